"""A scenario as a rate sensor, and its output: rad/s, averaged over one output interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..scenario import Scenario, ScenarioError
from ..scenario.bounded import is_bounded
from ..scenario.kinds import reported_channels
from ..scenario.table import MAX_STEPS
from ..scenario.to_core import core_setup
from ..simulation.rate_means import rate_means
from ..simulation.simulate import simulate, simulate_many
from ..simulation.user_controller import ControllerLike, controller_words, in_own_units
from .units import DEG_PER_S

Array = NDArray[np.float64]

RECORDED_SAMPLES = 100_000  # per run.duration: many per drive period
OUTPUTS = 2_000  # sensor outputs per run.duration
CLIPPED = 0.01  # share of samples at a limit, above which a device is too weak for a rate
MIN_OUTPUTS = 20  # for an Allan deviation
REST_STEPS = 4_000_000
HALF_TURNS = 1.1  # turns of the line of vibration in the steady half of a run
SHORT_REST_STEPS = 1_000_000  # for a controller that may diverge eventually


@dataclass(frozen=True)
class Output:
    """Sensor output, rad/s, (runs, samples), `interval` s apart; sample i is the mean over interval i."""

    rate: Array
    interval: float

    @property
    def time(self) -> Array:
        """Center of each interval, s: (samples,)."""
        return self.interval * (np.arange(self.rate.shape[-1], dtype=np.float64) + 0.5)

    def settled(self) -> Output:
        """The second half, which counts as steady; run.duration must be long enough."""
        return Output(self.rate[:, self.rate.shape[-1] // 2 :], self.interval)


@dataclass(frozen=True)
class Sensor:
    """A scenario as a rate sensor: its output at applied rates."""

    scenario: Scenario
    seeds: Sequence[int]
    controller: ControllerLike | None = None  # a user's, which replaces the scenario's controller

    @classmethod
    def of(cls, scenario: Scenario, seeds: int, controller: ControllerLike | None = None) -> Sensor:
        """A sensor with seeds 0 to `seeds` - 1. Raises ScenarioError if it has no rate estimate."""
        if controller is not None:
            _check_reports(scenario, controller)
        elif "rate_estimate" not in {channel.name for channel in reported_channels(core_setup(scenario))}:
            raise ScenarioError(
                f"controller.kind is {scenario.controller.kind}: it must be one that estimates the angular rate, the "
                "sensor's output"
            )
        elif not scenario.controller.adaptive:
            raise ScenarioError("controller.adaptive is false: it must be true for a rate estimate")
        elif scenario.controller.rate_law == "printed" and scenario.adaptation.kind == "gradient":
            raise ScenarioError(
                'controller.rate_law is "printed": it must be "skew", as the printed law never changes the estimate'
            )
        if scenario.run.steps < 2 * OUTPUTS:
            raise ScenarioError(
                f"run.duration is {scenario.run.duration:g}: it must be at least {2 * OUTPUTS} steps of "
                f"{scenario.run.step:g}"
            )
        start = scenario.disturbance.seed
        return cls(scenario, range(start, start + seeds), controller)

    def first(self, seeds: int) -> Sensor:
        """The sensor with only its first `seeds` seeds."""
        return replace(self, seeds=self.seeds[:seeds])

    @property
    def block(self) -> tuple[int, int]:
        """Steps between recorded samples, and samples averaged per output."""
        steps = self.scenario.run.steps
        every = max(1, steps // RECORDED_SAMPLES)
        return every, steps // every // OUTPUTS

    def output(self, rate: float, *, changes: dict[str, object] | None = None, steps: int | None = None) -> Output:
        """Output at this angular rate in rad/s, one run per seed; the controller's initial estimate is 0.

        `changes`: fields of the scenario to replace. Raises ValueError if a run diverges.
        """
        every, block = self.block
        duration = (steps or self.scenario.run.steps) * self.scenario.run.step
        scenario = self._at(rate, {"run.duration": duration, **(changes or {})})
        scales = scenario.plant.scales
        found = rate_means(scenario, self.seeds, every=every, block=block, controller=self.controller)
        if not np.isfinite(found).all():
            step, at = scenario.run.step, DEG_PER_S.of(rate)
            raise ValueError(f"run.step is {step:g}: it must be less, as the run at {at:g} deg/s diverges")
        return Output(found * scales.rate, every * block * self.scenario.run.step * scales.time)

    def _at(self, rate: float, changes: dict[str, object]) -> Scenario:
        own = in_own_units(self.scenario, self.controller)
        return own.replace({"plant.angular_rate": rate, "adaptation.initial_rate": 0.0, **changes})

    def keeps_its_limits(self, rate: float) -> bool:
        """True if the forces and the sensors of the device suffice at this angular rate, rad/s.

        They do not if more than CLIPPED of the settled samples of one run reach a limit of `Scenario.constraints`, or
        if the run diverges.
        """
        scenario = self._at(rate, {"run.record_every": self.block[0]})
        run = simulate_many([scenario], seeds=self.seeds[:1], controller=self.controller).isel(run=0)
        if np.isfinite(run["diverged_at"]):
            return False
        limits = scenario.constraints()
        limit_of = {"control": (limits.force, limits.force), "position": limits.position}
        if scenario.device.sensing == "full":
            limit_of["velocity"] = limits.velocity
        settled = run.isel(time=slice(run.sizes["time"] // 2, None))
        reached = (abs(settled[name].values) >= np.array(limit) for name, limit in limit_of.items())
        return bool((np.concatenate(list(reached), axis=1).any(axis=1)).mean() <= CLIPPED)

    def forces(self, rate: float) -> Array:
        """Largest magnitude of the force on x and y in the steady half of a run at this rate, N: (2,)."""
        steady = self._recorded(rate)["control"].values
        return np.asarray(abs(steady).max(axis=0) * self.scenario.plant.scales.force)

    def angle_and_rate(self, rate: float) -> tuple[Array, Array]:
        """Angle of the line of vibration, rad and unwrapped by half turns, and output, rad/s, in the steady half.

        The run is so long that the line turns by a whole half turn in it, at most REST_STEPS.
        """
        run = self.scenario.run
        wanted = math.ceil(2 * HALF_TURNS * math.pi / rate / (run.step * self.scenario.plant.scales.time))
        steady = self._recorded(rate, min(max(wanted, run.steps), REST_STEPS))
        angle = np.unwrap(steady["pattern_angle"].values, period=math.pi)
        return angle, np.asarray(steady["rate_estimate"].values * self.scenario.plant.scales.rate)

    def at_every_record(self, rate: float) -> tuple[Array, float]:
        """Output, rad/s, at every recorded sample of the steady half of a run, not averaged, and their interval, s."""
        steady, scales = self._recorded(rate), self.scenario.plant.scales
        interval = float(steady["time"][1] - steady["time"][0]) * scales.time
        return np.asarray(steady["rate_estimate"].values * scales.rate), interval

    def _recorded(self, rate: float, steps: int | None = None) -> xr.Dataset:
        """The steady half of a run of the first seed."""
        steps = steps or self.scenario.run.steps
        changes: dict[str, object] = {"run.record_every": max(1, steps // RECORDED_SAMPLES)}
        changes |= {"run.units": "nondimensional", "run.duration": steps * self.scenario.run.step}
        scenario = self._at(rate, changes)
        run = simulate_many([scenario], seeds=self.seeds[:1], controller=self.controller).isel(run=0)
        return run.isel(time=slice(run.sizes["time"] // 2, None))

    def steps_at_rest(self, seconds: float | None) -> int:
        """Steps of a run whose second half has this device time.

        By default the second half has two million steps, or half a million if the switching gain has no known bound
        (EQUATIONS.md, 4).

        Raises ValueError for more steps than a run can have, or too few outputs.
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
        """A static test: steady output at rate 0 over this device time, s."""
        found = self.output(0.0, steps=self.steps_at_rest(seconds))
        return found.settled() if seconds is None else Output(found.rate[:, OUTPUTS // 2 :], found.interval)


def _check_reports(scenario: Scenario, controller: ControllerLike) -> None:
    """Raises ScenarioError if the controller does not report rate_estimate."""
    run = simulate(scenario.replace({"run.duration": 4 * scenario.run.step, "run.record_every": 1}), controller)
    if "rate_estimate" not in run:
        raise ScenarioError(
            f"controller is {controller_words(controller)}: it must report rate_estimate, the sensor's output"
        )
