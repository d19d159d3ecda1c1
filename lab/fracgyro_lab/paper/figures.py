"""Figures 3 to 19 of the paper: on the left as printed, on the right corrected.

Reading order: `FIGURES`, `_cells` (which views of a quantity stand where), `_plan`, `draw`; then drawing.py.

A figure shows the paper's quantities over the whole run. Where one scale hides the story it has more views:
    whole     the whole run, scaled to everything in it
    early     the first EARLY units of time, scaled to everything in them
    late      the whole run, scaled to what follows LATE; what comes before may leave the panel
    envelope  the whole run: the largest magnitude in each pixel column, on a logarithmic scale
Data are decimated before they are drawn: each pixel column keeps its extremes, so that noise keeps its width.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from fracgyro.analysis.decimation import decimate
from fracgyro.scenario import Scenario
from fracgyro.scenario.kinds import LOOP_CHANNELS, reported_channels
from fracgyro.scenario.to_core import core_setup

from .drawing import (
    BLOCK,
    BLOCKS,
    COLUMNS_PER_MM,
    HEADINGS,
    NARROW,
    Array,
    Box,
    Cell,
    Panel,
    Plan,
    Row,
    View,
    envelope,
    render,
)

Runs = Mapping[tuple[str, str], xr.Dataset]
Layout = Literal["motion", "settling", "estimates", "growth"]

EARLY, LATE = 10.0, 15.0

# mm: the wide panels, the gaps between rows and between groups of rows, the room for the time axis
WIDE = 38.5
ROW_GAP, GROUP_GAP, FOOT = 4.5, 12.0, 9.5
INSETS: dict[str, Box] = {"x": (0.29, 0.03, 0.69, 0.41), "y": (0.29, 0.46, 0.69, 0.41)}  # in parts of a panel

FORCE, DAMPING, STIFFNESS = r"(m\omega_0^2q_0)", r"(m\omega_0)", r"(m\omega_0^2)"
NAMES = {
    "proposed": "the proposed fractional fast terminal controller",
    "fractional": "the fractional sliding mode controller",
    "conventional": "the conventional fast terminal controller",
}
ALL = list(NAMES)
# first number, controllers, title, layout, variable, symbol (? is a column's name), units of columns
CONTENTS: list[tuple[int, list[str], str, Layout, str, str, list[str]]] = [
    (3, ALL[:1], "Position and its reference", "motion", "position", "?", ["q_0"] * 2),
    (4, ALL, "Tracking error", "settling", "error", "e_?", ["q_0"] * 2),
    (7, [ALL[0], ALL[2]], "Sliding surface", "settling", "surface", "s_?", [r"(q_0\omega_0)"] * 2),
    (9, ALL[:1], "Control force", "motion", "control", "u_?", [FORCE] * 2),
    (10, ALL, "Damping estimates", "estimates", "damping_estimate", r"\hat d_{?}", [DAMPING] * 3),
    (13, ALL, "Stiffness estimates", "estimates", "stiffness_estimate", r"\hat k_{?}", [STIFFNESS] * 3),
    (16, ALL, "Angular rate estimate", "estimates", "rate_estimate", r"\hat\Omega_z", [r"\omega_0"]),
    (19, ALL[:1], "Bound estimates", "growth", "bound_estimate", r"\hat b_?", [FORCE, STIFFNESS, DAMPING]),
]


@dataclass(frozen=True)
class FigureSpec:
    number: int
    controller: str
    caption: str
    layout: Layout
    rows: tuple[Row, ...]

    @property
    def stem(self) -> str:
        return f"figure{self.number:02d}"


def _specs() -> Iterator[FigureSpec]:
    channels = {channel.name: channel for channel in (*LOOP_CHANNELS, *reported_channels(core_setup(Scenario.paper())))}
    for first, controllers, what, layout, variable, symbol, units in CONTENTS:
        channel = channels[variable]
        names: Any = channel.labels if channel.dimension else [""]
        styles = names if channel.dimension == "axis" else ["estimate"] * len(names)
        columns = zip(range(len(names)), names, units, styles, strict=True)
        rows = tuple(
            Row(variable, i, symbol.replace("?", str(name)), unit, style, _words(variable, name, unit))
            for i, name, unit, style in columns
        )
        for number, controller in enumerate(controllers, start=first):
            yield FigureSpec(number, controller, f"{what}: {NAMES[controller]}", layout, rows)


def _words(variable: str, name: Any, unit: str) -> str:
    """`damping_estimate`, xx and its unit for formulas: damping estimate xx (m omega0)."""
    plain = re.sub(r"\\?(omega|q)_0", r" \g<1>0", unit.strip("()")).strip()
    return f"{variable.replace('_', ' ')} {name}".strip() + f" ({plain})"


FIGURES = {spec.number: spec for spec in _specs()}


def _cells(spec: FigureSpec) -> Iterator[Cell]:
    rows, last, top = spec.rows, spec.rows[-1], 7.0
    if spec.layout == "motion":
        views: tuple[View, View] = ("whole", "early")
        for view in views:
            for row in rows:
                yield Cell((row,), view, (0.0, top, BLOCK, 25.0), row is last)
                top += 25.0 + (GROUP_GAP if row is last else ROW_GAP)
    elif spec.layout == "settling":
        for row in rows:
            yield Cell((row,), "whole", (0.0, top, BLOCK, 33.0), False)
            left, down, width, height = INSETS[row.style]
            inset = (left * BLOCK, top + down * 33.0, width * BLOCK, height * 33.0)
            yield Cell((row,), "early", inset, True, inset=True)
            top += 33.0 + ROW_GAP
        yield Cell(rows, "envelope", (0.0, top, BLOCK, 30.0), True, titled=True)
    else:
        wide: View = "late" if spec.layout == "estimates" else "whole"
        top, height = (11.5, 29.0) if len(rows) > 1 else (16.5, 45.0)
        for row in rows:
            yield Cell((row,), "early", (0.0, top, NARROW, height), row is last, row is rows[0])
            yield Cell((row,), wide, (BLOCK - WIDE, top, WIDE, height), row is last, row is rows[0])
            top += height + ROW_GAP


@lru_cache
def _plant(scenario: str) -> tuple[float, dict[str, Array]]:
    """The unit of time in ms, and the true values by variable."""
    plant = Scenario.from_toml(scenario).plant
    damping, stiffness, rate, more_damping, more_stiffness = plant.nondimensional()
    true = {"damping": damping + more_damping, "stiffness": stiffness + more_stiffness, "rate": [rate]}
    return 1e3 * plant.scales.time, {f"{name}_estimate": np.array(values) for name, values in true.items()}


def _signals(run: xr.Dataset, layout: Layout, rows: tuple[Row, ...]) -> dict[str, Array]:
    """Curves of some rows, by style and from back to front."""
    signals: dict[str, Array] = {}
    for row in rows:
        values = run[row.variable].values
        signals[row.style] = values if values.ndim == 1 else values[:, row.column]
        if row.variable == "position":
            signals["reference"] = run["reference"].values[:, row.column]
        if row.variable == "rate_estimate" and run["rate_symmetric_estimate"].values.any():
            # In the plant Omega_21 is Omega_z; the printed law never moves the skew part of its estimate.
            signals = {"element": values + run["rate_symmetric_estimate"].values[:, 1], **signals}
        if layout == "estimates":
            truth = _plant(run.attrs["scenario"])[1][row.variable][row.column]
            signals["truth"] = np.full(len(values), truth)
    return signals


def _legend(run: xr.Dataset, spec: FigureSpec) -> dict[str, str]:
    texts = {"reference": "reference", "estimate": "estimate", "truth": "true value"}
    styles = _signals(run, spec.layout, spec.rows)
    if spec.layout == "settling":
        return {"x": "x axis", "y": "y axis"}
    if "element" in styles:
        skew, element = r"$\hat\Omega_z$: skew part", r"$\hat\Omega_{21}$: skew + symmetric"
        return {"estimate": skew, "element": element, "truth": "true"}
    return {style: texts[style] for style in styles if style in texts} if spec.layout != "growth" else {}


def _limits(pair: list[list[Array]], room: str = "") -> list[tuple[float, float]]:
    """Limits of each variant's panel, with a margin; equal limits if both curves still fill most of their panels.

    With an inset, zero, the final value of the curve, is kept clear of it.
    """
    ranges = [(min(float(v.min()) for v in side), max(float(v.max()) for v in side)) for side in pair]
    union = (min(low for low, _ in ranges), max(high for _, high in ranges))
    if union[1] - union[0] < 2.5 * min(high - low for low, high in ranges):
        ranges = [union] * len(ranges)
    limits = []
    for low, high in ranges:
        margin = 0.06 * (high - low) or 1.0
        low, high = low - margin, high + margin
        low = min(low, -1.63 * high) if room == "y" else low
        high = max(high, -1.63 * low) if room == "x" else high
        limits.append((low, high))
    return limits


def _panels(pair: list[xr.Dataset], layout: Layout, cell: Cell) -> Iterator[Panel]:
    """The panels of both variants for one cell."""
    time, row, view = pair[0]["time"].values, cell.rows[0], cell.view
    unit = f"1 = {_plant(pair[0].attrs['scenario'])[0]:g} ms"
    end, columns = float(time[-1]), round(cell.box[2] * COLUMNS_PER_MM)
    early, late = min(EARLY, 0.5 * end), min(LATE, 0.75 * end)
    span = (0.0, early if view == "early" else end)
    seen = (time >= span[0]) & (time <= span[1])
    signals = [{k: v[seen] for k, v in _signals(run, layout, cell.rows).items()} for run in pair]
    thin = envelope if view == "envelope" else decimate
    curves = [{k: thin(time[seen], v, columns) for k, v in side.items()} for side in signals]
    if view == "envelope":
        limits = _limits([[v for _, v in side.values()] for side in curves])
    else:
        # The first sample may leave the panel: the Riemann-Liouville derivative makes a spike of it.
        scaling = time[seen] >= (late if view == "late" else time[1])
        room = row.style if layout == "settling" and not cell.inset else ""
        limits = _limits([[v[scaling] for v in side.values()] for side in signals], room)
    titles = {
        "early": f"to t = {early:g}",
        "late": f"whole run, scaled to t > {late:g}",
        "whole": "whole run",
        "envelope": f"largest magnitude in each {end / columns:.2g} of t",
    }
    symbol = f"|{row.symbol[0]}|" if view == "envelope" else row.symbol
    label = f"${symbol}\\,/\\,{row.unit}$"
    for side, block in enumerate(BLOCKS):
        first = signals[side][row.style][0]
        spike = view == "early" and not limits[side][0] <= first <= limits[side][1]
        yield Panel(
            cell,
            block + cell.box[0],
            span,
            limits[side],
            curves[side],
            label if side == 0 and cell.box[0] == 0.0 else "",
            f"t (nondimensional; {unit})" if cell.box[2] > NARROW else "t",
            titles[view] if cell.titled else "",
            f"first sample {first:.0f}, off the scale".replace("-", "\N{MINUS SIGN}") if spike else "",
        )


def _plan(number: int, runs: Runs) -> Plan:
    spec = FIGURES[number]
    pair = [runs[variant, spec.controller] for variant in HEADINGS]
    panels = [panel for cell in _cells(spec) for panel in _panels(pair, spec.layout, cell)]
    height = max(panel.cell.box[1] + panel.cell.box[3] for panel in panels) + FOOT
    return Plan(spec.stem, spec.caption, height, panels, [_legend(run, spec) for run in pair])


def draw(number: int, runs: Runs, folder: Path) -> list[Path]:
    """Writes figureNN.svg, .png and .csv, each whole; the same runs give the same bytes."""
    return render(_plan(number, runs), folder)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Processes started meanwhile never see an interrupt: it is their parent's, who sees it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Processes to draw with. They start at once, since their imports take as long as the simulations meanwhile."""
    # Spawned, not forked: the simulator's threads or a progress display may hold a lock at that moment.
    pool = ProcessPoolExecutor(count, get_context("spawn"))
    try:
        with uninterrupted():
            for _ in range(count):
                pool.submit(int)
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def start_all(runs: Runs, folder: Path, pool: ProcessPoolExecutor) -> list[Future[list[Path]]]:
    """All of them begun, each to end with the paths of its files."""
    return [pool.submit(render, _plan(number, runs), folder) for number in FIGURES]
