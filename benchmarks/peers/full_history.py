"""The usual implementation of this controller: a loop over the samples that sums the whole history at each.

Grünwald-Letnikov sums for both fractional terms. Three variants:
    `arrays`             NumPy as most would write it, vectors and matrices throughout, for which `simulate` is there;
    `make(...)`          the same over plain numbers, where only the sums are arrays: twice as fast in Python, and what
                         numba compiles. The sums are four `np.dot` over contiguous memory; in numba that is as fast as
                         one pass with reassociation allowed (tried), for the memory's speed decides;
    `make(one_sum=True)` half the sums: D^α e of Grünwald and Letnikov is the difference quotient of their D^(α-1) e.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .gyroscope import (
    DAMPING,
    ESTIMATES,
    FLOOR,
    FREQUENCY,
    GAIN,
    LAMBDA1,
    LAMBDA2,
    LAYER,
    OMEGA,
    ORDER,
    RATIO,
    START,
    STEP,
    STIFFNESS,
    advanced,
    held_step,
    make_law,
    references,
    row,
)

Run = Callable[[np.ndarray], np.ndarray]  # noise (samples, 2) to positions (samples, 2)


def weights(order: float, count: int) -> np.ndarray:
    """Grünwald-Letnikov weights (-1)^k binomial(order, k) / h^order, newest last."""
    k = np.arange(1, count)
    newest_first = np.concatenate([[1.0], np.cumprod((k - 1 - order) / k)])
    return np.ascontiguousarray(newest_first[::-1]) / STEP**order


def arrays(noise: np.ndarray) -> np.ndarray:
    """NumPy throughout."""
    count = len(noise)
    of_integral, of_derivative = weights(ORDER - 1, count), weights(ORDER, count)
    step = np.array(held_step(STEP))
    reference = references(STEP * np.arange(count))
    d, k, w = RATIO * DAMPING, RATIO * STIFFNESS, RATIO * OMEGA
    b = np.array(ESTIMATES[7:])
    state = np.array(START)
    errors, out = np.zeros((2, count)), np.empty((count, 2))
    for n in range(count):
        q, v = state[:2], state[2:]
        e, de = q - reference[n, :2], v - reference[n, 2:4]
        errors[:, n] = e
        past = errors[:, : n + 1]
        integral, derivative = past @ of_integral[count - 1 - n :], past @ of_derivative[count - 1 - n :]
        size = np.abs(e)
        s = de + LAMBDA1 * integral + LAMBDA2 * np.sqrt(size) * np.sign(e)
        norms = np.array([1.0, np.sqrt(q @ q), np.sqrt(v @ v)])
        norm_s = np.sqrt(s @ s)
        u = (d + 2 * w) @ v + k @ q + reference[n, 4:] - LAMBDA1 * derivative
        u -= 0.5 * LAMBDA2 * de / np.sqrt(np.maximum(size, FLOOR)) + b @ norms / max(norm_s, LAYER) * s
        vs, qs = np.outer(v, s), np.outer(q, s)
        d = d - STEP * 0.5 * GAIN * (vs + vs.T)
        k = k - STEP * 0.5 * GAIN * (qs + qs.T)
        w = w + STEP * GAIN * (vs - vs.T)
        b = b + STEP * norm_s * np.array([1.0, 1.6, 1.6]) * norms
        out[n] = q
        state = step[:, :4] @ state + step[:, 4:] @ (u + noise[n])
    return out


def select(condition: bool, yes: float, no: float) -> float:
    return yes if condition else no


def make(compiled: Callable[..., Any], one_sum: bool) -> Run:
    """Plain numbers; `compiled` is numba.njit, or does nothing."""
    law = compiled(make_law(math.sqrt, compiled(select), math.copysign))
    advance, product = compiled(advanced), compiled(row)
    rate_x, rate_y = FREQUENCY

    @compiled
    def loop(noise, integral, derivative, step):
        count = len(noise)
        x, y, v_x, v_y = START
        estimates = ESTIMATES
        i_x = i_y = 0.0
        errors_x, errors_y, out = np.zeros(count), np.zeros(count), np.empty((count, 2))
        for n in range(count):
            phase_x, phase_y = rate_x * STEP * n, rate_y * STEP * n
            sin_x, cos_x, sin_y, cos_y = math.sin(phase_x), math.cos(phase_x), math.sin(phase_y), math.cos(phase_y)
            e = x - sin_x, y - cos_y
            de = v_x - rate_x * cos_x, v_y + rate_y * sin_y
            errors_x[n], errors_y[n] = e
            past_x, past_y, start = errors_x[: n + 1], errors_y[: n + 1], count - 1 - n
            before_x, before_y = i_x, i_y
            i_x, i_y = float(np.dot(past_x, integral[start:])), float(np.dot(past_y, integral[start:]))
            if one_sum:
                d_x, d_y = (i_x - before_x) / STEP, (i_y - before_y) / STEP
            else:
                d_x, d_y = float(np.dot(past_x, derivative[start:])), float(np.dot(past_y, derivative[start:]))
            acceleration = -rate_x * rate_x * sin_x, -rate_y * rate_y * cos_y
            _, u, rates = law((x, y), (v_x, v_y), e, de, acceleration, (i_x, i_y), (d_x, d_y), estimates)
            estimates = advance(estimates, STEP, rates)
            out[n, 0], out[n, 1] = x, y
            f_x, f_y = u[0] + noise[n, 0], u[1] + noise[n, 1]
            x, y, v_x, v_y = (
                product(step[0], x, y, v_x, v_y, f_x, f_y),
                product(step[1], x, y, v_x, v_y, f_x, f_y),
                product(step[2], x, y, v_x, v_y, f_x, f_y),
                product(step[3], x, y, v_x, v_y, f_x, f_y),
            )
        return out

    def run(noise: np.ndarray) -> np.ndarray:
        return loop(noise, weights(ORDER - 1, len(noise)), weights(ORDER, len(noise)), held_step(STEP))

    return run
