"""Numbers as C++ initializers, to the last bit."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .compilers import Number


def initializer(value: Any, number: Number, indent: str = "") -> str:
    """C++ initializer of nested tuples (structs) and lists (arrays); trailing zeros are omitted."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return f"{value}U"
    if isinstance(value, str):
        return value or "nullptr"
    if isinstance(value, float):
        return float_text(value, number)
    if not _significant(value):
        return "{}"
    inner = indent + "    "
    entries = list(value)
    while entries and isinstance(value, list) and not _significant(entries[-1]):
        entries.pop()
    texts = [initializer(entry, number, inner) for entry in entries]
    braces = ("{{", "}}") if isinstance(value, list) else ("{", "}")
    flat = ", ".join(texts)
    if len(flat) + len(indent) < 110 and "\n" not in flat:
        return f"{braces[0]}{flat}{braces[1]}"
    return f"{braces[0]}\n" + ",\n".join(inner + text for text in texts) + f"\n{indent}{braces[1]}"


def float_text(value: float, number: Number) -> str:
    if value in (float("inf"), -float("inf")):
        return f"{'-' if value < 0 else ''}std::numeric_limits<{number}>::infinity()"
    digits, exponent = value.hex().split("p")
    return f"{digits.rstrip('0').rstrip('.')}p{exponent}" + ("F" if number == "float" else "")


def _significant(value: Any) -> bool:
    return any(map(_significant, value)) if isinstance(value, tuple | list) else bool(value)


def list_text(values: Iterable[float], number: Number) -> str:
    return f"{{{', '.join(float_text(value, number) for value in values)}}}"
