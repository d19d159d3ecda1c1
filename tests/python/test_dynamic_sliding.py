"""Dynamic sliding mode: an independent transcription, and what it is for."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from in_lanes import assert_lanes_agree
from law_oracles import DynamicSliding

PAPER = fg.Scenario.paper().replace({"controller.kind": "dynamic", "controller.force_limit": 1000.0})
SHORT = PAPER.replace({"run.duration": 4.0})
NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
TUNED = {"controller.surface_gain": 120.0, "controller.reaching_rate": 200.0, "controller.force_bandwidth": 400.0}
SWITCHING = TUNED | {"controller.switching_rate": 3e4, "controller.switching_layer": 50.0}
FIXED = {"controller.adaptive": False}


@pytest.mark.parametrize("gains", [{}, TUNED, SWITCHING, FIXED], ids=["default", "tuned", "switching", "fixed"])
@pytest.mark.parametrize("limit", [np.inf, 700.0])
def test_it_is_its_transcription(limit: float, gains: dict[str, Any]) -> None:
    limited = {**gains, **NOISE, "controller.force_limit": limit}
    # The laws (44) with a large s, which the limit prevents, are unstable at such gains.
    learns = {"adaptation.damping_gain": 15.0, "adaptation.stiffness_gain": 15.0, "adaptation.rate_gain": 15.0}
    scenario, law = SHORT.replace(limited | (learns if np.isinf(limit) else {})), DynamicSliding()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-9 * scale)


def error(changes: dict[str, Any]) -> float:
    runs = fg.simulate_many([PAPER.replace({**NOISE, **TUNED, "run.duration": 20.0, **changes})], seeds=range(3))
    return float(np.sqrt((runs["error"].values[:, 10_000:] ** 2).mean()))


def test_it_bears_a_delay_that_nobody_stated() -> None:
    known = error({})
    assert known < 4e-5
    assert error({"device.delay": 1}) < 1.2 * known


def test_its_force_chatters_far_less_than_that_of_the_pd_that_it_follows() -> None:
    def chattering(changes: dict[str, Any]) -> float:
        run = fg.simulate(SHORT.replace({**NOISE, **TUNED, **changes}))
        return float(fg.metrics.chattering(run, (2.0, None)).max())

    assert chattering({}) < 0.25 * chattering({"controller.force_bandwidth": 1e6})


def test_lanes_and_single_precision() -> None:
    assert_lanes_agree([SHORT.replace(gains) for gains in ({}, TUNED, SWITCHING, FIXED)])
