"""The numbers behind the figures of a report, as downloaded through their links."""

from __future__ import annotations

import csv
import html
import io
import re
from pathlib import Path
from urllib.parse import unquote

LINK = re.compile(r'<a class="data" download="([^"]+)\.csv" href="data:text/csv;charset=utf-8,([^"]+)">')
Rows = list[dict[str, str]]


def figure_data(page: Path) -> dict[str, Rows]:
    """By name of the file. Every figure of the page has its link."""
    figures = re.findall(r"<figure.*?</figure>", page.read_text(encoding="utf-8"), re.DOTALL)
    assert figures
    links = []
    for figure in figures:
        (link,) = LINK.findall(figure)
        links.append(link)
    return {name: read(unquote(html.unescape(source))) for name, source in links}


def read(text: str) -> Rows:
    return list(csv.DictReader(io.StringIO(text, newline="")))


def column(rows: Rows, name: str) -> list[float]:
    """Its numbers, up to the first blank."""
    values = [row[name] for row in rows]
    return [float(value) for value in values[: values.index("") if "" in values else None]]
