"""The noise terms of IEEE Std 952 in a spectrum: values, intervals, and limits of terms that are not observed.

Quantization Q, white noise N, flicker noise B and a random walk K have the two-sided density

    S(f) = (N² + B²/(2π f) + K² (h/(2 sin π f h))²) |H(f)|² + 4 Q²/h sin²(π f h),

and drift, as of a sensor that warms up, has 1/(f² + fc²)² with a corner frequency fc.

H is the sensor's response of first, second or fourth order, if visible, in discrete time with sampling interval h.
Sampled flicker noise is B²/(2π f) up to half the sampling rate or, as with fractional differences, B² h/(2 sin π f h),
depending on the filter before the sampling: both are tried. N, B and K, each at least 0, are always in the model; Q and
a response are included if they improve the likelihood by three standard deviations. The powers of a spectrum
(spectrum.py) are chi square with mean S, so that

    -2 log L = Σ ν (log S + P/S),    ν: degrees of freedom of a power P,

whose minimum gives the terms. Each interval is that of the profile likelihood: all values for which -2 log L, minimized
over the other terms, exceeds its minimum by at most the 95 % point of chi square, for any response or flicker shape
that is nearly as likely as the best.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, nnls
from scipy.stats import chi2, norm

from .spectrum import Spectrum

Array = NDArray[np.float64]

WHITE, FLICKER, WALK, QUANTIZATION, DRIFT = range(5)
CONFIDENCE = 0.95
TWO_SIDED = float(chi2.ppf(CONFIDENCE, 1))
DETECTED = 9.0  # gain of twice the log likelihood for a term to be observed: three standard deviations
EITHER = float(chi2.isf(chi2.sf(DETECTED, 1), 2))  # the same for two terms together
PLAUSIBLE = 1e-3  # smallest p-value of the residuals
MIN_OCTAVES = 4  # octaves of a fit
MIN_FREEDOM = 30.0  # degrees of freedom of a fit
CORNERS = (0.0, 2.0, 4.0, 8.0, 16.0)  # corner frequencies of drift: a warm-up shorter than the record
RESPONSES = (
    "first order",
    "first order, bilinear",
    "second order",
    "second order, bilinear",
    "fourth order",
    "fourth order, bilinear",
)
ROUNDING = 1e-30  # fraction of the largest power, below which a power counts as zero
LIKELIER = 1.5  # gain of twice the log likelihood by drift instead of K, above which K is not reported
MAX_RESPONSE_TIME = 5.0  # s, of a gyroscope
UNBOUNDED_RATIO = 1e3  # upper end of an interval over the power, above which it counts as unbounded


@dataclass(frozen=True)
class Response:
    """The sensor's response."""

    time: float = 0.0  # T, s; 0: not visible
    kind: str = RESPONSES[0]

    def gain(self, frequency: Array, interval: float) -> Array:
        """|H|² at these frequencies, in Hz."""
        if self.time == 0:
            return np.ones_like(frequency)
        if self.kind.endswith("bilinear"):
            tangent = 2 * np.tan(np.pi * frequency * interval) * self.time / interval
        else:
            sine = 2 * np.sin(np.pi * frequency * interval)
        if self.kind == "first order":
            keep = math.exp(-interval / self.time)  # from one sample to the next
            return np.asarray((1 - keep) ** 2 / ((1 - keep) ** 2 + keep * sine**2))
        if self.kind == "first order, bilinear":
            return np.asarray(1 / (1 + tangent**2))
        if self.kind == "second order":
            return np.asarray(1 / (1 + (sine * self.time / interval) ** 4))
        if self.kind == "second order, bilinear":
            return np.asarray(1 / (1 + tangent**4))
        if self.kind == "fourth order":
            return np.asarray(1 / (1 + (sine * self.time / interval) ** 8))
        return np.asarray(1 / (1 + tangent**8))


@dataclass(frozen=True)
class Shape:
    """Shape variants of the flicker and drift densities."""

    fractional: bool = False  # flicker noise is B² h/(2 sin π f h)
    corner: float = 0.0  # corner of drift, in units of the lowest frequency: an exponential warm-up is flat below it


@dataclass(frozen=True)
class Power:
    """N², B², K² or Q² with the ends of its interval; unless `seen`, it was not observed and `high` is its limit."""

    value: float
    low: float
    high: float
    seen: bool


@dataclass(frozen=True)
class Fit:
    """The terms fitted to the longest part of a spectrum that they explain; terms that were not tried are absent."""

    terms: dict[int, Power]
    response: Response
    frequency: tuple[float, float]  # lowest and highest frequency of the part, Hz
    whole: bool  # True if the part includes the lowest frequencies
    undecided: bool  # slow noise is present, but flicker noise and random walk cannot be distinguished
    drifts: bool = False  # the random walk could also be drift


class _Model:
    """Densities of a part of a spectrum for N, B, K, Q = 1, and their maximum-likelihood fit."""

    def __init__(self, spectrum: Spectrum, part: slice, terms: tuple[int, ...], kind: str | None, shape: Shape) -> None:
        self.frequency, self.power = spectrum.frequency[part], spectrum.power[part]
        self.freedom, self.interval = spectrum.freedom[part], spectrum.interval
        self.terms, self.kind, self.shape = terms, kind, shape
        self.unknowns = len(terms) + (kind is not None)
        self._plain = densities(spectrum, shape)[part][:, terms]
        self._behind = [i for i, term in enumerate(terms) if term != QUANTIZATION]
        smooth = np.exp(_smoothed(np.log(self.power), self.freedom))
        self._start = smooth
        self._root = np.sqrt(self.freedom)

    def columns(self, time: float) -> Array:
        """Densities for unit terms behind a response with this time constant: (bands, terms)."""
        if self.kind is None:
            return self._plain
        gain = Response(time, self.kind).gain(self.frequency, self.interval)
        columns = self._plain.copy(order="K")
        for i in self._behind:
            columns[:, i] *= gain
        return columns

    def score(self, density: Array) -> float:
        """-2 log L, up to a constant."""
        return float(self.freedom @ (np.log(density) + self.power / density))

    def best(
        self, start: tuple[Array, float] | None = None, fixed: tuple[int, float] | None = None
    ) -> tuple[float, Array, float]:
        """Minimum score with its powers and response time; `fixed`: a term and its power, held constant."""
        if start is None:
            times = [0.0] if self.kind is None else self._times()
            tries = [self._descend(None, time, fixed, rounds=4) for time in times]
            found = min(tries, key=lambda each: each[0])
            start = found[1], found[2]
        return self._descend(start[0], start[1], fixed, rounds=60)

    def _times(self) -> list[float]:
        shortest, longest = self.interval / 4, min(0.1 / float(self.frequency[0]), MAX_RESPONSE_TIME)
        return [float(t) for t in np.geomspace(shortest, max(longest, 4 * shortest), 14)]

    def _descend(
        self, powers: Array | None, time: float, fixed: tuple[int, float] | None, rounds: int
    ) -> tuple[float, Array, float]:
        """Fisher scoring: non-negative least squares, weighted with the previous density."""
        count = len(self.terms)
        free = [i for i in range(count) if fixed is None or i != fixed[0]]
        columns = self.columns(time)
        held = np.zeros(len(self.power)) if fixed is None else fixed[1] * columns[:, fixed[0]]
        if powers is None:
            density = self._start
            powers = np.zeros(count)
            now = math.inf
        else:
            powers = powers.copy()
            if fixed is not None:
                powers[fixed[0]] = fixed[1]
            density = columns @ powers
            if not (density > 0).all():
                density, now = self._start, math.inf
            else:
                now = self.score(density)
        for _ in range(rounds):
            weight = self._root / density
            matrix, wanted = columns[:, free] * weight[:, None], (self.power - held) * weight
            if self.kind is not None and now < math.inf:
                slope = self._slope(time, powers) * weight
                matrix = np.column_stack([matrix, slope, -slope])
            scale = np.sqrt((matrix**2).sum(axis=0))
            scale[scale == 0] = 1.0
            solved = nnls(matrix / scale, wanted)[0] / scale
            step = float(solved[len(free)] - solved[len(free) + 1]) if len(solved) > len(free) else 0.0
            step = min(max(step, -0.7), 0.7)
            target = powers.copy()
            target[free] = solved[: len(free)]
            if fixed is not None:
                target[fixed[0]] = fixed[1]
            size, before = 1.0, now
            for _ in range(12):
                trial = powers + size * (target - powers) if before < math.inf else target
                moved = self._within(time * math.exp(size * step))
                columns_there = self.columns(moved) if moved != time else columns
                there = columns_there @ trial
                if (there > 0).all() and (score := self.score(there)) < now:
                    powers, time, columns, density, now = trial, moved, columns_there, there, score
                    if fixed is not None:
                        held = fixed[1] * columns[:, fixed[0]]
                    break
                size /= 2
            if not now < before - 1e-7:
                break
        return now, powers, time

    def _within(self, time: float) -> float:
        if self.kind is None:
            return 0.0
        slowest = max(min(0.2 / float(self.frequency[0]), MAX_RESPONSE_TIME), self.interval)
        return min(max(time, self.interval / 16), slowest)

    def _slope(self, time: float, powers: Array) -> Array:
        """Derivative of the density with respect to the logarithm of the response time."""
        longer, shorter = self.columns(time * 1.01), self.columns(time / 1.01)
        return np.asarray((longer - shorter) @ powers / (2 * math.log(1.01)))

    @property
    def most(self) -> Array:
        """Upper limit of each power."""
        return np.asarray(np.min(self._start[:, None] / np.maximum(self.columns(0.0), 1e-300), axis=0))


Best = tuple[float, Array, float]


class _Candidate:
    """Models that differ only in the response or the flicker shape, each with its fit; best first."""

    def __init__(self, models: list[tuple[_Model, Best]]) -> None:
        least = min(best[0] for _, best in models)
        near = [each for each in models if each[1][0] <= least + DETECTED and _accounts(*each)]
        self.models = sorted(near, key=lambda each: each[1][0])

    @property
    def first(self) -> tuple[_Model, Best]:
        return self.models[0]

    @property
    def score(self) -> float:
        model, best = self.first
        return best[0] + DETECTED * model.unknowns

    def excess(self, term: int, value: float) -> float:
        """Increase of -2 log L if a power is set to this value."""
        at = [model.best((best[1], best[2]), (term, value))[0] for model, best in self.models]
        return min(at) - self.first[1][0]

    def power(self, term: int) -> Power:
        value = float(self.first[1][1][term])
        seen = value > 0 and self.excess(term, 0.0) >= DETECTED
        low, high = self._interval(term, TWO_SIDED)
        return Power(value, low if seen else 0.0, high, seen)

    def _interval(self, term: int, most: float) -> tuple[float, float]:
        """Ends of the values of a power that increase -2 log L by at most `most`."""
        model, best = self.first
        unit, at = float(model.most[term]), float(best[1][term])

        def beyond(logarithm: float) -> float:
            return self.excess(term, math.exp(logarithm)) - most

        low = 0.0
        if at > 1e-9 * unit and self.excess(term, 0.0) > most:
            below = at / 2
            while beyond(math.log(below)) < 0:
                below /= 2
            low = math.exp(brentq(beyond, math.log(below), math.log(at), xtol=1e-4))
        high = max(2 * at, 1e-3 * unit)
        while beyond(math.log(high)) < 0:
            high *= 2
            if high > UNBOUNDED_RATIO * max(unit, at):
                return low, math.inf
        start = max(at, 1e-9 * unit)
        while beyond(math.log(start)) > 0:  # rounding
            start /= 2
        return low, math.exp(brentq(beyond, math.log(start), math.log(high), xtol=1e-4))


def densities(spectrum: Spectrum, shape: Shape | None = None) -> Array:
    """Densities in a spectrum's bands for N, B, K, Q and drift = 1: (bands, terms)."""
    shape = shape or Shape()
    sine = 2 * np.sin(np.pi * spectrum.frequency * spectrum.interval)
    frequency = sine / spectrum.interval if shape.fractional else 2 * np.pi * spectrum.frequency
    corner = 2 * np.pi * shape.corner * spectrum.frequency[0]
    return np.column_stack(
        [
            np.ones_like(sine),
            spectrum.flicker / frequency,
            (spectrum.interval / sine) ** 2,
            sine**2 / spectrum.interval,
            1 / ((sine / spectrum.interval) ** 2 + corner**2) ** 2,
        ]
    )


def fit(spectrum: Spectrum, shortest: float = 0.0) -> Fit | None:
    """The terms fitted to the longest part of a spectrum that they explain.

    Among parts of equal length, the fit with the fewest unknowns wins, then the part with the lower frequencies.
    Frequencies whose half period is below `shortest`, s, are excluded. None if no part of four octaves fits.
    """
    largest = float(spectrum.power.max(initial=0.0))
    if not 0 < largest < math.inf:
        return None
    spectrum = replace(spectrum, power=np.maximum(spectrum.power, ROUNDING * largest))
    for parts in _parts(spectrum, shortest):
        found = [(candidate, part) for part in parts if (candidate := _candidate(spectrum, part)) is not None]
        if found:
            candidate, part = min(found, key=lambda each: (each[0].first[0].unknowns, each[1].start))
            return _described(spectrum, part, candidate)
    return None


def _parts(spectrum: Spectrum, shortest: float) -> Iterator[list[slice]]:
    """Lists of parts with the same number of octaves, longest first."""
    end = len(spectrum.frequency)
    if shortest > 0:
        end = int(np.searchsorted(spectrum.frequency, 0.5 / shortest, side="right"))
    if end < 2:
        return
    octave = np.log2(spectrum.frequency[:end] / spectrum.frequency[0])
    # Whole octaves from the lowest frequency up, then the remainder.
    whole = int(octave[-1])
    edges = [int(np.searchsorted(octave, k)) for k in range(whole + 1)] + [end]
    if octave[-1] - whole < 0.5:
        edges.pop(-2)
    count = len(edges) - 1
    for length in range(count, MIN_OCTAVES - 1, -1):
        parts = [slice(edges[first], edges[first + length]) for first in range(count - length + 1)]
        yield [part for part in parts if spectrum.freedom[part].sum() >= MIN_FREEDOM]


def _candidate(spectrum: Spectrum, part: slice) -> _Candidate | None:
    """The best candidate that explains the part, or None."""
    slow = (WHITE, FLICKER, WALK)
    kinds = [(slow, (None,)), ((*slow, QUANTIZATION), (None,)), (slow, RESPONSES)]
    tried = [(terms, of, _group(spectrum, part, terms, of)) for terms, of in kinds]
    known = [each for each in tried if each[2] is not None]
    best = [min(known, key=_score)] if known else tried
    # Drift is tried only if it can improve the best fit without it, or if nothing else fits.
    best += [((*terms, DRIFT), of, _group(spectrum, part, (*terms, DRIFT), of)) for terms, of, _ in best]
    return min((each for each in best if each[2] is not None), key=_score, default=(None, None, None))[2]


_Tried = tuple[tuple[int, ...], tuple[str | None, ...], _Candidate | None]


def _score(tried: _Tried) -> float:
    return math.inf if tried[2] is None else tried[2].score


def _group(spectrum: Spectrum, part: slice, terms: tuple[int, ...], kinds: Sequence[str | None]) -> _Candidate | None:
    """The models with these terms and response kinds that explain the part, or None."""
    cut = part.stop < len(spectrum.frequency)
    longest = 1 / float(spectrum.frequency[part.stop - 1])  # twice the shortest average that is left
    shapes = [Shape(fractional, corner) for fractional in (False, True) for corner in CORNERS]
    shapes = [
        shape
        for shape in shapes
        if (not shape.fractional or kinds == (None,)) and (shape.corner == 0 or DRIFT in terms)
    ]
    models = [_Model(spectrum, part, terms, kind, shape) for kind in kinds for shape in shapes]
    tried = [(model, model.best()) for model in models]
    tried = [each for each in tried if not cut or each[0].kind is None or each[1][2] <= longest]
    if not tried:
        return None
    candidate = _Candidate(tried)
    return candidate if candidate.models else None


def _accounts(model: _Model, best: tuple[float, Array, float]) -> bool:
    """True if the residuals are random: in each half octave, and in all together."""
    density = model.columns(best[2]) @ best[1]
    half = np.floor(2 * np.log2(model.frequency / model.frequency[0] * 1.0001)).astype(int)
    first = np.flatnonzero(np.diff(half, prepend=-1))
    freedom = np.add.reduceat(model.freedom, first)
    ratio = np.add.reduceat(model.freedom * model.power / density, first)
    below = chi2.cdf(ratio, freedom)
    tail = 2 * np.minimum(below, chi2.sf(ratio, freedom))
    deviations = norm.isf(np.maximum(tail, 1e-300) / 2)
    unknowns = int(np.count_nonzero(best[1])) + (model.kind is not None)
    all_together = chi2.sf(float(np.sum(deviations**2)), max(len(first) - unknowns, 1))
    return bool(all_together >= PLAUSIBLE and tail.min() * len(first) >= PLAUSIBLE)


def _described(spectrum: Spectrum, part: slice, candidate: _Candidate) -> Fit:
    model, best = candidate.first
    terms = {term: candidate.power(i) for i, term in enumerate(model.terms)}
    slow = 0.0
    if not terms[FLICKER].seen and not terms[WALK].seen:
        rest = tuple(term for term in model.terms if term not in (FLICKER, WALK))
        slow = _Model(spectrum, part, rest, model.kind, model.shape).best()[0] - best[0]
    drifts = False
    if terms[WALK].seen:
        drifts = DRIFT in terms and terms[DRIFT].seen
        if DRIFT not in terms:
            other = tuple(term for term in model.terms if term != WALK)
            drifting = _group(spectrum, part, (*other, DRIFT), (model.kind,))
            drifts = drifting is not None and drifting.first[1][0] < best[0] - LIKELIER
        if drifts:
            terms[WALK] = replace(terms[WALK], value=0.0, low=0.0, seen=False)
    frequency = spectrum.frequency[part]
    return Fit(
        terms,
        Response() if model.kind is None else Response(best[2], model.kind),
        (float(frequency[0]), float(frequency[-1])),
        part.start == 0,
        slow >= EITHER,
        drifts,
    )


def _smoothed(values: Array, freedom: Array) -> Array:
    kernel = np.ones(13)
    total = np.convolve(freedom, kernel, "same")
    return np.asarray(np.convolve(values * freedom, kernel, "same") / total)
