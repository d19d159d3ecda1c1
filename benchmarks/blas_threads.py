"""Processor time of the Allan fit with BLAS's own threads and with one; writes benchmarks/results/blas_threads.md.

    python benchmarks/blas_threads.py [--quick]

Each fit in a process of its own, in turn; more processor time with all threads than with one is threads that wait.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys

from machine import command, machine, write

DEPENDS_ON = ["python/fracgyro/rate/allan.py", "python/fracgyro/rate/noise_terms.py"]

CHILD = """
import json, sys, time
import numpy as np
import fracgyro as fg
noise = np.random.default_rng(0).normal(size=int(sys.argv[1])) * 0.002
fg.rate.allan(noise[:10_000], interval=0.01)
wall, used = time.perf_counter(), time.process_time()
fg.rate.allan(noise, interval=0.01)
print(json.dumps([time.perf_counter() - wall, time.process_time() - used]))
"""


def fitted(samples: int, threads: str | None) -> tuple[float, float]:
    """Wall-clock and processor time, s."""
    given = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    given |= {"OPENBLAS_NUM_THREADS": threads} if threads else {}
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(samples)], env=given, check=True, capture_output=True, text=True
    )
    wall, used = json.loads(done.stdout)
    return wall, used


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the samples, once; not written")
    quick = parser.parse_args().quick
    samples, repeats = (10**6, 1) if quick else (10**7, 3)
    found: dict[str | None, list[tuple[float, float]]] = {None: [], "1": []}
    for _ in range(repeats):
        for threads, times in found.items():
            times.append(fitted(samples, threads))
    lines = [
        "# Threads of BLAS in the Allan fit",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine()}.",
        "",
        f"`fracgyro.rate.allan` of {samples:,} samples of white noise, least of {repeats}.",
        "",
        "| threads of BLAS | wall clock | processor time |",
        "|---|---|---|",
    ]
    for threads, times in found.items():
        wall, used = (min(column) for column in zip(*times, strict=True))
        lines.append(f"| {threads or 'its own choice'} | {wall:.2f} s | {used:.2f} s |")
    write("blas_threads", lines, keep=not quick)


if __name__ == "__main__":
    main()
