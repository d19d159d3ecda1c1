"""What is usually written for this controller: a loop over the samples that sums the whole history at every one.

The printed control law, Grünwald-Letnikov sums for both fractional terms, semi-implicit Euler for the plant. One
function, run by NumPy as it is and compiled by numba: two peers of the core. For timing only; tests have their oracle.
"""

import numpy as np


def weights(order: float, count: int) -> np.ndarray:
    """Grünwald-Letnikov weights (-1)^k binomial(order, k)."""
    k = np.arange(1, count)
    return np.concatenate([[1.0], np.cumprod((k - 1 - order) / k)])


def full_history(steps: int, h: float, noise: np.ndarray, derivative: np.ndarray, integral: np.ndarray) -> np.ndarray:
    """Positions (steps + 1, 2). derivative, integral: weights, newest last, already divided by h^order."""
    d = np.array([[0.01, 0.002], [0.002, 0.01]])
    k = np.array([[355.3, 70.99], [70.99, 532.9]])
    w = np.array([[0.0, -0.1], [0.1, 0.0]])
    dh, kh, wh = 0.95 * d, 0.95 * k, 0.95 * w
    b = np.array([0.1, 0.2, 0.3])
    q, v = np.array([0.5, 0.5]), np.zeros(2)
    history_x, history_y = np.zeros(steps + 1), np.zeros(steps + 1)
    out = np.zeros((steps + 1, 2))
    for n in range(steps + 1):
        t = n * h
        r = np.array([np.sin(np.pi * t), np.cos(0.5 * np.pi * t)])
        dr = np.array([np.pi * np.cos(np.pi * t), -0.5 * np.pi * np.sin(0.5 * np.pi * t)])
        ddr = np.array([-(np.pi**2) * np.sin(np.pi * t), -0.25 * np.pi**2 * np.cos(0.5 * np.pi * t)])
        e, de = q - r, v - dr
        history_x[n], history_y[n] = e
        past_x, past_y = history_x[: n + 1], history_y[: n + 1]
        de_frac = np.array([np.dot(past_x, derivative[steps - n :]), np.dot(past_y, derivative[steps - n :])])
        ie_frac = np.array([np.dot(past_x, integral[steps - n :]), np.dot(past_y, integral[steps - n :])])
        size = np.maximum(np.abs(e), 1e-6)
        s = de + 10.0 * ie_frac + 0.5 * np.sign(e) * np.sqrt(np.abs(e))
        ns, nq, nv = np.sqrt(np.sum(s * s)), np.sqrt(np.sum(q * q)), np.sqrt(np.sum(v * v))
        rho = b[0] + b[1] * nq + b[2] * nv
        gain = rho / ns if ns >= 0.06 else ns * rho / 0.0036
        a = dh + 2.0 * wh
        u = np.zeros(2)
        for i in range(2):
            u[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + kh[i, 0] * q[0] + kh[i, 1] * q[1] + ddr[i]
            u[i] -= 10.0 * de_frac[i] + 0.25 * de[i] / np.sqrt(size[i]) + gain * s[i]
        for i in range(2):
            for j in range(2):
                dh[i, j] -= h * 75.0 * (v[i] * s[j] + s[i] * v[j])
                kh[i, j] -= h * 75.0 * (q[i] * s[j] + s[i] * q[j])
                wh[j, i] -= h * 150.0 * (v[i] * s[j] - s[i] * v[j])
        b += h * ns * np.array([1.0, 1.6 * nq, 1.6 * nv])
        out[n] = q
        force = np.zeros(2)
        for i in range(2):
            force[i] = u[i] + noise[n, i]
            for j in range(2):
                force[i] -= (d[i, j] + 2.0 * w[i, j]) * v[j] + k[i, j] * q[j]
        v = v + h * force
        q = q + h * v
    return out


def arguments(steps: int, h: float, order: float) -> tuple[np.ndarray, np.ndarray]:
    """The two weight arrays that `full_history` takes, newest last."""
    return (
        np.ascontiguousarray(weights(order, steps + 1)[::-1]) / h**order,
        np.ascontiguousarray(weights(order - 1.0, steps + 1)[::-1]) / h ** (order - 1.0),
    )
