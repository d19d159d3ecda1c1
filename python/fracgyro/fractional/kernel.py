"""The fractional kernel as a sum of exponentials, for an O(1)-memory fractional operator.

The kernel of I^(1-order) and of the Caputo derivative D^order, 0 < order < 1 (paper, eq. (7)), is
t^(-order) / Gamma(1 - order). `design` approximates it on [shortest, longest] by sum_j weights[j] exp(-poles[j] t), as
in include/fracgyro/core/kernel_design.hpp; the same arguments give the same bits on every processor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import _core
from ..arguments import real
from .sampled import Between, Sampled, has_parabolas

Vector = npt.NDArray[np.float64]
GRID = 1e-4  # spacing of the logarithm of frequency for error bounds
MIN_RANGE = 10.0  # shortest range of the exponentials, in steps


@dataclass(frozen=True, eq=False)
class ExponentialSum:
    """A sum of exponentials for t^(-order)/Gamma(1-order), made by `design`. Arrays are read-only.

    >>> kernel = fg.fractional.design(order=0.9, shortest=1e-3, longest=10.0, tolerance=1e-6)
    >>> t = np.geomspace(1e-3, 10.0)
    >>> found = np.exp(-np.outer(t, kernel.poles)) @ kernel.weights
    >>> bool((abs(found / (t**-0.9 / 9.513507698668732) - 1) <= kernel.error).all())  # Gamma(0.1)
    True
    """

    order: float  #: as requested, like the next three
    shortest: float  #: times, in any common unit
    longest: float
    tolerance: float
    poles: Vector  #: shape (count,), ascending, unit 1/time, all positive
    weights: Vector  #: shape (count,), unit time^(-order), all positive
    error: float  #: proven bound of the relative error on [shortest, longest]; at most the tolerance

    @property
    def count(self) -> int:
        """Number of exponentials."""
        return len(self.poles)

    @property
    def direct(self) -> float:
        """Weight of the signal itself, for the part of the kernel below `shortest`; unit time^(1-order)."""
        kernel = math.pow(self.shortest, 1.0 - self.order) / math.gamma(2.0 - self.order)
        return kernel + float(np.sum(self.weights * np.expm1(-self.poles * self.shortest) / self.poles))

    def frequency_response(self, frequency: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Frequency response of the fractional integral I^(1-order), ideally s^(order-1) at s = j frequency.

        `frequency`: rad per unit of time, any shape; the result has the same shape. `frequency_error` bounds the error.

        >>> kernel = fg.fractional.design(order=0.9, shortest=1e-5, longest=80.0, tolerance=1e-6)
        >>> bool(abs(kernel.frequency_response(10.0) / 10j**-0.1 - 1) < 2e-5)
        True
        """
        s = 1j * np.asarray(frequency, dtype=np.float64)
        found: npt.NDArray[np.complex128] = self.direct + (self.weights / (s[..., None] + self.poles)).sum(axis=-1)
        return found

    def frequency_error(self, lowest: float, highest: float) -> float:
        """Bound of the relative error of `frequency_response` from `lowest` to `highest`, proven except for rounding.

        It is the largest error on a grid plus a bound of the variation between grid points. Small errors require a
        range of times from well below 1/highest to well above 1/lowest. Raises ValueError unless 0 < lowest <= highest
        < infinity.

        >>> kernel = fg.fractional.design(order=0.9, shortest=1e-5, longest=80.0, tolerance=1e-6)
        >>> kernel.count, kernel.frequency_error(0.1, 316.0) < 2e-5
        (29, True)
        """
        lowest, highest = real("lowest", lowest), real("highest", highest)
        if not 0.0 < lowest <= highest < math.inf:
            raise ValueError(f"lowest and highest must be positive, finite and in this order, got {lowest}, {highest}")
        beta = 1.0 - self.order
        points = 1 + max(1, math.ceil(math.log(highest / lowest) / GRID))
        worst = 0.0
        for z in np.array_split(np.linspace(math.log(lowest), math.log(highest), points), 1 + points // 4096):
            w = np.exp(z)
            power = (1j * w) ** beta
            # One exponential, f(z) = weight (jw)^beta / (jw + pole), has f' = f (beta - u) and
            # f'' = f ((beta - u)^2 - u (1 - u)) with u = jw / (jw + pole), of which |u| <= 1 and |u (1 - u)| <= 1/2.
            u = 1j * w[:, None] / (1j * w[:, None] + self.poles)
            terms = power[:, None] * (1.0 - u) * (self.weights / self.poles)
            error = abs(power * self.direct + terms.sum(axis=1) - 1.0)
            slope = abs(beta * power * self.direct + (terms * (beta - u)).sum(axis=1))
            # Within half a grid spacing |f| increases by at most the factor exp(GRID).
            curvature = beta**2 * abs(power * self.direct) + ((1.0 + beta) ** 2 + 0.5) * abs(terms).sum(axis=1)
            near = error + slope * GRID / 2 + curvature * math.exp(GRID) * GRID**2 / 8
            worst = max(worst, float(near.max()))
        return worst

    def state_space(
        self, step: float | None = None, *, derivative: bool = False, between: Between = "lines"
    ) -> tuple[Any, ...]:
        """The fractional integral I^(1-order) as matrices (A, B, C, D); with `step`, sampled: (A, B, C, D, step).

        There is one state per exponential and, if sampled, one for the last sample and one for the last change. The
        result fits python-control's `ss` and scipy's `StateSpace`. `derivative` and `between`: as in `sampled`; the
        derivative exists only sampled. Raises ValueError for a step that is not finite or below `shortest`.

        >>> kernel = fg.fractional.design(order=0.9, shortest=1e-3, longest=80.0, tolerance=1e-6)
        >>> [matrix.shape for matrix in kernel.state_space()]
        [(21, 21), (21, 1), (1, 21), (1, 1)]
        >>> A, B, C, D, step = kernel.state_space(1e-3, derivative=True)
        """
        if step is None:
            if derivative:
                raise ValueError("step must be given for a derivative, which has no state space in continuous time")
            direct = np.array([[self.direct]])
            return np.diag(-self.poles), np.ones((self.count, 1)), self.weights[None, :], direct
        return self.sampled(step, derivative=derivative, between=between).state_space()

    def sampled(self, step: float, *, derivative: bool = False, between: Between = "lines") -> Sampled:
        """The integral I^(1-order), or the derivative D^order, sample by sample.

        The signal is assumed to be 0 up to one step before the first sample, so that the Caputo and the
        Riemann-Liouville derivative are equal; for the Caputo derivative of another signal, subtract its first value.
        `between`: the signal between samples, lines or parabolas through this sample and the two before; for such
        signals the error is only that of the kernel. Parabolas are far more accurate for smooth signals. They overshoot
        after a jump or a kink, including a nonzero initial slope, and increase the noise in the derivative of order 0.9
        by a factor of 1.7. Raises TypeError or ValueError for a step that is not a finite number or below `shortest`.

        >>> kernel = fg.fractional.design(order=0.5, shortest=1e-2, longest=10.0, tolerance=1e-9)
        >>> half_integral = kernel.sampled(1e-2)
        >>> for t in 1e-2 * np.arange(1, 101):  # of a ramp: t^1.5 / Gamma(2.5)
        ...     found = half_integral.step(t)
        >>> round(found, 6)
        0.752253
        """
        step = real("step", step)
        if not self.shortest <= step < math.inf:
            raise ValueError(f"step must be finite and at least shortest = {self.shortest}, got {step}")
        terms, gains = _core.sampled_operator(
            self.poles, self.weights, self.order, self.shortest, step, derivative, has_parabolas(between)
        )
        nothing = np.zeros((0, 2))
        return Sampled(step, nothing, terms, *gains) if derivative else Sampled(step, terms, nothing, *gains)


def design(order: float, shortest: float, longest: float, tolerance: float) -> ExponentialSum:
    """Minimal number (within one) of positive exponentials for t^(-order)/Gamma(1-order) on [shortest, longest].

    order: order of the fractional derivative, in (0, 1), dimensionless.
    shortest, longest: ends of the range of time lags, one common unit, longest/shortest in (1, 1e10].
    tolerance: largest relative error of the kernel, in [1e-11, 1e-1].

    Results are cached and deterministic. The design depends only on longest/shortest; the unit of time scales it:
    poles ~ 1/shortest, weights ~ shortest^(-order). Raises ValueError for arguments outside the ranges above
    (ArithmeticError if the design fails; no such arguments are known).

    >>> kernel = fg.fractional.design(order=0.9, shortest=1e-3, longest=80.0, tolerance=1e-6)
    >>> kernel.count, kernel.error <= 1e-6
    (21, True)
    """
    given = {"order": order, "shortest": shortest, "longest": longest, "tolerance": tolerance}
    return _designed(*(real(name, value) for name, value in given.items()))


@lru_cache(maxsize=256)
def _designed(order: float, shortest: float, longest: float, tolerance: float) -> ExponentialSum:
    check(order, shortest, longest, tolerance)
    poles, weights, error = _core.design_kernel(order, shortest, longest, tolerance)
    if not len(poles):
        raise ArithmeticError(f"no exponentials found for order {order}, range {shortest} to {longest}")
    poles.flags.writeable = weights.flags.writeable = False
    return ExponentialSum(order, shortest, longest, tolerance, poles, weights, error)


def check(order: float, shortest: float, longest: float, tolerance: float, *, shortest_is: str = "shortest") -> None:
    """Raises ValueError for invalid arguments of `design`.

    `shortest_is`: name of the argument `shortest` in the message.
    """
    if not 0.0 < order < 1.0:
        raise ValueError(f"order must lie in (0, 1), got {order}")
    if not _core.earliest <= shortest <= _core.latest:
        limits = f"{_core.earliest:g} and {_core.latest:g}".replace("+", "")
        raise ValueError(f"{shortest_is} must be a positive time between {limits}, got {shortest}")
    if not shortest < longest < math.inf:
        raise ValueError(f"longest must be finite and greater than {shortest_is} = {shortest}, got {longest}")
    if not longest <= _core.largest_ratio * shortest:
        limit = f"{_core.largest_ratio:g} times {shortest_is} = {shortest}"
        raise ValueError(f"longest must be at most {limit}, got {longest}")
    if not _core.smallest_tolerance <= tolerance <= _core.largest_tolerance:
        limits = f"[{_core.smallest_tolerance:g}, {_core.largest_tolerance:g}]"
        raise ValueError(f"tolerance must lie in {limits}, got {tolerance}")


@lru_cache(maxsize=1024)  # a design takes milliseconds, and a study needs few
def core_kernel(order: float, step: float, duration: float, tolerance: float) -> _core.ExponentialSum:
    """Exponentials of I^(1-order) for samples `step` apart over `duration`; empty for orders 0 and 1.

    Raises ValueError for invalid arguments of `design`, and if the core has no room for the required exponentials.
    """
    if order not in (0.0, 1.0):
        check(order, step, max(duration, MIN_RANGE * step), tolerance, shortest_is="step")
    found = _core.designed_kernel(order, step, duration, tolerance)
    if order not in (0.0, 1.0) and not found.count:
        raise ValueError(
            f"tolerance is {tolerance}: it must be larger for order {order} and {duration / step:.3g} steps, which "
            f"require more than {_core.kernel_capacity} exponentials"
        )
    return found
