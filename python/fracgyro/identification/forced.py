"""The delay of the force in a forced record: whole samples by the likelihood, then a fraction of the interval.

The first samples of a record and the last are left out of the motion, so that the force of each is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .likelihood import Fit, linearized, maximize, search
from .model import Complex, Shape
from .records import Segment
from .spectra import Spectrum, spectrum
from .thermal import thermal_spectra, weights

Array = NDArray[np.float64]

DELAYS = range(-1, 9)  # samples; -1: each force stands in the row of the motion after it
GAIN = 6.63  # decrease of the sum of squares of a fraction that is kept: 1 % of chi^2 with one degree of freedom
SEARCHES, POLISH = 10, 4  # steps of the search for the fraction, and steps of each fit in it
REFINEMENTS = 4  # looks at the fraction that the search found, each but the last with a step
LEAST = 0.01  # fraction next to a whole delay
GOLDEN = (math.sqrt(5) - 1) / 2
DIFFERENCE = 1e-4  # step of the derivative, in intervals


@dataclass(frozen=True)
class Delay:
    """Delay of the force: whole samples, a fraction of the interval and its deviation, and the interval, s.

    The deviation is infinite if the force moves nothing.
    """

    samples: int
    fraction: float
    deviation: float
    interval: float

    @property
    def seconds(self) -> float:
        return (self.samples + self.fraction) * self.interval

    def plain(self) -> dict[str, Any]:
        """The delay as JSON."""
        known = math.isfinite(self.deviation)
        return {"samples": self.samples, "fraction": self.fraction, "deviation": self.deviation if known else None}


def delayed(segment: Segment, delay: int) -> Segment:
    """The segment without its first samples and its last, with the force of `delay` samples earlier."""
    force = segment.force
    assert force is not None
    first, last = DELAYS[-1] + 1, force.shape[1] + DELAYS[0]
    return replace(
        segment,
        motion=segment.motion[:, first:last],
        force=force[:, first - delay : last - delay],
        before=force[:, first - delay - 1 : last - delay - 1],
        begin=segment.begin + first * segment.interval,
    )


def spectrum_of(segment: Segment) -> Spectrum:
    """The spectrum of a segment."""
    return spectrum(segment.motion, segment.force, segment.interval, segment.before)


def fractional(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, fit: Fit, delay: int, segments: Sequence[Segment]
) -> tuple[Fit, list[Spectrum], Delay]:
    """The fit with a fraction of the interval as one more unknown, if the residuals show it; else as it was."""
    noise = fit.thermal
    whiten = weights(noise, thermal_spectra(shape, spectra, unit, fit.parameters) if noise.is_thermal else None)
    best: tuple[float, float, int, list[Spectrum]] = fit.squares - GAIN, 0.0, delay, list(spectra)
    for whole in (delay, delay - 1):
        if whole < DELAYS[0]:
            continue
        moved = list(spectra)
        if whole != delay:  # the same motion, with the force of one sample later
            moved = [_later(one, segment) for one, segment in zip(spectra, segments, strict=True)]
        squares, fraction = _search(shape, moved, unit, fit.parameters, whiten)
        if squares < best[0]:
            best = squares, fraction, whole, [replace(one, fraction=fraction) for one in moved]
    _, fraction, whole, found = best
    if fraction > 0:
        fit = maximize(shape, found, unit, fit.parameters, noise)
        noise = fit.thermal
        whiten = weights(noise, thermal_spectra(shape, found, unit, fit.parameters) if noise.is_thermal else None)
    # The search ends some deviations away from the best fraction: Gauss and Newton's steps lead there.
    for i in range(REFINEMENTS):
        residuals, column, jacobian = _by_fraction(shape, found, unit, fit.parameters, whiten)
        rest = column - jacobian @ np.linalg.lstsq(jacobian, column, rcond=None)[0]
        size = float(np.linalg.norm(rest))
        if i == REFINEMENTS - 1 or not (fraction > 0 and size > 0):
            break
        fraction = min(max(fraction - float(rest @ residuals) / size**2, LEAST), 1 - LEAST)
        found = [replace(one, fraction=fraction) for one in found]
        fit = maximize(shape, found, unit, fit.parameters, noise)
    deviation = 1 / size if size > 0 else math.inf  # the force moves nothing
    if fraction > 0:
        norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        shift = np.linalg.lstsq(jacobian / norms, column, rcond=None)[0] / norms
        fit = replace(fit, covariance=fit.covariance + deviation**2 * np.outer(shift, shift))
    return fit, found, Delay(whole, fraction, deviation, segments[0].interval)


def _later(one: Spectrum, segment: Segment) -> Spectrum:
    """The spectrum with the force of one sample later; the last sample of it is unknown and taken as the one before."""
    force = segment.force
    assert force is not None
    ahead = np.concatenate([force[:, 1:], force[:, -1:]], axis=1)
    whole = spectrum(segment.motion, ahead, segment.interval, force)
    return whole.between(float(one.frequency[0]) * (1 - 1e-9), float(one.frequency[-1]) * (1 + 1e-9))


def _search(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, parameters: Array, whiten: Sequence[Complex]
) -> tuple[float, float]:
    """The smallest sum of squares over the fraction, and the fraction: by golden sections."""

    def squares(fraction: float) -> float:
        moved = [replace(one, fraction=fraction) for one in spectra]
        return search(shape, moved, unit, parameters, whiten, POLISH).squares

    low, high = LEAST, 1 - LEAST
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = squares(left), squares(right)
    for _ in range(SEARCHES):
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = squares(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = squares(right)
    return min((at_left, left), (at_right, right))


def _by_fraction(
    shape: Shape, spectra: Sequence[Spectrum], unit: float, parameters: Array, whiten: Sequence[Complex]
) -> tuple[Array, Array, Array]:
    """The residuals, their derivative with respect to the fraction, and the Jacobian."""
    here = [replace(one, fraction=max(one.fraction, DIFFERENCE)) for one in spectra]
    there = [replace(one, fraction=one.fraction + DIFFERENCE) for one in here]
    first, second = (linearized(shape, each, unit, parameters, whiten) for each in (here, there))
    return first.residuals, (second.residuals - first.residuals) / DIFFERENCE, first.jacobian
