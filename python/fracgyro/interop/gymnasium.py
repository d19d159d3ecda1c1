"""Gymnasium environments: tracking a reference, and sensing the angular rate.

The gyroscope moves as in fg.simulate, bit for bit under the same forces, with the scenario's disturbance, dynamic rate
and device. Importing this module registers `fracgyro/Tracking-v0` and `fracgyro/RateSensing-v0` for gymnasium.make and
gymnasium.make_vec.
"""

from __future__ import annotations

import copy
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box, Space
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from fracgyro.scenario.shipped import SHIPPED

from .. import _core
from ..arguments import short
from ..scenario import Scenario
from ..scenario.to_core import core_setup
from .episodes import ERROR, RATE, ScenarioLike, Task, Vector, rate_sensing, tracking
from .matrices import Matrix, matrices

__all__ = ["RateSensing", "RateSensingVector", "Tracking", "TrackingVector"]

Info = dict[str, Any]

MAX_OBSERVATION = 1e6  # observations are clipped; only a diverging episode exceeds this


class _Tasked:
    """Part shared by single and vector environments."""

    task: Task
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """The specification of gymnasium.make; JSON with the scenario as text."""
        return self._spec

    @spec.setter
    def spec(self, made: EnvSpec | None) -> None:
        if made is not None:
            made = copy.copy(made)
            made.max_episode_steps = made.max_episode_steps or self.task.steps
            given = made.kwargs.get("scenario")
            if given is not None and not (isinstance(given, str) and given in SHIPPED):
                made.kwargs = {**made.kwargs, "scenario": self.task.scenario.to_toml()}
        self._spec = made

    @property
    def force_limit(self) -> float:
        """Force of an action of 1, in units of m omega0^2 q0."""
        return self.task.force_limit

    @property
    def rate_range(self) -> float | None:
        """Rate of an action of 1, in rad/s; None without rate sensing."""
        return self.task.rate_range

    @property
    def plant_matrices(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """A, B, C, D of the ideal gyroscope over one step, at the rate plant.angular_rate of the given scenario.

        States x, y, vx, vy; inputs force x, y, in units of m omega0^2 q0. For model-based methods.
        """
        return matrices(self.task.scenario, sampled=True)


def _spaces(task: Task) -> tuple[Space[Vector], Space[Vector]]:
    """Spaces of observations and actions."""
    spaces = (
        Box(-MAX_OBSERVATION, MAX_OBSERVATION, (task.observed,), np.float64),
        Box(-1.0, 1.0, (task.acted,), np.float64),
    )
    return cast(tuple[Space[Vector], Space[Vector]], spaces)


def _saved(gyroscopes: _core.Gyroscopes | None) -> bytes | None:
    return None if gyroscopes is None else bytes(gyroscopes.state)


def _resumed(scenarios: list[Scenario], state: bytes | None) -> _core.Gyroscopes | None:
    if state is None:
        return None
    gyroscopes = _core.Gyroscopes([core_setup(scenario) for scenario in scenarios])
    gyroscopes.state = state
    return gyroscopes


class _Environment(_Tasked, gymnasium.Env[Vector, Vector]):
    def __init__(self, task: Task) -> None:
        self.task = task
        self.observation_space, self.action_space = _spaces(task)
        self._steps = task.steps
        self._taken = 0
        self._acted, self._observed = task.acted, task.observed
        self._limit, self._error_limit = task.force_limit, task.error_limit
        self._rate_unit = task.rate_unit
        self._share = 0.0 if task.rate_range is None else task.rate_unit / task.rate_range
        self._scenario = task.scenario
        self._gyroscope: _core.Gyroscopes | None = None

    @property
    def scenario(self) -> Scenario:
        """The scenario of this episode, with the drawn seeds and rate, for fg.simulate or fg.Controller."""
        return self._scenario

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Vector, Info]:
        super().reset(seed=seed)
        self._scenario = self.task.drawn(self.np_random)
        self._gyroscope = _core.Gyroscopes([core_setup(self._scenario)])
        self._taken = 0
        row = self._gyroscope.rows()[0]
        return row[: self.task.observed], self._info(row)

    def step(self, action: Vector) -> tuple[Vector, float, bool, bool, Info]:
        if self._gyroscope is None:
            raise gymnasium.error.ResetNeeded("call reset before the first step")
        row = self._gyroscope.step(np.asarray(action, dtype=float), self._acted, self._limit)[0]
        self._taken += 1
        x, y = row.item(ERROR), row.item(ERROR + 1)
        if self._share:
            estimate = min(max(float(action[2]), -1.0), 1.0)
            difference = estimate - self._share * row.item(RATE)
            reward = -(difference * difference)  # the last bit of a power may depend on the processor
        else:
            reward = -(x * x + y * y)
        lost = not (abs(x) <= self._error_limit and abs(y) <= self._error_limit)
        observation = row[: self._observed]
        if lost:
            reward = self.task.worst * (self._steps - self._taken + 1)
            observation = observation.clip(-MAX_OBSERVATION, MAX_OBSERVATION)
        return observation, reward, lost, self._taken >= self._steps, self._info(row)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_gyroscope": _saved(self._gyroscope)}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        vars(self).update(saved)
        self._gyroscope = _resumed([self._scenario], saved["_gyroscope"])

    def _info(self, row: Vector) -> Info:
        return {"error": row[ERROR:RATE], "angular_rate": self._rate_unit * row.item(RATE)}


class Tracking(_Environment):
    """`fracgyro/Tracking-v0`: find the force that makes the gyroscope follow its reference.

    An action is the force x, y, as fractions of controller.force_limit, from -1 to 1. An observation has,
    nondimensional, x and y each of the measured position (q0), reference (q0), its rate (q0 omega0), its acceleration
    (q0 omega0^2) and, unless device.sensing is "position", the measured velocity (q0 omega0). The reward of a step is
    minus the squared error at its end, e_x^2 + e_y^2. An episode is truncated after run.duration, or after
    `max_episode_steps` if that is less. It terminates if an error exceeds `error_limit`, in q0; the reward then
    includes errors of that size for all remaining steps. `info` has the simulated "error" and "angular_rate" (rad/s).

    Each reset draws a new disturbance.seed, and rate.seed if the rate is noise. `scenario`: a Scenario, the name of a
    shipped one, the path of a TOML file, TOML text or a dict of tables; by default `hardware` for 10 units of time. An
    environment can be copied and pickled; the copy continues independently from the same state. Raises TypeError,
    ValueError or ScenarioError for an invalid argument; a step raises ValueError for actions that are not finite.

    >>> import gymnasium
    >>> from fracgyro.interop.gymnasium import Tracking
    >>> env = gymnasium.make("fracgyro/Tracking-v0")
    >>> observation, info = env.reset(seed=1)
    >>> observation[:2].tolist()
    [0.5, 0.5]
    """

    def __init__(
        self,
        scenario: ScenarioLike | None = None,
        *,
        error_limit: float = 10.0,
        max_episode_steps: int | None = None,
    ) -> None:
        super().__init__(tracking(scenario, error_limit, max_episode_steps))


class RateSensing(_Environment):
    """`fracgyro/RateSensing-v0`: estimate the angular rate while controlling the force.

    Like `Tracking`, but each reset draws a constant angular rate between minus and plus `rate_range`, in rad/s, instead
    of plant.angular_rate; [rate] may vary it. An action has a third number, the rate estimate, as a fraction of
    `rate_range`, from -1 to 1. The reward of a step is minus the squared error of the estimate, in units of
    `rate_range`. `rate_range`: by default twice plant.angular_rate.

    >>> from fracgyro.interop.gymnasium import RateSensing
    >>> env = RateSensing()
    >>> observation, info = env.reset(seed=1)
    >>> abs(info["angular_rate"]) <= env.rate_range
    True
    """

    def __init__(
        self,
        scenario: ScenarioLike | None = None,
        *,
        error_limit: float = 10.0,
        rate_range: float | None = None,
        max_episode_steps: int | None = None,
    ) -> None:
        super().__init__(rate_sensing(scenario, error_limit, rate_range, max_episode_steps))


class _Environments(_Tasked, VectorEnv[Vector, Vector, NDArray[Any]]):
    def __init__(self, task: Task, num_envs: int) -> None:
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise ValueError(f"num_envs is {short(num_envs)}: it must be an integer of at least 1")
        self.task = task
        self.metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = _spaces(task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._scenarios = [task.scenario] * num_envs
        self._taken = np.zeros(num_envs, dtype=int)
        self._over = np.zeros(num_envs, dtype=bool)
        self._gyroscopes: _core.Gyroscopes | None = None

    @property
    def scenarios(self) -> list[Scenario]:
        """The scenarios of the current episodes."""
        return list(self._scenarios)

    def reset(self, *, seed: int | list[int | None] | None = None, options: Info | None = None) -> tuple[Vector, Info]:
        each = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed or [None] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(f"seed has {len(each)} seeds: it must have one for each of {self.num_envs} environments")
        for i, one in enumerate(each):
            if one is not None:
                self._generators[i] = seeding.np_random(one)[0]
        self._scenarios = [self.task.drawn(generator) for generator in self._generators]
        self._gyroscopes = _core.Gyroscopes([core_setup(scenario) for scenario in self._scenarios])
        self._taken[:] = 0
        self._over[:] = False
        rows = self._gyroscopes.rows()
        return rows[:, : self.task.observed], self._infos(rows)

    def step(self, actions: Vector) -> tuple[Vector, Vector, NDArray[np.bool_], NDArray[np.bool_], Info]:
        if self._gyroscopes is None:
            raise gymnasium.error.ResetNeeded("call reset before the first step")
        task, before, actions = self.task, self._over, np.asarray(actions, dtype=float)
        rows = self._gyroscopes.step(actions, task.acted, task.force_limit)
        self._taken += 1
        errors = rows[:, ERROR:RATE]
        if task.rate_range is None:
            rewards = -(errors * errors).sum(axis=1)
        else:
            estimates = actions.reshape(self.num_envs, -1)[:, 2].clip(-1.0, 1.0)
            rewards = -((estimates - task.rate_unit / task.rate_range * rows[:, RATE]) ** 2)
        within = np.abs(errors) <= task.error_limit
        lost = ~(within[:, 0] & within[:, 1])
        steps = task.steps
        if lost.any():
            rewards[lost] = task.worst * (steps - self._taken[lost] + 1)
            rows[lost, :ERROR] = rows[lost, :ERROR].clip(-MAX_OBSERVATION, MAX_OBSERVATION)
        ended = self._taken >= steps
        if before.any():
            self._begin(np.flatnonzero(before), rows)
            rewards[before], lost[before], ended[before] = 0.0, False, False
        self._over = lost | ended
        return rows[:, : task.observed], rewards, lost, ended, self._infos(rows)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_gyroscopes": _saved(self._gyroscopes)}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        vars(self).update(saved)
        self._gyroscopes = _resumed(self._scenarios, saved["_gyroscopes"])

    def _begin(self, places: NDArray[np.intp], rows: Vector) -> None:
        """Starts new episodes in place of finished ones; their rows have the initial state."""
        assert self._gyroscopes is not None
        for i in places.tolist():
            self._scenarios[i] = self.task.drawn(self._generators[i])
            self._gyroscopes.restart(i, core_setup(self._scenarios[i]))
        self._taken[places] = 0
        rows[places] = self._gyroscopes.rows()[places]

    def _infos(self, rows: Vector) -> Info:
        there = np.ones(self.num_envs, dtype=bool)
        found = {"error": rows[:, ERROR:RATE], "angular_rate": self.task.rate_unit * rows[:, RATE]}
        return found | {f"_{name}": there for name in found}


class TrackingVector(_Environments):
    """Vector environment of `Tracking`: many gyroscopes stepped by one call, with the same numbers.

    A finished episode restarts in the next step (gymnasium's NEXT_STEP). A single seed applies to the first environment
    and increases by one for each of the others. The gyroscopes are stepped in C++, one after another, on one processor.

    >>> import gymnasium
    >>> from fracgyro.interop.gymnasium import TrackingVector
    >>> envs = gymnasium.make_vec("fracgyro/Tracking-v0", num_envs=3, vectorization_mode="vector_entry_point")
    >>> observations, infos = envs.reset(seed=1)
    >>> observations.shape
    (3, 10)
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: ScenarioLike | None = None,
        *,
        error_limit: float = 10.0,
        max_episode_steps: int | None = None,
    ) -> None:
        super().__init__(tracking(scenario, error_limit, max_episode_steps), num_envs)


class RateSensingVector(_Environments):
    """Vector environment of `RateSensing`; otherwise like `TrackingVector`.

    >>> from fracgyro.interop.gymnasium import RateSensingVector
    >>> envs = RateSensingVector(num_envs=3)
    >>> observations, infos = envs.reset(seed=1)
    >>> infos["angular_rate"].shape
    (3,)
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: ScenarioLike | None = None,
        *,
        error_limit: float = 10.0,
        rate_range: float | None = None,
        max_episode_steps: int | None = None,
    ) -> None:
        super().__init__(rate_sensing(scenario, error_limit, rate_range, max_episode_steps), num_envs)


for _name in ("Tracking", "RateSensing"):
    gymnasium.register(
        f"fracgyro/{_name}-v0", entry_point=f"{__name__}:{_name}", vector_entry_point=f"{__name__}:{_name}Vector"
    )
