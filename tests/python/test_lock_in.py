"""The controller `lock_in` in whole runs: a second transcription, the rate at its bound, targets, refusals."""

from __future__ import annotations

import math
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.bound import bound_angle_random_walk
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.to_core import datasheet
from lock_in_oracle import LockIn

SEEDS = 24
SPAN = 160


def device(name: str = "dual_mass", **changes: Any) -> fg.Scenario:
    return fg.Scenario.shipped(name).replace(
        {
            "controller.kind": "lock_in",
            "guard.checked": False,
            "adaptation.rate_forgetting": 0.0,
            "adaptation.initial_rate": 0.0,
            **{key.replace("__", "."): value for key, value in changes.items()},
        }
    )


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"device__delay": 3},
        {"adaptation__rate_forgetting": 0.0255, "adaptation__forgetting": 0.003},
        {"controller__force_limit": 0.003, "run__initial_position": (0.0, 0.0), "run__initial_velocity": (0.0, 0.0)},
        {"plant__stiffness_deviation": {"xx": 0.0, "xy": 0.1, "yy": 0.0}, "controller__span": 200},
        {"reference__amplitude": (1.0, 0.6), "reference__phase": (0.3, -1.0), "controller__bandwidth": 0.05},
    ],
    ids=["as shipped", "delay", "forgetting", "from rest at a limit", "quadrature, longer spans", "another reference"],
)
def test_it_computes_the_forces_and_estimates_of_its_equations(changes: dict[str, Any]) -> None:
    scenario = device(**changes)
    ours, oracle, n = fg.Controller(scenario), LockIn(scenario), scenario.controller.span
    record = scenario.replace({"run.duration": 40 * n * scenario.run.step, "run.record_every": 1})
    positions = fg.simulate(record)["measured_position"].values
    force = np.array([(ours.step(k * scenario.run.step, q, None), oracle.step(q)) for k, q in enumerate(positions)])
    assert np.abs(force).max() > 1e-3
    np.testing.assert_allclose(force[:, 0], force[:, 1], rtol=0, atol=1e-9)
    report, (rate, dxx, dxy, dyy, kxx, kxy, kyy, _) = ours.report, oracle.nominal + oracle.theta
    assert report["rate_estimate"] == pytest.approx(rate, abs=1e-9)
    np.testing.assert_allclose(report["damping_estimate"], [dxx, dxy, dyy], atol=1e-9)
    np.testing.assert_allclose(report["stiffness_estimate"], [kxx, kxy, kyy], atol=1e-9)
    assert report["rate_deviation"] == pytest.approx(oracle.deviation, rel=1e-5)
    if not changes:  # the others have not settled
        assert abs(rate - scenario.plant.angular_rate * scenario.plant.scales.time) < 1e-4


# The rate is that of the range, 300 deg/s. For 24 seeds 99.9 % are within 0.6 and 1.5 times the true value; 1.1 times
# the bound is measured with more seeds in benchmarks/results/lock_in.md.
@pytest.mark.parametrize("name", ["dual_mass", "disc", "tuned_in_air", "paper_resonance"])
def test_the_rate_has_the_noise_of_the_bound_and_no_error_of_scale(name: str) -> None:
    scenario = device(name, run__units="SI")
    steps = round(0.2 / scenario.plant.scales.time / scenario.run.step)
    scenario = scenario.replace({"run.duration": steps * scenario.run.step, "run.record_every": steps})
    run = fg.simulate_many([scenario], seeds=range(SEEDS))
    error = run["rate_estimate"].values[:, -1] - scenario.plant.angular_rate
    stated = run["rate_deviation"].values[:, -1]
    bound = bound_angle_random_walk(scenario)
    assert bound is not None
    ratio = error.std(ddof=1) * math.sqrt(0.2) / bound.unknown
    assert 0.6 < ratio < 1.5
    assert 0.6 < math.sqrt((stated**2).mean()) / error.std(ddof=1) < 1.6
    assert (np.abs(error) < 4 * stated).all()
    assert abs(error.mean()) < 4 * error.std(ddof=1) / math.sqrt(SEEDS)


def test_a_drift_of_the_stiffness_that_is_stated_does_not_bias_the_rate() -> None:
    span = 4000.0 * fg.Scenario.shipped("dual_mass").plant.scales.time
    drifting = device(
        device__stiffness_drift=1.0, device__temperature_ramp=10.0 * span, run__duration=4000.0, run__units="SI"
    )
    assert datasheet(drifting).stiffness_drift == pytest.approx(1e-5 * drifting.plant.scales.time, rel=0.5)
    run = fg.simulate_many([drifting.replace({"run.record_every": 80_000})], seeds=range(8))
    error = run["rate_estimate"].values[:, -1] - drifting.plant.angular_rate
    assert (np.abs(error) < 4 * run["rate_deviation"].values[:, -1]).all()
    assert run["rate_trusted"].values[:, -1].all()
    assert np.abs(error).max() < math.radians(0.01)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"reference.kind": "rest"},
            r"reference\.kind is \"rest\": for controller\.kind lock_in, which demodulates both",
        ),
        ({"reference.offset": (0.0, 0.1)}, r"reference\.kind is \"sine\": for controller\.kind lock_in"),
        ({"reference.amplitude": (1.0, 0.0)}, r"reference\.amplitude is \[1\.0, 0\.0\]: for controller\.kind lock_in"),
        ({"reference.frequency": (0.0, 1.0)}, r"reference\.frequency is \[0\.0, 1\.0\]: for controller\.kind lock_in"),
        ({"controller.span": 100}, r"controller\.span is 100: it must lie between 160 and 256"),
        ({"controller.filter": "kalman"}, r"controller\.filter is \"kalman\""),
    ],
)
def test_what_it_cannot_follow_is_refused_by_name(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        device().replace(changes)


def test_lanes_have_the_bits_of_single_runs() -> None:
    scenario = device(run__duration=800.0, run__record_every=160)
    together = fg.simulate_many([scenario], seeds=range(3))
    for seed in range(3):
        single = fg.simulate(scenario.replace({"disturbance.seed": seed}))
        for name in ("rate_estimate", "stiffness_estimate", "control"):
            np.testing.assert_array_equal(together[name].values[seed], single[name].values)
