"""Processor time of the Allan fit with BLAS's own threads and with one; writes benchmarks/results/blas_threads.md.

    python benchmarks/blas_threads.py [--quick]

Each fit in a process of its own, in turn, also with another process on each core; allantools at the same times. More
processor time with all threads than with one is threads that wait.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["python/fracgyro/rate/allan.py", "python/fracgyro/rate/noise_terms.py"]

CHILD = """
import json, sys, time
import numpy as np
{imported}
noise = np.random.default_rng(0).normal(size=int(sys.argv[1])) * 0.002
def work(noise):
    {work}
work(noise[:10_000])
wall, used = time.perf_counter(), time.process_time()
work(noise)
print(json.dumps([time.perf_counter() - wall, time.process_time() - used]))
"""
WORK = {
    "fg.rate.allan": ("import fracgyro as fg", "fg.rate.allan(noise, interval=0.01)"),
    "allantools.oadev": (
        "import allantools",
        "allantools.oadev(noise, rate=100.0, data_type='freq', taus=0.01 * 2.0 ** np.arange((len(noise) // 10)"
        ".bit_length()))",
    ),
}
CASES = [("fg.rate.allan", None), ("fg.rate.allan", "1"), ("allantools.oadev", None)]


def measured(name: str, samples: int, threads: str | None) -> tuple[float, float]:
    """Wall-clock and processor time, s."""
    imported, work = WORK[name]
    given = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    given |= {"OPENBLAS_NUM_THREADS": threads} if threads else {}
    words = [sys.executable, "-c", CHILD.format(imported=imported, work=work), str(samples)]
    wall, used = json.loads(subprocess.run(words, env=given, check=True, capture_output=True, text=True).stdout)
    return wall, used


@contextmanager
def busy(cores: int) -> Iterator[None]:
    """Context manager: `cores` processes that compute all the time."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(cores)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the samples, once; not written")
    quick = parser.parse_args().quick
    samples, repeats = (10**6, 1) if quick else (10**7, 2)
    cores = len(os.sched_getaffinity(0))
    rows, least = [], {}
    for others in (0, cores):
        found: dict[tuple[str, str | None], list[tuple[float, float]]] = {case: [] for case in CASES}
        with busy(others):
            for _ in range(repeats):
                for case, times in found.items():
                    times.append(measured(case[0], samples, case[1]))
        for (name, threads), times in found.items():
            wall, used = (min(column) for column in zip(*times, strict=True))
            least[name, threads, others] = used
            rows.append(f"| {others} | `{name}` | {threads or 'its own choice'} | {wall:.2f} s | {used:.2f} s |")
    shares = [least[(*CASES[0], others)] / least[(*CASES[2], others)] for others in (0, cores)]
    lines = [
        "# Threads of BLAS in the Allan fit",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine('allantools')}.",
        "",
        f"{samples:,} samples of white noise, in memory; averaging times of powers of 2 up to a tenth of the record. "
        f"Least of {repeats}. `fg.rate.allan` also looks for events, estimates the spectrum and fits the noise terms.",
        "",
        "| other processes that compute | | threads of BLAS | wall clock | processor time |",
        "|---|---|---|---|---|",
        *rows,
        "",
        f"Of allantools' processor time `fg.rate.allan` takes {shares[0]:.2f}, and {shares[1]:.2f} with another "
        "process on each core.",
    ]
    write("blas_threads", lines, keep=not quick)


if __name__ == "__main__":
    main()
