"""Plots of a tuning's report."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from ...analysis.style import MM, WIDTH
from .criteria import Objective, Score
from .search import Trial, ratios

ACROSS = 3  # panels side by side
FEASIBLE, FRONT, CHOSEN = "#9db8cc", "#0072B2", "#D55E00"
OTHERS: Any = {"color": "#bbbbbb", "markersize": 2, "fillstyle": "none", "markeredgewidth": 0.5}
FRONT_MARGIN = 6.0  # the plot of the front shows ratios up to this factor above its largest


def pareto_figure(
    objectives: Sequence[Objective], base: Score, trials: Sequence[Trial], members: Sequence[Trial], chosen: Trial
) -> Figure:
    """Every pair of objectives: feasible trials, the front, the base scenario and the chosen trial."""
    pairs = list(itertools.combinations(range(len(objectives)), 2))
    rows, columns = -(-len(pairs) // ACROSS), min(len(pairs), ACROSS)
    figure = Figure(figsize=(WIDTH * MM, (58 * rows + 12) * MM), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    feasible = np.array([ratios(t.score, base) for t in trials if t.score.feasible])
    best = np.array([ratios(t.score, base) for t in members])
    mine, own = ratios(chosen.score, base), ratios(base, base)
    for panel, (i, j) in itertools.zip_longest(panels, pairs, fillvalue=(0, 0)):
        if not isinstance(panel, Axes):
            break
        if (i, j) == (0, 0):
            panel.set_visible(False)
            continue
        panel.axhline(own[j], color="black", linewidth=0.5, dashes=(3, 2))
        panel.axvline(own[i], color="black", linewidth=0.5, dashes=(3, 2))
        panel.plot(feasible[:, i], feasible[:, j], "o", color=FEASIBLE, markersize=2.2, markeredgewidth=0)
        panel.plot(best[:, i], best[:, j], "o", color=FRONT, markersize=3.2, markeredgewidth=0)
        panel.plot(own[i], own[j], "s", color="black", markersize=5)
        panel.plot(mine[i], mine[j], "*", color=CHOSEN, markersize=10, markeredgecolor="white", markeredgewidth=0.5)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlim(*_span(best[:, i], own[i]))
        panel.set_ylim(*_span(best[:, j], own[j]))
        _round_ticks(panel.xaxis)
        _round_ticks(panel.yaxis)
        panel.set_xlabel(_label(objectives[i], base.objectives[i]))
        panel.set_ylabel(_label(objectives[j], base.objectives[j]))
        panel.spines[["top", "right"]].set_visible(False)
    legend = [
        Line2D([], [], marker="s", color="black", linestyle="", markersize=5, label="base scenario"),
        Line2D([], [], marker="*", color=CHOSEN, linestyle="", markersize=9, label=f"chosen, trial {chosen.number}"),
        Line2D([], [], marker="o", color=FRONT, linestyle="", markersize=3.5, label="Pareto front"),
        Line2D([], [], marker="o", color=FEASIBLE, linestyle="", markersize=3, label="other feasible trials"),
    ]
    figure.legend(handles=legend, loc="outside lower center", ncols=4)
    return figure


def history_figure(objectives: Sequence[Objective], base: Score, trials: Sequence[Trial], chosen: Trial) -> Figure:
    """Objectives by trial, with the minimum so far; for several objectives also the mean used for the choice."""
    several = len(objectives) > 1
    rows = len(objectives) + several
    figure = Figure(figsize=(WIDTH * MM, (32 * rows + 14) * MM), layout="constrained")
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False).ravel()
    values = np.array([ratios(t.score, base) for t in trials])
    with np.errstate(divide="ignore"):
        table = np.column_stack([values, np.exp(np.log(values).mean(axis=1))]) if several else values
    names = [_label(o, value) for o, value in zip(objectives, base.objectives, strict=True)]
    names += ["geometric mean"] if several else []
    number = np.array([trial.number for trial in trials])
    kept = np.array([trial.score.feasible for trial in trials])
    place = int(np.flatnonzero(number == chosen.number)[0])
    for panel, column, name in zip(panels, table.T, names, strict=True):
        drawn = np.where(np.isfinite(column) & (column > 0), column, np.nan)
        panel.plot(
            number[~kept], drawn[~kept], "o", color="#bbbbbb", markersize=2, fillstyle="none", markeredgewidth=0.5
        )
        panel.plot(number[kept], drawn[kept], "o", color=FRONT, markersize=2.2, markeredgewidth=0)
        panel.plot(number[place], drawn[place], "*", color=CHOSEN, markersize=10, markeredgecolor="white")
        panel.axhline(1.0, color="black", linewidth=0.5, dashes=(3, 2))
        if name == names[-1]:
            least = np.minimum.accumulate(np.where(kept, column, np.inf))
            panel.step(number, np.where(np.isfinite(least), least, np.nan), where="post", color=FRONT, linewidth=0.9)
        shown = drawn[kept][np.isfinite(drawn[kept])]
        panel.set_yscale("log")
        panel.set_ylim(*_span(shown, 1.0, np.quantile(shown, 0.9)))
        _round_ticks(panel.yaxis)
        panel.set_ylabel(name.replace(" / ", "\n/ "))
        panel.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("trial")
    legend = [
        Line2D([], [], marker="o", color=FRONT, linestyle="", markersize=3.5, label="feasible"),
        Line2D([], [], marker="o", linestyle="", **OTHERS, label="not feasible"),
        Line2D([], [], marker="*", color=CHOSEN, linestyle="", markersize=9, label=f"chosen, trial {chosen.number}"),
        Line2D([], [], color="black", linewidth=0.7, dashes=(3, 2), label="base scenario"),
        Line2D([], [], color=FRONT, linewidth=0.9, label="minimum so far, feasible"),
    ]
    figure.legend(handles=legend, loc="outside lower center", ncols=5)
    return figure


def _round_ticks(axis: Axis) -> None:
    """Ticks at 1, 2 and 5 times powers of ten, in decimal notation."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def _label(objective: Objective, base: float) -> str:
    over = " / base" if 0 < base < math.inf else ""
    return f"{objective.metric}{over}"


def _span(values: Sequence[float] | np.ndarray, own: float, most: float | None = None) -> tuple[float, float]:
    """Limits of a logarithmic axis that include these values and the base, but no outliers."""
    positive = np.append([v for v in values if v > 0], own if own > 0 else 1.0)
    low, high = float(positive.min()), float(positive.max() if most is None else max(most, own))
    high = min(high, FRONT_MARGIN * max(own, float(np.median(positive))))
    return low / 1.3, high * 1.3
