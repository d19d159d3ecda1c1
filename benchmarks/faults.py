"""Effect of sensor faults in the closed loop, without and with the guard; writes benchmarks/results/faults.md.

    python benchmarks/faults.py [--quick]

The paper's gyroscope and noise, the exact plant, a force limit of 6000. A fault begins at t = 20 and the loop is
observed for 40 units of time. Quick: three faults, and 10⁵ steps without any.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fracgyro as fg
from fracgyro.export.compilers import FLAGS, SOURCES, Number, include, system_compiler
from fracgyro.scenario.kinds import KINDS
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.shipped import SHIPPED
from machine import command, machine, write
from scenario_files import write_files

DEPENDS_ON = ["sliding_mode", "composite", "joint", "benchmarks/faults.cpp", "benchmarks/scenario_files.hpp"]

BEGIN, END = 20.0, 60.0
PAPER = fg.Scenario.paper().replace({"controller.force_limit": 6000.0, "run.duration": END})
CHECKED = {"guard.checked": True}
ADAPTATIONS: dict[str, dict[str, Any]] = {
    "gradient": {},
    "composite": {"adaptation.kind": "composite"},
    "composite, forgetting": {"adaptation.kind": "composite", "adaptation.rate_forgetting": 2.0},
    "joint": {"adaptation.kind": "joint"},
}

# Kind, size, samples, period of repetition.
Fault = tuple[str, float, int, int]
ONE_SAMPLE: list[Fault] = [
    *(("x", size, 1, 0) for size in (1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e4, 9e5, 1.1e6)),
    *(("y", size, 1, 0) for size in (1e-2, 1.0, 100.0)),
    *(("vx", size, 1, 0) for size in (0.05, 0.1, 0.3, 1.0, 10.0, 100.0, 9e5)),
    *(("vy", size, 1, 0) for size in (0.2, 10.0, 9e5)),
]
LASTING: list[Fault] = [
    *(("stuck", 0.0, samples, 0) for samples in (10, 100, 1000)),
    *(("zero", 0.0, samples, 0) for samples in (10, 100, 1000)),
    *(("flip", 0.0, samples, 0) for samples in (1, 10, 100)),
    *(("nan", 0.0, samples, 0) for samples in (10, 100, 1000)),
    ("zero y", 0.0, 1000, 0),
    ("flip both", 0.0, 10, 0),
    ("stuck x", 0.0, 100, 0),
    ("stuck vx", 0.0, 100, 0),
    ("x", 1.0, 1, 1000),
    ("gain", 1.01, 20, 0),
    ("gain", 1.01, 2000, 0),
    *((what, size, 20_000, 0) for what, size in (("stuck", 0.0), ("flip", 0.0), ("gain", 1.01), ("x", 0.01))),
]
FAULTS = [*ONE_SAMPLE, *LASTING]
NOTICED: list[Fault] = [
    (what, size, 1000, 0)
    for what, size in (
        ("stuck", 0.0),
        ("stuck x", 0.0),
        ("stuck vx", 0.0),
        ("zero", 0.0),
        ("zero y", 0.0),
        ("flip", 0.0),
        ("flip both", 0.0),
        ("gain", 0.5),
        ("gain", 0.95),
        ("x", 0.01),
        ("vx", 0.05),
    )
]
WORDS = {
    "stuck": "x and vx stuck",
    "stuck x": "x stuck",
    "stuck vx": "vx stuck",
    "zero": "x and vx read 0",
    "zero y": "y and vy read 0",
    "flip": "x and vx change sign",
    "flip both": "all four change sign",
    "nan": "x is NaN",
    "gain": "x and vx times",
}


def worded(fault: Fault) -> str:
    what, size, samples, every = fault
    text = WORDS.get(what, f"{what} + {size:g}") + (f" {size:g}" if what == "gain" else "")
    return f"{text}, every {every}th sample" if every else f"{text}, {samples}" if samples > 1 else text


class Program:
    """faults.cpp, compiled, for one scenario after another."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        source = Path(__file__).with_suffix(".cpp")
        headers = include(SOURCES / "include")
        system_compiler(*FLAGS, "-O2", "-march=native", *headers, source, "-o", folder / "faults")

    def __call__(
        self, scenario: fg.Scenario, number: Number, mode: str, *words: float, faults: Sequence[Fault] = ()
    ) -> list[Any]:
        write_files(scenario, self._folder)
        ran = subprocess.run(
            [self._folder / "faults", str(KINDS.index(scenario.controller.kind)), number, mode, *map(str, words)],
            cwd=self._folder,
            input="".join(",".join(map(str, fault)) + "\n" for fault in faults),
            capture_output=True,
            text=True,
            check=True,
        )
        return [json.loads(line.replace("nan", "null").replace("inf", "null")) for line in ran.stdout.splitlines()]


def recovered(found: dict[str, Any], step: float) -> str:
    """Maximum error; recovery time; maximum relative rate error; its recovery time."""

    def back(samples: int) -> str:
        return "–" if samples >= round((END - BEGIN) / step) else f"{samples * step:.3g}"

    cells = [found["most_error"], found["most_off"]]
    error, off = ("–" if value is None else f"{value:.2g}" for value in cells)
    return f"{error}, {back(found['error_back'])}, {off}, {back(found['off_back'])}"


def tables(program: Program, faults: list[Fault]) -> tuple[list[str], list[str]]:
    """Effect of each fault, and true if the effect of one bad sample ends within 100 samples."""
    lines, claims = [], []
    for name, change in ADAPTATIONS.items():
        runs = {}
        for number in ("double", "float"):
            for guard, more in {"off": {}, "on": CHECKED}.items():
                scenario = PAPER.replace({**change, **more})
                runs[number, guard] = program(scenario, number, "run", BEGIN, END, faults=faults)
        usual = runs["double", "on"][0]
        lines += [
            f"## {name}",
            "",
            f"Without a fault the error is at most {usual['error']:.2g} and that of the rate {usual['off']:.2g} of it.",
            "",
            "| fault | guard off | guard on | refused | in float | deviations |",
            "|---|---|---|---|---|---|",
        ]
        for i, fault in enumerate(faults):
            off, on, single = (runs[key][i + 1] for key in (("double", "off"), ("double", "on"), ("float", "on")))
            cells = [recovered(found, PAPER.run.step) for found in (off, on, single)]
            worst = [found["deviations"] for found in (off, on, single)]
            most = ", ".join(f"{number:.2g}" if number else "–" for number in worst)
            lines.append(f"| {worded(fault)} | {cells[0]} | {cells[1]} | {on['refused']} | {cells[2]} | {most} |")
        lines.append("")
        one = [i + 1 for i, fault in enumerate(faults) if fault in ONE_SAMPLE or fault[2:] == (1, 0)]
        longest = [
            max(max(runs[number, "on"][i][key] for i in one) for key in ("error_back", "off_back"))
            for number in ("double", "float")
        ]
        claims.append(f"{name}: {longest[0]} samples in double, {longest[1]} in float")
    return lines, claims


def noticed(program: Program) -> list[str]:
    lines = ["| fault that lasts | median | 9 of 10 | most | not within 1000 |", "|---|---|---|---|---|"]
    scenario = PAPER.replace({**ADAPTATIONS["composite"], **CHECKED})
    found = program(scenario, "double", "notice", BEGIN, BEGIN + 4.0, faults=NOTICED)
    for fault, samples in zip(NOTICED, found, strict=True):
        seen = sorted(n + 1 for n in samples if n >= 0)
        never = len(samples) - len(seen)
        numbers = [statistics.median(seen), seen[int(0.9 * len(seen))], seen[-1]] if seen else ["–"] * 3
        cells = [worded(fault).removesuffix(", 1000"), *(f"{n:g}" if n != "–" else "–" for n in numbers)]
        lines.append(f"| {' | '.join(cells)} | {never} of {len(samples)} |")
    return lines


def alarms(program: Program, steps: int) -> list[str]:
    lines = ["| scenario | steps | refused, double | refused, float | at the force limit |", "|---|---|---|---|---|"]
    scenarios = {name: exactly_sensed(name) for name in SHIPPED}
    bounded = PAPER.replace({"controller.switching_limit": 0.5})  # otherwise the loop diverges in noise
    scenarios |= {f"paper, limit 6000, {name}": bounded.replace(change) for name, change in ADAPTATIONS.items()}
    # A limit reached at the start, and in the last case in every period.
    for limit in (1000.0, 700.0, 500.0):
        scenarios[f"paper, limit {limit:g}"] = bounded.replace({"controller.force_limit": limit})
    for name, scenario in scenarios.items():
        guarded = scenario.replace(CHECKED)
        found = [program(guarded, number, "alarms", steps)[0] for number in ("double", "float")]
        lines.append(
            f"| {name} | {steps:.0e} | {found[0]['refused']} | {found[1]['refused']} | {found[0]['saturated']} |"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="three faults, 1e5 steps, and nothing written")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory() as name:
        program = Program(Path(name))
        table, claims = tables(program, FAULTS[3::15] if quick else FAULTS)
        lines = [
            "# What faults of the sensors do",
            "",
            f"`{command()}`, on {machine()}.",
            "",
            "Closed loop with the exact plant, the paper's noise and force limit 6000; a fault begins at t = 20, and",
            "the loop is watched for 40 units. Cells: largest true error; after how long it is back; largest error of",
            "the rate, over the rate; after how long that is back. Back is a run from when on it stays within 1.25",
            "times the largest that fault-free runs of eight seeds show while watched; –: not within 40. Off: NaN,",
            "infinity and more than 10⁶ are refused all the same, and least squares bound what one sample may add.",
            "Deviations: the largest error of the rate, over what is stated for it, while it is trusted; guard off,",
            "on, and on in float.",
            "",
            *table,
            "After the one-sample faults both are back, with the guard on, after at most:",
            *(f"* {claim};" for claim in claims),
            "",
            "## How soon a fault is noticed",
            "",
            "Samples until the first is refused, composite, of faults begun at 200 moments of the reference's period.",
            "What is stuck at a turning point is noticed once it ought to have left it.",
            "",
            *noticed(program),
            "",
            "## False alarms",
            "",
            "Without any fault, from t = 0 on, the start and the force limit included.",
            "",
            *alarms(program, 100_000 if quick else 10_000_000),
        ]
    write("faults", lines, keep=not quick)


if __name__ == "__main__":
    main()
