"""Plots of the report: panels of half the page width, one per table, and their legends."""

from __future__ import annotations

import math
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
Limit = dict[str, Any]  # for one sensing, as in compare.json
Table = tuple[str, Sequence[Row]]  # with its title
LINE, ROOM = 4.2, 18.0  # mm: height of a contender's line, and of the margins above and below
MARKERS = "osD^v<>PXph*"
MARKED = 4  # best contenders of each table, which have a color
OTHERS = "#b9c2c8"
# More than the marked contenders and the conditions: no color stands for two.
PALETTE = (*mpl.color_sequences["Dark2"], "#3f90da", "#bd1f01", "#832db6", "#5b8c00", "#00798c", "#4b3f2f")
MAX_SPAN = 300.0  # ratio of the ends of a front's axis of errors; points farther from the best are not drawn
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
            Line2D([], [], marker="|", color=SAMPLER, ls="none", markersize=6, label="one search, training seeds"),
        ]
    )


class Fronts:
    """Error over chattering, with the line of the limit; a contender looks the same in all panels.

    Those among the MARKED best of any panel have a color each, the others are gray.
    """

    def __init__(self, rows: Sequence[Row], limits: Sequence[Limit]) -> None:
        best: dict[str, None] = {}
        for place in dict.fromkeys(map(_sensing, rows)):
            here = [row for row in rows if _sensing(row) == place and row["kept"]]
            for ceiling in {row["ceiling"] for row in here}:
                ranked = sorted((row for row in here if row["ceiling"] == ceiling), key=_error)
                best |= dict.fromkeys(row["name"] for row in ranked[:MARKED])
        names = [name for name in _names(rows) if name in best]
        self._looks = dict(zip(names, zip(cycle(PALETTE), cycle(MARKERS), strict=False), strict=False))
        self._limits = {_sensing(limit): limit for limit in limits}
        self._others = len(_names(rows)) > len(names)

    def panel(self, title: str, rows: Sequence[Row]) -> Figure:
        """The least error of any trial up to each amount of chattering."""
        figure, panel = self._begun(title, rows)
        drawn = self._limit(panel, rows, 2)
        for name in _names(rows):
            if not (points := _front(rows, name)):
                continue
            color, marker = self._looks.get(name, (OTHERS, ""))
            # More chattering than any trial had is not needed for its error.
            xs, ys = zip(*points, (100 * points[-1][0], points[-1][1]), strict=True)
            width, order = (0.9, 3) if marker else (0.6, 2)
            panel.plot(xs, ys, color=color, linewidth=width, drawstyle="steps-post", zorder=order)
            drawn += ys
            for ceiling in _ceilings(rows) if marker else []:
                if within := [error for chattering, error in points if chattering <= ceiling]:
                    panel.plot(ceiling, min(within), marker, color=color, markersize=3, zorder=4)
        return self._ended(figure, panel, rows, drawn, "error on the training seeds, q0")

    def steady(self, title: str, rows: Sequence[Row]) -> Figure:
        """The steady error of the tuned contenders on the held-out seeds."""
        figure, panel = self._begun(title, rows)
        drawn = self._limit(panel, rows, 1)
        for name in dict.fromkeys(row["name"] for row in rows):
            color, marker = self._looks.get(name, (OTHERS, "."))
            if points := sorted(filter(None, (_steady(row) for row in rows if row["name"] == name))):
                xs, ys = zip(*points, strict=True)
                panel.plot(xs, ys, marker, color=color, markersize=3, linewidth=0.5, ls="-", zorder=3)
                drawn += ys
        return self._ended(figure, panel, rows, drawn, "steady error on the held-out seeds, q0")

    def _begun(self, title: str, rows: Sequence[Row]) -> tuple[Figure, Axes]:
        figure = Figure(figsize=(WIDTH / 2 * MM, 72 * MM), layout="constrained")
        panel = figure.subplots()
        panel.set_title(_broken(title), fontsize=7)
        panel.spines[["top", "right"]].set_visible(False)
        for ceiling in _ceilings(rows):
            panel.axvline(ceiling, color="gray", linewidth=0.6, dashes=(3, 2), zorder=1)
        return figure, panel

    def _limit(self, panel: Axes, rows: Sequence[Row], column: int) -> list[float]:
        limit = self._limits.get(_sensing(rows[0]))
        known = [point for point in limit["front"] if point[column] is not None] if limit else []
        xs, ys = ([float(point[i]) for point in known] for i in (0, column))
        panel.plot(xs, ys, color="black", linewidth=1.4, zorder=5)
        return ys

    def _ended(self, figure: Figure, panel: Axes, rows: Sequence[Row], drawn: list[float], words: str) -> Figure:
        ceilings = _ceilings(rows)
        panel.set_xlim(ceilings[0] / 8, ceilings[-1] * 3)
        if drawn:
            panel.set_ylim(0.8 * min(drawn), min(MAX_SPAN * min(drawn), 1.2 * max(drawn)))
        _logarithmic(panel.xaxis, "x")
        _logarithmic(panel.yaxis, "y")
        panel.set_xlabel("chattering index, larger axis")
        panel.set_ylabel(words)
        return figure

    def legend(self) -> Figure:
        handles = [
            Line2D([], [], color=color, marker=marker, markersize=3, label=name.replace("_", " "))
            for name, (color, marker) in self._looks.items()
        ]
        if any(limit["front"] for limit in self._limits.values()):
            handles.insert(0, Line2D([], [], color="black", linewidth=1.4, label="the limit of any controller"))
        if self._others:
            handles.append(Line2D([], [], color=OTHERS, linewidth=0.6, label="others"))
        return _legend(handles)


class Robustness:
    """Ratio of the error under each condition and on each plant to the nominal error."""

    def __init__(self, conditions: Sequence[str]) -> None:
        looks = zip(MARKERS, PALETTE, strict=False)
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
    header += [f"{words}: search {i + 1}, when trained" for i in range(count)]
    found = []
    for title, rows in tables:
        for row in rows:
            error, kept = row["metrics"].get("error", {}), str(row["kept"]).lower()
            numbers = [error.get(end) for end in ("value", "low", "high")]
            found.append([title, row["name"], *numbers, kept, *row["sampler_errors"]])
    return csv_text(header, found)


def front_data(tables: Sequence[Table], limits: Sequence[Limit]) -> str:
    """Points of both panels of each table: one of the two errors is blank, except those of the limit."""
    header = ["table", "contender", "chattering index, larger axis"]
    header += ["error on the seeds of training (q0)", "steady error on the held-out seeds (q0)"]
    by_sensing = {_sensing(limit): limit for limit in limits}
    found: list[list[Any]] = []
    for title, rows in tables:
        limit = by_sensing.get(_sensing(rows[0]))
        found += [[title, "limit", at, error, steady] for at, steady, error in (limit["front"] if limit else [])]
        found += [[title, name, *point, None] for name in _names(rows) for point in _front(rows, name)]
        points = ((row["name"], point) for row in rows if (point := _steady(row)))
        found += [[title, name, chattering, None, steady] for name, (chattering, steady) in points]
    return csv_text(header, found)


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
    panel.set_title(_broken(title), fontsize=7)
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


def _broken(title: str) -> str:
    """Two lines, if there is a scenario before the class."""
    return title if title.startswith("class") else title.replace(", class", "\nclass", 1)


def _sensing(of: Row | Limit) -> tuple[str, str, float]:
    return of["scenario"], of["class"], of["noise"]


def _ceilings(rows: Sequence[Row]) -> list[float]:
    return sorted({row["ceiling"] for row in rows})


def _error(row: Row) -> float:
    value = row["metrics"]["error"]["value"]
    return math.inf if value is None else float(value)


def largest(row: Row, names: Sequence[str]) -> float | None:
    """The largest of these metrics; None where one has no value."""
    found = [row["metrics"].get(name, {}).get("value") for name in names]
    known = [float(value) for value in found if value is not None]
    return max(known) if known and len(known) == len(found) else None


CHATTERING = ("chattering_x", "chattering_y")


def _steady(row: Row) -> tuple[float, float] | None:
    """Chattering of the larger axis, and the geometric mean of both axes' steady errors."""
    chattering = largest(row, CHATTERING)
    steady = [row["metrics"].get(f"rmse_steady_{axis}", {}).get("value") for axis in "xy"]
    return None if chattering is None or not all(steady) else (chattering, math.sqrt(steady[0] * steady[1]))


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
