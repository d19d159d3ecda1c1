"""Cubic springs as known forces of unknown size: the measured motion gives the cube (D. Adams, R. Allemang, Mech. Syst.
Signal Process. 14, 2000, 637-656).

    y'' + C y' + K y = -V k (V^-1 y)^3

V: principal axes of the stiffness, of which the first is seen by x and the second by y with a gain of 1. Near the modes
x^3 is 3/4 |z|^2 z, where z is the analytic signal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from .likelihood import Fit, linearized
from .model import Complex, Shape
from .records import Segment
from .spectra import Spectrum
from .start import linear_start, stable, stacked

Array = NDArray[np.float64]

DISTINCT = 3.0  # split of the squared frequencies over the damping, below which the modes have no axes
MOST_TURNED = 0.5  # component of an axis along the other pick-off
WIDER, MARGIN = 2.0, 64  # bins on each side of the band that enter the cube: over its width, and at least
UNSEEN = 1e-6  # part of a spring's effect that K and C do not explain, below which it is rounding
STEPS, SMALL_STEP = 30, 1e-3  # the latter in standard deviations


def forced_problem(
    shape: Shape, parameters: Array, spectra: Sequence[Spectrum], segments: Sequence[Segment], unit: float
) -> tuple[Forced, Array]:
    """The model with the forces of the measured motion, and the largest amplitude along each axis."""
    axes = principal_axes(shape, parameters)
    along = [_forces(axes, *each) for each in zip(spectra, segments, strict=True)]
    problem = Forced(shape, axes, tuple(spectra), unit, tuple(each for each, _ in along))
    return problem, np.max([each for _, each in along], axis=0)


def principal_axes(shape: Shape, parameters: Array) -> Array:
    """The axes of the springs as the pick-offs see them, by columns, with ones on the diagonal.

    Those of the pick-offs where the modes are too near each other, or the axes turned too far.
    """
    n = shape.axes
    stiffness, damping, _ = shape.matrices(parameters)
    values, vectors = np.linalg.eig(stiffness)
    if n == 1 or np.iscomplexobj(values) or abs(values[1] - values[0]) < DISTINCT * np.abs(damping).max():
        return np.eye(n)
    vectors = vectors[:, ::-1] if abs(vectors[0, 0]) < abs(vectors[0, 1]) else vectors
    found = vectors / np.diag(vectors)
    return np.asarray(found if np.abs(found - np.eye(n)).max() < MOST_TURNED else np.eye(n))


def _forces(axes: Array, one: Spectrum, segment: Segment) -> tuple[Complex, Array]:
    """3/4 |z|^2 z along each axis in the bins of the fit, (bins, axes), and the largest |z|, (axes,)."""
    samples, places = one.samples, places_of(one)
    z, base = analytic_signal(axes, one, segment)
    low = round(base * one.interval * samples / (2 * np.pi))
    force = fft.fft(0.75 * np.abs(z) ** 2 * z, axis=1)[:, places - low] / 2 * (samples / z.shape[1])
    return np.ascontiguousarray(math.sqrt(2 / samples) * force.T), np.abs(z).max(axis=1)


def analytic_signal(axes: Array, one: Spectrum, segment: Segment) -> tuple[Complex, float]:
    """The analytic signal of the measured motion along each axis, less a frequency, rad/s: (axes, times).

    In a wider band than that of the fit, because it begins with a jump; sampled as fast as its cube needs.
    """
    samples, places = one.samples, places_of(one)
    margin = max(int(WIDER * (places[-1] - places[0])), MARGIN)
    low, high = max(int(places[0]) - margin, 1), min(int(places[-1]) + margin, (samples - 1) // 2)
    size = fft.next_fast_len(3 * (high - low + 1))
    baseband = np.zeros((len(segment.motion), size), dtype=complex)
    baseband[:, : high - low + 1] = 2 * fft.rfft(segment.motion, axis=1)[:, low : high + 1]
    z = np.linalg.inv(axes) @ fft.ifft(baseband, axis=1) * (size / samples)
    return z, 2 * math.pi * low / (samples * one.interval)


def places_of(one: Spectrum) -> NDArray[np.int64]:
    """Numbers of the bins."""
    return np.round(one.frequency * one.interval * one.samples / (2 * np.pi)).astype(np.int64)


Evaluate = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Forced:
    """The model with the springs as forces that are known but for their size. `forces`: of each record."""

    shape: Shape
    axes: Array
    spectra: tuple[Spectrum, ...]
    unit: float
    forces: tuple[Complex, ...]

    def __call__(self, whiten: Sequence[Complex], seen: NDArray[np.int64]) -> Evaluate:
        """Residuals and their derivative, transients projected out, as a function of K, C and k of the axes `seen`."""
        shape, n, unit = self.shape, self.shape.axes, self.unit
        count = shape.count

        def evaluate(values: Array) -> tuple[Array, Array]:
            strength = np.zeros(n)
            strength[seen] = values[count:]
            stiffness, damping, _ = shape.matrices(values[:count])
            moved, columns = [], []
            for one, force, weight in zip(self.spectra, self.forces, whiten, strict=True):
                w = (one.frequency / unit)[:, None, None]
                inverse = np.linalg.inv(-(w**2) * np.eye(n) + 1j * w * damping + stiffness)
                pushed = (inverse @ self.axes @ (strength * force)[:, :, None])[:, :, 0]
                moved.append(replace(one, motion=one.motion + pushed))
                by = np.zeros((len(force), n, count + len(seen)), dtype=complex)
                for a in range(n):
                    for b in range(n):
                        by[:, :, a * n + b] = -inverse[:, :, a] * pushed[:, b, None]
                by[:, :, n * n : 2 * n * n] = 1j * w * by[:, :, : n * n]
                by[:, :, count:] = (inverse @ self.axes)[:, :, seen] * force[:, None, seen]
                columns.append(weight @ by)
            found = linearized(shape, moved, unit, values[:count], whiten)
            rows = []
            for basis, column in zip(found.bases, columns, strict=True):
                flat = stacked(column.reshape(-1, column.shape[2]))
                rows.append(flat - basis @ (basis.T @ flat))
            jacobian = np.concatenate(rows)
            jacobian[:, :count] += found.jacobian
            return found.residuals, jacobian

        return evaluate


def scores(rest: Array, jacobian: Array, n: int) -> tuple[Array, Array]:
    """k of each axis over its standard deviation, and k, from one step at k = 0 with that axis only."""
    found, sizes = [], []
    for i in range(n):
        column = jacobian[:, jacobian.shape[1] - n + i]
        others = jacobian[:, : jacobian.shape[1] - n]
        norms = np.maximum(np.linalg.norm(others, axis=0), np.finfo(float).tiny)
        clear = column - (others / norms) @ np.linalg.lstsq(others / norms, column, rcond=1e-12)[0]
        size = float(np.linalg.norm(clear))
        seen = size > UNSEEN * float(np.linalg.norm(column)) > 0
        found.append(-float(clear @ rest) / size if seen else 0.0)
        sizes.append(size if seen else math.inf)
    return np.array(found), np.array(found) / np.array(sizes)


def _minimum(
    evaluate: Evaluate, start: Array, allowed: Callable[[Array], Array], steps: int = STEPS
) -> tuple[Array, Array, Array]:
    """Parameters of the smallest sum of squares from this start, residuals and derivative there."""
    best, (rest, jacobian) = start, evaluate(start)
    damping = 0.0
    for _ in range(steps):
        norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        scaled = jacobian / norms
        squared, turned = np.linalg.eigh(scaled.T @ scaled)
        along = turned.T @ (scaled.T @ rest)
        squared = np.maximum(squared, 1e-13 * squared[-1])
        improved = False
        while damping < 1e6:
            step = -(turned @ (along / (squared + damping)))
            if np.linalg.norm(scaled @ step) < SMALL_STEP:
                break
            trial = allowed(best + step / norms)
            found = evaluate(trial)
            if float(found[0] @ found[0]) < float(rest @ rest):
                improved = True
                break
            damping = max(10 * damping, 1e-3)
        if not improved:
            break
        best, (rest, jacobian) = trial, found
        damping = damping / 30 if damping > 1e-4 else 0.0
    return best, rest, jacobian


def by_measured_force(problem: Forced, fit: Fit, whiten: Sequence[Complex], seen: NDArray[np.int64]) -> Array:
    """K, C and k with the force of the measured motion: from the linear fit, and from linear least squares."""
    shape, count = problem.shape, problem.shape.count
    evaluate = problem(whiten, seen)

    def allowed(values: Array) -> Array:
        return np.concatenate([stable(shape, values[:count]), values[count:]])

    driven = Shape(shape.axes, len(seen))
    noise = fit.noise
    scaled = [
        replace(one, motion=one.motion / deviation, force=force[:, seen])
        for one, force, deviation in zip(problem.spectra, problem.forces, noise, strict=True)
    ]
    starts = [np.concatenate([fit.parameters, np.zeros(len(seen))])]
    if np.allclose(noise / noise[:, :1], noise[0] / noise[0, 0], rtol=0.3):
        stiffness, damping, drive = driven.matrices(linear_start(driven, scaled, problem.unit))
        turn = np.outer(noise[0], 1 / noise[0])
        strengths = -np.diag((np.linalg.inv(problem.axes) @ (noise[0][:, None] * drive))[seen])
        starts.append(allowed(np.concatenate([(stiffness * turn).ravel(), (damping * turn).ravel(), strengths])))
    found = [_minimum(evaluate, start, allowed) for start in starts]
    return min(found, key=lambda each: float(each[1] @ each[1]))[0]
