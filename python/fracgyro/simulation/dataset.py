"""Conversion of rows from the core to xarray Datasets."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..extras import require
from ..files import whole_file
from ..scenario import Scenario
from ..scenario.kinds import AXES, METRICS, WINDOWS, Channel
from ..scenario.scales import VOLT, si_unit
from .user_controller import UserController
from .user_plant import UserPlant

VERSION = version("fracgyro")
MAX_CACHED = 10**6  # samples of a run whose coordinates are kept for the next one


def time_scale(scenario: Scenario) -> float:
    return scenario.plant.scales.time if scenario.run.units == "SI" else 1.0


def dataset(
    rows: np.ndarray,
    scenarios: Sequence[Scenario],
    channels: tuple[Channel, ...],
    user: UserController | None = None,
    *,
    plant: UserPlant | None = None,
    first: int = 0,
    every: int | None = None,
) -> xr.Dataset:
    """Dataset of one run from rows (sample, column), or of several from rows (run, sample, column).

    Variables are views of the rows unless units must change. Runs share run.step, run.units and, in SI, the unit of
    time. `user`: its reports are already in the units of the run. `first`: sample of the first row;
    `every`: samples between rows, by default run.record_every.
    """
    scenario = scenarios[0]
    si = scenario.run.units == "SI"
    given = (user and user.reports) or ()
    data: dict[str, np.ndarray] = {}
    column = 0
    for channel in channels:
        values = rows[..., column : column + channel.width] if channel.dimension else rows[..., column]
        if si and channel not in given:
            factors = _factors(scenarios, channel)
            values = values * (factors[0] if rows.ndim == 2 else factors)
        data[channel.name] = values
        column += channel.width
    step = scenario.run.step * (scenario.run.record_every if every is None else every)
    form = _form if rows.shape[-2] <= MAX_CACHED else _form.__wrapped__
    run = form(channels, rows.shape[:-1], first, step, time_scale(scenario), si).copy(deep=True, data=data)
    run.attrs = {
        **({"scenario": scenario.to_toml()} if rows.ndim == 2 else {}),
        "version": VERSION,
        "units": scenario.run.units,
        **({"controller": user.name} if user else {}),
        **({"plant": plant.name} if plant else {}),
    }
    return run


def _factors(scenarios: Sequence[Scenario], channel: Channel) -> np.ndarray:
    """SI value of a channel's unit in each run: (run, 1, column), or (run, 1) for a scalar channel."""
    found = {id(s): [s.plant.scales.of(unit) for unit in channel.units] for s in scenarios}
    factors = np.array([found[id(s)] for s in scenarios])[:, np.newaxis]
    return factors if channel.dimension else factors[..., 0]


@lru_cache(maxsize=4)
def _form(
    channels: tuple[Channel, ...], shape: tuple[int, ...], first: int, step: float, scale: float, si: bool
) -> xr.Dataset:
    """The part shared by all runs of this shape: coordinates, their indexes, variable names and attributes."""
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    leading = ["run"] * (len(shape) - 1)
    for channel in channels:
        units = units_of([si_unit(unit) if si or unit == VOLT else "1" for unit in channel.units])
        inner = [channel.dimension] if channel.dimension else []
        if channel.dimension:
            coordinates[channel.dimension] = _fixed(channel.labels)
        values = np.broadcast_to(0.0, (*shape, channel.width) if inner else shape)
        variables[channel.name] = ([*leading, "time", *inner], values, {"long_name": channel.meaning, **units})
    time = _fixed(np.arange(first, first + shape[-1]) * step * scale)
    attributes = {"long_name": "time", "units": "s" if si else "1"}
    return xr.Dataset(variables, coords={"time": ("time", time, attributes), **coordinates})


def units_of(columns: Sequence[str]) -> dict[str, str]:
    """The attribute `units` in pint's syntax, or `column_units` if the columns have different units."""
    return {"units": columns[0]} if len(set(columns)) == 1 else {"column_units": ", ".join(columns)}


def _fixed(values: ArrayLike) -> np.ndarray:
    """A read-only array, which several Datasets share."""
    array = np.array(values)
    array.flags.writeable = False
    return array


def metrics_dataset(values: np.ndarray, thresholds: dict[str, float]) -> xr.Dataset:
    """One row of the core's metrics for each run, as variables; the RMS error over its windows is one variable."""
    ends = np.cumsum([metric.width for metric in METRICS])
    columns = np.split(values, ends[:-1], axis=1)
    found = {m.name: part if m.width > 1 else part[:, 0] for m, part in zip(METRICS, columns, strict=True)}
    rmse = np.stack([found.pop(f"rmse_{window}") for window in WINDOWS], axis=1)
    figures = _metrics_form(len(values)).copy(deep=True, data={"rmse": rmse, **found})
    figures.attrs = {"version": VERSION, "units": "nondimensional", **thresholds}
    return figures


@lru_cache(maxsize=4)
def _metrics_form(runs: int) -> xr.Dataset:
    """The Dataset of the metrics with zeros, to be filled by `copy`."""
    labels = {"window": _fixed(WINDOWS), "axis": _fixed(AXES), "bound": _fixed([0, 1, 2])}
    inner = {"rmse": ["window", "axis"]} | {m.name: [m.dimension] for m in METRICS if m.dimension}
    inner |= {m.name: [] for m in METRICS if not m.dimension}

    def variable(dimensions: list[str]) -> tuple[list[str], np.ndarray, dict[str, str]]:
        shape = (runs, *(len(labels[dimension]) for dimension in dimensions))
        return ["run", *dimensions], np.broadcast_to(0.0, shape), {"units": "1"}

    named = {name: variable(of) for name, of in inner.items() if name.partition("_")[2] not in WINDOWS}
    return xr.Dataset(named, coords=labels)


def write_run(run: xr.Dataset, path: Path) -> None:
    """Writes a run as NetCDF-4."""
    memory = _netcdf(run)
    with whole_file(path, replaces="its kind") as scratch:
        scratch.write_bytes(memory.getbuffer())


def _netcdf(run: xr.Dataset) -> io.BytesIO:
    """The bytes of a NetCDF-4 file. HDF5 crashes if it writes to a full disk itself."""
    require("netcdf", "h5netcdf")
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    memory = io.BytesIO()
    with h5netcdf.File(memory, "w") as file:
        run.dump_to_store(H5NetCDFStore(file))
    return memory
