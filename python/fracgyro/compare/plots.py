"""The figures of the report."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ..analysis.style import COLORS, MM, WIDTH

Row = dict[str, Any]
LINE, ROOM = 4.2, 20.0  # mm: height of a contender's line, and of what is above and below them
MARKERS = "osD^v<>PXph*"
PLANT = "#b8c4cc"


def error_figure(tables: Sequence[tuple[str, Sequence[Row]]]) -> Figure:
    """One panel for each table: contenders from the least error down, with intervals; hollow: over the ceiling."""
    most = max(len(rows) for _, rows in tables)
    down = -(-len(tables) // 2)
    across = min(len(tables), 2)
    figure = Figure(figsize=(WIDTH * MM, ((LINE * most + ROOM) * down + 8) * MM), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, (title, rows) in zip(panels, tables, strict=False):
        for place, row in enumerate(reversed(rows)):
            error = row["metrics"].get("error", {})
            if error.get("value") is None:
                continue
            own = COLORS[row["name"].startswith("paper")]
            filled = own if row["kept"] else "white"
            panel.plot([error["low"], error["high"]], [place, place], color=own, linewidth=1.2)
            panel.plot(error["value"], place, "o", color=own, markerfacecolor=filled, markersize=4)
        panel.set_yticks(range(len(rows)), [row["name"].replace("_", " ") for row in reversed(rows)], fontsize=6.5)
        panel.set_ylim(-0.7, len(rows) - 0.3)
        panel.set_title(title, fontsize=7)
        _logarithmic(panel)
        panel.set_xlabel("error, q0")
        panel.grid(axis="y", linewidth=0.3, color="#e3e7ea")
    for panel in panels[len(tables) :]:
        panel.set_visible(False)
    legend = [
        Line2D([], [], marker="o", color=COLORS[1], markersize=4, label="the paper's and its variants"),
        Line2D([], [], marker="o", color=COLORS[0], markersize=4, label="others"),
        Line2D([], [], marker="o", color="gray", markerfacecolor="white", markersize=4, label="above the ceiling"),
    ]
    figure.legend(handles=legend, loc="outside lower center", ncols=3)
    return figure


def front_figure(tables: Sequence[tuple[str, Sequence[Row]]], ceilings: Sequence[float]) -> Figure:
    """One panel for each class and noise: the best error of any trial up to each amount of chattering."""
    names = list(dict.fromkeys(row["name"] for _, rows in tables for row in rows if row["front"]))
    looks = dict(zip(names, cycle(zip(mpl.color_sequences["tab20"], cycle(MARKERS), strict=False)), strict=False))
    down, across = -(-len(tables) // 2), min(len(tables), 2)
    figure = Figure(figsize=(WIDTH * MM, (72 * down + 5 * -(-len(names) // 3)) * MM), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, (title, rows) in zip(panels, tables, strict=False):
        for ceiling in ceilings:
            panel.axvline(ceiling, color="gray", linewidth=0.6, dashes=(3, 2))
        for name in dict.fromkeys(row["name"] for row in rows):
            points = _joined([point for row in rows if row["name"] == name for point in row["front"]])
            if points:
                color, marker = looks[name]
                xs, ys = zip(*points, strict=True)
                panel.plot(
                    xs, ys, marker, color=color, markersize=2.2, linewidth=0.9, linestyle="-", drawstyle="steps-post"
                )
        panel.set_title(title, fontsize=7)
        panel.set_yscale("log")
        _logarithmic(panel)
        panel.set_xlim(ceilings[0] / 20, ceilings[-1] * 4)
        panel.set_xlabel("chattering index, larger axis")
        panel.set_ylabel("error on the seeds of training, q0")
    for panel in panels[len(tables) :]:
        panel.set_visible(False)
    legend = [
        Line2D([], [], color=looks[name][0], marker=looks[name][1], markersize=3, label=name.replace("_", " "))
        for name in names
    ]
    figure.legend(handles=legend, loc="outside lower center", ncols=3)
    return figure


def robustness_figure(tables: Sequence[tuple[str, Sequence[Row]]], conditions: Sequence[str]) -> Figure:
    """One panel for each table: how many times larger the error is under each condition and on each plant."""
    marks = dict(zip(conditions, MARKERS, strict=False))
    colors = dict(zip(conditions, mpl.color_sequences["Dark2"] * 3, strict=False))
    most = max(len(rows) for _, rows in tables)
    down, across = -(-len(tables) // 2), min(len(tables), 2)
    figure = Figure(figsize=(WIDTH * MM, ((LINE * most + ROOM) * down + 14) * MM), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, (title, rows) in zip(panels, tables, strict=False):
        panel.axvline(1.0, color="black", linewidth=0.5)
        for place, row in enumerate(reversed(rows)):
            for name, found in row["others"].items():
                if found["value"] is None:
                    continue
                if name in marks:
                    panel.plot(found["value"], place, marks[name], color=colors[name], markersize=3.6, zorder=3)
                else:
                    panel.plot(found["value"], place, "|", color=PLANT, markersize=5, zorder=2)
            lost = sum(found["diverged"] > 0 for found in row["others"].values())
            if lost:
                note = f"diverges in {lost}"
                panel.annotate(
                    note, (1, place), xycoords=("axes fraction", "data"), fontsize=5, va="center", ha="right"
                )
        panel.set_yticks(range(len(rows)), [row["name"].replace("_", " ") for row in reversed(rows)], fontsize=6.5)
        panel.set_ylim(-0.7, len(rows) - 0.3)
        panel.set_title(title, fontsize=7)
        _logarithmic(panel)
        panel.set_xlabel("error over that without the change")
        panel.grid(axis="y", linewidth=0.3, color="#e3e7ea")
    for panel in panels[len(tables) :]:
        panel.set_visible(False)
    legend = [
        Line2D([], [], marker=marks[name], color=colors[name], linestyle="", markersize=4, label=name)
        for name in conditions
    ]
    legend.append(Line2D([], [], marker="|", color=PLANT, linestyle="", markersize=6, label="another plant or noise"))
    figure.legend(handles=legend, loc="outside lower center", ncols=4)
    return figure


def _joined(points: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """The front of several."""
    kept: list[tuple[float, float]] = []
    for chattering, error in sorted(map(tuple, points)):
        if not kept or error < kept[-1][1]:
            kept.append((chattering, error))
    return kept


def _logarithmic(panel: Axes) -> None:
    panel.set_xscale("log")
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=6))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.tick_params(axis="x", labelsize=6.5)
    panel.spines[["top", "right"]].set_visible(False)
