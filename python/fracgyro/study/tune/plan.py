"""The study file of `fracgyro tune`: varied fields, objectives and constraints."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from ...analysis.metric_names import tasks_of_columns
from ...analysis.task_runs import available
from ...files import one_line
from ...scenario import Scenario, ScenarioError
from ...scenario.table import Table, format_value
from ...scenario.table import field as described
from ...scenario.toml import read_text
from ...simulation.native import Law
from ...simulation.user_controller import ControllerLike
from ..controller import fields_of_scenario, of_each, recorded
from ..file import (
    FIXED,
    SCENARIO,
    SEEDS,
    TITLE,
    VARY,
    Thresholds,
    base_scenario,
    check_tasks,
    load_study,
    refuse_both,
    seeds_of,
)
from ..folder import digest
from ..space import MAX_POINTS, Dimension, read_space, value_of
from .criteria import Constraint, Measured, Objective, measure

DIGITS = 4  # significant digits of a tuned value


class Tune(Table):
    """Settings of the search."""

    sampler: Literal["tpe", "cmaes", "nsga2"] = described(
        "tpe", "Sampler of Optuna; cmaes: only for one objective and ranges; nsga2: for several objectives."
    )
    trials: int = described(400, "Number of trials.", ge=1, le=MAX_POINTS)
    seed: int = described(1, "Seed of the sampler.", ge=0)
    batch: int | None = described(
        None,
        "Trials proposed together, the population of cmaes and nsga2. Default: 1 for tpe, 32 for nsga2, Hansen's for "
        "cmaes.",
        ge=2,
        le=MAX_POINTS,
    )
    held_out_seeds: int = described(
        200, "Number of noise seeds, after the largest of seeds, that validate the result.", ge=2, le=MAX_POINTS
    )
    storage: str | None = described(
        None, "Address of the database of trials, in SQLAlchemy's syntax. Default: study.db in the folder."
    )


class TuningFile(Table):
    """A study file for `fracgyro tune`."""

    title: str = described("", TITLE)
    scenario: str = described("paper", SCENARIO)
    seeds: Annotated[list[int], BeforeValidator(seeds_of), SEEDS] = described(
        list(range(8)), "Noise seeds for every trial: a list, or their number."
    )
    fixed: dict[str, Any] = described({}, FIXED)
    vary: dict[str, Any] = described({}, VARY)
    metrics: Thresholds = Thresholds()
    tune: Tune = Tune()
    objective: list[Objective] = Field(min_length=1)
    constraint: list[Constraint] = Field(default=[])


@dataclass(frozen=True)
class Plan:
    """A tuning study in full."""

    name: str  # name of the file
    text: str
    file: TuningFile
    base: Scenario
    dimensions: tuple[Dimension, ...]
    held_out: list[int]
    controller: ControllerLike | None  # a user's, which replaces the scenario's controller

    @property
    def batch(self) -> int:
        """Trials proposed together: by default 1 for tpe, 32 for nsga2, and Hansen's population for cmaes."""
        default = {"tpe": 1, "nsga2": 32, "cmaes": 4 + int(3 * math.log(len(self.dimensions)))}
        return self.file.tune.batch or default[self.file.tune.sampler]

    @property
    def tasks(self) -> tuple[str, ...]:
        """Tasks whose figures are objectives or constraints; runs are recorded for them."""
        return tasks_of_columns(o.metric for o in (*self.file.objective, *self.file.constraint))

    @property
    def thresholds(self) -> dict[str, float]:
        return self.file.metrics.model_dump()

    def scenario(self, values: dict[str, Any]) -> Scenario | None:
        """The base with these values, or None if the combination is invalid."""
        try:
            return self.base.replace(fields_of_scenario(values))
        except ScenarioError:
            return None

    def controllers(self, points: Sequence[dict[str, Any]]) -> ControllerLike | Sequence[Law] | None:
        """A user's controllers for scenarios with these values, or None."""
        return of_each(self.controller, points)

    def measure(self, points: Sequence[dict[str, Any]], progress: Callable[[int], object]) -> list[Measured | None]:
        """Metrics of each point on the search seeds, or None for an invalid combination of values."""
        scenarios = [self.scenario(point) for point in points]
        pairs = [(s, point) for s, point in zip(scenarios, points, strict=True) if s is not None]
        seeds = self.file.seeds
        progress((len(points) - len(pairs)) * len(seeds))
        if not pairs:
            return [None] * len(points)
        controllers = self.controllers([point for _, point in pairs])
        found = iter(measure([s for s, _ in pairs], seeds, self.thresholds, progress, controllers, self.tasks))
        return [None if scenario is None else next(found) for scenario in scenarios]

    def base_values(self) -> dict[str, Any] | None:
        """The base scenario as a point of the space, or None if it is outside."""
        point = {}
        for dimension in self.dimensions:
            value = value_of(dimension.field, self.base, self.controller)
            if dimension.choices is not None:
                inside = value in dimension.choices
            else:
                if isinstance(value, tuple) and len(set(value)) == 1:
                    value = value[0]
                inside = isinstance(value, int | float) and dimension.low <= value <= dimension.high
            if not inside:
                return None
            point[dimension.field] = value
        return point

    @cached_property
    def recorded(self) -> dict[str, Any]:
        """Entry of study.json that identifies a user's controller; empty without one."""
        return recorded(self.controller, self.base)

    def parts(self) -> dict[str, Any]:
        """Everything that the trials depend on, by the names of the study file."""
        file = self.file
        return {
            "the version of fracgyro": version("fracgyro"),
            "scenario or fixed": self.base.model_dump(),
            "seeds": file.seeds,
            "vary": [repr(dimension) for dimension in self.dimensions],
            "metrics": file.metrics.model_dump(),
            "objective": [o.model_dump() for o in file.objective],
            "constraint": [c.model_dump() for c in file.constraint],
            "tune.sampler, seed or batch": [file.tune.sampler, file.tune.seed, self.batch],
            **self.recorded,
        }

    @property
    def hash(self) -> str:
        """Hash of `parts`; the number of trials and held-out seeds and the storage do not affect it."""
        return digest(self.parts())


def rounded(dimension: Dimension, value: float) -> float:
    """The value rounded to DIGITS significant digits, within the range."""
    return float(np.clip(float(f"{value:.{DIGITS}g}"), dimension.low, dimension.high))


def read_tuning(path: str | os.PathLike[str], controller: ControllerLike | None = None) -> Plan:
    """The study file as a plan. Raises ScenarioError for an invalid file."""
    file = load_study(path, TuningFile)
    base = base_scenario(file.scenario, Path(path).parent, file.fixed)
    refuse_both(file.fixed, file.vary)
    dimensions = read_space(file.vary, base, controller)
    if not dimensions:
        raise ScenarioError("vary is empty: at least one field must vary")
    for dimension in dimensions:
        if dimension.field == "disturbance.seed":
            raise ScenarioError("disturbance.seed is in [vary]: use seeds")
        if dimension.steps is not None:
            raise ScenarioError(f"{dimension.field}: steps is {dimension.steps}: it must be left out of a tuning")
        if dimension.choices is not None and file.tune.sampler == "cmaes":
            raise ScenarioError(
                f"{dimension.field} has a list of values: it must have a range when tune.sampler is cmaes"
            )
    if file.tune.sampler == "cmaes" and len(file.objective) > 1:
        raise ScenarioError(
            f"objective is given {len(file.objective)} times: it must be given once when tune.sampler is cmaes"
        )
    begin, end = file.metrics.transient, base.run.duration
    late = next((o.metric for o in (*file.objective, *file.constraint) if "_steady" in o.metric), None)
    if late and end <= begin and all(dimension.field != "run.duration" for dimension in dimensions):
        raise ScenarioError(
            f"run.duration is {end:g}: it must be greater than metrics.transient, {begin:g}, to measure {late}"
        )
    named = [o.metric for o in (*file.objective, *file.constraint)]
    check_tasks(named, available(base, own=controller is not None), "the base scenario")
    if not base.disturbance.random:
        raise ScenarioError(
            f"disturbance.kind is {format_value(base.disturbance.kinds)}: it must be noise or vibration, for seeds to "
            "be held out"
        )
    first = max(file.seeds) + 1
    if first + file.tune.held_out_seeds > 2**63:
        raise ScenarioError(
            f"seeds has {max(file.seeds)}: it must leave room for {file.tune.held_out_seeds} larger held-out seeds"
        )
    held_out = list(range(first, first + file.tune.held_out_seeds))
    return Plan(one_line(Path(path).name), read_text(path), file, base, dimensions, held_out, controller)
