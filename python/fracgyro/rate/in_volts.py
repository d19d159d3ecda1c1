"""Figures that `fracgyro rate` adds for what a scenario has.

With electrodes or electronics: voltages, readout, shares of noise, bias by parts; with them or a spring common to both
axes the ripple at the split; of a whole-angle gyroscope drift, lock-in and resolution of the angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import mean_interval
from ..scenario import Scenario
from ..scenario.device_core import device_values
from ..scenario.volts_core import at_bias, drive, has_volts, plant_at_bias
from .bound import bound_of_noise, lines_of, noise_of
from .innovation import Noise
from .results import Result
from .runs import RANGE
from .sensor import Sensor
from .units import ARCSECOND, DEG_PER_H, DEG_PER_ROOT_H, DEG_PER_S

Array = NDArray[np.float64]

ATTO = 1e18
# Fields of [electronics] that make noise: each off, and the name of the noise.
NOISES: dict[str, tuple[str, float]] = {
    "voltage_noise": ("the amplifiers' voltage noise", 0.0),
    "feedback_resistance": ("the feedback resistance", math.inf),
    "current_noise": ("the amplifiers' current noise", 0.0),
}
AXES = ("x", "y")
MIN_BEATS = 20  # periods of the ripple in a record
MAX_PHASE = 0.5  # rad between its samples


def volts_figures(sensor: Sensor) -> list[Result]:
    """The figures that the scenario has the parts for; none without electrodes and electronics.

    Runs one seed at rest and at 300 deg/s, and all at rest without feedthrough and without lags.
    """
    scenario = sensor.scenario
    if not has_volts(scenario) or sensor.controller is not None:
        return []
    return [*_voltages(sensor), *_readout(scenario), *_noise(scenario), *_biases(sensor)]


def _voltages(sensor: Sensor) -> list[Result]:
    """Largest voltages of the drivers, at rest and at the end of the range."""
    scenario = sensor.scenario
    if not scenario.electrodes.of("force"):
        return []
    gain = at_bias(scenario).gain[[0, 2]]
    most, _ = drive(scenario)
    found = []
    for key, words, rate in (("at_rest", "at rest", 0.0), ("at_range", "at 300 deg/s", RANGE)):
        forces = sensor.forces(rate)
        for i, axis in enumerate(AXES):
            limit, volts = most[i] / float(gain[i]), float(forces[i]) / float(gain[i])
            reached = ", which it reaches" if volts >= limit else ""
            found.append(
                Result(
                    f"voltage_{key}_{axis}",
                    f"Voltage of the driver of {axis}, {words}",
                    "largest magnitude in the steady half of a run, force over the gain as designed",
                    "V",
                    min(volts, limit),
                    note=f"its range is {limit:g} V{reached}" if math.isfinite(limit) else "",
                )
            )
    return found


def _readout(scenario: Scenario) -> list[Result]:
    """Noise of the pick-offs in meters and in farads, and its shares."""
    if not any(at_bias(scenario).noise):
        return []
    whole, slope, found = at_bias(scenario).noise, slopes(scenario), []
    single = {name: at_bias(only_noise(scenario, name)).noise for name in NOISES}
    for i, axis in enumerate(AXES):
        shares = [f"{100 * (single[name][i] / whole[i]) ** 2:.3g} % by {words}" for name, (words, _) in NOISES.items()]
        meters, farads = float(whole[i]), float(whole[i]) * slope[i]
        named = f"readout_{axis}", f"Readout noise of {axis}"
        note = "of its power " + ", ".join(shares)
        found.append(
            Result(f"{named[0]}_m", named[1], "one-sided density of the position", "m/sqrt(Hz)", meters, note=note)
        )
        definition = f"the same, times dC/d{axis} of {1e12 * slope[i] / 1e6:.4g} pF/um"
        found.append(Result(f"{named[0]}_farad", named[1], definition, "aF/sqrt(Hz)", ATTO * farads))
    return found


def slopes(scenario: Scenario) -> tuple[float, float]:
    """dC/dx and dC/dy of the pick-offs as designed, F/m: their charge for a volt on each."""
    volt = [{**dict(one), "bias": 1.0} for one in scenario.electrodes.each if one.role == "pickoff"]
    quiet = {"carrier_frequency": 0.0, "carrier_voltage": 0.0}
    electronics = {"pole": scenario.electronics.pole, **quiet}
    found = at_bias(scenario.replace({"electrodes": volt, "electronics": electronics, "trim": {}}))
    return float(found.charge[0]), float(found.charge[2])


def only_noise(scenario: Scenario, name: str) -> Scenario:
    """The scenario with this noise of its amplifiers, and no other of theirs."""
    off = {f"electronics.{each}": value for each, (_, value) in NOISES.items() if each != name}
    return scenario.replace(dict(off))


def _noise(scenario: Scenario) -> list[Result]:
    """The bound of the angle random walk with one noise at a time, D and K known."""
    still = scenario.replace({"plant.angular_rate": 0.0})
    noise = noise_of(still)
    if noise is None:
        return []
    jitter = _of_jitter(still)
    all_of_them = bound_of_noise(still, replace(noise, position=noise.position + jitter))
    if all_of_them is None:
        return []
    quiet = replace(noise, force=0.0, position=np.zeros(2))
    driven = float(np.mean(np.square(device_values(still)["drive_noise"]))) * still.run.step
    cases: dict[str, tuple[str, Noise]] = {
        "thermal": ("the thermal force", replace(quiet, force=noise.force - driven)),
        "drivers": ("the noise of the drivers", replace(quiet, force=driven)),
    }
    for name, (words, _) in NOISES.items():
        amplifiers = np.array(device_values(only_noise(still, name))["amplifier_noise"])
        cases[name] = words, replace(quiet, position=amplifiers**2 * still.run.step)
    cases["jitter"] = "the jitter of the samples", replace(quiet, position=jitter)
    steps = np.array(device_values(still)["drive_step"])
    # Rounding as white noise; of both axes the mean power, as the bound has one density of the force.
    rounding = float((steps**2).mean()) / 12 * still.run.step
    cases["drive_steps"] = "the steps of the drivers", replace(quiet, force=rounding)
    found = []
    for key, (words, each) in cases.items():
        if not (each.force or each.of_sensing):
            continue
        bound = bound_of_noise(still, each)
        if bound is None:
            continue
        share = f"{100 * (bound.known / all_of_them.known) ** 2:.3g} %"
        note = f"{share} of the power of all noise"
        if key == "drive_steps":
            note = f"{share} of the power of all other noise; none if the controller knows the rounded force"
        found.append(
            Result(
                f"bound_{key}",
                f"Bound of the angle random walk by {words}",
                "Cramér-Rao bound with this noise only, damping and stiffness known; the powers need not add up",
                DEG_PER_ROOT_H.name,
                DEG_PER_ROOT_H.of(bound.known),
                note=note,
            )
        )
    return found


def _of_jitter(scenario: Scenario) -> Array:
    """Density of the position error of samples taken too early or too late: jitter times velocity, x and y."""
    lines = lines_of(scenario) or []
    squares = sum((abs(frequency * position) ** 2 / 2 for frequency, position in lines), np.zeros(2))
    jitter = scenario.electronics.jitter / scenario.plant.scales.time
    return np.asarray(jitter**2 * squares * scenario.run.step)


def _biases(sensor: Sensor) -> list[Result]:
    """Change of the output at rest that parts of the electronics cause: with them less without, on the same seeds."""
    e = sensor.scenario.electronics
    off: dict[str, Any] = {"pole": (math.inf, math.inf), "sample_delay": 0.0, "update_delay": 0.0, "aperture": 0.0}
    lags = {name: value for name, value in off.items() if getattr(e, name) != value}
    parts = (
        ("feedthrough", "feedthrough", {"feedthrough": (0.0,) * 4} if any(e.feedthrough) else {}),
        ("phase", "poles and delays, times the quadrature", lags),
    )
    whole, found = None, []
    for key, words, without in parts:
        if not without:
            continue
        if whole is None:
            whole = sensor.output(0.0).settled().rate.mean(axis=1)
        changes = {f"electronics.{name}": value for name, value in without.items()}
        rest = sensor.output(0.0, changes=changes).settled().rate.mean(axis=1)
        value, low, high = (DEG_PER_H.of(number) for number in mean_interval(np.asarray(whole - rest)))
        made = Result(
            f"bias_by_{key}",
            f"Bias by {words}",
            "zero-rate output less that without them",
            DEG_PER_H.name,
            value,
            low,
            high,
        )
        found.append(replace(made, note="not observed: its interval includes 0") if low <= 0.0 <= high else made)
    return found


def ripple_figures(sensor: Sensor) -> list[Result]:
    """Ripple of the output at the difference of the resonances; none without electrodes, electronics or common springs.

    Runs one seed at rest.
    """
    scenario = sensor.scenario
    device = scenario.device
    if not (has_volts(scenario) or device.cubic_coupling or any(device.cubic_skew)) or sensor.controller is not None:
        return []
    plant = plant_at_bias(scenario)
    stiffness = plant.effective_stiffness()
    split = abs(math.sqrt(stiffness.yy / plant.mass) - math.sqrt(stiffness.xx / plant.mass))  # rad/s
    output, interval = sensor.at_every_record(0.0)
    length = interval * len(output)
    beats = split * length / math.tau
    definition = f"amplitude at rest at {split / math.tau:.4g} Hz, the difference of the resonances"
    made = Result("ripple", "Ripple at the split", definition, DEG_PER_S.name, math.nan)
    if scenario.trim.tuning != "fixed":
        return [replace(made, definition="amplitude at rest", note="not available: a trim moves the resonances")]
    if beats < MIN_BEATS or split * interval > MAX_PHASE:
        reason = "the record has fewer than 20 periods of it" if beats < MIN_BEATS else "it is sampled too seldom"
        return [replace(made, note=f"not available: {reason}")]
    nearby = [_amplitude(output, interval * (split + math.tau * k / length)) for k in (-6, -5, -4, 4, 5, 6)]
    value, floor = _amplitude(output, interval * split), math.sqrt(sum(each * each for each in nearby) / len(nearby))
    below = f"not above noise: {DEG_PER_S.of(floor):.3g} deg/s at frequencies next to it" if value < 3 * floor else ""
    return [replace(made, value=DEG_PER_S.of(value), note=below)]


def _amplitude(output: Array, phase: float) -> float:
    """Amplitude of the sine that advances by this phase a sample, by least squares with a line."""
    n = np.arange(len(output))
    columns = np.stack([np.ones(len(n)), n / len(n), np.cos(phase * n), np.sin(phase * n)], axis=1)
    fit = np.linalg.lstsq(columns, output, rcond=None)[0]
    return float(np.hypot(fit[2], fit[3]))


@dataclass(frozen=True)
class AngleDrift:
    """Rate of a whole-angle gyroscope at 300 deg/s over the angle of its line, and its fit.

    rate = mean + cosine cos 2 angle + sine sin 2 angle, rad and rad/s.
    """

    angle: Array
    rate: Array
    mean: float
    cosine: float
    sine: float
    noise: float  #: RMS, rad, of the angle about its mean rate and this drift

    def fitted(self, angle: Array) -> Array:
        """The fit at these angles."""
        return np.asarray(self.mean + self.cosine * np.cos(2 * angle) + self.sine * np.sin(2 * angle))


def angle_drift(sensor: Sensor) -> AngleDrift | None:
    """The drift against the angle, from a run of one seed; None with other controllers."""
    if sensor.scenario.controller.kind != "whole_angle" or sensor.controller is not None:
        return None
    angle, rate = sensor.angle_and_rate(RANGE)
    columns = np.stack([np.ones_like(angle), np.cos(2 * angle), np.sin(2 * angle)], axis=1)
    turning = np.column_stack([columns, np.arange(len(angle))])
    left = angle - turning @ np.linalg.lstsq(turning, angle, rcond=None)[0]
    mean, cosine, sine = map(float, np.linalg.lstsq(columns, rate, rcond=None)[0])
    return AngleDrift(angle, rate, mean, cosine, sine, noise=float(np.sqrt((left**2).mean())))


def angle_figures(found: AngleDrift | None) -> list[Result]:
    """Drift against the angle, lock-in, resolution of the angle and gain of the rate; none without such a drift."""
    if found is None:
        return []
    turned = abs(float(found.angle[-1] - found.angle[0])) / math.pi
    few = "" if turned >= 1.0 else f"the line turned by {turned:.2g} half turns only: parts of it are not separated"
    phase = 0.5 * math.atan2(found.cosine, -found.sine)
    drift = DEG_PER_H.of(math.hypot(found.cosine, found.sine))
    return [
        Result(
            "angle_drift",
            "Drift against the angle",
            "amplitude p of −p sin 2(ϑ − ϑτ) in the rate at 300 deg/s, ϑ the angle of the line of vibration",
            DEG_PER_H.name,
            drift,
            note="; ".join(filter(None, (f"ϑτ = {math.degrees(phase):.4g} deg", few))),
        ),
        Result(
            "lock_in",
            "Lock-in",
            "magnitude of the whole rate, with controller.virtual_rate, below which the line comes to rest: p",
            DEG_PER_H.name,
            drift,
            note=few,
        ),
        Result(
            "angle_resolution",
            "Resolution of the angle",
            "RMS of the angle of the line at 300 deg/s about its mean rate and its drift, sample by sample",
            ARCSECOND.name,
            ARCSECOND.of(found.noise),
        ),
        Result(
            "rate_gain",
            "Gain of the rate",
            "mean rate over 300 deg/s, without that drift",
            "1",
            found.mean / RANGE,
            note=few or f"{DEG_PER_S.of(found.mean):.6g} deg/s",
        ),
    ]
