"""Identification of a device from decays: right values, the bound, intervals, and properties of the estimates."""

from __future__ import annotations

import math
from dataclasses import replace

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DISC, DUAL_MASS, IN_AIR, PAPER, RATE, Device
from fracgyro.identification.first_stage import Fitted, fit_segments
from fracgyro.identification.model import Shape, poles, sampled
from fracgyro.identification.records import of_arrays
from fracgyro.identification.spectra import Spectrum
from fracgyro.identification.to_scenario import correction
from nightly import nightly_unless
from scipy.linalg import expm

NAMES = {"dual mass": DUAL_MASS, "disc": DISC, "paper": PAPER, "in air": IN_AIR}
LENGTHS = {"dual mass": 50_000, "disc": 100_000, "paper": 20_000, "in air": 4000}


def first(found: fg.identify.Found) -> Fitted:
    (group,) = found.groups
    assert isinstance(group, Fitted)
    return group


def in_units(fitted: Fitted, omega: float) -> tuple[np.ndarray, np.ndarray]:
    """Parameters and covariance of the first stage, in units of this omega."""
    turn = fitted.unit / omega
    scale = np.array([turn**2] * 4 + [turn] * 4)
    return fitted.fit.parameters * scale, fitted.fit.covariance * np.outer(scale, scale)


# -- Right values ------------------------------------------------------------------------------------------------------


def test_the_numbers_seen_by_the_pick_offs_of_the_dual_mass() -> None:
    """Computed by another program: docs/decisions/0052-identification.md."""
    stiffness, damping = replace(DUAL_MASS, turn=-0.02).seen
    expected = [1.0000108740, 5.3824664864e-4, 5.4906540627e-4, 1.0271778315]
    np.testing.assert_allclose(stiffness.ravel(), expected, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(damping.ravel(), [2.15e-4, -3.80e-4, 4.70e-4, 2.256e-3], rtol=3e-3)
    found = poles(Shape(2), replace(DUAL_MASS, turn=-0.02).parameters) * 3925.0
    np.testing.assert_allclose(found, [-0.420935 + 3924.987039j, -4.428873 + 3978.010648j], rtol=1e-4)


def test_the_map_over_a_short_interval_loses_no_digit() -> None:
    shape, interval = Shape(2, 1), 1e-7
    parameters = np.concatenate([DUAL_MASS.parameters, [0.7, -0.3]])
    found = sampled(shape, parameters, interval)
    n = 4
    matrix = np.zeros((5, 5))
    matrix[:2, 2:4], matrix[2:4, :2], matrix[2:4, 2:4] = np.eye(2), -DUAL_MASS.seen[0], -DUAL_MASS.seen[1]
    matrix[2:4, 4] = [0.7, -0.3]
    series = sum(np.linalg.matrix_power(interval * matrix, k) / math.factorial(k) for k in range(1, 6))
    np.testing.assert_allclose(found.less_one, series[:n, :n], rtol=1e-14, atol=1e-30)
    np.testing.assert_allclose(found.held, series[:n, n:], rtol=1e-14, atol=1e-30)


def test_the_derivatives_of_the_map_are_those_of_central_differences() -> None:
    shape, step = Shape(2, 2), 1e-6
    parameters = np.concatenate([DUAL_MASS.parameters, [0.7, -0.3, 0.1, 0.9]])
    found = sampled(shape, parameters, 0.5)
    for i in range(shape.count):
        moved = step * np.eye(shape.count)[i]
        up, down = sampled(shape, parameters + moved, 0.5), sampled(shape, parameters - moved, 0.5)
        np.testing.assert_allclose(found.less_one_by[i], (up.less_one - down.less_one) / (2 * step), atol=1e-9)
        np.testing.assert_allclose(found.held_by[i], (up.held - down.held) / (2 * step), atol=1e-9)


@pytest.mark.parametrize("name", nightly_unless(lambda name: name == "dual mass", NAMES))
def test_a_record_without_noise_gives_every_number_to_twelve_digits(name: str) -> None:
    device = NAMES[name]
    found = fg.identify(device.record(min(LENGTHS[name], 20_000), 5.04, noise=0.0))
    parameters, _ = in_units(first(found), device.omega)
    np.testing.assert_allclose(parameters, device.parameters, atol=1e-12)
    stiffness, damping = device.principal
    omega = device.omega
    assert found["rate"].value == pytest.approx(device.rate, rel=1e-8)
    assert found["pickoff_ratio"].value == pytest.approx(device.ratio, rel=1e-8)
    assert found["kxy"].value == pytest.approx(omega**2 * stiffness[0, 1], rel=1e-8)
    assert found["dxy"].value == pytest.approx(omega * damping[0, 1], rel=1e-6, abs=1e-9 * omega)


def test_two_known_rates_without_noise_give_the_skew_as_well_and_the_correction_of_both_pick_offs() -> None:
    device = replace(DUAL_MASS, skew=0.015, rate=0.0)
    records = [replace(device, rate=rate).record(20_000, 5.04, 0.0, rate=rate) for rate in (0.0, RATE)]
    found = fg.identify(records)
    assert found["skew"].value == pytest.approx(0.015, abs=1e-9)
    assert found["pickoff_ratio"].value == pytest.approx(1.01, abs=1e-9)
    assert found["rate_offset"].value == pytest.approx(0.0, abs=1e-7)
    matrix = correction(found)
    np.testing.assert_allclose(matrix @ np.array([[1.0, 0.0], [0.015, 1.01]]), np.eye(2), atol=1e-8)
    assert f"multiply what is measured by {matrix}" in " ".join(found.to_toml().replace("# ", "").split())


# -- The bound ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["dual mass", "in air"])
def test_the_covariance_is_the_bound_of_simulated_sensitivities(name: str) -> None:
    """The bound with all samples in the time domain, start values unknown too, by central differences."""
    device, samples, noise = NAMES[name], LENGTHS[name] // 5, 1e-3
    start, per_period = (1.0, 0.1, 0.1, -1.0), 12.6
    fitted = fit_segments([of_arrays(device.record(samples, per_period, noise))])
    _, covariance = in_units(fitted, device.omega)
    size = 2 * np.pi / per_period

    def motion(values: np.ndarray) -> np.ndarray:
        stiffness, damping = values[:4].reshape(2, 2), values[4:8].reshape(2, 2)
        step = expm(size * np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]]))
        eigenvalues, vectors = np.linalg.eig(step)
        weights = np.linalg.solve(vectors, values[8:].astype(complex))
        return np.real((vectors[:2] * weights) @ np.exp(np.outer(np.log(eigenvalues), np.arange(samples)))).ravel()

    at = np.concatenate([device.parameters, start])
    steps = 1e-3 * np.concatenate([np.sqrt(np.diag(covariance)), np.full(4, 1e-2)])
    columns = [(motion(at + s * e) - motion(at - s * e)) / (2 * s) for s, e in zip(steps, np.eye(12), strict=True)]
    found_noise = np.repeat(fitted.fit.noise[0], samples)
    scaled = np.stack(columns, axis=1) * steps / found_noise[:, None]
    bound = steps * np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled)))
    np.testing.assert_allclose(fitted.fit.noise[0], noise, rtol=0.2)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), bound[:8], rtol=0.02)  # the band leaves out some


@pytest.mark.parametrize(
    ("name", "noise"),
    nightly_unless(
        lambda name, noise: (name, noise) in {("dual mass", 1e-3), ("in air", 5e-2)},
        [("dual mass", 1e-3), ("disc", 1e-3), ("in air", 1e-3), ("in air", 5e-2)],
    ),
)
def test_the_errors_of_eight_records_follow_their_intervals(name: str, noise: float) -> None:
    device, samples = NAMES[name], LENGTHS[name] // 2
    squares = 0.0
    for seed in range(8):
        fitted = fit_segments([of_arrays(device.record(samples, 12.6, noise, seed))])
        parameters, covariance = in_units(fitted, device.omega)
        error = parameters - device.parameters
        squares += float(error @ np.linalg.solve(covariance, error))
    # chi^2 with 64 degrees of freedom: 0.1 % and 99.9 %.
    assert 33.0 < squares < 105.0


@pytest.mark.nightly
def test_the_errors_of_forced_records_follow_their_intervals() -> None:
    """A held multisine in both drives, with feedthrough; simulated sample by sample."""
    device, samples, size = DUAL_MASS, 12_288, 2 * np.pi / 8.0
    drive, through = 1e-2 * np.array([[1.0, 0.0], [0.0, 0.9]]), np.array([[0.02, 0.005], [0.003, 0.03]])
    drive = np.array([[1.0, 0.0], [0.0, device.ratio]]) @ drive
    matrix = np.zeros((6, 6))
    matrix[:2, 2:4], matrix[2:4, :2], matrix[2:4, 2:4] = np.eye(2), -device.seen[0], -device.seen[1]
    matrix[2:4, 4:] = drive
    step = expm(size * matrix)
    expected = np.concatenate([device.parameters, drive.ravel()])
    squares = 0.0
    for seed in range(4):
        generator = np.random.default_rng(seed)
        force = generator.normal(size=(2, samples))
        state, motion = np.zeros(4), np.empty((2, samples))
        for i in range(samples):
            motion[:, i] = state[:2]
            state = step[:4, :4] @ state + step[:4, 4:] @ force[:, i]
        motion += through @ force + 1e-3 * np.abs(motion).max() * generator.normal(size=motion.shape)
        record = fg.identify.Record(*motion, interval=device.interval(8.0), force=force)
        fitted = fit_segments([of_arrays(record)], device.omega)
        error = fitted.fit.parameters - expected
        squares += float(error @ np.linalg.solve(fitted.fit.covariance, error))
    assert 22.0 < squares < 84.0  # chi^2 with 48 degrees of freedom: 0.1 % and 99.9 %
    found = fg.identify(record)
    assert abs(found["b2"].value / found["b1"].value - 0.9) < 0.01
    assert abs(found["beta"].value) < 3 * found["beta"].half


# -- Intervals ---------------------------------------------------------------------------------------------------------


def test_axes_that_are_not_turned_do_not_show_the_pick_off_ratio() -> None:
    found = fg.identify(replace(DUAL_MASS, turn=0.0).record(50_000))
    for name in ("pickoff_ratio", "dxy"):
        assert not found[name].determined
        assert found[name].plain()["interval"] is None
        assert "known rate" in found[name].note
    low, high = found["rate"].interval
    assert 5.1 < low < RATE < high < 7.0
    assert found["rate"].value - low < (high - low) / 5, "one-sided: other ratios only raise the rate"
    assert found["kxx"].determined
    assert found["frequency_1"].determined
    assert "1e+09" not in found.to_toml()


def test_damping_that_cannot_be_negative_bounds_the_ratio_of_the_disc() -> None:
    found = fg.identify(replace(DISC, turn=0.0).record(100_000))
    low, high = found["pickoff_ratio"].interval
    assert found["pickoff_ratio"].determined
    assert 1.005 < low < 1.01 < high < 1.015


def test_a_given_ratio_narrows_the_coupling_damping() -> None:
    record = replace(DUAL_MASS, turn=0.0).record(50_000)
    given = fg.identify(record, pickoff_ratio=(1.01, 0.001))
    assert given["dxy"].determined
    assert given["dxy"].interval[0] < 0 < given["dxy"].interval[1]
    exact = fg.identify(record, pickoff_ratio=1.01)
    assert exact["dxy"].half < given["dxy"].half
    assumed = fg.identify(record, assume={"dxy": 0.0})
    assert assumed["pickoff_ratio"].determined
    assert assumed["pickoff_ratio"].interval[0] < 1.01 < assumed["pickoff_ratio"].interval[1]


@pytest.mark.nightly
def test_a_known_rate_shows_the_ratio_of_axes_that_are_not_turned() -> None:
    device = replace(DUAL_MASS, turn=0.0)
    records = [replace(device, rate=rate).record(50_000, seed=i, rate=rate) for i, rate in enumerate((0.0, RATE))]
    found = fg.identify(records)
    assert found["pickoff_ratio"].interval[0] < 1.01 < found["pickoff_ratio"].interval[1]
    assert found["pickoff_ratio"].half < 0.004
    assert found["skew"].determined
    assert {each.name for each in found.tests if each.verdict == "pass"} == {"whiteness", "agreement", "springs"}


@pytest.mark.parametrize("records", [1, 2])
def test_one_known_rate_does_not_free_a_skew_that_only_the_ratio_together_shows(records: int) -> None:
    device = replace(DUAL_MASS, turn=0.001, rate=0.0)
    starts = [(1, 0.1, 0.1, -1), (0.2, 1, 0.5, 0.1)]
    found = fg.identify([device.record(20_000, 8.0, seed=i, start=starts[i], rate=0.0) for i in range(records)])
    assert "skew" not in found
    assert "the pick-offs are assumed at right angles: a known rate shows their skew" in found.notes
    assert found["pickoff_ratio"].interval[0] < 1.01 < found["pickoff_ratio"].interval[1]
    assert found["pickoff_ratio"].half < 0.1


def test_records_of_different_devices_do_not_agree() -> None:
    records = [DUAL_MASS.record(20_000, rate=RATE), replace(DUAL_MASS, turn=0.021).record(20_000, rate=-RATE, seed=1)]
    found = fg.identify(records)
    assert "agreement" in [each.name for each in found.tests if each.verdict == "fail"]


def test_a_decay_that_is_too_short_for_its_damping_says_so() -> None:
    found = fg.identify(replace(DISC, quality=(2e7, 2e7)).record(20_000, noise=1e-2))
    assert not found["quality_1"].determined
    assert "longer" in found["quality_1"].note


# -- Properties --------------------------------------------------------------------------------------------------------


def test_scales_of_motion_time_and_mass_scale_the_result() -> None:
    record = DUAL_MASS.record(20_000)
    plain = fg.identify(record, mass=1e-6)
    scaled = fg.identify(replace(record, x=4 * record.x, y=4 * record.y), mass=1e-6)
    faster = fg.identify(replace(record, interval=record.interval / 4), mass=1e-6)
    heavier = fg.identify(record, mass=4e-6)
    for name in ("kxx", "kxy", "dxx", "dxy", "rate", "pickoff_ratio", "frequency_2"):
        value, half = plain[name].value, plain[name].half
        assert scaled[name].value == pytest.approx(value, abs=1e-6 * half)
        power = {"k": 2, "d": 1, "r": 1, "f": 1, "p": 0}[name[0]]
        assert faster[name].value == pytest.approx(4**power * value, abs=4**power * 1e-6 * half)
        assert faster[name].half == pytest.approx(4**power * half, rel=1e-6)
        assert heavier[name].value == pytest.approx((4 if name[0] in "kd" else 1) * value, rel=1e-12)


def test_exchanging_the_pick_offs_turns_the_rate_and_inverts_the_ratio() -> None:
    record = DUAL_MASS.record(20_000)
    one, other = fg.identify(record), fg.identify(replace(record, x=record.y, y=record.x))
    assert other["rate"].value == pytest.approx(-one["rate"].value, rel=1e-4)
    assert other["pickoff_ratio"].value == pytest.approx(1 / one["pickoff_ratio"].value, rel=1e-5)
    assert other["kxx"].value == pytest.approx(one["kyy"].value, rel=1e-9)
    assert other["dxy"].value == pytest.approx(one["dxy"].value, rel=1e-3)


def test_a_negated_pick_off_turns_rate_quadrature_and_coupling_damping() -> None:
    record = DUAL_MASS.record(20_000)
    one, other = fg.identify(record), fg.identify(replace(record, y=-record.y))
    for name in ("rate", "kxy", "dxy", "quadrature"):
        assert other[name].value == pytest.approx(-one[name].value, abs=1e-6 * one[name].half)
    assert other["pickoff_ratio"].value == pytest.approx(one["pickoff_ratio"].value, rel=1e-9)


def test_two_records_of_equal_information_halve_the_variance_in_any_order() -> None:
    records = [DUAL_MASS.record(20_000, seed=seed) for seed in (1, 2)]
    single = [fg.identify(each)["kxx"].half for each in records]
    both = fg.identify(records)
    assert both["kxx"].half == pytest.approx(np.mean(single) / math.sqrt(2), rel=0.01)
    assert both["rate"].half < 0.75 * fg.identify(records[0])["rate"].half
    other = fg.identify(records[::-1])
    assert {name: each.value for name, each in other.items()} == {name: each.value for name, each in both.items()}


def test_a_second_start_resolves_equal_frequencies() -> None:
    """One start of a degenerate mode shows only the plane in which it moves."""
    device = Device((10000.0, 10000.0), (2e4, 2e4), rate=0.0)
    starts = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0))
    records = [device.record(50_000, seed=i, start=start) for i, start in enumerate(starts)]
    two = first(fg.identify(records))
    one = first(fg.identify(device.record(50_000, start=(1.0, 0.5, 0.0, 0.0))))
    deviation = [float(np.sqrt(each.fit.covariance[3, 3])) for each in (one, two)]
    assert deviation[0] > 10 * deviation[1]
    parameters, covariance = in_units(two, device.omega)
    error = (parameters - device.parameters) / np.sqrt(np.diag(covariance))
    assert np.abs(error).max() < 4.5


def test_the_band_holds_both_modes() -> None:
    fitted = first(fg.identify(DUAL_MASS.record(20_000)))
    assert isinstance(fitted.spectra[0], Spectrum)
    assert fitted.low < 3925 - 15 * 3978 / 449
    assert fitted.high > 3978 + 15 * 3978 / 449


def test_an_unknown_quantity_is_named_with_those_that_are_known() -> None:
    time = np.arange(4000) / 50e3
    noise = 1e-3 * np.random.default_rng(0).normal(size=4000)
    found = fg.identify([fg.identify.Record(np.exp(-20 * time) * np.cos(8000 * np.pi * time) + noise, interval=2e-5)])
    with pytest.raises(KeyError, match=r"q_1 is not among the quantities .*quality_1"):
        found["q_1"]
    assert "q_1" not in found
