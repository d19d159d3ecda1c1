"""Panels of the picture of runs: one channel over time each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from . import metrics
from .channel_units import SPIKE, Scaled
from .decimation import band, crossings, decimate, largest
from .scenarios import one_scenario, scale
from .style import COLORS
from .tasks import drives

PALETTE = (*COLORS, "#009E73", "#CC79A7", "#56B4E9", "#E69F00")  # Okabe and Ito's, for color-blind readers
REFERENCE: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 0.8}
COLUMNS = 1500  # pixel columns: each keeps the extremes of its samples
DENSE = COLUMNS // 4  # a curve with more crossings of its mean is drawn as a band
DECADES = 12.0  # below the largest error
SETTLED = 0.25  # share of a run before the part that sets the limits of a rate, and of a drive's force and quadrature
CLIPPED = 3.0  # a peak is clipped if it is larger than the other values by this factor

Array = NDArray[np.float64]


class Own(NamedTuple):
    """Name and color of a run among several."""

    name: str
    color: str


def width_of(run: xr.Dataset, name: str) -> int:
    """Number of columns of a channel; 1 if the run lacks it."""
    return int(np.prod(run[name].shape[1:])) if name in run else 1


def labels(run: xr.Dataset, name: str) -> list[str]:
    dimension = run[name].dims[-1]
    return list(map(str, run[dimension].values if dimension in run.coords else range(width_of(run, name))))


def overlapping(run: xr.Dataset, name: str) -> bool:
    """True if the curves of a channel would hide one another: several of them are bands."""
    if name not in run or name in ("error", "rate_estimate"):
        return False
    columns = run[name].values.reshape(run.sizes["time"], -1).T
    return sum(crossings(column) > DENSE for column in columns) > 1


def draw(
    panel: Axes, run: xr.Dataset, name: str, places: Sequence[int], units: tuple[Scaled, Scaled], own: Own | None
) -> None:
    """These columns of a channel; `units`: of time and of the channel; `own`: if there are several runs."""
    time, unit = run["time"].values / units[0].scale, units[1].scale
    if name == "rate_estimate":
        return _draw_rate(panel, run, time, unit, own)
    values = run[name].values.reshape(time.size, -1) / unit
    wide, names = values.shape[1], labels(run, name) if values.ndim > 1 and run[name].ndim > 1 else [name]
    for column in places:
        label = own.name if own else names[column] if wide > 1 else name.replace("_", " ")
        style: dict[str, Any] = {
            "color": own.color if own else PALETTE[column % len(PALETTE)],
            "linewidth": 0.8,
            "label": label,
        }
        shown = values[:, column]
        if name == "error":
            panel.semilogy(*largest(time, _positive(abs(shown)), COLUMNS), **style)
        elif (found := crossings(shown)) > DENSE:
            style |= {"linewidth": 0.5, "alpha": 0.5}
            panel.fill_between(*band(time, shown, max(50, found // 4)), **style)
        else:
            panel.plot(*decimate(time, shown, COLUMNS), **style)
    if name == "position":
        _draw_reference(panel, time, [run["reference"].values[:, column] / unit for column in places])
    elif name == "drive_amplitude" and (asked := _set_point(run)) is not None:
        panel.plot(time[[0, -1]], [asked / unit] * 2, **REFERENCE, label="set point")


def _draw_reference(panel: Axes, time: Array, references: Iterable[Array]) -> None:
    """References as dotted lines; of a dense one the envelope."""
    drawn = []
    for values in references:
        if (found := crossings(values)) > DENSE:
            middle, low, high = band(time, values, max(50, found // 4))
            drawn += [(middle, low), (middle, high)]
        else:
            drawn.append(decimate(time, values, COLUMNS))
    for number, curve in enumerate(drawn):
        panel.plot(*curve, **REFERENCE, label="" if number else "reference")


def _set_point(run: xr.Dataset) -> float | None:
    """Amplitude that a conventional drive must keep, in the unit of position."""
    return float(scale(run, "q0")) * one_scenario(run).reference.amplitude[0] if drives(run) else None


def _positive(sizes: Array) -> Array:
    """Sizes for a logarithmic axis of at most DECADES, on which a mass at rest may have no error at all."""
    peak = float(sizes.max())
    return np.maximum(sizes, 10.0**-DECADES * peak) if peak > 0 else np.full_like(sizes, np.nan)


def _draw_rate(panel: Axes, run: xr.Dataset, time: Array, unit: float, own: Own | None) -> None:
    """The estimate with a band of two standard deviations, and the true rate; scaled to the settled part."""
    estimate: Array = run["rate_estimate"].values / unit
    truth: Array = (metrics.true_rate(run) * xr.ones_like(run["rate_estimate"])).values / unit
    spread: Array = 2 * run["rate_deviation"].values / unit if "rate_deviation" in run else 0.0 * estimate
    label, color = own or ("estimate ± 2σ" if spread.any() else "estimate", PALETTE[0])
    if spread.any():
        middle, _, high = band(time, estimate + spread, COLUMNS)
        low = band(time, estimate - spread, COLUMNS)[1]
        panel.fill_between(middle, low, high, color=color, alpha=0.25, linewidth=0)
    panel.plot(*decimate(time, estimate, COLUMNS), color=color, linewidth=0.8, label=label)
    panel.plot(*decimate(time, truth, COLUMNS), **REFERENCE, label="true rate")
    later = slice(int(SETTLED * time.size), None)
    values = np.concatenate([(estimate + spread)[later], (estimate - spread)[later], truth])
    margin = 0.15 * float(np.ptp(values)) or 1.0
    bottom, top = float(values.min()) - margin, float(values.max()) + margin
    before = panel.get_ylim() if own and len(panel.lines) > 2 else (bottom, top)
    panel.set_ylim(min(bottom, before[0]), max(top, before[1]))


def clip(
    panel: Axes, runs: Sequence[xr.Dataset], name: str, places: Sequence[int], units: tuple[Scaled, Scaled]
) -> str | None:
    """Limits a panel of forces or quadrature to the values without a spike; returns words about it, if any.

    A spike is in few samples; for a conventional drive it is everything above the settled part of the run.
    """
    if name not in ("control", "quadrature"):
        return None
    kept: list[Array] = []
    peak, at = 0.0, 0.0
    for run in runs:
        values = run[name].values.reshape(run.sizes["time"], -1)[:, list(places)] / units[1].scale
        size = abs(values).max(axis=1)
        settled = drives(run)
        usual = size[int(SETTLED * len(size)) :].max() if settled else np.quantile(size, 1 - SPIKE, method="higher")
        if not np.isfinite(usual):
            return None  # also if NaN, which is at most nothing: no sample would be kept
        kept.append(values[size <= usual])
        if size.max() > abs(peak):
            row = int(size.argmax())
            peak = float(values[row][abs(values[row]).argmax()])
            at = float(run["time"].values[row]) / units[0].scale
    low, high = (float(extreme([extreme(part) for part in kept])) for extreme in (np.min, np.max))
    if abs(peak) <= CLIPPED * max(abs(low), abs(high)) or low == high:
        return None
    margin = 0.1 * (high - low)
    panel.set_ylim(low - margin, high + margin)
    number = f"{float(f'{peak:.3g}'):g}".replace("-", "\N{MINUS SIGN}")
    return f"clipped peak: {number} at t = {at:.2g}"
