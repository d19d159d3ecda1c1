"""Estimated cost of a study, before it runs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from ..analysis.task_runs import measure_tasks
from ..scenario import Scenario
from ..simulation.user_controller import ControllerLike

TRIED_STEPS = 2_000  # in each timed run
TRIED_RUNS = 64  # enough to fill lanes and processors


@dataclass(frozen=True)
class Preview:
    """Size of a study; `seconds` is an estimate for this machine."""

    runs: int
    points: int
    seeds: int
    steps: int  #: of all runs
    seconds: float
    rows: list[dict[str, object]]  #: fields of the first points

    @property
    def time(self) -> str:
        """The estimated time as text."""
        if self.seconds < 90.0:
            return f"{self.seconds:.2g} s"
        minutes = self.seconds / 60.0
        return f"{minutes:.2g} min" if minutes < 90.0 else f"{minutes / 60.0:.3g} h"


def seconds(
    scenario: Scenario, runs: int, steps: int, controller: ControllerLike | None, tasks: Sequence[str] = ()
) -> float:
    """Estimated time of `runs` runs with `steps` steps in all, from short runs of one of the scenarios.

    Longer runs cost less per step, as the design of their exponentials does.
    """
    short = scenario.replace({"run.duration": min(scenario.run.steps, TRIED_STEPS) * scenario.run.step})
    tried = 2 if callable(controller) else min(runs, TRIED_RUNS)
    measure_tasks([short], tasks, seeds=range(1), controller=controller)  # imports and designs, which a study does once
    start = time.perf_counter()
    measure_tasks([short], tasks, seeds=range(tried), controller=controller)
    return (time.perf_counter() - start) * steps / (tried * short.run.steps)


def first_rows(fields: Sequence[str], points: Sequence[Sequence[object]], count: int = 5) -> list[dict[str, object]]:
    """The fields of the first points."""
    return [dict(zip(fields, point, strict=True)) for point in points[:count]]
