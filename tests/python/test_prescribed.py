"""Prescribed performance: an independent transcription, and the bound in noise."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from in_lanes import assert_lanes_agree
from law_oracles import Prescribed

PAPER = fg.Scenario.paper().replace({"controller.kind": "prescribed", "controller.force_limit": 1000.0})
SHORT = PAPER.replace({"run.duration": 4.0})
NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
FIXED = {"controller.adaptive": False}
CUBES = {"controller.barrier_root": 0.0, "controller.barrier_cube": 0.5, "controller.damper_cube": 100.0}
# A spring of 200, at a bound below what it leaves.
FUNNEL = FIXED | {
    "controller.barrier_shape": "funnel",
    "controller.bound_start": 0.6,
    "controller.barrier_scale": 0.25,
}
INFEASIBLE = FIXED | {"controller.bound_final": 1e-4, "controller.barrier_scale": 50.0}


@pytest.mark.parametrize("gains", [{}, FIXED, CUBES, FUNNEL], ids=["default", "fixed", "cubes", "funnel"])
@pytest.mark.parametrize("limit", [np.inf, 700.0])
def test_it_is_its_transcription(limit: float, gains: dict[str, Any]) -> None:
    changes = {"controller.barrier_root": 0.0, **gains, **NOISE, "controller.force_limit": limit}
    scenario, law = SHORT.replace(changes), Prescribed()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-6 * scale)  # the difference
    end = 0.01 + 0.99 * np.exp(-5.0 * 4.0)
    np.testing.assert_allclose(found["error_bound"].values[-1], end, rtol=1e-3)


def test_the_bound_is_kept_where_the_spring_in_it_keeps_it() -> None:
    kept = {"controller.bound_final": 1e-3, "controller.barrier_scale": 5.0}
    runs = fg.simulate_many([PAPER.replace({**NOISE, **FIXED, **kept, "run.duration": 6.0})], seeds=range(10))
    assert not runs["bound_left"].values.any()
    assert (np.abs(runs["error"].values) < runs["error_bound"].values).all()


def test_a_bound_that_cannot_be_kept_is_reported_and_control_is_not_lost() -> None:
    run = fg.simulate(PAPER.replace({**NOISE, **INFEASIBLE, "run.duration": 6.0}))
    assert run["bound_left"].values[-1] == 1.0
    assert run["bound_widened"].values[4000:].mean() > 0.5
    assert np.abs(run["error"].values[4000:]).max() < 1e-3


def test_lanes_and_single_precision() -> None:
    assert_lanes_agree([SHORT.replace(gains) for gains in ({}, FIXED, CUBES, FUNNEL, INFEASIBLE)])
