"""A user's controller in a study, which replaces the controller of its scenarios."""

from __future__ import annotations

import ctypes
import difflib
import functools
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from ..scenario import Scenario, ScenarioError
from ..simulation.native import Law
from ..simulation.user_controller import ControllerLike, UserController, controller_name

LAW = "law."  # prefix of a parameter's name, to distinguish it from fields of a scenario
# Fields that a native.Law replaces; a callable may read all of them in reset(scenario).
OF_THE_CONTROLLER = ("controller.", "adaptation.", "guard.", "run.kernel_tolerance")
OF_ANY_LAW = (
    "controller.force_limit",
    "controller.filter",
    "controller.observer_bandwidth",
    "controller.event_threshold",
    "controller.event_share",
    "controller.compensation_bandwidth",
)


def is_parameter(field: str) -> bool:
    return field.startswith(LAW)


def parameter(field: str, controller: ControllerLike | None) -> float:
    """The value of `law.NAME`. Raises ScenarioError if the controller has no such parameter."""
    if controller is None:
        raise ScenarioError(
            f"{field} is in [vary]: it is only allowed in fracgyro.study.sweep and fracgyro.study.tune with a "
            "native.Law as controller"
        )
    if not isinstance(controller, Law):
        raise ScenarioError(f"{field} is in [vary]: it is only allowed with a native.Law, which has named parameters")
    name, known = field.removeprefix(LAW), controller.parameters
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known)
    hint = f"did you mean {LAW}{near[0]}?" if near else f"it has {', '.join(LAW + each for each in known) or 'none'}"
    raise ScenarioError(f"{field} is not a parameter of the law; {hint}")


def check_read(field: str, controller: ControllerLike | None) -> None:
    """Raises ScenarioError for a field that has no effect with this controller."""
    if isinstance(controller, Law) and field.startswith(OF_THE_CONTROLLER) and field not in OF_ANY_LAW:
        raise ScenarioError(
            f"{field} is in [vary]: it has no effect, as a native.Law replaces the scenario's controller; only "
            f"{', '.join(OF_ANY_LAW[:-1])} and {OF_ANY_LAW[-1]} remain"
        )


def fields_of_scenario(values: Mapping[str, Any]) -> dict[str, Any]:
    return {field: value for field, value in values.items() if not is_parameter(field)}


def with_values(controller: ControllerLike | None, values: Mapping[str, Any]) -> ControllerLike | None:
    """The controller with its parameters in `values` replaced."""
    if not isinstance(controller, Law):
        return controller
    return controller.replace({field.removeprefix(LAW): v for field, v in values.items() if is_parameter(field)})


def of_each(
    controller: ControllerLike | None, points: Sequence[Mapping[str, Any]]
) -> ControllerLike | list[Law] | None:
    """The controller argument of `measure_many` for scenarios with these values."""
    if not isinstance(controller, Law):
        return controller
    return [law for values in points if isinstance(law := with_values(controller, values), Law)]


def recorded(controller: ControllerLike | None, base: Scenario) -> dict[str, Any]:
    """Entry of study.json that identifies the controller; empty without one. `code` is None if it cannot be read.

    The code of a C function is its offset in its library and the hash of the library; the code of a Python object is
    its bytecode, its attributes after reset(base), and everything that both use from the controller's package.
    """
    if controller is None:
        return {}
    UserController(controller).start(base)
    values = controller.parameters if isinstance(controller, Law) else _attributes(controller)
    said: dict[str, Any] = {"name": controller_name(controller), "parameters": values}
    if isinstance(controller, Law):
        said |= {"state_size": controller.state_size, "reports": list(controller.reports)}
    return {"controller": {**said, "code": _code(controller)}}


def _attributes(controller: Any) -> dict[str, Any]:
    own = getattr(controller, "__dict__", {})
    plain = {name: value for name, value in own.items() if isinstance(value, bool | int | float | str)}
    return {name: value for name, value in plain.items() if str(value) not in ("nan", "inf", "-inf")}  # JSON has none


def _code(controller: Any) -> str | None:
    try:
        if isinstance(controller, Law):
            found = _in_library(controller._address) or _Reader(controller._function).read(controller._function)
        else:
            found = _Reader(controller).read(controller)
        return hashlib.sha256(json.dumps(found).encode()).hexdigest()
    except (_Unreadable, RecursionError):
        return None


class _Symbol(ctypes.Structure):
    """Dl_info of dlfcn.h."""

    _fields_ = (
        ("file", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


def _in_library(address: int) -> list[Any] | None:
    """Hash of the library that contains the address, and the offset; None if no library contains it."""
    found = _Symbol()
    try:
        if not ctypes.CDLL(None).dladdr(ctypes.c_void_p(address), ctypes.byref(found)):
            return None
        data = Path(os.fsdecode(found.file)).read_bytes()
    except (AttributeError, OSError, TypeError):
        return None
    return [hashlib.sha256(data).hexdigest(), address - (found.base or 0)]


class _Unreadable(Exception):
    """An object that cannot be compared with one in another process."""


class _Reader:
    """Converts Python objects to JSON that is equal in two processes if the objects behave equally."""

    def __init__(self, root: Any) -> None:
        inner = getattr(root, "__wrapped__", root)
        while isinstance(inner, functools.partial):
            inner = inner.func
        self._home = _package(inner if hasattr(inner, "__qualname__") else type(inner))
        self._known: dict[int, Any] = {}

    def read(self, value: Any) -> Any:
        if value is None or value is ... or isinstance(value, bool | int | float | complex | str | bytes):
            return repr(value)
        if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biufcSU":
            return [value.dtype.str, list(value.shape), value.tobytes().hex()]
        if isinstance(value, Scenario):
            return value.to_toml()
        if isinstance(value, ModuleType | BuiltinFunctionType):
            return value.__name__
        if id(value) not in self._known:
            self._known[id(value)] = "again"  # for a recursive object
            self._known[id(value)] = [type(value).__name__, *self._parts(value)]
        return self._known[id(value)]

    def _parts(self, value: Any) -> Iterator[Any]:
        inner = getattr(value, "py_func", getattr(value, "__wrapped__", None))  # Numba's functions
        if isinstance(value, list | tuple):
            yield from map(self.read, value)
        elif isinstance(value, set | frozenset):
            yield from sorted(json.dumps(self.read(each)) for each in value)
        elif isinstance(value, dict):
            yield from ([self.read(key), self.read(each)] for key, each in value.items())
        elif isinstance(value, CodeType):
            yield from (value.co_code.hex(), list(value.co_names), [self.read(each) for each in value.co_consts])
        elif isinstance(value, MethodType):
            yield from (self.read(value.__func__), self.read(value.__self__))
        elif isinstance(value, functools.partial):
            yield from map(self.read, (value.func, value.args, value.keywords))
        elif isinstance(value, FunctionType | type) and _package(value) != self._home:
            yield f"{value.__module__}.{value.__qualname__}"
        elif isinstance(value, FunctionType):
            yield from map(self.read, (value.__code__, value.__defaults__, value.__kwdefaults__))
            yield [self.read(cell.cell_contents) for cell in value.__closure__ or ()]
            known = value.__globals__
            yield [[name, self.read(known[name])] for name in sorted(set(_names(value.__code__))) if name in known]
        elif isinstance(value, type):
            yield [self.read(base) for base in value.__bases__]
            own = sorted(vars(value).items())
            yield [[n, self.read(e)] for n, e in own if isinstance(e, FunctionType) or not n.startswith("__")]
        elif isinstance(value, staticmethod | classmethod):
            yield self.read(value.__func__)
        elif isinstance(value, property):
            yield from map(self.read, (value.fget, value.fset))
        elif inner is not None:
            yield self.read(inner)
        elif _package(type(value)) == self._home and hasattr(value, "__dict__"):
            yield from (self.read(type(value)), self.read(vars(value)))
        else:
            raise _Unreadable


def _package(value: Any) -> str:
    return str(getattr(value, "__module__", None) or "").partition(".")[0]


def _names(code: CodeType) -> Iterator[str]:
    """Names of globals that the code, or a function within it, may use."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
