"""A visitor's first minutes, from an empty folder to a picture and an own law: benchmarks/results/stopwatch.md.

    python benchmarks/stopwatch.py [--wheel FILE]

Begins with an empty folder, an empty home and no cache of pip, and installs the wheel as from a package index. Only the
computer's time is measured, not that of reading and typing. The law is the class of docs/controllers.md, as printed
there. Without --wheel the same is also done in a new clone, which compiles.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from machine import ROOT, command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["./pyproject.toml", "./CMakeLists.txt"]

PICTURE_MARK, LAW_MARK = 180, 600  # s
KEPT = ("PATH", "LANG", "SSL_CERT_FILE", "REQUESTS_CA_BUNDLE", "PIP_INDEX_URL", "PIP_CERT", "PIP_CONFIG_FILE")
CURVES = 5  # a picture of a run has more


@dataclass
class Visit:
    """An empty folder, and the time since a visitor came."""

    folder: Path
    rows: list[str] = field(default_factory=list)
    total: float = 0.0
    processor: float = 0.0

    def run(self, shown: str, words: list[str] | None = None) -> None:
        """Run a command line, or `words`, for which `shown` stands in the log."""
        home = self.folder / "home"
        home.mkdir(exist_ok=True)
        kept = {name: os.environ[name] for name in KEPT if name in os.environ}
        kept |= {each: os.environ[each] for each in os.environ if each.lower().endswith("_proxy")}
        room = {**kept, "HOME": str(home), "PIP_NO_CACHE_DIR": "1", "CCACHE_DISABLE": "1"}
        room["PATH"] = f"{self.folder / '.venv/bin'}:{kept['PATH']}"
        room["PIP_DISABLE_PIP_VERSION_CHECK"] = "1"
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(words or shown.split(), cwd=self.folder, env=room, check=True, stdout=subprocess.DEVNULL)
        took, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        self.total, self.processor = self.total + took, self.processor + processor
        self.rows.append(f"| `{shown}` | {took:.1f} | {self.total:.0f} | {processor:.1f} | {self.processor:.0f} |")

    def size(self) -> str:
        """Distributions and megabytes of the environment, without pip."""
        python = self.folder / ".venv/bin/python"
        listed = subprocess.run([python, "-m", "pip", "list", "--format=freeze"], check=True, capture_output=True)
        names = [line for line in listed.stdout.decode().splitlines() if not line.startswith(("pip=", "setuptools="))]
        packages = next((self.folder / ".venv/lib").glob("python*/site-packages"))
        files = (
            each for each in packages.rglob("*") if each.is_file() and each.relative_to(packages).parts[0] != "pip"
        )
        return f"{len(names)} distributions, {sum(each.stat().st_size for each in files) / 1e6:.0f} MB"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path)
    wheel = parser.parse_args().wheel
    busy = os.getloadavg()[0]
    lines = [
        "# A visitor's first minutes",
        "",
        f"Made by `{command()}`: the computer's time from an empty folder, without a cache, for each command and in "
        "total. Reading and typing are not included.",
        "",
        f"Machine: {machine()}. It was shared: {busy:.0f} processes ran on {os.cpu_count()} processors. The "
        "processor time is that of a quiet machine with one processor, apart from downloads.",
    ]
    with tempfile.TemporaryDirectory() as name:
        room = Path(name)
        ways = [("From the wheel", _from_wheel)] + ([] if wheel else [("From a clone, compiled", _from_clone)])
        wheel = wheel.resolve() if wheel else _built(room / "wheel")
        for way, install in ways:
            visit = Visit(room / install.__name__)
            visit.folder.mkdir()
            lines += ["", f"## {way}", "", *_visited(visit, install(visit, wheel))]
    write("stopwatch", lines)


def _built(folder: Path) -> Path:
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT]
    subprocess.run(pip, check=True)
    return next(folder.glob("*.whl"))


def _from_wheel(visit: Visit, wheel: Path) -> str:
    """Install; returns a sentence about the size without extras."""
    visit.run("python3 -m venv .venv")
    visit.run("pip install fracgyro", ["pip", "install", "--quiet", str(wheel)])
    visit.run("fracgyro simulate paper")
    light = visit.size()
    visit.run("pip install 'fracgyro[report]'", ["pip", "install", "--quiet", f"{wheel}[report]"])
    return f"Without extras: {light}. "


def _from_clone(visit: Visit, wheel: Path) -> str:
    del wheel  # everything is compiled
    clone = visit.folder / "fracgyro"
    visit.run("git clone", ["git", "clone", "--quiet", str(ROOT), str(clone)])
    visit.run("python3 -m venv .venv")
    visit.run("pip install '.[report]'", ["pip", "install", "--quiet", f"{clone}[report]"])
    return ""


def _visited(visit: Visit, light: str) -> list[str]:
    """The rest, which is the same for both; returns the lines of the log."""
    visit.run("fracgyro simulate paper --plot run.svg")
    _check(visit.folder / "run.svg")
    picture, drawn = (visit.total, visit.processor), visit.size()
    (visit.folder / "pd.py").write_text(_law(), encoding="utf-8")
    visit.run("fracgyro simulate paper --controller pd.py:PD --plot own.svg")
    _check(visit.folder / "own.svg")
    own = (visit.total, visit.processor)
    return [
        "| command | s | since the start, s | processor time, s | since the start, s |",
        "|---|---|---|---|---|",
        *visit.rows,
        "",
        f"{light}With `report`: {drawn}.",
        "",
        _against("First picture", *picture, PICTURE_MARK),
        "",
        _against("Own law", *own, LAW_MARK),
    ]


def _against(subject: str, took: float, processor: float, mark: float) -> str:
    kept = "kept" if took <= mark else "kept by the processor time" if processor <= mark else "missed"
    return f"{subject}: after {took:.0f} s, processor time {processor:.0f} s. The mark of {mark} s is {kept}."


def _law() -> str:
    """The class of the guide, from its first block of Python up to its first run."""
    text = (ROOT / "docs/controllers.md").read_text(encoding="utf-8")
    head, _, _ = text.partition("\nrun = ")
    return head.rpartition("```python\n")[2]


def _check(path: Path) -> None:
    curves = sum(1 for each in ElementTree.parse(path).iter() if each.tag.endswith("path") and each.get("d"))
    if curves < CURVES:
        raise SystemExit(f"{path.name} has {curves} curves: no picture of a run")


if __name__ == "__main__":
    main()
