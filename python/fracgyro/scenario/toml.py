"""Reading untrusted TOML files: text -> tables."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterable
from typing import Any

from ..files import cut, read_input, reason
from .messages import ScenarioError
from .table import MAX_DEPTH


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a TOML file. Raises ScenarioError when it cannot be read."""
    try:
        return read_input(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path} is not valid TOML: byte {error.start} is not UTF-8") from None
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None
    except ValueError as error:
        raise ScenarioError(f"{path} cannot be read: {error}") from None


def read_tables(text: str, source: str) -> dict[str, Any]:
    """The tables of a TOML text; `source` names it in the ScenarioError raised when it is not valid."""
    if (plain := _plain_tables(text)) is not None:
        return plain
    try:
        tables = tomllib.loads(text)
        problem = _beyond_toml(tables)
    except ValueError as error:
        digits = re.search(r"[0-9][0-9_]{4299}", text)  # which Python refuses to read
        line = text.count("\n", 0, digits.start()) + 1 if digits else 0
        problem = f"line {line} has an integer of more than 64 bits" if digits else str(error) + _single_brackets(text)
    except RecursionError:
        problem = "it is nested too deeply"
    if problem:
        raise ScenarioError(f"{source} is not valid TOML: {cut(problem, 200)}")
    return tables


# Lines as `Scenario.to_toml` writes them. Numbers, true, false, lists of numbers and text without escapes that JSON
# allows mean the same in TOML.
_LINE = re.compile(
    r"\[([a-z_]+)\]"
    r'|([a-z_]+) = (?:("[^"\\]*")|([-0-9.,einf\[\] ]+|true|false)'
    r"|\{xx = ([-0-9.einf]+), xy = ([-0-9.einf]+), yy = ([-0-9.einf]+)\})"
)
# For tomllib: control characters, an integer that may have more than 64 bits, and lists of lists of lists.
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f]")
_LARGE = re.compile(r"[0-9]{19}|\[ *\[ *\[")


def _plain_tables(text: str) -> dict[str, Any] | None:
    """The tables of a text with one head, entry or comment per line, in a fifth of tomllib's time; None for others."""
    if _CONTROL.search(text):
        return None
    tables: dict[str, dict[str, str]] = {"": {}}  # values as JSON; "": before the first head
    table = tables[""]
    for line in text.split("\n"):
        if not line or line[0] == "#":
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            return None
        head, name, said, plain, *matrix = match.groups()
        if (head or name) in (tables if head else table):
            return None
        if head:
            table = tables[head] = {}
        elif said:
            table[name] = said
        else:
            numbers = f'{{"xx":{matrix[0]},"xy":{matrix[1]},"yy":{matrix[2]}}}' if matrix[0] else plain
            if _LARGE.search(numbers):
                return None
            table[name] = numbers.replace("inf", "Infinity")
    whole = ("{" + ",".join(f'"{name}":{value}' for name, value in inner.items()) + "}" for inner in tables.values())
    try:
        first, *others = map(json.loads, whole)
    except ValueError:
        return None
    found = dict(zip(list(tables)[1:], others, strict=True))
    return None if first.keys() & found.keys() else first | found


def _single_brackets(text: str) -> str:
    """Hint if a table has headers of both kinds, as [disturbance] and [[disturbance]], or disturbance two of one."""
    heads = re.findall(r"^[ \t]*(\[\[?)[ \t]*([\w.]+)[ \t]*\]", text, re.MULTILINE)
    once, listed = ([name for brackets, name in heads if brackets == kind] for kind in ("[", "[["))
    found = [name for name in once if name in listed or (name == "disturbance" and once.count(name) > 1)]
    return f"; each table of a list is headed by two brackets, as [[{found[0]}]]" if found else ""


def _beyond_toml(value: Any, name: str = "", depth: int = 0) -> str:
    """Error for text that tomllib accepts but TOML does not allow, or that is not supported; "" for valid text."""
    if depth > MAX_DEPTH:
        return f"{name} is nested too deeply"
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return f"{name} is an integer of more than 64 bits"
    inner: Iterable[tuple[str, Any]] = ()
    if isinstance(value, dict):
        inner = ((f"{name}.{key}" if name else key, entry) for key, entry in value.items())
    elif isinstance(value, list):
        inner = ((f"{name}[{place}]", entry) for place, entry in enumerate(value))
    return next(filter(None, (_beyond_toml(entry, path, depth + 1) for path, entry in inner)), "")
