"""Draws docs/run.svg, the picture of README.md: a run of the paper's scenario with composite adaptation."""

from __future__ import annotations

from pathlib import Path

import fracgyro as fg
import xarray as xr
from fracgyro.analysis.style import COLORS, PAGE, own_style, save_svg
from matplotlib.axes import Axes
from matplotlib.figure import Figure

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "run.svg"
SCENARIO = fg.Scenario.paper().replace({"adaptation.kind": "composite", "run.units": "SI", "run.record_every": 50})
BLACK = {"color": "black", "linestyle": ":", "linewidth": 0.9}


def draw(path: Path) -> None:
    run = fg.simulate(SCENARIO)
    # Without simplification the number of points does not depend on rounding.
    with own_style(PAGE | {"font.size": 9, "legend.fontsize": 8, "path.simplify": False}):
        figure = Figure(figsize=(7.0, 2.6))
        tracking, rate = figure.subplots(1, 2)
        draw_tracking(tracking, run.sel(time=slice(0, 8e-3)))
        draw_rate(rate, run.sel(time=slice(2e-3, None, 8)))
        for panel in (tracking, rate):
            panel.set_xlabel("time (ms)")
            panel.set_xlim(0)
            panel.grid(True, linewidth=0.3)
            panel.spines[["top", "right"]].set_visible(False)
        figure.tight_layout(w_pad=2)
        save_svg(figure, path, "A simulated run")


def draw_tracking(panel: Axes, run: xr.Dataset) -> None:
    for i, axis in enumerate(("x", "y")):
        panel.plot(1e3 * run["time"], 1e6 * run["position"][:, i], color=COLORS[i], linewidth=1.2, label=axis)
        panel.plot(1e3 * run["time"], 1e6 * run["reference"][:, i], label="reference" if i else "", **BLACK)
    panel.set(ylabel="position (µm)", title="The mass follows its reference", ylim=(-1.2, 1.7))
    panel.legend(loc="upper right", ncols=3)


def draw_rate(panel: Axes, run: xr.Dataset) -> None:
    times, estimate, band = 1e3 * run["time"], run["rate_estimate"], 2 * run["rate_deviation"]
    panel.fill_between(times, estimate - band, estimate + band, color=COLORS[0], alpha=0.25, linewidth=0)
    panel.plot(times, estimate, color=COLORS[0], linewidth=1.2, label="estimate ± 2σ")
    panel.axhline(SCENARIO.plant.angular_rate, label="truth", **BLACK)
    panel.set(ylabel="angular rate (rad/s)", title="The angular rate is estimated", ylim=(90, 110))
    panel.legend(loc="upper right", ncols=2)


if __name__ == "__main__":
    draw(PICTURE)
