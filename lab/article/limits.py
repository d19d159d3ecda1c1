"""The limit of tracking (docs/limit.md) in the settings of the comparison, in its measure of error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import fracgyro as fg
import numpy as np
import xarray as xr
from fracgyro.scenario import Scenario
from fracgyro_lab.comparison.task import sensed
from fracgyro_lab.comparison.track import Track

POINTS = 16  # on the line


class Limit(NamedTuple):
    """RMS errors in q0: steady on x and y, and the geometric mean of these and the errors of the transient."""

    steady: tuple[float, float]
    total: float


@lru_cache
def scenario(information: str, noise: float) -> Scenario:
    return sensed(Track().scenarios()["paper"], information, noise)


@lru_cache
def limit(information: str, noise: float, ceiling: float) -> Limit | None:
    """None where no law keeps the ceiling."""
    try:
        found = fg.limit.tracking(scenario(information, noise), chattering=ceiling)
    except ValueError:
        return None
    x, y = (float(each) for each in found["rmse_steady"].values)
    return Limit((x, y), float(_total(found)))


def line(information: str, noise: float, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """(chattering, total error) from one ceiling to another."""
    ceilings = np.geomspace(low, high, POINTS)
    return ceilings, _total(fg.limit.tracking(scenario(information, noise), chattering=ceilings.tolist()))


def _total(found: xr.Dataset) -> np.ndarray:
    """The error that Track.error measures."""
    steady, transient = (np.log(found[name].values).mean(axis=-1) for name in ("rmse_steady", "rmse_transient"))
    return np.asarray(np.exp((steady + transient) / 2))


def over(steady: Sequence[float], of: Limit | None) -> float:
    """Steady errors on x and y over those of the limit, geometric mean; infinite if either is missing."""
    if of is None or not all(math.isfinite(each) for each in steady):
        return math.inf
    return math.sqrt(math.prod(steady) / math.prod(of.steady))
