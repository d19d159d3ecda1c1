"""Single samples that are far off the motion: a line through their neighbors takes their place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .records import Segment

Array = NDArray[np.float64]

NEIGHBORS = 4  # samples on each side
FAR = 8.0  # standard deviations
LEAST = 1e-6  # times the amplitude: smaller differences are rounding
MOST = 1e-4  # share of the samples, and at least one: more are not outliers but another motion
FITTED = 50_000  # samples from which the interpolation is determined
PASSES = 3


def without_outliers(segment: Segment) -> tuple[Segment, list[str]]:
    """The segment with its outliers interpolated, and notes with their number."""
    motion, notes = segment.motion, []
    for i, axis in enumerate(segment.axes):
        at = outliers(motion[i])
        if len(at) == 0:
            continue
        if len(at) > max(MOST * motion.shape[1], 1):
            notes.append(f"{len(at)} samples of {axis} are far off the motion, too many to be left out")
            continue
        motion = motion.copy()
        motion[i] = _interpolated(motion[i], at)
        first = segment.begin + int(at[0]) * segment.interval
        words = "sample is" if len(at) == 1 else "samples are"
        notes.append(f"{len(at)} {words} far off the motion of {axis}, the first at {first:.4g} s: interpolated")
    return replace(segment, motion=motion), notes


def outliers(row: Array) -> NDArray[np.int64]:
    """Places of the samples that are far off what their neighbors say."""
    found: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    size = float(np.abs(row - row.mean()).max())
    for _ in range(PASSES):
        clean = _interpolated(row, found)
        rest = _rest(clean, row)
        limit = max(FAR * float(np.median(np.abs(rest))) / 0.6745, LEAST * size)
        far = np.flatnonzero(np.abs(rest) > limit)
        # An outlier moves the interpolation of its neighbors: among near ones only the largest counts.
        kept = [k for k in far if np.abs(rest[k]) == np.abs(rest[max(k - NEIGHBORS, 0) : k + NEIGHBORS + 1]).max()]
        new = np.unique(np.concatenate([found, np.array(kept, dtype=np.int64) + NEIGHBORS]))
        if len(new) == len(found):
            break
        found = new
    return found


def _neighbors(row: Array) -> Array:
    """The neighbors of each sample that has them on both sides: (samples, 2 NEIGHBORS)."""
    windows = np.lib.stride_tricks.sliding_window_view(row, 2 * NEIGHBORS + 1)
    return np.delete(windows, NEIGHBORS, axis=1)


def _weights(clean: Array) -> Array:
    """The linear interpolation that has the smallest error on the largest part of the record, its beginning."""
    part = clean[:FITTED]
    neighbors = _neighbors(part)
    normal = neighbors.T @ neighbors
    ridge = 1e-12 * float(np.trace(normal))
    right = neighbors.T @ part[NEIGHBORS:-NEIGHBORS]
    return np.asarray(np.linalg.solve(normal + ridge * np.eye(len(normal)), right))


def _rest(clean: Array, row: Array) -> Array:
    """Differences of the samples from what their clean neighbors say."""
    return np.asarray(row[NEIGHBORS:-NEIGHBORS] - _neighbors(clean) @ _weights(clean))


def _interpolated(row: Array, at: NDArray[np.int64]) -> Array:
    """The row with these samples replaced, in two passes because the first weights know the outliers."""
    clean = row.copy()
    if len(at) == 0:
        return clean
    clean[at] = (row[at - 1] + row[at + 1]) / 2
    for _ in range(2):
        weights = _weights(clean)
        for k in at:
            window = np.delete(clean[k - NEIGHBORS : k + NEIGHBORS + 1], NEIGHBORS)
            clean[k] = float(window @ weights)
    return clean
