"""Allan deviation of a rate record, and the three terms of IEEE Std 952 read from it, each with its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

import allantools
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ..arguments import number, signal

Array = NDArray[np.float64]

CONFIDENCE = 0.95
FLICKER = 0.664  # sqrt(2 ln 2 / pi): the deviation of flicker noise over B
SLOPE_TOLERANCE = 0.1  # how far a slope may be from -1/2 or +1/2 and still count as it, in addition to its own noise
MIN_RECORD = 10  # times tau that a record must last
PEAK = 1.892  # averaging time over correlation time at which Markov noise has its largest deviation


@dataclass(frozen=True)
class Estimate:
    """A figure in SI and its 95 % interval. `limit`: the record is too short to show it, it is at most `high`."""

    value: float
    low: float
    high: float
    limit: bool = False


@dataclass(frozen=True)
class Allan:
    """The deviation (rad/s) over averaging times `tau` (s), with its 95 % interval, and the terms read from it."""

    tau: Array
    deviation: Array
    low: Array
    high: Array
    angle_random_walk: Estimate | None  # N, rad/sqrt(s)
    bias_instability: Estimate  # B, rad/s
    rate_random_walk: Estimate  # K, rad/s/sqrt(s)


def allan(values: Array, interval: float) -> Allan:
    """Overlapping Allan deviation of one or more records of equal length, (samples) or (records, samples), in rad/s.

    Records are independent; their variances are averaged and their degrees of freedom add up. `interval`: time between
    samples, s. Raises TypeError where these are no numbers, ValueError where a record has less than 20 samples, one
    that is not finite or more than two dimensions, or `interval` is not above 0.
    """
    records, interval = np.atleast_2d(signal("values", values)), number("interval", interval, above=0.0)
    if records.ndim > 2:
        raise ValueError(f"values has {records.ndim} dimensions: it must have (samples) or (records, samples)")
    count, samples = records.shape
    if samples < 2 * MIN_RECORD or not np.isfinite(records).all():
        raise ValueError(f"the record has {samples} samples: it must have at least {2 * MIN_RECORD}, all finite")
    octaves = 2 ** np.arange((samples // MIN_RECORD).bit_length())
    found = [
        allantools.oadev(record, rate=1 / interval, data_type="freq", taus=octaves * interval) for record in records
    ]
    tau = np.asarray(found[0][0])
    deviation = np.sqrt(np.mean([np.asarray(one[1]) ** 2 for one in found], axis=0))
    freedom = count * np.array([_degrees_of_freedom(round(t / interval), samples) for t in tau])
    low, high = deviation[:, None].T * _factors(freedom)
    peak = _peak_of_the_response(deviation, low, high)
    walk = _angle_random_walk(tau, deviation, freedom, peak)
    beyond = slice(peak, None)
    return Allan(
        tau,
        deviation,
        low,
        high,
        walk,
        _bias_instability(tau[beyond], deviation[beyond], low[beyond], high[beyond], walk),
        _rate_random_walk(tau[beyond], deviation[beyond], high[beyond], freedom[beyond]),
    )


def _degrees_of_freedom(m: int, samples: int) -> float:
    """Of the overlapping variance of white rate noise, over averages of m samples (Greenhall and Riley 2003)."""
    return float(allantools.edf_greenhall(alpha=0, d=2, m=m, N=samples, overlapping=True, modified=False))


def _factors(freedom: Array) -> Array:
    """What a deviation is multiplied by to get the ends of its interval: rows low, high."""
    tail = (1 - CONFIDENCE) / 2
    return np.asarray(np.sqrt(freedom / chi2.ppf([[1 - tail], [tail]], freedom)), dtype=float)


def _peak_of_the_response(deviation: Array, low: Array, high: Array) -> int:
    """Where the deviation, having risen from the shortest average on, falls again by more than its noise; else 0.

    Left of it a sensor of finite bandwidth cannot move: its rise is not a rate random walk, its low start not a floor.
    """
    peak = int(np.argmax(np.diff(deviation) < 0))  # 0 too where nothing falls
    return peak if (high[peak:] < low[peak]).any() else 0


def _stretch(tau: Array, deviation: Array, freedom: Array, slope: float) -> slice | None:
    """The longest run of averaging times along which the deviation goes as tau^slope; two octaves at least."""
    slopes = np.diff(np.log(deviation)) / np.diff(np.log(tau))
    noise = 2.0 / np.log(2.0) / np.sqrt(2.0 * freedom[1:])  # two standard deviations, of neighbours an octave apart
    fits = np.abs(slopes - slope) <= SLOPE_TOLERANCE + noise
    if slope > 0:
        fits &= slopes - noise > 0  # a rise, and not the noise of a few long averages
    edges = np.diff(np.concatenate([[0], fits.astype(int), [0]]))
    starts, lengths = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    if len(lengths) == 0 or lengths.max() < 2:
        return None
    first = int(starts[np.argmax(lengths)])
    return slice(first, first + int(lengths.max()) + 1)


def _along(tau: Array, deviation: Array, freedom: Array, slope: float) -> Estimate | None:
    """The height at tau = 1 of the line of this slope. The shortest averages know most, and all others are theirs."""
    here = _stretch(tau, deviation, freedom, slope)
    if here is None:
        return None
    height = float(np.sqrt(np.average((deviation[here] * tau[here] ** -slope) ** 2, weights=freedom[here])))
    low, high = height * _factors(freedom[here].max(keepdims=True))[:, 0]
    return Estimate(height, float(low), float(high))


def _angle_random_walk(tau: Array, deviation: Array, freedom: Array, peak: int) -> Estimate | None:
    """N: the line of slope -1/2, read at tau = 1 s.

    A sensor of finite bandwidth makes Markov noise of white noise (IEEE Std 952): its deviation rises to a
    peak and joins that line from below, as N/sqrt(tau) sqrt(1 - T/2tau (3 - 4 exp(-tau/T) + exp(-2tau/T))). With T
    from where the peak lies the root is divided out.
    """
    if peak == 0:
        return _along(tau, deviation, freedom, -0.5)
    left, top, right = np.log(deviation[peak - 1 : peak + 2])
    place = 0.5 * (left - right) / (left - 2 * top + right)  # of the parabola through the three, in octaves
    time = float(tau[peak]) * 2.0**place / PEAK
    x = tau / time
    whitened = deviation / np.sqrt(1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x))
    return _along(tau[peak:], whitened[peak:], freedom[peak:], -0.5)


def _bias_instability(tau: Array, deviation: Array, low: Array, high: Array, walk: Estimate | None) -> Estimate:
    """B: the smallest deviation over 0.664. Observed where it lies above what white noise by itself would leave."""
    least = int(np.argmin(deviation))
    floor = walk.high / math.sqrt(tau[least]) if walk else 0.0
    observed = low[least] > floor and least < len(tau) - 1
    return Estimate(
        float(deviation[least] / FLICKER), float(low[least] / FLICKER), float(high[least] / FLICKER), not observed
    )


def _rate_random_walk(tau: Array, deviation: Array, high: Array, freedom: Array) -> Estimate:
    """K: the line of slope +1/2, read at tau = 3 s, beyond the least deviation."""
    least = int(np.argmin(deviation))
    rising = slice(least, None)
    found = _along(tau[rising], deviation[rising], freedom[rising], 0.5)
    root3 = math.sqrt(3.0)
    if found:
        return Estimate(found.value * root3, found.low * root3, found.high * root3)
    last = root3 / math.sqrt(tau[-1])
    return Estimate(float(deviation[-1] * last), 0.0, float(high[-1] * last), True)
