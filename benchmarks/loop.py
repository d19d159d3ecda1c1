"""Times the closed loop and its usual alternatives in one run; writes benchmarks/results/loop.md.

    python benchmarks/loop.py [--repeats N]

The paper's 80 units of time at h = 1e-3: 80,001 samples, noise redrawn every step, every channel recorded.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
from fracgyro import modes
from machine import machine, write
from peers.full_history import arguments, full_history

ROOT = Path(__file__).resolve().parent.parent
STEPS, STEP, ORDER, TOLERANCE = 80_000, 1e-3, 0.9, 1e-6
MARK = 8e-3  # seconds


def build(folder: Path) -> Path:
    """The C++ benchmark, with the flags of CMakeLists.txt."""
    options = ["-DFRACGYRO_PYTHON=OFF", "-DFRACGYRO_BENCHMARKS=ON", "-DCMAKE_BUILD_TYPE=Release"]
    for command in (["cmake", "-S", ROOT, "-B", folder, *options], ["cmake", "--build", folder]):
        subprocess.run([str(word) for word in command], check=True, capture_output=True)
    return folder / "benchmark_loop"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, help="rounds; NumPy, which takes long, runs in the first 3")
    repeats = parser.parse_args().repeats

    designed = modes.design(ORDER, STEP, STEPS * STEP, TOLERANCE)
    text = f"{designed.count}\n" + "\n".join(
        f"{s!r} {w!r}" for s, w in zip(designed.rates.tolist(), designed.weights.tolist(), strict=True)
    )
    noise = np.random.default_rng(0).standard_normal((STEPS + 1, 2))
    sums = arguments(STEPS, STEP, ORDER)
    compiled = numba.njit(full_history)
    compiled(10, STEP, noise, *arguments(10, STEP, ORDER))

    def timed(function: Callable[..., np.ndarray]) -> float:
        start = time.perf_counter()
        positions = function(STEPS, STEP, noise, *sums)
        seconds = time.perf_counter() - start
        assert abs(positions[-1, 0]) < 1e-2, "the peer must track the reference"  # also fails for NaN
        return seconds

    with tempfile.TemporaryDirectory() as scratch:
        program = build(Path(scratch))

        def core(key: str) -> float:
            best = [
                json.loads(subprocess.run([program], input=text, text=True, capture_output=True, check=True).stdout)[
                    key
                ]
                for _ in range(9)
            ]
            return statistics.median(best)

        rows: dict[str, list[float]] = {
            "fracgyro core, C++": [],
            "numba, full history": [],
            "NumPy, full history": [],
        }
        for round_number in range(repeats):
            rows["fracgyro core, C++"].append(core("seconds"))
            rows["numba, full history"].append(timed(compiled))
            if round_number < 3:
                rows["NumPy, full history"].append(timed(full_history))
            rows["fracgyro core, C++"].append(core("seconds"))
            print(f"round {round_number + 1} of {repeats} done", file=sys.stderr)

    ours = statistics.median(rows["fracgyro core, C++"])
    lines = [
        "# The closed loop, timed",
        "",
        "Made by `make bench`. Wall-clock seconds of one run of 80 units of time at h = 1e-3 (80,001 steps), noise",
        "redrawn every step, every channel recorded, one thread. All in one process tree, interleaved. Machines like",
        "this one are shared: compare the ratios.",
        "",
        f"Machine: {machine()}; numba {numba.__version__}.",
        f"Operator: {designed.count} exponential modes, certified relative error {designed.error:.1e}.",
        "",
        "| | median | per step | range | repeats | times ours |",
        "|---|---|---|---|---|---|",
    ]
    for name, seconds in rows.items():
        median = statistics.median(seconds)
        lines.append(
            f"| {name} | {median:.4g} s | {median / (STEPS + 1) * 1e9:.4g} ns | {min(seconds):.4g} to "
            f"{max(seconds):.4g} s | {len(seconds)} | {median / ours:,.0f} |"
        )
    lines += [
        "",
        f"Mark: at most {MARK * 1e3:g} ms a run ({MARK / (STEPS + 1) * 1e9:.0f} ns a step): "
        f"{'met' if ours <= MARK else 'missed'} with the median of {ours * 1e3:.2f} ms; least "
        f"{min(rows['fracgyro core, C++']) * 1e3:.2f} ms. Each of our repeats is itself the median of nine processes.",
    ]
    write("loop", lines)


if __name__ == "__main__":
    main()
