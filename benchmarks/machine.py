"""The machine of a measurement, and its log."""

import os
import platform
import re
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from sources import ROOT, log_of, scripts, stamp

RESULTS = ROOT / "benchmarks" / "results"
COLUMNS = 120
_MAIN = Path(sys.argv[0]).resolve()
# Taken at the start: sources may change while a measurement runs.
_STAMPS = {log: stamp(_MAIN, sys.argv[1:], log) for log, script in scripts().items() if script == _MAIN}


def on_one_core() -> None:
    """Restart this program on one processor, before any library has counted them."""
    if hasattr(os, "sched_setaffinity") and len(os.sched_getaffinity(0)) > 1:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        os.execv(sys.executable, [sys.executable, *sys.argv])


def machine(*packages: str) -> str:
    """Processor, system, and the versions that matter, in one line."""
    info = Path("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
    processor = f"{len(names)} × {names[0]}" if names else platform.processor()
    compiler = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", *packages))
    system = f"{platform.system()} {platform.machine()}"
    return f"{processor}, {system}; Python {platform.python_version()}, {versions}; {compiler}"


def command() -> str:
    """The command that is running, as it would be typed at the root of the repository."""
    return shlex.join(["python", str(_MAIN.relative_to(ROOT)), *sys.argv[1:]])


def wrapped(lines: list[str]) -> list[str]:
    """Markdown in at most 120 columns, except rows of tables. No line begins with a list marker."""
    found: list[str] = []
    for line in "\n".join(lines).split("\n"):
        rest = line
        while len(rest) > COLUMNS and not line.startswith("|"):
            breaks = (m.start() for m in re.finditer(r" (?!([-+*>#|]|\d+[.)])( |$))", rest))
            place = max((each for each in breaks if each <= COLUMNS), default=0)
            if not rest[:place].strip():
                break
            found.append(rest[:place])
            indent = re.match(r"\s*(?:[-*] )?", line)
            rest = " " * (len(indent[0]) if indent else 0) + rest[place + 1 :]
        found.append(rest)
    return found


def write(name: str, lines: list[str], keep: bool = True) -> None:
    """Prints the log and keeps it with its sources, in benchmarks/results/<name>.md or the path given in sources.py."""
    text = "\n".join(wrapped([*lines, "", _STAMPS.get(log_of(name), "")])).rstrip() + "\n"
    if keep:
        (ROOT / log_of(name)).write_text(text, encoding="utf-8")
    print(text)
