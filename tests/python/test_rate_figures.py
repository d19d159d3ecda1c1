"""Figures of merit of a rate sensor: units by hand, and gyroscopes with known errors."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from figure_data import column, read
from fracgyro.analysis.confidence import Mean
from fracgyro.cli import cli
from fracgyro.cli.rate import _print_figures
from fracgyro.rate import plots
from fracgyro.rate.allan import allan
from fracgyro.rate.bound import Bound
from fracgyro.rate.grades import Grade, grade
from fracgyro.rate.measure import _check_rest, _credible, rms_interval
from fracgyro.rate.merit import Response, full_scale, gain_and_lag, response, static, turn_on_time
from fracgyro.rate.report import grade_of, interval_of, value_of
from fracgyro.rate.require import verdict
from fracgyro.rate.results import Result, _mean, noise_terms
from fracgyro.rate.sensor import Output
from fracgyro.rate.units import (
    DEG_PER_H,
    DEG_PER_H_PER_ROOT_H,
    DEG_PER_ROOT_H,
    DEG_PER_S,
    DEG_PER_S_PER_ROOT_HZ,
    DEGREE,
    HERTZ,
    MILLISECOND,
    PERCENT,
    PPM,
    Unit,
    angle_random_walk,
    thermal_force_density,
)
from fracgyro.scenario import Scenario, ScenarioError
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.signal import lfilter

DEG = math.pi / 180

# -- Units, worked by hand -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "si", "worked"),
    [
        (DEG_PER_S, math.pi, 180.0),
        (DEG_PER_S, 1.0, 57.29577951308232),
        (DEG_PER_H, DEG, 3600.0),  # 1 deg/s
        (DEG_PER_H, 7.2921159e-5, 15.04106865),  # the Earth, which turns 360.9856 deg a day
        (DEG_PER_ROOT_H, DEG, 60.0),  # 1 deg/sqrt(s) = 60 deg/sqrt(h), as an hour has 60 squared seconds
        (DEG_PER_ROOT_H, DEG / 60, 1.0),
        (DEG_PER_H_PER_ROOT_H, DEG, 3600.0 * 60.0),
        (PPM, 0.001, 1000.0),
        (PERCENT, 0.25, 25.0),
        (HERTZ, 100.0, 100.0),
        (DEGREE, math.pi / 4, 45.0),
        (MILLISECOND, 0.25, 250.0),
    ],
)
def test_a_unit_is_as_worked_by_hand(unit: Unit, si: float, worked: float) -> None:
    assert unit.of(si) == pytest.approx(worked, rel=1e-7)
    assert unit.to_si(worked) == pytest.approx(si, rel=1e-7)


def test_one_degree_per_root_hour_is_a_sixtieth_of_a_degree_per_second_per_root_hertz_two_sided() -> None:
    density = DEG_PER_S_PER_ROOT_HZ.to_si(1 / 60)
    assert DEG_PER_ROOT_H.of(angle_random_walk(density, one_sided=False)) == pytest.approx(1.0, rel=1e-12)
    # A datasheet's one-sided density holds twice the power for the same noise.
    assert DEG_PER_ROOT_H.of(angle_random_walk(density, one_sided=True)) == pytest.approx(0.70710678, rel=1e-7)


def test_the_thermal_force_on_a_milligram_resonator_is_that_of_nyquist() -> None:
    # 2 * 1.380649e-23 * 300 * 1e-6 = 8.283894e-27
    assert thermal_force_density(1e-6, 300.0) * 1e27 == pytest.approx(8.283894, rel=1e-12)


# -- Allan deviation -----------------------------------------------------------------------------------------


def white(density: float, interval: float, shape: tuple[int, int], seed: int) -> NDArray[np.float64]:
    """Samples, each the mean over an interval, of white rate noise of this two-sided amplitude density."""
    return np.random.default_rng(seed).normal(size=shape) * density / math.sqrt(interval)


@pytest.mark.nightly
def test_the_angle_random_walk_of_white_noise_lies_in_its_interval_19_times_of_20() -> None:
    density, interval, hits, trials = 0.02, 0.01, 0, 100
    for seed in range(trials):
        found = allan(white(density, interval, (2, 2000), seed), interval).angle_random_walk
        assert found is not None
        hits += found.low <= density <= found.high
    assert 0.9 <= hits / trials <= 0.995  # 0.95, and 2.2 standard deviations of the count


def test_more_records_make_the_interval_narrower() -> None:
    one, four = (allan(white(1.0, 0.1, (n, 4000), 1), 0.1).angle_random_walk for n in (1, 4))
    assert one is not None
    assert four is not None
    assert (four.high - four.low) / (one.high - one.low) == pytest.approx(0.5, rel=0.1)


def test_white_noise_and_a_walking_rate_are_told_apart() -> None:
    interval, white_density, walk = 1.0, 1.0, 0.02
    noise = white(white_density, interval, (4, 40_000), 5)
    steps = np.random.default_rng(6).normal(size=noise.shape) * walk * math.sqrt(interval)
    found = allan(noise + np.cumsum(steps, axis=1), interval)
    assert found.angle_random_walk is not None
    assert found.angle_random_walk.value == pytest.approx(white_density, rel=0.05)
    assert not found.rate_random_walk.limit
    assert found.rate_random_walk.value == pytest.approx(walk, rel=0.2)  # it varies by 6 %
    # No flicker noise. N^2/tau + K^2 tau/3 is least at tau = sqrt(3) N/K, and 2 N K/sqrt(3) there.
    assert found.bias_instability.limit
    assert 0.02 < found.bias_instability.high < math.sqrt(2 * white_density * walk / math.sqrt(3)) / 0.664


def slow(records: NDArray[np.float64], interval: float, lag: float) -> NDArray[np.float64]:
    """Output of a first-order sensor."""
    keep = math.exp(-interval / lag)
    return np.asarray(lfilter([1 - keep], [1, -keep], records, axis=1))


def test_a_sensor_that_answers_slowly_shows_the_same_angle_random_walk() -> None:
    density, interval = 0.1, 0.01
    found = allan(slow(white(density, interval, (4, 50_000), 3), interval, 0.1), interval).angle_random_walk
    assert found is not None
    assert found.value == pytest.approx(density, rel=0.08)


def test_the_rise_of_a_slow_answer_is_no_rate_random_walk_and_its_low_start_no_floor() -> None:
    density, interval = 0.1, 0.01
    # So short that the shortest average has the least deviation.
    found = allan(slow(white(density, interval, (4, 1000), 3), interval, 0.1), interval)
    assert found.deviation[0] == found.deviation.min()
    assert found.rate_random_walk.limit
    assert found.bias_instability.limit
    assert found.bias_instability.high > found.deviation[0] / 0.664


def test_a_walking_rate_is_found_behind_a_slow_answer() -> None:
    density, interval, walk = 0.1, 0.01, 0.05
    noise = white(density, interval, (4, 50_000), 3)
    steps = np.random.default_rng(6).normal(size=noise.shape) * walk * math.sqrt(interval)
    found = allan(slow(noise + np.cumsum(steps, axis=1), interval, 0.1), interval)
    assert not found.rate_random_walk.limit
    assert found.rate_random_walk.value == pytest.approx(walk, rel=0.35)  # the estimate itself varies by 10 %
    assert found.angle_random_walk is not None
    assert found.angle_random_walk.value == pytest.approx(density, rel=0.1)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (np.ones(19), "19 samples: it must have at least 20"),
        (np.full(100, np.nan), "nan at sample 0: all must be finite"),
    ],
)
def test_a_record_too_short_or_not_finite_is_refused(record: NDArray[np.float64], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        allan(record, 1.0)


# -- Display of a figure -------------------------------------------------------------------------------------


def figure(value: float, low: float = math.nan, high: float = math.nan, graded: Grade | None = "tactical") -> Result:
    return Result("key", "Figure", "what it is", "deg/h", value, low, high, "a note", graded)


@pytest.mark.parametrize(
    ("result", "value", "interval", "graded"),
    [
        (figure(5.0, 4.0, 6.0), "5", "4 to 6", "tactical"),
        (figure(math.nan, high=4.97), "< 4.97", "", "tactical (limit only)"),
        (figure(math.nan, low=9600.0), "≥ 9600", "", "tactical (limit only)"),
        (figure(math.nan, graded=None), "–", "", ""),
    ],
)
def test_a_figure_that_is_only_bounded_is_shown_as_that(result: Result, value: str, interval: str, graded: str) -> None:
    assert (value_of(result), interval_of(result), grade_of(result)) == (value, interval, graded)


def test_the_terminal_shows_the_notes_below_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    _print_figures([figure(5.0), figure(math.nan, low=9600.0)])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines[:3]] == [
        ["figure", "value", "unit", "interval", "grade"],
        ["Figure", "5", "deg/h", "tactical"],
        ["Figure", "≥", "9600", "deg/h", "tactical", "(limit", "only)"],
    ]
    assert lines[3:] == ["", "Figure: a note.", "Figure: a note."]


# -- A gyroscope with known errors ---------------------------------------------------------------------------

RATES = DEG * np.array([-300.0, -200.0, -100.0, -30.0, 0.0, 30.0, 100.0, 200.0, 300.0])


def gyroscope(rates: NDArray[np.float64], runs: int, noise: float, seed: int) -> NDArray[np.float64]:
    """Scale factor 1.002, bias 0.5 deg/s, and noise on each mean."""
    outputs = 1.002 * rates[:, None] + 0.5 * DEG
    return outputs + noise * np.random.default_rng(seed).normal(size=(len(rates), runs))


def test_scale_factor_and_bias_come_back_within_their_intervals_19_times_of_20() -> None:
    trials, factor_hits, bias_hits = 300, 0, 0
    for seed in range(trials):
        found = static(RATES, gyroscope(RATES, 8, 0.1 * DEG, seed))
        factor_hits += found.scale_factor.low <= 1.002 <= found.scale_factor.high
        bias_hits += found.zero_rate_output.low <= 0.5 * DEG <= found.zero_rate_output.high
    assert 0.92 <= factor_hits / trials <= 0.985
    assert 0.92 <= bias_hits / trials <= 0.985


def test_nonlinearity_is_the_largest_deviation_from_the_line_over_the_full_scale() -> None:
    # A cubic of 3 deg/s at 300: the line takes 3/5 of it up (for a continuum), the ends keep 2/5 = 0.4 %.
    dense = DEG * np.linspace(-300, 300, 601)
    found = static(dense, (dense + 3 * DEG * (dense / dense[-1]) ** 3)[:, None].repeat(2, axis=1))
    assert abs(found.nonlinearity.mean) == pytest.approx(0.004, rel=0.02)
    assert found.scale_factor.mean == pytest.approx(1.006, abs=1e-4)


def test_full_scale_ends_where_one_percent_is_exceeded_and_at_divergence() -> None:
    rates = DEG * np.array([-1200.0, -600.0, -300.0, 0.0, 300.0, 600.0, 1200.0])
    outputs = rates.copy()[:, None].repeat(2, axis=1)
    line = static(rates[2:5], outputs[2:5])
    assert full_scale(rates, outputs, line) == (pytest.approx(1200 * DEG), True)
    for bad in (1200 * DEG * 0.985, math.nan):
        outputs[-1] = bad
        assert full_scale(rates, outputs, line) == (pytest.approx(600 * DEG), False)


def test_full_scale_is_about_the_output_at_rest_and_the_scale_factor_of_the_line() -> None:
    rates = DEG * np.array([-600.0, -300.0, 0.0, 300.0, 600.0])
    outputs = (1.05 * rates + 20 * DEG)[:, None].repeat(2, axis=1)
    line = static(rates[1:4], outputs[1:4])
    assert full_scale(rates, outputs, line) == (pytest.approx(600 * DEG), True)
    outputs[0] -= 6.1 * DEG  # on one side only, and more than 1 % of 600
    assert full_scale(rates, outputs, line) == (pytest.approx(300 * DEG), False)
    outputs[0] += 0.2 * DEG
    assert full_scale(rates, outputs, line) == (pytest.approx(600 * DEG), True)
    outputs[1] += 4 * DEG
    assert full_scale(rates, outputs, line) == (0.0, False)
    one = np.array([-1.0, 0.0, 1.0])  # rad/s
    assert full_scale(one, one[:, None].repeat(2, axis=1), static(one, one[:, None].repeat(2, axis=1))) == (1.0, True)


def test_turn_on_ends_at_the_last_output_that_is_one_percent_off() -> None:
    time = np.arange(1000) * 1e-3
    settling = 5.0 * (1 - np.exp(-time / 0.05))[None]
    # exp(-t/0.05) = 0.01 at t = 0.05 ln 100 = 0.2303
    assert turn_on_time(time, settling) == pytest.approx(0.2303, abs=2e-3)
    unsteady = settling.copy()
    unsteady[0, 900] = 6.0
    assert math.isnan(turn_on_time(time, unsteady))


def test_the_final_value_is_that_of_the_second_half_and_must_be_reached_before_it() -> None:
    time = np.arange(30.0)
    for first, expected in ((12, 12.0), (14, 14.0), (15, math.nan)):
        outputs = np.where(time < first, 0.0, 1.0)[None]
        assert turn_on_time(time, outputs) == pytest.approx(expected, nan_ok=True)


def test_a_first_order_sensor_has_3_db_at_its_corner_and_45_degrees_of_lag_there() -> None:
    corner, factor, interval = 40.0, 1.01, 1e-3
    frequency = np.geomspace(5, 200, 12)
    gains = []
    for f in frequency:
        start = np.arange(2000) * interval
        answer = factor / (1 + 1j * f / corner)
        # The mean over each interval of the answer to 2 sin(2 pi f t), with a drift that must not matter.
        primitive = [-(np.exp(2j * np.pi * f * t) * answer).real / (2 * np.pi * f) for t in (start, start + interval)]
        mean = 2 * (primitive[1] - primitive[0]) / interval
        gains.append([gain_and_lag(start + interval / 2, mean + 0.3 + 0.1 * start, 2.0, float(f), interval)] * 2)
    found = response(frequency, np.array(gains), factor)
    assert found.bandwidth.mean == pytest.approx(corner, rel=0.02)
    assert found.lag_at_bandwidth == pytest.approx(math.pi / 4, rel=0.02)
    assert found.gain[0] == pytest.approx(1 / math.hypot(1, 5 / 40), rel=1e-6)


def test_the_lag_goes_on_beyond_half_a_turn() -> None:
    frequency = np.geomspace(1.0, 100.0, 30)
    # Three lags in a row, each of 45 degrees at 10 Hz: 252.9 at 100 Hz; the level of 3 dB where one has 1 dB.
    found = response(frequency, np.repeat((1 / (1 + 1j * frequency / 10) ** 3)[:, None], 2, axis=1), 1.0)
    assert found.lag == pytest.approx(3 * np.arctan(frequency / 10))
    assert found.bandwidth.mean == pytest.approx(10 * math.sqrt(2 ** (1 / 3) - 1), rel=0.01)
    assert found.lag_at_bandwidth == pytest.approx(3 * math.atan(math.sqrt(2 ** (1 / 3) - 1)), rel=0.01)


def test_a_bandwidth_outside_the_frequencies_tried_is_said_to_be_so() -> None:
    frequency = np.array([1.0, 2.0, 4.0])
    assert response(frequency, np.ones((3, 2), complex), 1.0).bandwidth.mean == math.inf
    assert response(frequency, np.full((3, 2), 0.1 + 0j), 1.0).bandwidth == (0.0, 0.0, 1.0)


def test_a_bandwidth_below_1_hz_is_one() -> None:
    frequency = np.geomspace(0.1, 10.0, 30)
    found = response(frequency, np.repeat((1 / (1 + 1j * frequency / 0.5))[:, None], 2, axis=1), 1.0)
    assert found.bandwidth.mean == pytest.approx(0.5, rel=0.01)


def test_a_bandwidth_that_every_run_has_elsewhere_is_lost_in_the_noise() -> None:
    frequency = np.geomspace(1.0, 100.0, 9)
    gains = np.array([1 / (1 + 1j * frequency / corner) for corner in (3.0, 30.0, 10.0)]).T
    assert math.isnan(response(frequency, gains, 1.0).bandwidth.mean)
    for elsewhere in (1.0, 0.1):  # this one falls nowhere, or has fallen before
        gains[:, 0] = elsewhere
        assert math.isnan(response(frequency, gains, 1.0).bandwidth.mean)


# -- Grades --------------------------------------------------------------------------------------------------


def test_a_figure_has_the_best_grade_whose_limit_it_keeps() -> None:
    assert [grade("bias", v) for v in (0.005, -5.0, 500.0, 2000.0)] == [
        "navigation",
        "tactical",
        "consumer",
        "below consumer",
    ]
    assert [grade("scale_factor", v) for v in (5.0, -500.0, 5000.0, 20000.0)] == [
        "navigation",
        "tactical",
        "consumer",
        "below consumer",
    ]
    assert [grade("angle_random_walk", v) for v in (0.0005, 0.1, 900.0)] == ["navigation", "tactical", "consumer"]
    assert [grade("bandwidth", v) for v in (99.0, 80.0, 10.0)] == ["navigation", "consumer", "below consumer"]
    assert grade("bias", math.nan) == "below consumer"


def test_a_turn_on_is_drawn_to_its_last_output_in_decades_about_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []

    def embedded(figure: Figure, title: str) -> str:
        drawn.append(figure)
        return title

    monkeypatch.setattr(plots, "embedded", embedded)
    output = Output(DEG * np.array([[2e5, -4e3, 300.0, 300.0]]), interval=1e-3)
    measured: Any = SimpleNamespace(turn_on=output, turn_on_time=2e-3, rates=DEG * np.array([-300.0, 0.0, 300.0]))
    chart = plots.turn_on_chart(measured)
    assert column(read(chart.data), "time (ms)") == pytest.approx([0.5, 1.5, 2.5, 3.5])
    decades = [1e3, 1e4, 1e5, 1e6]
    assert drawn[0].axes[0].get_yticks() == pytest.approx([*(-d for d in reversed(decades)), 0.0, *decades])


# -- Observed figures and requirements -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "low", "high", "limit", "expected"),
    [
        ("angle_random_walk", 0.09, 0.08, 0.10, 0.10, "pass"),
        ("angle_random_walk", 0.09, 0.08, 0.11, 0.10, "undecided"),
        ("angle_random_walk", 0.12, 0.11, 0.13, 0.10, "fail"),
        ("angle_random_walk", math.nan, math.nan, math.nan, 0.1, "undecided"),
        ("bias_instability", math.nan, math.nan, 9.0, 10.0, "pass"),
        ("bias_instability", math.nan, math.nan, 11.0, 10.0, "undecided"),
        ("zero_rate_output", -8.0, -9.0, -7.0, 10.0, "pass"),
        ("zero_rate_output", -12.0, -13.0, -11.0, 10.0, "fail"),
        ("zero_rate_output", 1.0, -20.0, 22.0, 10.0, "undecided"),
        ("bandwidth", 60.0, 55.0, 65.0, 50.0, "pass"),
        ("bandwidth", 45.0, 42.0, 48.0, 50.0, "fail"),
        ("bandwidth", math.nan, 55.0, math.nan, 50.0, "pass"),
        ("bandwidth", math.nan, math.nan, 40.0, 50.0, "fail"),
        ("full_scale", 600.0, math.nan, math.nan, 300.0, "pass"),
        ("full_scale", 100.0, math.nan, math.nan, 300.0, "fail"),
        ("turn_on_time", math.nan, math.nan, math.nan, 10.0, "undecided"),
    ],
)
def test_a_requirement_is_decided_by_the_interval(
    key: str, value: float, low: float, high: float, limit: float, expected: str
) -> None:
    assert verdict(Result(key, "Figure", "", "deg/h", value, low, high), limit) == expected


def test_a_mean_that_may_be_zero_has_no_grade() -> None:
    noise, bias = (
        _mean("zero_rate_output", "", "", DEG_PER_H, Mean(1e-4, 1e-4 - half, 1e-4 + half), "bias")
        for half in (2e-4, 5e-5)
    )
    assert noise.grade is None
    assert noise.note == "not observed: its interval includes 0"
    assert (bias.grade, bias.note) == (grade("bias", bias.value), "")


def test_an_angle_random_walk_below_half_of_its_bound_is_not_observed() -> None:
    found = allan(np.random.default_rng(0).normal(size=10_000), 0.01)
    walk = found.angle_random_walk
    assert walk is not None
    for ratio, observed in ((0.4, False), (0.6, True)):
        bound = Bound(known=walk.value / ratio, unknown=walk.value / ratio)
        seen = _credible(found, bound)
        assert (seen.angle_random_walk is not None) == observed
        (line, *_) = noise_terms(seen, bound)
        assert line.note.startswith("not observed, the record is too short") != observed
        assert (line.grade is not None) == observed


@pytest.mark.parametrize(("rest", "refused"), [(0.09, True), (0.11, False)])
def test_a_record_at_rest_lasts_ten_over_the_bandwidth(rest: float, refused: bool) -> None:
    frequency = np.array([10.0, 1000.0])
    answered = Response(frequency, np.array([1.0, 0.1]), np.zeros(2), Mean(100.0, 99.0, 101.0), 0.8)
    if refused:
        with pytest.raises(ScenarioError, match=r"^rest is 0\.09: it must be at least 0\.1 s, 10 over the bandwidth"):
            _check_rest(rest, answered)
    else:
        _check_rest(rest, answered)


@pytest.mark.parametrize(
    ("limits", "code", "lines"),
    [
        (
            "arw=0.1,bandwidth=50",
            0,
            ["angle_random_walk, at most 0.1 deg/sqrt(h): pass", "bandwidth, at least 50 Hz: pass"],
        ),
        ("arw=0.01", 1, ["angle_random_walk, at most 0.01 deg/sqrt(h): fail"]),
        ("arw=0.05", 1, ["angle_random_walk, at most 0.05 deg/sqrt(h): undecided"]),
    ],
)
def test_requirements_decide_the_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limits: str, code: int, lines: list[str]
) -> None:
    found = [
        Result("angle_random_walk", "Angle random walk", "", "deg/sqrt(h)", 0.05, 0.04, 0.06),
        Result("bandwidth", "Bandwidth", "", "Hz", 60.0, 55.0, 65.0),
    ]
    monkeypatch.setattr("fracgyro.rate.characterise", lambda *words, **options: found)
    Scenario.shipped("dual_mass").save(tmp_path / "device.toml")
    words = ["rate", str(tmp_path / "device.toml"), "--out", str(tmp_path / "out"), "--require", limits]
    ran = CliRunner().invoke(cli, words)
    assert ran.exit_code == code
    assert [line for line in ran.stdout.splitlines() if ", at " in line] == lines


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ("arv=1", "--require arv is not a figure; known are arw, bias, "),
        ("bandwith=1", "--require bandwith is not a figure; did you mean bandwidth?"),
        ("arw", "--require arw is '': it must be a number above 0, as in arw=0.1"),
        ("arw=-1", "--require arw is '-1': it must be a number above 0, as in arw=0.1"),
    ],
)
def test_a_requirement_that_is_none_is_refused_before_the_measurement(limits: str, said: str) -> None:
    ran = CliRunner().invoke(cli, ["rate", "device.toml", "--out", "out", "--require", limits])
    assert ran.exit_code == 2
    assert said in ran.output


def test_no_interval_of_an_rms_is_negative() -> None:
    wide = np.array([[1.0, -1.0], [9.0, 9.0]])
    mean, low, high = rms_interval(wide)
    assert (mean, low) == (5.0, 0.0)
    assert high > 9.0
    assert rms_interval(np.array([[1.0, -1.0], [1.1, 1.1]])).low > 0.0
