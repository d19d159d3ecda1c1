"""Units of exported quantities: nondimensional or SI, and nondimensional ones as multiples of SI units."""

from __future__ import annotations

from ..scenario.schema import Plant
from ..scenario.units import ANGLE, NAMED, Scales, powers, si_unit

SI = {_name.replace(" ", "."): dict(_powers.exponents) for _powers, _name in NAMED.items()}
SI |= {ANGLE: {"rad": 1}, "rad/s": {"rad": 1, "s": -1}}


def shown(unit: str, scales: Scales, si: bool) -> tuple[float, str]:
    """Factor and unit in which a number in this nondimensional unit is shown."""
    return (scales.of(unit), si_unit(unit).replace(" ", ".")) if si else (1.0, unit)


def base_unit(unit: str, plant: Plant) -> dict[str, float] | None:
    """FMI's BaseUnit: exponents of SI's base units, and a factor; None for a power that is not an integer."""
    if unit in SI:
        return dict(SI[unit])
    found = powers(unit)
    return None if found is None else {**found.exponents, "factor": plant.scales.of(unit)}
