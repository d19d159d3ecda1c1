"""Users' plants in the compiled loop: Python callables and C functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from .. import _core
from ..arguments import number, short
from ..scenario import Scenario, ScenarioError
from ..scenario.plants import conflict
from ..scenario.volts_core import has_volts
from . import native
from .user_controller import described, raise_own, units

PlantLike = Callable[..., Any] | native.Plant
MIN_STATES, MAX_STATES = 2, 8


class PlantError(ValueError):
    """A user's plant raised an exception, which is the cause of this one.

    >>> try:
    ...     fg.simulate(fg.Scenario.paper(), plant=lambda time, state, force: 1 / 0)
    ... except fg.PlantError as error:
    ...     print(type(error.__cause__).__name__)
    ZeroDivisionError
    """


class UserPlant:
    """A user's plant in place of the gyroscope of scenarios."""

    def __init__(self, plant: object) -> None:
        if isinstance(plant, type) or not (callable(plant) or isinstance(plant, native.Plant)):
            what = "a class, not an instance" if isinstance(plant, type) else short(plant)
            raise TypeError(
                f"plant is {what}: it must be a native.Plant, or a callable that takes the time, the state and the "
                "force (ux, uy) and returns the derivative of the state"
            )
        self.plant: Any = plant
        self.is_native = isinstance(plant, native.Plant)
        self.takes_rate = bool(getattr(plant, "takes_rate", False))
        self._running: list[Any] = []
        if not self.is_native:
            self._initial = _initial(plant)
            self._motion = getattr(plant, "motion", None)
            if self._motion is None and len(self._initial) not in (0, 4):
                raise ValueError(
                    f"initial_state of the plant has {len(self._initial)} numbers: it must have the 4 states x, y, vx, "
                    "vy, or the plant a method motion(state), which returns them"
                )

    @property
    def key(self) -> str:
        """A key that distinguishes it from other plants, the same in every process."""
        if self.is_native:
            return f"{self.plant.states} {self.plant.parameters} {self.plant.motion} {self.plant.initial_state}"
        return f"{self.name} {self._initial}"

    @property
    def name(self) -> str:
        """Name of the function or class."""
        function = self.plant._function if self.is_native else self.plant
        return str(getattr(function, "__name__", type(self.plant).__name__))

    def put_into(self, setup: _core.DeviceSetup, scenario: Scenario) -> None:
        """Puts the plant into a run. Raises ScenarioError if the scenario's rate or device needs the gyroscope."""
        if found := conflict(scenario.plant, scenario.rate, scenario.device, self.takes_rate, "a user's plant"):
            raise ScenarioError(found)
        if has_volts(scenario):
            raise ScenarioError("electrodes or electronics are given: a user's plant, which takes forces, has none")
        core = self._core()
        setup.set_user_plant(core, units(scenario))
        self._running.append(core)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Context of runs with this plant. Raises PlantError if the callable raises an exception, ValueError for its
        results.
        """
        try:
            yield
        except Exception as error:
            failed = [core.failed_at for core in self._running if isinstance(core, _core.PythonPlant)]
            if (time := next((time for time in failed if time is not None), None)) is None:
                raise_own(error)
                raise
            raise PlantError(f"the plant raised {described(error)} at t = {time:.9g}") from error

    def _core(self) -> _core.UserPlant:
        if self.is_native:
            made: _core.UserPlant = self.plant._core_plant()
            return made
        count = len(self._initial) or 4
        return _core.PythonPlant(self.plant, self._motion, count, self._initial, self.takes_rate)


def put_into(plant: UserPlant | None, setups: Sequence[_core.DeviceSetup], scenarios: Sequence[Scenario]) -> None:
    """Puts a plant, if there is one, into the runs of these scenarios, which come next."""
    if plant:
        plant._running.clear()
        for setup, scenario in zip(setups, scenarios, strict=True):
            plant.put_into(setup, scenario)


@contextmanager
def running(plant: UserPlant | None) -> Iterator[None]:
    """Context of runs with a user's plant, or without one."""
    if plant is None:
        yield
        return
    with plant.running():
        yield


def _initial(plant: object) -> list[float]:
    """The initial state; empty if the plant has none, which means that the run's initial motion is its state."""
    given = getattr(plant, "initial_state", None)
    if given is None:
        return []
    values = given.tolist() if isinstance(given, np.ndarray) else given
    if not isinstance(values, Sequence) or isinstance(values, str) or not MIN_STATES <= len(values) <= MAX_STATES:
        raise ValueError(
            f"initial_state of the plant is {short(given)}: it must have {MIN_STATES} to {MAX_STATES} numbers"
        )
    return [number("initial_state of the plant", value) for value in values]
