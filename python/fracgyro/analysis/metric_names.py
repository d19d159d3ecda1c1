"""The names of metrics: quantity of each, and words and unit of each column. metrics.py defines them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from itertools import cycle
from typing import NamedTuple

from ..scenario.kinds import AXES, SINE_DRIVES, WINDOWS, Channel
from ..scenario.kinds import METRICS as LISTED


def column_names(metric: Channel) -> list[str]:
    """Columns of a metric as the core lists it: one, or one for each axis or entry."""
    return [f"{metric.name}_{label}" for label in metric.labels] if metric.width > 1 else [metric.name]


def _words(metric: Channel) -> list[str]:
    return [f"{metric.meaning}, {label}" for label in metric.labels] if metric.width > 1 else [metric.meaning]


def written(unit: str) -> str:
    """A nondimensional unit as text; empty for 1."""
    return "" if unit == "1" else unit.replace("omega0", "ω0").replace("^2", "²").replace("*", " ")


def quantity(metric: Channel) -> str:
    """The name of the variable that has a metric: rmse, over its windows, or the metric's own name."""
    name, _, window = metric.name.partition("_")
    return name if window in WINDOWS else metric.name


COLUMNS = [column for metric in LISTED for column in column_names(metric)]  # columns of a row of the core
# Columns, with words and unit; the time of divergence is not a metric that is compared or optimized.
METRICS = {
    column: (words, written(unit))
    for metric in LISTED
    if metric.name != "diverged_at"
    for column, words, unit in zip(column_names(metric), _words(metric), cycle(metric.units))
}
# Nondimensional units of each metric: one, or one for each of its columns.
UNITS = {quantity(metric): metric.units for metric in LISTED}


class Task(NamedTuple):
    """A task of a run, with words and nondimensional unit of each of its figures, which tasks.py defines."""

    needs: str  # condition on the scenario
    by_axis: bool
    figures: dict[str, tuple[str, str]]

    @property
    def units(self) -> dict[str, str]:
        return {name: unit for name, (_, unit) in self.figures.items()}


TASKS = {
    "step": Task(
        "reference.kind = step",
        True,
        {
            "overshoot": ("overshoot of a step, relative to its height", "1"),
            "rise_time": ("time of a step from 10 to 90 % of its height", "1/omega0"),
            "settling_time": ("time after which a step stays within 2 % of its height", "1/omega0"),
            "final_error": ("mean error at the end of a step, relative to its height", "1"),
        },
    ),
    "chirp": Task(
        "reference.kind = chirp",
        True,
        {
            "cutoff_frequency": ("first frequency of a chirp at which the gain is 3 dB below 1", "omega0"),
            "gain_deviation": ("largest deviation of the gain from 1 along a chirp", "1"),
            "phase_deviation": ("largest phase between reference and position along a chirp", "rad"),
        },
    ),
    "drive": Task(
        f"controller.kind = {' or '.join(SINE_DRIVES)}",
        False,
        {
            "amplitude_error": ("mean error of the drive amplitude, relative", "1"),
            "amplitude_noise": ("standard deviation of the drive amplitude, relative", "1"),
            "amplitude_settling_time": ("time after which the drive amplitude stays within 1 %", "1/omega0"),
            "frequency": ("mean frequency of the drive's phase-locked loop", "omega0"),
            "phase_error": ("angle by which the drive force leads the velocity", "rad"),
            "quadrature": ("mean quadrature, as an angular rate", "omega0"),
            "quadrature_noise": ("standard deviation of the quadrature, as an angular rate", "omega0"),
        },
    ),
}
# Columns of a study, by task: axis and figure of each.
_TASK_COLUMNS = {
    name: {
        (f"{figure}_{axis}" if axis else figure): (figure, axis)
        for figure in task.figures
        for axis in (AXES if task.by_axis else [""])
    }
    for name, task in TASKS.items()
}
TASK_METRICS = {
    column: (f"{words}, {axis}" if axis else words, written(unit))
    for name, columns in _TASK_COLUMNS.items()
    for column, (figure, axis) in columns.items()
    for words, unit in [TASKS[name].figures[figure]]
}
ALL_METRICS = METRICS | TASK_METRICS


def task_columns(tasks: Iterable[str]) -> list[str]:
    """Columns of the figures of these tasks."""
    return [column for name in tasks for column in _TASK_COLUMNS[name]]


def tasks_of_columns(columns: Iterable[str]) -> tuple[str, ...]:
    """Tasks that have any of these columns."""
    wanted = set(columns)
    return tuple(name for name, own in _TASK_COLUMNS.items() if wanted & set(own))


def lacking(columns: Iterable[str], found: Iterable[str]) -> str | None:
    """A message about the first of these columns that is a task's figure but not among `found`; None if all are."""
    have = set(found)
    for name, own in _TASK_COLUMNS.items():
        for column in columns:
            if column in own and column not in have:
                axis = own[column][1]
                where = f" on {axis}" if axis else ""
                return f"{column} needs {TASKS[name].needs}{where}"
    return None


def nondimensional_unit(metric: str) -> str:
    """The units of a metric as text, separated by commas if its columns differ."""
    return ", ".join(map(written, UNITS[metric]))


def metric_hint(name: str) -> str:
    """Hint for an unknown name: its columns or the nearest one of ALL_METRICS, or all of them."""
    if axes := [f"{name}_{axis}" for axis in AXES if f"{name}_{axis}" in ALL_METRICS]:
        return f"did you mean {' or '.join(axes)}?"
    near = difflib.get_close_matches(name, ALL_METRICS)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(ALL_METRICS)}"
