"""Checks of a scenario that concern several of its tables."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError, create_model

from .device import GAIN_DRIFTS, MATRIX_DRIFTS
from .disturbance import named_entries
from .kinds import (
    OF_FILTER,
    SINE_DRIVES,
    TWO_SINE_DRIVES,
    fields_of_its_kind,
    filtered_types,
    kinds_with,
    place_of_type,
    reports,
)
from .messages import scenario_error
from .plants import check_kind
from .printing import BY_KIND, fields_of_table, having, own_fields
from .schema import HOLD_TOLERANCE
from .table import MAX_STEPS, Table, format_value, message_error, of_other_kinds, toml_value
from .volts_checks import check_volts
from .volts_core import plant_at_bias


def check(scenario: Any) -> None:
    """Raises PydanticCustomError, in one sentence, for the first thing that is wrong in a Scenario."""
    _check_disturbance(scenario)
    _check_rate(scenario)
    _check_noise_corners(scenario)
    _check_drift(scenario)
    check_kind(scenario.plant, scenario.rate, scenario.device)
    check_volts(scenario)
    _check_kind(scenario)
    _check_fields_of_its_kind(scenario)
    _check_filter(scenario)
    _check_compensation(scenario)
    _check_reference(scenario)
    _check_estimates(scenario)


def _check_kind(scenario: Any) -> None:
    """A field that is given must be one that the kind of controller has."""
    kind, filtered = scenario.controller.kind, scenario.controller.filter
    for name in BY_KIND:
        table = getattr(scenario, name)
        for field in sorted(table.model_fields_set - set(fields_of_table(_model(scenario), name, kind, filtered))):
            path = f"{name}.{field}"
            error = of_other_kinds(path, getattr(table, field), kinds_with(path), kind)
            if name == "datasheet" and field in OF_FILTER:
                raise message_error(f'{error.message()}; or controller.filter = "kalman"')
            raise error


def _check_filter(scenario: Any) -> None:
    """A controller that filters by itself takes no filter before it."""
    c = scenario.controller
    takes = filtered_types(c.kind)
    if c.filter != "none" and not takes[place_of_type(scenario)]:
        of = f"adaptation.kind {scenario.adaptation.kind}" if any(takes) else f"controller.kind {c.kind}"
        raise message_error(
            f"controller.filter is {format_value(c.filter)}: for {of}, which filters the measurements itself, it must "
            "be none"
        )


def _check_compensation(scenario: Any) -> None:
    """A law whose estimates state how far they are to be trusted would find the nominal plant, and trust it."""
    c = scenario.controller
    if c.compensation_bandwidth == 0:
        return
    types = reports(c.kind)
    trusts = any(channel.name == "rate_trusted" for channel in types[place_of_type(scenario)])
    if trusts or c.kind in SINE_DRIVES:
        of = f"adaptation.kind {scenario.adaptation.kind}" if len(types) > 1 else f"controller.kind {c.kind}"
        raise message_error(
            f"controller.compensation_bandwidth is {format_value(c.compensation_bandwidth)}: for {of}, which would "
            "no longer see the plant and the angular rate, it must be 0.0"
        )


def _check_fields_of_its_kind(scenario: Any) -> None:
    """A field that several kinds of controllers describe differently must be as this kind describes it."""
    for name in BY_KIND:
        table, kind = getattr(scenario, name), scenario.controller.kind
        fields = fields_of_its_kind(name, kind)
        given = {field: value for field in fields if (value := getattr(table, field)) is not None}
        try:
            if given:
                _table_of_kind(name, kind)(**given)
        except ValidationError as error:
            raise message_error(str(scenario_error(error, _model(scenario), (name,)))) from None


@lru_cache
def _table_of_kind(name: str, kind: str) -> type[Table]:
    fields: dict[str, Any] = dict(fields_of_its_kind(name, kind))
    return create_model(name, __base__=Table, **fields)


def _check_reference(scenario: Any) -> None:
    kinds = scenario.reference.kinds
    for field in sorted(scenario.reference.model_fields_set - set(own_fields(_model(scenario), "reference", kinds))):
        value, kind = getattr(scenario.reference, field), scenario.reference.kind
        raise of_other_kinds(f"reference.{field}", value, having("reference", field), kind)
    kind = scenario.controller.kind
    if kind in SINE_DRIVES and (kinds[0] != "sine" or scenario.reference.offset[0] != 0):
        raise message_error(
            f"reference.kind is {format_value(scenario.reference.kind)}: for controller.kind {kind}, which drives x at "
            "its frequency, it must be a sine on x, without an offset"
        )
    if kind in TWO_SINE_DRIVES:
        _check_two_sines(scenario, kind)


def _check_two_sines(scenario: Any, kind: str) -> None:
    reference = scenario.reference
    if reference.kinds != ("sine", "sine") or any(reference.offset):
        raise message_error(
            f"reference.kind is {format_value(reference.kind)}: for controller.kind {kind}, which demodulates both "
            "axes, it must be a sine on each, without an offset"
        )
    for field in ("amplitude", "frequency"):
        if 0.0 in getattr(reference, field):
            raise message_error(
                f"reference.{field} is {format_value(getattr(reference, field))}: for controller.kind {kind} both "
                "numbers must be other than 0"
            )


def _check_whole_steps(name: str, time: float, least: int, step: float, after: str = "") -> None:
    ratio = min(time / step, 2.0 * MAX_STEPS)
    if ratio > MAX_STEPS * (1 + HOLD_TOLERANCE):
        raise message_error(f"{name} is {toml_value(time)}: it must be at most {MAX_STEPS} steps of {toml_value(step)}")
    if round(ratio) < least or abs(ratio - round(ratio)) > HOLD_TOLERANCE * ratio:
        raise message_error(
            f"{name} is {toml_value(time)}: it must be a whole number of run.step, which is {toml_value(step)}{after}"
        )


def _check_disturbance(scenario: Any) -> None:
    highest = math.pi / scenario.run.step
    share = scenario.device.acceleration_share or (1.0, 1.0)
    for name, entry in named_entries(scenario.disturbance):
        white = entry.kind == "noise" and entry.band is None
        if white and entry.quantity == "acceleration" and abs(share[0]) != abs(share[1]):
            raise message_error(
                f"device.acceleration_share is {toml_value(share)}: its numbers must have the same size for {name}, "
                "noise without a band, which is as strong on both axes"
            )
        if entry.kind == "noise" and entry.hold is not None:
            _check_whole_steps(f"{name}.hold", entry.hold, 1, scenario.run.step, "; left out, it is one step")
        field = "psd" if entry.kind == "vibration" else "band"
        reach = entry.psd[-1][0] if entry.psd else entry.band[1] if entry.kind == "noise" and entry.band else 0.0
        if reach > highest:
            raise message_error(
                f"{name}.{field} reaches {toml_value(reach)}: it must reach at most pi over run.step, which is "
                f"{highest:.6g}"
            )


def _check_rate(scenario: Any) -> None:
    rate, scales = scenario.rate, scenario.plant.scales
    step = scenario.run.step * scales.time
    if rate.kind not in ("constant", "table"):
        _check_whole_steps("rate.start", rate.start, 0, step, " s")
    if rate.kind == "staircase" and rate.hold is not None:
        _check_whole_steps("rate.hold", rate.hold, 1, step, " s")
    if rate.transverse_points is not None and not scenario.plant.centrifugal:
        raise message_error(
            "rate.transverse_points is given: it needs plant.centrifugal = true, without which rates about x and y do "
            "not act"
        )
    used = {"sine": ["frequency"], "noise": ["frequency"], "chirp": ["frequency", "final_frequency"]}
    for name in used.get(rate.kind, []):
        highest = math.pi / step
        if getattr(rate, name) > highest:
            raise message_error(
                f"rate.{name} is {toml_value(getattr(rate, name))}: it must be at most pi over the "
                f"step, which is {highest:.6g} rad/s"
            )


def _check_noise_corners(scenario: Any) -> None:
    highest = 0.5 / (scenario.run.step * scenario.plant.scales.time)
    for name in ("position_noise_corner", "velocity_noise_corner"):
        if getattr(scenario.device, name) > highest:
            raise message_error(
                f"device.{name} is {toml_value(getattr(scenario.device, name))}: it must be at most half the sampling "
                f"frequency, which is {highest:.6g} Hz"
            )


def _check_drift(scenario: Any) -> None:
    end = scenario.run.duration * scenario.plant.scales.time
    for _, change in scenario.device.temperature(end):
        for name, field, per in (
            ("stiffness", "stiffness_drift", 1),
            ("stiffness", "frequency_temperature_coefficient", 2),
            ("damping", "damping_drift", 1),
        ):
            drift = getattr(scenario.device, field)
            factor = 1 + 1e-6 * per * drift * change
            if not 0 < factor < math.inf:
                raise message_error(
                    f"device.{field} is {toml_value(drift)}: over {change:g} K it multiplies the {name} by "
                    f"{factor:g}, which must be greater than 0 and finite"
                )
        if change:
            with np.errstate(over="ignore", invalid="ignore"):  # overflow is refused below
                _check_warm(scenario, change)


def _check_warm(scenario: Any, change: float) -> None:
    """Matrices and gains that drift by entries stay possible."""
    device, plant = scenario.device, scenario.plant
    if not any(np.any(getattr(device, name)) for name in (*MATRIX_DRIFTS, *GAIN_DRIFTS)):
        return
    damping, stiffness = (
        np.add(own.entries(), more.entries())
        for own, more in ((plant.damping, plant.damping_deviation), (plant.stiffness, plant.stiffness_deviation))
    )
    growth = 1e-6 * change * np.array([device.damping_drift, device.stiffness_coefficient])
    warm = zip((damping, stiffness), growth, device.drifts(damping, stiffness), strict=True)
    for names, (matrix, common, more) in zip((MATRIX_DRIFTS[2:], MATRIX_DRIFTS[:2]), warm, strict=True):
        xx, xy, yy = (1 + common) * matrix + change * more
        least = 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
        name = max(names, key=lambda each: np.abs(getattr(device, each)).max())
        if more.any() and not least >= 0:  # NaN if it overflows
            raise message_error(
                f"device.{name} is {toml_value(getattr(device, name))}: over {change:g} K it makes "
                f"{'damping' if name in MATRIX_DRIFTS[2:] else 'stiffness'} negative or infinite, with an eigenvalue "
                f"of {least:.4g}"
            )
    for name in GAIN_DRIFTS:
        gains = 1 + 1e-6 * change * np.array(getattr(device, name))
        if not (min(gains) > 0 and max(gains) < math.inf):
            raise message_error(
                f"device.{name} is {toml_value(getattr(device, name))}: over {change:g} K a gain would be 0, negative "
                "or infinite"
            )


def _check_estimates(scenario: Any) -> None:
    damping, stiffness, rate, _, _ = plant_at_bias(scenario).nondimensional()
    largest = max(abs(float(number)) for number in (*damping, *stiffness, rate))
    if scenario.controller.adaptive and scenario.adaptation.initial_ratio * largest == math.inf:
        raise message_error(
            f"adaptation.initial_ratio is {toml_value(scenario.adaptation.initial_ratio)}: times D, K and Omega_z, of "
            f"which the largest is {largest:.6g}, it must be finite"
        )


def _model(scenario: Any) -> type[BaseModel]:
    return type(scenario)
