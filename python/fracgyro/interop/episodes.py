"""Reinforcement-learning tasks: initial scenario of an episode, observations and rewards."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import number, short
from ..scenario import Scenario, ScenarioError
from ..scenario.named import is_name, named
from ..scenario.shipped import NAMES

Vector = NDArray[np.float64]
ScenarioLike = Scenario | str | os.PathLike[str] | Mapping[str, Any]

SEEDS = 2**53  # seeds that every integration supports
DURATION = 10.0  # run.duration of the default scenario

FORMS = f"one of {', '.join(NAMES)}, the path of a TOML file, TOML text or a dict of tables"

# Columns of _core.Gyroscopes. An observation has those before the error, without the velocity if it is not sensed.
VELOCITY, ERROR, RATE = 8, 10, 12


@dataclass(frozen=True)
class Task:
    """A scenario whose motion must follow its reference; with a `rate_range`, the rate must also be estimated.

    `rate_range`: rad/s; the constant angular rate of each episode is drawn between minus and plus this.
    """

    scenario: Scenario
    error_limit: float
    rate_range: float | None
    steps: int  # steps per episode

    @property
    def observed(self) -> int:
        """Numbers in an observation."""
        return VELOCITY if self.scenario.device.sensing == "position" else ERROR

    @property
    def acted(self) -> int:
        """Numbers in an action: the force and the rate, as fractions of their limits."""
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
        """The lowest reward of a step."""
        return -2.0 * self.error_limit**2 if self.rate_range is None else -4.0

    def drawn(self, generator: np.random.Generator) -> Scenario:
        """The scenario of one episode."""
        changes: dict[str, Any] = {"disturbance.seed": int(generator.integers(SEEDS))}
        if self.scenario.rate.kind == "noise":
            changes["rate.seed"] = int(generator.integers(SEEDS))
        if self.rate_range is not None:
            changes["plant.angular_rate"] = float(generator.uniform(-self.rate_range, self.rate_range))
        return self.scenario.replace(changes)


def tracking(scenario: ScenarioLike | None, error_limit: float, max_episode_steps: int | None) -> Task:
    """The tracking task. Raises TypeError, ValueError or ScenarioError for an invalid argument."""
    found = Scenario.shipped("hardware").replace({"run.duration": DURATION}) if scenario is None else taken(scenario)
    limit = found.controller.force_limit
    if not math.isfinite(limit):
        raise ScenarioError(f"controller.force_limit is {limit}: it must be finite, as actions are fractions of it")
    limit, steps = number("error_limit", error_limit, above=0.0), found.run.steps
    if max_episode_steps is not None:
        if isinstance(max_episode_steps, bool) or not isinstance(max_episode_steps, int) or max_episode_steps < 1:
            raise ValueError(f"max_episode_steps is {short(max_episode_steps)}: it must be an integer of at least 1")
        steps = min(steps, max_episode_steps)
    return Task(found.replace({"run.units": "nondimensional", "run.record_every": 1}), limit, None, steps)


def rate_sensing(
    scenario: ScenarioLike | None, error_limit: float, rate_range: float | None, max_episode_steps: int | None
) -> Task:
    """The task with a rate estimate. Raises what `tracking` raises."""
    task = tracking(scenario, error_limit, max_episode_steps)
    widest = 2.0 * abs(task.scenario.plant.angular_rate) if rate_range is None else rate_range
    if rate_range is None and widest == 0.0:
        raise ValueError("plant.angular_rate is 0: rate_range must be given, as its default is twice that rate")
    return replace(task, rate_range=number("rate_range", widest, above=0.0))


def taken(scenario: ScenarioLike) -> Scenario:
    """A scenario from the name of a shipped one, a path, TOML text or a dict of tables.

    Raises TypeError for another type, ScenarioError for an invalid scenario.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, Mapping):
        return Scenario(**scenario)
    if not isinstance(scenario, str | os.PathLike):
        raise TypeError(f"scenario is {short(scenario)}: it must be a Scenario, {FORMS}")
    if isinstance(scenario, str) and ("=" in scenario or "\n" in scenario) and Path(scenario).suffix != ".toml":
        return Scenario.from_toml(scenario)
    if not (isinstance(scenario, str) and is_name(scenario)) and not os.path.exists(scenario):
        raise ScenarioError(f"scenario is {short(os.fspath(scenario))}: it must be a Scenario, {FORMS}")
    return named(scenario)
