"""Plots of the report: panels of half the page width, one per table, and their legends."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any

import matplotlib as mpl
from fracgyro.analysis.html import csv_text
from fracgyro.analysis.style import COLORS, MM, WIDTH
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

Row = dict[str, Any]
Table = tuple[str, Sequence[Row]]  # with its title
LINE, ROOM = 4.2, 18.0  # mm: height of a contender's line, and of the margins above and below
MARKERS = "osD^v<>PXph*"
PLANT = "#b8c4cc"
SAMPLER = "#7a868e"
MAX_DRAWN_RATIO = 30.0  # largest ratio of the axis: larger ones are drawn here, with their value
DEAD = 1e-6  # smaller ratios mean that the converter is too coarse to see any motion


def error_panel(title: str, rows: Sequence[Row], words: str) -> Figure:
    """Contenders by increasing error, with intervals; hollow: beyond a limit. `words`: name of the error."""
    figure, panel = _lines(title, rows)
    for place, row in enumerate(reversed(rows)):
        error = row["metrics"].get("error", {})
        if error.get("value") is None:
            continue
        own = COLORS[row["name"].startswith("paper")]
        samplers = [found for found in row["sampler_errors"] if found is not None]
        panel.plot(samplers, [place] * len(samplers), "|", color=SAMPLER, markersize=6)
        filled = own if row["kept"] else "white"
        panel.plot([error["low"], error["high"]], [place, place], color=own, linewidth=1.2)
        panel.plot(error["value"], place, "o", color=own, markerfacecolor=filled, markersize=4)
    _logarithmic(panel.xaxis, "x")
    panel.set_xlabel(words)
    return figure


def error_legend() -> Figure:
    return _legend(
        [
            Line2D([], [], marker="o", color=COLORS[1], markersize=4, label="the paper's and its variants"),
            Line2D([], [], marker="o", color=COLORS[0], markersize=4, label="others"),
            Line2D([], [], marker="o", color="gray", markerfacecolor="white", markersize=4, label="beyond a limit"),
            Line2D([], [], marker="|", color=SAMPLER, ls="none", markersize=6, label="one tuning, when trained"),
        ]
    )


class Fronts:
    """The best error of any trial up to each amount of chattering; a contender looks the same in all panels."""

    def __init__(self, rows: Sequence[Row], ceilings: Sequence[float]) -> None:
        names = _names(rows)
        looks = zip(mpl.color_sequences["tab20"], cycle(MARKERS), strict=False)
        self._looks = dict(zip(names, cycle(looks), strict=False))
        self._ceilings = ceilings

    def panel(self, title: str, rows: Sequence[Row]) -> Figure:
        figure = Figure(figsize=(WIDTH / 2 * MM, 80 * MM), layout="constrained")
        panel = figure.subplots()
        for ceiling in self._ceilings:
            panel.axvline(ceiling, color="gray", linewidth=0.6, dashes=(3, 2))
        for name, (color, marker) in self._looks.items():
            points = _front(rows, name)
            if points:
                xs, ys = zip(*points, strict=True)
                panel.plot(xs, ys, marker, color=color, markersize=2.2, linewidth=0.9, ls="-", drawstyle="steps-post")
        panel.set_title(title, fontsize=7)
        panel.spines[["top", "right"]].set_visible(False)
        panel.set_xlim(self._ceilings[0] / 20, self._ceilings[-1] * 4)
        _logarithmic(panel.xaxis, "x")
        _logarithmic(panel.yaxis, "y")
        panel.set_xlabel("chattering index, larger axis")
        panel.set_ylabel("error on the seeds of training, q0")
        return figure

    def legend(self) -> Figure:
        return _legend(
            [
                Line2D([], [], color=color, marker=marker, markersize=3, label=name.replace("_", " "))
                for name, (color, marker) in self._looks.items()
            ]
        )


class Robustness:
    """Ratio of the error under each condition and on each plant to the nominal error."""

    def __init__(self, conditions: Sequence[str]) -> None:
        looks = zip(MARKERS, cycle(mpl.color_sequences["Dark2"]), strict=False)
        self._looks = dict(zip(conditions, looks, strict=False))

    def panel(self, title: str, rows: Sequence[Row]) -> Figure:
        figure, panel = _lines(title, rows)
        panel.axvline(1.0, color="black", linewidth=0.5)
        for place, row in enumerate(reversed(rows)):
            for name, ratio in _shown(row).items():
                marker, color = self._looks.get(name, ("|", PLANT))
                panel.plot(
                    min(ratio, MAX_DRAWN_RATIO),
                    place,
                    marker,
                    color=color,
                    markersize=4,
                    zorder=2 + (name in self._looks),
                )
            far = [ratio for ratio in _shown(row).values() if ratio > MAX_DRAWN_RATIO]
            if far:
                words = " – ".join(dict.fromkeys(f"{ratio:.2g}" for ratio in (min(far), max(far))))
                panel.text(1.2 * MAX_DRAWN_RATIO, place, words, fontsize=5.5, va="center")
            lost = sum(found["lost"] > 0 for found in row["others"].values())
            if lost:
                there = panel.get_yaxis_transform()
                panel.text(1, place + 0.35, f"lost in {lost}", transform=there, fontsize=5.5, va="center", ha="right")
        values = [ratio for row in rows for ratio in _shown(row).values()]
        panel.set_xlim(
            0.8 * min([0.5, *values]), 6 * MAX_DRAWN_RATIO if max([1.0, *values]) > MAX_DRAWN_RATIO else None
        )
        _logarithmic(panel.xaxis, "x")
        panel.set_xlabel("error over that without the change")
        return figure

    def legend(self) -> Figure:
        handles = [
            Line2D([], [], marker=marker, color=color, linestyle="", markersize=4, label=name)
            for name, (marker, color) in self._looks.items()
        ]
        plant = Line2D([], [], marker="|", color=PLANT, linestyle="", markersize=6, label="another plant or noise")
        return _legend([*handles, plant])


def error_data(tables: Sequence[Table], words: str) -> str:
    """Data of all error panels, as CSV."""
    count = max(len(row["sampler_errors"]) for _, rows in tables for row in rows)
    header = ["table", "contender", words, "low end of its 95 % interval", "high end", "within the limits"]
    header += [f"{words}: tuning {i + 1}, when trained" for i in range(count)]
    found = []
    for title, rows in tables:
        for row in rows:
            error, kept = row["metrics"].get("error", {}), str(row["kept"]).lower()
            numbers = [error.get(end) for end in ("value", "low", "high")]
            found.append([title, row["name"], *numbers, kept, *row["sampler_errors"]])
    return csv_text(header, found)


def front_data(tables: Sequence[Table]) -> str:
    header = ["table", "contender", "chattering index, larger axis", "error on the seeds of training (q0)"]
    fronts = ((title, name, _front(rows, name)) for title, rows in tables for name in _names(rows))
    return csv_text(header, ([title, name, *point] for title, name, points in fronts for point in points))


def robustness_data(tables: Sequence[Table]) -> str:
    header = ["table", "contender", "condition, plant or noise", "error over that without the change", "runs lost"]
    every = ((title, row["name"], row["others"].items()) for title, rows in tables for row in rows)
    found = ([title, name, what, of["value"], of["lost"]] for title, name, others in every for what, of in others)
    return csv_text(header, found)


def _shown(row: Row) -> dict[str, float]:
    """The ratios that can be drawn: without lost runs and above DEAD."""
    ratios = {name: found["value"] for name, found in row["others"].items() if not found["lost"]}
    return {name: ratio for name, ratio in ratios.items() if ratio is not None and ratio > DEAD}


def _lines(title: str, rows: Sequence[Row]) -> tuple[Figure, Axes]:
    """A line for each contender, the first on top."""
    figure = Figure(figsize=(WIDTH / 2 * MM, (LINE * len(rows) + ROOM) * MM), layout="constrained")
    panel = figure.subplots()
    panel.set_xscale("log")
    panel.set_yticks(range(len(rows)), [row["name"].replace("_", " ") for row in reversed(rows)], fontsize=6.5)
    panel.set_ylim(-0.7, len(rows) - 0.3)
    panel.set_title(title, fontsize=7)
    panel.grid(axis="y", linewidth=0.3, color="#e3e7ea")
    panel.spines[["top", "right"]].set_visible(False)
    return figure, panel


def _legend(handles: Sequence[Line2D]) -> Figure:
    figure = Figure(figsize=(WIDTH / 2 * MM, (3.9 * -(-len(handles) // 2) + 4) * MM))
    figure.legend(handles=handles, loc="center", ncols=2)
    return figure


def _names(rows: Sequence[Row]) -> list[str]:
    """Contenders that have a front."""
    return list(dict.fromkeys(row["name"] for row in rows if row["front"]))


def _front(rows: Sequence[Row], name: str) -> list[tuple[float, float]]:
    return joined([point for row in rows if row["name"] == name for point in row["front"]])


def joined(points: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """The front of several fronts, [chattering, error], by rising chattering."""
    kept: list[tuple[float, float]] = []
    for chattering, error in sorted((point[0], point[1]) for point in points):
        if not kept or error < kept[-1][1]:
            kept.append((chattering, error))
    return kept


def _logarithmic(axis: Axis, which: str) -> None:
    """Labels at powers of ten, and between if there are few."""
    axis.axes.set(**{f"{which}scale": "log"})
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0,) if high > 100 * low else (1.0, 2.0, 5.0), numticks=9))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_tick_params(labelsize=6.5)
