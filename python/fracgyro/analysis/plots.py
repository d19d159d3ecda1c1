"""Plot of runs."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arguments import short
from ..files import check_place, whole_file
from .bode import draw_bode, is_response, response_of
from .channel_units import scaled
from .panels import PALETTE, Own, clip, draw, labels, overlapping, width_of
from .style import LETTERS, MM, WIDTH, own_style, svg
from .tasks import drives

FORMATS = {".svg": b"<?xm", ".png": b"\x89PNG", ".pdf": b"%PDF"}  # first bytes of a file, by suffix
CHANNELS = ("position", "error", "control", "rate_estimate")
OF_A_CHIRP = ("position", "error", "control")  # above its frequency response
OF_A_DRIVE = ("drive_amplitude", "drive_frequency", "quadrature", "control", "rate_estimate")
NAMES = {"error": "|error|", "control": "force", "rate_estimate": "rate"}
FOLLOWED = ("reference", "set point", "true rate")  # last in legends
TALL = 216.0  # mm: panels of more than this together are lower
NARROW = 100.0  # mm: up to this width letters have 7 points, beyond it 8
UNITS = {"mm": 1.0, "cm": 10.0, "in": 25.4}

Run = xr.Dataset


def plot(
    run: Run | Mapping[str, Run],
    figure: Figure | None = None,
    *,
    channels: Sequence[str] | None = None,
    width: str = f"{WIDTH:g} mm",
) -> Figure:
    """Draws channels of one run, or of several, over time, and returns the figure.

    `run`: a Dataset of one run, or a dict of names to such Datasets, which share the panels. `channels`: names of
    variables; by default position, error, control and, if estimated, rate_estimate. For a chirp the default adds the
    frequency response; for a conventional gyroscope it is drive_amplitude, with its set point, drive_frequency,
    quadrature, control and rate_estimate. Datasets of `metrics.frequency_response` become a Bode plot.

    The error is drawn as its magnitude, the rate with its standard deviation and the true rate. `width`: of a new
    figure, "89 mm" for a column of a journal; the letters are then of 7 points. `figure`: the figure to draw into; by
    default a new one of pyplot. Curves are drawn by their extremes in each pixel column, so that oscillations keep
    their size; a fast oscillation becomes a band from its least to its largest value. A spike of the force that would
    flatten the rest is clipped, and its value stated.

    Requires the extra report. Raises ValueError for a Dataset of several runs, runs in different units, an unknown
    channel or another `width`.

    >>> figure = fg.plot(fg.simulate(fg.Scenario.paper()))
    >>> len(figure.axes)
    4
    """
    runs = dict(run) if isinstance(run, Mapping) and not isinstance(run, xr.Dataset) else {"": run}
    own = {name: PALETTE[number % len(PALETTE)] for number, name in enumerate(runs)}
    wide = _millimeters(width)
    letters = 7 if wide <= NARROW else 8
    if runs and all(map(is_response, runs.values())):
        responses, places = runs, []
    else:
        chosen = _checked(runs, channels)
        found = {name: response_of(each) for name, each in runs.items()} if channels is None else {}
        responses = {name: each for name, each in found.items() if each is not None}
        if channels is None and responses:
            chosen = [name for name in chosen if name in OF_A_CHIRP]
        split = bool(responses) or all(map(drives, runs.values()))
        places = [(name, each) for name in chosen for each in _places(runs, name, split=split)]
    count = len(places) + (2 if responses else 0)
    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=_size(wide, count))
    figure.set_layout_engine("constrained")
    panels = _panels(figure, len(places), count)
    if places:
        _draw_over_time(panels[: len(places)], runs, places, own, letters)
    if responses:
        draw_bode(panels[-2], panels[-1], responses, own)
    for panel in panels:
        _lettered(panel, letters)
    figure.align_ylabels()
    _legends(panels, letters)
    return figure


def _panels(figure: Figure, over_time: int, count: int) -> list[Axes]:
    """Panels below one another; those over time share it, and so do those over frequency."""
    grid, panels = figure.add_gridspec(count, 1), list[Axes]()
    for first, end in ((0, over_time), (over_time, count)):
        for place in range(first, end):
            shared = panels[first] if place > first else None
            panels.append(figure.add_subplot(grid[place], sharex=shared))
            panels[-1].tick_params(which="both", labelbottom=place == end - 1)
    return panels


Place = tuple[str, list[int]]  # a channel and those of its columns that share a panel


def _places(runs: Mapping[str, Run], name: str, *, split: bool) -> list[list[int]]:
    """Columns of each panel of a channel: all, or one if there are several runs or curves would hide each other."""
    having = [run for run in runs.values() if name in run]
    columns = list(range(width_of(having[0], name)))
    apart = len(runs) > 1 or (split and name != "error") or any(overlapping(run, name) for run in having)
    return [[column] for column in columns] if apart else [columns]


def _draw_over_time(
    panels: Sequence[Axes], runs: Mapping[str, Run], places: Sequence[Place], own: Mapping[str, str], letters: float
) -> None:
    several = len(runs) > 1
    time = scaled(runs.values(), "time")
    for panel, (name, columns) in zip(panels, places, strict=True):
        having = {label: each for label, each in runs.items() if name in each}
        units = time, scaled(having.values(), name)
        for label, each in having.items():
            draw(panel, each, name, columns, units, Own(label, own[label]) if several else None)
        first = next(iter(having.values()))
        single = len(columns) == 1 and width_of(first, name) > 1
        words = NAMES.get(name, name.replace("_", " ")) + (f" {labels(first, name)[columns[0]]}" if single else "")
        panel.set_ylabel(words + (f"\n({units[1].unit})" if units[1].unit else ""))
        if spike := clip(panel, list(having.values()), name, columns, units):
            panel.set_title(spike, loc="left", fontsize=letters, pad=3)
        panel.grid(True, linewidth=0.3)
        panel.margins(x=0.01)
    panels[-1].set_xlabel(f"time ({time.unit})")


def _lettered(panel: Axes, letters: float) -> None:
    panel.set_axisbelow(True)
    panel.tick_params(which="both", labelsize=letters)
    panel.yaxis.get_offset_text().set_fontsize(letters)
    for axis in (panel.xaxis, panel.yaxis):
        axis.label.set_fontsize(letters)


def _checked(runs: Mapping[str, Run], channels: Sequence[str] | None) -> list[str]:
    """The channels to draw. Raises ValueError for what cannot be drawn."""
    if not runs:
        raise ValueError("run is {}: it must have at least one run")
    for run in runs.values():
        if is_response(run):
            raise ValueError("run has a frequency response and a run: it must have only one of these")
        if "run" in run.dims:
            raise ValueError(f"the Dataset has {run.sizes['run']} runs: select one, for example run.isel(run=0)")
    if len(units := {run.attrs["units"] for run in runs.values()}) > 1:
        raise ValueError(f"the runs have units {' and '.join(sorted(units))}: they must be the same")
    known = dict.fromkeys(str(name) for run in runs.values() for name, v in run.data_vars.items() if "time" in v.dims)
    if channels is None:
        default = OF_A_DRIVE if all(map(drives, runs.values())) else CHANNELS
        return [name for name in default if name in known]
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
    height = min(42.0, max(24.0, 0.27 * width), max(24.0, TALL / panels))
    return width * MM, (14.0 + panels * height) * MM


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
