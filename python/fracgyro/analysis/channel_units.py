"""Units of channels on the axes of a plot: nondimensional symbols, or SI with a prefix that suits the values."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..scenario.kinds import DEVICE_CHANNELS, KINDS, LOOP_CHANNELS, VOLTS_CHANNELS, reports
from .metric_names import written

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
WITHOUT_PREFIX = ("1", "", "rad", "rad/s")
SPIKE = 0.005  # share of the samples that a spike has at most
LATER = 0.25  # share of a run: the transient of an error before it does not decide the prefix


class Scaled(NamedTuple):
    """The divisor of values on an axis, and the text of the unit; empty without one."""

    scale: float
    unit: str


def scaled(runs: Iterable[xr.Dataset], name: str) -> Scaled:
    """Scale and unit of a channel, the same for all of the runs."""
    each = list(runs)
    if each[0].attrs["units"] != "SI":
        unit = "1/ω0" if name == "time" else _nondimensional().get(name, "")
        return Scaled(1.0, unit)
    unit = str(each[0][name].attrs.get("units", ""))
    if unit in WITHOUT_PREFIX or unit.startswith(("kg", "N s")):
        return Scaled(1.0, "" if unit == "1" else unit)
    power = _power(max(_size(run[name].values, name) for run in each))
    return Scaled(10.0**power, f"{PREFIXES[power]}{unit}")


def _size(values: np.ndarray, name: str) -> float:
    """The size of a channel that its prefix suits: without the transient of an error and the spike of a force."""
    sizes = abs(values[int(LATER * len(values)) :] if name == "error" else values)
    sizes = sizes[np.isfinite(sizes)]
    if not sizes.size:
        return 0.0
    usual = np.quantile(sizes, 1 - SPIKE, method="higher") if name == "control" else 0.0
    return float(usual or sizes.max())


def _power(size: float) -> int:
    """The power of a thousand just below the size."""
    if not 0.0 < size < math.inf:
        return 0
    return min(max(3 * math.floor(math.log10(size) / 3 + 1e-9), min(PREFIXES)), max(PREFIXES))


@cache
def _nondimensional() -> dict[str, str]:
    """Units of the channels whose columns all have the same."""
    reported = (c for kind in KINDS for of in reports(kind) for c in of)
    listed = [*LOOP_CHANNELS, *DEVICE_CHANNELS, *VOLTS_CHANNELS, *reported]
    return {channel.name: written(channel.units[0]) for channel in listed if len(set(channel.units)) == 1}
