"""Runs a second of a sweep against the engine's own rate; writes benchmarks/results/study_rate.md.

    python benchmarks/study_rate.py [--quick]

All rows in one run, in turn. The engine's rate is that of `_core.measure_runs` with set-ups that exist already.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import fracgyro as fg
import sweep_scaling
from fracgyro import _core
from fracgyro.scenario.patched import Patch
from fracgyro.scenario.to_core import core_setup
from fracgyro.simulation.many import threads_available
from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "python/fracgyro/study/sweep/run.py", "python/fracgyro/scenario/patched.py"]

FIELDS = ["adaptation.rate_gain", "adaptation.stiffness_gain"]
# Steps of a run and number of runs.
SIZES = ((1_000, 20_000), (80_001, 2_048))
CHILD = """
import json, sys, tempfile, time
from pathlib import Path
import fracgyro as fg

def swept(text):
    marks = []
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(text, encoding="utf-8")
        begin = time.perf_counter(), time.process_time()
        now = lambda: (time.perf_counter() - begin[0], time.process_time() - begin[1])
        fg.study.sweep(study, Path(folder) / "out", progress=lambda *_: marks.append(now()))
    return marks[-1]

swept(json.loads(sys.stdin.readline()))
for line in sys.stdin:
    print(json.dumps(swept(json.loads(line))), flush=True)
"""


def setups(steps: int, count: int) -> list[_core.DeviceSetup]:
    base = fg.Scenario.paper().replace({"run.duration": steps * 1e-3})
    return list(Patch(base, FIELDS).setups([(50 + 250 * i / count, 300 - 250 * i / count) for i in range(count)]))


def long_way(count: int) -> None:
    base = fg.Scenario.paper().replace({"run.duration": 1.0})
    for i in range(count):
        core_setup(base.replace(dict(zip(FIELDS, (50.0 + i / count, 300.0 - i / count), strict=True))))


def engine(made: list[_core.DeviceSetup], steps: int) -> None:
    params = _core.MetricsParams()
    params.transient = steps * 0.5e-3
    _core.measure_runs(made, params, threads_available(), _core.lane_counts()[-1])


def times(act: Callable[[], object]) -> tuple[float, float]:
    """Wall clock and processor time, s."""
    wall, used = time.perf_counter(), time.process_time()
    act()
    return time.perf_counter() - wall, time.process_time() - used


class Sweeps:
    """A process that times sweeps until their last run; their summaries take the same whatever the number of runs."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=tempfile.gettempdir(),
        )
        self.send(10, 100)  # imports

    def send(self, count: int, steps: int) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(sweep_scaling.study(count, 1, steps)) + "\n")
        self.process.stdin.flush()

    def swept(self, count: int, steps: int) -> tuple[float, float]:
        """Wall clock and processor time, s."""
        self.send(count, steps)
        assert self.process.stdout is not None
        wall, used = json.loads(self.process.stdout.readline())
        return wall, used


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs, once; not written")
    options = parser.parse_args()
    repeats, part = (1, 10) if options.quick else (5, 1)
    rows, shares = [], []
    sweeps = Sweeps()
    for steps, all_runs in SIZES:
        count = all_runs // part
        made = setups(steps, count)
        parts: dict[str, tuple[int, Callable[[], tuple[float, float]]]] = {
            "the engine": (count, lambda steps=steps, made=made: times(lambda: engine(made, steps)))
        }
        if steps == SIZES[0][0]:
            parts["set-ups, the long way"] = (count // 20, lambda count=count: times(lambda: long_way(count // 20)))
            parts["set-ups, patched"] = (count, lambda count=count: times(lambda: setups(1_000, count)))
        parts["a sweep"] = (count, lambda count=count, steps=steps: sweeps.swept(count, steps))
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in parts}
        for _ in range(repeats):
            for name, (_, act) in parts.items():
                found[name].append(act())
        least = {
            name: [1e6 * min(column) / parts[name][0] for column in zip(*each, strict=True)]
            for name, each in found.items()
        }
        for name, (wall, used) in least.items():
            rows.append(f"| {steps:,} | {name} | {parts[name][0]:,} | {wall:.1f} | {used:.1f} |")
        shares.append((steps, *(a / b for a, b in zip(least["the engine"], least["a sweep"], strict=True))))
    lines = [
        "# A sweep against the engine",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine('xarray', 'pyarrow')}; {threads_available()} threads.",
        "",
        f"Scenarios that differ in two gains, a seed each; least of {repeats}, in turn. A sweep is timed until its "
        "last run, planning included.",
        "",
        "| steps | | runs | wall clock, us a run | processor time, us a run |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "Share of the engine's rate that the sweep reaches: "
        + "; ".join(
            f"{wall:.2f} by wall clock and {used:.2f} by processor time with {steps:,} steps"
            for steps, wall, used in shares
        )
        + ". Marks: 0.6 and 0.95.",
    ]
    write("study_rate", lines, keep=not options.quick)


if __name__ == "__main__":
    main()
