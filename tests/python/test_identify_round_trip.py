"""The round trip: a simulated device is recorded on its bench, identified, and simulated again from its scenario."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest

TURN = 0.02  # rad, from the principal axes to the pick-offs
RATIOS = {"dual mass": 1.01, "data sheet": 0.985}
EVERY, SAMPLES = 8, 30_000  # steps between samples of the record
NOISE = 3e-13  # m/sqrt(Hz), of the pick-offs
SEEDS = (1, 2)


def shipped(name: str) -> fg.Scenario:
    """The device in its principal axes, with pick-offs at these axes and of equal gains."""
    if name == "dual mass":
        return fg.Scenario.shipped("dual_mass")
    made = fg.device(("15 kHz", "15.2 kHz"), (20_000, 8_000), mass="300 ug", amplitude="5 um")
    return made.scenario()


@cache
def identified(name: str, seed: int) -> fg.identify.Found:
    """From the free decay that `fg.Plant` gives: thermal motion, noise and pick-offs as of the device."""
    device = shipped(name).replace(
        {
            "device.pickoff_gain_error": (0.0, RATIOS[name] - 1),
            "device.pickoff_misalignment": -TURN,
            "device.force_misalignment": -TURN,
            "device.position_noise_density": NOISE,
            "disturbance.seed": seed,
            "run.initial_position": (0.7, 0.1),
            "run.initial_velocity": (0.1, -0.7),
            "run.units": "SI",
        }
    )
    plant, record = fg.Plant(device), np.empty((2, SAMPLES))
    for i in range(SAMPLES):
        record[:, i] = plant.motion.position
        for _ in range(EVERY):
            plant.step((0.0, 0.0))
    interval = EVERY * device.run.step / device.plant.reference_frequency
    return fg.identify(fg.identify.Record(*record, interval=interval), mass=device.plant.mass, pickoff=1.0)


def in_pickoff_axes(name: str, nominal: fg.Scenario, known: float | None = None) -> fg.Scenario:
    """The device, in the axes of its pick-offs, of which a controller knows `nominal`; `known`: another pick-off ratio
    that it knows."""
    turn = np.array([[math.cos(TURN), -math.sin(TURN)], [math.sin(TURN), math.cos(TURN)]])
    changes: dict[str, object] = {"device.pickoff_gain_error": (0.0, RATIOS[name] - 1)}
    if known is not None:
        changes["datasheet.pickoff_gain_error"] = (0.0, known - 1)
    for entry in ("stiffness", "damping"):
        own, known = getattr(shipped(name).plant, entry), getattr(nominal.plant, entry)
        true = turn @ np.array([[own.xx, own.xy], [own.xy, own.yy]]) @ turn.T
        deviation = {"xx": true[0, 0] - known.xx, "xy": true[0, 1] - known.xy, "yy": true[1, 1] - known.yy}
        changes[f"plant.{entry}_deviation"] = deviation
    return nominal.replace(changes)


def rates(scenario: fg.Scenario, rate: float, first: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Times, s, and rate estimates, rad/s, of a run at this rate."""
    changes = {"plant.angular_rate": rate, "run.units": "SI", "run.duration": 8000.0, "run.record_every": 10}
    run = fg.simulate(scenario.replace({**changes, "adaptation.initial_rate": first}))
    return run["time"].values, run["rate_estimate"].values


def late(scenario: fg.Scenario, rate: float) -> float:
    values = rates(scenario, rate)[1]
    return float(values[len(values) // 2 :].mean())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", RATIOS)
def test_a_recorded_device_is_found_in_its_principal_axes(name: str, seed: int) -> None:
    found = identified(name, seed)
    assert not [each.words for each in found.tests if each.verdict == "fail"]
    known, scenario = shipped(name).plant, found.scenario(axes="principal")
    for entry in ("xx", "yy"):
        for field, quantity in (("stiffness", "k"), ("damping", "d")):
            value = getattr(getattr(scenario.plant, field), entry)
            half = found[f"{quantity}{entry}"].half
            assert value == pytest.approx(getattr(getattr(known, field), entry), abs=2 * half)
    assert scenario.device.pickoff_misalignment == pytest.approx(-TURN, abs=1e-4)
    assert abs(found["pickoff_ratio"].value - RATIOS[name]) < 2 * found["pickoff_ratio"].half
    # Every 8th sample of white noise: 8 times the power below half of the new sampling rate.
    assert scenario.device.position_noise_density == pytest.approx(math.sqrt(EVERY) * NOISE, rel=0.15)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", RATIOS)
def test_the_errors_of_a_sensor_told_the_identified_device_are_those_predicted(name: str, seed: int) -> None:
    """Against a sensor that knows the device exactly, in the same noise."""
    found, full = identified(name, seed), shipped(name).plant.angular_rate
    prediction = found.prediction
    assert prediction is not None
    nominal = found.scenario()
    nearly = in_pickoff_axes(name, nominal)
    exact = in_pickoff_axes(name, nominal, RATIOS[name])
    still, turned = (late(nearly, rate) - late(exact, rate) for rate in (0.0, full))
    assert abs(math.degrees(still) * 3600) < 1.6 * prediction.bias
    assert abs(turned - still) / full * 1e6 < 1.6 * prediction.scale_factor
    untold = in_pickoff_axes(name, nominal, 1.0)
    before = (late(untold, full) - late(exact, full)) / full * 1e6
    assert before == pytest.approx(-5e5 * (RATIOS[name] - 1), rel=0.1)
    assert prediction.scale_factor < 0.1 * abs(before)


@pytest.mark.parametrize("name", RATIOS)
def test_a_joint_filter_settles_sooner_from_the_identified_scenario(name: str) -> None:
    """Than from the device as shipped, whose axes are not turned and whose pick-offs are equal.

    From an estimate of zero to within 2 %; the controller knows the identified ratio, or none.
    """
    full, found = shipped(name).plant.angular_rate, identified(name, 1)
    nominal = found.scenario()
    noise = {"device.position_noise_density": nominal.device.position_noise_density}
    settled = []
    for known in (nominal, shipped(name).replace(noise)):
        time, values = rates(in_pickoff_axes(name, known), full, first=0.0)
        settled.append(time[np.flatnonzero(abs(values - full) > 0.02 * full)[-1]])
    assert settled[0] < 0.5 * settled[1]


def test_the_figures_of_the_identified_sensor_are_those_of_the_device(tmp_path: Path) -> None:
    """`fracgyro rate --quick` of both, in shorter runs: each figure's interval holds the other's value.

    The pick-offs of the identified one are turned and unequal, which its controller knows.
    """
    found = identified("dual mass", 1)
    noise = {"device.position_noise_density": found.scenario().device.position_noise_density}
    short = {"run.duration": 5000.0, "run.step": 0.1, "plant.angular_rate": shipped("dual mass").plant.angular_rate}
    figures = []
    for i, scenario in enumerate((found.scenario(axes="principal"), shipped("dual mass").replace(noise))):
        aligned = {"device.force_misalignment": 0.0, "adaptation.initial_ratio": 1.0,
                   "reference.amplitude": (1.0, 1.0), "plant.reference_length": 5e-6}  # fmt: skip
        listed = fg.rate.characterise(scenario.replace({**short, **aligned}), tmp_path / f"{i}", quick=True, rest=0.2)
        figures.append({each.key: each for each in listed})
    one, other = figures
    for key in ("scale_factor_error", "zero_rate_output", "zero_rate_rms", "quadrature_residual", "damping_residual"):
        width = max(one[key].high - one[key].low, other[key].high - other[key].low)
        assert abs(one[key].value - other[key].value) < width, key
    assert one["full_scale"].value == pytest.approx(other["full_scale"].value, rel=0.01)
    assert one["bandwidth"].value == pytest.approx(other["bandwidth"].value, rel=0.05)
