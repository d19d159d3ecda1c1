"""What a step of each controller costs: time, in one run of this process, and memory."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from fracgyro.scenario import Scenario
from fracgyro.simulation.controller import Controller
from fracgyro.simulation.measure import measure_many

REPEATS = 7
STEPS = 5000  # long against what setting up takes


def costs(scenarios: Mapping[str, Scenario]) -> dict[str, dict[str, Any]]:
    """By name: nanoseconds a step of the closed loop, the plant included; as often as the fastest's; bytes of state.

    The least of several measurements, taken in turns, so that what else the machine does weighs on all alike.
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
