"""Contributions of step, kernel and precision to a run's error; writes benchmarks/results/error_budget.md.

    python benchmarks/error_budget.py

The paper's scenario, corrected, and three of the shipped devices. The noise does not depend on the step: it is held for
                                 the scenario's step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.to_core import core_setup
from machine import command, machine, write
from numpy.typing import NDArray

DEPENDS_ON = ["sliding_mode", "composite"]

SEEDS = 16
FINER = 8  # the step of the reference
EXACT = 1e-9  # its tolerance
TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7)
SHARE = 0.01  # share of the step's error that the kernel may add
FIGURES = {
    "RMSE, whole": ("rmse", "whole"),
    "RMSE, steady": ("rmse", "steady"),
    "rate, rms": ("rate_error_rms", None),
    "stiffness": ("stiffness_error", None),
    "positions": None,
}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    name: str
    scenario: fg.Scenario


def cases() -> list[Case]:
    paper = fg.Scenario.paper()
    found = [Case(f"paper, order {order:g}", paper.replace({"controller.order": order})) for order in (0.3, 0.6, 0.9)]
    for name in ("hardware", "dual_mass", "paper_resonance"):
        scenario = exactly_sensed(name)
        kind = {} if scenario.controller.kind.startswith("fractional") else {"controller.kind": "fractional"}
        span = {"run.duration": 20_000 * scenario.run.step}
        found.append(Case(name.replace("_", " "), scenario.replace({**kind, **span})))
    return found


def figures(case: Case, changes: dict[str, Any], single: bool = False) -> Array:
    """(figure, seed, axis); positions in full, for one seed."""
    hold = case.scenario.disturbance.hold or case.scenario.run.step
    scenario = case.scenario.replace({"disturbance.hold": hold, "run.units": "nondimensional", **changes})
    half = 0.5 * scenario.run.duration
    found = fg.measure_many([scenario], seeds=range(SEEDS), single_precision=single, transient=half)
    rows = []
    for name, window in filter(None, FIGURES.values()):
        values = found[name].values
        rows.append(found[name].sel(window=window).values if window else np.stack([values, values], axis=1))
    return np.array(rows)


def positions(case: Case, changes: dict[str, Any]) -> Array:
    hold = case.scenario.disturbance.hold or case.scenario.run.step
    scenario = case.scenario.replace({"disturbance.hold": hold, "run.units": "nondimensional", **changes})
    return np.asarray(fg.simulate(scenario)["position"].values)


def share(found: Array, reference: Array) -> Array:
    """Median over seeds of each figure's relative error; the worse axis."""
    return np.asarray(np.median(abs(found - reference) / abs(reference), axis=1).max(axis=1))


def budget(case: Case) -> tuple[list[str], float]:
    """Rows of a table, and the maximum tolerance that satisfies SHARE in every figure."""
    step = case.scenario.run.step
    exact = {"run.kernel_tolerance": EXACT}
    own, at = figures(case, exact), positions(case, exact)
    fine = exact | {"run.step": step / FINER, "run.record_every": FINER}
    rows, kept = [], 0.0

    def row(name: str, off: Array, apart: Array | None) -> Array:
        distance = np.nan if apart is None else float(np.abs(apart - at).max() / np.abs(at).max())
        all_of_it = np.append(off, distance)
        rows.append(f"| {name} | " + " | ".join("–" if np.isnan(v) else f"{v:.1e}" for v in all_of_it) + " |")
        return all_of_it

    of_step = row(
        f"the step, {step:g}, against {step / FINER:g}", share(figures(case, fine), own), positions(case, fine)
    )
    for tolerance in TOLERANCES:
        changes = {"run.kernel_tolerance": tolerance}
        count = core_setup(case.scenario.replace(changes)).kernel.count
        off = row(
            f"kernel at {tolerance:g}, {count} exponentials",
            share(figures(case, changes), own),
            positions(case, changes),
        )
        if not kept and (off <= SHARE * of_step).all():
            kept = tolerance
    row("single precision", share(figures(case, exact, single=True), own), None)
    return rows, kept


def main() -> None:
    lines = [
        "# Where the error of a run comes from",
        "",
        f"Made by `{command()}`.",
        "",
        f"Machine: {machine('scipy')}.",
        "",
        f"How far figures are from those of a run with a step {FINER} times shorter (first row), or of the same step "
        f"with a kernel of tolerance {EXACT:g} (other rows), relative to them: the median of {SEEDS} seeds "
        f"and the worse "
        "axis; of positions the largest distance over the run of one seed, over the largest position. The "
        "noise is the same "
        "whatever the step. The second half of a run counts as steady.",
    ]
    summary = []
    for case in cases():
        rows, kept = budget(case)
        lines += ["", f"## {case.name}", "", f"| | {' | '.join(FIGURES)} |", "|---" * (len(FIGURES) + 1) + "|", *rows]
        summary.append((case.name, kept))
    lines += ["", "## The largest tolerance at which the kernel adds a hundredth of what the step does", ""]
    lines += ["| | tolerance |", "|---|---|", *(f"| {name} | {kept:g} |" for name, kept in summary)]
    write("error_budget", lines)


if __name__ == "__main__":
    main()
