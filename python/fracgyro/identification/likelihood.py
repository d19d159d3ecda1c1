"""Maximum likelihood of the parameters of all records of one state of the device, by projected Gauss-Newton.

The transients of each record enter linearly: they are projected out (variable projection), so that only K, C and B are
searched. Noise is white and its deviation, of each channel of each record, follows from the residuals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .model import Complex, Shape, resolvent, sampled
from .spectra import Spectrum
from .start import stable, stacked

Array = NDArray[np.float64]

MAX_STEPS = 40
SMALL_STEP = 1e-4  # length of a step, in standard deviations, that is not taken
SAME_NOISE = 1e-3  # relative change of the noise that needs no further fit
SINGULAR = 1e-14  # eigenvalues of the normal equations below this are rounding
SMALL_GAIN = 1e-13  # relative decrease of the sum of squares that is rounding
ROUNDING = 1e-12  # times the amplitude
WEIGHTINGS = 4  # fits, each with the noise that the one before has found


@dataclass(frozen=True)
class Fit:
    """Parameters, their covariance, the sum of squares over the noise and its degrees of freedom.

    `noise`: (records, axes), deviation of a sample; `residuals`: of each record, (bins, axes), over the noise;
    `transients`: of each record, its state at the first sample less that after the last.
    """

    parameters: Array
    covariance: Array
    squares: float
    freedom: int
    noise: Array
    residuals: tuple[Complex, ...]
    transients: tuple[Array, ...]
    steps: int


def linearized(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, parameters: Array, noise: Array
) -> tuple[Array, Array, list[Complex], list[Array]]:
    """Residuals over the noise and their Jacobian, both with the linear parts projected out.

    Also the residuals by record as complex bins, and the linear parts: the transient and, with drives, the
    feedthrough D0 and D1 by rows.
    """
    residuals, jacobians, parts, transients = [], [], [], []
    maps = {each.interval: sampled(shape, parameters, each.interval * unit) for each in spectra}
    for one, deviations in zip(spectra, noise, strict=True):
        n, bins = shape.axes, len(one.frequency)
        found = maps[one.interval]
        inverse = resolvent(shape, found, one.frequency / unit, one.interval * unit)
        seen = inverse[:, :n, :] / deviations[:, None]  # the pick-offs' rows
        turn = np.exp(1j * one.frequency * one.interval)
        columns = seen * turn[:, None, None]
        if shape.drives:
            columns = np.concatenate([columns, _feedthrough(one, unit, deviations)], axis=2)
        driven = one.force @ found.held.T
        forced = (seen @ driven[:, :, None])[:, :, 0]
        target = stacked((one.motion / deviations - forced).reshape(bins * n))
        matrix = stacked(columns.reshape(bins * n, -1))
        norms = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
        basis, upper = np.linalg.qr(matrix / norms)
        within = basis.T @ target
        linear = np.linalg.lstsq(upper, within, rcond=None)[0] / norms
        rest = target - basis @ within
        rest -= basis @ (basis.T @ rest)
        state = (inverse @ (driven + turn[:, None] * linear[None, : 2 * n])[:, :, None])[:, :, 0]
        by = found.less_one_by.transpose(2, 1, 0).reshape(2 * n, -1)
        pushed = state @ by + one.force @ found.held_by.transpose(2, 1, 0).reshape(shape.drives, by.shape[1])
        jacobian = stacked(-(seen @ pushed.reshape(bins, 2 * n, shape.count)).reshape(bins * n, shape.count))
        jacobians.append(jacobian - basis @ (basis.T @ jacobian))
        residuals.append(rest)
        parts.append((rest[: bins * n] + 1j * rest[bins * n :]).reshape(bins, n))
        transients.append(linear)
    return np.concatenate(residuals), np.concatenate(jacobians), parts, transients


def _feedthrough(one: Spectrum, unit: float, deviations: Array) -> Complex:
    """Columns of D0 U + (j w) D1 U, by rows of D0, then of D1: (bins, axes, 2 axes drives)."""
    n, drives = len(deviations), one.force.shape[1]
    found = np.zeros((len(one.frequency), n, 2 * n * drives), dtype=complex)
    middle = one.frequency.mean()
    for row in range(n):
        places = slice(row * drives, (row + 1) * drives)
        found[:, row, places] = one.force / deviations[row]
        later = slice((n + row) * drives, (n + row + 1) * drives)
        found[:, row, later] = 1j * (one.frequency - middle)[:, None] / unit * one.force / deviations[row]
    return found


Evaluation = tuple[Array, Array, list[Complex], list[Array]]  # result of `linearized`


@dataclass(frozen=True)
class Minimum:
    """Parameters that minimize the sum of squares, that sum, the number of steps, and `linearized` there."""

    parameters: Array
    squares: float
    steps: int
    evaluation: Evaluation


def search(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, start: Array, noise: Array, max_steps: int = MAX_STEPS
) -> Minimum:
    """The minimum from this start, by Levenberg's and Marquardt's method."""
    best, evaluation = start, linearized(shape, spectra, unit, start, noise)
    squares, damping, steps = float(evaluation[0] @ evaluation[0]), 0.0, 0
    while steps < max_steps:
        rest, jacobian, _, _ = evaluation
        norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        scaled = jacobian / norms
        squared, turned = np.linalg.eigh(scaled.T @ scaled)
        along = turned.T @ (scaled.T @ rest)
        improved = False
        while damping < 1e8:
            kept = squared > SINGULAR * squared[-1]
            step = -(turned @ np.where(kept, along / np.where(kept, squared + damping, 1.0), 0.0))
            if np.linalg.norm(scaled @ step) < SMALL_STEP:
                break
            candidate = stable(shape, best + step / norms)
            trial = linearized(shape, spectra, unit, candidate, noise)
            found = float(trial[0] @ trial[0])
            if found < squares * (1 - SMALL_GAIN):
                improved = True
                break
            damping = max(10 * damping, 1e-4)
        if not improved:
            break
        steps += 1
        best, squares, evaluation = candidate, found, trial
        damping = damping / 30 if damping > 1e-6 else 0.0
    return Minimum(best, squares, steps, evaluation)


def _least(one: Spectrum) -> float:
    """Noise that stands for rounding, of a sample."""
    least = ROUNDING * float(np.abs(one.motion).max()) / math.sqrt(one.samples)
    return max(least, float(np.finfo(float).tiny))


def maximize(shape: Shape, spectra: Sequence[Spectrum], unit: float, start: Array, noise: Array) -> Fit:
    """The fit from this start; `noise`, (records, axes), is a first value of the noise."""
    parameters, steps = start, 0
    rows = 2 * shape.axes * sum(len(each.frequency) for each in spectra)
    for i in range(WEIGHTINGS):
        found = search(shape, spectra, unit, parameters, noise)
        parameters, steps = found.parameters, steps + found.steps
        _, jacobian, parts, transients = found.evaluation
        free = rows - sum(map(len, transients)) - shape.count
        new = np.array(
            [
                np.maximum(old * np.sqrt(np.mean(np.abs(part) ** 2, axis=0) / 2 * (rows / free)), _least(one))
                for old, part, one in zip(noise, parts, spectra, strict=True)
            ]
        )
        if i == WEIGHTINGS - 1 or np.allclose(new, noise, rtol=SAME_NOISE):
            break
        noise = new
    norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    inverse = np.linalg.pinv(jacobian / norms, rcond=1e-14)
    covariance = (inverse @ inverse.T) / np.outer(norms, norms)
    return Fit(parameters, covariance, found.squares, free, noise, tuple(parts), tuple(transients), steps)
