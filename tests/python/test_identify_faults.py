"""Faults of records that are noticed and named: outliers, a third mode, a drive that is still on."""

from __future__ import annotations

import re
from dataclasses import replace

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DISC, DUAL_MASS, RATE
from fracgyro.identification.outliers import outliers

SAMPLES, PER_PERIOD = 12_000, 8.0
INTERVAL = DUAL_MASS.interval(PER_PERIOD)


@pytest.mark.parametrize("seed", range(4))
def test_a_single_outlier_is_interpolated_and_counted(seed: int) -> None:
    record = DUAL_MASS.record(SAMPLES, PER_PERIOD, seed=seed)
    x = record.x.copy()
    x[5000] += 0.3
    assert outliers(x).tolist() == [5000]
    found = fg.identify(replace(record, x=x))
    (note,) = [each for each in found.notes if "far off the motion" in each]
    assert "1 sample is far off the motion of x, the first at 0.159" in note
    clean = fg.identify(record)
    for name in ("frequency_1", "quality_2", "rate"):
        assert abs(found[name].value - clean[name].value) < 0.2 * clean[name].half


def test_good_records_have_no_outliers() -> None:
    for seed in range(8):
        for row in DUAL_MASS.motion(SAMPLES, PER_PERIOD):
            noise = np.random.default_rng(seed).normal(size=SAMPLES)
            assert len(outliers(row + 1e-3 * noise)) == 0
            assert len(outliers(np.round((row + 1e-4 * noise) * 2048) / 2048)) == 0
    assert len(outliers(DUAL_MASS.motion(SAMPLES, PER_PERIOD)[0])) == 0


def words(added: np.ndarray, seed: int) -> str:
    record = DUAL_MASS.record(SAMPLES, PER_PERIOD, seed=seed)
    found = fg.identify(replace(record, x=record.x + added))
    failed = [each.words for each in found.tests if each.verdict == "fail"]
    assert failed
    assert abs(found["rate"].value - RATE) < 1.0
    return failed[0]


@pytest.mark.parametrize("seed", range(4))
def test_a_third_mode_is_named_with_its_frequency_and_quality_factor(seed: int) -> None:
    times = INTERVAL * np.arange(SAMPLES)
    quality = 1200.0
    text = words(1e-2 * np.exp(-np.pi * 4030 / quality * times) * np.cos(2 * np.pi * 4030 * times), seed)
    matched = re.search(r"a line at ([\d.]+) Hz .*: a further mode with a quality factor near ([\d.e+]+);", text)
    assert matched is not None, text
    assert abs(float(matched[1]) - 4030) < 2
    assert quality / 2 < float(matched[2]) < 2 * quality


def failed(record: fg.identify.Record) -> dict[str, str]:
    """The words of the failed tests, by name."""
    return {each.name: each.words for each in fg.identify(record).tests if each.verdict == "fail"}


def test_an_amplitude_that_a_loop_holds_is_named() -> None:
    record = DUAL_MASS.record(SAMPLES, PER_PERIOD)
    times = INTERVAL * np.arange(SAMPLES)
    noise = 1e-3 * np.random.default_rng(1).normal(size=SAMPLES)
    held = failed(replace(record, x=np.cos(2 * np.pi * 3925 * times) + noise))["decay"]
    assert re.search(r"amplitude at 392[45][.\d]* Hz does not fall in 0\.38.* is a loop still closed", held), held
    assert "decay" not in failed(record)
    assert "decay" not in failed(replace(DISC, quality=(3e6, 3e6)).record(20_000))


def test_a_drive_at_the_mode_itself_is_named() -> None:
    record = DUAL_MASS.record(2 * SAMPLES, PER_PERIOD)
    line = 0.05 * np.cos(2 * np.pi * 3925 * INTERVAL * np.arange(2 * SAMPLES) + 1)
    assert "not white" in failed(replace(record, x=record.x + line))["whiteness"]


def test_a_decay_that_hardly_falls_says_how_long_to_record() -> None:
    device = replace(DISC, quality=(2e5, 2e5))
    found = fg.identify(device.record(4000, 12.6, 2e-2))
    words = [each.words for each in found.tests if each.name == "decay"]
    assert words
    length = 4000 * device.interval(12.6)
    assert all("so its damping is known to" in each for each in words)
    longer = max(float(each.split("record at least ")[1].split(" s")[0]) for each in words)
    assert length < longer < 20 * length
    enough = fg.identify(device.record(int(4000 * longer / length), 12.6, 2e-2))
    for name in ("quality_1", "quality_2"):
        assert enough[name].half < 0.16 * enough[name].value


def test_the_steps_of_a_converter_are_named_with_its_bits() -> None:
    record = DUAL_MASS.record(SAMPLES, PER_PERIOD, noise=1e-4)
    step = 2.2 / 2**12
    found = fg.identify(replace(record, x=np.round(record.x / step) * step))
    (note,) = [each for each in found.notes if "as of a converter" in each]
    assert re.search(r"x has steps of 0\.000537, as of a converter with 12 bits in use", note), note


@pytest.mark.parametrize("seed", range(4))
def test_a_line_that_does_not_decay_is_named_as_a_drive(seed: int) -> None:
    text = words(1e-2 * np.cos(2 * np.pi * 4031 * INTERVAL * np.arange(SAMPLES)), seed)
    assert re.search(r"a line at 403[01][.\d]* Hz does not decay, .* is the drive still on\?", text), text
