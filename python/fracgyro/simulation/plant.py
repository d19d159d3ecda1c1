"""The gyroscope by itself and the closed loop in parts: for a controller of your own, live tuning, or hardware."""

from __future__ import annotations

import json
import operator
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from threading import Lock
from typing import Any, cast

import numpy as np
import xarray as xr

from .. import _core
from ..arguments import pair, short
from ..scenario import Scenario, ScenarioError, check_scenario
from ..scenario.kinds import DEVICE_CHANNELS, LOOP_CHANNELS, Channel, numbers, reported
from ..scenario.sentences import paths
from ..scenario.to_core import core_numbers, core_setup, is_ideal
from .dataset import dataset, time_scale
from .outside import ControllerLike, Outside, units
from .simulate import MAX_RECORD, DivergedError

CHECKSUM = struct.Struct("<I")


class Plant:
    """The gyroscope of a scenario, with its disturbance, its moving rate and its device, one step at a time.

    A step is exact for a force that is held over it. Times, forces, positions and velocities are in the units that
    `scenario.run.units` names. The noise is that of `simulate`: under the same forces the motion is the same, bit for
    bit. It can be copied and pickled: the copy goes on by itself from where this one is. Raises TypeError where
    `scenario` is not one.

    >>> plant = fg.Plant(fg.Scenario.paper())
    >>> plant.step((0.0, 0.0)).time
    0.001
    """

    def __init__(self, scenario: Scenario) -> None:
        check_scenario(scenario)
        self.scenario = scenario
        self._core = _core.Gyroscope(core_setup(scenario), units(scenario))

    @property
    def motion(self) -> _core.Motion:
        """What is measured now: `.time`, `.position` (x, y) and `.velocity` (x, y), NaN where no velocity is sensed.

        >>> fg.Plant(fg.Scenario.paper()).motion.position
        (0.5, 0.5)
        """
        return self._core.motion

    def step(self, force: Sequence[float]) -> _core.Motion:
        """The motion that is measured after `run.step` under this force [x, y] that a controller asks for.

        device.delay and the actuator come in between. Raises TypeError where the force holds no numbers, ValueError for
        others than two finite ones, and where the motion has diverged.

        >>> plant = fg.Plant(fg.Scenario.paper())
        >>> plant.step((0.0, 0.0)) == plant.motion
        True
        """
        # None: something is not a plain finite number, though it may be one of NumPy's.
        motion: _core.Motion | None = self._core.step(force)
        return motion or cast(_core.Motion, self._core.step(pair("force", force)))

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed_plant, (self.scenario, bytes(self._core.state))


def _resumed_plant(scenario: Scenario, state: bytes) -> Plant:
    plant = Plant(scenario)
    plant._core.state = state
    return plant


class Loop:
    """The closed loop of a scenario, run in parts and tuned while it runs.

    `controller`: as in `simulate`, but a callable is called itself, and not a copy. The loop may go on beyond
    run.duration, the longest time that a fractional memory is accurate for. Samples are recorded at every step,
    whatever run.record_every is. Without a callable a loop can be copied, without a controller pickled: the copy goes
    on by itself from where this one is. Raises TypeError where `scenario` is not one, and what `simulate` raises of a
    controller.

    >>> loop = fg.Loop(fg.Scenario.paper())
    >>> loop.run(1000).sizes["time"], loop.time
    (1000, 1.0)
    """

    def __init__(self, scenario: Scenario, controller: ControllerLike | None = None) -> None:
        check_scenario(scenario)
        self.scenario = scenario  # as it is now
        self._first = scenario
        self._outside = None if controller is None else Outside(controller)
        self._device = not is_ideal(scenario)
        setup = core_setup(scenario)
        self._law: _core.UserController | None = None
        self._lock = Lock()
        if self._outside:
            self._law = self._outside.start(scenario, itself=True)
            self._core = _core.Loop(setup, self._law, units(scenario))
        else:
            self._reported = reported(setup)
            self._core = _core.Loop(setup)

    @property
    def time(self) -> float:
        """Of the coming sample, in the unit of the run.

        >>> fg.Loop(fg.Scenario.paper()).time
        0.0
        """
        return float(self._core.steps * self.scenario.run.step * time_scale(self.scenario))

    def run(self, samples: int) -> xr.Dataset:
        """The coming samples, as `simulate` gives them.

        Without changes they are those of `simulate`, bit for bit. Raises ValueError where `samples` is less than 1 or
        the record too large, DivergedError where the motion diverges, and what `simulate` raises of a controller.

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
        with self._alone():
            first = self._core.steps
            rows = self._rows(count)
            found = dataset(rows, [self.scenario], self._channels(), self._outside, first=first, every=1)
            if len(rows) < count:
                raise DivergedError(self.scenario, self._core.steps * self.scenario.run.step, found)
            return found

    def step(self) -> dict[str, Any]:
        """The coming sample: the variables of `run`, each a number or an array, by name. Raises what `run` does.

        >>> fg.Loop(fg.Scenario.paper()).step()["position"].tolist()
        [0.5, 0.5]
        """
        found = self.run(1).isel(time=0)
        return {"time": float(found["time"]), **{str(name): values.values[()] for name, values in found.items()}}

    def set(self, changes: Mapping[str, Any]) -> None:
        """Other values of the scenario's fields from the coming sample on.

        What the controller has learnt stays, and so do its first estimates. Raises ScenarioError where a value is not
        allowed, or a field cannot be set: one that acts only at the start, or that another controller would have.

        >>> loop = fg.Loop(fg.Scenario.paper())
        >>> loop.set({"plant.angular_rate": 50.0})
        >>> loop.scenario.plant.angular_rate
        50.0
        """
        of_kind = numbers(self.scenario.controller.kind)
        settable = {number.path for number in of_kind if number.settable != "at_start" and number.table != "run"}
        for path in changes:
            if path not in settable and path in paths(Scenario):
                raise ScenarioError(f"{path} cannot be set while the loop runs: it acts only at the start")
        changed = self.scenario.replace(changes)
        with self._alone():
            if not self._core.set(self._setup(changed)):
                raise ScenarioError(
                    f"{', '.join(changes)} cannot be set while the loop runs: the controller would be another one, or "
                    "its memory"
                )
            self.scenario = changed

    @property
    def state(self) -> bytes:
        """Everything that changes while running, what was set included.

        Assign it to a loop of the same scenario and controller to resume, bit for bit. Raises ValueError where the
        controller is a Python callable, whose memory is its own; assigning raises TypeError or ValueError for what was
        not saved so, or was damaged since.

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
            raise TypeError(f"state is {short(saved)}: it must be bytes, as they were saved")
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
        of = ""
        if self._outside:  # not the address, which another process has elsewhere
            law = self._outside.controller
            of = f" {law.state_size} {law.parameters} {law.reports}"
        return f"fracgyro {version('fracgyro')} loop 2 {self._first.content_hash()}{of}\n".encode()

    def _check_restorable(self) -> None:
        if self._outside and not self._outside.is_native:
            raise ValueError(
                "a loop with a Python callable has no state, and cannot be copied: what a callable remembers is its own"
            )

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Raises ValueError while the loop runs: for its own controller, or another thread."""
        if not self._lock.acquire(blocking=False):
            raise ValueError("the loop is running: neither its controller nor another thread can run or change it")
        try:
            yield
        finally:
            self._lock.release()

    def _setup(self, scenario: Scenario) -> _core.DeviceSetup:
        """Of the scenario, but for the numbers that act only at the start."""
        first = core_numbers(self._first)
        of_kind = numbers(scenario.controller.kind)
        kept = {number.name: first[number.name] for number in of_kind if number.settable == "at_start"}
        return core_setup(scenario, kept)

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed_loop, (self._first, self._outside and self._outside.controller, self.state)

    def _rows(self, count: int) -> np.ndarray:
        if not self._outside:
            rows = self._core.run(count, self._device)
        else:
            with self._outside.running(self._law):
                rows = self._core.run(count, self._device)
        width = sum(channel.width for channel in self._channels())
        return np.asarray(rows).reshape(-1, width)

    def _channels(self) -> tuple[Channel, ...]:
        if self._outside:
            return self._outside.channels(self._device)
        return (*LOOP_CHANNELS, *self._reported, *(DEVICE_CHANNELS if self._device else ()))


def _resumed_loop(scenario: Scenario, controller: ControllerLike | None, state: bytes) -> Loop:
    loop = Loop(scenario, controller)
    loop.state = state
    return loop
