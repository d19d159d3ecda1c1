"""Draws docs/compare.svg: error over chattering of the controllers compared, and the limit of any controller."""

from __future__ import annotations

import sys
from pathlib import Path

from fracgyro.analysis.style import PAGE, own_style, save_svg
from machine import RESULTS

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "compare.svg"


def draw(path: Path) -> None:
    sys.path.append(str(ROOT / "lab" / "article"))
    import comparison
    import figures

    track = comparison.load(RESULTS, "track")
    with own_style(PAGE):
        save_svg(figures.fronts(track["contenders"]), path, "What an error costs in chattering, and the limit")


if __name__ == "__main__":
    draw(PICTURE)
