"""The controller without a plant, one sample at a time: for your own loop, or hardware."""

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
from ..scenario.kinds import persistent_channels
from ..scenario.to_core import check_single, core_setup
from .user_controller import units

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Estimates:
    """Estimates of the controller, in the units of the run; NaN or False for those that it does not have.

    >>> estimates = fg.Controller(fg.Scenario.paper()).estimates
    >>> round(estimates.rate, 3), estimates.rate_trusted
    (0.095, False)
    """

    damping: Vector  #: D as xx, xy, yy: (3,)
    stiffness: Vector  #: K as xx, xy, yy: (3,)
    rate: float  #: angular rate
    bound: Vector  #: disturbance bounds b0, b1, b2: (3,)
    rate_deviation: float  #: standard deviation of the rate; composite and joint adaptation only
    rate_trusted: bool  #: True once the rate is observable and the measurements agree with the model
    sample_refused: bool  #: True if the last sample was too far from its prediction and was not used


class Controller:
    """The controller of a scenario: eqs (16), (35), (44), (46), or another `controller.kind`.

    Call `step` once every `scenario.run.step`. Times, positions, velocities and forces are in the units of
    `scenario.run.units`. The fractional memory is accurate up to `scenario.run.duration`. `single_precision` computes
    in float, with the same bits as firmware exported in float. A controller can be copied and pickled; the copy
    continues independently from the same state.

    Raises TypeError if `scenario` is not a Scenario, ValueError if a coefficient exceeds single precision.

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
        self._reported = persistent_channels(setup)
        self._scales = [[scales.of(unit) if si else 1.0 for unit in channel.units] for channel in self._reported]

    def step(self, time: float, position: Sequence[float], velocity: Sequence[float] | None = None) -> Vector:
        """Returns the force [x, y] to hold until the next step.

        `position` and `velocity` are [x, y] measured at `time`; NaN marks a missing sample. The force is always finite
        and within the limit; `status` reports whether the sample was accepted. Time starts with the first accepted
        sample; `time` is the time of the next step. With device.sensing = "position" the velocity comes from an
        observer and the argument is ignored.

        Raises TypeError for an argument that is not a number, ValueError for a time that is not finite or not that of
        the next step, and for a missing velocity.

        >>> controller = fg.Controller(fg.Scenario.paper())
        >>> for i in range(3):
        ...     force = controller.step(1e-3 * i, (0.5, 0.5), (0.0, 0.0))
        """
        if self._observes:
            velocity = None
        elif velocity is None:
            return self._checked(time, position, velocity)
        # None: an argument is not a plain finite number; it may be one of NumPy's or NaN.
        force: Vector | None = self._core.checked_step(self._step, self._units, time, position, velocity)
        return self._checked(time, position, velocity) if force is None else force

    def _checked(self, time: object, position: object, velocity: object) -> Vector:
        """`step` with full validation, for arguments that are not plain finite floats."""
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
        if force is None:  # another thread took the step
            self._check_time(time, plain)
            raise ValueError(f"time is {time}: another thread uses this controller; each thread needs its own")
        return force

    def _check_time(self, given: object, time: float) -> None:
        """Raises ValueError unless `given` is the time of the next step."""
        expected = self._core.steps * self._step
        if not abs(time / self._units.time - expected) < 0.5 * self._step:
            why = "steps must be consecutive" if expected else "time starts with the first accepted sample"
            raise ValueError(f"time is {given}: the next step is at {expected * self._units.time:.9g}, and {why}")

    def acted(self, force: Sequence[float]) -> None:
        """States the force [x, y] that acts where converters round that of the last `step`; call it after each step.

        The filters of joint adaptation, lqg and controller.filter use it; other controllers ignore it. Without it they
        take the requested force for the acting one. Raises TypeError or ValueError for anything but two finite numbers.

        >>> scenario = fg.Scenario.shipped("dual_mass_volts")
        >>> controller, plant = fg.Controller(scenario), fg.Plant(scenario)
        >>> motion = plant.step(controller.step(plant.motion.time, plant.motion.position))
        >>> controller.acted(plant.rounded)
        """
        x, y = pair("force", force)
        self._core.acted((x / self._units.force, y / self._units.force))

    @property
    def time(self) -> float:
        """Time of the next step, in the unit of the run.

        >>> controller = fg.Controller(fg.Scenario.paper())
        >>> force = controller.step(controller.time, (0.5, 0.5), (0.0, 0.0))
        >>> controller.time
        0.001
        """
        return float(self._core.steps * self._step * self._units.time)

    @property
    def status(self) -> str:
        """Result of the plausibility check of the last sample.

        ok: accepted. saturated: accepted, and the force is at its limit. not_finite, out_of_range, implausible:
        rejected, and the previous force is held. lost: rejected, and the force is feedforward of the reference until
        samples agree again. restarted: the state was reset.

        >>> fg.Controller(fg.Scenario.paper()).status
        'ok'
        """
        return str(self._core.status.name)

    @property
    def estimates(self) -> Estimates:
        """Estimates after the last step; NaN for those that the controller does not have.

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
        """Report channels of the controller after the last step, by name.

        Excludes channels that exist only within a step, such as the sliding surface.

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
        """The complete state, as bytes. Assign it to a controller of the same scenario to resume, bit for bit.

        Assigning raises TypeError or ValueError for a state that was not saved in this way, or was damaged.

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
            raise TypeError(f"state is {short(saved)}: it must be bytes from `state`")
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
