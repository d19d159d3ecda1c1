"""Numbers of a scenario that integrations outside Python offer: value, unit, range and meaning of each.

They come from the core (kinds.numbers), with the names of the scenario and [0], .x or .xx for parts. [plant] is in SI
units, everything else is nondimensional, as in the TOML.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from .. import _core
from ..scenario import Scenario, ScenarioError, to_core
from ..scenario.device import Device, Rate
from ..scenario.device_core import is_ideal
from ..scenario.kinds import DEVICE_NUMBERS, PLANT_KINDS, Channel, Number, numbers
from ..scenario.schema import Plant
from ..scenario.table import format_value
from ..scenario.to_core import core_setup, datasheet, guard
from ..scenario.volts import Electrodes, Electronics
from ..scenario.volts_core import drive, has_volts, plant_at_bias
from .units import scale_and_unit

MAX_EXACT = 2**53 - 1  # integrations use doubles


@dataclass(frozen=True)
class Setting:
    """One adjustable number. The core's nondimensional number is value / scale."""

    number: Number
    value: float
    scale: float

    @property
    def name(self) -> str:
        return self.number.name


def without_plant(scenario: Scenario) -> Scenario:
    """The scenario for the controller only: ideal plant and constant rate, with the same sensors.

    Raises ScenarioError for another plant or a trim.
    """
    check_controller(scenario)
    assumed = {"guard": guard(scenario), "datasheet": datasheet(scenario)}
    device = Device(**{"sensing": scenario.device.sensing})
    linear = scenario.replace({"plant.kind": PLANT_KINDS[0]})
    volts = {"plant": plant_at_bias(linear), "electrodes": Electrodes(), "electronics": Electronics()}
    return linear.model_copy(update={"rate": Rate(), "device": device, **assumed, **volts})


def knows_rounding(scenario: Scenario) -> bool:
    """True if drivers round the force and the controller filters with the rounded one, which it must be given."""
    return has_volts(scenario) and any(drive(scenario)[1]) and to_core.force_aware(scenario)


def check_rounding(scenario: Scenario) -> None:
    """Raises ScenarioError where the filter of a target without the rounded force would take the steps for nothing."""
    if knows_rounding(scenario) and scenario.datasheet.force_noise is None:
        steps = max(drive(scenario)[1]) / scenario.plant.scales.force / math.sqrt(12)
        whole = math.hypot(datasheet(scenario).force_noise or 0.0, steps)
        raise ScenarioError(
            "datasheet.force_noise is not given: drivers round the force, and this target has no function that states "
            f"the rounded one to the filter; give it with their steps as noise, {whole:.6g}"
        )


def check_plant(scenario: Scenario) -> None:
    """Raises ScenarioError for a plant other than the gyroscope, which targets do not have."""
    if scenario.plant.kind != PLANT_KINDS[0]:
        raise ScenarioError(
            f"plant.kind is {scenario.plant.kind}: it must be {PLANT_KINDS[0]}, the only plant that is exported"
        )


def check_controller(scenario: Scenario) -> None:
    """Raises ScenarioError for another plant or a trim, which targets of a controller without its loop do not have."""
    check_plant(scenario)
    for name, value in scenario.trim:
        if name in ("tuning", "quadrature") and value != "fixed":
            raise ScenarioError(f"trim.{name} is {value}: it must be fixed for a controller without its loop")


def core_numbers(scenario: Scenario) -> dict[str, float]:
    """All numbers of a run for the core, in its order (include/fracgyro/sim/settings.hpp)."""
    check_plant(scenario)
    if scenario.disturbance.seed > MAX_EXACT:
        raise ScenarioError(f"disturbance.seed is {scenario.disturbance.seed}: it must be below 2^53 to be exported")
    names = [number.name for number in numbers(scenario.controller.kind)]
    return dict(zip(names, _core.setup_settings(core_setup(scenario)), strict=True))  # the designed kernel's, too


def sensing(scenario: Scenario) -> list[float]:
    """Parts around the controller, for the core, as sensing_of in settings.hpp lists them."""
    return list(core_setup(scenario).sensing)


def observer_bandwidth(scenario: Scenario) -> float:
    """Observer bandwidth for the core: 0 if the velocity is measured.

    For targets without filter, trigger, disturbance observer around the controller, and correction of pick-offs. Raises
    ScenarioError for these.
    """
    c = scenario.controller
    trigger, observer = "event trigger", "disturbance observer around a controller"
    for name, part in (("event_threshold", trigger), ("event_share", trigger), ("compensation_bandwidth", observer)):
        if getattr(c, name) > 0:
            raise ScenarioError(
                f"controller.{name} is {format_value(getattr(c, name))}: it must be 0.0 for this target, which has no "
                f"{part}"
            )
    if scenario.controller.filter != "none":
        raise ScenarioError(
            f"controller.filter is {format_value(scenario.controller.filter)}: it must be none for this target, which "
            "has no filter"
        )
    for name, off in (("pickoff_gain_error", (0.0, 0.0)), ("pickoff_misalignment", 0.0)):
        if (known := getattr(scenario.datasheet, name)) != off:
            raise ScenarioError(
                f"datasheet.{name} is {format_value(known)}: it must be {format_value(off)} for this target, which "
                "does not correct measurements"
            )
    return sensing(scenario)[0]


def device_numbers(scenario: Scenario) -> dict[str, float]:
    """The numbers of a dynamic rate and a real device as the core takes them; none if the device is ideal."""
    if is_ideal(scenario):
        return {}
    if scenario.rate.seed > MAX_EXACT:
        raise ScenarioError(f"rate.seed is {scenario.rate.seed}: it must be below 2^53 to be exported")
    return to_core.device_numbers(scenario)


def volts(scenario: Scenario) -> list[float]:
    """A device in volts for its loop, as take_volts in settings.hpp reads it; empty without."""
    return to_core.volts_list(scenario) if has_volts(scenario) else []


def reference_lists(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Numbers of the reference that are lists: of each term of a sum of sines, and of each row of a table."""
    reference = scenario.reference
    terms = [n for term in reference.terms or () for n in (*term.amplitude, *term.frequency, *term.phase)]
    rows = [n for row in _core.ReferenceLists([], reference.points or ()).rows for n in row]
    return terms, rows


def core_kernel(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Poles and weights of the exponentials for the scenario; empty if it needs none."""
    rates, weights = _core.setup_kernel(core_setup(scenario))
    return list(rates), list(weights)


def offered(kind: str) -> list[Number]:
    """Independent numbers of a run of this controller kind, in the core's order."""
    return [number for number in numbers(kind) if number.settable != "never"]


def settings(scenario: Scenario) -> list[Setting]:
    """The settings of a scenario."""
    values = core_numbers(scenario)
    found = []
    for number in offered(scenario.controller.kind):
        scale, _ = scale_and_unit(number.unit, scenario.plant.scales, in_si(number))
        value = values[number.name] if scale == 1.0 else _si(scenario, number)
        found.append(Setting(number, value, scale))
    return found


def device_settings(scenario: Scenario) -> list[Setting]:
    """Those of a dynamic rate and a real device; none if the device is ideal."""
    values = device_numbers(scenario)
    return [Setting(n, values[n.name], 1.0) for n in DEVICE_NUMBERS if values and n.settable != "never"]


def in_si(number: Number) -> bool:
    return number.table == "plant"


def unit(number: Number) -> str:
    return scale_and_unit(number.unit, Plant().scales, in_si(number))[1]


def meaning(number: Number) -> str:
    """Description from the core, nondimensional; for [plant] from its comment in the TOML."""
    return str(Plant.model_fields[number.field].description) if number.table == "plant" else number.meaning


def _si(scenario: Scenario, number: Number) -> float:
    """The scenario's number; the core's number times the scale may differ in the last digit."""
    plant = plant_at_bias(scenario)
    value: Any = plant.effective_stiffness() if number.field == "stiffness" else getattr(plant, number.field)
    return float(getattr(value, number.part[1:]) if number.part else value)


def columns(channel: Channel) -> list[str]:
    """Column names of a channel."""
    if channel.dimension is None:
        return [channel.name]
    return [f"{channel.name}[{at}]" if isinstance(at, int) else f"{channel.name}.{at}" for at in channel.labels]
