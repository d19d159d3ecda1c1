"""Allan deviation of a rate record, and the noise terms of IEEE Std 952 in it, each with its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from .. import _core
from ..arguments import number, signal
from .curve import Curve
from .inspection import HIDDEN_BELOW, Event, drift, inspect
from .noise_terms import CONFIDENCE, DRIFT, FLICKER, QUANTIZATION, WALK, WHITE, Fit, Power, Response, fit
from .spectrum import Line, spectrum

Array = NDArray[np.float64]

FLOOR = math.sqrt(2 * math.log(2) / math.pi)  # 0.664: the deviation of flicker noise over B
VIBRATION_RATIO = 30.0  # variance of short averages over N²: a larger ratio is reported as a vibration
MIN_RECORD = 10  # shortest record, in units of tau


@dataclass(frozen=True)
class Estimate:
    """A figure in SI and its 95 % interval. `limit`: the figure was not observed and is at most `high`.

    The interval is from 0 to infinity if an event in the record invalidates the figure.

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
    low: Array  #: low end of its 95 % interval, rad/s; `high`: high end
    high: Array
    angle_random_walk: Estimate | None  #: N, rad/sqrt(s)
    bias_instability: Estimate  #: B, rad/s
    rate_random_walk: Estimate  #: K, rad/s/sqrt(s)
    quantization: Estimate  #: Q, rad, of an integrating gyroscope
    undecided: bool  #: slow noise is present, but B and K cannot be distinguished
    drifts: bool  #: the longest averages fit K and also a drift, such as a warm-up
    response_time: float  #: time constant of the sensor's response, s, divided out of the record; 0: not visible
    fitted: tuple[float, float] | None  #: averaging times, s, from and to, over which the terms fit the record
    lines: tuple[Line, ...]  #: sinusoids excluded from the fit; amplitudes in rad/s
    events: tuple[Event, ...]  #: everything else in the record that is not sensor noise


def allan(values: Array, interval: float, shortest: float = 0.0) -> Allan:
    """Overlapping Allan deviation of one or more records of equal length, and the noise terms in them.

    `values`: rad/s, of shape (samples,) or (records, samples). `interval`: time between samples, s. `shortest`:
    shortest averaging time that is fitted, s; needed if the sensor's response is neither of first nor of second order.

    Q, N, B and K of IEEE Std 952 are fitted jointly to the longest part of the spectrum that they explain. A term that
    is not observed has a limit instead, and N is None. A visible low-pass response is divided out. Intervals are those
    of the profile likelihood. Several records count as independent: their spectra are averaged and their degrees of
    freedom add up.

    Raises TypeError for arguments that are not numbers, ValueError for a record of fewer than 20 samples, a sample that
    is not finite, more than two dimensions, time on another axis than the last, an `interval` that is not above 0 or a
    `shortest` below 0.

    >>> noise = np.random.default_rng(0).normal(size=100_000) * 0.002
    >>> round(fg.rate.allan(noise, interval=0.01).angle_random_walk.value, 5)  # 0.002 * sqrt(0.01) rad/sqrt(s)
    0.0002
    """
    shortest = number("shortest", shortest, least=0.0)
    records, interval = np.atleast_2d(signal("values", values)), number("interval", interval, above=0.0)
    count, samples = _checked(records)
    records = np.asarray(records, dtype=np.float64)
    averaged = 2 ** np.arange((samples // MIN_RECORD).bit_length())
    variance = np.mean([_overlapping(record, averaged) for record in records], axis=0)
    tau = np.asarray(averaged * interval, dtype=np.float64)
    events = [found for record in records for found in inspect(record, interval)]
    seen = spectrum(records, interval)
    fitted = fit(seen, shortest)
    if fitted is not None and DRIFT in fitted.terms and fitted.terms[DRIFT].seen:
        events.append(drift(records, interval))
    deviation = np.sqrt(variance)
    amplitude = _vibration(fitted, tau, deviation)
    amplitude = max([amplitude, *(line.amplitude for line in seen.lines if line.covers)])
    if amplitude > 0:
        events.append(Event("vibration", 0.0, samples * interval, amplitude, spoils=True))
    curve = Curve(tau, interval, samples, count)
    low, high = deviation[:, None].T * _factors(curve.freedom(fitted))
    least = _limits(curve, fitted, high)
    terms = [_estimate(fitted, term, float(least[term])) for term in range(4)]
    walk = terms[WHITE]
    if any(found.spoils for found in events):
        terms = [each if each.limit else Estimate(each.value, 0.0, math.inf) for each in terms]
        steps = [found.size for found in events if found.kind == "steps" and found.spoils]
        walk = Estimate(0.0, 0.0, HIDDEN_BELOW * max(steps) * math.sqrt(interval), True) if steps else terms[WHITE]
        if steps:  # quantization also hides slow noise
            terms[FLICKER] = terms[WALK] = Estimate(0.0, 0.0, math.inf, True)
    return Allan(
        tau,
        deviation,
        low,
        high,
        None if walk.limit and not math.isfinite(walk.high) else walk,
        terms[FLICKER],
        terms[WALK],
        terms[QUANTIZATION],
        bool(fitted and fitted.whole and fitted.undecided),
        bool(fitted and fitted.drifts),
        fitted.response.time if fitted else 0.0,
        _fitted(fitted, tau),
        seen.lines,
        tuple(events),
    )


def _vibration(fitted: Fit | None, tau: Array, deviation: Array) -> float:
    """Amplitude of a vibration that makes the short averages, which are not fitted, far noisier than N."""
    times = _fitted(fitted, tau)
    if fitted is None or times is None or not fitted.terms[WHITE].seen:
        return 0.0
    short = tau < 0.99 * times[0]
    excess = deviation[short] ** 2 * tau[short] / fitted.terms[WHITE].value
    return math.sqrt(2) * float(deviation[short].max()) if excess.max(initial=0.0) > VIBRATION_RATIO else 0.0


def _fitted(fitted: Fit | None, tau: Array) -> tuple[float, float] | None:
    """Averaging times that correspond to the fitted frequencies: half periods."""
    if fitted is None:
        return None
    shortest, longest = 0.5 / fitted.frequency[1], 0.5 / fitted.frequency[0]
    inside = tau[(tau > 0.7 * shortest) & (tau <= longest)]
    return (float(inside[0]), float(inside[-1])) if len(inside) else None


def _checked(records: NDArray[Any]) -> tuple[int, int]:
    """Numbers of records and samples. Raises ValueError for records that are too short or not finite."""
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
    """Allan variance over averages of `averaged` samples, starting at every sample."""
    sums = np.empty(len(record) + 1)
    sums[0] = 0.0
    np.subtract(record, record.mean(dtype=np.float64), out=sums[1:])
    np.cumsum(sums[1:], out=sums[1:])
    counts = len(sums) - 2 * averaged
    squares = np.array([_core.second_differences(sums, int(m)) for m in averaged])
    return np.asarray(squares / counts / (2.0 * averaged.astype(np.float64) ** 2))


def _factors(freedom: Array) -> Array:
    """Ends of the interval of a deviation as factors of it: rows low, high."""
    tail = (1 - CONFIDENCE) / 2
    return np.asarray(np.sqrt(freedom / chi2.ppf([[1 - tail], [tail]], freedom)), dtype=float)


def _estimate(fitted: Fit | None, term: int, most: float) -> Estimate:
    """The figure of one term. Slow noise counts as observed only if the longest averages are also fitted."""
    if fitted is None or (term in (FLICKER, WALK) and not fitted.whole):
        return Estimate(0.0, 0.0, math.inf if term == WHITE else most, limit=True)
    power = fitted.terms.get(term, Power(0.0, 0.0, 0.0, seen=False))
    low, value, high = (math.sqrt(each) for each in (power.low, power.value, power.high))
    if not power.seen or math.isinf(high):
        return Estimate(0.0, 0.0, math.inf if term == WHITE else min(high or most, most), limit=True)
    return Estimate(value, low, high)


def _limits(curve: Curve, fitted: Fit | None, high: Array) -> Array:
    """Upper limit of each term: the one that gives all the variance at its most restrictive averaging time.

    At the longest averaging time if the response of the sensor is not known.
    """
    times = slice(None) if fitted else slice(-1, None)
    columns = curve.columns(fitted.response if fitted else Response())
    return np.asarray(np.min(high[times, None] / np.sqrt(columns[times]), axis=0), dtype=float)
