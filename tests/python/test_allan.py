"""N, B and K from an Allan deviation: on deviations without noise, on records whose terms are known, and allantools."""

from __future__ import annotations

import math
from importlib import import_module

import allantools
import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.noise_terms import FLICKER, WALK, WHITE, Curve, Fit, Response
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

allan = import_module("fracgyro.rate.allan")
Array = NDArray[np.float64]


# -- Records whose terms are known ---------------------------------------------------------------------------


def white(n: float, samples: int, interval: float, seed: int) -> Array:
    return np.random.default_rng(seed).normal(size=samples) * n / math.sqrt(interval)


def flicker(b: float, samples: int, interval: float, seed: int) -> Array:
    """Density B²/(2π f): white noise through (1 - z⁻¹)^(-1/2) (Kasdin 1995), after as many samples again."""
    length = 2 * samples
    k = np.arange(1, length)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    noise = np.random.default_rng([seed, 1]).normal(size=length)
    return b * np.fft.irfft(np.fft.rfft(noise, 2 * length) * np.fft.rfft(response, 2 * length))[samples:length]


def walk(k: float, samples: int, interval: float, seed: int) -> Array:
    return np.cumsum(np.random.default_rng([seed, 2]).normal(size=samples)) * k * math.sqrt(interval)


def slow(record: Array, interval: float, lag: float) -> Array:
    """As a sensor of first order reports it."""
    keep = math.exp(-interval / lag)
    return np.asarray(lfilter([1 - keep], [1, -keep], record))


def test_every_term_lies_in_its_interval_19_times_of_20_behind_a_sensor_of_finite_bandwidth_too() -> None:
    n, b, k, samples, trials = 1.0, 0.15, 0.01, 50_000, 40
    for lag in (0.0, 2.0):
        found = []
        for seed in range(trials):
            record = white(n, samples, 1.0, seed) + flicker(b, samples, 1.0, seed) + walk(k, samples, 1.0, seed)
            found.append(fg.rate.allan(slow(record, 1.0, lag) if lag else record, 1.0))
        for name, truth, spread in (
            ("angle_random_walk", n, 0.01),
            ("bias_instability", b, 0.05),
            ("rate_random_walk", k, 0.08),
        ):
            seen = [one for one in (getattr(each, name) for each in found) if not one.limit]
            assert len(seen) >= 0.8 * trials
            assert np.mean([one.value for one in seen]) == pytest.approx(truth, rel=spread)
            # 0.95, and 2.5 standard deviations of the count
            assert sum(one.low <= truth <= one.high for one in seen) >= 0.86 * len(seen)
        lags = [each.response_time for each in found]
        assert np.median(lags) == pytest.approx(lag, rel=0.05)


def test_a_term_that_is_not_there_is_seldom_seen_and_its_limit_holds() -> None:
    found = [fg.rate.allan(white(1.0, 2000, 1.0, seed), 1.0) for seed in range(100)]
    assert sum(not one.bias_instability.limit for one in found) <= 2
    assert sum(not one.rate_random_walk.limit for one in found) <= 2
    for seed in range(20):
        # B and K too weak to be seen in so short a record.
        weak = white(1.0, 2000, 1.0, seed) + flicker(0.02, 2000, 1.0, seed) + walk(1e-3, 2000, 1.0, seed)
        one = fg.rate.allan(weak, 1.0)
        assert one.bias_instability.high > 0.02
        assert one.rate_random_walk.high > 1e-3


@pytest.mark.parametrize("cutoff", [5.0, 20.0])
def test_a_response_of_second_order_is_divided_out(cutoff: float) -> None:
    filtered = lfilter(*butter(2, cutoff, fs=200.0), white(0.1, 400_000, 0.005, 1))
    found = fg.rate.allan(filtered, 0.005)
    assert found.angle_random_walk.value == pytest.approx(0.1, rel=0.02)
    assert found.response_time == pytest.approx(1 / (2 * math.pi * cutoff), rel=0.15)
    # The first average itself is lower, by what the filter takes.
    assert found.deviation[0] * math.sqrt(0.005) < 0.08


def test_behind_another_filter_the_shortest_averages_are_left_out() -> None:
    filtered = lfilter(*butter(6, 20.0, fs=200.0), white(0.1, 400_000, 0.005, 1))
    found = fg.rate.allan(filtered, 0.005)
    assert found.angle_random_walk.value == pytest.approx(0.1, rel=0.02)
    assert found.fitted[0] > 0.005
    asked = fg.rate.allan(filtered, 0.005, shortest=0.3)
    assert asked.angle_random_walk.value == pytest.approx(0.1, rel=0.05)
    assert asked.fitted[0] == pytest.approx(0.32)
    with pytest.raises(ValueError, match=r"shortest is -1: it must be at least 0"):
        fg.rate.allan(filtered, 0.005, shortest=-1)


def test_a_slow_oscillation_leaves_the_angle_random_walk_and_shows_no_other_term() -> None:
    time = 0.005 * np.arange(400_000)
    found = fg.rate.allan(white(0.1, 400_000, 0.005, 1) + 0.02 * np.sin(2 * np.pi * 0.01 * time), 0.005)
    assert found.angle_random_walk.value == pytest.approx(0.1, rel=0.01)
    assert found.bias_instability.limit
    assert found.rate_random_walk.limit
    assert found.fitted[1] < 100.0  # the period


def test_records_without_noise_show_nothing() -> None:
    found = fg.rate.allan(np.ones((2, 1000)), 0.1)
    assert found.angle_random_walk is None
    assert found.bias_instability.limit
    assert found.fitted is None
    assert found.response_time == 0.0
    assert fg.rate.allan(white(1.0, 40, 1.0, 0), 1.0).angle_random_walk is None  # two octaves do not tell terms apart


def test_where_no_terms_fit_only_the_longest_averages_limit_them() -> None:
    # Two octaves of a sensor slower than all of them: its shortest averages show far less noise than there is.
    found = fg.rate.allan(slow(white(1.0, 40, 1.0, 0), 1.0, 50.0), 1.0)
    assert found.fitted is None
    assert found.high[0] < found.high[1] < found.high[2]
    assert found.bias_instability.high == pytest.approx(found.high[2] / allan.FLOOR, rel=0.1)
    assert found.rate_random_walk.high == pytest.approx(found.high[2] / math.sqrt(4 / 3), rel=0.1)


# -- Deviations without noise --------------------------------------------------------------------------------

INTERVAL, SAMPLES = 0.01, 200_000
TAU = INTERVAL * 2.0 ** np.arange(15)


def test_the_parts_of_the_terms_are_those_of_ieee_952() -> None:
    columns = Curve(TAU, np.ones(15), INTERVAL, SAMPLES, 1).columns(Response())
    np.testing.assert_allclose(columns[:, WHITE], 1 / TAU, rtol=1e-12)
    np.testing.assert_allclose(columns[4:, FLICKER], 2 * math.log(2) / math.pi, rtol=1e-2)
    np.testing.assert_allclose(columns[4:, WALK], TAU[4:] / 3, rtol=1e-2)


@pytest.mark.parametrize("lag", [0.05, 0.2])
def test_behind_a_slow_sensor_white_noise_is_markov_noise(lag: float) -> None:
    x = TAU / lag  # IEEE Std 952; of means over tau of the noise, here of samples
    markov = (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x)) / TAU
    columns = Curve(TAU, np.ones(15), INTERVAL, SAMPLES, 1).columns(Response(lag))
    np.testing.assert_allclose(columns[3:, WHITE], markov[3:], rtol=0.03)
    assert columns[0, WHITE] < 0.2 / TAU[0]
    # Long averages do not know of it.
    np.testing.assert_allclose(columns[-1], [1 / TAU[-1], 0.4413, TAU[-1] / 3], rtol=0.01)


@pytest.mark.parametrize(
    ("n", "b", "k", "response"),
    [
        (0.1, 0, 0, Response()),
        (0.1, 0.05, 0, Response()),
        (0.1, 0, 0.02, Response()),
        (0.1, 0.05, 0.02, Response()),
        (0.1, 0.05, 0.02, Response(0.2)),
        (0.1, 0.05, 0.02, Response(0.2, order=2)),
        (0, 0.05, 0, Response()),
    ],
)
def test_the_terms_of_a_deviation_without_noise_are_those_it_was_made_of(
    n: float, b: float, k: float, response: Response
) -> None:
    made_of = np.array([n, b, k]) ** 2
    variance = Curve(TAU, TAU, INTERVAL, SAMPLES, 1).columns(response) @ made_of
    fit = Curve(TAU, variance, INTERVAL, SAMPLES, 1).fit()
    assert fit is not None
    assert sorted(fit.power) == [term for term in range(3) if made_of[term]]
    for term, power in fit.power.items():
        # Behind a response its time is the likeliest, which is not quite the one without residuals.
        likeliest = 0.3 * math.sqrt(fit.variance[term]) if response.time else 0.0
        assert power == pytest.approx(made_of[term], rel=1e-9, abs=likeliest)
    assert fit.response.time == pytest.approx(response.time, rel=0.01)
    assert fit.response.order == response.order
    assert fit.part == slice(0, 15)


# -- Against allantools and tables ---------------------------------------------------------------------------


def test_the_deviation_is_that_of_allantools() -> None:
    record = 5.0 + white(1.0, 5000, 0.1, 3) + walk(0.1, 5000, 0.1, 3)
    found = fg.rate.allan(record, 0.1)
    tau, deviation, *_ = allantools.oadev(record, rate=10.0, data_type="freq", taus=found.tau)
    np.testing.assert_allclose(found.tau, tau, rtol=1e-12)
    np.testing.assert_allclose(found.deviation, deviation, rtol=1e-9)


@pytest.mark.parametrize(("term", "alpha"), [(WHITE, 0), (FLICKER, -1), (WALK, -2)])
def test_the_degrees_of_freedom_of_each_noise_are_those_of_greenhall_and_riley(term: int, alpha: int) -> None:
    curve = Curve(TAU, TAU, INTERVAL, SAMPLES, 1)
    variance = curve.columns(Response())[:, term]
    fit = Curve(TAU, variance, INTERVAL, SAMPLES, 1).fit()
    assert fit is not None
    assert list(fit.power) == [term]
    for i in range(4, 15):
        expected = allantools.edf_greenhall(alpha, d=2, m=2**i, N=SAMPLES + 1, overlapping=True, modified=False)
        assert curve.freedom(fit)[i] == pytest.approx(expected, rel=0.06)


def test_intervals_are_those_of_chi_square() -> None:
    # Tables: chi square of 10 degrees of freedom is 3.247 at 2.5 % and 20.483 at 97.5 %.
    assert allan._factors(np.array([10.0]))[:, 0] == pytest.approx(
        [math.sqrt(10 / 20.483), math.sqrt(10 / 3.247)], rel=1e-4
    )
    # 10 degrees of freedom: a power of 4 of variance 2 4^2/10.
    fit = Fit({WHITE: 4.0}, {WHITE: 3.2}, Response(), slice(0, 15))
    found = allan._estimate(fit, WHITE, math.inf)
    assert (found.low, found.value, found.high) == pytest.approx((1.3974, 2.0, 3.5098), rel=1e-4)


def test_the_averaging_times_go_by_octaves_up_to_a_tenth_of_the_record() -> None:
    record = np.random.default_rng(0).normal(size=(1, 1000))
    found = fg.rate.allan(record, 0.5)
    assert found.tau.tolist() == [0.5 * 2**n for n in range(7)]  # 64 of 1000, and 128 would be too many
    # Of one sample: half the mean square of differences.
    assert found.deviation[0] == pytest.approx(math.sqrt(0.5 * np.mean(np.diff(record) ** 2)), rel=1e-9)
    both = fg.rate.allan(np.concatenate([record, 3 * record]), 0.5)
    np.testing.assert_allclose(both.deviation, math.sqrt(5) * found.deviation, rtol=1e-12)  # of 1 and 9 the mean
    assert ((found.low < found.deviation) & (found.deviation < found.high)).all()
    with pytest.raises(ValueError, match=r"^the record has 19 samples: it must have at least 20$"):
        fg.rate.allan(np.ones(19), 1.0)


def test_a_record_whose_first_axis_is_time_is_refused_by_its_shape() -> None:
    with pytest.raises(
        ValueError, match=r"^values has shape \(60000, 3\): it must be .*, the last axis being time"
    ) as said:
        fg.rate.allan(np.random.default_rng(0).normal(size=(60_000, 3)), 0.01)
    assert str(said.value).endswith("take values.T")
    with pytest.raises(ValueError, match=r"^the record has 10 samples: it must have at least 20$"):
        fg.rate.allan(np.ones((3, 10)), 0.01)
    with pytest.raises(ValueError, match=r"^values has 3 dimensions: it must be \(samples\) or \(records, samples\)$"):
        fg.rate.allan(np.ones((3, 10, 10)), 0.01)


def test_a_sample_that_is_not_finite_is_refused_with_its_place() -> None:
    record = np.ones(50)
    record[[17, 30]] = np.nan, np.inf
    with pytest.raises(ValueError, match=r"^values is nan at sample 17: all must be finite, and 2 of 50 are not$"):
        fg.rate.allan(record, 1.0)
    both = np.array([np.ones(50), record])
    with pytest.raises(ValueError, match=r"^values is nan at sample 17 of record 1: .* 2 of 100 are not$"):
        fg.rate.allan(both, 1.0)
