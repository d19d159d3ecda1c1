"""One run from Python, compared with the same run in C++; writes benchmarks/results/one_run.md."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import fracgyro as fg
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup
from machine import command, machine, on_one_core, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode"]

PAPER = fg.Scenario.paper()
SETUP = core_setup(PAPER)
RECORD = "C++ only, memory reused"
REUSED = "`fg.simulate`, memory reused"
FRESH = "`fg.simulate`, every result kept"
MEASURED = "`fg.measure_many` of the one run"
MARKS = {REUSED: 1.35, FRESH: 1.8}


def record() -> object:
    return _core.record_runs([SETUP], 1, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=25, help="each keeps two records of 19 MB")
    rounds = parser.parse_args().rounds
    on_one_core()
    seconds: dict[str, list[float]] = {RECORD: [], REUSED: [], FRESH: [], MEASURED: []}
    kept: list[object] = []

    def timed(name: str, task: Callable[[], object]) -> object:
        begin = time.perf_counter()
        made = task()
        seconds[name].append(time.perf_counter() - begin)
        return made

    for _ in range(rounds + 1):
        record()  # its memory serves the next two
        timed(RECORD, record)
        timed(REUSED, lambda: fg.simulate(PAPER))
        kept.append(record())  # takes that memory, so that there is none for the next
        kept.append(timed(FRESH, lambda: fg.simulate(PAPER)))
        timed(MEASURED, lambda: fg.measure_many([PAPER]))
    for times in seconds.values():
        del times[0]  # the first call includes one-time setup

    def row(name: str) -> str:
        times = seconds[name]
        ratios = sorted(one / alone for one, alone in zip(times, seconds[RECORD], strict=True))
        mark = f"at most {MARKS[name]}" if name in MARKS else "–"
        median, least, most = (1e3 * f(times) for f in (statistics.median, min, max))
        return (
            f"| {name} | {median:.2f} ms | {least:.2f} to {most:.2f} ms | {statistics.median(ratios):.2f} | "
            f"{ratios[0]:.2f} to {ratios[-1]:.2f} | {mark} |"
        )

    write(
        "one_run",
        [
            "# One run from Python\n",
            f"Made by `{command()}`.\n",
            f"Machine: {machine('xarray')}; on one core.\n",
            f"The paper's scenario, {PAPER.run.steps + 1:,} samples, noise drawn; all but the last keep every channel. "
            f"In turn, {rounds} rounds after one that does not count; ratios within a round.\n",
            "| | median | range | over C++ only | range | mark |",
            "|---|---|---|---|---|---|",
            *map(row, seconds),
        ],
    )


if __name__ == "__main__":
    main()
