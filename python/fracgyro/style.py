"""How pictures look: the same on every machine, whatever its matplotlibrc says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl

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
