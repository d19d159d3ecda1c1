"""The limit of tracking in the cells of the comparison and on the shipped devices.

Writes benchmarks/results/limit.md. Nothing is simulated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import fracgyro as fg
import xarray as xr
from machine import command, machine, write
from words import short

DEPENDS_ON = ["pid"]
CEILINGS = (0.0035, 0.05, math.inf)
NOISE = 1e-13  # m/sqrt(Hz)
DEVICES = ("dual_mass", "tuned_in_air", "disc", "paper_resonance", "paper_thermal")
FORCE_LIMIT = 1000.0  # that of the comparison
ROUNDING = 1e-14


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
        ],
    )


if __name__ == "__main__":
    main()
