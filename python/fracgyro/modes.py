"""Exponential modes of the fractional kernel: the constants behind an O(1)-memory fractional operator.

The kernel of I^(1-order) and of the Caputo derivative D^order, 0 < order < 1 (paper, eq. (7)), is

    k(t) = t^(-order) / Gamma(1 - order) = sin(pi order)/pi * integral_0^inf s^(order-1) exp(-s t) ds.

`design` replaces it on [shortest, longest] by sum_j weights[j] exp(-rates[j] t), every weight and rate
positive (each mode is a stable first-order lag), with nearly the fewest modes that hold the relative
error below a tolerance.  The best sum of n modes is the one whose relative error takes its maximum with
alternating sign at 2n+1 times (Braess, Nonlinear Approximation Theory, 1986); it is found as follows.

1. Start: an analytic estimate of the optimal rates and weights (`_start`).
2. Solve for equal error at 2n+1 fixed times by Levenberg-Marquardt in (log weight, log rate) (`_level`).
3. Exchange the times for the extrema of the error (Remez) until the error is level to 2 % (`_minimax`).
4. Bound the error over the continuous range, not only at samples (`_certify`), and return that bound.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtpqrt
from scipy.special import ellipj, ellipkm1, gamma, gammaln, jv

Vector = npt.NDArray[np.float64]

LARGEST_RATIO = 1e10
SMALLEST_TOLERANCE = 1e-11
LARGEST_TOLERANCE = 1e-1


@dataclass(frozen=True, eq=False)
class Modes:
    """A sum of exponentials for t^(-order)/Gamma(1-order); see `design`.

    order, shortest, longest, tolerance: as asked for, the times in one unit of the caller's choice.
    rates: shape (count,), ascending, unit 1/time, all positive.  Read-only.
    weights: shape (count,), unit time^(-order), all positive.  Read-only.
    error: proven bound on |sum/kernel - 1| over all of [shortest, longest]; error <= tolerance.
    """

    order: float
    shortest: float
    longest: float
    tolerance: float
    rates: Vector
    weights: Vector
    error: float

    @property
    def count(self) -> int:
        """Number of modes."""
        return len(self.rates)


@functools.lru_cache(maxsize=256)
def design(order: float, shortest: float, longest: float, tolerance: float) -> Modes:
    """Fewest positive exponentials (to within one) for t^(-order)/Gamma(1-order) on [shortest, longest].

    order: order of the fractional derivative, in (0, 1), dimensionless.
    shortest, longest: ends of the range of time lags, one common unit, longest/shortest in (1, 1e10].
    tolerance: largest relative error of the kernel, in [1e-11, 1e-1].

    Results are cached and deterministic.  The design depends on longest/shortest alone; the unit of time
    scales it: rates ~ 1/shortest, weights ~ shortest^(-order).  Raises ValueError for arguments outside the
    ranges above (ArithmeticError if no modes were found; no such arguments are known).
    """
    order, shortest, longest, tolerance = map(float, (order, shortest, longest, tolerance))
    _check(order, shortest, longest, tolerance)
    span = math.log1p((longest - shortest) / shortest)
    # Minimax errors are log(error) = log(order) + 0.65 + 1.5 order - decay * count, to within 0.5 or so (a
    # fit); the decay is Zolotarev's for wide ranges, that of polynomial interpolation for narrow ones.
    decay = max(math.pi**2 / (_quarter_period(span) + 0.25), 2.0 * math.log(8.0 / span))
    count = math.ceil((math.log(order / tolerance) + 0.65 + 1.5 * order) / decay)
    count = max(count, 1)
    best = _certified(order, span, count)
    while best[2] > tolerance:
        count += 1
        if count > 100:
            raise ArithmeticError(f"no modes found for order {order}, range {shortest} to {longest}")
        best = _certified(order, span, count)
    while count > 1 and best[2] * math.exp(0.8 * decay) <= tolerance:  # one mode fewer might do: try it
        fewer = _certified(order, span, count - 1)
        if fewer[2] > tolerance:
            break
        best, count = fewer, count - 1
    log_weights, log_rates, error = best
    rates = np.exp(log_rates) / shortest
    weights = np.exp(log_weights) * (shortest**-order / gamma(1.0 - order))
    rates.flags.writeable = weights.flags.writeable = False
    return Modes(order, shortest, longest, tolerance, rates, weights, error)


def _check(order: float, shortest: float, longest: float, tolerance: float) -> None:
    if not 0.0 < order < 1.0:
        raise ValueError(f"order must lie in (0, 1), got {order}")
    if not 1e-200 <= shortest <= 1e200:
        raise ValueError(f"shortest must be a positive time between 1e-200 and 1e200, got {shortest}")
    if not shortest < longest < math.inf:
        raise ValueError(f"longest must be finite and greater than shortest = {shortest}, got {longest}")
    if not longest <= LARGEST_RATIO * shortest:
        limit = f"{LARGEST_RATIO:g} times shortest = {shortest}"
        raise ValueError(f"longest must be at most {limit}, got {longest}")
    if not SMALLEST_TOLERANCE <= tolerance <= LARGEST_TOLERANCE:
        limits = f"[{SMALLEST_TOLERANCE:g}, {LARGEST_TOLERANCE:g}]"
        raise ValueError(f"tolerance must lie in {limits}, got {tolerance}")


# Below, time runs over [1, R]; x = log t in [0, span], span = log R; the kernel is t^(-order), so that
# a weight here is the true one times Gamma(1-order) shortest^order.


def _certified(order: float, span: float, count: int) -> tuple[Vector, Vector, float]:
    log_weights, log_rates = _minimax(order, span, count)
    return log_weights, log_rates, _certify(np.exp(log_weights), np.exp(log_rates), order, span)


def _quarter_period(span: float) -> float:
    """Elliptic quarter period K(k), k^2 = 1 - 1/R^2; near log(4 R) for wide ranges."""
    return float(ellipkm1(math.exp(-2.0 * span)))


def _alternation_times(span: float, count: int) -> Vector:
    """Logs of Zolotarev's 2n+1 alternation points R dn(i K/2n) on [1, R]: close to those of the optimum.

    Only the half nearer to R is computed; dn(K - u) = 1/(R dn(u)) mirrors it in log t without cancellation.
    """
    deficit = math.expm1(-2.0 * span)  # 1/R^2 - 1
    argument = _quarter_period(span) / (2 * count) * np.arange(count)
    sn = ellipj(argument, -deficit)[0]
    below_longest = -0.5 * np.log1p(deficit * sn * sn)
    times: Vector = np.concatenate([below_longest, [0.5 * span], span - below_longest[::-1]])
    return times


def _bessel_zeros(order: float, count: int) -> Vector:
    """First zeros of J_(order-1): McMahon's expansion (DLMF 10.21.19), the first by series, then Newton."""
    mu = 4.0 * (order - 1.0) ** 2
    beta = (np.arange(1, count + 1) + 0.5 * order - 0.75) * np.pi
    zeros: Vector = beta - (mu - 1) / (8 * beta) - 4 * (mu - 1) * (7 * mu - 31) / (3 * (8 * beta) ** 3)
    zeros[0] = math.sqrt(4 * order * (1 + order / 2 - order**2 / 12))
    for _ in range(5):
        bessel = jv(order, zeros)
        # J_(order-1) by recurrence: exact where order - 1 is about to round to -1.
        value = 2 * order / zeros * bessel - jv(order + 1.0, zeros)
        zeros = zeros - value / ((order - 1) / zeros * value - bessel)
    return zeros


def _start(order: float, span: float, count: int) -> tuple[Vector, Vector]:
    """Estimate of the optimal (log weights, log rates), within about 0.02 of them.

    In the interior the rates are uniform in log s with spacing h = (span + log 4)/n, the trapezoidal rule.
    Near s = 0 they follow Gauss quadrature of s^(order-1) ds, i.e. squared zeros j_i of J_(order-1)
    with weight factors 2/(pi j_i J_order(j_i)^2).  A smooth map of u = j_i h/pi joins the two: log u^2 for
    small u, u for large.  At the fast end the spacing widens slightly.  The constants were fitted to
    minimax sets for order .05 to .99, errors 1e-2 to 1e-11, ranges 1e5 and 1e8 (rms residual 0.003).
    """
    h = (span + math.log(4.0)) / count
    zeros = _bessel_zeros(order, count)
    u = zeros * h / np.pi
    from_fastest = h * np.arange(count)[::-1]
    radius = np.sqrt(u * u + 0.9882)
    bump = np.exp(-0.0743 * u * u)
    height = 0.2028 - 0.0764 * h + 0.1695 * order * h + (0.0001 * h + 0.0067 * order * h - 0.0049) * u * u
    height_slope = 2 * (0.0001 * h + 0.0067 * order * h - 0.0049) * u
    fast_end = 1.3263 * h * np.exp(-2.435 * from_fastest - 4.7092 * h)
    offset = math.log(math.pi / (2 * h)) - 0.3333 + 0.0694 * h - 0.3162 * order * h - span
    log_rates = 2 * np.log(u) + radius - np.log(u * u + 2.3762) + offset + height * bump + fast_end
    slope = 2 / u + u / radius - 2 * u / (u * u + 2.3762) + 2.435 * fast_end
    slope += bump * (height_slope - 0.1486 * u * height)
    gauss = 2 / (np.pi * zeros * jv(order, zeros) ** 2)
    return np.log(gauss * h * slope) - gammaln(order) + order * log_rates, log_rates


def _terms(log_weights: Vector, log_rates: Vector, order: float, log_times: Vector) -> tuple[Vector, Vector]:
    """w_j t^order exp(-s_j t) and s_j t, shapes (times, modes); the relative error is sum_j - 1."""
    decay = np.exp(log_times[:, None] + log_rates)
    return np.exp(log_weights + order * log_times[:, None] - decay), decay


def _level(
    log_weights: Vector, log_rates: Vector, level: float, order: float, log_times: Vector
) -> tuple[Vector, Vector, float]:
    """Solve error(t_i) = (-1)^i level at 2n+1 times for weights, rates and level.

    Levenberg-Marquardt with damping proportional to the residual: quadratic convergence, and no motion along
    the directions that the data cannot see.  (Their singular values fall to level^2; a plain Newton
    step along them is rounding error divided by nearly nothing.)
    """
    count = len(log_weights)
    signs = (-1.0) ** np.arange(len(log_times))
    for _ in range(24):
        terms, decay = _terms(log_weights, log_rates, order, log_times)
        residual = terms.sum(axis=1) - 1.0 - signs * level
        size = math.sqrt(np.mean(residual**2))
        if size <= max(1e-2 * abs(level), 1e-15):
            break
        jacobian = np.hstack([terms, -terms * decay, -signs[:, None]])
        # Least squares by QR of [damping, 0; J, -residual]: not normal equations, which square the condition.
        # dtpqrt knows the damping's zeros, and its blocks of 8 stay too small for BLAS to start threads.
        damping = np.diag(np.append(np.full(2 * count, 1e-2 * size), [0.0, 0.0]))
        triangle = dtpqrt(0, min(8, len(damping)), damping, np.column_stack([jacobian, -residual]))[0]
        step = solve_triangular(triangle[: 2 * count + 1, :-1], triangle[: 2 * count + 1, -1])
        step *= min(1.0, 1.0 / max(np.abs(step[:-1]).max(), 1e-300))  # at most a factor e per step
        log_weights = log_weights + step[:count]
        log_rates = log_rates + step[count:-1]
        level += step[-1]
    return log_weights, log_rates, level


def _minimax(order: float, span: float, count: int) -> tuple[Vector, Vector]:
    """(log weights, log rates ascending) of nearly least maximum relative error on [0, span] in log t."""
    log_times = _alternation_times(span, count)
    modes = (*_start(order, span, count), 0.0)
    best, best_error = modes, math.inf
    for _ in range(5):
        modes = _level(*modes, order, log_times)
        log_times, highest, lowest = _extrema(modes[0], modes[1], order, log_times)
        if highest < best_error:
            best, best_error = modes, highest
        if highest <= 1.02 * lowest or lowest == 0.0:
            break
    ascending = np.argsort(best[1])
    return best[0][ascending], best[1][ascending]


def _extrema(log_weights: Vector, log_rates: Vector, order: float, log_times: Vector) -> tuple[Vector, float, float]:
    """Times of the 2n+1 extrema of the error, the greatest and the least of its levels there.

    The least is 0 and the times are unchanged where the error has not exactly 2n-1 interior extrema.
    """
    pieces = 12
    grid = log_times[:-1, None] + np.diff(log_times)[:, None] * (np.arange(pieces) / pieces)
    grid = np.append(grid.ravel(), log_times[-1])
    error = _terms(log_weights, log_rates, order, grid)[0].sum(axis=1) - 1.0
    rise = np.diff(error)
    peaks = np.flatnonzero(rise[:-1] * rise[1:] < 0) + 1
    highest = float(np.abs(error).max())
    if len(peaks) != len(log_times) - 2:
        return log_times, highest, 0.0
    left, right = grid[peaks] - grid[peaks - 1], grid[peaks + 1] - grid[peaks]
    slope_left, slope_right = rise[peaks - 1] / left, rise[peaks] / right
    vertex = grid[peaks] - (slope_left * right + slope_right * left) / (2 * (slope_right - slope_left))
    levels = np.abs(error[np.concatenate([[0], peaks, [-1]])])
    return np.concatenate([log_times[:1], vertex, log_times[-1:]]), highest, float(levels.min())


# The bound of `_certify`.  The relative error e(x) = e^(order x) sum_j w_j exp(-s_j e^x) - 1 is analytic in
# x = log t.  Cut [0, span] into intervals of half-width d around c and take the ellipse with foci c -/+ d and
# imaginary semi-axis psi < pi/2.  Its real semi-axis is A = sqrt(psi^2 + d^2), the sum of the two in units of
# d is rho = (psi + A)/d, and on it |e^(order x)| <= e^(order (c+A)) and Re e^x >= e^(c-A) cos(psi), so that
#     |e| <= M = 1 + e^(order (c+A)) sum_j w_j exp(-s_j e^(c-A) cos psi).
# The Chebyshev series of e cut after degree n is a polynomial p with
#     |e - p| <= delta = 2 M rho^-n / (rho - 1)                     (Trefethen, ATAP, theorem 8.2).
# A polynomial of degree n sampled at N > n Chebyshev points obeys (Ehlich and Zeller, Math. Z. 86, 1964)
#     max |p| <= max_k |p(x_k)| / cos(n pi / 2N).
# With |p(x_k)| <= |e(x_k)| + delta, the maximum of |e| on the interval is at most
#     (max_k |e(x_k)| + delta) / cos(n pi / 2N) + delta.
# Rounding, in units of 2^-52: a sample time is off by at most 32 relatively, which changes a term by
# 32 (order + s_j t); power, exponential (argument error s_j t), products and the final scaling of a rate and
# a weight by `design` (16 more) and the sum over the modes give at most count + 64 + 64 s_j t.


def _certify(weights: Vector, rates: Vector, order: float, span: float) -> float:
    """Proven bound on |t^order sum_j weights_j exp(-rates_j t) - 1| for all log t in [0, span]."""
    degree, points, psi = 16, 192, 1.2
    pieces = max(1, math.ceil(2.0 * span))
    half = 0.5 * span / pieces
    centres = half * (2 * np.arange(pieces) + 1)
    reach = math.hypot(psi, half)
    slowest = np.exp(centres - reach) * math.cos(psi)
    largest = 1.0 + np.exp(order * (centres + reach)) * (np.exp(-np.outer(slowest, rates)) @ weights)
    rho = (psi + reach) / half
    delta = float(largest.max()) * 2.0 * rho**-degree / (rho - 1.0)

    nodes = np.cos(np.pi * (np.arange(points) + 0.5) / points)
    times = np.exp((centres[:, None] + half * nodes).ravel())
    decay = np.outer(times, rates)
    terms = weights * np.exp(-decay) * (times**order)[:, None]
    rounding = np.finfo(float).eps * float((terms * (len(rates) + 64 + 64 * decay)).sum(axis=1).max())
    sampled = float(np.abs(terms.sum(axis=1) - 1.0).max()) + rounding
    return (sampled + delta) / math.cos(degree * math.pi / (2 * points)) + delta
