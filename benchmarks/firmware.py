"""Cost of the exported firmware: instructions, memory, and its error.

Writes integrations/firmware/measured.md.

python benchmarks/firmware.py            measures everything
python benchmarks/firmware.py --check    recounts some and compares them with the committed ones; only exponentials and
                                         bytes of data if the tools have other versions
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.export.compilers import Number, make
from fracgyro.export.host import Host, rmse
from fracgyro.scenario.to_core import core_setup
from machine import write
from sources import log_of

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "composite", "joint", "integrations/firmware/*"]

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / log_of("firmware")
SEEDS = 10
PAPER = fg.Scenario.paper()
LINEAR_JOINT: dict[str, Any] = {"controller.kind": "linear", "adaptation.kind": "joint"}
NOISY: dict[str, Any] = {"device.position_noise_density": 1e-13}
INTERNAL_MODEL = NOISY | {"controller.kind": "internal_model"}
LOCK_IN = NOISY | {"controller.kind": "lock_in", "device.sensing": "position", "controller.force_limit": 6000.0}
FILTERED_PID = NOISY | {"controller.kind": "pid", "controller.filter": "kalman"}
SCENARIOS: dict[str, dict[str, Any]] = {
    "paper, c = 0.6": {"controller.terminal_exponent": 0.6},
    "paper": {},
    "16 exponentials, c = 0.6": {"controller.terminal_exponent": 0.6, "run.kernel_tolerance": 5e-5},
    "16 exponentials, c = 0.6, force limit": {
        "controller.terminal_exponent": 0.6,
        "run.kernel_tolerance": 5e-5,
        "controller.force_limit": 6000.0,
    },
    "16 exponentials, c = 0.6, force and switching limit": {
        "controller.terminal_exponent": 0.6,
        "run.kernel_tolerance": 5e-5,
        "controller.force_limit": 6000.0,
        "controller.switching_limit": 0.5,
    },
    "16 exponentials, c = 0.6, force limit, samples checked": {
        "controller.terminal_exponent": 0.6,
        "run.kernel_tolerance": 5e-5,
        "controller.force_limit": 6000.0,
        "guard.checked": True,
    },
    "16 exponentials": {"run.kernel_tolerance": 5e-5},
    "fast: 8 exponentials": {"run.kernel_tolerance": 2e-2},
    "6 exponentials": {"run.kernel_tolerance": 0.1},
    "fast terminal, no exponentials": {"controller.kind": "fast_terminal"},
    "paper, composite": {"adaptation.kind": "composite"},
    "linear, composite": {"controller.kind": "linear", "adaptation.kind": "composite"},
    "linear, joint, positions": LINEAR_JOINT | {"device.sensing": "position"},
    "linear, joint, positions, divided by 8": LINEAR_JOINT
    | {"device.sensing": "position", "adaptation.covariance_steps": 8},
    "linear, joint, velocities too": LINEAR_JOINT,
    "internal model, positions": INTERNAL_MODEL | {"device.sensing": "position"},
    "internal model, velocities too": INTERNAL_MODEL,
    "internal model, velocities too, force limit": INTERNAL_MODEL | {"controller.force_limit": 6000.0},
    "lock-in": LOCK_IN,
    "lock-in, samples checked": LOCK_IN | {"guard.checked": True},
    "PID, Kalman filter, positions": FILTERED_PID | {"device.sensing": "position"},
    "PID, Kalman filter, velocities too": FILTERED_PID,
}
ROWS: list[tuple[str, Number]] = [(name, number) for name in SCENARIOS for number in get_args(Number)]
CHECKED: list[tuple[str, Number]] = [
    ("paper", "double"),
    ("16 exponentials, c = 0.6, force limit, samples checked", "float"),
    ("linear, joint, positions, divided by 8", "float"),
    ("lock-in", "float"),
]
TARGETS = {"m4f": "Cortex-M4F", "m7": "Cortex-M7"}

# Cycles per instruction, min and max, and cycles per division or square root. A step has nine of these, with composite
# adaptation 18 more, with joint adaptation 40 more, or 66 if velocities are measured; an internal model has two.
CYCLES = {"Cortex-M4F": (1.0, 1.5), "Cortex-M7": (0.65, 1.1)}
ROOTS, CYCLES_PER_ROOT = 9, 14
ROOTS_OF = {"composite": 27, "joint, positions": 49, "joint, velocities": 75, "internal": 2, "lock-in": 3, "PID": 0}
CLOCKS = {"168 MHz M4F": ("Cortex-M4F", 168), "480 MHz M7": ("Cortex-M7", 480), "1 GHz M7": ("Cortex-M7", 1000)}

HEAD = """\
# What the firmware costs

Counted by `python benchmarks/firmware.py`, compiled with the flags of the exported Makefile by
{tools}.

These are **instructions, not cycles**, which QEMU does not know. Mean over 64 steps, two of which evaluate the
reference again, of lock-in over two spans, after 9,600 steps, when what only the start needs is past where it ends;
and the most that any step took, those of the start and of a fault included. Bytes: coefficients and state; stack of a
step; code and constants added to an image. c = 1/2 and no force limit where nothing is said.
"""


def measure(scenario: fg.Scenario, number: Number, folder: Path) -> dict[str, str]:
    """Cells by column."""
    fg.export.firmware(scenario, folder, number, unbounded=True)
    counts = dict(re.findall(r"(Cortex-\w+): (\d+ \d+)", make(folder, "count")))
    sizes = re.findall(r"^\s*(\d+)\s+(\d+).*?(\w+)/image", make(folder, "size"), re.MULTILINE)
    symbols = subprocess.run(
        ["arm-none-eabi-nm", "-S", "build/m7/fracgyro.o"], cwd=folder, capture_output=True, text=True, check=True
    ).stdout
    (coefficients,) = re.findall(r"^\w+ (\w+) r \w*12coefficientsE$", symbols, re.MULTILINE) or ["0"]
    state = re.findall(r"STATE_SIZE (\d+)", (folder / "fracgyro_coefficients.h").read_text())[0]
    frames = [
        re.findall(r"fracgyro_step\(.*\t(\d+)\t", (folder / f"build/{t}/fracgyro.su").read_text())[0] for t in TARGETS
    ]
    return {
        **{name: " / ".join(counts[name].split()) for name in TARGETS.values()},
        "memory": f"{int(coefficients, 16)} + {state}",
        "stack": " / ".join(frames),
        "image": " / ".join(str(int(text) + int(data)) for text, data, _ in sizes),
    }


def exponentials(scenario: fg.Scenario) -> int:
    return len(_core.setup_kernel(core_setup(scenario))[0])


def table(rows: Iterable[tuple[str, Number]]) -> list[str]:
    lines = [
        "| controller | exponentials | scalar | Cortex-M4F: mean / most | Cortex-M7: mean / most "
        "| bytes: coefficients + state | stack M4F / M7 | image M4F / M7 |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, number in rows:
        scenario = PAPER.replace(SCENARIOS[name])
        with tempfile.TemporaryDirectory() as folder:
            cells = measure(scenario, number, Path(folder) / "out")
        lines.append(f"| {name} | {exponentials(scenario)} | {number} | {' | '.join(cells.values())} |")
    return lines


def sampling(counted: list[str]) -> list[str]:
    """The time of the longest step in microseconds, estimated from the counts."""
    lines = [
        "Estimated time of the longest step in microseconds, float. Assumed, not measured:",
        "; ".join(f"{name} {low} to {high} cycles per instruction" for name, (low, high) in CYCLES.items()) + ";",
        f"{CYCLES_PER_ROOT} more for each of {ROOTS} divisions and square roots, "
        + ", ".join(f"{name}: {count}" for name, count in ROOTS_OF.items())
        + ";",
        "code and data in memory without wait states. The paper's step is 1 microsecond.",
        "",
        f"| controller | exponentials | {' | '.join(CLOCKS)} |",
        "|---|---|---|---|---|",
    ]
    for row in counted[2:]:
        _, name, terms, number, m4f, m7, *_ = (cell.strip() for cell in row.split("|"))
        most = {"Cortex-M4F": int(m4f.split()[-1]), "Cortex-M7": int(m7.split()[-1])}
        roots = next((count for of, count in ROOTS_OF.items() if of in name), ROOTS)
        times = [
            [(most[processor] * cycles + roots * CYCLES_PER_ROOT) / clock for cycles in CYCLES[processor]]
            for processor, clock in CLOCKS.values()
        ]
        if number == "float":
            lines.append(f"| {name} | {terms} | {' | '.join(f'{low:.1f} to {high:.1f}' for low, high in times)} |")
    return lines


def errors() -> list[str]:
    """RMSE of x, y against the paper's controller in double, mean over seeds."""
    lines = [
        "RMSE of the closed loop, plant in double and firmware in float, against that of the paper's controller in",
        f"double: means over {SEEDS} seeds.",
        "",
        "| controller | exponentials | whole run: x, y | t >= 10: x, y |",
        "|---|---|---|---|",
    ]
    runs = [PAPER.replace({"disturbance.seed": seed}) for seed in range(SEEDS)]
    base = [[fg.metrics.rmse(fg.simulate(run), window=(start, None)).values for start in (0, 10)] for run in runs]
    for name, changes in SCENARIOS.items():
        if "controller.kind" in changes or "controller.terminal_exponent" in changes:
            continue
        with tempfile.TemporaryDirectory() as folder:
            scenario = PAPER.replace(changes)
            fg.export.firmware(scenario, Path(folder) / "out", unbounded=True)
            found = [[rmse(run, Host(Path(folder) / "out", "float"), start) for start in (0.0, 10.0)] for run in runs]
        whole, late = 100 * (np.mean(found, axis=0) / np.mean(base, axis=0) - 1)
        cells = [f"{x:+.2f} %, {y:+.2f} %" for x, y in (whole, late)]
        lines.append(f"| {name} | {exponentials(scenario)} | {' | '.join(cells)} |")
    return lines


def said(*command: str, text: str = "") -> str:
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


def tools() -> str:
    """The versions that instructions, stack and bytes of code depend on."""
    compiler = said("arm-none-eabi-g++", "--version").splitlines()[0]
    macros = said("arm-none-eabi-g++", "-E", "-dM", "-x", "c", "-", text="#include <_newlib_version.h>\n")
    (newlib,) = re.findall(r'_NEWLIB_VERSION "(.*)"', macros)
    emulator = said("qemu-system-arm", "--version").splitlines()[0]
    return f"{compiler} with newlib {newlib}, run by\n{emulator}"


def without_tools(rows: list[str]) -> list[str]:
    """Controller, exponentials, scalar, and bytes of coefficients and state: independent of the tools' versions."""
    kept = (0, 1, 2, 5)
    return [" | ".join(cells[i].strip() for i in kept) for cells in (row.strip("| ").split("|") for row in rows)]


def check(counted: list[str]) -> None:
    text = RESULTS.read_text(encoding="utf-8")
    whole = [line for line in text.splitlines() if line.startswith("|")][: 2 + len(ROWS)]
    committed = whole[:2] + [whole[2 + ROWS.index(row)] for row in CHECKED]
    same_tools = tools() in text
    if counted != committed if same_tools else without_tools(counted) != without_tools(committed):
        rows = "\n".join(counted)
        sys.exit(f"{RESULTS.relative_to(ROOT)} differs; make it again: python benchmarks/firmware.py\n{rows}")
    if not same_tools:
        found = tools().replace("\n", " ")
        print(f"only bytes of data are compared: the instructions were counted with other tools than {found}")


def main() -> None:
    rows = table(CHECKED if "--check" in sys.argv else ROWS)
    if "--check" in sys.argv:
        return check(rows)
    counted, head = "\n".join(rows), HEAD.format(tools=tools())
    write("firmware", [head, counted, "", *sampling(rows), "", *errors()])


if __name__ == "__main__":
    main()
