"""A scenario as text: complete and commented TOML, and its values by field."""

from __future__ import annotations

import textwrap
from functools import cache, lru_cache
from typing import Any

from pydantic import BaseModel

from .kinds import fields_of, kinds_with
from .table import toml_value

# The first words and the last line of a saved scenario: half a file may still be valid TOML.
BEGIN = "# A fracgyro scenario."
END = "# End of the scenario."
BY_KIND = ("controller", "adaptation", "datasheet")  # tables whose fields belong to kinds of controllers


@lru_cache(maxsize=8)
def text(scenario: BaseModel, kind: str) -> str:
    """The TOML of a scenario with this kind of controller."""
    lines = [
        f"{BEGIN} [plant], [rate] and [device] are in SI, all else is nondimensional.",
        "# A table or field that is left out takes the paper's value, in the corrected reading.",
    ]
    for name, table in scenario:
        lines += ["", f"# {type(table).__doc__}", f"[{name}]"]
        for field in fields_of_table(table, name, kind):
            value = getattr(table, field)
            lines += _comment(type(table).model_fields[field].description or "")
            lines += [f"# {field} is not set" if value is None else f"{field} = {toml_value(value)}"]
    return "\n".join([*lines, "", END]) + "\n"


def fields_of_table(table: BaseModel, name: str, kind: str) -> tuple[str, ...]:
    """The fields of the table `name` that a scenario with this kind of controller has, in their order."""
    known = tuple(type(table).model_fields)
    return _of_kind(known, name, kind) if name in BY_KIND else known


@cache
def _of_kind(known: tuple[str, ...], name: str, kind: str) -> tuple[str, ...]:
    return tuple(field for field in known if field in fields_of(kind, name) or not kinds_with(f"{name}.{field}"))


def values(scenario: BaseModel, kind: str) -> dict[str, Any]:
    """Every field that a scenario with this kind of controller has, by dotted name."""
    return {
        f"{name}.{field}": getattr(table, field)
        for name, table in scenario
        for field in fields_of_table(table, name, kind)
    }


@cache
def _comment(words: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(words, 106)]
