"""Processor time of commands from their start; writes benchmarks/results/start.md.

    python benchmarks/start.py [--quick]

Each in a process of its own, compiled files of Python in place, with everything that `pip install '.[all]'` brings.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = [
    "sliding_mode",
    "python/fracgyro/cli/main.py",
    "python/fracgyro/cli/simulate.py",
    "python/fracgyro/export/live.py",
    "python/fracgyro/export/fmu.py",
]

ROOT = Path(__file__).resolve().parent.parent
FRACGYRO = [sys.executable, "-c", "from fracgyro.cli import main; main()"]
# The command as it is typed, its words, times it is repeated, mark.
COMMANDS = [
    ("python -c pass", [sys.executable, "-c", "pass"], 5, None),
    ("fracgyro --help", [*FRACGYRO, "--help"], 9, 0.12),
    ("fracgyro simulate", [*FRACGYRO, "simulate"], 3, 1.5),
    ("make web", [sys.executable, "-m", "fracgyro.export.live", "{folder}/web"], 1, 12.0),
    ("fracgyro export fmu", [*FRACGYRO, "export", "fmu", "{folder}/gyro.toml", "--out", "{folder}/{n}.fmu"], 1, 6.0),
]


def spent(words: list[str]) -> float:
    """Processor time of the command and all that it starts, s. Nothing compiled before is used."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as empty:
        caches = {"CCACHE_DISABLE": "1", "ZIG_GLOBAL_CACHE_DIR": empty, "ZIG_LOCAL_CACHE_DIR": empty}
        subprocess.run(words, cwd=ROOT, env={**os.environ, **caches}, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="without exports; not written")
    quick = parser.parse_args().quick
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        words = [*FRACGYRO, "scenario", "hardware"]
        scenario = subprocess.run(words, check=True, capture_output=True, text=True).stdout
        (Path(folder) / "gyro.toml").write_text(scenario, encoding="utf-8")
        for name, words, repeats, mark in COMMANDS[:3] if quick else COMMANDS:
            found = [spent([w.format(folder=folder, n=n) for w in words]) for n in range(repeats)]
            limit = "–" if mark is None else f"{mark:g} s"
            rows.append(f"| `{name}` | {min(found):.2f} s | {max(found):.2f} s | {repeats} | {limit} |")
    lines = [
        "# Commands from their start",
        "",
        f"Made with `{command()}`.",
        "",
        f"Machine: {machine('click', 'xarray')}.",
        "",
        "Processor time of the command and of every process that it starts, compilers with empty caches among them. "
        "All extras are installed.",
        "",
        "| command | least | most | times | mark |",
        "|---|---|---|---|---|",
        *rows,
    ]
    write("start", lines, keep=not quick)


if __name__ == "__main__":
    main()
