"""Floating-point operations of a step of each controller, and its state; writes benchmarks/results/flops.md."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import fracgyro as fg
from fracgyro import _core
from fracgyro.export.compilers import SOURCES, include, system_compiler
from fracgyro.export.settings import core_kernel
from fracgyro.scenario.kinds import KINDS
from fracgyro.scenario.to_core import core_setup
from fracgyro_lab.zoo.laws import NOISE, cell, laws, sensed_base, with_gains
from machine import command, write

MEASURES_CODE = True
DEPENDS_ON = ["lab/fracgyro_lab/zoo/gains.json", "lab/fracgyro_lab/zoo/facts/*.toml"]
HERE = Path(__file__).parent
ADAPTATIONS = ["gradient", "composite", "joint"]
SENSING = {"full": "positions and velocities", "position": "positions only"}
SENSING |= {f"{name}_filtered": f"{words}, filter" for name, words in SENSING.items()}
SLIDING = ["fractional_fast_terminal", "fractional", "fast_terminal", "linear"]
Cells = list[str]


def law_lines() -> list[str]:
    """Lines for flops.cpp: the laws of the zoo with its gains, each with the measurements that it has there."""
    lines = []
    for name, law in sorted(laws().items()):
        tuned = with_gains(law, "noise")
        for information in law.classes:
            scenario = tuned.scenario(sensed_base(cell(information, NOISE)))
            setup = core_setup(scenario)
            lists = (_core.setup_settings(setup), *core_kernel(scenario))
            numbers = " ".join(f"{len(each)} {' '.join(map(repr, map(float, each)))}" for each in lists)
            lines.append(f"{name} {KINDS.index(scenario.controller.kind)} {setup.sensing[0]} {numbers}")
    return lines


def counted() -> tuple[list[list[str]], list[list[str]]]:
    """Words of the lines that flops.cpp prints, of kinds and of laws: the name, adaptation, sensing, operations."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "flops"
        system_compiler("-std=c++20", "-O1", *include(SOURCES / "include"), HERE / "flops.cpp", "-o", program)
        given = "\n".join(law_lines())
        ran = subprocess.run([str(program)], input=given, capture_output=True, text=True, check=True)
    kinds, _, of_laws = ran.stdout.partition("-\n")
    return [line.split() for line in kinds.splitlines()], [line.split() for line in of_laws.splitlines()]


def state_bytes(kind: str, adaptation: str, sensing: str) -> int:
    measured, _, filtered = sensing.partition("_")
    changes: dict[str, object] = {"controller.kind": kind, "device.sensing": measured}
    if filtered:
        changes |= {"controller.filter": "kalman", "device.position_noise_density": 1e-13}
    if kind in SLIDING:
        changes["adaptation.kind"] = adaptation
    return len(fg.Controller(fg.Scenario.paper().replace(changes))._core.state)


def operations(counts: tuple[str, ...]) -> Cells:
    numbers = [float(number) for number in counts]
    flops = sum(numbers[:3]) + numbers[4] + numbers[5]
    return [*(f"{number:.0f}" for number in numbers), f"**{flops:.0f}**"]


def row(kind: str, place: str, sensing: str, *counts: str) -> Cells:
    adaptation = ADAPTATIONS[int(place)] if kind in SLIDING else ""
    words = [f"`{kind}`", adaptation or "–", SENSING[sensing], *operations(counts)]
    return [*words, str(state_bytes(kind, adaptation, sensing))]


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
    kinds, of_laws = counted()
    lines += [f"| {' | '.join(row(*words))} |" for words in kinds]
    lines += [
        "",
        "## The laws of the zoo",
        "",
        "The same of the laws of the zoo, each with its settings and the gains that the zoo found in noise. "
        "Operations: as the flops above.",
        "",
        f"| {' | '.join(['law', 'of', *heads[2:-2], 'operations'])} |",
        "|---|---|---" + "|---:" * (len(heads) - 4) + "|",
    ]
    for name, _, sensing, *counts in of_laws:
        lines.append(f"| {' | '.join([f'`{name}`', 'zoo', SENSING[sensing], *operations(tuple(counts))])} |")
    write("flops", lines)


if __name__ == "__main__":
    main()
