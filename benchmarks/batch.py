"""Times many runs, metrics only, paired against another commit; writes benchmarks/results/batch.md.

    python benchmarks/batch.py [--against COMMIT] [--rounds N] [--quick]

The other commit is built too, into build/against. Both compute the same runs in turn, in a process each,
and their metrics are compared bit by bit.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode"]

ROOT = Path(__file__).resolve().parent.parent
STEPS = 80_000
# Cases: number of scenarios, of seeds, of threads, single precision or not, and the required ratio.
CASES = {
    "doubles, one noise": (32, 1, 1, False, 1.3),
    "doubles, noise per run": (1, 32, 1, False, 1.5),
    "floats, one noise": (32, 1, 1, True, 1.2),
    "floats, noise per run": (1, 32, 1, True, 1.6),
    "doubles, one noise, 128 scenarios on two threads": (128, 1, 2, False, 2.0),
}


def worker() -> None:
    """Answers every name of a case on the standard input with its seconds and its metrics."""
    import fracgyro as fg
    from fracgyro import _core
    from fracgyro.scenario.to_core import core_setup

    params = _core.MetricsParams()
    params.transient = 1.0
    lanes = _core.lane_counts()[-1]
    setups = {}
    for case, (scenarios, seeds, *_) in CASES.items():
        # The tolerance of the older commits, or there would be fewer exponentials now.
        paper = fg.Scenario.paper().replace({"run.duration": STEPS * 1e-3, "run.kernel_tolerance": 1e-6})
        setups[case] = [
            core_setup(paper.replace({"plant.angular_rate": 100.0 + i, "disturbance.seed": seed}))
            for i in range(scenarios)
            for seed in range(seeds)
        ]
    print(lanes, flush=True)
    for line in sys.stdin:
        *_, threads, single, _ = CASES[line.strip()]
        # A thread of its own has the processor's time to itself; several are done when the last one is.
        clock = time.process_time if threads == 1 else time.perf_counter
        start = clock()
        rows = _core.measure_runs(setups[line.strip()], params, threads, lanes, single)
        print(json.dumps([clock() - start, rows.tobytes().hex()]), flush=True)


class Build:
    """One commit, in a process of its own."""

    def __init__(self, package: Path | None) -> None:
        words = [sys.executable, __file__, "--worker"]
        environment = dict(os.environ)
        if package is not None:
            words.insert(1, "-S")  # or the editable installation would be found first
            environment["PYTHONPATH"] = os.pathsep.join([str(package), sysconfig.get_path("purelib")])
        self.process = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, cwd=ROOT
        )
        self.lanes = int(self.answer())

    def answer(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline()

    def run(self, case: str) -> tuple[float, str]:
        assert self.process.stdin is not None
        self.process.stdin.write(case + "\n")
        self.process.stdin.flush()
        seconds, metrics = json.loads(self.answer())
        return seconds, metrics

    def end(self) -> None:
        self.process.communicate()


def built(commit: str) -> Path:
    """The package of that commit, compiled with the flags that it ships with."""
    name = subprocess.run(["git", "rev-parse", "--short", commit], check=True, capture_output=True, text=True, cwd=ROOT)
    place = ROOT / "build/against" / name.stdout.strip()
    package = place / "package"
    if not (place / "built").exists():
        tree = place / "tree"
        if not tree.exists():
            subprocess.run(["git", "worktree", "prune"], check=True, cwd=ROOT)
            subprocess.run(["git", "worktree", "add", "--detach", tree, commit], check=True, cwd=ROOT)
        environment = {name: value for name, value in os.environ.items() if name != "CMAKE_ARGS"}
        words = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", package, tree]
        subprocess.run(words, check=True, env=environment)
        subprocess.run(["git", "worktree", "remove", "--force", tree], check=True, cwd=ROOT)
        (place / "built").touch()
    return package


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", default="b164dec", help="commit to compare with")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--quick", action="store_true", help="three rounds; not written")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        worker()
        return
    rounds = 3 if options.quick else options.rounds
    builds = {"before": Build(built(options.against)), "now": Build(None)}
    seconds: dict[str, dict[str, list[float]]] = {case: {name: [] for name in builds} for case in CASES}
    same = dict.fromkeys(CASES, True)
    for count in range(rounds + 1):
        for case in CASES:
            found = {name: build.run(case) for name, build in builds.items()}
            same[case] &= len({metrics for _, metrics in found.values()}) == 1
            for name, (took, _) in found.items():
                if count > 0:  # the first one warms up
                    seconds[case][name].append(took)
    for build in builds.values():
        build.end()
    rows = []
    for case, (scenarios, seeds, _, _, mark) in CASES.items():
        before, now = (seconds[case][name] for name in ("before", "now"))
        ratios = sorted(a / b for a, b in zip(before, now, strict=True))
        step = 1e9 / (scenarios * seeds * STEPS)
        rows.append(
            f"| {case} | {step * min(before):.2f} | {step * min(now):.2f} | {min(before) / min(now):.2f} | "
            f"{statistics.median(ratios):.2f} | {ratios[0]:.2f} to {ratios[-1]:.2f} | {mark} | "
            f"{'the same' if same[case] else 'differ'} |"
        )
    lines = [
        "# Many runs, before and now",
        "",
        f"Made by `{command()}`, with lanes of {8 * builds['now'].lanes} bytes.",
        "",
        f"Machine: {machine()}.",
        "",
        f"Runs of {STEPS:,} steps of the paper's scenario, metrics only, by {options.against} and by this tree in",
        f"turn, {rounds} rounds. Nanoseconds of processor time for a step of a run (on two threads: of time), the",
        "least of all rounds; how many times as many runs a second: by these, and by neighbors. Bits: of all metrics.",
        "",
        "| | before | now | ratio | median of neighbors | range | mark | bits |",
        "|---|---|---|---|---|---|---|---|",
        *rows,
    ]
    write("batch", lines, keep=not options.quick)


if __name__ == "__main__":
    main()
