"""The model behind a record: y'' + C y' + K y = B u as pick-offs see it, sampled exactly, and its derivatives.

The parameters are the entries of K, C and, with a force, B, each by rows, divided by the mass: with two pick-offs 8
numbers, or 12 with two drives. Time is in units of 1/omega0, so the entries of K are near 1.

A force that is held between samples moves the state x = (y, y') from sample to sample by x+ = F x + G u, exactly. The
discrete Fourier transform of N samples then obeys, without any error from leakage,

    (z_k - F) X_k = G U_k + z_k (x_0 - x_N),    z_k = exp(j w_k h)

(J. Schoukens, R. Pintelon, System Identification: A Frequency Domain Approach, 2nd ed., 2012, section 6.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SERIES_NORM, SERIES_TERMS = 0.25, 14  # 0.25^15/15! is 1e-21


@dataclass(frozen=True)
class Shape:
    """Numbers of pick-offs and of drives; places of K, C and B among the parameters."""

    axes: int
    drives: int = 0

    @property
    def count(self) -> int:
        return self.axes * (2 * self.axes + self.drives)

    def matrices(self, parameters: Array) -> tuple[Array, Array, Array]:
        """K, C and B: (axes, axes), (axes, axes), (axes, drives)."""
        n, squared = self.axes, self.axes**2
        stiffness, damping, drive = np.split(parameters, [squared, 2 * squared])
        return stiffness.reshape(n, n), damping.reshape(n, n), drive.reshape(n, self.drives)

    def names(self) -> list[str]:
        """Names of the parameters, in their order: K11, K12, ..., C11, ..., B11, ..."""
        n = self.axes
        square = [f"{i + 1}{k + 1}" for i in range(n) for k in range(n)]
        drives = [f"{i + 1}{k + 1}" for i in range(n) for k in range(self.drives)]
        return [*(f"K{each}" for each in square), *(f"C{each}" for each in square), *(f"B{each}" for each in drives)]


def generator(shape: Shape, parameters: Array) -> Array:
    """The matrix S of (x, u)' = S (x, u) while u is held: (2 axes + drives) squared."""
    stiffness, damping, drive = shape.matrices(parameters)
    n = shape.axes
    size = 2 * n + shape.drives
    found = np.zeros((size, size))
    found[:n, n : 2 * n] = np.eye(n)
    found[n : 2 * n, :n], found[n : 2 * n, n : 2 * n], found[n : 2 * n, 2 * n :] = -stiffness, -damping, drive
    return found


def directions(shape: Shape) -> Array:
    """Derivative of `generator` with respect to each parameter: (count, size, size)."""
    zero = generator(shape, np.zeros(shape.count))
    return np.stack([generator(shape, row) - zero for row in np.eye(shape.count)])


def poles(shape: Shape, parameters: Array) -> Complex:
    """The pole of each mode with a positive frequency, in the order of the frequencies, in units of omega0."""
    n = shape.axes
    found = np.linalg.eigvals(generator(shape, parameters)[: 2 * n, : 2 * n])
    return np.asarray(found[np.argsort(found.imag, kind="stable")][n:], dtype=complex)


@dataclass(frozen=True)
class Sampled:
    """The exact map over one interval, less identity: F - 1 and G; with their derivatives, (count, ...)."""

    less_one: Array
    held: Array
    less_one_by: Array
    held_by: Array


def sampled(shape: Shape, parameters: Array, interval: float) -> Sampled:
    """`Sampled` for this interval, in 1/omega0.

    The derivative along E of exp(S) - 1 is the corner of that of [[S, E], [0, S]].
    """
    matrix, along = interval * generator(shape, parameters), interval * directions(shape)
    size, n = len(matrix), 2 * shape.axes
    wide = np.zeros((shape.count, 2 * size, 2 * size))
    wide[:, :size, :size] = wide[:, size:, size:] = matrix
    wide[:, :size, size:] = along
    whole = exponential_less_one(wide)
    value, derivative = whole[0, :size, :size], whole[:, :size, size:]
    return Sampled(value[:n, :n], value[:n, n:], derivative[:, :n, :n], derivative[:, :n, n:])


def exponential_less_one(matrices: Array) -> Array:
    """exp(M) - 1 of each matrix, by its series for M/2^s and s times E + E + E E: without a subtraction, so an interval
    that is short against the period loses no digits."""
    norm = float(np.abs(matrices).sum(axis=-1).max())
    squarings = max(math.ceil(math.log2(norm / SERIES_NORM)), 0) if norm > 0 else 0
    small = matrices / 2**squarings
    identity = np.eye(matrices.shape[-1])
    inner = identity + small / SERIES_TERMS
    for k in range(SERIES_TERMS - 1, 1, -1):
        inner = identity + small @ inner / k
    found = small @ inner
    for _ in range(squarings):
        found = 2 * found + found @ found
    return np.asarray(found)


def resolvent(shape: Shape, maps: Sampled, frequency: Array, interval: float) -> Complex:
    """(z_k - F)^-1 for each of the frequencies, rad per 1/omega0: (bins, 2 axes, 2 axes)."""
    half = frequency * interval / 2
    less_one = 2j * np.sin(half) * np.exp(1j * half)  # z - 1, which loses no digits either
    return np.linalg.inv(less_one[:, None, None] * np.eye(2 * shape.axes) - maps.less_one)
