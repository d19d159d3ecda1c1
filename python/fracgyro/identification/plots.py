"""Pictures of the report of an identification."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..analysis.html import embedded
from ..analysis.style import COLORS, MM, WIDTH, legend_outside, one_panel, own_style, plain
from .cubic import shift_per
from .cubic_force import analytic_signal, principal_axes
from .diagnostics import LAGS, correlation
from .first_stage import Fitted
from .model import poles, sampled
from .profile import LEVEL
from .second_stage import Device
from .sweep import SweepFit
from .trends import Trend

Array = NDArray[np.float64]

MAX_POINTS = 1500  # points of a curve
BLOCKS = 240  # blocks of an envelope
JOINT_LEVEL = -2 * math.log(0.05)  # 95 % of chi^2 with two degrees of freedom
SHOWN_DELTA = 12.0  # largest excess of the profile that is drawn
GREY = "0.6"


def picture(figure: Figure, title: str) -> str:
    """The source of an HTML image."""
    return embedded(figure, title)


def spectra_figures(fitted: Fitted) -> Iterator[tuple[str, str]]:
    """For each record its spectrum with fit and residual: (image, caption)."""
    for i, (one, segment) in enumerate(zip(fitted.spectra, fitted.segments, strict=True)):
        with own_style():
            figure = Figure(figsize=(WIDTH * MM, 72 * MM), layout="constrained")
            panels = np.atleast_1d(figure.subplots(1, len(segment.axes), sharey=True))
            hertz = one.frequency / (2 * np.pi)
            noise = fitted.fit.noise[i]
            # In the scale of one.motion the noise of a bin is sqrt(2) times that of a sample.
            for k, (axis, panel) in enumerate(zip(segment.axes, panels, strict=True)):
                left = fitted.fit.left[i][:, k]
                measured = one.motion[:, k]
                every = max(len(hertz) // MAX_POINTS, 1)
                panel.semilogy(hertz, np.abs(measured), ".", color=COLORS[k % 2], markersize=2, label="record")
                panel.semilogy(hertz, np.abs(measured - left), color="black", linewidth=0.7, label="fit")
                panel.semilogy(hertz[::every], np.abs(left[::every]), ".", color=GREY, markersize=1.5, label="residual")
                panel.axhline(math.sqrt(2) * noise[k], color=GREY, linewidth=0.7, dashes=(4, 2))
                panel.set_title(f"{axis} pick-off", fontsize=8)
                panel.set_xlabel("frequency (Hz)")
                plain(panel)
            unit = segment.units[0] or "units of the record"
            panels[0].set_ylabel(f"spectrum ({unit})")
            panels[-1].legend(loc="upper right")
            source = picture(figure, f"Spectrum of {segment.name} with fit and residual")
        yield source, f"{segment.name}: spectrum of the band, the fit, and what the fit leaves; dashes: its noise."


def decay_figure(fitted: Fitted) -> str:
    """Envelope of each pick-off over time, with that of the fit, of the first record."""
    segment = fitted.segments[0]
    motion = segment.motion - segment.motion.mean(axis=1, keepdims=True)
    model = simulated(fitted, 0)
    size = max(motion.shape[1] // BLOCKS, math.ceil(2 * np.pi / (fitted.unit * segment.interval)))
    count = motion.shape[1] // size
    time = (np.arange(count) + 0.5) * size * segment.interval
    with own_style():
        figure, panel = one_panel(62)
        for k, axis in enumerate(segment.axes):
            for values, style, label in ((motion[k], ".", axis), (model[k], "-", f"{axis}, fit")):
                blocks = np.abs(values[: count * size]).reshape(count, size).max(axis=1)
                color = COLORS[k % 2] if style == "." else "black"
                panel.semilogy(time, blocks, style, color=color, markersize=3, linewidth=0.7, label=label)
        panel.set_xlabel("time (s)")
        panel.set_ylabel(f"amplitude ({segment.units[0] or 'units of the record'})")
        legend_outside(panel)
        return picture(figure, "Decay of both pick-offs with the fit")


def simulated(fitted: Fitted, i: int) -> Array:
    """The motion that the fit gives for a free record, (axes, samples)."""
    if fitted.cubic is not None and fitted.cubic.fitted:
        return fitted.cubic.motions[i]
    segment, n = fitted.segments[i], fitted.shape.axes
    maps = sampled(fitted.shape, fitted.fit.parameters, segment.interval * fitted.unit)
    values, vectors = np.linalg.eig(np.eye(2 * n) + maps.less_one)
    samples = segment.motion.shape[1]
    inverse = np.linalg.inv(vectors)
    # The transient is x_0 - x_N. The spectrum has the factor sqrt(2/N).
    start = (inverse @ fitted.fit.transients[i][: 2 * n]) / (1 - values**samples) / math.sqrt(2 / samples)
    powers = np.exp(np.outer(np.log(values), np.arange(samples)))
    return np.asarray(np.real((vectors[:n] * start) @ powers))


def backbone_figure(fitted: Fitted) -> str:
    """Frequency of the first record over the square of its amplitude, along each axis with a spring, and the fit."""
    springs, segment = fitted.cubic, fitted.segments[0]
    assert springs is not None
    one, parameters = fitted.spectra[0], fitted.fit.parameters
    own = np.sort(poles(fitted.shape, parameters).imag) * fitted.unit
    per = shift_per(fitted.shape, parameters) * fitted.unit / (2 * np.pi)
    z, base = analytic_signal(principal_axes(fitted.shape, parameters), one, segment)
    size = max(z.shape[1] // 60, 1)
    step = segment.interval * segment.motion.shape[1] / z.shape[1]
    with own_style():
        figure, panel = one_panel(62)
        for k, axis in enumerate(segment.axes):
            if not springs.strength[k]:
                continue
            turned = z[k] * np.exp(1j * (base - own[k]) * step * np.arange(z.shape[1]))
            angle = np.unwrap(np.angle(turned))
            squared, hertz = [], []
            for at in range(size, len(angle) - 2 * size, size):  # the ends of a filtered signal are not its own
                squared.append(float(np.mean(np.abs(turned[at : at + size]) ** 2)))
                hertz.append(float(np.polyfit(step * np.arange(size), angle[at : at + size], 1)[0] / (2 * np.pi)))
            kept = np.array(squared) > 0.05 * max(squared)
            panel.plot(
                np.array(squared)[kept], np.array(hertz)[kept], ".", color=COLORS[k % 2], markersize=3, label=axis
            )
            ends = np.array([0.0, max(squared)])
            panel.plot(ends, per[k] * springs.strength[k] * ends, color="black", linewidth=0.8, label=f"{axis}, fit")
        panel.set_xlabel(f"square of the amplitude ({segment.units[0] or 'unit of the record'}²)")
        panel.set_ylabel("frequency less that of a\nsmall motion (Hz)")
        legend_outside(panel)
        return picture(figure, "Frequency over the square of the amplitude")


def circle_figure(swept: SweepFit) -> str:
    """The response in the complex plane, with the fit and an arrow to the feedthrough."""
    response = swept.response
    n, drives = len(response.axes), len(response.drives)
    with own_style():
        figure = Figure(figsize=(WIDTH * MM, (80 if n * drives < 3 else 130) * MM), layout="constrained")
        panels = np.reshape(figure.subplots(n, drives, squeeze=False), (n, drives))
        for i, axis in enumerate(response.axes):
            for k, drive in enumerate(response.drives):
                panel, measured, model = panels[i, k], response.values[:, i, k], swept.model[:, i, k]
                panel.plot(measured.real, measured.imag, ".", color=COLORS[i % 2], markersize=3, label="record")
                panel.plot(model.real, model.imag, color="black", linewidth=0.8, label="fit")
                through = swept.feedthrough[i, k]
                middle = 0.5 * (model[np.argmax(np.abs(model - through))] + through)
                panel.annotate(
                    "feedthrough", (through.real, through.imag), (middle.real, middle.imag), fontsize=7,
                    arrowprops={"arrowstyle": "->", "linewidth": 0.8},
                )  # fmt: skip
                panel.set_title(f"pick-off {axis}, drive {drive}", fontsize=8)
                panel.set_aspect("equal", "datalim")
                plain(panel)
        panels[-1, 0].set_xlabel("real part")
        panels[-1, 0].set_ylabel("imaginary part")
        panels[0, -1].legend(loc="best")
        return picture(figure, f"Response of {response.name} in the complex plane")


def response_figure(swept: SweepFit) -> str:
    """Distance of the response from the feedthrough over frequency, with fit and residual."""
    response = swept.response
    with own_style():
        figure, panel = one_panel(70)
        for i, axis in enumerate(response.axes):
            for k, drive in enumerate(response.drives):
                through = swept.feedthrough[i, k]
                label = f"{axis}{drive}"
                color = COLORS[(i + k) % 2]
                measured, model = response.values[:, i, k] - through, swept.model[:, i, k] - through
                panel.semilogy(response.frequency, np.abs(measured), ".", color=color, markersize=3, label=label)
                panel.semilogy(response.frequency, np.abs(model), color="black", linewidth=0.7)
                left = np.abs(response.values[:, i, k] - swept.model[:, i, k])
                panel.semilogy(response.frequency, left, ".", color=GREY, markersize=1.5)
        panel.set_xlabel("frequency (Hz)")
        panel.set_ylabel("response less feedthrough")
        legend_outside(panel)
        return picture(figure, f"Response of {response.name} over frequency")


def whiteness_figure(fits: Sequence[Fitted | SweepFit]) -> str:
    """Correlation of the residuals with later bins, and the band that 95 % of white noise keeps to."""
    with own_style():
        figure, panel = one_panel(55)
        lags = np.arange(1, LAGS + 1)
        fewest = math.inf
        for fit in fits:
            for part in fit.fit.residuals:
                fewest = min(fewest, len(part))
                for k in range(part.shape[1]):
                    size = min(LAGS, len(part) // 3)
                    found = np.abs(correlation(part[:, k], size))
                    panel.plot(lags[:size], found, color=COLORS[k % 2], marker=".", markersize=3, linewidth=0.6)
        panel.axhline(math.sqrt(math.log(20) / fewest), color="black", linewidth=0.7, dashes=(4, 2))
        panel.set_ylim(bottom=0)
        panel.set_xlabel("bins later")
        panel.set_ylabel("correlation of the residual")
        return picture(figure, "Correlation of the residuals")


def profile_figure(device: Device) -> str:
    """Chi-squared and coupling damping over the pick-off ratio; dxy that D >= 0 forbids is shaded."""
    ratio, coupling, excess = device.profile.curve.T
    names = device.problem.names
    values = dict(zip(names, device.solution.parameters, strict=True))
    limit = math.sqrt(max(values["dxx"] * values["dyy"], 0.0))
    with own_style():
        figure = Figure(figsize=(WIDTH * MM, 90 * MM), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True)
        inside = excess < SHOWN_DELTA
        order = np.argsort(ratio)
        above.plot(ratio[order], excess[order], color=COLORS[0], marker=".", markersize=2, linewidth=0.8)
        above.axhline(LEVEL, color="black", linewidth=0.7, dashes=(4, 2))
        above.set_ylim(0, SHOWN_DELTA)
        above.set_ylabel("chi² above its minimum")
        below.plot(ratio[order], device.problem.unit * coupling[order], color=COLORS[1], linewidth=0.9)
        low, high = below.get_ylim()
        edge = device.problem.unit * limit
        for forbidden in ((edge, max(high, 1.3 * edge)), (min(low, -1.3 * edge), -edge)):
            below.axhspan(*forbidden, color=GREY, alpha=0.3, linewidth=0)
        below.set_ylabel("dxy/m (1/s)")
        below.set_xlabel("pick-off ratio, y over x")
        if inside.sum() > 2 and np.ptp(ratio[inside]) > 0:
            margin = 0.05 * float(np.ptp(ratio[inside]))
            above.set_xlim(float(ratio[inside].min()) - margin, float(ratio[inside].max()) + margin)
        for panel in (above, below):
            plain(panel)
        return picture(figure, "Profile over the pick-off ratio")


def ellipse_figure(device: Device) -> str:
    """The joint 95 % region of pick-off ratio and coupling damping; dxy that D >= 0 forbids is shaded."""
    unit, names, profile = device.problem.unit, device.problem.names, device.profile
    values = dict(zip(names, device.solution.parameters, strict=True))
    level = JOINT_LEVEL * profile.level / LEVEL
    near = profile.curve[profile.curve[:, 2] <= 2 * level]
    near = near[np.argsort(near[:, 0])]
    ratio = np.linspace(near[0, 0], near[-1, 0], MAX_POINTS)
    coupling, excess = (np.interp(ratio, near[:, 0], near[:, k]) for k in (1, 2))
    inside = excess <= level
    ratio, coupling, excess = ratio[inside], coupling[inside], excess[inside]
    place = names.index("dxy")
    spread = math.sqrt(max(float(profile.points[0].solution.covariance[place, place]), 0.0))  # at a known ratio
    half = spread * np.sqrt(level - excess)
    edge = unit * math.sqrt(max(values["dxx"] * values["dyy"], 0.0))
    with own_style():
        figure, panel = one_panel(70)
        panel.fill_between(
            ratio, unit * (coupling - half), unit * (coupling + half), color=COLORS[0], alpha=0.35, linewidth=0.8
        )
        panel.plot(ratio, unit * coupling, color=COLORS[0], linewidth=0.9)
        if not profile.open:
            panel.plot([math.exp(values["log_ratio"])], [unit * values["dxy"]], "o", color="black", markersize=4)
        low, high = panel.get_ylim()
        for forbidden in ((edge, max(high, edge)), (min(low, -edge), -edge)):
            panel.axhspan(*forbidden, color=GREY, alpha=0.3, linewidth=0)
        panel.set_ylim(low, high)
        panel.set_xlabel("pick-off ratio, y over x")
        panel.set_ylabel("dxy/m (1/s)")
        plain(panel)
        return picture(figure, "Joint region of the pick-off ratio and the coupling damping")


def axes_figure(device: Device) -> str:
    """Principal axes of K and D over the axes of the pick-offs."""
    values = dict(zip(device.problem.names, device.solution.parameters, strict=True))
    with own_style():
        figure = Figure(figsize=(90 * MM, 90 * MM), layout="constrained")
        panel = figure.add_subplot()
        for letter, color, words in (("k", COLORS[0], "stiffness K"), ("d", COLORS[1], "damping D")):
            xx, xy, yy = (values[f"{letter}{each}"] for each in ("xx", "xy", "yy"))
            sizes, vectors = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
            lengths = np.sqrt(np.abs(sizes) / np.abs(sizes).max())
            for i in range(2):
                x, y = (0.3 + 0.7 * lengths[i]) * vectors[:, i]
                panel.plot([-x, x], [-y, y], color=color, linewidth=1.2, label=words if i == 0 else None)
        for x, y, name in ((1.15, 0.0, "x"), (0.0, 1.15, "y")):
            panel.plot([-x, x], [-y, y], color=GREY, linewidth=0.7, dashes=(4, 2))
            panel.text(1.04 * x, 1.04 * y, name, ha="center", va="center")
        panel.set_aspect("equal")
        panel.set_axis_off()
        panel.legend(loc="lower left")
        return picture(figure, "Principal axes of stiffness and damping")


def trend_figure(trend: Trend) -> str:
    """The points of a trend with their intervals, and the line."""
    at, value, deviation = np.array(trend.points).T
    with own_style():
        figure, panel = one_panel(60)
        panel.errorbar(at, value, 1.96 * deviation, color=COLORS[0], fmt="o", markersize=3, linewidth=0.8)
        span = np.array([at.min(), at.max()])
        panel.plot(span, trend.intercept + trend.slope * span, color="black", linewidth=0.8)
        panel.set_xlabel(trend.over)
        panel.set_ylabel(trend.name)
        return picture(figure, f"{trend.name} over {trend.over}")
