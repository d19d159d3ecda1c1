"""Faults of sweeps: a jump of the response, up and down sweeps that differ, a peak that leans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .cubic import SEEN
from .diagnostics import Test
from .model import Complex, Shape, poles
from .records import MIN_FREQUENCIES, Response
from .sweep import SweepFit

Array = NDArray[np.float64]

JUMP = 5.0  # times the steps next to it: a pole between two points of a grid has 3
CLEAR = 12.0  # times the noise


def runs(response: Response) -> list[Response]:
    """A sweep up and down as two, each in the order in which it was measured; another sweep as it is."""
    steps = np.sign(np.diff(response.frequency))
    moving = np.flatnonzero(steps)
    turns = np.flatnonzero(steps[moving][1:] != steps[moving][:-1])
    if len(turns) != 1:
        return [response]
    # The point at the turn belongs to both, if it is not measured twice.
    end, begin = int(moving[turns[0]]) + 2, int(moving[turns[0] + 1])
    if min(end, len(response.frequency) - begin) < MIN_FREQUENCIES:
        return [response]
    parts = [slice(0, end), slice(begin, None)]
    return [
        replace(response, name=f"{response.name} ({_direction(response.frequency[each])})",
                frequency=response.frequency[each], values=response.values[each])
        for each in parts
    ]  # fmt: skip


def _direction(frequency: Array) -> str:
    return "up" if frequency[-1] > frequency[0] else "down"


def jump_test(response: Response) -> list[Test]:
    """A failed test at the largest jump from one frequency to the next, if there is one."""
    apart = np.abs(np.diff(response.frequency))
    worst = (0.0, 0, "")
    for i, axis in enumerate(response.axes):
        for k, drive in enumerate(response.drives):
            row = response.values[:, i, k]
            step = np.abs(np.diff(row))
            noise = _noise(row)
            for at in range(2, len(step) - 2):
                near = [*range(at - 2, at), *range(at + 1, at + 3)]
                neighbor = max(float(step[j]) * max(float(apart[at] / max(apart[j], 1e-300)), 1.0) for j in near)
                size = float(step[at]) / max(neighbor, noise)
                if size > JUMP and step[at] > CLEAR * noise and size > worst[0]:
                    worst = size, at, f"{axis}{drive}"
    if not worst[0]:
        return []
    first, second = response.frequency[worst[1] : worst[1] + 2]
    words = (
        f"{response.name}: {worst[2]} jumps between {first:.8g} and {second:.8g} Hz, as a nonlinear spring does: "
        "repeat with a smaller drive; frequencies and damping are not those of a small motion"
    )
    return [Test("jump", "fail", words)]


def _noise(row: Complex) -> float:
    """Size of the noise of a difference of neighbors, from the median of second differences."""
    return float(np.median(np.abs(row[2:] - 2 * row[1:-1] + row[:-2]))) / math.sqrt(3 * math.log(2)) + 1e-300


def direction_tests(fits: Sequence[SweepFit]) -> list[Test]:
    """A test for each pair of sweeps up and down of the same state: their frequencies must agree."""
    found = []
    for i, one in enumerate(fits):
        for other in fits[:i]:
            same = one.response.state == other.response.state and one.response.axes == other.response.axes
            if same and one.direction != other.direction:
                found.append(_direction_test(one, other))
    return found


def _direction_test(one: SweepFit, other: SweepFit) -> Test:
    up, down = (one, other) if one.direction == "up" else (other, one)
    worst = (-1.0, 0.0, 0.0)
    for i in range(up.shape.axes):
        (first, spread, width), (second, more, _) = (_mode(each, i) for each in (up, down))
        size = abs(first - second) / math.hypot(spread, more)
        worst = max(worst, (size, first - second, width))
    size, apart, width = worst
    p = min(up.shape.axes * math.erfc(size / math.sqrt(2)), 1.0)
    names = f"{up.response.name} and {down.response.name}"
    if size <= SEEN:
        return Test("directions", "pass", f"{names}: up and down agree (p = {p:.2g})", p)
    words = (
        f"{names}: up and down differ by {abs(apart):.3g} Hz, {abs(apart) / width:.2g} linewidths, "
        f"{'after' if apart > 0 else 'against'} the sweep: sweep more slowly, or with a smaller drive; the mean is used"
    )
    return Test("directions", "fail", words, p)


def _mode(fit: SweepFit, i: int) -> tuple[float, float, float]:
    """Frequency of a mode, its deviation, and the linewidth, Hz."""
    count = 2 * fit.shape.axes**2
    shape = Shape(fit.shape.axes)
    values, scale = fit.fit.parameters[:count], fit.unit / (2 * math.pi)
    pole = complex(poles(shape, values)[i]) * scale
    spread = np.sqrt(np.diag(fit.fit.covariance)[:count])
    gradient = np.zeros(count)
    for j in range(count):
        step = np.zeros(count)
        step[j] = max(0.01 * float(spread[j]), 1e-12)
        moved = [float(np.abs(poles(shape, values + sign * step)[i])) for sign in (1, -1)]
        gradient[j] = scale * (moved[0] - moved[1]) / (2 * step[j])
    variance = float(gradient @ fit.fit.covariance[:count, :count] @ gradient)
    return abs(pole), math.sqrt(max(variance, 1e-300)), 2 * abs(pole.real)


def lean_test(fit: SweepFit) -> Test:
    """A test whether the peak leans, as a cubic spring makes it."""
    name, score = fit.response.name, fit.lean
    p = min(len(score) * math.erfc(float(np.abs(score).max()) / math.sqrt(2)), 1.0)
    at = int(np.argmax(np.abs(score)))
    if abs(score[at]) <= SEEN:
        return Test("springs", "pass", f"{name}: the peaks do not lean (p = {p:.2g})", p)
    side = "higher" if score[at] > 0 else "lower"
    words = (
        f"{name}: the peak along {fit.response.axes[at]} leans to {side} frequencies, "
        f"by about {abs(fit.lean_shift[at]):.2g} Hz at its top: repeat with a smaller drive"
    )
    return Test("springs", "fail", words, p)
