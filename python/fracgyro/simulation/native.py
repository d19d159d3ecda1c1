"""Controllers and plants as C functions, compiled by Numba or a C compiler; they run on threads, without Python."""

from __future__ import annotations

import ctypes
import operator
from _ctypes import CFuncPtr
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from .. import _core
from ..arguments import number, short

__all__ = ["Law", "Plant"]

MAX_STATE = 10**6  # doubles
MAX_PLANT_STATES = 8
INCLUDE = Path(_core.__file__).parent / "include"  # the folder of fracgyro_law.h, for the compiler's option -I


class Law:
    """A C function as a controller: `void law(const double* in, double* state, const double* parameters, double* out)`.

    The function is called once per step. `in`: 11 doubles, the time, then pairs [x, y] of measured position, measured
    velocity, reference, and the reference's velocity and acceleration; the header fracgyro_law.h in the folder INCLUDE
    names their places. `state`: `state_size` doubles, zero before the
    first step of each run. `parameters`: the values of `parameters`, in their order. `out`: the force [x, y], then one
    double for each name in `reports`, which is recorded as a channel; rate_estimate makes the controller a rate sensor.
    Units are SI if run.units is SI, otherwise nondimensional. The 64 doubles behind each array are NaN; a run in which
    the function writes to them ends with a ValueError.

    `function`: an address, a `numba.cfunc`, or a function pointer of ctypes or cffi. It must not call Python;
    concurrent calls each have their own state.

    Raises TypeError for another kind of `function`, ValueError for invalid other arguments.

    >>> fg.native.Law(0x1000, parameters={"kp": 1e4}).parameters  # the address of a compiled function
    {'kp': 10000.0}
    """

    def __init__(
        self,
        function: Any,
        state_size: int = 0,
        parameters: Mapping[str, float] | None = None,
        reports: Iterable[str] = (),
    ) -> None:
        self._address = _address(function)
        self._function = function  # keeps it alive
        try:
            self.state_size = operator.index(state_size)
        except TypeError:
            raise TypeError(f"state_size is {short(state_size)}: it must be an integer") from None
        if not 0 <= self.state_size <= MAX_STATE:
            raise ValueError(f"state_size is {self.state_size}: it must be from 0 to {MAX_STATE}")
        self.parameters = _parameters(parameters)
        self.reports = tuple(reports)
        for name in self.reports:
            if not isinstance(name, str) or self.reports.count(name) > 1:
                raise ValueError(f"reports is {short(list(self.reports))}: it must be a list of different names")

    def replace(self, changes: Mapping[str, float]) -> Law:
        """A copy with some parameters changed. Raises ValueError for an unknown parameter.

        >>> law = fg.native.Law(0x1000, parameters={"kp": 1e4, "kd": 200.0})
        >>> law.replace({"kd": 300.0}).parameters["kd"]
        300.0
        """
        for name in changes:
            if name not in self.parameters:
                raise ValueError(f"{name} is not a parameter of this law: it has {', '.join(self.parameters)}")
        return Law(self._function, self.state_size, {**self.parameters, **changes}, self.reports)

    def __repr__(self) -> str:
        return f"Law({self._address:#x}, {self.state_size}, {self.parameters}, {list(self.reports)})"

    def __copy__(self) -> Law:
        return self

    def __deepcopy__(self, memo: object) -> Law:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Law cannot be pickled: its function's address is not valid in another process")

    def _core_law(self) -> _core.NativeController:
        """The core's controller for one run."""
        place = self.reports.index("rate_estimate") if "rate_estimate" in self.reports else -1
        values = list(self.parameters.values())
        return _core.NativeController(self._address, self.state_size, values, len(self.reports), place)


class Plant:
    """A C function as a plant: `void f(const double* in, const double* state, const double* parameters, double* out)`.

    `derivative`: computes the derivative of the state, four times a step: a step is a Runge-Kutta step of fourth order,
    over which the force is held. `in`: 4 doubles, the time, the force [x, y], which includes the disturbance, and the
    angular rate. `step`: computes the state after a step instead, in one call. `in`: 7 doubles, the time, the force
    [x, y], the angular rate at the beginning, middle and end of the step, and its length.

    `state` and `out`: `states` doubles, 2 to 8, and their derivatives or next values. `parameters`: the values of
    `parameters`, in their order. Units are SI if run.units is SI, otherwise nondimensional. The 64 doubles behind each
    array are NaN; a run in which the function writes to them ends with a ValueError.

    `motion`: the places of x, y, vx and vy among the states; None for one that stays 0. `initial_state`: the state at
    the beginning; without it, run.initial_position and run.initial_velocity at those places and 0 elsewhere.
    `takes_rate`: True if the function computes with the angular rate, which may then vary. Functions: as in `Law`.

    Raises TypeError unless one of `derivative` and `step` is given, and a C function; ValueError for invalid other
    arguments.

    >>> fg.native.Plant(0x1000, states=2, motion=(0, None, 1, None)).states  # the address of a compiled function
    2
    """

    def __init__(
        self,
        derivative: Any = None,
        states: int = 4,
        parameters: Mapping[str, float] | None = None,
        *,
        step: Any = None,
        motion: Sequence[int | None] = (0, 1, 2, 3),
        initial_state: Sequence[float] | None = None,
        takes_rate: bool = False,
    ) -> None:
        if (derivative is None) == (step is None):
            both = "neither is" if step is None else "both are"
            raise TypeError(f"derivative or step must be given, as a C function: {both}")
        self._steps = step is not None
        self._function = step if self._steps else derivative  # keeps it alive
        self._address = _address(self._function)
        if isinstance(states, bool) or not isinstance(states, int) or not 2 <= states <= MAX_PLANT_STATES:
            raise ValueError(f"states is {short(states)}: it must be an integer from 2 to {MAX_PLANT_STATES}")
        self.states = states
        self.parameters = _parameters(parameters)
        places = list(motion) if isinstance(motion, Sequence) else []
        if len(places) != 4 or not all(each is None or each in range(states) for each in places):
            raise ValueError(
                f"motion is {short(motion)}: it must be the places of x, y, vx and vy, each from 0 to {states - 1} or "
                "None"
            )
        self.motion = tuple(places)
        self.initial_state = None if initial_state is None else tuple(number("initial_state", x) for x in initial_state)
        if self.initial_state is not None and len(self.initial_state) != states:
            raise ValueError(f"initial_state is {short(initial_state)}: it must have {states} numbers, as states")
        self.takes_rate = takes_rate

    def __repr__(self) -> str:
        return f"Plant({self._address:#x}, {self.states}, {self.parameters})"

    def __copy__(self) -> Plant:
        return self

    def __deepcopy__(self, memo: object) -> Plant:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Plant cannot be pickled: its function's address is not valid in another process")

    def _core_plant(self) -> _core.NativePlant:
        """The core's plant for one run."""
        places = [-1 if place is None else place for place in self.motion]
        values = list(self.parameters.values())
        return _core.NativePlant(
            self._address, self._steps, values, self.states, places, list(self.initial_state or ())
        )


def _parameters(given: Mapping[str, float] | None) -> dict[str, float]:
    if not isinstance(given or {}, Mapping):
        raise TypeError(f"parameters is {short(given)}: it must be a dict of names to numbers")
    return {name: number(f"parameters {name}", value) for name, value in (given or {}).items()}


def _address(function: Any) -> int:
    found = getattr(function, "address", function)  # numba.cfunc
    if isinstance(function, CFuncPtr):
        found = ctypes.cast(function, ctypes.c_void_p).value or 0
    elif type(function).__module__ == "_cffi_backend":
        found = int(import_module("cffi").FFI().cast("intptr_t", function))
    if isinstance(found, bool) or not isinstance(found, int) or not 0 < found < 2**64:
        raise TypeError(
            f"function is {short(function)}: it must be the address of a C function, a numba.cfunc, or a function "
            "pointer of ctypes or cffi"
        )
    return found
