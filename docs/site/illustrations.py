"""Pictures of the first page, the tour and the cards, drawn as the site is built: from the tour's own code, from runs,
from the numbers of the logs.

A page asks for one with a comment, `<!-- picture: sense -->`. Each has one version, whose colors the style of the site
inverts on dark pages.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import xarray as xr
from fracgyro.analysis.style import COLORS, LETTERS, own_style, svg
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from picture import tenths

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))
import logs
import page_numbers
import words

SITE = Path(__file__).resolve().parent
MARK = re.compile(r"<!-- picture: ([\w-]+) -->")
SIZE = 4.2, 2.5  # inches: a card, or a page of the tour
POINTS = 400  # points of a curve
GREY = "#666666"
THIRD = "#009E73"
CLAIMS = 9
Draw = Callable[[Axes], None]


@cache
def _ran(page: str, blocks: int) -> Mapping[str, Any]:
    """Names after the first blocks of Python of a page of the tour."""
    names: dict[str, Any] = {}
    text = (SITE / f"tour/{page}.md").read_text(encoding="utf-8")
    for code in re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)[:blocks]:
        exec(re.sub(r"^( *)print\(.*\)$", r"\1pass", code, flags=re.MULTILINE), names)
    return names


def _curve(panel: Axes, run: xr.Dataset, values: Any, **style: Any) -> None:
    every = max(1, len(values) // POINTS)
    panel.plot(run["time"].values[::every], np.asarray(values)[::every], linewidth=1.3, **style)


def _largest(run: xr.Dataset) -> tuple[Any, Any]:
    """Times and the largest error of both axes, in POINTS bins."""
    error = np.abs(run["error"].values).max(axis=1)
    length = len(error) // POINTS
    bins = error[: POINTS * length].reshape(POINTS, length).max(axis=1)
    return run["time"].values[: POINTS * length : length], bins


# -- Tour --------------------------------------------------------------------------------------------------------------


def _simulate(panel: Axes) -> None:
    run = _ran("1-simulate", 1)["run"].isel(time=slice(0, 8001))
    for i, axis in enumerate("xy"):
        _curve(panel, run, run["reference"].values[:, i], color=GREY, linestyle=":", label="reference" if i else None)
        _curve(panel, run, run["position"].values[:, i], color=COLORS[i], label=axis)
    panel.set(xlabel="time (ms)", ylabel="position (µm)")


def _change(panel: Axes) -> None:
    for color, (name, scenario) in zip((GREY, *COLORS), _ran("2-change", 3)["variants"].items(), strict=True):
        run = fg.simulate(scenario)
        _curve(panel, run, 1e3 * run["rate_estimate"].values, color=color, label=name)
    panel.axhline(100.0, color="black", linestyle=":", linewidth=1.0, label="true")
    panel.set(xlabel="time (ms)", ylabel="rate estimate (rad/s)", ylim=(40, 180))


def _repeat(panel: Axes) -> None:
    names = _ran("3-repeat", 2)
    orders = [each.controller.order for each in names["scenarios"]]
    errors = names["rows"]["rmse"].sel(window="steady", axis="x").values.reshape(len(orders), -1)
    panel.semilogy(orders, errors.mean(axis=1), color=GREY, linewidth=1.0, label="mean")
    for order, values in zip(orders, errors, strict=True):
        places = order + 0.02 * (np.arange(len(values)) / len(values) - 0.5)  # next to each other
        panel.plot(places, values, "o", color=COLORS[0], alpha=0.4, markersize=4, label="" if order < 1 else "a seed")
    panel.set(xlabel="order of the derivative", ylabel="steady error of x (µm)", xticks=orders)
    panel.margins(0.1)


def _control(panel: Axes) -> None:
    names = _ran("4-control", 2)
    runs = {"spring and damper": names["run"], "with an integral": names["better"]}
    runs["the paper's controller"] = fg.simulate(names["scenario"])
    for color, (name, run) in zip((*COLORS, THIRD), runs.items(), strict=True):
        panel.semilogy(*_largest(run), color=color, linewidth=1.3, label=name)
    panel.set(xlabel="time (ms)", ylabel="tracking error (µm)")


def _sense(panel: Axes) -> None:
    still = {"plant.angular_rate": 0.0, "run.units": "SI", "run.duration": 1500.0, "run.record_every": 20}
    device = fg.Scenario.shipped("dual_mass")
    run = fg.simulate(device.replace({**still, "rate.kind": "step", "rate.amplitude": 1.0}))
    time, estimate, half = 1e3 * run["time"].values, run["rate_estimate"].values, 2 * run["rate_deviation"].values
    trusted = run["rate_trusted"].values > 0
    panel.fill_between(time, estimate - half, estimate + half, color=COLORS[0], alpha=0.3, linewidth=0)
    panel.plot(time, estimate, color=COLORS[0], linewidth=1.3, label="estimate ± 2 standard deviations")
    panel.plot(time[trusted], np.full(trusted.sum(), -0.25), color=THIRD, linewidth=3, label="trusted")
    panel.axhline(1.0, color="black", linestyle=":", linewidth=1.0, label="true")
    panel.set(xlabel="time (ms)", ylabel="rate (rad/s)", ylim=(-0.5, 2.0))


def _boxes(panel: Axes, middle: str, around: tuple[str, ...], before: tuple[str, ...] = ()) -> None:
    """A box with arrows from those on its left and to those on its right."""

    def box(x: float, y: float, width: float, height: float, text: str, color: str) -> None:
        style = "round,pad=0,rounding_size=0.15"
        panel.add_patch(FancyBboxPatch((x, y), width, height, boxstyle=style, facecolor="none", edgecolor=color))
        panel.text(x + width / 2, y + height / 2, text, ha="center", va="center")

    def column(x: float, texts: tuple[str, ...]) -> list[float]:
        room = 6.0 / len(texts)
        for place, text in enumerate(texts):
            box(x, 6 - (place + 1) * room + 0.1, 3.4, room - 0.2, text, COLORS[0])
        return [6 - (place + 0.5) * room for place in range(len(texts))]

    def arrow(begin: tuple[float, float], end: tuple[float, float]) -> None:
        panel.add_patch(FancyArrowPatch(begin, end, arrowstyle="-|>", mutation_scale=8, color=GREY, linewidth=0.8))

    left = 4.6 if before else 0.2
    box(left, 2.0, 3.4, 2.0, middle, COLORS[1])
    for y in column(left + 4.6, around):
        arrow((left + 3.4, 3.0), (left + 4.6, y))
    for y in column(0.2, before) if before else ():
        arrow((3.6, y), (left, 3.0))
    panel.set(xlim=(0, left + 8.2), ylim=(-0.1, 6.1))
    panel.axis("off")


def _export(panel: Axes) -> None:
    _boxes(panel, "one controller,\nthe same bits", ("microcontroller", "FPGA", "Simulink, FMU", "MATLAB", "browser"))


# -- Cards -------------------------------------------------------------------------------------------------------------


def _claims(panel: Axes) -> None:
    for row, reading in enumerate(("corrected", "printed")):
        holds = words.NUMBERS.index(page_numbers.NUMBERS[f"claims.{reading}"]())
        for place in range(CLAIMS):
            fill = COLORS[0] if place < holds else "none"
            panel.add_patch(FancyBboxPatch((place, row), 0.7, 0.7, boxstyle="round,pad=0", fc=fill, ec=COLORS[0]))
        panel.text(-0.4, row + 0.35, f"as {reading}: {holds} of {CLAIMS} hold", ha="right", va="center")
    panel.set(xlim=(-9.5, CLAIMS), ylim=(-1.2, 2.9))
    panel.axis("off")


def _equations(panel: Axes) -> None:
    law = (
        r"$s = \dot e + \lambda_1 D^{\alpha-1} e + \lambda_2 |e|^c\,\mathrm{sign}\,e$",
        r"$\mathrm{d}\hat\Omega_z/\mathrm{d}t = P\,(s_1 v_2 - s_2 v_1)$",
    )
    for y, line in zip((0.65, 0.3), law, strict=True):
        panel.text(0.5, y, line, ha="center", va="center", fontsize=12)
    panel.axis("off")


def _order(panel: Axes) -> None:
    orders = np.linspace(0.5, 1.0, 11)
    paper = fg.Scenario.paper().replace({"run.duration": 20.0})
    rows = fg.measure_many([paper.replace({"controller.order": float(each)}) for each in orders], seeds=range(4))
    for window, color in (("whole", COLORS[0]), ("steady", COLORS[1])):
        error = rows["rmse"].sel(window=window, axis="x").values.reshape(len(orders), -1).mean(axis=1)
        panel.semilogy(orders, error, "o-", color=color, markersize=3, linewidth=1.0, label=f"{window} run")
    panel.set(xlabel="order α", ylabel="error of x (µm)")


def _allan(panel: Axes) -> None:
    interval = 0.01
    noise = np.random.default_rng(1).normal(size=200_000) * 2e-3
    drift = np.cumsum(np.random.default_rng(2).normal(size=200_000)) * 4e-7
    found = fg.rate.allan(noise + drift, interval=interval)
    panel.loglog(found.tau, found.deviation, color=COLORS[0], linewidth=1.3, label="a record at rest")
    walk = found.angle_random_walk.value / np.sqrt(found.tau)
    panel.loglog(found.tau, walk, color="black", linestyle=":", linewidth=1.0, label="its angle random walk")
    panel.set(xlabel="averaging time (s)", ylabel="Allan deviation (rad/s)")


def _speed(panel: Axes) -> None:
    low, high = (logs.number(page_numbers.NUMBERS[f"history.{end}"]()) for end in ("low", "high"))
    panel.barh(["whole history", "exponentials"], [high, 1.0], color=[COLORS[1], COLORS[0]], height=0.5)
    panel.barh(["whole history"], [low], color=COLORS[1], height=0.5, edgecolor="black")
    panel.set(xscale="log", xlim=(0.5, 2 * high), xlabel="time of a run, times that of fracgyro")


def _architecture(panel: Axes) -> None:
    _boxes(panel, "one core,\nC++ headers", ("Python", "C, firmware", "FMU", "WebAssembly"), ("scenario", "studies"))


def _modes(panel: Axes) -> None:
    lag = np.logspace(-3, 1, 200)
    kernel = fg.fractional.design(0.9, 1e-3, 10.0, 1e-3)
    terms = kernel.weights * np.exp(-kernel.poles * lag[:, np.newaxis])
    panel.loglog(lag, np.maximum(terms, 1e-9), color=GREY, linewidth=0.5)
    panel.loglog(lag, terms.sum(axis=1), color=COLORS[0], linewidth=1.6, label="their sum, the kernel")
    panel.set(xlabel="lag", ylabel="weight", ylim=(1e-3, None))


DRAWN: dict[str, tuple[str, Draw]] = {
    "simulate": ("Positions of both axes approach their references within a few milliseconds", _simulate),
    "change": ("Rate estimates: as printed it stays at 95, corrected it nears 100, composite reaches it", _change),
    "repeat": ("The steady error of 20 seeds at each of three orders of the derivative", _repeat),
    "control": ("Tracking errors of two laws of a few lines, and of the paper's controller", _control),
    "sense": ("The rate steps to 1 rad/s; the estimate follows within its band and is then trusted", _sense),
    "export": ("One controller with the same bits on microcontroller, FPGA, Simulink, MATLAB, browser", _export),
    "claims": ("Of nine claims of the paper three hold as printed and four as corrected", _claims),
    "equations": ("The sliding surface and the law for the angular rate", _equations),
    "order": ("Errors over the order of the derivative, of the whole run and of its steady part", _order),
    "allan": ("Allan deviation of a record at rest, and its angle random walk", _allan),
    "speed": ("The whole history takes hundreds to thousands of times as long as exponentials", _speed),
    "architecture": (
        "Scenarios and studies run one core, which Python, firmware, FMU and browser share",
        _architecture,
    ),
    "modes": ("Exponentials and their sum, which is the kernel of the fractional derivative", _modes),
}
CODE = {
    "scenario": ("[controller]", 'kind = "lqg"', "", "[device]", 'sensing = "position"'),
    "studies": ("[vary]", "controller.order =", "  { low = 0.5, high = 1.0 }", "[tune]", "trials = 200"),
    "cli": ("$ fracgyro simulate paper", "$ fracgyro rate dual_mass", "$ fracgyro tune gains.toml"),
    "python": ("import fracgyro as fg", "", "run = fg.simulate(scenario)", "fg.plot(run)"),
    "c": ("/* every FRACGYRO_STEP_SECONDS */", "status = fracgyro_step(", "    &state, &motion, &force);"),
    "cpp": ("auto signals =", "  Controller::step(", "    state, coefficients, motion);"),
    "javascript": ("const loop =", "  await fracgyro.loop(paper);", "loop.run(1000);"),
}


def markdown(name: str) -> str:
    """The picture in Markdown. Raises KeyError for a picture that does not exist."""
    words = DRAWN[name][0] if name in DRAWN else f"Code: {' '.join(' '.join(CODE[name]).split())}"
    return f"![{words}](/pictures/site-{name}.svg)"


def drawn(name: str) -> str:
    """The picture as SVG."""
    if name in CODE:
        return _code(CODE[name])
    title, draw = DRAWN[name]
    with own_style({**LETTERS, "svg.hashsalt": "fracgyro", "font.size": 8, "mathtext.fontset": "dejavusans"}):
        figure = Figure(figsize=SIZE, layout="constrained")
        figure.patch.set_alpha(0.0)
        panel = figure.subplots()
        panel.set_facecolor("none")
        panel.grid(True, linewidth=0.3, alpha=0.5)
        draw(panel)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(loc="upper right", frameon=True, framealpha=0.7, edgecolor="none", fontsize=7)
        return tenths(svg(figure, title))


def _code(lines: tuple[str, ...]) -> str:
    width, height, row = 302, 180, 24
    first = (height - row * (len(lines) - 1)) / 2 + 5
    texts = "".join(
        f'<text x="20" y="{first + row * place:.0f}" xml:space="preserve">{escape(line, quote=False)}</text>'
        for place, line in enumerate(lines)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">'
        f'<rect x="4" y="4" width="{width - 8}" height="{height - 8}" rx="8" fill="none" stroke="{GREY}"/>'
        f'<g font-family="monospace" font-size="13" fill="{COLORS[0]}">{texts}</g></svg>\n'
    )
