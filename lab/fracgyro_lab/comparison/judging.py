"""Evaluation of a tuned contender on unseen seeds and plants, and under other conditions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from fracgyro.scenario import Scenario
from fracgyro.study.tune.criteria import Measured
from numpy.typing import NDArray

from .contender import Contender
from .own import controller_of
from .task import Cell, Task


@dataclass(frozen=True)
class Judging:
    """A unit of work: a tuned contender, its cell and its held-out seeds."""

    task: Task
    contender: Contender
    cell: Cell
    base: Scenario  # with the sensing of the cell
    values: dict[str, Any]
    searched: list[dict[str, Any]]  # best values of the other searches: only their error is measured
    seeds: list[int]  # held-out seeds
    few: int  # number of these seeds for other plants and conditions

    @property
    def name(self) -> str:
        return f"{self.contender.name}-{self.cell.name}"

    @property
    def runs(self) -> int:
        return (1 + len(self.searched)) * len(self.seeds) + self.few * len(self._changed())

    def measure(self) -> dict[str, Any]:
        """By seed: every metric, and the error as it is, with each change, and of each other search's best gains; null
        where a run diverged. `limited`: with each change, the constrained metrics, means of the larger."""
        controller = controller_of(self.contender, self.values)
        mine, few = self.scenario(), self.seeds[: self.few]
        (held,) = self.task.measure([mine], self.seeds, self.base, controller)
        changed = self._changed()
        others = self.task.measure(list(changed.values()), few, self.base, controller)
        errors = {name: _listed(self.task.error(found)) for name, found in zip(changed, others, strict=True)}
        limited = {name: self._limited(measured) for name, measured in zip(changed, others, strict=True)}
        metrics = held.metrics | self.task.figures(mine, few, controller)
        return {
            "metrics": {name: _listed(values) for name, values in metrics.items()},
            "error": _listed(self.task.error(held)),
            "diverged": int(held.diverged.sum()),
            "others": errors,
            "limited": limited,
            "searched": [_listed(self.task.error(found)) for found in map(self._searched, self.searched)],
        }

    def _searched(self, values: dict[str, Any]) -> Measured:
        scenario = self.contender.scenario(self.base, values)
        (found,) = self.task.measure([scenario], self.seeds, self.base, controller_of(self.contender, values))
        return found

    def _limited(self, found: Measured) -> float | None:
        """The largest constrained metric, where a ceiling makes them comparable."""
        if not self.cell.ceiling:
            return None
        largest = max(c.of(found.metrics[c.metric]) for c in self.task.constraints(self.cell.ceiling))
        return largest if np.isfinite(largest) else None

    def scenario(self) -> Scenario:
        return self.contender.scenario(self.base, self.values)

    def _changed(self) -> dict[str, Scenario]:
        mine = self.scenario()
        changes = self.task.plants(mine) | self.task.conditions(mine)
        return {name: mine.replace(change) for name, change in changes.items()}


def _listed(values: NDArray[np.float64]) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]
