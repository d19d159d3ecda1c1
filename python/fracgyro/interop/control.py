"""Gyroscope, controller and closed loop of a scenario as systems of python-control, and runs as its responses.

The systems are nondimensional, regardless of run.units: times in 1/omega0, positions in q0, velocities in q0 omega0,
forces in m omega0^2 q0.
"""

from __future__ import annotations

import json
import os
from functools import lru_cache
from pathlib import Path

import control as ct
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..arguments import short
from ..files import read_input
from ..scenario import Scenario, check_scenario
from ..simulation.controller import Controller
from .matrices import FORCES, STATES, matrices

__all__ = ["controller", "loop", "plant", "rate_response", "response"]

Vector = NDArray[np.float64]


def plant(scenario: Scenario, *, sampled: bool = True) -> ct.StateSpace:
    """The ideal gyroscope: inputs u_x, u_y; states and outputs x, y, vx, vy.

    It has no disturbance, no device imperfections, and the constant rate plant.angular_rate. `sampled`: discrete with
    dt = run.step, exact for a zero-order-hold force; otherwise continuous. Raises TypeError if `scenario` is not a
    Scenario.

    >>> fg.interop.control.plant(fg.Scenario.paper()).dt
    0.001
    """
    found = matrices(scenario, sampled)
    dt = scenario.run.step if sampled else 0
    return ct.ss(*found, dt, inputs=FORCES, outputs=STATES, states=STATES, name="plant")


def controller(scenario: Scenario) -> ct.NonlinearIOSystem:
    """The scenario's controller as in fg.Controller: inputs x, y, vx, vy; outputs u_x, u_y; dt = run.step.

    The state is the state of fg.Controller, 32 bits per number; zeros are the initial state. It can be copied and
    stored, but arithmetic on it is invalid, so `linearize` does not work. The time is part of the state and starts at
    0. Raises TypeError if `scenario` is not a Scenario; during a simulation, ValueError for inputs that are not finite
    and for an invalid state.

    >>> system = fg.interop.control.controller(fg.Scenario.paper())
    >>> system.input_labels, system.output_labels
    (['x', 'y', 'vx', 'vy'], ['u_x', 'u_y'])
    """
    check_scenario(scenario)
    pure = _Pure(scenario.replace({"run.units": "nondimensional"}))
    return ct.nlsys(
        lambda t, x, u, params: pure.step(x, u)[1],
        lambda t, x, u, params: pure.step(x, u)[0],
        inputs=STATES,
        outputs=FORCES,
        states=pure.states,
        dt=scenario.run.step,
        name="controller",
    )


def loop(scenario: Scenario) -> tuple[ct.NonlinearIOSystem, Vector]:
    """The closed loop of `plant` and `controller` as one system, and its initial state.

    Inputs d_x, d_y: a disturbance force. Outputs x, y, vx, vy, u_x, u_y. Each sample takes one step of the controller;
    systems connected by python-control take two, as it evaluates outputs before the inputs are known. Raises TypeError
    if `scenario` is not a Scenario.

    >>> import control as ct
    >>> scenario = fg.Scenario.paper()
    >>> system, start = fg.interop.control.loop(scenario)
    >>> time = scenario.run.step * np.arange(100)
    >>> response = ct.input_output_response(system, time, 0, start)
    >>> response.outputs[:2, 0].tolist()
    [0.5, 0.5]
    """
    check_scenario(scenario)
    pure, run = _Pure(scenario.replace({"run.units": "nondimensional"})), scenario.run
    a, b, _, _ = matrices(scenario, sampled=True)

    def update(t: float, x: Vector, d: Vector, params: object) -> Vector:
        force, state = pure.step(x[4:], x[:4])
        return np.concatenate([a @ x[:4] + b @ (force + d), state])

    system = ct.nlsys(
        update,
        lambda t, x, d, params: np.concatenate([x[:4], pure.step(x[4:], x[:4])[0]]),
        inputs=["d_x", "d_y"],
        outputs=[*STATES, *FORCES],
        states=4 + pure.states,
        dt=run.step,
        name="loop",
    )
    return system, np.array([*run.initial_position, *run.initial_velocity, *np.zeros(pure.states)])


def response(run: xr.Dataset, variable: str) -> ct.TimeResponseData:
    """A variable of one run, in the run's units, with one output per column.

    Raises ValueError for an unknown variable and for a Dataset of several runs.

    >>> run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0}))
    >>> fg.interop.control.response(run, "error").output_labels
    ['error_x', 'error_y']
    """
    if variable not in run:
        raise ValueError(f"variable is {short(variable)}: it must be one of {', '.join(map(str, run))}")
    values = run[variable]
    if "run" in values.dims:
        raise ValueError("the Dataset has several runs: select one, for example run.isel(run=0)")
    columns = [dim for dim in values.dims if dim != "time"]
    labels = [f"{variable}_{label}" for label in values[columns[0]].values] if columns else [variable]
    outputs = values.transpose(*columns, "time").values.reshape(len(labels), -1)
    return ct.TimeResponseData(run["time"].values, outputs, output_labels=labels, issiso=False)


def rate_response(folder: str | os.PathLike[str]) -> ct.FrequencyResponseData:
    """Measured response of the rate estimate to a sinusoidal rate, from `fracgyro rate --out`; frequencies in rad/s.

    `folder`: contains rate.json. The gain is relative to the scale factor, so it is 1 for a constant rate. Raises
    ValueError if the file cannot be read or has no response.

    >>> _ = fg.rate.characterise(fg.Scenario.shipped("dual_mass"), "sensor")  # doctest: +SKIP
    >>> fg.interop.control.rate_response("sensor").output_labels  # doctest: +SKIP
    ['rate_estimate']
    """
    path = Path(folder) / "rate.json"
    try:
        content = json.loads(read_input(path))["response"]
        frequency, gain, lag = (np.array(content[name], dtype=float) for name in ("frequency", "gain", "lag"))
        measured = gain * np.exp(-1j * lag)
    except (OSError, ValueError, KeyError, TypeError):
        raise ValueError(f"{path} has no measured response: create it with fracgyro rate --out") from None
    return ct.frd(measured, 2.0 * np.pi * frequency, inputs=["rate"], outputs=["rate_estimate"], name="sensor")


class _Pure:
    """fg.Controller as a pure function of state and input.

    The state vector has the 32-bit words of the state, XORed with the words of the initial state, as integers below
    2^32. Copying them and adding zero preserves all bits; bytes read as floating-point numbers could be NaN and change.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._controller = Controller(scenario)
        self._size = len(self._controller.state)
        self._start = self._words()
        self.states = len(self._start)
        # python-control evaluates the same step up to six times, alternating with a step for zero input.
        self._stepped = lru_cache(maxsize=4)(self._step)

    def step(self, state: Vector, motion: Vector) -> tuple[Vector, Vector]:
        """The force, and the next state."""
        return self._stepped(np.asarray(state, dtype=float).tobytes(), np.asarray(motion, dtype=float).tobytes())

    def _step(self, state: bytes, motion: bytes) -> tuple[Vector, Vector]:
        words = np.frombuffer(state)
        if not ((words >= 0) & (words < 2**32) & (words % 1 == 0)).all():
            raise ValueError("the state is invalid: it must be an unmodified copy of a state of the controller")
        self._controller.state = (words.astype("<u4") ^ self._start).tobytes()[: self._size]
        x, y, vx, vy = np.frombuffer(motion).tolist()
        force = self._controller.step(self._controller.time, (x, y), (vx, vy))
        found = force, (self._words() ^ self._start).astype(float)
        for kept in found:
            kept.flags.writeable = False
        return found

    def _words(self) -> NDArray[np.uint32]:
        return np.frombuffer(self._controller.state.ljust(self._size + 3 & ~3, b"\0"), dtype="<u4")
