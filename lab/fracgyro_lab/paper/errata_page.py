"""The errata as Markdown: docs/errata.md, and the table at the end of EQUATIONS.md.

`python -m fracgyro_lab.paper.errata_page` prints the page, and with `table` the table.
"""

from __future__ import annotations

import sys

from fracgyro.scenario.reference import escaped, rows_of

from .errata import ERRATA, Erratum

HEAD = f"""# Errata of the paper

The paper has {len(ERRATA)} errata known to us. Equation numbers are its own. The first three change what is computed:
they are the switches between the paper as printed and as corrected. Evidence is the reason itself, an identity that a
program checks, or runs, whose numbers are in the report of `fracgyro reproduce`. A field chooses the reading, or deals
with the erratum. Made by `python -m fracgyro_lab.paper.errata_page > docs/errata.md`.
"""
COLUMNS = ("where", "as printed", "correct", "reason", "evidence", "field")


def page() -> str:
    """The whole list, with what can be checked without a run."""
    return "\n".join([HEAD, *rows_of(COLUMNS, [_row(erratum) for erratum in ERRATA])])


def table() -> str:
    """The errata that a field of the scenario chooses or deals with."""
    rows = [(e.where, e.printed, e.correct, _fields(e)) for e in ERRATA if e.fields]
    return "\n".join(rows_of(("where", "as printed", "correct", "field"), [_escaped(*row) for row in rows]))


def _row(e: Erratum) -> tuple[str, ...]:
    evidence = ([e.identity()] if e.identity else []) + (["Runs."] if e.runs else [])
    return _escaped(e.where, e.printed, e.correct, e.why, " ".join(evidence) or "The reason.", _fields(e))


def _fields(erratum: Erratum) -> str:
    return ", ".join(f"`{field}`" for field in erratum.fields) or "–"


def _escaped(*cells: str) -> tuple[str, ...]:
    return tuple(escaped(cell) for cell in cells)


if __name__ == "__main__":
    text = table() if sys.argv[1:] == ["table"] else page()
    sys.stdout.buffer.write(text.encode())  # the same bytes on every system
