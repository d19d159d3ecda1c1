"""PID control with fractional integral and derivative (Podlubny 1999, doi:10.1109/9.739144)."""

from __future__ import annotations

import math

import numpy as np

from ..arguments import real
from .kernel import check, design
from .sampled import Between, Sampled, has_parabolas


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
    between: Between = "lines",
) -> Sampled:
    """Fractional PID kp e + ki I^lam e + kd D^mu e, sample by sample.

    `lam`, `mu`: orders of integral and derivative, in (0, 1]; 1 is the ordinary one. `step`: time between samples.
    `longest`: length of the memory, in the unit of step; older samples fade. For lam < 1 the gain at zero frequency is
    therefore finite, and a much longer constant error is not removed. `tolerance`: largest relative error of the
    kernels up to `longest` (`design`), and of integral and derivative. `between`: e between samples, as in
    `ExponentialSum.sampled`. The derivative is not filtered and the integral not limited. Raises TypeError or
    ValueError for gains that are not finite, and as `design`.

    >>> controller = fg.fractional.pid(10.0, 5.0, 0.8, 1.0, 0.6, step=1e-3, longest=10.0)
    >>> controller.count, round(controller.step(0.1), 3)  # recursions, first output
    (32, 8.112)
    """
    kp, ki, lam, kd, mu = map(real, ("kp", "ki", "lam", "kd", "mu"), (kp, ki, lam, kd, mu))
    step, longest, tolerance = map(real, ("step", "longest", "tolerance"), (step, longest, tolerance))
    for name, gain in (("kp", kp), ("ki", ki), ("kd", kd)):
        if not math.isfinite(gain):
            raise ValueError(f"{name} must be finite, got {gain}")
    for name, order in (("lam", lam), ("mu", mu)):
        if not 0.0 < order <= 1.0:
            raise ValueError(f"{name} must lie in (0, 1], got {order}")
    if not 0.0 < step < math.inf:
        raise ValueError(f"step must be positive and finite, got {step}")
    if (ki != 0.0 and lam < 1.0) or (kd != 0.0 and mu < 1.0):
        check(0.5, step, longest, tolerance, shortest_is="step")
    second_difference = 0.5 if has_parabolas(between) else 0.0  # weight of the difference between successive changes
    nothing = np.zeros((0, 2))
    found = Sampled(step, nothing, nothing, kp, 0.0, 0.0, 0.0)
    if ki != 0.0:
        integral = (  # the trapezoidal rule; the terms of parabolas telescope
            Sampled(step, np.array([[0.0, step]]), nothing, step / 2.0, step, -second_difference * step / 6.0, 0.0)
            if lam == 1.0
            else design(1.0 - lam, step, longest, tolerance).sampled(step, between=between)
        )
        found = found.plus(integral.times(ki))
    if kd != 0.0:
        derivative = (
            Sampled(step, nothing, nothing, 0.0, 0.0, (1.0 + second_difference) / step, -second_difference / step)
            if mu == 1.0
            else design(mu, step, longest, tolerance).sampled(step, derivative=True, between=between)
        )
        found = found.plus(derivative.times(kd))
    return found
