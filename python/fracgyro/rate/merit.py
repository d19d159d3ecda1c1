"""Figures of merit from the sensor's output, in the terms of IEEE Std 528 and 1431; arrays in SI in, SI out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import Mean, mean_interval

Array = NDArray[np.float64]

LINEAR_WITHIN = 0.01  # fraction of the input: largest deviation up to full scale
ON_WITHIN = 0.01  # fraction of the final value
MAX_BANDWIDTH_RATIO = 4.0  # high over low end of the bandwidth's interval, above which it is lost in the noise


@dataclass(frozen=True)
class Static:
    """Results at constant rates: means over runs with their 95 % intervals."""

    scale_factor: Mean  # slope of the least-squares line through the outputs
    zero_rate_output: Mean  # mean output at rest, rad/s
    nonlinearity: Mean  # largest deviation from that line, with its sign, over the range
    deviation: Array  # rad/s, mean output less the line, at each rate


def static(rates: Array, outputs: Array) -> Static:
    """Scale factor, zero-rate output and non-linearity.

    `rates`: (n,), rad/s, including 0. `outputs`: (n, runs), rad/s, mean output of each run at each rate.
    """
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
    """Full scale, rad/s, and True if it is the largest rate tried.

    It is the largest rate up to which, for both signs, the mean output is within 1 % of the rate of the line; 0 if the
    smallest rate is already outside. `rates` (n,) may exceed the range of the line fit; NaN in `outputs` (n, runs)
    marks a run that diverged.
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
    """Time, s, after which every output is within 1 % of its final value; median over runs.

    `outputs`: (runs, samples). The final value is the mean over the second half; NaN if that half does not settle.
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
    """Response to sinusoidal rates: frequency in Hz, gain relative to the scale factor, lag in rad; (n,) each."""

    frequency: Array
    gain: Array
    lag: Array
    # -3 dB frequency, Hz. Infinite or 0: above or below the frequencies tried. NaN: lost in the noise.
    bandwidth: Mean
    lag_at_bandwidth: float  # rad


def gain_and_lag(time: Array, output: Array, amplitude: float, frequency: float, interval: float) -> complex:
    """Complex gain at `frequency` in Hz for the input amplitude * sin(2 pi frequency time), by least squares.

    The averaging of each output over `interval` is divided out: it belongs to the record, not to the sensor.
    """
    angle = 2 * math.pi * frequency * time
    columns = np.stack([np.sin(angle), np.cos(angle), np.ones_like(time), time - time.mean()], axis=1)
    sine, cosine = np.linalg.lstsq(columns, output, rcond=None)[0][:2]
    return complex(sine, cosine) / amplitude / float(np.sinc(frequency * interval))


def response(frequency: Array, gains: NDArray[np.complex128], scale_factor: float) -> Response:
    """Frequency response from `gains` (frequencies, runs) of gain_and_lag; `frequency` (frequencies,) increases."""
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
    """Geometric mean of the runs' -3 dB frequencies."""
    if np.isinf(crossings).all():
        return Mean(math.inf, math.inf, math.inf)
    if (crossings == 0).all():
        return Mean(0.0, 0.0, float(frequency[0]))
    if (crossings > 0).all() and np.isfinite(crossings).all():
        found = Mean(*(math.exp(number) for number in mean_interval(np.log(crossings))))
        if found.high < MAX_BANDWIDTH_RATIO * found.low:
            return found
    return Mean(math.nan, math.nan, math.nan)


def _minus_three_db(frequency: Array, gain: Array) -> float:
    """Frequency, Hz, of the first crossing of 1/sqrt(2), interpolated in log gain over log frequency."""
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
