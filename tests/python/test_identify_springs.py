"""Cubic springs: the round trip with the simulator's own, the backbone of one mode, and forced records."""

from __future__ import annotations

import math
from functools import cache

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DUAL_MASS
from fracgyro.identification.envelope import Grid, motions, positive
from fracgyro.identification.first_stage import Fitted
from fracgyro.identification.model import Shape
from nightly import nightly_unless

TURN, RATIO = 0.02, 1.01
EVERY, SAMPLES = 12, 12_000
NOISE = 1e-3  # over the amplitude
DEVICE = fg.Scenario.shipped("dual_mass")
LENGTH = DEVICE.plant.reference_length
SPRING = DEVICE.plant.stiffness.xx / LENGTH**2  # N/m^3


@cache
def recorded(x: float, y: float) -> tuple[np.ndarray, float]:
    """The free decay that `fg.Plant` gives, in units of its amplitude, and the interval; springs over `SPRING`."""
    changes = {
        "device.cubic_stiffness": (x * SPRING, y * SPRING),
        "device.pickoff_gain_error": (0.0, RATIO - 1),
        "device.pickoff_misalignment": -TURN,
        "disturbance.kind": "none",
        "run.initial_position": (0.7, 0.1),
        "run.initial_velocity": (0.1, -0.7),
        "run.units": "SI",
    }
    device = DEVICE.replace({**changes, "device.position_noise_density": 0.0})
    plant, record = fg.Plant(device), np.empty((2, SAMPLES))
    for i in range(SAMPLES):
        record[:, i] = plant.motion.position
        for _ in range(EVERY):
            plant.step((0.0, 0.0))
    return record / LENGTH, EVERY * device.run.step / device.plant.reference_frequency


def identified(x: float, y: float, seed: int) -> fg.identify.Found:
    record, interval = recorded(x, y)
    noisy = record + NOISE * np.random.default_rng(seed).normal(size=record.shape)
    return fg.identify(fg.identify.Record(*noisy, interval=interval), mass=DEVICE.plant.mass, pickoff=LENGTH)


# Shifts of the frequency by a tenth of the linewidth, by one, and by eight.
@pytest.mark.parametrize(("x", "y"), nightly_unless(lambda x, y: y != 0, [(-1e-4, 0.0), (1e-3, -4e-3), (1e-2, 0.0)]))
def test_the_springs_of_the_simulated_device_are_found(x: float, y: float) -> None:
    found = identified(x, y, 1)
    assert [each.verdict for each in found.tests] == ["pass"] * len(found.tests)
    for axis, spring in (("x", x), ("y", y)):
        if spring == 0.0:
            assert f"cubic_{axis}" not in found
            continue
        quantity = found[f"cubic_{axis}"]
        assert abs(quantity.value - spring * SPRING) < 1.6 * quantity.half  # three standard deviations
        assert quantity.half < 0.05 * abs(spring) * SPRING
        # 3/(16 pi) k/(m w) A^2 is the shift of the frequency.
        backbone = found[f"backbone_{axis}"]
        own = found["frequency_1" if axis == "x" else "frequency_2"].value
        gain = 1.0 if axis == "x" else RATIO
        shift = 3 / 8 * spring * DEVICE.plant.reference_frequency**2 / (2 * math.pi) ** 2 / own / gain**2
        assert backbone.value == pytest.approx(shift, rel=0.05)
        assert backbone.unit == "Hz/unit^2"
    clean = identified(0.0, 0.0, 1)
    for name in ("frequency_1", "frequency_2", "quality_1", "rate", "pickoff_ratio"):
        near = abs(found[name].value - clean[name].value)
        assert near < 1.6 * math.hypot(found[name].half, clean[name].half), name
    scenario = fg.Scenario.from_toml(found.to_toml())
    for mine, true in zip(scenario.device.cubic_stiffness, (x * SPRING, y * SPRING), strict=True):
        assert mine == pytest.approx(true, rel=0.05)


@pytest.mark.nightly
def test_the_errors_of_springs_follow_their_intervals() -> None:
    errors = []
    for seed in range(4):
        found = identified(1e-3, -4e-3, seed)
        for name, spring in (("cubic_x", 1e-3), ("cubic_y", -4e-3)):
            errors.append(1.96 * (found[name].value - spring * SPRING) / found[name].half)
    squares = float(np.sum(np.square(errors)))
    assert 0.8 < squares < 26.2  # chi^2 with 8 degrees of freedom: 0.1 % and 99.9 %


def test_a_linear_record_has_no_springs() -> None:
    for seed in range(4):
        found = fg.identify(DUAL_MASS.record(12_000, 8.0, seed=seed))
        assert not [name for name in found if name.startswith(("cubic", "backbone"))]
        (test,) = [each for each in found.tests if each.name == "springs"]
        assert test.verdict == "pass"
        assert "the frequency does not depend on the amplitude" in test.words
        (fit,) = found.groups
        assert isinstance(fit, Fitted)
        assert fit.cubic is not None
        assert not fit.cubic.fitted


def softening(seed: int, amplitude: float, slope: float = -7716.0) -> fg.identify.Record:
    """A decay of one mode in closed form, V: 417 kHz, Q 3018, `slope` Hz/V^2, 0.2 mV of noise, 8.2 ms at 2 MHz."""
    frequency, decay = 417_849.0, math.pi * 417_849.0 / 3018
    time = np.arange(16_400) / 2e6
    phase = frequency * time + slope * amplitude**2 * (1 - np.exp(-2 * decay * time)) / (2 * decay)
    motion = amplitude * np.exp(-decay * time) * np.cos(2 * np.pi * phase + 0.3)
    return fg.identify.Record(motion + 2e-4 * np.random.default_rng(seed).normal(size=time.size), interval=5e-7)


# At 100 mV a linear fit is 20 Hz too low.
@pytest.mark.parametrize("amplitude", [0.036, 0.1])
def test_the_backbone_of_one_mode_is_that_of_its_closed_form(amplitude: float) -> None:
    found = [fg.identify(softening(seed, amplitude)) for seed in range(4)]
    for name, true in (("backbone_x", -7716.0), ("frequency_1", 417_849.0), ("quality_1", 3018.0)):
        errors = [1.96 * (each[name].value - true) / each[name].half for each in found]
        assert float(np.sum(np.square(errors))) < 18.5, name  # chi^2 with 4 degrees of freedom: 99.9 %


def test_the_motion_of_an_undamped_spring_has_the_frequency_of_its_series() -> None:
    """w = 1 + 3/8 e - 15/256 e^2 with e = k a^2, from the envelope with one sample in a step of many periods."""
    strength, samples = 0.02, 40_000
    shape, parameters = Shape(1), np.array([1.0, 0.0])
    (motion,) = motions(
        shape, np.eye(1)[None], parameters[None], np.array([[strength]]), np.array([[1.0, 0.0]]),
        positive(shape, parameters), Grid(samples, 0.5, 40),
    )  # fmt: skip
    spectrum = np.fft.rfft(motion[0] * np.hanning(samples))
    signal = np.fft.irfft(np.where(np.arange(len(spectrum)) > 0, spectrum, 0))
    crossings = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    at = crossings - signal[crossings] / (signal[crossings + 1] - signal[crossings])
    middle = slice(len(at) // 10, -len(at) // 10)
    omega = 2 * np.pi / np.polyfit(np.arange(len(at))[middle], 0.5 * at[middle], 1)[0]
    size = strength * float(np.abs(motion).max()) ** 2
    # The second term is 3e-3 of the first.
    assert omega - 1 == pytest.approx(3 / 8 * size - 15 / 256 * size**2, rel=5e-4)


def test_a_forced_record_with_springs_is_named() -> None:
    generator = np.random.default_rng(3)
    force = 0.02 * generator.normal(size=(2, 4000))
    device = DEVICE.replace({"device.cubic_stiffness": (1e-3 * SPRING, 0.0), "device.position_noise_density": 0.0})
    plant, record = fg.Plant(device), np.empty((2, 4000))
    for i in range(4000):
        record[:, i] = plant.motion.position
        for _ in range(EVERY):
            plant.step(tuple(force[:, i]))
    noisy = record + NOISE * generator.normal(size=record.shape)
    interval = EVERY * device.run.step / device.plant.reference_frequency
    found = fg.identify(fg.identify.Record(*noisy, interval=interval, force=force))
    (test,) = [each for each in found.tests if each.name == "springs"]
    assert test.verdict == "fail"
    assert "shifts the frequency along x by" in test.words
    assert "repeat with a smaller amplitude" in test.words
