"""Nondimensional units, such as m*omega0^2*q0, and the SI units and scales that they stand for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from typing import NamedTuple

from .units import BASE, Unit, UnitError, base, parse, parse_with


class Powers(NamedTuple):
    """Exponents of m, q0 and omega0."""

    mass: int
    length: int
    rate: int

    @property
    def exponents(self) -> dict[str, int]:
        """Exponents of kg, m and s that are not 0."""
        found = {"kg": self.mass, "m": self.length, "s": -self.rate}
        return {name: power for name, power in found.items() if power}


SI_TABLES = (
    "plant",
    "rate",
    "device",
    "electrodes",
    "electronics",
    "trim",
)  # tables of a scenario in SI; all others are nondimensional
# SI units with special names.
NAMED = {
    Powers(0, 0, 0): "1",
    Powers(0, 0, -1): "s",
    Powers(0, 0, 1): "rad/s",
    Powers(0, 1, 0): "m",
    Powers(0, 1, 1): "m/s",
    Powers(0, 1, 2): "m/s^2",
    Powers(1, 0, 1): "N s/m",
    Powers(1, 0, 2): "N/m",
    Powers(1, -2, 2): "N/m^3",
    Powers(1, 1, 2): "N",
    Powers(2, 2, 3): "N^2 s",
}
ANGLE, VOLT = "rad", "V"  # the same in both
OF_ONE = {"m": base("kg"), "q0": base("m"), "omega0": parse("1/s"), "rad": base("rad")}


@lru_cache
def powers(unit: str) -> Powers | None:
    """Exponents in a nondimensional unit; None if it has a symbol of its own or a power that is not an integer."""
    try:
        found = parse_with(unit, OF_ONE.get).powers
    except UnitError:
        return None
    kg, m, s, _, _, radians, _ = found
    if radians or not all(power.is_integer() for power in found):
        return None
    return Powers(int(kg), int(m), -int(s))


def _checked(unit: str) -> Powers:
    if (found := powers("1" if unit in (ANGLE, VOLT) else unit)) is None:
        raise ValueError(f"the unit {unit} has no SI unit: it must be a product of integer powers of m, q0 and omega0")
    return found


@lru_cache
def si_unit(unit: str) -> str:
    """The SI unit of a quantity in this nondimensional unit, as pint and others read it."""
    if unit in (ANGLE, VOLT):
        return unit
    found = _checked(unit)
    return NAMED.get(found) or _spelled(found.exponents.items())


def _spelled(exponents: Iterable[tuple[str, float]]) -> str:
    return " ".join(name if power == 1 else f"{name}^{power:.13g}" for name, power in exponents if power)


@dataclass(frozen=True)
class Scales:
    """SI value = nondimensional value * scale: the map (3)-(4), which takes (47) to (48)."""

    mass: float  # kg, m
    length: float  # m, q0
    rate: float  # rad/s, omega0

    def of(self, unit: str) -> float:
        """The scale of quantities in this nondimensional unit."""
        found, factor = _checked(unit), 1.0
        for scale, power in ((self.mass, found.mass), (self.rate, found.rate), (self.length, found.length)):
            for _ in range(abs(power)):
                factor = factor * scale if power > 0 else factor / scale
        return factor

    @property
    def time(self) -> float:
        return self.of("1/omega0")

    @property
    def velocity(self) -> float:
        return self.of("q0*omega0")

    @property
    def acceleration(self) -> float:
        return self.of("omega0^2*q0")

    @property
    def force(self) -> float:
        return self.of("m*omega0^2*q0")

    @property
    def damping(self) -> float:
        return self.of("m*omega0")

    @property
    def stiffness(self) -> float:
        return self.of("m*omega0^2")


@lru_cache(maxsize=4096)
def exact_unit(scales: Scales, unit: str, exponents: tuple[tuple[str, float], ...]) -> tuple[Unit, str]:
    """A nondimensional unit in decimals, and its SI unit; `exponents`: values of the symbols in its powers.

    It has radians if it is a frequency, or a power of one. Raises UnitError for another unit.
    """
    ones = {"m": scales.mass, "q0": scales.length, "omega0": scales.rate, "rad": 1.0}
    names = {name: Unit(Decimal(repr(float(one))), OF_ONE[name].powers) for name, one in ones.items()}
    found = parse_with(unit, names.get, dict(exponents))
    kg, m, s, _, _, radians, _ = found.powers
    if s < 0 and not kg and not m:
        radians = -s
    whole = all(power.is_integer() for power in (kg, m, s))
    si = NAMED.get(Powers(int(kg), int(m), -int(s))) if whole else None
    si = ANGLE if unit == ANGLE else si or _spelled(zip(BASE[:3], (kg, m, s), strict=True))
    return Unit(found.factor, (kg, m, s, 0.0, 0.0, radians, 0.0)), si
