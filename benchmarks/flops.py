"""Floating-point operations of a step of each controller, and its state; writes benchmarks/results/flops.md."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import fracgyro as fg
from fracgyro.export.compilers import SOURCES, include, system_compiler
from machine import command, write

MEASURES_CODE = True
HERE = Path(__file__).parent
ADAPTATIONS = ["gradient", "composite", "joint"]
SENSING = {"full": "positions and velocities", "position": "positions only"}
SENSING |= {f"{name}_filtered": f"{words}, filter" for name, words in SENSING.items()}
SLIDING = ["fractional_fast_terminal", "fractional", "fast_terminal", "linear"]
Cells = list[str]


def counted() -> list[list[str]]:
    """Words of each line that flops.cpp prints: kind, adaptation, sensing, and the operations of a step."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "flops"
        system_compiler("-std=c++20", "-O1", *include(SOURCES / "include"), HERE / "flops.cpp", "-o", program)
        ran = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    return [line.split() for line in ran.stdout.splitlines()]


def state_bytes(kind: str, adaptation: str, sensing: str) -> int:
    measured, _, filtered = sensing.partition("_")
    changes: dict[str, object] = {"controller.kind": kind, "device.sensing": measured}
    if filtered:
        changes |= {"controller.filter": "kalman", "device.position_noise_density": 1e-13}
    if kind in SLIDING:
        changes["adaptation.kind"] = adaptation
    return len(fg.Controller(fg.Scenario.paper().replace(changes))._core.state)


def row(kind: str, place: str, sensing: str, *operations: str) -> Cells:
    adaptation = ADAPTATIONS[int(place)] if kind in SLIDING else ""
    numbers = [float(number) for number in operations]
    words = [f"`{kind}`", adaptation or "–", SENSING[sensing], *(f"{number:.0f}" for number in numbers)]
    flops = sum(numbers[:3]) + numbers[4] + numbers[5]
    return [*words, f"**{flops:.0f}**", str(state_bytes(kind, adaptation, sensing))]


def main() -> None:
    heads = ["controller", "adaptation", "measured", "additions", "multiplications", "divisions", "comparisons"]
    heads += ["roots", "powers", "flops", "state, bytes"]
    lines = ["# Operations of a step", "", f"Made by `{command()}`.", ""]
    lines += [
        "Mean of 1000 steps near the paper's reference, with a force limit, the default gains, 10 exponentials and "
        "a terminal exponent other than one half, counted by a number type that counts. Flops: all but the "
        "comparisons, each root and power as one; exponentials and logarithms are among the powers. Positions only: "
        "with the observer, where a controller has no filter of its own. Filter: `controller.filter` is kalman. "
        "State: what changes while running, in double precision, the guard not included.",
        "",
        f"| {' | '.join(heads)} |",
        "|---|---|---" + "|---:" * (len(heads) - 3) + "|",
    ]
    lines += [f"| {' | '.join(row(*words))} |" for words in counted()]
    write("flops", lines)


if __name__ == "__main__":
    main()
