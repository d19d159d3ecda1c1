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
from .to_core import natural_frequencies, nominal, reference_reach
from .volts_core import plant_at_bias

STEPS_PER_PERIOD = 20  # for the fastest resonance: fewer are a coarse sampling of the motion
EARLY = 0.1  # share of a run
STEADY = 10.0  # start of the steady window of the metrics


def suspicious(scenario: Scenario) -> Iterator[str]:
    """A sentence for each suspicious thing: field, value and consequence."""
    yield from _bounds(scenario)
    yield from _step(scenario)
    yield from _limits(scenario)
    yield from _tables(scenario)
    yield from _laws(scenario)
    yield from _scale(scenario)
    if scenario.run.duration < STEADY:
        yield f"run.duration is {scenario.run.duration:g}: metrics of the steady window need more than {STEADY:g}"


def _laws(scenario: Scenario) -> Iterator[str]:
    """Fields that are allowed and at which a law or a trim does not do its work."""
    c, trim, plant, run = scenario.controller, scenario.trim, scenario.plant, scenario.run

    def has(name: str) -> bool:
        return c.kind in kinds_with(f"controller.{name}")

    if has("rebalance_bandwidth") and c.demodulation_bandwidth < 5 * c.rebalance_bandwidth:
        yield (
            f"controller.demodulation_bandwidth is {c.demodulation_bandwidth:g}: below 5 times rebalance_bandwidth, "
            f"which is {c.rebalance_bandwidth:g}, the loop that holds y may ring or diverge"
        )
    if has("quadrature_bandwidth") and c.quadrature_bandwidth > 0.05:
        yield (
            f"controller.quadrature_bandwidth is {c.quadrature_bandwidth:g}: above 0.05 the loop that keeps the "
            "vibration a line may diverge"
        )
    if has("reversal_turns") and c.reversal_turns % 0.5:
        yield (
            f"controller.reversal_turns is {c.reversal_turns:g}: only over a multiple of 0.5 the drift by the dampers "
            "averages out"
        )
    if c.kind == "virtual_rotation" and not c.virtual_rate:
        yield "controller.virtual_rate is 0.0: the vibration is not turned, as with controller.kind whole_angle"
    if has("reversal_interval") and c.settling_time >= c.reversal_interval:
        yield (
            f"controller.settling_time is {c.settling_time:g}: reversal_interval is {c.reversal_interval:g}, so that "
            "the rate is never read"
        )
    if any(plant.transverse_rate) and not plant.centrifugal:
        yield f"plant.transverse_rate is {toml_value(plant.transverse_rate)}: without plant.centrifugal it does not act"
    if trim.on:
        if trim.interval > run.duration * plant.scales.time:
            yield (
                f"trim.interval is {trim.interval:g} s: the run ends after {run.duration * plant.scales.time:.3g} s, "
                "before a voltage is adjusted"
            )
        read = c.output_bandwidth * plant.scales.rate / math.tau if has("output_bandwidth") else 0.0
        if trim.frequency < read:
            yield (
                f"trim.frequency is {trim.frequency:g} Hz: controller.output_bandwidth is {read:.4g} Hz, so that the "
                "tone is in the rate"
            )


def _scale(scenario: Scenario) -> Iterator[str]:
    """Open loop scales the rate by the nominal split of the modes."""
    if scenario.controller.kind != "open_loop":
        return
    known, trim = nominal(scenario), scenario.trim
    damping, stiffness, _, more_damping, more_stiffness = plant_at_bias(scenario).nondimensional()
    square, held = float(stiffness[0] + more_stiffness[0]), float(stiffness[2] + more_stiffness[2])
    if not square > 0:
        return
    if trim.tuning == "split":
        held = (math.sqrt(square) + math.tau * trim.target * scenario.plant.scales.time) ** 2

    def per_motion(d: float, k: float) -> complex:
        return complex(d / 2, (square - k) / (2 * math.sqrt(square)))

    expected = per_motion(float(known["initial_damping"][2]), float(known["initial_stiffness"][2]))
    actual = per_motion(float(damping[2] + more_damping[2]), held)
    factor = (expected / actual).real if actual else math.inf
    if abs(factor - 1) > 0.01:
        unknown = any(more_stiffness) or any(more_damping)
        yield (
            f"adaptation.initial_ratio is {scenario.adaptation.initial_ratio:g}"
            + (" and the plant has a deviation that no controller knows" if unknown else "")
            + ": open_loop scales the rate by the nominal split of the modes, and gives "
            f"{factor:.3g} times the rate"
        )


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
