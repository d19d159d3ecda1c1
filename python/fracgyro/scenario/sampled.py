"""A function of time as the table of a reference or a disturbance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..arguments import short
from .messages import ScenarioError
from .points import MAX_POINTS
from .schema import Plant, Run

Function = Callable[[float], Sequence[float]]


def points_of(function: Function, plant: Plant, run: Run, every: int, what: str = "reference") -> list[list[float]]:
    """Rows [time, x, y], nondimensional, at every `every`-th step; the function's units are those of run.units.

    `what`: a reference, or a disturbance, which is a force.
    """
    if not callable(function):
        raise ScenarioError(f"function is {short(function)}: it must be callable with a time")
    if not (type(every) is int and 1 <= every <= run.steps):
        raise ScenarioError(f"every is {every!r}: it must be a whole number from 1 to the {run.steps} steps of the run")
    count = -(-run.steps // every) + 1
    if count > MAX_POINTS:
        needed = -(-run.steps // (MAX_POINTS - 1))
        raise ScenarioError(f"every is {every}: it must be at least {needed}, as a table has at most {MAX_POINTS} rows")
    scales = plant.scales
    size = scales.length if what == "reference" else scales.force
    time_unit, unit = (scales.time, size) if run.units == "SI" else (1.0, 1.0)
    rows = []
    for k in range(count):
        time = k * every * run.step
        value = function(time * time_unit)
        try:
            x, y = (float(number) for number in value)
        except (TypeError, ValueError):
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            at = f"the {what} at t = {time * time_unit:g}"
            raise ScenarioError(f"{at} is {short(value)}: it must be two finite numbers, x and y")
        rows.append([time, x / unit, y / unit])
    return rows
