"""Numbers of the committed logs: the tables of benchmarks/results/*.md and others, as printed there."""

from __future__ import annotations

import re

from sources import ROOT, log_of

RESULTS = ROOT / "benchmarks" / "results"
SECTION = "section"  # key of the heading above a table
Row = dict[str, str]


def text(log: str) -> str:
    """The whole log, in one line for each paragraph or row. Raises ValueError if it is missing."""
    path = ROOT / log_of(log)
    try:
        return re.sub(r"(?<=[^\n|])\n(?=[^\n|#])", " ", path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path.relative_to(ROOT)} is missing: `make bench` writes it") from None


def rows(log: str, *headings: str) -> list[Row]:
    """Rows of all tables of a log that have these headings. Raises ValueError if there are none."""
    found, section = [], ""
    for part in re.findall(r"^#+ .*$|(?:^\|.*\|$\n?)+", text(log), re.MULTILINE):
        if part.startswith("#"):
            section = part.lstrip("# ")
            continue
        heads, _, *lines = (_cells(line) for line in part.splitlines())
        if set(headings) <= {*heads, SECTION}:
            found += [{SECTION: section, **dict(zip(heads, line, strict=True))} for line in lines]
    if not found:
        raise ValueError(f"{log_of(log)} has no table with {', '.join(headings)}")
    return found


def row(log: str, **cells: str) -> Row:
    """The one row that has these cells; a heading that is not an identifier is given by `row(log, **{...})`."""
    found = [each for each in rows(log, *cells) if cells.items() <= each.items()]
    if len(found) != 1:
        raise ValueError(f"{log_of(log)} has {len(found)} rows with {cells}: one is needed")
    return found[0]


def said(log: str, pattern: str) -> str:
    """First group of a pattern in the text of a log. Raises ValueError if the log does not have it exactly once."""
    found: list[str] = re.findall(pattern, text(log))
    if len(found) != 1:
        raise ValueError(f"{log_of(log)} has {pattern!r} {len(found)} times: once is needed")
    return found[0]


def number(cell: str) -> float:
    """The first of a cell."""
    found = re.search(r"[-−+]?\d[\d,]*(\.\d+)?(e[-+]?\d+)?", cell)
    if found is None:
        raise ValueError(f"a log has {cell!r} where a number is needed")
    return float(found[0].replace("−", "-").replace(",", ""))


def numbers(cell: str) -> list[float]:
    """All numbers of a cell."""
    found = re.finditer(r"(?<![\w.])[-−+]?\d[\d,]*(\.\d+)?(e[-+]?\d+)?", cell)
    return [number(each[0]) for each in found]


def _cells(line: str) -> list[str]:
    return [cell.strip().replace("**", "").replace("&#124;", "|") for cell in line.strip("|").split("|")]
