"""Attacks that may kill their process: what was tried last is on disk, and becomes a finding."""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

HERE = Path(__file__).parent


class Notebook:
    """Holds what is tried right now."""

    def __init__(self, path: str) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)

    def note(self, attempt: bytes) -> None:
        os.pwrite(self._file, attempt, 0)
        os.ftruncate(self._file, len(attempt))


def arguments(faces: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10.0, help="for each face")
    parser.add_argument("--attempts", type=int, default=10**9, help="for each face, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--face", choices=faces, action="append", help="repeatable; all if left out")
    parser.add_argument("--note", help=argparse.SUPPRESS)  # of an attack's own process
    parser.add_argument("--made", help=argparse.SUPPRESS)  # what is attacked, made before
    return parser.parse_args()


def indices(chosen: argparse.Namespace) -> Iterator[int]:
    """Until time or attempts are up."""
    end = time.monotonic() + chosen.seconds
    for index in count():
        if index == chosen.attempts or time.monotonic() > end:
            return
        yield index


def corpus(kind: str, face: str) -> list[bytes]:
    return [path.read_bytes() for path in sorted((HERE / "corpus" / kind).glob(f"{face}-*"))]


def watched(kind: str, face: str, chosen: argparse.Namespace, folder: str, made: str = "") -> bool:
    """Whether the attack, the calling script in a process of its own, ended well; if not, a finding is left."""
    note = Path(folder) / f"{face}.tried"
    limits = ["--seconds", str(chosen.seconds), "--attempts", str(chosen.attempts), "--seed", str(chosen.seed)]
    command = [sys.executable, sys.argv[0], "--face", face, "--note", str(note), "--made", made, *limits]
    ran = subprocess.run([*command[:1], *(["-S"] if sys.flags.no_site else []), *command[1:]])
    if ran.returncode == 0:
        return True
    attempt = note.read_bytes() if note.exists() else b""
    place = HERE / "corpus" / kind / f"{face}-{hashlib.sha256(attempt).hexdigest()[:16]}"
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(attempt)
    print(f"{face}: exit code {ran.returncode}: the attempt is in {place}")
    return False
