"""Install the wheel with each extra into an empty environment; writes benchmarks/results/install.md.

    python benchmarks/install.py [--wheel FILE]

How many distributions and megabytes that makes, pip left out, and how long `import fracgyro` takes there: the median of
new processes, and of a first simulation of one step. Without --wheel, also what building it takes: processor time of
all processes and memory of the largest; and the same of the commands of CONTRIBUTING.md in a new clone, every test
among them, which takes most of an hour.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = [
    "./pyproject.toml",
    "./Makefile",
    "./CMakeLists.txt",
    "./CMakePresets.json",
    "tests/cpp/CMakeLists.txt",
    "python/fracgyro/simulation/simulate.py",
]

ROOT = Path(__file__).resolve().parent.parent
EXTRAS = ("", "netcdf", "report", "rate", "study", "export", "cluster", "interop", "all")
REPEATS = 7
IMPORT = "import fracgyro"
# In a new clone, one after the other: when, the file edited before, the command.
PYTEST = ".venv/bin/pytest -p no:xdist tests/python/test_units.py"
STEPS = (
    ("from nothing", None, "make lint"),
    ("again", None, "make lint"),
    ("then", None, "make test-quick"),
    ("again", None, "make test-quick"),
    ("after an edit of Python", "python/fracgyro/scenario/units.py", PYTEST),
    ("the first C++ test", None, "make cpp-test TEST=guard"),
    ("after an edit of it", "tests/cpp/test_guard.cpp", "make cpp-test TEST=guard"),
    ("after an edit of its header", "include/fracgyro/hardware/guard.hpp", "make cpp-test TEST=guard"),
    ("after an edit of a page's style", "integrations/web/live/live.css", "make .venv/installed-test"),
    ("after an edit of a header", "include/fracgyro/controllers/lqg.hpp", "make .venv/installed-test"),
    ("at the end", None, "make test"),
)
FIRST = "import fracgyro as fg; fg.simulate(fg.Scenario.paper().replace({'run.duration': 1e-3}))"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="built from this tree if left out")
    wheel = parser.parse_args().wheel
    built: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        if wheel is None:
            wheel, sentence = _built(Path(folder))
            built = ["", sentence, *_commands(Path(folder) / "clone")]
        rows = [_row(wheel, extra) for extra in EXTRAS]
    imported, first = rows[0][1]
    write(
        "install",
        [
            "# What an installation brings",
            "",
            f"Made by `{command()}`: the wheel installed into an empty environment, pip left out.",
            "",
            f"Machine: {machine()}.",
            "",
            "| extra | distributions | MB |",
            "|---|---|---|",
            *(row for row, _ in rows),
            "",
            f"Without extras, `import fracgyro` takes {imported:.2f} s, with a first simulation {first:.2f} s. "
            "Python's own start is left out. Medians of new processes, compiled files in place.",
            *built,
        ],
    )


def _cost(words: list[str | Path], folder: Path = ROOT) -> tuple[float, float]:
    """Processor time of all processes and time on the clock, s. Nothing compiled before is used."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, cwd=folder, env={**os.environ, "CCACHE_DISABLE": "1"}, check=True)
    took, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, took


def _built(folder: Path) -> tuple[Path, str]:
    """The wheel, and a sentence on its cost; valid only if no earlier child process used more memory."""
    words = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]
    processor, took = _cost([*words, "--wheel-dir", folder, "-C", f"build-dir={folder / 'build'}", ROOT])
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    (wheel,) = folder.glob("*.whl")
    return wheel, (
        f"Building the wheel from source, without ccache, takes {processor:.0f} s of processor time in all processes, "
        f"{took:.0f} s on this machine; the largest process has {memory:.0f} MB."
    )


def _commands(clone: Path) -> list[str]:
    """A table of what STEPS take. What pip has downloaded before is not downloaded again."""
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    lines = ["", "In a new clone, one after the other:", ""]
    lines += ["| | command | processor time, s | on this machine, s |", "|---|---|---|---|"]
    for when, edited, line in STEPS:
        if edited:
            time.sleep(1.0)  # or the edit could have the time of the build before
            (clone / edited).touch()
        processor, took = _cost(line.split(), clone)
        lines.append(f"| {when} | `{line}` | {processor:.0f} | {took:.0f} |")
    return lines


def _row(wheel: Path, extra: str) -> tuple[str, tuple[float, float]]:
    with tempfile.TemporaryDirectory() as name:
        room = Path(name) / "venv"
        subprocess.run([sys.executable, "-m", "venv", room], check=True)
        before = _size(room)
        what = f"{wheel}[{extra}]" if extra else str(wheel)
        pip = [room / "bin/python", "-m", "pip", "--disable-pip-version-check"]
        subprocess.run([*pip, "install", "--quiet", what], check=True)
        listed = subprocess.run([*pip, "list", "--format=freeze"], check=True, capture_output=True, text=True).stdout
        count = sum(not line.startswith(("pip=", "setuptools=")) for line in listed.splitlines())
        row = f"| {extra or 'none'} | {count} | {_size(room) - before:.0f} |"
        took = (_seconds(room, IMPORT), _seconds(room, FIRST)) if not extra else (0.0, 0.0)
        return row, took


def _size(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file() and not path.is_symlink()) / 1e6


def _seconds(room: Path, code: str) -> float:
    """In addition to an empty program."""

    def once(what: str) -> float:
        begin = time.perf_counter()
        subprocess.run([room / "bin/python", "-c", what], check=True)
        return time.perf_counter() - begin

    once(code)
    return statistics.median(once(code) - once("") for _ in range(REPEATS))


if __name__ == "__main__":
    main()
