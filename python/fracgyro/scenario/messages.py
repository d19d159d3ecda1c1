"""Messages for invalid input: one sentence with the field, the value and the allowed values."""

from __future__ import annotations

import contextlib
import difflib
import re
from collections.abc import Iterable
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ..files import cut, one_line
from .scales import SI_TABLES, si_unit
from .table import format_value, found_wrong
from .units import examples


class ScenarioError(ValueError):
    """Bad input, in one sentence that names the field, the value and the allowed values.

    >>> try:
    ...     fg.Scenario.paper().replace({"controller.ordr": 0.8})
    ... except fg.ScenarioError as error:
    ...     print(error)
    controller.ordr is not a known field; did you mean controller.order?
    """

    def __init__(self, message: str, others: Iterable[str] = ()) -> None:
        super().__init__(one_line(message))
        self.others = tuple(map(one_line, others))  #: further problems of the same input, a sentence each


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """End of a message with the nearest known name, or empty."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


@cache
def paths(model: type[BaseModel]) -> tuple[str, ...]:
    """Every dotted path, tables included."""
    found = []
    for name, info in model.model_fields.items():
        found.append(name)
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            found += [f"{name}.{inner}" for inner in paths(info.annotation)]
    return tuple(found)


@cache
def leaves(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Every field that is not a table, by its dotted path."""
    found: dict[str, FieldInfo] = {}
    for name, info in model.model_fields.items():
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            inner = leaves(info.annotation)
            found |= {f"{name}.{path}": each if each.description else info for path, each in inner.items()}
        else:
            found[name] = info
    return found


def unknown(path: str, model: type[BaseModel]) -> str:
    """Suggestion, in this order: a misspelled neighbor, the same name in another table, a misspelled table."""
    known = list(paths(model))
    parent, _, leaf = path.rpartition(".")
    if f"{parent}.each" in known:  # a table only in Python, for a list of tables
        parent += "[0]"
    if "[" in parent:  # `known` does not include lists of tables
        item = _item(parent, model)
        known = [f"{parent}.{name}" for name in item.model_fields] if item else []
    near = {name.rpartition(".")[2]: name for name in known if name.rpartition(".")[0] == parent}
    same = [name for name in known if name.endswith(f".{leaf}")]
    if same and not parent:
        *others, last = same
        return f"{leaf} is not a known field; did you mean {', '.join(others)}{' or ' if others else ''}{last}?"
    guesses = [near[name] for name in difflib.get_close_matches(leaf, near)]
    guesses += same
    guesses += [] if near else difflib.get_close_matches(path, known)
    if not parent and not guesses:
        inner = {name.rpartition(".")[2]: name for name in known}
        guesses = [inner[name] for name in difflib.get_close_matches(leaf, inner)]
    if guesses[:1] == [path]:
        return f"{cut(path)} is a field of a list of tables, which cannot be varied by its name; give the lists"
    choice = (
        [name.rpartition(".")[2] for name in near.values()] if "[" in parent else near.values() or model.model_fields
    )
    hint = f"did you mean {guesses[0]}?" if guesses else f"known are {', '.join(choice)}"
    return f"{cut(path if path.isprintable() else repr(path))} is not a known field; {hint}"


def _item(path: str, model: type[BaseModel]) -> type[BaseModel] | None:
    """The model of the tables in the list that `path`, as `objective[0]`, names."""
    *tables, name = path.partition("[")[0].split(".")
    fields = model.model_fields
    for table in tables:
        fields = getattr(fields[table].annotation, "model_fields", {}) if table in fields else {}
    info = fields.get(name)
    inner = getattr(info.annotation, "model_fields", {}) if info else {}
    return next(filter(None, map(_model_of_items, (info, *inner.values()))), None)


def _model_of_items(info: FieldInfo | None) -> type[BaseModel] | None:
    items = get_args(info.annotation) if info else ()
    return items[0] if items and isinstance(items[0], type) and issubclass(items[0], BaseModel) else None


def _numbered(text: str, place: int | None = None) -> str:
    """Further tables of the disturbance under the names that they have in TOML: disturbance[1], and so on.

    `place`: of the one whose own check wrote the text.
    """
    if place is not None:
        text = text.replace("disturbance.", f"disturbance[{place + 1}].")
    text = re.sub(r"disturbance\.added\[(\d+)\]", lambda found: f"disturbance[{int(found[1]) + 1}]", text)
    return text.replace("electrodes.each", "electrodes")


def scenario_error(error: ValidationError, model: type[BaseModel], at: tuple[str, ...] = ()) -> ScenarioError:
    """The first of pydantic's problems as a sentence; `at`: where in `model` the value stood that was validated."""
    problems = error.errors(include_url=False)
    made = problems[0].get("ctx", {}).get("error")
    if isinstance(made, ScenarioError):  # by the model itself, while pydantic called it
        return made
    first, *others = (_describe({**problem, "loc": (*at, *problem["loc"])}, model) for problem in problems)
    return ScenarioError(first + (f" (and {len(others)} more)" if others else ""), others)


def _describe(problem: ErrorDetails, model: type[BaseModel]) -> str:
    if (wrong := found_wrong(problem["input"])) is not None:
        return _numbered(wrong)
    if problem["type"] == "message":
        at = problem["loc"]
        return _numbered(problem["msg"], int(at[2]) if at[:2] == ("disturbance", "added") and len(at) > 2 else None)
    path, info, fields = "", None, model.model_fields
    for part in problem["loc"]:
        if isinstance(part, int):
            path += f"[{part}]"
            fields = getattr(_model_of_items(info), "model_fields", fields)
            continue
        path += f".{part}" if path else part
        info = fields.get(part)
        fields = getattr(info.annotation, "model_fields", {}) if info else {}
    if problem["type"] == "extra_forbidden":
        return _numbered(unknown(path, model))
    path = _numbered(path)
    allowed = _allowed(problem, info.metadata if info else [])
    if problem["type"] == "missing":
        return f"{path} is missing: it must be {'a number' if info and info.annotation is float else 'given'}"
    if problem["type"] == "float_type" and isinstance(problem["input"], str) and info:
        allowed += _or_text(path.partition(".")[0], info)
    return f"{path or 'scenario'} is {format_value(problem['input'])}: {allowed}"


def _or_text(table: str, info: FieldInfo) -> str:
    """The text with a unit that a field accepts instead of a number; empty if it has none."""
    unit = info.json_schema_extra.get("unit") if isinstance(info.json_schema_extra, dict) else None
    if not isinstance(unit, str) or "," in unit:
        return ""
    with contextlib.suppress(ValueError):  # its powers depend on other fields
        return f", or {examples(unit if table in SI_TABLES else si_unit(unit))}"
    return ""


def _allowed(problem: ErrorDetails, metadata: list[Any]) -> str:
    kind, context = problem["type"], problem.get("ctx", {})
    if kind == "literal_error":
        hint = did_you_mean(str(problem["input"]), re.findall(r"'([^']*)'", context["expected"]))
        return f"it must be {context['expected']}{hint}".replace("'", "")
    if kind.startswith(("greater", "less")):
        words = {"ge": "at least", "gt": "greater than", "le": "at most", "lt": "less than"}
        found = {word: getattr(bound, word) for word in words for bound in metadata if hasattr(bound, word)}
        limits = {
            word: f"{limit:g}" if isinstance(limit, float) else limit for word, limit in (found or context).items()
        }
        if len(limits) == 2:
            low, high = limits.values()
            return f"it must lie {'strictly ' if 'gt' in limits else ''}between {low} and {high}"
        word, limit = next(iter(limits.items()))
        return f"it must be {words[word]} {limit}"
    if kind == "too_short":
        return f"it must have at least {context['min_length']} entr{'y' if context['min_length'] == 1 else 'ies'}"
    types = {
        "float_type": "a number",
        "finite_number": "a finite number",
        "int_type": "an integer",
        "bool_type": "true or false",
        "model_type": "a table",
        "json_invalid": f"JSON, but {context.get('error')}",
        "dict_type": "a table",
        "list_type": "a list; tables of one are headed by two brackets, as [[objective]]",
        "string_type": "text in quotes",
    }
    return f"it must be {types[kind]}" if kind in types else problem["msg"]
