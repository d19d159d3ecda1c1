"""Maximum likelihood of the parameters of all records of one state of the device, by projected Gauss-Newton.

The transients of each record enter linearly: they are projected out (variable projection), so that only K, C and B are
searched. The noise of each channel of each record, and thermal motion, follow from the residuals (thermal.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .model import Complex, Sampled, Shape, resolvent, sampled
from .spectra import Spectrum
from .start import stable, stacked
from .thermal import Noise, estimated, only_white, thermal_spectra, weights

Array = NDArray[np.float64]

MAX_STEPS = 40
SMALL_STEP = 1e-4  # length of a step, in standard deviations, that is not taken
SAME_NOISE = 1e-3  # relative change of the noise that needs no further fit
SAME_THERMAL = 0.02  # the same of the thermal motion, which is known to some 10 % at best
SINGULAR = 1e-14  # eigenvalues of the normal equations below this are rounding
SMALL_GAIN = 1e-13  # relative decrease of the sum of squares that is rounding
ROUNDING = 1e-12  # times the amplitude
WEIGHTINGS = 4  # fits, each with the noise that the one before has found


@dataclass(frozen=True)
class Fit:
    """Parameters, their covariance, the sum of squares over the noise and its degrees of freedom.

    `noise`: (records, axes), deviation of a sample; `residuals`: of each record, (bins, axes), whitened; `left`: the
    same in units of the record; `transients`: of each record, its state at the first sample less that after the last;
    `thermal`: noise with the thermal motion.
    """

    parameters: Array
    covariance: Array
    squares: float
    freedom: int
    noise: Array
    residuals: tuple[Complex, ...]
    transients: tuple[Array, ...]
    steps: int
    left: tuple[Complex, ...]
    thermal: Noise


@dataclass(frozen=True)
class Linearized:
    """Whitened residuals and their Jacobian, both with the linear parts projected out.

    `parts`: the residuals by record as complex bins; `linear`: of each record, the transient and, with drives, the
    feedthrough D0 and D1 by rows; `bases`: of each record, what the linear parts span.
    """

    residuals: Array
    jacobian: Array
    parts: list[Complex]
    linear: list[Array]
    bases: list[Array]

    @property
    def squares(self) -> float:
        return float(self.residuals @ self.residuals)

    def columns(self, shape: Shape) -> list[Complex]:
        """Derivatives of the bins of each record with respect to all that was fitted: (bins, axes, count)."""
        width = sum(each.shape[1] for each in self.bases)
        found, row, column = [], 0, 0
        for basis in self.bases:
            height = len(basis)
            own = np.zeros((height, shape.count + width))
            own[:, : shape.count] = self.jacobian[row : row + height]
            own[:, shape.count + column : shape.count + column + basis.shape[1]] = basis
            half = height // 2
            found.append((own[:half] + 1j * own[half:]).reshape(half // shape.axes, shape.axes, -1))
            row, column = row + height, column + basis.shape[1]
        norms = np.sqrt(sum((np.abs(each) ** 2).sum(axis=(0, 1)) for each in found))
        return [each / np.maximum(norms, np.finfo(float).tiny) for each in found]


def linearized(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, parameters: Array, whiten: Sequence[Complex]
) -> Linearized:
    """The model at these parameters; `whiten`: of each record, as from `weights`."""
    residuals, jacobians, parts, transients, bases = [], [], [], [], []
    maps = {each.interval: sampled(shape, parameters, each.interval * unit) for each in spectra}
    later = {
        each.interval: sampled(shape, parameters, each.interval * unit * (1 - each.fraction))
        for each in spectra
        if each.fraction
    }
    for one, weight in zip(spectra, whiten, strict=True):
        n, bins = shape.axes, len(one.frequency)
        found = maps[one.interval]
        inverse = resolvent(shape, found, one.frequency / unit, one.interval * unit)
        seen = weight @ inverse[:, :n, :]  # the pick-offs' rows
        turn = np.exp(1j * one.frequency * one.interval)
        columns = seen * turn[:, None, None]
        if shape.drives:
            columns = np.concatenate([columns, weight @ _feedthrough(one, unit, n)], axis=2)
        driven, pushed_by = _driven(one, found, later.get(one.interval))
        forced = (seen @ driven[:, :, None])[:, :, 0]
        target = stacked(((weight @ one.motion[:, :, None])[:, :, 0] - forced).reshape(bins * n))
        matrix = stacked(columns.reshape(bins * n, -1))
        norms = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
        basis, upper = np.linalg.qr(matrix / norms)
        within = basis.T @ target
        linear = np.linalg.lstsq(upper, within, rcond=None)[0] / norms
        rest = target - basis @ within
        rest -= basis @ (basis.T @ rest)
        state = (inverse @ (driven + turn[:, None] * linear[None, : 2 * n])[:, :, None])[:, :, 0]
        by = found.less_one_by.transpose(2, 1, 0).reshape(2 * n, -1)
        pushed = (state @ by).reshape(bins, 2 * n, shape.count) + pushed_by
        jacobian = stacked(-(seen @ pushed).reshape(bins * n, shape.count))
        jacobians.append(jacobian - basis @ (basis.T @ jacobian))
        residuals.append(rest)
        parts.append((rest[: bins * n] + 1j * rest[bins * n :]).reshape(bins, n))
        transients.append(linear)
        bases.append(basis)
    return Linearized(np.concatenate(residuals), np.concatenate(jacobians), parts, transients, bases)


def _driven(one: Spectrum, maps: Sampled, later: Sampled | None) -> tuple[Complex, Complex]:
    """Change of the state by the force in each interval, (bins, 2 axes), and its derivatives, (bins, 2 axes, count).

    With a delay by a fraction of the interval the force of the sample before acts first: G(h) = G_first + G_later, with
    G_later the map over the rest of the interval.
    """
    if later is None or one.before is None:
        return one.force @ maps.held.T, _along(one.force, maps.held_by)
    change = one.force - one.before
    driven = one.before @ maps.held.T + change @ later.held.T
    return driven, _along(one.before, maps.held_by) + _along(change, later.held_by)


def _along(force: Complex, held_by: Array) -> Complex:
    count, states, drives = held_by.shape
    product = force @ held_by.transpose(2, 1, 0).reshape(drives, states * count)
    return np.asarray(product.reshape(len(force), states, count), dtype=complex)


def _feedthrough(one: Spectrum, unit: float, n: int) -> Complex:
    """Columns of D0 U + (j w) D1 U, by rows of D0, then of D1: (bins, axes, 2 axes drives).

    A sample sees the force that is held at its time: with a delay by a fraction of the interval that of the one before.
    """
    force = one.before if one.fraction and one.before is not None else one.force
    drives = force.shape[1]
    found = np.zeros((len(one.frequency), n, 2 * n * drives), dtype=complex)
    middle = one.frequency.mean()
    for row in range(n):
        places = slice(row * drives, (row + 1) * drives)
        found[:, row, places] = force
        later = slice((n + row) * drives, (n + row + 1) * drives)
        found[:, row, later] = 1j * (one.frequency - middle)[:, None] / unit * force
    return found


@dataclass(frozen=True)
class Minimum:
    """Parameters that minimize the sum of squares, that sum, the number of steps, and `linearized` there."""

    parameters: Array
    squares: float
    steps: int
    evaluation: Linearized


def search(
    shape: Shape,
    spectra: Sequence[Spectrum],
    unit: float,
    start: Array,
    whiten: Sequence[Complex],
    max_steps: int = MAX_STEPS,
) -> Minimum:
    """The minimum from this start, by Levenberg's and Marquardt's method."""
    best, evaluation = start, linearized(shape, spectra, unit, start, whiten)
    squares, damping, steps = evaluation.squares, 0.0, 0
    while steps < max_steps:
        rest, jacobian = evaluation.residuals, evaluation.jacobian
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
            trial = linearized(shape, spectra, unit, candidate, whiten)
            found = trial.squares
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


def maximize(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, start: Array, noise: Noise, *, rough: bool = False
) -> Fit:
    """The fit from this start; `noise` is a first value of the noise. `rough`: thermal motion is not looked for."""
    parameters, steps = start, 0
    rows = 2 * shape.axes * sum(len(each.frequency) for each in spectra)
    whiten = weights(noise, thermal_spectra(shape, spectra, unit, parameters) if noise.is_thermal else None)
    for i in range(WEIGHTINGS):
        found = search(shape, spectra, unit, parameters, whiten)
        parameters, steps = found.parameters, steps + found.steps
        new = _new_noise(shape, spectra, unit, found, noise, whiten, rows, rough)
        same = np.allclose(new.white, noise.white, rtol=SAME_NOISE)
        same &= np.allclose(new.thermal, noise.thermal, rtol=SAME_THERMAL)
        if i == WEIGHTINGS - 1 or same:
            break
        noise = new
        whiten = weights(noise, thermal_spectra(shape, spectra, unit, parameters) if noise.is_thermal else None)
    evaluation = found.evaluation
    free = rows - sum(map(len, evaluation.linear)) - shape.count
    norms = np.maximum(np.linalg.norm(evaluation.jacobian, axis=0), np.finfo(float).tiny)
    inverse = np.linalg.pinv(evaluation.jacobian / norms, rcond=1e-14)
    covariance = (inverse @ inverse.T) / np.outer(norms, norms)
    left = [
        (np.linalg.inv(each) @ one[:, :, None])[:, :, 0] for each, one in zip(whiten, evaluation.parts, strict=True)
    ]
    return Fit(
        parameters, covariance, found.squares, free, noise.white, tuple(evaluation.parts), tuple(evaluation.linear),
        steps, tuple(left), noise,
    )  # fmt: skip


def _new_noise(
    shape: Shape,
    spectra: Sequence[Spectrum],
    unit: float,
    found: Minimum,
    noise: Noise,
    whiten: Sequence[Complex],
    rows: int,
    rough: bool,
) -> Noise:
    """The noise that these residuals show; `rough`: without new thermal motion."""
    evaluation = found.evaluation
    least = np.array([_least(one) for one in spectra])
    if not noise.is_thermal:
        free = rows - sum(map(len, evaluation.linear)) - shape.count
        power = [np.mean(np.abs(part) ** 2, axis=0) / 2 * (rows / free) for part in evaluation.parts]
        noise = only_white(np.maximum(noise.white * np.sqrt(np.array(power)), least[:, None]))
    if rough or (noise.white <= 2 * least[:, None]).any():  # rounding has any spectrum
        return noise
    shapes = thermal_spectra(shape, spectra, unit, found.parameters)
    try:
        return estimated(noise, shapes, whiten, evaluation.parts, evaluation.columns(shape))
    except np.linalg.LinAlgError:  # far from the model the variances have no finite likelihood
        return noise
