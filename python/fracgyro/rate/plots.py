"""Plots of the reports, with their data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..analysis.html import csv_text, embedded
from ..analysis.style import COLORS, MM, WIDTH, legend_outside, one_panel, own_style, plain
from .allan import FLOOR, Allan
from .bound import Bound
from .in_volts import AngleDrift
from .inspection import Event
from .measure import Characterization
from .procedures import Point
from .units import DEG_PER_H, DEG_PER_S, DEGREE, MILLISECOND

Array = NDArray[np.float64]

LEFT_OUT = "left out of the fit"
SPANS = 1000  # intervals of a record in a plot
TURN_ON_TIMES = 5.0  # length of the turn-on plot, in turn-on times
BINS = 60  # half a turn of a line of vibration
LOGARITHMIC_FROM = 10.0  # largest turn-on output over the range, above which the scale is logarithmic


class Chart(NamedTuple):
    """A plot as HTML image source, and its data as CSV."""

    source: str
    data: str


def allan_chart(m: Characterization) -> Chart:
    """`allan_figure` with its data."""
    unit, tau = DEG_PER_H.per_si, m.allan.tau
    columns = {
        "averaging time (s)": tau,
        "low end of the 95 % interval (deg/h)": m.allan.low * unit,
        "high end (deg/h)": m.allan.high * unit,
    }
    with own_style():
        figure = allan_figure(m.allan, m.bound)
        for line in figure.axes[0].lines:  # a horizontal line has one value
            if line.get_label() != LEFT_OUT:
                columns[f"{line.get_label()} (deg/h)"] = np.resize(np.asarray(line.get_ydata()), tau.shape)
        source = embedded(figure, "Allan deviation over averaging time")
    return Chart(source, _data(columns))


def allan_figure(found: Allan, bound: Bound | None = None, label: str = "output") -> Figure:
    """The deviation with its interval, the contribution of each term, and the Cramér-Rao bound.

    Call and save it within `own_style`.
    """
    figure, panel = one_panel(78)
    unit, tau = DEG_PER_H.per_si, found.tau
    panel.fill_between(tau, found.low * unit, found.high * unit, color=COLORS[0], alpha=0.2, linewidth=0)
    panel.loglog(tau, found.deviation * unit, color=COLORS[0], marker="o", markersize=3, linewidth=1, label=label)
    first, last = found.fitted or (math.inf, 0.0)
    out = (tau < 0.99 * first) | (tau > 1.01 * last)
    if out.any():
        hollow: dict[str, Any] = {"linestyle": "", "marker": "o", "markersize": 3.5, "markerfacecolor": "white"}
        panel.loglog(tau[out], found.deviation[out] * unit, color=COLORS[0], label=LEFT_OUT, **hollow)
    dashes: dict[str, Any] = {"linewidth": 0.7, "dashes": (4, 2)}
    if found.angle_random_walk and not found.angle_random_walk.limit:
        line = found.angle_random_walk.value / np.sqrt(tau) * unit
        panel.loglog(tau, line, color="black", label="slope −1/2: angle random walk", **dashes)
    if not found.bias_instability.limit:
        level = found.bias_instability.value * FLOOR * unit
        panel.axhline(level, color="#009E73", label="0.664 × bias instability", **dashes)
    if not found.rate_random_walk.limit:
        line = found.rate_random_walk.value * np.sqrt(tau / 3) * unit
        panel.loglog(tau, line, color="#CC79A7", label="slope +1/2: rate random walk", **dashes)
    if not found.quantization.limit:
        line = math.sqrt(3) * found.quantization.value / tau * unit
        panel.loglog(tau, line, color="#E69F00", label="slope −1: quantization", **dashes)
    if bound:
        known, unknown = (n / np.sqrt(tau) * unit for n in (bound.known, bound.unknown))
        panel.loglog(tau, known, color=COLORS[1], linewidth=0.9, label="Cramér-Rao bound, D and K known")
        label = "Cramér-Rao bound, D and K unknown"
        panel.loglog(tau, unknown, color=COLORS[1], linewidth=0.9, dashes=(2, 2), label=label)
    panel.set_ylim(bottom=float(np.min(found.deviation)) * unit / 3, top=float(np.max(found.deviation)) * unit * 3)
    panel.set_xlabel("averaging time (s)")
    panel.set_ylabel("Allan deviation (deg/h)")
    legend_outside(panel)
    return figure


def series_figure(values: Array, interval: float, events: tuple[Event, ...] = ()) -> Figure:
    """A record over time: mean and range of the samples in each of a thousand intervals, and the events.

    Call and save it within `own_style`.
    """
    figure, panel = one_panel(62)
    spans = min(SPANS, len(values))
    edges = np.linspace(0, len(values), spans + 1).astype(int)
    low, high = (DEG_PER_S.per_si * reduce.reduceat(values, edges[:-1]) for reduce in (np.minimum, np.maximum))
    means = DEG_PER_S.per_si * np.add.reduceat(values, edges[:-1]) / np.diff(edges)
    time, unit = _span(len(values) * interval)
    at = (edges[:-1] + edges[1:]) / 2 * interval * time
    panel.fill_between(at, low, high, color=COLORS[0], alpha=0.35, linewidth=0, label="range of the samples")
    panel.plot(at, means, color=COLORS[0], linewidth=0.8, label=f"mean of {np.diff(edges).max():,} samples")
    labeled = False
    for event in events:
        if event.kind in ("steps", "repeated", "drift", "vibration"):
            continue  # the whole record is affected
        label = None if labeled else "found in the record"
        labeled = True
        if event.end - event.time < 2e-3 * len(values) * interval:
            # Above the panel: a line across it would hide the event.
            panel.plot(
                event.time * time,
                1.03,
                "v",
                color=COLORS[1],
                markersize=5,
                transform=panel.get_xaxis_transform(),
                clip_on=False,
                linestyle="none",
                label=label,
            )
        else:
            panel.axvspan(event.time * time, event.end * time, color=COLORS[1], alpha=0.18, linewidth=0, label=label)
    panel.set_xlim(0, len(values) * interval * time)
    panel.set_xlabel(f"time ({unit})")
    panel.set_ylabel("rate (deg/s)")
    legend_outside(panel)
    return figure


def _span(seconds: float) -> tuple[float, str]:
    """Factor from seconds to the unit of the time axis, and that unit."""
    if seconds > 4 * 3600:
        return 1 / 3600, "h"
    return (1 / 60, "min") if seconds > 600 else (1.0, "s")


def ladder_chart(m: Characterization) -> Chart:
    """Mean output minus the least-squares line, over the rate."""
    with own_style():
        figure, panel = one_panel(62)
        rate, deviation = DEG_PER_S.per_si * m.rates, DEG_PER_S.per_si * m.static.deviation
        panel.axhline(0, color="black", linewidth=0.5)
        panel.plot(rate, deviation, color=COLORS[0], marker="o", markersize=3, linewidth=0.8)
        panel.set_xlabel("rate (deg/s)")
        panel.set_ylabel("mean output minus the line (deg/s)")
        source = embedded(figure, "Deviation from the line over the rate")
    return Chart(source, _data({"rate (deg/s)": rate, "mean output minus the line (deg/s)": deviation}))


def turn_on_chart(m: Characterization) -> Chart:
    """Output of every run from its start, at the highest rate of the range."""
    with own_style():
        figure, panel = one_panel(62)
        time = MILLISECOND.per_si * m.turn_on.time
        for i, run in enumerate(m.turn_on.rate):
            label = "output, one line per run" if i == 0 else None
            panel.plot(time, DEG_PER_S.per_si * run, color=COLORS[0], linewidth=0.6, alpha=0.6, label=label)
        panel.axhline(DEG_PER_S.of(float(m.rates[-1])), color="black", linewidth=0.9, dashes=(4, 2.5), label="rate")
        if math.isfinite(m.turn_on_time):
            start = MILLISECOND.of(m.turn_on_time)
            panel.axvline(start, color=COLORS[1], linewidth=0.9, label="turn-on time")
            panel.set_xlim(0, min(float(time[-1]), TURN_ON_TIMES * start))
        largest = DEG_PER_S.of(float(abs(m.turn_on.rate).max()))
        if largest > LOGARITHMIC_FROM * DEG_PER_S.of(float(m.rates[-1])):
            panel.set_yscale("symlog", linthresh=1000)
            powers = 10.0 ** np.arange(3, math.ceil(math.log10(largest)) + 1)
            panel.set_yticks([*-powers[::-1], 0, *powers])
        panel.set_xlabel("time (ms)")
        panel.set_ylabel("output (deg/s)")
        legend_outside(panel)
        source = embedded(figure, "Output from the start")
        seen = time <= panel.get_xlim()[1]
    runs = {f"output of run {i} (deg/s)": DEG_PER_S.per_si * run[seen] for i, run in enumerate(m.turn_on.rate, 1)}
    return Chart(source, _data({"time (ms)": time[seen], **runs}))


def response_chart(m: Characterization) -> Chart:
    """Gain and phase lag over the frequency of the rate."""
    with own_style():
        figure = Figure(figsize=(WIDTH * MM, 82 * MM), layout="constrained")
        gain, lag = figure.subplots(2, 1, sharex=True)
        style = {"color": COLORS[0], "marker": "o", "markersize": 3, "linewidth": 0.8}
        decibels, degrees = 20 * np.log10(m.response.gain), DEGREE.per_si * m.response.lag
        gain.semilogx(m.response.frequency, decibels, **style)
        gain.axhline(20 * math.log10(math.sqrt(0.5)), color="black", linewidth=0.7, dashes=(4, 2.5))
        lag.semilogx(m.response.frequency, degrees, **style)
        if 0 < m.response.bandwidth.mean < math.inf:
            for panel in (gain, lag):
                panel.axvline(m.response.bandwidth.mean, color=COLORS[1], linewidth=0.9)
        gain.set_ylabel("gain (dB)")
        lag.set_ylabel("phase lag (deg)")
        lag.set_xlabel("frequency of the rate (Hz)")
        for panel in (gain, lag):
            plain(panel)
        source = embedded(figure, "Gain and phase lag over frequency")
    columns = {"frequency of the rate (Hz)": m.response.frequency, "gain (dB)": decibels, "phase lag (deg)": degrees}
    return Chart(source, _data(columns))


def angle_chart(found: AngleDrift) -> Chart:
    """Rate less its mean over the angle of the line of vibration, in bins of half a turn, with its fit."""
    within = np.mod(found.angle, math.pi)
    middles = (np.arange(BINS) + 0.5) * math.pi / BINS
    place = np.minimum((within * BINS / math.pi).astype(int), BINS - 1)
    counts = np.bincount(place, minlength=BINS)
    sums = np.bincount(place, weights=found.rate - found.mean, minlength=BINS)
    seen = counts > 0
    unit, angles = DEG_PER_H.per_si, np.degrees(middles[seen])
    measured, fitted = unit * sums[seen] / counts[seen], unit * (found.fitted(middles[seen]) - found.mean)
    with own_style():
        figure, panel = one_panel(62)
        panel.plot(angles, measured, color=COLORS[0], linestyle="", marker="o", markersize=3, label="mean of a bin")
        panel.plot(angles, fitted, color="black", linewidth=0.9, label="fit")
        panel.set_xlabel("angle of the line (deg)")
        panel.set_ylabel("rate less its mean (deg/h)")
        legend_outside(panel)
        source = embedded(figure, "Rate over the angle of the line of vibration")
    columns = {"angle of the line (deg)": angles, "rate less its mean (deg/h)": measured, "fit (deg/h)": fitted}
    return Chart(source, _data(columns))


def temperature_chart(points: Sequence[Point]) -> Chart | None:
    """Zero-rate output over the temperature, less its mean at the nominal one; None without such points."""
    found = [each for each in points if each.procedure == "temperature, at rest"]
    if not found:
        return None
    kelvin, output, run = (np.array([getattr(each, name) for each in found]) for name in ("at", "value", "run"))
    output = 3600.0 * (output - output[kelvin == 0.0].mean())
    with own_style():
        figure, panel = one_panel(62)
        panel.axhline(0, color="black", linewidth=0.5)
        for each in np.unique(run):
            panel.plot(
                kelvin[run == each], output[run == each], color=COLORS[0], marker="o", markersize=3, linewidth=0.8
            )
        panel.set_xlabel("temperature from nominal (K)")
        panel.set_ylabel("zero-rate output (deg/h)")
        source = embedded(figure, "Zero-rate output over the temperature")
    return Chart(source, _data({"temperature (K)": kelvin, "run": run, "zero-rate output (deg/h)": output}))


def _data(columns: dict[str, Any]) -> str:
    return csv_text(columns, zip(*columns.values(), strict=True))
