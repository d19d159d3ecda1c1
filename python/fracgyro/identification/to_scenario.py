"""The scenario of an identified device, and its TOML with intervals and sources as comments.

Plant axes are those of the pick-offs, as the records see them; or the principal axes of the stiffness, which the
pick-offs and the actuators are then turned against. Both are the same device.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from ..arguments import short
from ..devices.commented import commented
from ..devices.shipped_like import TEMPERATURE, Linear, like, timing, whole_steps
from ..scenario import Scenario
from .first_stage import Fitted
from .quantity import Quantity
from .results import Results

Axes = Literal["pickoffs", "principal"]

SLOWEST_RATE = math.radians(10.0)  # rad/s: a smaller identified rate is not a full scale
INSIDE = 0.999  # times the largest coupling damping that D >= 0 allows

# Field of the scenario: quantities that it comes from.
SOURCES = {
    "plant.stiffness": ("kxx", "kxy", "kyy"),
    "plant.damping": ("dxx", "dxy", "dyy"),
    "plant.angular_rate": ("rate",),
    "device.pickoff_gain_error": ("pickoff_ratio",),
    "datasheet.pickoff_gain_error": ("pickoff_ratio",),
    "device.force_misalignment": ("beta",),
    "device.cubic_stiffness": ("cubic_x", "cubic_y"),
    "reference.frequency": ("frequency_1", "frequency_2"),
}


def base_name(found: Results) -> str:
    """The shipped scenario whose controller the identified device takes, by its quality factors."""
    losses = [each for name, each in found.items() if name.startswith("quality_") and each.determined]
    quality = [each.value for each in losses] or [1e4]
    return like(min(quality), max(quality))


def scenario_of(found: Results, axes: Axes = "pickoffs") -> Scenario:
    """The identified device in the shipped scenario that is most like it, in these axes.

    Raises ValueError for other axes, or if the principal axes are not known.
    """
    if axes not in ("pickoffs", "principal"):
        raise ValueError(f"axes is {short(axes)}: it must be pickoffs or principal")
    if axes == "principal" and not ("kxy" in found and found["kxy"].determined):
        raise ValueError("axes is principal: these records do not determine kxy, so it must be pickoffs")
    base = Scenario.shipped(base_name(found))
    return base.replace(_changes(found, base, axes))


def principal(plant: Linear) -> tuple[Linear, float]:
    """The device in the principal axes of its stiffness, and the angle to the nearest of them from x, rad."""
    xx, xy, yy = plant.stiffness
    angle = 0.5 * math.atan2(2 * xy * math.copysign(1.0, xx - yy), abs(xx - yy))
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])

    def turned(entries: tuple[float, float, float]) -> tuple[float, float, float]:
        (one, coupling), (_, other) = (turn.T @ np.array([entries[:2], entries[1:]]) @ turn).tolist()
        return one, coupling, other

    kxx, _, kyy = turned(plant.stiffness)
    return replace(plant, stiffness=(kxx, 0.0, kyy), damping=turned(plant.damping)), angle


def _changes(found: Results, base: Scenario, axes: Axes) -> dict[str, Any]:
    mass = found.known.mass or 1.0
    k = {name: _rounded(found, name) for name in ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy")}
    if k["kyy"] is None:  # one pick-off: the other axis is that of the shipped scenario, scaled
        shipped = base.plant
        k["kyy"] = float(k["kxx"] or 1.0) * shipped.stiffness.yy / shipped.stiffness.xx
        k["dyy"] = float(k["dxx"] or 1.0) * shipped.damping.yy / shipped.damping.xx
    kxx, kyy, dxx, dyy = (abs(float(k[name] or 0.0)) for name in ("kxx", "kyy", "dxx", "dyy"))
    kxy = float(k["kxy"] or 0.0)
    limit = INSIDE * math.sqrt(dxx * dyy)
    dxy = min(max(float(k["dxy"] or 0.0), -limit), limit)
    linear = Linear(mass, (kxx, kxy, kyy), (dxx, dxy, dyy), _length(found, base))
    drive = found.get("beta")
    pushed = math.radians(drive.value) if drive is not None and drive.determined else 0.0
    seen = 0.0
    if axes == "principal":
        linear, angle = principal(linear)
        seen, pushed = -angle, pushed - angle
    ratio = _rounded(found, "pickoff_ratio") or 1.0
    rate = _rate(found)
    gains = (0.0, float(f"{ratio - 1:.12g}"))
    changes = linear.changes() | {
        "device.pickoff_gain_error": gains,
        "device.pickoff_misalignment": seen,
        "datasheet.pickoff_gain_error": gains,
        "datasheet.pickoff_misalignment": seen,
        "device.force_misalignment": pushed,
        "adaptation.initial_ratio": 1.0,
        **_in_seconds(base, linear),
        "controller.force_limit": linear.force_limit(base, base.plant.angular_rate if rate is None else rate),
    }
    if rate is not None:
        changes["plant.angular_rate"] = rate
    if found.known.mass is not None:
        temperature = found.conditions[0].state.temperature or TEMPERATURE
        changes["disturbance.density"] = linear.thermal_density(temperature)
    if "cubic_x" in found or "cubic_y" in found:
        changes["device.cubic_stiffness"] = tuple(_rounded(found, f"cubic_{axis}") or 0.0 for axis in "xy")
    delay = _delay(found, base, linear.omega)
    if delay is not None:
        changes |= timing(*delay)
    noise = noise_density(found)
    if noise is not None:
        changes["device.position_noise_density"] = float(f"{noise:.4g}")
    return changes


def _delay(found: Results, base: Scenario, omega: float) -> tuple[int, float] | None:
    """Delay of the force in steps, and the step; None without a forced record, or if it is too long for the steps."""
    delay = found.get("delay")
    return None if delay is None else whole_steps(max(delay.value, 0.0) * omega, float(base.run.step))


def _in_seconds(base: Scenario, linear: Linear) -> dict[str, Any]:
    """Bandwidth and drifts of the shipped scenario, in units of the device's omega0."""
    turn = base.plant.reference_frequency / linear.omega
    values = {
        "adaptation.rate_forgetting": base.adaptation.rate_forgetting,
        "datasheet.stiffness_drift": base.datasheet.stiffness_drift,
        "datasheet.damping_drift": base.datasheet.damping_drift,
    }
    return {name: float(f"{turn * value:.6g}") for name, value in values.items()}


def noise_density(found: Results) -> float | None:
    """One-sided density of the pick-offs' noise, m/sqrt(Hz), if the pick-off's gain is known."""
    fit = next((each for each in found.groups if isinstance(each, Fitted)), None)
    if fit is None or found.known.pickoff is None:
        return None
    intervals = [each.interval for each in fit.segments]
    densities = [
        float(row[0]) * math.sqrt(2 * interval) for row, interval in zip(fit.fit.noise, intervals, strict=True)
    ]
    return found.known.pickoff * min(densities)


def _length(found: Results, base: Scenario) -> float:
    """Unit of length: the amplitude of the records, m, or that of the shipped scenario."""
    fit = next((each for each in found.groups if isinstance(each, Fitted)), None)
    if fit is None or found.known.pickoff is None:
        return float(base.plant.reference_length)
    size = max(float(abs(each.motion - each.motion.mean(axis=1, keepdims=True)).max()) for each in fit.segments)
    return float(f"{found.known.pickoff * size:.3g}")


def _rate(found: Results) -> float | None:
    """The identified rate, if it is large enough to be the end of a range."""
    rate = found.get("rate")
    if rate is None or not rate.determined or abs(rate.value) < SLOWEST_RATE:
        return None
    return _rounded(found, "rate")


def _rounded(found: Results, name: str) -> float | None:
    """A quantity in SI with two digits more than a tenth of its interval shows; None if it is not determined."""
    each = found.get(name)
    if each is None or not each.determined:
        return None
    if not each.half > 0 or each.value == 0:
        return each.value
    digits = math.ceil(math.log10(max(abs(each.value) / each.half, 1.0))) + 4
    return float(f"{each.value:.{min(digits, 17)}g}")


def correction(found: Results) -> list[list[float]] | None:
    """The matrix by which a measured (x, y) is multiplied to be the motion, in units of x: P^-1 of structure.py.

    None if the pick-off ratio is not determined.
    """
    ratio, skew = _rounded(found, "pickoff_ratio"), _rounded(found, "skew") or 0.0
    if ratio is None:
        return None
    return [[1.0, 0.0], [_ten(-skew / ratio), _ten(1 / ratio)]]


def _ten(value: float) -> float:
    return float(f"{value:.10g}") + 0.0


# -- TOML --------------------------------------------------------------------------------------------------------------


def toml_of(found: Results, axes: Axes = "pickoffs") -> str:
    """The scenario as TOML: its head lists what was assumed, and each identified field has its interval and source."""
    scenario = scenario_of(found, axes)
    comments = _field_comments(found, scenario)
    words = [f"Identified by fracgyro from {', '.join(found.files) or 'arrays'}; intervals are 95 %."]
    words += [f"{each[0].upper()}{each[1:]}." for each in found.notes]
    words += [f"Test failed: {each.words}." for each in found.tests if each.verdict == "fail"]
    words.append(f"Controller, adaptation and run are those of the shipped scenario {base_name(found)}.")
    if axes == "principal":
        said = _part(found["stiffness_axis"])
        words.append(f"All is in the principal axes of the stiffness, which the pick-offs see turned: {said}.")
        for field in ("plant.stiffness", "plant.damping", "device.force_misalignment"):
            comments.setdefault(field, []).append("In the principal axes; intervals are for the axes of the pick-offs.")
        for table in ("device", "datasheet"):
            comments[f"{table}.pickoff_misalignment"] = ["From the principal axes to the pick-offs."]
    return commented(scenario, words, comments)


def _field_comments(found: Results, scenario: Scenario) -> dict[str, list[str]]:
    """Comments of the fields, by dotted name."""
    names = ", ".join(found.files) or "the records"
    comments: dict[str, list[str]] = {}
    for field, quantities in SOURCES.items():
        known = [found[name] for name in quantities if name in found]
        parts = [_part(each) for each in known if each.determined]
        if parts:
            comments[field] = [f"Identified from {names}: {'; '.join(parts)}."]
        missing = [name for name in quantities if name not in found]
        if missing and field in ("plant.stiffness", "plant.damping"):
            comments.setdefault(field, []).append(f"Not determined by these records: {', '.join(missing)}.")
        for each in known:
            if not each.determined:
                reason = f": {each.note}" if each.note else ""
                comments.setdefault(field, []).append(f"Not determined by these records: {each.name}{reason}.")
    if _rate(found) is None:
        comments.setdefault("plant.angular_rate", []).append("The end of the range of the shipped scenario.")
    for axis in "xy":
        if f"backbone_{axis}" in found and f"cubic_{axis}" not in found:
            words = f"{_part(found[f'backbone_{axis}'])}: in N/m^3 with mass and gain of the pick-off."
            comments.setdefault("device.cubic_stiffness", []).append(f"Identified from {names}: {words}")
    if "delay" in found:
        said = f"delay {found['delay'].value:.6g} s, +- {found['delay'].half:.2g} s"
        in_steps = _delay(found, Scenario.shipped(base_name(found)), scenario.plant.reference_frequency)
        part = "it is too long to be set" if in_steps is None else f"{in_steps[0]} steps of this run"
        comments["device.delay"] = [f"Identified from {names}: {said}; {part}."]
    if "pickoff_ratio" in found and found["pickoff_ratio"].determined:
        words = "Measurements are corrected by it before the controller."
        comments.setdefault("datasheet.pickoff_gain_error", []).append(words)
    matrix = correction(found)
    if matrix is not None and matrix[1][0]:
        words = "The pick-offs are not at right angles, for which a scenario has no field: "
        words += f"instead of this correction, multiply what is measured by {matrix}."
        comments.setdefault("datasheet.pickoff_gain_error", []).append(words)
    relative = "Relative: no mass was given, so stiffness and damping are per 1 kg."
    if found.known.mass is None:
        comments["plant.mass"] = [relative]
        comments["disturbance.density"] = ["Not determined by these records: it needs the mass."]
    else:
        comments["plant.mass"] = ["Given."]
        temperature = found.conditions[0].state.temperature or TEMPERATURE
        comments["disturbance.density"] = [f"Thermal force of the identified damping at {temperature:g} K."]
    if found.known.pickoff is None:
        words = "Not determined by these records: it needs the gain of the pick-off, in m per unit of the record."
        comments["plant.reference_length"] = comments["device.position_noise_density"] = [words]
    else:
        comments["plant.reference_length"] = ["Largest motion in the records."]
        comments["device.position_noise_density"] = ["Noise of the x pick-off in the records."]
    for trend in found.trends:
        slope = f"{trend.slope:.6g} +- {1.96 * trend.slope_deviation:.2g} {trend.unit}"
        comments.setdefault("plant.stiffness", []).append(f"Trend of {trend.name} over {trend.over}: {slope}.")
    return comments


def _part(each: Quantity) -> str:
    unit = f" {each.unit}" if each.unit else ""
    lean = max(each.interval[1] - each.value, each.value - each.interval[0])
    if lean > 0.6 * (each.interval[1] - each.interval[0]):  # one-sided
        return f"{each.name} {each.interval[0]:.6g} to {each.interval[1]:.6g}{unit}"
    return f"{each.name} +- {each.half:.2g}{unit}"
