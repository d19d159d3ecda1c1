"""Time of an entry of the board, from the command to the file; writes benchmarks/results/board_entry.md.

python benchmarks/board_entry.py [--quick]
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
DEPENDS_ON = ["sliding_mode", "lab/fracgyro_lab/board/*.py"]

MARK = 120  # s
FRACGYRO = [sys.executable, "-c", "from fracgyro.cli import main; main()"]
LAWS = [["pid"], ["paper"], ["paper", "--class", "P"], ["lab/board/pid_in_python.py"]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the first law; not written")
    quick = parser.parse_args().quick
    rows, longest = [], 0.0
    for law in LAWS[:1] if quick else LAWS:
        with tempfile.TemporaryDirectory() as folder:
            begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
            out = Path(folder) / "entry.json"
            subprocess.run([*FRACGYRO, "enter", *law, "--out", str(out)], cwd=ROOT, check=True, capture_output=True)
            took, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        longest = max(longest, took)
        rows.append(f"| `fracgyro enter {' '.join(law)}` | {took:.0f} s | {processor:.0f} s |")
    lines = [
        "# An entry of the board",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine()}; {os.cpu_count()} processors.",
        "",
        "From the command to the file, with the search.",
        "",
        "| command | time | processor time |",
        "|---|---|---|",
        *rows,
        "",
        f"The mark of {MARK} s is {'kept' if longest <= MARK else 'missed'}.",
    ]
    write("board_entry", lines, keep=not quick)


if __name__ == "__main__":
    main()
