"""One tuning: a contender in a cell with one sampler's seed. It can be sent to another process or machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.study.tune.criteria import Constraint, Measured
from fracgyro.study.tune.plan import Plan, Tune, TuningFile
from fracgyro.study.tune.search import Trial, opened

from .contender import Contender
from .own import controller_of
from .task import Cell, Task


@dataclass(frozen=True, kw_only=True)
class ContenderPlan(Plan):
    """A tuning without published gains and without a base scenario."""

    task: Task
    contender: Contender

    def measure(self, points: Sequence[dict[str, Any]], progress: Callable[[int], object]) -> list[Measured | None]:
        found = [self._measured(point) for point in points]
        progress(len(points) * len(self.file.seeds))
        return found

    def _measured(self, point: dict[str, Any]) -> Measured | None:
        values = self.task.completed(self.contender, self.base, point)
        if values is None:
            return None
        try:
            scenario = self.contender.scenario(self.base, values)
        except ScenarioError:
            return None
        controller = controller_of(self.contender, values)
        return self.task.train(scenario, self.file.seeds, self.base, controller)

    def base_values(self) -> dict[str, Any] | None:
        return None

    def parts(self) -> dict[str, Any]:
        return {**super().parts(), "task": self.task.name, "contender": repr(self.contender)}


@dataclass(frozen=True)
class Tuning:
    """A unit of work: one tuning of a contender in a cell."""

    task: Task
    contender: Contender
    cell: Cell
    base: Scenario  # with the cell's sensing
    trials: int
    seeds: list[int]
    sampler: int  # its seed
    storage: str | None  # storage of the finished trials

    @property
    def name(self) -> str:
        return f"{self.contender.name}-{self.cell.name}-{self.sampler}"

    @property
    def runs(self) -> int:
        return self.trials * len(self.seeds)

    def measure(self) -> dict[str, Any]:
        """The trials as [objective, largest constraint, feasible], and the best values with their error."""
        constraints = self.task.constraints(self.cell.ceiling)
        plan = self._plan(constraints)
        one = np.ones(1)  # ratios to it are the values themselves
        unit = Measured({c.metric: one for c in (*plan.file.objective, *constraints)}, np.zeros(1, dtype=bool))
        with opened(plan, self.storage, unit, resume=self.storage is not None) as search:
            search.run(lambda runs: None)
            trials = search.finished()[: self.trials]
        feasible = [trial for trial in trials if trial.score.feasible]
        best = min(feasible, key=_objective, default=None)
        return {
            "best": best and self.task.completed(self.contender, plan.base, best.values),
            "error": best and _mean_log(best.score.objectives[: self.task.compared]),
            "trials": [[_finite(_objective(t)), _finite(max(t.score.constraints)), t.score.feasible] for t in trials],
        }

    def _plan(self, constraints: list[Constraint]) -> ContenderPlan:
        gains = self.contender.tuned(self.cell.information)
        file = TuningFile(
            seeds=self.seeds,
            objective=list(self.task.objectives),
            constraint=constraints,
            tune=Tune(trials=self.trials, seed=self.sampler),
        )
        return ContenderPlan(
            self.name,
            "",
            file,
            self.base,
            tuple(gain.dimension for gain in gains),
            [],
            None,
            joined=True,
            task=self.task,
            contender=self.contender,
        )


def _objective(trial: Trial) -> float:
    return _mean_log(trial.score.objectives)


def _mean_log(values: Sequence[float]) -> float:
    if not all(0 < value < math.inf for value in values):
        return math.inf
    return sum(map(math.log, values)) / len(values)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
