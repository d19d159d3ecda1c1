"""How the time of a run grows with steps, exponentials, runs, threads; writes benchmarks/results/scaling.{md,svg,png}.

    python benchmarks/scaling.py [--quick]

Only the public Python interface, so that the time to set a run up and to make the result is in it.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import fracgyro as fg
import matplotlib
import numpy as np
from fracgyro.analysis.style import LETTERS, save_svg
from machine import RESULTS, command, machine, write

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode"]

STEP = 1e-3
STEPS = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
TOLERANCES = tuple(10.0**-n for n in range(2, 10))
RUNS = (1, 4, 16, 64, 256, 1024, 4096)
FEW_STEPS = 10_000  # steps of each run if there are many runs
RUNS_PER_THREADS = 64


@dataclass
class Series:
    """One panel: seconds against `at`."""

    title: str
    axis: str
    at: list[float] = field(default_factory=list)
    seconds: list[list[float]] = field(default_factory=list)
    processors: list[list[float]] = field(default_factory=list)  # processor time over wall-clock time
    slope_from: float = 0.0  # the slope is fitted from here on

    @property
    def medians(self) -> np.ndarray:
        return np.array([statistics.median(s) for s in self.seconds])

    def slope(self) -> float:
        """Least-squares slope of log time against log `at`."""
        x = np.array(self.at)
        used = x >= self.slope_from
        return float(np.polyfit(np.log(x[used]), np.log(self.medians[used]), 1)[0]) if used.sum() > 1 else math.nan


def scenario(steps: int, tolerance: float = 1e-6) -> fg.Scenario:
    changes = {"run.duration": steps * STEP, "run.step": STEP, "run.kernel_tolerance": tolerance}
    return fg.Scenario.paper().replace(changes)


def interleaved(series: Series, tasks: list[tuple[float, Callable[[], object]]], rounds: int) -> Series:
    """Times every task once a round, after a first call that counts for nothing."""
    for at, task in tasks:
        task()
        series.at.append(at)
        series.seconds.append([])
        series.processors.append([])
    for _ in range(rounds):
        for (_, task), seconds, processors in zip(tasks, series.seconds, series.processors, strict=True):
            start, used = time.perf_counter(), time.process_time()
            task()
            seconds.append(time.perf_counter() - start)
            processors.append((time.process_time() - used) / seconds[-1])
    print(f"{series.title}: done", file=sys.stderr, flush=True)
    return series


def measure(one: fg.Scenario, runs: int) -> object:
    return fg.measure_many([one], seeds=list(range(runs)))


def on(processors: set[int], task: Callable[[], object]) -> object:
    """`task` on these processors only; simulate_many starts as many threads."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, processors)
    try:
        return task()
    finally:
        os.sched_setaffinity(0, before)


def steps_panel(rounds: int, most: int) -> Series:
    series = Series("one run, every channel recorded", "steps", slope_from=10_000)
    scenarios = {n: scenario(n) for n in STEPS if n <= most}
    tasks = [(n, lambda one=one: fg.simulate(one)) for n, one in scenarios.items()]
    return interleaved(series, tasks, rounds)


def modes_panel(rounds: int) -> Series:
    series = Series("one run of 80,000 steps", "exponentials (tolerance 1e-2 to 1e-9)")
    tasks = []
    for tolerance in TOLERANCES:
        one = scenario(80_000, tolerance)
        count = fg.fractional.design(one.controller.order, STEP, one.run.duration, tolerance).count
        tasks.append((count, lambda one=one: fg.measure_many([one])))
    return interleaved(series, tasks, rounds)


def runs_panel(rounds: int, most: int) -> Series:
    series = Series(f"many runs of {FEW_STEPS:,} steps, metrics only, all threads", "runs", slope_from=16)
    one = scenario(FEW_STEPS)
    return interleaved(series, [(n, lambda n=n: measure(one, n)) for n in RUNS if n <= most], rounds)


def threads_panel(rounds: int) -> Series:
    series = Series(f"{RUNS_PER_THREADS} runs of {FEW_STEPS:,} steps, metrics only", "threads")
    one = scenario(FEW_STEPS)
    available = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    counts = sorted({2**k for k in range(len(available).bit_length()) if 2**k <= len(available)} | {len(available)})
    tasks = [
        (n, lambda n=n: on(set(available[:n]), lambda: measure(one, RUNS_PER_THREADS))) for n in counts if available
    ]
    return interleaved(series, tasks, rounds)


def draw(panels: list[Series]) -> None:
    plt.rcParams.update(LETTERS)
    figure, axes = plt.subplots(2, 2, figsize=(10, 7.5), layout="constrained")
    for axis, series in zip(axes.flat, panels, strict=True):
        x, median = np.array(series.at), 1e3 * series.medians
        low, high = (1e3 * np.array([f(s) for s in series.seconds]) for f in (min, max))
        axis.fill_between(x, low, high, alpha=0.25, linewidth=0, label="range")
        axis.loglog(x, median, "o-", markersize=4, label=f"median, slope {series.slope():.2f}")
        if series.axis == "threads":
            axis.loglog(x, median[0] / x, "k:", linewidth=1, label="ideal, slope -1")
        elif not series.axis.startswith("exponential"):
            axis.loglog(x, median[-1] * x / x[-1], "k:", linewidth=1, label="proportional, slope 1")
        if series.axis == "threads" or series.axis.startswith("exponential"):
            axis.set_xticks(x, [f"{n:g}" for n in x])
            axis.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        if high.max() < 10 * low.min():
            spread = [n * 10.0**p for p in range(-3, 6) for n in (1, 1.5, 2, 3, 4, 5, 6, 8)]
            least, most = 0.8 * low.min(), 1.2 * high.max()
            inside = [v for v in spread if least <= v <= most]
            axis.set_ylim(least, most)
            axis.set_yticks(inside, [f"{v:g}" for v in inside])
            axis.yaxis.set_minor_locator(matplotlib.ticker.NullLocator())
        axis.set_xlabel(series.axis)
        axis.set_ylabel("time in ms")
        axis.set_title(series.title, fontsize=10)
        axis.grid(True, which="major", alpha=0.3)
        axis.legend(fontsize=8)
    save_svg(figure, RESULTS / "scaling.svg", "Time of runs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="two rounds, up to 100,000 steps and 64 runs; not written")
    options = parser.parse_args()
    rounds = 2 if options.quick else 5
    panels = [
        steps_panel(rounds, 100_000 if options.quick else STEPS[-1]),
        modes_panel(rounds),
        runs_panel(rounds, 64 if options.quick else RUNS[-1]),
        threads_panel(rounds),
    ]
    lines = [
        "# How the time grows",
        "",
        f"Made by `make bench`, with `{command()}`. Drawn in [scaling.svg](scaling.svg).",
        "",
        f"Machine: {machine('matplotlib')}.",
        "",
        "Through the public Python interface, set-up and results included; double precision, h = 1e-3. Median and",
        f"range of {rounds} interleaved rounds after one that does not count. Slope: of log time against log of the",
        "first column. Processors: processor time over wall-clock time, median. Where it is clearly below the number",
        "of threads (1 for one run), others had the machine or threads waited: that row says little about the engine.",
    ]
    for series in panels:
        since = f", from {series.slope_from:g} on" if series.slope_from else ""
        lines += [
            "",
            f"## {series.title[0].upper()}{series.title[1:]}",
            "",
            f"Slope {series.slope():.2f}{since}.",
            "",
            f"| {series.axis} | median | range | per unit | processors |",
            "|---|---|---|---|---|",
        ]
        for at, seconds, had in zip(series.at, series.seconds, series.processors, strict=True):
            median = statistics.median(seconds)
            lines.append(
                f"| {at:,.0f} | {median * 1e3:.4g} ms | {min(seconds) * 1e3:.4g} to {max(seconds) * 1e3:.4g} ms | "
                f"{median / at * 1e6:,.4g} µs | {statistics.median(had):.2f} |"
            )
    if not options.quick:
        draw(panels)
    write("scaling", lines, keep=not options.quick)


if __name__ == "__main__":
    main()
