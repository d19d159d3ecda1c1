"""The times of a record's samples: their interval, and what about them is not even.

Times are compared with a straight line through those around them: what comes back to it is rounding or jitter, what
stays off it by an interval or more is a gap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOW = 256  # samples over which an interval is measured
NEAR, FAR = 8, 64  # samples on each side of a gap whose times are compared
LASTING = 0.6  # of an interval: a shift that stays is a gap
ROBUST = 1.4826  # standard deviation over the median absolute deviation
JITTER = 0.5  # of an interval: jitter beyond this is noted


@dataclass(frozen=True)
class Times:
    """The interval of a record, in the unit of its times, and where these are not even."""

    interval: float
    gaps: NDArray[np.int64]  # samples after which some are missing
    missing: int  # samples in the gaps
    falls: NDArray[np.int64]  # samples that come before the one before them
    repeats: int  # samples at the time of the one before, where times are not rounded to more than an interval
    jitter: float  # largest distance from the line beyond rounding, intervals

    @property
    def even(self) -> bool:
        return not len(self.gaps) and not len(self.falls)

    def longest(self, samples: int) -> tuple[int, int]:
        """First sample, and the one after the last, of the longest stretch without a gap or a fall."""
        ends = np.unique(np.concatenate([[0], self.gaps + 1, self.falls, [samples]]))
        at = int(np.argmax(np.diff(ends)))
        return int(ends[at]), int(ends[at + 1])


def examine(times: Array) -> Times | None:
    """None where times do not rise."""
    steps = np.diff(times)
    falls = np.flatnonzero(steps < 0) + 1
    interval = _interval(times)
    if not interval > 0:
        return None
    resolution = _resolution(steps)
    rounded = max(resolution / interval, 1.0)  # what one rounding shifts, in intervals
    near, far = NEAR * math.ceil(rounded), FAR * math.ceil(rounded)
    # Medians over so many jittering times are uncertain, by this many intervals.
    jitter = ROBUST * float(np.median(np.abs(steps - interval))) / math.sqrt(2) / interval
    least = LASTING * rounded + 4 * 1.25 * jitter * math.sqrt(2 / far)
    gaps, missing = [], 0
    candidates = np.flatnonzero(steps > (rounded + LASTING) * interval)
    for i in _steepest(times, interval, candidates, near, far, least):
        shift = _shift(times, i, far, interval)
        if shift >= least and _shift(times, i, near, interval) >= least / 2:
            gaps.append(i)
            missing += max(round(shift), 1)
    kept = np.array(gaps, dtype=np.int64)
    total = len(times) - 1 + missing
    if not len(falls) and not gaps and rounded > 1:  # the ends are rounded, too
        at = np.arange(len(times)) - (len(times) - 1) / 2
        interval = float(at @ (times - times[0])) / float(at @ at)
    elif not len(falls):
        interval = float(times[-1] - times[0]) / total  # of the whole record, as it is known best
    distance = _distance(times, interval, kept, falls)
    repeats = 0 if resolution > 1.5 * interval else int(np.count_nonzero(steps == 0))
    return Times(interval, kept, missing, falls, repeats, distance - 0.5 * resolution / interval)


def _interval(times: Array) -> float:
    """Median, over windows, of their mean interval: neither rounding nor a few gaps change it."""
    window = min(max(WINDOW, len(times) // 16), len(times) - 1)
    ends = times[::window]
    return float(np.median(np.diff(ends))) / window


def _steepest(
    times: Array, interval: float, candidates: NDArray[np.int64], together: int, width: int, least: float
) -> list[int]:
    """Candidates across which means of `width` times shift by this, in intervals; in each cluster the largest."""
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
    """How far times after i are off the line through those before it, in intervals beyond the one between."""
    before, after = times[max(i + 1 - width, 0) : i + 1], times[i + 1 : i + 1 + width]
    left = np.median(before - interval * np.arange(-len(before) + 1, 1))
    right = np.median(after - interval * np.arange(1, len(after) + 1))
    return float(right - left) / interval


def _distance(times: Array, interval: float, gaps: NDArray[np.int64], falls: NDArray[np.int64]) -> float:
    """The largest from a line through each stretch, in intervals."""
    ends = np.unique(np.concatenate([[0], gaps + 1, falls, [len(times)]]))
    most = 0.0
    for begin, end in pairwise(map(int, ends)):
        for first in range(begin, end, 4 * WINDOW):
            part = times[first : min(first + 4 * WINDOW, end)]
            off = part - interval * np.arange(len(part))
            most = max(most, float(np.max(np.abs(off - np.median(off)))) / interval)
    return most


def _resolution(steps: Array) -> float:
    """The least difference between two steps, as far as some thousands show, in stretches: every n-th may be alike."""
    begins = np.linspace(0, max(len(steps) - WINDOW, 0), 16).astype(int)
    few = np.unique(np.concatenate([steps[begin : begin + WINDOW] for begin in begins]))
    apart = np.diff(few)
    apart = apart[apart > 1e-6 * max(abs(float(few[-1])), 1e-300)]
    return float(apart.min()) if len(apart) else 0.0
