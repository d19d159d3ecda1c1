"""Text with units in the tables of a scenario: "2 us" becomes a number in the unit of its field, and back."""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from functools import cache, cached_property
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from .disturbance import FORCE
from .messages import ScenarioError
from .points import FILES, Hashed, PointsFile, with_rows
from .scales import SI_TABLES, Scales, exact_unit
from .schema import Controller, Plant
from .table import Symmetric, Wrong, format_value, message_error
from .units import Quantity, Unit, UnitError, factor, is_quantity, parse, printed, quantity
from .volts import wrapped

ACCELERATION = FORCE.removeprefix("m*")
# Fields of [controller] that are exponents in units of other fields.
EXPONENTS = {
    "alpha": "order",
    "c": "terminal_exponent",
    "gamma1": "position_exponent",
    "gamma2": "velocity_exponent",
    "rho": "reaching_exponent",
    "mu": "near_exponent",
    "nu": "far_exponent",
}


class Units:
    """The units of the fields of a scenario, from its tables as they were given."""

    def __init__(self, tables: Mapping[str, Any], model: type[BaseModel]) -> None:
        self.tables, self.model = tables, model

    @cached_property
    def scales(self) -> Scales:
        plant = self.tables.get("plant", {})
        if isinstance(plant, Plant):
            return plant.scales
        with contextlib.suppress(ValidationError):  # which the scenario reports
            return Plant(**plant).scales if isinstance(plant, Mapping) else Plant().scales
        return Plant().scales

    @cached_property
    def exponents(self) -> tuple[tuple[str, float], ...]:
        given = self.tables.get("controller", {})
        given = dict(given) if isinstance(given, BaseModel | Mapping) else {}
        known = {symbol: name for symbol, name in EXPONENTS.items() if name in Controller.model_fields}
        found = {symbol: given.get(name, Controller.model_fields[name].default) for symbol, name in known.items()}
        return tuple((symbol, float(value)) for symbol, value in found.items() if isinstance(value, int | float))

    def of(self, table: str, unit: str) -> tuple[Unit, str]:
        """The unit of a field, and its SI unit as text."""
        return (parse(unit), unit) if table in SI_TABLES else exact_unit(self.scales, unit, self.exponents)


def with_numbers(given: Mapping[str, Any], model: type[BaseModel]) -> dict[str, Any]:
    """The tables of a scenario with numbers for all text with units.

    If `units` is SI, plain numbers of nondimensional fields and of files are in SI, too. A Wrong replaces text
    in a unit that its field does not have, and the rows of a file that has none.
    """
    tables = {name: table for name, table in wrapped(given).items() if name != "units"}
    units = given.get("units", "nondimensional")
    if units not in ("nondimensional", "SI"):
        tables["units"] = Wrong(f"units is {format_value(units)}: it must be nondimensional or SI")
    run = tables.get("run", {})
    if units == "SI" and isinstance(run, Mapping):
        tables["run"] = {"units": "SI", **run}
    found = Units(tables, model)
    for name in sorted(tables, key=lambda name: name not in SI_TABLES):  # the plant first, which has the scales
        info = model.model_fields.get(name)
        if info and isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            si = units == "SI" and name not in SI_TABLES
            if si or not _only_numbers(tables[name]):
                tables[name] = _table(tables[name], info.annotation, name, lambda *of, si=si: _checked(found, si, *of))
            if name in FILES:
                tables[name] = _with_rows(tables[name], name, FILES[name], info.annotation, found, si)
    return tables


def _checked(*of: Any) -> Any:
    """The result of `_number`; a Wrong instead of an error."""
    try:
        return _number(*of)
    except PydanticCustomError as error:
        return Wrong(error.message())


def _with_rows(value: Any, path: str, file: PointsFile, model: type[BaseModel], units: Units, si: bool) -> Any:
    """A table, or a list of them, with rows in place of the file that a table may name."""
    if isinstance(value, list | tuple):
        return [_with_rows(each, f"{path}[{k}]" if k else path, file, model, units, si) for k, each in enumerate(value)]
    if not isinstance(value, Mapping):
        return value
    if isinstance(added := value.get("added"), list | tuple):
        rest = [_with_rows(each, f"{path}[{k}]", file, model, units, si) for k, each in enumerate(added, start=1)]
        value = {**value, "added": rest}
    kind = value.get("kind")
    of_table = "kind" not in model.model_fields or "table" in (kind if isinstance(kind, list | tuple) else [kind])
    if not isinstance(value.get(file.field), str) or not of_table:
        return value
    names = _meant(unit_of(model.model_fields[file.points]), value).split(", ")

    def by(column: int, given: str | None) -> Decimal | None:
        if given is None and not si:
            return None
        wanted, name = units.of(path.partition("[")[0], names[min(column, len(names) - 1)])
        return factor(given or name, wanted, name)

    try:
        return with_rows(value, file, path, by)
    except PydanticCustomError as error:
        others = {name: each for name, each in value.items() if name != file.field}
        return {**others, file.points: Wrong(error.message())}


def _only_numbers(table: Any) -> bool:
    """True if there is no text with a unit in a table: most have none, which is then known at once."""
    values = (vars(table) if isinstance(table, BaseModel) else table if isinstance(table, dict) else {}).values()
    return bool(values) and all(
        type(value) in PLAIN
        or (type(value) is str and not is_quantity(value))
        or (type(value) in (tuple, list) and all(type(each) is float for each in value))
        or (type(value) is dict and all(type(each) is float for each in value.values()))
        or (type(value) is Symmetric and all(type(each) is float for each in vars(value).values()))
        for value in values
    )


PLAIN = (float, int, bool, type(None), Hashed)
Change = Callable[[Any, str, str], Any]  # changes a number: value, unit and path


def _table(value: Any, model: type[BaseModel], path: str, change: Change) -> Any:
    if isinstance(value, list | tuple):
        return [_table(each, model, f"{path}[{place}]", change) for place, each in enumerate(value)]
    given = {name: getattr(value, name) for name in value.model_fields_set} if isinstance(value, BaseModel) else value
    if not isinstance(given, Mapping):
        return value
    found = {}
    for name, (unit, inner) in _numeric(model).items():
        if name in given:
            at, each = f"{path}.{name}", given[name]
            found[name] = _table(each, inner, at, change) if inner else _entries(each, _meant(unit, given), at, change)
    return value if all(found[name] is given[name] for name in found) else {**given, **found}


@cache
def _numeric(model: type[BaseModel]) -> dict[str, tuple[str, type[BaseModel] | None]]:
    """The fields of a table that have numbers: their unit, and the table in each if it is one."""
    found: dict[str, tuple[str, type[BaseModel] | None]] = {}
    for name, info in model.model_fields.items():
        if tables := _tables_in(info.annotation):
            found[name] = "", tables[0]
        elif _has_numbers(info.annotation):
            found[name] = unit_of(info), None
    return found


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [] if issubclass(annotation, Symmetric) else [annotation]
    return [each for part in get_args(annotation) for each in _tables_in(part)]


def _has_numbers(annotation: Any) -> bool:
    return annotation in (float, Symmetric) or any(map(_has_numbers, get_args(annotation)))


def unit_of(info: Any) -> str:
    """The unit of a field; of entries with different units, all of them."""
    return str((info.json_schema_extra or {}).get("unit", "1"))


def _meant(unit: str, table: Mapping[str, Any]) -> str:
    """The unit of a field in this table: that of an acceleration if the values of a disturbance are accelerations."""
    return unit.replace(FORCE, ACCELERATION) if table.get("quantity") == "acceleration" else unit


def _entries(value: Any, unit: str, path: str, change: Change) -> Any:
    """The value of a field with its numbers changed, entry by entry."""
    if isinstance(value, Hashed):
        return value
    if isinstance(value, str | int | float):
        return change(value, unit, path)
    if isinstance(value, BaseModel):
        changed = _entries(dict(value), unit, path, change)
        return value if all(changed[name] is each for name, each in value) else changed
    if isinstance(value, Mapping):
        return {name: _entries(each, unit, f"{path}.{name}", change) for name, each in value.items()}
    if not isinstance(value, list | tuple):
        return value
    units = unit.split(", ") if not any(isinstance(each, list | tuple) for each in value) else [unit]
    entries = enumerate(value)
    found = [_entries(each, units[min(k, len(units) - 1)], f"{path}[{k}]", change) for k, each in entries]
    return value if all(map(operator.is_, found, value)) else found


def _number(units: Units, si: bool, value: Any, unit: str, path: str) -> Any:
    """A number from text; other values as they are, except plain ones in SI, which become quantities."""
    if not si and type(value) in (float, int, bool):
        return value
    plain = isinstance(value, int | float) and not isinstance(value, bool | Quantity)
    if isinstance(value, Quantity):
        text = value.text
    elif isinstance(value, str) and is_quantity(value):
        text = value
    elif not (si and plain and unit not in ("1", "rad") and abs(value) < math.inf):
        return value
    try:
        wanted, name = units.of(path.partition(".")[0], unit)
        return quantity(f"{value!r} {name}" if plain else text, wanted, name)
    except UnitError as error:
        raise message_error(
            f"{path} is {format_value(value)}: {error}{_or_acceleration(units, text, unit, path)}"
        ) from None


def _or_acceleration(units: Units, text: str, unit: str, path: str) -> str:
    """Hint for an acceleration instead of a force; empty for other text."""
    table, _, field = path.partition(".")
    if table.startswith("disturbance") and FORCE in unit:
        with contextlib.suppress(UnitError):
            quantity(text, *units.of(table, unit.replace(FORCE, ACCELERATION)))
            table = f"{table}.{field.partition('.')[0]}" if field.startswith("added[") else table
            return f'; {table}.quantity = "acceleration" takes an acceleration such as "50 g"'
    return ""


def number_of(scenario: BaseModel, path: str, value: Any) -> Any:
    """The value of one field of this scenario, with numbers for text with units. Raises ScenarioError as a scenario."""
    tables = dict(scenario)
    units, (name, *inner) = Units(tables, type(scenario)), path.split(".")
    if not inner:
        return value
    for each in reversed(inner):
        value = {each: value}
    value = {"quantity": getattr(tables[name], "quantity", None), **value}
    try:
        value = _table(value, type(tables[name]), name, lambda *of: _number(units, False, *of))
    except PydanticCustomError as error:
        raise ScenarioError(error.message()) from None
    for each in inner:
        value = value[each]
    return value


def texts_of(scenario: BaseModel) -> dict[str, str]:
    """The texts of all quantities, by path."""
    found: dict[str, str] = {}

    def collect(value: Any, _: str, path: str) -> Any:
        if isinstance(value, Quantity):
            found[path] = value.text
        return value

    for name, table in scenario:
        _table(dict(table), type(table), name, collect)
    return found


def in_si(scenario: BaseModel, fields: Mapping[str, Iterable[str]]) -> dict[str, Any]:
    """The numbers with units of the `fields` of each table, by path, as quantities in SI; points remain plain."""
    tables = dict(scenario)
    units = Units(tables, type(scenario))

    def text(value: Any, unit: str, path: str) -> Any:
        if not isinstance(value, float) or isinstance(value, Quantity) or unit == "1" or math.isinf(value):
            return value
        return printed(value, *units.of(path.partition(".")[0], unit))

    found = {}
    for name, chosen in fields.items():
        for field, value in dict(tables[name]).items():
            info = type(tables[name]).model_fields[field]
            if field in chosen and value is not None and _has_numbers(info.annotation) and "points" not in field:
                unit = _meant(unit_of(info), dict(tables[name]))
                found[f"{name}.{field}"] = _entries(value, unit, f"{name}.{field}", text)
            elif field in chosen and value is not None and (inner := _tables_in(info.annotation)):
                complete = [dict(each) for each in value]  # with the fields that were not given
                found[f"{name}.{field}"] = _table(complete, inner[0], f"{name}.{field}", text)
    return found
