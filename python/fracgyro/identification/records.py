"""Records of a bench: their description by the user, and the segments and sweeps that the fits work on."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import number, pair, short, signal

Array = NDArray[np.float64]

AXES = ("x", "y")
MIN_SAMPLES = 64
MIN_FREQUENCIES = 12


@dataclass(frozen=True)
class State:
    """State of the device during a record. `rate`, rad/s, of the turntable; `bias`, V; `temperature`, K."""

    rate: float | None = None
    bias: float | None = None
    temperature: float | None = None

    def checked(self, name: str) -> State:
        """The state with floats. Raises ValueError or TypeError for anything else."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        return State(**{key: None if each is None else number(f"{name}: {key}", each) for key, each in given.items()})


@dataclass(frozen=True)
class Record:
    """A record in arrays: the motion of both pick-offs, or of one, at even times.

    `x`, `y`: (samples,), in any unit, the same for both, or None; `interval`: time between samples, s; `force`:
    (2, samples), or (1, samples) of the x drive only, the force that acts from each sample to the next, or None for a
    free decay; `rate`, rad/s, `bias`, V, `temperature`, K: the state of the device, if known; `name`: for messages and
    comments.

    >>> time = np.arange(4000) / 50e3
    >>> noise = 1e-3 * np.random.default_rng(0).normal(size=4000)
    >>> x = np.exp(-20 * time) * np.cos(2 * np.pi * 4000 * time) + noise
    >>> found = fg.identify([fg.identify.Record(x, interval=2e-5)])
    >>> abs(found["frequency_1"].value - 4000) < 0.1
    True
    """

    x: Any = None
    y: Any = None
    interval: float = 1.0
    force: Any = None
    rate: float | None = None
    bias: float | None = None
    temperature: float | None = None
    name: str = "record"


@dataclass(frozen=True)
class Decay:
    """A file with a decay or a forced record, and what the file does not say.

    `rate`, rad/s, `bias`, V, `temperature`, K: the state of the device, if known; `sampling`: Hz, for a file without
    times; `begin`, `end`: part of the record, s from its first sample; `columns`: names or numbers of columns, as in
    {"x": "CH1", "y": "#3"}. docs/identify.md describes the columns.

    >>> fg.identify.Decay("ring_x.csv", rate=0.0).path
    'ring_x.csv'
    """

    path: str | os.PathLike[str]
    rate: float | None = None
    bias: float | None = None
    temperature: float | None = None
    sampling: float | None = None
    begin: float | None = None
    end: float | None = None
    columns: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Sweep:
    """A file with the steady response over frequency, and the state of the device, as in `Decay`.

    >>> fg.identify.Sweep("sweep.csv", bias=5.0).bias
    5.0
    """

    path: str | os.PathLike[str]
    rate: float | None = None
    bias: float | None = None
    temperature: float | None = None
    columns: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Segment:
    """A part of a record without gaps. `motion`: (axes, samples); `force`: (drives, samples), or None.

    `axes`, `drives`: of the rows of motion and force; `begin`: s from the first sample of the record; `step`: of the
    converter of each pick-off, 0 without one; `units`: of each pick-off; `before`: the force one sample earlier.
    """

    name: str
    motion: Array
    force: Array | None
    interval: float
    axes: tuple[str, ...]
    drives: tuple[str, ...]
    state: State
    units: tuple[str, ...]
    begin: float = 0.0
    step: tuple[float, ...] = ()
    digest: str = ""
    before: Array | None = None

    @property
    def length(self) -> float:
        return int(self.motion.shape[1]) * self.interval


@dataclass(frozen=True)
class Response:
    """A sweep. `values`: (frequencies, axes, drives), complex; `frequency`: Hz, in the order of the file."""

    name: str
    frequency: Array
    values: NDArray[np.complex128]
    axes: tuple[str, ...]
    drives: tuple[str, ...]
    state: State
    digest: str = ""


def of_arrays(record: Record) -> Segment:
    """The segment of a record in arrays. Raises TypeError or ValueError, in one sentence, for an invalid one."""
    name = record.name
    interval = number(f"{name}: interval", record.interval, above=0.0)
    given = {axis: getattr(record, axis) for axis in AXES if getattr(record, axis) is not None}
    if not given:
        raise ValueError(f"{name} has neither x nor y: give the motion of at least one pick-off")
    rows = [np.asarray(signal(f"{name}: {axis}", each), dtype=float) for axis, each in given.items()]
    for axis, row in zip(given, rows, strict=True):
        if row.ndim != 1 or len(row) != len(rows[0]):
            raise ValueError(f"{name}: {axis} has the shape {row.shape}: it must be one row of samples, as long as x")
        if not np.isfinite(row).all():
            at = int(np.flatnonzero(~np.isfinite(row))[0])
            raise ValueError(f"{name}: {axis}[{at}] is {row[at]}: it must be a finite number")
    force = None
    if record.force is not None:
        force = np.asarray(signal(f"{name}: force", record.force), dtype=float)
        if force.ndim != 2 or force.shape[1] != len(rows[0]) or not 1 <= force.shape[0] <= 2:
            raise ValueError(f"{name}: force has the shape {force.shape}: it must be (1 or 2, {len(rows[0])})")
        if not np.isfinite(force).all():
            raise ValueError(f"{name}: force is not finite everywhere: it must have finite numbers")
    state = State(record.rate, record.bias, record.temperature).checked(name)
    motion = np.stack(rows)
    drives = AXES[: 0 if force is None else len(force)]
    return Segment(
        name, motion, force, interval, tuple(given), drives, state, ("",) * len(rows), digest=digest(motion, force)
    )


def digest(*arrays: Array | None) -> str:
    """SHA-256 of arrays, which orders records independently of the order in which they are given."""
    found = hashlib.sha256()
    for each in arrays:
        found.update(b"none" if each is None else np.ascontiguousarray(each).tobytes())
    return found.hexdigest()


def check_length(segment: Segment) -> None:
    """Raises ValueError if a segment is too short."""
    samples = segment.motion.shape[1]
    if samples < MIN_SAMPLES:
        raise ValueError(f"{segment.name} has {samples} samples: it must have at least {MIN_SAMPLES}")


def part(segment: Segment, begin: int, end: int | None = None) -> Segment:
    """The samples from `begin` to `end` of a segment."""
    values = {each.name: getattr(segment, each.name) for each in fields(segment)}
    values["motion"] = segment.motion[:, begin:end]
    values["force"] = None if segment.force is None else segment.force[:, begin:end]
    values["before"] = None if segment.before is None else segment.before[:, begin:end]
    values["begin"] = segment.begin + begin * segment.interval
    return Segment(**values)


Given = Record | Decay | Sweep | str | os.PathLike[str] | tuple[str | os.PathLike[str], Mapping[str, Any]]


def described(given: Given | Sequence[Given]) -> list[Record | Decay | Sweep]:
    """Records as classes: a path is a `Decay`, or a `Sweep` if the file has frequencies; so is (path, settings)."""
    if isinstance(given, str | os.PathLike | Record | Decay | Sweep):
        return described([given])
    if not isinstance(given, Sequence) or not given:
        raise TypeError(f"records is {short(given)}: it must be a list of files or records")
    found: list[Record | Decay | Sweep] = []
    for each in given:
        if isinstance(each, Record | Decay | Sweep):
            found.append(each)
        elif isinstance(each, str | os.PathLike):
            found.append(Decay(each))
        elif isinstance(each, tuple) and len(each) == 2 and isinstance(each[1], Mapping):
            known = {field.name for field in fields(Decay)} - {"path"}
            for key in each[1]:
                if key not in known:
                    raise ValueError(f"{key} of {each[0]} is not a setting: known are {', '.join(sorted(known))}")
            found.append(Decay(each[0], **each[1]))
        else:
            raise TypeError(f"records has {short(each)}: it must have files, (file, settings) or records")
    return found


def finite_pair(name: str, value: object) -> tuple[float, float]:
    """Two finite numbers of an argument, such as a value and its deviation; a single number has the deviation 0."""
    if isinstance(value, int | float):
        return number(name, value), 0.0
    mean, deviation = pair(name, value)
    if deviation < 0 or not math.isfinite(deviation):
        raise ValueError(f"{name} has the deviation {deviation:g}: it must be at least 0")
    return mean, deviation
