"""Cubic springs in free decays: whether the frequency depends on the amplitude, and the fit that includes it.

    y'' + C y' + K y + V k (V^-1 y)^3 = 0

with one k for each principal axis of the stiffness; V: these axes, of which the first is seen by x and the second by y
with a gain of 1. Near the modes x^3 is 3/4 |z|^2 z, where z is the analytic signal.

First the measured motion gives the cube (cubic_force.py). Its score is the test, and its fit the start of the second:
maximum likelihood with the simulated motion (cubic_fit.py), because in the first the noise of the motion is in the
force.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cubic_fit import simulated_fit
from .cubic_force import by_measured_force, forced_problem, scores
from .likelihood import Fit
from .model import Shape
from .records import Segment
from .spectra import Spectrum
from .thermal import only_white, thermal_spectra, weights

Array = NDArray[np.float64]

SEEN = 3.0  # standard deviations of a spring that is not zero


@dataclass(frozen=True)
class Cubic:
    """Springs of a fit, by axis. `strength`: k, in units of omega0^2 over the square of the record's unit, 0 without
    one in the fit; `covariance`: of `strength`; `score`: of the test, in standard deviations; `first`: k by the test;
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
    problem, largest = forced_problem(shape, fit.parameters, spectra, segments, unit)
    shapes = thermal_spectra(shape, spectra, unit, fit.parameters) if fit.thermal.is_thermal else None
    whiten = weights(fit.thermal, shapes)
    nothing = np.concatenate([fit.parameters, np.zeros(n)])
    rest, jacobian = problem(whiten, np.arange(n))(nothing)
    score, first = scores(rest, jacobian, n)
    found = Cubic(np.zeros(n), np.zeros((n, n)), score, first, largest)
    seen = np.flatnonzero(np.abs(score) > SEEN)
    if len(seen) == 0 or shape.drives:
        return fit, found
    # The residual of a spring resembles thermal motion: the fits start from white noise, as most bins show it.
    white = [np.median(np.abs(each), axis=0) / math.sqrt(2 * math.log(2)) for each in fit.left]
    linear = fit
    fit = replace(fit, thermal=only_white(np.array(white)), noise=np.array(white))
    whiten = weights(fit.thermal)
    best = by_measured_force(problem, fit, whiten, seen)
    problem = forced_problem(shape, best[: shape.count], spectra, segments, unit)[
        0
    ]  # the linear fit's axes may be far off
    best = by_measured_force(problem, replace(fit, parameters=best[: shape.count]), whiten, seen)
    improved = simulated_fit(problem, best, seen, fit, whiten)
    if improved is None:
        return linear, found
    new, strength, covariance, moved = improved
    whole, spread = np.zeros(n), np.zeros((n, n))
    whole[seen], spread[np.ix_(seen, seen)] = strength, covariance
    if not (np.abs(strength) > SEEN * np.sqrt(np.diag(covariance))).all():  # something else than springs
        return linear, found
    return new, Cubic(whole, spread, score, first, largest, moved)
