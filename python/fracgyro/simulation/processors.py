"""Processors that this process may use: its affinity, and the quota of its container."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

OF_PROCESS = Path("/proc/self/cgroup")
ROOT = Path("/sys/fs/cgroup")


@lru_cache
def processors() -> int:
    """At least 1. Found once, as a container keeps its quota."""
    found = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min([found, *(math.ceil(quota) for quota in quotas(OF_PROCESS, ROOT))]))


def quotas(of_process: Path, root: Path) -> list[float]:
    """Processors that each control group of a process allows, of those that set a limit.

    `of_process`: the file that lists its groups; `root`: the folder of all groups, of version 1 or 2.
    """
    found = []
    for folder in dict.fromkeys(_folders(of_process, root)):
        words = _words(folder / "cpu.max")  # version 2: the quota and its period, in microseconds
        if not words:  # version 1
            words = _words(folder / "cpu.cfs_quota_us") + _words(folder / "cpu.cfs_period_us")
        try:
            quota, period = map(float, words)
        except ValueError:  # no such file, or "max"
            continue
        if quota > 0 and period > 0:
            found.append(quota / period)
    return found


def _folders(of_process: Path, root: Path) -> Iterator[Path]:
    """Groups of the process and those above them, which limit it, too."""
    for line in _lines(of_process):
        number, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")
        if number == "0" and not controllers:
            base = root
        elif "cpu" in controllers.split(","):
            base = next((each for each in (root / controllers, root / "cpu") if each.is_dir()), root)
        else:
            continue
        inner = Path(group.lstrip("/"))
        if ".." in inner.parts:  # outside of the container, which sees only its own
            inner = Path()
        yield from (base / each for each in (inner, *inner.parents))


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []


def _words(path: Path) -> list[str]:
    return " ".join(_lines(path)).split()
