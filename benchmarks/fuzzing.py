"""Random files, folders and commands for SECONDS, then states and the calls of FMUs.

    python benchmarks/fuzzing.py [SECONDS [SEED]]    900 s and seed 1 by default

Writes benchmarks/results/fuzzing.md.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from machine import command, machine, write

MEASURES_CODE = True
DEPENDS_ON = ["tests/fuzz/*.py"]

FUZZ = Path(__file__).resolve().parents[1] / "tests" / "fuzz"
FILES = ("fuzz_scenarios", "fuzz_studies", "fuzz_cli")
STATES = {  # for each target
    "fuzz_states": ["--seconds", "60"],
    "fuzz_fmu": ["--seconds", "3600", "--attempts", "34000"],
}


def start(name: str, seed: str, options: list[str]) -> subprocess.Popen[str]:
    words = [sys.executable, FUZZ / f"{name}.py", "--seed", seed, *options]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def said(name: str, fuzzer: subprocess.Popen[str]) -> list[str]:
    """Its counts, a line for each target; a fuzzer without any has failed itself."""
    lines = [line.strip() for line in fuzzer.communicate()[0].splitlines()]
    if not lines:
        raise SystemExit(f"{name} ended with code {fuzzer.returncode} and without counts")
    return lines


def main() -> None:
    seconds, seed = (*sys.argv[1:], *("900", "1")[len(sys.argv) - 1 :])
    side_by_side = [(name, start(name, seed, ["--seconds", seconds])) for name in FILES]
    files = [line for name, fuzzer in side_by_side for line in said(name, fuzzer)]
    states = [line for name in STATES for line in said(name, start(name, seed, STATES[name]))]
    lines = [
        "# Fuzzing",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine('pydantic', 'optuna', 'pyarrow')}.",
        "",
        "Every input works, or is refused in one sentence. A traceback, a warning, a crash or 20 s without an answer",
        "is a failure. Input n depends on seed and n only; the fuzzers of files run side by side.",
        "",
        *(f"- {line}" for line in files),
        "",
        "Saved states in Python and in the browser's module, any bytes: refused, or the controller goes on from them.",
        "An input of an FMU is 300 bytes that say which calls to make, some of which restore a state of any bytes.",
        "",
        *(f"- {line}" for line in states),
    ]
    write("fuzzing", lines)


if __name__ == "__main__":
    main()
