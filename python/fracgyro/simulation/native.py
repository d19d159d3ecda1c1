"""Controllers as C functions, compiled by Numba or a C compiler; they run on threads and without Python."""

from __future__ import annotations

import ctypes
import operator
from _ctypes import CFuncPtr
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from .. import _core
from ..arguments import number, short

__all__ = ["Law"]

MAX_STATE = 10**6  # doubles
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
        if not isinstance(parameters or {}, Mapping):
            raise TypeError(f"parameters is {short(parameters)}: it must be a dict of names to numbers")
        self.parameters = {name: number(f"parameters {name}", value) for name, value in (parameters or {}).items()}
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
