"""Files, folders and commands made at random: `fuzzing.py SECONDS SEED`; writes benchmarks/results/fuzzing.md."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from machine import command, machine, write

FUZZ = Path(__file__).resolve().parents[1] / "tests" / "fuzz"
FUZZERS = ("fuzz_scenarios", "fuzz_studies", "fuzz_cli")


def main() -> None:
    seconds, seed = sys.argv[1:3]
    fuzzers = [
        subprocess.Popen(
            [sys.executable, FUZZ / f"{name}.py", "--seconds", seconds, "--seed", seed],
            stdout=subprocess.PIPE,
            text=True,
        )
        for name in FUZZERS
    ]
    found = [fuzzer.communicate()[0].strip() for fuzzer in fuzzers]
    lines = [
        "# Fuzzing",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine('pydantic', 'optuna', 'pyarrow')}.",
        "",
        "Every input works, or is refused in one sentence. A traceback, a warning, a crash or 20 s without an answer",
        "is a failure. Input n depends on seed and n only; the fuzzers run side by side.",
        "",
        *(f"- {line}" for line in found),
    ]
    write("fuzzing", lines)


if __name__ == "__main__":
    main()
