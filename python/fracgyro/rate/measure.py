"""Characterization of a scenario as a rate sensor: runs at set rates -> figures of merit, in SI."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..analysis.confidence import Mean, mean_interval
from ..scenario import Scenario, ScenarioError
from ..simulation.user_controller import ControllerLike
from .allan import Allan, allan
from .bound import Bound, bound_angle_random_walk
from .merit import Response, Static, full_scale, gain_and_lag, response, static, turn_on_time
from .runs import Output, Sensor
from .units import DEG_PER_S

Array = NDArray[np.float64]
Progress = Callable[[float, float, str], object]

RANGE = DEG_PER_S.to_si(300.0)  # input range, +-, of the line fit
WITHIN = np.array([1 / 30, 0.1, 1 / 3, 2 / 3, 1.0]) * RANGE  # 10, 30, 100, 200, 300 deg/s; both signs, and 0
BEYOND = np.array([2.0, 4.0, 8.0, 16.0, 32.0]) * RANGE
SINE = RANGE / 3  # amplitude of the sinusoidal rates
FREQUENCIES = 12  # sinusoidal rates; the lowest has two periods in the steady half
FIRST_ORDER_LAG = math.radians(50.0)  # at the bandwidth: a larger lag means a higher order
RESPONSES = 10.0  # shortest static test, in units of 1/bandwidth
COUPLING = 0.1  # damping deviation that is tried, as a fraction of sqrt(dxx dyy)


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
    turn_on: Output  # at the highest rate of the range
    turn_on_time: float
    rest: Output
    allan: Allan
    bound: Bound | None
    response: Response
    quadrature: Leak
    damping: Leak


def measure(
    scenario: Scenario,
    *,
    seeds: int,
    controller: ControllerLike | None = None,
    rest: float | None = None,
    progress: Progress | None = None,
) -> Characterization:
    """Measurements of a scenario, without a report.

    `rest`: device time of the static test, s. `progress`: called with (done, total, current measurement). Raises what
    `characterise` raises.
    """
    sensor = Sensor.of(scenario, seeds, controller)
    sensor.steps_at_rest(rest)  # raises an error before any run
    few = Sensor.of(scenario, 2, controller)
    show = progress or (lambda done, total, doing: None)
    inner = np.concatenate([-WITHIN[::-1], [0.0], WITHIN])
    outer = np.concatenate([-BEYOND[::-1], BEYOND])
    total = len(inner) + len(outer) + 1 + FREQUENCIES + 4
    done = 0

    def next_one(doing: str) -> None:
        nonlocal done
        show(done, total, doing)
        done += 1

    outputs = []
    for rate in inner:
        next_one("constant rates")
        outputs.append(sensor.output(float(rate)))
    means = np.array([output.settled().rate.mean(axis=1) for output in outputs])
    line = static(inner, means)
    still = outputs[len(WITHIN)].settled().rate
    further = []
    for rate in outer:
        next_one("full scale")
        further.append(_mean_or_nan(few, float(rate)))
    first = means[:, : len(few.seeds)]  # the same seeds at every rate: the noise cancels
    reached, last = full_scale(np.concatenate([inner, outer]), np.concatenate([first, further]), static(inner, first))
    frequencies = _frequencies(outputs[0])
    gains = []
    for frequency in frequencies:
        next_one("sinusoidal rates")
        gains.append(_gains(few, float(frequency)))
    answered = response(frequencies, np.array(gains), line.scale_factor.mean)
    if rest is not None:
        _check_rest(rest, answered)
    next_one("record at rest")
    at_rest = sensor.at_rest(rest)
    leaks = []
    for name, size, offered in _couplings(scenario):
        pair = []
        for sign in (-1.0, 1.0):
            next_one("quadrature")
            output = sensor.output(0.0, changes={name: {"xx": 0.0, "xy": sign * size, "yy": 0.0}})
            pair.append(output.settled().rate.mean(axis=1))
        leaks.append(Leak(offered, mean_interval((pair[1] - pair[0]) / 2)))
    bound = bound_angle_random_walk(scenario.replace({"plant.angular_rate": 0.0}), controller)
    found = allan(at_rest.rate, at_rest.interval, _shortest(answered))
    show(total, total, "writing")
    return Characterization(
        scenario,
        controller,
        seeds,
        inner,
        line,
        mean_interval(np.sqrt((still**2).mean(axis=1))),
        reached,
        last,
        outputs[-1],
        turn_on_time(outputs[-1].time, outputs[-1].rate),
        at_rest,
        _credible(found, bound),
        bound,
        answered,
        *leaks,
    )


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


def _mean_or_nan(sensor: Sensor, rate: float) -> Array:
    """Mean steady output of each run at a rate beyond the range; NaN if a run diverges."""
    try:
        return np.asarray(sensor.output(rate).settled().rate.mean(axis=1), dtype=float)
    except ValueError:
        return np.full(len(sensor.seeds), math.nan)


def _frequencies(output: Output) -> Array:
    """Test frequencies, Hz: from two periods in the steady half to a quarter of the output rate."""
    lowest = 4.0 / output.time[-1]
    return np.geomspace(lowest, 0.25 / output.interval, FREQUENCIES)


def _gains(sensor: Sensor, frequency: float) -> NDArray[np.complex128]:
    """Complex gain of each run at a frequency in Hz: (runs,)."""
    moving = {"rate.kind": "sine", "rate.amplitude": SINE, "rate.frequency": 2 * math.pi * frequency}
    output = sensor.output(0.0, changes=moving)
    steady = output.settled().rate
    return np.array([gain_and_lag(output.time[-len(run) :], run, SINE, frequency, output.interval) for run in steady])


def _couplings(scenario: Scenario) -> list[tuple[str, float, float]]:
    """Field, deviation in SI, and the rate that causes an equal force: k/(2 m omega), c/(2 m).

    The stiffness deviation makes the quadrature force as large as the Coriolis force at the end of the range.
    """
    plant = scenario.plant
    omega = math.sqrt(plant.stiffness.xx / plant.mass)
    stiffness = 2 * plant.mass * omega * RANGE
    damping = COUPLING * math.sqrt(plant.damping.xx * plant.damping.yy)
    return [
        ("plant.stiffness_deviation", stiffness, RANGE),
        ("plant.damping_deviation", damping, damping / (2 * plant.mass)),
    ]
