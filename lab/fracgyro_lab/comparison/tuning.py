"""One tuning: a contender in a cell, by several searches until they agree. It can be sent to another process."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.study.tune.criteria import Measured, Score, score

from .contender import Contender
from .converge import Point, converged, search
from .journal import Journal, opened
from .own import controller_of
from .task import Cell, Task

MARGIN = 0.99  # share of a limit while searching: other seeds have somewhat more
# Penalty over the logarithm of a constraint over its limit: above what a law gains by breaking it, or the search is
# repeated with the next. A steep one makes a sharp ridge of the limit, on which CMA-ES shrinks its steps too soon.
STEEP = (1.0, 6.0)
BROKEN, LOST = 100.0, 1000.0  # values of a trial without an error, and of one that diverged
CONFIRMED = 4  # best trials of a search that all training seeds then judge
ATTEMPTS = 4  # times as many, if none of them keeps the limits


@dataclass(frozen=True)
class Tuning:
    """A unit of work: the tuning of a contender in a cell."""

    task: Task
    contender: Contender
    cell: Cell
    base: Scenario  # with the cell's sensing
    starts: tuple[Mapping[str, float], ...]  # known good gains, of special cases and of the next lower ceiling
    trials: int  # the most of each search
    seeds: list[int]  # training seeds
    few: int  # number of them that a search uses
    samplers: int  # number of searches
    storage: str | None  # database of finished trials

    @property
    def name(self) -> str:
        return f"{self.contender.name}-{self.cell.name}"

    @property
    def runs(self) -> int:
        return self.samplers * (self.trials * self.few + CONFIRMED * len(self.seeds))

    def measure(self) -> dict[str, Any]:
        """By search: the best gains with their error; the number of trials, and their front."""
        with opened(self.storage, self._parts()) as journal:
            trials = _Trials(self, journal)
            for trials.steep in STEEP:
                samplers = search(
                    trials.goals,
                    len(trials.gains),
                    [np.array([gain.share(start[gain.field]) for gain in trials.gains]) for start in self.starts],
                    range(1, self.samplers + 1),
                    self.trials,
                )
                if trials.ended_within_the_limits():
                    break
            found = [self._confirmed(trials.best(i)) for i in range(len(samplers))]
        errors = [math.inf if each["error"] is None else float(each["error"]) for each in found]
        return {
            "samplers": found,
            "trials": trials.count,
            "converged": all(map(math.isfinite, errors)) and converged(errors),
            "front": trials.front(),
        }

    def _confirmed(self, best: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """The best trial on all training seeds, among the first of these."""
        for attempt in range(ATTEMPTS):
            candidates = best[CONFIRMED * attempt :][:CONFIRMED]
            scores = self.scores(candidates, self.seeds)
            errors = [self.error(one) if one and one.feasible else math.inf for one in scores]
            if errors and min(errors) < math.inf:
                least = int(np.argmin(errors))
                values = self.task.completed(self.contender, self.base, candidates[least])
                return {"best": values, "error": errors[least]}
        return {"best": None, "error": None}

    def error(self, found: Score) -> float:
        """Logarithm of the error that is compared."""
        return _mean_log(found.objectives[: self.task.compared])

    def scores(self, points: Sequence[dict[str, Any]], seeds: Sequence[int]) -> list[Score | None]:
        """Scores of gains; None where they make no valid scenario."""
        given = [self._scenario(point) for point in points]
        valid = [each for each in given if each is not None]
        measured = iter(self._measured(valid, seeds))
        constraints = self.task.constraints(self.cell.ceiling)
        limits = [constraint.at_most or 0.0 for constraint in constraints]
        return [
            None if each is None else score(next(measured), self.task.objectives, constraints, limits) for each in given
        ]

    def _scenario(self, point: dict[str, Any]) -> tuple[dict[str, Any], Scenario] | None:
        values = self.task.completed(self.contender, self.base, point)
        try:
            return None if values is None else (values, self.contender.scenario(self.base, values))
        except ScenarioError:
            return None

    def _measured(self, given: Sequence[tuple[dict[str, Any], Scenario]], seeds: Sequence[int]) -> list[Measured]:
        if self.contender.own is None:
            return self.task.train([scenario for _, scenario in given], seeds, self.base, None)
        controllers = (controller_of(self.contender, values) for values, _ in given)
        each = zip(given, controllers, strict=True)
        return [m for (_, scenario), law in each for m in self.task.train([scenario], seeds, self.base, law)]

    def _parts(self) -> dict[str, Any]:
        """Everything that the value of a trial depends on."""
        return {
            "version": version("fracgyro"),
            "task": self.task.name,
            "contender": repr(self.contender),
            "cell": asdict(self.cell),
            "base": self.base.model_dump(),
            "seeds": self.seeds[: self.few],
        }


class _Trials:
    """The trials of all searches of a tuning.

    A result is the value without penalties that is minimized, the largest constraint over its limit, the error and the
    largest constraint.
    """

    def __init__(self, tuning: Tuning, journal: Journal) -> None:
        self._tuning, self._journal = tuning, journal
        self.steep = STEEP[0]
        self.gains = tuning.contender.tuned(tuning.cell.information)
        self._limits = [MARGIN * (c.at_most or 0.0) for c in tuning.task.constraints(tuning.cell.ceiling)]
        self._found: dict[tuple[float, ...], list[Any]] = {}
        self._of: list[list[tuple[float, ...]]] = [[] for _ in range(tuning.samplers)]

    @property
    def count(self) -> int:
        """Number of different trials."""
        return len(self._found)

    def goals(self, which: int, points: list[Point]) -> list[float]:
        """Values of points, which the search minimizes."""
        keys = [
            tuple(gain.value(float(share)) for gain, share in zip(self.gains, point, strict=True)) for point in points
        ]
        new = [key for key in dict.fromkeys(keys) if key not in self._found]
        for key in new:
            if (held := self._journal.found(self._values(key))) is not None:
                self._found[key] = held
        missing = [key for key in new if key not in self._found]
        scores = self._tuning.scores([self._values(key) for key in missing], self._tuning.seeds[: self._tuning.few])
        for key, found in zip(missing, map(self._result, scores), strict=True):
            self._found[key] = found
            self._journal.keep(self._values(key), found)
        self._of[which] += keys
        return [self._goal(key) for key in keys]

    def _goal(self, key: tuple[float, ...]) -> float:
        value, over, *_ = self._found[key]
        return float(value + self.steep * math.log(max(over, 1.0)))

    def _keeps(self, key: tuple[float, ...]) -> bool:
        value, over, *_ = self._found[key]
        return bool(value < BROKEN and over <= 1.0)

    def ended_within_the_limits(self) -> bool:
        """True if the best trial of every search kept the limits, or none of its trials had an error."""
        best = (min(keys, key=self._goal) for keys in self._of if keys)
        return all(self._keeps(key) or self._goal(key) >= BROKEN for key in best)

    def best(self, which: int) -> list[dict[str, Any]]:
        """Gains that kept the limits, the best first."""
        kept = filter(self._keeps, dict.fromkeys(self._of[which]))
        return [self._values(key) for key in sorted(kept, key=self._goal)]

    def front(self) -> list[list[float]]:
        """[chattering, error] of the trials that no other beats in both, feasible or not; none without a ceiling."""
        if not self._tuning.cell.ceiling:
            return []
        return front([found[2:] for found in self._found.values()])

    def _values(self, key: tuple[float, ...]) -> dict[str, Any]:
        return {gain.field: value for gain, value in zip(self.gains, key, strict=True)}

    def _result(self, found: Score | None) -> list[Any]:
        if found is None:
            return [2 * LOST, 1.0, None, None]
        error, compared = _mean_log(found.objectives), self._tuning.error(found)
        over = max((value / limit for value, limit in zip(found.constraints, self._limits, strict=True)), default=0.0)
        if found.diverged or not math.isfinite(over):
            return [LOST * (1.0 + found.diverged), 1.0, _finite(compared), _finite(max(found.constraints, default=0.0))]
        return [error if math.isfinite(error) else BROKEN, over, _finite(compared), max(found.constraints, default=0.0)]


def front(points: Sequence[Sequence[float | None]]) -> list[list[float]]:
    """[constraint, error] of the [error's logarithm, constraint] that no other beats in both, by rising constraint."""
    known = sorted((constraint, error) for error, constraint in points if error is not None and constraint is not None)
    kept: list[list[float]] = []
    for constraint, error in known:
        if not kept or error < kept[-1][1]:
            kept.append([constraint, error])
    return [[constraint, math.exp(error)] for constraint, error in kept]


def _mean_log(values: Sequence[float]) -> float:
    if not all(0 < value < math.inf for value in values):
        return math.inf
    return sum(map(math.log, values)) / len(values)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
