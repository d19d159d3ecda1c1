"""The Cramér-Rao bound with sensing noise: the published table, numbers worked by hand, and two ways that agree."""

from __future__ import annotations

import math
import tomllib
from itertools import product
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.bound import Bound, _bound, _nondimensional, bound_of_motion, noise_of
from fracgyro.rate.innovation import Noise, Plant, information_of_motion
from fracgyro.rate.units import DEG_PER_ROOT_H
from fracgyro.scenario.named import exactly_sensed
from nightly import nightly_unless

bound_angle_random_walk = fg.rate.bound_angle_random_walk
SHIPPED = Path(fg.__file__).parent / "scenario" / "shipped"


def device(name: str, position: float = 0.0, velocity: float | None = None) -> fg.Scenario:
    """At rest; noise in m/sqrt(Hz), and of the velocity in omega0 times that, or positions only."""
    scenario = fg.Scenario.shipped(name).replace({"plant.angular_rate": 0.0})
    if position == 0.0:
        return exactly_sensed(name).replace({"plant.angular_rate": 0.0})
    sensing: dict[str, Any] = {"device.sensing": "position", "device.position_noise_density": position}
    if velocity is not None:
        density = velocity * scenario.plant.reference_frequency
        sensing |= {"device.sensing": "full", "device.velocity_noise_density": density}
    return scenario.replace(sensing)


# Columns: none; 1e-14, 1e-13 m/sqrt(Hz) of positions; 1e-13 of both; 1e-12 of positions.
NOISE = [(0.0, None), (1e-14, None), (1e-13, None), (1e-13, 1e-13), (1e-12, None)]
TABLE = {  # deg/sqrt(h)
    ("dual_mass", "known"): ["0.00789", "0.00806", "0.0180", "0.0139", "0.162"],
    ("dual_mass", "unknown"): ["0.00789", "0.00806", "0.0180", "0.0139", "0.162"],
    ("tuned_in_air", "known"): ["0.287", "0.287", "0.319", "0.304", "0.894"],
    ("tuned_in_air", "unknown"): ["0.356", "0.356", "0.369", "0.363", "1.05"],
    ("paper_resonance", "known"): ["0.0587", "0.144", "1.31", "0.843", "13.1"],
    ("paper_resonance", "unknown"): ["0.0607", "0.149", "1.36", "0.914", "13.6"],
    ("disc", "known"): ["0.000984", "0.00138", "0.00140", "0.00140", "0.00140"],
    ("disc", "unknown"): ["0.000984", "0.00548", "0.0539", "0.0380", "0.539"],
}


@pytest.mark.parametrize(("name", "which"), TABLE)
def test_the_table_of_bounds_is_reproduced_to_three_digits(name: str, which: str) -> None:
    for noise, printed in zip(NOISE, TABLE[name, which], strict=True):
        found = bound_angle_random_walk(device(name, *noise))
        assert found is not None
        value = DEG_PER_ROOT_H.of(getattr(found, which))
        last = 10.0 ** -(len(printed.partition(".")[2]))
        assert value == pytest.approx(float(printed), abs=0.501 * last)


def by_hand(name: str, rate: float) -> tuple[float, float]:
    """Computed only from the file, in SI units: the effect of each parameter on the measured position."""
    with open(SHIPPED / f"{name}.toml", "rb") as file:
        said = tomllib.load(file)
    plant, reference, device = said["plant"], said["reference"], said["device"]
    m, q0, w0 = plant["mass"], plant["reference_length"], plant["reference_frequency"]
    d, k = (np.array([[a["xx"], a["xy"]], [a["xy"], a["yy"]]]) for a in (plant["damping"], plant["stiffness"]))
    force = said["disturbance"]["density"] * (m * w0**2 * q0) ** 2 / w0 * np.eye(2)  # N^2/Hz, two-sided
    sensed = 0.5 * device["position_noise_density"] ** 2 * np.eye(2)  # m^2/Hz, two-sided
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    entries = [np.array(e) for e in ([[1, 0], [0, 0]], [[0, 1], [1, 0]], [[0, 0], [0, 1]])]
    information = np.zeros((7, 7))
    for axis in range(2):
        w = reference["frequency"][axis] * w0
        q = np.zeros(2, complex)
        q[axis] = reference["amplitude"][axis] * q0
        answer = np.linalg.inv(-m * w**2 * np.eye(2) + 1j * w * (d + 2 * m * rate * turn) + k)
        forces = [1j * w * e @ q for e in entries] + [e @ q for e in entries] + [2j * w * m * turn @ q]
        moved = answer @ np.array(forces).T
        seen = answer @ force @ answer.conj().T + sensed
        information += 0.5 * np.real(moved.conj().T @ np.linalg.solve(seen, moved))
    scale = np.sqrt(np.diag(information))
    unknown = np.linalg.inv(information / np.outer(scale, scale))[-1, -1]
    return 1 / scale[-1], math.sqrt(unknown) / scale[-1]


@pytest.mark.parametrize("rate", [0.0, 5.0])  # rad/s
@pytest.mark.parametrize("name", ["dual_mass", "tuned_in_air", "paper_resonance", "disc"])
def test_the_bound_is_that_of_the_spectrum_of_the_positions_in_si(name: str, rate: float) -> None:
    found = bound_angle_random_walk(fg.Scenario.shipped(name).replace({"plant.angular_rate": rate}))
    assert found is not None
    assert (found.known, found.unknown) == pytest.approx(by_hand(name, rate), rel=1e-5)


@pytest.mark.parametrize(
    ("name", "noise"),
    nightly_unless(
        lambda name, noise: noise == NOISE[0] or name == "dual_mass",
        product(["dual_mass", "tuned_in_air", "paper_resonance", "disc"], NOISE[:4]),
    ),
)
def test_lines_and_sensitivities_of_the_innovation_agree(name: str, noise: tuple[float, float | None]) -> None:
    noisy, ideal = device(name, *noise), device(name).replace({"run.duration": 6000.0})
    for rate in (0.0, 5.0):  # rad/s
        noisy, ideal = (each.replace({"plant.angular_rate": rate}) for each in (noisy, ideal))
        lines, motion = bound_angle_random_walk(noisy), of_ideal_motion(noisy, ideal)
        assert lines is not None
        assert motion is not None
        assert motion.known == pytest.approx(lines.known, rel=2e-3)
        assert motion.unknown == pytest.approx(lines.unknown, rel=1e-2)  # 2.4 beats of the disc: not a whole number


def of_ideal_motion(noisy: fg.Scenario, ideal: fg.Scenario) -> Bound | None:
    noise = noise_of(noisy)
    if noise is None or not noise.of_sensing:
        return bound_of_motion(ideal)
    motion = _nondimensional(ideal, fg.simulate(ideal))
    return _bound(information_of_motion(Plant.of(noisy), noisy.run.step, noise, *motion), noisy, 1.0)


def test_along_a_noisy_run_the_bound_is_the_same() -> None:
    scenario = device("tuned_in_air", 1e-14, 1e-14).replace({"run.duration": 4000.0})
    lines, motion = bound_angle_random_walk(scenario), bound_of_motion(scenario)
    assert lines is not None
    assert motion is not None
    assert (motion.known, motion.unknown) == pytest.approx((lines.known, lines.unknown), rel=5e-3)
    in_si = bound_of_motion(scenario.replace({"run.units": "SI"}))
    assert in_si is not None
    assert in_si.known == pytest.approx(motion.known, rel=1e-9)


def test_with_known_damping_and_stiffness_each_line_counts_by_the_axis_that_feels_it() -> None:
    # Sum over both motions of 4 mean v^2/(S + N |k - w^2 + j w d|^2), k and d of the other axis.
    scenario = device("dual_mass", 1e-13)
    scales = scenario.plant.scales
    density = (1e-13 / scales.length) ** 2 * scales.rate / 2  # two-sided, and time in 1/omega0
    w = 1.013503185
    force = 8.66056e-16
    of_x = 4 * 0.5 / (force + density * abs(w * w - 1 + 1j / 449 * w) ** 2)
    of_y = 4 * 0.5 * w * w / (force + density * abs(1 - w * w + 1j * w / 4673) ** 2)
    found = bound_angle_random_walk(scenario)
    assert found is not None
    assert found.known == pytest.approx(math.sqrt(scales.rate / (of_x + of_y)), rel=1e-4)


def test_deviations_densities_and_converters_are_the_same_noise() -> None:
    scenario = device("dual_mass", 1e-13)
    plain = {"device.position_noise_density": 0.0}
    step = scenario.run.step * scenario.plant.scales.time
    deviation = 1e-13 * math.sqrt(0.5 / step)
    drawn = scenario.replace({**plain, "device.position_noise": deviation})
    # 12 bit steps of that deviation: range 2^11 steps.
    steps = scenario.replace(
        {**plain, "device.position_bits": 12, "device.position_range": 2.0**11 * deviation * math.sqrt(12)}
    )
    expected = bound_angle_random_walk(scenario)
    assert expected is not None
    for same in (drawn, steps):
        found = bound_angle_random_walk(same)
        assert found is not None
        assert (found.known, found.unknown) == pytest.approx((expected.known, expected.unknown), rel=1e-9)
    # With both, their powers add: twice the density is sqrt(2) times the amplitude.
    both = bound_angle_random_walk(steps.replace({"device.position_noise": deviation}))
    louder = bound_angle_random_walk(scenario.replace({"device.position_noise_density": math.sqrt(2) * 1e-13}))
    assert both is not None
    assert louder is not None
    assert both.known == pytest.approx(louder.known, rel=1e-9)


def test_an_exact_sensor_leaves_the_noise_of_the_force_and_a_silent_force_that_of_sensing() -> None:
    ideal = bound_angle_random_walk(device("dual_mass"))
    exact_speed = bound_angle_random_walk(device("dual_mass", 1e-13).replace({"device.sensing": "full"}))
    assert exact_speed == ideal
    assert bound_angle_random_walk(device("dual_mass").replace({"disturbance.kind": "none"})) is None
    silent = {"disturbance.kind": "none"}
    one, ten = (bound_angle_random_walk(device("dual_mass", n).replace(silent)) for n in (1e-13, 1e-12))
    assert one is not None
    assert ten is not None
    assert ten.known == pytest.approx(10 * one.known, rel=1e-9)


def test_axes_that_move_at_one_frequency_do_not_separate_the_parameters_whatever_their_phases() -> None:
    for phase in ((0.0, 0.0), (0.0, 0.5 * math.pi), (1.0, 2.0)):
        scenario = device("dual_mass").replace({"reference.frequency": [1.0, 1.0], "reference.phase": list(phase)})
        assert bound_angle_random_walk(scenario) is None


def test_the_phases_do_not_matter_where_each_axis_has_its_frequency() -> None:
    scenario = device("tuned_in_air", 1e-13)
    bound = bound_angle_random_walk(scenario)
    assert bound is not None
    assert bound_angle_random_walk(scenario.replace({"reference.phase": [0.3, 2.0]})) == bound


def test_exact_sensors_and_silent_forces_leave_a_bound_of_0_along_a_motion_too() -> None:
    silent = {"disturbance.density": None, "disturbance.standard_deviation": 0.0, "run.duration": 1000.0}
    scenario = device("tuned_in_air").replace(silent)
    assert bound_of_motion(scenario) == Bound(0.0, 0.0) == bound_angle_random_walk(scenario)


# -- The plant's exact step ----------------------------------------------------------------------------------


def test_the_step_of_the_sensitivities_is_that_of_the_plant() -> None:
    scenario = fg.Scenario.shipped("tuned_in_air").replace(
        {"disturbance.density": None, "disturbance.standard_deviation": 0.0}
    )
    exact, _ = Plant.of(scenario).steps(scenario.run.step)
    run = fg.simulate(scenario.replace({"run.duration": 5.0}))
    state = np.concatenate([run["position"].values, run["velocity"].values], axis=1)
    known = np.concatenate([state, run["control"].values], axis=1)
    np.testing.assert_allclose(known[:-1] @ exact.T, state[1:], rtol=0, atol=1e-13)


def test_the_force_of_a_motion_is_the_one_that_acts_and_the_units_are_the_cores() -> None:
    # Actuators 10 % too strong and late: the motion follows the force that they apply, in any units.
    quiet = {"disturbance.density": None, "disturbance.standard_deviation": 0.0, "run.duration": 5.0}
    faulty = {"device.force_gain_error": [0.1, 0.1], "device.delay": 1, "run.units": "SI"}
    scenario = fg.Scenario.shipped("tuned_in_air").replace(quiet | faulty)
    position, velocity, force = _nondimensional(scenario, fg.simulate(scenario))
    exact, _ = Plant.of(scenario).steps(scenario.run.step)
    known = np.concatenate([position, velocity, force], axis=1)
    np.testing.assert_allclose(known[:-1] @ exact.T, known[1:, :4], rtol=0, atol=1e-13)
    assert len(known) == scenario.run.steps - scenario.run.steps // 2 + 1  # the second half, with the last sample


def test_its_derivatives_are_differences_of_steps() -> None:
    plant, little = Plant.of(fg.Scenario.shipped("tuned_in_air")), 1e-6
    _, derivatives = plant.steps(0.3)
    one, turn = np.eye(2), np.array([[0.0, -2.0], [2.0, 0.0]])
    entries = [np.outer(one[0], one[0]), np.outer(one[0], one[1]) + np.outer(one[1], one[0]), np.outer(one[1], one[1])]
    changes = [(e, 0 * e) for e in entries] + [(0 * e, e) for e in entries] + [(turn, 0 * turn)]
    for (damping, stiffness), derivative in zip(changes, derivatives, strict=True):
        up, down = (
            Plant(plant.damping + sign * little * damping, plant.stiffness + sign * little * stiffness).steps(0.3)[0]
            for sign in (1, -1)
        )
        np.testing.assert_allclose(derivative, (up - down) / (2 * little), rtol=0, atol=1e-9)


def test_the_sensors_are_one_whose_information_is_the_sum() -> None:
    noise = Noise(1.0, np.array([2.0, 4.0]), np.array([18.0, math.inf]))
    # 1/2 + 3^2/18 = 1; 1/4
    np.testing.assert_allclose(noise.at(3.0), [1.0, 4.0])


def test_the_sensitivities_are_those_of_the_filter_run_step_by_step() -> None:
    # Steps so long that the force counts, and a motion that closes after 25 samples.
    plant, step, period = Plant.of(fg.Scenario.shipped("tuned_in_air")), 0.5, 25
    noise = Noise(0.3, np.array([0.2, 0.4]), np.array([math.inf, 0.5]))
    angle = 2 * np.pi * np.arange(31) / period
    position = np.stack([np.sin(angle), 0.5 * np.cos(2 * angle)], axis=1)
    velocity, force = np.roll(position, 3, axis=0) ** 2, np.stack([np.cos(angle), np.sin(3 * angle)], axis=1)
    velocity[25:], force[25:] = velocity[:6], force[:6]
    exact, derivatives = plant.steps(step)
    a, b, c = exact[:, :4], exact[:, 4:], np.eye(4)[[0, 1, 3]]
    r = np.diag([0.2, 0.4, 0.5]) / step
    p = np.eye(4)
    for _ in range(2000):
        covariance = c @ p @ c.T + r
        gain = p @ c.T @ np.linalg.inv(covariance)
        p = a @ (p - gain @ c @ p) @ a.T + b @ b.T * 0.3 / step
    found, errors = np.zeros((7, 7)), np.zeros((7, 4))
    for n in range(40 * period):
        known = np.concatenate([position[n % period], velocity[n % period], force[n % period]])
        if n >= 39 * period:
            psi = errors @ c.T
            found += psi @ np.linalg.solve(covariance, psi.T) / (period * step)
        errors = (errors - errors @ c.T @ gain.T) @ a.T + derivatives @ known
    information = information_of_motion(plant, step, noise, position, velocity, force)
    np.testing.assert_allclose(information, found, rtol=1e-6, atol=1e-6 * found.max())


def test_a_sum_of_sines_has_the_bound_of_its_lines_and_another_reference_none() -> None:
    scenario = fg.Scenario.shipped("dual_mass")
    r = scenario.reference
    term = {"amplitude": r.amplitude, "frequency": r.frequency, "phase": r.phase}
    half = {**term, "amplitude": tuple(0.5 * a for a in r.amplitude)}
    expected = fg.rate.bound_angle_random_walk(scenario)
    assert expected is not None
    for terms in ([term], [half, half]):
        found = fg.rate.bound_angle_random_walk(scenario.replace({"reference.kind": "sines", "reference.terms": terms}))
        assert found is not None
        assert found.unknown == pytest.approx(expected.unknown, rel=1e-9)
    chirp = {"reference.kind": "chirp", "reference.end": 1e4, "reference.final_frequency": (1.1, 1.1)}
    shifted = {"reference.kind": "sines", "reference.terms": [term], "reference.offset": (0.1, 0.0)}
    for changes in (chirp, shifted, {"reference.offset": (0.1, 0.0)}, {"reference.kind": "rest"}):
        assert fg.rate.bound_angle_random_walk(scenario.replace(changes)) is None
