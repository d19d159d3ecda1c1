"""The gyroscope without a controller, and the closed loop in parts: for your controller, live tuning, or hardware."""

from __future__ import annotations

import json
import operator
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from threading import Lock
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .. import _core
from ..arguments import pair, short
from ..scenario import Scenario, ScenarioError, check_scenario
from ..scenario.device_core import device_channels
from ..scenario.kinds import LOOP_CHANNELS, Channel, columns, numbers, plant_numbers, reported_channels
from ..scenario.messages import paths
from ..scenario.table import format_value
from ..scenario.to_core import core_numbers, core_setup
from ..scenario.volts_core import at_bias
from .dataset import dataset, time_scale
from .simulate import MAX_RECORD, DivergedError
from .user_controller import ControllerLike, UserController
from .user_controller import units as scales_of
from .user_plant import PlantLike, UserPlant, put_into, running

CHECKSUM = struct.Struct("<I")


class Plant:
    """The gyroscope of a scenario, with its disturbance, dynamic rate and device, one step at a time.

    A step is exact for a zero-order-hold force. Times, forces, positions and velocities are in the units of
    `scenario.run.units`. Under the same forces the motion, noise included, equals that of `simulate` bit for bit. A
    plant can be copied and pickled; the copy continues independently from the same state. `plant`: replaces the
    gyroscope, as in `simulate`; its step is a Runge-Kutta step.

    `units`: "V" takes the voltages of the drivers of [[electrodes]] for forces and gives the outputs of the charge
    amplifiers, V, for positions; times are in s. The gains are those that the device is designed to have.

    Raises TypeError if `scenario` is not a Scenario, ValueError for other `units`, ScenarioError for a scenario without
    drivers or charge amplifiers in `units` "V", and the errors that `simulate` raises for a plant.

    >>> plant = fg.Plant(fg.Scenario.paper())
    >>> plant.step((0.0, 0.0)).time
    0.001
    """

    def __init__(self, scenario: Scenario, plant: PlantLike | None = None, *, units: str | None = None) -> None:
        check_scenario(scenario)
        if units not in (None, "V"):
            raise ValueError(f'units is {short(units)}: it must be "V" or None, which are the units of run.units')
        self.scenario = scenario
        self._volts = _InVolts.of(scenario) if units else None
        self._own = None if plant is None else UserPlant(plant)
        setup = core_setup(scenario)
        put_into(self._own, [setup], [scenario])
        self._core = _core.Gyroscope(setup, scales_of(scenario))

    @property
    def motion(self) -> _core.Motion:
        """Current measurement: `.time`, `.position` (x, y) and `.velocity` (x, y), NaN if no velocity is sensed.

        >>> fg.Plant(fg.Scenario.paper()).motion.position
        (0.5, 0.5)
        """
        return self._in_units(self._core.motion)

    @property
    def rounded(self) -> tuple[float, float] | None:
        """Force (x, y) to which the converters of the drivers rounded the last command, by their gains as designed.

        In the units of `scenario.run.units`; None without such converters. `Controller.acted` takes it.

        >>> fg.Plant(fg.Scenario.paper()).rounded is None
        True
        """
        return cast(tuple[float, float] | None, self._core.rounded)

    def step(self, force: Sequence[float]) -> _core.Motion:
        """Apply the commanded force, or voltages, [x, y] for `run.step`; returns the motion measured then.

        The plant includes device.delay and the actuator. Raises TypeError for a force that is not numbers, ValueError
        for anything but two finite numbers and after the motion has diverged.

        >>> plant = fg.Plant(fg.Scenario.paper())
        >>> plant.step((0.0, 0.0)) == plant.motion
        True
        """
        if self._own is None:  # `running` takes longer than the step
            return self._stepped(force)
        with running(self._own):
            return self._stepped(force)

    def _stepped(self, force: Sequence[float]) -> _core.Motion:
        if self._volts is not None:
            force = self._volts.forces(pair("voltage", force))
        # None: an argument is not a plain finite number; it may be one of NumPy's.
        motion: _core.Motion | None = self._core.step(force)
        return self._in_units(motion or cast(_core.Motion, self._core.step(pair("force", force))))

    def _in_units(self, motion: _core.Motion) -> _core.Motion:
        return motion if self._volts is None else self._volts.reading(motion)

    def __reduce__(self) -> tuple[Any, ...]:
        own, units = self._own and self._own.plant, "V" if self._volts else None
        return _resumed_plant, (self.scenario, own, bytes(self._core.state), units)


def _resumed_plant(scenario: Scenario, own: PlantLike | None, state: bytes, units: str | None) -> Plant:
    plant = Plant(scenario, own, units=units)
    plant._core.state = state
    return plant


@dataclass(frozen=True)
class _InVolts:
    """Between volts and the units of a run, by the gains as designed."""

    force: NDArray[np.float64]  #: of one volt of each driver: (2, 2)
    output: NDArray[np.float64]  #: V of the amplifiers by one unit of length on each axis: (2, 2)
    time: float  #: s in one unit of time

    @classmethod
    def of(cls, scenario: Scenario) -> _InVolts:
        e, needed = scenario.electronics, 'in units "V"'
        if not scenario.electrodes.of("force"):
            raise ScenarioError(f"electrodes of role force are missing: {needed} a scenario must have them")
        if e.amplifier != "charge":
            raise ScenarioError(f"electronics.amplifier is {format_value(e.amplifier)}: {needed} it must be charge")
        if not e.feedback_capacitance:
            raise ScenarioError(f"electronics.feedback_capacitance is 0.0: {needed} it must be above 0")
        at, si = at_bias(scenario), scenario.run.units == "SI"
        scales = scenario.plant.scales
        force, length, time = (1.0, 1.0, 1.0) if si else (scales.force, scales.length, scales.time)
        gain, charge = (found[[0, 1, 1, 2]].reshape(2, 2) for found in (at.gain, at.charge))
        return cls(gain / force, charge * length / e.feedback_capacitance, time)

    def forces(self, voltages: Sequence[float]) -> list[float]:
        return [float(row @ voltages) for row in self.force]

    def reading(self, motion: _core.Motion) -> _core.Motion:
        x, y = (float(row @ motion.position) for row in self.output)
        sequence = (motion.time * self.time, (x, y), motion.velocity)
        return cast(_core.Motion, cast(Any, _core.Motion)(sequence))  # a struct sequence takes one argument


class Loop:
    """The closed loop of a scenario, which can run in parts and be tuned while it runs.

    `controller`, `plant`: as in `simulate`, but a callable is used directly, not copied. The loop may run longer than
    run.duration, up to which the fractional memory is accurate. Every step is recorded, regardless of run.record_every.
    A loop without a callable can be copied, one without a user's controller also pickled; the copy continues
    independently from the same state. Raises TypeError if `scenario` is not a Scenario, and the errors that `simulate`
    raises for a controller.

    >>> loop = fg.Loop(fg.Scenario.paper())
    >>> loop.run(1000).sizes["time"], loop.time
    (1000, 1.0)
    """

    def __init__(
        self, scenario: Scenario, controller: ControllerLike | None = None, plant: PlantLike | None = None
    ) -> None:
        check_scenario(scenario)
        self.scenario = scenario  # with the changes of `set`
        self._first = scenario
        self._user = None if controller is None else UserController(controller)
        self._own = None if plant is None else UserPlant(plant)
        self._device = device_channels(scenario)
        setup = core_setup(scenario)
        put_into(self._own, [setup], [scenario])
        self._law: _core.UserController | None = None
        self._lock = Lock()
        if self._user:
            self._law = self._user.start(scenario, itself=True)
            self._core = _core.Loop(setup, self._law, scales_of(scenario))
        else:
            self._reported = reported_channels(setup)
            self._core = _core.Loop(setup)

    @property
    def time(self) -> float:
        """Time of the next sample, in the unit of the run.

        >>> fg.Loop(fg.Scenario.paper()).time
        0.0
        """
        return float(self._core.steps * self.scenario.run.step * time_scale(self.scenario))

    def run(self, samples: int) -> xr.Dataset:
        """Runs the next samples; returns them as a Dataset like that of `simulate`.

        Without changes they equal those of `simulate`, bit for bit. Raises ValueError if `samples` is less than 1 or
        the record too large, DivergedError if the motion diverges, and the errors that `simulate` raises for a
        controller.

        >>> scenario = fg.Scenario.paper().replace({"run.duration": 1.0})
        >>> fg.Loop(scenario).run(1001)["position"].equals(fg.simulate(scenario)["position"])
        True
        """
        try:
            count = operator.index(samples)
        except TypeError:
            raise TypeError(f"samples is {short(samples)}: it must be an integer") from None
        if count < 1:
            raise ValueError(f"samples is {count}: it must be at least 1")
        if (size := 8 * count * sum(channel.width for channel in self._channels())) > MAX_RECORD:
            raise ValueError(
                f"samples is {count}: their record of {size / 1e9:.3g} GB may be at most {MAX_RECORD / 1e9:g} GB"
            )
        with self._exclusive():
            first = self._core.steps
            rows = self._rows(count)
            shown = self._channels()
            found = dataset(rows, [self.scenario], shown, self._user, plant=self._own, first=first, every=1)
            if len(rows) < count:
                raise DivergedError(self.scenario, self._core.steps * self.scenario.run.step, found)
            return found

    def step(self) -> dict[str, Any]:
        """Runs one sample; returns the variables of `run` by name, each a number or an array. Raises what `run` raises.

        >>> fg.Loop(fg.Scenario.paper()).step()["position"].tolist()
        [0.5, 0.5]
        """
        found = self.run(1).isel(time=0)
        return {"time": float(found["time"]), **{str(name): values.values[()] for name, values in found.items()}}

    def set(self, changes: Mapping[str, Any]) -> None:
        """Changes fields of the scenario from the next sample on.

        The controller keeps its state and its initial estimates. Raises ScenarioError for an invalid value, and for a
        field that cannot change during a run: it acts only at the start, or requires another controller.

        >>> loop = fg.Loop(fg.Scenario.paper())
        >>> loop.set({"plant.angular_rate": 50.0})
        >>> loop.scenario.plant.angular_rate
        50.0
        """
        of_kind = numbers(self.scenario.controller.kind)
        of_plant = plant_numbers(self.scenario.plant.kind)
        known = [number for number in (*of_kind, *of_plant) if number.settable != "at_start" and number.table != "run"]
        settable = {number.path for number in known}
        for path in changes:
            if path not in settable and path in paths(Scenario):
                raise ScenarioError(f"{path} cannot be set while the loop runs: it acts only at the start")
        changed = self.scenario.replace(changes)
        with self._exclusive():
            if not self._core.set(self._setup(changed)):
                raise ScenarioError(
                    f"{', '.join(changes)} cannot be set while the loop runs: the controller would be another one, or "
                    "its memory"
                )
            self.scenario = changed

    @property
    def state(self) -> bytes:
        """The complete state, including the changes of `set`, as bytes.

        Assign it to a loop of the same scenario and controller to resume, bit for bit. Raises ValueError if the
        controller is a Python callable, whose state is not accessible; assigning raises TypeError or ValueError for a
        state that was not saved in this way, or was damaged.

        >>> one, other = fg.Loop(fg.Scenario.paper()), fg.Loop(fg.Scenario.paper())
        >>> first = one.run(100)
        >>> other.state = one.state
        >>> one.run(10).equals(other.run(10))
        True
        """
        self._check_restorable()
        law = self._law.state if isinstance(self._law, _core.NativeController) else []
        saved_from = {"scenario": self.scenario.to_toml(), "law": np.array(law, dtype="<f8").tobytes().hex()}
        content = json.dumps(saved_from).encode() + b"\n" + bytes(self._core.state)
        return self._key + CHECKSUM.pack(zlib.crc32(content)) + content

    @state.setter
    def state(self, saved: bytes) -> None:
        self._check_restorable()
        if not isinstance(saved, bytes):
            raise TypeError(f"state is {short(saved)}: it must be bytes from `state`")
        key = self._key
        if saved[: len(key)] != key:
            raise ValueError("state was saved by another version, or by a loop of another scenario or controller")
        rest = saved[len(key) :]
        content = rest[CHECKSUM.size :]
        damaged = ValueError("state is damaged: it is not as it was saved")
        if len(rest) < CHECKSUM.size or CHECKSUM.unpack(rest[: CHECKSUM.size])[0] != zlib.crc32(content):
            raise damaged
        head, _, core = content.partition(b"\n")
        try:
            saved_from = json.loads(head)
            scenario = Scenario.from_toml(saved_from["scenario"])
            law = np.frombuffer(bytes.fromhex(saved_from["law"]), dtype="<f8").tolist()
            if not self._core.set(self._setup(scenario)):
                raise damaged
        except (KeyError, TypeError, ValueError):
            raise damaged from None
        self._core.state = core
        if isinstance(self._law, _core.NativeController):
            self._law.state = law
        self.scenario = scenario

    @property
    def _key(self) -> bytes:
        of = self._own.key if self._own else ""
        if self._user:  # without the address, which differs between processes
            law = self._user.controller
            of += f" {law.state_size} {law.parameters} {law.reports}"
        return f"fracgyro {version('fracgyro')} loop 2 {self._first.content_hash()}{of}\n".encode()

    def _check_restorable(self) -> None:
        if self._user and not self._user.is_native:
            raise ValueError(
                "a loop with a Python callable cannot be saved or copied: the state of the callable is not accessible"
            )

    @contextmanager
    def _exclusive(self) -> Iterator[None]:
        """Raises ValueError if the loop is already running, in its controller or in another thread."""
        if not self._lock.acquire(blocking=False):
            raise ValueError("the loop is running: its controller or another thread cannot run or change it")
        try:
            yield
        finally:
            self._lock.release()

    def _setup(self, scenario: Scenario) -> _core.DeviceSetup:
        """The core's setup of the scenario, with the original values of fields that act only at the start."""
        first = core_numbers(self._first)
        of_kind = numbers(scenario.controller.kind)
        kept = {number.name: first[number.name] for number in of_kind if number.settable == "at_start"}
        setup = core_setup(scenario, kept)
        put_into(self._own, [setup], [scenario])
        return setup

    def __reduce__(self) -> tuple[Any, ...]:
        user, own = self._user and self._user.controller, self._own and self._own.plant
        return _resumed_loop, (self._first, user, own, self.state)

    def _rows(self, count: int) -> np.ndarray:
        with running(self._own), self._user.running(self._law) if self._user else nullcontext():
            rows = self._core.run(count, columns(self._device))
        return np.asarray(rows).reshape(-1, columns(self._channels()))

    def _channels(self) -> tuple[Channel, ...]:
        if self._user:
            return self._user.channels(self._device)
        return (*LOOP_CHANNELS, *self._reported, *self._device)


def _resumed_loop(scenario: Scenario, controller: ControllerLike | None, plant: PlantLike | None, state: bytes) -> Loop:
    loop = Loop(scenario, controller, plant)
    loop.state = state
    return loop
