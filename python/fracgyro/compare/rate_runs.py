"""Runs of the task `rate`: what a rate sensor puts out, as a scenario and a controller have it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..rate.bound import bound_angle_random_walk, noise_of
from ..rate.innovation import Plant
from ..rate.merit import gain_and_lag, turn_on_time
from ..rate.units import DEG_PER_H, DEG_PER_ROOT_H, DEG_PER_S
from ..scenario import Scenario
from ..simulation.rate_means import rate_means
from ..simulation.user_controller import ControllerLike

Values = NDArray[np.float64]

BANDWIDTH = 100.0  # Hz
WITHIN = 0.01  # of the gain there: some 2 Hz
RANGE = DEG_PER_S.to_si(300.0)
SINE = RANGE / 3  # amplitude
OUTPUT = 5e-4  # s that an output is the mean of
SETTLING, SETTLED = 0.1, 0.3  # s that a run is left to settle, in a tuning and where it is judged
SMOOTHED = 2.5e-3  # s that the output is averaged over for its settling time
AVERAGE, AVERAGES = 0.05, 5  # s; long against the bandwidth and 1/split
LOW = math.sqrt(0.5)  # -3 dB
TRIES = 14
STEP = math.log(6.0)  # of the search for a bracket
DIVERGES = 1.0  # in place of the logarithm of a gain


def outputs(
    scenario: Scenario,
    seconds: float,
    seeds: Sequence[int],
    controller: ControllerLike | None,
    changes: Mapping[str, Any] | None = None,
) -> tuple[Values, float]:
    """(seeds, outputs) in rad/s, NaN for a run that diverges, and the time between them, s."""
    unit = scenario.plant.scales.time
    block = max(1, round(OUTPUT / (scenario.run.step * unit)))
    interval = block * scenario.run.step * unit
    count = math.ceil(seconds / interval)
    run = scenario.replace({**(changes or {}), "run.duration": count * block * scenario.run.step})
    found = rate_means(run, seeds, every=1, block=block, controller=controller)[:, :count]
    return np.asarray(found * scenario.plant.scales.rate, dtype=np.float64), interval


def _middles(found: Values, interval: float) -> Values:
    """s, of the outputs."""
    return interval * (np.arange(found.shape[1], dtype=np.float64) + 0.5)


def noise_at_rest(
    scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None, settling: float = SETTLED
) -> tuple[Values, Values, Values]:
    """By seed: the angle random walk, deg/sqrt(h); the output's standard deviation, mdeg/s; its mean, deg/h.

    The angle random walk is the Allan deviation of averages over 50 ms, times the root of that time: where white noise
    is all that there is, at a bandwidth of 100 Hz.
    """
    found, interval = outputs(scenario, settling + AVERAGE * AVERAGES, seeds, controller)
    each = round(AVERAGE / interval)
    late = found[:, -each * AVERAGES :]
    means = late.reshape(len(seeds), AVERAGES, each).mean(axis=2)
    allan = np.sqrt((np.diff(means, axis=1) ** 2).mean(axis=1) / 2)
    walk = DEG_PER_ROOT_H.of(1.0) * allan * math.sqrt(each * interval)
    return walk, 1e3 * DEG_PER_S.of(1.0) * late.std(axis=1), DEG_PER_H.of(1.0) * late.mean(axis=1)


def settled(
    scenario: Scenario, rate: float, seeds: Sequence[int], controller: ControllerLike | None
) -> tuple[Values, Values]:
    """By seed, at a constant rate: the mean output and its RMS about that rate, all in rad/s."""
    found, interval = outputs(scenario, SETTLED + 2 * AVERAGE, seeds, controller, {"plant.angular_rate": rate})
    late = SETTLED / interval
    return _late_mean(found, late), np.sqrt(_late_mean((found - rate) ** 2, late))


def at_range(
    scenario: Scenario,
    seeds: Sequence[int],
    controller: ControllerLike | None,
    changes: Mapping[str, Any] | None = None,
) -> tuple[Values, Values]:
    """By seed, at 300 deg/s: the mean output, rad/s, and the settling time, ms.

    The settling time is that from which averages over 2.5 ms stay within 1 % of the final value. Where they never do it
    is that of the whole run times how often as far off the furthest of its second half is, so that a search can tell
    bad from worse.
    """
    found, interval = outputs(
        scenario, 2 * SETTLING, seeds, controller, {"plant.angular_rate": RANGE, **(changes or {})}
    )
    each = round(SMOOTHED / interval)
    blocks = found[:, : found.shape[1] // each * each].reshape(len(seeds), -1, each).mean(axis=2)
    time = each * interval * (np.arange(blocks.shape[1], dtype=np.float64) + 0.5)
    times = []
    for run in blocks:
        half = run[len(run) // 2 :]
        furthest = float(np.max(abs(half - half.mean())) / (0.01 * abs(half.mean())))
        on = turn_on_time(time, run[np.newaxis])
        times.append(1e3 * (on if math.isfinite(on) else time[-1] * max(furthest, 1.0)))
    return _late_mean(found, SETTLING / interval), np.array(times)


def start_up_from_rest(scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None) -> Values:
    """By seed: the settling time from a thousandth of the motion, ms; NaN where it never comes."""
    run = scenario.run
    rest = {
        "run.initial_position": tuple(1e-3 * number for number in run.initial_position),
        "run.initial_velocity": tuple(1e-3 * number for number in run.initial_velocity),
    }
    times = at_range(scenario, seeds, controller, rest)[1]
    return np.where(times < 1e3 * SETTLING, times, np.nan)


def _late_mean(found: Values, first: float) -> Values:
    return np.asarray(found[:, round(first) :].mean(axis=1))


def response(
    scenario: Scenario, controller: ControllerLike | None, frequencies: Sequence[float], seed: int = 0
) -> list[complex]:
    """To a sinusoidal rate at each frequency in Hz; NaN where the run diverges."""
    gains = []
    for frequency in frequencies:
        moving = {"rate.kind": "sine", "rate.amplitude": SINE, "rate.frequency": 2 * math.pi * frequency}
        seconds = max(2 / frequency, 4 / BANDWIDTH)
        found, interval = outputs(scenario, SETTLING + seconds, [seed], controller, moving)
        late = found[0, -round(seconds / interval) :]
        time = _middles(found, interval)
        if not np.isfinite(late).all():
            gains.append(complex(math.nan, math.nan))
            continue
        gains.append(gain_and_lag(time[-len(late) :], late, SINE, frequency, interval))
    return gains


def found_bandwidth(
    at: Callable[[float], tuple[Scenario, ControllerLike | None]], low: float, high: float
) -> float | None:
    """The number between these with which the gain falls to -3 dB at 100 Hz; None where there is none.

    Noise is as it is: it is far below a rate of 100 deg/s. Where the gain at half of that frequency is lower still, the
    bandwidth is less.
    """

    def gain(value: float, frequency: float = BANDWIDTH) -> float:
        (found,) = response(*at(value), [frequency])
        return abs(found)

    def off(value: float) -> float:  # what diverges has too much
        found = gain(value)
        return math.log(max(found, 1e-6) / LOW) if math.isfinite(found) else DIVERGES

    ends = [math.log(low), math.log(high)]
    point = math.log(_guess(at(high)[0], low, high))
    errors: list[float | None] = [None, None]  # unknown
    for number in range(TRIES):
        value = float(f"{math.exp(point):.4g}")
        error = off(value)
        if abs(error) < WITHIN:
            return value if gain(value, BANDWIDTH / 2) > LOW else None
        side = int(error > 0)
        if ends[side] == point:  # even the end of the range is not enough, or too much
            return None
        ends[side], errors[side] = point, error
        less, more = errors
        if less is None or more is None:
            point = max(ends[0], point - STEP) if error > 0 else min(ends[1], point + STEP)
        else:
            part = less / (less - more)
            point = ends[0] + (0.5 if number % 3 == 2 else min(max(part, 0.05), 0.95)) * (ends[1] - ends[0])
    return None


def _guess(scenario: Scenario, low: float, high: float) -> float:
    """The corner frequency itself."""
    return min(max(2 * math.pi * BANDWIDTH * scenario.plant.scales.time, low), high)


def bound(scenario: Scenario) -> float:
    """deg/sqrt(h): of the motion that this scenario has, with D and K unknown where that leaves the rate to be found.

    Where one axis moves, no estimate tells the rate from dxy: D and K are known then.
    """
    if all(scenario.reference.amplitude):
        found = bound_angle_random_walk(scenario)
        return math.nan if found is None else float(DEG_PER_ROOT_H.of(found.unknown))
    noise = noise_of(scenario)
    if noise is None:
        return math.nan
    amplitude, frequency = scenario.reference.amplitude[0], scenario.reference.frequency[0]
    inverse = Plant.of(scenario).inverse_response(frequency)
    density = noise.force * np.eye(2) + inverse * noise.at(frequency) @ inverse.conj().T
    variance = density[1, 1].real / (2 * (amplitude * frequency) ** 2)  # 4 <v^2> is twice the amplitude's square
    scales = scenario.plant.scales
    return float(DEG_PER_ROOT_H.of(math.sqrt(variance) * scales.rate * math.sqrt(scales.time)))
