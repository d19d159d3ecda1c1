"""The units of inertial sensors: computations are in SI, results are shown in these units."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..scenario.units import parse, ratio

BOLTZMANN = 1.380649e-23  # k_B, J/K, exact since 2019


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


def _unit(name: str, si: str) -> Unit:
    return Unit(name, si, float(ratio(parse(si), parse(name)) or math.nan))


RATES = {
    name: _unit(name, "rad/s") for name in ("deg/s", "rad/s", "deg/h", "mdeg/s", "mrad/s", "urad/s", "arcsec/s", "rpm")
}
DEG_PER_S, DEG_PER_H = RATES["deg/s"], RATES["deg/h"]
# N of IEEE Std 952: the integral of white rate noise grows as the square root of time.
DEG_PER_ROOT_H = _unit("deg/sqrt(h)", "rad/s/sqrt(Hz)")
# K of IEEE Std 952: random walk of the rate.
DEG_PER_H_PER_ROOT_H = _unit("deg/h/sqrt(h)", "rad/s^2/sqrt(Hz)")
DEG_PER_S_PER_ROOT_HZ = _unit("deg/s/sqrt(Hz)", "rad/s/sqrt(Hz)")
# Q of IEEE Std 952: an angle that is rounded before it is differenced.
ARCSECOND = _unit("arcsec", "rad")
PPM = _unit("ppm", "1")
PERCENT = _unit("%", "1")
HERTZ = _unit("Hz", "Hz")
DEGREE = _unit("deg", "rad")
MILLISECOND = _unit("ms", "s")


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
