"""The space of a study: fields of a scenario that vary, each over a range or a list of values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from .. import _core
from ..arguments import number
from ..scenario import Scenario, ScenarioError
from ..scenario.messages import paths, scenario_error, unknown
from ..scenario.quantities import number_of
from ..scenario.table import Table, as_given, format_value
from ..scenario.table import field as described
from ..simulation.user_controller import ControllerLike
from .controller import check_read, is_parameter, parameter

MAX_POINTS = 10**6  # points of a study; also the largest number of seeds and of trials


@dataclass(frozen=True)
class Dimension:
    """A field that varies: from `low` to `high`, or over `choices` (then both are 0)."""

    field: str  # dotted path, such as controller.order, or law.NAME
    low: float
    high: float
    scale: Literal["linear", "log"] = "linear"
    integer: bool = False
    choices: tuple[Any, ...] | None = None
    steps: int | None = None  # in a grid

    def at(self, u: float) -> Any:
        """The value at `u`, 0 <= u < 1: a uniform u gives a uniform or, with scale "log", a log-uniform value."""
        if self.choices is not None:
            return self.choices[int(u * len(self.choices))]
        low, high = self.low, self.high + (1 if self.integer else 0)
        value = low * _core.power(high / low, u) if self.scale == "log" else low + (high - low) * u
        value = min(math.floor(value) if self.integer else value, self.high)
        return int(value) if self.integer else max(value, self.low)

    def at_each(self, units: NDArray[np.float64]) -> NDArray[Any]:
        """The values of `at` for many u, or with choices their places: an array of doubles or integers, (u,)."""
        if self.choices is not None:
            return (units * len(self.choices)).astype(np.int64)
        if self.scale == "log":
            return np.array([self.at(u) for u in units.tolist()], dtype=np.int64 if self.integer else np.float64)
        low, high = self.low, self.high + (1 if self.integer else 0)
        values = low + (high - low) * units
        if self.integer:
            return np.minimum(np.floor(values), self.high).astype(np.int64)
        return np.clip(values, self.low, self.high)

    def extremes(self) -> tuple[Any, ...]:
        """The choices, or the ends of the range."""
        if self.choices is not None:
            return self.choices
        return (int(self.low), int(self.high)) if self.integer else (self.low, self.high)

    def grid(self) -> tuple[Any, ...] | None:
        """The choices, or `steps` values from low to high; None without either."""
        if self.choices is not None or self.steps is None:
            return self.choices
        low, high, parts = self.low, self.high, np.linspace(0.0, 1.0, self.steps).tolist()
        spaced = [low * _core.power(high / low, u) if self.scale == "log" else low + (high - low) * u for u in parts]
        # To 12 digits, so that 0.3 is exactly 0.3.
        values = [float(f"{v:.12g}") for v in spaced]
        if self.integer:
            return tuple(dict.fromkeys(round(v) for v in values))
        return tuple(min(max(v, self.low), self.high) for v in values)


class Range(Table):
    """A range: low to high, or relative to the base scenario's value."""

    low: float | None = described(None, "Smallest value; requires high.")
    high: float | None = described(None, "Largest value; requires low.")
    relative: float | None = described(
        None, "Instead of low and high: the base scenario's value plus or minus this fraction of it.", gt=0
    )
    scale: Literal["linear", "log"] = described(
        "linear", "Spacing or distribution of the values; log requires low > 0."
    )
    steps: int | None = described(
        None, "Number of values of a grid or a list, including the ends; not allowed otherwise.", ge=2, le=MAX_POINTS
    )


def read_space(
    entries: Mapping[str, Any], base: Scenario, controller: ControllerLike | None = None
) -> tuple[Dimension, ...]:
    """The dimensions in `entries`, by field: { low, high, scale, steps }, { relative, steps } or a list.

    law.NAME is a parameter of the controller, which must be a native.Law.
    Raises ScenarioError for an unknown field or an invalid range.
    """
    found = []
    for field, entry in flat(entries).items():
        value_of(field, base, controller)  # raises for an unknown parameter
        check_read(field, controller)
        found.append(_dimension(field, entry, base, controller))
    return tuple(found)


def value_of(field: str, base: Scenario, controller: ControllerLike | None = None) -> Any:
    """The value of a field in the base scenario, or of a parameter. Raises ScenarioError for an unknown parameter."""
    if is_parameter(field):
        return parameter(field, controller)
    value: Any = base
    for name in field.split("."):
        value = getattr(value, name)
    return value


def flat(entries: Mapping[str, Any], table: str = "") -> dict[str, Any]:
    """Entries by dotted field, for all of TOML's notations: dotted keys, quoted keys, nested tables.

    Raises ScenarioError for a key that is given twice and a value that must be a table.
    """
    found: dict[str, Any] = {}
    for name, entry in entries.items():
        field = f"{table}.{name}" if table else name
        if field not in ("law", *paths(Scenario)) and not is_parameter(field):
            raise ScenarioError(unknown(field, Scenario))
        deeper = field == "law" or any(path.startswith(f"{field}.") for path in paths(Scenario))
        if deeper and not isinstance(entry, Mapping):
            raise ScenarioError(f"{field} is {format_value(entry)}: it must be a table")
        for key, value in (flat(entry, field) if deeper else {field: entry}).items():
            if key in found:
                raise ScenarioError(f"{key} is given twice: it must be given once")
            found[key] = value
    return found


def _dimension(field: str, entry: Any, base: Scenario, controller: ControllerLike | None) -> Dimension:
    if isinstance(entry, list | tuple):
        if not entry:
            raise ScenarioError(f"{field} is []: it must have at least one value")
        values = [_with_number(field, value, base) for value in entry]
        return Dimension(field, 0.0, 0.0, choices=tuple(as_given(value, _valid(field, value)) for value in values))
    if not isinstance(entry, Mapping):
        law = is_parameter(field)
        raise ScenarioError(
            f"{field} is {format_value(entry)}: it must be a list of values or "
            f"{{ low, high }} or {{ relative }}; a single value belongs to {'the law' if law else '[fixed]'}"
        )
    ends = {end: _with_number(field, entry[end], base) for end in ("low", "high") if end in entry}
    try:
        asked = Range(**{**entry, **ends})
    except ValidationError as error:
        raise ScenarioError(f"{field}: {scenario_error(error, Range)}") from None
    low, high = _ends(field, asked, base, controller)
    if not low < high:
        raise ScenarioError(
            f"{field}: low is {format_value(low)}: it must be less than high, which is {format_value(high)}"
        )
    if asked.scale == "log" and not low > 0:
        raise ScenarioError(f'{field}: low is {format_value(low)}: it must be greater than 0 when scale is "log"')
    integer = not is_parameter(field) and _info(field).annotation is int
    for end in (low, high):
        _valid(field, int(end) if integer and end == int(end) else end)
    return Dimension(field, low, high, asked.scale, integer, steps=asked.steps)


def _ends(field: str, asked: Range, base: Scenario, controller: ControllerLike | None) -> tuple[float, float]:
    if asked.relative is None:
        if asked.low is None or asked.high is None:
            raise ScenarioError(f"{field} is {_given(asked)}: it must have low and high, or relative")
        return asked.low, asked.high
    if asked.low is not None or asked.high is not None:
        raise ScenarioError(f"{field} is {_given(asked)}: it must have either low and high or relative")
    value = value_of(field, base, controller)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < abs(value) < math.inf:
        raise ScenarioError(
            f"{field}: relative is {format_value(asked.relative)}: the base value must be a number other than 0, "
            f"but it is {format_value(value)}"
        )
    ends = value * (1 - asked.relative), value * (1 + asked.relative)
    return min(ends), max(ends)


def _with_number(field: str, value: Any, base: Scenario) -> Any:
    """A number in the unit of the field from text with a unit; other values as they are."""
    return value if is_parameter(field) else number_of(base, field, value)


def _given(asked: Range) -> str:
    return format_value({name: getattr(asked, name) for name in asked.model_fields_set})


def _info(field: str) -> FieldInfo:
    model: Any = Scenario
    *tables, name = field.split(".")
    for table in tables:
        model = model.model_fields[table].annotation
    info: FieldInfo = model.model_fields[name]
    return info


def _valid(field: str, value: Any) -> Any:
    """The validated value of a field; combinations of fields are validated with the whole scenario."""
    if is_parameter(field):
        try:
            return number(field, value) + 0.0
        except (TypeError, ValueError):
            raise ScenarioError(f"{field} is {format_value(value)}: it must be a finite number") from None
    info = _info(field)
    kind: Any = Annotated[info.annotation, info]
    try:
        return TypeAdapter(kind, config=Table.model_config).validate_python(value)
    except ValidationError as error:
        raise scenario_error(error, Scenario, tuple(field.split("."))) from None
