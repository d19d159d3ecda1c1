"""Boundedness of a controller over unlimited time, and the cause of a divergence; EQUATIONS.md, 4."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .kinds import kinds_with
from .messages import ScenarioError
from .scenario import Scenario
from .table import toml_value
from .to_core import reference_reach

SAFE = 1.0  # limit of rho h/delta: half the value at which the loop diverges


def gain(scenario: Scenario, bound: Iterable[float], position: float, speed: float) -> float:
    """rho h/delta, the fraction of s removed by one step, for these bound estimates, |q| and |v|."""
    b0, b1, b2 = bound
    rho, c = b0 + b1 * position + b2 * speed, scenario.controller
    slope = rho * scenario.run.step / c.layer_thickness if c.layer_thickness > 0 else math.inf
    return float(min(slope, c.switching_limit))


def is_bounded(scenario: Scenario) -> bool:
    """True if the bound estimates cannot raise rho h/delta above SAFE.

    They rest, or the switching limit keeps it there, or adaptation.projection does so on the reference.
    """
    c, a = scenario.controller, scenario.adaptation
    if not c.adaptive or c.kind not in kinds_with("adaptation.bound_gain"):
        return True
    if c.layer_thickness == 0:
        return False
    if c.switching_limit <= SAFE:
        return True
    most = [b + a.projection * max(a.initial_bound) for b in a.initial_bound]
    position, velocity = reference_reach(scenario)
    return a.projection > 0 and gain(scenario, most, math.hypot(*position), math.hypot(*velocity)) <= SAFE


def check_bounded(scenario: Scenario, unbounded: bool) -> None:
    """Raises ScenarioError for a scenario that is not bounded, unless that is allowed."""
    if unbounded or is_bounded(scenario):
        return
    c = scenario.controller
    if c.layer_thickness == 0:
        raise ScenarioError(
            "controller.layer_thickness is 0.0: it must be greater than 0 for a controller that runs indefinitely, as "
            "without a layer the bound estimates grow until the loop diverges; --unbounded (unbounded=True) exports it "
            "anyway"
        )
    raise ScenarioError(
        f"controller.switching_limit is {toml_value(c.switching_limit)}: it must be at most {SAFE:g} for a controller "
        "that runs indefinitely, as in noise the bound estimates grow until the loop diverges (0.5 suits hardware); "
        "--unbounded (unbounded=True) exports it anyway"
    )


def cause(scenario: Scenario, run: xr.Dataset) -> tuple[float, NDArray[np.float64]] | None:
    """rho h/delta and the bound estimates, nondimensional, when the diverged run last was within the layer.

    None if they did not cause it.
    """
    c = scenario.controller
    if not c.adaptive or c.layer_thickness == 0 or "bound_estimate" not in run:
        return None
    scales = scenario.plant.scales
    si = run.attrs["units"] == "SI"

    def size(name: str, scale: float) -> NDArray[np.float64]:
        values: NDArray[np.float64] = np.hypot(*run[name].values.T) / (scale if si else 1.0)
        return values

    within = np.flatnonzero(size("surface", scales.velocity) < c.layer_thickness)
    if not len(within):
        return None
    last = within[-1]
    units = [scales.force, scales.stiffness, scales.damping] if si else [1.0, 1.0, 1.0]
    bound: NDArray[np.float64] = run["bound_estimate"].values[last] / units
    found = gain(scenario, bound, size("position", scales.length)[last], size("velocity", scales.velocity)[last])
    return (found, bound) if found > SAFE else None
