"""Allan deviation of a rate record, and the three terms of IEEE Std 952 found in it, each with its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ..arguments import number, signal
from .noise_terms import FLICKER, WALK, WHITE, Curve, Fit, Response

Array = NDArray[np.float64]

CONFIDENCE = 0.95
FLOOR = math.sqrt(2 * math.log(2) / math.pi)  # 0.664: the deviation of flicker noise over B
MIN_RECORD = 10  # times tau that a record must last


@dataclass(frozen=True)
class Estimate:
    """A figure in SI and its 95 % interval. `limit`: the record does not show it, it is at most `high`.

    >>> noise = np.random.default_rng(0).normal(size=10_000) * 0.002
    >>> fg.rate.allan(noise, interval=0.01).bias_instability.limit
    True
    """

    value: float
    low: float
    high: float
    limit: bool = False


@dataclass(frozen=True)
class Allan:
    """The Allan deviation of a record and the noise terms found in it, in SI.

    >>> noise = np.random.default_rng(0).normal(size=10_000) * 0.002
    >>> fg.rate.allan(noise, interval=0.01).tau[:3].tolist()
    [0.01, 0.02, 0.04]
    """

    tau: Array  #: averaging times, s
    deviation: Array  #: at each, rad/s
    low: Array  #: ends of its 95 % interval, rad/s
    high: Array
    angle_random_walk: Estimate | None  #: N, rad/sqrt(s)
    bias_instability: Estimate  #: B, rad/s
    rate_random_walk: Estimate  #: K, rad/s/sqrt(s)
    response_time: float  #: s, of the sensor's response, which was divided out; 0 where it does not show
    fitted: tuple[float, float] | None  #: s, from and to which averaging time the terms account for the deviation


def allan(values: Array, interval: float, shortest: float = 0.0) -> Allan:
    """Overlapping Allan deviation of one or more records of equal length, and the noise terms found in it.

    `values`: (samples) or (records, samples), time being the last axis, in rad/s. `interval`: time between samples, s.
    `shortest`: averages below this, s, are not fitted, as the sensor's response is in them and is not of first or
    second order.

    N, B and K of IEEE Std 952 are fitted to its square at once; those that the record does not show have a limit
    instead, and N is None. The shortest averages, at which a sensor of finite bandwidth shows less noise than it has,
    are divided by the response of first or second order that fits them, and left out where none does. Records are
    independent; their variances are averaged and their degrees of freedom add up.

    Raises TypeError where these are no numbers, ValueError where a record has less than 20 samples, one that is not
    finite or more than two dimensions, or time is not the last axis, `interval` is not above 0 or `shortest` below 0.

    >>> noise = np.random.default_rng(0).normal(size=100_000) * 0.002
    >>> round(fg.rate.allan(noise, interval=0.01).angle_random_walk.value, 5)  # 0.002 * sqrt(0.01) rad/sqrt(s)
    0.0002
    """
    shortest = number("shortest", shortest, least=0.0)
    records, interval = np.atleast_2d(signal("values", values)), number("interval", interval, above=0.0)
    count, samples = _checked(records)
    averaged = 2 ** np.arange((samples // MIN_RECORD).bit_length())
    variance = np.mean([_overlapping(record, averaged) for record in records], axis=0)
    tau = np.asarray(averaged * interval, dtype=np.float64)
    curve = Curve(tau, variance, interval, samples, count)
    fit = curve.fit(shortest)
    deviation = np.sqrt(variance)
    low, high = deviation[:, None].T * _factors(curve.freedom(fit))
    least = _limits(curve, fit, high)
    walk = _estimate(fit, WHITE, math.inf)
    return Allan(
        tau,
        deviation,
        low,
        high,
        None if walk.limit else walk,
        _estimate(fit, FLICKER, least[FLICKER]),
        _estimate(fit, WALK, least[WALK]),
        fit.response.time if fit else 0.0,
        (float(tau[fit.part][0]), float(tau[fit.part][-1])) if fit else None,
    )


def _checked(records: NDArray[Any]) -> tuple[int, int]:
    """Numbers of records and samples. Raises ValueError where they are not long enough and finite."""
    least, rule = 2 * MIN_RECORD, "it must be (samples) or (records, samples)"
    if records.ndim > 2:
        raise ValueError(f"values has {records.ndim} dimensions: {rule}")
    count, samples = records.shape
    if count >= least > samples:
        raise ValueError(f"values has shape {records.shape}: {rule}, the last axis being time; take values.T")
    if samples < least:
        raise ValueError(f"the record has {samples} samples: it must have at least {least}")
    if (bad := np.argwhere(~np.isfinite(records))).size:
        record, sample = map(int, bad[0])
        of = f" of record {record}" if count > 1 else ""
        raise ValueError(
            f"values is {records[record, sample]} at sample {sample}{of}: all must be finite, and {len(bad)} of "
            f"{records.size} are not"
        )
    return count, samples


def _overlapping(record: Array, averaged: NDArray[np.int64]) -> Array:
    """Allan variance over averages of so many samples, beginning at every sample."""
    sums = np.empty(len(record) + 1)
    sums[0] = 0.0
    np.cumsum(record - record.mean(dtype=np.float64), out=sums[1:])
    found = []
    for m in averaged:
        means = sums[m:] - sums[:-m]
        change = means[m:] - means[:-m]
        found.append(float(np.mean(np.square(change, out=change))) / (2.0 * float(m) ** 2))
    return np.array(found)


def _factors(freedom: Array) -> Array:
    """What a deviation is multiplied by to get the ends of its interval: rows low, high."""
    tail = (1 - CONFIDENCE) / 2
    return np.asarray(np.sqrt(freedom / chi2.ppf([[1 - tail], [tail]], freedom)), dtype=float)


def _estimate(fit: Fit | None, term: int, most: float) -> Estimate:
    """Chi square, whose degrees of freedom are those that the variance of the power amounts to."""
    if fit is None or term not in fit.power:
        return Estimate(0.0, 0.0, most, True)
    power = fit.power[term]
    low, high = math.sqrt(power) * _factors(np.array([2 * power**2 / fit.variance[term]]))[:, 0]
    return Estimate(math.sqrt(power), float(low), float(high))


def _limits(curve: Curve, fit: Fit | None, high: Array) -> Array:
    """The most that each term can be: all the variance at the averaging time at which that is least.

    The longest where the response of the sensor is not known.
    """
    times = slice(None) if fit else slice(-1, None)
    columns = curve.columns(fit.response if fit else Response())
    return np.asarray(np.min(high[times, None] / np.sqrt(columns[times]), axis=0), dtype=float)
