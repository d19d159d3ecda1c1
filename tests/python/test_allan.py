"""The terms read from an Allan deviation, on deviations that are known without noise."""

from __future__ import annotations

import math
from importlib import import_module

import numpy as np
import pytest
from numpy.typing import NDArray

allan = import_module("fracgyro.rate.allan")
Array = NDArray[np.float64]
TAU = 0.01 * 2.0 ** np.arange(12)
MANY = 40_000 / 2.0 ** np.arange(12)  # degrees of freedom of a long record


def markov(density: float, time: float, tau: Array) -> Array:
    """Deviation of white noise behind a sensor of first order (IEEE Std 952, of Markov noise)."""
    x = tau / time
    return density / np.sqrt(tau) * np.sqrt(1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x))


@pytest.mark.parametrize("time", [0.05, 0.06, 0.07, 0.1])
def test_behind_a_slow_sensor_the_angle_random_walk_is_that_of_the_white_noise_to_a_percent(time: float) -> None:
    deviation = markov(0.1, time, TAU)
    peak = allan._peak_of_the_response(deviation, 0.999 * deviation, 1.001 * deviation)
    assert TAU[peak] == pytest.approx(1.892 * time, rel=0.42)  # within half an octave
    found = allan._angle_random_walk(TAU, deviation, MANY, peak)
    assert found is not None
    assert found.value == pytest.approx(0.1, rel=0.01)
    # As narrow as the best average that counts allows: chi square of 40000/2^peak.
    assert (found.high - found.low) / found.value == pytest.approx(2 * 1.96 / math.sqrt(2 * MANY[peak]), rel=0.05)


def test_a_rise_within_the_noise_is_no_response_of_the_sensor() -> None:
    deviation = np.array([1.0, 1.01, 0.99, 0.7, 0.7])
    assert allan._peak_of_the_response(deviation, 0.999 * deviation, 1.001 * deviation) == 1
    assert allan._peak_of_the_response(deviation, 0.8 * deviation, 1.2 * deviation) == 0
    assert allan._peak_of_the_response(deviation, 0.9 * deviation, 1.1 * deviation) == 1  # 0.7 is below that of 1.01
    rising = np.array([1.0, 2.0, 3.0])
    assert allan._peak_of_the_response(rising, rising, rising) == 0


FALLING = 1.0 / np.sqrt(TAU)


def test_a_rise_of_two_octaves_is_a_rate_random_walk_and_one_octave_is_none() -> None:
    # 1/sqrt(tau) down to the least, from there K sqrt(tau/3).
    for octaves, limit in ((3, False), (2, False), (1, True)):
        least = len(TAU) - 1 - octaves
        deviation = np.where(np.arange(12) <= least, FALLING, FALLING[least] * np.sqrt(TAU / TAU[least]))
        found = allan._rate_random_walk(TAU, deviation, 1.1 * deviation, np.full(12, 1e6))
        assert found.limit is limit
        walk = FALLING[least] / math.sqrt(TAU[least] / 3)
        if not limit:
            assert found.value == pytest.approx(walk, rel=1e-9)
            assert found.low < walk < found.high
        else:
            assert (found.low, found.value) == (0.0, pytest.approx(walk))
            assert found.high == pytest.approx(1.1 * walk)


def test_a_rise_that_its_own_noise_could_make_is_no_rate_random_walk() -> None:
    deviation = np.where(np.arange(12) <= 8, FALLING, FALLING[8] * np.sqrt(TAU / TAU[8]))
    # Two standard deviations of a slope are 2/ln 2/sqrt(2 f): 0.5 at f = 16.7.
    for freedom, limit in ((18.0, False), (15.0, True)):
        found = allan._rate_random_walk(TAU, deviation, deviation, np.full(12, freedom))
        assert found.limit is limit


@pytest.mark.parametrize(("slope", "found"), [(-0.5, True), (-0.59, True), (-0.41, True), (-0.62, False)])
def test_a_line_has_its_slope_to_a_tenth(slope: float, found: bool) -> None:
    freedom = np.full(12, 1e6)
    assert (allan._along(TAU, TAU**slope, freedom, -0.5) is not None) is found


def test_the_line_is_the_longest_and_its_height_is_read_at_one_second() -> None:
    # Two octaves of another height come first.
    deviation = np.concatenate([5.0 / np.sqrt(TAU[:3]), 2.0 / np.sqrt(TAU[3:])])
    line = allan._along(TAU, deviation, np.full(12, 1e6), -0.5)
    assert line is not None
    assert line.value == pytest.approx(2.0, rel=1e-9)
    # The same the other way round: what follows the longest does not count.
    line = allan._along(TAU, np.concatenate([2.0 / np.sqrt(TAU[:8]), 5.0 / np.sqrt(TAU[8:])]), np.full(12, 1e6), -0.5)
    assert line is not None
    assert line.value == pytest.approx(2.0, rel=1e-9)


def test_the_bias_instability_is_the_least_deviation_over_0_664() -> None:
    tau, deviation = TAU[:4], np.array([4.0, 2.0, 3.0, 4.0])
    walk = allan.Estimate(0.1, 0.05, 0.15)
    found = allan._bias_instability(tau, deviation, 0.9 * deviation, 1.2 * deviation, walk)
    # White noise alone would leave at most 0.15/sqrt(0.02) = 1.06 there.
    assert (found.value, found.low, found.high) == pytest.approx((2 / 0.664, 1.8 / 0.664, 2.4 / 0.664))
    assert not found.limit
    walk = allan.Estimate(0.2, 0.15, 0.26)  # 1.84 > 1.8
    assert allan._bias_instability(tau, deviation, 0.9 * deviation, 1.2 * deviation, walk).limit
    assert not allan._bias_instability(tau, 0.1 * deviation, 0.1 * deviation, 0.1 * deviation, None).limit
    # At the longest average nothing is seen beyond.
    assert allan._bias_instability(tau[:2], deviation[:2], deviation[:2], deviation[:2], None).limit


def test_the_averaging_times_go_by_octaves_up_to_a_tenth_of_the_record() -> None:
    record = np.random.default_rng(0).normal(size=(1, 1000))
    found = allan.allan(record, 0.5)
    assert found.tau.tolist() == [0.5 * 2**n for n in range(7)]  # 64 of 1000, and 128 would be too many
    # Of one sample: half the mean square of differences.
    assert found.deviation[0] == pytest.approx(math.sqrt(0.5 * np.mean(np.diff(record) ** 2)), rel=1e-9)
    both = allan.allan(np.concatenate([record, 3 * record]), 0.5)
    np.testing.assert_allclose(both.deviation, math.sqrt(5) * found.deviation, rtol=1e-12)  # of 1 and 9 the mean
    assert ((found.low < found.deviation) & (found.deviation < found.high)).all()
    with pytest.raises(ValueError, match="the record has 19 samples: it must have at least 20, all finite"):
        allan.allan(np.ones(19), 1.0)


def test_the_degrees_of_freedom_are_those_of_white_noise() -> None:
    # NIST SP 1065 has (3 (N - 1)/2m - 2 (N - 2)/N) 4 m^2/(4 m^2 + 5), to a tenth or so.
    for m in (10, 50):
        reported = (3 * 999 / (2 * m) - 2 * 998 / 1000) * 4 * m**2 / (4 * m**2 + 5)
        assert allan._degrees_of_freedom(m, 1000) == pytest.approx(reported, rel=0.1)


def test_intervals_are_those_of_chi_square() -> None:
    # Tables: chi square of 10 degrees of freedom is 3.247 at 2.5 % and 20.483 at 97.5 %.
    assert allan._factors(np.array([10.0]))[:, 0] == pytest.approx(
        [math.sqrt(10 / 20.483), math.sqrt(10 / 3.247)], rel=1e-4
    )
