"""The minimal controller in the comment of controller.hpp: it compiles and fits the contract."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

INCLUDE = Path(__file__).resolve().parents[2] / "include"


@pytest.mark.parametrize("complete", [True, False])
def test_the_minimal_controller_of_the_contract_compiles(tmp_path: Path, complete: bool) -> None:
    text = (INCLUDE / "fracgyro/control/controller.hpp").read_text(encoding="utf-8")
    code = "".join(f"{line}\n" for line in re.findall(r"^//     (.*)$", text, re.MULTILINE))
    assert 10 < code.count("\n") < 25
    if not complete:
        code = re.sub(r"^ *static Report report.*\n", "", code, flags=re.MULTILINE)
    source = tmp_path / "minimal.cpp"
    source.write_text(
        f'#include "fracgyro/sim/stepper.hpp"\nnamespace fracgyro {{\n{code}'
        "static_assert(Controller<Proportional<double>> && Controller<Proportional<float>>);\n}\n",
        encoding="utf-8",
    )
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    command = [*compiler, "-std=c++20", "-fsyntax-only", "-Wno-psabi", f"-I{INCLUDE}", str(source)]
    assert (subprocess.run(command, capture_output=True, check=False).returncode == 0) == complete
