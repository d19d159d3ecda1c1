"""The task `track`: tracking the paper's reference, off resonance, with limited chattering."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from fracgyro.analysis.metric_names import METRICS
from fracgyro.analysis.metrics import TRANSIENT
from fracgyro.scenario import Scenario
from fracgyro.scenario.to_core import reference_reach
from fracgyro.simulation.user_controller import ControllerLike
from fracgyro.study.tune.criteria import Constraint, Measured, Objective, measure

from .task import DEG, Changes, Task, Values, checked, drifting, late, other_noise, other_plants
from .track_contenders import CONTENDERS, OBSERVER, PAPER

DURATION = 20.0  # twice the transient of the paper's run
FORCE_LIMIT = 1000.0
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
    ceilings = (0.0035, 0.05)  # the paper's own, and what an error may be bought with
    objectives = tuple(Objective(metric=metric) for metric in ERRORS)
    compared = len(ERRORS)
    lost = 0.0  # 1 q0, as large as the reference

    def scenarios(self) -> dict[str, Scenario]:
        long = {"run.duration": DURATION, "run.kernel_tolerance": 3e-5}
        return {"paper": self.scenario(Scenario.paper().replace(long))}

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

    def measure(
        self,
        scenarios: Sequence[Scenario],
        seeds: Sequence[int],
        base: Scenario,
        controller: ControllerLike | None,
    ) -> list[Measured]:
        transient = min(TRANSIENT, base.run.duration / 2)
        return measure(scenarios, seeds, {"transient": transient}, controller=controller)

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
        return found
