"""Clauses 12.11 and 12.17 of IEEE Std 1431: bias by constant accelerations, vibrations and shocks.

An acceleration of the frame drives each mode by `device.acceleration_share`. Runs with and without it have the same
noise, so that their difference has little of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import mean_interval
from ..scenario.volts_core import plant_at_bias
from .procedures import Row, Sheet, mean_of
from .sensor import Output, Sensor
from .units import DEG_PER_H, DEG_PER_S, Unit

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2
AXES = ("x", "y")
FREQUENCIES = (20.0, 100.0, 500.0, 1000.0, 2000.0)  # Hz, and NEAR times those of the modes
NEAR = 0.97
DENSITY = 0.01  # g^2/Hz, of the random vibration
BAND = (20.0, 2000.0)  # Hz
SHOCK, LASTS = 50.0, 1e-3  # g and s, a half-sine
DEG_PER_H_PER_G = Unit("deg/h/g", "rad/s", DEG_PER_H.per_si)
DEG_PER_H_PER_G2 = Unit("deg/h/g²", "rad/s", DEG_PER_H.per_si)
DEGREES = Unit("deg", "rad", math.degrees(1.0))
ROWS = (
    *(("12.11", f"g_sensitivity_{axis}", f"Bias by acceleration along {axis}", DEG_PER_H_PER_G) for axis in AXES),
    *(("12.11", f"g_squared_{axis}", f"… second order, along {axis}", DEG_PER_H_PER_G2) for axis in AXES),
    *(("12.17", f"sine_vibration_{axis}", f"Rectified vibration along {axis}", DEG_PER_H_PER_G2) for axis in AXES),
    *(("12.17", f"sine_ripple_{axis}", f"Output by a vibration along {axis}, RMS", DEG_PER_S) for axis in AXES),
    ("12.17", "random_vibration", "Output by a random vibration, RMS", DEG_PER_S),
    *(("12.17", f"shock_{axis}", f"Angle after a shock along {axis}", DEGREES) for axis in AXES),
)


def accelerations(sheet: Sheet, sensor: Sensor) -> None:
    """The rows of both clauses; "not in the scenario" if it states no share of an acceleration on the modes."""
    varied = _varied(sensor)
    if sensor.scenario.device.acceleration_share is None:
        for clause, key, name, unit in ROWS:
            sheet.missing(clause, key, name, varied[key], unit.name, "device.acceleration_share is not set")
        return
    still = sensor.output(0.0)
    procedures = {"12.11": _constant, "sine": _sines, "random": _random, "shock": _shocks}
    found: dict[str, Array] = {}
    failed: dict[str, str] = {}
    for name, procedure in procedures.items():
        try:
            found |= procedure(sheet, sensor, still)
        except ValueError as error:
            failed[name] = str(error)
    for clause, key, name, unit in ROWS:
        if key in found:
            sheet.mean(clause, key, name, varied[key], unit, mean_interval(found[key]))
        else:
            note = next(text for part, text in failed.items() if clause == part or key.startswith(part))
            sheet.rows.append(Row(clause, key, name, varied[key], unit.name, note=note))


def _varied(sensor: Sensor) -> dict[str, str]:
    """Quantity that is varied, by key of the row."""
    sines = f"1 g at {', '.join(f'{each:.4g}' for each in _frequencies(sensor))} Hz"
    found = {"random_vibration": f"{DENSITY:g} g²/Hz from {BAND[0]:g} to {BAND[1]:g} Hz along x and y, independent"}
    for axis in AXES:
        found |= dict.fromkeys((f"g_sensitivity_{axis}", f"g_squared_{axis}"), f"±1 g along {axis}")
        found |= dict.fromkeys((f"sine_vibration_{axis}", f"sine_ripple_{axis}"), f"{sines}: the largest")
        found[f"shock_{axis}"] = f"half-sine of {SHOCK:g} g and {1e3 * LASTS:g} ms, integral of what it changes"
    return found


def _frequencies(sensor: Sensor) -> list[float]:
    """Frequencies of the sinusoidal vibrations, Hz, as far as the step can follow them."""
    plant, scenario = plant_at_bias(sensor.scenario), sensor.scenario
    modes = [math.sqrt(k / plant.mass) / math.tau for k in (plant.stiffness.xx, plant.stiffness.yy)]
    highest = 0.1 / (scenario.run.step * scenario.plant.scales.time)
    return sorted(each for each in {*FREQUENCIES, *(NEAR * mode for mode in modes)} if each < highest)


def _along(axis: int, size: float) -> tuple[float, float]:
    return (size, 0.0) if axis == 0 else (0.0, size)


def _output(sensor: Sensor, **entry: Any) -> Output:
    """Output at rest with one more disturbance, of the accelerations of this entry."""
    tables: list[dict[str, Any]] = [
        each.model_dump(exclude_unset=True, exclude={"added"}) for each in sensor.scenario.disturbance.entries
    ]
    if not {"kind", "standard_deviation", "density"} & set(tables[0]):
        tables[0]["standard_deviation"] = sensor.scenario.disturbance.standard_deviation
    return sensor.output(0.0, changes={"disturbance": [*tables, {"quantity": "acceleration", **entry}]})


def _constant(sheet: Sheet, sensor: Sensor, still: Output) -> dict[str, Array]:
    """Coefficients of a parabola through the biases at -1, 0 and 1 g."""
    g, found = GRAVITY / sensor.scenario.plant.scales.acceleration, {}
    middle = mean_of(still)
    for axis, name in enumerate(AXES):
        ends = []
        for sign in (-1.0, 1.0):
            ends.append(mean_of(_output(sensor, kind="step", amplitude=_along(axis, -sign * g))))
            sheet.outputs("12.11", "constant acceleration", f"acceleration along {name} (g)", sign, ends[-1])
        found[f"g_sensitivity_{name}"] = (ends[1] - ends[0]) / 2
        found[f"g_squared_{name}"] = (ends[1] + ends[0]) / 2 - middle
    return found


def _sines(sheet: Sheet, sensor: Sensor, still: Output) -> dict[str, Array]:
    """Change of the mean, and RMS of what a vibration of 1 g adds, each at its worst frequency."""
    scales, found = sensor.scenario.plant.scales, {}
    g = GRAVITY / scales.acceleration
    for axis, name in enumerate(AXES):
        rectified, ripple = [], []
        for hertz in _frequencies(sensor):
            frequency = math.tau * hertz * scales.time
            moved = _output(sensor, kind="sine", amplitude=_along(axis, g), frequency=(frequency, frequency))
            change = moved.settled().rate - still.settled().rate
            rectified.append(change.mean(axis=1))
            ripple.append(change.std(axis=1))
            sheet.outputs("12.17", f"sinusoidal vibration along {name}", "frequency at 1 g (Hz)", hertz, mean_of(moved))
        found[f"sine_vibration_{name}"] = _largest(rectified)
        found[f"sine_ripple_{name}"] = _largest(ripple)
    return found


def _largest(values: Sequence[Array]) -> Array:
    """The values of all runs at that frequency at which their mean is the largest."""
    return max(values, key=lambda each: abs(float(each.mean())))


def _random(sheet: Sheet, sensor: Sensor, still: Output) -> dict[str, Array]:
    scales = sensor.scenario.plant.scales
    low, high = (math.tau * each * scales.time for each in BAND)
    density = DENSITY * (GRAVITY / scales.acceleration) ** 2 / (math.tau * scales.time)
    moved = _output(sensor, kind="vibration", psd=((low, density), (high, density)))
    sheet.outputs("12.17", "random vibration", "density (g²/Hz)", DENSITY, mean_of(moved))
    return {"random_vibration": (moved.settled().rate - still.settled().rate).std(axis=1)}


def _shocks(sheet: Sheet, sensor: Sensor, still: Output) -> dict[str, Array]:
    """Integral, from a shock in the middle of the run to its end, of the output that it changes."""
    run, scales = sensor.scenario.run, sensor.scenario.plant.scales
    size, found = SHOCK * GRAVITY / scales.acceleration, {}
    for axis, name in enumerate(AXES):
        shock = {"start": run.duration / 2, "width": LASTS / scales.time, "amplitude": _along(axis, size)}
        moved = _output(sensor, kind="pulse", **shock)
        change = moved.rate - still.rate
        found[f"shock_{name}"] = moved.interval * change.sum(axis=1)
        sheet.outputs("12.17", f"shock along {name}", "peak (g)", SHOCK, mean_of(moved))
    return found
