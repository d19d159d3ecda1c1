"""Install the wheel with each extra into an empty environment; writes benchmarks/results/install.md.

    python benchmarks/install.py [--wheel FILE]

Measures the number of distributions and megabytes without pip, and the time of `import fracgyro`: the median of new
processes, and of a first simulation of one step. Without --wheel, also the cost of the build: processor time of
all processes and memory of the largest.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from machine import command, machine, write

DEPENDS_ON = ["pyproject.toml", "python/fracgyro/simulation/simulate.py"]

ROOT = Path(__file__).resolve().parent.parent
EXTRAS = ("", "netcdf", "report", "rate", "study", "export", "cluster", "interop", "all")
REPEATS = 7
IMPORT = "import fracgyro"
FIRST = "import fracgyro as fg; fg.simulate(fg.Scenario.paper().replace({'run.duration': 1e-3}))"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="built from this tree if left out")
    wheel = parser.parse_args().wheel
    built = ""
    with tempfile.TemporaryDirectory() as folder:
        if wheel is None:
            wheel, built = _built(Path(folder))
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
            *(["", built] if built else []),
        ],
    )


def _built(folder: Path) -> tuple[Path, str]:
    """The wheel, and a sentence on its cost; valid only if no earlier child process used more memory."""
    words = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*words, "--wheel-dir", folder, "-C", f"build-dir={folder / 'build'}", ROOT], check=True)
    took, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    (wheel,) = folder.glob("*.whl")
    return wheel, (
        f"Building the wheel from source, without ccache, takes {processor:.0f} s of processor time in all processes, "
        f"{took:.0f} s on this machine; the largest process has {after.ru_maxrss / 1e3:.0f} MB."
    )


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
