"""Clauses 12.6 and 12.8 of IEEE Std 1431: bias and scale factor over the temperature, hysteresis and warm-up.

A device takes seconds to hours to warm, and a run lasts about a second: outputs are those at constant temperatures.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import mean_interval
from ..scenario import Scenario
from ..scenario.device import GAIN_DRIFTS, MATRIX_DRIFTS
from .procedures import Row, Sheet, mean_of
from .runs import RANGE
from .sensor import Sensor
from .units import DEG_PER_H, PPM

Array = NDArray[np.float64]

TEMPERATURES = np.array([-40.0, -20.0, 0.0, 20.0, 40.0])  # K
ORDER = 3  # degree of the polynomial over the temperature
SETTLED = 0.1  # share of the change of a warm-up that may be left
DRIFTS = ("stiffness_drift", "frequency_temperature_coefficient", "damping_drift", *MATRIX_DRIFTS, *GAIN_DRIFTS)


def temperature(sheet: Sheet, sensor: Sensor) -> None:
    """Clause 12.8: bias and scale factor at constant temperatures; the loop of the bias by hysteresis."""
    names = (
        ("zero_rate_per_kelvin", "Zero-rate output over temperature", "deg/h/K"),
        ("zero_rate_residual", "… left of it by a polynomial of third order", "deg/h"),
        ("scale_per_kelvin", "Scale factor over temperature", "ppm/K"),
        ("temperature_hysteresis", "Hysteresis of the zero-rate output", "deg/h"),
    )
    varied = f"temperature, {TEMPERATURES[0]:g} to {TEMPERATURES[-1]:g} K from nominal; rates 0 and 300 deg/s"
    if not _drifts(sensor.scenario):
        for key, name, unit in names:
            sheet.missing("12.8", key, name, varied, unit, "nothing of [device] drifts with the temperature")
        return
    bias, scale = [], []
    for kelvin in TEMPERATURES:
        still, turning = (mean_of(sensor.output(rate, changes=at(float(kelvin)))) for rate in (0.0, RANGE))
        sheet.outputs("12.8", "temperature, at rest", "temperature (K)", float(kelvin), still)
        sheet.outputs("12.8", "temperature, at 300 deg/s", "temperature (K)", float(kelvin), turning)
        bias.append(still)
        scale.append((turning - still) / RANGE)
    offsets, factors = np.array(bias), np.array(scale)
    slopes = np.polyfit(TEMPERATURES, offsets, 1)[0]
    sheet.mean("12.8", *names[0][:2], varied, replace(DEG_PER_H, name="deg/h/K"), mean_interval(slopes))
    fitted = np.polyfit(TEMPERATURES, offsets.mean(axis=1), ORDER)
    left = offsets.mean(axis=1) - np.polyval(fitted, TEMPERATURES)
    sheet.rows.append(Row("12.8", *names[1][:2], varied, "deg/h", DEG_PER_H.of(float(abs(left).max()))))
    slopes = np.polyfit(TEMPERATURES, factors, 1)[0]
    sheet.mean("12.8", *names[2][:2], varied, replace(PPM, name="ppm/K"), mean_interval(slopes))
    _hysteresis(sheet, sensor, *names[3])


def _hysteresis(sheet: Sheet, sensor: Sensor, key: str, name: str, unit: str) -> None:
    """Width of the loop of the bias: at one temperature, reached from below, that follows it is lower, and higher."""
    width = float(sensor.scenario.device.hysteresis)
    varied = "temperature, up and down by more than the backlash: difference at one temperature"
    if not width:
        sheet.missing("12.8", key, name, varied, unit, "device.hysteresis is 0")
        return
    outputs = []
    for kelvin in (-width, width):
        outputs.append(mean_of(sensor.output(0.0, changes=at(kelvin))))
        sheet.outputs("12.8", "hysteresis", "temperature that drifts follow (K)", kelvin, outputs[-1])
    sheet.mean("12.8", key, name, varied, DEG_PER_H, mean_interval(outputs[1] - outputs[0]))


def warm_up(sheet: Sheet, sensor: Sensor) -> None:
    """Clause 12.6: change of the bias by the warm-up, and the time until a tenth of it is left."""
    names = (
        ("warm_up_change", "Change of the zero-rate output by the warm-up", "deg/h"),
        ("warm_up", "Warm-up time", "s"),
    )
    varied = "time after power on; outputs at constant temperatures"
    device = sensor.scenario.device
    if not device.warm_up_rise or not _drifts(sensor.scenario):
        why = "nothing of [device] drifts with the temperature" if device.warm_up_rise else "device.warm_up_rise is 0"
        for key, name, unit in names:
            sheet.missing("12.6", key, name, varied, unit, why)
        return
    shares, outputs = np.array([0.0, 0.5, 1.0]), []
    for share in shares:
        outputs.append(mean_of(sensor.output(0.0, changes=at(float(share * device.warm_up_rise)))))
        warmer = float(share * device.warm_up_rise)
        sheet.outputs("12.6", "warm-up", "temperature above that at power on (K)", warmer, outputs[-1])
    sheet.mean("12.6", *names[0][:2], varied, DEG_PER_H, mean_interval(outputs[-1] - outputs[0]))
    time = warm_up_time(shares, np.array([means.mean() for means in outputs]), device.warm_up_time)
    note = f"until {SETTLED:.0%} of the change is left"
    sheet.rows.append(Row("12.6", *names[1][:2], varied, "s", time, note=note))


def warm_up_time(shares: Array, outputs: Array, constant: float) -> float:
    """Time, s, after which the output differs from its last by `SETTLED` of its change at most.

    `outputs` at three `shares` of the rise, which is exponential with the time constant, in s.
    """
    time = np.linspace(0.0, 20 * constant, 200_001)
    course = np.polyval(np.polyfit(shares, outputs, 2), -np.expm1(-time / constant))
    away = abs(course - outputs[-1]) > SETTLED * abs(outputs[-1] - outputs[0])
    return float(time[np.flatnonzero(away)[-1] + 1]) if away.any() else math.nan


def at(kelvin: float) -> dict[str, Any]:
    """Changes with which the device has this temperature, from nominal, throughout."""
    points = ((0.0, kelvin),)
    still = {"temperature_ramp": 0.0, "temperature_points": points, "warm_up_rise": 0.0, "hysteresis": 0.0}
    return {f"device.{name}": value for name, value in still.items()}


def _drifts(scenario: Scenario) -> bool:
    return any(np.any(getattr(scenario.device, name)) for name in DRIFTS)
