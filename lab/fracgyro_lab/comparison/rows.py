"""The rows of compare.json: one for each contender in each cell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .plan import Comparison, Row
from .task import Cell, Task

RESAMPLES = 2000
Values = NDArray[np.float64]
Interval = dict[str, float | None]


@dataclass(frozen=True)
class Tuned:
    """Result of the tunings of a contender in a cell."""

    values: dict[str, Any] | None  # values of the median sampler; None without a feasible trial
    errors: list[float]  # best error by sampler seed; infinite without a feasible trial
    trials: list[list[Any]]  # all trials: error, largest constraint, feasible


def median_of(results: Sequence[dict[str, Any]]) -> Tuned:
    """The result with the median error; for an even number the worse of the two."""
    errors = [math.inf if result["error"] is None else float(result["error"]) for result in results]
    trials = [trial for result in results for trial in result["trials"]]
    middle = sorted(range(len(results)), key=lambda i: errors[i])[len(results) // 2]
    return Tuned(results[middle]["best"], errors, trials)


def made(plan: Comparison, tuned: dict[str, Tuned], judged: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """All rows by name. A row without an entry in `judged` had no feasible trial."""
    found = {}
    for row in plan.rows():
        reference = judged.get(f"{plan.task.reference}-{row.cell.name}")
        found[row.name] = _of_tuning(plan, row, tuned[row.name])
        if row.name in judged:
            found[row.name] |= _of_judging(plan.task, row.cell, judged[row.name], reference)
    for row in plan.rows():
        against = found.get(f"{plan.task.reference}-{row.cell.name}")
        if against is None or not against["kept"]:  # a ratio to an infeasible reference is meaningless
            found[row.name]["ratio"] = None
    for row in plan.rows():
        against = found.get(f"{plan.task.reference}-{row.cell.name}")
        decides = not plan.effort.quick  # a quick run does not tune
        if decides and against is not None and row.contender.name != plan.task.reference:
            found[row.name]["verdict"] = verdict(found[row.name], against)
    return found


def verdict(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> str | None:
    """ "less" or "more" error than the reference's, or "undecided"; None where either has none.

    It is decided where the interval of the ratio leaves 1 out, and so do all pairs of tunings: those of one contender
    often differ by more than the seeds of the noise do.
    """
    if mine["ratio"] is None or mine["ratio"]["value"] is None or not (mine["kept"] and theirs["kept"]):
        return None
    low, high = mine["ratio"]["low"], mine["ratio"]["high"]
    own, other = (row["sampler_errors"] or [row["metrics"]["error"]["value"]] for row in (mine, theirs))
    own, other = ([math.inf if error is None else error for error in errors] for errors in (own, other))
    if high < 1 and max(own) < min(other):
        return "less"
    return "more" if low > 1 and min(own) > max(other) else "undecided"


def _of_tuning(plan: Comparison, row: Row, tuned: Tuned) -> dict[str, Any]:
    """With what a judging adds, as it is without one."""
    contender, cell, values = row.contender, row.cell, tuned.values or {}
    gains = contender.tuned(cell.information)
    found = [gain for gain in (*gains, contender.bandwidth) if gain and gain.field in values]
    return {
        "name": contender.name,
        "words": contender.words,
        "source": contender.source,
        "ablation_of": contender.group or None,
        "scenario": cell.scenario,
        "class": cell.information,
        "noise": cell.noise,
        "ceiling": cell.ceiling,
        "tuned": bool(contender.gains) and not plan.effort.quick,
        "gains": {name: held for gain in found for name, held in gain.changes(values).items()},
        "trials": plan.effort.trials * len(tuned.errors),
        "sampler_errors": [_exp(error) for error in tuned.errors],
        "range_ends": [gain.field for gain in gains if gain.field in values and gain.at_end(values[gain.field])],
        "seeds": 0,
        "diverged": None,
        "metrics": {},
        "ratio": None,
        "verdict": None,
        "kept": False,
        "others": {},
        "front": front(tuned.trials) if cell.ceiling else [],
    }


def _of_judging(task: Task, cell: Cell, judged: dict[str, Any], reference: dict[str, Any] | None) -> dict[str, Any]:
    """`reference`: that of the contender to which ratios are."""
    error = _array(judged["error"])
    return {
        "seeds": len(error),
        "diverged": judged["diverged"],
        "metrics": {"error": interval(task, "error", error), **_metrics(task, judged["metrics"])},
        "ratio": None if reference is None else ratio(error, _array(reference["error"])),
        "kept": not judged["diverged"] and _keeps(task, cell, judged["metrics"]),
        "others": {name: other(task, error, _array(listed)) for name, listed in judged["others"].items()},
    }


def _metrics(task: Task, by_seed: dict[str, list[float | None]]) -> dict[str, Interval]:
    return {name: interval(task, name, _array(listed)) for name, listed in by_seed.items()}


def _keeps(task: Task, cell: Cell, metrics: dict[str, list[float | None]]) -> bool:
    return all(c.of(_array(metrics[c.metric])) <= (c.at_most or 0.0) for c in task.constraints(cell.ceiling))


def other(task: Task, error: Values, changed: Values) -> dict[str, Any]:
    """Against the same seeds without the change. `lost`: runs that diverged, or have lost what they had to follow."""
    return {**ratio(changed, error[: len(changed)]), "lost": int((changed >= task.lost).sum()), "seeds": len(changed)}


def ratio(mine: Values, theirs: Values) -> Interval:
    """Geometric mean of the errors' ratio, paired by seed, with a 95 % bootstrap interval.

    NaN if any run diverged: diverged runs are not left out.
    """
    gaps = mine - theirs if np.isfinite(mine).all() and np.isfinite(theirs).all() else np.array([math.nan])
    draws = np.random.default_rng(0).integers(0, len(gaps), size=(RESAMPLES, len(gaps)))
    low, high = np.quantile(gaps[draws].mean(axis=1), [0.025, 0.975])
    return {"value": _exp(gaps.mean()), "low": _exp(low), "high": _exp(high)}


def front(trials: Sequence[Sequence[Any]]) -> list[list[float]]:
    """[chattering, error] of the trials that no other beats in both, feasible or not, by rising chattering."""
    points = sorted((c, e) for e, c, _ in trials if e is not None and c is not None)
    kept: list[list[float]] = []
    for chattering, error in points:
        if not kept or error < kept[-1][1]:
            kept.append([chattering, error])
    return [[chattering, math.exp(error)] for chattering, error in kept]


def interval(task: Task, metric: str, values: Values) -> Interval:
    """Without a value where a run has none."""
    if not np.isfinite(values).all():
        return {"value": None, "low": None, "high": None}
    mean, low, high = task.interval(metric, values)
    return {"value": mean, "low": _finite(low), "high": _finite(high)}


def _array(listed: Sequence[float | None]) -> Values:
    return np.array([math.inf if value is None else value for value in listed])


def _exp(value: float) -> float | None:
    return _finite(math.exp(value)) if value < 700 else None


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
