"""The points of the space that a study runs: study file -> plan."""

from __future__ import annotations

import dataclasses
import itertools
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator

from ...analysis.metric_names import ALL_METRICS, metric_hint, tasks_of_columns
from ...analysis.task_runs import available
from ...scenario import Scenario, ScenarioError
from ...scenario.table import Table, format_value, message_error
from ...scenario.table import field as described
from ...scenario.toml import read_text
from ...simulation.user_controller import ControllerLike
from ..file import (
    FIXED,
    METRIC,
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
from ..space import MAX_POINTS, Dimension, read_space
from .point_columns import Points
from .setups import Setups, fields_to_patch, scenario_of

MIN_BLOCK = 16  # points, for a confidence interval
SHOWN = ("rmse_steady_x", "rmse_steady_y", "error_settling_time", "rate_error_rms")


def _show(value: Any) -> Any:
    for name in value if isinstance(value, list) else []:
        if not isinstance(name, str) or name not in ALL_METRICS:
            raise message_error(f"show has {format_value(name)}, which is not a known metric; {metric_hint(str(name))}")
    return value


class Design(Table):
    """Choice of the points."""

    kind: Literal["grid", "list", "random", "latin_hypercube", "sobol", "sobol_indices"] = described(
        "grid",
        "grid: every combination; list: the lists side by side, row by row; otherwise drawn from the ranges. "
        "sobol_indices: d + 2 blocks of points for Sobol indices, d being the number of fields.",
    )
    points: int | None = described(
        None,
        "Number of points drawn, for sobol_indices per block; a power of 2 for both sobol; not for grid and list.",
        ge=1,
        le=MAX_POINTS,
    )
    seed: int = described(0, "Seed of the drawn points.", ge=0)


class Study(Table):
    """A study file for `fracgyro sweep`."""

    title: str = described("", TITLE)
    scenario: str = described("paper", SCENARIO)
    seeds: Annotated[list[int] | None, BeforeValidator(seeds_of), SEEDS] = described(
        None, "Noise seeds for every point: a list, or their number. Default: the scenario's seed."
    )
    fixed: dict[str, Any] = described({}, FIXED)
    vary: dict[str, Any] = described({}, VARY)
    design: Design = Design()
    metrics: Thresholds = Thresholds()
    show: Annotated[list[Annotated[str, METRIC]], BeforeValidator(_show)] = described(
        list(SHOWN), "Names of the metrics in the summary.", min_length=1
    )
    quantiles: bool = described(
        True,
        "Quantiles, medians, maps and rank correlations in the summary. Without, only the metadata of the blocks is "
        "read, and memory does not grow with the runs.",
    )


@dataclass
class Facts:
    """Facts about the scenarios of all points; the scenarios are created when they run, to save memory."""

    longest: int = 0  # steps of the longest run
    steps: int = 0  # sum over all points
    durations: set[float] = dataclasses.field(default_factory=set)
    controllers: set[str] = dataclasses.field(default_factory=set)  # kinds
    disturbances: set[str] = dataclasses.field(default_factory=set)  # kinds
    random: bool = False  # a disturbance depends on the seed
    figures: set[str] = dataclasses.field(default_factory=set)  # columns of tasks

    def add(self, scenario: Scenario, *, own: bool, times: int) -> None:
        """Adds that many points, all with this scenario but for fields that change none of the facts."""
        self.longest = max(self.longest, scenario.run.steps)
        self.steps += scenario.run.steps * times
        self.durations.add(scenario.run.duration)
        self.controllers.add(scenario.controller.kind)
        self.disturbances.add(scenario.disturbance.kinds)
        self.random = self.random or scenario.disturbance.random
        self.figures.update(available(scenario, own=own))


@dataclass(frozen=True)
class Plan:
    """A study in full: every point runs with every seed."""

    study: Study
    text: str  # contents of the study file
    base: Scenario
    dimensions: tuple[Dimension, ...]
    points: Points  # values of the dimensions
    patched: tuple[str, ...]  # fields that are set in the set-up of another point
    facts: Facts
    seeds: list[int]
    controller: ControllerLike | None  # a user's, which replaces the scenarios' controller

    def scenario(self, number: int) -> Scenario:
        """The scenario of a point."""
        return scenario_of(self.base, number, self.fields, self.points[number])

    @property
    def fields(self) -> list[str]:
        return [dimension.field for dimension in self.dimensions]

    @property
    def tasks(self) -> tuple[str, ...]:
        """Tasks whose figures are shown; runs are recorded for them."""
        return tasks_of_columns(self.study.show)

    @property
    def runs(self) -> int:
        return len(self.points) * len(self.seeds)

    @property
    def sampled(self) -> bool:
        """True if the points are a random sample of the space."""
        return self.study.design.kind in ("random", "latin_hypercube", "sobol", "sobol_indices")


def read_plan(path: str | os.PathLike[str], controller: ControllerLike | None = None) -> Plan:
    """The study file as a plan with valid points. Raises ScenarioError for an invalid file or point."""
    study = load_study(path, Study)
    base = base_scenario(study.scenario, Path(path).parent, study.fixed)
    refuse_both(study.fixed, study.vary)
    if study.design.kind == "sobol_indices" and not study.quantiles:
        raise ScenarioError(
            'quantiles is false: it must be true when design.kind is "sobol_indices", whose indices need all rows'
        )
    dimensions = read_space(study.vary, base, controller)
    if "disturbance.seed" in {dimension.field for dimension in dimensions}:
        raise ScenarioError("disturbance.seed is in [vary]: use seeds, which apply to every point")
    points = DESIGNS[study.design.kind](study.design, dimensions)
    fields = [dimension.field for dimension in dimensions]
    facts, patched = Facts(), fields_to_patch(base, dimensions)
    setups = Setups(base, fields, patched)
    if set(patched) == set(fields):  # every point has the base's facts
        facts.add(base, own=controller is not None, times=len(points))
    else:
        for scenario, alike in itertools.groupby(itertools.starmap(setups.alike, enumerate(points)), _Same):
            facts.add(scenario.it, own=controller is not None, times=sum(1 for _ in alike))
    check_tasks(study.show, facts.figures, "every point")
    seeds = [base.disturbance.seed] if study.seeds is None else study.seeds
    if len(seeds) > 1 and not facts.random:
        raise ScenarioError(
            f"seeds is {format_value(seeds)}: it must be one seed, as no result depends on it with disturbance.kind "
            f"{' or '.join(map(format_value, sorted(facts.disturbances)))}"
        )
    return Plan(study, read_text(path), base, dimensions, points, patched, facts, seeds, controller)


class _Same:
    """A scenario, equal only to itself, which is known at once."""

    def __init__(self, scenario: Scenario) -> None:
        self.it = scenario

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.it is self.it


def _grid(design: Design, dimensions: tuple[Dimension, ...]) -> Points:
    axes = _axes(design, dimensions)
    count = int(np.prod([float(len(axis)) for axis in axes]))
    if count > MAX_POINTS:
        raise ScenarioError(f"the grid has {count} points: it must have at most {MAX_POINTS}")
    return Points.grid(axes)


def _list(design: Design, dimensions: tuple[Dimension, ...]) -> Points:
    _some(design, dimensions)
    axes = _axes(design, dimensions)
    for dimension, axis in zip(dimensions, axes, strict=True):
        if len(axis) != len(axes[0]):
            raise ScenarioError(
                f"{dimension.field} has {len(axis)} values: it must have {len(axes[0])}, as {dimensions[0].field} has, "
                'when design.kind is "list"'
            )
    return Points.listed(axes)


def _axes(design: Design, dimensions: tuple[Dimension, ...]) -> list[tuple[Any, ...]]:
    if design.points is not None:
        raise ScenarioError(
            f"design.points is {design.points}: it must be left out when design.kind is {format_value(design.kind)}"
        )
    axes = []
    for dimension in dimensions:
        axis = dimension.grid()
        if axis is None:
            raise ScenarioError(
                f"{dimension.field}: steps is missing: it must be given when design.kind is {format_value(design.kind)}"
            )
        axes.append(axis)
    return axes


def _random(design: Design, dimensions: tuple[Dimension, ...]) -> Points:
    return _sampled(design, dimensions, lambda n, d, rng: rng.random((n, d)))


def _latin_hypercube(design: Design, dimensions: tuple[Dimension, ...]) -> Points:
    from scipy.stats.qmc import LatinHypercube  # takes half a second

    return _sampled(design, dimensions, lambda n, d, rng: LatinHypercube(d, seed=rng).random(n))


def _sobol(design: Design, dimensions: tuple[Dimension, ...]) -> Points:
    return _sampled(design, dimensions, _sobol_points)


def _sobol_indices(design: Design, dimensions: tuple[Dimension, ...]) -> Points:
    """Blocks A, B and, for each field i, AB_i: A with the values of that field from B."""
    most = MAX_POINTS // (len(dimensions) + 2)
    if design.points is not None and not MIN_BLOCK <= design.points <= most:
        raise ScenarioError(
            f"design.points is {design.points}: it must be from {MIN_BLOCK} to {most} for Sobol indices, which need "
            f"{len(dimensions) + 2} blocks of it"
        )

    def blocks(n: int, d: int, rng: np.random.Generator) -> Any:
        a, b = np.split(_sobol_points(n, 2 * d, rng), 2, axis=1)
        mixed = [np.where(np.arange(d) == i, b, a) for i in range(d)]
        return np.concatenate([a, b, *mixed])

    return _sampled(design, dimensions, blocks)


def _sobol_points(n: int, d: int, rng: np.random.Generator) -> Any:
    if n.bit_count() != 1:
        near = 1 << n.bit_length()
        raise ScenarioError(f"design.points is {n}: a Sobol design must have a power of 2, such as {near}")
    from scipy.stats.qmc import Sobol

    return Sobol(d, seed=rng).random(n)


def _sampled(
    design: Design,
    dimensions: tuple[Dimension, ...],
    unit_cube: Callable[[int, int, np.random.Generator], Any],
) -> Points:
    _some(design, dimensions)
    if design.points is None:
        raise ScenarioError(f"design.points is missing: {format_value(design.kind)} must have a number of points")
    for dimension in dimensions:
        if dimension.steps is not None:
            raise ScenarioError(
                f"{dimension.field}: steps is {dimension.steps}: it must be left out when design.kind is "
                f"{format_value(design.kind)}"
            )
    return Points.drawn(dimensions, unit_cube(design.points, len(dimensions), np.random.default_rng(design.seed)))


def _some(design: Design, dimensions: tuple[Dimension, ...]) -> None:
    if not dimensions:
        raise ScenarioError(f"vary is empty: at least one field must vary when design.kind is {design.kind}")


DESIGNS: dict[str, Callable[[Design, tuple[Dimension, ...]], Points]] = {
    "grid": _grid,
    "list": _list,
    "random": _random,
    "latin_hypercube": _latin_hypercube,
    "sobol": _sobol,
    "sobol_indices": _sobol_indices,
}
