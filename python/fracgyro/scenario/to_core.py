"""From a scenario to the compiled core: nondimensional numbers and the designed exponentials."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..fractional.kernel import core_kernel
from .device_core import device_values, is_ideal, profiles, rate_values, transverse_list
from .kinds import (
    DEVICE_NUMBERS,
    KINDS,
    OF_FILTER,
    PLANT_KINDS,
    core_values,
    force_aware_types,
    numbers,
    place_of_type,
    plant_numbers,
)
from .motion import Reference
from .scenario import Scenario
from .schema import Datasheet, Guard, Run
from .table import MAX_STEPS
from .terms import MAX_DEVIATIONS, first_part, frame_terms, largest_force, term_list, terms, white_noise
from .volts_core import electrode_numbers, electronics_numbers, has_volts, lag, plant_at_bias, trim_numbers

MAX_DELAY = 8  # steps that a controller takes into account
MAX_SAMPLES = 100_000  # at which a reference is looked at
MIN_TOLERANCE = 1e-5  # nondimensional, for sensors and disturbance: rounding, and effects not modeled


Pair = tuple[float, float]


def only_laws(scenario: Scenario) -> bool:
    """True if only the laws (44) adapt."""
    return bool(scenario.adaptation.kind == "gradient" or not scenario.controller.adaptive)


class Derived(NamedTuple):
    """Nondimensional values of the core's fields that follow from those of a scenario."""

    device: dict[str, Any]
    disturbance: dict[str, Any]


def derived(scenario: Scenario) -> Derived:
    return Derived(device_values(scenario), first_part(scenario))


def core_numbers(scenario: Scenario, found: Derived | None = None) -> dict[str, float]:
    """Every number of a run on an ideal device by name, nondimensional, as the core takes it."""
    found = found or derived(scenario)
    tables = {name: dict(vars(table)) for name, table in vars(scenario).items()}
    tables["guard"] = dict(guard(scenario, found))
    tables["datasheet"] = dict(datasheet(scenario, found))
    tables["plant"] = _plant(scenario)
    tables["disturbance"] = found.disturbance
    tables["adaptation"] |= nominal(scenario)
    tables["run"]["steps"] = scenario.run.steps
    return core_values(numbers(scenario.controller.kind), tables)


def device_numbers(scenario: Scenario, found: Derived | None = None) -> dict[str, float]:
    """Every number that a dynamic rate and a real device add, in the same form."""
    device = found.device if found else device_values(scenario)
    return core_values(DEVICE_NUMBERS, {"rate": rate_values(scenario), "device": device})


def nominal(scenario: Scenario) -> dict[str, Any]:
    """The plant as the controller knows it at first. With known parameters, eqs (20) and (34), the true one."""
    c, a = scenario.controller, scenario.adaptation
    adaptive = getattr(c, "adaptive", True)
    damping, stiffness, rate, _, _ = plant_at_bias(scenario).nondimensional()
    ratio = a.initial_ratio if adaptive else 1.0
    known = ratio * stiffness
    if c.kind == "open_loop" and scenario.trim.tuning == "split":  # its scale factor is that of the split that is held
        split = math.tau * scenario.trim.target * scenario.plant.scales.time
        known[2] = (math.sqrt(stiffness[0]) + split) ** 2
    return {
        "initial_damping": ratio * damping,
        "initial_stiffness": known,
        "initial_rate": ratio * rate if a.initial_rate is None or not adaptive else a.initial_rate,
    }


def guard(scenario: Scenario, found: Derived | None = None) -> Guard:
    """The guard with every field set: those left out follow from the rest of the scenario (EQUATIONS.md)."""
    found = found or derived(scenario)
    g, device, run = scenario.guard, found.device, scenario.run
    # The density A^2/|omega| has the variance A^2/pi ln(pi steps) above 1/duration; this bounds it without a logarithm.
    flickered = math.sqrt((1.2 + 0.7 * run.steps.bit_length()) / math.pi)

    def sensed(quantity: str) -> float:
        noise, flicker = device[f"{quantity}_noise"], flickered * device[f"{quantity}_flicker"]
        noise = max(noise, *device["amplifier_noise"]) if quantity == "position" else noise
        return MIN_TOLERANCE + MAX_DEVIATIONS * math.hypot(noise, flicker) + _resolution(device, quantity)

    values = {
        "plant_tolerance": _plant_tolerance(scenario),
        "force_tolerance": _force_tolerance(scenario, found),
        "position_tolerance": sensed("position"),
        "velocity_tolerance": sensed("velocity"),
        "patience": 0,
        "saturation_patience": 0,
    }
    if g.checked:
        slowest, fastest = natural_frequencies(scenario)
        period = 2 * math.pi / run.step
        values["patience"] = round(min(max(4, period / fastest / 32), MAX_STEPS))
        limit = scenario.controller.force_limit
        if math.isfinite(limit):
            largest = max(reference_reach(scenario)[0])
            swing_up = 8 * fastest * largest / limit / run.step
            values["saturation_patience"] = round(min(max(20 * period / slowest, swing_up), MAX_STEPS))
    return g.model_copy(update={name: value for name, value in values.items() if getattr(g, name) is None})


def datasheet(scenario: Scenario, found: Derived | None = None) -> Datasheet:
    """The controller's assumptions with every field set: those left out are the simulated values."""
    found = found or derived(scenario)
    assumed, device = scenario.datasheet, found.device

    def rounded(noise: float, quantity: str) -> float:
        return math.hypot(noise, _resolution(device, quantity) / math.sqrt(12))

    converted = 0.0 if force_aware(scenario) else max(device["drive_step"]) / math.sqrt(12)
    amplified = math.hypot(*device["amplifier_noise"]) / math.sqrt(2)
    values = {
        "force_noise": rounded(math.hypot(white_noise(scenario), converted, max(device["drive_noise"])), "actuator"),
        "position_noise": rounded(math.hypot(device["position_noise"], amplified), "position"),
        "velocity_noise": rounded(device["velocity_noise"], "velocity"),
        "delay": min(device["delay"], MAX_DELAY),
        "lag": lag(scenario) / scenario.plant.scales.time,
        **_drifts(scenario),
    }
    # A core without a law that needs a field has none.
    unset = {name: value for name, value in values.items() if getattr(assumed, name, value) is None}
    return assumed.model_copy(update=unset)


def force_aware(scenario: Scenario) -> bool:
    """True if the controller, or the filter before it, receives the force to which a converter rounds its request."""
    c = scenario.controller
    return force_aware_types(c.kind)[place_of_type(scenario)] or bool(c.filter == "kalman")


def _drifts(scenario: Scenario) -> dict[str, float]:
    """The largest rates at which stiffness and damping drift, as fractions of themselves per unit of time."""
    device, scales = scenario.device, scenario.plant.scales
    points = device.temperature(scenario.run.duration * scales.time)
    slopes = [abs(b - a) / (end - begin) for (begin, a), (end, b) in itertools.pairwise(points) if end > begin]
    warming = 1e-6 * max(slopes, default=0.0) * scales.time
    return {
        "stiffness_drift": _largest_drift(device.stiffness_coefficient, device.spring_drift, device.quadrature_drift)
        * warming,
        "damping_drift": _largest_drift(device.damping_drift, device.damper_drift, device.damping_axis_drift) * warming,
    }


def _largest_drift(common: float, own: Pair, xy: float) -> float:
    """That of an entry of K or D in ppm/K: of all, of xx and yy in addition, and of xy over the size of the others."""
    return float(max(abs(common), abs(common + own[0]), abs(common + own[1]), abs(xy)))


def reference_reach(scenario: Scenario) -> tuple[Pair, Pair]:
    """The largest magnitudes of the reference and its velocity during the run, nondimensional, on x and y."""
    r = scenario.reference
    if is_plain(scenario):
        (ax, ay), (fx, fy) = r.amplitude, r.frequency
        return (abs(ax), abs(ay)), (abs(ax * fx), abs(ay * fy))
    return _reach(r, scenario.run)


@lru_cache(maxsize=32)
def _reach(reference: Reference, run: Run) -> tuple[Pair, Pair]:
    every = -(-run.steps // MAX_SAMPLES)
    x, y, vx, vy, *_ = np.abs(_core.reference(_reference_only(reference, run), run.steps // every + 1, every)).T
    return (float(x.max()), float(y.max())), (float(vx.max()), float(vy.max()))


def _reference_only(reference: Reference, run: Run) -> _core.DeviceSetup:
    return core_setup(Scenario(reference=reference, run=run, controller={"kind": "pid"}, disturbance={"kind": "none"}))


def is_plain(scenario: Scenario) -> bool:
    """True if the reference is a sine about 0 on each axis."""
    return scenario.reference.kind == "sine" and not any(scenario.reference.offset)


def equivalent_sine(scenario: Scenario) -> tuple[Pair, Pair]:
    """Amplitude and frequency, of x and y, of sines with the mean squares of the reference and its velocity."""
    r = scenario.reference
    if is_plain(scenario):
        return r.amplitude, r.frequency
    (ax, ay), (fx, fy) = _core.equivalent_sine(_reference_only(r, scenario.run))
    return (ax, ay), (fx, fy)


def natural_frequencies(scenario: Scenario) -> tuple[float, float]:
    """The lower and the higher resonance frequency."""
    xx, xy, yy = (float(entry) for entry in plant_at_bias(scenario).nondimensional()[1])
    mean, half = xx / 2 + yy / 2, math.hypot(xx / 2 - yy / 2, xy)
    least, most = sys.float_info.min, sys.float_info.max  # after rounding, still a frequency
    return math.sqrt(max(mean - half, least)), math.sqrt(min(max(mean + half, least), most))


def _plant_tolerance(scenario: Scenario) -> float:
    """Twice the deviation that the scenario states, at least a tenth."""
    plant, device = plant_at_bias(scenario), scenario.device
    ratio = scenario.adaptation.initial_ratio if scenario.controller.adaptive else 1.0
    unknown = np.abs(plant.stiffness_deviation.entries()).max() / np.abs(plant.stiffness.entries()).max()
    warmest = max(abs(change) for _, change in device.temperature(scenario.run.duration * plant.scales.time))
    drift = _largest_drift(device.stiffness_coefficient, device.spring_drift, device.quadrature_drift)
    error: float = abs(1 / ratio - 1) + float(unknown) + 1e-6 * drift * warmest
    error += 1e-6 * warmest * max(map(abs, (*device.pickoff_gain_drift, *device.force_gain_drift)))
    error += max(map(abs, device.pickoff_gain_error)) + abs(device.pickoff_misalignment)
    error += max(map(abs, device.force_gain_error)) + abs(device.force_misalignment)
    return max(0.1, 2 * error)


def _force_tolerance(scenario: Scenario, found: Derived) -> float:
    """The disturbance, what the converter and the limit of the actuator make of the force, and a force that is late."""
    device, limit = found.device, scenario.controller.force_limit
    reach = float(min(device["actuator_limit"], *device["drive_limit"]))
    clipped = limit - reach if limit > reach else 0.0
    late = 2 * limit if device["delay"] or scenario.electronics.update_delay else 0.0
    converter = _resolution(device, "actuator") + float(max(device["drive_step"]))
    drivers = MAX_DEVIATIONS * float(max(device["drive_noise"]))
    return min(1e9, MIN_TOLERANCE + largest_force(scenario) + converter + drivers + clipped + late)


def _resolution(device: Mapping[str, Any], quantity: str) -> float:
    """One step of a converter; 0 without one."""
    bits = device[f"{quantity}_bits"]
    reach = device["actuator_limit"] if quantity == "actuator" else max(device[f"{quantity}_range"])
    return float(2 * reach / 2**bits) if bits else 0.0


def _plant(scenario: Scenario) -> dict[str, Any]:
    """Numbers of eqs (9) and (13)."""
    names = ("damping", "stiffness", "angular_rate", "damping_deviation", "stiffness_deviation")
    return dict(zip(names, plant_at_bias(scenario).nondimensional(), strict=True))


def own_plant_numbers(scenario: Scenario) -> dict[str, float]:
    """Every number that a plant of this kind has of its own, nondimensional."""
    plant = scenario.plant
    own = plant_numbers(plant.kind)
    scales = {number.field: plant.scales.of(number.unit) for number in own}
    values = {name: np.divide(getattr(plant, name), scale).tolist() for name, scale in scales.items()}
    return core_values(own, {"plant": values})


def core_setup(scenario: Scenario, changes: Mapping[str, float] | None = None) -> _core.DeviceSetup:
    """One run for the compiled loop; `changes`: numbers of `core_numbers` that are others."""
    return _made(scenario, changes) if changes else _core.DeviceSetup(_unchanged(scenario))


def check_single(scenario: Scenario) -> None:
    """Raises ValueError, in one sentence, where single precision cannot hold what the controller is computed with."""
    exact, lost = _lost_in_single(core_setup(scenario))
    if not lost.size:
        return
    found = core_numbers(scenario)
    for name in sorted(found, key=lambda name: -abs(math.log(abs(found[name]) or 1.0))):
        if len(_lost_in_single(core_setup(scenario, {name: 1.0}))[1]) < lost.size:
            raise ValueError(
                f"{name} is {found[name]:g}, nondimensional: it makes a coefficient of {exact[lost[0]]:.1e}, and "
                "single precision holds none beyond 3.4e38; use double"
            )
    raise ValueError(
        f"a coefficient of the controller is {exact[lost[0]]:.1e}: single precision holds none beyond 3.4e38; "
        "use double"
    )


def _lost_in_single(setup: _core.DeviceSetup) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """The coefficients, and the places of those that single precision cannot hold."""
    exact, single = (np.array([*_flat(_core.coefficients(setup, single))]) for single in (False, True))
    return exact, np.flatnonzero(np.isfinite(exact) & ~np.isfinite(single))


def _flat(nested: Any) -> Iterator[float]:
    if isinstance(nested, list | tuple):
        for one in nested:
            yield from _flat(one)
    elif not isinstance(nested, str):  # a constant that the exported file names
        yield float(nested)


@lru_cache(maxsize=8)
def _unchanged(scenario: Scenario) -> _core.DeviceSetup:
    """Kept, for `core_setup` to copy."""
    return _made(scenario, {})


class Parts(NamedTuple):
    """Everything that a set-up is made of; None for a part that it does not have."""

    kind: int
    numbers: dict[str, float]
    memory: tuple[float, float, float, float]  # arguments of core_kernel, for a controller that has memory
    seed: int  # the disturbance's: a double does not hold all
    reference: Reference | None
    terms: list[float]
    sensing: list[float]
    device: tuple[list[float], Any, Any, int] | None
    transverse: list[float]
    plant: tuple[int, list[float]] | None
    volts: list[float] | None

    def setup(self) -> _core.DeviceSetup:
        made = _core.DeviceSetup(self.kind, list(self.numbers.values()))
        if made.has_memory:
            made.kernel = core_kernel(*self.memory)
        made.seed = self.seed
        if self.reference is not None:
            made.set_reference(_lists(self.reference))
        made.set_terms(self.terms)
        made.sensing = self.sensing
        if self.device is not None:
            made.set_device(*self.device)
            made.set_transverse(self.transverse)
        if self.plant is not None:
            made.set_plant(*self.plant)
        if self.volts is not None:
            made.set_volts(self.volts)
        return made


def parts(scenario: Scenario) -> Parts:
    run, values = scenario.run, derived(scenario)
    place = PLANT_KINDS.index(scenario.plant.kind)
    device = None
    if not is_ideal(scenario):
        device = list(device_numbers(scenario, values).values()), *profiles(scenario), scenario.rate.seed
    return Parts(
        KINDS.index(scenario.controller.kind),
        core_numbers(scenario, values),
        (scenario.controller.order, run.step, run.duration, run.kernel_tolerance),
        scenario.disturbance.seed,
        None if is_plain(scenario) else scenario.reference,
        term_list(terms(scenario)),
        _sensing(scenario, values),
        device,
        transverse_list(scenario),
        (place, list(own_plant_numbers(scenario).values())) if place else None,
        volts_list(scenario) if has_volts(scenario) else None,
    )


def volts_list(scenario: Scenario) -> list[float]:
    """A device in volts as one list, which `take_volts` in settings.hpp reads."""
    device, scales, electrodes = scenario.device, scenario.plant.scales, scenario.electrodes.each
    shifts = [math.tau * each / scales.rate for each in device.common_mode_frequency]
    moves = term_list(frame_terms(scenario)) if device.has_common_mode else []
    return [
        *(scales.mass, scales.length, scales.rate),
        *electronics_numbers(scenario.electronics),
        *(float(len(electrodes)), *(number for one in electrodes for number in electrode_numbers(one))),
        *(*trim_numbers(scenario.trim), known_lag(scenario)),
        *(*shifts, *device.common_mode_quality, *moves),
    ]


def known_lag(scenario: Scenario) -> float:
    """Time, s, by which a trim knows readings and forces to be late: as the datasheet, or else simulated."""
    known, step = scenario.datasheet, scenario.run.step * scenario.plant.scales.time
    delay, late = getattr(known, "delay", None), getattr(known, "lag", None)
    delay = scenario.device.delay if delay is None else delay
    return float(delay * step + (lag(scenario) if late is None else late * scenario.plant.scales.time))


def _made(scenario: Scenario, changes: Mapping[str, float]) -> _core.DeviceSetup:
    found = parts(scenario)
    if unknown := set(changes) - set(found.numbers):
        raise KeyError(f"{min(unknown)} is not a number of this run")
    return found._replace(numbers=found.numbers | dict(changes)).setup()


def _sensing(scenario: Scenario, found: Derived) -> list[float]:
    """Parts around the controller, as sensing_of in settings.hpp lists them."""
    c, known, positions = scenario.controller, scenario.datasheet, scenario.device.sensing == "position"
    observed = c.observer_bandwidth if positions else 0.0
    rest = (
        c.event_threshold,
        c.event_share,
        *known.pickoff_gain_error,
        known.pickoff_misalignment,
        c.compensation_bandwidth,
    )
    if c.filter == "none":
        return [observed, *[0.0] * (1 + len(OF_FILTER)), *rest]
    assumed = datasheet(scenario, found)
    return [observed, c.observer_bandwidth, *(float(getattr(assumed, name)) for name in OF_FILTER), *rest]


@lru_cache(maxsize=32)
def _lists(reference: Reference) -> _core.ReferenceLists:
    """Kept, as runs of one reference are measured together."""
    terms = [(*term.amplitude, *term.frequency, *term.phase) for term in reference.terms or ()]
    return _core.ReferenceLists(terms, reference.points or ())
