"""The first stage for the decays and forced records of one state of the device: from segments to a fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cubic import Cubic, with_springs
from .forced import DELAYS, Delay, delayed, fractional, spectrum_of
from .likelihood import Fit, maximize, search
from .model import Shape, poles
from .records import Segment, part
from .spectra import Spectrum, band, clearest, first_band, spread, visible
from .start import linear_start
from .thermal import only_white, weights

Array = NDArray[np.float64]

FRACTIONS = (1.0, 0.25, 1 / 16)  # beginnings of each record from which a start is computed
POLISH = 6  # steps before the starts are compared
MIN_START_BINS = 10
MAX_START_BINS = 1200  # limit for a record: in a long one the first band has many without a mode
BANDS = 4  # fits, each in the band around the modes of the one before
ROUGH = 4.0  # times the beginning in which the slowest mode is the clearest
LONGEST = 14.0  # times the longest time constant: later samples have only noise


@dataclass(frozen=True)
class Fitted:
    """A fit, its model, its unit of time (omega0, rad/s), the spectra and segments it is of; `delay`: of the force;
    `cubic`: the test for springs."""

    fit: Fit
    shape: Shape
    unit: float
    spectra: tuple[Spectrum, ...]
    segments: tuple[Segment, ...]
    delay: Delay | None = None
    cubic: Cubic | None = None

    def plain(self) -> dict[str, Any]:
        """The fit as JSON."""
        return {
            "kind": "decay" if self.shape.drives == 0 else "forced",
            "records": [each.name for each in self.segments],
            "omega0": self.unit,
            "names": self.shape.names(),
            "parameters": self.fit.parameters.tolist(),
            "covariance": self.fit.covariance.tolist(),
            "noise": self.fit.noise.tolist(),
            "thermal": self.fit.thermal.thermal.tolist(),
            "thermal_deviation": self.fit.thermal.deviation.tolist(),
            "thermal_p": self.fit.thermal.p,
            "chi_squared": self.fit.squares,
            "degrees_of_freedom": self.fit.freedom,
            "bins": sum(len(each.frequency) for each in self.spectra),
            "band_hz": [self.low, self.high],
            **({} if self.delay is None else {"delay": self.delay.plain()}),
            **({} if self.cubic is None else {"cubic": self.cubic.plain()}),
        }

    @property
    def low(self) -> float:
        """Lower end of the band, Hz."""
        return min(float(each.frequency[0]) for each in self.spectra) / (2 * np.pi)

    @property
    def high(self) -> float:
        """Upper end of the band, Hz."""
        return max(float(each.frequency[-1]) for each in self.spectra) / (2 * np.pi)


def fit_segments(segments: Sequence[Segment], unit: float | None = None) -> Fitted:
    """Maximum likelihood of K, C and B. `unit`: omega0, rad/s; by default the largest line.

    Raises ValueError, in one sentence, if the modes cannot be found.
    """
    segments = sorted(segments, key=lambda each: (each.digest, each.begin))  # the order of files has no effect
    first = segments[0]
    drives = 0 if first.force is None else first.force.shape[0]
    shape = Shape(len(first.axes), drives)
    searches = [[visible(row) for row in each.motion] for each in segments]
    bands = [first_band(each, one.interval) for each, one in zip(searches, segments, strict=True)]
    unit = unit or bands[0][2]
    low, high = min(each[0] for each in bands), max(each[1] for each in bands)
    # Until the decay is known, a record that is much longer than it is cut roughly.
    rough = [
        _shortened(each, ROUGH * clearest(one) * each.interval) for each, one in zip(segments, searches, strict=True)
    ]
    delays = DELAYS if drives else range(1)
    tried = [_started(shape, rough, unit, (low, high), each) for each in delays]
    # A delay by half a period more resembles a negative gain: each delay that is better than its neighbors is fitted.
    sums = [math.inf, *(each[0] for each in tried), math.inf]
    likely = [i for i in range(len(tried)) if sums[i + 1] <= min(sums[i], sums[i + 2])]
    fits = [_followed(shape, segments, unit, (low, high), delays[i], *tried[i][1:]) for i in likely]
    best = min(fits, key=_left)
    fit, springs = with_springs(shape, best.fit, best.spectra, best.segments, unit)
    return replace(best, fit=fit, cubic=springs)


def _followed(
    shape: Shape,
    segments: Sequence[Segment],
    unit: float,
    edges: tuple[float, float],
    delay: int,
    parameters: Array,
    noise: Array,
) -> Fitted:
    """The fit from this start and with this delay, in the band around its modes."""
    low, high = edges
    if shape.drives:
        segments = [delayed(each, delay) for each in segments]
    total = only_white(noise)
    whole: list[Spectrum] | None = None
    for i in range(BANDS):
        modes = poles(shape, parameters) * unit
        # A record that is much longer than its decay is cut: its end has only noise.
        slowest = LONGEST / max(float(np.min(-modes.real)), 1e-12 * unit)
        shortened = [_shortened(each, slowest) for each in segments]
        if whole is None or any(new is not old for new, old in zip(shortened, segments, strict=True)):
            segments, whole = shortened, [spectrum_of(each) for each in shortened]
        longest = max(each.length for each in segments)
        new = band(modes, longest, min(1 / each.interval for each in segments))
        spectra = [_wide_enough(each, *new) for each in whole]
        same = abs(new[0] - low) < 0.05 * (new[1] - new[0]) and abs(new[1] - high) < 0.05 * (new[1] - new[0])
        low, high = new
        last = same or i == BANDS - 1
        fit = maximize(shape, spectra, unit, parameters, total, rough=not last)
        parameters, total = fit.parameters, fit.thermal
        if last:
            break
    found = None
    if shape.drives:
        fit, spectra, found = fractional(shape, spectra, unit, fit, delay, segments)
    return Fitted(fit, shape, unit, tuple(spectra), tuple(segments), found)


def _left(fitted: Fitted) -> float:
    """Logarithm of what a fit leaves, summed over its channels."""
    return sum(float(np.log(np.mean(np.abs(each) ** 2, axis=0)).sum()) for each in fitted.fit.left)


def _started(
    shape: Shape, segments: Sequence[Segment], unit: float, edges: tuple[float, float], delay: int
) -> tuple[float, Array, Array]:
    """Sum of squares, first values and first noise, for this delay of the force, in samples."""
    if shape.drives:
        segments = [delayed(each, delay) for each in segments]
    whole = [spectrum_of(each) for each in segments]
    noise = np.stack([_first_noise(each) for each in whole])
    return *_start(shape, segments, whole, unit, edges, noise), noise


def _shortened(segment: Segment, longest: float) -> Segment:
    samples = math.ceil(longest / segment.interval)
    if segment.force is not None or samples > 0.9 * segment.motion.shape[1]:
        return segment
    return part(segment, 0, max(samples, 256))


def _wide_enough(one: Spectrum, low: float, high: float) -> Spectrum:
    """Bins of the band; of a short record enough for its transient and the parameters."""
    step = float(one.frequency[0])
    missing = 16 - int((high - low) / step)
    if missing > 0:
        low, high = low - missing * step / 2, high + missing * step / 2
    return one.between(low, high)


def _first_noise(one: Spectrum) -> Array:
    """Noise of each channel from the median of its bins; at least a millionth of the largest."""
    largest = np.sqrt((one.motion.real**2 + one.motion.imag**2).max(axis=0))
    middle = np.median(np.abs(spread(one.motion)), axis=0)
    return np.asarray(np.maximum(middle / np.sqrt(2 * np.log(2)), 1e-6 * largest))


def _start(
    shape: Shape,
    segments: Sequence[Segment],
    whole: Sequence[Spectrum],
    unit: float,
    edges: tuple[float, float],
    noise: Array,
) -> tuple[float, Array]:
    """Sum of squares and parameters of the best polished linear start, from whole records and from their beginnings."""
    within = [_wide_enough(each, *edges).thinned(MAX_START_BINS) for each in whole]
    found: list[tuple[float, Array]] = []
    for fraction in FRACTIONS if shape.drives == 0 else FRACTIONS[:1]:
        shorter = [part(each, 0, max(math.ceil(fraction * each.motion.shape[1]), 64)) for each in segments]
        spectra = (
            within
            if fraction == 1.0
            else [_wide_enough(spectrum_of(each), *edges).thinned(MAX_START_BINS) for each in shorter]
        )
        if min(len(each.frequency) for each in spectra) < MIN_START_BINS:
            continue
        scaled = [
            Spectrum(each.frequency, each.motion / deviation, each.force, each.interval, each.samples)
            for each, deviation in zip(spectra, noise, strict=True)
        ]
        ratio = noise[0] / noise[0, 0]
        if not np.allclose(noise / noise[:, :1], ratio, rtol=1e-9):
            scaled = [
                Spectrum(each.frequency, each.motion / (deviation[0] * ratio), each.force, each.interval, each.samples)
                for each, deviation in zip(spectra, noise, strict=True)
            ]
        try:
            guess = _unscaled(shape, linear_start(shape, scaled, unit), ratio)
            polished = search(shape, within, unit, guess, weights(only_white(noise)), POLISH)
        except np.linalg.LinAlgError:
            continue
        if np.isfinite(polished.squares):
            found.append((polished.squares, polished.parameters))
    if not found:
        raise ValueError(f"{segments[0].name}: no mode was found: is it a decay of at least a few periods?")
    return min(found, key=lambda each: each[0])


def _unscaled(shape: Shape, parameters: Array, ratio: Array) -> Array:
    """Parameters of the motion from those of the motion over the noise of its channels."""
    stiffness, damping, drive = shape.matrices(parameters)
    turn = np.outer(ratio, 1 / ratio)
    return np.concatenate([(stiffness * turn).ravel(), (damping * turn).ravel(), (drive * ratio[:, None]).ravel()])
