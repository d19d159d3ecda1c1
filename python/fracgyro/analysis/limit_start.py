"""The limit of the transient: the least sum of squared errors from the start of a run, within the force limit.

A convex problem without noise, which could only add to it. Beyond a horizon the errors are left out, so that a long
approach has a limit that is too small, never one that is too large.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..scenario import Scenario
from .limit_model import Model, first_steady, reference

Array = NDArray[np.float64]
SHORTEST, LONGEST = 32, 128  # samples of the horizon with forces
SETTLED = 1e-3  # share of the squares in the last quarter of the horizon, below which it is long enough


def transient_error(scenario: Scenario, model: Model, transient: float) -> Array:
    """RMS error before the time `transient`, by axis, nondimensional; NaN without a sample there."""
    count = first_steady(scenario, transient)
    if not count:
        return np.full(2, np.nan)
    length, total = SHORTEST, np.zeros(2)
    while True:
        squares = _squares(scenario, model, min(count, model.delay + 1 + length))
        total, late = squares.sum(axis=0), squares[-length // 4 :].sum()
        if length >= LONGEST or len(squares) == count or late <= SETTLED * total.sum():
            return np.asarray(np.sqrt(total / count))
        length *= 2


def _squares(scenario: Scenario, model: Model, count: int) -> Array:
    """Squared errors of the first samples, (count, 2), at the least sum."""
    from scipy.optimize import lsq_linear  # takes a second

    run, f = scenario.run, model.advance
    state = np.array([*run.initial_position, *run.initial_velocity])
    free, answer = np.empty((count, 2)), np.empty((count, 2, 2))
    moved = model.force
    for n in range(count):
        free[n], answer[n] = state[:2], moved[:2]
        state, moved = f @ state, f @ moved
    errors = free - reference(scenario, count)[:, :2]
    first = model.delay + 1  # the first sample that a force moves
    acting = count - first
    if acting <= 0:
        return errors**2
    if model.force_limit == math.inf:
        errors[first:] = 0.0
        return errors**2
    whole = np.zeros((acting, 2, acting, 2))
    for n in range(acting):
        whole[n, :, : n + 1] = answer[n::-1].transpose(1, 0, 2)
    matrix = whole.reshape(2 * acting, 2 * acting) * model.force_limit
    found = lsq_linear(matrix, -errors[first:].ravel(), bounds=(-1.0, 1.0), method="bvls", max_iter=100 * acting)
    errors[first:] += (matrix @ found.x).reshape(acting, 2)
    return errors**2
