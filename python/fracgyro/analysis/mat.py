"""A run as a MAT-file, for MATLAB and Octave."""

from __future__ import annotations

import os

import numpy as np
import xarray as xr

from ..extras import needs
from ..files import whole_file
from .scenarios import texts


def to_mat(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Writes a run as a MAT-file; see `RunAccessor.to_mat`."""
    with needs("interop"):
        from scipy.io import savemat
    variables = {str(name): values for name, values in run.variables.items() if values.dtype.kind in "bfiu"}
    units = {name: str(values.attrs.get("units", "")) for name, values in variables.items()}
    content = {name: np.asarray(values) for name, values in variables.items()}
    scenarios = texts(run).values  # a cell array for several runs
    with whole_file(path, replaces="its kind") as scratch, open(scratch, "wb") as file:
        savemat(
            file,
            {**content, "units": units, "scenario": scenarios.astype(object) if scenarios.ndim else str(scenarios)},
            long_field_names=True,
            oned_as="column",
        )
