"""`run.fracgyro`: metrics, plot and scenario of a Dataset from `simulate` or read from its file."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import xarray as xr

from ..extras import needs
from ..scenario import Scenario
from . import metrics
from .mat import to_mat
from .run_files import to_csv
from .scenarios import texts


@xr.register_dataset_accessor("fracgyro")
class RunAccessor:
    """`run.fracgyro`: the functions of `fracgyro.metrics` and `fracgyro.plot` as methods of a run, and its scenario.

    >>> run = fg.simulate(fg.Scenario.paper())
    >>> bool((run.fracgyro.rmse(window=(10, None)) == fg.metrics.rmse(run, window=(10, None))).all())
    True
    """

    def __init__(self, run: xr.Dataset) -> None:
        self._run = run

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run.

        Raises ValueError for a Dataset with no scenario or several, ScenarioError for an invalid one.

        >>> fg.simulate(fg.Scenario.paper()).fracgyro.scenario == fg.Scenario.paper()
        True
        """
        found = texts(self._run)
        if found.ndim:
            raise ValueError(f"the Dataset has {found.size} runs: select one, for example run.isel(run=0)")
        return Scenario.from_toml(str(found.item()))

    def plot(self, figure: Any = None, **options: Any) -> Any:
        """Draws the run with `fracgyro.plot`, and its options.

        >>> figure = fg.simulate(fg.Scenario.paper()).fracgyro.plot()
        """
        with needs("report"):
            from .plots import plot
        return plot(self._run, figure, **options)

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Writes the run as CSV with a header row, `time,position_x,...`, in full precision.

        Two lines before it start with #: version and scenario hash, and units. pandas skips them:
        `pandas.read_csv(path, comment="#")`. Raises ValueError for several runs or a file that cannot be written.

        >>> fg.simulate(fg.Scenario.paper()).fracgyro.to_csv("run.csv")
        >>> pathlib.Path("run.csv").read_text().splitlines()[2][:30]
        'time,position_x,position_y,vel'
        """
        to_csv(self._run, path)

    def to_mat(self, path: str | os.PathLike[str]) -> None:
        """Writes a MAT-file for `load` in MATLAB and Octave; needs the extra interop.

        The file has every variable, with the dimensions in the order of the Dataset, the struct `units`, and `scenario`
        as TOML, a cell array for several runs. Raises ValueError if it cannot be written.

        >>> fg.simulate(fg.Scenario.paper()).fracgyro.to_mat("run.mat")
        """
        to_mat(self._run, path)

    def __getattr__(self, name: str) -> Any:
        if name not in metrics.__all__:
            raise AttributeError(f"{name} is not a metric: it must be one of {', '.join(metrics.__all__)}")
        return partial(getattr(metrics, name), self._run)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *metrics.__all__})
