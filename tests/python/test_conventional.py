"""The conventional gyroscope's noise, against the bound of one driven axis."""

from __future__ import annotations

import math
import re

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.units import DEG_PER_ROOT_H
from fracgyro.scenario import Scenario
from fracgyro.scenario.suspicious import suspicious
from fracgyro.simulation.rate_means import rate_means

DUAL_MASS = Scenario.shipped("dual_mass")
OMEGA = DUAL_MASS.plant.reference_frequency
HZ = 2 * math.pi / OMEGA
LOOPS = {
    "plant.angular_rate": 0.0,
    "adaptation.initial_rate": 0.0,
    "reference.amplitude": (1.0, 0.0),
    "run.initial_position": (0.0, 0.0),
    "controller.pll_bandwidth": 100 * HZ,
    "controller.amplitude_bandwidth": 100 * HZ,
    "controller.amplitude_integral": 20 * HZ,
    "controller.demodulation_bandwidth": 2000 * HZ,
    "controller.output_bandwidth": 90 * HZ,
}
REBALANCED = LOOPS | {"controller.kind": "force_rebalance", "controller.rebalance_bandwidth": 200 * HZ}
# Without rebalance y rings at the split, 53 Hz, which the output must suppress.
OPEN = LOOPS | {"controller.kind": "open_loop", "controller.output_bandwidth": 15 * HZ}
AVERAGE = 0.1  # s: much longer than 1/split


def bound(noise: float) -> float:
    """deg/sqrt(h): the amplitude of a known line on y in colored noise, with x's motion only."""
    damping, stiffness, *_ = DUAL_MASS.plant.nondimensional()
    response = complex(stiffness[2] - 1.0, damping[2])  # force that y needs for its motion, at x's frequency
    density = noise**2 * OMEGA / (2 * DUAL_MASS.plant.reference_length**2)
    force = DUAL_MASS.disturbance.density
    assert force is not None
    variance = (force + density * abs(response) ** 2) / (4 * 0.5)
    return DEG_PER_ROOT_H.of(math.sqrt(variance * OMEGA))


@pytest.mark.parametrize("changes", [REBALANCED, OPEN], ids=["force rebalance", "open loop"])
@pytest.mark.parametrize(("noise", "expected"), [(0.0, 0.0112), (1e-13, 0.0257)])
def test_the_angle_random_walk_is_the_bound_of_one_axis(
    changes: dict[str, object], noise: float, expected: float
) -> None:
    assert bound(noise) == pytest.approx(expected, rel=0.01)
    scenario = DUAL_MASS.replace({**changes, "device.position_noise_density": noise, "run.duration": 20000.0})
    outputs = rate_means(scenario, range(24), every=1, block=round(AVERAGE * OMEGA / scenario.run.step)) * OMEGA
    settled = np.diff(outputs[:, 3:], axis=1)
    walk = DEG_PER_ROOT_H.of(math.sqrt((settled**2).mean() / 2 * AVERAGE))
    # 24 records of 4 differences: 10 % of standard deviation.
    assert 0.75 < walk / bound(noise) < 1.25


@pytest.mark.parametrize("ratio", [0.95, 0.999])
def test_open_loop_scales_the_rate_by_the_nominal_split_and_the_check_says_so(ratio: float) -> None:
    quiet = {"disturbance": {"kind": "none"}, "plant.angular_rate": 0.1, "run.duration": 2e4, "run.record_every": 100}
    scenario = DUAL_MASS.replace({**OPEN, **quiet, "adaptation.initial_ratio": ratio})
    (said,) = suspicious(scenario)
    stated = float(re.findall(r"gives (\S+) times the rate$", said)[0])
    rate = float(fg.simulate(scenario)["rate_estimate"][-100:].mean())
    assert stated == pytest.approx({0.95: -0.876, 0.999: 0.962}[ratio], abs=0.001)
    assert rate * OMEGA / 0.1 == pytest.approx(stated, abs=0.005)
    assert not list(suspicious(scenario.replace({"adaptation.initial_ratio": 1.0})))


def test_the_check_states_what_a_deviation_of_the_plant_does_to_open_loop() -> None:
    quiet = {"disturbance": {"kind": "none"}, "plant.angular_rate": 0.1, "run.duration": 2e4, "run.record_every": 100}
    softer = {"plant.stiffness_deviation": {"xx": 0.0, "xy": 0.0, "yy": -0.005 * DUAL_MASS.plant.stiffness.yy}}
    scenario = DUAL_MASS.replace({**OPEN, **quiet, **softer, "adaptation.initial_ratio": 1.0})
    (said,) = suspicious(scenario)
    stated = float(re.findall(r"that no controller knows: .* gives (\S+) times the rate$", said)[0])
    rate = float(fg.simulate(scenario)["rate_estimate"][-100:].mean())
    assert stated > 1.1
    assert rate * OMEGA / 0.1 == pytest.approx(stated, rel=0.01)
