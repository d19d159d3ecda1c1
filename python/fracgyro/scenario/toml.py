"""Reading untrusted TOML files: text -> tables."""

from __future__ import annotations

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
