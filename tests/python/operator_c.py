"""Compile an exported operator with a main program of tests/operator, and run it."""

from __future__ import annotations

import os
from pathlib import Path

import fracgyro as fg
from fracgyro.export.compilers import SOURCES, Number, run
from fracgyro.export.targets import BOARDS, EMULATOR

ROOT = Path(__file__).resolve().parents[2]
MAINS = ROOT / "tests/operator"
STRICT_C99 = [
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Werror",
    "-ffp-contract=off",
]
CORTEX = SOURCES / "integrations/firmware/cortex_m"
BOARD = {"m4f": "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16", "m7": "-mcpu=cortex-m7 -mfpu=fpv5-d16"}


def built(
    sampled: fg.fractional.Sampled, number: Number, folder: Path, target: str, main: str, *flags: str
) -> list[str]:
    """The command that runs it in the folder. target: host, m4f or m7."""
    fg.export.operator(sampled, folder, number)
    words = [*STRICT_C99, f"-DNUMBER={number}", *(flags or ("-O2",)), f"-I{folder}"]
    sources = [str(folder / "operator.c"), str(MAINS / f"{main}.c")]
    program = str(folder / "program")
    if target == "host":
        run([os.environ.get("CC", "cc"), *words, *sources, "-o", program])
        return [program]
    startup = [str(CORTEX / "startup.c"), "-nostartfiles", "--specs=rdimon.specs", f"-T{CORTEX / 'mps2.ld'}"]
    cortex = [*BOARD[target].split(), "-mthumb", "-mfloat-abi=hard"]
    for source in sources:
        run(["arm-none-eabi-gcc", *cortex, *words, "-c", source, "-o", f"{Path(source).name}.o"], folder)
    objects = [f"{Path(source).name}.o" for source in sources]
    run(["arm-none-eabi-gcc", *cortex, "-O2", *objects, *startup, "-o", program], folder)
    return [*EMULATOR, "-icount", "shift=0", "-M", BOARDS[target], "-kernel", program]
