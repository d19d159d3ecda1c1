"""Plan of a comparison: everything that it depends on, and its units of work."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.named import named
from fracgyro.scenario.table import format_value
from fracgyro.study.space import MAX_POINTS

from .contender import Contender, chosen
from .judging import Judging
from .own import own_contender
from .rate import Rate
from .task import Cell, Task, sensed
from .track import Track
from .tuning import Tuning

TASKS: dict[str, Task] = {task.name: task for task in (Track(), Rate())}
CLASSES = ("F", "P")
FIRST_HELD_OUT = 10_000  # seeds from here on are never trained on


@dataclass(frozen=True)
class Effort:
    """The same for every contender."""

    trials: int
    seeds: int  # training seeds
    samplers: int  # seeds of the sampler, of which the median counts
    held_out: int  # seeds
    few: int  # held-out seeds used for other plants and conditions
    quick: bool  # a preview: its gains are not called tuned


FULL = Effort(200, 8, 3, 100, 10, False)
QUICK = Effort(20, 2, 1, 4, 1, True)


@dataclass(frozen=True)
class Row:
    """A contender in a cell."""

    contender: Contender
    cell: Cell

    @property
    def name(self) -> str:
        return f"{self.contender.name}-{self.cell.name}"


@dataclass(frozen=True)
class Comparison:
    """The plan in full."""

    task: Task
    scenarios: dict[str, Scenario]
    contenders: tuple[Contender, ...]
    sensing: tuple[tuple[str, float], ...]  # class of information and noise of each table
    effort: Effort
    storage: str | None

    def rows(self) -> list[Row]:
        each = product(self.scenarios, self.sensing, self.task.ceilings)
        cells = [Cell(scenario, *sensing, ceiling) for scenario, sensing, ceiling in each]
        return [Row(c, cell) for cell in cells for c in self.contenders if cell.information in c.classes]

    def tunings(self, row: Row) -> list[Tuning]:
        """One tuning per seed of the sampler; empty if there is nothing to tune."""
        effort, cell = self.effort, row.cell
        if not row.contender.gains:  # an observer by itself is left as the scenario has it
            return []
        return [
            Tuning(
                self.task,
                row.contender,
                cell,
                self._base(cell),
                effort.trials,
                list(range(effort.seeds)),
                sampler,
                self.storage,
            )
            for sampler in range(1, effort.samplers + 1)
        ]

    def untuned(self, row: Row) -> dict[str, Any] | None:
        """The values of a contender with nothing to tune; None if it cannot do the task."""
        return self.task.completed(row.contender, self._base(row.cell), {})

    def judging(self, row: Row, values: dict[str, Any]) -> Judging:
        seeds = list(range(FIRST_HELD_OUT, FIRST_HELD_OUT + self.effort.held_out))
        return Judging(self.task, row.contender, row.cell, self._base(row.cell), values, seeds, self.effort.few)

    def _base(self, cell: Cell) -> Scenario:
        return sensed(self.scenarios[cell.scenario], cell.information, cell.noise)

    def parts(self) -> dict[str, Any]:
        """Everything that the results depend on, for study.json, by the names of the command line."""
        own = {c.name: hashlib.sha256(c.own.text.encode()).hexdigest() for c in self.contenders if c.own}
        return {
            "the version of fracgyro": version("fracgyro"),
            "the task": self.task.name,
            "the scenarios": {name: scenario.model_dump() for name, scenario in self.scenarios.items()},
            "the contenders": [repr(dataclasses.replace(c, own=None)) for c in self.contenders],
            "the file of --controller": own,
            "--class or --noise": self.sensing,
            "--trials or --quick": dataclasses.asdict(self.effort),
        }


def planned(
    task: str,
    *,
    scenarios: Sequence[str | os.PathLike[str]],
    only: Sequence[str],
    classes: Sequence[str],
    noise: Sequence[float],
    controller: str | None,
    trials: int | None,
    quick: bool,
    storage: str | None,
) -> Comparison:
    """The plan of a comparison. Raises ScenarioError for invalid options."""
    if task not in TASKS:
        raise ScenarioError(f"the task is {format_value(task)}: it must be {' or '.join(TASKS)}")
    one = TASKS[task]
    for information in classes:
        if information not in CLASSES:
            raise ScenarioError(f"--class is {format_value(information)}: it must be F, P or both, as in F,P")
    for density in noise:
        if not 0 <= density < math.inf:
            raise ScenarioError(f"--noise is {format_value(density)}: it must be finite and not negative")
    if trials is not None and not 1 <= trials <= MAX_POINTS:
        raise ScenarioError(f"--trials is {trials}: it must lie between 1 and {MAX_POINTS}")
    given = {Path(path).stem: one.scenario(named(path)) for path in scenarios}
    if len(given) < len(scenarios):
        raise ScenarioError("two scenarios have the same name: their files must be called differently")
    own = () if controller is None else (own_contender(controller, one),)
    for contender in own:
        if any(contender.name == theirs.name for theirs in one.contenders):
            raise ScenarioError(
                f"--controller is {format_value(controller)}: it must have a name that no contender of the task has"
            )
    effort = QUICK if quick else FULL
    if trials is not None:
        effort = dataclasses.replace(effort, trials=trials)
    asked = chosen((*one.contenders, *own), tuple(only))
    plan = Comparison(
        one,
        given or one.scenarios(),
        tuple(c for c in (*one.contenders, *own) if c in asked or c in own),  # one's own takes part in any case
        _sensing(one, classes, noise, quick),
        effort,
        storage,
    )
    if not plan.rows():
        raise ScenarioError(
            f"--only is {format_value(list(only))} and --class {format_value(list(classes))}: together they must leave "
            "a contender"
        )
    return plan


def _sensing(task: Task, classes: Sequence[str], noise: Sequence[float], quick: bool) -> tuple[tuple[str, float], ...]:
    """The task's own, or every class with every noise where either is given."""
    if not classes and not noise:
        return task.quick_sensing if quick else task.sensing
    known = zip(*task.sensing, strict=True)
    each = (given or own for given, own in zip((classes, noise), known, strict=True))
    return tuple(dict.fromkeys(product(*each)))
