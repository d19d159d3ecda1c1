"""Runs a second of a sweep against the engine's own rate; writes benchmarks/results/study_rate.md.

    python benchmarks/study_rate.py [--quick]

All rows in one run, in turn. The engine's rate is that of `_core.measure_runs` with set-ups that exist already.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import fracgyro as fg
import sweep_scaling
from fracgyro import _core
from fracgyro.scenario.patched import Patch
from fracgyro.scenario.to_core import core_setup
from fracgyro.simulation.many import threads_available
from machine import command, machine, write

DEPENDS_ON = ["sliding_mode", "python/fracgyro/study/sweep/run.py", "python/fracgyro/scenario/patched.py"]

BASE = fg.Scenario.paper().replace({"run.duration": 1.0})
SWEEP = "a sweep, planned and run"
FIELDS = ["adaptation.rate_gain", "adaptation.stiffness_gain"]


def values(count: int) -> list[tuple[float, float]]:
    return [(50.0 + 250.0 * i / count, 300.0 - 250.0 * i / count) for i in range(count)]


def long_way(count: int) -> list[_core.DeviceSetup]:
    return [core_setup(BASE.replace(dict(zip(FIELDS, point, strict=True)))) for point in values(count)]


def patched(count: int) -> list[_core.DeviceSetup]:
    patch = Patch(BASE, FIELDS)
    return [patch.setup(point) for point in values(count)]


def engine(setups: list[_core.DeviceSetup]) -> None:
    params = _core.MetricsParams()
    params.transient = 0.5
    _core.measure_runs(setups, params, threads_available(), _core.lane_counts()[-1])


def swept(count: int) -> tuple[float, float]:
    """Wall clock and processor time of a sweep until its last run, s; its summary takes the same whatever its size."""
    marks: list[tuple[float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(sweep_scaling.study(count, 1, 1000), encoding="utf-8")
        begin = time.perf_counter(), time.process_time()
        fg.study.sweep(
            study,
            Path(folder) / "out",
            progress=lambda *_: marks.append((time.perf_counter() - begin[0], time.process_time() - begin[1])),
        )
    return marks[-1]


def times(act: Callable[[], object]) -> tuple[float, float]:
    """Wall clock and processor time, s."""
    wall, used = time.perf_counter(), time.process_time()
    act()
    return time.perf_counter() - wall, time.process_time() - used


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer runs, once; not written")
    quick = parser.parse_args().quick
    count, repeats = (2_000, 1) if quick else (20_000, 3)
    few = count // 10  # the long way is slow
    setups = patched(count)
    swept(10)
    parts: dict[str, tuple[int, Callable[[], object]]] = {
        "set-ups, the long way": (few, lambda: long_way(few)),
        "set-ups, patched": (count, lambda: patched(count)),
        "the engine": (count, lambda: engine(setups)),
    }
    runs = {name: each for name, (each, _) in parts.items()}
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in [*parts, SWEEP]}
    for _ in range(repeats):
        for name, (_, act) in parts.items():
            found[name].append(times(act))
        found[SWEEP].append(swept(count))
    least = {name: tuple(min(column) for column in zip(*each, strict=True)) for name, each in found.items()}
    per_run = {name: [1e6 * each / runs.get(name, count) for each in both] for name, both in least.items()}
    rate, sweep, long = (per_run[name][0] for name in ("the engine", SWEEP, "set-ups, the long way"))
    lines = [
        "# A sweep against the engine",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine('xarray', 'pyarrow')}; {threads_available()} threads.",
        "",
        f"{count:,} scenarios of {BASE.run.steps:,} steps that differ in two gains, a seed each; least of {repeats}. A "
        "sweep is timed until its last run.",
        "",
        "| | wall clock, us a run | processor time, us a run |",
        "|---|---|---|",
        *(f"| {name} | {wall:.1f} | {used:.1f} |" for name, (wall, used) in per_run.items()),
        "",
        f"By wall clock the sweep reaches {rate / sweep:.2f} of the engine's rate; with set-ups made the long way, "
        "twice as planning and running did, one after the other, it would be at most "
        f"{rate / (rate + 2 * long):.2f}.",
    ]
    write("study_rate", lines, keep=not quick)


if __name__ == "__main__":
    main()
