"""One picture of one run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..files import whole_file
from . import metrics
from .style import COLORS, own_style


def plot_run(run: xr.Dataset, path: Path) -> None:
    """Tracking, error, control force and rate estimate over time; the format is that of the suffix.

    Raises ValueError when the suffix is not a format that Matplotlib writes, or the file cannot be written.
    """
    with own_style({}):
        _plot_run(run, path)


def _plot_run(run: xr.Dataset, path: Path) -> None:
    figure = Figure(figsize=(6.7, 7.5))
    canvas = FigureCanvasAgg(figure)
    formats = canvas.get_supported_filetypes()
    if path.suffix.lstrip(".") not in formats:
        raise ValueError(f"{path} cannot be drawn: its suffix must be one of {', '.join(sorted(formats))}")
    si = run.attrs["units"] == "SI"
    time = run["time"]
    stride = slice(None, None, max(1, time.size // 8000))
    senses = "rate_estimate" in run
    panels = figure.subplots(4 if senses else 3, 1, sharex=True)
    for i, axis in enumerate(("x", "y")):
        panels[0].plot(time[stride], run["position"][stride, i], color=COLORS[i], label=f"{axis}")
        panels[0].plot(time[stride], run["reference"][stride, i], color="black", linestyle=":", linewidth=0.8)
        size = np.maximum(abs(run["error"][stride, i]), 1e-300)
        panels[1].semilogy(time[stride], size, color=COLORS[i], linewidth=0.7, label=axis)
        panels[2].plot(time[stride], run["control"][stride, i], color=COLORS[i], linewidth=0.7, label=axis)
    if senses:
        off = np.maximum(abs(metrics.rate_error(run)), 1e-300)
        panels[3].semilogy(time[stride], off[stride], color=COLORS[0], linewidth=0.9, label="Ωz")
    names = ("position q, reference (dotted)", "error |e|", "control force u", "error of rate estimate")
    for panel, name, variable in zip(panels, names, ("position", "error", "control", "rate_estimate"), strict=False):
        unit = f" ({run[variable].attrs['units']})" if si else ""
        panel.set_ylabel(name + unit, fontsize=8)
        panel.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        panel.grid(True, linewidth=0.3)
        panel.tick_params(labelsize=8)
    panels[-1].set_xlabel("time (s)" if si else "time (nondimensional)", fontsize=9)
    figure.align_ylabels()
    figure.subplots_adjust(left=0.12, right=0.91, top=0.98, bottom=0.07, hspace=0.12)
    with whole_file(path, replaces="its kind") as scratch:
        figure.savefig(scratch, dpi=150)
