"""The gyroscope as matrices, eqs (9) and (13), nondimensional regardless of run.units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scenario import Scenario, check_scenario
from ..simulation.plant import Plant

Matrix = NDArray[np.float64]

STATES = ["x", "y", "vx", "vy"]  # unit q0, q0 omega0
FORCES = ["u_x", "u_y"]  # unit m omega0^2 q0


def matrices(scenario: Scenario, sampled: bool) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """A, B, C, D for the states and outputs STATES and the inputs FORCES.

    The gyroscope is ideal: no disturbance, no device imperfections, constant rate plant.angular_rate. `sampled`:
    discrete with run.step and the numbers of the core's step; otherwise continuous.
    """
    check_scenario(scenario)
    a, b = _sampled(scenario) if sampled else _continuous(scenario)
    return a, b, np.eye(4), np.zeros((4, 2))


def _continuous(scenario: Scenario) -> tuple[Matrix, Matrix]:
    damping, stiffness, rate, damping_deviation, stiffness_deviation = scenario.plant.nondimensional()
    d, k = damping + damping_deviation, stiffness + stiffness_deviation
    a = np.zeros((4, 4))
    a[:2, 2:] = np.eye(2)
    a[2:, :2] = [[-k[0], -k[1]], [-k[1], -k[2]]]
    a[2:, 2:] = [[-d[0], -d[1] + 2.0 * rate], [-d[1] - 2.0 * rate, -d[2]]]
    return a, np.eye(4)[:, 2:]


def _sampled(scenario: Scenario) -> tuple[Matrix, Matrix]:
    """Columns are the motion one step after a unit state or force; products with 1 and sums with 0 are exact."""
    columns = []
    for x, y, vx, vy, *force in np.eye(6).tolist():
        run = {"initial_position": (x, y), "initial_velocity": (vx, vy), "units": "nondimensional"}
        ideal = Scenario.model_validate(
            {
                "plant": scenario.plant,
                "reference": scenario.reference,
                "controller": {"kind": "pid"},  # unused; needs no kernel design
                "disturbance": {"kind": "none"},
                "run": dict(scenario.run) | run,
            }
        )
        motion = Plant(ideal).step(force)
        columns.append([*motion.position, *motion.velocity])
    whole = np.array(columns).T
    return whole[:, :4], whole[:, 4:]
