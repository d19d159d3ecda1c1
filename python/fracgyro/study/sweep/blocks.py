"""The unit of work: a block of runs -> a table with one row per run. It can be sent to another machine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pyarrow as pa

from ... import _core
from ...analysis.metric_names import METRICS, task_columns
from ...analysis.task_runs import measure_tasks
from ...scenario import Scenario
from ...simulation.measure import MAX_SINGLE_RUNS, measure_setups
from ...simulation.native import Law
from ...simulation.user_controller import ControllerLike
from ..controller import of_each
from .design import Plan
from .point_columns import Points
from .setups import Setups, scenario_of

# Largest loss if a process is killed: about a second of one processor, or this many runs.
STEPS_PER_BLOCK, RUNS_PER_BLOCK = 2 * 10**7, 4096
MAX_BLOCKS = 100_000  # in a study: beyond, blocks have more runs
STEPS_OF_CALLABLES = 10**6  # per block: Python takes a microsecond per step


@dataclass(frozen=True)
class Block:
    """Consecutive points, each with consecutive seeds."""

    number: int
    first: int  # number of the first point
    base: Scenario
    values: Points  # values of the varied fields, by point
    seeds: list[int]
    columns: pa.Schema  # point, seed and the varied fields
    thresholds: dict[str, Any]
    controller: ControllerLike | None  # a user's
    tasks: tuple[str, ...] = ()
    patched: tuple[str, ...] = ()  # fields that are set in the set-up of another point
    first_seed: int = 0  # its place among all seeds
    few: bool = False  # all runs of the study together are so few that each runs by itself

    @property
    def name(self) -> str:
        return f"block {self.number}"

    @property
    def runs(self) -> int:
        return len(self.values) * len(self.seeds)

    def keys(self) -> pa.Table:
        """Key columns `columns`, one row per run."""
        points = np.repeat(np.arange(len(self.values)), len(self.seeds))
        parameters = [self.values.column(place) for place in range(len(self.columns) - 2)]
        arrays = [pa.array(self.first + points), pa.array(np.tile(np.array(self.seeds), len(self.values)))]
        arrays += [
            pa.array(column, field.type).take(pa.array(points))
            for column, field in zip(parameters, list(self.columns)[2:], strict=True)
        ]
        return pa.Table.from_arrays(arrays, schema=self.columns)

    def complete(self, table: pa.Table) -> bool:
        """True if the table has the rows of `measure`: the keys and every metric, all numbers."""
        keys = self.keys()
        mine, others = table.column_names[: keys.num_columns], table.column_names[keys.num_columns :]
        if mine != keys.column_names or sorted(others) != sorted({*METRICS, *task_columns(self.tasks), "diverged_at"}):
            return False
        numbers = {table.schema.field(name).type for name in others} == {pa.float64()}
        return numbers and bool(table.select(mine).equals(keys))

    def setups(self) -> Iterator[_core.DeviceSetup] | None:
        """Set-ups of the points, made when they are used; None if scenarios are needed instead."""
        if self.controller is not None or self.tasks:
            return None
        return Setups(self.base, self.columns.names[2:], self.patched).each(self.first, self.values)

    def measure(
        self,
        progress: Callable[[int], object] | None = None,
        setups: Iterable[_core.DeviceSetup] | None = None,
        meanwhile: Callable[[], object] | None = None,
    ) -> pa.Table:
        """The keys with the metrics, null for events that never occur. Uses all processors.

        `setups`: those of `setups()`, if they exist already; `meanwhile`: called while the last of them run.
        """
        fields = self.columns.names[2:]
        made = self.setups() if setups is None else setups
        if made is not None:
            runs = measure_setups(made, self.seeds, self.few, progress, meanwhile, **self.thresholds)
        else:
            points = [dict(zip(fields, values, strict=True)) for values in self.values]
            scenarios = [scenario_of(self.base, n, fields, values) for n, values in enumerate(self.values, self.first)]
            controllers = of_each(self.controller, points)
            runs = measure_tasks(
                scenarios, self.tasks, seeds=self.seeds, controller=controllers, progress=progress, **self.thresholds
            )
        table = self.keys()
        for name, variable in runs.data_vars.items():
            inner = [dimension for dimension in variable.dims if dimension != "run"]
            labels = product(*(variable[dimension].values for dimension in inner))
            columns = variable.transpose("run", *inner).values.reshape(self.runs, -1)
            for label, column in zip(labels, columns.T, strict=True):
                words = "_".join(map(str, (name, *label)))
                table = table.append_column(words, pa.array(column, pa.float64(), from_pandas=True))
        return table


def blocks(plan: Plan) -> list[Block]:
    """All blocks of the plan, ordered by point, then by seed."""
    native = plan.controller is None or isinstance(plan.controller, Law)
    most = min(max((STEPS_PER_BLOCK if native else STEPS_OF_CALLABLES) // plan.facts.longest, 1), RUNS_PER_BLOCK)
    most = max(most, -(-plan.runs // MAX_BLOCKS))
    seeds = min(len(plan.seeds), most)
    points = max(most // len(plan.seeds), 1)
    columns = _columns(plan)
    thresholds = plan.study.metrics.model_dump()
    pieces = product(range(0, len(plan.points), points), range(0, len(plan.seeds), seeds))
    return [
        Block(
            number,
            first,
            plan.base,
            plan.points[first : first + points],
            plan.seeds[seed : seed + seeds],
            columns,
            thresholds,
            plan.controller,
            plan.tasks,
            plan.patched,
            seed,
            plan.runs <= MAX_SINGLE_RUNS,
        )
        for number, (first, seed) in enumerate(pieces)
    ]


def _columns(plan: Plan) -> pa.Schema:
    kinds = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string(), tuple: pa.list_(pa.float64())}
    fields = [(field, kinds[type(plan.points[0][i])]) for i, field in enumerate(plan.fields)]
    return pa.schema([("point", pa.int64()), ("seed", pa.int64()), *fields])
