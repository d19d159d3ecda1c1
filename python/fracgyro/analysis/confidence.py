"""Means with 95 % confidence intervals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit


class Mean(NamedTuple):
    """A mean over seeds and its 95 % confidence interval (Student's t)."""

    mean: float
    low: float
    high: float

    def __format__(self, spec: str) -> str:
        spec = spec or ".3g"
        return f"{self.mean:{spec}} [{self.low:{spec}}, {self.high:{spec}}]"


def mean_interval(values: ArrayLike) -> Mean:
    """The mean of independent values; the interval is infinite for a single one."""
    sample = np.asarray(values, dtype=float)
    mean = float(sample.mean())
    half = half_width(sample.size, float(sample.std(ddof=1)) if sample.size > 1 else np.nan)
    return Mean(mean, mean - half, mean + half)


def half_width(count: int, deviation: float) -> float:
    """Half of the interval of the mean of `count` values with this standard deviation."""
    return float(stdtrit(count - 1, 0.975) * deviation / np.sqrt(count)) if count > 1 else float(np.inf)
