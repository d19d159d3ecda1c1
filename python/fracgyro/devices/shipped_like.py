"""A device in the shipped scenario that is most like it: its plant, its noise, and a force limit that suits it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..rate.units import thermal_force_density
from ..scenario import Scenario

TEMPERATURE = 300.0  # K
BASES = ((50.0, "tuned_in_air"), (1e5, "dual_mass"), (math.inf, "disc"))  # by quality factor, up to these
RESERVE = 3.0  # least force limit, over the force that the motion needs
MAX_DELAY = 8  # steps, of datasheet.delay
FEWEST_STEPS = 20  # a period, if the sampling rate is supposed
LONGEST_RUN = 20_000.0  # 1/omega0


def like(smallest: float, largest: float) -> str:
    """Name of the shipped scenario whose controller a device with these quality factors takes."""
    if smallest < BASES[0][0]:
        return BASES[0][1]
    return next(name for limit, name in BASES[1:] if largest <= limit)


def whole_steps(delay: float, step: float) -> tuple[int, float] | None:
    """A delay in whole steps, n, and the step near `step` that is an nth of it; times in 1/omega0.

    Without a step if the delay is less than half of one; None if it is too long for `datasheet.delay`.
    """
    steps = min(round(delay / step), MAX_DELAY)
    if steps == 0:
        return 0, step
    fitting = float(f"{delay / steps:.10g}")
    return (steps, fitting) if fitting <= 2 * math.pi / FEWEST_STEPS else None


def timing(steps: int, step: float) -> dict[str, float | int]:
    """Fields of a delay by whole steps, which the controller knows, and of a run with these steps."""
    return {
        "run.step": step,
        "run.duration": float(f"{step * round(LONGEST_RUN / step):.10g}"),
        "device.delay": steps,
        "datasheet.delay": steps,
    }


@dataclass(frozen=True)
class Linear:
    """A linear device in SI: mass, and (xx, xy, yy) of stiffness and damping; `length`: amplitude of the x mode, m."""

    mass: float
    stiffness: tuple[float, float, float]
    damping: tuple[float, float, float]
    length: float

    @property
    def omega(self) -> float:
        """omega0, the resonance frequency of the x axis, rad/s, with ten digits."""
        return float(f"{math.sqrt(self.stiffness[0] / self.mass):.10g}")

    def changes(self) -> dict[str, Any]:
        """Fields of a scenario in which each axis moves at its own resonance."""
        (xx, xy, yy), (dxx, dxy, dyy) = self.stiffness, self.damping
        return {
            "plant.mass": self.mass,
            "plant.stiffness": {"xx": xx, "xy": xy, "yy": yy},
            "plant.damping": {"xx": dxx, "xy": dxy, "yy": dyy},
            "plant.reference_frequency": self.omega,
            "plant.reference_length": self.length,
            "reference.frequency": (1.0, float(f"{math.sqrt(yy / self.mass) / self.omega:.10g}")),
        }

    def thermal_density(self, temperature: float = TEMPERATURE) -> float:
        """disturbance.density of the thermal force; both axes have that of the larger damping."""
        force = self.mass * self.omega**2 * self.length
        larger = max(self.damping[0], self.damping[2])
        return float(f"{thermal_force_density(larger, temperature) * self.omega / force**2:.6g}")

    def force_limit(self, base: Scenario, rate: float) -> float:
        """controller.force_limit: that of `base`, or RESERVE times the force for its amplitudes at `rate`, rad/s."""
        a, b = base.reference.amplitude
        d = [each / (self.mass * self.omega) for each in self.damping]
        coupling = abs(self.stiffness[1]) / (self.mass * self.omega**2) + abs(d[1]) + 2 * abs(rate) / self.omega
        needed = max(d[0] * a + coupling * b, d[2] * b + coupling * a)
        return max(float(base.controller.force_limit), float(f"{RESERVE * needed:.2g}"))
