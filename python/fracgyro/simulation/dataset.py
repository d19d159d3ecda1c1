"""Rows of numbers from the core as xarray Datasets."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .. import _core
from ..files import whole_file
from ..scenario import Scenario
from ..scenario.kinds import AXES, QUANTITIES, Channel
from .outside import Outside


def time_scale(scenario: Scenario) -> float:
    return scenario.plant.scales.time if scenario.run.units == "SI" else 1.0


def dataset(
    rows: np.ndarray,
    scenario: Scenario,
    channels: tuple[Channel, ...],
    outside: Outside | None = None,
    *,
    first: int = 0,
    every: int | None = None,
) -> xr.Dataset:
    """Rows (..., sample, column) as a Dataset; every variable is a view of them unless units must change.

    `outside`: whose reports are in the units of the run already. `first`: the sample of the first row; `every`: samples
    from one row to the next, run.record_every if left out.
    """
    si = scenario.run.units == "SI"
    scales = scenario.plant.scales
    given = (outside and outside.reports) or ()
    leading = ["run"] * (rows.ndim - 2)
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    column = 0
    for channel in channels:
        values = rows[..., column : column + channel.width] if channel.dimension else rows[..., column]
        units = [QUANTITIES[unit] for unit in channel.units]
        if si and channel not in given:
            factors = [getattr(scales, scale) for scale, _ in units]
            values = values * (factors if len(factors) > 1 else factors[0])
        unit = ", ".join(u for _, u in units) if si else "1"
        if channel.dimension:
            coordinates[channel.dimension] = channel.labels
        dimensions = [*leading, "time", *([channel.dimension] if channel.dimension else [])]
        variables[channel.name] = (dimensions, values, {"long_name": channel.meaning, "units": unit})
        column += channel.width
    step = scenario.run.step * (scenario.run.record_every if every is None else every)
    time = np.arange(first, first + rows.shape[-2]) * step * time_scale(scenario)
    attributes = {"long_name": "time", "units": "s" if si else "1"}
    return xr.Dataset(
        variables,
        coords={"time": ("time", time, attributes), **coordinates},
        attrs={
            "scenario": scenario.to_toml(),
            "version": version("fracgyro"),
            "units": scenario.run.units,
            **({"controller": outside.name} if outside else {}),
        },
    )


def metrics_dataset(values: np.ndarray, thresholds: dict[str, float]) -> xr.Dataset:
    by_name = dict(zip(_core.metric_names, values.T, strict=True))
    windows = ["whole", "transient", "steady"]
    rmse = np.stack([[by_name.pop(f"rmse_{w}_{a}") for a in AXES] for w in windows])
    grouped = {"rmse": (["run", "window", "axis"], np.moveaxis(rmse, -1, 0))}
    for name in ("chattering", "effort"):
        grouped[name] = (["run", "axis"], np.stack([by_name.pop(f"{name}_{a}") for a in AXES], axis=-1))
    bounds = np.stack([by_name.pop(f"bound_{i}") for i in range(3)], axis=-1)
    grouped["bound_final"] = (["run", "bound"], bounds)
    figures = xr.Dataset(
        {**grouped, **{name: ("run", column) for name, column in by_name.items()}},
        coords={"window": windows, "axis": AXES, "bound": [0, 1, 2]},
        attrs={"version": version("fracgyro"), "units": "nondimensional", **thresholds},
    )
    for variable in figures.data_vars.values():
        variable.attrs["units"] = "1"
    return figures


def write_run(run: xr.Dataset, path: Path) -> None:
    """As NetCDF-4."""
    with whole_file(path, replaces_any=False) as scratch:
        run.to_netcdf(scratch, engine="h5netcdf")
