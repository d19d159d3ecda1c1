"""The page of the board, a single static file, from a folder of entries."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fracgyro.analysis.html import page
from fracgyro.files import whole_file
from fracgyro.scenario import ScenarioError

from ..comparison.contender import Contender
from ..comparison.track import HIGH, LOW, Track
from . import trial
from .chart import chart, trace
from .entrant import KIND, contender, entrant
from .entry import Entry, read

CLASSES = {"F": "positions and velocities are measured", "P": "positions only"}
TRACES = 1e-6, 0.1  # range of all traces
SENSED = {"F": "positions and velocities", "P": "positions only"}


def write_page(folder: Path, out: Path, operations: Path | None = None) -> int:
    """Writes index.html into the folder `out`; returns the number of entries.

    `operations`: the log with the operations of a step of the compiled laws, benchmarks/results/flops.md. Raises
    ScenarioError for a file that is not an entry, or a folder without entries.
    """
    entries = {path.stem: read(path) for path in sorted(folder.glob("*.json"))}
    if not entries:
        raise ScenarioError(f"{folder} has no entries: they are JSON files of `fracgyro enter`")
    counted = counts(operations.read_text(encoding="utf-8")) if operations else {}
    rows = [_row(name, entry, folder, counted) for name, entry in entries.items()]
    rows.sort(key=lambda row: (row["error"] is None, not row["kept"], row["error"] or 0.0))
    tables = []
    for information, words in CLASSES.items():
        of = [(name, entry) for name, entry in entries.items() if entry.setting.information == information]
        if of:
            front = (Track().limit(trial.base(information), (LOW, HIGH)) or {})["front"]
            limit = [(chattering, error) for chattering, _, error in front if error]
            tables.append((information, words, chart(of, limit)))
    text = page(
        "fracgyro_lab.board",
        "board.html.jinja",
        filters={"number": number},
        rows=rows,
        charts=tables,
        changes=list(dict.fromkeys(name for entry in entries.values() for name in entry.robustness)),
        ceiling=trial.CEILING,
        trials=trial.TRIALS,
        judging=trial.JUDGING,
    )
    out.mkdir(parents=True, exist_ok=True)
    with whole_file(out / "index.html") as scratch:
        scratch.write_text(text, encoding="utf-8", newline="\n")
    return len(entries)


def _row(name: str, entry: Entry, folder: Path, counted: Mapping[tuple[str, ...], int]) -> dict[str, Any]:
    """Numbers of an entry for the table."""
    best, given = entry.best, entry.rows.as_given
    known = [change.value for change in entry.robustness.values()]
    values = [value for value in known if value is not None]
    lost = sum(bool(change.lost) for change in entry.robustness.values())
    worst = max(entry.robustness, key=lambda name: entry.robustness[name].value or float("inf"))
    return {
        "name": name,
        "entry": entry,
        "information": entry.setting.information,
        "python": ":" in entry.law,
        "error": best.error.value,
        "kept": best.kept,
        "over": best.over_limit.error if best.over_limit else None,
        "steady": best.over_limit.steady if best.over_limit else None,
        "chattering": best.chattering,
        "given": given.error.value if given else None,
        "lost": lost,
        "worst": None if lost else max(values, default=None),
        "worst_name": worst,
        "operations": _of_entry(entry, counted),
        "outdated": not _current(entry, folder),
        "trace": trace(entry.trace.error, *TRACES),
    }


def _current(entry: Entry, folder: Path) -> bool:
    """True if the law still has the hash of the entry."""
    file, colon, name = entry.law.partition(":")
    try:
        law = f"{folder / file}:{name}" if colon else file
        return entrant(law, entry.setting.information).sha256 == entry.sha256
    except ScenarioError:
        return False


def counts(log: str) -> dict[tuple[str, ...], int]:
    """Operations of a step by kind, adaptation and measurements, from the text of flops.md.

    Those of the laws of the zoo by name, "zoo" and measurements.
    """
    found = re.findall(r"^\| `(\w+)` \| (\S+) \| ([a-z ]+) \|.*\*\*(\d+)\*\*", log, re.MULTILINE)
    return {(kind, adaptation, measured): int(count) for kind, adaptation, measured, count in found}


def _of_entry(entry: Entry, counted: Mapping[tuple[str, ...], int]) -> int | None:
    law = contender(entry.law)
    return operations_of(law, entry.setting.information, counted) if law else None


def operations_of(law: Contender, information: str, counted: Mapping[tuple[str, ...], int]) -> int | None:
    """Operations of a step of a law of the comparison without a filter; None if they are not counted."""
    if law.fixed.get("controller.filter"):
        return None
    sensed = SENSED[information]
    place = (str(law.fixed[KIND]), str(law.fixed.get("adaptation.kind", "–")), sensed)
    return counted.get((law.name, "zoo", sensed), counted.get(place))


def number(value: float | None, digits: int = 3) -> str:
    """With three digits; a dash for None."""
    return "–" if value is None else f"{value:.{digits}g}"
