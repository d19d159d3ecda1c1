"""Style of plots, the same on every machine regardless of its matplotlibrc."""

from __future__ import annotations

import html
import io
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..files import whole_file
from .compact_svg import compact

WIDTH = 170.0  # width of a picture, mm
MM = 1 / 25.4  # in inches, which Matplotlib counts in
DPI = 200
COLORS = ("#0072B2", "#D55E00")  # x and y, from Okabe and Ito's palette for color-blind readers

# DejaVu Sans is part of Matplotlib, so the layout is the same on every machine. Letters remain text, for search,
# copying and screen readers; Verdana has the same width, for browsers without DejaVu Sans.
LETTERS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana"],
    "svg.fonttype": "none",
    "svg.hashsalt": "fracgyro",
}
FAMILY = "font-family: 'DejaVu Sans', 'Verdana', sans-serif"
PAGE: dict[Any, Any] = {
    **LETTERS,
    "font.size": 8,
    "mathtext.fontset": "dejavusans",
    "legend.fontsize": 7,
    "legend.frameon": False,
}


@contextmanager
def own_style(changes: Mapping[Any, Any] = PAGE) -> Iterator[None]:
    """Matplotlib's own settings with these changes, until the block ends."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(changes)
        yield


def svg(figure: Figure, title: str, description: str | None = None) -> str:
    """The figure as compact SVG with title and description for screen readers; the default description names axes."""
    written = io.StringIO()
    figure.savefig(written, format="svg", metadata={"Date": None, "Title": title})
    words = "; ".join(filter(None, map(_axes, figure.axes))) if description is None else description
    described = f"</title>\n <desc>{html.escape(words, quote=False)}</desc>"
    # Matplotlib writes only the first font for letters of formulas.
    text = re.sub(r"font-family: 'DejaVu Sans'(?!,)", FAMILY, written.getvalue())
    return compact(text.replace("</title>", described, 1) if words else text)


def save_svg(figure: Figure, path: str | os.PathLike[str], title: str, description: str | None = None) -> None:
    """Writes `svg` to the file; raises ValueError where it cannot be written."""
    with whole_file(path) as scratch:
        scratch.write_text(svg(figure, title, description), encoding="utf-8", newline="\n")


def one_panel(height: float) -> tuple[Figure, Axes]:
    """A figure of the width of a page with one panel; `height`: mm."""
    figure = Figure(figsize=(WIDTH * MM, height * MM), layout="constrained")
    panel = figure.add_subplot()
    plain(panel)
    return figure, panel


def plain(panel: Axes) -> None:
    """Removes the frame on top and right, and adds a grid."""
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(True, linewidth=0.3)


def legend_outside(panel: Axes) -> None:
    """Adds a legend to the right of the panel."""
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _axes(panel: Axes) -> str:
    """Description of a panel: its axis labels and the names of its curves."""
    over = " over ".join(filter(None, (panel.get_ylabel(), panel.get_xlabel())))
    names = ", ".join(filter(None, panel.get_legend_handles_labels()[1]))
    words = ": ".join(filter(None, (panel.get_title(), over, names))) if panel.get_visible() else ""
    return " ".join(words.split())
