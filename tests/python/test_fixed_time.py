"""Fixed-time sliding mode: an independent transcription, and that it learns."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from in_lanes import assert_lanes_agree
from law_oracles import FixedTime

PAPER = fg.Scenario.paper().replace({"controller.kind": "fixed_time", "controller.force_limit": 1000.0})
SHORT = PAPER.replace({"run.duration": 4.0})
NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
EXPLICIT = {"controller.reaching": "explicit", "controller.far_reaching": 60.0}
SLOW: dict[str, Any] = {"controller.near_gain": 3.0, "controller.far_exponent": 1.8, "controller.near_floor": 1e-2}
FIXED = {"controller.adaptive": False}


@pytest.mark.parametrize("gains", [{}, EXPLICIT, SLOW, FIXED], ids=["default", "explicit", "slow", "fixed"])
@pytest.mark.parametrize("limit", [np.inf, 700.0])
def test_it_is_its_transcription(limit: float, gains: dict[str, Any]) -> None:
    scenario, law = SHORT.replace({**gains, **NOISE, "controller.force_limit": limit}), FixedTime()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-9 * scale)


def test_lanes_and_single_precision() -> None:
    assert_lanes_agree([SHORT.replace(gains) for gains in ({}, SLOW, {"controller.near_gain": 5.0}, FIXED)])
