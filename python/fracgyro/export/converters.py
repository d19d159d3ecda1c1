"""Drivers and converters around an exported controller (include/fracgyro/hardware/converters.hpp)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..scenario import Scenario
from ..scenario.device_core import device_values
from ..scenario.volts_core import at_bias
from .compilers import Number
from .initializers import list_text
from .settings import knows_rounding

MOST_BITS = {"float": 23, "double": 32}  # words that are exact in the number type


class Driver(NamedTuple):
    """Source of the force that a controller asks for, on x and y. Voltages are forces if there are no electrodes."""

    bits: tuple[int, int]  #: 0: no converter
    reach: tuple[float, float]  #: largest voltage
    force: tuple[float, float, float]  #: per volt, as designed, nondimensional: xx, xy, yy
    per_gap: tuple[float, float]  #: X per length, of a driver that knows how the force of plates grows; otherwise 0
    unit: str

    def numbers(self) -> dict[str, Sequence[float]]:
        """For the core, by their names there."""
        xx, xy, yy = self.force
        per, levels = 1.0 / (xx * yy - xy * xy), [2.0 ** (bits - 1) if bits else 0.0 for bits in self.bits]
        return {
            "per_force": (per * yy, -(per * xy), per * xx),
            "force": self.force,
            "reach": self.reach,
            "step": [reach / level if level else 0.0 for reach, level in zip(self.reach, levels, strict=True)],
            "levels": levels,
            "per_gap": self.per_gap,
        }


def driver(scenario: Scenario) -> Driver:
    """The drivers of the electrodes, or the actuator of a scenario without any."""
    device, scales = scenario.device, scenario.plant.scales
    electrodes = scenario.electrodes.of("force")
    if not electrodes:
        bits, reach = device.actuator_bits, device.actuator_limit / scales.force
        return Driver((bits, bits), (reach, reach), (1.0, 0.0, 1.0), (0.0, 0.0), "m omega0^2 q0")
    own = [(0, math.inf, 0.0)] * 2
    for one in electrodes:
        grows = one.kind == "plate" and one.pair and scenario.electronics.linearized
        for axis in (0, 1):
            if one.axis[axis]:
                own[axis] = (one.bits, one.range, scales.length / one.gap if grows else 0.0)
    (x_bits, x_reach, x_gap), (y_bits, y_reach, y_gap) = own
    xx, xy, yy = (float(each) / scales.force for each in at_bias(scenario).gain)
    return Driver((x_bits, y_bits), (x_reach, y_reach), (xx, xy, yy), (x_gap, y_gap), "V")


def amplifier_volts(scenario: Scenario) -> tuple[float, float] | None:
    """Output of the charge amplifiers, V, for one unit of length on x and on y; None without such amplifiers."""
    e = scenario.electronics
    if e.amplifier != "charge" or not e.feedback_capacitance:
        return None
    x, y = np.abs(at_bias(scenario).charge[[0, 2]]) * scenario.plant.scales.length / e.feedback_capacitance
    return float(x), float(y)


class Lines(NamedTuple):
    """Text for the header with the coefficients of firmware."""

    definitions: list[str]
    includes: list[str]
    constants: list[str]


def converters(scenario: Scenario, number: Number) -> Lines:
    """The lines for the converters; without `fracgyro_step_words` if the scenario does not have all of their bits."""
    device, driven = scenario.device, driver(scenario)
    inputs = ["position"] + (["velocity"] if device.sensing == "full" else [])
    of_inputs = {name: getattr(device, f"{name}_bits") for name in inputs}
    missing = [f"device.{name}_bits" for name, bits in of_inputs.items() if not bits]
    if not all(driven.bits):
        missing.append("bits of electrodes of role force" if driven.unit == "V" else "device.actuator_bits")
    if missing:
        return _without(f"without {' and '.join(missing)}")
    if (widest := max(*driven.bits, *of_inputs.values())) > MOST_BITS[number]:
        return _without(f"{widest} bits are not exact in {number}")

    values, scales, volts = device_values(scenario), scenario.plant.scales, amplifier_volts(scenario)
    steps: dict[str, Sequence[float]] = {}
    said = ["", "/* Converters of fracgyro_step_words, with levels from minus their range to a step below it. */"]
    for name, bits in of_inputs.items():
        x, y = values[f"{name}_range"]
        steps[name] = (x / 2 ** (bits - 1), y / 2 ** (bits - 1))
        scale, unit = {"position": (scales.length, "m"), "velocity": (scales.velocity, "m/s")}[name]
        at = f", {x * volts[0]:.6g}, {y * volts[1]:.6g} V at the amplifiers" if volts and name == "position" else ""
        said.append(f"/* ADC of the {name}: {bits} bits over {x * scale:.6g}, {y * scale:.6g} {unit}{at} */")
    (x_bits, y_bits), (x, y) = driven.bits, driven.reach
    said.append(f"/* DAC: {x_bits}, {y_bits} bits over {x:.6g}, {y:.6g} {driven.unit} */")
    known = int(knows_rounding(scenario))
    definitions = [
        *said,
        "#define FRACGYRO_WORDS 1",
        f"#define FRACGYRO_ROUNDED_FORCE_KNOWN {known} /* fracgyro_step_words calls fracgyro_acted */",
    ]
    numbers = steps | driven.numbers()
    inner = ", ".join(f".{name} = {list_text(each, number)}" for name, each in numbers.items())
    constant = f"constexpr fracgyro::Converters<{number}>::Coefficients converters = {{{inner}}};"
    return Lines(definitions, ['#include "fracgyro/hardware/converters.hpp"'], [constant])


def _without(reason: str) -> Lines:
    return Lines([f"#define FRACGYRO_WORDS 0 /* no fracgyro_step_words: {reason} */"], [], [])
