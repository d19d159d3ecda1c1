"""Table 1: RMSE of x and y by order, for both variants, over many seeds."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fracgyro.analysis.confidence import mean_interval
from fracgyro.analysis.style import COLORS, LETTERS, own_style, save_svg
from fracgyro.files import whole_file
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from .runs import ORDERS, VARIANTS, Study

WINDOWS = ("whole", "transient", "steady")


class Row(NamedTuple):
    """One cell of Table 1. The window is the whole run, its transient (t < 10) or what follows (steady)."""

    variant: str
    order: float
    axis: str
    window: str
    rmse_mean: float
    rmse_ci_low: float
    rmse_ci_high: float
    seeds: int


def table(study: Study) -> list[Row]:
    """Every cell, in reading order."""
    rows = []
    for variant in VARIANTS:
        for order in ORDERS:
            rmse = study[variant, "proposed", order]["rmse"]
            for axis in ("x", "y"):
                for window in WINDOWS:
                    values = rmse.sel(axis=axis, window=window).values
                    rows.append(Row(variant, order, axis, window, *mean_interval(values), values.size))
    return rows


def farther_off(study: Study, variant: str, window: str, axis: str) -> list[float]:
    """The orders below 1 whose mean RMSE is larger than that of order 1, paired by seed, with 95 % confidence."""
    rmse = {order: study[variant, "proposed", order]["rmse"].sel(window=window, axis=axis) for order in ORDERS}
    return [order for order in ORDERS if order < 1 and mean_interval(rmse[order] - rmse[1.0]).low > 0]


def order_ranges(orders: Sequence[float]) -> str:
    """Rising orders with their neighbors as ranges: 0.1 to 0.3, 0.7."""
    ranges: list[list[float]] = []
    for order in orders:
        if ranges and round(order - ranges[-1][-1], 1) == 0.1:
            ranges[-1].append(order)
        else:
            ranges.append([order])
    return ", ".join(f"{r[0]:g} to {r[-1]:g}" if len(r) > 1 else f"{r[0]:g}" for r in ranges) or "no order"


def write_table(rows: list[Row], path: Path) -> None:
    """Writes the table as CSV, with the columns of `Row`."""
    with whole_file(path) as scratch, open(scratch, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        writer.writerows(rows)


def draw_table(rows: list[Row], path: Path) -> None:
    """RMSE against order, as SVG: one panel per window, logarithmic, with confidence intervals."""
    with own_style(LETTERS):
        _draw_table(rows, path)


def _draw_table(rows: list[Row], path: Path) -> None:
    figure = Figure(figsize=(6.7, 2.6))
    FigureCanvasSVG(figure)
    panels = figure.subplots(1, len(WINDOWS))
    styles: dict[str, dict[str, Any]] = {
        "printed": {"linestyle": "--", "marker": "s"},
        "corrected": {"linestyle": "-", "marker": "o"},
    }
    for panel, window in zip(panels, WINDOWS, strict=True):
        for variant in VARIANTS:
            for axis in ("x", "y"):
                line = [r for r in rows if (r.variant, r.axis, r.window) == (variant, axis, window)]
                means = np.array([r.rmse_mean for r in line])
                low = means - [r.rmse_ci_low for r in line]
                panel.errorbar(
                    [r.order for r in line],
                    means,
                    yerr=np.where(np.isfinite(low), low, 0.0),
                    color=COLORS["xy".index(axis)],
                    markersize=3,
                    linewidth=1,
                    label=f"{axis}, {variant}",
                    **styles[variant],
                )
        panel.set_yscale("log")
        panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.yaxis.set_minor_formatter(NullFormatter())
        panel.set_title(window, fontsize=9)
        panel.set_xlabel("order α", fontsize=8)
        panel.tick_params(labelsize=7)
        panel.grid(True, which="both", linewidth=0.3, alpha=0.5)
    panels[0].set_ylabel("RMSE (unit of length q₀)", fontsize=8)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="lower center", ncols=4, fontsize=7.5, frameon=False)
    figure.subplots_adjust(left=0.1, right=0.99, top=0.9, bottom=0.27, wspace=0.42)
    save_svg(figure, path, "RMSE against order, by axis, window and variant")
