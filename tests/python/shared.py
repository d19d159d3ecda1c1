"""Folders that several tests use and that are filled once, by whichever process of pytest asks first."""

from __future__ import annotations

import fcntl
from collections.abc import Callable
from pathlib import Path

import pytest


def shared(factory: pytest.TempPathFactory, name: str, fill: Callable[[Path], object]) -> Path:
    """The folder `name`, which did not exist when `fill` was called with it. Other processes wait for the first."""
    base = factory.getbasetemp()
    parent = (base.parent if base.name.startswith("popen-") else base) / "shared" / name
    parent.mkdir(parents=True, exist_ok=True)
    with open(parent / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (parent / "filled").exists():
            fill(parent / "folder")
            (parent / "filled").touch()
    return parent / "folder"
