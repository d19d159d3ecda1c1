"""Exported hardware with a fixed point: the size of its numbers, and the cost of rounding by word length.

Writes benchmarks/results/fpga_fixed.md.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.export.compilers import run
from fracgyro.export.host import rmse
from fracgyro.export.targets import answer_columns, answers
from fracgyro_fpga.arithmetic import FRACTION, MOST
from fracgyro_fpga.graph import SOURCES_OF_NUMBERS, Graph, compiled_for, numbers_of, trace
from fracgyro_fpga.interpreter import Interpreter

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from machine import command, machine, write

from fpga import CHECKED, EIGHT, SCENARIO, SIXTEEN, motion_of

RANGED, STEPS = 5_000, 100_000
SETTLED = 2.0  # units of time
FRACTIONS = (20, 24, FRACTION, 32, 36)
SCENARIOS: dict[str, dict[str, Any]] = {
    "paper": {},
    "8 exponentials": EIGHT,
    "8 exponentials, samples checked, all limits": EIGHT | CHECKED,
    "16 exponentials": SIXTEEN,
    "PID": {"controller.kind": "pid"},
}


def lasting(scenario: fg.Scenario, steps: int) -> fg.Scenario:
    return scenario.replace({"run.duration": steps * scenario.run.step})


def ranges(graph: Graph, scenario: fg.Scenario) -> tuple[dict[int, int], Counter[str]]:
    """By bits left of the point, the sign among them: operations that need them; and those that end at the ends."""
    most: dict[int, int] = {}
    interpreter = Interpreter(graph)
    for sample in motion_of(lasting(scenario, RANGED), faults=False):
        interpreter.step(sample)
        for node, value in interpreter.values.items():
            most[node] = max(most.get(node, 0), abs(value))
    computed = [place for place in most if graph.nodes[place].op not in SOURCES_OF_NUMBERS]
    bits = Counter(max(0, most[place].bit_length() - FRACTION) + 1 for place in computed)
    return bits, Counter(graph.nodes[place].op.replace("_", " ") for place in computed if most[place] == MOST)


class Loop:
    """The traced controller where closed_loop() has firmware."""

    def __init__(self, graph: Graph) -> None:
        self.interpreter, self.arithmetic = Interpreter(graph), graph.arithmetic
        self.force = (0.0, 0.0)

    def step(self, position: Sequence[float], velocity: Sequence[float]) -> int:
        force, _ = self.interpreter.step((*position, *velocity))
        x, y = self.arithmetic.numbers(np.array(force)).tolist()
        self.force = (x, y)
        return self.interpreter.status


def tracking(scenario: fg.Scenario, graph: Graph) -> str:
    """RMS error of x and y in a closed loop, after the start."""
    return ", ".join(f"{one:.4g}" for one in rmse(scenario, Loop(graph), SETTLED))


def errors(scenario: fg.Scenario) -> list[str]:
    """Rows: of the force and the reported rate against double, over a recorded run."""
    motion = motion_of(scenario, faults=False).astype(np.float64)
    expected = answers("python", scenario, "double", motion)
    found = {"float": answers("python", scenario, "float", motion).astype(np.float64)}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for fraction in FRACTIONS:
            program = compiled_for(scenario, "desk", folder, "-O2", f"-DFRACGYRO_FRACTION={fraction}")
            np.rint(motion * 2.0**fraction).astype("<i8").tofile(folder / "motion")
            run([str(program), *numbers_of(scenario)], folder)
            rows = np.fromfile(folder / "answer", "<i8").reshape(len(motion), -1)
            found[f"20 + {fraction} bits"] = rows[:, 1 : 1 + expected.shape[1]] * 2.0**-fraction
    of_rate = [place for place, name in enumerate(answer_columns(scenario)) if name == "rate_estimate"]
    lines = []
    for name, values in found.items():
        cells = [name]
        for places in ([0, 1], of_rate):
            error = values[:, places] - expected[:, places]
            cells += [f"{np.sqrt(np.mean(error**2)):.2g}", f"{np.max(np.abs(error)):.2g}"] if places else ["", ""]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def main() -> None:
    ranged, closed = [], []
    for name, changes in SCENARIOS.items():
        scenario = SCENARIO.replace(changes)
        graph = trace(scenario, "fixed")
        bits, ends = ranges(graph, scenario)
        least = ", ".join(f"{count} of {size}" for size, count in sorted(bits.items(), reverse=True)[:3])
        ended = ", ".join(f"{op}: {count}" for op, count in sorted(ends.items())) or "none"
        ranged.append(f"| {name} | {bits.total()} | {sum(bits[k] for k in bits if k <= 12)} | {least} | {ended} |")
        short = lasting(scenario, RANGED)
        double = fg.metrics.rmse(fg.simulate(short), (SETTLED, None)).values
        cells = [", ".join(f"{one:.4g}" for one in double), tracking(short, trace(short)), tracking(short, graph)]
        closed.append(f"| {name} | {' | '.join(cells)} |")
        print(ranged[-1], closed[-1], sep="\n", file=sys.stderr, flush=True)
    lines = [
        "# Exported hardware with a fixed point",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine()}.",
        "",
        "## How large numbers become",
        "",
        f"Over the first {RANGED:,} steps of the paper's run: operations by the bits that they need left of the point,",
        "the sign among them. What needs more than 20 ends at the ends of the range.",
        "",
        "| controller | operations | of at most 12 bits | those that need most | at an end |",
        "|---|---|---|---|---|",
        *ranged,
        "",
        "## What rounding costs",
        "",
        f"Answers to {STEPS + 1:,} recorded samples of the paper's run, less those in double; coefficients are rounded",
        "too. Nondimensional; the force is some 500, the rate 0.1.",
        "",
        "| numbers | force: RMS error | largest | rate estimate: RMS error | largest |",
        "|---|---|---|---|---|",
        *errors(lasting(SCENARIO, STEPS)),
        "",
        "## In a closed loop",
        "",
        f"RMS tracking error of x, y in {RANGED:,} steps, without the first {SETTLED:g} units of time. The plant is in",
        "double.",
        "",
        "| controller | double | float | fixed |",
        "|---|---|---|---|",
        *closed,
    ]
    write("fpga_fixed", lines)


if __name__ == "__main__":
    main()
