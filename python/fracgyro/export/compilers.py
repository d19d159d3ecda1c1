"""Tools for exported code: the system's compiler for this machine, zig for others, make, emulators."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Literal

from .. import _core

Number = Literal["float", "double"]  # number type of an exported controller

# The sources are installed with the compiled module, whose coefficients match these headers.
SOURCES = Path(_core.__file__).parent

# Same as in CMakeLists.txt: without contraction, every compiler and processor computes the same bits.
FLAGS = ["-std=c++20", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS += ["-fno-exceptions", "-fno-rtti", "-fvisibility=hidden", "-Wno-psabi"]
ZIG = "ziglang from PyPI: in your clone, pip install '.[export]'"
# The packages of Debian that bring programs of other names; they are called the same or alike elsewhere.
PACKAGES = {
    "node": "nodejs",
    "arm-none-eabi-g++": "gcc-arm-none-eabi, libnewlib-arm-none-eabi and libstdc++-arm-none-eabi-newlib",
    "octave-cli": "octave",
    "mkoctfile": "octave-dev",
}


def need(*programs: str) -> None:
    """Raises ValueError if one is missing, with a message that names the package to install."""
    for program in programs:
        if shutil.which(program) is None:
            package = PACKAGES.get(program, program)
            raise ValueError(f"{program} is not found: install {package}, as they are called in Debian")


def make(folder: Path, *words: str) -> str:
    """Output of `make WORDS` in a folder of exported firmware. Raises ValueError if it fails."""
    need("make")
    return run(["make", "--silent", *words], folder)


def has_zig() -> bool:
    return importlib.util.find_spec("ziglang") is not None


def zig(*words: str | Path) -> None:
    """Runs `zig WORDS`. Raises ValueError if zig is missing or fails."""
    if not has_zig():
        raise ValueError(f"a compiler for other systems is missing: install {ZIG}")
    run([sys.executable, "-m", "ziglang", *map(str, words)])


def system_compiler(*words: str | Path) -> None:
    """Runs the system's C++ compiler. Raises ValueError if it is missing or fails."""
    run([*compiler(), *map(str, words)])


def compiler() -> list[str]:
    """Command of the compiler: CXX, or c++. Raises ValueError if it is missing."""
    command = shlex.split(os.environ.get("CXX", "c++"))
    if not command or shutil.which(command[0]) is None:
        raise ValueError(f"{' '.join(command) or 'CXX'} is not found: set CXX to a C++20 compiler")
    return command


def include(*folders: Path) -> list[str]:
    return [word for folder in folders for word in ("-I", str(folder))]


def run(command: list[str], folder: Path | None = None) -> str:
    """Output of a command. Raises ValueError if it fails."""
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if ran.returncode:
        lines = (
            [line for line in ran.stderr.splitlines() if "error" in line] or ran.stderr.splitlines() or ["no reason"]
        )
        raise ValueError(f"{Path(command[0]).name} failed: {lines[0].strip()}")
    return ran.stdout


def join_macos(binaries: list[bytes]) -> bytes:
    """A universal Mach-O library for Intel and Apple processors: the header, then each binary on its own page."""
    page = 2**14
    header, place, joined = struct.pack(">II", 0xCAFEBABE, len(binaries)), page, b""
    for binary in binaries:
        processor = struct.unpack("<II", binary[4:12])  # CPU type and subtype
        header += struct.pack(">5I", *processor, place + len(joined), len(binary), 14)
        joined += binary + bytes(-len(binary) % page)
    return header.ljust(page, b"\0") + joined
