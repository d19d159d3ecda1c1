"""The compilers of what is exported: the system's own for this machine, zig for all others."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import struct
import subprocess
import sys
from pathlib import Path

from .. import _core

# The sources are installed beside the compiled module.
SOURCES = Path(_core.__file__).parent

# As CMakeLists.txt has them: without contraction, every compiler and processor computes the same bits.
FLAGS = ["-std=c++20", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS += ["-fno-exceptions", "-fno-rtti", "-fvisibility=hidden", "-Wno-psabi"]
ZIG = "ziglang from PyPI, which comes with pip install 'fracgyro[export]'"


def has_zig() -> bool:
    return importlib.util.find_spec("ziglang") is not None


def zig(*words: str | Path) -> None:
    """Runs `zig WORDS`. Raises ValueError in one sentence when there is none, or it fails."""
    if not has_zig():
        raise ValueError(f"a compiler for other systems is missing: install {ZIG}")
    _run([sys.executable, "-m", "ziglang", *map(str, words)])


def system_compiler(*words: str | Path) -> None:
    """The same with the system's C++ compiler, that which CXX names or c++."""
    command = shlex.split(os.environ.get("CXX", "c++"))
    if not command or shutil.which(command[0]) is None:
        raise ValueError(f"{' '.join(command) or 'CXX'} is not found: set CXX to a C++20 compiler")
    _run([*command, *map(str, words)])


def include(*folders: Path) -> list[str]:
    return [word for folder in folders for word in ("-I", str(folder))]


def _run(command: list[str]) -> None:
    ran = subprocess.run(command, capture_output=True, text=True)
    if ran.returncode:
        lines = (
            [line for line in ran.stderr.splitlines() if "error" in line] or ran.stderr.splitlines() or ["no reason"]
        )
        raise ValueError(f"{Path(command[0]).name} failed: {lines[0].strip()}")


def join_macos(binaries: list[bytes]) -> bytes:
    """One library for Intel and Apple processors: Mach-O's universal header, then each binary at a page of its own."""
    page = 2**14
    header, place, joined = struct.pack(">II", 0xCAFEBABE, len(binaries)), page, b""
    for binary in binaries:
        processor = struct.unpack("<II", binary[4:12])  # its kind and subkind
        header += struct.pack(">5I", *processor, place + len(joined), len(binary), 14)
        joined += binary + bytes(-len(binary) % page)
    return header.ljust(page, b"\0") + joined
