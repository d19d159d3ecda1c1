"""The linear plants as matrices, nondimensional regardless of run.units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .kinds import PLANT_KINDS
from .scenario import Scenario
from .to_core import own_plant_numbers
from .volts_core import plant_at_bias

LINEAR = (PLANT_KINDS[0], "general")  # plants with two axes and no spring that stiffens


def continuous(scenario: Scenario) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B of x' = A x + B (u + d) with x = [q, q'], eqs (9) and (13), for a plant.kind of LINEAR."""
    damping, stiffness, rate, more_damping, more_stiffness = plant_at_bias(scenario).nondimensional()
    d, k = damping + more_damping, stiffness + more_stiffness
    rates, forces = np.zeros((4, 4)), np.eye(4)[:, 2:]
    rates[:2, 2:] = np.eye(2)
    rates[2:, :2] = [[-k[0], -k[1]], [-k[1], -k[2]]]
    rates[2:, 2:] = [[-d[0], -d[1] + 2.0 * rate], [-d[1] - 2.0 * rate, -d[2]]]
    if scenario.plant.kind == "general":
        own = own_plant_numbers(scenario)
        rates[3, 0] -= own["plant.stiffness_asymmetry"]
        rates[3, 2] -= own["plant.damping_asymmetry"]
        rates[3], forces[3] = rates[3] / own["plant.mass_ratio"], forces[3] / own["plant.mass_ratio"]
    return rates, forces
