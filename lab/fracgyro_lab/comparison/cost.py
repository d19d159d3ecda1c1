"""Cost of a step of each controller: time, in one run of this process, and memory."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from fracgyro.scenario import Scenario
from fracgyro.simulation.controller import Controller
from fracgyro.simulation.measure import measure_many

REPEATS = 7
STEPS = 5000  # takes much longer than the setup


def costs(scenarios: Mapping[str, Scenario]) -> dict[str, dict[str, Any]]:
    """Cost by name: ns per step of the closed loop including the plant, ratio to the fastest, bytes of state.

    The time is the minimum of several interleaved measurements, so that other load affects all contenders equally.
    """
    short = {name: s.replace({"run.duration": min(STEPS, s.run.steps) * s.run.step}) for name, s in scenarios.items()}
    least: dict[str, float] = {}
    for _ in range(REPEATS):
        for name, scenario in short.items():
            begin = time.perf_counter()
            measure_many([scenario], seeds=[0])
            taken = (time.perf_counter() - begin) / scenario.run.steps
            least[name] = min(taken, least.get(name, taken))
    fastest = min(least.values(), default=1.0)
    return {
        name: {
            "ns_per_step": 1e9 * taken,
            "relative": taken / fastest,
            "state_bytes": len(Controller(scenarios[name])._core.state),
        }
        for name, taken in least.items()
    }
