"""Bode plot of measured frequency responses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from . import metrics
from .metric_names import written
from .scenarios import one_scenario
from .style import COLORS
from .tasks import task_axes

RESPONSE = ("gain", "phase")
MIN_SPAN_DB, MIN_SPAN_DEG = 1.0, 5.0  # smallest spans of the axes
FEW = 100.0  # ratio of frequencies below which ticks are also at 2 and 5 times powers of ten
DASHES = ("solid", (0, (4, 1.5)))  # x and y of one of several runs


def is_response(data: xr.Dataset) -> bool:
    """True for a Dataset of `metrics.frequency_response`."""
    return "frequency" in data.dims and all(name in data for name in RESPONSE)


def response_of(run: xr.Dataset) -> xr.Dataset | None:
    """The frequency response of a run along its chirp, if it has one that can be resolved."""
    try:
        return metrics.frequency_response(run) if "chirp" in task_axes(one_scenario(run)) else None
    except ValueError:
        return None


def draw_bode(gain: Axes, phase: Axes, responses: Mapping[str, xr.Dataset], colors: Mapping[str, str]) -> None:
    """Gain in dB and phase in degrees over a logarithmic frequency.

    A single response has the colors of the axes; of several, each has its own and y is dashed.
    """
    several = len(responses) > 1
    for name, response in responses.items():
        for i, axis in enumerate(response["axis"].values):
            here = response.sel(axis=axis)
            known = np.isfinite(here["gain"].values)
            if not known.any():
                continue
            label = f"{name}, {axis}" if several else str(axis)
            color, dashes = (colors[name], DASHES[i % 2]) if several else (COLORS[i % 2], "solid")
            frequency = here["frequency"].values[known]
            decibels = 20 * np.log10(here["gain"].values[known])
            for panel, values in ((gain, decibels), (phase, _degrees(here["phase"].values[known]))):
                panel.plot(frequency, values, color=color, linestyle=dashes, linewidth=0.8, label=label)
    unit = written(str(next(iter(responses.values()))["frequency"].attrs.get("units", "omega0")))
    for panel, span in ((gain, MIN_SPAN_DB), (phase, MIN_SPAN_DEG)):
        panel.set_xscale("log")
        _round_ticks(panel)
        panel.grid(True, linewidth=0.3)
        bottom, top = panel.get_ylim()
        if top - bottom < span:  # noise of a flat response would fill the panel
            panel.set_ylim(0.5 * (bottom + top - span), 0.5 * (bottom + top + span))
    gain.set_ylabel("gain\n(dB)")
    phase.set_ylabel("phase\n(deg)")
    phase.set_xlabel(f"frequency ({unit})")


def _round_ticks(panel: Axes) -> None:
    """Decimal ticks at powers of ten, and at 2 and 5 times them if there are few."""
    low, high = panel.get_xlim()
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < FEW * low else (1.0,)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def _degrees(radians: NDArray[np.float64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = np.degrees(np.unwrap(radians))
    return found
