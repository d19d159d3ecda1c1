"""Numbers and lists as text. Typst sets 1.5e-5 as a power of ten."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def short(value: float | None, digits: int = 2) -> str:
    """The value with `digits` significant digits; a dash if it is missing."""
    if value is None or not math.isfinite(value):
        return "–"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    if value != 0 and not -3 <= int(exponent) < 6:
        trimmed = re.sub(r"\.?0+$", "", mantissa) if "." in mantissa else mantissa
        return f"{trimmed}e{int(exponent)}".replace("-", "−", value < 0)
    text = f"{float(f'{mantissa}e{exponent}'):.{max(0, digits - 1 - int(exponent))}f}" if value else "0"
    return text.replace("-", "−")


def uncertain(value: float, half: float) -> str:
    """A value and the half width of its interval, to the first digit of that."""
    if not 1e-6 <= half < math.inf:
        return short(value, 3)
    places = max(0, -math.floor(math.log10(half)))
    return f"{value:.{places}f} ± {half:.{places}f}".replace("-", "−")


def concise(value: float, half: float) -> str:
    """The same as 0.018(2), with the half width in parentheses in units of the last digit; omitted if it is smaller."""
    if not abs(value) * 1e-4 <= half < math.inf or half == 0:
        return short(value, 4)
    if max(abs(value), half) >= 1e5:
        power = math.floor(math.log10(max(abs(value), half)))
        return f"{concise(value / 10.0**power, half / 10.0**power)}e{power}"
    exponent = int(f"{half:.0e}".partition("e")[2])
    scale = 10.0**exponent
    if exponent > 0:
        return f"{round(value / scale) * scale:.0f}({round(half / scale) * scale:.0f})".replace("-", "−")
    return f"{value:.{-exponent}f}({half / scale:.0f})".replace("-", "−")


def interval(low: float | None, high: float | None, digits: int = 2) -> str:
    return f"{short(low, digits)} to {short(high, digits)}"


def spelled(count: int, noun: str = "", plural: str = "") -> str:
    """Three rows, one row, no rows."""
    number = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"{number} {noun if count == 1 else plural or noun + 's'}" if noun else number


def listed(items: Sequence[str]) -> str:
    """a, b and c"""
    return f"{', '.join(items[:-1])} and {items[-1]}" if len(items) > 1 else "".join(items)
