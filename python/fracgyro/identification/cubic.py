"""Cubic springs in free decays: whether the frequency depends on the amplitude, and the fit that includes it.

    y'' + C y' + K y + V k (V^-1 y)^3 = 0

with one k for each principal axis of the stiffness; V: these axes, of which the first is seen by x and the second by y
with a gain of 1. Near the modes x^3 is 3/4 |z|^2 z, where z is the analytic signal.

First the measured motion gives z, so that the spring is a known force of unknown size (D. Adams, R. Allemang, Mech.
Syst. Signal Process. 14, 2000, 637-656). Its score is the test, and its fit the start of the second: maximum likelihood
with the simulated motion, because in the first the noise of the motion is in the force.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from .envelope import Grid, grid_of, motions, positive
from .likelihood import Fit, linearized
from .model import Complex, Shape, sampled
from .records import Segment
from .spectra import Spectrum
from .start import linear_start, stable, stacked
from .thermal import estimated, only_white, thermal_spectra, weights

Array = NDArray[np.float64]

SEEN = 3.0  # standard deviations of a spring that is not zero
DISTINCT = 3.0  # split of the squared frequencies over the damping, below which the modes have no axes
MOST_TURNED = 0.5  # component of an axis along the other pick-off
WIDER, MARGIN = 2.0, 64  # the measured motion that enters the force has so many more bins on each side of the band
UNSEEN = 1e-6  # part of a spring's effect that K and C do not explain, below which it is rounding
STEPS, SMALL_STEP = 30, 1e-3  # the latter in standard deviations
WEIGHTINGS = 3
DIFFERENCE = 0.05  # step of a derivative, in standard deviations
MAX_STEPS = 40_000  # of the simulated envelope


@dataclass(frozen=True)
class Cubic:
    """Springs of a fit, by axis. `strength`: k, in units of omega0^2 over the square of the record's unit, 0 where none
    is fitted; `covariance`: of `strength`; `score`: of the test, in standard deviations; `first`: k by the test;
    `largest`: amplitude; `motions`: of the fit, of each record, (axes, samples), without a spring empty."""

    strength: Array
    covariance: Array
    score: Array
    first: Array
    largest: Array
    motions: tuple[Array, ...] = ()

    @property
    def fitted(self) -> bool:
        """True if the fit has a spring."""
        return bool(self.strength.any())

    @property
    def p(self) -> float:
        """Probability of scores as large as these without springs."""
        return min(len(self.score) * math.erfc(float(np.abs(self.score).max()) / math.sqrt(2)), 1.0)

    def plain(self) -> dict[str, Any]:
        """The springs as JSON."""
        deviation = np.sqrt(np.diag(self.covariance)).tolist()
        return {"strength": self.strength.tolist(), "deviation": deviation, "score": self.score.tolist(),
                "largest": self.largest.tolist()}  # fmt: skip


def shift_per(shape: Shape, parameters: Array) -> Array:
    """Change of the frequency, over omega0, at an amplitude of 1 and a spring of 1, by axis."""
    return np.asarray(3 / 8 / np.sqrt(np.maximum(np.diag(shape.matrices(parameters)[0]), 1e-6)))


def with_springs(
    shape: Shape, fit: Fit, spectra: Sequence[Spectrum], segments: Sequence[Segment], unit: float
) -> tuple[Fit, Cubic]:
    """The fit with the springs that the residuals show, or as it was, and the test."""
    n = shape.axes
    problem, largest = _problem(shape, fit.parameters, spectra, segments, unit)
    shapes = thermal_spectra(shape, spectra, unit, fit.parameters) if fit.thermal.is_thermal else None
    whiten = weights(fit.thermal, shapes)
    nothing = np.concatenate([fit.parameters, np.zeros(n)])
    rest, jacobian = problem(whiten, np.arange(n))(nothing)
    score, first = _scores(rest, jacobian, n)
    found = Cubic(np.zeros(n), np.zeros((n, n)), score, first, largest)
    seen = np.flatnonzero(np.abs(score) > SEEN)
    if len(seen) == 0 or shape.drives:
        return fit, found
    # What a spring leaves resembles thermal motion: the fits start from white noise, as most bins show it.
    white = [np.median(np.abs(each), axis=0) / math.sqrt(2 * math.log(2)) for each in fit.left]
    linear = fit
    fit = replace(fit, thermal=only_white(np.array(white)), noise=np.array(white))
    whiten = weights(fit.thermal)
    best = _by_measured_force(problem, fit, whiten, seen)
    problem = _problem(shape, best[: shape.count], spectra, segments, unit)[0]  # the linear fit's axes may be far off
    best = _by_measured_force(problem, replace(fit, parameters=best[: shape.count]), whiten, seen)
    improved = _simulated_fit(problem, best, seen, fit, whiten)
    if improved is None:
        return linear, found
    new, strength, covariance, moved = improved
    whole, spread = np.zeros(n), np.zeros((n, n))
    whole[seen], spread[np.ix_(seen, seen)] = strength, covariance
    if not (np.abs(strength) > SEEN * np.sqrt(np.diag(covariance))).all():  # something else than springs
        return linear, found
    return new, Cubic(whole, spread, score, first, largest, moved)


def _problem(
    shape: Shape, parameters: Array, spectra: Sequence[Spectrum], segments: Sequence[Segment], unit: float
) -> tuple[_Forced, Array]:
    """The model with the forces of the measured motion, and the largest amplitude along each axis."""
    axes = principal_axes(shape, parameters)
    along = [_forces(axes, *each) for each in zip(spectra, segments, strict=True)]
    problem = _Forced(shape, axes, tuple(spectra), unit, tuple(each for each, _ in along))
    return problem, np.max([each for _, each in along], axis=0)


def principal_axes(shape: Shape, parameters: Array) -> Array:
    """The axes of the springs as the pick-offs see them, by columns, with ones on the diagonal.

    Those of the pick-offs where the modes are too near each other, or the axes too far off, to tell.
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
    """3/4 |z|^2 z along each axis in the bins of the fit, (bins, axes), and the largest |z|, (axes,).

    From the measured motion in a wider band, because z begins with a jump; z is sampled as fast as its cube needs.
    """
    samples = segment.motion.shape[1]
    places = _places(one)
    margin = max(int(WIDER * (places[-1] - places[0])), MARGIN)
    low, high = max(int(places[0]) - margin, 1), min(int(places[-1]) + margin, (samples - 1) // 2)
    size = fft.next_fast_len(3 * (high - low + 1))
    baseband = np.zeros((len(segment.motion), size), dtype=complex)
    baseband[:, : high - low + 1] = 2 * fft.rfft(segment.motion, axis=1)[:, low : high + 1]
    z = np.linalg.inv(axes) @ fft.ifft(baseband, axis=1) * (size / samples)
    force = fft.fft(0.75 * np.abs(z) ** 2 * z, axis=1)[:, places - low] / 2 * (samples / size)
    return np.ascontiguousarray(math.sqrt(2 / samples) * force.T), np.abs(z).max(axis=1)


def _places(one: Spectrum) -> NDArray[np.int64]:
    """Numbers of the bins."""
    return np.round(one.frequency * one.interval * one.samples / (2 * np.pi)).astype(np.int64)


Evaluate = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class _Forced:
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


def _scores(rest: Array, jacobian: Array, n: int) -> tuple[Array, Array]:
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


def _by_measured_force(problem: _Forced, fit: Fit, whiten: Sequence[Complex], seen: NDArray[np.int64]) -> Array:
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
        starts = [
            size * values[..., first + 2 * n * i : first + 2 * n * (i + 1)] for i, size in enumerate(self.sizes)
        ]
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
            places, scale = _places(one), math.sqrt(2 / one.samples)
            found.append(np.stack([scale * fft.rfft(each, axis=1)[:, places].T for each in several]))
        return found

    def evaluation(self, values: Array, deviation: Array, whiten: Sequence[Complex]) -> tuple[list[Complex], list[Complex]]:
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


def _simulated_fit(
    problem: _Forced, best: Array, seen: NDArray[np.int64], fit: Fit, whiten: Sequence[Complex]
) -> tuple[Fit, Array, Array, tuple[Array, ...]] | None:
    """Maximum likelihood from `best`: the fit, k of the axes `seen`, its covariance and the motions; None if it fails."""
    shape, n, unit = problem.shape, problem.shape.axes, problem.unit
    parameters, strength = best[: shape.count], np.zeros(n)
    strength[seen] = best[shape.count :]
    evaluate = problem(whiten, seen)
    rest, jacobian = evaluate(best)
    starts = _first_states(problem, parameters, strength, whiten)
    sizes = np.array([float(np.abs(each).max()) for each in starts])
    shift = max(float(np.max(3 / 8 * np.abs(strength) * (each[:n] ** 2 + each[n:] ** 2))) for each in starts)
    grids = tuple(
        grid_of(shape, parameters, shift, one.samples, one.interval * unit) for one in problem.spectra
    )
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


def _first_states(problem: _Forced, parameters: Array, strength: Array, whiten: Sequence[Complex]) -> list[Array]:
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
