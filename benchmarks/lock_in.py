"""The rate of `lock_in` on the shipped devices: its error over the bound, and how far its stated deviation is right.

Writes benchmarks/results/lock_in.md.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.rate.bound import bound_angle_random_walk
from fracgyro.rate.results import short
from fracgyro.rate.units import DEG_PER_H, DEG_PER_ROOT_H, DEG_PER_S
from machine import command, machine, write
from scipy import stats

DEPENDS_ON = ["lock_in"]

DEVICES = ["paper_resonance", "dual_mass", "tuned_in_air", "disc"]
TIME = 0.2  # s
SEEDS = 500
FAST = DEG_PER_S.to_si(300.0)


def device(name: str, **changes: Any) -> fg.Scenario:
    """A shipped device whose rate is taken for constant, with a first guess of 0."""
    return fg.Scenario.shipped(name).replace(
        {
            "controller.kind": "lock_in",
            "adaptation.rate_forgetting": 0.0,
            "adaptation.initial_rate": 0.0,
            "plant.angular_rate": 0.0,
            **{key.replace("__", "."): value for key, value in changes.items()},
        }
    )


def row(words: str, scenario: fg.Scenario, seeds: int) -> str:
    scales, step = scenario.plant.scales, scenario.run.step
    steps = round(TIME / scales.time / step)
    whole = scenario.replace({"run.duration": steps * step, "run.record_every": steps, "run.units": "SI"})
    run = fg.simulate_many([whole], seeds=range(seeds))
    error = run["rate_estimate"].values[:, -1] - scenario.plant.angular_rate
    stated = run["rate_deviation"].values[:, -1]
    bound = bound_angle_random_walk(scenario.replace({"run.duration": 2000 * step}))
    assert bound is not None
    walk, freedom = float(error.std(ddof=1)) * math.sqrt(TIME), seeds - 1
    low, high = (walk / bound.unknown * math.sqrt(freedom / stats.chi2.ppf(p, freedom)) for p in (0.975, 0.025))
    mean = stats.t.ppf(0.975, freedom) * error.std(ddof=1) / math.sqrt(seeds)
    cells = [
        words,
        str(seeds),
        short(DEG_PER_ROOT_H.of(walk)),
        short(DEG_PER_ROOT_H.of(bound.unknown)),
        f"**{walk / bound.unknown:.2f}** ({low:.2f} to {high:.2f})",
        f"{float(np.sqrt((stated**2).mean()) / error.std(ddof=1)):.2f}",
        f"{100 * float((np.abs(error) < 4 * stated).mean()):.1f} %",
        f"{DEG_PER_H.of(error.mean()):+.2g} ± {DEG_PER_H.of(mean):.2g}",
        f"{100 * float(run['rate_trusted'].values[:, -1].mean()):.0f} %",
    ]
    line = f"| {' | '.join(cells)} |"
    print(line, flush=True)
    return line


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    seeds = parser.parse_args().seeds
    rest: dict[str, Any] = {"run__initial_position": (0.0, 0.0), "run__initial_velocity": (0.0, 0.0)}
    turning: dict[str, Any] = {"plant__angular_rate": FAST}
    cases = [(f"{name}, at rest", device(name)) for name in DEVICES]
    cases += [
        (f"dual_mass, 300 deg/s{words}", device("dual_mass", **turning, **changes))
        for words, changes in (
            ("", {}),
            (", from rest, through the drive", rest),
            (", force two steps late, declared", {"device__delay": 2}),
            (", K guessed 5 % low", {"adaptation__initial_ratio": 0.95}),
            (", K guessed 5 % high", {"adaptation__initial_ratio": 1.05}),
        )
    ]
    heads = ["device", "seeds", "angle random walk (deg/√h)", "the bound", "ratio (95 %)", "stated over seen"]
    heads += ["within 4 stated deviations", "mean error (deg/h)", "trusted"]
    lines = ["# The rate of lock_in", "", f"Made by `{command()}`. Machine: {machine()}.", ""]
    lines += [
        f"Runs of {TIME:g} s with the shipped noise, 10⁻¹³ m/√Hz, Ω̂z taken for constant, its first guess 0. The angle",
        "random walk is the spread of the estimates at the end times the root of the time; the bound is that of Cramér",
        "and Rao with D and K unknown.",
        "",
        f"| {' | '.join(heads)} |",
        "|---" * len(heads) + "|",
        *(row(words, scenario, seeds) for words, scenario in cases),
    ]
    write("lock_in", lines)


if __name__ == "__main__":
    main()
