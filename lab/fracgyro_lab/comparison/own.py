"""A user's controller: FILE.py:NAME, called with its gains, returns a controller for `simulate`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from fracgyro.files import read_input, reason
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.table import format_value
from fracgyro.simulation.native import Law
from fracgyro.simulation.user_controller import ControllerLike

from .contender import Contender, Gain
from .task import Task

GAIN = "law."  # prefix of a user's gain, to distinguish it from fields of a scenario


def own_contender(given: str, task: Task) -> Contender:
    """The contender of FILE.py:NAME. Raises ScenarioError if it is not a controller."""
    path, colon, name = given.rpartition(":")
    if not colon or not path or not name.isidentifier():
        raise ScenarioError(f"--controller is {format_value(given)}: it must be FILE.py:NAME")
    text = _read(path)
    ranges = getattr(_factory(text, path, name), "ranges", None)
    if not isinstance(ranges, Mapping) or not ranges:
        raise ScenarioError(f"{name}.ranges is {format_value(ranges)}: it must be a dict of gains to their (low, high)")
    gains = {gain: _gain(name, gain, ends) for gain, ends in ranges.items()}
    lowest = {gain.field: gain.low for gain in gains.values()}
    bandwidth = None
    if task.finds_bandwidth:
        if "bandwidth" not in gains:
            raise ScenarioError(
                f"{name}.ranges has no bandwidth: it must have one, of the rate estimate, which the task "
                f"{task.name} sets so that all have the same"
            )
        bandwidth = gains.pop("bandwidth")
    found = Contender(
        name,
        f"{name} of {Path(path).name}",
        "the user's own",
        {},
        tuple(gains.values()),
        observer=task.observer,
        bandwidth=bandwidth,
        own=(text, path),
    )
    made = controller_of(found, lowest)
    if not callable(made) and not isinstance(made, Law):
        raise ScenarioError(
            f"{name} of {path} gives {format_value(made)}: it must give a function or a fracgyro.native.Law"
        )
    return found


def _read(path: str) -> str:
    try:
        return read_input(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{path} cannot be read: it is not UTF-8") from None
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None


def _gain(owner: str, name: Any, ends: Any) -> Gain:
    place = f"{owner}.ranges[{format_value(name)}] is {format_value(ends)}"
    numbers = isinstance(ends, tuple | list) and len(ends) == 2
    if not numbers or not all(isinstance(end, int | float) and math.isfinite(end) for end in ends):
        raise ScenarioError(f"{place}: it must be (low, high), two finite numbers")
    low, high = map(float, ends)
    if not isinstance(name, str) or not name.isidentifier() or not low < high:
        raise ScenarioError(f"{place}: low must be less than high, and the gain the name of an argument")
    return Gain(GAIN + name, low, high, log=low > 0)


def controller_of(contender: Contender, values: Mapping[str, Any]) -> ControllerLike | None:
    """The user's controller with these gains; None for a controller of the package."""
    if contender.own is None:
        return None
    text, path = contender.own
    arguments = {name.removeprefix(GAIN): value for name, value in values.items() if name.startswith(GAIN)}
    try:
        controller: ControllerLike = _factory(text, path, contender.name)(**arguments)
    except Exception as error:
        said = ", ".join(f"{name}={value:g}" for name, value in arguments.items())
        raise ScenarioError(f"{contender.name}({said}) of {path} raised {type(error).__name__}: {error}") from error
    return controller


@lru_cache
def _factory(text: str, path: str, name: str) -> Callable[..., Any]:
    module = ModuleType(Path(path).stem)
    module.__file__ = path
    try:
        exec(compile(text, path, "exec"), module.__dict__)
    except Exception as error:
        raise ScenarioError(f"{path} cannot be run: {type(error).__name__}: {error}") from error
    found = getattr(module, name, None)
    if not callable(found):
        raise ScenarioError(f"--controller names {name}: it must be a class or function of {path}")
    result: Callable[..., Any] = found
    return result
