"""Numbers with units outside scenarios: options of commands, and arguments."""

from __future__ import annotations

from ..arguments import number, short
from .units import UnitError, parse, quantity


def amount(name: str, value: object, unit: str) -> float:
    """A number in `unit`, or text with a unit such as "300 deg/s", in `unit`. Raises ValueError or TypeError."""
    if isinstance(value, str):
        try:
            return number(name, float(value))
        except ValueError:
            pass
        try:
            return float(quantity(value, parse(unit), unit))
        except (UnitError, ValueError) as error:
            raise ValueError(f"{name} is {short(value)}: {error}") from None
    return number(name, value)
