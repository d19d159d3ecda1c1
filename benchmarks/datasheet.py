"""Time of the datasheet of three devices, whole and quick; writes benchmarks/results/datasheet.md.

python benchmarks/datasheet.py [--quick]
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from machine import ROOT, command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "lock_in", "python/fracgyro/rate/datasheet.py"]

EFFORTS: tuple[tuple[list[str], int], ...] = (([], 20), (["--quick"], 3))  # options, mark in minutes
FRACGYRO = [sys.executable, "-c", "from fracgyro.cli import main; main()"]
DEVICES = ("dual_mass", "dual_mass_volts", "tuned_in_air_volts")


def timed(device: str, options: list[str], folder: Path) -> tuple[float, float]:
    """Wall clock and processor time of all processes, minutes."""
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [*FRACGYRO, "datasheet", device, "--out", str(folder), *options]
    subprocess.run(words, cwd=ROOT, check=True, capture_output=True)
    took, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return took / 60, (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / 60


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one quick datasheet; not written")
    quick = parser.parse_args().quick
    busy = os.getloadavg()[0]
    rows, kept = [], True
    with tempfile.TemporaryDirectory() as room:
        for device in DEVICES[1:2] if quick else DEVICES:
            for options, mark in EFFORTS[1:] if quick else EFFORTS:
                took, processor = timed(device, options, Path(room) / f"{device}{''.join(options)}")
                kept = kept and took <= mark
                words = " ".join(["fracgyro datasheet", device, *options])
                rows.append(f"| `{words}` | {took:.1f} min | {processor:.1f} min | {mark} min |")
                print(rows[-1], flush=True)
    lines = [
        "# Time of a datasheet",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine('scipy')}; load average {busy:.1f} before, on {os.cpu_count()} processors.",
        "",
        "| command | time | processor time | mark |",
        "|---|---|---|---|",
        *rows,
        "",
        f"The marks are {'kept' if kept else 'missed'}.",
    ]
    write("datasheet", lines, keep=not quick)


if __name__ == "__main__":
    main()
