"""Sobol indices: the fraction of a metric's variance over the points that each field causes.

The design has blocks of points A and B and, for each field i, AB_i: A with the values of that field from B (Saltelli et
al. 2010, doi:10.1016/j.cpc.2009.09.018). The estimators are scipy's.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...analysis.html import csv_text
from .effects import Rows

Array = NDArray[np.float64]
RESAMPLES, RESAMPLES_PER_PASS = 1000, 10  # bootstrap resamples; those in memory at a time


@dataclass(frozen=True)
class Index:
    """Indices of a field for the mean of a metric over the seeds, with 95 % bootstrap intervals over the points."""

    metric: str
    field: str
    first: float  #: S, first order: fraction of the variance caused by the field without interactions
    first_low: float
    first_high: float
    total: float  #: S_T: the same, including interactions with other fields
    total_low: float
    total_high: float

    def cells(self) -> list[str]:
        """S and S_T with their intervals, for tables."""
        return [
            f"{value:.3f} [{low:.3f}, {high:.3f}]".replace("-", "\N{MINUS SIGN}")
            for value, low, high in (
                (self.first, self.first_low, self.first_high),
                (self.total, self.total_low, self.total_high),
            )
        ]


@dataclass(frozen=True)
class Sensitivity:
    """Sobol indices of the metrics in the summary."""

    indices: list[Index]
    missing: dict[str, str]  #: why a metric has none

    def csv(self) -> str:
        return csv_text([each.name for each in fields(Index)], (asdict(index).values() for index in self.indices))


def sensitivity(rows: Rows) -> Sensitivity:
    plan, found = rows.plan, Sensitivity([], {})
    for name in plan.study.show:
        values = rows.by_point(name).mean(axis=1)
        lost = int(np.isnan(values).sum())
        if lost:
            # Without these points the fields would not vary independently, and the estimates would be invalid.
            found.missing[name] = (
                f"{lost} of {len(values)} points have a run without it, and indices require all points"
            )
        elif np.ptp(values) == 0:
            found.missing[name] = "it is the same at every point"
        else:
            numbers = indices(values.reshape(len(plan.fields) + 2, -1), plan.study.design.seed)
            found.indices.extend(Index(name, *each) for each in zip(plan.fields, *numbers.tolist(), strict=True))
    return found


def indices(blocks: Array, seed: int) -> Array:
    """Numbers of `Index` for each field, (6, d), from a metric at the points of A, B, AB_1 ... AB_d, (d + 2, n)."""
    count, rng = blocks.shape[1], np.random.default_rng(seed)
    found = _each(np.stack([blocks, blocks], axis=1))[0]
    drawn = (rng.integers(count, size=(RESAMPLES_PER_PASS, count)) for _ in range(0, RESAMPLES, RESAMPLES_PER_PASS))
    resampled = np.concatenate([_each(blocks[:, rows]) for rows in drawn])
    low, high = np.quantile(resampled, (0.025, 0.975), axis=0)
    return np.stack([found, low, high], axis=1).reshape(6, -1)


def _each(blocks: Array) -> Array:
    """First and total indices, (samples, 2, d), of `blocks`, (d + 2, samples, n)."""
    from scipy.stats import sobol_indices  # takes half a second

    found = sobol_indices(func={"f_A": blocks[0], "f_B": blocks[1], "f_AB": blocks[2:]}, n=blocks.shape[2])
    # scipy drops an axis of length 1 and fails if there are two such axes; there are at least two samples.
    return np.stack(
        [np.reshape(each, (blocks.shape[1], -1)) for each in (found.first_order, found.total_order)], axis=1
    )
