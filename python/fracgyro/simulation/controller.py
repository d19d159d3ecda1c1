"""The controller by itself, one sample at a time: for a loop of your own, or hardware."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..arguments import number, pair, short
from ..scenario import Scenario, check_scenario
from ..scenario.kinds import lasting
from ..scenario.to_core import check_single, core_setup
from .outside import units

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Estimates:
    """What the controller believes, in the units of the run; NaN and False where it does not know.

    >>> estimates = fg.Controller(fg.Scenario.paper()).estimates
    >>> round(estimates.rate, 3), estimates.rate_trusted
    (0.095, False)
    """

    damping: Vector  #: D as xx, xy, yy
    stiffness: Vector  #: K as xx, xy, yy
    rate: float  #: the angular rate
    bound: Vector  #: b0, b1, b2
    rate_deviation: float  #: standard deviation of the rate; of composite and joint adaptation
    rate_trusted: bool  #: whether the motion separates the rate from the other parameters and agrees with the model
    sample_refused: bool  #: whether the last sample was too far from the predicted one to learn from


class Controller:
    """The controller of a scenario: eqs (16), (35), (44), (46), or another `controller.kind`.

    Call `step` once every `scenario.run.step`. Times, positions, velocities and forces are in the units that
    `scenario.run.units` names. `scenario.run.duration` is the longest time the fractional memory is accurate for. With
    `single_precision` it computes in float, as firmware exported so does, to the same bits. It can be copied and
    pickled: the copy goes on by itself from where this one is.

    Raises TypeError where `scenario` is not one, ValueError where single precision cannot hold a coefficient.

    >>> controller = fg.Controller(fg.Scenario.paper())
    >>> force = controller.step(0.0, position=[0.5, 0.5], velocity=[0.0, 0.0])
    >>> force.shape, controller.status
    ((2,), 'ok')
    """

    def __init__(self, scenario: Scenario, *, single_precision: bool = False) -> None:
        check_scenario(scenario)
        self.scenario = scenario
        self._single = single_precision
        scales = scenario.plant.scales
        si = scenario.run.units == "SI"
        self._step = scenario.run.step
        self._units = units(scenario)
        self._observes = scenario.device.sensing == "position"
        if single_precision:
            check_single(scenario)
        setup = core_setup(scenario)
        self._core = _core.Controller(setup, single_precision)
        self._reported = lasting(setup)
        self._scales = [[scales.of(unit) if si else 1.0 for unit in channel.units] for channel in self._reported]

    def step(self, time: float, position: Sequence[float], velocity: Sequence[float] | None = None) -> Vector:
        """The force [x, y] to hold until the next step, from position and velocity [x, y] measured at `time`.

        Whatever is measured, the force is finite and within the limit; `status` says whether it was believed. NaN is a
        sample that is missing. Until the first that is believed, time does not start: `time` says what the next step
        is. With device.sensing = "position" the velocity is observed and what is given for it not looked at.

        Raises TypeError for an argument that is not a number, ValueError for a time that is not that of the next step,
        or not finite.

        >>> controller = fg.Controller(fg.Scenario.paper())
        >>> for i in range(3):
        ...     force = controller.step(1e-3 * i, (0.5, 0.5), (0.0, 0.0))
        """
        if self._observes:
            velocity = None
        elif velocity is None:
            return self._checked(time, position, velocity)
        # None: something is not a plain finite number, though it may be one of NumPy's, or a sample is missing.
        force: Vector | None = self._core.checked_step(self._step, self._units, time, position, velocity)
        return self._checked(time, position, velocity) if force is None else force

    def _checked(self, time: object, position: object, velocity: object) -> Vector:
        """As `step`, whatever the arguments are."""
        plain = number("time", time)
        self._check_time(time, plain)
        q = pair("position", position, finite=False)
        if velocity is None and not self._observes:
            raise ValueError('velocity is missing: it must be given unless device.sensing is "position"')
        v = None if velocity is None else pair("velocity", velocity, finite=False)
        if not all(map(math.isfinite, (*q, *(v or ())))):
            u = self._units
            held = self._core.step([each / u.length for each in q], [each / u.velocity for each in v or (0.0, 0.0)])
            return np.multiply(held, u.force)
        force: Vector | None = self._core.checked_step(self._step, self._units, plain, q, v)
        if force is None:  # another thread has taken a step since
            self._check_time(time, plain)
            raise ValueError(f"time is {time}: another thread steps this controller, and each needs one of its own")
        return force

    def _check_time(self, given: object, time: float) -> None:
        """Raises ValueError unless it is that of the next step."""
        expected = self._core.steps * self._step
        if not abs(time / self._units.time - expected) < 0.5 * self._step:
            why = "steps must be taken one after another" if expected else "time starts with a sample that is believed"
            raise ValueError(f"time is {given}: the next step is at {expected * self._units.time:.9g}, and {why}")

    @property
    def time(self) -> float:
        """Of the coming step, in the unit of the run.

        >>> controller = fg.Controller(fg.Scenario.paper())
        >>> force = controller.step(controller.time, (0.5, 0.5), (0.0, 0.0))
        >>> controller.time
        0.001
        """
        return float(self._core.steps * self._step * self._units.time)

    @property
    def status(self) -> str:
        """What was thought of the last sample: ok, or saturated, the force being at its limit.

        Not believed: not_finite, out_of_range, implausible, the last force being held; lost, the force being that of
        the reference until samples agree again; restarted, nothing being remembered.

        >>> fg.Controller(fg.Scenario.paper()).status
        'ok'
        """
        return str(self._core.status.name)

    @property
    def estimates(self) -> Estimates:
        """The estimates as they stand after the last step; NaN where the controller has none.

        >>> fg.Controller(fg.Scenario.paper()).estimates.stiffness.shape
        (3,)
        """
        found = self.report
        nothing = np.full(3, math.nan)
        return Estimates(
            damping=found.get("damping_estimate", nothing),
            stiffness=found.get("stiffness_estimate", nothing),
            rate=float(found.get("rate_estimate", math.nan)),
            bound=found.get("bound_estimate", nothing),
            rate_deviation=float(found.get("rate_deviation", math.nan)),
            rate_trusted=bool(found.get("rate_trusted", False)),
            sample_refused=bool(found.get("sample_refused", False)),
        )

    @property
    def report(self) -> dict[str, Any]:
        """What the controller reports besides the force, by channel, as it stands after the last step.

        What is known only within a step, as the sliding surface, is none of them.

        >>> "rate_estimate" in fg.Controller(fg.Scenario.paper()).report
        True
        """
        numbers, found, column = np.asarray(self._core.report), {}, 0
        for channel, scales in zip(self._reported, self._scales, strict=True):
            values = numbers[column : column + channel.width] * (scales if len(scales) > 1 else scales[0])
            found[channel.name] = values if channel.dimension else values[0]
            column += channel.width
        return found

    @property
    def state(self) -> bytes:
        """Everything that changes while running. Assign it to a controller of the same scenario to resume, bit for bit.

        Assigning raises TypeError or ValueError for what was not saved so, or was damaged since.

        >>> one, other = fg.Controller(fg.Scenario.paper()), fg.Controller(fg.Scenario.paper())
        >>> force = one.step(0.0, (0.5, 0.5), (0.0, 0.0))
        >>> other.state = one.state
        >>> bool((one.step(1e-3, (0.4, 0.4), (0.0, 0.0)) == other.step(1e-3, (0.4, 0.4), (0.0, 0.0))).all())
        True
        """
        return self._key + bytes(self._core.state)

    @state.setter
    def state(self, saved: bytes) -> None:
        if not isinstance(saved, bytes):
            raise TypeError(f"state is {short(saved)}: it must be bytes, as they were saved")
        key = self._key
        if saved[: len(key)] != key:
            raise ValueError("state was saved by another version, or by a controller of another scenario or precision")
        self._core.state = saved[len(key) :]

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self.scenario, self._single, self.state)

    @cached_property
    def _key(self) -> bytes:
        number = "float" if self._single else "double"
        return f"fracgyro {version('fracgyro')} controller 2 {self.scenario.content_hash()} {number}\n".encode()


def _resumed(scenario: Scenario, single_precision: bool, state: bytes) -> Controller:
    controller = Controller(scenario, single_precision=single_precision)
    controller.state = state
    return controller
