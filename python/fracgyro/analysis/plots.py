"""Plot of a run."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..files import check_place, whole_file
from . import metrics
from .style import COLORS, LETTERS, own_style, svg

SIZE = 6.7, 7.5  # inches
REFERENCE: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 0.9}
FORMATS = {".svg": b"<?xm", ".png": b"\x89PNG", ".pdf": b"%PDF"}  # first bytes of a file, by suffix
MAX_POINTS = 8000  # per curve


def plot(run: xr.Dataset, figure: Figure | None = None) -> Figure:
    """Draws position, tracking error, control force and, if estimated, the angular rate over time.

    `run`: a Dataset of one run. `figure`: the figure to draw into; by default a new one of pyplot. Returns the figure.
    Requires the extra report. Raises ValueError for a Dataset of several runs.

    >>> figure = fg.plot(fg.simulate(fg.Scenario.paper()))
    >>> len(figure.axes)
    4
    """
    if "run" in run.dims:
        raise ValueError(f"the Dataset has {run.sizes['run']} runs: select one, for example run.isel(run=0)")
    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=SIZE)
    si = run.attrs["units"] == "SI"
    shown = run.isel(time=slice(None, None, -(-run.sizes["time"] // MAX_POINTS)))
    time = shown["time"]
    senses = "rate_estimate" in run
    panels = figure.subplots(4 if senses else 3, 1, sharex=True)
    for i, axis in enumerate(("x", "y")):
        panels[0].plot(time, shown["position"][:, i], color=COLORS[i], label=axis)
        panels[0].plot(time, shown["reference"][:, i], label="reference" if i else "", **REFERENCE)
        size = np.maximum(abs(shown["error"][:, i]), 1e-300)
        panels[1].semilogy(time, size, color=COLORS[i], linewidth=0.7, label=axis)
        panels[2].plot(time, shown["control"][:, i], color=COLORS[i], linewidth=0.7, label=axis)
    if senses:
        _draw_rate(panels[3], shown)
    names = ("position", "tracking error", "control force", "angular rate")
    for panel, name, variable in zip(panels, names, ("position", "error", "control", "rate_estimate"), strict=False):
        unit = f" ({run[variable].attrs['units']})" if si else ""
        panel.set_ylabel(name + unit, fontsize=8)
        panel.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        panel.grid(True, linewidth=0.3)
        panel.tick_params(labelsize=8)
    panels[-1].set_xlabel("time (s)" if si else "time (nondimensional)", fontsize=9)
    figure.align_ylabels()
    figure.subplots_adjust(left=0.13, right=0.83, top=0.97, bottom=0.07, hspace=0.12)
    return figure


def _draw_rate(panel: Axes, run: xr.Dataset) -> None:
    """The estimate with a band of two standard deviations, and the simulated rate; scaled to the settled part."""
    time, estimate = run["time"], run["rate_estimate"]
    truth = metrics.true_rate(run) * xr.ones_like(estimate)
    band = 2 * run["rate_deviation"] if "rate_deviation" in run else 0 * estimate
    if band.any():
        panel.fill_between(time, estimate - band, estimate + band, color=COLORS[0], alpha=0.25, linewidth=0)
    panel.plot(time, estimate, color=COLORS[0], linewidth=0.9, label="estimate\n± 2σ" if band.any() else "estimate")
    panel.plot(time, truth, label="true", **REFERENCE)
    later = slice(time.size // 4, None)
    values = np.concatenate([(estimate + band)[later], (estimate - band)[later], truth])
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.15 * (high - low) or 1.0
    panel.set_ylim(low - margin, high + margin)


def check_plot(path: Path) -> None:
    """Raises ValueError if the suffix is not a known format, or `path` cannot be written."""
    if path.suffix not in FORMATS:
        raise ValueError(f"{path} cannot be drawn: its suffix must be one of {', '.join(FORMATS)}")
    check_place(path, FORMATS[path.suffix])


def write_plot(run: xr.Dataset, path: Path) -> None:
    """Writes `plot` to a file in the format of its suffix. Raises ValueError as `check_plot` does."""
    check_plot(path)
    with own_style(LETTERS):
        figure = plot(run, Figure(figsize=SIZE))
        if path.suffix == ".svg":
            drawn = svg(figure, "A run").encode()
        else:
            memory = io.BytesIO()  # Matplotlib's PDF writer raises other errors if the disk is full
            figure.savefig(memory, format=path.suffix[1:], dpi=150)
            drawn = memory.getvalue()
    with whole_file(path, replaces="its kind") as scratch:
        scratch.write_bytes(drawn)
