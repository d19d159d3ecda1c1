"""The runs behind the paper's figures, its Table 1 and its claims."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import xarray as xr
from fracgyro.scenario import Scenario
from fracgyro.simulation.measure import measure_many
from fracgyro.simulation.simulate import simulate

VARIANTS = ("printed", "corrected")
CONTROLLERS = {  # the three of section 5
    "proposed": "fractional_fast_terminal",
    "fractional": "fractional",
    "conventional": "fast_terminal",
}
ORDERS = tuple(round(0.1 * n, 1) for n in range(1, 11))
PAPER_ORDER = 0.9

Runs = dict[tuple[str, str], xr.Dataset]  # by (variant, controller)
Study = dict[tuple[str, str, float], xr.Dataset]  # metrics over `run` by (variant, controller, order)


class Results(NamedTuple):
    """Everything that the reproduction has run."""

    runs: Runs
    study: Study


def scenario(variant: str, controller: str, order: float = PAPER_ORDER, seed: int = 0) -> Scenario:
    """The paper's scenario for one of its three controllers."""
    return Scenario.paper("printed" if variant == "printed" else "corrected").replace(
        {"controller.kind": CONTROLLERS[controller], "controller.order": order, "disturbance.seed": seed}
    )


def record_all(progress: Callable[[int], object] | None = None) -> Runs:
    """One recorded run of each controller in each variant, all with the same noise."""
    runs = {}
    for variant in VARIANTS:
        for controller in CONTROLLERS:
            runs[variant, controller] = simulate(scenario(variant, controller))
            if progress:
                progress(1)
    return runs


def study_cases() -> list[tuple[str, str, float]]:
    """Every case of the study: Table 1's orders, and the two controllers the paper compares with.

    At order 1 the proposed controller is the conventional one, which is why Table 1 lists it there.
    """
    table = [(variant, "proposed", order) for variant in VARIANTS for order in ORDERS]
    return table + [(variant, other, PAPER_ORDER) for variant in VARIANTS for other in ("fractional", "conventional")]


def study(seeds: int, progress: Callable[[int], object] | None = None) -> Study:
    """Metrics of `seeds` runs of each case. Seed n is the same noise in every case: comparisons are paired."""
    results = {}
    for variant, controller, order in study_cases():
        base = scenario(variant, controller, order)
        results[variant, controller, order] = measure_many(
            [base.replace({"disturbance.seed": seed}) for seed in range(seeds)],
            progress=progress,
        )
    return results
