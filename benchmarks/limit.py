"""The limit of tracking in the cells of the comparison and on the shipped devices, and the two laws nearest to it.

Writes benchmarks/results/limit.md. Simulated are only the laws.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import fracgyro as fg
import numpy as np
import xarray as xr
from machine import command, machine, write
from words import short

DEPENDS_ON = ["pid"]
CEILINGS = (0.0035, 0.05, math.inf)
NOISE = 1e-13  # m/sqrt(Hz)
DEVICES = ("dual_mass", "tuned_in_air", "disc", "paper_resonance", "paper_thermal")
FORCE_LIMIT = 1000.0  # that of the comparison
ROUNDING = 1e-14
LAWS, MARGINS = ("internal_model", "lqg"), (1.0, 0.0)
SEEDS, STEADY = range(8), (10.0, None)
SLOWEST, FASTEST, TRIALS = 0.1, 2.5, 8
NEAR = ("sensing", "noise (m/√Hz)", "ceiling", "law", "margin", "bandwidth", "chattering", "error x, y", "over limit")
NEAR += ("start over limit", "with a hidden step")
LATE = {"device.delay": 1, "datasheet.delay": 0}


@dataclass(frozen=True)
class Cell:
    name: str
    sensing: str  # F: positions and velocities; P: positions
    noise: str  # m/sqrt(Hz)
    scenario: fg.Scenario


def sensed(scenario: fg.Scenario, sensing: str, noise: float) -> fg.Scenario:
    """Noise of the same nondimensional density on all measurements."""
    full = sensing == "F"
    return scenario.replace(
        {
            "device.sensing": "full" if full else "position",
            "device.position_noise_density": noise,
            "device.velocity_noise_density": noise * scenario.plant.reference_frequency if full else 0.0,
        }
    )


def cells() -> list[Cell]:
    paper = fg.Scenario.paper().replace({"controller.force_limit": FORCE_LIMIT})
    found = [
        Cell("paper", sensing, f"{noise:g}", sensed(paper, sensing, noise))
        for noise in (NOISE, 0.0)
        for sensing in ("F", "P")
    ]
    for name in DEVICES:
        scenario = fg.Scenario.shipped(name)
        sensing = "F" if scenario.device.sensing == "full" else "P"
        found.append(Cell(name, sensing, f"{scenario.device.position_noise_density:g}", scenario))
    return found


def pair(found: xr.Dataset, name: str) -> str:
    return ", ".join(short(value if value > ROUNDING else 0.0, 3) for value in found[name].values.tolist())


def steady(scenario: fg.Scenario, ceiling: float) -> str:
    try:
        return pair(fg.limit.tracking(scenario, ceiling), "rmse_steady")
    except ValueError:  # below the chattering of the force along the reference
        return "–"


@dataclass(frozen=True)
class Measured:
    steady: np.ndarray  # RMS errors of x and y
    transient: np.ndarray
    chattering: float  # the larger of both axes


def measured(scenario: fg.Scenario) -> Measured:
    run = fg.simulate_many([scenario], seeds=SEEDS)
    square = (run["position"] - run["reference"]) ** 2

    def rms(start: float, end: float | None) -> np.ndarray:
        return np.sqrt(square.sel(time=slice(start, end)).mean(("time", "run")).values)

    return Measured(rms(*STEADY), rms(0.0, STEADY[0]), float(fg.metrics.chattering(run).mean("run").max()))


def fastest(scenario: fg.Scenario, ceiling: float) -> tuple[float, Measured]:
    """The largest bandwidth whose chattering is at most the ceiling, and the run with it."""
    low, high = SLOWEST, FASTEST
    found = measured(scenario.replace({"controller.loop_bandwidth": high}))
    if found.chattering <= ceiling:
        return high, found
    for _ in range(TRIALS):
        middle = math.sqrt(low * high)
        trial = measured(scenario.replace({"controller.loop_bandwidth": middle}))
        if trial.chattering <= ceiling:
            low, found = middle, trial
        else:
            high = middle
    return low, found


def near() -> Iterator[str]:
    """Rows of the table of the laws."""
    for cell in cells():
        if cell.name != "paper":
            continue
        for ceiling in CEILINGS[:2]:
            limit = fg.limit.tracking(cell.scenario, ceiling)
            for law in LAWS:
                for margin in MARGINS:
                    chosen = {"controller.kind": law, "controller.delay_margin": margin, "run.duration": 20.0}
                    scenario = cell.scenario.replace(chosen)
                    bandwidth, known = fastest(scenario, ceiling)
                    hidden = measured(scenario.replace({"controller.loop_bandwidth": bandwidth, **LATE}))
                    late = hidden.steady / known.steady
                    values = [
                        cell.sensing,
                        cell.noise,
                        f"{ceiling:g}",
                        law,
                        f"{margin:g}",
                        f"{bandwidth:.2f}",
                        short(known.chattering),
                        ", ".join(short(v, 3) for v in known.steady.tolist()),
                        ", ".join(f"{v:.2f}" for v in (known.steady / limit["rmse_steady"].values).tolist()),
                        ", ".join(f"{v:.2f}" for v in (known.transient / limit["rmse_transient"].values).tolist()),
                        ", ".join(f"{v:.2f}" if v < 100.0 else "lost" for v in late.tolist()),
                    ]
                    yield f"| {' | '.join(values)} |"


def main() -> None:
    heads = ["scenario", "sensing", "noise (m/√Hz)", "chattering ≤ 0.0035", "≤ 0.05", "no ceiling"]
    heads += ["best estimate", "t < 10"]
    rows = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for cell in cells():
        found = fg.limit.tracking(cell.scenario)
        values = [steady(cell.scenario, ceiling) for ceiling in CEILINGS]
        values += [pair(found, name) for name in ("filter_error", "rmse_transient")]
        rows.append(f"| {' | '.join([cell.name, cell.sensing, cell.noise, *values])} |")
    write(
        "limit",
        [
            "# The limit of tracking",
            "",
            f"Computed by `{command()}`. Machine: {machine('scipy')}.",
            "",
            "RMS errors of x and y in q0 that no controller can be below: in steady state with chattering of at most "
            "the ceiling on either axis, of the best estimate of the position, and before t = 10 from the scenario's "
            "start within its force limit. A dash: the force along the reference has more chattering. F: positions "
            "and velocities are measured; P: positions only. "
            f"`paper` has a force limit of {FORCE_LIMIT:g}, devices are as shipped. "
            "[What it is](../../docs/limit.md).",
            "",
            *rows,
            "",
            "## The laws nearest to it",
            "",
            f"`paper`, {len(SEEDS)} seeds, 20 units of time, nominal plant 5 % off: the largest `loop_bandwidth` up to "
            f"{FASTEST:g} within the ceiling; RMS errors of x and y after t = 10, over the limit with that ceiling, "
            "and before t = 10 over that limit; and the factor on the steady error if the force comes a step later "
            "than `datasheet.delay` states.",
            "",
            f"| {' | '.join(NEAR)} |",
            "|---" * len(NEAR) + "|",
            *near(),
        ],
    )


if __name__ == "__main__":
    main()
