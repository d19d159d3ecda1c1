"""Plot of runs."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..arguments import short
from ..files import check_place, whole_file
from . import metrics
from .channel_units import Scaled, scaled
from .decimation import band, crossings, decimate, largest
from .style import COLORS, LETTERS, MM, WIDTH, own_style, svg

PALETTE = (*COLORS, "#009E73", "#CC79A7", "#56B4E9", "#E69F00")  # Okabe and Ito's, for color-blind readers
REFERENCE: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 0.8}
FORMATS = {".svg": b"<?xm", ".png": b"\x89PNG", ".pdf": b"%PDF"}  # first bytes of a file, by suffix
CHANNELS = ("position", "error", "control", "rate_estimate")
NAMES = {
    "position": "position",
    "error": "|error|",
    "control": "force",
    "rate_estimate": "rate",
}
COLUMNS = 1500  # pixel columns: each keeps the extremes of its samples
DENSE = COLUMNS // 4  # a curve with more crossings of its mean is drawn as a band
FOLLOWED = ("reference", "true rate")  # last in legends
DECADES = 12.0  # below the largest error
NARROW = 100.0  # mm: up to this width letters have 7 points, beyond it 8
UNITS = {"mm": 1.0, "cm": 10.0, "in": 25.4}

Run = xr.Dataset
Array = NDArray[np.float64]


def plot(
    run: Run | Mapping[str, Run],
    figure: Figure | None = None,
    *,
    channels: Sequence[str] | None = None,
    width: str = f"{WIDTH:g} mm",
) -> Figure:
    """Draws channels of one run, or of several, over time, and returns the figure.

    `run`: a Dataset of one run, or a dict of names to such Datasets, which share the panels. `channels`: names of
    variables; by default position, error, control and, if estimated, rate_estimate. The error is drawn as its
    magnitude, the rate with its standard deviation and the true rate. `width`: of a new figure, "89 mm" for a column of
    a journal; the letters are then of 7 points. `figure`: the figure to draw into; by default a new one of pyplot.
    Curves are drawn by their extremes in each pixel column, so that oscillations keep their size; a
    fast oscillation becomes a band from its least to its largest value.

    Requires the extra report. Raises ValueError for a Dataset of several runs, runs in different units, an unknown
    channel or another `width`.

    >>> figure = fg.plot(fg.simulate(fg.Scenario.paper()))
    >>> len(figure.axes)
    4
    """
    runs = dict(run) if isinstance(run, Mapping) and not isinstance(run, xr.Dataset) else {"": run}
    chosen = _checked(runs, channels)
    several = len(runs) > 1
    first = next(iter(runs.values()))
    places = [(name, place) for name in chosen for place in (_columns(first, name) if several else [None])]
    wide = _millimeters(width)
    letters = 7 if wide <= NARROW else 8
    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=_size(wide, len(places)))
    figure.set_layout_engine("constrained")
    panels = np.atleast_1d(figure.subplots(len(places), 1, sharex=True))
    time = scaled(runs.values(), "time")
    for panel, (name, place) in zip(panels, places, strict=True):
        unit = scaled((each for each in runs.values() if name in each), name)
        for number, (label, each) in enumerate(runs.items()):
            if name in each:
                _draw(
                    panel, each, name, place, (time, unit), (label, PALETTE[number % len(PALETTE)]) if several else None
                )
        axis = "" if place is None or _width(first, name) == 1 else f" {_labels(first, name)[place]}"
        words = NAMES.get(name, name.replace("_", " ")) + axis
        panel.set_ylabel(words + (f"\n({unit.unit})" if unit.unit else ""), fontsize=letters)
        panel.grid(True, linewidth=0.3)
        panel.set_axisbelow(True)
        panel.margins(x=0.01)
        panel.tick_params(labelsize=letters)
        panel.yaxis.get_offset_text().set_fontsize(letters)
    panels[-1].set_xlabel(f"time ({time.unit})", fontsize=letters)
    figure.align_ylabels()
    _legends(panels, letters)
    return figure


def _checked(runs: Mapping[str, Run], channels: Sequence[str] | None) -> list[str]:
    """The channels to draw. Raises ValueError for what cannot be drawn."""
    if not runs:
        raise ValueError("run is {}: it must have at least one run")
    for run in runs.values():
        if "run" in run.dims:
            raise ValueError(f"the Dataset has {run.sizes['run']} runs: select one, for example run.isel(run=0)")
    if len(units := {run.attrs["units"] for run in runs.values()}) > 1:
        raise ValueError(f"the runs have units {' and '.join(sorted(units))}: they must be the same")
    known = dict.fromkeys(str(name) for run in runs.values() for name, v in run.data_vars.items() if "time" in v.dims)
    if channels is None:
        return [name for name in CHANNELS if name in known]
    for name in channels:
        if name not in known:
            raise ValueError(f"channels has {short(name)}: it must have some of {', '.join(known)}")
    if isinstance(channels, str) or not channels:
        raise ValueError(f"channels is {short(channels)}: it must be a list of at least one channel")
    return list(channels)


def _millimeters(width: str) -> float:
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(mm|cm|in)\s*", width) if isinstance(width, str) else None
    size = float(found[1]) * UNITS[found[2]] if found else 0.0
    if not 30.0 <= size <= 1000.0:
        raise ValueError(f'width is {short(width)}: it must be from 30 mm to 1000 mm, as "89 mm", "8.9 cm" or "3.5 in"')
    return size


def _size(width: float, panels: int) -> tuple[float, float]:
    """Size of a figure in inches, from its width in mm."""
    return width * MM, (14.0 + panels * min(42.0, max(24.0, 0.27 * width))) * MM


def _columns(run: Run, name: str) -> list[int]:
    return list(range(_width(run, name)))


def _width(run: Run, name: str) -> int:
    return int(np.prod(run[name].shape[1:])) if name in run else 1


def _labels(run: Run, name: str) -> list[str]:
    dimension = run[name].dims[-1]
    return list(map(str, run[dimension].values)) if dimension in run.coords else list(map(str, _columns(run, name)))


def _draw(
    panel: Axes, run: Run, name: str, place: int | None, units: tuple[Scaled, Scaled], own: tuple[str, str] | None
) -> None:
    """One channel of one run: a column of it, or all; `own`: name and color of the run, if there are several."""
    time, unit = run["time"].values / units[0].scale, units[1].scale
    values = run[name].values.reshape(time.size, -1) / unit
    if name == "rate_estimate":
        return _draw_rate(panel, run, time, unit, own)
    followed: list[Array] = []
    for column in range(values.shape[1]) if place is None else [place]:
        label = own[0] if own else _labels(run, name)[column] if values.shape[1] > 1 else name
        style: dict[str, Any] = {
            "color": own[1] if own else PALETTE[column % len(PALETTE)],
            "linewidth": 0.8,
            "label": label,
        }
        shown = values[:, column]
        if name == "error":
            panel.semilogy(*largest(time, _positive(abs(shown)), COLUMNS), **style)
        elif (found := crossings(shown)) > DENSE:
            style |= {"linewidth": 0.5, "alpha": 0.5}
            panel.fill_between(*band(time, shown, max(50, found // 4)), **style)
        else:
            panel.plot(*decimate(time, shown, COLUMNS), **style)
            if name == "position":
                followed.append(run["reference"].values[:, column] / unit)
    for number, reference in enumerate(followed):
        panel.plot(*decimate(time, reference, COLUMNS), **REFERENCE, label="" if number else "reference")


def _positive(sizes: Array) -> Array:
    """Sizes for a logarithmic axis of at most DECADES, on which a mass at rest may have no error at all."""
    peak = float(sizes.max())
    return np.maximum(sizes, 10.0**-DECADES * peak) if peak > 0 else np.full_like(sizes, np.nan)


def _draw_rate(panel: Axes, run: Run, time: Array, unit: float, own: tuple[str, str] | None) -> None:
    """The estimate with a band of two standard deviations, and the true rate; scaled to the settled part."""
    estimate: Array = run["rate_estimate"].values / unit
    truth: Array = (metrics.true_rate(run) * xr.ones_like(run["rate_estimate"])).values / unit
    spread: Array = 2 * run["rate_deviation"].values / unit if "rate_deviation" in run else 0.0 * estimate
    label, color = own or ("estimate ± 2σ" if spread.any() else "estimate", PALETTE[0])
    if spread.any():
        middle, _, high = band(time, estimate + spread, COLUMNS)
        low = band(time, estimate - spread, COLUMNS)[1]
        panel.fill_between(middle, low, high, color=color, alpha=0.25, linewidth=0)
    panel.plot(*decimate(time, estimate, COLUMNS), color=color, linewidth=0.8, label=label)
    panel.plot(*decimate(time, truth, COLUMNS), **REFERENCE, label="true rate")
    later = slice(time.size // 4, None)
    values = np.concatenate([(estimate + spread)[later], (estimate - spread)[later], truth])
    margin = 0.15 * float(np.ptp(values)) or 1.0
    bottom, top = float(values.min()) - margin, float(values.max()) + margin
    before = panel.get_ylim() if own and len(panel.lines) > 2 else (bottom, top)
    panel.set_ylim(min(bottom, before[0]), max(top, before[1]))


def _legends(panels: Iterable[Axes], letters: float) -> None:
    """A legend above each panel that has names which no panel above it has."""
    known: set[str] = set()
    for panel in panels:
        found = dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
        named = {name: found[name] for name in sorted(found, key=lambda name: name in FOLLOWED)}
        if len(named) > 1 and not known >= set(named):
            panel.legend(
                list(named.values()),
                list(named),
                loc="lower right",
                bbox_to_anchor=(1.0, 0.97),
                ncols=5,
                fontsize=letters,
                frameon=False,
                handlelength=1.6,
                columnspacing=1.2,
                borderpad=0.1,
            )
        known |= set(named)


def check_plot(path: Path) -> None:
    """Raises ValueError if the suffix is not a known format, or `path` cannot be written."""
    if path.suffix not in FORMATS:
        raise ValueError(f"{path} cannot be drawn: its suffix must be one of {', '.join(FORMATS)}")
    check_place(path, FORMATS[path.suffix])


def write_plot(run: Run | Mapping[str, Run], path: Path, **options: Any) -> None:
    """Writes `plot`, with its options, in the format of the suffix. Raises ValueError as `check_plot` does."""
    check_plot(path)
    with own_style(LETTERS):
        wide = _millimeters(options.get("width", f"{WIDTH:g} mm"))
        figure = plot(run, Figure(figsize=_size(wide, 4)), **options)
        figure.set_size_inches(*_size(wide, len(figure.axes)))
        if path.suffix == ".svg":
            drawn = svg(figure, "A run").encode()
        else:
            memory = io.BytesIO()  # Matplotlib's PDF writer raises other errors if the disk is full
            figure.savefig(memory, format=path.suffix[1:], dpi=200)
            drawn = memory.getvalue()
    with whole_file(path, replaces="its kind") as scratch:
        scratch.write_bytes(drawn)
