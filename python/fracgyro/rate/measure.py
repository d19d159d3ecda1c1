"""Figures of a scenario as a rate sensor, from its runs, in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import Mean, mean_interval
from ..scenario import Scenario, ScenarioError
from ..simulation.user_controller import ControllerLike
from .allan import Allan, allan
from .bound import Bound, bound_angle_random_walk
from .merit import Response, Static, full_scale, gain_and_lag, response, static, turn_on_time
from .runs import FEW_SEEDS, RATES, RATES_BEYOND, SINE, Runs
from .sensor import Output, Sensor

Array = NDArray[np.float64]

FIRST_ORDER_LAG = math.radians(50.0)  # at the bandwidth: a larger lag means a higher order
RESPONSES = 10.0  # shortest static test, in units of 1/bandwidth


@dataclass(frozen=True)
class Leak:
    """Change of the output at rest caused by a coupling error, rad/s, and that error as a rate, rad/s."""

    offered: float
    residual: Mean


@dataclass(frozen=True)
class Characterization:
    """All measurements, in SI."""

    scenario: Scenario
    controller: ControllerLike | None
    seeds: int
    rates: Array
    static: Static
    zero_rate_rms: Mean  # rad/s, RMS output at rest, including its mean
    full_scale: float
    full_scale_is_last: bool
    full_scale_is_limited: bool  # by forces or sensors, not by the output
    turn_on: Output  # at the highest rate of the range
    turn_on_time: float
    rest: Output
    allan: Allan
    bound: Bound | None
    response: Response
    quadrature: Leak
    damping: Leak


def measure(sensor: Sensor, runs: Runs, *, rest: float | None = None) -> Characterization:
    """All figures from the runs of a sensor, in SI.

    `rest`: requested device time of the static test, s. Raises ScenarioError if it is too short for the bandwidth.
    """
    means = np.array([_mean(output) for output in runs.constant])
    line = static(RATES, means)
    answered = response(runs.frequencies, _gains(runs), line.scale_factor.mean)
    if rest is not None:
        _check_rest(rest, answered)
    reached, is_last = _full_scale(means[:, :FEW_SEEDS], runs.beyond)
    still, fastest = runs.constant[len(RATES) // 2].settled().rate, runs.constant[-1]
    scenario = sensor.scenario
    bound = bound_angle_random_walk(scenario.replace({"plant.angular_rate": 0.0}), sensor.controller)
    return Characterization(
        scenario=scenario,
        controller=sensor.controller,
        seeds=len(sensor.seeds),
        rates=RATES,
        static=line,
        zero_rate_rms=rms_interval(still),
        full_scale=min(reached, runs.within_limits),
        full_scale_is_last=is_last and reached <= runs.within_limits,
        full_scale_is_limited=runs.within_limits < reached,
        turn_on=fastest,
        turn_on_time=turn_on_time(fastest.time, fastest.rate),
        rest=runs.rest,
        allan=_credible(allan(runs.rest.rate, runs.rest.interval, _shortest(answered)), bound),
        bound=bound,
        response=answered,
        quadrature=_leak(*runs.stiffness),
        damping=_leak(*runs.damping),
    )


def rms_interval(values: Array) -> Mean:
    """The mean RMS of the rows, with an interval without what no RMS can be."""
    found = mean_interval(np.sqrt((values**2).mean(axis=1)))
    return found._replace(low=max(found.low, 0.0))


def _mean(output: Output) -> Array:
    """Mean steady output of each run: (runs,)."""
    return np.asarray(output.settled().rate.mean(axis=1), dtype=float)


def _full_scale(within: Array, beyond: list[Output | None]) -> tuple[float, bool]:
    """Full scale, rad/s, and True if it is the largest rate tried.

    `within`: (rates, runs), means in the range, of the same seeds as `beyond`, so that the noise cancels.
    """
    diverged = np.full(within.shape[1], math.nan)
    further = [diverged if output is None else _mean(output) for output in beyond]
    return full_scale(np.concatenate([RATES, RATES_BEYOND]), np.concatenate([within, further]), static(RATES, within))


def _gains(runs: Runs) -> NDArray[np.complex128]:
    """Complex gain at each frequency: (frequencies, runs)."""
    return np.array(
        [
            [
                gain_and_lag(output.time[-len(steady) :], steady, SINE, float(frequency), output.interval)
                for steady in output.settled().rate
            ]
            for frequency, output in zip(runs.frequencies, runs.sinusoidal, strict=True)
        ]
    )


def _leak(offered: float, negative: Output, positive: Output) -> Leak:
    return Leak(offered, mean_interval((_mean(positive) - _mean(negative)) / 2))


def _credible(found: Allan, bound: Bound | None) -> Allan:
    """The Allan result; drops an angle random walk far below its bound, found if a record is too short."""
    walk = found.angle_random_walk
    return (
        replace(found, angle_random_walk=None)
        if bound and walk and not walk.limit and walk.value < bound.known / 2
        else found
    )


def _check_rest(rest: float, answered: Response) -> None:
    """Raises ScenarioError for a static test not much longer than the sensor's response."""
    wide = answered.bandwidth.mean or float(answered.frequency[0])
    if rest < (shortest := RESPONSES / wide):  # never true for an infinite or unobserved bandwidth
        raise ScenarioError(
            f"rest is {rest:g}: it must be at least {shortest:.3g} s, {RESPONSES:g} over the bandwidth of {wide:.3g} "
            "Hz, to show the sensor's noise rather than its response"
        )


def _shortest(answered: Response) -> float:
    """Shortest averaging time that is fitted, s; 0 for a first-order response, with 45 degrees of lag."""
    return 1 / answered.bandwidth.mean if answered.lag_at_bandwidth > FIRST_ORDER_LAG else 0.0
