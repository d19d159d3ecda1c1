"""The least error that any controller can have, from `fg.limit.tracking`, in the figures that `track` compares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from fracgyro.analysis.limit import tracking
from fracgyro.scenario import Scenario, ScenarioError

SPAN = 10.0, 4.0  # the line goes from the lowest ceiling over the first to the highest times the second
POINTS = 12
NOTHING = 1e-3  # share of the steady error: a smaller transient is none


@lru_cache(maxsize=64)
def limit_of(base: Scenario, ceilings: tuple[float, ...], transient: float) -> dict[str, Any]:
    """For this scenario, sensing included: `front`, [chattering, steady error, error], and `ceilings`, a dict each.

    The steady error is the geometric mean of both axes, the error that of the four RMS errors, with the transient; None
    where a run starts on its reference and has no transient.
    `why`: a sentence if a limit does not exist; then both lists are empty.
    """
    grid = np.geomspace(ceilings[0] / SPAN[0], ceilings[-1] * SPAN[1], POINTS).tolist()
    try:
        front = [one for ceiling in grid if (one := _at(base, ceiling, transient)) is not None]
        found = [_at(base, ceiling, transient) for ceiling in ceilings]
    except ValueError as error:
        return {"why": str(error), "front": [], "ceilings": []}
    return {
        "why": None,
        "front": [[one["ceiling"], one["steady"], one["error"]] for one in front],
        "ceilings": [one for one in found if one is not None],
    }


def _at(base: Scenario, ceiling: float, transient: float) -> dict[str, Any] | None:
    """None for a ceiling that no law keeps. Raises ScenarioError for a scenario without a limit."""
    try:
        found = tracking(base, chattering=ceiling, transient=transient)
    except ScenarioError:
        raise
    except ValueError:
        return None
    steady, at_first = found["rmse_steady"].values.tolist(), found["rmse_transient"].values.tolist()
    named = {
        f"rmse_{when}_{axis}": value
        for when, pair in (("steady", steady), ("transient", at_first))
        for axis, value in zip("xy", pair, strict=True)
    }
    none = max(at_first) < NOTHING * min(steady)
    return {
        "ceiling": ceiling,
        **named,
        "steady": _mean(steady),
        "error": None if none else _mean([*steady, *at_first]),
    }


def over(
    limit: dict[str, Any] | None, ceiling: float, figures: dict[str, float | None]
) -> dict[str, float | None] | None:
    """Ratios of a contender's steady error and of its error to the limit at this ceiling; None without a limit."""
    at = next((one for one in limit["ceilings"] if one["ceiling"] == ceiling), None) if limit else None
    steady = [figures.get(f"rmse_steady_{axis}") for axis in "xy"]
    error = figures.get("error")
    if at is None or error is None or None in steady:
        return None
    return {
        "steady": _mean([value or 0.0 for value in steady]) / at["steady"],
        "error": at["error"] and error / at["error"],
    }


def _mean(values: Sequence[float]) -> float:
    """Geometric mean; 0 where one is 0."""
    return math.exp(sum(map(math.log, values)) / len(values)) if min(values) > 0 else 0.0
