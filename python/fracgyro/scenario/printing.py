"""A scenario as commented TOML."""

from __future__ import annotations

import textwrap
from functools import cache, lru_cache
from typing import cast

from pydantic import BaseModel

from .kinds import fields_of, kinds_with
from .quantities import texts_of
from .table import Table, plain, toml_value

# The first words and the last line of a saved scenario: half a file may still be valid TOML.
BEGIN = "# A fracgyro scenario."
END = "# End of the scenario."
BY_KIND = ("controller", "adaptation", "datasheet")  # tables whose fields belong to kinds of controllers


def scenario_text(scenario: Table, *, texts: bool = True) -> str:
    """Complete and commented TOML; without `texts`, quantities are plain numbers in the units of their fields."""
    return _text(scenario, tuple(texts_of(scenario).items()) if texts else ())


@lru_cache(maxsize=8)
def _text(scenario: Table, texts: tuple[tuple[str, str], ...]) -> str:
    """The TOML; `texts`: those of quantities, in which equal scenarios may differ."""
    lines = [
        f"{BEGIN} [plant], [rate] and [device] are in SI, all else is nondimensional.",
        *(["# A number with a unit, in quotes, is in that unit."] if texts else []),
        "# A table or field that is left out takes the paper's value, in the corrected reading.",
    ]
    tables = dict(scenario)
    for name, table in tables.items():
        lines += ["", f"# {type(table).__doc__}", f"[{name}]"]
        for field in fields_of_table(type(scenario), name, tables["controller"].kind):
            info = type(table).model_fields[field]
            value = getattr(table, field)
            shown = toml_value(value if texts else plain(value))
            lines += _comment(info.description or "")
            lines += [f"# {field} is not set" if value is None else f"{field} = {shown}"]
    return "\n".join([*lines, "", END]) + "\n"


@cache
def fields_of_table(model: type[BaseModel], table: str, kind: str) -> tuple[str, ...]:
    """The fields of a table that a scenario with this kind of controller has, in their order."""
    known = cast(type[BaseModel], model.model_fields[table].annotation).model_fields
    if table not in BY_KIND:
        return tuple(known)
    return tuple(field for field in known if field in fields_of(kind, table) or not kinds_with(f"{table}.{field}"))


@cache
def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, 106)]
