"""Statistics of the rows: means and quantiles along one field, over pairs of fields, and the best points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ...analysis.confidence import Mean, mean_interval
from ...scenario.table import toml_value
from ..space import Dimension
from .design import Plan
from .point_columns import Points

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
MAX_BINS, RUNS_PER_BIN = 8, 8  # for a field without levels
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """The rows as columns. A metric is NaN if its event never occurred; `kept` excludes diverged runs."""

    plan: Plan
    table: pa.Table
    kept: NDArray[np.bool_]

    @classmethod
    def of(cls, plan: Plan, table: pa.Table) -> Rows:
        return cls(plan, table, np.isnan(_column(table, "diverged_at")))

    @property
    def sampled(self) -> bool:
        """True if the points are a random sample of the space."""
        return self.plan.sampled

    @property
    def diverged(self) -> int:
        return int((~self.kept).sum())

    def metric(self, name: str) -> Array:
        """Values of a metric, NaN also for diverged runs: (runs,)."""
        return np.where(self.kept, _column(self.table, name), np.nan)

    def by_point(self, name: str) -> Array:
        """Values of a metric: (points, seeds)."""
        order = np.lexsort((np.array(self.table["seed"]), np.array(self.table["point"])))
        return self.metric(name)[order].reshape(len(self.plan.points), -1)

    def independent(self) -> Rows:
        """Rows of independent points: blocks A and B of a design for Sobol indices, otherwise all."""
        if self.plan.study.design.kind != "sobol_indices":
            return self
        count = 2 * len(self.plan.points) // (len(self.plan.dimensions) + 2)
        plan = replace(self.plan, points=self.plan.points[:count])
        return Rows.of(plan, self.table.filter(pc.less(self.table["point"], count)))

    def units(self) -> NDArray[np.int64]:
        """Index of the independent unit of each row: its point in a random sample, otherwise its seed."""
        name = "point" if self.sampled else "seed"
        return np.unique(_column(self.table, name), return_inverse=True)[1].astype(np.int64)


@dataclass(frozen=True)
class Axis:
    """A field divided into levels or bins."""

    field: str
    names: list[str]  # names of the levels or bins
    places: Array  # values of the levels or centers of the bins; 0, 1, 2 ... for values that are not numbers
    edges: Array | None  # edges of the bins
    log: bool
    numeric: bool
    index: NDArray[np.int64]  # level or bin of each row


@dataclass(frozen=True)
class Effect:
    """A metric along an axis."""

    axis: Axis
    means: list[Mean | None]  # None: no run has a value
    partial: list[bool]  # True: some runs were excluded
    quantiles: Array | None  # (QUANTILES, place); "never" counts as infinite; None unless the design is random


@dataclass(frozen=True)
class Cells:
    """A metric over two axes: its mean (grids and lists) or median (random designs)."""

    across: Axis
    up: Axis
    values: Array  # (up, across); NaN: no run has a value
    partial: NDArray[np.bool_]
    empty: NDArray[np.bool_]  # True: no run


@dataclass(frozen=True)
class Best:
    """A point without diverged runs and missing values."""

    point: int
    values: tuple[Any, ...]
    means: list[Mean]  # means of the shown metrics


def axis(rows: Rows, dimension: Dimension, bins: int) -> Axis:
    along = axis_of(rows.plan, dimension, bins, rows.plan.points)
    return replace(along, index=along.index[np.array(rows.table["point"])])


def axis_of(plan: Plan, dimension: Dimension, bins: int, points: Points) -> Axis:
    """The axis of a field; its `index` is that of these points of the plan."""
    levels, values = dimension.grid(), points.column(plan.dimensions.index(dimension))
    if levels is None:
        spaced = np.geomspace if dimension.scale == "log" else np.linspace
        edges = np.asarray(spaced(dimension.low, dimension.high, bins + 1))
        index = np.clip(np.searchsorted(edges, np.array(values, dtype=float), side="right") - 1, 0, bins - 1)
        log = dimension.scale == "log"
        middles = np.sqrt(edges[1:] * edges[:-1]) if log else 0.5 * (edges[1:] + edges[:-1])
        names = [f"{low:.3g} to {high:.3g}" for low, high in pairwise(edges)]
        return Axis(dimension.field, names, middles, edges, log, True, index)
    levels = tuple(dict.fromkeys(levels))
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) and np.isfinite(v) for v in levels)
    levels = tuple(sorted(levels)) if numeric else levels
    number = {level: i for i, level in enumerate(levels)}
    index = np.array([number[value] for value in values], dtype=np.int64)
    names = [f"{level:.4g}" if isinstance(level, float) else str(_plain(level)) for level in levels]
    places = np.array(levels, dtype=float) if numeric else np.arange(float(len(levels)))
    log = numeric and len(levels) > 2 and places[0] > 0 and _even(np.log(places)) and not _even(places)
    return Axis(dimension.field, names, places, None, bool(log), numeric, index)


def effect(rows: Rows, name: str, dimension: Dimension) -> Effect:
    along = axis(rows, dimension, int(np.clip(rows.plan.runs // (2 * RUNS_PER_BIN), 2, MAX_BINS)))
    metric, units = rows.metric(name), rows.units()
    means, partial, quantiles = [], [], []
    for place in range(len(along.places)):
        here = along.index == place
        left = here & ~np.isnan(metric)
        means.append(_mean(metric[left], units[left]))
        partial.append(bool(left.sum() < here.sum()))
        quantiles.append(_quantiles(rows, name, here))
    return Effect(along, means, partial, np.array(quantiles).T if rows.sampled else None)


def cells(rows: Rows, name: str, across: Dimension, up: Dimension) -> Cells:
    bins = int(np.clip(np.sqrt(len(rows.plan.points) / RUNS_PER_BIN), 2, MAX_BINS))
    x, y, metric = axis(rows, across, bins), axis(rows, up, bins), rows.metric(name)
    shape = len(y.places), len(x.places)
    cell = y.index * shape[1] + x.index
    left = ~np.isnan(metric)
    there, counted = (np.bincount(c, minlength=shape[0] * shape[1]) for c in (cell, cell[left]))
    values = np.full(len(there), np.nan)
    filled = np.flatnonzero(counted)
    by_cell = metric[left][np.argsort(cell[left], kind="stable")]
    middle = np.median if rows.sampled else np.mean
    values[filled] = [middle(inside) for inside in np.split(by_cell, np.cumsum(counted[filled])[:-1])]
    partial = counted < there
    return Cells(x, y, values.reshape(shape), partial.reshape(shape), (there == 0).reshape(shape))


def quantiles(rows: Rows, name: str) -> Array:
    return _quantiles(rows, name, np.ones(rows.plan.runs, dtype=bool))


def rank_correlation(rows: Rows, name: str, dimension: Dimension) -> float:
    """Spearman correlation between a numeric field and the means of the points; NaN for too few points."""
    place = rows.plan.dimensions.index(dimension)
    metric, points = rows.metric(name), np.array(rows.table["point"])
    left = ~np.isnan(metric)
    sums, counts = (np.bincount(points[left], w, len(rows.plan.points)) for w in (metric[left], None))
    good = counts > 0
    values = np.array(rows.plan.points.column(place), dtype=float)[good]
    ranks = _ranks(values), _ranks(sums[good] / counts[good])
    if len(values) < 3 or any(np.ptp(r) == 0 for r in ranks):
        return float("nan")
    return float(np.corrcoef(*ranks)[0, 1])


def best(rows: Rows, name: str, shown: Sequence[str], count: int) -> tuple[list[Best], int]:
    """The `count` points with the smallest mean magnitude of the metric, and the number of eligible points.

    A point is eligible if none of its runs diverged or lacks the metric.
    """
    by_point = {metric: rows.by_point(metric) for metric in {name, *shown}}
    means = np.abs(by_point[name].mean(axis=1))  # NaN unless all runs count
    ranked = np.argsort(means, kind="stable")[: min(count, int(np.isfinite(means).sum()))]
    found = [
        Best(int(p), rows.plan.points[p], [mean_interval(by_point[metric][p]) for metric in shown]) for p in ranked
    ]
    return found, int(np.isfinite(means).sum())


def _column(table: pa.Table, name: str) -> Array:
    return np.asarray(table[name].to_numpy())


def _ranks(values: Array) -> Array:
    """Ranks from 1; equal values share their mean rank."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * (counts - 1))[place])


def _plain(level: Any) -> Any:
    return level if isinstance(level, str) else toml_value(level)


def _even(values: Array) -> bool:
    gaps = np.diff(values)
    return bool(np.ptp(gaps) < 1e-6 * np.abs(gaps).max())


def _mean(values: Array, units: NDArray[np.int64]) -> Mean | None:
    """Mean with its interval over the independent units."""
    if not len(values):
        return None
    sums, counts = np.bincount(units, values), np.bincount(units)
    return mean_interval(sums[counts > 0] / counts[counts > 0])


def _quantiles(rows: Rows, name: str, here: NDArray[np.bool_]) -> Array:
    """Quantiles of the runs that did not diverge; "never" counts as infinite."""
    values = np.where(np.isnan(rows.metric(name)), np.inf, rows.metric(name))[here & rows.kept]
    return np.quantile(values, QUANTILES, method="inverted_cdf") if len(values) else np.full(len(QUANTILES), np.nan)
