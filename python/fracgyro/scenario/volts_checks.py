"""Checks of a scenario in volts that concern several of its tables."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .. import _core
from .kinds import PLANT_KINDS, SINE_DRIVES, TWO_SINE_DRIVES, kinds_with, reports
from .table import message_error, toml_value
from .volts_core import (
    IDEAL_ELECTRONICS,
    IDEAL_NUMBERS,
    NO_ELECTRODES,
    at_bias,
    electrode_numbers,
    has_volts,
    plant_at_bias,
)


def check_volts(scenario: Any) -> None:
    """Raises PydanticCustomError, in one sentence, for the first thing that is wrong with electrodes or electronics."""
    if scenario.trim.on:
        _check_trim(scenario)
    shifts = scenario.device.common_mode_frequency
    if scenario.device.has_common_mode and scenario.electrodes == NO_ELECTRODES:
        raise message_error(
            f"device.common_mode_frequency is {toml_value(shifts)}: it needs [[electrodes]], whose gaps it shifts"
        )
    if not has_volts(scenario):
        return
    _check_tables(scenario)
    _check_electronics(scenario)
    _check_overlaps(scenario)
    least = plant_at_bias(scenario).effective_stiffness().smallest_eigenvalue()
    if not least > 0:
        softest, one = max(scenario.electrodes.named(), key=lambda each: _softening(each[1]))
        raise message_error(
            f"electrodes soften plant.stiffness to a smallest eigenvalue of {least:.6g} N/m: it must be positive, as "
            f"a mass without springs pulls in; {softest} softens most, by {_softening(one):.6g} N/m at a bias of "
            f"{one.bias:g} V"
        )


def _softening(electrode: Any) -> float:
    """The most that it takes from a stiffness, N/m; infinite if it overflows."""
    found = float(np.abs(_core.at_bias(IDEAL_NUMBERS, [electrode_numbers(electrode)], (1.0, 1.0))[0]).max())
    return found if math.isfinite(found) else math.inf


def _check_overlaps(scenario: Any) -> None:
    """A comb whose fingers part has no capacitance that is linear in the motion."""
    kind, reference = scenario.controller.kind, scenario.reference
    x, y = (
        (abs(amplitude) + abs(offset)) * scenario.plant.reference_length if of in ("sine", "chirp") else 0.0
        for of, amplitude, offset in zip(reference.kinds, reference.amplitude, reference.offset, strict=True)
    )
    if _turns(kind):
        y = x
    elif kind in SINE_DRIVES and kind not in TWO_SINE_DRIVES:  # y is at rest or swings freely
        y = 0.0
    for name, one in scenario.electrodes.named():
        along = abs(one.axis[0]) * x + abs(one.axis[1]) * y
        if one.kind != "plate" and one.overlap <= along:
            raise message_error(
                f"{name}.overlap is {toml_value(one.overlap)}: it must be greater than the motion along the comb, by "
                f"which its fingers part; the reference moves {along:.6g} m"
            )


def _check_tables(scenario: Any) -> None:
    plant, device, electronics = scenario.plant, scenario.device, scenario.electronics
    table = "electrodes" if scenario.electrodes != NO_ELECTRODES else "electronics"
    if plant.kind != PLANT_KINDS[0]:
        raise message_error(f"plant.kind is {toml_value(plant.kind)}: it must be {PLANT_KINDS[0]} with {table}")
    pickoffs = scenario.electrodes.of("pickoff")
    if electronics.amplifier != "ideal" and not pickoffs:
        raise message_error(
            f"electronics.amplifier is {toml_value(electronics.amplifier)}: it must be ideal without electrodes of "
            "role pickoff"
        )
    if device.sensing != "position" and (pickoffs or electronics != IDEAL_ELECTRONICS):
        said = "electrodes of role pickoff" if pickoffs else "electronics"
        raise message_error(
            f"device.sensing is {toml_value(device.sensing)}: it must be position with {said}, which read positions"
        )
    if any(at_bias(scenario).noise):
        for name in ("position_noise", "position_noise_density"):
            if value := getattr(device, name):
                raise message_error(
                    f"device.{name} is {toml_value(value)}: it must be 0.0 with electronics.amplifier charge, from "
                    "which the noise follows"
                )
    for name, one in scenario.electrodes.named():
        if one.bits and device.actuator_bits:
            raise message_error(
                f"device.actuator_bits is {device.actuator_bits}: it must be 0 with {name}.bits, which is the "
                f"converter, of {one.bits} bits"
            )
        if one.role == "pickoff" and not one.bias and not electronics.carrier_voltage:
            raise message_error(f"{name}.bias is 0.0: a pick-off must have a bias or electronics.carrier_voltage")


def _check_trim(scenario: Any) -> None:
    trim, scales = scenario.trim, scenario.plant.scales
    part = f"trim.{'tuning' if trim.tuning != 'fixed' else 'quadrature'}"
    on = f"{part} is {toml_value(getattr(trim, part[5:]))}"
    quadrature = [one for one in scenario.electrodes.of("quadrature") if one.bias and abs(_mixes(one)) > 1e-6]
    if len(quadrature) != 1:
        raise message_error(
            f"{on}: it needs one electrode of role quadrature, with a bias and along x or y, whose nulling has the "
            f"tone; there are {len(quadrature)}"
        )
    if trim.tuning != "fixed":
        tuning = scenario.electrodes.of("tuning")
        along = sum(one.kind == "plate" and not one.axis[0] for one in tuning)
        if (len(tuning), along) != (1, 1):
            raise message_error(
                f"{on}: it needs one electrode of role tuning, plates along y; there are {len(tuning)}"
                + (f", and {along} of them are plates along y" if tuning else "")
            )
    kind, reference = scenario.controller.kind, scenario.reference
    decay = 2 * scenario.plant.mass / scenario.plant.damping.yy
    if kind == "open_loop" and trim.interval < 5 * decay:
        raise message_error(
            f"trim.interval is {toml_value(trim.interval)}: with controller.kind open_loop, which leaves y to ring, it "
            f"must be at least 5 times its decay, {5 * decay:.6g} s"
        )
    if _turns(kind):
        raise message_error(f"{on}: it must be fixed with controller.kind {kind}, whose vibration leaves x")
    if reference.kinds[0] != "sine" or reference.offset[0] or not reference.amplitude[0]:
        raise message_error(f"{on}: it needs a reference of kind sine on x, without offset and with an amplitude")
    own = reference.kinds[1] == "sine" and reference.amplitude[1] and reference.frequency[1] != reference.frequency[0]
    if kind not in SINE_DRIVES and (own or reference.kinds[1] not in ("sine", "rest")):
        raise message_error(
            f"{on}: it needs a reference of y at rest, or with the frequency of x: another vibration hides what y "
            "answers to the tone"
        )
    resonance = float(scenario.reference.frequency[0]) * scales.rate / math.tau
    if not trim.frequency < resonance / 4:
        raise message_error(
            f"trim.frequency is {toml_value(trim.frequency)}: it must be less than a quarter of the vibration's, which "
            f"is {resonance:.6g} Hz"
        )
    if not trim.interval * trim.frequency >= 4:
        raise message_error(
            f"trim.interval is {toml_value(trim.interval)}: it must be at least 4 periods of trim.frequency, which is "
            f"{4 / trim.frequency:.6g} s"
        )
    if abs(trim.target) >= trim.frequency:
        raise message_error(
            f"trim.target is {toml_value(trim.target)}: its magnitude must be less than trim.frequency, which is "
            f"{toml_value(trim.frequency)}"
        )


def _turns(kind: str) -> bool:
    """True for laws whose vibration does not stay on x."""
    return any(channel.name == "pattern_angle" for channels in reports(kind) for channel in channels)


def _mixes(electrode: Any) -> float:
    """Change of kxy by a volt of its nulling, over the most that it could be."""
    (c, s) = electrode.axis
    return float(c * c - s * s)


def _check_electronics(scenario: Any) -> None:
    e, electrodes = scenario.electronics, scenario.electrodes
    step = scenario.run.step * scenario.plant.scales.time
    sampled = e.sample_delay + e.aperture
    if sampled >= step:
        name = "aperture" if e.aperture else "sample_delay"
        raise message_error(
            f"electronics.{name} is {toml_value(getattr(e, name))}: sample_delay plus aperture must be less than a "
            f"step, which is {step:.6g} s"
        )
    if e.update_delay >= step:
        raise message_error(
            f"electronics.update_delay is {toml_value(e.update_delay)}: it must be less than a step, which is "
            f"{step:.6g} s; whole steps are device.delay"
        )
    if any(e.feedthrough) and not (electrodes.of("force") and electrodes.of("pickoff")):
        raise message_error(
            f"electronics.feedthrough is {toml_value(e.feedthrough)}: it needs electrodes of role force and of role "
            "pickoff"
        )
    if e.amplifier == "transimpedance" and scenario.controller.kind not in (kinds := kinds_with("datasheet.lag")):
        *others, last = kinds
        raise message_error(
            "electronics.amplifier is transimpedance, which reads the velocity: controller.kind must be "
            f"{', '.join(others)} or {last}, which know the phase of a reading"
        )
    leaky = e.amplifier == "charge" and e.feedback_capacitance and math.isfinite(e.feedback_resistance)
    bounded = leaky or e.amplifier == "transimpedance"
    if e.feedthrough_lag and not bounded:
        raise message_error(
            f"electronics.feedthrough_lag is {toml_value(e.feedthrough_lag)}: it needs a charge amplifier with "
            "feedback_capacitance and a finite feedback_resistance, or a transimpedance amplifier, or what leaks would "
            "add up without end"
        )
    if e.jitter >= step:
        raise message_error(
            f"electronics.jitter is {toml_value(e.jitter)}: it must be less than a step, which is {step:.6g} s"
        )
    k = plant_at_bias(scenario).effective_stiffness()
    fastest = math.sqrt(max(k.xx, k.yy, 0.0) / scenario.plant.mass) / math.tau
    if 0 < e.carrier_frequency <= 2 * fastest:
        raise message_error(
            f"electronics.carrier_frequency is {toml_value(e.carrier_frequency)}: it must be greater than twice the "
            f"resonance that it carries, which is {fastest:.6g} Hz"
        )
    if e.carrier_flicker and not e.carrier_frequency:
        raise message_error(
            f"electronics.carrier_flicker is {toml_value(e.carrier_flicker)}: it needs electronics.carrier_frequency"
        )
    plates = [one for one in electrodes.of("force") if one.kind == "plate" and one.pair]
    if e.linearized and not plates:
        raise message_error("electronics.linearized is true: it needs pairs of plates of role force")
