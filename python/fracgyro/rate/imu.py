"""The sensor's noise in the formats of three navigation filters and simulations.

Kalibr's imu.yaml, gnss-ins-sim's gyroscope error profile, and the gyroscope lines of a KF-GINS configuration. Terms
that were not observed are not filled in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Literal

import numpy as np

from .allan import FLOOR, Allan, Estimate
from .measure import Characterization
from .units import DEG_PER_H, DEG_PER_ROOT_H, Unit

Imu = Literal["kalibr", "gnss-ins-sim", "kf-gins"]

# Markov noise of standard deviation 1 has its largest Allan deviation, 0.617, at 1.892 times its correlation time.
MARKOV_PEAK, MARKOV_DEVIATION = 1.892, 0.617
AXES = 3


@dataclass(frozen=True)
class Noise:
    """Noise of one axis."""

    found: Allan
    interval: float  # s, of the output
    mean: float  # rad/s, at rest
    source: str  # origin of the measurement, for a comment


def of_simulation(m: Characterization) -> Noise:
    """Noise of a simulated sensor."""
    rest = m.rest
    seconds = rest.rate.shape[1] * rest.interval
    source = f"on {m.seeds} simulated records at rest, {_seconds(seconds)} s each"
    return Noise(m.allan, rest.interval, float(np.mean(rest.rate)), source)


def _seconds(value: float) -> str:
    return f"{value:.3g}" if value < 1000 else f"{value:,.0f}"


def imu_file(kind: Imu, axes: Sequence[Noise]) -> tuple[str, str]:
    """Name and text of the file; the noise of a single axis is used for all three."""
    name, text = FILES[kind]
    return name, text([_trusted(each) for each in axes])


def _trusted(axis: Noise) -> Noise:
    """The noise without the estimates that an event in the record invalidates."""
    if not any(event.spoils for event in axis.found.events):
        return axis
    none = Estimate(0.0, 0.0, math.inf, True)
    found = replace(axis.found, angle_random_walk=None, bias_instability=none, rate_random_walk=none)
    return replace(axis, found=found)


def _head(axes: Sequence[Noise], comment: str = "#") -> list[str]:
    lines = [f"{comment} Gyroscope noise measured by fracgyro {version('fracgyro')} {each.source}." for each in axes]
    slowest = max(each.found.response_time for each in axes)
    if slowest:
        lines.append(
            f"{comment} The sensor's response time is {slowest:.3g} s: samples closer than that are "
            "correlated and have less noise than white noise of this density."
        )
    for each in axes:
        lines += [f"{comment} Not noise: {event.sentence}." for event in each.found.events]
    return lines


def _worst(estimates: Sequence[Estimate | None]) -> Estimate | None:
    """The largest observed value; the largest limit if no value was observed."""
    seen = [each for each in estimates if each is not None and not each.limit]
    limits = [each for each in estimates if each is not None and each.limit]
    return max(seen, key=lambda each: each.value) if seen else max(limits, key=lambda each: each.high, default=None)


def _kalibr(axes: Sequence[Noise]) -> str:
    """Kalibr's imu.yaml. Its densities are square roots of two-sided power densities, as N and K are.

    It has one number for all axes: the largest.
    """
    walk = _worst([each.found.angle_random_walk for each in axes])
    drift = _worst([each.found.rate_random_walk for each in axes])
    several = ", the largest of the axes" if len(axes) > 1 else ""
    lines = [
        *_head(axes),
        "# To be added: rostopic, accelerometer_noise_density, accelerometer_random_walk.",
        f"update_rate: {1 / axes[0].interval:.6g}  # Hz, of the output",
        _line("gyroscope_noise_density", walk, f"rad/s/sqrt(Hz){several}"),
        _line("gyroscope_random_walk", drift, f"rad/s^2/sqrt(Hz){several}"),
    ]
    return "\n".join(lines) + "\n"


def _line(name: str, found: Estimate | None, words: str) -> str:
    if found is None or (found.limit and not math.isfinite(found.high)):
        return f"# {name}: not observed"
    if found.limit:
        return f"# {name}: not observed; at most {found.high:.3g} {words}"
    return f"{name}: {found.value:.6g}  # {words}"


def _gnss_ins_sim(axes: Sequence[Noise]) -> str:
    """A dict for `IMU.set_gyro_error`, in SI like its built-in profiles.

    Flicker noise becomes Gauss-Markov noise with the same peak Allan deviation, at the averaging time of the record's
    minimum.
    """
    rows = [_markov(each) for each in axes]
    biases, spreads, correlations, walks = (
        _axes(values) for values in zip(*((each.mean, *row) for each, row in zip(axes, rows, strict=True)), strict=True)
    )
    walk_words = [
        "not observed" if math.isnan(row[2]) else f"{DEG_PER_ROOT_H.of(row[2]):.3g} deg/sqrt(h)" for row in rows
    ]
    drift_words = [_words(each.found.bias_instability, DEG_PER_H) for each in axes]
    seen = any(not each.found.bias_instability.limit for each in axes)
    means = ", ".join(f"{DEG_PER_H.of(each.mean):.3g}" for each in axes)
    lines = [
        *_head(axes),
        "# Use: imu.set_gyro_error(gyro_err). rad/s, s and rad/sqrt(s), as in the simulator's built-in profiles.",
        "import numpy as np",
        "",
        "gyro_err = {",
        f"    'b': {biases},  # {means} deg/h, the mean output at rest",
        f"    'b_drift': {spreads},  # bias instability {_comment(drift_words)}",
        f"    'b_corr': {correlations}," + ("  # averaging time of the Allan minimum / 1.892" if seen else ""),
        f"    'arw': {walks},  # angle random walk {_comment(walk_words)}",
        "}",
    ]
    for each in axes:
        drift = each.found.rate_random_walk
        if not drift.limit:
            lines.append(f"# The simulator has no rate random walk. Observed: {drift.value:.3g} rad/s/sqrt(s).")
    return "\n".join(lines) + "\n"


def _markov(axis: Noise) -> tuple[float, float, float]:
    """Standard deviation and correlation time of the drift, and N; NaN without a bound."""
    flicker, walk = axis.found.bias_instability, axis.found.angle_random_walk
    white = walk.value if walk and not walk.limit else math.nan
    if flicker.limit:
        return 0.0 if math.isfinite(flicker.high) else math.nan, math.inf, white
    return flicker.value * FLOOR / MARKOV_DEVIATION, _least_at(axis.found) / MARKOV_PEAK, white


def _kf_gins(axes: Sequence[Noise]) -> str:
    """Gyroscope lines under imunoise in KF-GINS's YAML: deg/sqrt(h), deg/h, and h."""
    rows = [_markov(each) for each in axes]
    walks = [DEG_PER_ROOT_H.of(row[2]) for row in rows]
    spreads = [DEG_PER_H.of(row[0]) for row in rows]
    times = [row[1] / 3600 for row in rows if math.isfinite(row[1])]
    lines = [
        *_head(axes),
        "# Under imunoise; to be added: vrw, abstd, gsstd, asstd and those under initstd.",
        f"arw: {_listed(walks)}  # deg/sqrt(h)"
        if not any(map(math.isnan, walks))
        else "# arw: not observed on every axis, in deg/sqrt(h)",
        f"gbstd: {_listed(spreads)}  # deg/h, standard deviation of the bias as Gauss-Markov noise"
        if all(value > 0 for value in spreads)
        else "# gbstd: bias instability not observed on every axis, in deg/h",
        f"corrtime: {max(times):.4g}  # h, averaging time of the Allan minimum / 1.892"
        if times
        else "# corrtime: not observed, in h",
    ]
    return "\n".join(lines) + "\n"


def _listed(values: Sequence[float]) -> str:
    """Three axes as YAML."""
    three = list(values) if len(values) == AXES else [max(values)] * AXES
    return f"[ {', '.join(f'{each:.6g}' for each in three)} ]"


def _axes(values: Sequence[float]) -> str:
    """Three axes as Python."""
    written = ["np.inf" if math.isinf(value) else "np.nan" if math.isnan(value) else f"{value:.6g}" for value in values]
    if len(values) == AXES:
        return f"np.array([{', '.join(written)}])"
    return f"np.full({AXES}, {written[int(np.argmax(values))]})"


def _words(found: Estimate, unit: Unit) -> str:
    if not found.limit:
        return f"{unit.of(found.value):.3g} {unit.name}"
    return f"at most {unit.of(found.high):.3g} {unit.name}" if math.isfinite(found.high) else "not observed"


def _comment(axes: Sequence[str]) -> str:
    """Comment with the value of each axis and the meaning of 0 and nan."""
    words = ", ".join(axes)
    if all(each[0].isdigit() for each in axes):
        return words
    return f"{words}; 0 disables a term, nan is to be replaced; without this line the simulator uses its default"


def _least_at(found: Allan) -> float:
    inside = found.tau >= found.fitted[0] if found.fitted else np.ones(len(found.tau), dtype=bool)
    return float(found.tau[inside][np.argmin(found.deviation[inside])])


FILES: dict[Imu, tuple[str, Callable[[Sequence[Noise]], str]]] = {
    "kalibr": ("imu.yaml", _kalibr),
    "gnss-ins-sim": ("gnss_ins_sim.py", _gnss_ins_sim),
    "kf-gins": ("kf_gins.yaml", _kf_gins),
}
