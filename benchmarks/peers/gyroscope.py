"""The paper's study, shared by the peers: its numbers, the control law in scalars, and the plant's held step.

The loop is the corrected one, as `fracgyro.Scenario.paper()`: linear layer, Riemann-Liouville derivative, skew law for
the rate. The law is written over plain numbers because that is the fastest form for each peer: Python runs it without
making arrays, numba and JAX compile it.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm

STEP, STEPS, ORDER = 1e-3, 80_000, 0.9
DAMPING = np.array([[0.01, 0.002], [0.002, 0.01]])
STIFFNESS = np.array([[63.955, 12.779], [12.779, 95.92]]) / 0.18  # (47); (48) rounds it to four digits
OMEGA = np.array([[0.0, -0.1], [0.1, 0.0]])
RATIO = 0.95  # initial estimates of the three over their true values
START = (0.5, 0.5, 0.0, 0.0)  # x, y and their rates
FREQUENCY = (math.pi, 0.5 * math.pi)  # reference sin πt, cos ½πt
LAMBDA1, LAMBDA2, LAYER, FLOOR, GAIN = 10.0, 0.5, 0.06, 1e-6, 150.0
ROOT_FLOOR = math.sqrt(FLOOR)
# Initial estimates: D and K as xx, xy, yy; Ωz; b0, b1, b2.
ESTIMATES = (
    *(RATIO * np.array([0.01, 0.002, 0.01])).tolist(),
    *(RATIO * STIFFNESS[[0, 0, 1], [0, 1, 1]]).tolist(),
    RATIO * 0.1,
    *(0.1, 0.2, 0.3),
)


def held_step(h: float) -> tuple[tuple[float, ...], ...]:
    """Rows x, y, x', y' of the next sample; columns the same of this one, then the force on each axis, held."""
    flow = np.zeros((6, 6))
    flow[:2, 2:4] = flow[2:4, 4:] = np.eye(2)
    flow[2:4, :2], flow[2:4, 2:4] = -STIFFNESS, -(DAMPING + 2 * OMEGA)
    return tuple(tuple(row) for row in expm(h * flow)[:4].tolist())


def row(m, x, y, v_x, v_y, f_x, f_y):
    """One row of `held_step`, applied."""
    return m[0] * x + m[1] * y + m[2] * v_x + m[3] * v_y + m[4] * f_x + m[5] * f_y


def advanced(estimates, h, rates):
    """One Euler step of the ten estimates; written out, for numba."""
    dxx, dxy, dyy, kxx, kxy, kyy, rate, b0, b1, b2 = estimates
    r = rates
    return (
        dxx + h * r[0],
        dxy + h * r[1],
        dyy + h * r[2],
        kxx + h * r[3],
        kxy + h * r[4],
        kyy + h * r[5],
        rate + h * r[6],
        b0 + h * r[7],
        b1 + h * r[8],
        b2 + h * r[9],
    )


def references(times: np.ndarray) -> np.ndarray:
    """(samples, 6): reference x, y, its rate x, y, its acceleration x, y."""
    (a, b), (p, q) = FREQUENCY, (FREQUENCY[0] * times, FREQUENCY[1] * times)
    columns = [np.sin(p), np.cos(q), a * np.cos(p), -b * np.sin(q), -(a**2) * np.sin(p), -(b**2) * np.cos(q)]
    return np.ascontiguousarray(np.stack(columns, axis=-1))


def make_law(sqrt: Callable[..., Any], select: Callable[..., Any], copysign: Callable[..., Any]) -> Callable[..., Any]:
    """Equations (16), (35), (36), (44) of one sample, for the number type of `sqrt`, `select` and `copysign`."""

    def law(q, v, e, de, acceleration, integral, derivative, estimates):
        """From q, v, e, de/dt, d²r/dt², D^(α-1) e, D^α e, each a pair: the pairs s and u, and d/dt of the estimates."""
        dxx, dxy, dyy, kxx, kxy, kyy, rate, b0, b1, b2 = estimates
        size_x, size_y = abs(e[0]), abs(e[1])
        root_x, root_y = sqrt(size_x), sqrt(size_y)
        floored_x, floored_y = select(size_x > FLOOR, root_x, ROOT_FLOOR), select(size_y > FLOOR, root_y, ROOT_FLOOR)
        s_x = de[0] + LAMBDA1 * integral[0] + LAMBDA2 * copysign(root_x, e[0])
        s_y = de[1] + LAMBDA1 * integral[1] + LAMBDA2 * copysign(root_y, e[1])
        norm_s = sqrt(s_x * s_x + s_y * s_y)
        norm_q = sqrt(q[0] * q[0] + q[1] * q[1])
        norm_v = sqrt(v[0] * v[0] + v[1] * v[1])
        gain = (b0 + b1 * norm_q + b2 * norm_v) / select(norm_s > LAYER, norm_s, LAYER)
        drift_x = LAMBDA1 * derivative[0] + 0.5 * LAMBDA2 * de[0] / floored_x
        drift_y = LAMBDA1 * derivative[1] + 0.5 * LAMBDA2 * de[1] / floored_y
        u_x = dxx * v[0] + (dxy - 2.0 * rate) * v[1] + kxx * q[0] + kxy * q[1] + acceleration[0] - drift_x - gain * s_x
        u_y = (dxy + 2.0 * rate) * v[0] + dyy * v[1] + kxy * q[0] + kyy * q[1] + acceleration[1] - drift_y - gain * s_y
        moved = (
            -GAIN * v[0] * s_x,
            -0.5 * GAIN * (v[0] * s_y + v[1] * s_x),
            -GAIN * v[1] * s_y,
            -GAIN * q[0] * s_x,
            -0.5 * GAIN * (q[0] * s_y + q[1] * s_x),
            -GAIN * q[1] * s_y,
            GAIN * (s_x * v[1] - s_y * v[0]),
            norm_s,
            1.6 * norm_s * norm_q,
            1.6 * norm_s * norm_v,
        )
        return (s_x, s_y), (u_x, u_y), moved

    return law
