"""Time and memory of a sweep of many runs, also on a cluster; writes benchmarks/results/sweep_scaling.md.

    python benchmarks/sweep_scaling.py [--quick]

Each sweep in a process of its own, whose peak memory is read when it ends.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from machine import command, machine, write

DEPENDS_ON = ["sliding_mode", "python/fracgyro/study/sweep/run.py"]

POINTS, SEEDS = (100, 1_000, 10_000), 10
STEPS = 1_000
REPEATS = 3
FAR = 10**9  # runs
MACHINES = 1_000
LONG = 80_001  # samples of the paper's run


def study(points: int, seeds: int, steps: int) -> str:
    return f"""seeds = {seeds}
[fixed]
run.duration = {steps * 1e-3}
[metrics]
transient = {steps * 0.5e-3}
[design]
kind = "random"
points = {points}
[vary]
adaptation.rate_gain = {{ low = 50.0, high = 300.0 }}
adaptation.stiffness_gain = {{ low = 50.0, high = 300.0 }}
"""


def child(folder: str, scheduler: str | None) -> None:
    """One sweep, as a process: prints what it took."""
    import resource

    import fracgyro as fg

    runs = Path(folder) / "out" / "runs"
    seen: list[int] = []  # bytes in the folder while it runs
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.05):
            seen.append(sum(entry.stat().st_size for entry in runs.iterdir()) if runs.is_dir() else 0)

    threading.Thread(target=watch, daemon=True).start()
    begin, marks = time.perf_counter(), []
    kept = {"scheduler": scheduler} if scheduler else {}
    found = fg.study.sweep(
        Path(folder) / "study.toml",
        Path(folder) / "out",
        progress=lambda done, _: marks.append((time.perf_counter() - begin, done)),
        **kept,
    )
    over.set()
    print(
        json.dumps(
            {
                "seconds": found.seconds,
                "planned": marks[0][0],
                "measured": marks[-1][0] - marks[0][0],
                "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
                "size": sum(entry.stat().st_size for entry in runs.iterdir()),
                "while running": sum(size > 0 for size in seen) / max(len(seen), 1),
            }
        )
    )


@dataclass(frozen=True)
class Took:
    runs: int
    found: list[dict[str, Any]]

    def median(self, what: str) -> float:
        return statistics.median(each[what] for each in self.found)


def swept(points: int, seeds: int, steps: int, repeats: int, scheduler: str | None = None) -> Took:
    found = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "study.toml").write_text(study(points, seeds, steps), encoding="utf-8")
            words = [sys.executable, __file__, "--child", folder, *(["--scheduler", scheduler] if scheduler else [])]
            done = subprocess.run(words, check=True, capture_output=True, text=True)
            found.append(json.loads(done.stdout.splitlines()[-1]))
    print(f"{points * seeds:,} runs of {steps} steps: {found}", file=sys.stderr, flush=True)
    return Took(points * seeds, found)


def on_cluster(workers: int, points: int, seeds: int, steps: int, repeats: int) -> Took:
    """Workers are processes of this machine with one thread each; Dask lets each have all processors."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        return swept(points, seeds, steps, repeats, cluster.scheduler_address)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="once, and not the most runs; not written")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--scheduler", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.child, options.scheduler)
        return
    repeats = 1 if options.quick else REPEATS
    sizes = [swept(points, SEEDS, STEPS, repeats) for points in (POINTS[:-1] if options.quick else POINTS)]
    lines = [
        "# Sweeps of many runs",
        "",
        f"Made by `make bench`, with `{command()}`.",
        "",
        f"Machine: {machine('xarray', 'pyarrow', 'distributed')}.",
        "",
        f"`fracgyro.study.sweep` of points at random, {SEEDS} seeds each, {STEPS:,} steps a run, all metrics; "
        f"each in a "
        f"process of its own, median of {repeats}. Planning checks every point before anything runs. Peak "
        f"memory is that "
        "of the process, Python and its libraries included.",
        "",
        "| runs | planning | runs a second then | whole sweep | peak memory | rows on disk |",
        "|---|---|---|---|---|---|",
    ]
    for took in sizes:
        lines.append(
            f"| {took.runs:,} | {took.median('planned'):.2f} s | {took.runs / took.median('measured'):,.0f} | "
            f"{took.median('seconds'):.2f} s | {took.median('peak') / 1e6:.0f} MB | "
            f"{took.median('size') / 1e6:.2f} MB |"
        )
    few, many = sizes[-2:]
    growth = (many.median("peak") - few.median("peak")) / (many.runs - few.runs)
    row = many.median("size") / many.runs
    share = many.median("while running")
    lines += [
        "",
        f"From {few.runs:,} to {many.runs:,} runs memory grows by {growth:.0f} bytes a run, which are the "
        f"points, and the "
        f"columns that the summary shows; a million runs take {(few.median('peak') + growth * 1e6) / 1e6:.0f} MB. Rows "
        f"are written while the sweep runs: of the looks at the folder every 50 ms {share:.0%} found some.",
    ]
    counts = sorted({1, len(os.sched_getaffinity(0))})
    there = [on_cluster(workers, 200, SEEDS, 20_000, repeats) for workers in counts]
    here = swept(200, SEEDS, 20_000, repeats)
    lines += [
        "",
        "## On a cluster",
        "",
        f"{here.runs:,} runs of 20,000 steps, by processes of Dask on this machine; a worker uses all processors for a "
        "block.",
        "",
        "| | runs a second | of that without a cluster |",
        "|---|---|---|",
        f"| this process, no cluster | {here.runs / here.median('measured'):,.0f} | 1 |",
    ]
    for workers, took in zip(counts, there, strict=True):
        part = here.median("measured") / took.median("measured")
        lines.append(
            f"| {workers} worker{'s' * (workers > 1)} | {took.runs / took.median('measured'):,.0f} | {part:.2f} |"
        )
    rate = 20_000 / LONG * here.runs / here.median("measured")
    best = max(here.median("measured") / took.median("measured") for took in there)
    hours = FAR / (MACHINES * rate * best) / 3600
    lines += [
        "",
        f"## {FAR:,} runs on {MACHINES:,} machines",
        "",
        f"Of the paper's {LONG:,} samples: a machine as this one does {rate:.0f} of them a second by itself and "
        f"{rate * best:.0f} as a worker, so {MACHINES:,} take {hours:.1f} hours, if each is as fast as this one and "
        f"has work all the time. Its rows are {FAR * row / 1e9:.0f} GB, {MACHINES * rate * best * row / 1e6:.0f} MB a "
        "second, which one disk takes.",
        "",
        f"That is not to be had as it is: at 250 runs a block {MACHINES * rate * best / 250:,.0f} blocks would finish "
        "a second, and a scheduler of Dask gives out some thousand tasks a second (not measured here), so that blocks "
        "would have to be several times larger. A study has at most a million points, each with up to a million seeds, "
        "and one process checks them before it starts.",
    ]
    write("sweep_scaling", lines, keep=not options.quick)


if __name__ == "__main__":
    main()
