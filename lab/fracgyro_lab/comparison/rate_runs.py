"""Runs of the task `rate`: output of the rate sensor that a scenario and a controller form."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from fracgyro.rate.bound import bound_angle_random_walk, noise_of
from fracgyro.rate.innovation import Plant
from fracgyro.rate.merit import gain_and_lag, turn_on_time
from fracgyro.rate.units import DEG_PER_H, DEG_PER_ROOT_H, DEG_PER_S
from fracgyro.scenario import Scenario
from fracgyro.simulation.rate_means import rate_means
from fracgyro.simulation.user_controller import ControllerLike
from numpy.typing import NDArray

Values = NDArray[np.float64]

BANDWIDTH = 100.0  # Hz
WITHIN = 0.01  # relative tolerance of the gain: about 2 Hz
RANGE = DEG_PER_S.to_si(300.0)
SINE = RANGE / 3  # amplitude
OUTPUT = 5e-4  # s, averaging time of an output
SETTLING, SETTLED = 0.1, 0.3  # s, settling time of a run in a tuning and in the evaluation
SMOOTHED = 2.5e-3  # s, averaging time for the settling time
AVERAGE, AVERAGES = 0.05, 5  # s; long against the bandwidth and 1/split
LOW = math.sqrt(0.5)  # -3 dB
TRIES = 14
STEP = math.log(6.0)  # step of the search for a bracket
DIVERGES = 1.0  # replaces the logarithm of the gain


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
    """Center of each output, s."""
    return interval * (np.arange(found.shape[1], dtype=np.float64) + 0.5)


def noise_at_rest(
    scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None, settling: float = SETTLED
) -> tuple[Values, Values, Values]:
    """By seed: the angle random walk, deg/sqrt(h); the output's standard deviation, mdeg/s; its mean, deg/h.

    The angle random walk is the Allan deviation of averages over 50 ms, times the root of that time, in the white-noise
    range at a bandwidth of 100 Hz.
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

    The settling time is the time from which averages over 2.5 ms stay within 1 % of the final value. If they never do,
    it is the length of the run times the largest relative excess in its second half, so that a search can still rank
    such runs.
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
    """By seed: the settling time from a thousandth of the motion, ms; NaN if it does not settle."""
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
    """Complex gain for a sinusoidal rate at each frequency in Hz; NaN if the run diverges."""
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
    """The value in the range that gives a gain of -3 dB at 100 Hz; None if no value does.

    Noise is included; it is far below a rate of 100 deg/s. If the gain at half that frequency is even lower, the
    bandwidth is too small.
    """

    def gain(value: float, frequency: float = BANDWIDTH) -> float:
        (found,) = response(*at(value), [frequency])
        return abs(found)

    def off(value: float) -> float:  # a divergence counts as too much gain
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
    """Initial guess: the corner frequency."""
    return min(max(2 * math.pi * BANDWIDTH * scenario.plant.scales.time, low), high)


def bound(scenario: Scenario) -> float:
    """Cramér-Rao bound of the angle random walk, deg/sqrt(h), with D and K unknown if the rate is then observable.

    If only one axis moves, rate and dxy cannot be distinguished: D and K are then known.
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
