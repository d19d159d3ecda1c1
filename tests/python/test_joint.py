"""Joint adaptation in whole runs: its error reaches the bound with any electronics; its assumptions."""

from __future__ import annotations

import math
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.to_core import datasheet

SEEDS = 24
SPAN = 4000.0  # 0.16 s of the dual mass
DEGREES = 180.0 / math.pi


def device(**changes: Any) -> fg.Scenario:
    """The dual mass with positions only, 1e-13 m/sqrt(Hz) and the joint filter."""
    steps = round(SPAN / 0.05)
    return fg.Scenario.shipped("dual_mass").replace(
        {
            "adaptation.kind": "joint",
            "adaptation.rate_forgetting": 0.0,
            "adaptation.initial_rate": 0.0,
            "device.sensing": "position",
            "device.position_noise_density": 1e-13,
            "run.duration": SPAN,
            "run.record_every": steps,
            "run.units": "SI",
            **{key.replace("__", "."): value for key, value in changes.items()},
        }
    )


def ends(scenario: fg.Scenario, trusted: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Errors at the end of each run and the deviations that it states, deg/s."""
    run = fg.simulate_many([scenario], seeds=range(SEEDS))
    error = run["rate_estimate"].values[:, -1] - scenario.plant.angular_rate
    assert (run["rate_trusted"].values[:, -1] == trusted).all()
    return DEGREES * error, DEGREES * run["rate_deviation"].values[:, -1]


def walk(error: np.ndarray, scenario: fg.Scenario) -> float:
    """Angle random walk in deg/sqrt(h)."""
    return float(error.std(ddof=1)) * math.sqrt(SPAN * scenario.plant.scales.time) * 60.0


# For 24 seeds 99.9 % are within 0.6 and 1.5 times the true value.
@pytest.mark.parametrize(
    ("changes", "bound"),
    [
        ({"device__position_noise_density": 0.0}, 0.00789),
        ({}, 0.0180),
        ({"device__sensing": "full", "device__velocity_noise_density": 1e-13 * 24661.5}, 0.0139),
        ({"device__position_noise_density": 1e-12}, 0.162),
        ({"adaptation__covariance_steps": 8}, 0.0180),
    ],
)
def test_its_error_is_that_of_the_bound_and_what_it_states(changes: dict[str, Any], bound: float) -> None:
    scenario = device(**changes)
    error, stated = ends(scenario)
    assert 0.6 < walk(error, scenario) / bound < 1.5
    assert 0.6 < error.std(ddof=1) / stated.mean() < 1.5
    assert abs(error.mean()) < 4 * stated.mean() / math.sqrt(SEEDS)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"adaptation__initial_ratio": 0.95},
        {"run__initial_position": (0.0, 0.0), "run__initial_velocity": (0.0, 0.0)},
        {"device__delay": 1, "plant__stiffness_deviation": {"xx": 0.0, "xy": 0.37, "yy": 0.0}},
        {"adaptation__initial_ratio": 1.05, "adaptation__covariance_steps": 4},
    ],
)
def test_its_scale_factor_is_right_to_3_ppm(changes: dict[str, Any]) -> None:
    error, _ = ends(device(**changes))  # at 300 deg/s
    assert abs(error.mean()) < 3e-6 * 300.0


def test_a_converter_of_16_bit_costs_less_than_its_noise_were_it_white() -> None:
    scenario = device(device__position_noise_density=0.0, device__position_range=6.25e-6, device__position_bits=16)
    error, _ = ends(scenario)
    assert walk(error, scenario) < 1.5 * 0.0180  # 16 bit count as 1.1e-13 m/sqrt(Hz)


def test_a_delay_that_is_hidden_from_it_is_not_trusted_and_in_its_deviation() -> None:
    error, stated = ends(device(device__delay=1, datasheet__delay=0), trusted=False)
    assert (abs(error) < 4 * stated).all()
    assert stated.mean() > 10 * ends(device())[1].mean()
    assert abs(error.mean()) < 1e-3 * 300.0


def test_its_deviation_is_what_it_is_told_and_the_estimate_hardly_depends_on_it() -> None:
    error, stated = ends(device())
    force = datasheet(device()).force_noise
    other, claimed = ends(device(datasheet__force_noise=10.0 * force))
    assert abs(other - error).max() < 2.0 * stated.mean()
    assert claimed.mean() > 3.0 * stated.mean()


def test_a_drifting_stiffness_that_the_datasheet_states_is_little_of_a_rate() -> None:
    steady = fg.Scenario.shipped("dual_mass").run.duration
    changes: dict[str, Any] = {
        "plant__angular_rate": 0.0,
        "adaptation__rate_forgetting": 0.0255,
        "device__stiffness_drift": -30.0,
        "device__temperature_ramp": 0.33,
        "run__duration": steady,
        "run__record_every": 16,
    }

    def rms(**more: Any) -> float:
        run = fg.simulate(device(**changes, **more))
        later = run["rate_estimate"].values[run.sizes["time"] // 2 :] * DEGREES
        return float(np.sqrt((later**2).mean()))

    assert rms() < 0.01 < 1.0 < rms(datasheet__stiffness_drift=0.0)  # deg/s


def test_it_is_told_the_truth_unless_something_else_is_said() -> None:
    scenario = device(device__delay=2, device__position_range=6.25e-6, device__position_bits=12)
    known = datasheet(scenario)
    step = scenario.run.step * scenario.plant.scales.time
    noise = math.hypot(1e-13 * math.sqrt(0.5 / step), 2 * 6.25e-6 / 2**12 / math.sqrt(12)) / 5e-6
    assert known.position_noise == pytest.approx(noise, rel=1e-12)
    assert known.force_noise == pytest.approx(math.sqrt(8.66056e-16 / 0.05), rel=1e-12)
    assert known.delay == 2
    assert datasheet(scenario.replace({"datasheet.delay": 1, "datasheet.position_noise": 0.5})).model_dump() == {
        **known.model_dump(),
        "delay": 1,
        "position_noise": 0.5,
    }
    assert datasheet(device(device__delay=40)).delay == 8


def test_noise_that_is_held_counts_with_its_density() -> None:
    held = device(disturbance__hold=0.2)
    assert datasheet(held).force_noise == pytest.approx(datasheet(device()).force_noise, rel=1e-12)


def test_what_is_told_belongs_to_controllers_that_ask_for_it() -> None:
    with pytest.raises(ScenarioError) as caught:
        fg.Scenario().replace({"controller.kind": "pid", "datasheet.delay": 1})
    assert str(caught.value) == (
        'datasheet.delay is 1: it needs controller.kind = "fractional_fast_terminal", "fractional", "fast_terminal", '
        '"linear", "lqg", "internal_model", "lock_in", "open_loop", "force_rebalance", "whole_angle", '
        '"virtual_rotation" or "mode_reversal", '
        'but controller.kind is "pid"; or controller.filter = "kalman"'
    )
    with pytest.raises(ScenarioError, match=r"datasheet\.delay is 9: it must lie between 0 and 8"):
        fg.Scenario().replace({"datasheet.delay": 9})
    with pytest.raises(ScenarioError, match=r"adaptation\.covariance_steps is 9: it must lie between 1 and 8"):
        fg.Scenario().replace({"adaptation.covariance_steps": 9})
