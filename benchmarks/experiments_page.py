"""Run the examples of docs/experiments.md, and write their printed results and pictures; draw docs/references.svg.

A test runs the same examples and compares. An example is a section: its code, then the printed text, cut after the
given lines if it ends with "...", then a picture: the last figure, or the SVG file that the command wrote.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import fracgyro as fg
import matplotlib.pyplot as plt
from click.testing import CliRunner
from fracgyro.analysis.style import LETTERS, own_style, svg
from fracgyro.cli import cli

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/experiments.md"
# The picture of docs/references.md is that of a script of the gallery.
REFERENCES = ROOT / "docs/references.svg"
SCRIPT = ROOT / "docs/gallery/plot_14_references.py"
CUT = "..."
COLUMNS = "110"  # width of printed tables
STYLE = {**LETTERS, "figure.constrained_layout.use": True}


@dataclass(frozen=True)
class Example:
    title: str
    language: str  # python or sh
    code: str
    printed: str | None
    picture: str | None  # path from docs/
    words: str  # text of the picture


def examples(text: str) -> Iterator[Example]:
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        (language, code), *_ = re.findall(r"^```(python|sh)\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)
        printed = re.search(r"^```text\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)
        words, picture = (*re.findall(r"^!\[(.*?)\]\((.*?)\)$", section, re.MULTILINE), (None, None))[0]
        yield Example(section.split("\n")[0], language, code, printed and printed[1], picture, words or "")


def run(example: Example) -> tuple[str, str | None]:
    """The printed text of the example, and its picture as SVG."""
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.symlink(ROOT / "examples", Path(folder) / "examples", target_is_directory=True)
        os.chdir(folder)
        try:
            printed = _python(example.code) if example.language == "python" else _commands(example.code)
            drawn = _picture(example.words)
        finally:
            os.chdir(home)
            plt.close("all")
    return printed, drawn


def references() -> str:
    """The picture of docs/references.md, as SVG."""
    plt.switch_backend("agg")
    with own_style(STYLE):
        exec(compile(SCRIPT.read_text(encoding="utf-8"), SCRIPT.name, "exec"), {"__name__": "example"})
    drawn = _picture("References of every kind")
    plt.close("all")
    assert drawn is not None
    return drawn


def _python(code: str) -> str:
    plt.switch_backend("agg")
    out = io.StringIO()
    with own_style(STYLE), contextlib.redirect_stdout(out):
        exec(compile(code, "example", "exec"), {"fg": fg, "__name__": "example"})
    return out.getvalue()


def _commands(code: str) -> str:
    found = ""
    for line in code.splitlines():
        ran = CliRunner(env={"COLUMNS": COLUMNS}).invoke(cli, shlex.split(line)[1:])
        different = line.startswith("fracgyro diff ") and ran.exit_code == 1
        if ran.exit_code and not different:
            raise RuntimeError(f"{line}: {ran.output}{ran.exception}")
        found += ran.stdout
    return found


def _picture(title: str) -> str | None:
    if plt.get_fignums():
        with own_style(STYLE):
            return svg(plt.gcf(), title)
    return next((path.read_text(encoding="utf-8") for path in Path().glob("*.svg")), None)


def shown(printed: str, committed: str) -> str:
    """The printed text as on the page: without spaces at line ends, and cut as the committed text."""
    lines = [line.rstrip() for line in printed.strip("\n").splitlines()]
    if committed.rstrip().endswith(CUT):
        lines = [*lines[: max(committed.count("\n") - 1, 6)], CUT]
    return "\n".join(lines) + "\n"


def main() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for example in examples(text):
        printed, drawn = run(example)
        if example.printed is not None:
            before = f"```{example.language}\n{example.code}```\n\n```text\n"
            text = text.replace(before + example.printed, before + shown(printed, example.printed))
        if example.picture and drawn:
            (PAGE.parent / example.picture).write_text(drawn, encoding="utf-8", newline="\n")
        print(example.title, file=sys.stderr)
    PAGE.write_text(text, encoding="utf-8")
    REFERENCES.write_text(references(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
