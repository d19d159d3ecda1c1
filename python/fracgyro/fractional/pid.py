"""PID control with fractional integral and derivative (Podlubny 1999, doi:10.1109/9.739144)."""

from __future__ import annotations

import math

import numpy as np

from .kernel import design
from .sampled import Sampled


def pid(
    kp: float,
    ki: float,
    lam: float,
    kd: float,
    mu: float,
    *,
    step: float,
    longest: float,
    tolerance: float = 1e-6,
) -> Sampled:
    """kp e + ki I^lam e + kd D^mu e, sample by sample, for e that is linear between samples.

    lam, mu: orders of integral and derivative, in (0, 1]; 1 is the ordinary one. step: time between samples. longest:
    time to which the past counts in full, in the unit of step; what is older fades. tolerance: largest relative error
    of the kernels up to there (`design`), and with it of integral and derivative. Nothing filters the derivative, and
    nothing limits the integral. Raises ValueError for gains that are not finite, and as `design` does.

    >>> controller = fg.fractional.pid(10.0, 5.0, 0.8, 1.0, 0.6, step=1e-3, longest=10.0)
    >>> len(controller.kept), round(controller.step(0.1), 3)  # states, first output
    (32, 8.112)
    """
    for name, gain in (("kp", kp), ("ki", ki), ("kd", kd)):
        if not math.isfinite(gain):
            raise ValueError(f"{name} must be finite, got {gain}")
    for name, order in (("lam", lam), ("mu", mu)):
        if not 0.0 < order <= 1.0:
            raise ValueError(f"{name} must lie in (0, 1], got {order}")
    if not 0.0 < step < math.inf:
        raise ValueError(f"step must be positive and finite, got {step}")
    nothing, one = np.zeros(0), np.ones(1)
    found = Sampled(step, nothing, nothing, nothing, nothing, 0.0, kp)
    if ki != 0.0:
        half = step / 2
        integral = (
            Sampled(step, one, half * one, half * one, one, half, half)
            if lam == 1.0
            else design(1.0 - lam, step, longest, tolerance).sampled(step)
        )
        found = found.plus(integral.times(ki))
    if kd != 0.0:
        derivative = (
            Sampled(step, nothing, nothing, nothing, nothing, -1.0 / step, 1.0 / step)
            if mu == 1.0
            else design(mu, step, longest, tolerance).sampled(step, derivative=True)
        )
        found = found.plus(derivative.times(kd))
    return found
