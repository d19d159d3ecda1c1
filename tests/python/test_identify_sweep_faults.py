"""Sweeps that a cubic spring bends: a leaning peak, a jump, up and down that differ; and good sweeps without alarm."""

from __future__ import annotations

from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.identification.records import Response, State
from fracgyro.identification.sweep_faults import runs

FREQUENCY, QUALITY, THROUGH = 10_000.0, 1000.0, 0.2 + 0.1j
WIDTH = FREQUENCY / QUALITY


def steady(at: np.ndarray, spring: float) -> np.ndarray:
    """(1 - w^2 + j w/Q + 3/4 k |x|^2) x = 1/Q at each frequency, continued from the one before: the fold is a jump."""
    found, size = np.empty(len(at), dtype=complex), 0.0
    for i, w in enumerate(at / FREQUENCY):
        # |x|^2 as the root of a cubic that is the nearest to the one before.
        open_ = 1 - w**2
        roots = np.roots([(0.75 * spring) ** 2, 1.5 * spring * open_, open_**2 + (w / QUALITY) ** 2, -(QUALITY**-2)])
        real = roots[np.abs(roots.imag) < 1e-7 * np.abs(roots).max()].real if spring else roots.real
        size = float(real[np.argmin(np.abs(real - size))])
        found[i] = 1 / QUALITY / (open_ + 1j * w / QUALITY + 0.75 * spring * size)
    return found


def swept(shift: float, seed: int, order: str, noise: float = 1e-3, late: float = 0.0) -> np.ndarray:
    """Rows of a sweep file; `shift` of the peak and `late`, by a fast sweep, in linewidths."""
    spring = shift * 8 / 3 / QUALITY
    generator = np.random.default_rng(seed)
    rows = []
    for direction in order.split():
        at = np.linspace(FREQUENCY - 12 * WIDTH, FREQUENCY + 12 * WIDTH, 241)
        at = at if direction == "up" else at[::-1]
        moved = at - late * WIDTH * (1 if direction == "up" else -1)
        value = steady(moved, spring) + THROUGH
        value = value + noise * (generator.normal(size=len(at)) + 1j * generator.normal(size=len(at)))
        rows.append(np.column_stack([at, value.real, value.imag]))
    return np.concatenate(rows)


def identified(rows: np.ndarray, path: Path) -> fg.identify.Found:
    np.savetxt(path, rows, delimiter=",", header="frequency [Hz],xx_re,xx_im", comments="", fmt="%.12g")
    return fg.identify([path])


def verdicts(found: fg.identify.Found) -> dict[str, str]:
    """The words of each failed test."""
    return {each.name: each.words for each in found.tests if each.verdict == "fail"}


@pytest.mark.parametrize("order", ["up", "up down"])
def test_a_good_sweep_raises_no_alarm(order: str, tmp_path: Path) -> None:
    for seed in range(4):
        found = identified(swept(0.0, seed, order), tmp_path / "sweep.csv")
        assert not verdicts(found)
        assert abs(found["frequency_1"].value - FREQUENCY) < 2 * found["frequency_1"].half
        assert len(found.groups) == len(order.split())


@pytest.mark.parametrize("shift", [0.03, -0.03])
def test_a_peak_that_leans_is_named_with_its_direction_and_size(shift: float, tmp_path: Path) -> None:
    words = verdicts(identified(swept(shift, 1, "up"), tmp_path / "sweep.csv"))["springs"]
    assert f"leans to {'higher' if shift > 0 else 'lower'} frequencies" in words
    assert float(words.split("by about ")[1].split(" Hz")[0]) == pytest.approx(abs(shift) * WIDTH, rel=0.2)


def test_the_jump_of_a_fold_is_named_with_its_place(tmp_path: Path) -> None:
    words = verdicts(identified(swept(4.0, 1, "up"), tmp_path / "sweep.csv"))["jump"]
    begin, end = (float(each) for each in words.split("between ")[1].split(" Hz")[0].split(" and "))
    assert FREQUENCY + 2 * WIDTH < begin < end < FREQUENCY + 4.5 * WIDTH


def test_hysteresis_is_named_by_the_difference_of_up_and_down(tmp_path: Path) -> None:
    words = verdicts(identified(swept(4.0, 1, "up down"), tmp_path / "sweep.csv"))
    assert "jump" in words
    assert "up and down differ by" in words["directions"]


def test_a_fast_sweep_shifts_up_and_down_apart_and_their_mean_is_right(tmp_path: Path) -> None:
    found = identified(swept(0.0, 2, "up down", late=0.1), tmp_path / "sweep.csv")
    words = verdicts(found)["directions"]
    assert float(words.split("Hz, ")[1].split(" linewidths")[0]) == pytest.approx(0.2, rel=0.05)
    assert "after the sweep" in words
    assert abs(found["frequency_1"].value - FREQUENCY) < 0.01 * WIDTH


def test_a_sweep_up_and_down_is_two_and_others_are_as_they_were() -> None:
    def response(frequency: list[float]) -> Response:
        at = np.array(frequency)
        return Response("s", at, np.ones((len(at), 1, 1), dtype=complex), ("x",), ("x",), State())

    up = [float(each) for each in range(20)]
    both = runs(response(up + up[::-1][1:]))
    assert [each.name for each in both] == ["s (up)", "s (down)"]
    assert both[0].frequency.tolist() == up
    assert both[1].frequency.tolist() == up[::-1]
    for whole in (up, up[::-1], up + up[::-1][1:5], [1.0, 5.0, 2.0, 4.0] * 5):
        assert [each.name for each in runs(response(whole))] == ["s"]
