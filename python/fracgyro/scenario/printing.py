"""A scenario as commented TOML."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from itertools import zip_longest
from typing import Any, cast

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from .disturbance import Disturbance
from .kinds import OF_FILTER, fields_of, kinds_with, own_kinds, plants_with
from .motion import REFERENCE_LISTS
from .quantities import texts_of
from .scales import SI_TABLES, si_unit
from .table import Table, plain, toml_value
from .units import Quantity
from .volts import Electrode, Electrodes

# The first words and the last line of a saved scenario: half a file may still be valid TOML.
BEGIN = "# A fracgyro scenario."
END = "# End of the scenario."
BY_KIND = ("controller", "adaptation", "datasheet")  # tables whose fields belong to kinds of controllers
OWN_KINDS = ("plant", "reference")  # tables whose fields belong to kinds of their own


def scenario_text(scenario: Table, *, texts: bool = True) -> str:
    """Complete and commented TOML; without `texts`, quantities are plain numbers in the units of their fields."""
    return _text(scenario, tuple(texts_of(scenario).items()) if texts else ())


@lru_cache(maxsize=8)
def _text(scenario: Table, texts: tuple[tuple[str, str], ...]) -> str:
    """The TOML; `texts`: those of quantities, in which equal scenarios may differ."""
    lines = [
        f"{BEGIN} [plant], [rate], [device], [[electrodes]], [electronics] and [trim] are in SI, the",
        "# rest is nondimensional.",
        *(["# A number with a unit, in quotes, is in that unit."] if texts else []),
        "# A table or field that is left out takes the paper's value, in the corrected reading.",
    ]
    tables = dict(scenario)
    for name, shown_fields in fields_shown(scenario).items():
        table, fields = tables[name], shown_fields
        entries: tuple[Any, ...] = table.entries if isinstance(table, Disturbance) else (table,)
        head = f"[{name}]" if len(entries) == 1 else f"[[{name}]]"
        if isinstance(table, Electrodes):
            entries, head, fields = table.each, f"[[{name}]]", tuple(Electrode.model_fields)
            lines += [] if entries else ["", f"# {Electrodes.__doc__}"]
        for place, entry in enumerate(entries):
            added = "# Another one." if isinstance(table, Electrodes) else "# Added to it."
            lines += ["", f"# {type(table).__doc__}" if place == 0 else added, head]
            for field in fields:
                info = type(entry).model_fields.get(field)
                if info is None or field == "added":
                    continue
                value = getattr(entry, field)
                shown = toml_value(value if texts else plain(value))
                lines += (
                    _comment(_described(info, value) if texts and name not in SI_TABLES else info.description or "")
                    if place == 0
                    else []
                )
                lines += [f"# {field} is not set" if value is None else f"{field} = {shown}"]
    return "\n".join([*lines, "", END]) + "\n"


def fields_shown(scenario: Table) -> dict[str, tuple[str, ...]]:
    """The fields of each table that the scenario has, in their order."""
    tables: dict[str, Any] = dict(scenario)
    controller = tables["controller"]
    return {
        name: own_fields(type(scenario), name, table.kinds)
        if name in OWN_KINDS
        else fields_of_table(type(scenario), name, controller.kind, controller.filter)
        for name, table in tables.items()
    }


def values(scenario: Table) -> dict[str, Any]:
    """Every field that the scenario has, by dotted name."""
    tables = dict(scenario)
    return {
        f"{name}.{field}": getattr(tables[name], field)
        for name, fields in fields_shown(scenario).items()
        for field in fields
    }


def differing(pairs: Mapping[str, tuple[Any, Any]]) -> Iterator[tuple[str, tuple[Any, Any]]]:
    """The pairs whose values differ; of lists of tables, the fields of each table."""
    for name, (one, other) in pairs.items():
        if one == other:
            continue
        lists = [
            each if isinstance(each, tuple) and each and isinstance(each[0], Table) else () for each in (one, other)
        ]
        if not any(lists):
            yield name, (one, other)
        for place, both in enumerate(zip_longest(*lists)):
            shown = [dict(table) if table else {} for table in both]
            usual = {field: info.default for field, info in type(both[0] or both[1]).model_fields.items()}
            at = f"disturbance[{place + 1}]" if name == "disturbance.added" else f"{name}[{place}]"
            at = at.replace("electrodes.each", "electrodes")
            for field in usual:
                pair = (shown[0].get(field), shown[1].get(field))
                given = next((each for table, each in zip(both, pair, strict=True) if table), None)
                if pair[0] != pair[1] and (all(both) or given != usual[field]):
                    yield f"{at}.{field}", pair


def brief(value: Any) -> Any:
    """A value in plain types; tables in it have only the fields that differ from their defaults."""
    if isinstance(value, BaseModel):
        usual = {name: info.default for name, info in type(value).model_fields.items()}
        return {name: brief(each) for name, each in value if each != usual[name]}
    return tuple(map(brief, value)) if type(value) is tuple else plain(value)


def having(table: str, field: str) -> tuple[str, ...]:
    """The kinds of a table with kinds of its own that have a field; none: all."""
    if table == "plant":
        return tuple(plants_with(field))
    return (own_kinds(table) | REFERENCE_LISTS).get(field, ())


@cache
def own_fields(model: type[BaseModel], table: str, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """The fields of a table with kinds of its own that one of these kinds has, in their order."""
    known = cast(type[BaseModel], model.model_fields[table].annotation).model_fields
    return tuple(field for field in known if not having(table, field) or set(kinds) & set(having(table, field)))


@cache
def fields_of_table(model: type[BaseModel], table: str, kind: str, filtered: str = "none") -> tuple[str, ...]:
    """The fields of a table that a scenario with this kind of controller and filter has, in their order."""
    known = cast(type[BaseModel], model.model_fields[table].annotation).model_fields
    if table not in BY_KIND:
        return tuple(known)
    own = fields_of(kind, table) + (OF_FILTER if table == "datasheet" and filtered == "kalman" else ())
    return tuple(field for field in known if field in own or not kinds_with(f"{table}.{field}"))


def _described(info: FieldInfo, value: Any) -> str:
    """The description of a field; in SI if all of its numbers are quantities."""
    text, extra = info.description or "", info.json_schema_extra
    numbers = list(dict(value).values()) if isinstance(value, BaseModel) else value
    numbers = numbers if isinstance(numbers, list | tuple) else [numbers]
    if not isinstance(extra, dict) or not all(isinstance(number, Quantity) or number == 0 for number in numbers):
        return text
    unit = str(extra.get("unit"))
    if not numbers or "," in unit or not any(isinstance(number, Quantity) for number in numbers):
        return text
    first = next(number for number in numbers if isinstance(number, Quantity))
    try:
        si = si_unit(unit)
    except ValueError:  # its powers depend on other fields
        si = first.text.partition(" ")[2]
    return re.sub(r"\b([Uu]nit) [^,:;.]*", lambda found: f"{found[1]} {si}", text, count=1)


@cache
def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, 106)]
