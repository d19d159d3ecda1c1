"""Plan of a comparison: everything that it depends on, and its units of work."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.named import named
from fracgyro.scenario.table import format_value
from fracgyro.study.space import MAX_POINTS

from .contender import Contained, Contender, chosen
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

    trials: int  # the most of each search, which ends before if the searches agree
    seeds: int  # training seeds
    search_seeds: int  # number of them that a search uses; all judge its best trials
    samplers: int  # searches, of which the best counts
    held_out: int  # seeds
    few: int  # held-out seeds used for other plants and conditions
    quick: bool  # a preview: its gains are not called tuned


SEEDS, SAMPLERS, HELD_OUT, FEW = 8, 2, 100, 10
QUICK = Effort(20, 2, 2, 1, 4, 1, True)


@dataclass(frozen=True)
class Row:
    """A contender in a cell."""

    contender: Contender
    cell: Cell

    @property
    def name(self) -> str:
        return f"{self.contender.name}-{self.cell.name}"

    def is_at(self, contender: str, cell: Cell) -> bool:
        return self.contender.name == contender and self.cell == cell


@dataclass(frozen=True)
class Comparison:
    """The plan in full."""

    task: Task
    scenarios: dict[str, Scenario]
    contenders: tuple[Contender, ...]
    cells: tuple[Cell, ...]  # the tables, ceilings ascending
    effort: Effort
    storage: str | None

    @cached_property
    def rows(self) -> list[Row]:
        by_scenario = {
            name: [self.task.scaled(contender, base) for contender in self.contenders]
            for name, base in self.scenarios.items()
        }
        return [
            Row(contender, cell)
            for cell in self.cells
            for contender in by_scenario[cell.scenario]
            if cell.information in contender.classes and (contender.without_noise or cell.noise)
        ]

    def waves(self) -> list[list[Row]]:
        """The rows to be tuned, in groups: each after the special cases and lower ceilings that it starts from."""
        at: dict[str, int] = {}

        def place(row: Row) -> int:
            if row.name not in at:
                at[row.name] = 1 + max((place(other) for other, _ in self.before(row)), default=-1)
            return at[row.name]

        tuned = [row for row in self.rows if row.contender.gains]  # an observer by itself is left as it is
        tuned.sort(key=lambda row: -len(row.contender.gains))  # the longest first, or they end with one processor idle
        return [[row for row in tuned if place(row) == wave] for wave in range(max(map(place, tuned), default=-1) + 1)]

    def before(self, row: Row) -> list[tuple[Row, Contained]]:
        """Rows whose best gains are starts of this one's tuning: special cases, and the next lower ceiling."""
        mine = row.contender
        found = []
        for contained in mine.contains:
            found += [(other, contained) for other in self.rows if other.is_at(contained.name, row.cell)]
        lower = [
            other
            for other in self.rows
            if other.contender.name == mine.name
            and other.cell.ceiling < row.cell.ceiling
            and other.cell.sensing == row.cell.sensing
        ]
        found += [(other, Contained(mine.name)) for other in lower[-1:]]
        return [(other, contained) for other, contained in found if other.contender.gains]

    def tuning(self, row: Row, best: Mapping[str, Mapping[str, Any] | None]) -> Tuning:
        """`best`: gains found so far, by the names of rows."""
        effort, cell, mine = self.effort, row.cell, row.contender
        starts = [
            mine.started(cell.information, contained, values)
            for other, contained in self.before(row)
            if (values := best.get(other.name)) is not None
        ]
        return Tuning(
            self.task,
            mine,
            cell,
            self.base(cell),
            tuple(starts),
            effort.trials,
            list(range(effort.seeds)),
            effort.search_seeds,
            effort.samplers,
            self.storage,
        )

    def untuned(self, row: Row) -> dict[str, Any] | None:
        """The values of a contender with nothing to tune; None if it cannot do the task."""
        return self.task.completed(row.contender, self.base(row.cell), {})

    def judging(self, row: Row, values: dict[str, Any], others: Sequence[dict[str, Any]] = ()) -> Judging:
        seeds = list(range(FIRST_HELD_OUT, FIRST_HELD_OUT + self.effort.held_out))
        return Judging(
            self.task, row.contender, row.cell, self.base(row.cell), values, list(others), seeds, self.effort.few
        )

    def limits(self) -> list[dict[str, Any]]:
        """The limit of each scenario and sensing, as `Task.limit` returns it; empty if the task has none."""
        found = []
        for sensing in dict.fromkeys(cell.sensing for cell in self.cells):
            cells = [cell for cell in self.cells if cell.sensing == sensing]
            limit = self.task.limit(self.base(cells[0]), [cell.ceiling for cell in cells])
            if limit is not None:
                scenario, information, noise = sensing
                found.append({"scenario": scenario, "class": information, "noise": noise, **limit})
        return found

    def base(self, cell: Cell) -> Scenario:
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
            "--class or --noise": [cell.name for cell in self.cells],
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
    effort = QUICK if quick else Effort(one.trials, SEEDS, one.search_seeds, SAMPLERS, HELD_OUT, FEW, False)
    if trials is not None:
        effort = dataclasses.replace(effort, trials=trials)
    asked = chosen((*one.contenders, *own), tuple(only))
    taking_part = tuple(c for c in (*one.contenders, *own) if c in asked or c in own)  # one's own in any case
    shipped = one.scenarios()
    several = dict(list(shipped.items())[:1]) if quick else shipped  # a preview has the first
    sensing = _sensing(one, classes, noise, quick)
    plan = Comparison(
        one,
        given or several,
        taking_part,
        tuple(_cells(one, given or several, sensing, bool(given or classes or noise))),
        effort,
        storage,
    )
    if not plan.rows:
        raise ScenarioError(
            f"--only is {format_value(list(only))} and --class {format_value(list(classes))}: together they must leave "
            "a contender"
        )
    return plan


def _cells(
    task: Task, scenarios: Mapping[str, Scenario], sensing: Sequence[tuple[str, float]], asked: bool
) -> Iterator[Cell]:
    """`asked`: the user chose scenarios or sensing, and each scenario is compared in all of them."""
    for name, base in scenarios.items():
        for each in task.sensed_by(name, asked) or sensing:
            for ceiling in task.ceilings(name, sensed(base, *each)):
                yield Cell(name, *each, ceiling)


def _sensing(task: Task, classes: Sequence[str], noise: Sequence[float], quick: bool) -> tuple[tuple[str, float], ...]:
    """The task's own, or every class with every noise where either is given."""
    if not classes and not noise:
        return task.quick_sensing if quick else task.sensing
    known = zip(*task.sensing, strict=True)
    each = (given or own for given, own in zip((classes, noise), known, strict=True))
    return tuple(dict.fromkeys(product(*each)))
