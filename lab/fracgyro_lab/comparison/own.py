"""A user's controller: FILE.py:NAME, called with its gains, returns a controller for `simulate`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fracgyro.scenario import ScenarioError
from fracgyro.scenario.table import format_value
from fracgyro.simulation.own_file import ControllerFile
from fracgyro.simulation.user_controller import ControllerLike

from .contender import Contender, Gain
from .task import Task

GAIN = "law."  # prefix of a user's gain, to distinguish it from fields of a scenario


def own_contender(given: str, task: Task) -> Contender:
    """The contender of FILE.py:NAME. Raises ScenarioError if it is not a controller."""
    file = ControllerFile.read(given)
    name = file.name
    ranges = getattr(file.object, "ranges", None)
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
        f"{name} of {Path(file.path).name}",
        "the user's own",
        {},
        tuple(gains.values()),
        observer=task.observer,
        bandwidth=bandwidth,
        own=file,
    )
    controller_of(found, lowest)
    return found


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
    arguments = {name.removeprefix(GAIN): value for name, value in values.items() if name.startswith(GAIN)}
    made: ControllerLike = contender.own.made(**arguments)
    return made
