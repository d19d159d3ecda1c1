"""A user's own PDF of a paper: its hash and pages for an entry, and whether its pages have the entry's numbers.

The file is neither copied nor quoted.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fracgyro.extras import require
from fracgyro.scenario import ScenarioError

from .facts import Facts

PAGE = re.compile(r"\bpage (\d+)\b")
SIGNS = str.maketrans(
    {"\N{MINUS SIGN}": "-", "\N{EN DASH}": "-", "\N{MULTIPLICATION SIGN}": "x", "\N{DOT OPERATOR}": "x"}
)
NUMBER = re.compile(r"(\d+(?:\.\d+)?|\.\d+)(?:\s*(?:e|E|x\s*10\s*\^?)\s*([-+]?\s*\d+))?")
FOUND, NOT_FOUND, SCANNED, NO_PAGE = "found", "not found", "scanned", "no such page"


@dataclass(frozen=True)
class Document:
    """A PDF that was read: its SHA-256 and the text of each page, "" for a scanned one."""

    sha256: str
    pages: tuple[str, ...]


@dataclass(frozen=True)
class Looked:
    """A number or an equation of an entry, its page, and what was found there."""

    place: str
    printed: str
    page: int
    result: str


def opened(path: Path) -> Document:
    """Read a PDF. Raises ScenarioError if it is none, and MissingExtraError without the extra pdf."""
    require("pdf", "pypdf")
    from pypdf import PdfReader
    from pypdf.errors import PyPdfError

    try:
        data = path.read_bytes()
        pages = tuple(page.extract_text().strip() for page in PdfReader(path).pages)
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {error.strerror}") from None
    except (PyPdfError, ValueError, KeyError) as error:
        raise ScenarioError(f"{path} is not a PDF that can be read: {error}") from None
    return Document(hashlib.sha256(data).hexdigest(), pages)


def page_of(source: str) -> int | None:
    """The page that a source names, as in "page 7, table 2"."""
    found = PAGE.search(source)
    return int(found[1]) if found else None


def numbers_of(text: str) -> list[float]:
    """The sizes of all numbers in a text, with powers of ten as 1.8e-7, 1.8 x 10-7 and 1.8 x 10^-7."""
    return [
        float(f"{mantissa}e{exponent.replace(' ', '') or 0}") for mantissa, exponent in NUMBER.findall(_plain(text))
    ]


def _plain(text: str) -> str:
    return text.translate(SIGNS)


def looked_up(facts: Facts, document: Document) -> Iterator[Looked]:
    """Every number and equation of an entry whose source names a page, looked up in the text of that page.

    Signs and units are not compared.
    """
    for place, given in facts.every_given():
        values = given.value if isinstance(given.value, list) else [given.value]
        page = page_of(given.source)
        if page is not None:
            known = numbers_of(document.pages[page - 1]) if 1 <= page <= len(document.pages) else []
            has = all(any(math.isclose(abs(value), each, rel_tol=1e-9) for each in known) for value in values)
            yield Looked(place, ", ".join(f"{value:g}" for value in values), page, _result(document, page, has))
    for number, equation in enumerate(facts.equation):
        page = page_of(equation.source)
        if page is not None:
            text = _plain(document.pages[page - 1]) if 1 <= page <= len(document.pages) else ""
            has = equation.number in text
            yield Looked(f"equation[{number}].number", equation.number, page, _result(document, page, has))


def _result(document: Document, page: int, has: bool) -> str:
    if not 1 <= page <= len(document.pages):
        return NO_PAGE
    if not document.pages[page - 1]:
        return SCANNED
    return FOUND if has else NOT_FOUND
