"""Warnings about a valid scenario that is probably not what its author wants."""

from __future__ import annotations

import math
from collections.abc import Iterator

from .bounded import SAFE, gain, is_bounded
from .device_core import device_values
from .disturbance import named_entries
from .kinds import kinds_with
from .scenario import Scenario
from .table import toml_value
from .to_core import natural_frequencies, reference_reach

STEPS_PER_PERIOD = 20  # for the fastest resonance: fewer are a coarse sampling of the motion
EARLY = 0.1  # share of a run
STEADY = 10.0  # start of the steady window of the metrics


def suspicious(scenario: Scenario) -> Iterator[str]:
    """A sentence for each suspicious thing: field, value and consequence."""
    yield from _bounds(scenario)
    yield from _step(scenario)
    yield from _limits(scenario)
    yield from _tables(scenario)
    if scenario.run.duration < STEADY:
        yield f"run.duration is {scenario.run.duration:g}: metrics of the steady window need more than {STEADY:g}"


def _tables(scenario: Scenario) -> Iterator[str]:
    """Tables that end early: often their times are in another unit than their author thinks."""
    ends = [("reference.points", scenario.reference.points, 0.0)]
    ends += [(f"{name}.points", entry.points, entry.start) for name, entry in named_entries(scenario.disturbance)]
    for name, points, start in ends:
        if points and (end := points[-1][0]) + start < EARLY * scenario.run.duration:
            yield (
                f"{name} ends at {end + start:g}: run.duration is {scenario.run.duration:g}, more than ten times as "
                "long; plain times are in 1/omega0, and with units = \"SI\" or the header 'time (s)' in s"
            )


def _bounds(scenario: Scenario) -> Iterator[str]:
    c, a = scenario.controller, scenario.adaptation
    if not is_bounded(scenario):
        yield (
            f"controller.switching_limit is {toml_value(c.switching_limit)}: in noise the bound estimates grow until "
            "the loop diverges; 0.5 bounds them, and without such a limit a scenario is exported only with --unbounded"
        )
    if c.adaptive and c.kind in kinds_with("adaptation.bound_gain") and c.layer_thickness > 0:
        start = scenario.run
        first = gain(
            scenario, a.initial_bound, math.hypot(*start.initial_position), math.hypot(*start.initial_velocity)
        )
        if first > SAFE:
            yield (
                f"run.step is {start.step:g}: at the start rho h/delta is {first:.3g}, and from about 2 on the sampled "
                "loop is unstable; a shorter step or a thicker controller.layer_thickness lowers it"
            )


def _step(scenario: Scenario) -> Iterator[str]:
    step, fastest = scenario.run.step, natural_frequencies(scenario)[1]
    found = 2 * math.pi / fastest / step
    if found < STEPS_PER_PERIOD:
        yield (
            f"run.step is {step:g}: a period of the fastest resonance has {found:.3g} steps, and {STEPS_PER_PERIOD} or "
            "more suit a controller"
        )


def _limits(scenario: Scenario) -> Iterator[str]:
    device, limit = device_values(scenario), scenario.controller.force_limit
    if limit > device["actuator_limit"]:
        given = "inf" if math.isinf(limit) else f"{limit:g}"
        yield (
            f"controller.force_limit is {given}: the actuator gives at most {device['actuator_limit']:g}, unit "
            "m omega0^2 q0 (device.actuator_limit), and the controller does not know it"
        )
    for place, axis in enumerate("xy"):
        amplitude, reach = reference_reach(scenario)[0][place], device["position_range"][place]
        if amplitude > reach:
            yield (
                f"device.position_range is {scenario.device.position_range[place]:g} m in {axis}: the reference moves "
                f"{amplitude * scenario.plant.reference_length:g} m, so that the sensor clips"
            )
