"""Update the numbers of README.md and docs/ from the committed logs, as `make pages`.

    python benchmarks/pages.py            rewrites
    python benchmarks/pages.py --check    lists differences; exits with 1 if there are any

A page marks a measured number with a comment directly after it, `4.1<!--run.ms-->`, and a table whose rows are measured
with a line before it, `<!-- table: bounds -->`. page_numbers.py lists their sources.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import page_numbers as numbers
from machine import COLUMNS, wrapped
from sources import ROOT

PAGES = (
    "README.md",
    "paper.md",
    *(f"docs/{name}.md" for name in ("compare", "firmware", "fpga", "paper", "performance")),
)
PAGES += ("docs/limit.md", "docs/rate_sensor.md", "docs/references.md", "docs/site/index.md", "docs/site/install.md")
PAGES += ("docs/zoo.md", "integrations/web/README.md")
NUMBER = re.compile(r"([^\s|()\[\]<>*]+)<!--([\w.]+)-->")
TABLE = re.compile(r"(<!-- table: ([\w.]+) -->\n\|.*\|\n\|[-|: ]+\|\n)((?:\|.*\|\n)*)")


def written(page: str) -> str:
    """The page with the numbers of the logs. Raises ValueError if it marks a number that page_numbers.py lacks."""
    text = (ROOT / page).read_text(encoding="utf-8")

    def number(found: re.Match[str]) -> str:
        return f"{_known(numbers.NUMBERS, found[2], page)}<!--{found[2]}-->"

    def table(found: re.Match[str]) -> str:
        rows = _known(numbers.TABLES, found[2], page)
        return found[1] + "".join(f"|{'|'.join(f' {each} ' if each else ' ' for each in row)}|\n" for row in rows)

    return filled(NUMBER.sub(number, TABLE.sub(table, text)))


def filled(text: str) -> str:
    """Rewrap paragraphs with a line that has become too long."""
    done: list[str] = []
    paragraph: list[str] = []
    fenced = False
    for line in [*text.split("\n"), ""]:
        outside = fenced or line.startswith(("|", "#", "<!--", "```")) or not line.strip()
        if outside or re.match(r"\s*([-*]|\d+\.) ", line):
            if len(paragraph) > 1 and max(map(len, paragraph)) > COLUMNS:
                paragraph = wrapped([" ".join([paragraph[0], *(each.strip() for each in paragraph[1:])])])
            done += paragraph
            paragraph = []
        fenced ^= line.startswith("```")
        (done if outside else paragraph).append(line)
    return "\n".join(done[:-1])


def _known(found: Mapping[str, Callable[[], Any]], name: str, page: str) -> Any:
    if name not in found:
        raise ValueError(f"{page} marks {name}: benchmarks/page_numbers.py has no number or table of this name")
    return found[name]()


def tables(page: str) -> Iterator[tuple[str, str, list[str]]]:
    """(name or "", heading row, body rows) of each table of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for found in re.finditer(r"(?:<!-- table: ([\w.]+) -->\n)?^(\|.*\|)\n\|[-|: ]+\|\n((?:\|.*\|\n?)*)", text, re.M):
        yield found[1] or "", found[2], found[3].splitlines()


def main() -> int:
    differ = 0
    for page in PAGES:
        path: Path = ROOT / page
        old, new = path.read_text(encoding="utf-8"), written(page)
        for before, after in zip(old.splitlines(), new.splitlines(), strict=False):
            if before != after:
                differ += 1
                print(f"{page}\n- {before}\n+ {after}")
        if "--check" not in sys.argv:
            path.write_text(new, encoding="utf-8")
    return int("--check" in sys.argv and differ > 0)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except ValueError as error:
        sys.exit(f"pages: {error}")
