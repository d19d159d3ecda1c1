"""Figures 3 to 19 of the paper: on the left as printed, on the right corrected.

Reading order: `FIGURES`, `_cells` (which views of a quantity stand where), `_plan`, `draw`.

Every figure shows the paper's quantities over the whole run. Where one scale would hide the story there are more views:
    whole     the whole run, scaled to everything in it
    early     the first EARLY units of time, scaled to everything in them
    late      the rest of the run, scaled to what follows LATE; what comes before may leave the panel
    envelope  the whole run: the largest magnitude in each pixel column, on a logarithmic scale
Data are decimated before they are drawn: of each pixel column the extremes are kept, so that noise keeps its width.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from ..files import whole_file
from ..scenario import Scenario

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]  # left, top, width, height
View = Literal["whole", "early", "late", "envelope"]
Layout = Literal["motion", "settling", "estimates", "growth"]

HEADINGS = {"printed": "As printed", "corrected": "Corrected"}
EARLY, LATE = 10.0, 15.0
DPI = 200
COLUMNS_PER_MM = 5.0  # pixel columns of 0.2 mm, thinner than the lines

# In mm: a figure, its two blocks, their narrow and wide panels, the gaps between rows and between groups of rows.
WIDTH, BLOCKS, BLOCK_WIDTH = 170.0, (14.5, 98.0), 69.0
NARROW, WIDE = 20.0, 39.0
ROW_GAP, GROUP_GAP, FOOT = 4.5, 11.0, 9.5
INSETS: dict[str, Box] = {"above": (0.29, 0.03, 0.69, 0.41), "below": (0.29, 0.46, 0.69, 0.41)}  # parts of a panel

# Okabe and Ito's palette, safe for colour-blind readers.
STYLES: dict[str, dict[str, Any]] = {
    "x": {"color": "#0072B2", "linewidth": 0.7},
    "y": {"color": "#D55E00", "linewidth": 0.7},
    "estimate": {"color": "#0072B2", "linewidth": 0.8},
    "element": {"color": "#E69F00", "linewidth": 0.6},
    "reference": {"color": "black", "linewidth": 0.7, "dashes": (3, 2)},
    "truth": {"color": "black", "linewidth": 0.9, "dashes": (4, 2.5)},
}
RC = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
    "font.size": 8,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 7,
    "axes.titlepad": 3,
    "axes.labelpad": 2,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.fontsize": 7,
    "svg.fonttype": "path",
    "svg.hashsalt": "fracgyro",
}
for _axis in ("xtick", "ytick"):
    RC |= {f"{_axis}.labelsize": 7, f"{_axis}.major.width": 0.6, f"{_axis}.major.size": 2.5, f"{_axis}.major.pad": 2}


@dataclass(frozen=True)
class Row:
    """One of the paper's panels: a column of a run's variable, its symbol and the unit it is measured in."""

    symbol: str
    unit: str
    variable: str
    column: int | None
    style: str = "estimate"
    inset: str | None = None  # which of INSETS holds its early view

    @property
    def label(self) -> str:
        return f"${self.symbol}\\,/\\,{self.unit}$"


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


def _specs() -> Iterable[FigureSpec]:
    names = {
        "proposed": "the proposed fractional fast terminal controller",
        "fractional": "the fractional sliding mode controller",
        "conventional": "the conventional fast terminal controller",
    }
    force, damping, stiffness = r"(m\omega_0^2q_0)", r"(m\omega_0)", r"(m\omega_0^2)"
    rate = (Row(r"\hat\Omega_z", r"\omega_0", "rate_estimate", None),)
    units = enumerate((force, stiffness, damping))
    bounds = tuple(Row(f"\\hat b_{i}", unit, "bound_estimate", i) for i, unit in units)

    def axes(symbol: str, unit: str, variable: str, insets: tuple[str, ...] = ()) -> tuple[Row, ...]:
        where = insets or (None, None)
        return tuple(Row(symbol.replace("?", a), unit, variable, i, a, where[i]) for i, a in enumerate("xy"))

    def entries(symbol: str, unit: str, variable: str) -> tuple[Row, ...]:
        names = enumerate(("xx", "xy", "yy"))
        return tuple(Row(f"\\hat {symbol}_{{{name}}}", unit, variable, i) for i, name in names)

    everyone = tuple(names)
    sides = ("above", "below")
    position, control = axes("?", "q_0", "position"), axes("u_?", force, "control")
    error, surface = axes("e_?", "q_0", "error", sides), axes("s_?", r"(q_0\omega_0)", "surface", sides)
    dampings, stiffnesses = (
        entries("d", damping, "damping_estimate"),
        entries("k", stiffness, "stiffness_estimate"),
    )
    contents: list[tuple[int, tuple[str, ...], str, Layout, tuple[Row, ...]]] = [
        (3, ("proposed",), "Position and its reference", "motion", position),
        (4, everyone, "Tracking error", "settling", error),
        (7, ("proposed", "conventional"), "Sliding surface", "settling", surface),
        (9, ("proposed",), "Control force", "motion", control),
        (10, everyone, "Estimates of the damping", "estimates", dampings),
        (13, everyone, "Estimates of the stiffness", "estimates", stiffnesses),
        (16, everyone, "Estimate of the angular rate", "estimates", rate),
        (19, ("proposed",), "Estimates of the bounds of the uncertainty", "growth", bounds),
    ]
    for first, controllers, what, layout, rows in contents:
        for number, controller in enumerate(controllers, start=first):
            yield FigureSpec(number, controller, f"{what} under {names[controller]}", layout, rows)


FIGURES = {spec.number: spec for spec in _specs()}


@dataclass(frozen=True)
class Cell:
    """A place in each of the two blocks (mm from the block's left and the figure's top) and what is seen there."""

    rows: tuple[Row, ...]
    view: View
    box: Box
    lowest: bool = False  # of those that share its time axis
    title: str = ""


def _cells(spec: FigureSpec) -> list[Cell]:
    """From the top down."""
    cells, rows, last = [], spec.rows, spec.rows[-1]
    top = 7.0
    if spec.layout == "motion":
        views: tuple[View, View] = ("whole", "early")
        for view in views:
            for row in rows:
                cells.append(Cell((row,), view, (0.0, top, BLOCK_WIDTH, 25.0), row is last))
                top += 25.0 + (GROUP_GAP if row is last else ROW_GAP)
    elif spec.layout == "settling":
        for row in rows:
            cells.append(Cell((row,), "whole", (0.0, top, BLOCK_WIDTH, 33.0)))
            top += 33.0 + ROW_GAP
        title = f"largest magnitude in every 1/{_columns(BLOCK_WIDTH)} of the run"
        cells.append(Cell(rows, "envelope", (0.0, top, BLOCK_WIDTH, 30.0), True, title))
    else:
        wide: View = "late" if spec.layout == "estimates" else "whole"
        titles = [f"to $t$ = {EARLY:g}", "whole run" if wide == "whole" else f"after it; scale of $t$ > {LATE:g}"]
        top, height = (11.5, 29.0) if len(rows) > 1 else (16.5, 45.0)
        for row in rows:
            cells.append(Cell((row,), "early", (0.0, top, NARROW, height), row is last, titles[0]))
            cells.append(Cell((row,), wide, (BLOCK_WIDTH - WIDE, top, WIDE, height), row is last, titles[1]))
            titles = ["", ""]
            top += height + ROW_GAP
    return cells


def _columns(width: float) -> int:
    return round(width * COLUMNS_PER_MM)


def decimate(time: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """The least and the largest of each of `columns` stretches of equal length, in order of time, and both ends.

    A line through them covers the same pixels as one through every sample.
    """
    stretch = -(-len(values) // columns)
    if stretch <= 2:
        return time, values
    starts = np.arange(0, len(values), stretch)
    table = np.pad(values, (0, len(starts) * stretch - len(values)), mode="edge").reshape(-1, stretch)
    last = len(values) - 1
    kept = np.unique(np.concatenate([[0, last], starts + table.argmin(axis=1), starts + table.argmax(axis=1)]))
    kept = kept[kept <= last]  # an extreme of the padding is that of the last sample
    return time[kept], values[kept]


def envelope(time: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """The largest magnitude of each of `columns` stretches of equal length, at its middle."""
    starts = np.arange(0, len(values), -(-len(values) // columns))
    ends = np.append(starts[1:], len(values)) - 1
    return 0.5 * (time[starts] + time[ends]), np.maximum.reduceat(np.abs(values), starts)


@dataclass(frozen=True)
class Panel:
    """What one pair of axes shows."""

    box: Box  # mm from the figure's left and top
    span: tuple[float, float]
    limits: tuple[float, float]
    curves: dict[str, tuple[Array, Array]]  # time and values by style, from back to front
    logarithmic: bool
    label: str
    time_label: str
    title: str
    note: str  # of what lies off the scale
    lowest: bool
    inset: bool = False


@dataclass(frozen=True)
class Plan:
    """A figure ready to be drawn, small enough to be sent to another process."""

    stem: str
    height: float  # mm
    panels: tuple[Panel, ...]
    legends: tuple[dict[str, str], ...]  # of each block: text by style


def _truth(run: xr.Dataset, row: Row) -> float:
    damping, stiffness, rate, more_damping, more_stiffness = _scenario(run).plant.nondimensional()
    true = {"damping": damping + more_damping, "stiffness": stiffness + more_stiffness, "rate": [rate]}
    return float(true[row.variable.removesuffix("_estimate")][row.column or 0])


def _scenario(run: xr.Dataset) -> Scenario:
    return Scenario.from_toml(run.attrs["scenario"])


def _signals(run: xr.Dataset, spec: FigureSpec, row: Row) -> dict[str, Array]:
    """What is drawn for a row, by style and from back to front."""
    values = run[row.variable].values
    signals = {row.style: values if row.column is None else values[:, row.column]}
    if row.variable == "position":
        signals["reference"] = run["reference"].values[:, row.column]
    if row.variable == "rate_estimate" and run["rate_symmetric_estimate"].values.any():
        # In the plant Omega_21 is Omega_z. The printed law moves its estimate, but never that estimate's skew part.
        signals = {"element": values + run["rate_symmetric_estimate"].values[:, 1], **signals}
    if spec.layout == "estimates":
        signals["truth"] = np.full(len(values), _truth(run, row))
    return signals


def _legend(spec: FigureSpec, styles: Iterable[str]) -> dict[str, str]:
    if "element" in styles:
        skew, element = r"$\hat\Omega_z$: skew part", r"$\hat\Omega_{21}$: with symmetric part"
        return {"estimate": skew, "element": element, "truth": "true"}
    texts = {"x": "x axis", "y": "y axis"} if spec.layout == "settling" else {"reference": "reference"}
    if spec.layout == "estimates":
        texts = {"estimate": "estimate", "truth": "true value"}
    return {style: text for style, text in texts.items() if style in styles}


def _limits(pair: list[list[Array]]) -> list[tuple[float, float]]:
    """Of each variant's panel, with a margin; the same where that costs neither of them much of its height."""
    ranges = [(min(float(v.min()) for v in side), max(float(v.max()) for v in side)) for side in pair]
    union = (min(low for low, _ in ranges), max(high for _, high in ranges))
    if union[1] - union[0] < 2.5 * min(high - low for low, high in ranges):
        ranges = [union] * len(ranges)
    margins = [0.06 * (high - low) or 1.0 for low, high in ranges]
    return [(low - margin, high + margin) for (low, high), margin in zip(ranges, margins, strict=True)]


def _with_room(limits: tuple[float, float], inset: str | None) -> tuple[float, float]:
    """Limits that keep zero, where the curve comes to rest, clear of an inset."""
    low, high = limits
    if inset == "above":
        return low, max(high, low - low / 0.38)
    return (min(low, high - high / 0.38), high) if inset == "below" else limits


def _panels(pair: list[xr.Dataset], spec: FigureSpec, cell: Cell) -> list[Panel]:
    """The panels of both variants for one cell."""
    time = pair[0]["time"].values
    end, step = float(time[-1]), float(time[1])
    early, late = min(EARLY, 0.5 * end), min(LATE, 0.75 * end)
    span = {"early": (0.0, early), "late": (early, end)}.get(cell.view, (0.0, end))
    seen = (time >= span[0]) & (time <= span[1])
    # The first sample may leave the panel: the Riemann-Liouville derivative makes the first force a spike of one step.
    scaling = time[seen] >= (late if cell.view == "late" else step)
    columns = _columns(cell.box[2])
    logarithmic = cell.view == "envelope"
    thin = envelope if logarithmic else decimate
    signals = [{k: v[seen] for row in cell.rows for k, v in _signals(run, spec, row).items()} for run in pair]
    curves = [{k: thin(time[seen], v, columns) for k, v in side.items()} for side in signals]
    if logarithmic:
        powers = _limits([[np.log10(np.maximum(v, 1e-12)) for _, v in side.values()] for side in curves])
        limits = [(10.0**low, 10.0**high) for low, high in powers]
    else:
        limits = _limits([[v[scaling] for v in side.values()] for side in signals])
    row = cell.rows[0]
    unit = f"1 = {1e3 * _scenario(pair[0]).plant.scales.time:g} ms"
    panels = []
    for side, (low, high) in enumerate(limits):
        first = next(iter(signals[side].values()))[0]
        spike = cell.view == "early" and not low <= first <= high
        label = f"$|{row.symbol[0]}|\\,/\\,{row.unit}$" if logarithmic else row.label
        panel = Panel(
            (BLOCKS[side] + cell.box[0], *cell.box[1:]),
            span,
            _with_room((low, high), row.inset if cell.view == "whole" else None),
            curves[side],
            logarithmic,
            label if side == 0 and cell.box[0] == 0.0 else "",
            "" if not cell.lowest else f"$t$ (nondimensional; {unit})" if cell.box[2] > NARROW else "$t$",
            cell.title,
            f"first sample off the scale: {first:.0f}".replace("-", "\N{MINUS SIGN}") if spike else "",
            cell.lowest,
        )
        panels.append(panel)
    return panels


def _plan(number: int, runs: Mapping[tuple[str, str], xr.Dataset]) -> Plan:
    spec = FIGURES[number]
    pair = [runs[variant, spec.controller] for variant in HEADINGS]
    panels = []
    for cell in _cells(spec):
        panels += _panels(pair, spec, cell)
        inset = cell.rows[0].inset
        if inset and cell.view == "whole":
            left, top, width, height = INSETS[inset]
            _, cell_top, cell_width, cell_height = cell.box
            box = (left * cell_width, cell_top + top * cell_height, width * cell_width, height * cell_height)
            panels += [replace(panel, inset=True) for panel in _panels(pair, spec, Cell(cell.rows, "early", box, True))]
    height = max(panel.box[1] + panel.box[3] for panel in panels) + FOOT
    styles = [{style for row in spec.rows for style in _signals(run, spec, row)} for run in pair]
    return Plan(spec.stem, height, tuple(panels), tuple(_legend(spec, drawn) for drawn in styles))


def _add_panel(figure: Figure, height: float, panel: Panel) -> None:
    left, top, width, tall = panel.box
    axes = figure.add_axes((left / WIDTH, 1.0 - (top + tall) / height, width / WIDTH, tall / height))
    for style, (time, values) in panel.curves.items():
        axes.plot(time, values, **STYLES[style])
    if panel.logarithmic:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(numticks=8))
        axes.yaxis.set_minor_locator(NullLocator())
    else:
        axes.yaxis.set_major_locator(MaxNLocator(3 if panel.inset else 5, steps=[1, 2, 2.5, 5, 10]))
    start, stop = panel.span
    axes.set_xlim(start - 0.012 * (stop - start), stop)  # the first sample clear of the axis
    axes.set_ylim(*panel.limits)
    axes.xaxis.set_major_locator(MaxNLocator(2 if width <= NARROW else 4, steps=[1, 2, 5, 10]))
    axes.tick_params(labelbottom=panel.lowest)
    axes.set_title(panel.title or panel.note, loc="left" if panel.title else "right")
    if panel.inset:
        axes.tick_params(labelsize=6, length=2, pad=1.5)
        return
    axes.set_xlabel(panel.time_label)
    axes.set_ylabel(panel.label)
    axes.yaxis.set_label_coords(-9.0 / width, 0.5)


def _render(plan: Plan, folder: Path) -> list[Path]:
    with mpl.rc_context(RC):
        figure = Figure(figsize=(WIDTH / 25.4, plan.height / 25.4))
        for panel in plan.panels:
            _add_panel(figure, plan.height, panel)
        for left, heading, legend in zip(BLOCKS, HEADINGS.values(), plan.legends, strict=True):
            figure.text(left / WIDTH, 1.0 - 3.0 / plan.height, heading, fontsize=9, weight="bold", va="center")
            figure.legend(
                [Line2D([], [], **STYLES[style]) for style in legend],
                list(legend.values()),
                loc="center right",
                bbox_to_anchor=((left + BLOCK_WIDTH) / WIDTH, 1.0 - (3.0 if len(legend) < 3 else 8.0) / plan.height),
                ncols=max(len(legend), 1),
                frameon=False,
                borderaxespad=0.0,
                borderpad=0.0,
                handlelength=1.8,
                handletextpad=0.5,
                columnspacing=1.2,
            )
        svg = io.StringIO()
        figure.savefig(svg, format="svg", metadata={"Date": None})
        paths = [folder / f"{plan.stem}.svg", folder / f"{plan.stem}.png"]
        with whole_file(paths[0]) as scratch:
            scratch.write_text(_shorter(svg.getvalue()), encoding="utf-8", newline="\n")
        with whole_file(paths[1]) as scratch:
            figure.savefig(scratch, format="png", dpi=DPI)
    return paths


def _shorter(svg: str) -> str:
    """Paths to 0.01 pt (4 µm) and without what may be left out, which halves the file."""

    def shorter(path: re.Match[str]) -> str:
        rounded = re.sub(r"\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", " ".join(path[0].split()))
        return re.sub(r"(?<=\d) L (?=[-\d.]+ [-\d.]+ L )", " ", rounded)

    return re.sub(r"\n\s+", "\n", re.sub(r'(?<=\bd=")[^"]+', shorter, svg))


def draw(number: int, runs: Mapping[tuple[str, str], xr.Dataset], folder: Path) -> list[Path]:
    """Writes figureNN.svg and figureNN.png, each whole; the same runs give the same bytes."""
    return _render(_plan(number, runs), folder)


def draw_all(
    runs: Mapping[tuple[str, str], xr.Dataset],
    folder: Path,
    workers: int = 1,
    progress: Callable[[int], object] | None = None,
) -> list[Path]:
    """All of them, in `workers` processes; `progress` is called with the number finished since the last call."""
    plans = [_plan(number, runs) for number in FIGURES]
    paths = []
    if workers <= 1:
        for plan in plans:
            paths += _render(plan, folder)
            if progress:
                progress(1)
        return paths
    # Spawned, not forked: the simulator's threads or a progress display may hold a lock at that moment.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_render, plan, folder) for plan in plans]):
            paths += future.result()
            if progress:
                progress(1)
    return sorted(paths)
