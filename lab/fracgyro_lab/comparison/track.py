"""The task `track`: tracking the paper's reference, off resonance, with limited chattering."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from fracgyro.analysis.metric_names import METRICS
from fracgyro.analysis.metrics import TRANSIENT
from fracgyro.scenario import Scenario
from fracgyro.scenario.kinds import kinds_with
from fracgyro.scenario.to_core import natural_frequencies, reference_reach
from fracgyro.simulation.user_controller import ControllerLike
from fracgyro.study.tune.criteria import Constraint, Measured, Objective, measure

from .contender import Contender
from .limits import limit_of
from .task import DEG, Changes, Task, Values, checked, drifting, late, other_noise, other_plants
from .track_contenders import CONTENDERS, OBSERVER, PAPER

DURATION = 20.0  # twice the transient of the paper's run
FORCE_LIMIT = 1000.0
LOW, HIGH = 0.0035, 0.05  # chattering: the paper's own without noise, and a larger one for a smaller error
NEAR = 0.1  # ceilings that differ by a smaller share are one
PUBLISHED_SEEDS = 8  # for the runs that measure the chattering of the published gains
LOOP_BANDWIDTHS = 0.02, 1.1  # range of the field
OTHER = "dual_mass"  # the second device
PAPER_DEVICE = Scenario.paper()
ERRORS = ("rmse_steady_x", "rmse_steady_y", "rmse_transient_x", "rmse_transient_y")
CHATTERING = ("chattering_x", "chattering_y")


class Track(Task):
    """The geometric mean of four RMS errors, with a ceiling on chattering."""

    name = "track"
    title = "Tracking"
    contenders = CONTENDERS
    observer = OBSERVER
    reference = PAPER
    over = "the paper's"
    error_words = ("error", "q0")
    metrics = (*ERRORS, *CHATTERING, "largest_force", "saturated_share", "error_settling_time")
    sensing = quick_sensing = (("F", 0.0), ("F", 1e-13), ("P", 0.0), ("P", 1e-13))
    trials = 1200
    search_seeds = 2
    objectives = tuple(Objective(metric=metric) for metric in ERRORS)
    compared = len(ERRORS)
    lost = 0.0  # 1 q0, as large as the reference

    def scenarios(self) -> dict[str, Scenario]:
        long = {"run.duration": DURATION, "run.kernel_tolerance": 3e-5}
        other = Scenario.shipped(OTHER)
        slower = _faster(other)[0]
        step = other.run.step
        shorter = {"run.duration": step * round(DURATION / slower / step)}
        return {"paper": self.scenario(Scenario.paper().replace(long)), OTHER: self.scenario(other.replace(shorter))}

    def scenario(self, given: Scenario) -> Scenario:
        base = checked(given)
        changes: dict[str, Any] = {"run.units": "nondimensional", "run.record_every": 1}
        if base.controller.force_limit == math.inf:
            changes["controller.force_limit"] = FORCE_LIMIT
        if base.adaptation.initial_rate is None:  # fixed, as the plant's rate changes
            rate = base.plant.nondimensional()[2]
            changes["adaptation.initial_rate"] = base.adaptation.initial_ratio * rate
        return base.replace(changes)

    def constraints(self, ceiling: float) -> list[Constraint]:
        return [Constraint(metric=metric, at_most=ceiling) for metric in CHATTERING]

    def sensed_by(self, scenario: str, asked: bool) -> tuple[tuple[str, float], ...] | None:
        return (("F", 1e-13), ("P", 1e-13)) if scenario == OTHER and not asked else None

    def ceilings(self, scenario: str, base: Scenario) -> tuple[float, ...]:
        """A low and a high ceiling and, in noise, the chattering of the published gains in that noise.

        Of the second device only the last: near resonance the force is small, and with it any chattering large.
        """
        own = self._published(base) if base.device.position_noise_density else math.nan
        if scenario == OTHER:
            return (own,) if math.isfinite(own) else (HIGH,)
        apart = math.isfinite(own) and all(abs(own - known) > NEAR * known for known in (LOW, HIGH))
        return tuple(sorted((LOW, HIGH, own))) if apart else (LOW, HIGH)

    def _published(self, base: Scenario) -> float:
        """The chattering of the scenario's own gains, of the larger axis, to three digits; NaN if a run diverges."""
        (found,) = self.measure([base], range(PUBLISHED_SEEDS), base, None)
        larger = max(float(found.metrics[metric].mean()) for metric in CHATTERING)
        return float(f"{larger:.3g}")

    def scaled(self, contender: Contender, base: Scenario) -> Contender:
        return contender.scaled(*_faster(base))

    def limit(self, base: Scenario, ceilings: Sequence[float]) -> dict[str, Any] | None:
        return limit_of(base, tuple(ceilings), _transient(base))

    def measure(
        self,
        scenarios: Sequence[Scenario],
        seeds: Sequence[int],
        base: Scenario,
        controller: ControllerLike | None,
    ) -> list[Measured]:
        return measure(scenarios, seeds, {"transient": _transient(base)}, controller=controller)

    def error(self, measured: Measured) -> Values:
        with np.errstate(divide="ignore"):
            logs = np.log(np.stack([measured.metrics[metric] for metric in ERRORS]))
        found: Values = np.where(measured.diverged, np.inf, logs.mean(axis=0))
        return found

    def words(self, metric: str) -> tuple[str, str]:
        return METRICS[metric]

    def plants(self, base: Scenario) -> Changes:
        rates = {f"rate {deg:+d} deg/s": {"plant.angular_rate": deg * DEG} for deg in (300, 10, -300, -10)}
        return {**other_plants(base), **rates, "rate 0": {"plant.angular_rate": 0.0}, **other_noise(base)}

    def conditions(self, base: Scenario) -> Changes:
        scales, run = base.plant.scales, base.run
        position, velocity = reference_reach(base)
        reach = [1.25 * largest * scales.length for largest in position]
        # Far above the reference, so that no start clips.
        speed = [10 * largest * scales.velocity for largest in velocity]
        found = {
            "one step of delay": late(base, hidden=False),
            "one step of hidden delay": late(base, hidden=True),
        }
        for bits in (16, 12):
            converters: dict[str, Any] = {"device.position_range": reach, "device.position_bits": bits}
            if base.device.sensing == "full":
                converters |= {"device.velocity_range": speed, "device.velocity_bits": bits}
            found[f"{bits} bit"] = converters
        # The paper's reference needs 0.57 of it: half would be infeasible.
        found["0.7 of the force"] = {"controller.force_limit": 0.7 * base.controller.force_limit}
        found["K -300 ppm, drifting"] = drifting(base, -300.0)
        found["4 times as long"] = {"run.duration": 4 * run.duration}
        for name, times in (("h/2", 0.5), ("2h", 2.0)):
            if changed := sampled(base, times):
                found[name] = changed
        return found


def _faster(base: Scenario) -> tuple[float, float]:
    """The device's frequency and its sampling rate, over those of the paper's."""
    frequency = natural_frequencies(base)[0] / natural_frequencies(PAPER_DEVICE)[0]
    return frequency, PAPER_DEVICE.run.step / base.run.step


def _transient(base: Scenario) -> float:
    """The paper's, as a number of periods of the device; at most half of the run."""
    return min(TRANSIENT / min(_faster(base)[0], 1.0), base.run.duration / 2)


def sampled(base: Scenario, times: float) -> dict[str, Any]:
    """Another period of control; disturbance, noise and gains are physically the same. Empty without one."""
    run, disturbance = base.run, base.disturbance
    changes: dict[str, Any] = {"run.step": times * run.step}
    white = disturbance.kind == "noise" and disturbance.band is None and disturbance.hold in (None, run.step)
    if disturbance.added or base.datasheet.force_noise is not None or not white:
        return {}
    if disturbance.standard_deviation is not None:
        changes |= {
            "disturbance.standard_deviation": None,
            "disturbance.density": disturbance.standard_deviation**2 * run.step,
        }
    changes["disturbance.hold"] = None
    if base.controller.kind in kinds_with("controller.loop_bandwidth"):  # which is in radians per step
        changes["controller.loop_bandwidth"] = float(np.clip(times * base.controller.loop_bandwidth, *LOOP_BANDWIDTHS))
    return changes
