"""The types of the compiled module, which its build writes for type checkers, are right."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


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
