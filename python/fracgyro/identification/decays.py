"""Decays that do not decay: a loop that holds the amplitude, or a record that is too short for the damping."""

from __future__ import annotations

import math

from .diagnostics import Test
from .first_stage import Fitted
from .quantity import NORMAL, modal

BEST = 1e7  # quality factor above which an amplitude is held rather than free
KNOWN = 0.05  # deviation of the damping that the advice is for
POOR = 0.1


def decay_tests(fit: Fitted) -> list[Test]:
    """A failed test for each mode whose amplitude does not fall, a skipped one where the damping is hardly seen."""
    if fit.shape.drives:
        return []
    found = []
    where = ", ".join(dict.fromkeys(each.name for each in fit.segments))
    length = max(each.length for each in fit.segments)
    modes = modal(fit.shape, fit.fit.parameters, fit.fit.covariance, fit.unit)
    for i in range(fit.shape.axes):
        frequency, quality = modes[f"frequency_{i + 1}"].value, modes[f"quality_{i + 1}"]
        low, high = quality.interval
        loss = 0.5 * (1 / low + (1 / high if math.isfinite(high) else 0.0))
        deviation = (1 / low - loss) / NORMAL if math.isfinite(high) else 1 / low / (2 * NORMAL)
        if low > BEST:
            words = (
                f"{where}: the amplitude at {frequency:.7g} Hz does not fall in {length:.3g} s, its quality factor "
                f"would be above {low:.1g}: is a loop still closed, or the drive still on?"
            )
            found.append(Test("decay", "fail", words))
        elif deviation > POOR * loss:
            falls = 100 * -math.expm1(-math.pi * frequency * loss * length)
            longer = length * (deviation / loss / KNOWN) ** (2 / 3)
            words = (
                f"{where}: the amplitude at {frequency:.7g} Hz falls by {falls:.1g} %, so its damping is known to "
                f"{100 * NORMAL * deviation / loss:.1g} %: record at least {longer:.2g} s for "
                f"{100 * NORMAL * KNOWN:.0f} %"
            )
            found.append(Test("decay", "skipped", words))
    return found
