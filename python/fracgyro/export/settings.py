"""The numbers of a scenario that its faces outside Python offer: name, value, unit, range and meaning of each.

Names are those of the scenario, with [0], .x or .xx for parts; [plant] is in SI units but for its initial state, all
else nondimensional, as in the TOML. What a field means and may be comes from tables.py; its unit, which has no place of
its own there, from UNITS below, which a test compares with EQUATIONS.md.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, get_args

from .. import _core
from ..device import Device, Rate
from ..scenario import Scenario, ScenarioError
from ..setup import core_setup, guard
from ..table import toml_value

LARGEST_EXACT = 2**53 - 1  # faces take their numbers as doubles

# As in EQUATIONS.md, in ASCII; a tuple has one for each part. `fixed`: has meaning at t = 0 alone, or would make the
# reference jump by a phase that nobody asked for.
UNITS: dict[str, str | tuple[str, ...]] = {
    "reference.amplitude": "q0",
    "reference.frequency": "omega0",
    "reference.phase": "rad",
    "controller.fractional_gain": "omega0^(2-alpha)",
    "controller.terminal_gain": "q0^(1-c)*omega0",
    "controller.terminal_exponent": "1",
    "controller.singularity_floor": "q0",
    "controller.layer_thickness": "q0*omega0",
    "controller.force_limit": "m*omega0^2*q0",
    "controller.switching_limit": "1",
    "adaptation.damping_gain": "m/q0^2",
    "adaptation.stiffness_gain": "m*omega0^2/q0^2",
    "adaptation.rate_gain": "1/q0^2",
    "adaptation.bound_gain": ("m*omega0^2", "m*omega0^2/q0^2", "m/q0^2"),
    "adaptation.leakage": "omega0",
    "adaptation.dead_zone": "q0*omega0",
    "adaptation.projection": "1",
    "adaptation.forgetting": "omega0",
    "adaptation.rate_forgetting": "omega0",
    "adaptation.initial_damping": "m*omega0",
    "adaptation.initial_stiffness": "m*omega0^2",
    "adaptation.initial_rate": "omega0",
    "adaptation.initial_bound": ("m*omega0^2*q0", "m*omega0^2", "m*omega0"),
    "guard.plant_tolerance": "1",
    "guard.force_tolerance": "m*omega0^2*q0",
    "guard.position_tolerance": "q0",
    "guard.velocity_tolerance": "q0*omega0",
    "guard.patience": "1",
    "guard.saturation_patience": "1",
    "plant.damping": "N.s/m",
    "plant.stiffness": "N/m",
    "plant.damping_deviation": "N.s/m",
    "plant.stiffness_deviation": "N/m",
    "plant.angular_rate": "rad/s",
    "plant.initial_position": "q0",
    "plant.initial_velocity": "q0*omega0",
    "disturbance.standard_deviation": "m*omega0^2*q0",
    "disturbance.seed": "1",
    "disturbance.amplitude": "m*omega0^2*q0",
    "disturbance.frequency": "omega0",
    "disturbance.phase": "rad",
}
FIXED = {
    "reference.frequency",
    "reference.phase",
    "adaptation.initial_damping",
    "adaptation.initial_stiffness",
    "adaptation.initial_rate",
    "adaptation.initial_bound",
    "plant.initial_position",
    "plant.initial_velocity",
    "disturbance.seed",
    "disturbance.frequency",
    "disturbance.phase",
}
# What a scenario says by adaptation.initial_ratio, and the core as numbers.
INITIAL = {
    "adaptation.initial_damping": "D estimate at t = 0: in a scenario initial_ratio times plant.damping.",
    "adaptation.initial_stiffness": "K estimate at t = 0: in a scenario initial_ratio times plant.stiffness.",
    "adaptation.initial_rate": "Omega_z estimate at t = 0: in a scenario initial_ratio times plant.angular_rate, or "
    "initial_rate.",
}
# In the order of the core's numbers.
CHOICES = {
    "adaptation.kind": ["gradient", "composite"],
    "controller.derivative": ["caputo", "riemann_liouville"],
    "controller.layer": ["linear", "quadratic"],
    "controller.rate_law": ["skew", "printed"],
    "disturbance.kind": ["none", "noise", "sine"],
}
TABLES = {name: type(table).model_fields for name, table in Scenario()}
PLANT_SCALES = {"damping": "damping", "stiffness": "stiffness", "angular_rate": "rate"}


@dataclass(frozen=True)
class Limits:
    """low <= value <= high, or < where `strict` says so."""

    low: float = -math.inf
    high: float = math.inf
    strict: bool = False


@dataclass(frozen=True)
class Setting:
    """One number. The core's, nondimensional, is value / scale."""

    name: str
    value: float
    scale: float
    unit: str
    description: str
    limits: Limits
    tunable: bool

    @property
    def path(self) -> str:
        return path_of(self.name)


def path_of(name: str) -> str:
    """The scenario's field of which `name` is a part: plant.damping of plant.damping.xx."""
    return re.sub(r"(\.[xy]{1,2}|\[\d\])$", "", name)


def without_plant(scenario: Scenario) -> Scenario:
    """For the controller alone, which knows neither the rate nor the device, unless it is to observe the velocity."""
    if scenario.device.sensing != "full":
        return scenario
    return scenario.model_copy(update={"rate": Rate(), "device": Device(), "guard": guard(scenario)})


def core_numbers(scenario: Scenario) -> dict[str, float]:
    """Every number of a run as the core takes it, in its order (sim/fracgyro/settings.hpp).

    Raises ScenarioError for what the faces that take numbers do not simulate: a moving rate, a device not ideal.
    """
    for table, ideal in (("rate", Rate()), ("device", Device())):
        for name, value in getattr(scenario, table):
            wanted = getattr(ideal, name)
            if value != wanted and (table, name) != ("rate", "seed"):
                raise ScenarioError(
                    f"{table}.{name} is {toml_value(value)[:80]}: it must be {toml_value(wanted)} to be exported, as "
                    "FMU, browser and lanes know a constant rate and an ideal device alone"
                )
    if scenario.disturbance.seed > LARGEST_EXACT:
        raise ScenarioError(f"disturbance.seed is {scenario.disturbance.seed}: it must be below 2^53 to be exported")
    return dict(_core.setup_settings(core_setup(scenario)))


def core_modes(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Rates and weights of the modes designed for the scenario; none where it needs none."""
    rates, weights = _core.setup_modes(core_setup(scenario))
    return list(rates), list(weights)


def settings(scenario: Scenario) -> list[Setting]:
    """The numbers that a person may change, in the core's order."""
    found = []
    for name, number in core_numbers(scenario).items():
        path = path_of(name)
        if path not in UNITS:
            continue
        unit, scale = UNITS[path], _scale(scenario, path)
        if isinstance(unit, tuple):
            unit = unit[int(name[-2])]
        value = number if scale == 1.0 else _si(scenario, name)
        found.append(Setting(name, value, scale, unit, describe(path), limits(path), path not in FIXED))
    return found


def _scale(scenario: Scenario, path: str) -> float:
    table, _, field = path.partition(".")
    kind = PLANT_SCALES.get(field.removesuffix("_deviation")) if table == "plant" else None
    return float(getattr(scenario.plant.scales, kind)) if kind else 1.0


def _si(scenario: Scenario, name: str) -> float:
    """The scenario's own number: the core's times the scale may differ from it in the last place."""
    _, field, *part = name.split(".")
    value: Any = scenario.plant.effective_stiffness() if field == "stiffness" else getattr(scenario.plant, field)
    return float(getattr(value, part[0]) if part else value)


def _table_field(path: str) -> Any:
    table, _, field = path.partition(".")
    return TABLES[table].get(field)


def describe(path: str) -> str:
    """What the field means, as its comment in the TOML says it."""
    return INITIAL.get(path) or str(_table_field(path).description)


def limits(path: str) -> Limits:
    """What tables.py allows for each part of the field."""
    if path in INITIAL:
        return Limits()
    info = _table_field(path)
    marks = list(info.metadata)
    for part in get_args(info.annotation)[:1]:
        for mark in getattr(part, "__metadata__", ()):
            marks += getattr(mark, "metadata", [])
    found = {name: getattr(mark, name) for mark in marks for name in ("gt", "ge", "lt", "le") if hasattr(mark, name)}
    return Limits(
        found.get("gt", found.get("ge", -math.inf)),
        found.get("lt", found.get("le", math.inf)),
        "gt" in found or "lt" in found,
    )
