"""Quantities of cubic springs from the fits of one condition, and the test for them in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .cubic import SEEN, shift_per
from .diagnostics import Test
from .first_stage import Fitted
from .quantity import NORMAL, Quantity
from .second_stage import Known


def spring_quantities(
    fits: Sequence[Fitted], known: Known, ratio: Quantity | None, axis: Quantity | None
) -> dict[str, Quantity]:
    """Backbones in Hz over the square of the record's unit; in N/m^3 where mass and gain of the pick-off are known.

    `ratio`: of the pick-offs; `axis`: angle of the stiffness, by whose cosine a pick-off sees less of the motion.
    """
    found: dict[str, Quantity] = {}
    first = fits[0] if fits else None
    for i, name in enumerate(first.segments[0].axes if first else ()):
        seen = [each for each in fits if each.cubic is not None and each.cubic.strength[i]]
        if not seen:
            continue
        spring, deviation = _mean(seen, i)
        unit = seen[0].segments[0].units[i] or "unit"
        per = float(shift_per(seen[0].shape, seen[0].fit.parameters)[i]) / (2 * math.pi * seen[0].unit)
        half = NORMAL * per * deviation
        value = per * spring
        found[f"backbone_{name}"] = Quantity(f"backbone_{name}", value, (value - half, value + half), f"Hz/{unit}^2")
        gain = 1.0 if name == "x" else ratio.value if ratio is not None and ratio.determined else None
        if known.mass is None or known.pickoff is None or gain is None:
            continue
        turn = math.cos(math.radians(axis.value)) if axis is not None and axis.determined else 1.0
        scale = known.mass * (gain * turn / known.pickoff) ** 2
        spread = 0.0 if name == "x" or ratio is None else 2 * abs(spring) * ratio.half / gain
        half = scale * math.hypot(NORMAL * deviation, spread)
        value = scale * spring
        found[f"cubic_{name}"] = Quantity(f"cubic_{name}", value, (value - half, value + half), "N/m^3")
    return found


def _mean(fits: Sequence[Fitted], i: int) -> tuple[float, float]:
    """The spring over the mass, 1/s^2 over the square of the record's unit, and its deviation, of all fits."""
    values, weights = [], []
    for each in fits:
        assert each.cubic is not None
        values.append(float(each.cubic.strength[i]) * each.unit**2)
        weights.append(1 / (float(each.cubic.covariance[i, i]) * each.unit**4))
    return float(np.average(values, weights=weights)), 1 / math.sqrt(sum(weights))


def spring_tests(fit: Fitted) -> list[Test]:
    """One test: whether the frequency depends on the amplitude."""
    springs = fit.cubic
    assert springs is not None
    where = ", ".join(dict.fromkeys(each.name for each in fit.segments))
    p = springs.p
    if float(np.abs(springs.score).max()) <= SEEN:
        return [Test("springs", "pass", f"{where}: the frequency does not depend on the amplitude (p = {p:.2g})", p)]
    strength = springs.strength if springs.fitted else springs.first
    change = shift_per(fit.shape, fit.fit.parameters) * strength * springs.largest**2 * fit.unit / (2 * math.pi)
    parts = [
        f"along {axis} by {abs(each):.2g} Hz, {'up' if each > 0 else 'down'},"
        for axis, each, score in zip(fit.segments[0].axes, change, springs.score, strict=True)
        if abs(score) > SEEN
    ]
    words = f"{where}: the largest amplitude shifts the frequency {' and '.join(parts)}"
    if springs.fitted:
        return [Test("springs", "pass", f"{words} and the fit has a cubic spring", p)]
    return [Test("springs", "fail", f"{words} which the fit does not have: repeat with a smaller amplitude", p)]
