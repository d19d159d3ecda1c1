"""Sampling times of a record: their interval, and gaps, decreases, repeats and jitter.

Times are compared with a straight line through the times around them: a deviation that returns to the line is rounding
or jitter, a lasting shift is a gap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOW = 256  # samples for one measurement of the interval
NEAR_SAMPLES, FAR_SAMPLES = 8, 64  # samples on each side of a gap whose times are compared
MIN_GAP = 0.6  # intervals: smallest lasting shift that counts as a gap
ROBUST = 1.4826  # standard deviation over the median absolute deviation
JITTER = 0.5  # intervals: larger jitter is noted


@dataclass(frozen=True)
class Times:
    """The sampling interval of a record, in the unit of its times, and irregularities."""

    interval: float
    gaps: NDArray[np.int64]  # last sample before each gap
    missing: int  # samples in the gaps
    falls: NDArray[np.int64]  # samples whose time is before that of their predecessor
    repeats: int  # samples with the time of their predecessor; 0 if times are rounded to more than an interval
    jitter: float  # largest distance from the line, beyond rounding, in intervals

    @property
    def even(self) -> bool:
        return not len(self.gaps) and not len(self.falls)

    def longest(self, samples: int) -> tuple[int, int]:
        """First sample and end of the longest segment without a gap or a decrease."""
        ends = np.unique(np.concatenate([[0], self.gaps + 1, self.falls, [samples]]))
        at = int(np.argmax(np.diff(ends)))
        return int(ends[at]), int(ends[at + 1])


def examine(times: Array) -> Times | None:
    """The interval and irregularities of `times` (samples,); None if they do not increase."""
    steps = np.diff(times)
    falls = np.flatnonzero(steps < 0) + 1
    interval = _interval(times)
    if not interval > 0:
        return None
    rounding = resolution(steps)
    rounded = max(rounding / interval, 1.0)  # shift by rounding, in intervals
    near, far = NEAR_SAMPLES * math.ceil(rounded), FAR_SAMPLES * math.ceil(rounded)
    # Uncertainty of the medians over jittering times, in intervals.
    jitter = ROBUST * float(np.median(np.abs(steps - interval))) / math.sqrt(2) / interval
    least = MIN_GAP * rounded + 4 * 1.25 * jitter * math.sqrt(2 / far)
    gaps, missing = [], 0
    candidates = np.flatnonzero(steps > (rounded + MIN_GAP) * interval)
    for i in _steepest(times, interval, candidates, near, far, least):
        shift = _shift(times, i, far, interval)
        if shift >= least and _shift(times, i, near, interval) >= least / 2:
            gaps.append(i)
            missing += max(round(shift), 1)
    kept = np.array(gaps, dtype=np.int64)
    total = len(times) - 1 + missing
    if not len(falls) and not gaps and rounded > 1:  # the ends are also rounded
        at = np.arange(len(times)) - (len(times) - 1) / 2
        interval = float(at @ (times - times[0])) / float(at @ at)
    elif not len(falls):
        interval = float(times[-1] - times[0]) / total  # over the whole record, which is most accurate
    distance = _distance(times, interval, kept, falls)
    repeats = 0 if rounding > 1.5 * interval else int(np.count_nonzero(steps == 0))
    return Times(interval, kept, missing, falls, repeats, distance - 0.5 * rounding / interval)


def _interval(times: Array) -> float:
    """Median of the mean intervals of windows, insensitive to rounding and a few gaps."""
    window = min(max(WINDOW, len(times) // 16), len(times) - 1)
    ends = times[::window]
    return float(np.median(np.diff(ends))) / window


def _steepest(
    times: Array, interval: float, candidates: NDArray[np.int64], together: int, width: int, least: float
) -> list[int]:
    """Candidates across which means of `width` times shift by at least `least` intervals; one per cluster."""
    if not len(candidates):
        return []
    sums = np.cumsum(times - interval * np.arange(len(times)))
    sums = np.concatenate([[0.0], sums])
    middle = candidates + 1
    first, last = np.maximum(middle - width, 0), np.minimum(middle + width, len(times))
    after = (sums[last] - sums[middle]) / (last - middle)
    shift = (after - (sums[middle] - sums[first]) / (middle - first)) / interval
    large = np.flatnonzero(shift >= 0.8 * least)
    if not len(large):
        return []
    clusters = np.split(large, np.flatnonzero(np.diff(candidates[large]) > together) + 1)
    return [int(candidates[cluster[np.argmax(shift[cluster])]]) for cluster in clusters]


def _shift(times: Array, i: int, width: int, interval: float) -> float:
    """Shift of the times after i from the line through those before it, in intervals beyond the expected one."""
    before, after = times[max(i + 1 - width, 0) : i + 1], times[i + 1 : i + 1 + width]
    left = np.median(before - interval * np.arange(-len(before) + 1, 1))
    right = np.median(after - interval * np.arange(1, len(after) + 1))
    return float(right - left) / interval


def _distance(times: Array, interval: float, gaps: NDArray[np.int64], falls: NDArray[np.int64]) -> float:
    """Largest distance from a line through each segment, in intervals."""
    ends = np.unique(np.concatenate([[0], gaps + 1, falls, [len(times)]]))
    most = 0.0
    for begin, end in pairwise(map(int, ends)):
        for first in range(begin, end, 4 * WINDOW):
            part = times[first : min(first + 4 * WINDOW, end)]
            off = part - interval * np.arange(len(part))
            most = max(most, float(np.max(np.abs(off - np.median(off)))) / interval)
    return most


def resolution(steps: Array) -> float:
    """Smallest difference between two steps in a sample of segments, as every n-th step may be equal."""
    begins = np.linspace(0, max(len(steps) - WINDOW, 0), 16).astype(int)
    few = np.unique(np.concatenate([steps[begin : begin + WINDOW] for begin in begins]))
    apart = np.diff(few)
    apart = apart[apart > 1e-6 * max(abs(float(few[-1])), 1e-300)]
    return float(apart.min()) if len(apart) else 0.0
