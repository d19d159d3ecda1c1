"""Numbers of the committed logs: the tables of benchmarks/results/*.md, as they are printed there."""

from __future__ import annotations

import re
from pathlib import Path

RESULTS = Path(__file__).resolve().parents[1] / "benchmarks" / "results"
Row = dict[str, str]


def rows(log: str, *headings: str) -> list[Row]:
    """Of all tables of a log that have these headings. Raises ValueError where there is none."""
    path = RESULTS / f"{log}.md"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ValueError(f"benchmarks/results/{path.name} is missing: `make bench` writes it") from None
    found = []
    for table in re.findall(r"(?:^\|.*\|$\n?)+", text, re.MULTILINE):
        heads, _, *lines = (_cells(line) for line in table.splitlines())
        if set(headings) <= set(heads):
            found += [dict(zip(heads, line, strict=True)) for line in lines]
    if not found:
        raise ValueError(f"benchmarks/results/{path.name} has no table with {', '.join(headings)}")
    return found


def row(log: str, **cells: str) -> Row:
    """The one row that has these cells; a heading that is not an identifier is given by `row(log, **{...})`."""
    found = [each for each in rows(log, *cells) if cells.items() <= each.items()]
    if len(found) != 1:
        raise ValueError(f"benchmarks/results/{log}.md has {len(found)} rows with {cells}: one is needed")
    return found[0]


def number(cell: str) -> float:
    """The first of a cell."""
    found = re.search(r"[-−+]?\d[\d,]*(\.\d+)?(e[-+]?\d+)?", cell)
    if found is None:
        raise ValueError(f"a log has {cell!r} where a number is needed")
    return float(found[0].replace("−", "-").replace(",", ""))


def _cells(line: str) -> list[str]:
    return [cell.strip().replace("**", "").replace("&#124;", "|") for cell in line.strip("|").split("|")]
