"""How pictures look: the same on every machine, whatever its matplotlibrc says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl

WIDTH = 170.0  # of a picture, mm
MM = 1 / 25.4  # in inches, which Matplotlib counts in
DPI = 200
COLORS = ("#0072B2", "#D55E00")  # of x and y, from Okabe and Ito's palette, which is safe for color-blind readers

PAGE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
    "font.size": 8,
    "mathtext.fontset": "dejavusans",
    "legend.fontsize": 7,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "fracgyro",
}


@contextmanager
def own_style(changes: Mapping[Any, Any] = PAGE) -> Iterator[None]:
    """Matplotlib's own settings with these changes, until the block ends."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(changes)
        yield
