"""The controller of CONTRIBUTING.md, as printed: with a header and a line in the registry, every integration has it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nanobind
import pytest
from children import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
FACES = Path(__file__).with_name("of_the_guide.py")
NEITHER_BUILT_NOR_INSTALLED = shutil.ignore_patterns(
    ".*", "__pycache__", "benchmarks", "build", "docs", "examples", "node_modules", "out", "tests"
)


def add_the_controller_of_the_guide(tree: Path) -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## A controller of your own")[2]
    ((name, header),) = re.findall(r"whole of a new file,\s+`(\S+)`:\s+```cpp\n(.*?)^```$", guide, re.DOTALL | re.M)
    (tree / name).write_text(header, encoding="utf-8")
    for name, lines in re.findall(r"^```diff\n--- (\S+)\n(.*?)^```$", guide, re.DOTALL | re.M):
        before, after = ("".join(line[1:] for line in lines.splitlines(True) if line[0] != sign) for sign in "+-")
        text = (tree / name).read_text(encoding="utf-8")
        assert text.count(before) == 1
        (tree / name).write_text(text.replace(before, after), encoding="utf-8")


def leave_out_most_others(tree: Path) -> None:
    """Keeps the paper's controller, that of the guide and its neighbor: others take most of the time to compile."""
    registry = tree / "include/fracgyro/controllers/registry.hpp"
    text = registry.read_text(encoding="utf-8")
    before, entries, after = re.split(r"(^using Registry = .*?>>;$)", text, maxsplit=1, flags=re.DOTALL | re.M)
    kept = re.findall(r'^    Entry<"(?:fractional_fast_terminal|pid|pd)",.*?">', entries, re.M)
    assert len(kept) == 3
    registry.write_text(f"{before}using Registry = std::tuple<\n{f',{chr(10)}'.join(kept)}>;{after}", encoding="utf-8")


def run(*words: str | Path, **environment: str) -> None:
    ran = subprocess.run(
        words, env={**os.environ, **environment}, capture_output=True, text=True, timeout=PATIENCE, cwd=FACES.parent
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def installed(tree: Path) -> Path:
    """The package as pip would install it, quickly compiled."""
    cmake = shutil.which("cmake", path=str(Path(sys.executable).parent)) or "cmake"
    package = tree / "package"
    shutil.copytree(tree / "python", package)
    # The fastest build: all sources in one unit, without optimization.
    quick = ["-G", "Ninja", "-DCMAKE_UNITY_BUILD=ON", "-DCMAKE_UNITY_BUILD_BATCH_SIZE=0"]
    quick += ["-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_CXX_FLAGS_DEBUG=-O0"]
    found = [f"-DPython_EXECUTABLE={sys.executable}", f"-Dnanobind_DIR={nanobind.cmake_dir()}"]
    run(cmake, "-S", tree, "-B", tree / "build", "-DFRACGYRO_PYTHON=ON", *quick, *found)
    run(cmake, "--build", tree / "build")
    run(cmake, "--install", tree / "build", "--prefix", package)
    return package


@pytest.mark.takes_a_minute
def test_the_controller_of_the_guide_is_one_file_and_one_line_and_found_in_every_face(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    shutil.copytree(ROOT, tree, ignore=NEITHER_BUILT_NOR_INSTALLED)
    add_the_controller_of_the_guide(tree)
    leave_out_most_others(tree)
    # Without site, -S, nothing leads to the package that is tested elsewhere.
    path = os.pathsep.join([str(installed(tree)), *sys.path])
    pytest_ = [sys.executable, "-S", "-m", "pytest", "-p", "no:cacheprovider"]
    run(*pytest_, FACES, PYTHONPATH=path)
    # The tests of every kind and of every field.
    of_kinds = [
        FACES.with_name(f"test_{name}.py") for name in ("kinds", "lanes", "settings", "units", "controller_pages")
    ]
    run(*pytest_, *of_kinds, "-k", "pd or controller.kp or controller.kd", PYTHONPATH=path)
