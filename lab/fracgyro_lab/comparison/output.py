"""compare.json, and the gains as scenarios that `fracgyro simulate` runs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fracgyro.files import one_line, whole_file, writable_folder
from fracgyro.scenario.table import toml_value

from .judging import Judging


def write_json(path: Path, head: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> None:
    with whole_file(path) as scratch:
        text = json.dumps({**head, "contenders": rows}, indent=1, allow_nan=False)
        scratch.write_text(text, encoding="utf-8")


def write_gains(folder: Path, judgings: Mapping[str, Judging], rows: Mapping[str, Mapping[str, Any]]) -> None:
    """Writes one scenario per contender of the package and cell; compare.json has the gains of a user's controller."""
    writable_folder(folder)
    for name, piece in judgings.items():
        if piece.contender.own is None:
            first, rest = piece.scenario().to_toml().split("\n", 1)
            said = "\n".join(f"# {one_line(line)}".rstrip() for line in _said(piece, rows[name]))
            with whole_file(folder / f"{name}.toml") as scratch:
                scratch.write_text(f"{first}\n#\n{said}\n#\n{rest}", encoding="utf-8", newline="\n")


def _said(piece: Judging, row: Mapping[str, Any]) -> list[str]:
    cell = piece.cell
    tuned = "" if row["tuned"] or not row["trials"] else ", untuned"
    sensing = "positions and velocities" if cell.information == "F" else "positions only"
    ceiling = f", chattering at most {cell.ceiling:g}" if cell.ceiling else ""
    return [
        f"{piece.contender.words}{tuned}: by fracgyro {version('fracgyro')}, `fracgyro compare {piece.task.name}`.",
        f"{sensing}, noise {cell.noise:g} m/sqrt(Hz){ceiling}; {row['trials']} trials.",
        *(f"  {field} = {toml_value(value)}" for field, value in row["gains"].items()),
    ]
