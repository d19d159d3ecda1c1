"""docs/experiments.md: each example has at most five lines or is one command, prints its text and draws its picture."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import pytest
from nightly import nightly_unless

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "benchmarks"))

import experiments_page  # noqa: E402
from experiments_page import Example  # noqa: E402

EXAMPLES = list(experiments_page.examples(experiments_page.PAGE.read_text(encoding="utf-8")))
MAX_LINES = 5
NUMBER = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"
POINTS = 1.0  # a curve may differ by this many points of 1/72 inch

each = pytest.mark.parametrize("example", EXAMPLES, ids=[example.title for example in EXAMPLES])


def test_there_are_ten_experiments() -> None:
    assert len(EXAMPLES) == 10
    committed = {path.name for path in (ROOT / "docs/experiments").iterdir()}
    assert committed == {Path(example.picture).name for example in EXAMPLES if example.picture}


@each
def test_an_example_is_short(example: Example) -> None:
    """Imports and blank lines do not count."""
    lines = [line for line in example.code.splitlines() if line and not line.startswith("import ")]
    assert 1 <= len(lines) <= MAX_LINES


@pytest.mark.parametrize(
    "example",
    # Five commands, which take seven seconds, have tests of their own.
    nightly_unless(lambda example: "by name" not in example.title, EXAMPLES),
    ids=[example.title for example in EXAMPLES],
)
def test_an_example_prints_and_draws_as_on_the_page(example: Example) -> None:
    printed, drawn = experiments_page.run(example)
    if example.printed is not None:
        again = experiments_page.shown(printed, example.printed)
        assert re.sub(NUMBER, "0", again) == re.sub(NUMBER, "0", example.printed), "run benchmarks/experiments_page.py"
        numbers = [[float(number) for number in re.findall(NUMBER, text)] for text in (again, example.printed)]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-3, abs=1e-9)
    assert (drawn is None) == (example.picture is None)
    if example.picture and drawn:
        compare(drawn, ROOT / "docs" / example.picture)


def test_the_picture_of_references_is_drawn_again() -> None:
    compare(experiments_page.references(), experiments_page.REFERENCES)


def compare(drawn: str, path: Path) -> None:
    committed = path.read_text(encoding="utf-8")
    if f"Matplotlib v{matplotlib.__version__} " not in committed:
        pytest.skip(f"{path.name} was drawn by another Matplotlib than {matplotlib.__version__}")
    assert texts(drawn) == texts(committed), "run benchmarks/experiments_page.py"
    assert extents(drawn) == [pytest.approx(extent, abs=POINTS) for extent in extents(committed)]


def texts(picture: str) -> list[str]:
    return [
        "".join(found.itertext()).strip() for found in ElementTree.fromstring(picture).iter() if "text" in found.tag
    ]


def extents(picture: str) -> list[tuple[float, float, float, float]]:
    """Left, right, top and bottom of each curve: the number of its points depends on the last bits of its numbers."""
    found = []
    for path in ElementTree.fromstring(picture).iter("{http://www.w3.org/2000/svg}path"):
        numbers = [float(number) for number in re.findall(NUMBER, path.get("d", ""))]
        x, y = numbers[::2], numbers[1::2]
        found.append((min(x), max(x), min(y), max(y)))
    return found
