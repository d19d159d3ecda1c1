"""Units of exported quantities: nondimensional units, their SI units and scale factors."""

from __future__ import annotations

from ..scenario.scales import ANGLE, NAMED, Scales, powers, si_unit
from ..scenario.schema import Plant
from ..scenario.units import BASE, parse

SI = {_name.replace(" ", "."): _name for _name in (*NAMED.values(), ANGLE, "V")}  # FMI's spelling


def scale_and_unit(unit: str, scales: Scales, si: bool) -> tuple[float, str]:
    """Factor and name of the displayed unit for a nondimensional unit."""
    return (scales.of(unit), si_unit(unit).replace(" ", ".")) if si else (1.0, unit)


def base_unit(unit: str, plant: Plant) -> dict[str, float] | None:
    """FMI's BaseUnit: exponents of SI base units and a factor; None for a non-integer exponent."""
    if unit in SI:
        return {name: int(power) for name, power in zip(BASE, parse(SI[unit]).powers, strict=True) if power}
    found = powers(unit)
    return None if found is None else {**found.exponents, "factor": plant.scales.of(unit)}
