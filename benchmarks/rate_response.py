"""The rate's bandwidth and step against its noise, beside a Kalman filter.

Writes benchmarks/results/rate_response.md and docs/rate_response.svg.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import fracgyro as fg
import numpy as np
import xarray as xr
from fracgyro.analysis.style import own_style
from fracgyro.rate.merit import gain_and_lag, response
from fracgyro.rate.units import DEG_PER_S
from fracgyro.scenario.shipped import shipped
from machine import command, machine, write
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

DRAWING = Path(__file__).resolve().parents[1] / "docs" / "rate_response.svg"
SCENARIOS = ["paper_resonance", "dual_mass"]
RATE = DEG_PER_S.to_si(100.0)
CORNERS = [10.0, 30.0, 100.0, 300.0]  # Hz, of adaptation.rate_forgetting
SPREAD = np.geomspace(0.25, 4.0, 7)  # sine frequencies over the corner
SEEDS = range(4)
EVERY = 8  # steps between looks at the output; the Kalman filter takes in as many at a time
SETTLED = 0.02  # of the step
WITHIN = 1.5  # times the Kalman filter's noise: what the estimator is to keep
COLOURS = ["#E69F00", "#0072B2", "#009E73", "#CC79A7"]


def kalman(run: xr.Dataset, scenario: fg.Scenario, walk: float) -> Array:
    """The rate as the Kalman filter has it that knows D and K and takes Omega_z for a random walk of this intensity.

    Nondimensional; `walk` is variance per unit of time. From every step of the same run: the impulse of eq. (9) over a
    step that D, K and the force leave unexplained is 2 Omega_z J dq, plus noise of variance S h on each axis. EVERY
    steps are taken in at once: an element for each. The element at a time holds the information of the steps before it.
    """
    position, velocity, force = (run[name].values for name in ("position", "velocity", "control"))
    h = scenario.run.step
    damping, stiffness = (_matrix(entries) for entries in scenario.plant.nondimensional()[:2])
    moved = np.diff(position, axis=0)
    held = h / 2 * (position[1:] + position[:-1]) + h**2 / 12 * (velocity[:-1] - velocity[1:])
    # Hermite's rule lacks h^5/720 times the fourth derivative, which with K known is heard as a beat of the two axes.
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


def settings(scenario: fg.Scenario, corner: float) -> dict[str, object]:
    rate = 2 * math.pi * corner * scenario.plant.scales.time
    return {"adaptation.kind": "composite", "adaptation.forgetting": 0.0, "adaptation.rate_forgetting": rate}


def both(scenario: fg.Scenario, walk: float, changes: dict[str, object]) -> tuple[Array, Array, Array]:
    """Time in s; Omega_z in rad/s as least squares have it, and as the Kalman filter has it, in the same run.

    The filter knows of the scenario, and not of these changes to the run.
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
    """The answer to a step of the rate, from the step on: over it, at times in s."""

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
        """s, until within 2 % for good."""
        off = np.flatnonzero(abs(self.answer - 1.0) > SETTLED)
        return float(self.time[off[-1] + 1])


@dataclass(frozen=True)
class Answer:
    """Of one estimator, set to one corner: rad/s, Hz, rad."""

    noise: float
    bandwidth: float
    lag: float
    step: Step


def measure(scenario: fg.Scenario, corner: float) -> tuple[Answer, Answer]:
    """Of least squares and of the Kalman filter."""
    scales = scenario.plant.scales
    # The steady filter is of first order: corner sqrt(walk)/N, with N^2 = S/(4 mean |v|^2).
    speed = fg.simulate(scenario.replace({"run.duration": 2000.0}))["velocity"].values
    density = scenario.disturbance.density or 0.0
    walk = (2 * math.pi * corner * scales.time) ** 2 * density / (4 * float((speed**2).sum(axis=1).mean()))

    resting = [both(scenario, walk, {"disturbance.seed": seed})[1:] for seed in SEEDS]
    deviations = [noise(list(records)) for records in zip(*resting, strict=True)]

    # Answers do not depend on the noise, so that a millionth of it will do.
    moving: dict[str, object] = {"rate.amplitude": RATE, "disturbance.density": density * 1e-6}
    frequencies = corner * SPREAD
    gains: list[list[complex]] = []
    for frequency in frequencies.tolist():
        sine = {"rate.kind": "sine", "rate.frequency": 2 * math.pi * frequency}
        at, *answers = both(scenario, walk, {**moving, **sine})
        half = len(at) // 2
        gains.append([gain_and_lag(at[half:], answer[half:], RATE, frequency, 0.0) for answer in answers])

    h = scenario.run.step
    start = EVERY * h * round(10_000 / (EVERY * h))
    until = start + EVERY * h * round(10 / (2 * math.pi * corner * scales.time * EVERY * h))
    jump = {"rate.kind": "step", "rate.start": start * scales.time, "run.duration": until}
    at, *answers = both(scenario, walk, {**moving, **jump})
    after = at >= start * scales.time

    found = []
    for i, answer in enumerate(answers):
        wide = response(frequencies, np.array(gains)[:, i : i + 1].repeat(2, axis=1), 1.0)
        step = Step(at[after] - start * scales.time, answer[after] / RATE)
        found.append(Answer(deviations[i], wide.bandwidth.mean, wide.lag_at_bandwidth, step))
    return found[0], found[1]


def ratio(ours: Answer, best: Answer) -> float:
    """Noise over noise, each over the root of its bandwidth."""
    return ours.noise / math.sqrt(ours.bandwidth) / (best.noise / math.sqrt(best.bandwidth))


def row(name: str, corner: float, ours: Answer, best: Answer) -> str:
    cells = [name, f"{corner:g} Hz"]
    for answer in (ours, best):
        step = answer.step
        cells += [
            f"{answer.bandwidth:.1f} Hz",
            f"{math.degrees(answer.lag):.0f}°",
            f"{1e2 * step.overshoot:.1f} %",
            f"{1e3 * step.rise:.3g} ms",
            f"{1e3 * step.settling:.3g} ms",
            f"{1e3 * DEG_PER_S.of(answer.noise):.3g} mdeg/s",
        ]
    return f"| {' | '.join(cells)} | {ratio(ours, best):.2f} |"


def main() -> None:
    begin = time.perf_counter()
    columns = "bandwidth | lag there | overshoot | rise | settling | noise"
    lines = [
        "# The rate estimate: bandwidth and step against noise",
        "",
        f"Made by `{command()}`, which is part of `make bench`. Machine: {machine()}.",
        "",
        "Composite adaptation, adaptation.rate_forgetting from 2π · 10 Hz to 2π · 300 Hz. Noise: standard deviation "
        f"of Ω̂z about its mean at rest, steady half of {len(SEEDS)} runs. Bandwidth (−3 dB) and lag: from sines of "
        "100 deg/s. Rise from 10 to 90 %, settling to within 2 % for good: from a step of 100 deg/s. Beside it the "
        "Kalman filter that knows D, K and the noise and takes Ωz for a random walk, on the same runs, its walk "
        f"chosen for the corner, {EVERY} steps at a time. Noise grows as the root of the bandwidth: the last column is "
        "noise over noise, each over the root of its own bandwidth.",
        "",
        f"| scenario | set | {columns} | Kalman: {columns} | ratio |",
        "|---" * 15 + "|",
    ]
    measured: dict[str, list[tuple[Answer, Answer]]] = {}
    for name in SCENARIOS:
        base = shipped(name).replace({"plant.angular_rate": 0.0})
        for corner in CORNERS:
            # Long enough for 12 periods of the slowest sine in the steady half, as far as the exponentials reach.
            steps = min(24 / (corner * SPREAD[0]) / base.plant.scales.time / base.run.step, 900_000)
            steps = EVERY * round(max(steps, 80_000) / EVERY)
            scenario = base.replace({**settings(base, corner), "run.duration": steps * base.run.step})
            measured.setdefault(name, []).append(measure(scenario, corner))
            lines.append(row(name, corner, *measured[name][-1]))
            print(lines[-1], flush=True)
    draw(measured)
    ratios = [ratio(*pair) for pairs in measured.values() for pair in pairs]
    lines += ["", f"The ratio is {min(ratios):.2f} to {max(ratios):.2f}; {WITHIN:g} was to be kept."]
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("rate_response", lines)


def draw(measured: dict[str, list[tuple[Answer, Answer]]]) -> None:
    """Noise over bandwidth, of either scenario, and beside them the steps of the last one."""
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
        figure.savefig(DRAWING, metadata={"Date": None})


if __name__ == "__main__":
    main()
