"""`run.fracgyro`: what this package knows of a Dataset that `simulate` made, or that was read from its file."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import xarray as xr

from ..extras import needs
from ..scenario import Scenario
from . import metrics
from .mat import to_mat
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

        Raises ValueError if the Dataset has none or several, ScenarioError if it cannot be read.

        >>> fg.simulate(fg.Scenario.paper()).fracgyro.scenario == fg.Scenario.paper()
        True
        """
        found = texts(self._run)
        if found.ndim:
            raise ValueError(f"the Dataset has {found.size} runs: take one, as run.isel(run=0), for its scenario")
        return Scenario.from_toml(str(found.item()))

    def plot(self, figure: Any = None) -> Any:
        """As `fracgyro.plot`.

        >>> figure = fg.simulate(fg.Scenario.paper()).fracgyro.plot()
        """
        with needs("report"):
            from .plots import plot
        return plot(self._run, figure)

    def to_mat(self, path: str | os.PathLike[str]) -> None:
        """Writes a MAT-file for `load` in MATLAB and Octave; needs the extra interop.

        It has every variable, with its dimensions in the order of the Dataset, the struct `units`, and `scenario` as
        TOML, of several runs in a cell array. Raises ValueError, in one sentence, when it cannot be written.

        >>> fg.simulate(fg.Scenario.paper()).fracgyro.to_mat("run.mat")
        """
        to_mat(self._run, path)

    def __getattr__(self, name: str) -> Any:
        if name not in metrics.__all__:
            raise AttributeError(f"{name} is not a metric: known are {', '.join(metrics.__all__)}")
        return partial(getattr(metrics, name), self._run)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *metrics.__all__})
