"""What a navigation simulation needs to know of the sensor's noise, in the words of two that engineers use.

Kalibr's imu.yaml and gnss-ins-sim's error profile of a gyroscope. What the record did not show is not filled in.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.metadata import version
from typing import Literal

import numpy as np

from .allan import FLOOR, Allan, Estimate
from .measure import Characterisation
from .units import DEG_PER_H, DEG_PER_ROOT_H, Unit

Imu = Literal["kalibr", "gnss-ins-sim"]

# Markov noise of standard deviation 1 has its largest Allan deviation, 0.617, at 1.892 times its correlation time.
MARKOV_PEAK, MARKOV_DEVIATION = 1.892, 0.617


def imu_file(kind: Imu, m: Characterisation) -> tuple[str, str]:
    """Name and text of the file."""
    name, text = FILES[kind]
    return name, text(m)


def _head(m: Characterisation) -> list[str]:
    rest, found = m.rest, m.allan
    seconds = rest.rate.shape[1] * rest.interval
    lines = [
        f"# Gyroscope noise measured by fracgyro {version('fracgyro')} on {m.seeds} simulated records at rest, "
        f"{seconds:.3g} s each.",
    ]
    if found.response_time:
        lines.append(
            f"# The output's own response time is {found.response_time:.3g} s: samples closer than that are "
            "correlated, and have less noise than this density means."
        )
    return lines


def _kalibr(m: Characterisation) -> str:
    """Kalibr's imu.yaml; its densities are the roots of two-sided ones, and so are N and K."""
    walk, drift = m.allan.angle_random_walk, m.allan.rate_random_walk
    lines = [
        *_head(m),
        "# To be added: rostopic, accelerometer_noise_density, accelerometer_random_walk.",
        f"update_rate: {1 / m.rest.interval:.6g}  # Hz, of the output",
        f"gyroscope_noise_density: {walk.value:.6g}  # rad/s/sqrt(Hz)"
        if walk
        else "# gyroscope_noise_density: not observed",
        f"gyroscope_random_walk: {drift.value:.6g}  # rad/s^2/sqrt(Hz)"
        if not drift.limit
        else f"# gyroscope_random_walk: not observed; at most {drift.high:.3g} rad/s^2/sqrt(Hz)",
    ]
    return "\n".join(lines) + "\n"


def _gnss_ins_sim(m: Characterisation) -> str:
    """A dict for `IMU.set_gyro_error`, in SI as its built-in profiles are.

    Flicker noise becomes the Gauss-Markov noise whose largest Allan deviation is the same, where the least deviation
    of the record lies.
    """
    found = m.allan
    bias = float(np.mean(m.rest.rate))
    flicker, walk, drift = found.bias_instability, found.angle_random_walk, found.rate_random_walk
    spread, correlation = 0.0, math.inf
    if not flicker.limit:
        spread = flicker.value * FLOOR / MARKOV_DEVIATION
        correlation = _least_at(found) / MARKOV_PEAK
    unseen = "not observed; 0 adds none, and without this line the simulator takes its own"
    lines = [
        *_head(m),
        "# Use: imu.set_gyro_error(gyro_err). rad/s, s and rad/sqrt(s), as in the simulator's built-in profiles.",
        "import numpy as np",
        "",
        "gyro_err = {",
        f"    'b': {_axes(bias)},  # {DEG_PER_H.of(bias):.3g} deg/h, the mean output at rest",
        f"    'b_drift': {_axes(spread)},  # " + _words(flicker, DEG_PER_H, "bias instability", unseen),
        f"    'b_corr': {_axes(correlation)},"
        + ("" if flicker.limit else "  # flicker noise has none: where the least Allan deviation lies, over 1.892"),
        f"    'arw': {_axes(walk.value if walk else 0.0)},  # "
        + (f"{DEG_PER_ROOT_H.of(walk.value):.3g} deg/sqrt(h)" if walk else f"angle random walk: {unseen}"),
        "}",
    ]
    if not drift.limit:
        lines.append(f"# The simulator has no rate random walk. Observed: {drift.value:.3g} rad/s/sqrt(s).")
    return "\n".join(lines) + "\n"


def _axes(value: float) -> str:
    """The same for all three axes."""
    return f"np.full(3, {'np.inf' if math.isinf(value) else format(value, '.6g')})"


def _words(found: Estimate, unit: Unit, name: str, unseen: str) -> str:
    if found.limit:
        return f"{name}: at most {unit.of(found.high):.3g} {unit.name}, {unseen}"
    return f"{name} {unit.of(found.value):.3g} {unit.name}"


def _least_at(found: Allan) -> float:
    inside = found.tau >= found.fitted[0] if found.fitted else np.ones(len(found.tau), dtype=bool)
    return float(found.tau[inside][np.argmin(found.deviation[inside])])


FILES: dict[Imu, tuple[str, Callable[[Characterisation], str]]] = {
    "kalibr": ("imu.yaml", _kalibr),
    "gnss-ins-sim": ("gnss_ins_sim.py", _gnss_ins_sim),
}
