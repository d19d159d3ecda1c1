"""Figures of merit from the sensor's output, in the terms of IEEE Std 528 and 1431; arrays in SI in, SI out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import Mean, mean_interval

Array = NDArray[np.float64]

LINEAR_WITHIN = 0.01  # of the input: what the full scale keeps
ON_WITHIN = 0.01  # of the final value
LOST = 4.0  # once the ends of a bandwidth's interval differ by this factor, it is lost in the noise


@dataclass(frozen=True)
class Static:
    """From a ladder of constant rates. Means over runs with their 95 % intervals."""

    scale_factor: Mean  # slope of the line of least squares through the outputs
    zero_rate_output: Mean  # rad/s, the mean output at rest
    nonlinearity: Mean  # largest deviation from that line, with its sign, over the range
    deviation: Array  # rad/s, mean output less the line, at each rate


def static(rates: Array, outputs: Array) -> Static:
    """`rates` (n,) in rad/s, 0 among them; `outputs` (n, runs), the mean output of each run at each."""
    level = np.concatenate([[rates], [np.ones_like(rates)]]).T
    lines = np.linalg.lstsq(level, outputs, rcond=None)[0]
    deviations = outputs - level @ lines
    mean = deviations.mean(axis=1)
    worst = int(np.argmax(abs(mean)))
    return Static(
        mean_interval(lines[0]),
        mean_interval(outputs[int(np.argmin(abs(rates)))]),
        mean_interval(deviations[worst] / np.ptp(rates) * 2.0),
        mean,
    )


def full_scale(rates: Array, outputs: Array, line: Static) -> tuple[float, bool]:
    """The largest rate of the ladder up to which, to both sides, the output keeps within 1 % of the input of the line.

    `rates` may go beyond those that the line was drawn through; NaN in `outputs` (n, runs) is divergence. With it,
    whether that is the ladder's last rate: the sensor may then go further. 0 if there is no such rate.
    """
    mean = outputs.mean(axis=1)
    offset = float(line.zero_rate_output.mean)
    kept = abs(mean - offset - line.scale_factor.mean * rates) <= LINEAR_WITHIN * abs(rates)
    reached = 0.0
    for size in np.unique(abs(rates[rates != 0])):
        if not kept[abs(rates) == size].all():
            return reached, False
        reached = float(size)
    return reached, True


def turn_on_time(time: Array, outputs: Array) -> float:
    """s until every later output of a run, (runs, samples), is within 1 % of its final value; median over runs.

    The final value is the mean over the second half. NaN if an output of that half is further off.
    """
    final = outputs[:, outputs.shape[1] // 2 :].mean(axis=1, keepdims=True)
    off = abs(outputs - final) > ON_WITHIN * abs(final)
    last = off.shape[1] - 1 - np.argmax(off[:, ::-1], axis=1)
    later = np.where(off.any(axis=1), last + 1, 0)
    half = outputs.shape[1] // 2
    times = np.where(later < half, time[np.minimum(later, half)], np.nan)
    return float(np.median(times)) if np.isfinite(times).all() else math.nan


@dataclass(frozen=True)
class Response:
    """Of the output to a sinusoidal rate: gain over the scale factor at rest, lag in rad, at each frequency in Hz."""

    frequency: Array
    gain: Array
    lag: Array
    # Hz, where the gain has fallen by 3 dB. Infinite or 0: beyond or below the frequencies tried. NaN: lost in noise.
    bandwidth: Mean
    lag_at_bandwidth: float  # rad


def gain_and_lag(time: Array, output: Array, amplitude: float, frequency: float, interval: float) -> complex:
    """The output's component at `frequency` over the input amplitude * sin(2 pi frequency time), by least squares.

    The averaging over `interval` of each output is divided out: it is the record's, not the sensor's.
    """
    angle = 2 * math.pi * frequency * time
    columns = np.stack([np.sin(angle), np.cos(angle), np.ones_like(time), time - time.mean()], axis=1)
    sine, cosine = np.linalg.lstsq(columns, output, rcond=None)[0][:2]
    return complex(sine, cosine) / amplitude / float(np.sinc(frequency * interval))


def response(frequency: Array, gains: NDArray[np.complex128], scale_factor: float) -> Response:
    """`gains` (frequencies, runs), as from gain_and_lag, in the order of rising frequency."""
    mean = gains.mean(axis=1)
    lag = -np.unwrap(np.angle(mean))
    crossings = np.array([_minus_three_db(frequency, abs(run) / abs(scale_factor)) for run in gains.T])
    size = (abs(mean) / abs(scale_factor)).astype(np.float64, copy=False)
    bandwidth = _bandwidth(frequency, crossings)
    here = math.nan
    if 0 < bandwidth.mean < math.inf:
        here = float(np.interp(math.log(bandwidth.mean), np.log(frequency), lag))
    return Response(frequency, size, lag, bandwidth, here)


def _bandwidth(frequency: Array, crossings: Array) -> Mean:
    """Geometric mean over the runs, of those of _minus_three_db."""
    if np.isinf(crossings).all():
        return Mean(math.inf, math.inf, math.inf)
    if (crossings == 0).all():
        return Mean(0.0, 0.0, float(frequency[0]))
    if (crossings > 0).all() and np.isfinite(crossings).all():
        found = Mean(*(math.exp(number) for number in mean_interval(np.log(crossings))))
        if found.high < LOST * found.low:
            return found
    return Mean(math.nan, math.nan, math.nan)


def _minus_three_db(frequency: Array, gain: Array) -> float:
    """Where the gain first falls through 1/sqrt(2), by interpolation of its logarithm over that of the frequency."""
    level = math.log(math.sqrt(0.5))
    log = np.log(np.maximum(gain, 1e-12))
    below = np.flatnonzero(log < level)
    if len(below) == 0:
        return math.inf
    i = int(below[0])
    if i == 0:
        return 0.0
    part = (log[i - 1] - level) / (log[i - 1] - log[i])
    return float(np.exp(np.log(frequency[i - 1]) + part * np.log(frequency[i] / frequency[i - 1])))
