"""Objectives and constraints: statistics of metrics over noise seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, WithJsonSchema, model_validator

from ...analysis.metric_names import ALL_METRICS, metric_hint
from ...analysis.task_runs import measure_tasks
from ...scenario import Scenario
from ...scenario.table import Table, field, format_value, message_error
from ...simulation.native import Law
from ...simulation.user_controller import ControllerLike
from ..file import METRIC

Values = NDArray[np.float64]
STATISTICS: dict[str, Callable[[Values], Any]] = {"mean": np.mean, "median": np.median, "max": np.max}


STATISTIC = WithJsonSchema({"type": "string", "pattern": rf"^({'|'.join(STATISTICS)}|quantile [^a-df-zA-DF-Z]+)$"})


def _metric(name: str) -> str:
    if name not in ALL_METRICS:
        raise message_error(f"metric is {format_value(name)}, which is not a known metric; {metric_hint(name)}")
    return name


def _statistic(text: str) -> str:
    if text not in STATISTICS and _quantile(text) is None:
        raise message_error(
            f"statistic is {format_value(text)}: it must be mean, median, max, or quantile and a number between 0 and "
            '1, as "quantile 0.95"'
        )
    return text


def _quantile(text: str) -> float | None:
    word, _, number = text.partition(" ")
    try:
        level = float(number)
    except ValueError:
        return None
    return level if word == "quantile" and 0 <= level <= 1 else None


class Objective(Table):
    """A statistic of a metric over the seeds, to be minimized. For signed metrics the magnitude counts."""

    metric: Annotated[str, AfterValidator(_metric), METRIC] = field(..., "Name of a metric, such as rmse_steady_x.")
    statistic: Annotated[str, AfterValidator(_statistic), STATISTIC] = field(
        "mean", 'Statistic over the seeds: mean, median, max, or a quantile, such as "quantile 0.95".'
    )

    @property
    def label(self) -> str:
        return f"{self.statistic} of {self.metric}"

    def of(self, values: Values) -> float:
        """The statistic; infinite if a value that it needs is NaN, meaning never."""
        sizes = np.where(np.isnan(values), np.inf, np.abs(values))
        with np.errstate(invalid="ignore"):
            level = _quantile(self.statistic)
            found = float(STATISTICS[self.statistic](sizes) if level is None else np.quantile(sizes, level))
        return np.inf if np.isnan(found) else found


class Constraint(Objective):
    """A statistic with a limit: a number, or a multiple of the base scenario's value."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": [limit]} for limit in ("at_most", "at_most_base")]}
    )

    at_most: float | None = field(None, "Limit of the statistic; give exactly one of at_most and at_most_base.")
    at_most_base: float | None = field(None, "Limit as a multiple of the base scenario's value.")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.at_most is None) == (self.at_most_base is None):
            given = "neither" if self.at_most is None else "both"
            raise message_error(
                f"the constraint on {self.metric} has {given} of at_most and at_most_base: it must have exactly one"
            )
        return self

    def limit(self, base: Measured) -> float:
        """The limit, on the seeds of `base`."""
        if self.at_most_base is None:
            assert self.at_most is not None
            return self.at_most
        return self.at_most_base * self.of(base.metrics[self.metric])


@dataclass(frozen=True)
class Measured:
    """Metrics of one scenario, by name and seed; NaN for diverged runs."""

    metrics: dict[str, Values]
    diverged: NDArray[np.bool_]


def measure(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    thresholds: dict[str, Any],
    progress: Callable[[int], object] | None = None,
    controller: ControllerLike | Sequence[Law] | None = None,
    tasks: Sequence[str] = (),
) -> list[Measured]:
    """Metrics of every scenario with every seed, with the figures of `tasks`."""
    runs = measure_tasks(scenarios, tasks, seeds=seeds, controller=controller, progress=progress, **thresholds)
    diverged = np.isfinite(runs["diverged_at"].values).reshape(len(scenarios), len(seeds))
    columns = {}
    for name, variable in runs.drop_vars("diverged_at").data_vars.items():
        inner = [dimension for dimension in variable.dims if dimension != "run"]
        labels = [*product(*(variable[dimension].values for dimension in inner))]
        parts = variable.transpose("run", *inner).values.reshape(runs.sizes["run"], len(labels))
        for label, column in zip(labels, parts.T, strict=True):
            whole = np.where(diverged, np.nan, column.reshape(diverged.shape))
            columns["_".join(map(str, (name, *label)))] = whole
    return [Measured({name: column[i] for name, column in columns.items()}, diverged[i]) for i in range(len(scenarios))]


@dataclass(frozen=True)
class Score:
    """Objectives and constraints of a scenario."""

    objectives: tuple[float, ...]
    constraints: tuple[float, ...]  # statistics with limits
    excess: tuple[float, ...]  # excess of each statistic over its limit, relative to the limit; met if <= 0
    diverged: float  # fraction of the seeds

    @property
    def feasible(self) -> bool:
        return self.diverged == 0 and bool(np.isfinite(self.objectives).all()) and max(self.excess, default=0.0) <= 0


NEVER = 1e6  # excess of an infinite statistic


def score(
    measured: Measured, objectives: Sequence[Objective], constraints: Sequence[Constraint], limits: Sequence[float]
) -> Score:
    found = [c.of(measured.metrics[c.metric]) for c in constraints]
    over = [(v - limit) / (abs(limit) or 1.0) for v, limit in zip(found, limits, strict=True)]
    return Score(
        tuple(o.of(measured.metrics[o.metric]) for o in objectives),
        tuple(found),
        tuple(min(excess, NEVER) for excess in over),
        float(measured.diverged.mean()),
    )
