"""Interface of a task of the comparison, and functions shared by tasks. Each task is one file."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from fracgyro.analysis.confidence import Mean, mean_interval
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.printing import values
from fracgyro.scenario.table import format_value
from fracgyro.scenario.to_core import equivalent_sine, natural_frequencies
from fracgyro.simulation.user_controller import ControllerLike
from fracgyro.study.tune.criteria import Constraint, Measured, Objective
from numpy.typing import NDArray

from .contender import Contender, Gain

Values = NDArray[np.float64]
Changes = dict[str, dict[str, Any]]
Progress = Callable[[int], object]
DEG = math.pi / 180


@dataclass(frozen=True)
class Cell:
    """One table of the comparison: conditions shared by all its rows."""

    scenario: str  # its name
    information: str  # F: positions and velocities are measured; P: positions only
    noise: float  # noise density of the measured position, m/sqrt(Hz)
    ceiling: float  # limit of the chattering index on either axis; 0: none

    @property
    def sensing(self) -> tuple[str, str, float]:
        """Its part that cells of other ceilings share."""
        return self.scenario, self.information, self.noise

    @property
    def name(self) -> str:
        ceiling = f"-{self.ceiling:g}" if self.ceiling else ""
        return f"{self.scenario}-{self.information}-{self.noise:g}{ceiling}"


class Task(ABC):
    """A task: scenarios, objectives, limits, measurements, and conditions of the robustness test."""

    name: ClassVar[str]
    title: ClassVar[str]
    contenders: ClassVar[tuple[Contender, ...]]
    observer: ClassVar[Gain]  # tuned in class P for a contender without its own observer gain
    reference: ClassVar[str]  # the contender that ratios refer to
    over: ClassVar[str]  # label of those ratios
    error_words: ClassVar[tuple[str, str]]  # name of the compared error, and its unit
    metrics: ClassVar[tuple[str, ...]]  # additional metrics in tables
    sensing: ClassVar[tuple[tuple[str, float], ...]]  # class of information and noise of each table
    quick_sensing: ClassVar[tuple[tuple[str, float], ...]]  # the same for a quick preview
    trials: ClassVar[int]  # the most of each search
    search_seeds: ClassVar[int]  # training seeds that a search uses; all judge its best trials
    finds_bandwidth: ClassVar[bool] = False  # True if `completed` solves for the bandwidth of the rate estimate
    objectives: ClassVar[tuple[Objective, ...]]  # the mean of their logarithms is minimized
    lost: ClassVar[float]  # logarithm of an error above which control is lost
    compared: ClassVar[int]  # number of leading objectives in the error

    @abstractmethod
    def scenarios(self) -> dict[str, Scenario]:
        """Default scenarios by name."""

    @abstractmethod
    def scenario(self, given: Scenario) -> Scenario:
        """The scenario of all contenders, before their own changes. Raises ScenarioError for an unsuitable one."""

    @abstractmethod
    def constraints(self, ceiling: float) -> list[Constraint]: ...

    def sensed_by(self, scenario: str, asked: bool) -> tuple[tuple[str, float], ...] | None:
        """Class of information and noise of a default scenario that is not compared in all of them; else None."""
        return None

    def ceilings(self, scenario: str, base: Scenario) -> tuple[float, ...]:
        """Limits of the chattering, ascending, for the scenario with the sensing of a table; 0: none."""
        return (0.0,)

    def scaled(self, contender: Contender, base: Scenario) -> Contender:
        """The contender with ranges for this device."""
        return contender

    def completed(self, contender: Contender, base: Scenario, values: Mapping[str, Any]) -> dict[str, Any] | None:
        """The values with dependent ones added; None if there is no solution."""
        return dict(values)

    @abstractmethod
    def measure(
        self,
        scenarios: Sequence[Scenario],
        seeds: Sequence[int],
        base: Scenario,
        controller: ControllerLike | None,
    ) -> list[Measured]:
        """Metrics of every scenario with every seed: objectives, constraints and other columns of tables."""

    def train(
        self, scenarios: Sequence[Scenario], seeds: Sequence[int], base: Scenario, controller: ControllerLike | None
    ) -> list[Measured]:
        """Metrics of every scenario for a tuning: `measure`, or a subset."""
        return self.measure(scenarios, seeds, base, controller) if scenarios else []

    def figures(self, scenario: Scenario, seeds: Sequence[int], controller: ControllerLike | None) -> dict[str, Values]:
        """Additional metrics of the tuned contender, by seed."""
        return {}

    def limit(self, base: Scenario, ceilings: Sequence[float]) -> dict[str, Any] | None:
        """The least error that any controller can have, as `limits.limit_of` returns it; None if the task has none."""
        return None

    @abstractmethod
    def error(self, measured: Measured) -> Values:
        """Logarithm of the error by seed, infinite for a diverged run."""

    def interval(self, metric: str, values: Values) -> Mean:
        """Mean with its interval over the finite values of a metric, or of "error", whose values are logarithms."""
        if metric != "error":
            return mean_interval(values)
        return Mean(*(math.exp(min(number, 700.0)) for number in mean_interval(values)))

    @abstractmethod
    def words(self, metric: str) -> tuple[str, str]:
        """Name of a metric, and its unit."""

    @abstractmethod
    def plants(self, base: Scenario) -> Changes:
        """Changes by name: unseen plants. The contender's knowledge of the plant does not change."""

    @abstractmethod
    def conditions(self, base: Scenario) -> Changes:
        """Changes by name: conditions of the robustness test, with frozen gains."""


def checked(given: Scenario) -> Scenario:
    """The scenario. Raises ScenarioError unless its disturbance is noise, for held-out seeds."""
    if not given.disturbance.random:
        raise ScenarioError(
            f"disturbance.kind is {format_value(given.disturbance.kinds)}: it must be noise or vibration, or no seed "
            "can be held out"
        )
    return given


def sensed(base: Scenario, information: str, noise: float) -> Scenario:
    """The scenario with noise of the same nondimensional density on all measurements."""
    both = information == "F"
    return base.replace(
        {
            "device.sensing": "full" if both else "position",
            "device.position_noise_density": noise,
            "device.velocity_noise_density": noise * base.plant.reference_frequency if both else 0.0,
        }
    )


def other_plants(base: Scenario) -> Changes:
    """All but the angular rate."""
    plant = base.plant
    d, k, m = plant.damping, plant.stiffness, plant.mass
    more_d, more_k = plant.damping_deviation, plant.stiffness_deviation
    found: Changes = {}
    for sign in (1, -1):
        by = 0.05 * sign
        found[f"K {100 * by:+.0f} %"] = {"plant.stiffness_deviation": more_k.plus(by * k.xx, by * k.xy, by * k.yy)}
        found[f"D {100 * by:+.0f} %"] = {"plant.damping_deviation": more_d.plus(by * d.xx, by * d.xy, by * d.yy)}
        w = math.sqrt(k.xx / m), math.sqrt(k.yy / m)
        split = m * (w[1] + 0.2 * sign * (w[1] - w[0])) ** 2 - k.yy
        found[f"split {20 * sign:+d} %"] = {"plant.stiffness_deviation": more_k.plus(0.0, 0.0, split)}
        found[f"dxy {10 * sign:+d} %"] = cross_damping(base, 0.1 * sign)
        found[f"kxy {300 * sign:+d} deg/s"] = quadrature(base, 300 * DEG * sign)
    return found


def cross_damping(base: Scenario, share: float) -> dict[str, Any]:
    """A dxy that no contender knows of, this share of sqrt(dxx dyy)."""
    d = base.plant.damping
    return {"plant.damping_deviation": base.plant.damping_deviation.plus(0.0, share * math.sqrt(d.xx * d.yy), 0.0)}


def quadrature(base: Scenario, rate: float) -> dict[str, Any]:
    """A kxy that no contender knows of, with the force of this angular rate in rad/s."""
    frequency = equivalent_sine(base)[1][0] or natural_frequencies(base)[0]
    cross = 2 * base.plant.mass * rate * frequency * base.plant.scales.rate
    return {"plant.stiffness_deviation": base.plant.stiffness_deviation.plus(0.0, cross, 0.0)}


def other_noise(base: Scenario) -> Changes:
    """Changes of the noise density; empty without noise."""
    device = base.device
    if not device.position_noise_density:
        return {}
    return {
        words: {
            "device.position_noise_density": factor * device.position_noise_density,
            "device.velocity_noise_density": factor * device.velocity_noise_density,
        }
        for words, factor in (("noise / 3", 1 / 3), ("noise x 3", 3.0))
    }


def late(base: Scenario, *, hidden: bool) -> dict[str, Any]:
    """A step of delay more than the contender knows of, or than it knew of."""
    delay: dict[str, Any] = {"device.delay": base.device.delay + 1}
    knows = "datasheet.delay" in values(base)
    return {**delay, "datasheet.delay": base.device.delay} if hidden and knows else delay


def drifting(base: Scenario, ppm: float) -> dict[str, Any]:
    """A stiffness that changes by `ppm` until the run ends."""
    seconds = base.run.duration * base.plant.scales.time
    return {"device.stiffness_drift": ppm / 10.0, "device.temperature_ramp": 10.0 / seconds}
