"""The task `rate`: minimal noise of the angular rate of a driven gyroscope, at the same bandwidth for all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from fracgyro.analysis.confidence import Mean, mean_interval
from fracgyro.rate.merit import full_scale, static
from fracgyro.rate.units import DEG_PER_H, DEG_PER_S
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.table import format_value
from fracgyro.scenario.to_core import is_plain
from fracgyro.simulation.user_controller import ControllerLike
from fracgyro.study.tune.criteria import Constraint, Measured, Objective

from .contender import Contender
from .own import controller_of
from .rate_contenders import CONTENDERS, OBSERVER, REBALANCE
from .rate_runs import (
    BANDWIDTH,
    RANGE,
    SETTLED,
    SETTLING,
    at_range,
    bound,
    found_bandwidth,
    noise_at_rest,
    response,
    settled,
    start_up_from_rest,
)
from .task import (
    DEG,
    Changes,
    Task,
    Values,
    checked,
    cross_damping,
    drifting,
    late,
    other_noise,
    other_plants,
    quadrature,
)

WORDS = {
    "angle_random_walk": ("angle random walk", "deg/√h"),
    "over_bound": ("over the bound", ""),
    "output_noise": ("output noise", "mdeg/s RMS"),
    "zero_rate_output": ("zero-rate output", "deg/h"),
    "settling_time": ("settling", "ms"),
    "scale_factor_error": ("scale factor error", "ppm"),
    "nonlinearity": ("non-linearity", "ppm"),
    "lag_10": ("lag at 10 Hz", "deg"),
    "lag_100": ("lag at 100 Hz", "deg"),
    "bias_damping": ("bias by dxy", "deg/h"),
    "bias_quadrature": ("bias by quadrature", "deg/h"),
    "bias_quadrature_hidden": ("the same, hidden delay", "deg/h"),
    "scale_factor_hidden": ("scale factor error, hidden delay", "ppm"),
    "bias_drift": ("bias by drift of K", "deg/h"),
    "rms_drift": ("RMS by drift of K", "deg/h"),
    "scale_factor_16": ("scale factor error, 16 bit", "ppm"),
    "scale_factor_12": ("scale factor error, 12 bit", "ppm"),
    "equal_motion": ("angle random walk, equal total motion", "deg/√h"),
    "start_up": ("start-up", "ms"),
    "full_scale": ("full scale", "deg/s"),
}
# Standard deviations, averaged as mean squares.
SQUARED = ("angle_random_walk", "over_bound", "output_noise", "equal_motion", "rms_drift")


MAX_BELOW_BOUND = 2.0  # bound over the angle random walk: beyond, the output hardly responds to a rate near 0
MAX_LIMIT_RATIO = 10.0  # ratio to a limit, above which noise is not simulated
NOTHING = 1e-9  # deg/sqrt(h): smaller noise means that the converter is too coarse and its output constant


class Figure(Objective):
    """A figure of merit of this task."""

    metric: str


class Limit(Constraint):
    """A limit on a figure of merit of this task."""

    metric: str


class Rate(Task):
    """The angle random walk at a bandwidth of 100 Hz."""

    name = "rate"
    title = "Sensing the angular rate"
    contenders = CONTENDERS
    observer = OBSERVER
    reference = REBALANCE
    over = "force rebalance's"
    error_words = ("angle random walk", "deg/√h")
    metrics = tuple(WORDS)[1:]
    sensing = (("F", 0.0), ("F", 1e-13), ("P", 1e-13))
    quick_sensing = (("P", 1e-13),)
    trials = 200
    search_seeds = 8
    finds_bandwidth = True
    objectives = (Figure(metric="angle_random_walk"), Figure(metric="output_noise"))
    compared = 1
    lost = math.inf  # only what diverged

    def scenarios(self) -> dict[str, Scenario]:
        return {"dual_mass": self.scenario(Scenario.shipped("dual_mass"))}

    def scenario(self, given: Scenario) -> Scenario:
        base = checked(given)
        if not is_plain(base):
            raise ScenarioError(
                f"reference.kind is {format_value(base.reference.kind)} and reference.offset "
                f"{format_value(base.reference.offset)}: the task rate must have a sine about 0 on each axis"
            )
        if not all(base.reference.amplitude) or not all(base.reference.frequency):
            raise ScenarioError(
                f"reference.amplitude is {format_value(base.reference.amplitude)} and reference.frequency "
                f"{format_value(base.reference.frequency)}: both axes must be driven in the task rate"
            )
        if base.reference.amplitude[0] != 1.0 or base.reference.frequency[0] != 1.0:
            raise ScenarioError(
                f"reference.amplitude is {format_value(base.reference.amplitude)} and reference.frequency "
                f"{format_value(base.reference.frequency)}: both must begin with 1.0 in the task rate, whose gains are "
                "in units of the drive's motion"
            )
        return base.replace(
            {
                "run.units": "nondimensional",
                "run.record_every": 1,
                "rate.kind": "constant",
                "plant.angular_rate": 0.0,
                "adaptation.initial_rate": 0.0,
            }
        )

    def constraints(self, ceiling: float) -> list[Constraint]:
        return [
            Limit(metric="scale_factor_error", at_most=5000.0),
            Limit(metric="settling_time", at_most=100.0),
            Limit(metric="below_bound", at_most=MAX_BELOW_BOUND),
        ]

    def completed(self, contender: Contender, base: Scenario, values: Mapping[str, Any]) -> dict[str, Any] | None:
        gain = contender.bandwidth
        assert gain is not None

        def at(bandwidth: float) -> tuple[Scenario, ControllerLike | None]:
            tried = {**values, gain.field: bandwidth}
            return contender.scenario(base, tried), controller_of(contender, tried)

        try:
            found = found_bandwidth(at, gain.low, gain.high)
        except ScenarioError:
            return None
        return None if found is None else {**values, gain.field: found}

    def measure(
        self,
        scenarios: Sequence[Scenario],
        seeds: Sequence[int],
        base: Scenario,
        controller: ControllerLike | None,
    ) -> list[Measured]:
        return [self._measured(scenario, seeds, controller, SETTLED) for scenario in scenarios]

    def _measured(
        self, scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None, wait: float
    ) -> Measured:
        walk, spread, mean = noise_at_rest(scenario, seeds, controller, wait)
        level, settling = at_range(scenario, seeds[:1], controller)
        ones, least = np.ones(len(seeds)), bound(scenario)
        metrics = {
            "angle_random_walk": walk,
            "over_bound": walk / least,
            "below_bound": np.nan_to_num(least) / np.maximum(walk, NOTHING),
            "output_noise": spread,
            "zero_rate_output": mean,
            "scale_factor_error": ones * abs(1e6 * (level / RANGE - 1)),
            "settling_time": ones * settling,
        }
        return Measured(metrics, np.isnan(walk))

    def train(
        self, scenarios: Sequence[Scenario], seeds: Sequence[int], base: Scenario, controller: ControllerLike | None
    ) -> list[Measured]:
        """Metrics of trials; skips the noise far beyond a limit."""
        return [self._trained(scenario, seeds, controller) for scenario in scenarios]

    def _trained(self, scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None) -> Measured:
        limits = [limit for limit in self.constraints(0.0) if limit.metric != "below_bound"]
        level, settling = at_range(scenario, seeds[:1], controller)
        at_once = {"scale_factor_error": abs(1e6 * (level / RANGE - 1)), "settling_time": settling}
        if all(limit.of(at_once[limit.metric]) <= MAX_LIMIT_RATIO * (limit.at_most or 0.0) for limit in limits):
            return self._measured(scenario, seeds, controller, SETTLING)
        nothing = {objective.metric: np.full(len(seeds), np.nan) for objective in self.objectives}
        unknown = {"below_bound": np.zeros(len(seeds))}
        return Measured({**nothing, **unknown, **at_once}, np.isnan(np.repeat(level, len(seeds))))

    def figures(self, scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None) -> dict[str, Values]:
        def at(rate: float, changes: Mapping[str, Any] | None = None) -> Values:
            return settled(scenario.replace(dict(changes or {})), rate, seeds, controller)[0]

        def pair(make: Any, size: float, changes: Mapping[str, Any] | None = None) -> Values:
            """Half the difference of the output at rest between both signs of a change, deg/h."""
            up, down = (at(0.0, {**make(scenario, sign * size), **(changes or {})}) for sign in (1, -1))
            return DEG_PER_H.of(1.0) * (up - down) / 2

        def scale(changes: Mapping[str, Any] | None = None) -> Values:
            found: Values = 1e6 * ((at(RANGE, changes) - at(-RANGE, changes)) / (2 * RANGE) - 1)
            return found

        hidden = late(scenario, hidden=True)
        conditions = self.conditions(scenario)
        drifted = settled(scenario.replace(dict(conditions["K -300 ppm, drifting"])), 0.0, seeds, controller)
        ladder = RANGE * np.array([-1.0, -1 / 2, 0.0, 1 / 2, 1.0])
        outputs = np.array([at(float(rate)) for rate in ladder])
        lags = response(scenario, controller, (10.0, BANDWIDTH), seeds[0])
        half = {"reference.amplitude": tuple(a / math.sqrt(2) for a in scenario.reference.amplitude)}
        quieter = scenario if scenario.reference.amplitude[1] == 0.0 else scenario.replace(half)
        return {
            "scale_factor_error": scale(),
            "nonlinearity": _nonlinearity(ladder, outputs),
            "lag_10": np.array([-math.degrees(np.angle(lags[0]))]),
            "lag_100": np.array([-math.degrees(np.angle(lags[1]))]),
            "bias_damping": pair(cross_damping, 0.1),
            "bias_quadrature": pair(quadrature, RANGE),
            "bias_quadrature_hidden": pair(quadrature, RANGE, hidden),
            "scale_factor_hidden": scale(hidden),
            "bias_drift": DEG_PER_H.of(1.0) * (drifted[0] - at(0.0)),
            "rms_drift": DEG_PER_H.of(1.0) * drifted[1],
            "scale_factor_16": scale(conditions["16 bit"]),
            "scale_factor_12": scale(conditions["12 bit"]),
            "equal_motion": noise_at_rest(quieter, seeds, controller)[0],
            "start_up": start_up_from_rest(scenario, seeds, controller),
            "full_scale": _full_scale(scenario, seeds[:2], controller),
        }

    def error(self, measured: Measured) -> Values:
        walk = np.maximum(measured.metrics["angle_random_walk"], NOTHING)
        return np.log(np.where(measured.diverged, np.inf, walk))

    def interval(self, metric: str, values: Values) -> Mean:
        """Mean with its interval; standard deviations are averaged as mean squares, to avoid bias."""
        if metric == "error":
            values = np.exp(values)
        if metric != "error" and metric not in SQUARED:
            return mean_interval(values)
        return Mean(*(math.sqrt(max(number, 0.0)) for number in mean_interval(values**2)))

    def words(self, metric: str) -> tuple[str, str]:
        return WORDS[metric]

    def plants(self, base: Scenario) -> Changes:
        rates = {f"rate {deg:+d} deg/s": {"plant.angular_rate": DEG * deg} for deg in (300, 10, -300, -10)}
        return {**other_plants(base), **rates, **other_noise(base)}

    def conditions(self, base: Scenario) -> Changes:
        length = base.plant.scales.length
        # An axis that is held at rest has separate converters, 30 times finer.
        reach = [1.25 * length * (amplitude or 1 / 30) for amplitude in base.reference.amplitude]
        found = {
            "one step of delay": late(base, hidden=False),
            "one step of hidden delay": late(base, hidden=True),
        }
        for bits in (16, 12):
            found[f"{bits} bit"] = {"device.position_range": reach, "device.position_bits": bits}
        found["half of the force"] = {"controller.force_limit": 0.5 * base.controller.force_limit}
        found["K -300 ppm, drifting"] = drifting(base, -300.0)
        return found


def _nonlinearity(rates: Values, outputs: Values) -> Values:
    """Deviation of each run from its line, ppm of the range, at the rate with the largest mean deviation."""
    level = np.stack([rates, np.ones_like(rates)], axis=1)
    off = outputs - level @ np.linalg.lstsq(level, outputs, rcond=None)[0]
    worst = int(np.argmax(abs(off.mean(axis=1))))
    found: Values = 1e6 * off[worst] / RANGE
    return found


def _full_scale(scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None) -> Values:
    """Full scale, deg/s, one value: the last rate of the ladder up to which the output is within 1 % of its line."""
    inner = RANGE * np.array([-1.0, 0.0, 1.0])
    ladder = np.concatenate([inner, *([-size * RANGE, size * RANGE] for size in (2.0, 4.0, 8.0, 16.0, 32.0))])
    outputs = np.array([settled(scenario, float(rate), seeds, controller)[0] for rate in ladder])
    if not np.isfinite(outputs[:3]).all():
        return np.array([math.nan])
    reached, _ = full_scale(ladder, outputs, static(inner, outputs[:3]))
    return np.array([DEG_PER_S.of(reached)])
