"""Faults of records that the samples show: dead channels, clipping, converter steps, a drive before the decay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from .outliers import without_outliers
from .records import Segment, check_length, part
from .spectra import VISIBLE, visible

Array = NDArray[np.float64]

LOOKED_AT = 200_000  # samples of which the converter's step is determined
FEW_LEVELS = 0.95  # levels over samples: below it a converter may be visible
BLOCKS = 200  # blocks in the envelope
MIN_CLIPPED = 3  # samples
NEAR = 12  # blocks on each side of a step in the slope of the envelope
SHARP = 6.0  # times the scatter of the envelope: a smaller step is not one
FOLDED = 0.48  # times the sampling rate: a line above may be an alias
COARSE_STEPS, COARSE_NOISE = 500.0, 0.3  # amplitude and noise in steps, below which rounding is not white


def prepared(segment: Segment) -> tuple[Segment, list[str]]:
    """The segment without its spoiled beginning, with the converter's steps, and notes.

    Raises ValueError, in one sentence, for a record that shows no motion.
    """
    check_length(segment)
    notes: list[str] = []
    for axis, row in zip(segment.axes, segment.motion, strict=True):
        if np.ptp(row) == 0:
            raise ValueError(f"{segment.name}: only an offset is in {axis}: is it coupled, is the unit right?")
    segment, more = _without_idle_drives(segment)
    notes += more
    steps = tuple(step_of(row) for row in segment.motion)
    segment, more = _after_clipping(segment, steps)
    notes += more
    # Only at its beginning can a record have a drive: not after a gap, nor after clipping, which is of the decay.
    if segment.force is None and segment.begin == 0.0:
        segment, more = _after_drive(segment)
        notes += more
    check_length(segment)
    segment, more = without_outliers(segment)
    notes += more
    for axis, row, step in zip(segment.axes, segment.motion, steps, strict=True):
        if step:
            unit = segment.units[segment.axes.index(axis)]
            bits = math.ceil(math.log2(np.ptp(row) / step + 1))
            notes.append(
                f"{axis} has steps of {f'{step:.3g} {unit}'.rstrip()}, as of a converter with {bits} bits in use"
            )
        if step and np.abs(row - row.mean()).max() < COARSE_STEPS * step and _floor(row) < COARSE_NOISE * step:
            notes.append(
                f"{axis} has only {np.ptp(row) / step:.0f} steps of the converter and less noise than {COARSE_NOISE:g} "
                "steps: rounding is not random; use a smaller range"
            )
    return replace(segment, step=steps), [f"{segment.name}: {note}" for note in notes]


def _without_idle_drives(segment: Segment) -> tuple[Segment, list[str]]:
    """The segment without drives whose force is constant: what they would move is not seen."""
    if segment.force is None:
        return segment, []
    moves = [bool(np.ptp(row) > 0) for row in segment.force]
    if all(moves):
        return segment, []
    idle = [f"force_{axis}" for axis, used in zip(segment.drives, moves, strict=True) if not used]
    drives = tuple(axis for axis, used in zip(segment.drives, moves, strict=True) if used)
    segment = replace(segment, force=segment.force[moves] if drives else None, drives=drives)
    return segment, [f"{' and '.join(idle)} {'is' if len(idle) == 1 else 'are'} constant, and not used"]


def step_of(row: Array) -> float:
    """The converter's step, or 0 if the values have no common step."""
    levels = np.unique(row[:LOOKED_AT])
    if not 2 < len(levels) < FEW_LEVELS * min(len(row), LOOKED_AT):
        return 0.0
    apart = np.diff(levels)
    least = float(apart[apart > 1e-9 * np.ptp(levels)].min(initial=np.inf))
    if not np.isfinite(least):
        return 0.0
    step = least
    for _ in range(3):  # rounded text: refine over all levels
        counts = np.round((levels - levels[0]) / step)
        step = float(counts @ (levels - levels[0]) / (counts @ counts))
    off = np.abs((levels - levels[0]) / step - np.round((levels - levels[0]) / step))
    return step if float(off.max()) < 0.05 else 0.0


def _after_clipping(segment: Segment, steps: tuple[float, ...]) -> tuple[Segment, list[str]]:
    """The record after the last clipped sample, and a note."""
    last, notes = 0, []
    for axis, row, step in zip(segment.axes, segment.motion, steps, strict=True):
        clipped = _clipped(row, step)
        if np.count_nonzero(clipped) > MIN_CLIPPED:
            end = int(np.flatnonzero(clipped)[-1]) + 1
            level = float(np.abs(row[clipped]).max())
            until = segment.begin + end * segment.interval
            notes.append(
                f"{axis} clips at {level:.4g} {segment.units[segment.axes.index(axis)]}".rstrip()
                + f" in {np.count_nonzero(clipped)} samples until {until:.4g} s: the record is used from there"
            )
            last = max(last, end)
    if segment.motion.shape[1] - last < 64 and last:
        raise ValueError(f"{segment.name}: {notes[0].partition(':')[0]}, the end of the record: use a larger range")
    return (part(segment, last), notes) if last else (segment, notes)


def _clipped(row: Array, step: float) -> NDArray[np.bool_]:
    """Samples at the largest or smallest value, if they are more than a motion that is not clipped has there.

    Values without steps are equal only by clipping. With a converter, a sine stays within a step of its crest for a
    while: only longer runs count.
    """
    longest = 0
    if step:
        amplitude = float(np.abs(row - row.mean()).max())
        crest = np.arccos(1 - min(2 * step / amplitude, 2.0)) / np.pi / _line(row)
        longest = 2 + int(np.ceil(1.5 * crest))
    clipped = np.zeros(len(row), dtype=bool)
    for extreme in (row.max(), row.min()):
        at = np.concatenate([[False], row == extreme, [False]])
        edges = np.flatnonzero(at[1:] != at[:-1])
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if end - begin > longest:
                clipped[begin:end] = True
    return clipped


def _line(row: Array) -> float:
    """The largest line, in cycles a sample."""
    spectrum = np.abs(fft.rfft(row - row.mean()))
    return max(int(np.argmax(spectrum)), 1) / len(row)


def _after_drive(segment: Segment) -> tuple[Segment, list[str]]:
    """A decay without the part before it, in which the drive was still on: the last step in the envelope's slope."""
    samples = segment.motion.shape[1]
    size = samples // BLOCKS
    cycles = max(map(_line, segment.motion))
    if size < 2 / cycles:
        size = int(np.ceil(2 / cycles))
    count = samples // size
    if count < 40:
        return segment, []
    level = segment.motion - segment.motion.mean(axis=1, keepdims=True)
    power = (level[:, : count * size].reshape(len(level), count, size) ** 2).mean(axis=2)
    floor = np.median(power[:, -max(count // 20, 2) :], axis=1, keepdims=True)
    envelope = 0.5 * np.log(np.maximum((power / power.max(axis=1, keepdims=True)).sum(axis=0), 1e-300))
    clear = (power > 30 * floor).any(axis=0)
    useful = int(np.flatnonzero(~clear)[0]) if not clear.all() and clear[0] else count
    knee = _knee(envelope[: max(useful, 20)])
    if knee is None:
        return segment, []
    begin = (knee + 1) * size
    at = segment.begin + begin * segment.interval
    return part(segment, begin), [
        f"the drive is on until {at:.4g} s: the decay is used from there; --from overrides it (begin in Python)"
    ]


def _knee(envelope: Array) -> int | None:
    """The block at which a constant or growing envelope begins to decay, or None."""
    blocks = np.arange(len(envelope), dtype=float)
    best: tuple[float, int] | None = None
    for k in range(4, len(envelope) - NEAR):
        before = _line_fit(blocks[max(k - NEAR, 0) : k], envelope[max(k - NEAR, 0) : k])
        after = _line_fit(blocks[k : k + NEAR], envelope[k : k + NEAR])
        scatter = math.sqrt((before[1] + after[1]) / (2 * NEAR - 4))
        whole = _line_fit(blocks[:k], envelope[:k])[0]
        falls = after[0] < 0 and min(before[0], whole) > 0.2 * after[0]
        turn = before[0] - after[0]
        if falls and turn * NEAR > max(SHARP * scatter, 0.02) and (best is None or turn > best[0]):
            best = turn, k
    return None if best is None else best[1]


def _line_fit(x: Array, y: Array) -> tuple[float, float]:
    """Slope and the sum of squares of the residual."""
    level, about = x - x.mean(), y - y.mean()
    slope = float(level @ about / (level @ level))
    rest = about - slope * level
    return slope, float(rest @ rest)


def check_motion(segments: Sequence[Segment]) -> None:
    """Raises ValueError if a pick-off moves in none of these records, or if the mode's frequency may be folded."""
    for i, axis in enumerate(segments[0].axes):
        searches = [(each, visible(each.motion[i])) for each in segments]
        segment, best = max(searches, key=lambda each: float(each[1].power.max()))
        largest, line = float(best.power.max()), float(best.cycles[best.peak])
        if largest < VISIBLE:
            raise ValueError(
                f"{segment.name}: {axis} never exceeds its noise ({np.sqrt(largest):.2g} times at "
                f"{line / segment.interval:.6g} Hz): one axis is dead or was not excited; excite both, or leave the "
                "column out"
            )
        if line > FOLDED:
            raise ValueError(
                f"{segment.name}: the largest line is at {line:.2f} of the sampling rate: the mode may be folded; "
                "sample faster"
            )


def _floor(row: Array) -> float:
    """Noise of a sample, from the median of all bins."""
    power = np.abs(fft.rfft(row - row.mean())) ** 2
    return float(np.sqrt(np.median(power) / np.log(2) / len(row)))
