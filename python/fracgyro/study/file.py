"""The study file: the part shared by sweeps and tunings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError, WithJsonSchema

from ..analysis.metric_names import ALL_METRICS, lacking
from ..analysis.metrics import ERROR_BOUND, RATE_TOLERANCE, SURFACE_BOUND, TRANSIENT
from ..scenario import Scenario, ScenarioError
from ..scenario.messages import scenario_error
from ..scenario.named import named
from ..scenario.table import Table, field, format_value, message_error
from ..scenario.toml import read_tables, read_text
from .controller import is_parameter
from .space import MAX_POINTS, flat

Model = TypeVar("Model", bound=BaseModel)
# Descriptions of the shared keys.
TITLE = "Title of the summary and the report."
SCENARIO = "Base scenario: a name of `fracgyro scenario --list`, or a scenario file, relative to this one."
FIXED = "Changed fields of the scenario, by their dotted names."
VARY = "Fields of the scenario that vary, by their dotted names, or law.NAME: each a list of values, or a range."


class Thresholds(Table):
    """Thresholds of the metrics, nondimensional."""

    transient: float = field(TRANSIENT, "End of the transient and start of the steady window.", unit="1/omega0", gt=0)
    error_bound: float = field(ERROR_BOUND, "Bound of the error for error_settling_time.", unit="q0", gt=0)
    surface_bound: float = field(
        SURFACE_BOUND, "Bound of the surface for surface_settling_time.", unit="q0*omega0", gt=0
    )
    rate_tolerance: float = field(
        RATE_TOLERANCE, "Bound of the rate error for rate_settling_time, relative to the rate.", gt=0
    )


def seeds_of(value: Any) -> Any:
    """Seeds from a number or a list: 16 means seeds 0 to 15."""
    if type(value) is int and 1 <= value <= MAX_POINTS:
        return list(range(value))
    listed = isinstance(value, list) and all(type(seed) is int and 0 <= seed < 2**63 for seed in value)
    if not listed or not value or len(set(value)) < len(value):
        raise message_error(
            f"seeds is {format_value(value)}: it must be their number, from 1 to {MAX_POINTS}, "
            "or a list of different integers from 0 to 2^63 - 1"
        )
    return value


METRIC = WithJsonSchema({"enum": list(ALL_METRICS)})
SEEDS = WithJsonSchema(
    {
        "anyOf": [
            {"type": "integer", "minimum": 1, "maximum": MAX_POINTS},
            {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1, "uniqueItems": True},
        ]
    }
)


def load_study(path: str | os.PathLike[str], model: type[Model]) -> Model:
    """The TOML file as an instance of `model`. Raises ScenarioError for an invalid file."""
    tables = read_tables(read_text(path), str(path))
    try:
        return model(**tables)
    except ValidationError as error:
        raise scenario_error(error, model) from None


def base_scenario(name: str, folder: Path, fixed: Mapping[str, Any]) -> Scenario:
    """The shipped scenario of this name or a file relative to `folder`, with the changes `fixed`."""
    base = named(name, folder)
    changes = flat(fixed)
    for name in filter(is_parameter, changes):
        raise ScenarioError(f"{name} is in [fixed]: it must be set in the controller that is passed to the study")
    return base.replace(changes)


def check_tasks(names: Iterable[str], found: Iterable[str], whose: str) -> None:
    """Raises ScenarioError for a name that is a task's figure but not among `found`; `whose`: words for the runs."""
    if why := lacking(names, found):
        raise ScenarioError(f"{why}, which {whose} lacks")


def refuse_both(fixed: Mapping[str, Any], vary: Mapping[str, Any]) -> None:
    """Raises ScenarioError for a field that is in both."""
    for name in flat(fixed):
        if name in flat(vary):
            raise ScenarioError(f"{name} is in [fixed] and in [vary]: it must be in one of them")
