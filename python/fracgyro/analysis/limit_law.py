"""The law at the limit of tracking: a Kalman filter and the linear-quadratic feedback that prices chattering.

The force of sample n acts from sample n + d on. With the estimate z of the state at n + d, after the measurement at n,

    z' = F z + G u + w,    cov w = F^d (P- - P+) F^d^T,    error = z + (error of the prediction by d steps)

where P-, P+ are the covariances of the stationary filter before and after a measurement. The parts are independent. The
feedback minimizes E |z_position|^2 + rho |W D2 u|^2, with D2 u the second difference of u and W = diag(1/RMS of the
force along the reference).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from .limit_model import Feedforward, Model

Array = NDArray[np.float64]
EXACT = 1e-6  # standard deviation of a sensor without noise, relative to what the disturbance moves in a step
PRICES = (1e-9, 1e24)  # prices of chattering: the first leaves the error without a limit, the last leaves no feedback
DOUBLINGS = 100


@dataclass(frozen=True)
class Result:
    """By axis, nondimensional."""

    error: Array  # RMS
    chattering: Array  # by the definition of fg.metrics.chattering
    price: float  # rho


@dataclass(frozen=True)
class Estimate:
    """Covariances of the stationary filter."""

    present: Array  # covariance of the state at the measurement, after it
    acting: Array  # that of the state at which the force begins to act
    learned: Array  # that of the change of that estimate by a measurement
    after: Array  # that of the state one step later: no law has a smaller error

    @classmethod
    def of(cls, model: Model) -> Estimate:
        f, process = model.advance, model.process
        present, learned = _filtered(model)
        acting = present
        for _ in range(model.delay):
            acting, learned = f @ acting @ f.T + process, f @ learned @ f.T
        return cls(present, acting, learned, f @ acting @ f.T + process)


def _filtered(model: Model) -> tuple[Array, Array]:
    """Covariance of the estimate, and of what a measurement adds to it."""
    nothing = np.zeros((4, 4))
    if not model.process.any():
        return nothing, nothing  # the start is known
    if len(model.sensed) == 4 and not model.noise.any():
        return nothing, model.process
    scale = np.repeat(np.sqrt([np.trace(model.process[:2, :2]), np.trace(model.process[2:, 2:])]), 2)
    f, process = model.advance * scale / scale[:, np.newaxis], model.process / np.outer(scale, scale)
    c = model.sensed * scale
    noise = np.maximum(np.diag(model.noise), EXACT**2 * np.diag(c @ process @ c.T))
    c = c / np.sqrt(noise)[:, np.newaxis]  # noise of variance 1
    before = riccati(f.T, c.T, process)
    innovation = c @ before @ c.T + np.eye(len(c))
    gain = np.linalg.solve(innovation, c @ before).T
    kept = np.eye(4) - gain @ c
    present, learned = kept @ before @ kept.T + gain @ gain.T, gain @ innovation @ gain.T
    if not model.noise[:2, :2].any():  # positions are exact
        present[:2] = present[:, :2] = 0.0
    return present * np.outer(scale, scale), learned * np.outer(scale, scale)


def riccati(a: Array, b: Array, q: Array) -> Array:
    """X = A^T X A - A^T X B (1 + B^T X B)^-1 B^T X A + Q: the limit of its iteration from X = 0, by doubling.

    Unlike scipy.linalg.solve_discrete_are it also solves systems with modes next to the unit circle.
    """
    g, found = b @ b.T, q
    for _ in range(DOUBLINGS):
        inner = np.linalg.solve(np.eye(len(a)) + g @ found, np.hstack([a, g]))
        more = a.T @ found @ inner[:, : len(a)]
        g = g + a @ inner[:, len(a) :] @ a.T
        a = a @ inner[:, : len(a)]
        g, found = 0.5 * (g + g.T), found + 0.5 * (more + more.T)
        if np.abs(more).max() <= 1e-15 * np.abs(found).max():
            break
    return found


def lyapunov(a: Array, q: Array) -> Array:
    """X = A X A^T + Q for a stable A, by doubling."""
    found = q
    for _ in range(DOUBLINGS):
        more = a @ found @ a.T
        found, a = found + more, a @ a
        if np.abs(more).max() <= 1e-15 * np.abs(found).max():
            break
    return found


class Law:
    """The feedback for one scenario, at any price of chattering."""

    def __init__(self, model: Model, feedforward: Feedforward, estimate: Estimate) -> None:
        self.feedforward, self.estimate = feedforward, estimate
        self.least = np.sqrt(np.diag(estimate.after)[:2])  # errors without a limit of chattering
        self.unit = float(self.least.max())
        if not self.unit:
            return
        self.strength = self.unit / np.abs(model.force[:2]).max()  # the force that undoes it in a step
        rms = feedforward.rms
        weights = self.strength / np.where(rms > 0.0, rms, rms.max() or self.strength)
        self.weight = float(weights.max())
        self.weights = weights / self.weight
        scale = np.repeat([self.unit, self.strength * np.abs(model.force[2:]).max()], 2)
        g = model.force * self.strength / scale[:, np.newaxis]
        # States: z, the last force, its last change. Input: the second difference.
        self.input = np.vstack([g, np.eye(2), np.eye(2)])
        self.advance = np.vstack(
            [
                np.hstack([model.advance * scale / scale[:, np.newaxis], g, g]),
                np.hstack([np.zeros((2, 4)), np.eye(2), np.eye(2)]),
                np.hstack([np.zeros((2, 6)), np.eye(2)]),
            ]
        )
        self.driven = np.zeros((8, 8))
        self.driven[:4, :4] = estimate.learned / np.outer(scale, scale)

    def at(self, price: float) -> Result:
        """The law for this price, relative to that at which a change by `strength` costs as much as the error."""
        weights = math.sqrt(price) * self.weights
        solution = riccati(self.advance, self.input / weights, np.diag([1.0, 1.0, *np.zeros(6)]))
        b = self.input
        gain = np.linalg.solve(np.diag(weights**2) + b.T @ solution @ b, b.T @ solution @ self.advance)
        states = lyapunov(self.advance - b @ gain, self.driven)
        force = np.hstack([np.zeros((2, 4)), np.eye(2), np.eye(2)]) - gain
        square, second = (
            np.diag(each @ states @ each.T) * self.strength**2 + along**2
            for each, along in ((force, self.feedforward.rms), (gain, self.feedforward.second_difference))
        )
        error = np.sqrt(np.diag(states)[:2] * self.unit**2 + np.diag(self.estimate.acting)[:2])
        return Result(error, np.sqrt(second / square), price * (self.unit / self.weight) ** 2)

    def within(self, ceiling: float) -> Result:
        """The law whose larger chattering is the ceiling; with the least price if even that chatters less.

        Raises ValueError for a ceiling that no price keeps.
        """
        if not self.unit:  # no noise: no feedback
            along = self.feedforward
            with np.errstate(invalid="ignore"):
                found = kept = Result(self.least, along.second_difference / along.rms, 0.0)
        else:
            found, kept = map(self.at, PRICES)
        if found.chattering.max() <= ceiling:
            return Result(self.least, found.chattering, 0.0)
        if (least := float(kept.chattering.max())) >= ceiling:
            raise ValueError(
                f"chattering is {ceiling:g}: it must be greater than {least:.4g}, which the force along the reference "
                "has without feedback"
            )

        def excess(logarithm: float) -> float:
            return math.log(float(self.at(math.exp(logarithm)).chattering.max()) / ceiling)

        return self.at(math.exp(brentq(excess, *map(math.log, PRICES), xtol=1e-9)))
