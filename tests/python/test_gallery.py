"""The scripts of the gallery run as they stand, are short, draw something and take seconds."""

from __future__ import annotations

import ast
import re
import runpy
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from nightly import nightly_unless

GALLERY = Path(__file__).resolve().parents[2] / "docs" / "gallery"
SCRIPTS = sorted(GALLERY.glob("plot_*.py"))
MAX_LINES = 20


def test_there_is_a_gallery() -> None:
    assert len(SCRIPTS) >= 13


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_a_title_and_is_short(path: Path) -> None:
    """Imports, blank lines and comments do not count."""
    text = path.read_text(encoding="utf-8")
    assert re.match(r"\n.+\n=+\n\n\S", ast.get_docstring(ast.parse(text), clean=False) or "")
    code = text.split('"""', 2)[2].splitlines()
    assert sum(re.match(r"(import|from|#) ?|$", line.strip()) is None for line in code) <= MAX_LINES


# The slow ones call a datasheet, a tuning and an FMU, which have tests of their own.
SLOW = ("plot_07_datasheet", "plot_11_tune", "plot_12_fmu")


@pytest.mark.parametrize(
    "path", nightly_unless(lambda path: path.stem not in SLOW, SCRIPTS), ids=lambda path: path.stem
)
def test_a_script_runs_and_draws(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    runpy.run_path(str(path))
    drawn = [plt.figure(number).axes for number in plt.get_fignums()]
    plt.close("all")
    assert drawn
    assert all(drawn)
