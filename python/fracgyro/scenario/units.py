"""Numbers with units, such as "2 us", parsed, converted and printed. A unit is a product of powers of names.

Conversions have 40 decimal digits, so that "2 us" in s is the float 2e-06.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from decimal import Context, Decimal
from functools import lru_cache
from typing import NamedTuple, Self

BASE = ("kg", "m", "s", "K", "A", "rad", "cycle")
PI = Decimal("3.14159265358979323846264338327950288419716939937511")
EXACT = Context(prec=40, traps=[])
MAX_LENGTH = 100  # characters of a unit
NUMBER = re.compile(r" *([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?: +|(?![\d.]|[eE][+-]?\d))(\S.*?) *", re.ASCII)
TOKEN = re.compile(r"\s*([A-Za-z%][A-Za-z0-9]*|\d+(?:\.\d+)?|\*\*|\S)\s*", re.ASCII)
SIGNS = {"°C": "degC", "°": "deg", "\u00b5": "u", "\u03bc": "u", "·": "*", "⋅": "*", "Ω": "ohm"}
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
PREFIXES = {"a": -18, "f": -15, "p": -12, "n": -9, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9, "T": 12, "P": 15}
PREFIXED = ("m", "g", "s", "N", "Hz", "K", "A", "V", "F", "W", "ohm", "rad", "deg", "dps")
# cycle is only for Hz, which is 2 pi rad/s where radians are counted, and 1/s elsewhere.
DEFINED = {
    "g": (Decimal("1e-3"), "kg"),
    "min": (Decimal(60), "s"),
    "h": (Decimal(3600), "s"),
    "N": (Decimal(1), "kg m/s^2"),
    "Hz": (Decimal(1), "cycle/s"),
    "degC": (Decimal(1), "K"),
    "V": (Decimal(1), "kg m^2/(A s^3)"),
    "F": (Decimal(1), "A^2 s^4/(kg m^2)"),
    "W": (Decimal(1), "kg m^2/s^3"),
    "ohm": (Decimal(1), "kg m^2/(A^2 s^3)"),
    "deg": (PI / 180, "rad"),
    "arcmin": (PI / 10800, "rad"),
    "arcsec": (PI / 648000, "rad"),
    "rev": (2 * PI, "rad"),
    "dps": (PI / 180, "rad/s"),
    "rpm": (PI / 30, "rad/s"),
    "%": (Decimal("1e-2"), "1"),
    "ppm": (Decimal("1e-6"), "1"),
    "ppb": (Decimal("1e-9"), "1"),
}
GRAVITY = (Decimal("9.80665"), "m/s^2")  # g, mg, ug where an acceleration is meant
LONG = {"meter": "m", "gram": "g", "second": "s", "newton": "N", "hertz": "Hz", "kelvin": "K", "radian": "rad"}
LONG |= {"degree": "deg", "minute": "min", "hour": "h", "percent": "%"}
LONG_PREFIXES = {"atto": "a", "femto": "f", "pico": "p", "nano": "n", "micro": "u", "milli": "m", "centi": "c"}
LONG_PREFIXES |= {"kilo": "k", "mega": "M", "giga": "G", "tera": "T", "peta": "P"}


class UnitError(ValueError):
    """A text that is not a unit."""


class Unit(NamedTuple):
    """Its value in SI, and the exponents of BASE."""

    factor: Decimal
    powers: tuple[float, ...]

    def times(self, other: Unit) -> Unit:
        powers = tuple(round(a + b, 12) + 0.0 for a, b in zip(self.powers, other.powers, strict=True))
        return Unit(EXACT.multiply(self.factor, other.factor), powers)

    def to_the(self, power: float) -> Unit:
        powers = tuple(round(power * each, 12) + 0.0 for each in self.powers)
        return Unit(EXACT.power(self.factor, Decimal(repr(power))), powers)


def base(name: str, factor: Decimal = Decimal(1)) -> Unit:
    """A factor times one of BASE, or times 1."""
    return Unit(factor, tuple(float(name == each) for each in BASE))


ONE = base("1")


def _si(name: str) -> Unit | None:
    for word in (name, name.removesuffix("s")):  # pint's long names
        for prefix, letter in {"": "", **LONG_PREFIXES}.items():
            if word.startswith(prefix) and word.removeprefix(prefix) in LONG:
                name = letter + LONG[word.removeprefix(prefix)]
    if name in BASE:
        return base(name)
    if name in DEFINED:
        factor, unit = DEFINED[name]
        return parse(unit).times(base("1", factor))
    if name[1:] in PREFIXED and name[0] in PREFIXES and (found := _si(name[1:])):
        return found.times(base("1", Decimal(1).scaleb(PREFIXES[name[0]])))
    return None


def _with_gravity(name: str) -> Unit | None:
    if name not in ("g", "mg", "ug"):
        return _si(name)
    factor, unit = GRAVITY
    return parse(unit).times(base("1", factor.scaleb(PREFIXES.get(name[:-1], 0))))


class _Parser:
    """Recursive descent over the tokens of a unit."""

    def __init__(self, text: str, lookup: Callable[[str], Unit | None], symbols: Mapping[str, float]) -> None:
        self.text, self.lookup, self.symbols = text, lookup, symbols
        for sign, word in SIGNS.items():
            text = text.replace(sign, word)
        text = re.sub("[⁻⁰¹²³⁴-⁹]+", lambda found: "^" + found[0].translate(RAISED), text)
        self.tokens = TOKEN.findall(text)[::-1] if len(text) <= MAX_LENGTH else []

    def whole(self) -> Unit:
        found = self.product()
        if self.tokens:
            raise self.error()
        return found

    def error(self) -> UnitError:
        return UnitError(f"{self.text} is not a unit")

    def accept(self, *wanted: str) -> str:
        return self.tokens.pop() if self.tokens and self.tokens[-1] in wanted else ""

    def expect(self, wanted: str) -> None:
        if not self.accept(wanted):
            raise self.error()

    def product(self) -> Unit:
        found = self.power()
        while self.tokens and self.tokens[-1] != ")":
            inverse = self.accept("*", ".", "/") == "/"
            found = found.times(self.power().to_the(-1.0) if inverse else self.power())
        return found

    def power(self) -> Unit:
        found = self.atom()
        return found.to_the(self.exponent()) if self.accept("^", "**") else found

    def atom(self) -> Unit:
        root = self.accept("sqrt")
        if self.accept("("):
            found = self.product()
            self.expect(")")
            return found.to_the(0.5) if root else found
        name = self.tokens.pop() if self.tokens and not root else ""
        if name == "1":
            return ONE
        if not name or not (name[0].isalpha() or name == "%"):
            raise self.error()
        if (unit := self.lookup(name)) is None:
            raise UnitError(f"{name} is not a unit")
        return unit

    def exponent(self) -> float:
        """A number, a symbol, or a sum of them or a fraction in parentheses."""
        if not self.accept("("):
            return self.number()
        found = self.number()
        while sign := self.accept("+", "-", "/"):
            other = self.number()
            found = found / (other or float("nan")) if sign == "/" else found + (other if sign == "+" else -other)
        self.expect(")")
        return found

    def number(self) -> float:
        sign = -1.0 if self.accept("-") else 1.0
        word = self.tokens.pop() if self.tokens else ""
        if word not in self.symbols and not (word[:1].isdigit() and float(word) < 10):
            raise self.error()
        return sign * (self.symbols[word] if word in self.symbols else float(word))


@lru_cache(maxsize=1024)
def parse(text: str, *, gravity: bool = False) -> Unit:
    """A unit of SI; `gravity`: g is the standard gravity, not the gram. Raises UnitError for another text."""
    return parse_with(text, _with_gravity if gravity else _si)


def parse_with(text: str, lookup: Callable[[str], Unit | None], symbols: Mapping[str, float] | None = None) -> Unit:
    """A unit whose names `lookup` knows, with exponents in `symbols`. Raises UnitError for another text."""
    return _Parser(text, lookup, symbols or {}).whole()


def ratio(given: Unit, wanted: Unit) -> Decimal | None:
    """The value of `given` in units of `wanted`; None if they measure different quantities."""
    if given.powers[:5] != wanted.powers[:5]:
        return None
    factor = EXACT.divide(given.factor, wanted.factor)
    (radians, cycles), (wanted_radians, wanted_cycles) = given.powers[5:], wanted.powers[5:]
    if radians + cycles == wanted_radians + wanted_cycles:
        return EXACT.multiply(factor, EXACT.power(2 * PI, Decimal(repr(cycles - wanted_cycles))))
    # Radians may be left out, and 1/Hz is 1 s; m Hz is refused as a velocity, and rad as a ratio.
    return factor if any(given.powers[:5]) and cycles <= max(wanted_cycles, 0) else None


# Quantity, its unit, and examples.
KINDS = (
    ("a time", "s", '"2 us" or "20 ms"'),
    ("a length", "m", '"1.5 um"'),
    ("a mass", "kg", '"180 ug"'),
    ("a frequency or an angular rate", "rad/s", '"4.5 kHz" or "300 deg/s"'),
    ("a frequency", "Hz", '"4.5 kHz"'),
    ("an angle", "rad", '"90 deg"'),
    ("a velocity", "m/s", '"1 mm/s"'),
    ("an acceleration", "m/s^2", '"5 m/s^2" or "50 g"'),
    ("a force", "N", '"1 uN"'),
    ("a stiffness", "N/m", '"64 N/m"'),
    ("a damping", "N s/m", '"1.8 uN s/m"'),
    ("a temperature", "K", '"1 K"'),
    ("a voltage", "V", '"5 V" or "20 mV"'),
    ("a capacitance", "F", '"1 pF"'),
    ("a resistance", "ohm", '"10 Mohm"'),
    ("a ratio", "1", '"5 %" or "300 ppm"'),
)


def examples(unit: str) -> str:
    """Texts that a field in this SI unit accepts, for messages."""
    powers = parse(unit).powers
    found = [f"{name} such as {texts}" for name, each, texts in KINDS if parse(each).powers == powers]
    return found[0] if found else f'text such as "1 {unit}"'


class Quantity(float):
    """A number that was given as text with a unit: the float is in the unit of its field."""

    __slots__ = ("text",)
    text: str

    def __new__(cls, value: float, text: str) -> Self:
        found = super().__new__(cls, value)
        found.text = text
        return found

    def __reduce__(self) -> tuple[type[Self], tuple[float, str]]:
        return type(self), (float(self), self.text)


def is_quantity(text: str) -> bool:
    """True for a number followed by more text: a misspelled unit is for `quantity` to report."""
    return NUMBER.fullmatch(text) is not None


def quantity(text: str, wanted: Unit, si: str) -> Quantity:
    """The number in the unit `wanted`, whose SI unit is `si`.

    Raises UnitError, which states the allowed units, for a text that is not a number with a unit of this quantity.
    """
    if (parts := NUMBER.fullmatch(text)) is None:
        raise UnitError(f"it must be {examples(si)}")
    number, name = parts.groups()
    value = float(EXACT.multiply(EXACT.create_decimal(number), factor(name, wanted, si))) + 0.0
    if not math.isfinite(value):
        raise UnitError("it must be finite")
    return Quantity(value, text.strip())


def factor(name: str, wanted: Unit, si: str) -> Decimal:
    """The value of a unit in units of `wanted`, whose SI unit is `si`. Raises UnitError for another quantity."""
    rule = f"it must be {examples(si)}"
    name = f"1{name}" if name.startswith("/") else name
    try:
        given = parse(name)
        found = ratio(given, wanted)
        found = ratio(parse(name, gravity=True), wanted) if found is None else found
    except UnitError as error:
        raise UnitError(f"{error}; {rule}") from None
    if found is None:
        other = [word for word, each, _ in KINDS if parse(each).powers == given.powers]
        raise UnitError(f"it is {other[0]}; {rule}" if other else rule)
    return found


def printed(value: float, wanted: Unit, si: str) -> Quantity:
    """A number in the unit `wanted` as text in SI: with a readable prefix, and the fewest digits that read back."""
    exact = EXACT.multiply(Decimal(repr(float(value))), EXACT.divide(Decimal(1), ratio(parse(si), wanted) or 1))
    name = _with_prefix(exact, si)
    exact = EXACT.multiply(exact, ratio(parse(si), parse(name)) or 1)
    for digits in range(20):
        number = Decimal(f"{exact:.{digits}e}").normalize()
        plain = not number or -5 < number.adjusted() < 7
        found = quantity(f"{number:f} {name}" if plain else f"{number:e} {name}", wanted, si)
        if found == value:
            break
    return found


def _with_prefix(value: Decimal, si: str) -> str:
    """The SI unit with a prefix for its first name, such that 1 to 1000 of them are the value."""
    first = re.match(r"kg$|(m|s|N|Hz|V|A|F|ohm)(?=$|[ /])", si)
    if not first or not value:
        return si
    name, rest = first[0].replace("kg", "g"), si[first.end() :]
    power = value.adjusted() + (3 if si == "kg" else 0)
    prefixes = {power: letter for letter, power in PREFIXES.items() if power != -2 and (power < 0 or si != "s")} | {
        0: ""
    }
    return f"{prefixes.get(power - power % 3, None)}{name}{rest}" if power - power % 3 in prefixes else si
