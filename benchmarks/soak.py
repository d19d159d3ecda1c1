"""Every shipped scenario for 1e8 steps: errors, rate, bounds and rho h/delta, in each kind, adaptation and precision.

Writes benchmarks/results/soak.md. python benchmarks/soak.py [--steps N] compiles benchmarks/soak.cpp and runs it, in
some 20 minutes of a processor. Killed, it goes on with the blocks that build/soak does not hold.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import get_args

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.export.compilers import FLAGS, SOURCES, Number, include, system_compiler
from fracgyro.files import whole_file
from fracgyro.setup import core_setup
from fracgyro.shipped import SHIPPED, shipped

HERE = Path(__file__).parent
RESULTS = HERE / "results" / "soak.md"
STEPS = 10**8
KINDS = ["fractional_fast_terminal", "fractional", "fast_terminal", "linear"]
ADAPTATIONS = ["gradient", "composite"]
NUMBERS: tuple[Number, ...] = get_args(Number)
# So large that it limits nothing: the lanes of a block are all limited or none.
NO_LIMIT = 1e30

CASES = list(product(KINDS, ADAPTATIONS, NUMBERS))
KEPT = HERE.parent / "build" / "soak"

Row = tuple[str, str, str, str, list[str]]


def scenarios(kind: str, adaptation: str, steps: int) -> Iterator[fg.Scenario]:
    for name in SHIPPED:
        base = shipped(name)
        limit = min(base.controller.force_limit, NO_LIMIT)
        yield base.replace(
            {
                "controller.kind": kind,
                "controller.force_limit": limit,
                "adaptation.kind": adaptation,
                "run.duration": steps * base.run.step,
            }
        )


def as_input(runs: list[fg.Scenario], steps: int) -> str:
    lines = [f"{len(runs)} {steps}"]
    for run in runs:
        setup = core_setup(run)
        numbers = list(_core.setup_settings(setup).values())
        modes = np.column_stack(_core.setup_modes(setup)).ravel()
        lines.append(" ".join([run.controller.kind, *map(repr, map(float, [*numbers, *modes]))]))
    return "\n".join(lines)


def soak(program: Path, kind: str, adaptation: str, number: Number, steps: int) -> None:
    """The lines of one block into its file, whole or not at all."""
    kept = KEPT / f"{kind}-{adaptation}-{number}-{steps}.txt"
    if kept.exists():
        return
    runs = as_input(list(scenarios(kind, adaptation, steps)), steps)
    ran = subprocess.run([str(program)], input=runs, capture_output=True, text=True, check=True)
    with whole_file(kept) as scratch:
        scratch.write_text(ran.stdout, encoding="utf-8")
    print(kept.name, flush=True)


def rows(steps: int) -> Iterator[Row]:
    """Of the blocks that have been run."""
    names = list(SHIPPED)
    for kind, adaptation, number in CASES:
        kept = KEPT / f"{kind}-{adaptation}-{number}-{steps}.txt"
        for line in kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []:
            place, *cells = line.split()
            yield names[int(place)], kind, adaptation, number, cells


def power(count: float) -> str:
    mantissa, exponent = f"{count:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def report(found: list[Row], steps: int) -> str:
    ends = [f"{shipped(name).run.step * steps * shipped(name).plant.scales.time:.3g} ({name})" for name in SHIPPED]
    missing = [", ".join(case) for case in CASES if not any(row[1:4] == case for row in found)]
    lines = [
        "# Soak",
        "",
        f"`python benchmarks/soak.py`: every shipped scenario for {power(steps)} steps, in lanes without contraction, "
        "which have the bits of single runs; in double or in float, plant included.",
        "",
        "Over the million steps before each mark: RMS error of x and y; Ω̂z less Ωz, mean and standard deviation (which "
        "float resolves to 1e-3 of Ωz); at the mark the bound estimates; and the largest ρ h/δ of these steps, limited "
        f"as the force has it. Nondimensional. In seconds of each device the last mark is at {', '.join(ends)}.",
        *(["", f"Not run: {'; '.join(missing)}."] if missing else []),
    ]
    for kind, adaptation in product(KINDS, ADAPTATIONS):
        lines += ["", f"## {kind}, {adaptation}", ""]
        lines += ["| scenario | scalar | steps | error x, y | Ω̂z − Ωz: mean ± deviation | b̂0, b̂1, b̂2 | ρ h/δ |"]
        lines += ["|---|---|---|---|---|---|---|"]
        for name, number in product(SHIPPED, NUMBERS):
            for row in found:
                if row[:4] != (name, kind, adaptation, number):
                    continue
                at, *cells = row[4]
                if cells == ["diverged"]:
                    lines.append(f"| {name} | {number} | {at} | **diverged** | | | |")
                    continue
                ex, ey, mean, deviation, b0, b1, b2, gain = map(float, cells)
                lines.append(
                    f"| {name} | {number} | {power(float(at))} | {ex:.2e}, {ey:.2e} | {mean:+.2e} ± {deviation:.1e} "
                    f"| {b0:.3g}, {b1:.3g}, {b2:.3g} | {gain:.3g} |"
                )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=lambda text: int(float(text)), default=STEPS)
    steps = parser.parse_args().steps
    KEPT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        programs = {number: Path(folder) / number for number in NUMBERS}
        headers = include(SOURCES / "core", SOURCES / "sim")
        for number, program in programs.items():
            options = [*FLAGS, "-O2", "-march=native", "-Wno-psabi", f"-DNUMBER={number}"]
            system_compiler(*options, *headers, HERE / "soak.cpp", "-o", program)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(lambda case: soak(programs[case[2]], *case, steps), CASES))
    write(steps)


def write(steps: int) -> None:
    found = list(rows(steps))
    RESULTS.write_text(report(found, steps), encoding="utf-8")
    print(f"{len(found)} marks, {sum('diverged' in row[4] for row in found)} runs diverged: {RESULTS}")


if __name__ == "__main__":
    main()
