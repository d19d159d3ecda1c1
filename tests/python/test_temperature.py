"""The temperature of a device: warm-up, hysteresis, and drifts of single entries and gains."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.scenario.device import Device

BASE = fg.Scenario.shipped("dual_mass").replace({"run.duration": 4000.0})
ONE_KELVIN: dict[str, Any] = {"device.temperature_points": [[0.0, 1.0], [1.0, 1.0]]}


def test_a_warm_up_is_an_exponential_on_top_of_the_ambient() -> None:
    device = Device(temperature_ramp=0.5, warm_up_rise=3.0, warm_up_time=20.0)
    times, values = np.transpose(device.temperature(100.0))
    found = np.interp(at := np.linspace(0.0, 100.0, 9_999), times, values)
    np.testing.assert_allclose(found, 0.5 * at + 3.0 * (1 - np.exp(-at / 20.0)), atol=6e-5)


@pytest.mark.parametrize("width", [0.25, 2.0])
def test_hysteresis_is_a_loop_twice_as_wide_as_the_backlash(width: float) -> None:
    there_and_back = [[0.0, 0.0], [10.0, 10.0], [30.0, -10.0], [50.0, 10.0]]
    device = Device(temperature_points=there_and_back, hysteresis=width)
    times, values = np.transpose(device.temperature(50.0))
    found = np.interp([5.0, 15.0, 45.0], times, values)  # the device is at 5 K each time
    np.testing.assert_allclose(found, [5.0 - width, 5.0 + width, 5.0 - width], rtol=1e-12)
    assert found[1] - found[0] == pytest.approx(2 * width)
    held = np.interp(np.linspace(10.0, 10.0 + 2 * width, 9), times, values)
    np.testing.assert_allclose(held, 10.0 - width, rtol=1e-12)


def test_less_change_than_the_backlash_moves_nothing() -> None:
    device = Device(temperature_points=[[0.0, 1.0], [1.0, 2.9], [2.0, -0.9]], hysteresis=2.0)
    assert {value for _, value in device.temperature(2.0)} == {1.0}


def warm(**changes: Any) -> fg.Scenario:
    return BASE.replace({f"device.{name}": value for name, value in changes.items()} | ONE_KELVIN)


def assert_same_run(found: fg.Scenario, expected: fg.Scenario) -> None:
    got, wanted = (fg.simulate(scenario)["control"].values for scenario in (found, expected))
    np.testing.assert_allclose(got, wanted, atol=1e-7 * np.abs(wanted).max())


def test_entries_that_drift_are_those_entries() -> None:
    k, d = BASE.plant.stiffness, BASE.plant.damping
    stiffness = {"xx": 100e-6 * k.xx, "xy": 30e-6 * np.sqrt(k.xx * k.yy), "yy": -200e-6 * k.yy}
    damping = {"xx": 0.01 * d.xx - 2 * 0.02 * d.xy, "xy": 0.02 * (d.xx - d.yy), "yy": -0.02 * d.yy + 2 * 0.02 * d.xy}
    drifts = {
        "device.spring_drift": (100.0, -200.0),
        "device.quadrature_drift": 30.0,
        "device.damper_drift": (1e4, -2e4),
        "device.damping_axis_drift": 2e4,
    }
    same = {"plant.stiffness_deviation": stiffness, "plant.damping_deviation": damping}
    # A step of the rate too small to see puts both on the same integrator.
    moving = {"rate.kind": "step", "rate.amplitude": 1e-12}
    assert_same_run(BASE.replace({**drifts, **ONE_KELVIN}), BASE.replace({**same, **moving}))


@pytest.mark.parametrize("gain", ["pickoff_gain", "force_gain"])
def test_a_gain_that_drifts_is_that_gain(gain: str) -> None:
    found = warm(**{f"{gain}_drift": (2e3, -3e3)})
    expected = BASE.replace({f"device.{gain}_error": (2e-3, -3e-3), "adaptation.initial_ratio": 1.0})
    assert_same_run(found.replace({"adaptation.initial_ratio": 1.0}), expected)


def test_errors_of_estimates_refer_to_the_warm_plant() -> None:
    scenario = warm(spring_drift=(500.0, -300.0), damper_drift=(2e4, 0.0))
    run = fg.simulate(scenario)
    k, d = scenario.plant.stiffness, scenario.plant.damping
    truth = np.array([k.xx * (1 + 500e-6), k.xy, k.yy * (1 - 300e-6)])
    estimate, weights = run["stiffness_estimate"].values[-1] * scenario.plant.scales.stiffness, np.array([1, 2, 1])
    expected = np.sqrt((weights * (estimate - truth) ** 2).sum() / (weights * truth**2).sum())
    assert float(fg.metrics.stiffness_error(run)[-1]) == pytest.approx(expected, rel=1e-9)
    assert float(fg.metrics.summary(run)["stiffness_error"]) == pytest.approx(expected, rel=1e-6)
    assert d.xx > 0
    truth = np.array([d.xx * 1.02, d.xy, d.yy])
    estimate = run["damping_estimate"].values[-1] * scenario.plant.scales.damping
    expected = np.sqrt((weights * (estimate - truth) ** 2).sum() / (weights * truth**2).sum())
    assert float(fg.metrics.damping_error(run)[-1]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_errors_of_estimates_refer_to_the_plant_of_their_time(units: str) -> None:
    end = BASE.run.duration * BASE.plant.scales.time
    ramp = {"device.temperature_points": [[0.0, 0.0], [end, 2.0]], "device.spring_drift": (500.0, 0.0)}
    scenario = BASE.replace({**ramp, "run.units": units})
    run, k = fg.simulate(scenario), scenario.plant.stiffness
    middle = run.sizes["time"] // 2
    truth = np.array([k.xx * (1 + 500e-6 * 2.0 * middle / (run.sizes["time"] - 1)), k.xy, k.yy])
    unit = 1.0 if units == "SI" else scenario.plant.scales.stiffness
    off, weights = run["stiffness_estimate"].values[middle] * unit - truth, np.array([1, 2, 1])
    expected = np.sqrt((weights * off**2).sum() / (weights * truth**2).sum())
    assert float(fg.metrics.stiffness_error(run)[middle]) == pytest.approx(expected, rel=1e-8)


def test_joint_is_given_the_fastest_drift_of_an_entry() -> None:
    points = {"device.temperature_points": [[0.0, 0.0], [10.0, 2.0]]}
    from fracgyro.scenario.to_core import datasheet

    plain = BASE.replace({**points, "datasheet.stiffness_drift": None, "device.spring_drift": (0.0, -50.0)})
    assert datasheet(plain).stiffness_drift == pytest.approx(50e-6 * 0.2 * BASE.plant.scales.time)
    for own in ((-30.0, 0.0), (0.0, -30.0)):
        both = plain.replace({"device.spring_drift": own, "device.stiffness_drift": -20.0})
        assert datasheet(both).stiffness_drift == pytest.approx(50e-6 * 0.2 * BASE.plant.scales.time)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"device.warm_up_time": 0.0}, "device.warm_up_time is 0.0: it must be"),
        ({"device.hysteresis": -1.0}, "device.hysteresis is -1.0: it must be"),
        (
            {"device.spring_drift": [-2e6, 0.0], **ONE_KELVIN},
            "device.spring_drift is [-2000000.0, 0.0]: over 1 K it makes stiffness negative",
        ),
        (
            {"device.pickoff_gain_drift": [-1e6, 0.0], **ONE_KELVIN},
            "device.pickoff_gain_drift is [-1000000.0, 0.0]: over 1 K a gain would be 0, negative or infinite",
        ),
        (
            {"device.quadrature_drift": -1.7e308, **ONE_KELVIN},
            "device.quadrature_drift is -1.7e+308: over 1 K it makes stiffness negative or infinite",
        ),
        (
            {"device.damper_drift": [0.0, 1.7e308], "device.temperature_points": [[0.0, 0.0], [10.0, 1e12]]},
            "device.damper_drift is [0.0, 1.7e+308]: over 1e+12 K it makes damping negative or infinite",
        ),
        (
            {"device.force_gain_drift": [0.0, 1.7e308], "device.temperature_points": [[0.0, 0.0], [10.0, 1e9]]},
            "device.force_gain_drift is [0.0, 1.7e+308]: over 1e+09 K a gain would be 0, negative or infinite",
        ),
    ],
)
def test_an_impossible_temperature_is_one_sentence(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(fg.ScenarioError) as refused:
        BASE.replace(changes)
    assert sentence in str(refused.value)
