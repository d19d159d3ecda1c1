"""Scenarios by the name of a shipped one or by a path: the one reader of every scenario that a user names."""

from __future__ import annotations

import os
from pathlib import Path

from .messages import ScenarioError, did_you_mean
from .scenario import Scenario
from .shipped import NAMES
from .table import format_value
from .volts_core import has_volts, plant_at_bias


def named(given: str | os.PathLike[str], folder: str | os.PathLike[str] = ".") -> Scenario:
    """The shipped scenario of this name, or the one in this file, relative to `folder`.

    A name wins over a file: a file called dual_mass without a suffix is ./dual_mass. A Path is always a file.
    Raises ScenarioError for anything else; for a misspelled name it suggests the nearest one.
    """
    if isinstance(given, str) and given in NAMES:
        return Scenario.shipped(given)
    path = Path(folder, given)
    if isinstance(given, str) and is_name(given) and not os.path.lexists(path):
        raise ScenarioError(
            f"{format_value(given)} is neither a shipped scenario nor a file{did_you_mean(given, NAMES)}"
        )
    return Scenario.load(path if Path(folder) != Path() else given)


def is_name(given: str) -> bool:
    """True if the text looks like a name: no suffix, no folder."""
    return not os.path.splitext(given)[1] and os.path.basename(given) == given and given.isprintable()


def exactly_sensed(name: str) -> Scenario:
    """A shipped scenario with position and velocity known exactly, as the laws suppose, and composite adaptation.

    Those without sensing noise are as shipped; those in volts have the springs at bias, and forces as asked for. Raises
    ScenarioError for an unknown name.
    """
    scenario = Scenario.shipped(name)
    if has_volts(scenario):
        law: dict[str, object] = {"device.sensing": "full", "adaptation.kind": "composite"}
        springs = dict(plant_at_bias(scenario).stiffness)
        return scenario.replace({**law, "plant.stiffness": springs, "electrodes": [], "electronics": {}})
    if scenario.adaptation.kind != "joint":
        return scenario
    exact = {"device.sensing": "full", "device.position_noise_density": 0.0}
    return scenario.replace({**exact, "adaptation.kind": "composite"})
