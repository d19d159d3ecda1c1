"""Events in records: injected faults are reported with time and size, clean records have none."""

from __future__ import annotations

from collections.abc import Callable

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.inspection import _spread
from nightly import nightly_unless
from numpy.typing import NDArray
from scipy.signal import butter, lfilter
from test_allan import flicker, walk, white

Array = NDArray[np.float64]
DEG = np.pi / 180
SAMPLES, INTERVAL = 64_000, 0.01
NOISE = 0.1 * DEG  # one sample


def noise(seed: int = 0) -> Array:
    return NOISE * np.random.default_rng(seed).normal(size=SAMPLES)


def changed(part: slice | Array, change: Callable[[Array], Array | float]) -> Array:
    record = noise()
    record[part] = change(record[part])
    return record


LOST = np.random.default_rng(1).random(SAMPLES) < 0.02
PART = slice(20_000, 23_000)
FAULTS: dict[str, tuple[Array, str, float, float]] = {
    "one bad transfer": (changed(slice(30_000, 30_001), lambda x: x + 100 * DEG), "spike", 300.0, 100.0),
    "a knock": (
        changed(slice(30_000, 30_100), lambda x: x + 20 * DEG * np.exp(-np.arange(100) / 20)),
        "spike",
        300.0,
        20.0,
    ),
    "stuck": (changed(PART, lambda x: x[0]), "stuck", 200.0, float(noise()[20_000]) / DEG),
    "lost as zero": (np.where(LOST, 0.0, noise() + 0.3 * DEG), "constant", 0.0, 0.0),
    "lost as -999": (np.where(LOST, -999 * DEG, noise()), "spike", 0.0, -999.0),
    "saturated": (np.minimum(noise(), 1.5 * NOISE), "saturated", 0.0, 0.15),
    "noisier": (changed(PART, lambda x: 2 * x), "noise", 200.0, 0.28),
    "moved": (changed(PART, lambda x: x + DEG * np.sin(np.arange(3000) / 300)), "motion", 200.0, 1.3),
    "jumped": (changed(slice(32_000, None), lambda x: x + 0.05 * DEG), "jump", 320.0, 0.05),
    "coarse": (np.round(noise() / DEG * 2) * DEG / 2, "steps", 0.0, 0.5),
    "lost as the one before": (
        noise()[np.maximum.accumulate(np.where(LOST, 0, np.arange(SAMPLES)))],
        "repeated",
        0.0,
        0.02,
    ),
}


@pytest.mark.parametrize("fault", nightly_unless(lambda fault: fault != "moved", FAULTS))
def test_a_fault_is_named_with_its_time_and_size(fault: str) -> None:
    record, kind, time, size = FAULTS[fault]
    found = {event.kind: event for event in fg.rate.inspect(record, INTERVAL)}
    assert kind in found
    event = found[kind]
    assert event.spoils
    assert event.time == pytest.approx(time, abs=12.0)
    measured = event.size if kind == "repeated" else event.size / DEG
    assert measured == pytest.approx(size, rel=0.4, abs=0.02)
    assert event.time <= event.end <= SAMPLES * INTERVAL
    assert event.sentence.isprintable()
    walk = fg.rate.allan(record, INTERVAL).angle_random_walk
    assert walk is None or walk.limit or (walk.low, walk.high) == (0.0, np.inf)


def test_a_fault_is_named_once() -> None:
    record = FAULTS["one bad transfer"][0]
    assert [event.sentence for event in fg.rate.inspect(record, INTERVAL)] == ["at 300 s the rate is 99.9 deg/s off"]


def test_what_is_left_after_the_fault_is_cut_out_is_clean() -> None:
    record = FAULTS["moved"][0]
    assert fg.rate.inspect(record[:20_000], INTERVAL) == fg.rate.inspect(record[23_000:], INTERVAL) == ()


def clean(seed: int) -> dict[str, Array]:
    plain = white(1.0, 20_000, 1.0, seed)
    return {
        "white": plain,
        "flicker": 0.1 * plain + flicker(1.0, 20_000, 1.0, seed),
        "walk": 0.3 * plain + walk(0.05, 20_000, 1.0, seed),
        "a pure walk": walk(1.0, 20_000, 1.0, seed),
        "behind a filter": lfilter(*butter(2, 0.05), plain),
        "behind a slow filter, rounded": np.round(lfilter(*butter(2, 0.02), 10 * plain) / 0.5) * 0.5,
        "rounded to half the noise": np.round(2 * plain) / 2,
        "read five times too often": np.repeat(plain[:4000], 5),
        "read a little too often": plain[np.floor(0.95 * np.arange(20_000)).astype(int)],
        "interpolated": np.interp(np.arange(20_000) / 3.3, np.arange(20_000), plain),
        "of a rounded angle": np.diff(np.round(np.cumsum(plain) / 2) * 2),
    }


@pytest.mark.parametrize("seed", range(5))
def test_clean_records_are_not_blamed(seed: int) -> None:
    for kind, record in clean(seed).items():
        assert not [event.sentence for event in fg.rate.inspect(record, 0.01) if event.spoils], kind


def test_noise_of_about_a_step_is_a_note_and_not_a_fault() -> None:
    (event,) = fg.rate.inspect(np.round(noise() / (1.2 * NOISE)) * 1.2 * NOISE, INTERVAL)
    assert (event.kind, event.spoils) == ("steps", False)
    assert event.sentence == "the sensor's quantization step of 0.12 deg/s is as large as its noise and increases it"


def test_short_or_constant_records_show_nothing_and_others_are_refused() -> None:
    assert fg.rate.inspect(np.ones(5000), 1.0) == fg.rate.inspect(noise()[:50], 1.0) == ()
    with pytest.raises(ValueError, match=r"^values has 2 dimensions: it must be \(samples\)$"):
        fg.rate.inspect(np.ones((2, 500)), 1.0)
    with pytest.raises(ValueError, match=r"^values is nan at sample 3: all must be finite$"):
        fg.rate.inspect(np.array([1.0, 2.0, 3.0, np.nan]), 1.0)
    with pytest.raises(ValueError, match="interval is 0: it must be greater than 0"):
        fg.rate.inspect(noise(), 0)


def sinusoid(amplitude: float | Array, frequency: float = 1.234) -> Array:
    time = INTERVAL * np.arange(SAMPLES)
    return np.asarray(amplitude * DEG * np.sin(2 * np.pi * frequency * time + 0.3))


@pytest.mark.parametrize("amplitude", [0.3, 1.0, 10.0])
def test_a_steady_sinusoid_far_above_the_noise_leaves_the_angle_random_walk(amplitude: float) -> None:
    clean = fg.rate.allan(noise(), INTERVAL).angle_random_walk
    found = fg.rate.allan(noise() + sinusoid(amplitude), INTERVAL)
    assert found.angle_random_walk.value == pytest.approx(clean.value, rel=0.01)
    assert found.quantization.limit
    assert [line.frequency for line in found.lines] == pytest.approx([1.234], rel=1e-3)
    assert found.lines[0].amplitude == pytest.approx(amplitude * DEG, rel=0.01)
    assert not found.events


@pytest.mark.parametrize("phase", nightly_unless(lambda phase: phase == 3.0, [3.0, 30.0]))
def test_a_vibration_that_is_not_steady_and_covers_the_noise_is_named(phase: float) -> None:
    time = INTERVAL * np.arange(SAMPLES)
    wandering = phase * np.sin(2 * np.pi * time / 300) + 0.2 * np.cumsum(
        0.1 * np.random.default_rng(1).normal(size=SAMPLES)
    )
    found = fg.rate.allan(noise() + DEG * np.sin(2 * np.pi * 1.234 * time + wandering), INTERVAL)
    spoiling = [event for event in found.events if event.kind == "vibration"]
    assert [event.spoils for event in spoiling] == [True]
    assert (spoiling[0].time, spoiling[0].end) == (0.0, pytest.approx(SAMPLES * INTERVAL))
    assert spoiling[0].size == pytest.approx(DEG, rel=0.5)
    assert "an unsteady vibration of about" in spoiling[0].sentence
    assert found.angle_random_walk is None or not np.isfinite(found.angle_random_walk.high)


@pytest.mark.parametrize("factor", [1.5, 2.0, 5.0])
def test_noise_that_is_larger_in_half_of_the_record_is_named(factor: float) -> None:
    record = noise()
    record[SAMPLES // 2 :] *= factor
    found = fg.rate.inspect(record, INTERVAL)
    assert "noise" in {event.kind for event in found}
    first = next(event for event in found if event.kind == "noise")
    assert first.time == pytest.approx(SAMPLES // 2 * INTERVAL, rel=0.05)
    alternating = noise() * np.where(np.arange(SAMPLES) // (SAMPLES // 8) % 2, 1.0, factor)
    assert "noise" in {event.kind for event in fg.rate.inspect(alternating, INTERVAL)}


@pytest.mark.parametrize("order", [1, 2, 4])
def test_no_sinusoids_are_seen_behind_a_filter(order: int) -> None:
    filtered = lfilter(*butter(order, 0.1), noise())
    found = fg.rate.allan(filtered, INTERVAL)
    assert not found.lines
    assert found.angle_random_walk.value == pytest.approx(NOISE * np.sqrt(INTERVAL), rel=0.03)


def test_numbers_beyond_all_rates_are_no_overflow() -> None:
    with pytest.raises(ValueError, match=r"values is 1e\+300 at sample 7: all must be below 1e\+100"):
        fg.rate.inspect(np.where(np.arange(1000) == 7, 1e300, noise()[:1000]), INTERVAL)


@pytest.mark.parametrize("count", [2, 7, 100, 20_001])
def test_the_spread_of_a_block_is_about_its_least_squares_line(count: int) -> None:
    block = np.random.default_rng(count).normal(size=count) + np.linspace(-3.0, 5.0, count)
    at = np.arange(count)
    expected = np.mean((block - np.polyval(np.polyfit(at, block, 1), at)) ** 2)
    assert _spread(block) == pytest.approx(expected, rel=1e-9, abs=1e-15)
