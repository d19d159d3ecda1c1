"""Entry point of `fracgyro device`: from the numbers of a data sheet to a complete scenario."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..arguments import short
from ..files import whole_file
from ..rate.bound import bound_angle_random_walk
from ..rate.units import DEG_PER_ROOT_H
from ..scenario import Scenario
from ..scenario.amounts import amount
from .commented import commented
from .shipped_like import FEWEST_STEPS, MAX_DELAY, TEMPERATURE, Linear, like, timing, whole_steps

Value = float | str

WARMING = 10.0 / 60.0  # K/s, supposed: 10 K a minute
FASTER = 10.0  # drift of the damping over that of the stiffness, supposed
LEAST_NOISE, MOST_NOISE = 1e-20, 1e-5  # m/sqrt(Hz), of which one is searched
PARTS = 1e-9  # width at which the search ends, relative


@dataclass(frozen=True)
class Sheet:
    """The device of a data sheet: `changes` to the shipped scenario `base`, and for each field where it comes from."""

    base: str
    changes: dict[str, Any]
    comments: dict[str, list[str]]

    def scenario(self) -> Scenario:
        """The device with the controller of the shipped scenario that is most like it."""
        return Scenario.shipped(self.base).replace(self.changes)

    def to_toml(self) -> str:
        """The scenario as TOML: each given number is marked as given in a comment, each other one as supposed."""
        words = [
            "Made by fracgyro from the numbers of a data sheet.",
            f"supposed: all that is not commented as given is of the shipped scenario {self.base}, the most similar.",
        ]
        return commented(self.scenario(), words, self.comments)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the TOML. Raises ValueError if it cannot be written."""
        with whole_file(path) as scratch:
            Path(scratch).write_text(self.to_toml(), encoding="utf-8", newline="\n")


def device(
    frequency: Value | Sequence[Value],
    q: Value | Sequence[Value],
    *,
    split: Value | None = None,
    mass: Value | None = None,
    quadrature: Value | None = None,
    damping_axis: Value | None = None,
    angle_random_walk: Value | None = None,
    full_scale: Value | None = None,
    bandwidth: Value | None = None,
    temperature_coefficient: Value | None = None,
    amplitude: Value | None = None,
    delay: Value | None = None,
    sampling: Value | None = None,
) -> Sheet:
    """A device from the numbers of its data sheet; `scenario()` of the result is complete.

    Numbers are in the unit given here, or text with another unit. Numbers that are left out are supposed, and marked in
    the TOML.

    `frequency`: of x and y, Hz, or of x, with `split`, that of y less that of x, Hz. `q`: quality factors of x and y,
    or one for both. `mass`: modal, kg. `quadrature`: deg/s. `damping_axis`: angle from x to the nearest principal axis
    of the damping, deg, less than 45. `angle_random_walk`: deg/sqrt(h); the noise of the pick-offs becomes that with
    which it is the Cramér-Rao bound. `full_scale`: deg/s. `bandwidth`: Hz. `temperature_coefficient`: of the
    frequencies, ppm/K. `amplitude`: of the x mode, m. `delay`: from a sample to its force, s. `sampling`: Hz.

    Raises ValueError, in one sentence, for a number that is not allowed, and TypeError for anything but numbers.

    >>> made = fg.device(("15 kHz", "15.2 kHz"), (20_000, 8_000), mass=3e-9, full_scale=500)
    >>> made.scenario().plant.mass, round(made.scenario().plant.angular_rate, 3)
    (3e-09, 8.727)
    >>> print(*[line for line in made.to_toml().splitlines() if line.startswith("# given: full")])
    # given: full scale 500 deg/s.
    """
    hertz = _frequencies(frequency, split)
    quality = _positive("q", q, "1", most=2)
    base_name = like(min(quality), max(quality))
    base = Scenario.shipped(base_name)
    said = _Said(base_name)
    kilograms = said.number("plant.mass", "mass", mass, "kg", base.plant.mass)
    length = said.number("plant.reference_length", "amplitude", amplitude, "m", base.plant.reference_length)
    omega = [2 * math.pi * each for each in hertz]
    kxy = _signed("quadrature", quadrature, "deg/s")
    losses = [kilograms * each / loss for each, loss in zip(omega, [*quality, quality[-1]], strict=False)]
    plant = Linear(
        kilograms,
        (_digits(kilograms * omega[0] ** 2), _digits(2 * kilograms * omega[0] * math.radians(kxy or 0.0)),
         _digits(kilograms * omega[1] ** 2)),
        (_digits(losses[0]), _digits(_coupling(losses, damping_axis)), _digits(losses[1])),
        length,
    )  # fmt: skip
    shown = [f"{each:g}" for each in quality]
    said.given("plant.stiffness", f"frequencies {hertz[0]:.10g} and {hertz[1]:.10g} Hz")
    words = f"quadrature {kxy or 0.0:g} deg/s, which is xy"
    said.either("plant.stiffness", kxy, words, "no quadrature: xy is 0")
    said.given("plant.damping", f"quality factors {' and '.join(shown if len(shown) > 1 else shown * 2)}")
    turned = f"principal axis at {short(damping_axis)} deg from x, which gives xy"
    said.either("plant.damping", damping_axis, turned, "the axes of the damping are x and y: xy is 0")
    said.given("plant.reference_frequency", "the frequency of x")
    said.given("reference.frequency", "the frequencies of x and y")
    said.supposed("disturbance.density", f"thermal force of the larger damping at {TEMPERATURE:g} K")
    usual = math.degrees(base.plant.angular_rate)
    rate = said.number("plant.angular_rate", "full scale", full_scale, "deg/s", usual)
    usual = base.adaptation.rate_forgetting * base.plant.reference_frequency / (2 * math.pi)
    band = said.number("adaptation.rate_forgetting", "bandwidth", bandwidth, "Hz", usual)
    changes = plant.changes() | {
        "disturbance.density": plant.thermal_density(),
        "plant.angular_rate": float(f"{math.radians(rate):.10g}"),
        "adaptation.rate_forgetting": float(f"{2 * math.pi * band / plant.omega:.6g}"),
    }
    limit = plant.force_limit(base, math.radians(rate))
    if limit > base.controller.force_limit:
        changes["controller.force_limit"] = limit
        said.supposed("controller.force_limit", "three times the force for the motion at the full scale")
    changes |= _drifts(said, base, plant.omega, temperature_coefficient)
    changes |= _timing(said, base, plant.omega, delay, sampling)
    if angle_random_walk is None:
        changes["device.position_noise_density"] = base.device.position_noise_density
        said.supposed("device.position_noise_density", f"that of {base_name}")
    else:
        (wanted,) = _positive("angle_random_walk", angle_random_walk, "deg/sqrt(h)", most=1)
        changes["device.position_noise_density"] = _noise(base.replace(changes), wanted)
        words = f"angle random walk {wanted:g} deg/sqrt(h), the Cramér-Rao bound with this noise of the pick-offs"
        said.given("device.position_noise_density", words)
    return Sheet(base_name, changes, said.comments)


class _Said:
    """Comments by field: where its number comes from."""

    def __init__(self, base: str) -> None:
        self.base = base
        self.comments: dict[str, list[str]] = {}

    def given(self, field: str, words: str) -> None:
        self.comments.setdefault(field, []).append(f"given: {words}.")

    def supposed(self, field: str, words: str) -> None:
        self.comments.setdefault(field, []).append(f"supposed: {words}.")

    def either(self, field: str, value: object, given: str, supposed: str) -> None:
        """A comment for a number that was given, or not."""
        if value is None:
            self.supposed(field, supposed)
        else:
            self.given(field, given)

    def number(self, field: str, name: str, value: Value | None, unit: str, usual: float) -> float:
        """A positive number in `unit`, or `usual`, that of the shipped scenario; with the comment of its field."""
        found = usual if value is None else _positive(name.replace(" ", "_"), value, unit, most=1)[0]
        self.either(field, value, f"{name} {found:g} {unit}", f"{name} {found:.6g} {unit}, as in {self.base}")
        return found


def _digits(value: float) -> float:
    return float(f"{value:.10g}")


def _positive(name: str, value: object, unit: str, most: int) -> list[float]:
    """One number above 0, or up to `most`, in `unit`."""
    several = list(value) if isinstance(value, Sequence) and not isinstance(value, str | bytes) else [value]
    if not 1 <= len(several) <= most:
        rule = "one number" if most == 1 else "one number, or two for x and y"
        raise ValueError(f"{name} is {short(value)}: it must be {rule}")
    found = [amount(name, each, unit) for each in several]
    for each, given in zip(found, several, strict=True):
        if not each > 0:
            raise ValueError(f"{name} is {short(given)}: it must be greater than 0")
    return found


def _signed(name: str, value: Value | None, unit: str) -> float | None:
    return None if value is None else amount(name, value, unit)


def _frequencies(frequency: Value | Sequence[Value], split: Value | None) -> tuple[float, float]:
    found = _positive("frequency", frequency, "Hz", most=2)
    apart = _signed("split", split, "Hz")
    if len(found) == 2:
        if apart is not None and abs(apart - (found[1] - found[0])) > 1e-6 * found[0]:
            raise ValueError(f"split is {apart:g} Hz: it must be left out, as frequency has both frequencies")
        pair = found[0], found[1]
    elif apart is None:
        raise ValueError(f"split is missing: frequency is one number, {found[0]:g} Hz, so it must be given")
    else:
        pair = found[0], found[0] + apart
    if pair[1] <= 0 or pair[0] == pair[1]:
        rule = "both must be above 0 and differ: one frequency of motion does not separate the rate from the damping"
        raise ValueError(f"the frequencies are {pair[0]:g} and {pair[1]:g} Hz: {rule}")
    return pair


def _coupling(losses: Sequence[float], axis: Value | None) -> float:
    """dxy of a damping whose principal axis is turned by `axis` against x, from dxx and dyy."""
    angle = _signed("damping_axis", axis, "deg")
    if not angle:
        return 0.0
    dxx, dyy = losses[:2]
    half, largest = (dxx - dyy) / 2, math.sqrt(dxx * dyy)
    allowed = math.degrees(math.atan2(largest, abs(half))) / 2
    if not abs(angle) < allowed or half == 0:
        rule = "left out, as equal damping has no axes" if half == 0 else f"less than {allowed:.3g} deg, so that D > 0"
        raise ValueError(f"damping_axis is {angle:g} deg: it must be {rule}")
    return half * math.tan(2 * math.radians(angle))


def _drifts(said: _Said, base: Scenario, omega: float, coefficient: Value | None) -> dict[str, float]:
    """Fields of the drift by the temperature; `coefficient`: ppm/K, of the frequencies."""
    ppm = _signed("temperature_coefficient", coefficient, "ppm/K")
    if ppm is None:
        per_second = float(base.datasheet.stiffness_drift) * base.plant.reference_frequency
        said.supposed("datasheet.stiffness_drift", f"{1e6 * per_second:.3g} ppm/s, as in {said.base}")
        changes = {}
    else:
        per_second = 2e-6 * abs(ppm) * WARMING
        said.given("device.frequency_temperature_coefficient", f"{ppm:g} ppm/K")
        said.given("datasheet.stiffness_drift", f"temperature coefficient of the frequencies {ppm:g} ppm/K, twice")
        said.supposed("datasheet.stiffness_drift", "the temperature changes by 10 K a minute")
        changes = {"device.frequency_temperature_coefficient": ppm}
    said.supposed("datasheet.damping_drift", f"{FASTER:g} times that of the stiffness")
    drift = per_second / omega
    return changes | {
        "datasheet.stiffness_drift": float(f"{drift:.3g}"),
        "datasheet.damping_drift": float(f"{FASTER * drift:.3g}"),
    }


def _timing(
    said: _Said, base: Scenario, omega: float, delay: Value | None, sampling: Value | None
) -> dict[str, float | int]:
    """Fields of the sampling rate and of the delay, which is whole steps."""
    step = float(base.run.step)
    seconds = _signed("delay", delay, "s")
    if seconds is not None and seconds < 0:
        raise ValueError(f"delay is {seconds:g} s: it must be at least 0")
    steps = 0
    if sampling is not None:
        (hertz,) = _positive("sampling", sampling, "Hz", most=1)
        step = _digits(omega / hertz)
        said.given("run.step", f"sampling rate {hertz:g} Hz")
        steps = round((seconds or 0.0) * hertz)
        if steps > MAX_DELAY:
            rule = f"it must be at most {MAX_DELAY} steps of the sampling rate, {MAX_DELAY / hertz:g} s"
            raise ValueError(f"delay is {seconds:g} s: {rule}")
    elif seconds is not None and seconds * omega > step / 2:
        found = whole_steps(seconds * omega, step)
        if found is None:
            longest = MAX_DELAY * 2 * math.pi / FEWEST_STEPS / omega
            raise ValueError(f"delay is {seconds:g} s: without a sampling rate it must be at most {longest:.2g} s")
        steps, step = found
        said.supposed("run.step", f"sampling rate {omega / step:.6g} Hz, of which the delay is {steps} steps")
    else:
        said.supposed("run.step", f"sampling rate {omega / step:.6g} Hz, steps in a period as in {said.base}")
    words = f"delay {seconds or 0.0:g} s, in whole steps of {step / omega:.4g} s"
    for field in ("device.delay", "datasheet.delay"):
        said.either(field, seconds, words, "no delay")
    return timing(steps, step)


def _noise(scenario: Scenario, wanted: float) -> float:
    """position_noise_density with which the bound of `scenario` is `wanted`, deg/sqrt(h).

    Raises ValueError if the thermal force gives more than that.
    """

    def walk(density: float) -> float:
        bound = bound_angle_random_walk(scenario.replace({"device.position_noise_density": density}))
        return math.inf if bound is None else DEG_PER_ROOT_H.of(bound.unknown)

    low, high = LEAST_NOISE, MOST_NOISE
    for limit, word, outside in ((low, "more", walk(low) >= wanted), (high, "less", walk(high) <= wanted)):
        if outside:
            cause = "the thermal force gives" if word == "more" else f"noise of {limit:g} m/sqrt(Hz) gives"
            rule = f"it must be {word} than {walk(limit):.3g}, which {cause} at this mass, amplitude and Q"
            raise ValueError(f"angle_random_walk is {wanted:g} deg/sqrt(h): {rule}")
    while high > low * (1 + PARTS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if walk(middle) < wanted else (low, middle)
    return float(f"{high:.4g}")
