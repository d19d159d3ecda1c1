"""Q, N, B and K of a record: on spectra without noise, on records whose terms are known, and against allantools."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import cast

import allantools
import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.curve import Curve
from fracgyro.rate.noise_terms import (
    FLICKER,
    QUANTIZATION,
    RESPONSES,
    WALK,
    WHITE,
    Fit,
    Power,
    Response,
    densities,
    fit,
)
from fracgyro.rate.results import noise_terms
from fracgyro.rate.spectrum import flicker_factor, spectrum
from nightly import nightly_unless
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
    """Output of a first-order sensor."""
    keep = math.exp(-interval / lag)
    return np.asarray(lfilter([1 - keep], [1, -keep], record))


@pytest.mark.nightly
def test_every_term_lies_in_its_interval_19_times_of_20_behind_a_sensor_of_finite_bandwidth_too() -> None:
    n, b, k, samples, trials = 1.0, 0.15, 0.01, 50_000, 20
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
            assert sum(one.low <= truth <= one.high for one in seen) >= 0.82 * len(seen)
        lags = [each.response_time for each in found]
        assert np.median(lags) == pytest.approx(lag, rel=0.05)


@pytest.mark.nightly
def test_a_term_that_is_not_there_is_seldom_seen_and_its_limit_holds() -> None:
    found = [fg.rate.allan(white(1.0, 2000, 1.0, seed), 1.0) for seed in range(50)]
    assert sum(not one.bias_instability.limit for one in found) <= 1
    assert sum(not one.rate_random_walk.limit for one in found) <= 1
    for seed in range(20):
        # B and K are too weak to be observed in a record this short.
        weak = white(1.0, 2000, 1.0, seed) + flicker(0.02, 2000, 1.0, seed) + walk(1e-3, 2000, 1.0, seed)
        one = fg.rate.allan(weak, 1.0)
        assert one.bias_instability.high > 0.02
        assert one.rate_random_walk.high > 1e-3


@pytest.mark.parametrize("cutoff", nightly_unless(lambda cutoff: cutoff == 5.0, [5.0, 20.0]))
def test_a_response_of_second_order_is_divided_out(cutoff: float) -> None:
    filtered = lfilter(*butter(2, cutoff, fs=200.0), white(0.1, 400_000, 0.005, 1))
    found = fg.rate.allan(filtered, 0.005)
    assert found.angle_random_walk.value == pytest.approx(0.1, rel=0.02)
    assert found.response_time == pytest.approx(1 / (2 * math.pi * cutoff), rel=0.15)
    # The first average itself is lower, because of the filter.
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


def test_records_without_noise_show_nothing() -> None:
    found = fg.rate.allan(np.ones((2, 1000)), 0.1)
    assert found.angle_random_walk is None
    assert found.bias_instability.limit
    assert found.fitted is None
    assert found.response_time == 0.0


def test_where_no_terms_fit_only_the_longest_averages_limit_them() -> None:
    # Too few samples of a sensor slower than all of them: its shortest averages show far less noise than there is.
    found = fg.rate.allan(slow(white(1.0, 24, 1.0, 0), 1.0, 50.0), 1.0)
    assert found.fitted is None
    assert found.angle_random_walk is None
    assert found.bias_instability.high == pytest.approx(found.high[-1] / allan.FLOOR, rel=0.1)
    assert found.rate_random_walk.high == pytest.approx(found.high[-1] / math.sqrt(found.tau[-1] / 3), rel=0.3)


@pytest.mark.parametrize("size", [0.1, 0.01])
@pytest.mark.parametrize("time", [150.0, 300.0])
def test_a_warm_up_changes_no_angle_random_walk_and_is_no_random_walk(size: float, time: float) -> None:
    noise, at = white(8e-4, 360_000, 0.01, 5), 0.01 * np.arange(360_000)
    clean = fg.rate.allan(noise, 0.01)
    found = fg.rate.allan(noise + size * np.exp(-at / time), 0.01)
    assert found.angle_random_walk.value == pytest.approx(clean.angle_random_walk.value, rel=0.003)
    assert found.angle_random_walk.low < 8e-4 < found.angle_random_walk.high
    assert found.rate_random_walk.limit
    assert found.bias_instability.limit
    drifts = [event for event in found.events if event.kind == "drift"]
    assert found.fitted[1] < found.tau[-1] or drifts
    assert not any(event.spoils for event in found.events)


def test_where_the_record_does_not_tell_b_from_k_it_says_so() -> None:
    said = [fg.rate.allan(white(1.0, 20_000, 1.0, seed) + walk(0.0015, 20_000, 1.0, seed), 1.0) for seed in range(12)]
    assert 3 <= sum(each.undecided for each in said) <= 11
    for each in said:
        if each.undecided:
            assert each.bias_instability.limit
            assert each.rate_random_walk.limit
    clear = fg.rate.allan(white(1.0, 20_000, 1.0, 1) + walk(0.02, 20_000, 1.0, 1), 1.0)
    assert not clear.undecided
    assert not clear.rate_random_walk.limit


def test_a_rounded_angle_shows_as_quantization_and_leaves_n() -> None:
    step, interval, samples = 0.02, 0.01, 200_000
    angle = np.cumsum(white(0.01, samples, interval, 2) * interval)
    rate = np.diff(np.round(angle / step) * step) / interval
    found = fg.rate.allan(rate, interval)
    assert found.quantization.low < step / math.sqrt(12) < found.quantization.high
    assert found.angle_random_walk.low < 0.01 < found.angle_random_walk.high
    assert fg.rate.allan(white(0.01, samples, interval, 2), interval).quantization.limit


def test_something_in_the_record_leaves_no_interval() -> None:
    record = white(1e-3, 50_000, 0.01, 0)
    record[20_000] += 3.0
    found = fg.rate.allan(record, 0.01)
    assert [event.kind for event in found.events] == ["spike"]
    assert (found.angle_random_walk.low, found.angle_random_walk.high) == (0.0, math.inf)
    assert [each.key for each in noise_terms(found) if each.grade] == []
    assert all(math.isnan(each.low) for each in noise_terms(found))


def test_steps_coarser_than_the_noise_leave_a_limit_that_holds() -> None:
    for offset in (0.0, 0.25, 0.5):
        rounded = np.round(white(1.0, 60_000, 1.0, 1) / 5 + offset) * 5
        walk = fg.rate.allan(rounded, 1.0).angle_random_walk
        assert walk.limit
        assert 1.0 < walk.high < 5.0


def test_a_sinusoid_is_left_out_and_said() -> None:
    time = 0.01 * np.arange(100_000)
    for size in (0.5, 20.0):
        found = fg.rate.allan(white(0.1, 100_000, 0.01, 3) + size * np.sin(2 * np.pi * 7.3 * time), 0.01)
        assert found.angle_random_walk.low < 0.1 < found.angle_random_walk.high
        strongest = max(found.lines, key=lambda line: line.amplitude)
        assert strongest.frequency == pytest.approx(7.3, abs=0.01)
        assert strongest.amplitude == pytest.approx(size, rel=0.15)


# -- Spectra without noise -----------------------------------------------------------------------------------

INTERVAL, SAMPLES = 0.01, 200_000
TAU = INTERVAL * 2.0 ** np.arange(15)


def test_the_cosine_transform_makes_white_noise_and_a_random_walk_independent() -> None:
    """Their covariances are diagonal in it, with the density over the interval."""
    samples, interval = 40, 0.5
    k = np.arange(1, samples)
    frequency = k / (2 * samples * interval)
    basis = np.sqrt(2 / samples) * np.cos(np.pi * np.outer(k, np.arange(samples) + 0.5) / samples)
    steps = np.tril(np.ones((samples, samples)))
    for covariance, density in (
        (np.eye(samples) / interval, np.ones(samples - 1)),
        (interval * steps @ steps.T, (interval / (2 * np.sin(np.pi * frequency * interval))) ** 2),
    ):
        np.testing.assert_allclose(interval * basis @ covariance @ basis.T, np.diag(density), atol=1e-9)
    record = np.random.default_rng(0).normal(size=(1, samples))
    found = spectrum(record, interval)
    single = slice(0, 32)
    np.testing.assert_allclose(found.power[single], interval * (basis @ record[0])[single] ** 2, rtol=1e-9)
    assert found.freedom.sum() == samples - 1


def test_the_lowest_powers_of_flicker_noise_have_their_factor() -> None:
    found = [spectrum(flicker(1.0, 2000, 1.0, seed)[None], 1.0) for seed in range(400)]
    power = np.mean([each.power[:8] for each in found], axis=0)
    expected = np.array([flicker_factor(k) for k in range(1, 9)]) / (2 * np.pi * found[0].frequency[:8])
    np.testing.assert_allclose(power, expected, rtol=4 * math.sqrt(2 / 400))
    assert flicker_factor(1) == pytest.approx(0.7737, abs=1e-3)
    assert flicker_factor(31) > 0.99


def test_the_parts_of_the_terms_are_those_of_ieee_952() -> None:
    columns = Curve(TAU, INTERVAL, SAMPLES, 1).columns(Response())
    np.testing.assert_allclose(columns[:, WHITE], 1 / TAU, rtol=1e-12)
    np.testing.assert_allclose(columns[4:, FLICKER], 2 * math.log(2) / math.pi, rtol=1e-2)
    np.testing.assert_allclose(columns[4:, WALK], TAU[4:] / 3, rtol=1e-2)
    np.testing.assert_allclose(columns[4:, QUANTIZATION], 3 / TAU[4:] ** 2, rtol=1e-2)


@pytest.mark.parametrize("lag", [0.05, 0.2])
def test_behind_a_slow_sensor_white_noise_is_markov_noise(lag: float) -> None:
    x = TAU / lag  # IEEE Std 952; of means over tau of the noise, here of samples
    markov = (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x)) / TAU
    columns = Curve(TAU, INTERVAL, SAMPLES, 1).columns(Response(lag))
    np.testing.assert_allclose(columns[3:, WHITE], markov[3:], rtol=0.03)
    assert columns[0, WHITE] < 0.2 / TAU[0]
    # Long averages are unaffected.
    np.testing.assert_allclose(columns[-1, :3], [1 / TAU[-1], 0.4413, TAU[-1] / 3], rtol=0.01)


@pytest.mark.parametrize("response", [Response(), *(Response(0.2, kind) for kind in RESPONSES)])
@pytest.mark.parametrize(
    ("n", "b", "k"),
    nightly_unless(
        lambda n, b, k: n * b * k > 0 or n == 0,
        [(0.1, 0, 0), (0.1, 0.05, 0), (0.1, 0, 0.02), (0.1, 0.05, 0.01), (0, 0.05, 0)],
    ),
)
def test_the_terms_of_a_spectrum_without_noise_are_those_it_was_made_of(
    n: float, b: float, k: float, response: Response
) -> None:
    if response.time and not n:
        return  # not observed
    made_of = np.array([n, b, k]) ** 2
    plain = spectrum(white(1.0, SAMPLES, INTERVAL, 0)[None], INTERVAL)
    density = densities(plain)[:, :3] @ made_of * response.gain(plain.frequency, INTERVAL)
    found = fit(replace(plain, power=density))
    assert found is not None
    for term, power in found.terms.items():
        assert power.seen == (term < 3 and made_of[term] > 0)
        if power.seen:
            assert power.value == pytest.approx(made_of[term], rel=1e-4)
            assert power.low < made_of[term] < power.high
    assert found.response.time == pytest.approx(response.time, rel=0.01)
    if response.time:
        assert found.response.kind == response.kind
    assert found.frequency == (plain.frequency[0], plain.frequency[-1])
    assert found.whole


def test_the_interval_of_white_noise_alone_is_that_of_chi_square() -> None:
    found = fg.rate.allan(white(1.0, 100_000, 1.0, 0), 1.0).angle_random_walk
    half = 1.96 / math.sqrt(2 * 100_000)
    # B and K may be there, too, which makes it a little wider.
    assert 0.99 * half < (found.high - found.low) / 2 / found.value < 1.25 * half


# -- Against allantools and tables ---------------------------------------------------------------------------


def test_the_deviation_is_that_of_allantools() -> None:
    record = 5.0 + white(1.0, 5000, 0.1, 3) + walk(0.1, 5000, 0.1, 3)
    found = fg.rate.allan(record, 0.1)
    tau, deviation, *_ = allantools.oadev(record, rate=10.0, data_type="freq", taus=found.tau)
    np.testing.assert_allclose(found.tau, tau, rtol=1e-12)
    np.testing.assert_allclose(found.deviation, deviation, rtol=1e-9)


@pytest.mark.parametrize(("term", "alpha"), [(WHITE, 0), (FLICKER, -1), (WALK, -2)])
def test_the_degrees_of_freedom_of_each_noise_are_those_of_greenhall_and_riley(term: int, alpha: int) -> None:
    terms = {each: Power(float(each == term), 0.0, 1.0, seen=True) for each in (WHITE, FLICKER, WALK)}
    found = Fit(terms, Response(), (1e-3, 50.0), whole=True, undecided=False)
    freedom = Curve(TAU, INTERVAL, SAMPLES, 1).freedom(found)
    for i in range(4, 15):
        expected = allantools.edf_greenhall(alpha, d=2, m=2**i, N=SAMPLES + 1, overlapping=True, modified=False)
        assert freedom[i] == pytest.approx(expected, rel=0.06)


def test_intervals_of_the_deviation_are_those_of_chi_square() -> None:
    # Tables: chi square of 10 degrees of freedom is 3.247 at 2.5 % and 20.483 at 97.5 %.
    assert allan._factors(np.array([10.0]))[:, 0] == pytest.approx(
        [math.sqrt(10 / 20.483), math.sqrt(10 / 3.247)], rel=1e-4
    )


def test_the_averaging_times_go_by_octaves_up_to_a_tenth_of_the_record() -> None:
    record = np.random.default_rng(0).normal(size=(1, 1000))
    found = fg.rate.allan(record, 0.5)
    assert found.tau.tolist() == [0.5 * 2**n for n in range(7)]  # 64 of 1000, and 128 would be too many
    # One sample: half the mean square of differences.
    assert found.deviation[0] == pytest.approx(math.sqrt(0.5 * np.mean(np.diff(record) ** 2)), rel=1e-9)
    both = fg.rate.allan(np.concatenate([record, 3 * record]), 0.5)
    np.testing.assert_allclose(both.deviation, math.sqrt(5) * found.deviation, rtol=1e-12)  # the mean of 1 and 9
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


ODD: dict[str, Array] = {
    "alternating": np.where(np.arange(40) % 2, 1.0, -1.0),
    "a ramp": np.arange(500.0),
    "a step": np.repeat([2.0, 1.0], 250),
    "one sample": np.eye(1, 300, 150)[0],
    "whole numbers": np.random.default_rng(0).integers(-5, 5, 1009),
    "single precision": np.random.default_rng(0).normal(size=1009).astype(np.float32),
    "a sine": np.sin(0.3 * np.arange(1009)),
    "twice summed": np.cumsum(np.cumsum(np.random.default_rng(0).normal(size=1009))),
    "far from zero": 1e9 + np.random.default_rng(0).normal(size=1009),
    "tiny": 1e-200 * np.random.default_rng(0).normal(size=127),
    "twenty": np.random.default_rng(0).normal(size=20),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ODD)
def test_records_of_any_kind_end_without_a_warning(kind: str) -> None:
    found = fg.rate.allan(ODD[kind], 0.01)
    for term in (found.bias_instability, found.rate_random_walk, found.quantization):
        assert term.limit or term.low <= term.value <= term.high
    assert all(event.sentence.isprintable() for event in found.events)


def test_fitted_averaging_times_are_within_half_periods_of_the_fitted_frequencies() -> None:
    tau = 0.01 * 2.0 ** np.arange(13)
    assert allan._fitted(cast(Fit, SimpleNamespace(frequency=(0.05, 50.0))), tau) == pytest.approx((0.01, 5.12))
    assert allan._fitted(None, tau) is None
