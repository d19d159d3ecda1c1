"""Statistics without rows: what a block's metadata has for the summary, and the sums over all blocks.

Means and intervals are those of effects.py, to rounding. In a grid or a list an interval is over the seeds, and over at
most MAX_GROUPS groups of consecutive ones, so that memory grows neither with the points nor with the seeds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ...analysis.confidence import Mean, half_width, mean_interval
from ..space import Dimension
from .blocks import Block
from .design import Plan
from .effects import MAX_BINS, RUNS_PER_BIN, Axis, Best, Effect, axis_of

MAX_GROUPS = 32  # groups of seeds
BEST = 5  # points kept for each metric
Array = NDArray[np.float64]
Kept = dict[str, Any]  # aggregates of a block, as JSON


@dataclass
class Moments:
    """Number, mean, sum of squared deviations, least and greatest of values that are not kept."""

    count: int = 0
    mean: float = 0.0
    squares: float = 0.0
    least: float = math.inf
    greatest: float = -math.inf

    @classmethod
    def of(cls, values: Array) -> Moments:
        """Moments of all values that are not NaN."""
        there = values[~np.isnan(values)]
        if not len(there):
            return cls()
        mean = float(there.mean())
        return cls(len(there), mean, float(((there - mean) ** 2).sum()), float(there.min()), float(there.max()))

    def listed(self) -> list[float]:
        return [self.count, self.mean, self.squares, self.least, self.greatest] if self.count else [0]

    def add(self, other: Moments) -> None:
        if other.count:
            both = self.count + other.count
            apart = other.mean - self.mean
            self.squares += other.squares + apart**2 * self.count * other.count / both
            self.mean += apart * other.count / both
            self.count = both
            self.least, self.greatest = min(self.least, other.least), max(self.greatest, other.greatest)

    def interval(self) -> Mean:
        """The mean with its interval; NaN without values."""
        if not self.count:
            return Mean(math.nan, math.nan, math.nan)
        half = half_width(self.count, self.deviation)
        return Mean(self.mean, self.mean - half, self.mean + half)

    @property
    def deviation(self) -> float:
        """Standard deviation; NaN for less than two values."""
        return math.sqrt(self.squares / (self.count - 1)) if self.count > 1 else math.nan


def kept(plan: Plan, block: Block, table: pa.Table) -> Kept:
    """Needs of the summary from a block with these rows, by field, metric and place on the field's axis."""
    shape = len(block.values), len(block.seeds)
    gone = ~np.isnan(np.asarray(table["diverged_at"].to_numpy())).reshape(shape)
    values = {name: np.where(gone, np.nan, table[name].to_numpy().reshape(shape)) for name in plan.study.show}
    found: Kept = {"show": list(values), "fields": {}}
    if len(block.seeds) < len(plan.seeds):  # one point
        found["part"] = {name: Moments.of(each).listed() for name, each in values.items()}
    else:
        found["best"] = {name: _best(block, values, name) for name in values}
    for dimension in plan.dimensions:
        along = axis_of(plan, dimension, bins_of(plan), block.values)
        found["fields"][dimension.field] = {
            str(place): _of_place(plan, block, here, gone, values)
            for place in np.unique(along.index).tolist()
            for here in [along.index == place]
        }
    return found


def bins_of(plan: Plan) -> int:
    return int(np.clip(plan.runs // (2 * RUNS_PER_BIN), 2, MAX_BINS))


def _of_place(plan: Plan, block: Block, here: NDArray[np.bool_], gone: NDArray[np.bool_], values: Any) -> Kept:
    """Runs of the points `here`, and diverged ones; for each metric the runs that have it, and units of its mean."""
    found: Kept = {"runs": int(gone[here].size), "diverged": int(gone[here].sum()), "metrics": {}}
    for name, each in values.items():
        inside = each[here]
        there = ~np.isnan(inside)
        units: Any
        if not plan.sampled:
            groups = group_of(plan, block)
            sums = np.bincount(groups, np.where(there, inside, 0.0).sum(axis=0))
            units = [[int(g), float(sums[g]), int(there[:, groups == g].sum())] for g in np.unique(groups)]
        elif len(block.seeds) < len(plan.seeds):
            units = None  # with the other parts of the point
        else:
            counts = there.sum(axis=1)
            means = np.where(there, inside, 0.0).sum(axis=1)[counts > 0] / counts[counts > 0]
            units = Moments.of(means).listed()
        found["metrics"][name] = [int(there.sum()), units]
    return found


def group_of(plan: Plan, block: Block) -> NDArray[np.int64]:
    """The group of each seed of the block."""
    places = np.arange(len(block.seeds)) + block.first_seed
    return places * min(len(plan.seeds), MAX_GROUPS) // len(plan.seeds)


def _best(block: Block, values: dict[str, Array], name: str) -> Kept:
    """Points of the block in which every run has the metric: their number, and those with the least mean magnitude."""
    means = np.abs(values[name].mean(axis=1))
    eligible = int(np.isfinite(means).sum())
    ranked = np.argsort(means, kind="stable")[: min(BEST, eligible)].tolist()
    points = [
        [float(means[p]), block.first + p, [_whole(Moments.of(each[p]), each.shape[1]) for each in values.values()]]
        for p in ranked
    ]
    return {"eligible": eligible, "points": points}


def _whole(moments: Moments, seeds: int) -> list[float]:
    """Moments of a point; none unless all its runs have the metric."""
    return (moments if moments.count == seeds else Moments()).listed()


@dataclass
class _Place:
    """Sums at one place of an axis, for one metric."""

    runs: int = 0
    units: Moments = field(default_factory=Moments)  # in a sample: means of points
    sums: Array = field(default_factory=lambda: np.zeros(MAX_GROUPS))  # in a grid: of the groups of seeds
    counts: Array = field(default_factory=lambda: np.zeros(MAX_GROUPS))

    def mean(self, sampled: bool) -> Mean | None:
        if not self.runs:
            return None
        there = self.counts > 0
        return self.units.interval() if sampled else mean_interval(self.sums[there] / self.counts[there])


class Totals:
    """Sums over all blocks of a plan, added in order."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.runs = self.diverged = 0
        self.spread = {name: Moments() for name in plan.study.show}
        self.axes = {d.field: axis_of(plan, d, bins_of(plan), plan.points[:0]) for d in plan.dimensions}
        self._counts = {d.field: np.zeros((len(self.axes[d.field].places), 2), dtype=int) for d in plan.dimensions}
        self._places: dict[tuple[str, str, int], _Place] = {}
        self._best: dict[str, list[Any]] = {name: [] for name in plan.study.show}
        self._eligible = dict.fromkeys(plan.study.show, 0)
        self._part: dict[str, Moments] = {}  # the point whose seeds are in several blocks
        self._part_runs = 0

    @classmethod
    def over(cls, plan: Plan, all_aggregates: Iterable[tuple[Block, Kept]]) -> Totals:
        totals = cls(plan)
        for block, found in all_aggregates:
            totals.add(block, found)
        return totals

    def add(self, block: Block, found: Kept) -> None:
        """Adds a block with these aggregates, as `aggregates` in block_files.py gives them."""
        self.runs += found["rows"]
        self.diverged += found["diverged"]
        for name, spread in self.spread.items():
            spread.add(_moments(found["metrics"][name]))
        for of_field, places in found["summary"]["fields"].items():
            for place, here in places.items():
                self._counts[of_field][int(place)] += here["runs"], here["diverged"]
                for name, (runs, units) in here["metrics"].items():
                    self._add_units(of_field, name, int(place), runs, units)
        if "part" in found["summary"]:
            self._add_part(block, found)
            return
        for name, best in found["summary"]["best"].items():
            self._eligible[name] += best["eligible"]
            self._keep(name, best["points"])

    def _add_units(self, of_field: str, name: str, place: int, runs: int, units: Any) -> None:
        sums = self._places.setdefault((of_field, name, place), _Place())
        sums.runs += runs
        if units is None:  # a part of a point
            return
        if self.plan.sampled:
            sums.units.add(_moments(units))
            return
        for group, total, count in units:
            sums.sums[group] += total
            sums.counts[group] += count

    def _add_part(self, block: Block, found: Kept) -> None:
        if not self._part_runs:
            self._part = {name: Moments() for name in self.plan.study.show}
        self._part_runs += found["rows"]
        for name, each in found["summary"]["part"].items():
            self._part[name].add(_moments(each))
        if self._part_runs < len(self.plan.seeds):
            return
        self._part_runs = 0
        seeds = len(self.plan.seeds)
        moments = [_whole(each, seeds) for each in self._part.values()]
        for name, each in self._part.items():
            if each.count == seeds:
                self._eligible[name] += 1
                self._keep(name, [[abs(each.mean), block.first, moments]])
            if self.plan.sampled and each.count:
                for of_field, places in found["summary"]["fields"].items():
                    for place in map(int, places):
                        self._places[of_field, name, place].units.add(Moments.of(np.array([each.mean])))

    def _keep(self, name: str, points: list[Any]) -> None:
        self._best[name] = sorted([*self._best[name], *points], key=lambda each: each[:2])[:BEST]

    def never(self, name: str) -> int:
        """Runs that did not diverge and lack the metric."""
        return self.runs - self.diverged - self.spread[name].count

    def effect(self, name: str, dimension: Dimension) -> Effect:
        along = self.axes[dimension.field]
        places = [self._places.get((dimension.field, name, at), _Place()) for at in range(len(along.places))]
        runs = self._counts[dimension.field][:, 0]
        means = [place.mean(self.plan.sampled) for place in places]
        return Effect(along, means, [p.runs < n for p, n in zip(places, runs.tolist(), strict=True)], None)

    def best(self, name: str) -> tuple[list[Best], int]:
        """The same as `best` in effects.py: points with the least mean magnitude, and the number of eligible ones."""
        found = [
            Best(point, self.plan.points[point], [_moments(each).interval() for each in moments])
            for _, point, moments in self._best[name]
        ]
        return found, self._eligible[name]

    def diverged_where(self) -> list[tuple[Axis, list[tuple[int, int]]]]:
        """For each field: its axis, and at each place the runs and those that diverged."""
        return [(self.axes[name], [(int(n), int(g)) for n, g in each]) for name, each in self._counts.items()]


def _moments(listed: list[float]) -> Moments:
    return Moments(int(listed[0]), *listed[1:])
