"""Maximum likelihood of a free decay with cubic springs, from its simulated motion (envelope.py)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from .cubic_force import SMALL_STEP, STEPS, Forced, places_of, principal_axes
from .envelope import Grid, grid_of, motions, positive
from .likelihood import Fit, linearized
from .model import Complex, Shape, sampled
from .spectra import Spectrum
from .start import stable, stacked
from .thermal import estimated, only_white, thermal_spectra, weights

Array = NDArray[np.float64]

WEIGHTINGS = 3
DIFFERENCE = 0.05  # step of a derivative, in standard deviations
MAX_STEPS = 40_000  # in all envelopes of a fit


@dataclass(frozen=True)
class _Simulated:
    """The model with the simulated motion. The values are K and C, k of the axes `seen`, and the first state of each
    record over its amplitude."""

    shape: Shape
    turned: bool
    spectra: tuple[Spectrum, ...]
    unit: float
    seen: NDArray[np.int64]
    grids: tuple[Grid, ...]
    analytic: Complex
    sizes: Array

    def split(self, values: Array) -> tuple[Array, Array, list[Array]]:
        """K and C, k of all axes, and the first states; `values`: (..., count)."""
        n, count = self.shape.axes, self.shape.count
        strength = np.zeros((*values.shape[:-1], n))
        strength[..., self.seen] = values[..., count : count + len(self.seen)]
        first = count + len(self.seen)
        starts = [size * values[..., first + 2 * n * i : first + 2 * n * (i + 1)] for i, size in enumerate(self.sizes)]
        return values[..., :count], strength, starts

    def motion(self, values: Array) -> list[list[Array]]:
        """Motions of each record, for each row of `values`."""
        parameters, strength, starts = self.split(values)
        n = self.shape.axes
        axes = np.stack([principal_axes(self.shape, each) if self.turned else np.eye(n) for each in parameters])
        return [
            motions(self.shape, axes, parameters, strength, start, self.analytic, grid)
            for start, grid in zip(starts, self.grids, strict=True)
        ]

    def bins(self, values: Array) -> list[Complex]:
        """The bins of each record: (variants, bins, axes)."""
        found = []
        for one, several in zip(self.spectra, self.motion(values), strict=True):
            places, scale = places_of(one), math.sqrt(2 / one.samples)
            found.append(np.stack([scale * fft.rfft(each, axis=1)[:, places].T for each in several]))
        return found

    def evaluation(
        self, values: Array, deviation: Array, whiten: Sequence[Complex]
    ) -> tuple[list[Complex], list[Complex]]:
        """Whitened residuals of each record, (bins, axes), and their derivatives, (bins, axes, count)."""
        steps = DIFFERENCE * np.diag(deviation)
        rests, columns = [], []
        for one, found, weight in zip(
            self.spectra, self.bins(np.concatenate([values[None], values + steps, values - steps])), whiten, strict=True
        ):
            count = len(values)
            rests.append((weight @ (one.motion - found[0])[:, :, None])[:, :, 0])
            by = (found[1 : 1 + count] - found[1 + count :]) / (2 * DIFFERENCE * deviation)[:, None, None]
            columns.append(weight @ by.transpose(1, 2, 0))
        return rests, columns


def simulated_fit(
    problem: Forced, best: Array, seen: NDArray[np.int64], fit: Fit, whiten: Sequence[Complex]
) -> tuple[Fit, Array, Array, tuple[Array, ...]] | None:
    """Maximum likelihood from `best`: the fit, k of the axes `seen`, its covariance, motions; None if too long."""
    shape, n, unit = problem.shape, problem.shape.axes, problem.unit
    parameters, strength = best[: shape.count], np.zeros(n)
    strength[seen] = best[shape.count :]
    evaluate = problem(whiten, seen)
    jacobian = evaluate(best)[1]
    starts = _first_states(problem, parameters, strength, whiten)
    sizes = np.array([float(np.abs(each).max()) for each in starts])
    shift = max(float(np.max(3 / 8 * np.abs(strength) * (each[:n] ** 2 + each[n:] ** 2))) for each in starts)
    grids = tuple(grid_of(shape, parameters, shift, one.samples, one.interval * unit) for one in problem.spectra)
    if sum(each.steps for each in grids) > MAX_STEPS:
        return None
    turned = bool((problem.axes != np.eye(n)).any())
    model = _Simulated(shape, turned, problem.spectra, unit, seen, grids, positive(shape, parameters), sizes)
    values = np.concatenate([best, *(each / size for each, size in zip(starts, sizes, strict=True))])
    # Steps of the derivatives: deviations with the measured force, and of a state that all samples show.
    norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    inverse = np.linalg.pinv(jacobian / norms, rcond=1e-12)
    own = np.sqrt((inverse**2).sum(axis=1)) / norms
    states = [np.full(2 * n, float(row.max()) / size / math.sqrt(one.samples))
              for row, size, one in zip(fit.noise, sizes, problem.spectra, strict=True)]  # fmt: skip
    deviation = np.maximum(np.concatenate([own, *states]), 1e-9)
    noise = fit.thermal
    rows = 2 * n * sum(len(each.frequency) for each in problem.spectra)
    for i in range(WEIGHTINGS):
        values, rests, columns, covariance, steps = _searched(model, values, deviation, whiten)
        deviation = np.sqrt(np.diag(covariance))
        free = rows - len(values)
        if i == WEIGHTINGS - 1:
            break
        if not noise.is_thermal:
            power = np.array([np.mean(np.abs(each) ** 2, axis=0) / 2 * rows / free for each in rests])
            noise = only_white(noise.white * np.sqrt(power))
        shapes = thermal_spectra(shape, problem.spectra, unit, values[: shape.count])
        scaled = [each * deviation for each in columns]
        noise = estimated(noise, shapes, whiten, rests, scaled)
        whiten = weights(noise, shapes if noise.is_thermal else None)
    left = [(np.linalg.inv(weight) @ each[:, :, None])[:, :, 0] for weight, each in zip(whiten, rests, strict=True)]
    squares = float(sum((np.abs(each) ** 2).sum() for each in rests))
    count = shape.count
    new = Fit(
        values[:count], covariance[:count, :count], squares, free, noise.white, tuple(rests), fit.transients,
        fit.steps + steps, tuple(left), noise,
    )  # fmt: skip
    own_places = slice(count, count + len(seen))
    found = [each[0] for each in model.motion(values[None])]
    return new, values[own_places], covariance[own_places, own_places], tuple(found)


def _first_states(problem: Forced, parameters: Array, strength: Array, whiten: Sequence[Complex]) -> list[Array]:
    """State of the first sample of each record: of the free motion, and of the motion by the force."""
    shape, n = problem.shape, problem.shape.axes
    stiffness, damping, _ = shape.matrices(parameters)
    pushes, moved = [], []
    for one, force in zip(problem.spectra, problem.forces, strict=True):
        w = (one.frequency / problem.unit)[:, None, None]
        inverse = np.linalg.inv(-(w**2) * np.eye(n) + 1j * w * damping + stiffness)
        pushes.append((inverse @ problem.axes @ (strength * force)[:, :, None])[:, :, 0])
        moved.append(replace(one, motion=one.motion + pushes[-1]))
    found = linearized(shape, moved, problem.unit, parameters, whiten)
    states = []
    for one, pushed, linear in zip(problem.spectra, pushes, found.linear, strict=True):
        scale = math.sqrt(2 / one.samples)
        maps = np.eye(2 * n) + sampled(shape, parameters, one.interval * problem.unit).less_one
        free = np.linalg.solve(np.eye(2 * n) - np.linalg.matrix_power(maps, one.samples), linear[: 2 * n] / scale)
        rate = 1j * one.frequency[:, None] / problem.unit
        by_force = np.concatenate([-pushed.sum(axis=0).real, -(rate * pushed).sum(axis=0).real]) * scale
        states.append(free + by_force)
    return states


def _searched(
    model: _Simulated, values: Array, deviation: Array, whiten: Sequence[Complex]
) -> tuple[Array, list[Complex], list[Complex], Array, int]:
    """Values of the smallest sum of squares, whitened residuals and derivatives there, the covariance, and steps."""
    count, damping, taken = model.shape.count, 0.0, 0
    rests, columns = model.evaluation(values, deviation, whiten)
    squares = float(sum((np.abs(each) ** 2).sum() for each in rests))
    while True:
        jacobian = np.concatenate([stacked(each.reshape(-1, len(values))) for each in columns]) * deviation
        rest = np.concatenate([stacked(each.ravel()) for each in rests])
        squared, turned = np.linalg.eigh(jacobian.T @ jacobian)
        squared = np.maximum(squared, 1e-13 * squared[-1])
        along = turned.T @ (jacobian.T @ rest)
        improved = False
        while taken < STEPS and damping < 1e6 * squared[-1]:
            step = turned @ (along / (squared + damping))
            if np.linalg.norm(jacobian @ step) < SMALL_STEP:
                break
            trial = values + deviation * step
            trial[:count] = stable(model.shape, trial[:count])
            found = model.bins(trial[None])
            new = [
                (weight @ (one.motion - each[0])[:, :, None])[:, :, 0]
                for one, each, weight in zip(model.spectra, found, whiten, strict=True)
            ]
            lower = float(sum((np.abs(each) ** 2).sum() for each in new))
            if lower < squares:
                improved = True
                break
            damping = max(10 * damping, 1e-3 * float(np.median(squared)))
        if not improved:
            return values, rests, columns, (turned / squared) @ turned.T * np.outer(deviation, deviation), taken
        values, taken, damping = trial, taken + 1, damping / 30
        rests, columns = model.evaluation(values, deviation, whiten)
        squares = lower
