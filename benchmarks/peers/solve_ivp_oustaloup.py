"""A typical Simulink approach, in SciPy: a continuous controller, RK45 with steps of at most h, and Oustaloup filters.

One filter of 21 poles per axis serves both terms, as a careful user would set it up: Oustaloup's s^(α-1), expanded in
partial fractions D + Σ c_i/(s + p_i), acts on e, dz_i/dt = e - p_i z_i. As both e and ė are measured, D^(α-1) e =
D e + Σ c_i z_i and its exact derivative D ė + Σ c_i (e - p_i z_i), the Riemann-Liouville D^α e, are the two terms. The
first jumps by D e(0) at the start, so the second has an impulse there, which the force spreads over the first h. The
noise changes every h.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

from .full_history import select
from .gyroscope import DAMPING, ESTIMATES, FREQUENCY, OMEGA, ORDER, START, STEP, STIFFNESS, make_law

POLES, LOWEST, HIGHEST = 21, 1e-3, 2e3  # RK45 with steps of 1e-3 is stable for poles up to some 3e3


def oustaloup(order: float) -> tuple[float, np.ndarray, np.ndarray]:
    """D, c, p of s^order, -1 < order < 0, on [LOWEST, HIGHEST]."""
    k = np.arange(1, POLES + 1)
    ratio = HIGHEST / LOWEST
    poles = LOWEST * ratio ** ((2 * k - 1 + order) / (2 * POLES))
    zeros = LOWEST * ratio ** ((2 * k - 1 - order) / (2 * POLES))
    gain = HIGHEST**order
    between = -poles[:, None] + poles
    np.fill_diagonal(between, 1.0)
    residues = gain * np.prod(zeros - poles[:, None], axis=1) / np.prod(between, axis=1)
    return gain, residues, poles


def simulate(noise: np.ndarray, duration: float) -> np.ndarray:
    """Positions at 0, h, …, duration, (samples, 2)."""
    law = make_law(math.sqrt, select, math.copysign)
    (rate_x, rate_y), h = FREQUENCY, STEP
    direct, residues, poles = oustaloup(ORDER - 1.0)
    drained = residues * poles
    onward = float(residues.sum())
    plant = np.hstack([-STIFFNESS, -(DAMPING + 2 * OMEGA)]).tolist()
    forces = noise.tolist()
    jump_x, jump_y = direct * START[0] / h, direct * (START[1] - 1.0) / h
    last = len(forces) - 1

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        x, y, v_x, v_y, *estimates = state[:14].tolist()
        z = state[14:].reshape(2, POLES)
        sin_x, cos_x = math.sin(rate_x * t), math.cos(rate_x * t)
        sin_y, cos_y = math.sin(rate_y * t), math.cos(rate_y * t)
        e_x, e_y, de_x, de_y = x - sin_x, y - cos_y, v_x - rate_x * cos_x, v_y + rate_y * sin_y
        held = min(int(t / h + 1e-9), last)
        begun = 1.0 if held == 0 else 0.0
        (i_x, i_y), (d_x, d_y) = (z @ residues).tolist(), (z @ drained).tolist()
        integral = direct * e_x + i_x, direct * e_y + i_y
        derivative = (
            direct * de_x + onward * e_x - d_x + begun * jump_x,
            direct * de_y + onward * e_y - d_y + begun * jump_y,
        )
        acceleration = -rate_x * rate_x * sin_x, -rate_y * rate_y * cos_y
        _, u, rates = law((x, y), (v_x, v_y), (e_x, e_y), (de_x, de_y), acceleration, integral, derivative, estimates)
        noise_x, noise_y = forces[held]
        result = np.empty_like(state)
        (a, b, c, d), (e, f, g, k) = plant
        result[:14] = (
            v_x,
            v_y,
            a * x + b * y + c * v_x + d * v_y + u[0] + noise_x,
            e * x + f * y + g * v_x + k * v_y + u[1] + noise_y,
            *rates,
        )
        filters = result[14:].reshape(2, POLES)
        np.multiply(z, -poles, out=filters)
        filters[0] += e_x
        filters[1] += e_y
        return result

    first = np.concatenate([START, ESTIMATES, np.zeros(2 * POLES)])
    times = h * np.arange(round(duration / h) + 1)
    solution = solve_ivp(slope, (0.0, duration), first, method="RK45", max_step=h, first_step=h, t_eval=times)
    if not solution.success:
        raise RuntimeError(solution.message)
    return solution.y[:2].T
