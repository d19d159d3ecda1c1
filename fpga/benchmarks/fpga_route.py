"""Exported hardware, placed and routed for a Lattice ECP5: its clock, and what a step takes with it.

    python fpga/benchmarks/fpga_route.py [--jobs N] [--only NAME ...] [--seeds N]

Writes benchmarks/results/fpga_route.md. Each route takes some minutes; build/fpga_route keeps what was routed
of the same design by the same tools, so that the script can be stopped and started again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import shutil
import statistics
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fracgyro.export.compilers import make, run
from fracgyro_fpga import fpga
from fracgyro_fpga.arithmetic import ARITHMETICS, HardwareNumber

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from machine import command, machine, write

from fpga import EIGHT, ROOT, SCENARIO, SIXTEEN, motion_of

BUILD = ROOT / "build/fpga_route"
TOOLS = {name: version(f"yowasp-{name}") for name in ("yosys", "nextpnr-ecp5")}
LIMIT = {"controller.force_limit": 6000.0}
DESIGNS: dict[str, tuple[HardwareNumber, dict[str, Any]]] = {
    "8 exponentials": ("float", EIGHT),
    "8 exponentials, fixed": ("fixed", EIGHT),
    "8 exponentials, force limit": ("float", EIGHT | LIMIT),
    "16 exponentials": ("float", SIXTEEN),
    "16 exponentials, force limit": ("float", SIXTEEN | LIMIT),
    "8 exponentials, force limit, fixed": ("fixed", EIGHT | LIMIT),
}
GRADES, SEEDS = (8, 6), 3
SOURCES = ["units.v", "digits.v", "controller.v", "spi.v", "controller.hex", "constants.hex", "pins.lpf", "Makefile"]
CELLS = {"TRELLIS_COMB": "LUT4", "TRELLIS_FF": "FF", "MULT18X18D": "DSP", "DP16KD": "block RAM"}
STEPS = 2_000


def prepared(name: str) -> tuple[Path, list[float]]:
    """The folder of a design, synthesized, and its mean cycles from start to force and to ready."""
    number, changes = DESIGNS[name]
    scenario = SCENARIO.replace(changes)  # whose duration chooses the exponentials
    scratch = BUILD / name.replace(", ", "-").replace(" ", "_")
    shutil.rmtree(scratch, ignore_errors=True)
    fpga(scenario, scratch, number, unbounded=True)
    folder = BUILD / content(scratch)
    if not (folder / "cycles.json").exists():
        shutil.rmtree(folder, ignore_errors=True)
        ARITHMETICS[number].words(motion_of(scenario, faults=False)[:STEPS]).tofile(scratch / "motion")
        make(scratch, "build/controller")
        cycles = re.findall(r"([\d.]+) on average", run([str(scratch / "build/controller")], scratch))
        make(scratch, "build/spi.json", *tool("yosys"))
        (scratch / "cycles.json").write_text(json.dumps([float(one) for one in cycles]), encoding="utf-8")
        scratch.rename(folder)
    return folder, json.loads((folder / "cycles.json").read_text(encoding="utf-8"))


def content(folder: Path) -> str:
    """A hash of a design and of the tools, without comments and spaces."""
    text = "".join((folder / file).read_text(encoding="utf-8") for file in SOURCES) + json.dumps(TOOLS)
    return hashlib.sha256("".join(re.sub(r"//.*", "", text).split()).encode()).hexdigest()[:16]


def tool(name: str) -> list[str]:
    return [f"{name.partition('-')[0].upper()}={Path(sys.executable).parent / f'yowasp-{name}'}"]


def routed(name: str, folder: Path, seed: int) -> dict[int, dict[str, Any]]:
    """Reports of nextpnr by speed grade. Placed once, with the delays of the faster grade; routed for each grade."""
    reports = {grade: folder / f"route_{grade}_{seed}.json" for grade in GRADES}
    if not all(report.exists() for report in reports.values()):
        own = folder / f"own_{seed}"
        shutil.copytree(folder, own, ignore=shutil.ignore_patterns("own_*", "route_*"), dirs_exist_ok=True)
        choice = [f"SEED={seed}", *tool("nextpnr-ecp5")]
        make(own, "route.log", device(GRADES[0]), "STEPS=--placer static --no-route --write placed.json", *choice)
        for grade, report in reports.items():
            (own / "route.log").unlink()
            steps = "STEPS=--no-pack --no-place --router router1"
            make(own, "route.log", device(grade), steps, "PLACED=placed.json", *choice)
            shutil.copyfile(own / "route.json", report)
        shutil.rmtree(own)
    found = {grade: json.loads(report.read_text(encoding="utf-8")) for grade, report in reports.items()}
    for grade, one in found.items():
        print(f"{name}, grade {grade}, seed {seed}: {clock(one):.1f} MHz", file=sys.stderr, flush=True)
    return found


def device(grade: int) -> str:
    return f"DEVICE=--45k --package CABGA381 --speed {grade} --lpf pins.lpf"


def clock(report: dict[str, Any]) -> float:
    """In MHz."""
    (found,) = report["fmax"].values()
    return float(found["achieved"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="routes at a time")
    parser.add_argument("--only", nargs="+", choices=DESIGNS, default=list(DESIGNS), help="designs")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="how many, of the placer")
    options = parser.parse_args()
    with ThreadPoolExecutor(options.jobs) as pool:
        designs = dict(zip(options.only, pool.map(prepared, options.only), strict=True))
        wanted = [(name, seed) for seed in range(1, options.seeds + 1) for name in options.only]
        reports = dict(
            zip(wanted, pool.map(lambda one: routed(one[0], designs[one[0]][0], one[1]), wanted), strict=True)
        )
    rows = []
    for name, (_, (force, ready)) in designs.items():
        for grade in GRADES:
            some = [report[grade] for (of, _), report in reports.items() if of == name]
            clocks = [clock(one) for one in some]
            cells = [f"{some[0]['utilization'][cell]['used']:,}" for cell in CELLS]
            best = max(clocks)
            times = [f"{force / best:.2f}", f"{ready / best:.2f}"]
            middle = f"{len(some)} | {statistics.median(clocks):.1f} ({min(clocks):.1f} to {best:.1f})"
            rows.append(f"| {' | '.join([name, str(grade), *cells, f'{force:.0f}', f'{ready:.0f}', middle, *times])} |")
    lines = [
        "# Exported hardware, placed and routed",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine()}; {', '.join(f'{name} {number}' for name, number in TOOLS.items())}.",
        "",
        "The paper's controller, in float or with a fixed point, behind SPI in a Lattice LFE5U-45F (43,848 LUT4, FF,",
        "72 DSP, 108 block RAM). With each seed it is placed once, and routed for either speed grade, by",
        "nextpnr's static placer and router1. Clock: median, least and most of the seeds; times are those of the best",
        f"one. Cycles are means of the first {STEPS:,} steps.",
        "",
        f"| controller | grade | {' | '.join(CELLS.values())} | cycles to the force | a step | seeds | MHz "
        "| µs to the force | µs a step |",
        f"|{'---|' * 12}",
        *rows,
    ]
    write("fpga_route", lines)


if __name__ == "__main__":
    main()
