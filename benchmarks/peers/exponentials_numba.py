"""The closed loop as an expert numba user would write it: exponentials, constant memory, every channel recorded.

Tried and kept: one row of exponentials per channel, which becomes vectors over channels; the reference by
rotation instead of sines; the record touched beforehand. Tried, no faster: one row of channels per exponential.
"""

import math
from collections.abc import Callable

import numba
import numpy as np

from .exponentials import operator
from .full_history import select
from .gyroscope import ESTIMATES, FREQUENCY, ORDER, START, STEP, advanced, held_step, make_law, row

WIDTH = 26  # position, velocity, reference, e, de/dt, s, u, disturbance: 2 each; 10 estimates


def make(
    count: int, rates: np.ndarray, weights: np.ndarray, fastmath: bool
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """run(noise, out): fills out (count, WIDTH), whose first two columns are positions, and returns it."""
    compiled = numba.njit(fastmath=fastmath)
    law = compiled(make_law(math.sqrt, compiled(select), math.copysign))
    advance, product = compiled(advanced), compiled(row)
    rate_x, rate_y = FREQUENCY
    turn_x, turn_y = (
        (math.cos(rate_x * STEP), math.sin(rate_x * STEP)),
        (math.cos(rate_y * STEP), math.sin(rate_y * STEP)),
    )
    step = held_step(STEP)
    designed = operator(ORDER, STEP, count, rates, weights)
    newest, past, before = designed.newest, designed.past, designed.before
    kernel = len(rates)

    @compiled
    def move(g, decay, readout, e_x, e_y, de_x, de_y):
        """Moves the exponentials past a sample; their sums for the next one."""
        i_x = i_y = d_x = d_y = 0.0
        for j in range(kernel):
            r, w = decay[j], readout[j]
            a, b, c, d = r * g[0, j] + e_x, r * g[1, j] + e_y, r * g[2, j] + de_x, r * g[3, j] + de_y
            g[0, j], g[1, j], g[2, j], g[3, j] = a, b, c, d
            i_x += w * a
            i_y += w * b
            d_x += w * c
            d_y += w * d
        return i_x, i_y, d_x, d_y

    @compiled
    def loop(noise, onset, g, decay, readout, sums, out):
        x, y, v_x, v_y = START
        estimates = ESTIMATES
        sin_x, cos_x, sin_y, cos_y = 0.0, 1.0, 0.0, 1.0
        first_x, first_y = x - sin_x, y - cos_y
        last_x, last_y = before * first_x, before * first_y
        last_dx, last_dy = before * (v_x - rate_x * cos_x), before * (v_y + rate_y * sin_y)
        i_x, i_y, d_x, d_y = sums[0], sums[1], sums[2], sums[3]
        for n in range(len(noise)):
            e_x, e_y, de_x, de_y = x - sin_x, y - cos_y, v_x - rate_x * cos_x, v_y + rate_y * sin_y
            integral = newest * e_x + past * last_x + i_x, newest * e_y + past * last_y + i_y
            derivative = (
                newest * de_x + past * last_dx + d_x + first_x * onset[n],
                newest * de_y + past * last_dy + d_y + first_y * onset[n],
            )
            acceleration = -rate_x * rate_x * sin_x, -rate_y * rate_y * cos_y
            s, u, slopes = law(
                (x, y), (v_x, v_y), (e_x, e_y), (de_x, de_y), acceleration, integral, derivative, estimates
            )
            out[n, 0], out[n, 1], out[n, 2], out[n, 3] = x, y, v_x, v_y
            out[n, 4], out[n, 5], out[n, 6], out[n, 7] = sin_x, cos_y, e_x, e_y
            out[n, 8], out[n, 9], out[n, 10], out[n, 11] = de_x, de_y, s[0], s[1]
            out[n, 12], out[n, 13], out[n, 14], out[n, 15] = u[0], u[1], noise[n, 0], noise[n, 1]
            for k in range(10):
                out[n, 16 + k] = estimates[k]
            estimates = advance(estimates, STEP, slopes)
            i_x, i_y, d_x, d_y = move(g, decay, readout, last_x, last_y, last_dx, last_dy)
            last_x, last_y, last_dx, last_dy = e_x, e_y, de_x, de_y
            f_x, f_y = u[0] + noise[n, 0], u[1] + noise[n, 1]
            x, y, v_x, v_y = (
                product(step[0], x, y, v_x, v_y, f_x, f_y),
                product(step[1], x, y, v_x, v_y, f_x, f_y),
                product(step[2], x, y, v_x, v_y, f_x, f_y),
                product(step[3], x, y, v_x, v_y, f_x, f_y),
            )
            sin_x, cos_x = sin_x * turn_x[0] + cos_x * turn_x[1], cos_x * turn_x[0] - sin_x * turn_x[1]
            sin_y, cos_y = sin_y * turn_y[0] + cos_y * turn_y[1], cos_y * turn_y[0] - sin_y * turn_y[1]
        return out

    start = np.array([START[0], START[1] - 1.0, START[2] - rate_x, START[3]])  # e and de/dt at t = 0

    def run(noise: np.ndarray, out: np.ndarray) -> np.ndarray:
        g = np.outer(start, designed.start)
        return loop(noise, designed.onset, g, designed.decay, designed.weights, g @ designed.weights, out)

    return run
