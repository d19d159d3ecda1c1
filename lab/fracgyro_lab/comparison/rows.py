"""The rows of compare.json: one for each contender in each cell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .limits import over
from .plan import Comparison, Row
from .task import Cell, Task

RESAMPLES = 2000
Values = NDArray[np.float64]
Interval = dict[str, float | None]


@dataclass(frozen=True)
class Tuned:
    """Result of the tuning of a contender in a cell."""

    values: dict[str, Any] | None  # from the search with the least error; None if a run of each trial broke a limit
    searched: list[dict[str, Any]] = field(default_factory=list)  # best values of the other searches that have some
    errors: list[float] = field(default_factory=list)  # logarithms by search, on training seeds; infinite: none found
    trials: int = 0
    converged: bool | None = None  # True if the searches agree; None if there is nothing to tune
    front: list[list[float]] = field(default_factory=list)
    found: list[dict[str, Any] | None] = field(default_factory=list)  # best values by search

    @classmethod
    def of(cls, result: Mapping[str, Any]) -> Tuned:
        """From the result of `Tuning.measure`."""
        searches = result["samplers"]
        errors = [math.inf if each["error"] is None else float(each["error"]) for each in searches]
        order = sorted(range(len(searches)), key=lambda i: errors[i])
        first, *others = (searches[i]["best"] for i in order)
        return cls(
            first,
            [values for values in others if values is not None],
            errors,
            result["trials"],
            result["converged"],
            result["front"],
            [each["best"] for each in searches],
        )


def made(
    plan: Comparison, tuned: dict[str, Tuned], judged: dict[str, dict[str, Any]], limits: Sequence[Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    """All rows by name. A row without an entry in `judged` had no feasible trial."""
    by_sensing = {(limit["scenario"], limit["class"], limit["noise"]): dict(limit) for limit in limits}
    found = {}
    for row in plan.rows:
        found[row.name] = _of_tuning(plan, row, tuned[row.name])
        if row.name in judged:
            found[row.name] |= _of_judging(plan.task, row.cell, judged[row.name])
            figures = {name: each["value"] for name, each in found[row.name]["metrics"].items()}
            found[row.name]["over_limit"] = over(by_sensing.get(row.cell.sensing), row.cell.ceiling, figures)
    for row in plan.rows:
        theirs = f"{plan.task.reference}-{row.cell.name}"
        against, mine = found.get(theirs), found[row.name]
        # A ratio to a reference that breaks a limit is meaningless.
        if against is None or not against["kept"] or row.name not in judged:
            continue
        mine["ratio"] = ratio_of(judged[row.name], judged[theirs], _failed(tuned[row.name]), _failed(tuned[theirs]))
        if not plan.effort.quick and row.contender.name != plan.task.reference:  # a quick run does not tune
            mine["verdict"] = verdict(mine)
    return found


def _failed(tuned: Tuned) -> bool:
    return not all(map(math.isfinite, tuned.errors))


def verdict(mine: Mapping[str, Any]) -> str | None:
    """ "less" or "more" error than the reference's, or "undecided"; None without a ratio within the limits.

    It is decided where the interval of the ratio, which covers all pairs of searches, leaves 1 out.
    """
    if mine["ratio"] is None or mine["ratio"]["value"] is None or not mine["kept"]:
        return None
    low, high = mine["ratio"]["low"], mine["ratio"]["high"]
    if high is not None and high < 1:
        return "less"
    return "more" if low is not None and low > 1 else "undecided"


def ratio_of(mine: Mapping[str, Any], theirs: Mapping[str, Any], failed: bool, theirs_failed: bool) -> Interval:
    """Ratio of the errors of both best searches, with the 95 % intervals of all pairs of searches together.

    `failed`: a search has found nothing, and its end is open: the upper one, or for the other contender the lower.
    """
    own, other = ([_array(each) for each in (one["error"], *one["searched"])] for one in (mine, theirs))
    pairs = [ratio(first, second) for first in own for second in other]
    lows, highs = ([pair[end] for pair in pairs] for end in ("low", "high"))
    return {
        "value": pairs[0]["value"],
        "low": None if theirs_failed or None in lows else min(low for low in lows if low is not None),
        "high": None if failed or None in highs else max(high for high in highs if high is not None),
    }


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
        "trials": tuned.trials,
        "converged": tuned.converged,
        "sampler_errors": [_exp(error) for error in tuned.errors],
        "sampler_values": tuned.found,
        "range_ends": [gain.field for gain in gains if gain.field in values and gain.at_end(values[gain.field])],
        "seeds": 0,
        "diverged": None,
        "metrics": {},
        "ratio": None,
        "verdict": None,
        "kept": False,
        "range": None,
        "over_limit": None,
        "others": {},
        "front": tuned.front,
    }


def _of_judging(task: Task, cell: Cell, judged: dict[str, Any]) -> dict[str, Any]:
    error = _array(judged["error"])
    searches = [interval(task, "error", _array(each))["value"] for each in (judged["error"], *judged["searched"])]
    known = [each for each in searches if each is not None]
    return {
        "seeds": len(error),
        "diverged": judged["diverged"],
        "metrics": {"error": interval(task, "error", error), **_metrics(task, judged["metrics"])},
        "range": [min(known), max(known)] if len(known) == len(searches) else None,
        "kept": not judged["diverged"] and _keeps(task, cell, judged["metrics"]),
        "others": {
            name: {**other(task, error, _array(listed)), "chattering": judged["limited"][name]}
            for name, listed in judged["others"].items()
        },
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
