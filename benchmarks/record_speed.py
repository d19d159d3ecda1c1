"""Time and memory of `fracgyro allan` for ten million rows, next to allantools.

Writes benchmarks/results/record_speed.md.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["python/fracgyro/rate/of_record.py"]

ROWS = 10_000_000
REPEATS = 3
MEASURE = """
import resource, sys, time
began = time.perf_counter()
{work}
used = resource.getrusage(resource.RUSAGE_SELF)
print(time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
"""
WORK = {
    "`fracgyro allan`: reads, looks, fits": "from fracgyro.rate import analyze_record\n"
    "analyze_record(sys.argv[1], column='x')",
    "… with a report": "from fracgyro.rate import analyze_record\nanalyze_record(sys.argv[1], sys.argv[2], column='x')",
    "`fg.rate.inspect` of the array": "import numpy as np; from fracgyro.rate import inspect\n"
    "values = np.load(sys.argv[3]); inspect(values, 0.001)",
    "`fg.rate.allan` of the array": "import numpy as np; from fracgyro.rate import allan\n"
    "values = np.load(sys.argv[3]); allan(values, 0.001)",
    "allantools.oadev of the array, at the same times": "import numpy as np; import allantools\n"
    "values = np.load(sys.argv[3]); times = 1e-3 * 2.0 ** np.arange(20)\n"
    "allantools.oadev(values, rate=1e3, data_type='freq', taus=times)",
}


def measured(work: str, words: list[str]) -> tuple[float, float, float]:
    """Seconds by the clock, of processors, and MB at most."""
    ran = subprocess.run(
        [sys.executable, "-c", MEASURE.format(work=work), *words], check=True, capture_output=True, text=True
    )
    clock, processor, memory = map(float, ran.stdout.split())
    return clock, processor, memory


def main() -> None:
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        path, array = Path(folder) / "record.csv", Path(folder) / "record.npy"
        values = 1e-3 * rng.normal(size=ROWS)
        np.save(array, values)
        with path.open("w", encoding="utf-8") as file:
            file.write("time [s],x\n")
            for begin in range(0, ROWS, 100_000):
                part = values[begin : begin + 100_000]
                file.writelines(f"{1e-3 * (begin + i):.3f},{value:.8f}\n" for i, value in enumerate(part))
        size = path.stat().st_size / 1e6
        rows = {name: [] for name in WORK}
        for round_ in range(REPEATS):
            for name, work in WORK.items():
                out = str(Path(folder) / f"{len(rows[name])}-{round_}-{abs(hash(name))}")
                rows[name].append(measured(work, [str(path), out, str(array)]))
    lines = [
        "# Ten million rows",
        "",
        f"Made by `{command()}`. Machine: {machine()}.",
        "",
        f"White noise, {ROWS:,} rows with times, {size:.0f} MB of CSV. Each in a process of its own, imports included; "
        f"medians of {REPEATS}, in turn. Marks: 15 s and 1,000 MB.",
        "",
        "| | clock (s) | processors (s) | memory (MB) |",
        "|---" * 4 + "|",
    ]
    for name, found in rows.items():
        clock, processor, memory = np.median(found, axis=0)
        lines.append(f"| {name} | {clock:.1f} | {processor:.1f} | {memory:.0f} |")
    write("record_speed", lines)


if __name__ == "__main__":
    main()
