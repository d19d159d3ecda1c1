"""Trends of the modes over bias and temperature: f^2 over V^2 and f over T, weighted straight lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from .diagnostics import REJECTED
from .quantity import NORMAL

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trend:
    """A line through a quantity over a state. `slope`, `intercept` with their standard deviations, in `unit`.

    `agrees`: the line fits within the intervals; if not, the deviations are wider by the root of chi^2 over its
    degrees of freedom.
    """

    name: str
    over: str
    unit: str
    slope: float
    slope_deviation: float
    intercept: float
    intercept_deviation: float
    agrees: bool
    points: tuple[tuple[float, float, float], ...]

    def plain(self) -> dict[str, Any]:
        """The trend as JSON."""
        return {
            "name": self.name,
            "over": self.over,
            "unit": self.unit,
            "slope": self.slope,
            "slope_interval": [self.slope - NORMAL * self.slope_deviation, self.slope + NORMAL * self.slope_deviation],
            "intercept": self.intercept,
            "agrees": self.agrees,
            "points": [list(each) for each in self.points],
        }


def line(name: str, over: str, unit: str, x: Sequence[float], y: Sequence[float], deviation: Sequence[float]) -> Trend:
    """The weighted least-squares line. Raises ValueError for fewer than 3 points."""
    if len(x) < 3:
        raise ValueError(f"{name} over {over} has {len(x)} points: it must have at least 3")
    at, values, sd = (np.asarray(each, dtype=float) for each in (x, y, deviation))
    weight = 1 / sd**2
    middle = float(weight @ at / weight.sum())
    about = at - middle
    slope = float(weight @ (about * values) / (weight @ about**2))
    mean = float(weight @ values / weight.sum())
    squares = float(weight @ (values - mean - slope * about) ** 2)
    freedom = len(at) - 2
    agrees = bool(chdtrc(freedom, squares) >= REJECTED)
    widen = 1.0 if agrees else math.sqrt(squares / freedom)
    slope_deviation = widen / math.sqrt(float(weight @ about**2))
    mean_deviation = widen / math.sqrt(float(weight.sum()))
    intercept_deviation = math.hypot(mean_deviation, middle * slope_deviation)
    points = tuple(zip(map(float, at), map(float, values), map(float, sd), strict=True))
    return Trend(name, over, unit, slope, slope_deviation, mean - slope * middle, intercept_deviation, agrees, points)
