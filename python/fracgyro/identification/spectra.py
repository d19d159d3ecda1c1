"""Spectra of records: the bins near the modes, and where the modes are before anything is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from .model import Complex

Array = NDArray[np.float64]

LINEWIDTHS = 20.0  # half width of the band around the modes; 20 cost less than 1 % of the bound
MIN_BINS = 12
LOWEST = 0.02  # times the lowest mode: below it is the offset
VISIBLE = 30.0  # power over the median of all bins that counts as a mode in the first search
NEAR_PEAK = 1e-5  # power over that of the largest bin
BEGINNINGS = (1.0, 1 / 4, 1 / 16, 1 / 64)
MIN_BEGINNING = 64  # samples
MEDIAN_BINS = 20_000  # give a median to 1 %


@dataclass(frozen=True)
class Spectrum:
    """Bins of a record's discrete Fourier transform, scaled so that real and imaginary part of white noise have the
    variance of a sample. `frequency`, rad/s; `motion`, (bins, axes); `force`, (bins, drives); `before`: the force one
    sample earlier, which still acts during the `fraction` of each interval."""

    frequency: Array
    motion: Complex
    force: Complex
    interval: float
    samples: int
    before: Complex | None = None
    fraction: float = 0.0

    def only(self, kept: NDArray[Any] | slice) -> Spectrum:
        """These bins, by mask, number or slice."""
        before = None if self.before is None else self.before[kept]
        return replace(
            self, frequency=self.frequency[kept], motion=self.motion[kept], force=self.force[kept], before=before
        )

    def between(self, low: float, high: float) -> Spectrum:
        """The bins from `low` to `high`, rad/s."""
        first, end = np.searchsorted(self.frequency, low), np.searchsorted(self.frequency, high, side="right")
        return self.only(slice(int(first), int(end)))

    def thinned(self, bins: int) -> Spectrum:
        """At most `bins` bins: half of them the strongest, the others evenly spread. Each bin obeys the model."""
        count = len(self.frequency)
        if count <= bins:
            return self
        power = np.abs(self.motion) ** 2
        strongest = np.argsort((power / power.max(axis=0)).max(axis=1), kind="stable")[count - bins // 2 :]
        kept = np.union1d(strongest, np.linspace(0, count - 1, bins - bins // 2).astype(int))
        return self.only(kept)


def spread(bins: NDArray[Any]) -> NDArray[Any]:
    """Evenly spread bins, enough for their median: of many, a sort would take longer than a transform."""
    return bins[:: max(len(bins) // MEDIAN_BINS, 1)]


def spectrum(motion: Array, force: Array | None, interval: float, before: Array | None = None) -> Spectrum:
    """All bins between zero and half the sampling rate, both left out. `motion`: (axes, samples)."""
    samples = motion.shape[1]
    last = (samples - 1) // 2
    scale = np.sqrt(2 / samples)

    def transform(values: Array) -> Complex:
        return np.ascontiguousarray(scale * fft.rfft(values, axis=1)[:, 1 : last + 1].T)

    driven = np.zeros((last, 0), dtype=complex) if force is None else transform(force)
    frequency = 2 * np.pi / (samples * interval) * np.arange(1, last + 1)
    earlier = None if before is None else transform(before)
    return Spectrum(frequency, transform(motion), driven, interval, samples, earlier)


@dataclass(frozen=True)
class Search:
    """Power of each bin of a channel over the median, and the frequencies of the bins, in cycles a sample;
    `samples`: of the beginning that was transformed."""

    power: Array
    cycles: Array
    samples: int

    @property
    def peak(self) -> int:
        return int(np.argmax(self.power))


def visible(row: Array) -> Search:
    """The spectrum of that beginning of a channel in which its largest line is the clearest; with a Hann window."""
    found: list[Search] = []
    for fraction in BEGINNINGS:
        samples = int(fraction * len(row))
        if found and samples < MIN_BEGINNING:
            break
        part = row[:samples]
        level = part - part.mean()
        size = max(float(np.abs(level).max()), float(np.finfo(float).tiny))
        # A search needs no more than single precision, which takes half the time.
        power = np.abs(fft.rfft(_window(samples, fraction < 1) * (level / size).astype(np.float32))[2:]) ** 2
        median = max(float(np.median(spread(power))), float(np.finfo(np.float32).tiny))
        found.append(Search((power / median).astype(float), np.arange(2, len(power) + 2) / samples, samples))
    # A shorter beginning must be much clearer: its lines are wider.
    best = found[0]
    for each in found[1:]:
        if each.power.max() > 4 * best.power.max():
            best = each
    return best


@lru_cache(maxsize=2 * len(BEGINNINGS))
def _window(samples: int, falling: bool) -> NDArray[np.float32]:
    """A Hann window, or its falling half: a mode that decays at once is only at the very beginning."""
    turn = np.pi * (np.arange(samples) + 0.5) / samples
    found = 0.5 + 0.5 * np.cos(turn) if falling else 0.5 - 0.5 * np.cos(2 * turn)
    return found.astype(np.float32)


def clearest(searches: Sequence[Search]) -> int:
    """Samples of the longest of the beginnings in which the channels are the clearest."""
    return max(each.samples for each in searches)


def first_band(searches: Sequence[Search], interval: float) -> tuple[float, float, float]:
    """Band in which modes are visible and its largest line, rad/s: low, high, line."""
    strongest = max(range(len(searches)), key=lambda i: float(searches[i].power.max()))
    line = float(searches[strongest].cycles[searches[strongest].peak])
    low, high, margin = line, line, 0.0
    for each in searches:
        near = (each.cycles > line / 2.5) & (each.cycles < 2.5 * line)
        clear = each.cycles[near & (each.power > VISIBLE) & (each.power > NEAR_PEAK * each.power.max())]
        if len(clear):
            low, high = min(low, float(clear.min())), max(high, float(clear.max()))
        margin = max(margin, MIN_BINS * float(each.cycles[1] - each.cycles[0]))
    margin = max(margin, (high - low) / 4)
    scale = 2 * np.pi / interval
    return max(low - margin, LOWEST * low) * scale, min(high + margin, 0.5) * scale, line * scale


def band(modes: Complex, length: float, rate: float) -> tuple[float, float]:
    """The band of the fit, rad/s, around the poles `modes`, rad/s: record of `length` s at `rate` Hz."""
    width = LINEWIDTHS * max(2 * float(np.abs(modes.real).max()), 2 * np.pi / length)
    places = np.abs(modes)
    low, high = float(places.min()) - width, float(places.max()) + width
    return max(low, LOWEST * float(places.min())), min(high, np.pi * rate)
