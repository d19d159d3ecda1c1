"""Inspection of a record before its noise is measured: samples and segments that are not sensor noise at rest.

The record is processed in chunks, in memory that does not grow with its length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ..arguments import number, signal
from .units import DEG_PER_S

Array = NDArray[np.float64]
Kind = Literal[
    "spike", "stuck", "repeated", "constant", "saturated", "noise", "motion", "jump", "steps", "drift", "vibration"
]

MAX_VALUE = 1e100  # squares of values must not overflow
OUTLIER_DEVIATIONS = 8.0  # robust standard deviations, exceeded by Gaussian noise once in 10^15 samples
ROBUST = 1.4826  # standard deviation of Gaussian noise over its median absolute deviation
BLOCKS = 64  # blocks whose noise is compared
FEW_BLOCKS = 16  # with fewer blocks their median is not representative
MIN_BLOCK = 32  # samples
CHUNK = 2**18  # samples processed at once
SAMPLED = 2**17  # samples in the histogram of values
HIDDEN_BELOW, INCREASED_BELOW = 0.6, 1.0  # converter steps: noise below the first is hidden, below the second increased
SETTLED_GROWTH = 1.15  # growth of differences when the lag doubles, below which they have reached the noise level
IRREGULAR = 0.5  # standard deviation of the gaps between repeats over their mean; less: the sensor is polled too often
MEDIAN_SAMPLES = 4096  # samples of a block used for a median
ROUNDING = 1e-14  # fraction of the largest value, below which a difference counts as zero
ANGLE_CORRELATION = -0.1  # lag-one correlation below which the angle was rounded, which hides no noise
MAX_REPEATED = 0.002  # fraction of samples that repeat the previous one
INNER, INNER_SHARE = 0.95, 0.7592 / 0.95  # trimmed fraction of squares, and its mean relative to all for normal noise
MIN_CHANGE = {"noise": 0.15, "motion": 0.5}  # change of the logarithm of a variance
SUBBLOCKS = 8  # their scatter gives the uncertainty of a block's noise
UNSTEADY, MIN_SPREAD = 1e-9, 0.1  # p-value of the spread of block variances, and smallest spread of their logarithm


@dataclass(frozen=True)
class Event:
    """Anything in a record other than the noise of a sensor at rest.

    >>> noise = np.random.default_rng(0).normal(size=10_000) * 0.002
    >>> noise[5000] = 1.0
    >>> print(fg.rate.inspect(noise, interval=0.01)[0].sentence)
    at 50 s the rate is 57.2 deg/s off
    """

    kind: Kind
    time: float  #: s from the beginning of the record
    end: float  #: s
    size: float  #: rad/s; for repeated samples their fraction
    spoils: bool  #: True if it invalidates the noise terms
    count: int = 1  #: samples, or segments

    @property
    def sentence(self) -> str:
        """Description with place and size."""
        span, size = f"from {_seconds(self.time)} to {_seconds(self.end)} s", _rate(self.size)
        count = f"{self.count:,} samples"
        if self.kind == "spike" and self.count == 1:
            return f"at {_seconds(self.time)} s the rate is {size} off"
        if self.kind == "steps" and not self.spoils:
            return f"the sensor's quantization step of {size} is as large as its noise and increases it"
        return {
            "spike": f"{count} {span} are outliers, by up to {size}",
            "stuck": f"{span} the rate is stuck at {size} for {count}",
            "repeated": f"{count}, {100 * self.size:.2g} % of all, repeat the previous one at irregular times, "
            "as after lost samples",
            "constant": f"{count} {span} are exactly {size}, as if that value marked lost samples",
            "saturated": f"{count} {span} are at the end of the range, {size}",
            "noise": f"{span} the noise from sample to sample, up to {size}, differs from the rest",
            "motion": f"{span} the rate moves, by up to {size}",
            "jump": f"at {_seconds(self.time)} s the mean jumps by {size}",
            "steps": f"the sensor's quantization step of {size} hides its noise",
            "vibration": f"an unsteady vibration of about {size} masks the noise",
            "drift": f"{span} the mean drifts by {size}, as in a warm-up; it is not counted as K",
        }[self.kind]


def _rate(value: float) -> str:
    return f"{DEG_PER_S.of(value):.3g} deg/s"


def _seconds(value: float) -> str:
    return f"{value:,.1f}" if value >= 1000 else f"{value:.4g}"


def inspect(values: Array, interval: float) -> tuple[Event, ...]:
    """Events in a record other than the noise of a sensor at rest; `values` (samples,) in rad/s, `interval` in s.

    Reported are outliers, segments stuck at one value, fill values for lost samples, saturation, periods of more noise
    or motion, jumps of the mean, and quantization steps larger than the noise.

    Raises TypeError for arguments that are not numbers, ValueError for another shape, a value that is not finite or
    above 1e100, or an `interval` that is not above 0.

    >>> fg.rate.inspect(np.random.default_rng(0).normal(size=10_000), interval=0.01)
    ()
    """
    record, interval = signal("values", values), number("interval", interval, above=0.0)
    if record.ndim != 1:
        raise ValueError(f"values has {record.ndim} dimensions: it must be (samples)")
    if not np.isfinite(record).all():
        at = int(np.argmin(np.isfinite(record)))
        raise ValueError(f"values is {record[at]} at sample {at}: all must be finite")
    if len(record) and max(float(record.max()), -float(record.min())) > MAX_VALUE:
        at = int(np.argmax(np.abs(record)))
        raise ValueError(f"values is {record[at]:g} at sample {at}: all must be below {MAX_VALUE:g}")
    if len(record) < 2 * MIN_BLOCK:
        return ()
    look = _Inspection(np.asarray(record, dtype=np.float64), interval)
    if look.scale == 0:
        return ()
    searches: list[Callable[[], Event | None]] = [
        look.spikes,
        look.stuck,
        look.saturated,
        look.constant,
        look.repeated,
        look.noisy,
        look.moved,
        look.jumped,
        look.steps,
    ]
    return tuple(found for search in searches if (found := search()) is not None)


def drift(records: Array, interval: float) -> Event:
    """The drift event with the largest change of the block means; of several records, the largest."""
    size = max(records.shape[1] // BLOCKS, 1)
    whole = records[:, : records.shape[1] // size * size]
    spans = np.ptp(whole.reshape(len(records), -1, size).mean(axis=2), axis=1)
    return Event("drift", 0.0, records.shape[1] * interval, float(spans.max()), spoils=False)


def _line(block: Array) -> tuple[float, float]:
    """Center and slope of a robust line through a block: through the medians of its thirds."""
    stride = _stride(block)
    few = block[::stride]
    third = len(few) // 3
    first, last = float(np.median(few[:third])), float(np.median(few[-third:]))
    return float(np.median(few)), (last - first) / (len(few) - third) / stride


def _stride(block: Array) -> int:
    """n: every n-th sample of the block is used for a median."""
    return max(len(block) // MEDIAN_SAMPLES, 1)


def _spread(block: Array) -> float:
    """Variance about the least-squares line."""
    count = len(block)
    at = np.arange(count) - (count - 1) / 2
    square = count * (count**2 - 1) / 12  # sum of squares of `at`
    # Not a product of BLAS, whose threads would wake for each block and then wait.
    slope = float(np.einsum("i,i", at, block)) / square
    return max(float(block.var()) - slope**2 * square / count, 0.0)


def _inner(block: Array) -> float:
    """Half the mean square of differences between samples, from the smallest 95 %, corrected for normal noise."""
    stride = _stride(block)
    square = np.square(block[1::stride] - block[: len(block) - 1 : stride])
    kept = int(INNER * len(square))
    return float(np.mean(np.partition(square, kept)[:kept])) / 2 / INNER_SHARE


class _Inspection:
    def __init__(self, record: Array, interval: float) -> None:
        self.record, self.interval = record, interval
        self.block = max(len(record) // BLOCKS, MIN_BLOCK)
        self.count = len(record) // self.block
        blocks = [record[i * self.block : (i + 1) * self.block] for i in range(self.count)]
        self.means = np.array([float(block.mean()) for block in blocks])
        self.lines = [_line(block) for block in blocks]
        self.variances = np.array([_spread(block) for block in blocks])
        self.changes = np.array([float(np.mean(np.square(np.diff(block)))) / 2 for block in blocks])
        self.uncertain = self._uncertain(blocks)
        near = [
            float(np.median(np.abs(b - line)[:: _stride(b)])) for b, line in zip(blocks, self._through(), strict=True)
        ]
        inner = math.sqrt(float(np.median([_inner(block) for block in blocks])))
        self.rounding = ROUNDING * max(abs(float(record.min())), abs(float(record.max())))
        self.step, self.runs = self._differences()
        self.equal = int(self.runs[:, 1].sum())
        coarse = HIDDEN_BELOW * self.step if inner < INCREASED_BELOW * self.step else 0.0
        self.scale = max(ROBUST * float(np.median(near)), inner, coarse)
        self.far, self.off = self._far()
        self._compare(blocks)
        self.typical = math.sqrt(float(np.median(self.changes)))  # standard deviation of white noise

    def _uncertain(self, blocks: list[Array]) -> float:
        """Standard deviation of the logarithm of a block's noise, from the scatter of its subblocks."""
        size = (self.block - 1) // SUBBLOCKS
        if size < 2:
            return math.inf
        found = []
        for block in blocks:
            change = np.square(np.diff(block))[: size * SUBBLOCKS].reshape(SUBBLOCKS, size).mean(axis=1)
            found.append(float(np.var(np.log(np.maximum(change, 1e-300)), ddof=1)))
        return math.sqrt(float(np.median(found)) / SUBBLOCKS)

    def _through(self) -> Iterator[Array]:
        return (self._through_one(i, self.block) for i in range(self.count))

    def _through_one(self, i: int, length: int) -> Array:
        middle, slope = self.lines[i]
        return np.asarray(middle + slope * (np.arange(length) - (self.block - 1) / 2))

    def _far(self) -> tuple[NDArray[np.int64], Array]:
        """Samples far from the line through their block, unless the block has many, and their distances."""
        places, sizes = [], []
        for i in range(self.count):
            begin = i * self.block
            part = self.record[begin : begin + self.block if i + 1 < self.count else None]
            off = part - self._through_one(i, len(part))
            far = np.flatnonzero(np.abs(off) > OUTLIER_DEVIATIONS * self.scale)
            if len(far) <= len(part) / 4:
                places.append(begin + far)
                sizes.append(off[far])
        return np.concatenate(places), np.concatenate(sizes)

    def _compare(self, blocks: list[Array]) -> None:
        """Means and variances of the blocks without those samples: each sample is reported in one event only."""
        for i in np.unique(np.minimum(self.far // self.block, self.count - 1)):
            block = blocks[i].copy()
            inside = self.far[(self.far >= i * self.block) & (self.far < (i + 1) * self.block)] - i * self.block
            block[inside] = self._through_one(int(i), len(block))[inside]
            self.means[i], self.variances[i] = block.mean(), _spread(block)
            self.changes[i] = np.mean(np.square(np.diff(block))) / 2

    def _differences(self) -> tuple[float, NDArray[np.int64]]:
        """Smallest nonzero difference between successive samples, and runs of equal ones: (first, repeats)."""
        least, firsts, lengths = math.inf, [], []
        for begin, part in self._parts():
            change = np.abs(np.diff(part))
            least = min(least, float(np.min(change, where=change > self.rounding, initial=math.inf)))
            ends = np.diff(np.concatenate([[0], (change <= self.rounding).astype(np.int8), [0]]))
            first, end = np.flatnonzero(ends == 1), np.flatnonzero(ends == -1)
            firsts.append(begin + first)
            lengths.append(end - first)
        runs = np.column_stack([np.concatenate(firsts), np.concatenate(lengths)])
        # A run that continues in the next chunk is one run.
        joined = np.flatnonzero(runs[:-1].sum(axis=1) == runs[1:, 0])
        for i in joined[::-1]:
            runs[i, 1] += runs[i + 1, 1]
        runs = np.delete(runs, joined + 1, axis=0)
        return (0.0 if math.isinf(least) else least), runs

    def _parts(self) -> Iterator[tuple[int, Array]]:
        """Chunks that overlap by one sample, with the index of the first sample."""
        for begin in range(0, len(self.record) - 1, CHUNK):
            yield begin, self.record[begin : begin + CHUNK + 1]

    def _event(self, kind: Kind, first: int, last: int, size: float, *, spoils: bool = True, count: int = 1) -> Event:
        return Event(kind, first * self.interval, last * self.interval, size, spoils, count)

    # -- Samples ---------------------------------------------------------------------------------------------------

    def spikes(self) -> Event | None:
        """Samples far from the line through their block."""
        if not len(self.far):
            return None
        size = float(self.off[np.argmax(np.abs(self.off))])
        return self._event("spike", int(self.far[0]), int(self.far[-1]), size, count=len(self.far))

    def stuck(self) -> Event | None:
        """A segment of one value, longer than expected by chance."""
        if not len(self.runs):
            return None
        share = min(self.equal / (len(self.record) - 1), 1 - 1e-9)
        usual = 3 * math.log(len(self.record)) / -math.log(share)
        first, repeats = map(int, self.runs[np.argmax(self.runs[:, 1])])
        others = np.sort(self.runs[:, 1])[:-1]
        if repeats < 10 + usual or (
            len(others) > 20 and repeats < OUTLIER_DEVIATIONS * float(np.quantile(others, 0.9))
        ):
            return None
        return self._event("stuck", first, first + repeats, float(self.record[first]), count=repeats + 1)

    def saturated(self) -> Event | None:
        """Many samples at the maximum or at the minimum."""
        for sign in (1.0, -1.0):
            edge = sign * float((sign * self.record).max())
            count = int(np.count_nonzero(self.record == edge))
            if count < 5:
                continue
            inner = sign * float(np.max(sign * self.record, where=self.record != edge, initial=-math.inf))
            if count > 3 * int(np.count_nonzero(self.record == inner)) + 3 and math.isfinite(inner):
                at = np.flatnonzero(self.record == edge)
                return self._event("saturated", int(at[0]), int(at[-1]), edge, count=count)
        return None

    def constant(self) -> Event | None:
        """A value far more frequent than its neighbors suggest, in more than one segment."""
        stride = max(len(self.record) // SAMPLED, 1)
        values, counts = np.unique(self.record[::stride], return_counts=True)
        first = np.flatnonzero(np.diff(values, prepend=-math.inf) > self.rounding)
        values, counts = values[first], np.add.reduceat(counts, first)
        if len(values) < 7:
            return None
        log = np.log(counts + 0.5)
        expected = np.exp((4 * (log[1:-3] + log[3:-1]) - log[:-4] - log[4:]) / 6)  # exact for a normal distribution
        excess = (counts[2:-2] - 1.3 * expected - 5) / np.sqrt(expected)
        most = 2 + int(np.argmax(excess))
        alike = min(self.typical**2 / max(float(np.median(self.variances)), 1e-300), 1.0)  # expected share of repeats
        if excess[most - 2] * math.sqrt(alike) < OUTLIER_DEVIATIONS:
            return None
        at = np.flatnonzero(np.abs(self.record - values[most]) <= self.rounding)
        if self.equal and len(at) - 1 <= int(self.runs[:, 1].max()):
            return None  # one segment
        return self._event("constant", int(at[0]), int(at[-1]), float(values[most]), count=len(at))

    def repeated(self) -> Event | None:
        """Samples that repeat the previous one at irregular times, in a record with fine quantization."""
        share = self.equal / (len(self.record) - 1)
        if share < MAX_REPEATED or len(self.runs) < 20 or 20 * self.step > self.typical:
            return None
        gaps = np.diff(self.runs[:, 0])
        if float(gaps.std()) < IRREGULAR * float(gaps.mean()):
            return None
        return self._event("repeated", int(self.runs[0, 0]), int(self.runs[-1].sum()), share, count=self.equal)

    # -- Segments --------------------------------------------------------------------------------------------------

    def noisy(self) -> Event | None:
        """Blocks whose noise differs from the median, or varies too much from block to block."""
        return self._unlike("noise", self.changes, both=True) or self._unsteady()

    def _unsteady(self) -> Event | None:
        """Noise that varies over much of the record."""
        if self.count < FEW_BLOCKS or not 0 < self.uncertain < math.inf:
            return None
        logarithms = np.log(np.maximum(self.changes, 1e-300))
        spread = float(np.std(logarithms))
        # The few subblocks determine the standard deviation to a third.
        chance = chi2.sf(self.count * (spread / (1.3 * self.uncertain)) ** 2, self.count - 1)
        if spread < MIN_SPREAD or chance > UNSTEADY:
            return None
        low, high = np.quantile(logarithms, [0.1, 0.9])
        at = np.flatnonzero(logarithms > (low + high) / 2)
        first, last = int(at[0]) * self.block, (int(at[-1]) + 1) * self.block
        size = math.sqrt(2 * float(self.changes[at].max()))
        return self._event("noise", first, last, size, count=len(at))

    def moved(self) -> Event | None:
        """Blocks with far more variance than the median."""
        return self._unlike("motion", self.variances, both=False)

    def _unlike(self, kind: Literal["noise", "motion"], variances: Array, *, both: bool) -> Event | None:
        if self.count < FEW_BLOCKS:
            return None
        logarithms = np.log(np.maximum(variances, 1e-300))
        off = logarithms - np.median(logarithms)
        most = max(OUTLIER_DEVIATIONS * ROBUST * float(np.median(np.abs(off))), MIN_CHANGE[kind])
        at = np.flatnonzero((np.abs(off) if both else off) > most)
        if not len(at):
            return None
        worst = int(at[np.argmax(np.abs(off[at]))])
        first, last = int(at[0]) * self.block, (int(at[-1]) + 1) * self.block
        size = math.sqrt(2 * variances[worst])
        if kind == "motion":
            size = float(np.max(np.abs(self.record[first:last] - np.median(self.means))))
        return self._event(kind, first, last, size, count=len(at))

    def jumped(self) -> Event | None:
        """A change of the mean from one block to the next, much larger than elsewhere and unlike a warm-up."""
        if self.count < FEW_BLOCKS:
            return None
        change = np.diff(self.means)
        size = np.abs(change - np.median(change))
        worst = int(np.argmax(size))
        # A jump inside a block makes two differences large; a warm-up makes many large.
        around = np.concatenate([size[max(worst - 3, 0) : max(worst - 1, 0)], size[worst + 2 : worst + 4]])
        least = OUTLIER_DEVIATIONS * max(ROBUST * float(np.median(size)), self.typical / math.sqrt(self.block))
        if size[worst] < max(least, 4 * float(around.max(initial=0.0))):
            return None
        at = (worst + 1) * self.block
        return self._event("jump", at, at, float(change[worst]))

    # -- The converter ---------------------------------------------------------------------------------------------

    def steps(self) -> Event | None:
        """Quantization steps that hide the noise or increase it."""
        if (
            self.typical >= INCREASED_BELOW * self.step
            or 1 - self.typical**2 / max(float(np.median(self.variances)), 1e-300) < ANGLE_CORRELATION
        ):
            return None
        lag, apart = 1, self.typical
        while apart < HIDDEN_BELOW * self.step:
            # Behind a filter successive samples differ little, although the noise may span several steps.
            lag *= 2
            if 40 * lag > len(self.record):
                return self._event("steps", 0, len(self.record) - 1, self.step)
            apart = self._apart(lag)
        if lag == 1:
            return self._event("steps", 0, len(self.record) - 1, self.step, spoils=False)
        while (further := self._apart(2 * lag)) > SETTLED_GROWTH * apart:  # drift does not settle
            lag, apart = 2 * lag, further
            if 80 * lag > len(self.record):
                return self._event("steps", 0, len(self.record) - 1, self.step)
        return self._event("steps", 0, len(self.record) - 1, self.step, spoils=False) if apart < self.step else None

    def _apart(self, lag: int) -> float:
        """RMS of differences between samples `lag` apart, divided by the square root of 2."""
        stride = max((len(self.record) - lag) // SAMPLED, 1)
        change = self.record[lag::stride] - self.record[: len(self.record) - lag : stride]
        return float(np.std(change)) / math.sqrt(2)
