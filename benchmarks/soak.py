"""Runs of 1e8 and 1e9 steps; writes benchmarks/results/soak.md or soak_joint.md. Compiles benchmarks/soak.cpp.

python benchmarks/soak.py soak          every shipped scenario in each kind, adaptation and precision: errors, rate,
                                        bounds and rho h/delta; takes a processor an hour. After an interruption
                                        it continues with the blocks that build/soak does not yet hold.
python benchmarks/soak.py soak_joint    every shipped device as shipped, from positions with sensing noise and joint
                                        adaptation
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import NamedTuple, get_args

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.export.compilers import FLAGS, SOURCES, Number, include, system_compiler
from fracgyro.files import whole_file
from fracgyro.rate.units import DEG_PER_S
from fracgyro.scenario import kinds
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.shipped import SHIPPED
from fracgyro.scenario.to_core import core_setup, datasheet
from fracgyro.scenario.volts_core import has_volts
from machine import command, machine, write
from sources import digest

LOGS = {"soak": ["sliding_mode", "composite"], "soak_joint": ["sliding_mode", "joint"]}

HERE = Path(__file__).parent
STEPS, MAX_STEPS = 10**8, 10**9
KINDS = ["fractional_fast_terminal", "fractional", "fast_terminal", "linear"]
ADAPTATIONS = ["gradient", "composite"]
NUMBERS: tuple[Number, ...] = get_args(Number)
# So large that it limits nothing: the lanes of a block are all limited or none.
NO_LIMIT = 1e30

KEPT = HERE.parent / "build" / "soak" / digest(Path(__file__).resolve(), "soak")  # blocks of other sources are not used


class Block(NamedTuple):
    kind: str
    adaptation: str
    number: Number
    steps: int

    @property
    def kept(self) -> Path:
        return KEPT / f"{self.kind}-{self.adaptation}-{self.number}-{self.steps}.txt"


SOAKED = [name for name in SHIPPED if not has_volts(fg.Scenario.shipped(name))]  # the programs have no electrodes
DEVICES = [name for name in SOAKED if fg.Scenario.shipped(name).adaptation.kind == "joint"]
BLOCKS = [Block(*chosen, STEPS) for chosen in product(KINDS, ADAPTATIONS, NUMBERS)]
BLOCKS += [Block(KINDS[0], adaptation, "float", MAX_STEPS) for adaptation in ADAPTATIONS]  # rounding adds up most
Row = tuple[str, Block, list[str]]


def scenarios(block: Block) -> Iterator[fg.Scenario]:
    for name in SOAKED:
        base = exactly_sensed(name)
        limit = min(base.controller.force_limit, NO_LIMIT)
        yield base.replace(
            {
                "controller.kind": block.kind,
                "controller.force_limit": limit,
                "adaptation.kind": block.adaptation,
                "run.duration": block.steps * base.run.step,
            }
        )


def as_input(runs: list[fg.Scenario], steps: int) -> str:
    lines = [f"{len(runs)} {steps}"]
    for run in runs:
        setup = core_setup(run)
        kernel = np.column_stack(_core.setup_kernel(setup)).ravel()
        numbers = map(float, [setup.sensing[0], *_core.setup_settings(setup), *kernel])
        lines.append(f"{kinds.KINDS.index(run.controller.kind)} {' '.join(map(repr, numbers))}")
    return "\n".join(lines)


def soak(program: Path, block: Block) -> None:
    """The lines of one block into its file, whole or not at all."""
    if block.kept.exists():
        return
    runs = as_input(list(scenarios(block)), block.steps)
    ran = subprocess.run([str(program)], input=runs, capture_output=True, text=True, check=True)
    with whole_file(block.kept) as scratch:
        scratch.write_text(ran.stdout, encoding="utf-8")
    print(block.kept.name, flush=True)


def rows() -> Iterator[Row]:
    """Rows of the finished blocks."""
    names = SOAKED
    for block in BLOCKS:
        for line in block.kept.read_text(encoding="utf-8").splitlines() if block.kept.exists() else []:
            place, *cells = line.split()
            yield names[int(place)], block, cells


def power(count: float) -> str:
    mantissa, exponent = f"{count:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def seconds(steps: int) -> str:
    """Duration of `steps` steps on each device."""
    found = {name: exactly_sensed(name) for name in SOAKED}
    return ", ".join(f"{s.run.step * steps * s.plant.scales.time:.3g} ({name})" for name, s in found.items())


def report(found: list[Row]) -> list[str]:
    run = {block for _, block, _ in found}
    missing = [", ".join(map(str, block)) for block in BLOCKS if block not in run]
    lines = [
        "# Soak",
        "",
        f"`{command()}`: every shipped scenario without electrodes for {power(STEPS)} steps, in lanes without "
        "contraction, which have the bits of single runs; in double or in float, plant included. "
        f"{KINDS[0]} in float also for {power(MAX_STEPS)} steps.",
        "",
        "Over the million steps before each mark: RMS error of x and y; Ω̂z less Ωz, mean and standard deviation (which "
        "float resolves to 1e-3 of Ωz); at the mark the bound estimates; and the largest ρ h/δ of these steps, limited "
        f"as the force has it. Nondimensional. In seconds of each device the last mark of {power(STEPS)} steps is at "
        f"{seconds(STEPS)}.",
        *(["", f"Not run: {'; '.join(missing)}."] if missing else []),
    ]
    for kind, adaptation, steps in dict.fromkeys((block.kind, block.adaptation, block.steps) for block in BLOCKS):
        lines += ["", f"## {kind}, {adaptation}" + (f", {power(steps)} steps" if steps == MAX_STEPS else ""), ""]
        lines += ["| scenario | scalar | steps | error x, y | Ω̂z − Ωz: mean ± deviation | b̂0, b̂1, b̂2 | ρ h/δ |"]
        lines += ["|---|---|---|---|---|---|---|"]
        for name, number in product(SOAKED, NUMBERS):
            block = Block(kind, adaptation, number, steps)
            lines += [line(name, number, cells) for of, by, cells in found if (of, by) == (name, block)]
    return lines


def line(name: str, number: str, cells: list[str]) -> str:
    at, *numbers = cells
    if numbers == ["diverged"]:
        return f"| {name} | {number} | {at} | **diverged** | | | |"
    ex, ey, mean, deviation, b0, b1, b2, gain = map(float, numbers)
    return (
        f"| {name} | {number} | {power(float(at))} | {ex:.2e}, {ey:.2e} | {mean:+.2e} ± {deviation:.1e} "
        f"| {b0:.3g}, {b1:.3g}, {b2:.3g} | {gain:.3g} |"
    )


def soak_joint(program: Path, scenario: fg.Scenario) -> list[list[str]]:
    """The numbers of each mark."""
    sensing = datasheet(scenario).position_noise  # the simulated value by default
    assert sensing is not None
    run = as_input([scenario.replace({"run.duration": STEPS * scenario.run.step})], STEPS)
    ran = subprocess.run([str(program), repr(sensing)], input=run, capture_output=True, text=True, check=True)
    return [line.split() for line in ran.stdout.splitlines()]


def joint_row(name: str, number: str, numbers: list[str]) -> str:
    at, *found = numbers
    if found == ["diverged"]:
        cells = ["**diverged**", "", "", ""]
    else:
        ex, ey, mean, deviation, stated, trusted = map(float, found)
        unit = DEG_PER_S.per_si * fg.Scenario.shipped(name).plant.scales.rate
        cells = [f"{ex:.2e}, {ey:.2e}", f"{unit * mean:+.2e} ± {unit * deviation:.1e}", f"{unit * stated:.1e}"]
        cells += [f"{100 * trusted:g} %"]
    line = f"| {name} | {number} | {power(float(at))} | {' | '.join(cells)} |"
    print(line, flush=True)
    return line


def report_joint(programs: dict[Number, Path]) -> list[str]:
    begin = time.perf_counter()
    lines = [
        "# Soak of joint adaptation",
        "",
        f"Made by `{command()}`, which is part of `make bench`. Machine: {machine()}.",
        "",
        f"The shipped devices as shipped for {power(STEPS)} steps, the controller in double or in float. Over the "
        "million steps before each mark: RMS error of x and y, in units of the amplitude; Ω̂z less Ωz in deg/s, "
        "mean and standard deviation; the deviation that it states; how often Ω̂z was trusted.",
        "",
        "| device | controller | steps | error x, y | Ω̂z − Ωz (deg/s) | stated | trusted |",
        "|---" * 7 + "|",
    ]
    cases = list(product(DEVICES, NUMBERS))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(lambda case: soak_joint(programs[case[1]], fg.Scenario.shipped(case[0])), cases)
        for (name, number), marks in zip(cases, found, strict=True):
            lines += [joint_row(name, number, numbers) for numbers in marks]
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    return lines


def report_blocks(programs: dict[Number, Path]) -> list[str]:
    KEPT.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda block: soak(programs[block.number], block), BLOCKS))
    return report(list(rows()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", choices=LOGS)
    log = parser.parse_args().log
    with tempfile.TemporaryDirectory() as folder:
        programs = {number: Path(folder) / number for number in NUMBERS}
        headers = include(SOURCES / "include")
        for number, program in programs.items():
            options = [*FLAGS, "-fexceptions", "-O2", "-march=native", "-Wno-psabi", f"-DNUMBER={number}"]
            system_compiler(*options, *headers, HERE / "soak.cpp", "-o", program)
        write(log, report_joint(programs) if log == "soak_joint" else report_blocks(programs))


if __name__ == "__main__":
    main()
