"""The gyroscope as matrices, eqs (9) and (13), nondimensional regardless of run.units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..scenario import Scenario, ScenarioError, check_scenario
from ..scenario.kinds import PLANT_KINDS
from ..scenario.linear import continuous
from ..scenario.to_core import core_setup

Matrix = NDArray[np.float64]

STATES = ["x", "y", "vx", "vy"]  # unit q0, q0 omega0
FORCES = ["u_x", "u_y"]  # unit m omega0^2 q0


def matrices(scenario: Scenario, sampled: bool) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """A, B, C, D for the states and outputs STATES and the inputs FORCES.

    The gyroscope is ideal: no disturbance, no device imperfections, constant rate plant.angular_rate. `sampled`:
    discrete with run.step and the numbers of the core's step; otherwise continuous. Raises ScenarioError if plant.kind
    is another plant.
    """
    check_scenario(scenario)
    if scenario.plant.kind != PLANT_KINDS[0]:
        raise ScenarioError(
            f"plant.kind is {scenario.plant.kind}: it must be {PLANT_KINDS[0]}, the only plant with matrices"
        )
    a, b = _sampled(scenario) if sampled else continuous(scenario)
    return a, b, np.eye(4), np.zeros((4, 2))


def _sampled(scenario: Scenario) -> tuple[Matrix, Matrix]:
    linear = scenario.replace({"controller.kind": "pid"})  # unused; needs no kernel design
    whole = np.array(_core.plant_map(core_setup(linear)))
    return whole[:, :4], whole[:, 4:]
