"""Users' controllers in the compiled loop: Python callables and C functions."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import repeat
from types import FunctionType
from typing import Any, TypeAlias, TypeVar

import numpy as np

from .. import _core
from ..arguments import short
from ..scenario import Scenario
from ..scenario.kinds import DEVICE_CHANNELS, KINDS, LOOP_CHANNELS, VOLTS_CHANNELS, Channel, columns, reports
from .native import Law

Result = TypeVar("Result")
ControllerLike: TypeAlias = Callable[[Any], Any] | Law


class ControllerError(ValueError):
    """A user's controller raised an exception, which is the cause of this one.

    >>> try:
    ...     fg.simulate(fg.Scenario.paper(), controller=lambda sample: 1 / 0)
    ... except fg.ControllerError as error:
    ...     print(type(error.__cause__).__name__)
    ZeroDivisionError
    """


def units(scenario: Scenario) -> _core.Units:
    """Scales of a run: divide by them to make its numbers nondimensional."""
    found = _core.Units()
    if scenario.run.units == "SI":
        scales = scenario.plant.scales
        for name in ("time", "length", "velocity", "acceleration", "force", "rate"):
            setattr(found, name, getattr(scales, name))
    return found


def controller_name(controller: ControllerLike) -> str:
    """Name of the function or class."""
    function = controller._function if isinstance(controller, Law) else controller
    return str(getattr(function, "__qualname__", getattr(function, "__name__", type(controller).__name__)))


def controller_words(controller: ControllerLike | None) -> str:
    """Name and parameters of a controller, for messages; empty without one."""
    if controller is None:
        return ""
    values = controller.parameters if isinstance(controller, Law) else {}
    listed = ", ".join(f"{name} = {value:g}" for name, value in values.items())
    return controller_name(controller) + (f" with {listed}" if listed else "")


def in_own_units(scenario: Scenario, controller: ControllerLike | None) -> Scenario:
    """The scenario in nondimensional units; unchanged with a user's controller, which expects the run's units."""
    return scenario.replace({"run.units": "nondimensional"}) if controller is None else scenario


class UserController:
    """A user's controller: its report channels and its runs."""

    def __init__(self, controller: object) -> None:
        if isinstance(controller, type) or not (callable(controller) or isinstance(controller, Law)):
            what = "a class, not an instance" if isinstance(controller, type) else short(controller)
            raise TypeError(
                f"controller is {what}: it must be a native.Law, or a callable that takes a Sample and returns the "
                "force (ux, uy)"
            )
        self.controller: Any = controller
        self._first_cells: list[Any] | None = None  # closure variables of a function before its first run
        self._uncopied = ""  # why the callable cannot be copied, once a run has used the original
        self.is_native = isinstance(controller, Law)
        self.reports: tuple[Channel, ...] | None = None  # for a callable known after its first call
        if isinstance(controller, Law):
            self.reports = _channels([(name, 1) for name in controller.reports])

    @property
    def name(self) -> str:
        """Name of the function or class."""
        return getattr(self.controller, "__name__", type(self.controller).__name__)

    def channels(self, device: tuple[Channel, ...]) -> tuple[Channel, ...]:
        """Channels recorded in its runs on a device that adds these."""
        return (*LOOP_CHANNELS, *(self.reports or ()), *device)

    def start(self, scenario: Scenario, law: Law | None = None, *, itself: bool = False) -> _core.UserController:
        """The core's controller for one run; `law`: the law of this run, if runs have different ones.

        A callable without `reset` is copied, so that each run starts from its original state; with `itself`, for a
        single run, the callable is used directly.
        """
        if self.is_native:
            return (law or self.controller)._core_law()
        if reset := getattr(self.controller, "reset", None):
            try:
                reset(scenario)
            except Exception as error:
                raise ControllerError(f"reset(scenario) of the controller raised {described(error)}") from error
        return _core.PythonController(self.controller if reset or itself else self._copied())

    def _copied(self) -> Any:
        """A copy of the callable, for a run. Raises ValueError if an earlier run may have changed it."""
        if isinstance(self.controller, FunctionType):  # a copy of a function is the function
            cells = [cell.cell_contents for cell in self.controller.__closure__ or ()]
            if self._first_cells is None:
                self._first_cells = cells
            elif any(now is not then for now, then in zip(cells, self._first_cells, strict=True)):
                raise self._stateful("it is a function that changes variables of its enclosing scope")
            return self.controller
        try:
            return copy.deepcopy(self.controller)
        except Exception as error:
            if self._uncopied:
                raise self._stateful(f"it cannot be copied ({self._uncopied})") from None
            self._uncopied = described(error)
            return self.controller

    def _stateful(self, why: str) -> ValueError:
        return ValueError(
            f"controller is {self.name}: it can run only once, as {why} and would start a run with the state of the "
            "previous one; give it a method reset(scenario), which is called before each run"
        )

    @contextmanager
    def running(self, law: _core.UserController | None) -> Iterator[None]:
        """Context of a run. Raises ControllerError if the callable raises an exception, ValueError for its results."""
        try:
            yield
        except Exception as error:
            if not isinstance(law, _core.PythonController) or law.failed_at is None:
                raise_own(error)
                raise
            raise ControllerError(f"the controller raised {described(error)} at t = {law.failed_at:.9g}") from error
        if isinstance(law, _core.PythonController) and self.reports is None:
            self.reports = _channels(law.names)

    def record(
        self,
        scenarios: Sequence[Scenario],
        setups: Sequence[_core.DeviceSetup],
        every: int,
        device: tuple[Channel, ...],
        threads: int,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rows (run, sample, column), NaN after a divergence, and the number of samples of each run."""
        more = columns(device)
        found = self._each(
            scenarios, setups, lambda some, users, of: _core.record_runs(some, every, threads, more, users, of)
        )
        if any(rows.shape[2] != found[0][0].shape[2] for rows, _ in found):
            raise ValueError("report() of the controller returned other names than in the previous run")
        rows, lasted = zip(*found, strict=True)
        return np.concatenate(rows) if len(rows) > 1 else rows[0], np.concatenate(lasted)

    def rate_means(
        self,
        scenarios: Sequence[Scenario],
        setups: Sequence[_core.DeviceSetup],
        every: int,
        block: int,
        threads: int,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Like `_core.rate_means`."""
        found = self._each(
            scenarios,
            setups,
            lambda some, users, of: _core.rate_means(some, every, block, threads, True, users, of),
        )
        means, lasted = zip(*found, strict=True)
        return np.concatenate(means), np.concatenate(lasted)

    def measure(
        self,
        scenarios: Sequence[Scenario],
        setups: Sequence[_core.DeviceSetup],
        params: _core.MetricsParams,
        threads: int,
        laws: Sequence[Law] | None = None,
    ) -> np.ndarray:
        """Metrics of each run, (run, metric); `laws`: the laws of the runs, if they have different ones."""
        return np.concatenate(
            self._each(
                scenarios,
                setups,
                lambda some, users, of: _core.measure_device_runs(some, params, threads, users, of),
                laws,
            )
        )

    def _each(
        self,
        scenarios: Sequence[Scenario],
        setups: Sequence[_core.DeviceSetup],
        task: Callable[[Any, Any, Any], Result],
        laws: Sequence[Law] | None = None,
    ) -> list[Result]:
        """Results of `task` for every run: C functions in parallel, callables one after another."""
        if self.is_native:
            started = [self.start(s, law) for s, law in zip(scenarios, laws or repeat(None), strict=False)]
            return [task(setups, started, [units(s) for s in scenarios])]
        found = []
        for scenario, setup in zip(scenarios, setups, strict=True):
            if hasattr(self.controller, "reset") and scenario.disturbance.seed != setup.seed:
                scenario = scenario.replace({"disturbance.seed": setup.seed})
            law = self.start(scenario)
            with self.running(law):
                found.append(task([setup], [law], [units(scenario)]))
        return found


def _channels(names: Sequence[tuple[str, int]]) -> tuple[Channel, ...]:
    """Channels of these reports. Raises ValueError for an invalid name."""
    known = {channel.name: channel for kind in KINDS for of in reports(kind) for channel in of}
    recorded = (*LOOP_CHANNELS, *DEVICE_CHANNELS, *VOLTS_CHANNELS)
    taken = {channel.name for channel in recorded} | {"time", "axis", "run", "diverged_at"}
    found = []
    for name, width in names:
        own = known.get(name)
        if not name.isprintable() or name.strip() != name or name in ("", ".") or "/" in name:
            raise ValueError(
                f"the controller reports {short(name)}: a name must be printable, without / or surrounding spaces"
            )
        if name in taken or (own is not None and own.width != width):
            raise ValueError(
                f"the controller reports {name}: it must not be the name of another channel or a dimension"
            )
        meaning = own.meaning if own else f"{name}, reported by the controller"
        found.append(Channel(name, width, own.units if own else ("1",), meaning, "axis" if width == 2 else None))
    return tuple(found)


def raise_own(error: Exception) -> None:
    """Raises a refusal by the core again, here: the core's sentence about the callable is for the user."""
    if type(error) is ValueError:
        raise ValueError(str(error)) from None


def described(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
