"""Units of exported quantities: nondimensional units, their SI units and scale factors."""

from __future__ import annotations

from ..scenario.schema import Plant
from ..scenario.units import ANGLE, NAMED, Scales, powers, si_unit

SI = {_name.replace(" ", "."): dict(_powers.exponents) for _powers, _name in NAMED.items()}
SI |= {ANGLE: {"rad": 1}, "rad/s": {"rad": 1, "s": -1}}


def scale_and_unit(unit: str, scales: Scales, si: bool) -> tuple[float, str]:
    """Factor and name of the displayed unit for a nondimensional unit."""
    return (scales.of(unit), si_unit(unit).replace(" ", ".")) if si else (1.0, unit)


def base_unit(unit: str, plant: Plant) -> dict[str, float] | None:
    """FMI's BaseUnit: exponents of SI base units and a factor; None for a non-integer exponent."""
    if unit in SI:
        return dict(SI[unit])
    found = powers(unit)
    return None if found is None else {**found.exponents, "factor": plant.scales.of(unit)}
