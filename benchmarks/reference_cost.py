"""Instructions of a step of the exported firmware for each kind of reference.

Writes benchmarks/results/reference_cost.md. Needs what `make setup-embedded` installs.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import fracgyro as fg
from firmware import TARGETS, measure, tools
from machine import write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "integrations/firmware/*", "include/fracgyro/control/course.hpp"]
SINES = [{"amplitude": (1.0 / k, 1.0 / k), "frequency": (k, 2.0 * k)} for k in (1.0, 2.0, 3.0)]
KINDS: dict[str, dict[str, Any]] = {
    "sine, the paper's": {},
    "sine about an offset": {"offset": (0.1, 0.1)},
    "sines, 3 terms": {"kind": "sines", "terms": SINES},
    "step, not smoothed": {"kind": "step"},
    "step, smoothed": {"kind": "step", "smoothing": 0.2},
    "ramp, smoothed": {"kind": "ramp", "slope": (0.1, 0.1), "smoothing": 0.2},
    "chirp": {"kind": "chirp", "end": 80.0, "final_frequency": (6.0, 6.0)},
    "staircase, 10 steps climbed": {"kind": "staircase", "hold": 1.0, "levels": 20, "smoothing": 0.2},
    "table, 161 rows": {"kind": "table", "file": "examples/loops.csv"},
    "rest": {"kind": "rest"},
    "x a sine, y at rest": {"kind": ("sine", "rest")},
}


def main() -> None:
    rows = [
        "| reference, on both axes | Cortex-M4F: mean / most | Cortex-M7: mean / most | image M4F / M7 |",
        "|---|---|---|---|",
    ]
    for name, reference in KINDS.items():
        scenario = fg.Scenario.paper().replace({f"reference.{field}": value for field, value in reference.items()})
        with tempfile.TemporaryDirectory() as folder:
            cells = measure(scenario, "float", Path(folder) / "out")
        rows.append(f"| {name} | {' | '.join(cells[key] for key in (*TARGETS.values(), 'image'))} |")
    write(
        "reference_cost",
        [
            "# Instructions of a step, by kind of reference",
            "",
            f"Counted by `python benchmarks/reference_cost.py`, compiled by {tools()}.".replace("\n", " "),
            "",
            "Instructions, not cycles, of a step of the paper's controller in float, as in "
            "[measured.md](../../integrations/firmware/measured.md): mean over 64 steps from t = 9.6 on, and the most "
            "that any step took; bytes of code and constants. Only the sine about 0 is computed in float; the other "
            "kinds are computed in double, which a Cortex-M4F has only in software.",
            "",
            *rows,
        ],
    )


if __name__ == "__main__":
    main()
