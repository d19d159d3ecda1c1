"""Cost of lanes without fused multiply-adds; writes benchmarks/results/lane_contraction.md.

Studies' lanes for AVX2 and AVX-512, each compiled as it is shipped and with contraction, timed in turn.
"""

from __future__ import annotations

import statistics
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "composite", "bindings/lanes_*.cpp", "benchmarks/benchmark_lanes.cpp"]

ROOT = Path(__file__).resolve().parent.parent
FLAGS = ["-std=c++20", "-O3", "-DNDEBUG", "-fno-math-errno", "-fno-trapping-math", "-Wno-psabi", "-fno-tree-pre"]
FLAGS += ["-fno-gcse", f"-I{ROOT / 'include'}"]
AVX512 = ["-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512"]
KINDS = {
    "avx2": ["-mavx2", "-mmove-max=256", "-mstore-max=256"],
    "avx512": [*AVX512, "-mmove-max=512", "-mstore-max=512"],
}
CONTRACTION = {"off": ["-ffp-contract=off"], "fast": ["-ffp-contract=fast", "-mfma"]}
CASES = ["the paper's", "c = 0.7", "composite, c = 0.7"]
ROUNDS = 9


def compile_all(folder: Path) -> None:
    def compiled(words: list[str]) -> None:
        subprocess.run(["g++", *FLAGS, *words], check=True, cwd=folder)

    jobs = [
        [*KINDS[kind], *CONTRACTION[mode], "-c", str(ROOT / f"bindings/lanes_{kind}.cpp"), "-o", f"{kind}-{mode}.o"]
        for kind in KINDS
        for mode in CONTRACTION
    ]
    source = str(ROOT / "benchmarks/benchmark_lanes.cpp")
    jobs.append(["-ffp-contract=off", "-c", source, "-o", "main.o"])
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(compiled, jobs))
    for mode in CONTRACTION:
        compiled(["main.o", *(f"{kind}-{mode}.o" for kind in KINDS), "-o", mode])


def main() -> None:
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        compile_all(folder)
        for bytes_, kind in ((32, "AVX2"), (64, "AVX-512")):
            for number in ("double", "float"):
                for case, what in enumerate(CASES):
                    words = [str(bytes_), number, str(case)]
                    times: dict[str, list[float]] = {mode: [] for mode in CONTRACTION}
                    for _ in range(ROUNDS):
                        for mode, seen in times.items():
                            ran = subprocess.run([folder / mode, *words], check=True, capture_output=True, text=True)
                            seen.append(float(ran.stdout))
                    off, fast = (statistics.median(times[mode]) for mode in ("off", "fast"))
                    ratios = statistics.median(a / b for a, b in zip(times["off"], times["fast"], strict=True))
                    rows.append(f"| {kind} | {number} | {what} | {off:.1f} | {fast:.1f} | {ratios:.2f} |")
    lines = [
        "# Lanes without fused operations",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine()}.",
        "",
        "Processor time of a run's step, ns, in lanes as they are shipped (a product and a sum are two operations, so",
        "that all processors and single runs have the same bits) and with contraction. 32 runs of 20,000 steps with",
        f"the same noise, metrics only, on one thread; medians of {ROUNDS} runs of each program in turn, the ratio",
        "that of neighbours.",
        "",
        "| registers | number | controller | shipped | fused | ratio |",
        "|---|---|---|---|---|---|",
        *rows,
    ]
    write("lane_contraction", lines)


if __name__ == "__main__":
    main()
