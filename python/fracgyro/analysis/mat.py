"""A run as a MAT-file, for MATLAB and Octave."""

from __future__ import annotations

import os

import numpy as np
import xarray as xr

from ..extras import needs
from ..files import whole_file


def to_mat(run: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """As `RunAccessor.to_mat`."""
    with needs("interop"):
        from scipy.io import savemat
    variables = {str(name): values for name, values in run.variables.items() if values.dtype.kind in "bfiu"}
    units = {name: str(values.attrs.get("units", "")) for name, values in variables.items()}
    content = {name: np.asarray(values) for name, values in variables.items()}
    with whole_file(path) as scratch, open(scratch, "wb") as file:
        savemat(
            file,
            {**content, "units": units, "scenario": run.attrs.get("scenario", "")},
            long_field_names=True,
            oned_as="column",
        )
