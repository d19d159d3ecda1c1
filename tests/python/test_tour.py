"""The tour, entered line by line in an empty folder, prints the output on its pages; so do other pages with output."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest
from children import PATIENCE

SITE = Path(__file__).resolve().parents[2] / "docs" / "site"
TOUR = sorted(SITE.glob("tour/[0-9]*.md"))
PAGES = [SITE / "index.md", SITE / "cite.md", *TOUR]


def blocks(path: Path) -> Iterator[tuple[str, str]]:
    """Language and content of each fenced block, in order."""
    return iter(re.findall(r"^```(python|sh|text)\n(.*?)^```$", path.read_text("utf-8"), re.DOTALL | re.MULTILINE))


def typed(lines: str) -> str:
    """Output of a shell."""
    ran = subprocess.run(
        ["bash", "-e", "-c", lines],
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_a_page_prints_what_it_says(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "tour"}
    printed = ""
    for language, content in blocks(path):
        if language == "text":
            assert printed == content
        elif language == "python":
            with redirect_stdout(StringIO()) as said:
                exec(compile(content, path.name, "exec"), names)
            printed = said.getvalue()
        elif path in TOUR:  # elsewhere the shell installs something
            printed = typed(content)
    plt.close("all")


def test_the_tour_has_seven_pages() -> None:
    assert len(TOUR) == 7
