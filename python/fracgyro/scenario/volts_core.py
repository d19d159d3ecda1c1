"""The tables [[electrodes]], [electronics] and [trim] as the core's numbers, and what they are at bias."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .kinds import ELECTRODE_NUMBERS, ELECTRONICS_NUMBERS, TRIM_NUMBERS, core_values
from .messages import ScenarioError
from .schema import Plant
from .table import Symmetric
from .volts import Electrode, Electrodes, Electronics, Trim

NO_ELECTRODES = Electrodes()
IDEAL_ELECTRONICS = Electronics()


class AtBias(NamedTuple):
    """Electrodes and pick-offs around the resting mass, in SI; arrays are xx, xy, yy, or x and y."""

    softening: NDArray[np.float64]  #: N/m: what the electrodes take from plant.stiffness
    gain: NDArray[np.float64]  #: N/V: force per volt of the drivers, as designed
    charge: NDArray[np.float64]  #: C/m: of the pick-offs, as designed
    capacitance: NDArray[np.float64]  #: F: of the pick-offs, x and y
    noise: NDArray[np.float64]  #: m/sqrt(Hz), one-sided: of the amplifiers, x and y; zeros without


def has_volts(scenario: Any) -> bool:
    """True if the scenario has electrodes, or electronics that are not ideal."""
    return bool(scenario.electrodes != NO_ELECTRODES or scenario.electronics != IDEAL_ELECTRONICS)


def electronics_numbers(electronics: Electronics) -> list[float]:
    return list(core_values(ELECTRONICS_NUMBERS, {"electronics": dict(electronics)}).values())


def electrode_numbers(electrode: Electrode) -> list[float]:
    return list(core_values(ELECTRODE_NUMBERS, {"electrodes": dict(electrode)}).values())


def trim_numbers(trim: Trim) -> list[float]:
    return list(core_values(TRIM_NUMBERS, {"trim": dict(trim)}).values())


IDEAL_NUMBERS = electronics_numbers(IDEAL_ELECTRONICS)


def at_bias(scenario: Any) -> AtBias:
    """Electrodes and electronics of a scenario around the resting mass."""
    return _at_bias(scenario.plant, scenario.electrodes, scenario.electronics)


@lru_cache(maxsize=32)
def _at_bias(plant: Plant, electrodes: Electrodes, electronics: Electronics) -> AtBias:
    numbers, each = electronics_numbers(electronics), [electrode_numbers(one) for one in electrodes.each]
    softening = np.array(_core.at_bias(numbers, each, (1.0, 1.0))[0])
    left = (plant.effective_stiffness().entries() - softening)[[0, 2]]
    resonance = np.sqrt(np.maximum(left, 0.0) / plant.mass)
    _, gain, charge, capacitance, noise = map(np.array, _core.at_bias(numbers, each, tuple(resonance)))
    return AtBias(softening, gain, charge, capacitance[[0, 2]], noise[[0, 2]])


def plant_at_bias(scenario: Any) -> Plant:
    """The plant whose springs are those that act on a resting mass: plant.stiffness less what the electrodes soften."""
    if scenario.electrodes == NO_ELECTRODES:
        plant: Plant = scenario.plant
        return plant
    return _plant_at_bias(scenario.plant, scenario.electrodes, scenario.electronics)


@lru_cache(maxsize=32)
def _plant_at_bias(plant: Plant, electrodes: Electrodes, electronics: Electronics) -> Plant:
    xx, xy, yy = (float(entry) for entry in _at_bias(plant, electrodes, electronics).softening)
    stiffness = plant.stiffness.plus(-xx, -xy, -yy)
    return plant.model_copy(update={"stiffness": Symmetric.model_construct(**dict(stiffness))})


def lag(scenario: Any) -> float:
    """Time, s, by which readings and forces are late at the resonance of x, without device.delay."""
    e, plant = scenario.electronics, plant_at_bias(scenario)
    omega = math.sqrt(max(plant.effective_stiffness().xx, 0.0) / plant.mass)
    found = e.sample_delay + e.aperture / 2 + e.update_delay
    if omega:
        found += math.atan(omega / (math.tau * e.pole[0])) / omega
        if e.amplifier == "transimpedance":
            found -= math.pi / 2 / omega
        if e.amplifier == "charge" and e.feedback_capacitance:
            found -= math.atan(1 / (omega * e.feedback_resistance * e.feedback_capacitance)) / omega
    return float(found)


def drive(scenario: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Largest force of the drivers of x and y, N, and one step of their converters; infinite and 0 without."""
    most, steps = [math.inf, math.inf], [0.0, 0.0]
    gain = at_bias(scenario).gain[[0, 2]]
    for one in scenario.electrodes.of("force"):
        for axis in (0, 1):
            if one.axis[axis]:
                most[axis] = one.range * float(gain[axis])
                steps[axis] = 2 * most[axis] / 2**one.bits if one.bits else 0.0
    return (most[0], most[1]), (steps[0], steps[1])


def drive_noise(scenario: Any) -> tuple[float, float]:
    """Density of the noise of the forces of x and y by their drivers, N/sqrt(Hz), one-sided."""
    found, gain = [0.0, 0.0], at_bias(scenario).gain[[0, 2]]
    for one in scenario.electrodes.of("force"):
        for axis in (0, 1):
            if one.axis[axis]:
                found[axis] = one.noise * abs(float(gain[axis]))
    return found[0], found[1]


def bias_rows(scenario: Any) -> list[tuple[str, str]]:
    """Figures of a device in volts at bias, as text: name and value. Raises ScenarioError without electrodes."""
    if scenario.electrodes == NO_ELECTRODES:
        raise ScenarioError("electrodes are missing: a scenario without them has no bias; it must have some")
    at, plant = at_bias(scenario), plant_at_bias(scenario)
    k, m = plant.effective_stiffness(), plant.mass
    omega = [math.sqrt(k.xx / m), math.sqrt(k.yy / m)]

    def two(values: Any, unit: str, digits: int = 6) -> str:
        return f"{values[0]:.{digits}g}, {values[1]:.{digits}g} {unit}"

    rows = [
        ("frequencies x, y", two([each / math.tau for each in omega], "Hz", 9)),
        ("softening xx, yy", two(at.softening[[0, 2]], "N/m")),
        ("quadrature", f"{math.degrees(k.xy / (2 * m * omega[0])):.6g} deg/s, as kxy/(2 m omega_x)"),
    ]
    if scenario.electrodes.of("force"):
        rows.append(("force per volt", two(at.gain[[0, 2]], "N/V")))
        most, steps = drive(scenario)
        rows += [("full scale", two(most, "N")), ("one step of the converters", two(steps, "N"))]
        if any(noise := drive_noise(scenario)):
            rows.append(("noise of the drivers", two(noise, "N/sqrt(Hz)")))
    if scenario.electrodes.of("pickoff"):
        rows += [("charge of the pick-offs", two(at.charge[[0, 2]], "C/m")), ("capacitance", two(at.capacitance, "F"))]
        if at.noise.any():
            rows.append(("noise of the position", two(at.noise, "m/sqrt(Hz)")))
    for name, one in scenario.electrodes.named():
        if one.kind == "plate" and one.axis in ((1.0, 0.0), (0.0, 1.0)):
            own = np.array(_core.at_bias(IDEAL_NUMBERS, [electrode_numbers(one)], (1.0, 1.0))[0])
            spring = k.xx + own[0] if one.axis[0] else k.yy + own[2]  # without this electrode
            volts = _core.pull_in_voltage(electrode_numbers(one)) * math.sqrt(spring)
            rows.append((f"pull-in of {name}", f"{volts:.6g} V; it has {one.bias:g} V"))
    return rows
