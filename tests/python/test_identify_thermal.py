"""Thermal motion as a part of the noise: intervals, its scale, and the gain of the pick-off that follows from it."""

from __future__ import annotations

from dataclasses import replace

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DUAL_MASS, IN_AIR
from fracgyro.identification import thermal
from fracgyro.identification.first_stage import Fitted, fit_segments
from fracgyro.identification.model import Shape
from fracgyro.identification.records import of_arrays
from scipy.linalg import expm

BOLTZMANN = 1.380649e-23
NOISE, SIZE = 1e-5, 1e-5  # deviation of a sample, and thermal motion, over the amplitude


def fit(seed: int, size: float = SIZE) -> Fitted:
    return fit_segments([of_arrays(IN_AIR.record(4000, 12.6, NOISE, seed, thermal=size))])


def squared(found: Fitted) -> float:
    turn = found.unit / IN_AIR.omega
    scale = np.array([turn**2] * 4 + [turn] * 4)
    error = found.fit.parameters * scale - IN_AIR.parameters
    return float(error @ np.linalg.solve(found.fit.covariance * np.outer(scale, scale), error))


@pytest.mark.parametrize("interval", [1e-3, 0.5, 3.0])
def test_the_covariance_of_the_state_is_that_of_quadrature(interval: float) -> None:
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-IN_AIR.seen[0], -IN_AIR.seen[1]]])
    places, weights = np.polynomial.legendre.leggauss(30)
    found = thermal.process_covariance(Shape(2), IN_AIR.parameters, interval)
    for axis in range(2):
        force = np.zeros((4, 4))
        force[2 + axis, 2 + axis] = 1.0
        expected = np.zeros((4, 4))
        for place, weight in zip(places, weights, strict=True):
            one = expm(matrix * interval * (place + 1) / 2)
            expected += interval / 2 * weight * one @ force @ one.T
        np.testing.assert_allclose(found[axis], expected, rtol=1e-10, atol=1e-14 * expected.max())


def thermal_motion_is_found(found: Fitted) -> None:
    expected = 2 * SIZE**2 * np.diag(IN_AIR.principal[1]) * [1.0, IN_AIR.ratio**2]
    scaled = found.fit.thermal.thermal * (found.unit / IN_AIR.omega) ** 3
    np.testing.assert_array_less(np.abs(scaled - expected), 4 * found.fit.thermal.deviation)


def test_thermal_motion_is_found_within_its_interval() -> None:
    found = fit(0)
    thermal_motion_is_found(found)
    assert found.fit.thermal.is_thermal
    assert squared(found) < 26.2  # chi^2 with 8 degrees of freedom: 99.9 %


@pytest.mark.nightly
def test_errors_in_thermal_motion_follow_their_intervals(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [fit(seed) for seed in range(6)]
    # chi^2 with 48 degrees of freedom: 0.1 % and 99.9 %.
    assert 22.0 < sum(map(squared, found)) < 84.0
    relative = [each.fit.thermal.deviation / each.fit.thermal.thermal for each in found]
    assert 0.05 < np.mean(relative) < 0.3
    for each in found:
        thermal_motion_is_found(each)
    monkeypatch.setattr(thermal, "BOUND", -1.0)  # all noise is white
    assert sum(squared(fit(seed)) for seed in range(3)) > 150.0


def test_white_noise_has_no_thermal_motion() -> None:
    found = [fit(seed, 0.0).fit.thermal for seed in range(5)]
    assert sum(each.is_thermal for each in found) <= 1
    assert min(each.p for each in found) > 1e-3


@pytest.mark.nightly
def test_mass_and_temperature_give_the_gain_of_the_pick_off() -> None:
    mass, temperature = 1e-9, 300.0
    record = IN_AIR.record(4000, 12.6, NOISE, 3, thermal=SIZE)
    found = fg.identify(replace(record, temperature=temperature), mass=mass)
    # Equipartition: the root of the mean square of the motion along x is SIZE in units of the record.
    expected = np.sqrt(BOLTZMANN * temperature / (mass * IN_AIR.omega**2)) / SIZE
    low, high = found["thermal_pickoff"].interval
    assert low < expected < high
    assert high / low < 1.6
    assert [each.name for each in found.tests if each.name == "thermal"]
    assert "thermal_pickoff" not in fg.identify(record, mass=mass)
    without = fg.identify(replace(DUAL_MASS.record(10_000), temperature=temperature), mass=mass)
    assert "thermal_pickoff" not in without
