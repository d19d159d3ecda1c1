"""Validation of Python arguments that are not fields of a scenario; errors are one sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

NO_NUMBERS = (str, bytes, bytearray, memoryview, np.ma.MaskedArray)


def short(value: object) -> str:
    """A value as text of at most 80 characters, for a message."""
    try:
        text = " ".join(repr(value).split())  # the text of an array may have several lines
    except ValueError:  # an integer with more digits than Python prints
        return "too long a number"
    return text if len(text) <= 80 else f"{text[:77]}..."


def real(name: str, value: object) -> float:
    """A float. Raises TypeError for anything that is not a real number."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise TypeError(f"{name} is {short(value)}: it must be a number")
    try:
        return float(value)
    except OverflowError:
        return math.inf


def number(name: str, value: object, *, least: float = -math.inf, above: float = -math.inf) -> float:
    """A finite float. Raises TypeError as `real`, ValueError for a number that is not finite or too small."""
    result = real(name, value)
    if not math.isfinite(result):
        raise ValueError(f"{name} is {short(value)}: it must be a finite number")
    if result < least or result <= above:
        limit = f"at least {least:g}" if result < least else f"greater than {above:g}"
        raise ValueError(f"{name} is {short(value)}: it must be {limit}")
    return result


def pair(name: str, values: object, *, finite: bool = True) -> tuple[float, float]:
    """Two floats from a list or an array of any shape.

    Raises TypeError for anything but numbers, ValueError for another count and, with `finite`, for NaN or infinity.
    """
    rule = "it must be two finite numbers" if finite else "it must be two numbers"
    if not isinstance(values, Sequence | np.ndarray) or isinstance(values, NO_NUMBERS):
        raise TypeError(f"{name} is {short(values)}: {rule}")
    shown = short(values.tolist() if isinstance(values, np.ndarray) else list(values))
    rule = f"{name} is {shown}: {rule}"
    try:
        x, y = np.asarray(values, dtype=object).ravel()
    except ValueError:
        raise ValueError(rule) from None
    try:
        take = number if finite else real
        return take(name, x), take(name, y)
    except (TypeError, ValueError) as error:
        raise type(error)(rule) from None


def signal(name: str, values: object) -> NDArray[Any]:
    """An array of real numbers. Raises TypeError for anything else."""
    if isinstance(values, np.ma.MaskedArray):
        raise TypeError(f"{name} is a masked array: it must not be masked")
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{name} is {short(values)}: it must be an array of real numbers") from None
    if array.dtype.kind not in "iuf" and array.size:
        raise TypeError(f"{name} has dtype {array.dtype}: it must have real numbers")
    return array
