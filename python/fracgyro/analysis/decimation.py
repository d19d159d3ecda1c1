"""Fewer points of a curve for the same picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Distances from the mean that are noise, relative to the median one and to the standard deviation.
NOISE, NOISE_OF_ALL = 0.3, 0.02


def decimate(time: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """The minimum and the maximum of each of `columns` equal segments, in order of time, and both ends.

    A line through them covers the same pixels as one through every sample.
    """
    last, stretch = len(values) - 1, -(-len(values) // columns)
    if stretch <= 2:
        return time, values
    starts = np.arange(0, last + 1, stretch)
    table = np.pad(values, (0, len(starts) * stretch - last - 1), mode="edge").reshape(-1, stretch)
    kept = np.unique(np.concatenate([[0, last], starts + table.argmin(1), starts + table.argmax(1)]))
    kept = kept[kept <= last]  # padding repeats the last sample
    return time[kept], values[kept]


def largest(time: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """The maximum in each of `columns` equal segments, at its middle; every sample if there are fewer."""
    stretch = -(-len(values) // columns)
    starts = np.arange(0, len(values), stretch)
    ends = np.append(starts[1:], len(values)) - 1
    return 0.5 * (time[starts] + time[ends]), np.maximum.reduceat(values, starts)


def band(time: Array, values: Array, columns: int) -> tuple[Array, Array, Array]:
    """Times of `columns` equal segments, and the minimum and the maximum in each."""
    middle, high = largest(time, values, columns)
    middle[[0, -1]] = time[[0, -1]]
    return middle, -largest(time, -values, columns)[1], high


def crossings(values: Array) -> int:
    """Number of times at which the values cross their mean by more than noise."""
    off = values - values.mean()
    noise = max(NOISE * float(np.median(abs(off))), NOISE_OF_ALL * float(off.std()))
    above = off[abs(off) > noise] > 0
    return int(np.count_nonzero(above[1:] != above[:-1]))
