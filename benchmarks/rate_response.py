"""Bandwidth and step response of the rate against its noise, compared with a Kalman filter.

Writes benchmarks/results/rate_response.md and docs/rate_response.svg.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import fracgyro as fg
import numpy as np
import xarray as xr
from fracgyro.analysis.style import own_style, save_svg
from fracgyro.rate.merit import gain_and_lag, response
from fracgyro.rate.units import DEG_PER_S
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.to_core import datasheet
from machine import command, machine, write
from matplotlib.figure import Figure
from numpy.typing import NDArray

DEPENDS_ON = ["sliding_mode", "composite", "joint"]

Array = NDArray[np.float64]

DRAWING = Path(__file__).resolve().parents[1] / "docs" / "rate_response.svg"
SCENARIOS = ["paper_resonance", "dual_mass"]
DEVICES = ["paper_resonance", "dual_mass", "tuned_in_air", "disc"]
RATE = DEG_PER_S.to_si(100.0)
# A step of more standard deviations makes a filter restart; for least squares and for the joint filter.
MOST, MOST_JOINT = 300.0, 100.0
CORNERS = [10.0, 30.0, 100.0, 300.0]  # Hz, of adaptation.rate_forgetting
SPREAD = np.geomspace(0.25, 4.0, 7)  # sine frequencies over the corner
SEEDS = range(4)
EVERY = 8  # steps between samples of the output; the Kalman filter processes as many at a time
SETTLED = 0.02  # fraction of the step
WITHIN = 1.5  # limit for the estimator's noise over the Kalman filter's
COLOURS = ["#E69F00", "#0072B2", "#009E73", "#CC79A7"]


def kalman(run: xr.Dataset, scenario: fg.Scenario, walk: float) -> Array:
    """Rate estimate of a Kalman filter that knows D and K and models Omega_z as a random walk of this intensity.

    Nondimensional; `walk` is variance per unit of time. Measurement of every step: the impulse of eq. (9) not explained
                                                         by D, K and the force is 2 Omega_z J dq, plus noise of variance
                                                         S h on each axis. EVERY steps are processed at once, one
                                                         element for each. The element at a time contains the
                                                         information of the steps before it.
    """
    position, velocity, force = (run[name].values for name in ("position", "velocity", "control"))
    h = scenario.run.step
    damping, stiffness = (_matrix(entries) for entries in scenario.plant.nondimensional()[:2])
    moved = np.diff(position, axis=0)
    held = h / 2 * (position[1:] + position[:-1]) + h**2 / 12 * (velocity[:-1] - velocity[1:])
    # Hermite's rule has an error of h^5/720 times the fourth derivative, which with known K appears as a beat of the
    # axes.
    held += h**5 / 720 * np.array(scenario.reference.frequency) ** 4 * position[1:]
    left = np.diff(velocity, axis=0) - h * force[:-1] + moved @ damping + held @ stiffness
    # left = -2 Omega_z (-dq_y, dq_x) + noise
    row = 2 * np.stack([moved[:, 1], -moved[:, 0]], axis=1)
    density = scenario.disturbance.density or 0.0
    information, score = (_together((row * other).sum(axis=1) / (density * h)) for other in (row, left))
    estimate, variance = 0.0, 1.0
    found = np.empty(len(information) + 1)
    found[0] = 0.0
    for i, (gained, seen) in enumerate(zip(information.tolist(), score.tolist(), strict=True)):
        variance = 1.0 / (1.0 / (variance + walk * EVERY * h) + gained)
        estimate += variance * (seen - gained * estimate)
        found[i + 1] = estimate
    return found


def _together(values: Array) -> Array:
    return np.asarray(values[: len(values) // EVERY * EVERY].reshape(-1, EVERY).sum(axis=1), dtype=float)


def _matrix(entries: Array) -> Array:
    xx, xy, yy = entries
    return np.array([[xx, xy], [xy, yy]])


Changes = dict[str, object]
Outputs = Callable[[Changes], tuple[Array, ...]]  # time in s, and estimates in rad/s at these times


def both(scenario: fg.Scenario, walk: float, changes: Changes) -> tuple[Array, Array, Array]:
    """Time in s; Omega_z in rad/s from least squares and from the Kalman filter, in the same run. The filter uses the
    scenario without these changes to the run.
    """
    run = fg.simulate(scenario.replace(changes))
    scales = scenario.plant.scales
    best = kalman(run, scenario, walk)
    rows = slice(0, EVERY * len(best), EVERY)
    return run["time"].values[rows] * scales.time, run["rate_estimate"].values[rows] * scales.rate, best * scales.rate


def noise(records: list[Array]) -> float:
    """Standard deviation over the steady half of all runs, rad/s."""
    steady = np.array(records)[:, len(records[0]) // 2 :]
    return float(np.sqrt(np.mean((steady - steady.mean(axis=1, keepdims=True)) ** 2)))


@dataclass(frozen=True)
class Step:
    """Response to a step of the rate, normalized, at times in s after the step."""

    time: Array
    answer: Array

    @property
    def overshoot(self) -> float:
        return max(0.0, float(self.answer.max()) - 1.0)

    @property
    def rise(self) -> float:
        """s, from 10 to 90 %."""
        ten, ninety = (self.time[int(np.argmax(self.answer >= level))] for level in (0.1, 0.9))
        return float(ninety - ten)

    @property
    def settling(self) -> float:
        """s, until it stays within 2 %."""
        off = np.flatnonzero(abs(self.answer - 1.0) > SETTLED)
        return float(self.time[off[-1] + 1])


@dataclass(frozen=True)
class Answer:
    """Response of one estimator at one corner: rad/s, Hz, rad."""

    noise: float
    bandwidth: float
    lag: float
    step: Step


def answers(scenario: fg.Scenario, corner: float, outputs: Outputs, quiet: Changes, most: float) -> list[Answer]:
    """One for each estimator; `quiet` removes noise that the estimator assumes in any case."""
    scales = scenario.plant.scales
    resting = [outputs({"disturbance.seed": seed})[1:] for seed in SEEDS]
    deviations = [noise(list(records)) for records in zip(*resting, strict=True)]

    size = min(RATE, most * deviations[0])
    moving: Changes = {"rate.amplitude": size, **quiet}
    frequencies = corner * SPREAD
    gains: list[list[complex]] = []
    for frequency in frequencies.tolist():
        at, *found = outputs({**moving, "rate.kind": "sine", "rate.frequency": 2 * math.pi * frequency})
        half = len(at) // 2
        gains.append([gain_and_lag(at[half:], answer[half:], size, frequency, 0.0) for answer in found])

    h = scenario.run.step
    start = EVERY * h * round(10_000 / (EVERY * h))
    until = start + EVERY * h * round(10 / (2 * math.pi * corner * scales.time * EVERY * h))
    jump = {"rate.kind": "step", "rate.start": start * scales.time, "run.duration": until}
    at, *found = outputs({**moving, **jump})
    after = at >= start * scales.time

    answered = []
    for i, answer in enumerate(found):
        wide = response(frequencies, np.array(gains)[:, i : i + 1].repeat(2, axis=1), 1.0)
        step = Step(at[after] - start * scales.time, answer[after] / size)
        answered.append(Answer(deviations[i], wide.bandwidth.mean, wide.lag_at_bandwidth, step))
    return answered


def measure(scenario: fg.Scenario, corner: float) -> tuple[Answer, Answer]:
    """Results of least squares and of the Kalman filter."""
    # The steady filter is of first order: corner sqrt(walk)/N, with N^2 = S/(4 mean |v|^2).
    speed = fg.simulate(scenario.replace({"run.duration": 2000.0}))["velocity"].values
    density = scenario.disturbance.density or 0.0
    square = (2 * math.pi * corner * scenario.plant.scales.time) ** 2
    walk = square * density / (4 * float((speed**2).sum(axis=1).mean()))
    ours, best = answers(scenario, corner, lambda changes: both(scenario, walk, changes), {}, MOST)
    return ours, best


def of_positions(scenario: fg.Scenario, corner: float) -> Answer:
    """Results of the joint filter of a shipped device, which assumes the noise of its datasheet."""
    noise_of = datasheet(scenario)
    named = {f"datasheet.{name}": getattr(noise_of, name) for name in ("force_noise", "position_noise")}
    scenario = scenario.replace({**named, "run.record_every": EVERY})
    scales = scenario.plant.scales

    def outputs(changes: Changes) -> tuple[Array, ...]:
        run = fg.simulate(scenario.replace(changes))
        return run["time"].values * scales.time, run["rate_estimate"].values * scales.rate

    quiet: Changes = {
        "disturbance.density": (scenario.disturbance.density or 0.0) * 1e-6,
        "device.position_noise_density": scenario.device.position_noise_density * 1e-3,
    }
    return answers(scenario, corner, outputs, quiet, MOST_JOINT)[0]


def ratio(ours: Answer, best: Answer) -> float:
    """Noise over noise, each over the root of its bandwidth."""
    return ours.noise / math.sqrt(ours.bandwidth) / (best.noise / math.sqrt(best.bandwidth))


def cells(answer: Answer) -> list[str]:
    step = answer.step
    return [
        f"{answer.bandwidth:.1f} Hz",
        f"{math.degrees(answer.lag):.0f}°",
        f"{1e2 * step.overshoot:.1f} %",
        f"{1e3 * step.rise:.3g} ms",
        f"{1e3 * step.settling:.3g} ms",
        f"{1e3 * DEG_PER_S.of(answer.noise):.3g} mdeg/s",
    ]


def line(*words: str) -> str:
    found = f"| {' | '.join(words)} |"
    print(found, flush=True)
    return found


def long_enough(scenario: fg.Scenario, corner: float) -> fg.Scenario:
    """12 periods of the slowest sine in the steady half, within the range of the exponentials."""
    steps = min(24 / (corner * SPREAD[0]) / scenario.plant.scales.time / scenario.run.step, 900_000)
    steps = EVERY * round(max(steps, 80_000) / EVERY)
    rate = 2 * math.pi * corner * scenario.plant.scales.time
    return scenario.replace(
        {
            "plant.angular_rate": 0.0,
            "adaptation.forgetting": 0.0,
            "adaptation.rate_forgetting": rate,
            "run.duration": steps * scenario.run.step,
        }
    )


def main() -> None:
    begin = time.perf_counter()
    columns = "bandwidth | lag there | overshoot | rise | settling | noise"
    lines = [
        "# The rate estimate: bandwidth and step against noise",
        "",
        f"Made by `{command()}`, which is part of `make bench`. Machine: {machine()}.",
        "",
        "Composite adaptation, adaptation.rate_forgetting from 2π · 10 Hz to 2π · 300 Hz. Noise: standard deviation "
        f"of Ω̂z about its mean at rest, steady half of {len(SEEDS)} runs. Bandwidth (−3 dB) and lag: from sines. Rise "
        "from 10 to 90 %, settling to within 2 % for good: from a step. Both are of 100 deg/s, or of "
        f"{MOST:g} times the noise ({MOST_JOINT:g} below) if that is less: a step of more, which no vehicle makes, is "
        "a disagreement, after which the filter begins again and is there at once. Next to it is the Kalman filter "
        "that knows D, K and the noise and takes Ωz for a random walk, on the same runs, its walk chosen for the "
        f"corner, {EVERY} steps at a time. Noise grows as the root of the bandwidth: the last column is noise over "
        "noise, each over the root of its own bandwidth.",
        "",
        f"| scenario | set | {columns} | Kalman: {columns} | ratio |",
        "|---" * 15 + "|",
    ]
    measured: dict[str, list[tuple[Answer, Answer]]] = {}
    for name in SCENARIOS:
        for corner in CORNERS:
            scenario = long_enough(exactly_sensed(name), corner)
            measured.setdefault(name, []).append(measure(scenario, corner))
            ours, best = measured[name][-1]
            lines.append(line(name, f"{corner:g} Hz", *cells(ours), *cells(best), f"{ratio(ours, best):.2f}"))
    draw(measured)
    ratios = [ratio(*pair) for pairs in measured.values() for pair in pairs]
    lines += ["", f"The ratio is {min(ratios):.2f} to {max(ratios):.2f}; {WITHIN:g} was to be kept."]
    lines += [
        "",
        "## Joint adaptation, positions with sensing noise",
        "",
        "The shipped devices, at the same settings.",
        "",
        f"| scenario | set | {columns} |",
        "|---" * 8 + "|",
    ]
    for name in DEVICES:
        for corner in CORNERS:
            scenario = long_enough(fg.Scenario.shipped(name), corner)
            lines.append(line(name, f"{corner:g} Hz", *cells(of_positions(scenario, corner))))
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("rate_response", lines)


def draw(measured: dict[str, list[tuple[Answer, Answer]]]) -> None:
    """Noise over bandwidth for both scenarios, and next to them the step responses of the last one."""
    with own_style():
        figure = Figure(figsize=(170 / 25.4, 72 / 25.4), layout="constrained")
        trade, steps = figure.subplots(1, 2)
        for (name, pairs), colour in zip(measured.items(), COLOURS[1:], strict=False):
            ours, best = (list(column) for column in zip(*pairs, strict=True))
            first = name == SCENARIOS[0]
            places = np.array([answer.bandwidth for answer in best])
            level = 1e3 * DEG_PER_S.per_si * np.array([answer.noise for answer in best])
            trade.loglog(places, level, color=colour, linewidth=0.9, label="Kalman filter" if first else None)
            trade.loglog(
                places,
                WITHIN * level,
                color=colour,
                linewidth=0.7,
                dashes=(4, 2),
                label=f"{WITHIN:g} times it" if first else None,
            )
            trade.loglog(
                [answer.bandwidth for answer in ours],
                [1e3 * DEG_PER_S.of(answer.noise) for answer in ours],
                color=colour,
                marker="o",
                markersize=4,
                linestyle="none",
                label="composite" if first else None,
            )
            trade.text(places[-1], 0.38 * level[-1], name, color=colour, fontsize=7, ha="right")
        trade.set_xlabel("bandwidth, −3 dB (Hz)")
        trade.set_ylabel("noise, 1 σ (mdeg/s)")
        name, pairs = list(measured.items())[-1]
        for (ours, best), corner, colour in zip(pairs, CORNERS, COLOURS, strict=True):
            steps.semilogx(1e3 * ours.step.time[1:], ours.step.answer[1:], color=colour, label=f"{corner:g} Hz")
            steps.semilogx(1e3 * best.step.time[1:], best.step.answer[1:], color="black", linewidth=0.7, dashes=(3, 3))
        steps.set_xlim(left=0.05)
        steps.set_xlabel("time since the step (ms)")
        steps.set_ylabel("answer over the step")
        steps.set_title(f"{name}; dashed: Kalman filter", fontsize=8)
        for panel in (trade, steps):
            panel.grid(True, linewidth=0.3)
        trade.set_ylim(top=400.0)  # room for the legend
        trade.legend(fontsize=7, loc="upper left")
        steps.legend(fontsize=7, loc="upper left", title="set to", title_fontsize=7)
        save_svg(figure, DRAWING, "Noise and step response of the rate against its bandwidth")


if __name__ == "__main__":
    main()
