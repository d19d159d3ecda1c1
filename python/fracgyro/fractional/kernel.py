"""The fractional kernel as a sum of exponentials: the constants behind an O(1)-memory fractional operator.

The kernel of I^(1-order) and of the Caputo derivative D^order, 0 < order < 1 (paper, eq. (7)), is
t^(-order) / Gamma(1 - order). `design` replaces it on [shortest, longest] by sum_j weights[j] exp(-poles[j] t), as
include/fracgyro/core/kernel_design.hpp explains: the same arguments give the same bits on every processor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from .. import _core

Vector = npt.NDArray[np.float64]
MIN_RANGE = 10.0  # the exponentials cover at least this many steps, however short the run


@dataclass(frozen=True, eq=False)
class ExponentialSum:
    """A sum of exponentials for t^(-order)/Gamma(1-order), made by `design`. Arrays are read-only.

    >>> kernel = fg.fractional.design(order=0.9, shortest=1e-3, longest=10.0, tolerance=1e-6)
    >>> t = np.geomspace(1e-3, 10.0)
    >>> found = np.exp(-np.outer(t, kernel.poles)) @ kernel.weights
    >>> bool((abs(found / (t**-0.9 / 9.513507698668732) - 1) <= kernel.error).all())  # Gamma(0.1)
    True
    """

    order: float  #: as asked for, as are the next three
    shortest: float  #: times in one unit of the caller's choice
    longest: float
    tolerance: float
    poles: Vector  #: shape (count,), ascending, unit 1/time, all positive
    weights: Vector  #: shape (count,), unit time^(-order), all positive
    error: float  #: proven bound of the relative error over all of [shortest, longest]; at most the tolerance

    @property
    def count(self) -> int:
        """Number of exponentials."""
        return len(self.poles)


@lru_cache(maxsize=256)
def design(order: float, shortest: float, longest: float, tolerance: float) -> ExponentialSum:
    """Fewest positive exponentials (to within one) for t^(-order)/Gamma(1-order) on [shortest, longest].

    order: order of the fractional derivative, in (0, 1), dimensionless.
    shortest, longest: ends of the range of time lags, one common unit, longest/shortest in (1, 1e10].
    tolerance: largest relative error of the kernel, in [1e-11, 1e-1].

    Results are cached and deterministic. The design depends only on longest/shortest; the unit of time scales it:
    poles ~ 1/shortest, weights ~ shortest^(-order). Raises ValueError for arguments outside the ranges above
    (ArithmeticError if none were found; no such arguments are known).

    >>> kernel = fg.fractional.design(order=0.9, shortest=1e-3, longest=80.0, tolerance=1e-6)
    >>> kernel.count, kernel.error <= 1e-6
    (21, True)
    """
    order, shortest, longest, tolerance = map(float, (order, shortest, longest, tolerance))
    check(order, shortest, longest, tolerance)
    poles, weights, error = _core.design_kernel(order, shortest, longest, tolerance)
    if not len(poles):
        raise ArithmeticError(f"no exponentials found for order {order}, range {shortest} to {longest}")
    poles.flags.writeable = weights.flags.writeable = False
    return ExponentialSum(order, shortest, longest, tolerance, poles, weights, error)


def check(order: float, shortest: float, longest: float, tolerance: float) -> None:
    """Raises ValueError, in one sentence, for what `design` does not take."""
    if not 0.0 < order < 1.0:
        raise ValueError(f"order must lie in (0, 1), got {order}")
    if not _core.earliest <= shortest <= _core.latest:
        limits = f"{_core.earliest:g} and {_core.latest:g}".replace("+", "")
        raise ValueError(f"shortest must be a positive time between {limits}, got {shortest}")
    if not shortest < longest < math.inf:
        raise ValueError(f"longest must be finite and greater than shortest = {shortest}, got {longest}")
    if not longest <= _core.largest_ratio * shortest:
        limit = f"{_core.largest_ratio:g} times shortest = {shortest}"
        raise ValueError(f"longest must be at most {limit}, got {longest}")
    if not _core.smallest_tolerance <= tolerance <= _core.largest_tolerance:
        limits = f"[{_core.smallest_tolerance:g}, {_core.largest_tolerance:g}]"
        raise ValueError(f"tolerance must lie in {limits}, got {tolerance}")


@lru_cache(maxsize=1024)  # a design takes milliseconds, and studies ask for few different ones
def core_kernel(order: float, step: float, duration: float, tolerance: float) -> _core.ExponentialSum:
    """Exponentials of I^(1-order) for samples `step` apart over `duration`; none for order 0 and 1, which need none.

    Raises ValueError when order, step, duration or tolerance are outside what `design` allows, or the core has no
    room for as many exponentials as they take.
    """
    if order not in (0.0, 1.0):
        check(order, step, max(duration, MIN_RANGE * step), tolerance)
    found = _core.designed_kernel(order, step, duration, tolerance)
    if order not in (0.0, 1.0) and not found.count:
        raise ValueError(
            f"tolerance is {tolerance}: it must be larger for order {order} and {duration / step:.3g} steps, which "
            f"would take more than {_core.kernel_capacity} exponentials"
        )
    return found
