"""Many seeds by `measure_many` against windows of the kernel; writes benchmarks/results/batch_whole.md.

    python benchmarks/batch_whole.py [--quick]

A window is one register's runs of 2,000 steps that share their noise or have their own: no hand-over between tasks, no
Python, everything in the cache. All in turn, in one process.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import fracgyro as fg
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup
from fracgyro.simulation.many import at_most, threads_available
from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "python/fracgyro/simulation/measure.py"]

WINDOW = 2_000  # steps
MARK = 1.1


def seeded(scenario: fg.Scenario, seeds: int, count: int) -> list[_core.DeviceSetup]:
    found = []
    for n in range(count):
        setup = core_setup(scenario)
        setup.seed = n % seeds
        found.append(setup)
    return found


def runs(setups: list[_core.DeviceSetup], times: int = 1) -> None:
    params = _core.MetricsParams()
    for _ in range(times):
        _core.measure_runs(setups, params, 1, _core.lane_counts()[-1])


def many(scenario: fg.Scenario, seeds: int, jobs: int) -> None:
    with at_most(jobs):
        fg.measure_many([scenario], seeds=range(seeds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="64 seeds, once; not written")
    quick = parser.parse_args().quick
    seeds, repeats = (64, 1) if quick else (512, 5)
    paper, lanes, threads = fg.Scenario.paper(), _core.lane_counts()[-1], threads_available()
    window = paper.replace({"run.duration": WINDOW * paper.run.step})
    again = 200
    samples = paper.run.steps + 1
    shared, own = seeded(window, 1, lanes), seeded(window, lanes, lanes)
    whole = seeded(paper, seeds, seeds)
    cases: dict[str, tuple[int, Callable[[], object]]] = {
        "a window, the same noise in all lanes": (again * lanes * (WINDOW + 1), lambda: runs(shared, again)),
        "a window, a noise for each lane": (again * lanes * (WINDOW + 1), lambda: runs(own, again)),
        f"`_core.measure_runs`, {seeds} seeds": (seeds * samples, lambda: runs(whole)),
        f"`fg.measure_many`, {seeds} seeds, 1 thread": (seeds * samples, lambda: many(paper, seeds, 1)),
        f"`fg.measure_many`, {seeds} seeds, {threads} threads": (seeds * samples, lambda: many(paper, seeds, threads)),
    }
    least = dict.fromkeys(cases, float("inf"))
    many(paper, 8, threads)  # imports
    for _ in range(repeats):
        for name, (steps, act) in cases.items():
            begin = time.process_time()
            act()
            least[name] = min(least[name], 1e9 * (time.process_time() - begin) / steps)
    kernel = least["a window, a noise for each lane"]
    lines = [
        "# Many seeds against the kernel",
        "",
        f"Made with `{command()}`, with lanes of {8 * lanes} bytes.",
        "",
        f"Machine: {machine('xarray')}.",
        "",
        f"The paper's scenario; nanoseconds of processor time of the whole process for a step of a run, least of "
        f"{repeats}, in turn. A window has {WINDOW:,} steps, a run {samples:,}.",
        "",
        "| | ns a step and run | of a window with a noise for each lane |",
        "|---|---|---|",
        *(f"| {name} | {took:.1f} | {took / kernel:.2f} |" for name, took in least.items()),
        "",
        f"Mark: {MARK}. The two windows differ by the noise.",
    ]
    write("batch_whole", lines, keep=not quick)


if __name__ == "__main__":
    main()
