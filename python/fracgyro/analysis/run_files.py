"""A run as a file in the format of its suffix: NetCDF, CSV, Parquet or MAT."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..extras import needs, require
from ..files import check_place, whole_file
from ..scenario import Scenario
from ..simulation.dataset import write_run
from .mat import to_mat
from .scenarios import texts


def to_csv(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Writes a run as CSV; see `RunAccessor.to_csv`."""
    named, memory = _columns(run), io.StringIO()
    memory.write("".join(f"# {line}\n" for line in _head(run)))
    rows = csv.writer(memory, lineterminator="\n")
    rows.writerow(named)
    rows.writerows(np.column_stack(list(named.values())).tolist())  # Python's floats: in the fewest digits that suffice
    with whole_file(path, replaces="its kind") as scratch:
        scratch.write_text(memory.getvalue(), encoding="utf-8", newline="\n")


def to_parquet(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Writes a run as Parquet: the columns of `to_csv`, with the scenario and the units as metadata."""
    with needs("study"):
        import pyarrow as pa
        from pyarrow import parquet
    named, units = _columns(run), dict(_units(run))
    fields = [pa.field(name, pa.float64(), metadata={"units": units[name]}) for name in named]
    about = {"scenario": str(texts(run).item()), "version": version("fracgyro"), "units": str(run.attrs["units"])}
    memory = io.BytesIO()
    parquet.write_table(pa.table(list(named.values()), schema=pa.schema(fields, metadata=about)), memory)
    with whole_file(path, replaces="its kind") as scratch:
        scratch.write_bytes(memory.getbuffer())


class Format(NamedTuple):
    """A format: first bytes of a file, extra and module that it needs, writer."""

    beginning: bytes
    extra: str
    module: str
    write: Callable[[xr.Dataset, Path], None]


FORMATS = {
    ".nc": Format(b"\x89HDF", "netcdf", "h5netcdf", write_run),
    ".csv": Format(b"# fr", "", "", to_csv),
    ".parquet": Format(b"PAR1", "study", "pyarrow", to_parquet),
    ".mat": Format(b"MATL", "interop", "scipy", to_mat),
}


def check_file(path: Path) -> None:
    """Raises ValueError for another suffix or a path that cannot be written, MissingExtraError for a missing library.

    Call it before a long run.
    """
    if path.suffix not in FORMATS:
        raise ValueError(f"{path} cannot be written: its suffix must be one of {', '.join(FORMATS)}")
    found = FORMATS[path.suffix]
    if found.module:
        require(found.extra, found.module)
    check_place(path, found.beginning)


def write_file(run: xr.Dataset, path: Path) -> None:
    """Writes a run in the format of the suffix. Raises what `check_file` raises."""
    check_file(path)
    FORMATS[path.suffix].write(run, path)


def _columns(run: xr.Dataset) -> dict[str, NDArray[np.float64]]:
    """The numbers over time by column, as time, position_x, ... Raises ValueError for several runs."""
    if "run" in run.dims:
        raise ValueError(f"the Dataset has {run.sizes['run']} runs: select one, for example run.isel(run=0)")
    found = {"time": run["time"].values}
    for name, values in run.data_vars.items():
        if values.dims == ("time",):
            found[str(name)] = values.values
        elif values.dims[:1] == ("time",):
            for place, label in enumerate(_labels(run, values)):
                found[f"{name}_{label}"] = values.values[:, place]
    return found


def _labels(run: xr.Dataset, values: xr.DataArray) -> list[str]:
    dimension = values.dims[1]
    return list(map(str, run[dimension].values if dimension in run.coords else range(values.sizes[dimension])))


def _units(run: xr.Dataset) -> Iterator[tuple[str, str]]:
    """The unit of each column."""
    yield "time", str(run["time"].attrs.get("units", "1"))
    for name, values in run.data_vars.items():
        several = str(values.attrs.get("column_units", "")).split(", ")
        unit = str(values.attrs.get("units", "1"))
        if values.dims == ("time",):
            yield str(name), unit
        elif values.dims[:1] == ("time",):
            labels = _labels(run, values)
            units = several if len(several) == len(labels) else [unit] * len(labels)
            yield from ((f"{name}_{label}", each) for label, each in zip(labels, units, strict=True))


def _head(run: xr.Dataset) -> Iterator[str]:
    scenario = Scenario.from_toml(str(texts(run).item()))
    plant = scenario.plant
    yield f"fracgyro {version('fracgyro')}, scenario {scenario.content_hash()}"
    if run.attrs["units"] == "SI":
        yield "units: " + ", ".join(f"{name} {unit}" for name, unit in _units(run))
    else:
        yield (
            f"units: nondimensional, with q0 = {plant.reference_length!r} m, omega0 = {plant.reference_frequency!r} "
            f"rad/s, m = {plant.mass!r} kg"
        )
