"""The spectrum of a rate record by its cosine transform, whose powers are independent.

The record's cosine transform (DCT-II) gives z_k at f_k = k/(2 n h), k = 1 ... n - 1, for n samples every h. h z_k² has
the two-sided density S(f_k) as its mean, exactly for white noise and for a random walk, which this transform
decorrelates. For flicker noise the mean is 0.77 S at the first frequency and approaches S at higher ones
(`flicker_factor`). The mean of the record drops out, and a trend affects only the lowest frequencies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.stats import chi2

Array = NDArray[np.float64]

SINGLE = 32  # lowest frequencies, each of which is one band
PER_OCTAVE = 16  # bands above
MIN_LINE = 64  # smallest index k of a line
FALSE_LINES = 1e-4  # probability of a false line in a record of noise
LOCAL_FREQUENCIES = 128  # frequencies of the local median around a line
STRONG = 1e4  # power over the noise, above which a sinusoid leaks far
MAX_STRONG, PASSES, PHASES = 4, 3, 64  # sinusoids that are subtracted; passes; segments whose phases are compared
MEDIAN_SAMPLES = 2**16  # whose medians are taken at a time
MAX_FACTOR = 11  # largest prime factor of the transform length: one second instead of four


@dataclass(frozen=True)
class Line:
    """A sinusoid in the record: frequency in Hz, amplitude in the record's unit.

    `covers`: it is so strong that it masks the noise around it.
    """

    frequency: float
    amplitude: float
    covers: bool = False


@dataclass(frozen=True)
class Spectrum:
    """Mean powers in frequency bands, without lines; (bands,) each."""

    frequency: Array  # center of each band, Hz
    power: Array  # two-sided density
    freedom: Array  # degrees of freedom
    flicker: Array  # factor on the density of flicker noise
    interval: float
    lines: tuple[Line, ...]


def spectrum(records: Array, interval: float) -> Spectrum:
    """Mean spectrum of records of equal length, (records, samples), `interval` s between samples."""
    count, samples = records.shape
    samples = _quick(samples)
    power = _power(records, samples, interval)
    lines, kept = _lines(power, count, samples, interval)
    steady: list[Line] = []
    for _ in range(PASSES):
        strong = sorted((line for line in lines if line.covers), key=lambda line: -line.amplitude)[:MAX_STRONG]
        if not strong:
            break
        # Subtracting a steady sinusoid also removes its leakage.
        records = np.stack([_without(record[:samples], strong, interval) for record in records])
        power = _power(records, samples, interval)
        lines, kept = _lines(power, count, samples, interval)
        steady += [replace(line, covers=False) for line in strong]
    edges = _edges(samples)
    freedom = np.add.reduceat(kept, edges[:-1] - 1, dtype=float)
    power *= kept
    means = np.add.reduceat(power, edges[:-1] - 1) / np.maximum(freedom, 1.0)
    middle = (edges[:-1] + edges[1:] - 1) / 2
    factor = np.ones(len(middle))
    factor[: min(SINGLE, len(middle))] = [flicker_factor(k) for k in range(1, min(SINGLE, len(middle)) + 1)]
    seen = freedom > 0
    return Spectrum(
        (middle / (2 * samples * interval))[seen],
        means[seen],
        count * freedom[seen],
        factor[seen],
        interval,
        (*steady, *lines),
    )


def _power(records: Array, samples: int, interval: float) -> Array:
    """Mean of h z_k² over the records: (samples - 1,)."""
    found: Array | None = None
    for record in records:
        power = dct(record[:samples] - record[:samples].mean(), norm="ortho", overwrite_x=True)[1:]
        np.square(power, out=power)
        power *= interval
        found = power if found is None else np.add(found, power, out=found)
    assert found is not None
    return found if len(records) == 1 else np.divide(found, len(records), out=found)


def _without(record: Array, lines: Sequence[Line], interval: float) -> Array:
    """The record without its sinusoids near these frequencies, fitted by least squares."""
    rest = record - record.mean()
    for line in [*lines, *lines]:  # twice, as the lines overlap
        frequency, at = line.frequency * interval, np.arange(len(rest))
        for _ in range(4):
            mixed = rest * np.exp(-2j * np.pi * frequency * at)
            parts = mixed[: len(mixed) // PHASES * PHASES].reshape(PHASES, -1).mean(axis=1)
            turned = np.unwrap(np.angle(parts))
            slope = float(np.polyfit(np.arange(PHASES), turned, 1, w=np.abs(parts))[0])
            frequency += slope / (2 * np.pi * (len(mixed) // PHASES))
        carrier = np.exp(2j * np.pi * frequency * at)
        columns = np.column_stack([carrier.real, carrier.imag])
        rest = rest - columns @ np.linalg.solve(columns.T @ columns, columns.T @ rest)
    return np.asarray(rest)


def _quick(samples: int) -> int:
    """The largest length up to `samples` with a fast transform."""
    while samples > 1000 and not _has_small_factors(samples):
        samples -= 1
    return samples


def _has_small_factors(number: int) -> bool:
    for factor in (2, 3, 5, 7, MAX_FACTOR):
        while number % factor == 0:
            number //= factor
    return number == 1


def _edges(samples: int) -> NDArray[np.int64]:
    """First k of each band, and the end of the last."""
    if samples - 1 <= SINGLE:
        return np.arange(1, samples + 1)
    octaves = np.log2(samples / (SINGLE + 1))
    above = np.round(np.geomspace(SINGLE + 1, samples, max(2, round(PER_OCTAVE * octaves)))).astype(np.int64)
    return np.unique(np.concatenate([np.arange(1, SINGLE + 1), above]))


def _lines(power: Array, count: int, samples: int, interval: float) -> tuple[tuple[Line, ...], NDArray[np.bool_]]:
    """Significant sinusoids, and a mask of the k that are free of them."""
    kept = np.ones(len(power), dtype=bool)
    if len(power) <= 2 * MIN_LINE:
        return (), kept
    most = chi2.isf(FALSE_LINES / len(power), count) / count
    octaves = np.log2(samples / MIN_LINE)
    bands = np.unique(np.round(np.geomspace(MIN_LINE, samples, max(2, round(4 * octaves)))).astype(np.int64)) - 1
    middles, medians = _medians(power, bands, count)
    # Behind a filter the level falls steeply and needs medians over few frequencies.
    first = MIN_LINE - 1
    blocks = np.arange(first, len(power) + 1, min(LOCAL_FREQUENCIES, len(power) - first))
    near_middles, near_medians = _medians(power, blocks, count)
    least = np.minimum.reduce([near_medians, np.roll(near_medians, 1), np.roll(near_medians, -1)])
    whole = power[first : blocks[-1]].reshape(len(least), -1) > (most * least)[:, None]
    rest = power[blocks[-1] :] > most * near_medians[-2:].min()
    strong = first + np.concatenate([np.flatnonzero(whole), whole.size + np.flatnonzero(rest)])
    wide_level = dict(zip(strong.tolist(), _level(strong, middles, medians).tolist(), strict=True))
    level = np.maximum(list(wide_level.values()), _level(strong, near_middles, near_medians))
    strong = strong[(power[strong] > most * level) & (level > 0)]
    found = []
    for here in map(int, strong[np.argsort(-power[strong])]):
        if not kept[here]:
            continue
        # Its power falls with the square of the distance; the width is where it reaches a ninth of the noise.
        wide = min(int(3 * math.sqrt(power[here] / wide_level[here])) + 2, here // 2, len(power) // 8)
        # Leakage of a strong line also raises the level around it.
        around_it = medians[(middles > here / 4) & (middles < 4 * here)]
        noise = max(min(around_it.min(initial=np.inf), wide_level[here]), np.finfo(float).tiny)
        ratio = min(float(power[here]) / noise, 1 / np.finfo(float).eps)
        covers = ratio > STRONG and 3 * math.sqrt(ratio) > wide
        around = slice(max(here - wide, 0), here + wide + 1)
        mean = float(np.sum(power[around])) / (interval * samples)
        found.append(Line((here + 1) / (2 * samples * interval), float(np.sqrt(2 * mean)), covers))
        kept[around] = False
    return tuple(sorted(found, key=lambda line: line.frequency)), kept


def _medians(power: Array, ends: NDArray[np.int64], count: int) -> tuple[Array, Array]:
    """Centers of bands, and the mean power in each from its median, which lines do not affect."""
    sizes = np.diff(ends)
    if (sizes == sizes[0]).all():
        rows = power[ends[0] : ends[-1]].reshape(-1, sizes[0])
        at_once = max(MEDIAN_SAMPLES // int(sizes[0]), 1)  # small enough for the cache
        parts = [np.median(rows[begin : begin + at_once], axis=1) for begin in range(0, len(rows), at_once)]
        found = np.concatenate(parts)
    else:
        found = np.array([np.median(power[begin:end]) for begin, end in pairwise(map(int, ends))])
    return (ends[:-1] + ends[1:] - 1) / 2, np.asarray(found / (chi2.median(count) / count))


def _level(at: NDArray[np.int64], middles: Array, medians: Array) -> Array:
    """Level at these k, interpolated between the medians in log-log."""
    logarithms = np.log(np.maximum(medians, np.finfo(float).tiny))
    return np.asarray(np.exp(np.interp(np.log(at + 1.0), np.log(middles + 1.0), logarithms)))


@cache
def flicker_factor(k: int) -> float:
    """Mean of h z_k² divided by the density at f_k, for flicker noise.

    The window of the k-th cosine over a record of length 1 is 4 w² (1 - (-1)^k cos w)/(w² - (π k)²)² with w = 2π f.
    """
    steps, halves = 60, k + 60
    w = (np.arange(steps * halves) + 0.5) * np.pi / steps
    window = 4 * w**2 * (1 - (-1) ** k * np.cos(w)) / (w**2 - (np.pi * k) ** 2) ** 2
    # 2 ∫ window S df with S = 1/w and f = w/2π, over S(f_k) = 1/(π k)
    return float(np.sum(window / w) * k * np.pi / steps)
