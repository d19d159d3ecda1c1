"""Forced records whose force is delayed by whole samples and by a fraction, with feedthrough of the same delay."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DUAL_MASS
from fracgyro.identification.first_stage import Fitted
from fracgyro.identification.found import Found
from nightly import nightly_unless
from scipy.linalg import expm

SAMPLES, PER_PERIOD = 8192, 9.0
DRIVE = np.array([[1.0, 0.0], [0.0, DUAL_MASS.ratio]]) @ (1e-2 * np.array([[1.0, 0.0], [0.0, 0.9]]))
THROUGH = np.array([[0.02, 0.005], [0.003, 0.03]])


def forced(delay: float, seed: int, noise: float = 1e-3, drives: str = "xy") -> fg.identify.Record:
    """A record of a held random force, sample by sample: in each interval the delayed force changes once."""
    whole, fraction = math.floor(delay), delay % 1
    stiffness, damping = DUAL_MASS.seen
    matrix = np.zeros((6, 6))
    matrix[:2, 2:4], matrix[2:4, :2], matrix[2:4, 2:4], matrix[2:4, 4:] = np.eye(2), -stiffness, -damping, DRIVE
    size = 2 * np.pi / PER_PERIOD
    first, second = expm(size * fraction * matrix)[:4], expm(size * (1 - fraction) * matrix)[:4]
    generator = np.random.default_rng(seed)
    force = generator.normal(size=(2, SAMPLES)) * [[float(axis in drives)] for axis in "xy"]
    state, motion = np.zeros(4), np.empty((2, SAMPLES))
    for i in range(SAMPLES):
        late = force[:, min(i - whole, SAMPLES - 1)] if i >= whole else np.zeros(2)
        before = force[:, i - whole - 1] if i > whole else np.zeros(2)
        motion[:, i] = state[:2] + THROUGH @ (before if fraction else late)
        state = first @ np.concatenate([state, before])
        state = second @ np.concatenate([state, late])
    motion += noise * np.abs(motion).max() * generator.normal(size=motion.shape)
    return fg.identify.Record(*motion, interval=DUAL_MASS.interval(PER_PERIOD), force=force)


@cache
def identified(delay: float) -> Found:
    return fg.identify(forced(delay, seed=abs(round(10 * delay))))


@pytest.mark.parametrize("delay", nightly_unless(lambda delay: delay in (2.4, -1.0), [0.0, 3.0, 2.4, 0.7, -1.0]))
def test_delay_and_device_are_found_within_their_intervals(delay: float) -> None:
    found = identified(delay)
    (fit,) = found.groups
    assert isinstance(fit, Fitted)
    assert fit.delay is not None
    total, deviation = fit.delay.samples + fit.delay.fraction, fit.delay.deviation
    assert 0 < deviation < 0.02
    if delay % 1:
        assert abs(total - delay) < 4 * deviation
    else:
        assert (fit.delay.samples, fit.delay.fraction) == (delay, 0.0)
    assert found["delay"].value == pytest.approx(total * DUAL_MASS.interval(PER_PERIOD))
    turn = fit.unit / DUAL_MASS.omega
    scale = np.array([turn**2] * 4 + [turn] * 4 + [turn**2] * 4)
    error = fit.fit.parameters * scale - np.concatenate([DUAL_MASS.parameters, DRIVE.ravel()])
    squares = float(error @ np.linalg.solve(fit.fit.covariance * np.outer(scale, scale), error))
    assert squares < 33.0  # chi^2 with 12 degrees of freedom: 99.9 %
    assert not [each for each in found.tests if each.verdict == "fail"]


def test_one_drive_has_its_own_gain_and_the_angle_to_its_own_axis(tmp_path: Path) -> None:
    """A gain of the y drive that is negative, because its wires are exchanged, is not a turn."""
    record = forced(0.0, seed=5, drives="y")
    columns = [record.interval * np.arange(SAMPLES), record.x, record.y, *np.diag([1.0, -1.0]) @ record.force]
    header = "time [s],x [V],y [V],force_x [V],force_y [V]"
    np.savetxt(tmp_path / "y.csv", np.stack(columns, 1), delimiter=",", header=header, comments="", fmt="%.15g")
    found = fg.identify([tmp_path / "y.csv"])
    assert "y.csv: force_x is constant, and not used" in found.notes
    assert "b1" not in found
    assert abs(found["b2"].value / DUAL_MASS.omega**2 + DRIVE[1, 1] / DUAL_MASS.ratio) < 1.5 * found["b2"].half
    assert abs(found["beta"].value) < 1.5 * found["beta"].half < 3.0
    assert abs(found.scenario().device.force_misalignment) < 0.05


@pytest.mark.nightly
def test_a_record_without_noise_gives_the_fraction_of_the_interval() -> None:
    found = fg.identify(forced(1.6, seed=1, noise=1e-7))
    (fit,) = found.groups
    assert isinstance(fit, Fitted)
    assert fit.delay is not None
    assert fit.delay.samples == 1
    assert fit.delay.fraction == pytest.approx(0.6, abs=2e-3)


def test_the_scenario_has_the_delay_in_whole_steps_which_the_controller_knows() -> None:
    scenario = fg.Scenario.from_toml(identified(3.0).to_toml())
    assert scenario.device.delay == scenario.datasheet.delay == 8
    assert 8 * scenario.run.step == pytest.approx(3 * 2 * np.pi / PER_PERIOD, rel=1e-3)


def test_a_delay_below_half_a_step_is_no_step_and_is_written_above_the_field() -> None:
    text = identified(0.0).to_toml()
    scenario = fg.Scenario.from_toml(text)
    assert (scenario.device.delay, scenario.run.step) == (0, fg.Scenario.shipped("dual_mass").run.step)
    assert re.search(r"# Identified from record: delay 0 s, \+- [\d.e-]+ s; 0 steps of this run\.\ndelay = 0", text)


def test_a_delay_that_is_too_long_for_the_controller_is_not_set() -> None:
    record = forced(7.0, seed=70)
    text = fg.identify(record).to_toml()
    assert fg.Scenario.from_toml(text).device.delay == 0
    assert "it is too long to be set" in text
