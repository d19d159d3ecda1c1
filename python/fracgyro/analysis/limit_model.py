"""A scenario as a sampled linear plant in white noise, and the force along its reference, for the limit of tracking.

Nondimensional. Scenarios with another plant or noise are refused. Effects that could only raise the limit are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from .. import _core
from ..scenario import Scenario, ScenarioError
from ..scenario.device import CUBIC, GAIN_DRIFTS, MATRIX_DRIFTS
from ..scenario.device_core import device_values, sensor_variance
from ..scenario.disturbance import named_entries
from ..scenario.linear import LINEAR, continuous
from ..scenario.schema import HOLD_TOLERANCE
from ..scenario.table import toml_value
from ..scenario.to_core import core_setup
from ..scenario.volts_core import has_volts

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
MAX_SAMPLES = 10_000  # at which the force along the reference is evaluated


@dataclass(frozen=True)
class Model:
    """x' = advance x + force u(delay steps ago) + d, y = sensed x + noise, for x = [position, velocity]."""

    advance: Array  # (4, 4)
    force: Array  # (4, 2)
    process: Array  # covariance of d, (4, 4)
    sensed: Array  # (2 or 4, 4)
    noise: Array  # covariance of the sensors' noise
    delay: int
    force_limit: float

    @classmethod
    def of(cls, scenario: Scenario) -> Model:
        """Raises ScenarioError for a scenario that is not linear, stationary and in white noise."""
        _check(scenario)
        step, device = scenario.run.step, device_values(scenario)
        whole = np.zeros((6, 6))
        whole[:4, :4], whole[:4, 4:] = continuous(scenario)
        whole = expm(whole * step)
        advance, held = whole[:4, :4], whole[:4, 4:]
        axes = _turned(device["pickoff_misalignment"]).T * (1.0 + np.array(device["pickoff_gain_error"]))[:, np.newaxis]
        pushed = _turned(device["force_misalignment"]) * (1.0 + np.array(device["force_gain_error"]))
        quantities = ("position",) if scenario.device.sensing == "position" else ("position", "velocity")
        return cls(
            advance,
            held @ pushed,
            held @ held.T * _force_variance(scenario),
            np.asarray(np.kron(np.eye(2), axes)[: 2 * len(quantities)], dtype=float),
            np.diag(np.concatenate([sensor_variance(device, of) for of in quantities])),
            int(device["delay"]),
            min(float(scenario.controller.force_limit), float(device["actuator_limit"])),
        )


@dataclass(frozen=True)
class Feedforward:
    """The force that keeps the plant on the reference, by axis, in steady state."""

    rms: Array
    second_difference: Array  # RMS
    peak: Array

    @classmethod
    def of(cls, scenario: Scenario, model: Model, transient: float) -> Feedforward:
        """For sines over all time, for other references over the run from the time `transient` on.

        Raises ScenarioError if the force limit is below it.
        """
        lines = _lines(scenario)
        found = cls._of_run(scenario, model, transient) if lines is None else cls._of_lines(scenario, model, lines)
        if found.peak.max() > model.force_limit:
            limited = "controller.force_limit" if scenario.controller.force_limit == model.force_limit else ""
            unit = 1.0 if limited else scenario.plant.scales.force
            raise ScenarioError(
                f"{limited or 'device.actuator_limit'} is {model.force_limit * unit:g}: it must be at least "
                f"{found.peak.max() * unit:.4g}, the force that the reference needs, for a limit of tracking"
            )
        return found

    @classmethod
    def _of_lines(cls, scenario: Scenario, model: Model, lines: dict[float, Complex]) -> Feedforward:
        """Exactly, from the response of the sampled plant at each frequency."""
        step, mean, second = scenario.run.step, np.zeros(2), np.zeros(2)
        frequencies, phasors = np.array(list(lines)), np.zeros((len(lines), 2), complex)
        for place, (frequency, position) in enumerate(lines.items()):
            turn = np.exp(1j * frequency * step)
            # Motion and force at once: at a resonance without damping the plant has no response, but its inverse does.
            system = np.block([[turn * np.eye(4) - model.advance, -model.force], [np.eye(2, 6)]])
            phasors[place] = np.linalg.solve(system, np.concatenate([np.zeros(4), position]))[4:]
            square = np.abs(phasors[place]) ** 2 * (0.5 if frequency else 1.0)
            mean += square
            second += square * abs(turn - 1.0) ** 4
        steps = np.linspace(0, scenario.run.steps, min(scenario.run.steps, MAX_SAMPLES) + 1).round()
        forces = np.real(np.exp(1j * step * np.outer(steps, frequencies)) @ phasors)
        return cls(np.sqrt(mean), np.sqrt(second), np.abs(forces).max(axis=0))

    @classmethod
    def _of_run(cls, scenario: Scenario, model: Model, transient: float) -> Feedforward:
        """From the held force that has the reference's velocity after each step: its mean over the step."""
        first = first_steady(scenario, transient)
        count = min(scenario.run.steps + 1, first + MAX_SAMPLES)
        r = reference(scenario, count)
        if count - first < 4:
            r, first = reference(scenario, max(count, 4)), 0
        change = r[first + 1 :, 2:] - r[first:-1] @ model.advance[2:].T
        forces = np.linalg.solve(model.force[2:], change.T).T
        second = np.diff(forces, 2, axis=0)
        rms, changes = (np.sqrt((each**2).mean(axis=0)) for each in (forces, second))
        return cls(rms, changes, np.abs(forces).max(axis=0))


def reference(scenario: Scenario, count: int) -> Array:
    """Position and velocity of the reference at the first samples, (count, 4)."""
    plain = scenario.replace({"controller.kind": "pid"})  # unused; needs no kernel design
    return np.array(_core.reference(core_setup(plain), count, 1))[:, :4]


def first_steady(scenario: Scenario, transient: float) -> int:
    """The first sample at or after the time `transient`; one past the last if there is none."""
    return int(np.searchsorted(np.arange(scenario.run.steps + 1) * scenario.run.step, transient))


def assumptions(scenario: Scenario) -> list[str]:
    """Statements about the scenario on which its limit rests."""
    device = scenario.device
    found = ["plant, noise, delay and reference are known", "the force limit acts in the transient only"]
    if device.position_bits or (device.velocity_bits and device.sensing == "full"):
        found.append("steps of converters of the sensors are white noise")
    if _lines(scenario) is None:
        found.append("the reference can be followed exactly: what its jumps leave is left out")
    left_out = {
        "flicker noise of the sensors": device.position_noise_corner or device.velocity_noise_corner,
        "steps of the actuator's converter": device.actuator_bits,
        "what electrodes and electronics do beyond softening and noise": has_volts(scenario),
        "ranges of the sensors": np.isfinite([*device.position_range, *device.velocity_range]).any(),
    }
    return found + [f"{name} could only raise it: left out" for name, on in left_out.items() if on]


def _check(scenario: Scenario) -> None:
    plant, device = scenario.plant, scenario.device
    if plant.kind not in LINEAR:
        raise _refused("plant.kind", plant.kind, " or ".join(LINEAR), "the linear plants with two axes")
    for field in ("tuning", "quadrature"):
        if (value := getattr(scenario.trim, field)) != "fixed":
            raise _refused(f"trim.{field}", value, "fixed", "a stationary plant")
    if scenario.rate.kind != "constant":
        raise _refused("rate.kind", scenario.rate.kind, "constant", "a stationary plant")
    if scenario.rate.transverse_points is not None:
        raise _refused("rate.transverse_points", "given", "left out", "a stationary plant")
    varying = (*CUBIC, "stiffness_drift", "frequency_temperature_coefficient", "damping_drift")
    for field in (*varying, *MATRIX_DRIFTS, *GAIN_DRIFTS, "bias_instability", "rate_random_walk"):
        if np.any(value := getattr(device, field)):
            reason = "a linear plant" if field in CUBIC else "a stationary plant"
            raise _refused(f"device.{field}", value, toml_value(type(device).model_fields[field].default), reason)


def _force_variance(scenario: Scenario) -> float:
    """Variance of the disturbance, which is white from step to step, and of the quieter of the drivers."""
    total, step = float(min(device_values(scenario)["drive_noise"])) ** 2, scenario.run.step
    for name, entry in named_entries(scenario.disturbance):
        if entry.kind == "none":
            continue
        if entry.kind != "noise":
            raise _refused(f"{name}.kind", entry.kind, "none or noise", "white noise, as nothing else is unknowable")
        if entry.band is not None:
            raise _refused(f"{name}.band", entry.band, "left out", "white noise")
        if entry.start > 0.0 or entry.end < math.inf:
            field, value = ("start", entry.start) if entry.start > 0.0 else ("end", entry.end)
            raise _refused(f"{name}.{field}", value, "left out", "noise that does not change over time")
        if entry.hold is not None and abs(entry.hold - step) > HOLD_TOLERANCE * step:
            raise _refused(f"{name}.hold", entry.hold, f"run.step, {step:g}", "white noise")
        total += entry.density / step if entry.density is not None else float(entry.standard_deviation or 0.0) ** 2
    return total


def _refused(field: str, value: Any, wanted: str, reason: str) -> ScenarioError:
    shown = value if isinstance(value, str) else toml_value(value)
    return ScenarioError(f"{field} is {shown}: it must be {wanted} for a limit of tracking, which assumes {reason}")


def _turned(angle: float) -> Array:
    """Axes turned counter-clockwise: their directions as columns."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def _lines(scenario: Scenario) -> dict[float, Complex] | None:
    """Frequencies and phasors of the reference, Re(phasor e^(j w t)); None if it is not a sum of sines."""
    r = scenario.reference
    found: dict[float, Complex] = {0.0: np.array(r.offset, complex)}
    for axis, kind in enumerate(r.kinds):
        if kind not in ("sine", "sines", "rest"):
            return None
        of_sine = [(r.amplitude[axis], r.frequency[axis], r.phase[axis])] if kind == "sine" else []
        of_sum = [(t.amplitude[axis], t.frequency[axis], t.phase[axis]) for t in r.terms or ()]
        for amplitude, frequency, phase in of_sum if kind == "sines" else of_sine:
            phasor = -1j * amplitude * np.exp(1j * phase)  # a sin(w t + p) = Re(-j a e^(j p) e^(j w t))
            phasor = phasor.real if frequency == 0.0 else phasor.conjugate() if frequency < 0.0 else phasor
            found.setdefault(abs(frequency), np.zeros(2, complex))[axis] += phasor
    return found
