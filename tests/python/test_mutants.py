"""Rules that make mutants and expect survivors. `make mutants` compares their tables with the sources."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parents[1] / "mutants"
sys.path.append(str(HERE))

import compile_in  # noqa: E402
import run  # noqa: E402


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


def test_a_survivor_is_expected_by_its_kind_and_its_function_not_by_its_line() -> None:
    code = """template <class T>
struct Sums {
    std::size_t none = 0;
    static T of(const T& a, int n) {
        for (int i = 0; i < n; ++i) {
            sort([&](int k) { return k + 1; });
        }
    }
};
"""
    places = {words: compile_in.place_of(code, code.index(words)) for words in ("= 0;", "< n", "+ 1")}
    assert places == {"= 0;": "Sums", "< n": "of", "+ 1": "of"}
    found = {m.words: m.edit for m in compile_in.candidates("f.hpp", code)}
    assert found["0 to 1 in `for (int i = 0; i < n; ++i) {`"] == "0 to 1"
    assert run.edit_of("    a = f(b, strict=True)", "    a = f(b, strict=False)") == "True to False"
    assert run.edit_of("if a < 2:", "if a <= 2:") == "< to <="
