"""Time and memory of a sweep of many runs, also on a cluster; writes benchmarks/results/sweep_scaling.md.

    python benchmarks/sweep_scaling.py [--quick]

Each sweep in a process of its own, whose peak memory is read when it ends.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fracgyro.study.cluster import TASK
from fracgyro.study.sweep.blocks import MAX_BLOCKS
from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "python/fracgyro/study/sweep/run.py"]

# Points: with quantiles in the summary, and without.
POINTS, WITHOUT, SEEDS = (1_000, 10_000), (1_000, 10_000, 100_000), 10
STEPS = 100
REPEATS = 3
FAR = 10**9  # runs
MACHINES = 1_000
PER_SECOND = 500  # tasks that a scheduler of Dask starts, assumed
SIMULATED = 50_000  # tasks of a simulated cluster, at most
CORES = 64  # cores of the larger machines
LONG = 80_001  # samples of the paper's run


def study(points: int, seeds: int, steps: int, quantiles: bool = True) -> str:
    return f"""seeds = {seeds}
quantiles = {str(quantiles).lower()}
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
    from fracgyro.study.sweep.block_files import BlockFiles

    runs = Path(folder) / "out" / "runs"
    write, writing = BlockFiles.write, [0.0]

    def timed(*words: Any) -> None:
        start = time.perf_counter()
        write(*words)
        writing[0] += time.perf_counter() - start

    BlockFiles.write = timed
    seen: list[int] = []  # bytes in the folder while it runs
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.05):
            seen.append(sum(entry.stat().st_size for entry in runs.glob("block-*")))

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
                "writing": writing[0],
            }
        )
    )


@dataclass(frozen=True)
class Took:
    runs: int
    found: list[dict[str, Any]]

    def median(self, what: str) -> float:
        return statistics.median(each[what] for each in self.found)


def swept(
    points: int, seeds: int, steps: int, repeats: int, scheduler: str | None = None, quantiles: bool = True
) -> Took:
    found = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "study.toml").write_text(study(points, seeds, steps, quantiles), encoding="utf-8")
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


def simulated(tasks: int, machines: int, seconds: float, client: float) -> float:
    """Time of `tasks` tasks of `seconds` each, s, if the scheduler starts PER_SECOND and the client keeps their rows.

    A machine has one task under way and one that waits; the client submits another when it has kept a result, which
    takes it `client` s.
    """
    scheduled, kept = 0.0, 0.0  # until when each is busy
    queues = [deque[float]() for _ in range(machines)]  # when the tasks that wait there arrived
    events: list[tuple[float, int]] = []
    left = tasks
    for round_ in range(2):
        for machine_ in range(min(machines, left)):
            scheduled += 1 / PER_SECOND
            left -= 1
            if round_ == 0:
                heapq.heappush(events, (scheduled + seconds, machine_))
            else:
                queues[machine_].append(scheduled)
    idle: dict[int, float] = {}
    while events:
        now, machine_ = heapq.heappop(events)
        if queues[machine_]:
            heapq.heappush(events, (max(now, queues[machine_].popleft()) + seconds, machine_))
        else:
            idle[machine_] = now
        kept = max(kept, now) + client
        if left:
            left -= 1
            scheduled = max(scheduled, kept) + 1 / PER_SECOND
            if machine_ in idle:
                del idle[machine_]
                heapq.heappush(events, (scheduled + seconds, machine_))
            else:
                queues[machine_].append(scheduled)
    return kept


def plan_row(name: str, runs: int, rate: float, client: float) -> str:
    """A row of the plan: tasks of `runs` runs, on machines of `rate` runs a second; `client`: s a run."""
    tasks = min(-(-FAR // runs), SIMULATED)
    took = simulated(tasks, MACHINES, runs / rate, client * runs) * FAR / (tasks * runs)
    least = FAR / (MACHINES * rate)
    return (
        f"| {name} | {runs:,} | {runs / rate:.2f} s | {MACHINES * rate / runs:,.0f} | {took / 60:,.1f} min | "
        f"{least / took:.2f} |"
    )


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
    sizes = [(True, swept(points, SEEDS, STEPS, repeats)) for points in POINTS]
    for points in WITHOUT[:-1] if options.quick else WITHOUT:
        sizes.append((False, swept(points, SEEDS, STEPS, 1 if points > 10_000 else repeats, quantiles=False)))
    lines = [
        "# Sweeps of many runs",
        "",
        f"Made by `make bench`, with `{command()}`.",
        "",
        f"Machine: {machine('xarray', 'pyarrow', 'distributed')}.",
        "",
        f"`fracgyro.study.sweep` of points at random, {SEEDS} seeds each, {STEPS:,} steps a run, all metrics; each in "
        f"a process of its own, median of {repeats}, the largest once. Planning checks every point before anything "
        "runs. Peak memory is that of the process, Python and its libraries included. Without quantiles the summary "
        "reads only the metadata of the blocks.",
        "",
        "| runs | quantiles | planning | runs a second then | whole sweep | peak memory | rows on disk |",
        "|---|---|---|---|---|---|---|",
    ]
    for quantiles, took in sizes:
        lines.append(
            f"| {took.runs:,} | {'yes' if quantiles else 'no'} | {took.median('planned'):.2f} s | "
            f"{took.runs / took.median('measured'):,.0f} | {took.median('seconds'):.2f} s | "
            f"{took.median('peak') / 1e6:.0f} MB | {took.median('size') / 1e6:.2f} MB |"
        )
    few, many = [took for quantiles, took in sizes if not quantiles][-2:]
    with_few, with_many = (took for quantiles, took in sizes if quantiles)
    growth = [
        (large.median("peak") - small.median("peak")) / (large.runs - small.runs)
        for small, large in ((few, many), (with_few, with_many))
    ]
    row = many.median("size") / many.runs
    lines += [
        "",
        f"From {few.runs:,} to {many.runs:,} runs memory grows by {growth[0]:.1f} bytes a run without quantiles, "
        f"and from {with_few.runs:,} to {with_many.runs:,} by {growth[1]:.0f} with them. Rows are written while the "
        f"sweep runs: of the looks at the folder every 50 ms {many.median('while running'):.0%} found some.",
    ]
    counts = sorted({1, len(os.sched_getaffinity(0))})
    there = [on_cluster(workers, 200, SEEDS, 20_000, 1) for workers in counts]
    here = swept(200, SEEDS, 20_000, 1)
    lines += [
        "",
        "## On a cluster",
        "",
        f"{here.runs:,} runs of 20,000 steps, once, by processes of Dask on this machine; a worker uses all processors "
        "for a block.",
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
    best = rate * max(here.median("measured") / took.median("measured") for took in there)
    client = many.median("writing") / many.runs
    large = best * CORES / len(os.sched_getaffinity(0))
    old, now = 2 * 10**7 // LONG, FAR // MAX_BLOCKS
    lines += [
        "",
        f"## {FAR:,} runs on {MACHINES:,} machines",
        "",
        f"Of the paper's {LONG:,} samples: a machine as this one does {best:.0f} of them a second as a worker, one "
        f"with {CORES} such cores {large:,.0f} if they share nothing. Simulated with one worker a machine, a scheduler "
        f"that starts {PER_SECOND} tasks a second, and this client, which takes {1e6 * client:.1f} us to keep a row. "
        f"Of at most {SIMULATED:,} tasks, the rest in proportion.",
        "",
        "| machines and tasks | runs a task | time of a task | tasks a second, if none waited | time | part of the "
        "machines' rate |",
        "|---|---|---|---|---|---|",
        plan_row("as this one, blocks of 2·10⁷ steps, each a task", old, best, client),
        plan_row(f"as this one, at most {MAX_BLOCKS:,} blocks, each a task", now, best, client),
        plan_row("the same, if workers wrote the rows", now, best, 0.0),
        plan_row(f"{CORES} cores, blocks of 2·10⁷ steps, each a task", old, large, 0.0),
        plan_row(f"{CORES} cores, at most {MAX_BLOCKS:,} blocks, each a task, workers write", now, large, 0.0),
        plan_row(f"{CORES} cores, tasks of {TASK:g} s, workers write", int(TASK * large), large, 0.0),
        "",
        f"Such a study has {MAX_BLOCKS:,} blocks of {now:,} runs, and a task has as many blocks as take "
        f"{TASK:g} s. Its rows are {FAR * row / 1e9:.0f} GB, {MACHINES * best * row / 1e6:.0f} MB a second: all go "
        f"through the client, which keeps {row / client / 1e6:.0f} MB a second. A study has at most a million points, "
        "each with up to a million seeds.",
    ]
    write("sweep_scaling", lines, keep=not options.quick)


if __name__ == "__main__":
    main()
