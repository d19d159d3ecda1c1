"""Units as faces name them: nondimensional or SI, and those such as m*omega0^2*q0 as multiples of SI units."""

from __future__ import annotations

import re

from ..scenario.kinds import QUANTITIES
from ..scenario.schema import Plant, Scales

KNOWN = {"1/omega0": ("time", "s"), **QUANTITIES}
SI = {
    "s": {"s": 1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N/m": {"kg": 1, "s": -2},
    "rad/s": {"rad": 1, "s": -1},
    "rad": {"rad": 1},
}


def shown(unit: str, scales: Scales, si: bool) -> tuple[float, str]:
    """Of a number in this nondimensional unit: the factor and the unit that it is shown in."""
    if not si or unit not in KNOWN:
        return 1.0, unit
    quantity, symbol = KNOWN[unit]
    return float(getattr(scales, quantity)), symbol.replace(" ", ".")


def base_unit(unit: str, plant: Plant) -> dict[str, float] | None:
    """FMI's BaseUnit: exponents of SI's base units, and a factor; None for a power that is not an integer."""
    if unit in SI:
        return dict(SI[unit])
    over, _, under = unit.partition("/")
    powers = {"m": 0, "q0": 0, "omega0": 0}
    for part, sign in ((over, 1), (under, -1)):
        for word in part.split("*"):
            found = re.fullmatch(r"(m|q0|omega0)(?:\^(\d+))?", word)
            if found:
                powers[found[1]] += sign * int(found[2] or 1)
            elif word not in ("", "1"):
                return None
    scales = {"m": plant.mass, "q0": plant.reference_length, "omega0": plant.reference_frequency}
    factor = 1.0
    for name, power in powers.items():
        for _ in range(abs(power)):
            factor = factor * scales[name] if power > 0 else factor / scales[name]
    exponents = {"kg": powers["m"], "m": powers["q0"], "s": -powers["omega0"]}
    return {**{name: power for name, power in exponents.items() if power}, "factor": factor}
