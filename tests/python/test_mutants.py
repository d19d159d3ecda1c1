"""The tables of mutants fit the code: each changed snippet exists exactly once."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parents[1] / "mutants"
sys.path.append(str(HERE))

import compile_in  # noqa: E402
import python_kills  # noqa: E402
import run  # noqa: E402


@pytest.mark.parametrize("entry", compile_in.listed(), ids=lambda entry: entry["id"])
def test_a_listed_mutant_of_the_headers_is_there_once(entry: dict[str, str]) -> None:
    compile_in.from_table(entry, (compile_in.ROOT / entry["file"]).read_text(encoding="utf-8"))


@pytest.mark.parametrize("entry", python_kills.listed(), ids=lambda entry: entry["id"])
def test_a_listed_mutant_of_the_package_is_there_once(entry: dict[str, Any]) -> None:
    compile(python_kills.edited(entry), entry["file"], "exec")


def test_what_is_explained_of_a_survivor_is_of_a_mutant_that_is_there() -> None:
    written = {entry["id"] for entry in python_kills.listed()}
    there = {mutant.key for mutant in compile_in.sample()}
    for key in run.explained():
        file, mutant = key.split(": ", 1)
        if file.endswith(".hpp"):
            assert key in there
        else:
            line = mutant.partition("` -> `")[0].removeprefix("`")
            text = (compile_in.ROOT / file).read_text(encoding="utf-8")
            assert mutant in written or line in [each.strip() for each in text.splitlines()], key


def test_the_tests_that_may_kill_are_there() -> None:
    for name, tests in python_kills.TESTS.items():
        text = (Path(__file__).parent / f"test_{name}.py").read_text(encoding="utf-8")
        assert [test for test in tests if f"def {test}(" not in text] == []


def test_the_rules_find_what_they_say_and_nothing_that_the_compiler_computes() -> None:
    code = """#pragma once
inline constexpr double limit = 2.0 * 3.0;
FRACGYRO_COPY(f, 2 * 3)
inline double f(double a, int n) {  // a + b
    double s = 0.0;
    if (n < 4) {
        s = a + 1e-2 * a;
    }
    return s;
}
"""
    found = compile_in.candidates("f.hpp", code)
    assert [(m.rule, m.line) for m in sorted(found, key=lambda m: (m.line, m.rule))] == [
        ("comparison", 6),
        ("condition", 6),
        ("constant", 6),
        ("constant", 7),
        ("product", 7),
        ("statement", 7),
        ("sum", 7),
    ]
    assert compile_in.mutated(code, list(enumerate(found))).splitlines()[6:8] == [
        "    if (mutant::active(3) != bool(n < mutant::Than{2} < mutant::number(4, 4))) {",
        "        if (!mutant::active(6)) { "
        "s = a + mutant::Sign{0} * mutant::number(5, 1e-2) * mutant::Factor{1} * a; }",
    ]


def test_the_sample_is_large_and_each_mutant_has_a_number_of_its_own_in_every_file() -> None:
    mutants = compile_in.sample()
    assert 150 <= len(mutants) < 8192
    assert len({m.key for m in mutants}) == len(mutants)
