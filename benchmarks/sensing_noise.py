"""The rate estimate with real electronics: sensing noise, converters, delay, drift; its error over the bound.

Writes benchmarks/results/sensing_noise.md.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from itertools import count
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.rate.bound import bound_angle_random_walk
from fracgyro.rate.results import short
from fracgyro.rate.units import DEG_PER_H, DEG_PER_ROOT_H, DEG_PER_S, PPM
from machine import command, machine, write
from scipy import stats

DEPENDS_ON = ["sliding_mode", "joint"]

SEEDS = 64
MANY = 500  # seeds of rows with a mark on the ratio: their interval is -6 to +6.5 %
STARTS = count(0, MANY)  # first seed of each row: no two rows share one
TIME = 0.2  # s, duration of a run
DEVICES = ["paper_resonance", "dual_mass", "tuned_in_air", "disc"]
NOISES = [0.0, 1e-14, 1e-13, 1e-12]  # m/sqrt(Hz), one-sided, position; velocity noise is omega0 times that
COMMODITY = 1e-13
FAST = DEG_PER_S.to_si(300.0)


@dataclass(frozen=True)
class Ends:
    """Errors of the estimate at the end of each run, and the deviations that it states, rad/s."""

    scenario: fg.Scenario
    error: np.ndarray
    stated: np.ndarray
    time: float

    @property
    def mean(self) -> float:
        return float(self.error.mean())

    @property
    def rms(self) -> float:
        return float(np.sqrt((self.error**2).mean()))

    @property
    def half_width(self) -> float:
        """Half width of the 95 % interval of the mean."""
        spread = self.error.std(ddof=1) / math.sqrt(len(self.error))
        return float(stats.t.ppf(0.975, len(self.error) - 1) * spread)

    def walk(self) -> tuple[float, float, float]:
        """Angle random walk, rad/sqrt(s), with its 95 % interval: spread of the errors times the root of the time."""
        value = float(self.error.std(ddof=1)) * math.sqrt(self.time)
        freedom = len(self.error) - 1
        low, high = (math.sqrt(freedom / stats.chi2.ppf(p, freedom)) for p in (0.975, 0.025))
        return value, value * low, value * high


def device(name: str, density: float, *, velocity: bool = False, **changes: Any) -> fg.Scenario:
    """A shipped device with this sensing noise and the joint filter, with an initial rate estimate of 0."""
    scenario = fg.Scenario.shipped(name)
    noise: dict[str, object] = {
        "device.sensing": "full" if velocity else "position",
        "device.position_noise_density": density,
    }
    if velocity:
        noise["device.velocity_noise_density"] = density * scenario.plant.reference_frequency
    joint = {
        "adaptation.kind": "joint",
        "adaptation.rate_forgetting": 0.0,
        "adaptation.initial_rate": 0.0,
        "plant.angular_rate": 0.0,
    }
    return scenario.replace({**joint, **noise, **{key.replace("__", "."): value for key, value in changes.items()}})


def ends(scenario: fg.Scenario, span: float = TIME, limit: str = "") -> Ends:
    seeds = min(options.seeds, MANY if limit.startswith("ratio") else SEEDS)
    first = next(STARTS)
    scales, step = scenario.plant.scales, scenario.run.step
    steps = round(span / scales.time / step)
    whole = scenario.replace({"run.duration": steps * step, "run.record_every": steps, "run.units": "SI"})
    run = fg.simulate_many([whole], seeds=range(first, first + seeds))
    estimate, stated = (run[name].values[:, -1] for name in ("rate_estimate", "rate_deviation"))
    return Ends(scenario, estimate - scenario.plant.angular_rate, stated, steps * step * scales.time)


def row(words: list[str], found: Ends, limit: str = "", bound: float | None = None) -> str:
    if bound is None:
        least = bound_angle_random_walk(
            found.scenario.replace({"run.duration": min(found.scenario.run.duration, 2000)})
        )
        bound = math.nan if least is None else least.unknown
    value, low, high = found.walk()
    rate = found.scenario.plant.angular_rate
    mean = f"{DEG_PER_H.of(found.mean):+.2g} ± {DEG_PER_H.of(found.half_width):.2g}"
    scale = f"{PPM.of(found.mean / rate):+.2g} ± {PPM.of(found.half_width / abs(rate)):.2g}" if rate else "–"
    if limit.startswith("ratio"):
        most = float(limit.split()[-1])
        limit += ": met" if high <= most * bound else ": missed" if low > most * bound else ": open"
    cells = [
        *words,
        str(len(found.error)),
        short(DEG_PER_ROOT_H.of(value)),
        short(DEG_PER_ROOT_H.of(bound)),
        f"**{value / bound:.2f}** ({low / bound:.2f} to {high / bound:.2f})",
        f"{float(np.sqrt((found.stated**2).mean()) / found.error.std(ddof=1)):.2f}",
        mean,
        short(DEG_PER_H.of(found.rms)),
        scale,
        limit,
    ]
    line = f"| {' | '.join(cells)} |"
    print(line, flush=True)
    return line


HEAD = [
    "seeds",
    "angle random walk (deg/√h)",
    "the bound",
    "ratio (95 %)",
    "stated over seen",
    "mean error (deg/h)",
    "RMS error (deg/h)",
    "of 300 deg/s (ppm)",
    "mark",
]


def heads(*words: str) -> list[str]:
    names = [*words, *HEAD]
    return [f"| {' | '.join(names)} |", "|---" * len(names) + "|"]


def devices() -> list[str]:
    lines = heads("device", "noise (m/√Hz)", "sensed")
    for name in DEVICES:
        for velocity in (False, True):
            for density in NOISES:
                sensed = "q and v" if velocity else "q"
                limit = "ratio ≤ 1.25"
                found = ends(device(name, density, velocity=velocity), limit=limit)
                lines.append(row([name, short(density), sensed], found, limit))
    return lines


def electronics() -> list[str]:
    """One thing at a time on the dual mass."""
    name = "dual_mass"
    plant = fg.Scenario.shipped(name).plant
    reach = 1.25 * plant.reference_length
    quadrature = 2 * plant.mass * plant.reference_frequency * FAST
    turning: dict[str, Any] = {"plant__angular_rate": FAST}
    late: dict[str, Any] = {"device__delay": 1}
    pulled: dict[str, Any] = {"plant__stiffness_deviation": {"xx": 0.0, "xy": quadrature, "yy": 0.0}}
    hidden: dict[str, Any] = {**late, "datasheet__delay": 0}
    rest: dict[str, Any] = {"run__initial_position": (0.0, 0.0), "run__initial_velocity": (0.0, 0.0)}
    cases: list[tuple[str, fg.Scenario, float, str]] = [
        ("300 deg/s", device(name, COMMODITY, **turning), TIME, "< 3 ppm"),
        ("… from rest, through the drive", device(name, COMMODITY, **turning, **rest), TIME, ""),
        ("… K guessed 5 % low", device(name, COMMODITY, **turning, adaptation__initial_ratio=0.95), 0.3, "< 10 ppm"),
        ("… K guessed 5 % high", device(name, COMMODITY, **turning, adaptation__initial_ratio=1.05), 0.3, "< 10 ppm"),
        (
            "force a step late, declared, 300 deg/s of quadrature",
            device(name, COMMODITY, **turning, **late, **pulled),
            TIME,
            "< 3 ppm",
        ),
        ("… hidden, at rest", device(name, COMMODITY, **hidden), TIME, "none"),
        ("… hidden, 300 deg/s", device(name, COMMODITY, **turning, **hidden), TIME, "none"),
        ("… hidden, at rest, 300 deg/s of quadrature", device(name, COMMODITY, **hidden, **pulled), TIME, "none"),
    ]
    for bits in (16, 14, 12):
        converter: dict[str, Any] = {"device__position_range": reach, "device__position_bits": bits}
        limit = "ratio ≤ 1.5" if bits == 16 else "none"
        cases.append(
            (f"{bits} bit of ±1.25 amplitudes, 300 deg/s", device(name, 0.0, **turning, **converter), TIME, limit)
        )
    for factor in (0.01, 0.25, 4.0, 100.0):
        d = fg.Scenario.shipped(name)
        force = math.sqrt(factor * (d.disturbance.density or 0.0) / d.run.step)
        cases.append(
            (
                f"datasheet: S times {factor:g}",
                device(name, COMMODITY, **turning, datasheet__force_noise=force),
                TIME,
                "none",
            )
        )
    for steps in (2, 4, 8):
        cases.append(
            (
                f"P once in {steps} steps",
                device(name, COMMODITY, **turning, adaptation__covariance_steps=steps),
                TIME,
                "ratio ≤ 1.25",
            )
        )
    lines = heads("dual mass, positions, 10⁻¹³ m/√Hz unless said")
    for words, scenario, span, limit in cases:
        lines.append(row([words], ends(scenario, span, limit), limit))
    return lines


def hidden() -> list[str]:
    """An unstated delay of the force by one step, on each device, without and with quadrature."""
    lines = heads("device", "hidden delay of one step")
    for name in DEVICES:
        plant = fg.Scenario.shipped(name).plant
        coupling = 2 * plant.mass * math.sqrt(plant.stiffness.xx / plant.mass) * DEG_PER_S.to_si(250.0)
        late: dict[str, Any] = {"device__delay": 1, "datasheet__delay": 0}
        pulled: dict[str, Any] = {"plant__stiffness_deviation": {"xx": 0.0, "xy": coupling, "yy": 0.0}}
        for words, changes in (("at rest", late), ("at rest, 250 deg/s of quadrature", late | pulled)):
            found = ends(device(name, COMMODITY, **changes))
            lines.append(row([name, words], found, "none"))
    return lines


def drift() -> list[str]:
    """The second half of runs with falling stiffness."""
    lines = [
        "| D, K forgotten at (Hz) | mean error (deg/h) | RMS error (deg/h) | noise without drift, over that at 0 |",
        "|---" * 4 + "|",
    ]
    d = fg.Scenario.shipped("dual_mass")
    time_unit = d.plant.scales.time
    span = d.run.duration * time_unit
    falling = {"device__stiffness_drift": -30.0, "device__temperature_ramp": 10.0 / span}
    quiet = None
    for bandwidth in (0.0, 10.0, 30.0, 100.0, 300.0):
        tracked: dict[str, Any] = {
            "adaptation__forgetting": 2 * math.pi * bandwidth * time_unit,
            "adaptation__rate_forgetting": 2 * math.pi * 100.0 * time_unit,
            "run__record_every": 16,
            "run__units": "SI",
        }
        late, first = [], next(STARTS)
        for changes in (falling, {}):
            run = fg.simulate_many(
                [device("dual_mass", COMMODITY, **tracked, **changes)], seeds=range(first, first + 8)
            )
            rate = run["rate_estimate"].values
            late.append(rate[:, rate.shape[1] // 2 :])
        means = late[0].mean(axis=1)
        width = stats.t.ppf(0.975, 7) * means.std(ddof=1) / math.sqrt(8)
        noise = float(late[1].std())
        quiet = noise if quiet is None else quiet
        mean = f"{DEG_PER_H.of(means.mean()):+.3g} ± {DEG_PER_H.of(width):.2g}"
        rms = DEG_PER_H.of(float(np.sqrt((late[0] ** 2).mean())))
        lines.append(f"| {bandwidth:g} | {mean} | {short(rms)} | {noise / quiet:.2f} |")
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    begin = time.perf_counter()
    lines = [
        "# The rate estimate with real electronics",
        "",
        f"Made by `{command()}`, which is part of `make bench`. Machine: {machine()}.",
        "",
        f'`adaptation.kind = "joint"`, runs of {TIME:g} s, at rest unless said, Ω̂z taken for constant and its',
        "first guess 0. No two rows share a seed. The angle random walk is the spread of the estimates at the end "
        "times the root of the time; "
        "the bound is that of Cramér and Rao with D and K unknown and with this sensing noise. Stated over seen: the",
        "deviation that the filter reports over the spread. The mean error has a 95 % interval; a mark on the ratio is",
        "met if its whole interval is within, missed if none of it is, else open.",
        "",
        "## Shipped devices",
        "",
        *devices(),
        "",
        "## Delay, converters, wrong guesses, divided work",
        "",
        *electronics(),
        "",
        "Of converters the bound is that with white noise of LSB²/12. It is not white, and the ratio is below 1.",
        "",
        "## Hidden delay on each device",
        "",
        *hidden(),
        "",
        "## Stiffness falling by 300 ppm in 0.81 s",
        "",
        "Second half of the run, 8 seeds, Ω̂z forgotten at 100 Hz; the mark is 100 deg/h with K tracked.",
        "",
        *drift(),
        "",
        "What D and K forget costs Ω̂z some of its bandwidth, and so some of its noise.",
    ]
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("sensing_noise", lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=MANY, help="at most, of a row")
    options = parser.parse_args()
    main()
