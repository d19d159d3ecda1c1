"""Cost of an hour of a rate sensor's output, and its Allan deviation: N, B and K of one record.

Writes benchmarks/results/long_record.md and long_record.svg.
"""

from __future__ import annotations

import math
import resource
import time

import fracgyro as fg
import numpy as np
from fracgyro.analysis.style import own_style, save_svg
from fracgyro.rate.allan import Allan, Estimate, allan
from fracgyro.rate.bound import bound_angle_random_walk
from fracgyro.rate.units import DEG_PER_H, DEG_PER_ROOT_H
from fracgyro.scenario.named import exactly_sensed
from fracgyro.simulation.rate_means import rate_means
from machine import RESULTS, command, machine, write
from matplotlib.figure import Figure

DEPENDS_ON = ["sliding_mode", "composite", "joint"]

DRAWING = RESULTS / "long_record.svg"
RECORD = 1800.0  # s of device time, each
SEEDS = range(2)
OUTPUT = 0.01  # s
SETTLED = 1.0  # s, left out
FLICKER = DEG_PER_H.to_si(0.3)  # B
WALK = DEG_PER_H.to_si(2.7) / 60.0  # K: 2.7 deg/h/sqrt(h)


def sensor() -> fg.Scenario:
    """dual_mass at rest with composite adaptation, and error torques that act as a rate."""
    changes = {"plant.angular_rate": 0.0, "adaptation.initial_rate": 0.0}
    return exactly_sensed("dual_mass").replace(
        {**changes, "device.bias_instability": FLICKER, "device.rate_random_walk": WALK}
    )


def timed(scenario: fg.Scenario, span: float, seeds: range) -> tuple[np.ndarray, float, float, float]:
    """Outputs in rad/s, (seed, output); their interval in s; wall-clock and CPU time in s."""
    scales = scenario.plant.scales
    step = scenario.run.step * scales.time
    block = round(OUTPUT / step)
    long = scenario.replace({"run.duration": round(span / step) * scenario.run.step})
    begin, worked = time.perf_counter(), time.process_time()
    found = rate_means(long, seeds, every=1, block=block) * scales.rate
    return found, block * step, time.perf_counter() - begin, time.process_time() - worked


def peak() -> float:
    """Largest memory of the process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def costs() -> list[str]:
    """CPU time of an hour of device time, for each content of [device]; the minimum of five interleaved runs."""
    electronics = {
        "device.position_noise_density": 1e-13,
        "device.velocity_noise_density": 1e-13 * exactly_sensed("dual_mass").plant.reference_frequency,
    }
    corners = {"device.position_noise_corner": 100.0, "device.velocity_noise_corner": 100.0}
    of = {
        "ideal": exactly_sensed("dual_mass"),
        "white noise of both sensors": exactly_sensed("dual_mass").replace(electronics),
        "… and flicker noise": exactly_sensed("dual_mass").replace({**electronics, **corners}),
        "B and K of the rate": sensor(),
        "all of these": sensor().replace({**electronics, **corners}),
        "as shipped: positions with white noise, joint adaptation": fg.Scenario.shipped("dual_mass"),
    }
    span, best = 1.0, dict.fromkeys(of, math.inf)
    for _ in range(5):
        for name, scenario in of.items():
            best[name] = min(best[name], timed(scenario, span, range(1))[3])
    lines = ["| device | processor time a step (ns) | of an hour of device time (minutes) |", "|---" * 3 + "|"]
    step = exactly_sensed("dual_mass").run.step * exactly_sensed("dual_mass").plant.scales.time
    for name, took in best.items():
        lines.append(f"| {name} | {1e9 * took / span * step:.0f} | {3600 * took / span / 60:.1f} |")
    return lines


def read(name: str, unit: str, true: float, found: Estimate | None) -> str:
    if found is None:
        return f"| {name} | {unit} | {true:.3g} | – |"
    if found.limit:
        return f"| {name} | {unit} | {true:.3g} | at most {found.high:.3g} |"
    return f"| {name} | {unit} | {true:.3g} | {found.value:.3g} ({found.low:.3g} to {found.high:.3g}) |"


def scaled(found: Estimate | None, by: float) -> Estimate | None:
    return found and Estimate(by * found.value, by * found.low, by * found.high, found.limit)


def model(tau: np.ndarray, walk: float) -> np.ndarray:
    """The Allan deviation of N, B and K, rad/s."""
    return np.sqrt(walk**2 / tau + (0.664 * FLICKER) ** 2 + WALK**2 * tau / 3)


def draw(found: Allan, walk: float) -> None:
    tau = np.geomspace(found.tau[0], found.tau[-1], 100)
    with own_style():
        figure = Figure(figsize=(110 / 25.4, 75 / 25.4), layout="constrained")
        axes = figure.subplots()
        deviation, low, high = (DEG_PER_H.per_si * each for each in (found.deviation, found.low, found.high))
        axes.errorbar(
            found.tau, deviation, (deviation - low, high - deviation), fmt="o", markersize=3, color="#0072B2",
            label="dual_mass, composite",
        )  # fmt: skip
        for label, one in (
            ("N", walk / np.sqrt(tau)),
            ("0.664 B", np.full_like(tau, 0.664 * FLICKER)),
            ("K", WALK * np.sqrt(tau / 3)),
        ):
            axes.loglog(tau, DEG_PER_H.per_si * one, color="black", linewidth=0.7, dashes=(4, 2))
            # Inside the frame, and off the points.
            place = 0 if label == "K" else -1
            axes.annotate(
                label,
                (tau[place], DEG_PER_H.per_si * one[place]),
                (6 if place == 0 else -6, 4),
                textcoords="offset points",
                ha="left" if place == 0 else "right",
                fontsize=7,
            )
        axes.loglog(tau, DEG_PER_H.per_si * model(tau, walk), color="black", linewidth=0.8, label="N, B and K together")
        axes.set_xlabel("averaging time (s)")
        axes.set_ylabel("Allan deviation (deg/h)")
        axes.grid(True, linewidth=0.3)
        axes.legend()
        save_svg(figure, DRAWING, "Allan deviation of a long record")


def main() -> None:
    scenario = sensor()
    timed(scenario, OUTPUT * 10, SEEDS)
    before = peak()
    found, interval, took, _ = timed(scenario, SETTLED + RECORD, SEEDS)
    grown = peak() - before
    bound = bound_angle_random_walk(scenario)
    assert bound is not None
    kept = found[:, round(SETTLED / interval) :]
    steps = len(SEEDS) * (SETTLED + RECORD) / (scenario.run.step * scenario.plant.scales.time)
    result = allan(kept, interval)
    walk = bound.known
    per_h = DEG_PER_H.per_si
    lines = [
        "# A long record of a rate sensor",
        "",
        f"Made by `{command()}`. Machine: {machine()}.",
        "",
        f"dual_mass at rest, composite adaptation, thermal noise. B = {FLICKER * per_h:.3g} deg/h and K = "
        f"{WALK * per_h * 60:.3g} deg/h/√h act as a rate. {len(SEEDS)} records of {RECORD / 60:.0f} minutes of device "
        f"time at {OUTPUT * 1e3:.0f} ms, {steps:.3g} steps together: {took / 60:.1f} minutes on two threads, with "
        f"whatever else ran. The process grew by {grown:.1f} MB meanwhile, of which the outputs are "
        f"{found.nbytes / 1e6:.1f} MB.",
        "",
        "| term | unit | in the scenario | found in the Allan deviation |",
        "|---" * 4 + "|",
        read(
            "N (the bound)", "deg/√h", DEG_PER_ROOT_H.of(walk), scaled(result.angle_random_walk, DEG_PER_ROOT_H.per_si)
        ),
        read("B", "deg/h", FLICKER * per_h, scaled(result.bias_instability, per_h)),
        read("K", "deg/h/√h", WALK * per_h * 60, scaled(result.rate_random_walk, per_h * 60)),
        "",
        "![Allan deviation](long_record.svg)",
        "",
        "Up to some tens of milliseconds the deviation is that of a sensor of 100 Hz, below its white noise.",
        "",
        "| averaging time (s) | Allan deviation (deg/h) | 95 % interval | of N, B and K | measured over it |",
        "|---" * 5 + "|",
    ]
    expected = model(result.tau, walk)
    for tau, deviation, low, high, one in zip(
        result.tau, result.deviation, result.low, result.high, expected, strict=True
    ):
        lines.append(
            f"| {tau:.3g} | {per_h * deviation:.3g} | {per_h * low:.3g} to {per_h * high:.3g} | {per_h * one:.3g} | "
            f"{deviation / one:.2f} |"
        )
    lines += ["", "## Cost", "", *costs()]
    draw(result, walk)
    write("long_record", lines)


if __name__ == "__main__":
    main()
