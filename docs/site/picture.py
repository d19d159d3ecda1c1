"""The picture of a controller's page: a closed loop with it, drawn as the site is built."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import fracgyro as fg
import numpy as np
import xarray as xr
from fracgyro.analysis.metrics import true_rate
from fracgyro.analysis.style import COLORS, LETTERS, own_style, svg
from fracgyro.scenario.kinds import SINE_DRIVES
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

# By how hard they are to follow: the first that a controller follows is drawn.
SETUPS: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    ("paper", "the paper's scenario", {}),
    ("dual_mass", "the shipped dual mass gyroscope, both axes driven at resonance", {"run.duration": 4000.0}),
    (
        "dual_mass",
        "the shipped dual mass gyroscope, x driven at resonance",
        {"run.duration": 4000.0, "reference.amplitude": (1.0, 0.0), "run.initial_position": (0.0, 0.0)},
    ),
    (
        "disc",
        "the shipped disc, whose vibration starts along x",
        {"run.duration": 8000.0, "reference.amplitude": (1.0, 0.0), "run.initial_position": (0.0, 0.0)},
    ),
)
FREE = ("whole_angle", "virtual_rotation")  # a vibration on both axes alike, which the disc has
FOLLOWED = 0.1  # RMS error over the reference's, in the second half
POINTS = 200  # points of a curve
# Letters and frames, x, y; on the page's own background, whose style inverts pictures on dark pages.
PALETTE = ("#222222", *COLORS)
SIZE = 3.7, 2.4  # inches: two next to each other, or one on a telephone
MARGINS = {"left": 0.2, "right": 0.97, "bottom": 0.18, "top": 0.89}  # to compute them would take half the time
Values = NDArray[np.float64]


def followed(run: xr.Dataset) -> bool:
    half = run.isel(time=slice(run.sizes["time"] // 2, None))
    error, reference = (np.sqrt((half[name] ** 2).mean("time").values) for name in ("error", "reference"))
    return bool((error < FOLLOWED * reference)[reference > 0].all())


def closed_loop(kind: str) -> tuple[int, xr.Dataset]:
    """The run that is drawn, and the place of its setup in SETUPS. Raises DivergedError if all diverge."""
    for place, (name, _, changes) in enumerate(SETUPS):
        if kind in SINE_DRIVES and place != (3 if kind in FREE else 2):
            continue  # only x is driven
        base = fg.Scenario.paper() if name == "paper" else fg.Scenario.shipped(name)
        try:
            run = fg.simulate(base.replace({"controller.kind": kind, "run.units": "SI", **changes}))
        except fg.DivergedError:
            if place >= 2:
                raise
            continue
        if place >= 2 or followed(run):
            break
    return place, run


def pictures(run: xr.Dataset, title: str) -> Iterator[tuple[str, str]]:
    """(subject, SVG): the tracking error, and the rate estimate or else the control force."""
    second = ("the rate estimate", _draw_rate) if "rate_estimate" in run else ("the control force", _draw_force)
    keys = ("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color")
    with own_style({**LETTERS, "svg.hashsalt": "fracgyro", "font.size": 8, **dict.fromkeys(keys, PALETTE[0])}):
        for shown, draw in (("the tracking error", _draw_error), second):
            figure = Figure(figsize=SIZE)
            figure.patch.set_alpha(0.0)
            panel = figure.subplots(gridspec_kw=MARGINS)
            panel.set_facecolor("none")
            panel.set_xlabel("time (ms)")
            panel.grid(True, linewidth=0.3, alpha=0.5)
            draw(panel, run, PALETTE)
            panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderpad=0.1)
            yield shown, tenths(svg(figure, f"{title}: {shown} over time"))


def tenths(drawn: str) -> str:
    """The SVG with coordinates in tenths of a point; the digits of its words stay."""
    return re.sub(r'"[^"]*"', lambda found: re.sub(r"(\d\.\d)\d+", r"\1", found[0]), drawn)


def _bins(values: Values) -> Values:
    """Samples in POINTS rows of equal length; those left over at the end are left out."""
    length = max(1, len(values) // POINTS)
    return values[: len(values) // length * length].reshape(-1, length, *values.shape[1:])


def _time(run: xr.Dataset) -> Values:
    """Middles of the bins, in ms."""
    found: Values = 1e3 * _bins(run["time"].values).mean(axis=1)
    return found


def _draw_error(panel: Axes, run: xr.Dataset, colors: tuple[str, ...]) -> None:
    largest = 1e9 * _bins(np.abs(run["error"].values)).max(axis=1)
    for i, axis in enumerate(("x", "y")):
        panel.semilogy(_time(run), np.maximum(largest[:, i], 1e-6), color=colors[1 + i], linewidth=1.0, label=axis)
    panel.set_ylabel("largest tracking error (nm)")


def _draw_force(panel: Axes, run: xr.Dataset, colors: tuple[str, ...]) -> None:
    force = 1e6 * _bins(run["control"].values)
    low, high = force.min(axis=1), force.max(axis=1)
    for i, axis in enumerate(("x", "y")):
        _band(panel, run, low[:, i], high[:, i], color=colors[1 + i], alpha=0.7, label=axis)
    _limit(panel, low, high)
    panel.set_ylabel("control force (µN)")


def _draw_rate(panel: Axes, run: xr.Dataset, colors: tuple[str, ...]) -> None:
    true = float(np.mean(true_rate(run)))
    estimate = _bins(run["rate_estimate"].values)
    low, high = estimate.min(axis=1), estimate.max(axis=1)
    _band(panel, run, low, high, color=colors[1], label="estimate")
    panel.axhline(true, color=colors[0], linestyle=":", linewidth=1.0, label="true")
    _limit(panel, np.append(low, true), np.append(high, true))
    panel.set_ylabel("angular rate (rad/s)")


def _band(panel: Axes, run: xr.Dataset, low: Values, high: Values, **style: Any) -> None:
    panel.fill_between(_time(run), low, high, linewidth=0.8, **style)


def _limit(panel: Axes, low: Values, high: Values) -> None:
    """Set the limits of the y axis to the range of the second half of the run."""
    later = slice(len(low) // 2, None)
    bottom, top = float(low[later].min()), float(high[later].max())
    margin = max(0.15 * (top - bottom), 0.02 * abs(top), 1e-9)
    panel.set_ylim(bottom - margin, top + margin)
