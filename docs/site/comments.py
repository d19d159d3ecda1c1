"""The comment of a controller in C++, in the form that CONTRIBUTING.md describes, as Markdown."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import groupby, takewhile
from pathlib import Path

from formulas import block
from fracgyro.export.compilers import SOURCES

ROOT = Path(__file__).resolve().parents[2]
REPOSITORY = "https://github.com/fracgyro/fracgyro"
HEADERS = SOURCES / "include/fracgyro"
INDENT = 8  # spaces before a line of equations
MAX_WORDS = 40  # length of a controller's summary


@dataclass
class Comment:
    """The comment of a controller, in Markdown."""

    name: str  # the law's, in full
    what: str
    use: str = ""
    source: str = ""
    law: list[str] = field(default_factory=list)  # paragraphs and formulas


def comment_of(kind: str) -> tuple[Comment, Path]:
    """The comment of a kind, and its header. Raises ValueError in one sentence if it is not as CONTRIBUTING.md has it.

    Where a header has several controllers, each type has a comment of its own, and the head of the header is for all.
    """
    registry = _text(_declaring("Registry"))
    ((family, named),) = re.findall(rf'Entry<"{kind}", (\w+)<(\w+)>', registry)
    (controller,) = re.findall(rf"struct {family} \{{.*?List<(\w+)<T", registry, re.DOTALL)
    header = _declaring(named if controller == "Of" else controller)
    head = _paragraphs("".join(takewhile(lambda line: line.startswith("//"), _text(header).splitlines(True))))
    own = _paragraphs(_comment_above(named))
    try:
        return parsed([*own, *head[1:]] if any(each.startswith("Use it when ") for each in own) else head), header
    except ValueError as error:
        raise ValueError(f"{header.name}: the comment of {named}, whose kind is {kind}, {error}") from None


def parsed(paragraphs: list[str]) -> Comment:
    """The comment that these are. Raises ValueError: the end of a sentence about a comment."""
    name, colon, what = paragraphs[0].partition(": ") if paragraphs else ("", "", "")
    found = Comment(name, what[:1].upper() + what[1:])
    for paragraph in paragraphs[1:]:
        if paragraph.startswith("Use it when "):
            found.use = paragraph
        elif paragraph.startswith("Source: "):
            found.source = found.source or paragraph
        else:
            found.law.append(paragraph)
    if not colon or not what.endswith("."):
        raise ValueError("must begin with its name, a colon and one sentence: what it is")
    if not found.use:
        raise ValueError("has no paragraph that begins with Use it when")
    if not found.source:
        raise ValueError("has no paragraph that begins with Source:")
    if not any(each.startswith("```math") for each in found.law):
        raise ValueError(f"has no equation, which is a line indented by {INDENT} spaces")
    words = len(f"{found.what} {found.use}".split())
    if words > MAX_WORDS:
        raise ValueError(f"needs {words} words for what it is and when to use it: at most {MAX_WORDS}")
    return found


def _paragraphs(comment: str) -> list[str]:
    """A comment of C++ as paragraphs of Markdown: indented lines are equations."""
    lines = [line.removeprefix("//") for line in comment.splitlines()]
    found = []
    for kind, group in groupby(lines, lambda line: "" if not line.strip() else "=" if line[:INDENT].isspace() else "w"):
        if kind == "=":
            found.append(block(list(group)))
        elif kind == "w":
            found.append(_markdown(" ".join(line.strip() for line in group)))
    return found


def _markdown(text: str) -> str:
    parts = re.split(r"(`[^`]*`)", text)
    for i, part in enumerate(parts):
        if i % 2 == 0:
            part = re.sub(r"([*<\\])", r"\\\1", part)
            part = re.sub(r"\b(\w+)\.hpp\b", lambda found: f"[`{found[0]}`]({address(_header(found[0]))})", part)
            part = re.sub(r"\bdocs/decisions/(\d{4})\b", _decision, part)
            parts[i] = re.sub(r"\bdoi (10\.[^\s,;]*[^\s,;.])", _doi, part)
    return "".join(parts)


def _doi(found: re.Match[str]) -> str:
    doi, after = found[1], ""
    if doi.count(")") > doi.count("("):
        doi, after = doi[:-1], ")"
    return f"[doi {doi}](<https://doi.org/{doi}>){after}"


def _decision(found: re.Match[str]) -> str:
    (path,) = (ROOT / "docs/decisions").glob(f"{found[1]}-*.md")
    return f"[decision {found[1]}](../decisions/{path.name})"


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _header(name: str) -> Path:
    (found,) = HEADERS.rglob(name)
    return found


def address(header: Path) -> str:
    """Its page in the repository."""
    return f"{REPOSITORY}/blob/main/include/fracgyro/{header.relative_to(HEADERS).as_posix()}"


def _declaring(name: str) -> Path:
    declared = re.compile(rf"^(?:struct|class|using) {name}\b(?!;)", re.MULTILINE)
    (found,) = (path for path in HEADERS.rglob("*.hpp") if declared.search(_text(path)))
    return found


def _comment_above(name: str) -> str:
    above = rf"((?:^//.*\n)+)(?:template <.*\n)?(?:struct|class|using) {name}\b(?!;)"
    found = re.search(above, _text(_declaring(name)), re.MULTILINE)
    return found[1] if found else ""
