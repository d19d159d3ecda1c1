"""Errors of contenders of the comparison again, by a second program: laws, plant, observer and noise in NumPy."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro_lab.comparison.task import sensed
from fracgyro_lab.comparison.track import Track
from law_oracles import IntegralSliding, Pid, Resonant
from second_program import WithoutReference, errors

BASE = Track().scenarios()["paper"]
PID: dict[str, Any] = {"kind": "pid", "natural_frequency": 60.0, "damping_ratio": 0.9, "integral_frequency": 25.0}
ROWS: dict[str, tuple[Any, str, dict[str, Any]]] = {
    "pid, F": (Pid(), "F", PID),
    "pid, P": (Pid(), "P", {**PID, "observer_bandwidth": 150.0}),
    "resonant, F": (
        Resonant([np.pi, np.pi / 2]),
        "F",
        {"kind": "resonant", "natural_frequency": 65.0, "damping_ratio": 1.15, "integral_frequency": 0.0},
    ),
    "integral_sliding, F": (IntegralSliding(), "F", {"kind": "integral_sliding", "surface_gain": 36.0}),
    "internal_model, P": (WithoutReference(), "P", {"kind": "internal_model", "loop_bandwidth": 0.5}),
}


@pytest.mark.parametrize("row", ROWS)
def test_the_error_of_a_contender_is_that_of_a_second_program(row: str) -> None:
    law, information, gains = ROWS[row]
    changes = {f"controller.{name}": value for name, value in gains.items()}
    scenario = sensed(BASE, information, 1e-13).replace(changes)
    expected = errors(scenario, law)
    found = np.sqrt(
        (fg.measure_many([scenario], seeds=range(20))["rmse"].sel(window=["transient", "steady"]) ** 2).mean("run")
    )
    # The transient has little noise in it; 20 seeds of 10,000 correlated samples scatter by 1 %.
    np.testing.assert_allclose(found.values[0], expected[0], rtol=0.003)
    np.testing.assert_allclose(found.values[1], expected[1], rtol=0.03)
