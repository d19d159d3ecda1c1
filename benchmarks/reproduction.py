"""Run the full and the quick reproduction, and record the verdicts; writes benchmarks/results/reproduction.md."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from machine import machine, write

DEPENDS_ON = ["sliding_mode", "lab/fracgyro_lab/paper/reproduce.py"]


def reproduce(folder: str, *options: str) -> float:
    """Wall-clock seconds of the whole command."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "fracgyro", "reproduce", "--out", folder, *options], check=True, capture_output=True
    )
    return time.perf_counter() - start


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        short = reproduce(folder, "--quick")
        whole = reproduce(folder)
        claims = json.loads((Path(folder) / "claims.json").read_text(encoding="utf-8"))
    lines = [
        "# The reproduction: time and verdicts",
        "",
        "Made by `make bench`.",
        "",
        f"Machine: {machine()}.",
        "",
        f"`fracgyro reproduce` took {whole:.0f} s, `fracgyro reproduce --quick` {short:.1f} s, start of Python "
        "included.",
        "",
        "| | claim | variant | verdict | evidence |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {c['id']} | {c['claim']} | {c['variant']} | {c['verdict']} | {c['evidence'].replace('|', '&#124;')} |"
        for c in claims
    ]
    write("reproduction", lines)


if __name__ == "__main__":
    main()
