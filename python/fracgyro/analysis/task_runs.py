"""Figures of tasks for many runs, which are recorded for them a few at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import xarray as xr

from ..scenario import Scenario
from ..scenario.kinds import AXES
from ..scenario.scales import si_unit
from ..simulation.measure import measure_many
from ..simulation.native import Law
from ..simulation.simulate import SHARED_FIELDS, simulate_many
from ..simulation.user_controller import ControllerLike
from ..simulation.user_plant import PlantLike
from .metric_names import TASKS, task_columns
from .tasks import task_axes, task_figures

MAX_SAMPLES = 100_000  # limit of a record that is not saved
PER_CYCLE = 4  # fewest samples in a cycle of a chirp
MAX_NUMBERS = 2.5e7  # in the records of runs that are recorded together
COLUMNS = 40  # an upper estimate of the columns of a record


def thinned(scenario: Scenario) -> Scenario:
    """The scenario with a record of at most MAX_SAMPLES samples, or more if a chirp must be resolved."""
    r, run = scenario.reference, scenario.run
    ends = [max(abs(r.frequency[i]), abs(r.final_frequency[i])) for i, kind in enumerate(r.kinds) if kind == "chirp"]
    every = max(1, run.steps // MAX_SAMPLES)
    if ends and max(ends) > 0:
        every = max(1, min(every, int(2 * math.pi / (PER_CYCLE * max(ends) * run.step))))
    return scenario.replace({"run.record_every": every})


def available(scenario: Scenario, *, own: bool) -> list[str]:
    """Columns of the figures that runs of a scenario have; `own`: a user's controller replaces the scenario's."""
    return [
        column
        for name, on in tasks_of(scenario, own=own).items()
        for column in task_columns([name])
        if not on or column.rpartition("_")[2] in on
    ]


def tasks_of(scenario: Scenario, *, own: bool) -> dict[str, list[str]]:
    """Tasks that runs of a scenario have, each with its axes; `own`: as in `available`."""
    return {name: axes for name, axes in task_axes(scenario).items() if axes or not own}


def measure_tasks(
    scenarios: Sequence[Scenario],
    tasks: Iterable[str],
    *,
    seeds: Sequence[int] | None = None,
    controller: ControllerLike | Sequence[Law] | None = None,
    plant: PlantLike | None = None,
    progress: Callable[[int], object] | None = None,
    **thresholds: Any,
) -> xr.Dataset:
    """`measure_many`, with the figures of these tasks as further variables, nondimensional.

    Runs are simulated again with a record if there are tasks. NaN for a run that diverges, lacks the task or is too
    short for it.
    """
    wanted = list(tasks)
    bar = None if wanted else progress
    found = measure_many(scenarios, seeds=seeds, controller=controller, plant=plant, progress=bar, **thresholds)
    if not wanted:
        return found
    runs = found.sizes["run"]
    shapes = {name: TASKS[task].by_axis for task in wanted for name in TASKS[task].figures}
    values = {name: np.full((runs, len(AXES)) if by_axis else runs, np.nan) for name, by_axis in shapes.items()}
    for first, group, some, law in _groups(scenarios, seeds, controller):
        recorded = simulate_many(group, seeds=some, controller=law, plant=plant, progress=progress)
        times = 1 if some is None else len(some)
        for i in np.flatnonzero(np.isnan(recorded["diverged_at"].values)):
            scenario = group[i // times]
            for name, value in _figures(recorded.isel(run=i), scenario, shapes):
                values[name][first + i] = value
    return found.assign({name: (["run", "axis"][: v.ndim], v, {"units": "1"}) for name, v in values.items()})


def tasks_in_units(scenario: Scenario, rows: xr.Dataset) -> list[xr.Dataset]:
    """Figures of each task in rows of `measure_tasks`, in the units of the scenario's runs; only axes with the task."""
    found = []
    for name, axes in task_axes(scenario).items():
        names = list(TASKS[name].figures)
        if set(names) <= set(rows):
            part = rows[names].sel(axis=axes) if axes else rows[names]
            for figure, unit in TASKS[name].units.items():
                part[figure] = part[figure] * _scale(scenario, unit)
                part[figure].attrs["units"] = si_unit(unit) if scenario.run.units == "SI" else unit
            found.append(part)
    return found


Group = tuple[int, list[Scenario], Sequence[int] | None, ControllerLike | None]


def _groups(
    scenarios: Sequence[Scenario], seeds: Sequence[int] | None, controller: ControllerLike | Sequence[Law] | None
) -> Iterator[Group]:
    """Runs recorded together: place of the first one in the result, scenarios, seeds and controller."""
    each = list(map(thinned, scenarios))
    laws = controller if isinstance(controller, list | tuple) else None

    def alike(place: int) -> Any:
        s = each[place]
        unit = s.plant.reference_frequency if s.run.units == "SI" else None
        return *(getattr(s.run, name) for name in SHARED_FIELDS), unit, place if laws else None

    times = 1 if seeds is None else len(seeds)
    for _, consecutive in groupby(range(len(each)), alike):
        places = list(consecutive)
        run = each[places[0]].run
        most = max(1, int(MAX_NUMBERS / (COLUMNS * (run.steps // run.record_every + 1))))
        for i in range(0, len(places), max(1, most // times)):
            group = places[i : i + max(1, most // times)]
            law: Any = laws[group[0]] if laws else controller
            for j in range(0, times, most):
                some = None if seeds is None else seeds[j : j + most]
                yield group[0] * times + j, [each[place] for place in group], some, law


def _figures(run: xr.Dataset, scenario: Scenario, wanted: Iterable[str]) -> Iterator[tuple[str, Any]]:
    """Figures of a run, nondimensional; over both axes if they have any."""
    try:
        parts = task_figures(run)
    except ValueError:  # too short
        return
    units = {name: unit for task in TASKS.values() for name, unit in task.units.items()}
    for name, values in ((str(name), values) for part in parts for name, values in part.items()):
        if name in wanted:
            found = values.values / _scale(scenario, units[name])
            if "axis" in values.dims:
                own = dict(zip(values["axis"].values, found, strict=True))
                found = np.array([own.get(axis, np.nan) for axis in AXES])
            yield name, found


def _scale(scenario: Scenario, unit: str) -> float:
    return scenario.plant.scales.of(unit) if scenario.run.units == "SI" else 1.0
