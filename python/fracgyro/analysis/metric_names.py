"""The names of metrics: quantity of each, and words and unit of each column. metrics.py defines them."""

from __future__ import annotations

import difflib
from itertools import cycle

from ..scenario.kinds import METRICS as LISTED
from ..scenario.kinds import WINDOWS, Channel


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


def nondimensional_unit(metric: str) -> str:
    """The units of a metric as text, separated by commas if its columns differ."""
    return ", ".join(map(written, UNITS[metric]))


def metric_hint(name: str) -> str:
    """Hint for an unknown name: the nearest column of METRICS, or all of them."""
    near = difflib.get_close_matches(name, METRICS)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(METRICS)}"
