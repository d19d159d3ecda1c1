"""First values of the parameters, by linear least squares on the equation of motion in the frequency domain.

(-w^2 + jw C + K) Y = B U + t0 + jw t1 is linear in K, C, B and the transients t0, t1 of each record. The error of the
equation is the noise of Y times the bracket, so each pass weights it by the inverse of the last one (C. Sanathanan,
J. Koerner, IEEE Trans. Autom. Control 8, 1963, 56-58).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .model import Shape, generator
from .spectra import Spectrum

Array = NDArray[np.float64]

PASSES = 12
SAME = 1e-4  # of the damping: a change that ends the passes


def stacked(values: NDArray[Any]) -> Array:
    """Real parts above imaginary parts, along the first axis."""
    return np.asarray(np.concatenate([values.real, values.imag]))


def least_squares(matrix: Array, target: Array) -> Array:
    """The least-squares solution, by QR of the tall matrix with its columns scaled, then SVD of the small triangle."""
    norms = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    upper: Array = np.asarray(np.linalg.qr(np.column_stack([matrix / norms, target]))[1])
    count = matrix.shape[1]
    return np.asarray(np.linalg.lstsq(upper[:count, :count], upper[:count, -1], rcond=None)[0] / norms)


def linear_start(shape: Shape, spectra: Sequence[Spectrum], unit: float) -> Array:
    """Parameters in units of `unit`, omega0 in rad/s, from spectra whose noise is equal in all channels."""
    guess = np.zeros(shape.count)
    guess[: shape.axes**2] = (np.mean([each.frequency.mean() for each in spectra]) / unit) ** 2 * np.eye(
        shape.axes
    ).ravel()
    guess[shape.axes**2 : 2 * shape.axes**2] = 1e-3 * np.eye(shape.axes).ravel()
    for _ in range(PASSES):
        last, guess = guess, stable(shape, _one_pass(shape, spectra, unit, guess))
        # Further passes change it by far less than the fit, which begins there.
        if np.abs(guess - last).max() < SAME * np.abs(guess[shape.axes**2 : 2 * shape.axes**2]).max():
            break
    return guess


def _one_pass(shape: Shape, spectra: Sequence[Spectrum], unit: float, guess: Array) -> Array:
    n, drives = shape.axes, shape.drives
    stiffness, damping, _ = shape.matrices(guess)
    blocks, targets = [], []
    for i, one in enumerate(spectra):
        w = one.frequency / unit
        bracket = -((w**2)[:, None, None] * np.eye(n)) + 1j * w[:, None, None] * damping + stiffness
        weight = np.linalg.inv(bracket)
        bins = len(w)
        columns = np.zeros((bins, n, shape.count + 2 * n * len(spectra)), dtype=complex)
        for row in range(n):  # the equation of each axis
            at = row * n
            columns[:, row, at : at + n] = one.motion
            columns[:, row, n * n + at : n * n + at + n] = 1j * w[:, None] * one.motion
            columns[:, row, 2 * n * n + row * drives : 2 * n * n + (row + 1) * drives] = -one.force
            first = shape.count + 2 * n * i
            columns[:, row, first + row] = -1
            columns[:, row, first + n + row] = -1j * w
        target = (w**2)[:, None] * one.motion
        blocks.append(stacked((weight @ columns).reshape(bins * n, -1)))
        targets.append(stacked((weight @ target[:, :, None]).ravel()))
    found = least_squares(np.concatenate(blocks), np.concatenate(targets))
    return found[: shape.count]


def stable(shape: Shape, parameters: Array) -> Array:
    """The parameters with enough damping added that no mode grows."""
    n = shape.axes
    growth = np.linalg.eigvals(generator(shape, parameters)[: 2 * n, : 2 * n]).real.max()
    if growth <= 0:
        return parameters
    changed = parameters.copy()
    changed[n * n : 2 * n * n] += 2.0 * 2.0 * growth * np.eye(n).ravel()
    return changed
