"""Composite adaptation: against the oracle, against the Cramér-Rao bound, and through Python. Reading order: agreement,
the bound, a dynamic rate, trust, one sample at a time, many runs.
"""

from __future__ import annotations

import math

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro import _core
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.to_core import core_setup
from test_loop import QUIET, assert_agrees, sharp

COMPOSITE = {"adaptation.kind": "composite"}
PAPER = fg.Scenario.paper().replace(COMPOSITE)
SHORT = PAPER.replace({"run.duration": 2.0})
CASES = {
    "as it stands": {},
    "no disturbance": QUIET,
    "forgetting, another guess": {
        "adaptation.forgetting": 0.5,
        "adaptation.rate_forgetting": 2.0,
        "adaptation.initial_rate": -0.02,
    },
    "linear, printed, turning the other way": {
        "controller.kind": "linear",
        "controller.rate_law": "printed",
        "plant.angular_rate": -80.0,
    },
    "known parameters need no adaptation": {"controller.adaptive": False, "run.duration": 1.0},
}


@pytest.mark.parametrize("case", CASES)
def test_composite_adaptation_agrees_with_the_oracle(case: str) -> None:
    scenario = sharp("corrected", {**COMPOSITE, "run.duration": 2.0, **CASES[case]})
    expected = assert_agrees(scenario, 2e-10)
    if scenario.controller.adaptive:
        run = fg.simulate(scenario)
        np.testing.assert_allclose(run["rate_deviation"], expected["deviation"], rtol=1e-6, atol=1e-9)
        np.testing.assert_array_equal(run["rate_trusted"], expected["trusted"])


# -- The bound -----------------------------------------------------------------------------------------------


def bounds(run: xr.Dataset, until: float) -> np.ndarray:
    """Least standard deviations of Omega_z, D and K by the time, from the run's own motion and noise of variance 1."""
    h = 1e-3
    n = round(until / h)
    q, v = run["position"].values[: n + 1], run["velocity"].values[:n]
    mean_q, mean_v = (q[1:] + q[:-1]) / 2, v  # to the first order in h, which is plenty here
    nothing = np.zeros(n)
    x = np.stack([-2 * mean_v[:, 1], mean_v[:, 0], mean_v[:, 1], nothing, mean_q[:, 0], mean_q[:, 1], nothing])
    y = np.stack([2 * mean_v[:, 0], nothing, mean_v[:, 0], mean_v[:, 1], nothing, mean_q[:, 0], mean_q[:, 1]])
    return np.sqrt(np.diag(np.linalg.inv(x @ x.T + y @ y.T)))


def test_the_estimates_reach_the_cramer_rao_bound_and_say_so() -> None:
    # RMS over 40 seeds: known to within 11 %, so that three sigma are a third.
    scenario = PAPER.replace({"run.duration": 10.0, "adaptation.initial_rate": 0.0})
    runs = fg.simulate_many([scenario], seeds=range(40))
    damping, stiffness, rate = scenario.plant.nondimensional()[:3]
    for until in (2.0, 10.0):
        at = runs.sel(time=until, method="nearest")
        found = np.column_stack([at["rate_estimate"], at["damping_estimate"], at["stiffness_estimate"]])
        off = np.sqrt(np.mean((found - [rate, *damping, *stiffness]) ** 2, axis=0))
        ratio = off / bounds(runs.isel(run=0), until)
        assert ((ratio > 0.67) & (ratio < 1.33)).all(), ratio
        np.testing.assert_allclose(at["rate_deviation"], bounds(runs.isel(run=0), until)[0], rtol=0.1)
    late = np.abs(runs["rate_estimate"].sel(time=slice(0.5, None)).values)
    assert late.max() < 2 * rate


def test_the_noise_level_is_found_whatever_it_is() -> None:
    deviations = {}
    for level in (0.1, 1.0, 10.0):
        run = fg.simulate(SHORT.replace({"disturbance.standard_deviation": level}))
        deviations[level] = float(run["rate_deviation"][-1]) / level
    np.testing.assert_allclose(list(deviations.values()), deviations[1.0], rtol=0.05)


def test_tracking_is_no_worse_than_with_the_gradient_law() -> None:
    scenario = PAPER.replace({"run.duration": 20.0})
    gradient = scenario.replace({"adaptation.kind": "gradient"})
    runs = fg.measure_many([scenario, gradient], seeds=range(16))
    rmse = runs["rmse"].sel(window=["transient", "steady"]).values.reshape(2, 16, 2, 2).mean(axis=1)
    assert (rmse[0] < rmse[1]).all()


def test_four_times_the_forgetting_of_the_rate_is_twice_the_deviation_which_errors_keep_to() -> None:
    scenarios = [PAPER.replace({"run.duration": 20.0, "adaptation.rate_forgetting": rate}) for rate in (1.0, 4.0)]
    late = fg.simulate_many(scenarios, seeds=range(8)).sel(time=slice(5, None))
    deviation = late["rate_deviation"].mean("time").values.reshape(2, 8).mean(axis=1)
    assert deviation[1] / deviation[0] == pytest.approx(2.0, rel=0.1)
    # The estimator assumes a varying rate. A constant rate is estimated as with a window of 2/forgetting: better by
    # sqrt 2.
    off = np.sqrt(((late["rate_estimate"] - 0.1) ** 2).mean("time").values.reshape(2, 8).mean(axis=1))
    np.testing.assert_allclose(off / deviation, 1 / math.sqrt(2), rtol=0.25)


def test_forgetting_at_a_rate_follows_a_step_at_that_rate() -> None:
    scenario = PAPER.replace({"run.duration": 6.0, "adaptation.rate_forgetting": 2.0})
    advances = [np.array(_core.plant_map(core_setup(scenario, {"plant.angular_rate": rate}))) for rate in (-0.2, 0.2)]
    random = np.random.default_rng(1)

    def rates() -> list[float]:
        controller, state, found = fg.Controller(scenario), np.array([0.5, 0.5, 0.0, 0.0]), []
        for n in range(5500):
            force = controller.step(n * 1e-3, state[:2].tolist(), state[2:].tolist())
            found.append(controller.estimates.rate)
            state = advances[n >= 4000] @ [*state, *(force + random.normal(size=2))]
        return found

    mean = np.mean([rates() for _ in range(8)], axis=0)
    assert mean[3999] == pytest.approx(-0.2, abs=0.01)
    for later in (0.5, 1.0, 1.499):
        left = (0.2 - mean[round(1000 * (4 + later))]) / 0.4
        assert left == pytest.approx(math.exp(-2.0 * later), abs=0.08)


# -- Trust ---------------------------------------------------------------------------------------------------


def test_without_motion_nothing_is_believed() -> None:
    rest = {"reference.amplitude": (0.0, 0.0), "run.initial_position": (0.0, 0.0)}
    run = fg.simulate(SHORT.replace(rest))
    assert not run["rate_trusted"].any()
    assert float(run["rate_deviation"][-1]) > 1.0


def test_with_one_axis_at_rest_the_rate_is_not_told_from_the_damping_between_them() -> None:
    one = {"reference.amplitude": (1.0, 0.0), "run.initial_position": (0.5, 0.0)}
    assert not fg.simulate(SHORT.replace({**one, **QUIET}))["rate_trusted"][1000:].any()
    both = fg.simulate(SHORT)["rate_trusted"].values
    assert not both[:10].any()
    assert both[500:].all()


def test_the_force_believes_least_squares_from_when_the_rate_is_first_trusted() -> None:
    gradient, run = fg.simulate(SHORT.replace({"adaptation.kind": "gradient"})), fg.simulate(SHORT)
    first = int(np.argmax(run["rate_trusted"].values))
    assert first > 10
    same = (run["control"] == gradient["control"]).all("axis").values
    assert same[:first].all()
    assert not same[first:].any()


def test_a_force_one_step_late_throws_the_estimates_and_neither_the_loop_nor_them_for_long() -> None:
    late = PAPER.replace({"device.delay": 1, "adaptation.forgetting": 0.1, "run.duration": 15.0})
    runs = fg.simulate_many([late], seeds=range(8))
    assert np.abs(runs["rate_estimate"].values).max() > 1000 * 0.1
    end = runs.sel(time=slice(10.0, None))
    assert end["rate_trusted"].all()
    np.testing.assert_allclose(end["rate_estimate"], 0.1, atol=0.03)
    assert np.abs(end["error"]).max() < 1e-3


# First fits jump. If mistaken for a sensor that jumps, they would be repeated endlessly.
def test_it_begins_again_once_where_a_hidden_delay_makes_it_disagree() -> None:
    scenario = exactly_sensed("tuned_in_air").replace(
        {
            **COMPOSITE,
            "adaptation.rate_forgetting": 0.031,
            "device.delay": 1,
            "plant.angular_rate": 0.0,
            "run.duration": 6000.0,
        }
    )
    run = fg.simulate(scenario)
    late = run.isel(time=slice(round(0.85 * run.sizes["time"]), None))
    error = np.abs(late["rate_estimate"].values)
    assert (error < 4.0 * late["rate_deviation"].values).mean() > 0.99
    assert error.max() < math.radians(100.0) / scenario.plant.scales.rate


# -- One sample at a time ------------------------------------------------------------------------------------


def test_a_saved_controller_resumes_bit_for_bit_and_tells_what_the_run_tells() -> None:
    run = fg.simulate(SHORT)
    controller = fg.Controller(SHORT)
    inputs = list(zip(run["time"].values, run["position"].values, run["velocity"].values, strict=True))
    for n, (time, position, velocity) in enumerate(inputs):
        reported = controller.estimates
        assert reported.rate == run["rate_estimate"].values[n]
        assert reported.rate_deviation == run["rate_deviation"].values[n]
        assert reported.rate_trusted == bool(run["rate_trusted"].values[n])
        if n == 1000:
            saved = controller.state
            controller = fg.Controller(SHORT)
            controller.state = saved
        np.testing.assert_array_equal(controller.step(time, position, velocity), run["control"].values[n])


def test_the_gradient_law_does_not_claim_to_know() -> None:
    gradient = SHORT.replace({"adaptation.kind": "gradient"})
    run = fg.simulate(gradient)
    assert "rate_deviation" not in run
    assert "rate_trusted" not in run
    reported = fg.Controller(gradient).estimates
    assert math.isnan(reported.rate_deviation)
    assert not reported.rate_trusted
    both = fg.simulate_many([SHORT, gradient])
    assert both["rate_deviation"][0].notnull().all()
    assert both["rate_deviation"][1].isnull().all()
    assert "rate_deviation" not in fg.simulate_many([gradient])


def test_a_known_plant_needs_no_sensing() -> None:
    known = SHORT.replace({"controller.adaptive": False, "adaptation.initial_rate": 0.5})
    run = fg.simulate(known)
    assert (run["rate_estimate"] == 0.1).all()
    assert "rate_deviation" not in run


def test_si_units_scale_the_deviation() -> None:
    run, si = fg.simulate(SHORT), fg.simulate(SHORT.replace({"run.units": "SI"}))
    np.testing.assert_allclose(si["rate_deviation"].values, 1000.0 * run["rate_deviation"].values, rtol=1e-14)
    assert si["rate_deviation"].attrs["units"] == "rad/s"
    np.testing.assert_array_equal(si["rate_trusted"], run["rate_trusted"])


# -- Many runs -----------------------------------------------------------------------------------------------


def test_in_lanes_the_metrics_are_those_of_single_runs() -> None:
    scenarios = [
        PAPER.replace({**changes, "run.duration": 3.0, "disturbance.seed": seed})
        for seed, changes in enumerate(
            [
                {},
                {"adaptation.kind": "gradient"},
                {"adaptation.rate_forgetting": 3.0},
                {"adaptation.forgetting": 0.3},
                {"controller.kind": "linear", "plant.angular_rate": -50.0},
                {"controller.kind": "fast_terminal", "controller.force_limit": 1e3},
                {"controller.switching_limit": 0.02},
            ]
        )
    ]
    found = fg.measure_many(scenarios, transient=1.0)
    for i, scenario in enumerate(scenarios):
        single = fg.metrics.summary(fg.simulate(scenario), transient=1.0)
        for name in ("rmse", "rate_error", "rate_error_rms", "damping_error", "stiffness_error", "largest_force"):
            np.testing.assert_allclose(found[name].isel(run=i), single[name], rtol=1e-8, atol=1e-12, err_msg=name)
