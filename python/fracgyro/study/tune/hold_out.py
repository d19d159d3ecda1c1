"""A tuned scenario compared with its base on noise seeds that the search has not used.

On the seeds of the search the best of many trials is biased (the winner's curse): only the held-out seeds count.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...analysis.confidence import Mean, mean_interval
from ...analysis.metric_names import ALL_METRICS, METRICS, task_columns
from ...analysis.task_runs import available
from ...scenario import Scenario
from ..controller import of_each
from .criteria import Constraint, Measured, Objective, Values, measure
from .plan import Plan
from .search import Search, Trial

RESAMPLES = 2000  # for the interval of a statistic other than the mean


@dataclass(frozen=True)
class Objected:
    """An objective of the tuned and the base scenario, on the search seeds and on the held-out seeds."""

    label: str
    metric: str
    searched_base: float
    searched: float
    base: float
    tuned: float
    difference: Mean  #: tuned - base on the held-out seeds, paired by seed
    verdict: Literal["confirmed", "refuted", "undecided"]  #: improvement over the base, decided by the interval


@dataclass(frozen=True)
class Constrained:
    """A constraint on the tuned scenario, on the search seeds and on the held-out seeds."""

    label: str
    metric: str
    searched_limit: float
    searched: float
    limit: float
    tuned: float
    kept: bool


@dataclass(frozen=True)
class Compared:
    """A metric's mean over the held-out seeds with a value, and the number of seeds without one."""

    metric: str
    words: str
    unit: str
    base: float
    tuned: float
    never_base: int
    never_tuned: int
    difference: Mean | None  #: paired, over the seeds with both values; None for fewer than two

    @property
    def neutral(self) -> bool:
        """True for bound estimates, which are states of the controller, and frequencies: smaller is not better."""
        return self.metric.startswith(("bound_", "cutoff_frequency", "frequency"))

    @property
    def verdict(self) -> Literal["better", "worse", ""]:
        """Verdict by the interval, or by the number of seeds with a value if that differs."""
        if self.never_base != self.never_tuned:
            return "better" if self.never_tuned < self.never_base else "worse"
        if self.difference is None or self.difference.low <= 0 <= self.difference.high:
            return ""
        return "better" if self.difference.mean < 0 else "worse"


@dataclass(frozen=True)
class HoldOut:
    """A tuned scenario and its base on the held-out seeds."""

    objectives: list[Objected]
    constraints: list[Constrained]
    metrics: list[Compared]
    diverged_base: int
    diverged: int


def hold_out(plan: Plan, search: Search, chosen: Trial, tuned: Scenario, progress: Callable[[int], object]) -> HoldOut:
    """Compares both scenarios on every held-out seed."""
    controllers = of_each(plan.controller, [{}, chosen.values])
    base, mine = measure([plan.base, tuned], plan.held_out, plan.thresholds, progress, controllers, plan.tasks)
    file, figures = plan.file, available(plan.base, own=plan.controller is not None)
    listed = [*METRICS, *(column for column in task_columns(plan.tasks) if column in figures)]
    return HoldOut(
        [
            _objected(objective, base, mine, own, found)
            for objective, own, found in zip(
                file.objective, search.base.objectives, chosen.score.objectives, strict=True
            )
        ],
        [
            _constrained(constraint, base, mine, limit, found)
            for constraint, limit, found in zip(file.constraint, search.limits, chosen.score.constraints, strict=True)
        ],
        [_compared(metric, base.metrics[metric], mine.metrics[metric]) for metric in listed],
        int(base.diverged.sum()),
        int(mine.diverged.sum()),
    )


def _objected(objective: Objective, base: Measured, mine: Measured, own: float, found: float) -> Objected:
    theirs, ours = base.metrics[objective.metric], mine.metrics[objective.metric]
    gap = _gap(objective, theirs, ours)
    verdict: Literal["confirmed", "refuted", "undecided"]
    verdict = "confirmed" if gap.high < 0 else "refuted" if gap.low > 0 else "undecided"
    return Objected(
        objective.label, objective.metric, own, found, objective.of(theirs), objective.of(ours), gap, verdict
    )


def _gap(objective: Objective, theirs: Values, ours: Values) -> Mean:
    """Difference of the statistic, with Student's interval for the mean and a paired bootstrap for others."""
    gap = objective.of(ours) - objective.of(theirs)
    if not math.isfinite(gap):
        return Mean(gap, -math.inf, math.inf)
    if objective.statistic == "mean":
        return mean_interval(np.abs(ours) - np.abs(theirs))
    draws = np.random.default_rng(0).integers(0, len(ours), size=(RESAMPLES, len(ours)))
    gaps = [objective.of(ours[draw]) - objective.of(theirs[draw]) for draw in draws]
    low, high = np.quantile(gaps, [0.025, 0.975], method="closest_observation")
    return Mean(gap, float(low), float(high))


def _constrained(constraint: Constraint, base: Measured, mine: Measured, limit: float, found: float) -> Constrained:
    here = constraint.limit(base)
    value = constraint.of(mine.metrics[constraint.metric])
    return Constrained(constraint.label, constraint.metric, limit, found, here, value, value <= here)


def _compared(metric: str, theirs: Values, ours: Values) -> Compared:
    theirs, ours = np.abs(theirs), np.abs(ours)
    both = np.isfinite(theirs) & np.isfinite(ours)
    words, unit = ALL_METRICS[metric]
    return Compared(
        metric,
        words,
        unit,
        float(np.nanmean(theirs)) if np.isfinite(theirs).any() else math.nan,
        float(np.nanmean(ours)) if np.isfinite(ours).any() else math.nan,
        int(np.isnan(theirs).sum()),
        int(np.isnan(ours).sum()),
        mean_interval(ours[both] - theirs[both]) if both.sum() > 1 else None,
    )
