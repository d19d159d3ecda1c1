"""Rows of the comparison's log again, by a second program: laws, plant, observer and noise in NumPy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fracgyro_lab.comparison.plan import TASKS
from fracgyro_lab.comparison.task import sensed
from law_oracles import IntegralSliding, Pid, Resonant
from second_program import WithoutReference, errors

TRACK = TASKS["track"]
BASE = TRACK.scenarios()["paper"]
LOG = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "compare-track.json"
LAWS: dict[str, Any] = {
    "pid": Pid,
    "resonant": lambda: Resonant([np.pi, np.pi / 2]),
    "integral_sliding": IntegralSliding,
    "internal_model": WithoutReference,
}
ROWS = [
    ("pid", "F", 0.0035),
    ("pid", "P", 0.05),
    ("resonant", "F", 0.0035),
    ("integral_sliding", "F", 0.05),
    ("internal_model", "P", 0.0035),
]


@pytest.mark.parametrize(("name", "information", "ceiling"), ROWS)
def test_a_row_of_the_log_is_that_of_a_second_program(name: str, information: str, ceiling: float) -> None:
    def is_asked(row: dict[str, Any]) -> bool:
        place = (row["name"], row["scenario"], row["class"], row["noise"], row["ceiling"])
        return place == (name, "paper", information, 1e-13, ceiling)

    (row,) = filter(is_asked, json.loads(LOG.read_text(encoding="utf-8"))["contenders"])
    (contender,) = (each for each in TRACK.contenders if each.name == name)
    scenario = contender.scenario(sensed(BASE, information, 1e-13)).replace(row["gains"])
    expected = errors(scenario, LAWS[name]())
    found = [[row["metrics"][f"rmse_{when}_{axis}"]["value"] for axis in "xy"] for when in ("transient", "steady")]
    # The transient has little noise in it; 20 seeds of 10,000 correlated samples scatter by 1 %.
    np.testing.assert_allclose(found[0], expected[0], rtol=0.003)
    np.testing.assert_allclose(found[1], expected[1], rtol=0.03)
