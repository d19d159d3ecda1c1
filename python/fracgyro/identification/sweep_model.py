"""Sweeps: maximum likelihood of K and C from the steady response over frequency.

The response to each drive is

    H(w) = exp(-j (phi + (w - w_m) tau)) [ (-w^2 + jw C + K)^-1 B + j (w - w_m) D1 + D0 ]

with B and D1 real and D0, the feedthrough, complex. `phi` holds the instrument's phase and the delay at the middle w_m
of the sweep; tau its slope. The feedthrough is as late as the rest: with a constant one, sweeps of 1e-5 noise were not
white. B, D0 and D1 are linear: they are projected out. All derivatives are written by hand, as
finite differences of a mode with a quality factor of 10^6 have no correct digit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .model import Complex, Shape
from .start import stable, stacked

Array = NDArray[np.float64]

SMALL_STEP = 1e-4  # length of a step, in standard deviations, that is not taken
SINGULAR = 1e-14  # eigenvalues of the normal equations below this are rounding
# A narrow sweep hardly shows the slopes of delay and feedthrough, and drifts of the instrument resemble them. So they
# have a deviation before any record, as physics has it: a delay of half a period, a feedthrough such as jw Cp.
DELAY = 3.0  # 1/omega0
SLOPE = 1.0  # times the feedthrough over omega0


@dataclass(frozen=True)
class SweepModel:
    """A sweep in units of omega0, which is `unit` rad/s, with the noise of each pick-off."""

    shape: Shape
    unit: float
    w: Array
    middle: float
    values: Complex
    noise: Array

    def linear(self, parameters: Array) -> tuple[Complex, list[Complex], Complex]:
        """Columns of the linear part for one drive, over the noise: B, D1, then D0 real, D0 imaginary; also their
        derivatives with respect to K, C, phi and tau, and the inverse of the bracket."""
        n, square = self.shape.axes, self.shape.axes**2
        stiffness, damping = parameters[:square].reshape(n, n), parameters[square : 2 * square].reshape(n, n)
        phase, delay = parameters[2 * square :]
        w, bins = self.w, len(self.w)
        bracket = -((w**2)[:, None, None] * np.eye(n)) + 1j * w[:, None, None] * damping + stiffness
        inverse: Complex = np.asarray(np.linalg.inv(bracket), dtype=complex)
        turn = np.exp(-1j * (phase + (w - self.middle) * delay))[:, None, None] / self.noise[:, None]
        still: Complex = np.zeros((bins, n, 4 * n), dtype=complex)
        columns = still.copy()
        columns[:, :, :n] = turn * inverse
        columns[:, :, n : 2 * n] = turn * 1j * (w - self.middle)[:, None, None] * np.eye(n)
        columns[:, :, 2 * n : 3 * n] = turn * np.eye(n)
        columns[:, :, 3 * n :] = turn * 1j * np.eye(n)
        derivatives: list[Complex] = []
        for power in (0, 1):
            for i in range(n):
                for k in range(n):
                    one = still.copy()
                    product = -inverse[:, :, i, None] * inverse[:, None, k, :]
                    one[:, :, :n] = turn * product * ((1j * w) ** power)[:, None, None]
                    derivatives.append(one)
        derivatives.append(-1j * columns)
        derivatives.append(-1j * (w - self.middle)[:, None, None] * columns)
        return columns, derivatives, inverse

    def stacked_columns(self, columns: Complex) -> Array:
        """The columns as real rows, and below them a row for each expected slope of the feedthrough."""
        bins, n = len(self.w), self.shape.axes
        slopes = np.zeros((n, 4 * n))
        size = np.median(np.abs(self.values), axis=(0, 2)) + 1e-3 * np.abs(self.values).max(axis=(0, 2))
        slopes[:, n : 2 * n] = np.diag(1 / (SLOPE * size))
        return np.concatenate([stacked(columns.reshape(bins * n, -1)), slopes])

    def moved(self, derivatives: list[Complex], linear: Array) -> Array:
        """Derivative of the rows of one drive with respect to K, C, phi and tau, for these linear parts."""
        bins, n = len(self.w), self.shape.axes
        rows = np.stack([stacked((each @ linear).reshape(bins * n)) for each in derivatives], axis=1)
        return np.concatenate([rows, np.zeros((n, len(derivatives)))])

    def evaluate(self, parameters: Array) -> tuple[Array, Array, list[Array]]:
        """Residuals and Jacobian with the linear parts projected out, and the linear parts of each drive."""
        columns, derivatives, _ = self.linear(parameters)
        bins, n = len(self.w), self.shape.axes
        matrix = self.stacked_columns(columns)
        norms = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
        basis, upper = np.linalg.qr(matrix / norms)
        rests, jacobians, parts = [], [], []
        for drive in range(self.shape.drives):
            target = stacked((self.values[:, :, drive] / self.noise).reshape(bins * n))
            target = np.concatenate([target, np.zeros(n)])
            within = basis.T @ target
            linear = np.linalg.lstsq(upper, within, rcond=None)[0] / norms
            rests.append(target - matrix @ linear)
            along = self.moved(derivatives, linear)
            jacobians.append(-(along - basis @ (basis.T @ along)))
            parts.append(linear)
        known = np.zeros((1, len(parameters)))
        known[0, -1] = 1 / DELAY
        return np.concatenate([*rests, known @ parameters]), np.concatenate([*jacobians, known]), parts


def searched(problem: SweepModel, start: Array, steps: int) -> tuple[Array, float]:
    """Levenberg and Marquardt from this start: the parameters and the sum of squares."""
    best, damping = start, 0.0
    rest, jacobian, _ = problem.evaluate(best)
    squares = float(rest @ rest)
    for _ in range(steps):
        norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        normal = (jacobian / norms).T @ (jacobian / norms)
        squared, turned = np.linalg.eigh(normal)
        along = turned.T @ ((jacobian / norms).T @ rest)
        improved = False
        while damping < 1e8:
            kept = squared > SINGULAR * squared[-1]
            scaled = -(turned @ np.where(kept, along / np.where(kept, squared + damping, 1.0), 0.0))
            size = math.sqrt(max(float(scaled @ normal @ scaled), 0.0))
            if size < SMALL_STEP:
                break
            candidate = best + scaled / norms
            candidate[:-2] = stable(Shape(problem.shape.axes), candidate[:-2])
            trial = problem.evaluate(candidate)
            found = float(trial[0] @ trial[0])
            if found < squares:
                improved = True
                break
            damping = max(10 * damping, 1e-4)
        if not improved:
            break
        best, squares, rest, jacobian = candidate, found, trial[0], trial[1]
        damping = damping / 30 if damping > 1e-6 else 0.0
    return best, squares
