"""Every shipped device as shipped, from positions with sensing noise and joint adaptation, for 1e8 steps.

Writes benchmarks/results/soak_joint.md.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

from fracgyro.export.compilers import FLAGS, SOURCES, include, system_compiler
from fracgyro.rate.units import DEG_PER_S
from fracgyro.scenario import Scenario
from fracgyro.scenario.shipped import SHIPPED, shipped
from fracgyro.scenario.to_core import datasheet
from machine import command, machine, write
from soak import HERE, NUMBERS, STEPS, as_input, power

DEPENDS_ON = ["joint"]

DEVICES = [name for name in SHIPPED if shipped(name).adaptation.kind == "joint"]


def soak(program: Path, scenario: Scenario) -> list[list[str]]:
    """The numbers of each mark."""
    sensing = datasheet(scenario).position_noise  # the truth, as nothing else is said
    assert sensing is not None
    run = as_input([scenario.replace({"run.duration": STEPS * scenario.run.step})], STEPS)
    ran = subprocess.run([str(program), repr(sensing)], input=run, capture_output=True, text=True, check=True)
    return [line.split() for line in ran.stdout.splitlines()]


def row(name: str, number: str, numbers: list[str]) -> str:
    at, *found = numbers
    if found == ["diverged"]:
        cells = ["**diverged**", "", "", ""]
    else:
        ex, ey, mean, deviation, stated, trusted = map(float, found)
        unit = DEG_PER_S.per_si * shipped(name).plant.scales.rate
        cells = [f"{ex:.2e}, {ey:.2e}", f"{unit * mean:+.2e} ± {unit * deviation:.1e}", f"{unit * stated:.1e}"]
        cells += [f"{100 * trusted:g} %"]
    line = f"| {name} | {number} | {power(float(at))} | {' | '.join(cells)} |"
    print(line, flush=True)
    return line


def main() -> None:
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
    with tempfile.TemporaryDirectory() as folder:
        programs = {number: Path(folder) / number for number in NUMBERS}
        for number, program in programs.items():
            options = [*FLAGS, "-O2", "-march=native", "-Wno-psabi", f"-DNUMBER={number}"]
            system_compiler(*options, *include(SOURCES / "include"), HERE / "soak_joint.cpp", "-o", program)
        cases = list(product(DEVICES, NUMBERS))
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            found = pool.map(lambda case: soak(programs[case[1]], shipped(case[0])), cases)
            for (name, number), marks in zip(cases, found, strict=True):
                lines += [row(name, number, numbers) for numbers in marks]
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("soak_joint", lines)


if __name__ == "__main__":
    main()
