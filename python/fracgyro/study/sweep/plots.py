"""Plots of a summary, as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator
from numpy.typing import NDArray

from ...analysis.html import csv_text, embedded
from ...analysis.metric_names import ALL_METRICS
from ...analysis.style import MM, WIDTH, own_style
from .effects import QUANTILES, Axis, Cells, Effect

INK = "#0072B2"
ACROSS = 4  # panels side by side
WIDE_RANGE = 30.0  # largest over smallest value, above which the scale is logarithmic
MAX_WRITTEN = 12  # cells per side of a heat map, up to which their values are written


def label(metric: str, power: int = 0) -> str:
    """Label of a metric with its unit, scaled by 10^power."""
    words, unit = ALL_METRICS[metric]
    factor = f"10{str(power).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}" if power else ""
    inside = " ".join(part for part in (factor, unit) if part)
    return f"{words} ({inside})" if inside else words


def power_of(values: NDArray[np.float64]) -> int:
    """Common power of ten for a label; 0 for numbers that are easy to read without one."""
    largest = np.abs(values[np.isfinite(values)]).max(initial=0.0)
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    return power if not -2 <= power <= 2 else 0


def effects_chart(metric: str, effects: Sequence[Effect]) -> str:
    """A metric along every field, on one scale; half as wide for one or two fields."""
    columns = min(max(len(effects), 2), ACROSS)
    rows = -(-len(effects) // columns)
    values = np.concatenate([_finite(effect) for effect in effects])
    log = len(values) > 0 and values.min() > 0 and values.max() > WIDE_RANGE * values.min()
    power = 0 if log else power_of(values)
    with own_style():
        wide, high = (0.5 * WIDTH, 68) if columns == 2 else (WIDTH, 48 * rows)
        figure = Figure(figsize=(wide * MM, high * MM), layout="constrained")
        panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for panel, effect in zip(panels, effects, strict=False):
            _draw_effect(panel, effect, 10.0**power)
        for panel in panels[len(effects) :]:
            panel.set_visible(False)
        if log:
            panels[0].set_yscale("log")
        figure.supylabel(label(metric, power), fontsize=8)
        return embedded(figure, f"{ALL_METRICS[metric][0]} along every field")


def heat_map(metric: str, cells: Cells, limits: tuple[float, float]) -> str:
    """A metric over two fields. `limits`: smallest and largest value of the color scale."""
    low, high = limits
    log = low > 0 and high > WIDE_RANGE * low
    power = power_of(np.array([low] if log else limits))
    low, high, values = low / 10.0**power, high / 10.0**power, cells.values / 10.0**power
    norm = LogNorm(low, high) if log else Normalize(low, high)
    with own_style():
        figure = Figure(figsize=(0.5 * WIDTH * MM, 68 * MM), layout="constrained")
        panel = figure.add_subplot()
        drawn = panel.pcolormesh(values, norm=norm, cmap="viridis")
        for j, i in np.argwhere(np.isnan(values) & ~cells.empty):
            panel.add_patch(
                Rectangle((i, j), 1, 1, facecolor="#eeeeee", edgecolor="#888888", hatch="////", linewidth=0)
            )
        up, across = np.nonzero(cells.partial & ~np.isnan(values))
        panel.scatter(across + 0.88, up + 0.85, s=5, color="#D55E00", edgecolor="white", linewidths=0.3, zorder=3)
        _ticks(panel, cells.across, "x")
        _ticks(panel, cells.up, "y")
        texts = {place: _short(value) for place, value in np.ndenumerate(values) if not np.isnan(value)}
        if max(values.shape) <= MAX_WRITTEN and max(map(len, texts.values())) <= 4:
            for (j, i), text in texts.items():
                color = "white" if norm(values[j, i]) < 0.6 else "black"
                panel.text(i + 0.5, j + 0.5, text, size=5.5, ha="center", va="center", color=color)
        if log and high < 1e4 * low:
            bar = figure.colorbar(drawn, ax=panel, ticks=LogLocator(subs=(1, 2, 5)), format=FuncFormatter(_tick))
            bar.minorticks_off()
        else:
            bar = figure.colorbar(drawn, ax=panel)
        bar.set_label(label(metric, power))
        return embedded(figure, f"{ALL_METRICS[metric][0]} over {cells.across.field} and {cells.up.field}")


def numbers(metric: str, effects: Sequence[Effect], maps: Sequence[Cells], *, sampled: bool) -> str:
    """Data of a metric's plots, as CSV: along each field, then over each pair of fields."""
    what = label(metric)
    header = ["field", "value (of a bin: its center)", "second field", "its value", f"mean of {what}"]
    header += ["low end of its 95 % interval", "high end"]
    header += [f"{100 * q:g} % quantile" for q in QUANTILES] if sampled else []
    rows: list[list[Any]] = []
    for effect in effects:
        bands = np.full((len(effect.means), 0), np.nan) if effect.quantiles is None else effect.quantiles.T
        for place, mean, band in zip(_places(effect.axis), effect.means, bands, strict=True):
            rows.append([effect.axis.field, place, "", "", *(mean or [None] * 3), *band])
    for cells in maps:
        across, up = _places(cells.across), _places(cells.up)
        for (j, i), value in np.ndenumerate(cells.values):
            median = [None] * (3 + list(QUANTILES).index(0.5)) if sampled else []
            rows.append([cells.across.field, across[i], cells.up.field, up[j], *median, value])
    return csv_text(header, rows)


def _places(axis: Axis) -> list[Any]:
    return axis.places.tolist() if axis.numeric else axis.names


def correlation_chart(metrics: Sequence[str], fields: Sequence[str], values: NDArray[np.float64]) -> str:
    """Rank correlations `values`, (metrics, fields)."""
    with own_style():
        figure = Figure(figsize=(WIDTH * MM, (24 + 7 * len(metrics)) * MM), layout="constrained")
        panel = figure.add_subplot()
        drawn = panel.pcolormesh(values, vmin=-1, vmax=1, cmap="RdBu_r")
        for (j, i), value in np.ndenumerate(values):
            text = "–" if np.isnan(value) else f"{round(value, 2) + 0.0:.2f}".replace("-", "\N{MINUS SIGN}")
            color = "white" if abs(value) > 0.6 else "black"
            panel.text(i + 0.5, j + 0.5, text, ha="center", va="center", color=color)
        panel.set_xticks(np.arange(len(fields)) + 0.5, [_broken(field) for field in fields], fontsize=7)
        panel.set_yticks(np.arange(len(metrics)) + 0.5, [ALL_METRICS[metric][0] for metric in metrics])
        panel.tick_params(length=0)
        panel.invert_yaxis()
        figure.colorbar(drawn, ax=panel).set_label("rank correlation")
        return embedded(figure, "Rank correlations of metrics and fields")


def _draw_effect(panel: Axes, effect: Effect, unit: float) -> None:
    axis = effect.axis
    if effect.quantiles is not None:
        bands = np.where(np.isfinite(effect.quantiles), effect.quantiles, np.nan) / unit
        for lower, upper, strength in ((0, 4, 0.15), (1, 3, 0.3)):
            if axis.numeric:
                panel.fill_between(axis.places, bands[lower], bands[upper], color=INK, alpha=strength, linewidth=0)
            else:
                panel.vlines(axis.places, bands[lower], bands[upper], color=INK, alpha=strength, linewidth=6)
        if axis.numeric:
            panel.plot(axis.places, bands[2], color=INK, linewidth=0.9)
        else:
            panel.hlines(bands[2], axis.places - 0.12, axis.places + 0.12, color=INK, linewidth=0.9)
    for place, mean, partial in zip(axis.places, effect.means, effect.partial, strict=True):
        if mean is None:
            continue
        middle, low, high = (value / unit for value in mean)
        bar = [[middle - low], [high - middle]] if np.isfinite(low) else None
        style: dict[str, Any] = {"markerfacecolor": "white" if partial else "black", "markeredgewidth": 0.7}
        panel.errorbar(place, middle, bar, fmt="o", markersize=2.8, color="black", elinewidth=0.7, capsize=1.2, **style)
    if axis.log:
        panel.set_xscale("log")
    ends = axis.places if axis.edges is None else axis.edges
    if axis.log:
        panel.set_xlim(ends[0] / 1.15, ends[-1] * 1.15)
    elif axis.edges is None:
        margin = 0.5 if not axis.numeric or len(ends) == 1 else 0.06 * float(np.ptp(ends))
        panel.set_xlim(ends[0] - margin, ends[-1] + margin)
    else:
        panel.set_xlim(ends[0], ends[-1])
    wide = max(len(axis.names) * 4, sum(map(_width, axis.names)))
    if not axis.numeric:
        slanted: dict[str, Any] = {"rotation": 40, "ha": "right"} if wide > 26 else {}
        panel.set_xticks(axis.places, [_broken(name) for name in axis.names], **slanted)
    elif axis.edges is None and (axis.log or len(axis.names) <= 4):
        every = -(-wide // 20)
        panel.set_xticks(axis.places[::every], axis.names[::every])
    elif not axis.log:
        panel.xaxis.set_major_locator(MaxNLocator(4, steps=(1, 2, 5, 10)))
        panel.xaxis.set_major_formatter(FuncFormatter(_tick))
    panel.minorticks_off()
    panel.set_xlabel(axis.field, fontsize=7)
    panel.tick_params(labelsize=6.5)
    panel.spines[["top", "right"]].set_visible(False)


def _finite(effect: Effect) -> NDArray[np.float64]:
    found = [value for mean in effect.means if mean for value in mean]
    if effect.quantiles is not None:
        found += effect.quantiles.ravel().tolist()
    return np.array([value for value in found if np.isfinite(value)])


def _ticks(panel: Axes, axis: Axis, side: str) -> None:
    """Ticks of a heat map, whose levels and bins have equal width."""
    if axis.edges is not None:
        every = -(-len(axis.edges) // 6)
        at: Any = np.arange(len(axis.edges))[::every]
        names = [_tick(float(f"{edge:.3g}")) for edge in axis.edges[::every]]
    else:
        every = -(-len(axis.names) // 12)
        at, names = np.arange(len(axis.names))[::every] + 0.5, [_broken(name) for name in axis.names[::every]]
    if side == "x":
        long = sum(map(_width, names)) > 34
        panel.set_xticks(at, names, fontsize=6.5, rotation=40 if long else 0, ha="right" if long else "center")
        panel.set_xlabel(axis.field)
    else:
        panel.set_yticks(at, names, fontsize=6.5)
        panel.set_ylabel(axis.field)


def _tick(value: float, _: object = None) -> str:
    return f"{value:.4g}".replace("e-0", "e-").replace("e+0", "e").replace("-", "\N{MINUS SIGN}")


def _short(value: float) -> str:
    """Two digits, in as few characters as possible."""
    return f"{value:.2g}".replace("0.", ".", 1) if abs(value) < 100 else f"{value:.0f}"


def _broken(name: str) -> str:
    """A name over several lines."""
    return name.replace("_", "_\n").replace(".", ".\n") if any(c.isalpha() for c in name[1:2]) else name


def _width(name: str) -> int:
    """Characters of the longest line."""
    return max(map(len, _broken(name).split("\n")))
