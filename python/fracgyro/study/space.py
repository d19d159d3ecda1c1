"""What varies in a study: fields of a scenario, each over a range or a list of values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from .. import _core
from ..arguments import number
from ..scenario import Scenario, ScenarioError
from ..scenario.sentences import explained, paths, unknown
from ..scenario.table import Table, shown
from ..scenario.table import field as described
from ..simulation.outside import ControllerLike
from .controller import check_read, is_parameter, parameter

MAX_POINTS = 10**6  # of a study; also runs for one of them, and trials


@dataclass(frozen=True)
class Dimension:
    """A field that varies: from `low` to `high`, or over `choices` (then both are 0)."""

    field: str  # dotted path, as controller.order, or law.NAME
    low: float
    high: float
    scale: Literal["linear", "log"] = "linear"
    integer: bool = False
    choices: tuple[Any, ...] | None = None
    steps: int | None = None  # of a grid

    def at(self, u: float) -> Any:
        """The value at `u`, 0 <= u < 1: uniform in u gives a uniform (or, scale "log", log-uniform) value."""
        if self.choices is not None:
            return self.choices[int(u * len(self.choices))]
        low, high = self.low, self.high + (1 if self.integer else 0)
        value = low * _core.power(high / low, u) if self.scale == "log" else low + (high - low) * u
        value = min(math.floor(value) if self.integer else value, self.high)
        return int(value) if self.integer else max(value, self.low)

    def grid(self) -> tuple[Any, ...] | None:
        """The choices, or `steps` values from low to high; None without either."""
        if self.choices is not None or self.steps is None:
            return self.choices
        low, high, parts = self.low, self.high, np.linspace(0.0, 1.0, self.steps).tolist()
        spaced = [low * _core.power(high / low, u) if self.scale == "log" else low + (high - low) * u for u in parts]
        # To 12 digits: 0.3 is then 0.3, and can be asked for.
        values = [float(f"{v:.12g}") for v in spaced]
        if self.integer:
            return tuple(dict.fromkeys(round(v) for v in values))
        return tuple(min(max(v, self.low), self.high) for v in values)


class Range(Table):
    """A range: low to high, or relative to the base scenario's value."""

    low: float | None = described(None, "Its least value; with high.")
    high: float | None = described(None, "Its greatest value; with low.")
    relative: float | None = described(
        None, "In the place of low and high: the base scenario's value, more or less by this fraction of it.", gt=0
    )
    scale: Literal["linear", "log"] = described("linear", "How values are spaced or drawn; log: low > 0.")
    steps: int | None = described(
        None, "Of a grid or a list: how many values, ends included; left out elsewhere.", ge=2, le=MAX_POINTS
    )


def read_space(
    entries: Mapping[str, Any], base: Scenario, controller: ControllerLike | None = None
) -> tuple[Dimension, ...]:
    """The dimensions that `entries` ask for, by field: { low, high, scale, steps }, { relative, steps } or a list.

    law.NAME is a parameter of the controller, which must be a native.Law.
    Raises ScenarioError in one sentence when a field is unknown or what is asked of it impossible.
    """
    found = []
    for field, entry in flat(entries).items():
        value_of(field, base, controller)  # raises where the law has no such parameter
        check_read(field, controller)
        found.append(_dimension(field, entry, base, controller))
    return tuple(found)


def value_of(field: str, base: Scenario, controller: ControllerLike | None = None) -> Any:
    """What the base has there. Raises ScenarioError for a parameter that the controller does not have."""
    if is_parameter(field):
        return parameter(field, controller)
    value: Any = base
    for name in field.split("."):
        value = getattr(value, name)
    return value


def flat(entries: Mapping[str, Any], table: str = "") -> dict[str, Any]:
    """By dotted field, whether it is written so, in quotes, or as TOML's nested tables. Raises ScenarioError."""
    found: dict[str, Any] = {}
    for name, entry in entries.items():
        field = f"{table}.{name}" if table else name
        if field not in ("law", *paths(Scenario)) and not is_parameter(field):
            raise ScenarioError(unknown(field, Scenario))
        deeper = field == "law" or any(path.startswith(f"{field}.") for path in paths(Scenario))
        if deeper and not isinstance(entry, Mapping):
            raise ScenarioError(f"{field} is {shown(entry)}: it must be a table")
        for key, value in (flat(entry, field) if deeper else {field: entry}).items():
            if key in found:
                raise ScenarioError(f"{key} is given twice: it must be given once")
            found[key] = value
    return found


def _dimension(field: str, entry: Any, base: Scenario, controller: ControllerLike | None) -> Dimension:
    if isinstance(entry, list | tuple):
        if not entry:
            raise ScenarioError(f"{field} is []: it must have at least one value")
        return Dimension(field, 0.0, 0.0, choices=tuple(_valid(field, value) for value in entry))
    if not isinstance(entry, Mapping):
        law = is_parameter(field)
        raise ScenarioError(
            f"{field} is {shown(entry)}: it must be a list of values or "
            f"{{ low, high }} or {{ relative }}; a single value belongs to {'the law' if law else '[fixed]'}"
        )
    try:
        asked = Range(**entry)
    except ValidationError as error:
        raise ScenarioError(f"{field}: {explained(error, Range)}") from None
    low, high = _ends(field, asked, base, controller)
    if not low < high:
        raise ScenarioError(f"{field}: low is {shown(low)}: it must be less than high, which is {shown(high)}")
    if asked.scale == "log" and not low > 0:
        raise ScenarioError(f'{field}: low is {shown(low)}: it must be greater than 0 when scale is "log"')
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
            f"{field}: relative is {shown(asked.relative)}: the base value must be a number other than 0, "
            f"but it is {shown(value)}"
        )
    ends = value * (1 - asked.relative), value * (1 + asked.relative)
    return min(ends), max(ends)


def _given(asked: Range) -> str:
    return shown({name: getattr(asked, name) for name in asked.model_fields_set})


def _info(field: str) -> FieldInfo:
    model: Any = Scenario
    *tables, name = field.split(".")
    for table in tables:
        model = model.model_fields[table].annotation
    info: FieldInfo = model.model_fields[name]
    return info


def _valid(field: str, value: Any) -> Any:
    """The value as the field holds it. What it means together with other fields is for the whole scenario to check."""
    if is_parameter(field):
        try:
            return number(field, value) + 0.0
        except (TypeError, ValueError):
            raise ScenarioError(f"{field} is {shown(value)}: it must be a finite number") from None
    info = _info(field)
    kind: Any = Annotated[info.annotation, info]
    try:
        return TypeAdapter(kind, config=Table.model_config).validate_python(value)
    except ValidationError as error:
        raise explained(error, Scenario, tuple(field.split("."))) from None
