"""Builds the C++ tests and the Python module once, with every mutant in them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

from compile_in import ROOT, Mutant, sample, write

BUILD = ROOT / "build/mutants"
SOURCE, OBJECTS = BUILD / "source", BUILD / "objects"
COPIED = ("bindings", "integrations", "tests/cpp")


def build(only: Collection[str] = ()) -> list[Mutant]:
    """The mutants, in the order of their numbers; of some files only, or of all."""
    mutants = [mutant for mutant in sample() if not only or mutant.file in only]
    for folder in COPIED:
        for path in (ROOT / folder).rglob("*"):
            target = SOURCE / path.relative_to(ROOT)
            if path.is_file() and (not target.is_file() or target.read_bytes() != path.read_bytes()):
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, target)
    # One width of lanes is enough, and is compiled in a third of the time.
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8").replace('MATCHES "x86_64|AMD64"', 'MATCHES "none"')
    listed = SOURCE / "CMakeLists.txt"
    if not listed.is_file() or listed.read_text(encoding="utf-8") != text:
        listed.write_text(text, encoding="utf-8")
    shutil.copyfile(ROOT / "pyproject.toml", SOURCE / "pyproject.toml")  # whose version the build reads
    write(mutants, SOURCE)
    bin = Path(sys.executable).parent
    nanobind = subprocess.run(
        [sys.executable, "-m", "nanobind", "--cmake_dir"], capture_output=True, text=True, check=True
    ).stdout.strip()
    configure = [
        bin / "cmake", "-S", SOURCE, "-B", OBJECTS, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={bin / 'ninja'}",
        "-DFRACGYRO_TESTS=ON", "-DFRACGYRO_PYTHON=ON", f"-Dnanobind_DIR={nanobind}", "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -w",
        f"-DPython_EXECUTABLE={sys.executable}",
    ]  # fmt: skip
    subprocess.run(configure, check=True, stdout=subprocess.DEVNULL)
    subprocess.run([bin / "cmake", "--build", OBJECTS, "--", "-k", "0"], check=True)
    for name in ("include", "integrations"):  # next to the module, where exports look for them
        (OBJECTS / name).unlink(missing_ok=True)
        (OBJECTS / name).symlink_to(ROOT / name)
    return mutants


def tests() -> list[Path]:
    return sorted(path for path in (OBJECTS / "tests/cpp").glob("test_*") if path.suffix == "")


def module() -> Path:
    (found,) = OBJECTS.glob("_core*.so")
    return found


if __name__ == "__main__":
    print(f"{len(build())} mutants")
