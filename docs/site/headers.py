"""The C interface as a page: each declaration of a header below its comment."""

from __future__ import annotations

import re
from pathlib import Path

DECLARATION = re.compile(
    r"(?:/\*(?P<words>(?:(?!\*/).)*)\*/\n)?"
    r"(?P<code>(?:typedef (?:enum|struct) \{.*?\n\}[^;]*;)|(?:^(?:void|fracgyro_status) \w+\([^;]*;))",
    re.DOTALL | re.MULTILINE,
)


def c_reference(header: Path, coefficients: str) -> str:
    """Markdown. `coefficients`: the header of an exported scenario."""
    text = header.read_text(encoding="utf-8")
    lines = ["# C", "", _sentences(text[2 : text.index("*/")].partition("\n *\n")[0]), ""]
    lines += ["```c", *(line.strip() for line in _example(text)), "```", ""]
    lines += [_sentences(text[2 : text.index("*/")].rpartition("\n *\n")[2]), ""]
    for found in DECLARATION.finditer(text):
        name = re.search(r"(?:\}.*?(\w+);|(\w+)\()", found["code"], re.DOTALL)
        assert name is not None
        lines += [f"## {name[1] or name[2]}", "", *([_sentences(found["words"]), ""] if found["words"] else [])]
        lines += ["```c", found["code"], "```", ""]
    shown = coefficients[: coefficients.index("\n/* Stiffness of the")]
    lines += ["## fracgyro_coefficients.h", "", "Made for each scenario. For the shipped `hardware` it begins:", ""]
    return "\n".join([*lines, "```c", shown.rstrip(), "```", ""])


def _example(text: str) -> list[str]:
    return re.findall(r"^ \*     (.*)$", text[: text.index("*/")], re.MULTILINE)


def _sentences(comment: str) -> str:
    return " ".join(re.sub(r"^ \* ?", "", comment, flags=re.MULTILINE).split())
