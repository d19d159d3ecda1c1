"""The minimal controller and the minimal plant in the comments of their contracts: they compile and fit."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

INCLUDE = Path(__file__).resolve().parents[2] / "include"


@pytest.mark.parametrize("complete", [True, False])
@pytest.mark.parametrize(
    ("contract", "loop", "check", "needed"),
    [
        (
            "control/controller.hpp",
            "sim/stepper.hpp",
            "Controller<Proportional<double>> && Controller<Proportional<float>>",
            "static Report report",
        ),
        ("plant/plant.hpp", "plant/plant.hpp", "Plant<FreeMass>", "static State start"),
    ],
)
def test_the_minimal_example_of_the_contract_compiles(
    tmp_path: Path, contract: str, loop: str, check: str, needed: str, complete: bool
) -> None:
    text = (INCLUDE / "fracgyro" / contract).read_text(encoding="utf-8")
    code = "".join(f"{line}\n" for line in re.findall(r"^//     (.*)$", text, re.MULTILINE))
    assert 10 < code.count("\n") < 25
    if not complete:
        code = re.sub(rf"^ *{needed}.*\n", "", code, flags=re.MULTILINE)
    source = tmp_path / "minimal.cpp"
    source.write_text(
        f'#include "fracgyro/{loop}"\nnamespace fracgyro {{\n{code}static_assert({check});\n}}\n', encoding="utf-8"
    )
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    command = [*compiler, "-std=c++20", "-fsyntax-only", "-Wno-psabi", f"-I{INCLUDE}", str(source)]
    assert (subprocess.run(command, capture_output=True, check=False).returncode == 0) == complete
