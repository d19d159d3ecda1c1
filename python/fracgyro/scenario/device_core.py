"""The tables [rate] and [device] as the core's numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .device import GAIN_DRIFTS, MATRIX_DRIFTS, Device
from .kinds import DEVICE_CHANNELS, VOLTS_CHANNELS, Channel
from .points import Points
from .scenario import Scenario
from .volts_core import NO_ELECTRODES, at_bias, drive, drive_noise, has_volts

IDEAL = Device()


def is_ideal(scenario: Scenario) -> bool:
    """True if the rate is constant and the device ideal, and the controller receives the measurements themselves."""
    c = scenario.controller
    known = scenario.datasheet
    corrected = any(known.pickoff_gain_error) or known.pickoff_misalignment
    around = c.event_threshold or c.event_share or c.compensation_bandwidth
    plain = bool(c.filter == "none" and not around and not corrected)
    still = scenario.rate.kind == "constant" and scenario.rate.transverse_points is None
    return plain and still and scenario.device == IDEAL and not has_volts(scenario)


def device_channels(*scenarios: Scenario) -> tuple[Channel, ...]:
    """The channels that devices add to those of the controllers: none if all are ideal."""
    in_volts = any(scenario.electrodes != NO_ELECTRODES for scenario in scenarios)
    return () if all(map(is_ideal, scenarios)) else (*DEVICE_CHANNELS, *(VOLTS_CHANNELS if in_volts else ()))


def rate_values(scenario: Scenario) -> dict[str, Any]:
    """Nondimensional values of the core's table rate."""
    rate, scale = scenario.rate, scenario.plant.scales.rate
    step = scenario.run.step * scenario.plant.scales.time  # s
    values = {
        "kind": "staircase" if rate.kind == "step" else rate.kind,
        "amplitude": (rate.amplitude or 0.0) / scale,
        "frequency": rate.frequency / scale,
        "final_frequency": rate.final_frequency / scale,
        "seed": rate.seed,
        "inertial": scenario.plant.centrifugal,
    }
    if rate.kind not in ("constant", "table"):
        values["start_steps"] = round(rate.start / step)
    if rate.kind == "staircase" and rate.hold is not None:
        values |= {"hold_steps": round(rate.hold / step), "levels": rate.levels}
    return values


def device_values(scenario: Scenario) -> dict[str, Any]:
    """Nondimensional values of the core's table device."""
    d, scales, step = scenario.device, scenario.plant.scales, scenario.run.step
    # A one-sided density up to half the sampling frequency.
    to_deviation = math.sqrt(0.5 / (step * scales.time))
    position_noise = (d.position_noise or d.position_noise_density * to_deviation) / scales.length
    velocity_noise = (d.velocity_noise or d.velocity_noise_density * to_deviation) / scales.velocity
    # A white density N up to the corner f_c is that of flicker noise A^2/omega at f_c: A = N sqrt(pi f_c).
    to_flicker = math.sqrt(2 * math.pi * step * scales.time)
    cubic = scales.length * scales.length / scales.stiffness
    volts = {"amplifier_noise": (0.0, 0.0), "drive_limit": (math.inf, math.inf)}
    volts |= {"drive_step": (0.0, 0.0), "drive_noise": (0.0, 0.0)}
    if has_volts(scenario):
        (noise_x, noise_y), (most, steps) = at_bias(scenario).noise, drive(scenario)
        volts["amplifier_noise"] = (to_deviation * noise_x / scales.length, to_deviation * noise_y / scales.length)
        volts["drive_limit"] = (most[0] / scales.force, most[1] / scales.force)
        volts["drive_step"] = (steps[0] / scales.force, steps[1] / scales.force)
        driven_x, driven_y = drive_noise(scenario)
        volts["drive_noise"] = (to_deviation * driven_x / scales.force, to_deviation * driven_y / scales.force)
    return (
        dict(vars(d))
        | volts
        | {
            "position_noise": position_noise,
            "velocity_noise": velocity_noise,
            "position_flicker": position_noise * to_flicker * math.sqrt(d.position_noise_corner),
            "velocity_flicker": velocity_noise * to_flicker * math.sqrt(d.velocity_noise_corner),
            "position_range": [reach / scales.length for reach in d.position_range],
            "velocity_range": [reach / scales.velocity for reach in d.velocity_range],
            "actuator_limit": d.actuator_limit / scales.force,
            "cubic_stiffness": [kappa * cubic for kappa in d.cubic_stiffness],
            "cubic_coupling": d.cubic_coupling * cubic,
            "cubic_skew": [kappa * cubic for kappa in d.cubic_skew],
            "stiffness_drift": 1e-6 * d.stiffness_coefficient,
            "damping_drift": 1e-6 * d.damping_drift,
            **{name: np.multiply(1e-6, getattr(d, name)).tolist() for name in (*MATRIX_DRIFTS, *GAIN_DRIFTS)},
            "bias_instability": d.bias_instability / scales.rate,
            "rate_walk_step": d.rate_random_walk * math.sqrt(step * scales.time) / scales.rate,
        }
    )


def sensor_variance(device: Mapping[str, Any], quantity: str) -> NDArray[np.float64]:
    """Variance per sample of a sensor of position or velocity, [x, y]: white noise, and a converter's steps as such.

    `device`: from `device_values`. Flicker noise is left out.
    """
    bits, spans = device[f"{quantity}_bits"], np.array(device[f"{quantity}_range"])
    steps = 2.0 * spans / 2.0**bits if bits else np.zeros(2)
    amplifiers = np.array(device["amplifier_noise"]) if quantity == "position" else np.zeros(2)
    return np.asarray(device[f"{quantity}_noise"] ** 2 + amplifiers**2 + steps**2 / 12)


def transverse_list(scenario: Scenario) -> list[float]:
    """The angular rates about x and y over time, as `take_transverse` in settings.hpp reads them; none if constant."""
    points, scales = scenario.rate.transverse_points, scenario.plant.scales
    if points is None:
        return []
    step = scenario.run.step * scales.time
    times, x, y = zip(*points, strict=True)
    rates = [each / scales.rate for each in (*scenario.plant.transverse_rate, *x, *y)]
    return [*rates[:2], *(time / step for time in times), *rates[2:]]


Profile = tuple[list[float], list[float]]  # times, in steps of the run, and values


def profiles(scenario: Scenario) -> tuple[Profile, Profile]:
    """Points of the rate, nondimensional, and of the change of temperature, K; none where the rate has no table."""
    scales = scenario.plant.scales
    step = scenario.run.step * scales.time

    def profile(points: Points, scale: float) -> Profile:
        return [time / step for time, _ in points], [value * scale for _, value in points]

    end = scenario.run.duration * scales.time
    return profile(scenario.rate.points or (), 1 / scales.rate), profile(scenario.device.temperature(end), 1.0)
