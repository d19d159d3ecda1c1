"""Nondimensional units, such as m*omega0^2*q0, and the SI units and scales that they stand for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple


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
}
ANGLE = "rad"  # the same in both


@lru_cache
def powers(unit: str) -> Powers | None:
    """Exponents in a nondimensional unit; None if it has a symbol of its own or a power that is not an integer."""
    found = {"m": 0, "q0": 0, "omega0": 0}
    over, _, under = unit.partition("/")
    for part, sign in ((over, 1), (under, -1)):
        for word in part.split("*"):
            if factor := re.fullmatch(r"(m|q0|omega0)(?:\^(\d+))?", word):
                found[factor[1]] += sign * int(factor[2] or 1)
            elif word not in ("", "1"):
                return None
    return Powers(*found.values())


def _checked(unit: str) -> Powers:
    if (found := powers("1" if unit == ANGLE else unit)) is None:
        raise ValueError(f"the unit {unit} has no SI unit: it must be a product of integer powers of m, q0 and omega0")
    return found


@lru_cache
def si_unit(unit: str) -> str:
    """The SI unit of a quantity in this nondimensional unit, as pint and others read it."""
    if unit == ANGLE:
        return unit
    found = _checked(unit)
    exponents = found.exponents.items()
    return NAMED.get(found) or " ".join(name if power == 1 else f"{name}^{power}" for name, power in exponents)


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
