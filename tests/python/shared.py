"""Folders that several tests use and that are filled once, by whichever process of pytest asks first."""

from __future__ import annotations

import fcntl
import hashlib
import shutil
from collections.abc import Callable, Sequence
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


def compile_once(factory: pytest.TempPathFactory, command: Sequence[str], run: Callable[[list[str]], object]) -> None:
    """Runs a compiler, whose last words are -o and the program. The same words again copy the program."""
    *compiling, program = command
    name = hashlib.sha256(" ".join(compiling).encode()).hexdigest()
    shutil.copy(shared(factory, name, lambda path: run([*compiling, str(path)])), program)


def live_page(factory: pytest.TempPathFactory) -> Path:
    """The folder of the live page of the paper's device, compiled once."""
    from fracgyro.export.live import write_page
    from fracgyro.export.web import build

    def fill(made: Path) -> None:
        build(made, ["double"])
        write_page(made / "live", made / "fracgyro.wasm")

    return shared(factory, "live", fill) / "live"
