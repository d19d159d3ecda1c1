"""The feedback of `lqg` and `internal_model` again, in NumPy and SciPy, from its equations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.linalg import expm, solve_discrete_are

AXES = 2


def held(flow: np.ndarray, inputs: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """The maps of a state and of an input that is held for a step."""
    states, held_inputs = inputs.shape
    whole = np.zeros((states + held_inputs,) * 2)
    whole[:states] = np.hstack([flow, inputs])
    found = expm(step * whole)
    return found[:states, :states], found[:states, states:]


def regulator(k: float, d: float, bandwidth: float, margin: float, h: float, delay: int) -> np.ndarray:
    """The feedback of e, its rate and earlier forces of one axis."""
    usable = min(bandwidth, (1.1 + 1.4 * (1 - margin) ** 3) / (1 + margin * delay / 2))
    late = margin * max(0.0, 1 - 0.29 / usable) / (1 + delay / 4)
    f, g = held(np.array([[0, 1], [-k, -d]]), np.array([[0.0], [1.0]]), h)
    size = 2 + max(2, delay + 1)
    a, b = np.zeros((size, size)), np.zeros((size, 1))
    a[:2, :2] = f
    newest = np.array([2.0, -1.0])  # u_n without its second difference, of the last two
    b[2] = 1.0
    a[2, 2:4] = newest
    a[3:, 2:-1] = np.eye(size - 3)
    for steps, share in ((delay, 1 - late), (delay + 1, late)):
        if steps == 0:
            a[:2, 2:4] += share * g * newest
            b[:2] += share * g
        else:
            a[:2, 1 + steps] += share * g[:, 0]
    cost = np.zeros((size, size))
    cost[0, 0] = 1.0
    price = np.array([[usable**-4]])
    units = np.diag([(h / usable) ** 2, h / usable, *[1.0] * (size - 2)])  # in which SciPy succeeds
    inverse = np.linalg.inv(units)
    a, b = inverse @ a @ units, inverse @ b
    x = solve_discrete_are(a, b, cost, price)
    found: np.ndarray = np.linalg.solve(price + b.T @ x @ b, b.T @ x @ a)[0] @ inverse
    found[2:4] -= newest
    return found


class SmoothFeedback:
    """`controller`: the scenario's table; `per_axis`: stiffness and damping of the nominal plant on each axis."""

    def __init__(self, controller: Any, per_axis: list[tuple[float, float]], h: float, delay: int) -> None:
        self.gains = np.array(
            [regulator(k, d, controller.loop_bandwidth, controller.delay_margin, h, delay) for k, d in per_axis]
        )
        self.near = 0.25 * controller.force_limit / (self.gains[:, 0] / self.gains[:, 1]) ** 2
        self.past = np.zeros((AXES, self.gains.shape[1] - 2))

    def force(self, error: np.ndarray, rate: np.ndarray) -> np.ndarray:
        found = np.zeros(AXES)
        for axis in range(AXES):
            e, near = error[axis], self.near[axis]
            if math.isfinite(near) and abs(e) > near:
                e = math.copysign(2 * math.sqrt(near * abs(e)) - near, e)
            found[axis] = -self.gains[axis] @ [e, rate[axis], *self.past[axis]]
        return found

    def remember(self, acting: np.ndarray) -> None:
        """The part of the acting force that is feedback."""
        self.past = np.hstack([acting[:, None], self.past[:, :-1]])
