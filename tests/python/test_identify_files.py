"""Identification from files: columns, units, gaps, faults, sweeps, the command, and the scenario that is written."""

from __future__ import annotations

import json
import math
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DUAL_MASS, RATE, Device
from browser import faults_of_report
from click.testing import CliRunner
from fracgyro.cli.identify import identify_command
from fracgyro.identification.bench import read_bench
from fracgyro.identification.diagnostics import whiteness
from fracgyro.identification.records import Response, State
from fracgyro.identification.sweep import SweepFit, fit_sweep, sweep_tests
from fracgyro.identification.trends import line
from fracgyro.scenario.amounts import amount
from nightly import nightly_unless

DATA = os.environ.get("FRACGYRO_RESONATOR")
REAL = Path(DATA) if DATA else Path(__file__).resolve().parents[2].parent / "shared/data/resonator"
SAMPLES, PER_PERIOD = 12_000, 8.0


def motion(noise: float = 1e-3, seed: int = 0) -> np.ndarray:
    clean = DUAL_MASS.motion(SAMPLES, PER_PERIOD)
    return clean + noise * np.random.default_rng(seed).normal(size=clean.shape)


def write(path: Path, values: np.ndarray, header: str = "time [ms],x [V],y [mV]", unit: float = 1e3) -> Path:
    times = unit * DUAL_MASS.interval(PER_PERIOD) * np.arange(values.shape[1])
    np.savetxt(path, np.column_stack([times, *values]), delimiter=",", header=header, comments="", fmt="%.10g")
    return path


# -- Reading -----------------------------------------------------------------------------------------------------------


def test_units_and_times_are_read_from_the_columns(tmp_path: Path) -> None:
    values = motion()
    path = write(tmp_path / "ring.csv", values * [[1], [1000]])
    found = fg.identify([path])
    arrays = fg.identify(fg.identify.Record(*values, interval=DUAL_MASS.interval(PER_PERIOD)))
    for name in ("frequency_1", "rate", "pickoff_ratio"):
        assert found[name].value == pytest.approx(arrays[name].value, abs=0.01 * arrays[name].half)
    assert list(found.files) == ["ring.csv"]


def test_motion_in_meters_needs_no_gain_of_the_pick_off(tmp_path: Path) -> None:
    path = write(tmp_path / "ring.csv", 5.0 * motion(), "time [ms],x [um],y [um]")
    scenario = fg.identify([path], mass=1.42e-6).scenario()
    assert scenario.plant.reference_length == pytest.approx(5e-6, rel=0.05)
    density = 5e-9 * np.sqrt(2 * DUAL_MASS.interval(PER_PERIOD))
    assert scenario.device.position_noise_density == pytest.approx(density, rel=0.1)


def test_a_gap_splits_the_record(tmp_path: Path) -> None:
    whole = motion()
    times = 1e3 * DUAL_MASS.interval(PER_PERIOD) * np.arange(SAMPLES)
    kept = np.r_[0:5000, 5037:SAMPLES]
    rows = np.column_stack([times, *whole])[kept]
    np.savetxt(tmp_path / "gap.csv", rows, delimiter=",", header="time [ms],x,y", comments="", fmt="%.10g")
    found = fg.identify([tmp_path / "gap.csv"])
    assert any("37 samples are missing: the record is split" in note for note in found.notes)
    assert abs(found["rate"].value - RATE) < 4 * found["rate"].half
    assert not [each for each in found.tests if each.verdict == "fail"]


def test_a_clipped_beginning_is_left_out(tmp_path: Path) -> None:
    values = motion()
    path = write(tmp_path / "clip.csv", np.clip(values, -0.9, 0.9))
    found = fg.identify([path])
    (note,) = [each for each in found.notes if "clips at 0.9" in each and "x " in each]
    assert re.search(r"clip\.csv: x clips at 0\.9 V in \d+ samples until 0\.\d+ s: the record is used from there", note)
    assert abs(found["quality_1"].value / 4662 - 1) < 0.02
    assert not [each for each in found.tests if each.verdict == "fail"]


def test_the_part_before_the_decay_is_left_out(tmp_path: Path) -> None:
    """3000 samples of a drive at constant amplitude, as of an oscilloscope that triggers early."""
    values = motion()
    steps = np.arange(-3000, 0) * 2 * np.pi / PER_PERIOD
    driven = np.stack([np.cos(steps), np.sin(1.01 * steps)]) + 1e-3 * np.random.default_rng(5).normal(size=(2, 3000))
    path = write(tmp_path / "early.csv", np.hstack([driven, values]))
    found = fg.identify([path])
    assert any("the drive is on until" in note for note in found.notes)
    assert abs(found["quality_1"].value / 4662 - 1) < 0.02
    explicit = fg.identify([(path, {"begin": 3100 * DUAL_MASS.interval(PER_PERIOD)})])
    assert not any("the drive is on" in note for note in explicit.notes)


@pytest.mark.parametrize(
    ("header", "change", "sentence"),
    [
        ("time [ms],a,b", None, "has no column x or y: its columns are time [ms], a, b"),
        ("time [ms],x [furlong],y", None, "x is in furlong: it must be in V, A, N, m or code"),
        ("time [ms],x,y", "nan", "line 12: y is empty or NaN: it must be a finite number"),
        ("time [ms],x,y", "offset", "only an offset is in y: is it coupled, is the unit right?"),
        ("time [ms],x,y", "dead", "y never exceeds its noise"),
        ("time [ms],x,y", "short", "has 50 samples: it must have at least 64"),
        ("a,x,y", None, "has no column time: give the sampling rate"),
        ("time [parsec],x,y", None, "time [parsec] must be in s, ms, us or ns; or give --sampling"),
        ("time [ms],x [V],y [nA]", None, "x is in V and y in nA: both must be in one unit, V, A, N, m or code"),
    ],
)
def test_a_bad_record_is_refused_in_one_sentence(
    tmp_path: Path, header: str, change: str | None, sentence: str
) -> None:
    values = motion()
    if change == "nan":
        values[1, 10] = np.nan
    elif change == "offset":
        values[1] = 0.3
    elif change == "dead":
        values[1] = 1e-3 * np.random.default_rng(3).normal(size=SAMPLES)
    elif change == "short":
        values = values[:, :50]
    path = write(tmp_path / "bad.csv", values, header)
    with pytest.raises(ValueError, match=re.escape(sentence)):
        fg.identify([path])


TIMES = DUAL_MASS.interval(PER_PERIOD) * np.arange(SAMPLES)
EVEN = {"sampling": 1 / DUAL_MASS.interval(PER_PERIOD)}


@pytest.mark.parametrize(
    ("spoiled", "sentence"),
    [
        (
            lambda t, r: t + 0.4 * t[1] * r.uniform(-1, 1, len(t)),
            "intervals from an even clock: samples must be evenly",
        ),
        (lambda t, r: np.cumsum(t[1] * r.uniform(0.8, 1.2, len(t))), "intervals from an even clock"),
        (lambda t, r: np.cumsum(t[1] * r.integers(1, 4, len(t))), "intervals from an even clock"),
        (lambda t, r: np.concatenate([t[:100], t[99:-1]]), "line 102: time [s] repeats the time before it"),
        (lambda t, r: t + 3 * t[1] * (np.arange(len(t)) // 7), "intervals from an even clock"),
    ],
)
def test_times_that_are_not_even_are_refused(tmp_path: Path, spoiled: Any, sentence: str) -> None:
    """Taken as even, they gave a frequency that was off by a million half intervals."""
    times = spoiled(TIMES[:4000], np.random.default_rng(0))
    rows = np.column_stack([times, motion()[:, : len(times)].T])
    np.savetxt(tmp_path / "uneven.csv", rows, delimiter=",", header="time [s],x,y", comments="", fmt="%.12g")
    with pytest.raises(ValueError, match=re.escape(sentence)):
        fg.identify([tmp_path / "uneven.csv"])


@pytest.mark.parametrize(("digits", "noted"), [("%.12g", False), *((each, True) for each in ("%.5g", "%.4g", "%.5f"))])
def test_times_as_files_round_them_are_even_and_their_rounding_is_noted(
    tmp_path: Path, digits: str, noted: bool
) -> None:
    rows = np.column_stack([TIMES, motion().T])
    text = {"delimiter": ",", "header": "time [s],x,y", "comments": ""}
    np.savetxt(tmp_path / "rounded.csv", rows, fmt=[digits, "%.12g", "%.12g"], **text)
    found, exact = fg.identify([tmp_path / "rounded.csv"]), fg.identify([(tmp_path / "rounded.csv", EVEN)])
    notes = [note for note in found.notes if "time [s] is rounded to" in note]
    assert len(notes) == noted
    off = abs(found["frequency_1"].value / exact["frequency_1"].value - 1)
    stated = re.search(r"known to about (\S+) of it", notes[0]) if notes else None
    assert off < (float(stated[1]) if stated else 1e-10)


def test_the_beat_after_a_gap_is_no_drive(tmp_path: Path) -> None:
    kept = np.delete(np.arange(SAMPLES), np.arange(5000, 5400))
    rows = np.column_stack([TIMES[kept], motion()[:, kept].T])
    np.savetxt(tmp_path / "gap.csv", rows, delimiter=",", header="time [s],x,y", comments="", fmt="%.12g")
    notes = fg.identify([tmp_path / "gap.csv"]).notes
    assert any("a gap at line 5002" in note for note in notes)
    assert not any("drive is on" in note for note in notes)


@pytest.mark.parametrize(("rates", "noted"), [((None, None), True), ((0.0, None), False), ((0.0, 0.0), False)])
def test_records_without_a_rate_share_one_which_is_noted(rates: tuple[float | None, ...], noted: bool) -> None:
    records = [DUAL_MASS.record(8000, PER_PERIOD, 1e-3, seed, rate=rate) for seed, rate in enumerate(rates)]
    notes = fg.identify(records).notes
    assert ("records without a stated rate are taken at one common rate" in notes) == noted


def test_what_leaves_no_fit_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr("fracgyro.identification.entry.fit_segments", fails)
    with pytest.raises(ValueError, match=r"^record: no fit converges: the records must contain the decay"):
        fg.identify(fg.identify.Record(*motion(), interval=TIMES[1]))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"mass": -1.0}, "mass is -1.0: it must be greater than 0"),
        ({"pickoff_ratio": 0.0}, "pickoff_ratio is 0: it must be greater than 0"),
        ({"assume": {"dzz": 0.0}}, "assume has dzz: it must have one of kxx, kxy"),
        ({"assume": {"dxy": (0.0, -1.0)}}, "assume dxy has the deviation -1: it must be at least 0"),
    ],
)
def test_an_invalid_argument_is_refused_in_one_sentence(arguments: dict[str, object], sentence: str) -> None:
    record = fg.identify.Record(*motion(), interval=DUAL_MASS.interval(PER_PERIOD))
    with pytest.raises(ValueError, match=re.escape(sentence)):
        fg.identify(record, **arguments)


@pytest.mark.parametrize(
    "content", ["", "x,y\n1,2\n", "time,x\n" + "0,1\n" * 80, "a b\nc d\n", "time [s],x\n1,2\n2,1\n"]
)
def test_any_text_gives_one_sentence(tmp_path: Path, content: str) -> None:
    (tmp_path / "any.csv").write_text(content)
    ran = CliRunner().invoke(identify_command, [str(tmp_path / "any.csv")])
    assert isinstance(ran.exception, ValueError)
    assert "any.csv" in str(ran.exception)
    assert "\n" not in str(ran.exception)


# -- Tests of the model ------------------------------------------------------------------------------------------------


def test_the_whiteness_of_white_noise_is_uniform() -> None:
    generator = np.random.default_rng(0)
    found = [whiteness(generator.normal(size=400) + 1j * generator.normal(size=400)) for _ in range(400)]
    assert 0.02 < np.mean(np.array(found) < 0.05) < 0.09
    assert np.mean(found) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("bins", [20, 60, 120])
def test_the_whiteness_of_few_bins_raises_no_more_alarms_than_it_states(bins: int) -> None:
    generator = np.random.default_rng(bins)
    rows = generator.normal(size=(8000, bins)) + 1j * generator.normal(size=(8000, bins))
    found = np.array([whiteness(row) for row in rows])
    assert 0.0066 < np.mean(found < 0.01) < 0.0134  # three deviations of 0.0011
    # 20 expected; as a chi^2 that is only scaled to the variance about 29, 44 and 40.
    assert 8 < np.count_nonzero(found < 0.0025) < 34


@pytest.mark.parametrize("size", [1e-2, 3e-3])
def test_a_third_mode_is_noticed_with_its_frequency(size: float) -> None:
    values = motion()
    times = DUAL_MASS.interval(PER_PERIOD) * np.arange(SAMPLES)
    values[0] += size * np.exp(-4 * times) * np.cos(2 * np.pi * 4008 * times)
    found = fg.identify(fg.identify.Record(*values, interval=DUAL_MASS.interval(PER_PERIOD)))
    (failed,) = [each for each in found.tests if each.verdict == "fail"]
    assert "x of record: the residual is not white" in failed.words
    hertz = re.search(r"a line at ([\d.]+) Hz is left", failed.words)
    assert hertz is not None
    assert abs(float(hertz[1]) - 4008) < 5


def test_a_converter_of_twelve_bits_raises_no_alarm() -> None:
    step = 1.25 / 2**11
    values = np.round(motion(1e-5) / step) * step
    found = fg.identify(fg.identify.Record(*values, interval=DUAL_MASS.interval(PER_PERIOD)))
    assert not [each for each in found.tests if each.verdict == "fail"]
    assert any("a converter of step 0.00061" in each.words for each in found.tests)
    assert abs(found["rate"].value - RATE) < 3 * found["rate"].half


# -- Sweeps ------------------------------------------------------------------------------------------------------------

DRIVE = np.array([[1.0, 0.01], [-0.02, 0.9]])
THROUGH = np.array([[100.0, 20.0], [30.0, 200.0]])


def frequencies() -> np.ndarray:
    widths = [(3925.0, 3925 / 4673), (3978.0, 3978 / 449)]
    dense = [at + width / 2 * np.tan(np.linspace(-1.4, 1.4, 60)) for at, width in widths]
    return np.unique(np.concatenate([np.linspace(3925 - 17, 3978 + 120, 121), *dense]))


def test_a_sweep_without_noise_gives_the_device_and_its_drives() -> None:
    at = frequencies()
    response = DUAL_MASS.response(at, DRIVE, THROUGH, 0.7)
    found = fit_sweep(Response("sweep", at, response, ("x", "y"), ("x", "y"), State()))
    turn = found.unit / DUAL_MASS.omega
    scale = np.array([turn**2] * 4 + [turn] * 4 + [turn**2] * 4)
    expected = np.concatenate([DUAL_MASS.parameters, DRIVE.ravel()])
    np.testing.assert_allclose(found.fit.parameters * scale, expected, atol=1e-10)
    np.testing.assert_allclose(found.delay * DUAL_MASS.omega, 0.7, rtol=1e-9)
    assert np.abs(found.model - response).max() < 1e-10 * np.abs(response).max()
    middle = 2 * np.pi * at.mean() / DUAL_MASS.omega
    np.testing.assert_allclose(found.feedthrough, THROUGH * np.exp(-0.7j * middle), rtol=1e-8)


@pytest.mark.parametrize("seed", nightly_unless(lambda seed: seed == 0, range(3)))
def test_a_sweep_of_little_noise_is_as_white_as_one_of_much(seed: int) -> None:
    """The feedthrough is as late as the rest: with a constant one, sweeps of 1e-5 had something left."""
    at, generator = frequencies(), np.random.default_rng(seed)
    clean = DUAL_MASS.response(at, DRIVE, THROUGH, 0.7)
    random = generator.normal(size=clean.shape) + 1j * generator.normal(size=clean.shape)
    much, found = (
        fit_sweep(Response("sweep", at, clean + noise * random, ("x", "y"), ("x", "y"), State()))
        for noise in (1e-3 * np.abs(clean).max(), 1e-5 * np.abs(clean).max())
    )
    p, expected = ([each.p for each in sweep_tests(each)] for each in (found, much))
    assert p == pytest.approx(expected, rel=0.15)
    miss = (np.abs(found.feedthrough) - np.abs(THROUGH)) / found.feedthrough_deviation
    assert np.abs(miss).max() < 4.0
    assert found.feedthrough_deviation.max() < 2e-5 * np.abs(clean).max()


@pytest.mark.nightly
def test_the_errors_of_six_sweeps_follow_their_intervals() -> None:
    at = frequencies()
    clean = DUAL_MASS.response(at, DRIVE, THROUGH, 0.7)
    noise = 1e-3 * np.abs(clean).max()
    squares = 0.0
    for seed in range(6):
        generator = np.random.default_rng(seed)
        measured = clean + noise * (generator.normal(size=clean.shape) + 1j * generator.normal(size=clean.shape))
        found = fit_sweep(Response("sweep", at, measured, ("x", "y"), ("x", "y"), State()))
        turn = found.unit / DUAL_MASS.omega
        scale = np.array([turn**2] * 4 + [turn] * 4)
        error = found.fit.parameters[:8] * scale - DUAL_MASS.parameters
        covariance = found.fit.covariance[:8, :8] * np.outer(scale, scale)
        squares += float(error @ np.linalg.solve(covariance, error))
    assert 22.0 < squares < 84.0  # chi^2 with 48 degrees of freedom: 0.1 % and 99.9 %


def test_correlated_residuals_of_a_sweep_widen_its_intervals() -> None:
    """A mode of Q 3000 in noise that is a walk with a correlation of 0.9 from point to point."""
    at = np.linspace(417_300.0, 418_300.0, 301)
    w = at / 417_800.0
    clean = (1 / (1 - w**2 + 1j * w / 3000)) / 3000 + 2.0
    generator = np.random.default_rng(2)
    white = generator.normal(size=301) + 1j * generator.normal(size=301)
    walk = np.empty(301, dtype=complex)
    walk[0] = white[0]
    for i in range(1, 301):
        walk[i] = 0.9 * walk[i - 1] + white[i]
    independent, correlated = (
        fit_sweep(Response("sweep", at, (clean + 0.01 * each)[:, None, None], ("x",), ("x",), State()))
        for each in (white, walk)
    )
    assert independent.widened == 1.0
    assert 2.0 < correlated.widened < 6.0


def test_a_sweep_and_a_decay_agree_and_narrow_the_intervals(tmp_path: Path) -> None:
    at = frequencies()
    clean = DUAL_MASS.response(at, DRIVE, THROUGH, 0.7)
    generator = np.random.default_rng(1)
    size = 1e-4 * np.abs(clean).max()
    measured = clean + size * (generator.normal(size=clean.shape) + 1j * generator.normal(size=clean.shape))
    names = [f"{axis}{drive}" for axis in "xy" for drive in "xy"]
    header = "frequency [kHz]," + ",".join(f"{name}_mag [dB],{name}_phase [deg]" for name in names)
    columns = [
        part
        for each in measured.reshape(len(at), 4).T
        for part in (20 * np.log10(np.abs(each)), np.degrees(np.angle(each)))
    ]
    path = tmp_path / "sweep.csv"
    np.savetxt(path, np.column_stack([at / 1e3, *columns]), delimiter=",", header=header, comments="", fmt="%.12g")
    ring = write(tmp_path / "ring.csv", motion(), "time [ms],x [V],y [V]")
    both, decay = fg.identify([path, ring]), fg.identify([ring])
    assert isinstance(both.groups[-1], SweepFit)
    assert both["kxx"].half < decay["kxx"].half
    assert both["rate"].half < decay["rate"].half
    assert abs(both["rate"].value - RATE) < 2.5 * both["rate"].half
    assert [each.verdict for each in both.tests if each.name == "agreement"] == ["pass"]
    assert both["b1"].determined


def swept(path: Path, drives: str, seed: int, device: Device = DUAL_MASS) -> Path:
    """A file with the response of both pick-offs to these drives."""
    at, generator = frequencies(), np.random.default_rng(seed)
    clean = device.response(at, np.diag([1.0, device.ratio * 0.9]), THROUGH, 0.7)
    size = 1e-4 * np.abs(clean).max()
    measured = clean + size * (generator.normal(size=clean.shape) + 1j * generator.normal(size=clean.shape))
    names = [f"{axis}{drive}" for drive in drives for axis in "xy"]
    parts = [measured[:, "xy".index(axis), "xy".index(drive)] for axis, drive in names]
    header = "frequency [Hz]," + ",".join(f"{name}_re,{name}_im" for name in names)
    columns = [at, *(each for part in parts for each in (part.real, part.imag))]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.12g")
    return path


def test_a_sweep_for_each_drive_gives_one_device(tmp_path: Path) -> None:
    """An analyzer with two channels stores them so."""
    found = fg.identify([swept(tmp_path / f"{axis}.csv", axis, seed=4) for axis in "xy"])
    assert not [each for each in found.tests if each.verdict == "fail"]
    assert abs(found["b2"].value / found["b1"].value - 0.9) < 2e-3
    assert abs(found["beta"].value) < 3 * found["beta"].half
    assert abs(found["rate"].value - RATE) < 2.5 * found["rate"].half


def test_the_advice_on_sweeps_is_what_such_sweeps_then_give(tmp_path: Path) -> None:
    device = replace(DUAL_MASS, rate=0.0)
    one = swept(tmp_path / "one.csv", "xy", 1, device)
    found = fg.identify([one])
    promised = {each.name: each for each in found.advice}
    assert set(promised) == {"repeat", "known rate", "amplitude"}
    rate = -math.copysign(RATE, found["rate"].value)
    turned = swept(tmp_path / "turned.csv", "xy", 2, replace(device, rate=rate)), {"rate": rate}
    further = {"repeat": [one, swept(tmp_path / "two.csv", "xy", 2, device)], "known rate": [one, turned]}
    for name, records in further.items():
        then = fg.identify(records)
        for quantity, (_, half) in promised[name].halves.items():
            assert then[quantity].half == pytest.approx(half, rel=0.15), (name, quantity)


def test_the_advice_for_one_pick_off_is_the_other_one_first() -> None:
    times = np.arange(SAMPLES) / 32e3
    decay = np.exp(-3 * times) * np.cos(2 * np.pi * 4000 * times)

    def one(noise: float, seed: int) -> fg.identify.Record:
        return fg.identify.Record(decay + noise * np.random.default_rng(seed).normal(size=SAMPLES), interval=1 / 32e3)

    other, again, louder = fg.identify([one(1e-3, 0)]).advice
    assert "both pick-offs" in other.words
    for advice, records in ((again, [one(1e-3, 0), one(1e-3, 1)]), (louder, [one(5e-4, 0)])):
        then = fg.identify(records)
        assert set(advice.halves) == {"frequency_1", "quality_1", "kxx", "dxx"}
        for name, (_, promised) in advice.halves.items():
            assert then[name].half == pytest.approx(promised, rel=0.1)


def test_a_lone_magnitude_is_refused(tmp_path: Path) -> None:
    rows = np.column_stack([np.linspace(1e3, 2e3, 50), np.ones(50)])
    np.savetxt(tmp_path / "gain.csv", rows, delimiter=",", header="frequency [Hz],magnitude", comments="")
    with pytest.raises(ValueError, match="phase of xx is missing: feedthrough cannot be separated without it"):
        fg.identify([tmp_path / "gain.csv"])


@pytest.mark.parametrize(
    ("header", "change", "sentence"),
    [
        ("frequency [Hz],magnitude,phase", lambda f, m, p: (f, 20 * np.log10(m), p), "for decibels, call the column"),
        ("frequency [Hz],magnitude,phase [rad]", lambda f, m, p: (f, m, p), "rad: for degrees, call the column phase"),
        ("frequency [Hz],magnitude,phase", lambda f, m, p: (f, 0 * m + 2.0, 0 * p), "xx is constant: it must show a"),
        ("frequency [Hz],magnitude,phase", lambda f, m, p: (f + 30.0, m, p), ""),
    ],
)
def test_a_sweep_in_other_units_or_without_a_resonance_is_refused(
    tmp_path: Path, header: str, change: Any, sentence: str
) -> None:
    at = np.linspace(3900.0, 3960.0, 241)
    response = 0.5 / (1 - (at / 3925.0) ** 2 + 1j * at / 3925.0 / 500) * np.exp(2j)
    response += 1e-3 * (np.random.default_rng(1).normal(size=(2, 241)) * [[1], [1j]]).sum(axis=0)
    columns = change(at, np.abs(response) / 100, np.degrees(np.angle(response)))
    np.savetxt(tmp_path / "sweep.csv", np.column_stack(columns), delimiter=",", header=header, comments="")
    if not sentence:
        assert abs(fg.identify([tmp_path / "sweep.csv"])["frequency_1"].value - 3955.0) < 0.1
        return
    with pytest.raises(ValueError, match=re.escape(sentence)):
        fg.identify([tmp_path / "sweep.csv"])


def test_a_sweep_outside_the_resonance_is_refused(tmp_path: Path) -> None:
    at = np.linspace(3950.0, 3990.0, 241)
    response = 0.5 / (1 - (at / 3925.0) ** 2 + 1j * at / 3925.0 / 500)
    response += 1e-3 * (np.random.default_rng(1).normal(size=(2, 241)) * [[1], [1j]]).sum(axis=0)
    rows = np.column_stack([at, response.real, response.imag])
    np.savetxt(tmp_path / "outside.csv", rows, delimiter=",", header="frequency [Hz],xx_re,xx_im", comments="")
    with pytest.raises(ValueError, match="no resonance is inside the sweep: the fit has 39"):
        fg.identify([tmp_path / "outside.csv"])


def test_a_trend_is_the_weighted_line() -> None:
    at = np.array([9.0, 16.0, 25.0, 36.0])
    exact = line("f^2", "V^2", "Hz^2/V^2", at, 1.75e11 - 5.05e6 * at, [1e5, 2e5, 1e5, 3e5])
    assert exact.slope == pytest.approx(-5.05e6, rel=1e-9)
    assert exact.intercept == pytest.approx(1.75e11, rel=1e-12)
    assert exact.agrees
    scattered = line("f", "T", "Hz/K", [1, 2, 3, 4], [0.0, 1.0, 0.0, 1.0], [0.01] * 4)
    assert not scattered.agrees
    assert scattered.slope_deviation > 0.2


# -- A real resonator --------------------------------------------------------------------------------------------------

needs_real = pytest.mark.skipif(not REAL.is_dir(), reason="the records of a real resonator are not here")


@needs_real
def test_the_sweep_of_a_real_resonator_gives_the_published_numbers() -> None:
    found = fg.identify([REAL / "sweep_5V.csv"])
    assert abs(found["frequency_1"].value - 417665.1) < 5
    assert found["frequency_1"].interval[0] < 417665.1 < found["frequency_1"].interval[1]
    assert abs(found["quality_1"].value / 2991.8 - 1) < 0.08
    assert found["quality_1"].interval[0] < 2991.8 < found["quality_1"].interval[1]
    capacitance = found["feedthrough"].value / (2 * np.pi * found["frequency_1"].value * 5.0e6)
    assert capacitance == pytest.approx(0.892e-12, rel=0.03)


@needs_real
def test_the_quality_factor_of_a_real_sweep_is_that_of_the_ring_downs_of_the_device() -> None:
    quality = fg.identify([REAL / "sweep_5V.csv"])["quality_1"]
    table = np.genfromtxt(REAL / "ringdown_results.csv", delimiter=",", names=True)
    each = np.pi * table["frequency_sine_fit_hz"] * 1e-3 * table["decay_time_ms"]
    for ring_down in (3018.0, float(np.mean(each))):  # published, and of the table
        assert quality.value == pytest.approx(ring_down, rel=0.08)
        assert quality.interval[0] < ring_down < quality.interval[1]


@needs_real
def test_the_frequency_of_a_real_resonator_falls_with_its_amplitude() -> None:
    table = np.genfromtxt(REAL / "ringdown_results.csv", delimiter=",", names=True)
    amplitude, frequency = 1e-3 * table["initial_amplitude_mv"], table["frequency_sine_fit_hz"]
    errors = table["frequency_sine_fit_error_hz"]
    found = line("f", "V^2", "Hz/V^2", amplitude**2, frequency, errors)
    assert found.slope + 3 * found.slope_deviation < 0
    assert found.slope == pytest.approx(-7716, rel=0.3)  # 10 Hz at 36 mV


@needs_real
def test_the_bias_slope_of_a_real_resonator_is_the_published_one() -> None:
    table = np.genfromtxt(REAL / "bias_results.csv", delimiter=",", names=True)
    frequency = table["resonance_frequency_hz"]
    deviation = 2 * frequency * table["resonance_frequency_error_hz"]
    found = line("f^2", "V^2", "Hz^2/V^2", table["bias_v"] ** 2, frequency**2, deviation)
    assert found.slope == pytest.approx(-5.04e6, abs=0.1e6)
    assert np.sqrt(found.intercept) == pytest.approx(417996.3, abs=3)


# -- Command and scenario ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("identify")
    write(folder / "turned.csv", motion())
    still = replace(DUAL_MASS, rate=0.0).motion(SAMPLES, PER_PERIOD)
    write(folder / "still.csv", still + 1e-3 * np.random.default_rng(9).normal(size=still.shape))
    (folder / "bench.toml").write_text(
        '[[record]]\nfile = "turned.csv"\nrate = "300 deg/s"\n\n[[record]]\nfile = "still.csv"\nrate = 0\n\n'
        '[known]\nmass = "1.42 mg"\npickoff = 2.1e-6\n'
    )
    ran = CliRunner().invoke(identify_command, [str(folder / "bench.toml"), "--out", str(folder / "out")])
    assert ran.exit_code == 0, ran.output
    assert "rate_offset" in ran.output
    return folder


def test_the_report_is_accessible_and_fits(browser: Any, written: Path) -> None:
    assert faults_of_report(browser, written / "out/report.html") == []


def test_the_command_writes_scenario_numbers_and_report(written: Path) -> None:
    assert sorted(path.name for path in (written / "out").iterdir()) == ["device.toml", "identify.json", "report.html"]
    content = json.loads((written / "out/identify.json").read_text(encoding="utf-8"))
    quantities = content["conditions"][0]["quantities"]
    low, high = quantities["pickoff_ratio"]["interval"]
    # y is in mV and x in V, but both numbers are the same.
    assert low < 1.01e-3 < high
    assert len(content["conditions"][0]["fits"]) == 2
    report = (written / "out/report.html").read_text(encoding="utf-8")
    assert report.count("<figure") >= 6
    assert "pickoff_ratio" in report
    assert "a scale factor error of 4.99" in report  # half of 1 - 0.00101


def test_the_scenario_is_that_of_the_device_with_sources_as_comments(written: Path) -> None:
    text = (written / "out/device.toml").read_text(encoding="utf-8")
    scenario = fg.Scenario.load(written / "out/device.toml")
    assert scenario.plant.mass == 1.42e-6
    expected = DUAL_MASS.principal[0] * 1.42e-6 * DUAL_MASS.omega**2
    assert scenario.plant.stiffness.xx == pytest.approx(expected[0, 0], rel=1e-6)
    assert scenario.plant.stiffness.xy == pytest.approx(expected[0, 1], rel=0.02)
    assert re.search(r"# Identified from still.csv, turned.csv: kxx \+- \S+ N/m", text)
    assert text.rstrip().endswith("# End of the scenario.")
    run = fg.simulate(scenario.replace({"run.duration": 200.0}))
    assert np.isfinite(run["position"].values).all()


def test_one_pick_off_says_what_is_not_known() -> None:
    found = fg.identify(fg.identify.Record(motion()[0], interval=DUAL_MASS.interval(PER_PERIOD)), mass=1e-6)
    assert set(found) == {"frequency_1", "quality_1", "kxx", "dxx"}
    assert any("only one pick-off was recorded" in note for note in found.notes)
    assert "Not determined by these records: kxy, kyy" in found.to_toml()
    assert found.scenario().plant.stiffness.xx == pytest.approx(found["kxx"].value)


def test_the_only_pick_off_is_the_x_axis_whatever_its_name() -> None:
    found = fg.identify(fg.identify.Record(y=motion()[1], interval=DUAL_MASS.interval(PER_PERIOD)))
    assert "only the y pick-off was recorded: its axis is called x here and in the scenario" in found.notes
    assert found["frequency_1"].value == pytest.approx(3978.0, abs=1.0)
    assert found.scenario().plant.stiffness.xx == pytest.approx(found["kxx"].value)


def test_a_path_that_ends_in_toml_is_only_the_scenario(written: Path, tmp_path: Path) -> None:
    target = tmp_path / "device.toml"
    arguments = [str(written / "turned.csv"), "--out", str(target), "--pickoff-ratio", "0.00101+-0.00001", "--json"]
    ran = CliRunner().invoke(identify_command, arguments)
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.output)["known"]["pickoff_ratio"] == [0.00101, pytest.approx(0.00001 / 1.96)]
    assert fg.Scenario.load(target).plant.mass == 1.0
    assert "Relative: no mass was given" in target.read_text(encoding="utf-8")


def test_amounts_have_units() -> None:
    assert amount("rate", "300 deg/s", "rad/s") == pytest.approx(RATE)
    assert amount("mass", "1.42e-6", "kg") == 1.42e-6
    with pytest.raises(ValueError, match=r"rate is '3 kg'"):
        amount("rate", "3 kg", "rad/s")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "has no [[record]]"),
        ("[[record]]\nrate = 0\n", "record 1: file is None"),
        ('[[record]]\nfile = "a.csv"\nrat = 0\n', "record 1: rat is not a setting; did you mean"),
        ('[[record]]\nfile = "a.csv"\nkind = "jump"\n', "kind is 'jump': it must be decay, forced or sweep"),
        ('[[record]]\nfile = "a.csv"\n[known]\nmas = 1\n', "mas of [known] is not a number of the device"),
        ("[other]\na = 1\n", "other is not a table of a bench"),
    ],
)
def test_a_bench_file_is_checked(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "bench.toml").write_text(text)
    with pytest.raises(ValueError, match=re.escape(sentence)):
        read_bench(tmp_path / "bench.toml")
