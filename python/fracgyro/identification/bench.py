"""A bench day as TOML: the records with the states of the device, and the known numbers of it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..arguments import short
from ..scenario.amounts import amount
from ..scenario.messages import did_you_mean
from ..scenario.toml import read_tables, read_text
from .records import Decay, Sweep

KNOWN = {"mass": "kg", "pickoff": "m", "pickoff_ratio": "1", "assume": ""}
STATES = {"rate": "rad/s", "temperature": "K"}


def read_bench(path: str | os.PathLike[str]) -> tuple[list[Decay | Sweep], dict[str, Any]]:
    """The records of a bench file, and the numbers of its table [known] as arguments of `fg.identify`.

    Raises ScenarioError or ValueError, in one sentence, for a file that is not one.
    """
    tables = read_tables(read_text(path), str(path))
    for key in tables:
        if key not in ("record", "known"):
            raise ValueError(f"{path}: {key} is not a table of a bench: it must have [[record]] and [known]")
    entries = tables.get("record")
    if not isinstance(entries, list) or not entries or not all(isinstance(each, dict) for each in entries):
        raise ValueError(f"{path} has no [[record]]: it must have one for each file")
    folder = Path(path).parent
    records = [_record(each, i + 1, folder, str(path)) for i, each in enumerate(entries)]
    known = tables.get("known", {})
    if not isinstance(known, dict):
        raise ValueError(f"{path}: known is {short(known)}: it must be a table")
    return records, _known(known, str(path))


def _record(entry: Mapping[str, Any], place: int, folder: Path, path: str) -> Decay | Sweep:
    settings = dict(entry)
    where = f"{path}: record {place}"
    file, kind = settings.pop("file", None), settings.pop("kind", "decay")
    if not isinstance(file, str):
        raise ValueError(f"{where}: file is {short(file)}: it must be the name of a file")
    if kind not in ("decay", "forced", "sweep"):
        raise ValueError(f"{where}: kind is {short(kind)}: it must be decay, forced or sweep")
    made = Sweep if kind == "sweep" else Decay
    allowed = [each.name for each in fields(made) if each.name != "path"]
    for key in settings:
        if key not in allowed:
            hint = did_you_mean(key, allowed) or f"; known are {', '.join(allowed)}"
            raise ValueError(f"{where}: {key} is not a setting{hint}")
    for key, unit in STATES.items():
        if key in settings:
            settings[key] = amount(f"{where}: {key}", settings[key], unit)
    if not isinstance(settings.get("columns", {}), dict):
        raise ValueError(f"{where}: columns is {short(settings['columns'])}: it must be a table of names")
    return made(folder / file, **settings)


def _known(known: Mapping[str, Any], path: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in known.items():
        if key not in KNOWN:
            hint = did_you_mean(key, KNOWN) or f"; known are {', '.join(KNOWN)}"
            raise ValueError(f"{path}: {key} of [known] is not a number of the device{hint}")
        if key == "assume":
            found[key] = {name: tuple(each) if isinstance(each, list) else each for name, each in dict(value).items()}
        elif key == "pickoff_ratio":
            found[key] = tuple(value) if isinstance(value, list) else value
        else:
            found[key] = amount(f"{path}: {key}", value, KNOWN[key])
    return found
