"""Tasks for a learner: what an episode begins with, what is observed of it, and what a step is worth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import number
from ..scenario import Scenario, ScenarioError, check_scenario
from ..scenario.shipped import shipped

Vector = NDArray[np.float64]

SEEDS = 2**53  # those that every face of a scenario takes
DURATION = 10.0  # of the scenario that there is if none is given

# Columns of _core.Gyroscopes. An observation is what comes before the error, without the velocity where none is sensed.
VELOCITY, ERROR, RATE = 8, 10, 12


@dataclass(frozen=True)
class Task:
    """A scenario whose motion is to follow its reference; with a `rate_range`, also a rate to be found.

    `rate_range`: in rad/s, plus and minus; of it a constant angular rate is drawn for each episode.
    """

    scenario: Scenario
    error_limit: float
    rate_range: float | None

    @property
    def observed(self) -> int:
        """Numbers in an observation."""
        return VELOCITY if self.scenario.device.sensing == "position" else ERROR

    @property
    def acted(self) -> int:
        """Numbers in an action: the force and the rate, as shares of their limits."""
        return 2 if self.rate_range is None else 3

    @property
    def force_limit(self) -> float:
        return float(self.scenario.controller.force_limit)

    @property
    def rate_unit(self) -> float:
        """The unit of a row's rate, in rad/s."""
        return float(self.scenario.plant.scales.rate)

    @property
    def worst(self) -> float:
        """The reward of a step that is as bad as one may be."""
        return -2.0 * self.error_limit**2 if self.rate_range is None else -4.0

    def drawn(self, generator: np.random.Generator) -> Scenario:
        """The scenario of one episode."""
        changes: dict[str, Any] = {"disturbance.seed": int(generator.integers(SEEDS))}
        if self.scenario.rate.kind == "noise":
            changes["rate.seed"] = int(generator.integers(SEEDS))
        if self.rate_range is not None:
            changes["plant.angular_rate"] = float(generator.uniform(-self.rate_range, self.rate_range))
        return self.scenario.replace(changes)


def tracking(scenario: Scenario | None, error_limit: float) -> Task:
    """Raises TypeError, ValueError or ScenarioError, in one sentence, where an argument is not allowed."""
    if scenario is None:
        scenario = shipped("hardware").replace({"run.duration": DURATION})
    check_scenario(scenario)
    limit = scenario.controller.force_limit
    if not math.isfinite(limit):
        raise ScenarioError(f"controller.force_limit is {limit}: it must be finite, as actions are shares of it")
    limit = number("error_limit", error_limit, above=0.0)
    return Task(scenario.replace({"run.units": "nondimensional", "run.record_every": 1}), limit, None)


def rate_sensing(scenario: Scenario | None, error_limit: float, rate_range: float | None) -> Task:
    """Raises what `tracking` does."""
    task = tracking(scenario, error_limit)
    widest = 2.0 * abs(task.scenario.plant.angular_rate) if rate_range is None else rate_range
    if rate_range is None and widest == 0.0:
        raise ValueError("plant.angular_rate is 0: rate_range must be given, as it is twice that otherwise")
    return Task(task.scenario, task.error_limit, number("rate_range", widest, above=0.0))
