"""The scenarios of recorded runs: one per run."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..scenario import Scenario


def texts(run: xr.Dataset) -> xr.DataArray:
    """The scenario of a run as TOML, over `run` if there are several. Raises ValueError for a Dataset without one."""
    if "scenario" in run.attrs:
        return xr.DataArray(run.attrs["scenario"])
    if "scenario" in run.coords:
        return run["scenario"].reset_coords(drop=True)
    raise ValueError("the Dataset has neither an attribute nor a coordinate scenario: it is not a run of fracgyro")


def of_each(run: xr.Dataset, read: Callable[[Scenario], ArrayLike], dimension: str | None = None) -> xr.DataArray:
    """`read(scenario)` of each run; `dimension`: name of the dimension if it returns an array."""
    found = texts(run)
    known = {text: np.asarray(read(_scenario(str(text)))) for text in dict.fromkeys(found.values.flat)}
    values = np.array([known[text] for text in found.values.flat])
    inner = [dimension] if dimension else []
    return xr.DataArray(values if found.ndim else values[0], dims=[*found.dims, *inner])


def one_scenario(run: xr.Dataset) -> Scenario:
    """The scenario of a single run. Raises ValueError for several."""
    found = texts(run)
    if found.ndim:
        raise ValueError(f"the Dataset has {found.size} runs: select one, such as run.isel(run=0)")
    return _scenario(str(found.values))


@lru_cache(maxsize=1000)
def _scenario(text: str) -> Scenario:
    return Scenario.from_toml(text)


def scale(run: xr.Dataset, unit: str) -> xr.DataArray:
    """SI value of a nondimensional unit for each SI run; 1 for nondimensional runs."""
    return of_each(run, lambda s: s.plant.scales.of(unit)) if run.attrs["units"] == "SI" else xr.DataArray(1.0)


def time_unit(run: xr.Dataset) -> float:
    """Scale of time, the same for all runs of a Dataset."""
    found = np.unique(scale(run, "1/omega0"))
    if len(found) > 1:
        raise ValueError(
            "plant.reference_frequency differs between these SI runs: it must be the same for one time axis"
        )
    return float(found[0])
