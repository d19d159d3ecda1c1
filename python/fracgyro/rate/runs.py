"""What is simulated to characterise a scenario, and the sensor's output: rad/s, averaged over one output interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scenario import Scenario, ScenarioError
from ..scenario.bounded import is_bounded
from ..scenario.kinds import reported
from ..scenario.table import MAX_STEPS
from ..scenario.to_core import core_setup
from ..simulation.outside import ControllerLike, controller_words, in_own_units
from ..simulation.rate_means import rate_means
from ..simulation.simulate import simulate
from .units import DEG_PER_S

Array = NDArray[np.float64]
Progress = Callable[[int], object]

KEPT = 100_000  # samples of a run that are looked at: many to a period of the drive
OUTPUTS = 2_000  # of the sensor in run.duration
MIN_OUTPUTS = 20  # of which there is an Allan deviation
REST_STEPS = 4_000_000
SHORT_REST_STEPS = 1_000_000  # of what may diverge some time


@dataclass(frozen=True)
class Output:
    """The sensor's output in rad/s, (runs, samples), `interval` s apart; sample i is the mean over the interval i."""

    rate: Array
    interval: float

    @property
    def time(self) -> Array:
        """Middle of each interval, s."""
        return self.interval * (np.arange(self.rate.shape[-1], dtype=np.float64) + 0.5)

    def settled(self) -> Output:
        """The second half, which counts as steady: a scenario's run.duration is to be long enough for that."""
        return Output(self.rate[:, self.rate.shape[-1] // 2 :], self.interval)


@dataclass(frozen=True)
class Sensor:
    """A scenario as a rate sensor: what it puts out at rates that are set from outside."""

    scenario: Scenario
    seeds: Sequence[int]
    controller: ControllerLike | None = None  # from outside, in the place of the scenario's own

    @classmethod
    def of(cls, scenario: Scenario, seeds: int, controller: ControllerLike | None = None) -> Sensor:
        """Raises ScenarioError where the scenario or the controller leaves nothing to characterise."""
        if controller is not None:
            _check_reports(scenario, controller)
        elif "rate_estimate" not in {channel.name for channel in reported(core_setup(scenario))}:
            raise ScenarioError(
                f"controller.kind is {scenario.controller.kind}: it must be one that estimates the angular rate, as "
                "the sensor's output is this estimate"
            )
        elif not scenario.controller.adaptive:
            raise ScenarioError("controller.adaptive is false: it must be true, as the sensor's output is an estimate")
        elif scenario.controller.rate_law == "printed" and scenario.adaptation.kind == "gradient":
            raise ScenarioError(
                'controller.rate_law is "printed": it must be "skew", as the printed law never moves the estimate'
            )
        if scenario.run.steps < 2 * OUTPUTS:
            raise ScenarioError(
                f"run.duration is {scenario.run.duration:g}: it must be at least {2 * OUTPUTS} steps of "
                f"{scenario.run.step:g}, or no output is left to judge"
            )
        start = scenario.disturbance.seed
        return cls(in_own_units(scenario, controller), range(start, start + seeds), controller)

    @property
    def block(self) -> tuple[int, int]:
        """Steps from one sample that is looked at to the next, and samples that an output is the mean of."""
        steps = self.scenario.run.steps
        every = max(1, steps // KEPT)
        return every, steps // every // OUTPUTS

    def output(self, rate: float, *, changes: dict[str, object] | None = None, steps: int | None = None) -> Output:
        """At this angular rate in rad/s, one run per seed. The controller is not told the rate: its guess is 0.

        Raises ValueError where a run diverges.
        """
        every, block = self.block
        scenario = self.scenario.replace(
            {
                "plant.angular_rate": rate,
                "adaptation.initial_rate": 0.0,
                "run.duration": (steps or self.scenario.run.steps) * self.scenario.run.step,
                **(changes or {}),
            }
        )
        scales = scenario.plant.scales
        found = rate_means(scenario, self.seeds, every=every, block=block, controller=self.controller)
        if not np.isfinite(found).all():
            step, at = scenario.run.step, DEG_PER_S.of(rate)
            raise ValueError(f"run.step is {step:g}: it must be less, as the run at {at:g} deg/s diverges")
        return Output(found * scales.rate, every * block * self.scenario.run.step * scales.time)

    def steps_at_rest(self, seconds: float | None) -> int:
        """Of a run that has a steady record so long.

        If None two million, or half a million where nothing is known to bound the switching gain (EQUATIONS.md, 4).

        Raises ValueError where these are more than a run can have, or leave too few outputs.
        """
        if seconds is None:
            bounded = self.controller is None and is_bounded(self.scenario)
            return REST_STEPS if bounded else SHORT_REST_STEPS
        run, (every, block) = self.scenario.run, self.block
        start, step = run.steps // 2, run.step * self.scenario.plant.scales.time
        least, most = MIN_OUTPUTS * every * block * step, (MAX_STEPS - start) * step
        if not least <= seconds <= most:
            raise ValueError(f"rest is {seconds:g}: it must lie between {least:.3g} and {most:.6g} s")
        return start + round(seconds / step)

    def at_rest(self, seconds: float | None = None) -> Output:
        """A long record of the steady output at rate 0: of this device time."""
        found = self.output(0.0, steps=self.steps_at_rest(seconds))
        return found.settled() if seconds is None else Output(found.rate[:, OUTPUTS // 2 :], found.interval)


def _check_reports(scenario: Scenario, controller: ControllerLike) -> None:
    """Raises ScenarioError where the controller does not report what the sensor puts out."""
    run = simulate(scenario.replace({"run.duration": 4 * scenario.run.step, "run.record_every": 1}), controller)
    if "rate_estimate" not in run:
        raise ScenarioError(
            f"controller is {controller_words(controller)}: it must report rate_estimate, as the sensor's output is "
            "this estimate"
        )
