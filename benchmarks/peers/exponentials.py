"""I^(1-α) in constant memory, for the compiled peers: exponentials of the kernel.

An operator as derived by an expert user of numba or JAX: on the four channels e_x, e_y, ė_x, ė_y, each linear between
samples. A mode's state is F = ∫ exp(-s (t-τ)) f(τ) dτ. With r = exp(-s h) and μ_k = ∫₀¹ x^k exp(-s h x) dx it
moves as F ← r F + A f_past + B f, where A = h μ₁ and B = h (μ₀ - μ₁). Stored is g = (F - B f)/(A + r B), which moves as
g ← r g + f_past.
"""

from dataclasses import dataclass
from math import gamma

import numpy as np


@dataclass(frozen=True)
class Operator:
    """I^(1-α) f = newest f + past f_past + Σ weights g; then g ← decay g + f_past and f_past ← f.

    Begun with g = start f(0) and f_past = before f(0), the first sample's result is 0, as it must be, without a branch.
    """

    newest: float
    past: float
    decay: np.ndarray
    weights: np.ndarray
    start: np.ndarray
    before: float
    onset: np.ndarray  # mean of t^(-α)/Γ(1-α) over each hold, e(0) times which makes Caputo's D^α Riemann-Liouville's


def operator(order: float, h: float, count: int, rates: np.ndarray, weights: np.ndarray) -> Operator:
    """`rates`, `weights`: Σ weights exp(-rates t) ≈ t^(-order)/Γ(1-order) on [h, count h]."""
    nu = 1.0 - order
    local = h**nu / gamma(1.0 + nu)
    x, w = np.polynomial.legendre.leggauss(40)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    kernel = np.exp(-np.outer(rates * h, x))
    mu0, mu1 = kernel @ w, kernel @ (w * x)
    a, b, r = h * mu1, h * (mu0 - mu1), np.exp(-rates * h)
    newest = local / (nu + 1.0)
    past = local * nu / (nu + 1.0) + float(np.sum(weights * r * b))
    readout = weights * r * (a + r * b)
    second = -b / (a + r * b)  # g at the second sample, in f(0)
    before = float((newest + np.sum(readout * second / r)) / (np.sum(readout / r) - past))
    return Operator(
        newest=newest,
        past=past,
        decay=r,
        weights=readout,
        start=(second - before) / r,
        before=before,
        onset=np.diff((h * np.arange(count + 1)) ** nu) / (h * gamma(1.0 + nu)),
    )
