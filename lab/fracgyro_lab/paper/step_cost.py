"""Cost of a step of the proposed controller, compared with the conventional controller: claim i."""

from __future__ import annotations

import time
from dataclasses import dataclass

from fracgyro import _core
from fracgyro.scenario.to_core import core_setup

from .runs import scenario

TIMING_REPEATS = 7
SHORT = 20.0  # length of the runs that are timed


@dataclass(frozen=True)
class StepCost:
    """Timings of the proposed controller: over the conventional one's, and in seconds a step."""

    ratios: tuple[float, ...] = ()
    seconds: tuple[float, ...] = ()
    exponentials: int = 0


def time_steps(variant: str) -> StepCost:
    """Times both controllers in turn, inside the compiled loop, on one thread. Nothing else should be running."""
    names = ("proposed", "conventional")
    setups = {c: core_setup(scenario(variant, c).replace({"run.duration": SHORT})) for c in names}
    ratios, costs = [], []
    for _ in range(TIMING_REPEATS):
        seconds = {}
        for controller, setup in setups.items():
            start = time.perf_counter()
            _core.record_runs([setup], setup.steps, 1)  # the first sample and the last: only the loop
            seconds[controller] = time.perf_counter() - start
        ratios.append(seconds["proposed"] / seconds["conventional"])
        costs.append(seconds["proposed"] / (setups["proposed"].steps + 1))
    return StepCost(tuple(ratios), tuple(costs), setups["proposed"].kernel.count)
