"""Noise of a record: white noise of each pick-off, and thermal motion, which is only near the modes.

A thermal force is white, so the motion that it causes has the spectrum of the modes. In the equation of the discrete
transform it is a random input of covariance Q_d, which acts in each interval, without any error from leakage:

    S_k = diag(sigma^2) + sum over the axes of q_i V_i,k,    V_k = H (z_k - F)^-1 Q_d (z_k - F)^-H H'

with one scale q for the force on each axis. Their ratio is the pick-offs'; the correlation of the forces by dxy is
neglected. The scales and the sigma have the largest restricted likelihood, which takes into account what the fitted
parameters absorb (H. D. Patterson, R. Thompson, Biometrika 58, 1971, 545-554).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from ..rate.units import thermal_force_density
from .model import Complex, Sampled, Shape, exponential_less_one, generator, resolvent, sampled
from .spectra import Spectrum

Array = NDArray[np.float64]

STEPS = 40
SAME = 1e-4  # relative change of all variances that ends the search
SMALLEST = 1e-12  # times the white variance: a thermal variance that is zero
MAX_SPREAD = 0.5  # deviation over the density, above which it gives no gain of the pick-off
BOUND = 0.05  # probability of the likelihood ratio of a thermal motion that is not included
HARDLY = 0.5  # likelihood ratio by the score, below which no thermal motion is included: its p is 0.3


@dataclass(frozen=True)
class Noise:
    """`white`: (records, axes), deviation of a sample; `thermal`: (axes,), density of the force over the mass on each
    axis, in units of the record and omega0; `deviation`: of `thermal`; `p`: of its likelihood ratio."""

    white: Array
    thermal: Array
    deviation: Array
    p: float = 1.0

    @property
    def is_thermal(self) -> bool:
        """True if thermal motion is seen in any axis."""
        return bool((self.thermal > 0).any())


def only_white(deviations: Array) -> Noise:
    """White noise of these deviations, (records, axes)."""
    nothing = np.zeros(deviations.shape[1])
    return Noise(deviations, nothing, nothing)


def process_covariance(shape: Shape, parameters: Array, interval: float) -> Array:
    """Covariance of the state that a white force of density 1 on each axis adds in an interval: (axes, 2 axes, 2 axes).

    By C. Van Loan, IEEE Trans. Autom. Control 23, 1978, 395-404, for a small part of the interval, then by doubling it:
    over all of it the growing solutions of a strongly damped device would overflow.
    """
    n = 2 * shape.axes
    matrix = generator(shape, parameters)[:n, :n]
    doublings = max(math.ceil(math.log2(max(interval * float(np.abs(matrix).sum(axis=1).max()), 1.0))), 0)
    wide = np.zeros((shape.axes, 2 * n, 2 * n))
    wide[:, :n, :n], wide[:, n:, n:] = matrix, -matrix.T
    for axis in range(shape.axes):
        wide[axis, shape.axes + axis, n + shape.axes + axis] = 1.0
    whole = exponential_less_one(interval / 2**doublings * wide)
    forward = np.eye(n) + whole[0, :n, :n]
    found = whole[:, :n, n:] @ forward.T
    for _ in range(doublings):
        found = found + forward @ found @ forward.T
        forward = forward @ forward
    return np.asarray((found + found.transpose(0, 2, 1)) / 2)


def thermal_spectra(shape: Shape, spectra: Sequence[Spectrum], unit: float, parameters: Array) -> list[Complex]:
    """V of each record for each axis: (axes, bins, axes, axes)."""
    found = []
    maps: dict[float, tuple[Sampled, Array]] = {}
    for one in spectra:
        interval = one.interval * unit
        if interval not in maps:
            maps[interval] = sampled(shape, parameters, interval), process_covariance(shape, parameters, interval)
        of, covariance = maps[interval]
        seen = resolvent(shape, of, one.frequency / unit, interval)[:, : shape.axes, :]
        found.append(np.asarray(seen @ covariance[:, None] @ seen.conj().transpose(0, 2, 1)))
    return found


def weights(noise: Noise, spectra: Sequence[Complex] | None = None) -> list[Complex]:
    """Matrices that whiten the bins of each record: (bins or 1, axes, axes). `spectra`: of `thermal_spectra`."""
    found: list[Complex] = []
    for i, deviations in enumerate(noise.white):
        if spectra is None or not noise.is_thermal:
            found.append(np.diag(1 / deviations).astype(complex)[None])
            continue
        ratio = np.einsum("j,jkab->kab", noise.thermal, spectra[i]) / np.outer(deviations, deviations)
        root = np.linalg.cholesky(np.eye(len(deviations)) + ratio)
        found.append(np.asarray(np.linalg.inv(root) / deviations))
    return found


@dataclass(frozen=True)
class _Part:
    """A record in the coordinates of the present weights: residuals, (bins, axes), columns of what was fitted,
    (bins, axes, count), and the shapes of the variances, (count, bins, axes, axes)."""

    residuals: Complex
    columns: Complex
    shapes: Complex


def estimated(
    noise: Noise,
    spectra: Sequence[Complex],
    whitened: Sequence[Complex],
    residuals: Sequence[Complex],
    columns: Sequence[Complex],
) -> Noise:
    """The variances with the largest restricted likelihood, from the residuals of a fit with the weights `whitened`.

    `columns`: of each record, (bins, axes, count), derivatives with respect to all that was fitted, so weighted too.
    Thermal motion stays only if the ratio of the likelihoods shows it.
    """
    records, axes = noise.white.shape
    parts = []
    for i, (weight, rest, column) in enumerate(zip(whitened, residuals, columns, strict=True)):
        shapes = np.zeros((records * axes + axes, len(rest), axes, axes), dtype=complex)
        for axis in range(axes):
            unit = np.zeros((axes, axes))
            unit[axis, axis] = noise.white[i, axis] ** 2  # so that all variances are near 1
            shapes[i * axes + axis] = weight @ unit @ weight.conj().transpose(0, 2, 1)
            thermal = spectra[i][axis] * _unit(noise, spectra)[axis]
            shapes[records * axes + axis] = weight @ thermal @ weight.conj().transpose(0, 2, 1)
        parts.append(_Part(rest, column, shapes))
    white = np.arange(records * axes + axes) < records * axes
    start = np.where(white, 1.0, 0.0)
    plain, without, score, information = _searched(parts, start, white)
    if _by_score(score, information, white) < HARDLY:
        deviations = noise.white * np.sqrt(plain[white].reshape(records, axes))
        return Noise(deviations, np.zeros(axes), np.zeros(axes))
    begin = np.where(white, plain, 0.0)
    begin[~white] = noise.thermal / _unit(noise, spectra)
    free, likelihood, _, information = _searched(parts, begin, np.ones(len(start), dtype=bool))
    ratio = 2 * (likelihood - without)
    p = _boundary(axes, ratio)
    scales = _unit(noise, spectra)
    if p > BOUND:
        deviations = noise.white * np.sqrt(plain[white].reshape(records, axes))
        return Noise(deviations, np.zeros(axes), np.zeros(axes), p)
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(information)), 0.0))[~white] * scales
    deviations = noise.white * np.sqrt(free[white].reshape(records, axes))
    return Noise(deviations, free[~white] * scales, spread, p)


def _by_score(score: Array, information: Array, white: NDArray[np.bool_]) -> float:
    """About the ratio of the likelihoods with the best thermal motion and without, from the derivatives without: each
    axis by itself."""
    among, between = information[np.ix_(white, white)], information[np.ix_(white, ~white)]
    left = score[~white] - between.T @ np.linalg.lstsq(among, score[white], rcond=1e-12)[0]
    own = np.diag(information)[~white] - (between * np.linalg.lstsq(among, between, rcond=1e-12)[0]).sum(axis=0)
    return float(np.sum(np.maximum(left, 0.0) ** 2 / np.maximum(own, np.finfo(float).tiny)))


def _unit(noise: Noise, spectra: Sequence[Complex]) -> Array:
    """Thermal density of each axis that equals the white noise in its clearest bin."""
    axes = noise.white.shape[1]
    peaks = [
        max(
            float(np.real(one[axis, :, axis, axis]).max()) / deviations[axis] ** 2
            for one, deviations in zip(spectra, noise.white, strict=True)
        )
        for axis in range(axes)
    ]
    return 1 / np.array(peaks)


def _boundary(axes: int, ratio: float) -> float:
    """Probability of a likelihood ratio of variances that are zero: a mixture of chi^2 (S. Self, K. Liang, 1987)."""
    if not ratio > 0:
        return 1.0
    if axes == 1:
        return float(0.5 * chdtrc(1, ratio))
    return float(0.5 * chdtrc(1, ratio) + 0.25 * chdtrc(2, ratio))


def _searched(parts: Sequence[_Part], start: Array, free: NDArray[np.bool_]) -> tuple[Array, float, Array, Array]:
    """The variances, the restricted log-likelihood, its derivative and the information of all variances, by Fisher's
    scoring."""
    values = start
    best, score, information = _likelihood(parts, values)
    for _ in range(STEPS):
        held = free & ((values > SMALLEST) | (score > 0))
        step = np.zeros(len(values))
        step[held] = np.linalg.lstsq(information[np.ix_(held, held)], score[held], rcond=1e-12)[0]
        improved = False
        for _ in range(12):
            trial = np.maximum(values + step, np.where(start > 0, 0.05 * values, 0.0))
            if np.allclose(trial, values, rtol=SAME, atol=SAME**2):
                break
            found, new_score, new_information = _likelihood(parts, trial)
            if found > best:
                improved = True
                break
            step = step / 4
        if not improved:
            break
        values, best, score, information = trial, found, new_score, new_information
    return values, best, score, information


def _likelihood(parts: Sequence[_Part], values: Array) -> tuple[float, Array, Array]:
    """Restricted log-likelihood, its derivative, and the expected information, of these variances."""
    count = parts[0].columns.shape[2]
    normal, right = np.zeros((count, count)), np.zeros(count)
    inverses = []
    found = 0.0
    for part in parts:
        inverse = np.linalg.inv(np.einsum("j,jkab->kab", values, part.shapes))
        inverses.append(inverse)
        found += float(np.log(np.abs(np.linalg.det(inverse))).sum())
        weighed = (inverse @ part.columns).reshape(-1, count)
        flat = part.columns.reshape(-1, count)
        normal += np.real(flat.conj().T @ weighed)
        right += np.real(weighed.conj().T @ part.residuals.ravel())
    solved = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)
    shift = solved @ right
    eigenvalues = np.linalg.eigvalsh(normal)
    found -= 0.5 * float(np.log(eigenvalues[eigenvalues > 1e-12 * eigenvalues[-1]]).sum())
    score, information = np.zeros(len(values)), np.zeros((len(values), len(values)))
    for part, inverse in zip(parts, inverses, strict=True):
        rest = part.residuals - part.columns @ shift
        along = (inverse @ rest[:, :, None])[:, :, 0]
        found -= 0.5 * float(np.real(np.vdot(rest, along)))
        columns = inverse @ part.columns
        used = [j for j in range(len(values)) if part.shapes[j].any()]
        products = inverse @ part.shapes[used]
        turned = columns.reshape(-1, count).conj().T
        for j, product in zip(used, products, strict=True):
            absorbed = np.real(turned @ (part.shapes[j] @ columns).reshape(-1, count))
            score[j] -= float(np.real(np.trace(product, axis1=1, axis2=2)).sum())
            score[j] += 0.5 * float((solved * absorbed).sum())
            score[j] += 0.5 * float(np.real(np.vdot(along, (part.shapes[j] @ along[:, :, None])[:, :, 0])))
        rows = products.reshape(len(used), -1)
        columns_of = products.transpose(0, 1, 3, 2).reshape(len(used), -1)
        information[np.ix_(used, used)] += np.real(rows @ columns_of.T)
    return found, score, information


def gain_of_pickoff(
    noise: Noise, damping: float, unit: float, mass: float, temperature: float
) -> tuple[float, tuple[float, float]] | None:
    """The gain of the x pick-off, m per unit of the record, from its thermal motion, and its 95 % interval; or None.

    `damping`: C_11 in units of omega0, `unit`. The force has the density 2 k_B T times the damping, if nothing else
    drives the device.
    """
    density, deviation = float(noise.thermal[0]), float(noise.deviation[0])
    if not density > 0 or not 0 < deviation < MAX_SPREAD * density or not damping > 0:
        return None
    force = thermal_force_density(mass * unit * damping, temperature) / (mass**2 * unit**3)
    freedom = 2 * (density / deviation) ** 2  # a variance is distributed as chi^2
    low, high = (float(chdtri(freedom, p)) / freedom for p in (0.975, 0.025))
    gain = (force / density) ** 0.5
    return gain, (gain * low**0.5, gain * high**0.5)
