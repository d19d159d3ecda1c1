"""The types of the compiled module that type checkers read are right, and are what `make stub` writes."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STUB = ROOT / "python/fracgyro/_core.pyi"
MADE_BY = "3.1.0"  # nanobind, whose next release may word it otherwise


def test_every_name_of_the_compiled_module_is_in_its_types_and_the_other_way_round() -> None:
    """stubtest does not recognize nanobind's functions, and compares only the names."""
    ran = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "fracgyro._core", "--mypy-config-file", "pyproject.toml"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    errors = re.findall(r"^error: fracgyro\._core\.(\S+) (.*)$", ran.stdout, re.MULTILINE)
    assert ("power", "is not a function") in errors, ran.stdout + ran.stderr
    inherited = re.compile(r"__nb_enum__|Motion\.")
    assert [name for name, words in errors if "present" in words and not inherited.search(name)] == []


def test_the_committed_types_are_generated(tmp_path: Path) -> None:
    if version("nanobind") != MADE_BY:
        pytest.skip(f"_core.pyi was made by nanobind {MADE_BY}, not {version('nanobind')}")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = re.search(r"^stub: .*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    assert recipe
    again = tmp_path / "_core.pyi"
    script = recipe[1].replace("$(STUB)", str(again)).replace("$(BIN)/python", sys.executable)
    script = script.replace("$(BIN)", str(Path(sys.executable).parent))
    subprocess.run(["sh", "-ec", script], cwd=ROOT, check=True)
    assert again.read_text(encoding="utf-8") == STUB.read_text(encoding="utf-8")
