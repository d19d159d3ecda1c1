"""Reference fractional operators over a whole record, O(n log n), to check the O(1)-memory ones.

Everything is nondimensional.  A record holds one sample per row, at times t_k = k step; its operators
start from t = 0 (lower terminal 0).  With nu = 1 - order,

    I^nu f(t)    = 1/Gamma(nu) * integral_0^t (t - tau)^(nu - 1) f(tau) dtau     (Riemann-Liouville integral),
    D^order f(t) = I^nu f'(t)                                                   (Caputo; paper, eq. (7)).

`hermite` is exact for the cubic Hermite interpolant of values and rates (product integration: Diethelm,
The Analysis of Fractional Differential Equations, 2010, appendix C); `grunwald_letnikov` is the classical
first-order difference (Podlubny, Fractional Differential Equations, 1999, sec. 2.2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["grunwald_letnikov", "hermite"]

Array = npt.NDArray[np.float64]


def hermite(values: npt.ArrayLike, rates: npt.ArrayLike, step: float, order: float) -> tuple[Array, Array]:
    """I^(1-order) and the Caputo derivative D^order of the cubic Hermite interpolant of a record.

    values, rates: the signal and its time derivative at t_k = k step, both of shape (n,) or (n, channels).
    step: sampling step, > 0. order: order of the derivative, in [0, 1].

    Returns (integral, caputo), each of the shape of `values`; integral is I^(1-order) = D^(order-1) of the signal. At
    order 1 they are (values, rates). At order 0 the integral is the running integral from 0 and caputo is `values`, as
    eq. (7) of the paper defines D^0 f = f; the limit order -> 0+ is different: values - values[0].

    The error is that of the interpolant, O(step^3) or better for smooth signals (about step^(4-order)), plus rounding
    of about 1e-15 relative to the largest result. Raises ValueError for mismatched or empty arrays, non-finite samples,
    step <= 0 or order outside [0, 1].

    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> integral, derivative = fg.fractional.full_history.hermite(t, np.ones_like(t), 1e-3, order=0.5)
    >>> bool(abs(derivative - 2 * np.sqrt(t / np.pi)).max() < 1e-12)
    True
    """
    values, rates = _record(values, "values"), _record(rates, "rates")
    if values.shape != rates.shape:
        raise ValueError(f"rates must have the shape of values, {values.shape}, got {rates.shape}")
    _check_step(step)
    if not 0.0 <= order <= 1.0:
        raise ValueError(f"order must lie in [0, 1], got {order}")
    if order == 1.0:
        return values.copy(), rates.copy()

    # On the interval before sample j let x in [0, 1] be the distance back from t_j, in steps (left end: x=1).
    # With the fall F = e_left - e_right across it, the interpolant of value e and rate v is
    #     e(x) = e_right (1-x) + e_left x - (F + h v_right) x (1-x)^2 + (F + h v_left) x^2 (1-x),
    #     e'   = v_left x + v_right (1-x) + 6 kappa x (1-x),   kappa = -F/h - (v_left + v_right)/2.
    # Seen from t_n = t_j + m h the kernel of I^nu is h^nu (m + x)^(-order) / Gamma(nu); it acts on e for the
    # integral and on e' for the derivative.
    right, left = values[1:], values[:-1]
    rate_right, rate_left = rates[1:], rates[:-1]
    fall = left - right
    moments = _Moments(-order, len(values) - 1)
    integral = _history(
        [
            (moments(0, 1), right),
            (moments(1, 0), left),
            (moments(1, 2), -(fall + step * rate_right)),
            (moments(2, 1), fall + step * rate_left),
        ],
        values.shape,
    )
    scale = step ** (1.0 - order) / math.gamma(1.0 - order)
    if order == 0.0:
        return scale * integral, values.copy()
    kappa = -fall / step - 0.5 * (rate_left + rate_right)
    caputo = _history(
        [(moments(1, 0), rate_left), (moments(0, 1), rate_right), (6.0 * moments(1, 1), kappa)], values.shape
    )
    return scale * integral, scale * caputo


def grunwald_letnikov(values: npt.ArrayLike, step: float, order: float) -> Array:
    """Gruenwald-Letnikov derivative step^(-order) sum_k (-1)^k binom(order, k) values[n-k], full window.

    values: shape (n,) or (n, channels), sampled at t_k = k step. step: sampling step, > 0.
    order: in [-1, 1]; a negative order integrates. Order 0 returns `values`.

    Returns the shape of `values`. Approximates the Riemann-Liouville derivative of a signal that is zero before t = 0,
    to first order in step away from t = 0 (a jump values[0] != 0 adds its t^(-order)). Raises ValueError for empty or
    non-finite values, step <= 0 or order outside [-1, 1].

    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> found = fg.fractional.full_history.grunwald_letnikov(t, 1e-3, order=0.5)
    >>> bool(abs(found - 2 * np.sqrt(t / np.pi)).max() < 0.02)
    True
    """
    values = _record(values, "values")
    _check_step(step)
    if not -1.0 <= order <= 1.0:
        raise ValueError(f"order must lie in [-1, 1], got {order}")
    # Orders with a finite or constant window, computed without the rounding of an FFT.
    if order == 0.0:
        return values.copy()
    if order == 1.0:
        difference: Array = np.diff(values, axis=0, prepend=0.0)
        return difference / step
    if order == -1.0:
        return np.cumsum(values, axis=0) * step
    # (-1)^k binom(order, k) from the ratio of neighboring terms, 1 - (order + 1)/k.
    factors = 1.0 - (order + 1.0) / np.arange(1, len(values))
    coefficients = np.concatenate([[1.0], np.cumprod(factors)])
    return _causal_sum([(coefficients, values)]) * math.pow(step, -order)


class _Moments:
    """Call (i, j) for the integrals over x in [0, 1] of (m + x)^power x^i (1-x)^j, m = 0 .. count-1.

    m = 0, where the kernel is singular, uses the closed form, a beta function; the others use Gauss-Legendre: the
    integrand is analytic except at x = -m, so 16 points have an error of (3 + sqrt 8)^-32 = 3e-25. All terms are
    positive, so there is no cancellation for large m, unlike with differences of powers.
    """

    def __init__(self, power: float, count: int) -> None:
        self._power, self._count = power, count
        nodes, weights = np.polynomial.legendre.leggauss(16)
        self._nodes, self._weights = 0.5 * (nodes + 1.0), 0.5 * weights
        self._kernel = (np.arange(1, max(count, 1))[:, None] + self._nodes) ** power

    def __call__(self, i: int, j: int) -> Array:
        nearest = math.gamma(self._power + 1.0 + i) * math.gamma(j + 1.0) / math.gamma(self._power + i + j + 2.0)
        farther = self._kernel @ (self._weights * self._nodes**i * (1.0 - self._nodes) ** j)
        return np.concatenate([[nearest], farther])[: self._count]


def _history(terms: Sequence[tuple[Array, Array]], shape: tuple[int, ...]) -> Array:
    """Sum over the intervals before each sample; zero at the first sample."""
    result = np.zeros(shape)
    if shape[0] > 1:
        result[1:] = _causal_sum(terms)
    return result


def _causal_sum(terms: Sequence[tuple[Array, Array]]) -> Array:
    """Sum over the terms of sum_m kernel[m] data[n - m]; kernel (n,), data (n,) or (n, channels).

    The terms are added as spectra (zero-padded against wrap-around), so that one inverse FFT is enough.
    """
    count = len(terms[0][1])
    length = 1 << (2 * count - 1).bit_length()
    spectrum = sum(
        np.fft.rfft(kernel.reshape(-1, *[1] * (data.ndim - 1)), length, axis=0) * np.fft.rfft(data, length, axis=0)
        for kernel, data in terms
    )
    result: Array = np.fft.irfft(np.asarray(spectrum), length, axis=0)[:count]
    return result


def _record(samples: npt.ArrayLike, name: str) -> Array:
    record = np.asarray(samples, dtype=np.float64)
    if record.ndim not in (1, 2) or record.shape[0] == 0:
        raise ValueError(f"{name} must have shape (n,) or (n, channels) with n > 0, got {record.shape}")
    if not np.isfinite(record).all():
        raise ValueError(f"{name} must be finite")
    return record


def _check_step(step: float) -> None:
    if not 0.0 < step < math.inf:
        raise ValueError(f"step must be positive and finite, got {step}")
