"""The Cramér-Rao bound of the rate estimate, as an angle random walk."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..scenario import Scenario
from ..simulation.outside import ControllerLike, in_own_units, units
from ..simulation.simulate import simulate

SAMPLES = 200_000


@dataclass(frozen=True)
class Bound:
    """N in rad/sqrt(s) of the best unbiased estimate of a constant Omega_z: no angle random walk can be less.

    `known`: D and K are known, as to an estimator that has long watched them and forgets only Omega_z. `unknown`: they
    are unknown constants, found from the same span of time as Omega_z.
    """

    known: float
    unknown: float


def bound_angle_random_walk(scenario: Scenario, controller: ControllerLike | None = None) -> Bound | None:
    """From the noise and the motion of the scenario; both bounds.

    From the regressors of the steady motion, which `controller` brings about if there is one: each step of length h
    adds phi phi^T h/S to the information, phi^T theta being the force of D, K and Omega_z in eq. (9) and S the
    two-sided density of d. None where the disturbance is not white noise or the motion does not separate the
    parameters.
    """
    d = scenario.disturbance
    if d.kind != "noise":
        return None
    hold = scenario.run.step if d.hold is None else d.hold
    density = d.density if d.density is not None else (d.standard_deviation or 0.0) ** 2 * hold
    every = max(1, scenario.run.steps // SAMPLES)
    scenario = in_own_units(scenario.replace({"run.record_every": every}), controller)
    run = simulate(scenario, controller)
    half, unit = run.sizes["time"] // 2, units(scenario)
    (x, y), (vx, vy) = run["position"].values[half:].T / unit.length, run["velocity"].values[half:].T / unit.velocity
    none = np.zeros_like(x)
    # Rows of (9) by (Dxx, Dxy, Dyy, Kxx, Kxy, Kyy, Omega_z).
    rows = np.concatenate(
        [np.stack([vx, vy, none, x, y, none, -2 * vy], axis=1), np.stack([none, vx, vy, none, x, y, 2 * vx], axis=1)]
    )
    information = rows.T @ rows / len(x)
    scale = np.sqrt(np.diag(information))
    if not scale.all() or np.linalg.cond(information / np.outer(scale, scale)) > 1e10:
        return None
    inflation = np.linalg.inv(information / np.outer(scale, scale))[-1, -1]
    scales = scenario.plant.scales
    known = math.sqrt(density) / scale[-1] * scales.rate * math.sqrt(scales.time)
    return Bound(known, known * math.sqrt(inflation))
