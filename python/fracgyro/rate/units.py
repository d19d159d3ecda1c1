"""The units of inertial sensors: computations are in SI, results are shown in these units."""

from __future__ import annotations

import math
from dataclasses import dataclass

BOLTZMANN = 1.380649e-23  # k_B, J/K, exact since 2019
DEGREES = 180.0 / math.pi
HOUR = 3600.0  # s


@dataclass(frozen=True)
class Unit:
    """A display unit, its SI unit, and their ratio: `per_si` of this unit are one SI unit."""

    name: str
    si: str
    per_si: float

    def of(self, value: float) -> float:
        """Convert a value from SI to this unit."""
        return value * self.per_si

    def to_si(self, value: float) -> float:
        return value / self.per_si


DEG_PER_S = Unit("deg/s", "rad/s", DEGREES)
DEG_PER_H = Unit("deg/h", "rad/s", DEGREES * HOUR)
RATES = {
    unit.name: unit
    for unit in (
        DEG_PER_S,
        Unit("rad/s", "rad/s", 1.0),
        DEG_PER_H,
        Unit("mdeg/s", "rad/s", 1e3 * DEGREES),
        Unit("mrad/s", "rad/s", 1e3),
        Unit("urad/s", "rad/s", 1e6),
        Unit("arcsec/s", "rad/s", DEGREES * HOUR),
        Unit("rpm", "rad/s", 30 / math.pi),
    )
}
# N of IEEE Std 952: the integral of white rate noise grows as the square root of time.
DEG_PER_ROOT_H = Unit("deg/sqrt(h)", "rad/s/sqrt(Hz)", DEGREES * math.sqrt(HOUR))
# K of IEEE Std 952: random walk of the rate.
DEG_PER_H_PER_ROOT_H = Unit("deg/h/sqrt(h)", "rad/s^2/sqrt(Hz)", DEGREES * HOUR * math.sqrt(HOUR))
DEG_PER_S_PER_ROOT_HZ = Unit("deg/s/sqrt(Hz)", "rad/s/sqrt(Hz)", DEGREES)
# Q of IEEE Std 952: an angle that is rounded before it is differenced.
ARCSECOND = Unit("arcsec", "rad", DEGREES * HOUR)
PPM = Unit("ppm", "1", 1e6)
PERCENT = Unit("%", "1", 100.0)
HERTZ = Unit("Hz", "Hz", 1.0)
DEGREE = Unit("deg", "rad", DEGREES)
MILLISECOND = Unit("ms", "s", 1e3)


def angle_random_walk(density: float, *, one_sided: bool) -> float:
    """N in rad/sqrt(s) of white rate noise with this amplitude density in rad/s/sqrt(Hz).

    N squared is the two-sided power density (IEEE Std 952); datasheets and spectrum analyzers mostly state the
    one-sided density, whose power is twice as large.
    """
    return density / math.sqrt(2.0) if one_sided else density


def thermal_force_density(damping: float, temperature: float) -> float:
    """Two-sided power density 2 k_B T c of the thermal force, N^2 s; `damping` c in N s/m, `temperature` in K.

    The one-sided density is 4 k_B T c (T. B. Gabrielson, "Mechanical-thermal noise in micromachined acoustic and
    vibration sensors", IEEE Trans. Electron Devices 40, 1993, 903-909). White noise of two-sided density S held for h
    has variance S/h: `disturbance.density` is two-sided.
    """
    return 2.0 * BOLTZMANN * temperature * damping
