"""One recorded run through every target, and the hash of each result; writes benchmarks/results/parity.md."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
from fracgyro import _core
from fracgyro.export.compilers import compiler
from fracgyro.export.parity import PUBLISHED, SCENARIO
from fracgyro.export.replay import Difference, first_difference, load, parity_hash
from fracgyro.export.targets import AnyNumber, answer_columns, answers, expected, target_named
from fracgyro.simulation.dataset import write_run
from fracgyro.simulation.simulate import simulate
from fracgyro_fpga.desk import IN_FIXED
from machine import command, machine, write
from numpy.typing import NDArray

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "composite", "integrations/**/*", "fpga/fracgyro_fpga/**/*"]

CORE = "core"  # not a target: what the FPGA is compared with in fixed
# References of the other targets; double is the number type of the record.
REFERENCES: dict[AnyNumber, str] = {"double": "host", "float": "host", "fixed": CORE}


def first_line(*words: str) -> str:
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()[0]


# Name: target, what compiles and runs it, environment.
def targets() -> dict[str, tuple[str, str, dict[str, str]]]:
    gcc, clang = first_line("g++", "--version"), first_line("clang++", "--version")
    ours = first_line(*compiler(), "--version")
    arm = f"{first_line('arm-none-eabi-g++', '--version')}; {first_line('qemu-system-arm', '--version')}"
    octave = f"{first_line('octave-cli', '--version')}; {ours}"
    web = f"zig {version('ziglang')}; node {first_line('node', '--version')}"
    return {
        "Python Controller": ("python", ours, {}),
        "SIMD lanes": ("lanes", f"{ours}, -march=native: {8 * _core.lane_counts()[-1]} bytes", {}),
        "firmware, this computer, gcc": ("host", gcc, {"CC": "gcc", "CXX": "g++"}),
        "firmware, this computer, clang": ("host", clang, {"CC": "clang", "CXX": "clang++"}),
        "firmware, Cortex-M4F": ("m4f", arm, {}),
        "firmware, Cortex-M7": ("m7", arm, {}),
        "Octave, a MEX file": ("octave", octave, {}),
        "WebAssembly": ("wasm", web, {}),
        "FMU": ("fmu", f"{ours}; FMPy {version('fmpy')}", {}),
        "FPGA, simulated": ("fpga", first_line("verilator", "--version"), {}),
        "C++ core, this computer": (CORE, ours, {}),
    }


def numbers(target: str) -> tuple[AnyNumber, ...]:
    return ("fixed",) if target == CORE else target_named(target).numbers


def rows_of(target: str, number: AnyNumber, motion: NDArray[np.float64]) -> NDArray[np.floating]:
    if target == CORE:
        return expected("fpga", SCENARIO, number, motion)
    return answers(target, SCENARIO, number, motion)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.nc"
        write_run(simulate(SCENARIO), path)
        trace = load(path)
    lines = [
        "# The same bits on every target",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine()}.",
        "",
        f"The paper's corrected scenario, its noise included, over 100 units of time: {len(trace.motion):,} samples.",
        "Each target is handed the recorded positions and velocities, in float rounded to float, and answers force and",
        "estimates. The parity hash is SHA-256 over the bits of 12 numbers a step; seconds include compiling.",
    ]
    problems: list[Difference | None] = []
    hashes: dict[AnyNumber, str] = {}
    compiled_by = targets()
    for number, reference_target in REFERENCES.items():
        reference = trace.answers if number == "double" else rows_of(reference_target, number, trace.motion)
        hashes[number] = parity_hash(SCENARIO, reference)
        rows = []
        for name, (target, made, environment) in compiled_by.items():
            if number not in numbers(target):
                continue
            os.environ.update(environment)
            start = time.perf_counter()
            found = rows_of(target, number, trace.motion)
            seconds = time.perf_counter() - start
            for variable in environment:
                del os.environ[variable]
            difference = first_difference(found, reference, answer_columns(SCENARIO))
            problems.append(difference)
            seen = f"`{parity_hash(SCENARIO, found)[:16]}…`" if difference is None else f"**{difference}**"
            rows.append(f"| {name} | {made} | {seen} | {seconds:.1f} |")
        recorded = ", that of the record" if number == "double" else ""
        lines += ["", f"## {number}: `{hashes[number]}`{recorded}", ""]
        lines += ["| target | compiled and run by | parity hash | s |", "|---|---|---|---|", *rows]
    write("parity", lines)
    if any(problems):
        raise SystemExit("targets differ")
    if hashes != {**PUBLISHED, "fixed": IN_FIXED}:
        raise SystemExit(f"fracgyro.export.parity has other hashes: it must have {hashes}")


if __name__ == "__main__":
    main()
