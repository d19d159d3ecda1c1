"""The article's figures, as SVG, as wide as the page's text with its margin."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import comparison
import limits
import logs
import numpy as np
import sensing
import tracking
import xarray as xr
from fracgyro.analysis.style import COLORS, MM, PAGE, own_style
from fracgyro_lab.comparison.plots import joined
from fracgyro_lab.paper.table import draw_table, table
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, LogLocator, NullLocator
from replication import EACH, LIMIT, RATE, Replication, gains_over_time

WIDE = 160.0  # mm
GREEN, PURPLE, SKY, GOLD = "#009E73", "#CC79A7", "#56B4E9", "#E69F00"  # from the same palette as COLORS
BROWN = "#7a4b2a"
GRAY = "#9aa5ac"
SPAN = 40.0  # times the least limit: larger errors are not drawn
NAMED = 6  # contenders of a front that have a color of their own
LOOKS = [(COLORS[0], "s"), (GREEN, "^"), (PURPLE, "D"), (GOLD, "v"), (SKY, "P"), (BROWN, "X")]


def draw(r: Replication, errors: sensing.Errors, track: dict[str, Any], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with own_style(PAGE | {"svg.fonttype": "path"}):  # Typst may lack the font
        _save(_tracking(r), folder / "tracking.svg")
        _save(_end(r), folder / "end.svg")
        _save(_sensing(errors), folder / "sensing.svg")
        _save(fronts(track["contenders"]), folder / "fronts.svg")
    draw_table(table(r.study), folder / "orders.svg")


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasSVG(figure)
    figure.savefig(path, metadata={"Date": None})


def _pair(height: float) -> tuple[Figure, Sequence[Axes]]:
    figure = Figure(figsize=(WIDE * MM, height * MM), layout="constrained")
    panels = figure.subplots(1, 2)
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(True, linewidth=0.3, color="#e3e7ea")
    return figure, panels


def _envelope(time: np.ndarray, values: np.ndarray, bins: int = 160) -> tuple[np.ndarray, np.ndarray]:
    """Maximum in each of `bins` equal parts of the time."""
    count = len(values) // bins
    return time[: bins * count : count], values[: bins * count].reshape(bins, count).max(axis=1)


def _norm(values: xr.DataArray) -> np.ndarray:
    return np.asarray(np.hypot(*values.values.T))


def _tracking(r: Replication) -> Figure:
    figure, (left, right) = _pair(62)
    lines: list[tuple[str, str, str, str, Any]] = [
        ("printed", "proposed", "proposed, as printed", COLORS[1], (0, (4, 1.5))),
        ("corrected", "proposed", "proposed, corrected", COLORS[0], "-"),
        ("corrected", "fractional", "fractional SMC, corrected", GREEN, "-"),
        ("corrected", "conventional", "conventional, corrected", PURPLE, "-"),
    ]
    for variant, controller, words, color, style in lines:
        run = r.runs[variant, controller]
        left.plot(*_envelope(run["time"].values, _norm(run["error"])), color=color, ls=style, lw=1.0, label=words)
    left.set(yscale="log", xlabel="t (1 = 1 ms)", ylabel="‖e‖ / q₀")
    left.legend(loc="upper right")
    left.set_title("a  tracking error", loc="left", fontsize=8)

    printed, corrected = (r.runs[variant, "proposed"] for variant in ("printed", "corrected"))
    element = printed["rate_estimate"] + printed["rate_symmetric_estimate"].sel(entry="xy")
    curves: list[tuple[xr.DataArray, str, str, Any]] = [
        (printed["rate_estimate"], r"$\hat\Omega_z$, as printed: never moves", COLORS[1], "-"),
        (element, r"the entry $\hat\Omega_{21}$, as printed", COLORS[1], (0, (1.5, 1.2))),
        (corrected["rate_estimate"], r"$\hat\Omega_z$, corrected", COLORS[0], "-"),
    ]
    for values, words, color, style in curves:
        off = np.abs(values.values / RATE - 1)
        right.plot(*_envelope(values["time"].values, off), color=color, ls=style, lw=1.0, label=words)
    right.set(yscale="log", xlabel="t (1 = 1 ms)", ylabel=r"$|\hat\Omega_z/\Omega_z - 1|$")
    right.set_ylim(0.02, 5e3)
    right.legend(loc="upper right")
    right.set_title("b  error of the angular rate", loc="left", fontsize=8)
    return figure


def _end(r: Replication) -> Figure:
    figure, (left, right) = _pair(58)
    looks = [(r.long, None, "as corrected", COLORS[1]), (r.limited, LIMIT, f"limited to {LIMIT:g}", COLORS[0])]
    for run, limit, words, color in looks:
        left.plot(*gains_over_time(run, limit), color=color, lw=1.0, label=words)
        size = _norm(run["error"])
        right.plot(
            run["time"].values[::20], np.maximum.reduceat(size, np.arange(0, len(size), 20)), color=color, lw=1.0
        )
    paper = logs.number(logs.row("boundedness", surface="fractional fast terminal (paper)")["predicted"])
    above = logs.number(logs.row("boundedness", surface="fractional, α = 0.9")["predicted"])
    left.axhspan(paper, above, color=GRAY, alpha=0.5, lw=0, label="threshold")
    left.set(xlabel="t (1 = 1 ms)", ylabel="ρh/δ", ylim=(0, 2.4), xlim=(0, 5 * EACH))
    left.legend(loc="lower right")
    left.set_title("a  gain of the layer in one step", loc="left", fontsize=8)
    right.set(yscale="log", xlabel="t (1 = 1 ms)", ylabel="‖e‖ / q₀", xlim=(0, 5 * EACH))
    right.set_title("b  tracking error", loc="left", fontsize=8)
    return figure


def _sensing(e: sensing.Errors) -> Figure:
    figure, (left, right) = _pair(70)
    left.axhline(e.printed, color=COLORS[1], lw=1.0, label="as printed: the first guess")
    left.plot(e.time, e.gradient, color=PURPLE, lw=1.0, label="gradient law, corrected")
    left.plot(e.time, e.composite, color=COLORS[0], lw=1.0, label="least squares added")
    left.plot(*sensing.bound_of_paper(), color="black", ls="--", lw=0.9, label="Cramér-Rao bound")
    left.set(
        xscale="log",
        yscale="log",
        xlabel="t (1 = 1 ms)",
        ylabel=r"RMS error of $\hat\Omega_z$ / $\Omega_z$",
        xlim=(0.5, 80),
    )
    left.set_ylim(4e-3, 2e5)  # room for the legend
    left.xaxis.set_major_locator(FixedLocator([0.5, 1, 2, 5, 10, 20, 50]))
    left.xaxis.set_major_formatter("{x:g}")
    left.xaxis.set_minor_locator(NullLocator())
    left.legend(loc="upper right")
    left.set_title("a  the paper's run, exact sensors", loc="left", fontsize=8)

    noises = np.geomspace(3e-15, 3e-12, 40)
    for (device, words), color in zip(sensing.DEVICES.items(), (COLORS[0], GREEN, PURPLE, GOLD), strict=True):
        right.plot(noises, sensing.bound_curve(device, noises), color=color, ls="--", lw=0.8)
        for noise, value, low, high in sensing.measured(device):
            right.errorbar(noise, value, [[value - low], [high - value]], color=color, marker="o", ms=3, lw=0.9)
        right.plot([], [], color=color, marker="o", ms=3, lw=0.9, label=words)
    composite = logs.number(
        logs.row("rate_sensor", scenario="dual_mass", effect="sensing noise")["angle random walk (deg/sqrt(h))"]
    )
    right.plot(1e-13, composite, marker="x", ms=7, zorder=5, ls="", color=COLORS[0], label="dual mass, least squares")
    right.set(xscale="log", yscale="log", ylabel="angle random walk, deg/√h")
    right.set_xlabel("noise of the position, m/√Hz")
    right.set_ylim(1e-3, 2e4)
    right.legend(loc="upper left")
    right.yaxis.set_major_locator(LogLocator(numticks=9))
    right.set_title("b  devices, positions with noise", loc="left", fontsize=8)
    return figure


def fronts(every: list[dict[str, Any]]) -> Figure:
    """Error against chattering of training, by class, with noise; the limit, the paper's and the best stand out."""
    rows = [row for row in every if row.get("scenario", tracking.SCENARIO) == tracking.SCENARIO]
    noise = max(float(row["noise"]) for row in rows)
    rows = [row for row in rows if float(row["noise"]) == noise and row["front"]]
    figure, panels = _pair(80)
    colored = _best(rows)
    for panel, information in zip(panels, tracking.CLASSES, strict=True):
        here = [row for row in rows if row["class"] == information]
        ceilings = sorted({float(row["ceiling"]) for row in here})
        ends = ceilings[0] / 8, ceilings[-1] * 3
        for ceiling in ceilings:
            panel.axvline(ceiling, color="gray", lw=0.6, dashes=(3, 2))
        for name in dict.fromkeys(row["name"] for row in here):
            points = joined([p for row in here if row["name"] == name for p in row["front"]])
            xs, ys = np.array(points).T
            if name == comparison.PAPER:
                look: dict[str, Any] = {"color": COLORS[1], "marker": "o", "lw": 1.6, "zorder": 4}
            elif name in colored:
                color, marker = colored[name]
                look = {"color": color, "marker": marker, "lw": 1.0, "zorder": 3}
            else:
                look = {"color": GRAY, "lw": 0.6, "zorder": 2}
            marker = look.pop("marker", None)
            # More chattering than any trial had is not needed for its error.
            panel.plot([*xs, 100 * xs[-1]], [*ys, ys[-1]], drawstyle="steps-post", **look)
            found = [(ceiling, ys[xs <= ceiling].min()) for ceiling in ceilings if xs[0] <= ceiling]
            if marker and found:
                panel.plot(*np.array(found).T, marker, ms=3.2, color=look["color"], zorder=5)
        line = limits.line(information, noise, *ends)
        panel.plot(*line, color="black", lw=1.6, zorder=6)
        panel.set(xscale="log", yscale="log", xlabel="chattering index, larger axis")
        panel.set_xlim(*ends)
        panel.set_ylim(0.85 * line[1].min(), SPAN * line[1].min())
        words = "positions and velocities" if information == "F" else "positions only"
        panel.set_title(f"class {information}: {words}", loc="left", fontsize=8)
    panels[0].set_ylabel("error of the best trial so far, q₀")
    handles = [Line2D([], [], color="black", lw=1.4, label="the limit")]
    handles += [Line2D([], [], color=COLORS[1], marker="o", lw=1.6, ms=3, label="paper")]
    handles += [
        Line2D([], [], color=color, marker=marker, lw=1.0, ms=3, label=tracking.name_of(name))
        for name, (color, marker) in colored.items()
    ]
    handles.append(Line2D([], [], color=GRAY, lw=0.8, label="others"))
    figure.legend(handles=handles, loc="outside lower center", ncols=5)
    return figure


def _best(rows: list[dict[str, Any]]) -> dict[str, tuple[str, str]]:
    """The contenders with the least errors in any table, other than the paper's, each with its look.

    Those that need the exact delay are nearly the limit, which would hide the others.
    """
    kept = [row for row in rows if row["kept"] and row["name"] != comparison.PAPER and row["front"]]
    kept = [row for row in kept if not row["name"].endswith("_exact_delay")]
    tables: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in sorted(kept, key=tracking.error):
        tables.setdefault((row["class"], row["ceiling"]), []).append(row)
    most = max((len(found) for found in tables.values()), default=0)
    names = dict.fromkeys(found[i]["name"] for i in range(most) for found in tables.values() if i < len(found))
    return dict(zip(list(names)[:NAMED], LOOKS, strict=False))
