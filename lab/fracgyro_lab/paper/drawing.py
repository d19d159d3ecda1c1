"""Draws planned panels. figures.py decides their contents."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import numpy as np
from fracgyro.analysis.decimation import largest
from fracgyro.analysis.html import csv_text
from fracgyro.analysis.style import DPI, MM, WIDTH, own_style, save_svg
from fracgyro.files import whole_file
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Affine2D, Bbox, Transform, TransformedBbox
from numpy.typing import NDArray

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]  # left, top, width, height
View = Literal["whole", "early", "late", "envelope"]

HEADINGS = {"printed": "As printed", "corrected": "Corrected"}
COLUMNS_PER_MM = 5.0  # thinner than the lines
# mm: a figure's two blocks and their narrow panels
BLOCKS, BLOCK = (14.5, 98.0), 69.0
NARROW = 18.5

# Names of data columns.
VIEWS = {"whole": "whole run", "early": "start", "late": "whole run", "envelope": "largest magnitude"}
OTHERS = {"reference": ": reference", "truth": ": true value", "element": ": skew + symmetric"}

# Okabe and Ito's palette, which is safe for color-blind readers.
STYLES: dict[str, dict[str, Any]] = {
    "x": {"color": "#0072B2", "linewidth": 0.7},
    "y": {"color": "#D55E00", "linewidth": 0.7},
    "estimate": {"color": "#0072B2", "linewidth": 0.8},
    "element": {"color": "#E69F00", "linewidth": 0.6},
    "reference": {"color": "black", "linewidth": 0.7, "dashes": (3, 2)},
    "truth": {"color": "black", "linewidth": 0.9, "dashes": (4, 2.5)},
}


@dataclass(frozen=True)
class Row:
    """One of the paper's panels: a column of a run's variable, its symbol and the unit it is measured in."""

    variable: str
    column: int
    symbol: str
    unit: str
    style: str  # x and y for the axes
    words: str  # label, with its unit in brackets


@dataclass(frozen=True)
class Cell:
    """A place in each of the two blocks (mm from its left, the figure's top), and its view."""

    rows: tuple[Row, ...]
    view: View
    box: Box
    lowest: bool  # lowest panel on its time axis
    titled: bool = False
    inset: bool = False


def envelope(time: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """log10 of the largest magnitude in each of `columns` equal segments, at its middle."""
    middle, magnitude = largest(time, np.abs(values), columns)
    return middle, np.log10(np.maximum(magnitude, 1e-12))


@dataclass(frozen=True)
class Panel:
    """Contents of one pair of axes."""

    cell: Cell
    left: float  # mm
    span: tuple[float, float]
    limits: tuple[float, float]
    curves: dict[str, tuple[Array, Array]]  # time and values by style, from back to front
    label: str
    time_label: str
    title: str
    note: str


@dataclass(frozen=True)
class Plan:
    """A figure ready to be drawn, small enough to be sent to another process."""

    stem: str
    title: str
    height: float  # mm
    panels: list[Panel]
    legends: list[dict[str, str]]  # per block: text by style


def _ticks(low: float, high: float, count: int) -> tuple[list[float], list[str]]:
    """Round values within the limits, about `count` of them, and their texts with equally many decimals."""
    values = MaxNLocator(count, steps=(1, 2, 5, 10)).tick_values(low, high)
    inside = [round(float(value), 9) for value in values if low <= value <= high]
    decimals = max((len(np.format_float_positional(v, trim="-").partition(".")[2]) for v in inside), default=0)
    return inside, [f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") for value in inside]


def _powers(low: float, high: float, _: int) -> tuple[list[float], list[str]]:
    """The same for a logarithmic scale, whose limits are exponents."""
    superscript = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    inside = range(math.ceil(low), math.floor(high) + 1)
    return [float(power) for power in inside], [f"10{str(power).translate(superscript)}" for power in inside]


def _add_panel(figure: Figure, mm: Transform, panel: Panel) -> None:
    """By hand, as a pair of matplotlib's axes takes five times as long, most of it for the ticks."""
    cell = panel.cell
    left, (_, top, width, tall) = panel.left, cell.box
    start, stop = panel.span
    start -= 0.012 * (stop - start)  # keeps the first sample clear of the axis
    low, high = panel.limits
    frame = TransformedBbox(Bbox.from_bounds(left, -top - tall, width, tall), mm)

    def across(time: Array) -> Array:
        return left + (time - start) / (stop - start) * width

    def up(values: Array) -> Array:
        return -top - tall + (values - low) / (high - low) * tall

    for style, (time, values) in panel.curves.items():
        curve = figure.add_artist(Line2D(across(time), up(values), transform=mm, **STYLES[style]))
        curve.set_clip_box(frame)

    size, length = (6, 0.7) if cell.inset else (7, 0.9)
    times, time_texts = _ticks(*panel.span, 2 if width <= NARROW else 4)
    levels, level_texts = (_powers if cell.view == "envelope" else _ticks)(low, high, 3 if cell.inset else 5)
    bars = [([left, left, left + width], [-top, -top - tall, -top - tall])]
    for x, text in zip(across(np.array(times)), time_texts, strict=True):
        bars.append(([x, x], [-top - tall, -top - tall - length]))
        if cell.lowest:
            figure.text(x, -top - tall - length - 0.6, text, transform=mm, size=size, ha="center", va="top")
    for y, text in zip(up(np.array(levels)), level_texts, strict=True):
        bars.append(([left, left - length], [y, y]))
        figure.text(left - length - 0.6, y, text, transform=mm, size=size, ha="right", va="center_baseline")
    gap = [np.nan]
    xs, ys = (np.concatenate([np.append(bar[axis], gap) for bar in bars]) for axis in (0, 1))
    figure.add_artist(Line2D(xs, ys, transform=mm, color="black", linewidth=0.6, solid_capstyle="projecting"))

    figure.text(left, 1.0 - top, panel.title, transform=mm, size=7)
    figure.text(left + width, 1.0 - top, panel.note, transform=mm, size=7, ha="right")
    if not cell.inset:
        middle = -top - 0.5 * tall
        figure.text(left - 9.0, middle, panel.label, transform=mm, rotation=90, ha="right", va="center")
        if cell.lowest:
            figure.text(left + 0.5 * width, -top - tall - 4.6, panel.time_label, transform=mm, ha="center", va="top")


def numbers(plan: Plan) -> str:
    """The curves as they are drawn, as CSV. Each has its own times, as each segment keeps its own extremes."""
    columns: dict[str, Array] = {}
    for panel in plan.panels:
        cell, variant = panel.cell, list(HEADINGS.values())[panel.left >= BLOCKS[1]]
        for style, (time, values) in panel.curves.items():
            row = next((row for row in cell.rows if row.style == style), cell.rows[0])
            what = f"{row.words}{OTHERS.get(style, '')}, {variant.lower()}, {VIEWS[cell.view]}"
            columns[f"t (1/omega0) of {what}"] = time
            columns[what] = 10.0**values if cell.view == "envelope" else values
    return csv_text(columns, zip_longest(*columns.values()))


def render(plan: Plan, folder: Path) -> list[Path]:
    """Writes the plan as SVG, PNG and CSV into `folder`."""
    with own_style():
        figure = Figure(figsize=(WIDTH * MM, plan.height * MM))
        mm = Affine2D().translate(0.0, plan.height).scale(1.0 / WIDTH, 1.0 / plan.height) + figure.transFigure
        for panel in plan.panels:
            _add_panel(figure, mm, panel)
        line = 3.0 if max(map(len, plan.legends)) < 3 else 8.0
        for left, heading, legend in zip(BLOCKS, HEADINGS.values(), plan.legends, strict=True):
            figure.text(left, -3.0, heading, transform=mm, size=9, weight="bold", va="center")
            if legend:
                figure.legend(
                    [Line2D([], [], **STYLES[style]) for style in legend],
                    list(legend.values()),
                    loc="center right",
                    bbox_to_anchor=(left + BLOCK, -line),
                    bbox_transform=mm,
                    ncols=len(legend),
                    borderaxespad=0.0,
                    borderpad=0.0,
                    handlelength=1.8,
                    handletextpad=0.5,
                    columnspacing=1.1,
                )
        shown = dict.fromkeys(f"{panel.label} over {panel.time_label}" for panel in plan.panels if panel.label)
        plain = re.sub(r"\\,|[$\\]", "", "; ".join(shown))  # without the signs of formulas
        paths = [folder / f"{plan.stem}.{kind}" for kind in ("svg", "png", "csv")]
        save_svg(figure, paths[0], plan.title, plain)
        with whole_file(paths[1]) as scratch:
            figure.savefig(scratch, format="png", dpi=DPI, pil_kwargs={"compress_level": 4})
    with whole_file(paths[2]) as scratch:
        scratch.write_text(numbers(plan), encoding="utf-8", newline="\n")
    return paths
