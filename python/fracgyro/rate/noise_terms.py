"""The noise terms of IEEE Std 952 fitted to an Allan variance: which of them it shows, and how well.

The rate has white noise N, flicker noise B and a random walk K, of two-sided density

    S(f) = (N² + B²/(2π f) + K²/(2π f)²) |H(f)|²,    H: the sensor's response, |H|² = 1/(1 + (2π f T)^2n)

with n = 1, or n = 2 (Butterworth's, that of an estimate which falls behind where its sensors' noise hides the motion),
and the Allan variance over averages of length tau is sigma²(tau) = 2 ∫ S(f) G(f, tau) df over f > 0, with
G = 2 sin⁴(π f tau)/(π f tau)²: N²/tau + (2 ln 2/π) B² + K² tau/3 where tau is long against T and the sampling interval.
Estimates over different tau come from one record; theirs is the covariance

    cov(i, j) = 4/(t - 2 min(tau_i, tau_j)) ∫ S² G_i G_j df,    t: the record's length,

so that N², B² and K² are found by generalized least squares, and T by the likelihood. f goes up to half the sampling
frequency, and G and H are those of samples.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

Array = NDArray[np.float64]

WHITE, FLICKER, WALK = range(3)
SETS: list[tuple[int, ...]] = [s for n in (1, 2, 3) for s in itertools.combinations((WHITE, FLICKER, WALK), n)]
DETECTED = 9.0  # what a term must add to twice the log likelihood: three standard deviations
PLAUSIBLE = 0.01  # least probability of the residuals
SHORTEST = 4  # octaves that a fit needs
PER_OCTAVE = 48  # frequencies of the integrals
ROUNDS = 4  # of least squares, each with the covariance of the one before


@dataclass(frozen=True)
class Response:
    """Of the sensor."""

    time: float = 0.0  # T, s; 0 where it does not show
    order: int = 1


@dataclass(frozen=True)
class Fit:
    """Powers N², B², K² of the terms seen, with their variances; `part`: of the averaging times, which fit."""

    power: dict[int, float]
    variance: dict[int, float]
    response: Response
    part: slice


@dataclass(frozen=True)
class _Solved:
    terms: tuple[int, ...]
    response: Response
    power: Array
    covariance: Array
    residual: float  # chi square
    score: float  # -2 log likelihood, and the price of each unknown
    unknowns: int


class Curve:
    """An Allan variance over octaves of averaging times, from `records` records of `samples` samples each."""

    def __init__(self, tau: Array, variance: Array, interval: float, samples: int, records: int) -> None:
        self.tau, self.variance, self.interval = tau, variance, interval
        length = samples * interval
        octaves = math.log2(500 * samples)
        self.frequency = np.geomspace(1e-3 / length, 0.5 / interval, int(PER_OCTAVE * octaves))
        self._width = np.gradient(self.frequency)
        sine = np.sin(np.pi * self.frequency * interval)
        averaged = np.round(tau / interval)[:, None]
        self._gain = 2 * np.sin(np.pi * self.frequency * interval * averaged) ** 4 / (averaged * sine) ** 2
        self._density = np.stack(
            [np.ones_like(sine), 1 / (2 * np.pi * self.frequency), (interval / (2 * sine)) ** 2]
        )  # of N, B, K = 1
        left = length - 2 * tau
        self._span = np.maximum(left[:, None], left) * records

    def columns(self, response: Response) -> Array:
        """Variance over each averaging time for N, B, K = 1 behind this response."""
        return self._model(response)[0]

    def freedom(self, fit: Fit | None) -> Array:
        """Degrees of freedom at each averaging time, of the noise that was fitted, else of white noise."""
        columns, density = self._model(fit.response if fit else Response())
        power = np.array([fit.power.get(term, 0.0) for term in range(3)] if fit else [1.0, 0.0, 0.0])
        spread = self._covariance(power @ density, slice(None)).diagonal()
        return np.asarray(2 * (columns @ power) ** 2 / spread)

    def fit(self, shortest: float = 0.0) -> Fit | None:
        """The terms that the longest part shows for which they account; the shortest averages are left out first.

        Averages below `shortest` are out from the beginning. A part without the longest averages cannot show B and K,
        only N. None where no part of four octaves fits.
        """
        count = len(self.tau)
        first = int(np.searchsorted(self.tau, shortest))
        parts = [slice(start, count) for start in range(first, count - SHORTEST + 1)]
        parts += [slice(first, stop) for stop in range(count - 1, first + SHORTEST - 1, -1)]
        if not (self.variance > 0).all():
            return None
        for part in parts:
            best = self._best(part)
            if best is None:
                continue
            freedom = part.stop - part.start - best.unknowns
            if chi2.sf(best.residual, max(freedom, 1)) >= PLAUSIBLE:
                kept = [i for i, term in enumerate(best.terms) if part.stop == count or term == WHITE]
                power = {best.terms[i]: float(best.power[i]) for i in kept}
                variance = {best.terms[i]: float(best.covariance[i, i]) for i in kept}
                if any(power[term] ** 2 <= variance[term] for term in power):
                    continue  # where the response hides all the noise
                return Fit(power, variance, best.response, part)
        return None

    def _model(self, response: Response) -> tuple[Array, Array]:
        """Columns, and the densities of N, B, K = 1."""
        density, h, time = self._density, self.interval, response.time
        averaged = np.round(self.tau / h)
        white = 1 / self.tau
        sine = 2 * np.sin(np.pi * self.frequency * h)
        if time > 0 and response.order == 1:
            keep = math.exp(-h / time)  # from one sample to the next
            density = density * (1 - keep) ** 2 / ((1 - keep) ** 2 + keep * sine**2)
            # The integral of N in closed form, as it is known best: IEEE Std 952's Markov noise, of samples.
            lost = keep / (1 - keep**2) * (3 - 4 * keep**averaged + keep ** (2 * averaged)) / averaged
            white = white * (1 - lost)
        elif time > 0:
            density = density / (1 + (sine * time / h) ** 4)
            white = 2 * (self._gain * self._width) @ density[0]
        others = 2 * (self._gain * self._width) @ density[1:].T
        return np.column_stack([white, others]), density

    def _covariance(self, density: Array, part: slice) -> Array:
        gain = self._gain[part]
        return np.asarray(4 * (gain * (self._width * density**2)) @ gain.T / self._span[part, part])

    def _solve(self, terms: Sequence[int], response: Response, part: slice, unknowns: int) -> _Solved | None:
        """None where a power is not above 0."""
        columns, densities = self._model(response)
        columns, densities, seen = columns[part][:, terms], densities[list(terms)], self.variance[part]
        power = np.min(seen[:, None] / columns, axis=0)
        for _ in range(ROUNDS):
            root = _root(self._covariance(power @ densities, part))
            if root is None:
                return None
            power, spread = _least_squares(root, columns, seen)
            if (power <= 0).any():
                return None
        root = _root(self._covariance(power @ densities, part))
        if root is None:
            return None
        residual = float(np.sum(np.linalg.solve(root, seen - columns @ power) ** 2))
        score = residual + 2 * float(np.log(np.diag(root)).sum()) + DETECTED * unknowns
        if response.time > 0:  # what is not known of it widens the others
            longer, shorter = (
                self.columns(replace(response, time=factor * response.time))[part, 0] for factor in (1.01, 1 / 1.01)
            )
            by_time = (longer - shorter) / 0.02 * power[0]
            spread = _least_squares(root, np.column_stack([columns, by_time]), seen)[1]
        return _Solved(tuple(terms), response, power, spread, residual, score, unknowns)

    def _best(self, part: slice) -> _Solved | None:
        """Of every set of terms, those with N also behind a response, the one of the best score."""
        found = [self._solve(terms, Response(), part, len(terms)) for terms in SETS]
        found += [self._behind(order, terms, part) for order in (1, 2) for terms in SETS if WHITE in terms]
        return min((one for one in found if one), key=lambda one: one.score, default=None)

    def _behind(self, order: int, terms: Sequence[int], part: slice) -> _Solved | None:
        unknowns = len(terms) + 1

        def score(log_time: float) -> float:
            solved = self._solve(terms, Response(math.exp(log_time), order), part, unknowns)
            return solved.score if solved else 1e12

        longest = float(self.tau[part][-1]) / 2
        grid = np.log(np.geomspace(self.interval / 4, longest, 2 * len(self.tau)))
        scores = [score(x) for x in grid]
        i = int(np.argmin(scores))
        bounds = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]
        best = minimize_scalar(score, bounds=bounds, method="bounded", options={"xatol": 1e-3})
        time = math.exp(best.x if best.fun < scores[i] else grid[i])
        return self._solve(terms, Response(time, order), part, unknowns)


def _root(covariance: Array) -> Array | None:
    try:
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)
    except np.linalg.LinAlgError:
        return None


def _least_squares(root: Array, columns: Array, seen: Array) -> tuple[Array, Array]:
    """Powers and their covariance, the estimates having the covariance root rootᵀ."""
    white, values = np.linalg.solve(root, columns), np.linalg.solve(root, seen)
    spread = np.linalg.inv(white.T @ white)
    return spread @ (white.T @ values), spread
