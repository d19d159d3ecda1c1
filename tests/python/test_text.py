"""Documents, checked by `make lint` without the package: links resolve, identifiers exist, lines fit."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]
GENERATED = {"build", "out", "node_modules"}
DOCUMENTS = sorted(
    path
    for path in ROOT.rglob("*.md")
    if not any(part.startswith(".") or part in GENERATED for part in path.relative_to(ROOT).parts)
)


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


# -- Identifiers of EQUATIONS.md -----------------------------------------------------------------------------


def cited() -> list[tuple[str, str]]:
    text = (ROOT / "EQUATIONS.md").read_text(encoding="utf-8")
    return sorted(set(re.findall(r"`([\w./]+\.(?:hpp|cpp|py))::(\w+)`", text)))


@pytest.mark.parametrize(("file", "identifier"), cited())
def test_every_identifier_of_the_equations_exists_in_its_file(file: str, identifier: str) -> None:
    found = [path for folder in ("include", "python", "lab", "fpga") for path in (ROOT / folder).rglob(file)]
    assert len(found) == 1, f"{file} must name one file"
    comment = "#" if found[0].suffix == ".py" else "//"
    code = re.sub(rf"{comment}.*", "", found[0].read_text(encoding="utf-8"))
    assert re.search(rf"\b{identifier}\b", code)


# -- Links ---------------------------------------------------------------------------------------------------


def unfenced(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(path: Path) -> set[str]:
    """Anchors that GitHub derives from the headings."""
    headings = re.findall(r"^#+ (.*)$", unfenced(path.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", DOCUMENTS, ids=relative)
def test_every_relative_link_resolves(path: Path) -> None:
    text = re.sub(r"`[^`\n]*`", "", unfenced(path.read_text(encoding="utf-8")))
    links = re.findall(r"\]\(\s*<?([^)\s>]+)", text) + re.findall(r"^\[[^\]]+\]:\s*(\S+)", text, re.MULTILINE)
    links += re.findall(r"(?:src|href)=\"([^\"]+)\"", text)
    for link in links:
        if re.match(r"[a-z]+:", link):
            continue
        target, _, anchor = unquote(link).partition("#")
        found = path.parent / target if target else path
        assert found.exists(), link
        if anchor and found.suffix == ".md":
            assert anchor in anchors(found), link


# -- Width ---------------------------------------------------------------------------------------------------

TEXT = {
    ".md",
    ".py",
    ".cpp",
    ".hpp",
    ".c",
    ".h",
    ".mjs",
    ".ts",
    ".css",
    ".html",
    ".toml",
    ".txt",
    ".sh",
    ".cff",
    ".m",
    "",
}
WIDE = ("tests/fuzz/corpus", "tests/firmware/corpus.jsonl")  # data
# Mutants are named by their lines of code.
WIDE += ("benchmarks/results/mutants.md", "tests/mutants/survivors.toml")
COLUMNS = 120


def texts() -> Iterator[Path]:
    for path in sorted(ROOT.rglob("*")):
        parts = path.relative_to(ROOT).parts
        skipped = relative(path).startswith(WIDE) or any(part.startswith(".") or part in GENERATED for part in parts)
        if path.suffix in TEXT and path.is_file() and not skipped:
            yield path


def test_no_line_is_wider_than_120_columns() -> None:
    """Except what cannot be broken: a row of a table in Markdown, and one word, as a link or a hash."""
    wide = [
        f"{relative(path)}:{number} has {columns} columns"
        for path in texts()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if (columns := sum(not unicodedata.combining(letter) for letter in line)) > COLUMNS
        and not (path.suffix == ".md" and line.lstrip().startswith("|"))
        and len(line.split()) > 1
    ]
    assert not wide, "\n".join(wide)
