"""Reading records and sweeps from files: columns by name, units in names, times and gaps."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arguments import number, short
from ..files import check_regular, cut, reason
from ..rate.record import SECONDS, TIME
from ..rate.tables import Table, open_table
from ..rate.times import examine, resolution
from ..rate.units import RATES
from .records import MIN_FREQUENCIES, Decay, Response, Segment, State, Sweep, digest

Array = NDArray[np.float64]

PREFIXES = {"": 1.0, "k": 1e3, "m": 1e-3, "u": 1e-6, "μ": 1e-6, "n": 1e-9, "p": 1e-12, "f": 1e-15}
BASES = ("V", "A", "N", "m")
COUNTS = ("code", "codes", "count", "counts", "lsb", "1")
QUANTITY = re.compile(r"(x|y|force_x|force_y|rate|temperature|bias)(?:[ _]*[\[(]\s*([^\])]*?)\s*[\])])?", re.IGNORECASE)
OTHER_TIME = re.compile(r"(?:time|t)[ _]*[\[(].*[\])]", re.IGNORECASE)
FREQUENCY = re.compile(r"(?:f|freq|frequency)(?:[ _]*[\[(]?\s*(k|M|G)?hz\s*[\])]?)?", re.IGNORECASE)
MAX_UNEVEN = 0.1  # intervals, of a sample from an even clock
NEGLIGIBLE = 1e-10  # share of the sampling rate
FEW_STEPS = 8  # do not show an uneven clock
MAX_RADIANS = 100.0  # a phase in radians that reaches further is one in degrees
HERTZ = {None: 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
RESPONSE = re.compile(
    r"(?:([xy])([xy])[ _]*)?(re|real|im|imag|mag|magnitude|gain|amplitude|phase)(?:[ _]*[\[(]?\s*(db|deg|degrees|rad)?"
    r"\s*[\])]?)?",
    re.IGNORECASE,
)
PARTS = {"re": "re", "real": "re", "im": "im", "imag": "im", "phase": "phase"}


def read(given: Decay | Sweep) -> tuple[list[Segment] | Response, list[str]]:
    """The segments of a time record, or a sweep if the file has a column of frequencies, and notes.

    Raises ValueError, in one sentence, for a file that is neither.
    """
    try:
        check_regular(given.path)
        table = open_table(given.path)
        if isinstance(given, Sweep) or any(_frequency(name) for name in table.names):
            return _sweep(table, given), []
        return _decay(table, given)
    except OSError as error:
        raise ValueError(f"{given.path} cannot be read: {reason(error)}") from None


def _plain(text: str) -> str:
    return unicodedata.normalize("NFKC", text).strip()


def _frequency(name: str) -> re.Match[str] | None:
    return FREQUENCY.fullmatch(_plain(name))


def _label(path: str | os.PathLike[str]) -> str:
    return Path(path).name


# -- Time records ------------------------------------------------------------------------------------------------------


def _decay(table: Table, given: Decay) -> tuple[list[Segment], list[str]]:
    name = _label(given.path)
    places, units = _quantities(table, given.columns, name)
    axes = tuple(axis for axis in ("x", "y") if axis in places)
    if not axes:
        listed = ", ".join(cut(each) for each in table.names[:12])
        raise ValueError(
            f"{name} has no column x or y: its columns are {listed}; name one, as in x [V], or choose one with --x "
            "(columns in Python)"
        )
    timed = next((i for i, each in enumerate(table.names) if TIME.fullmatch(_plain(each))), None)
    wanted = [*places.values(), *([] if timed is None or given.sampling is not None else [timed])]
    columns, notes = table.read(wanted)
    for place, column in zip(wanted, columns, strict=True):
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            line, words = table.before + int(bad[0]) + 1, "infinite" if np.isinf(column[bad[0]]) else "empty or NaN"
            raise ValueError(f"{name}, line {line}: {cut(table.names[place])} is {words}: it must be a finite number")
    if len(columns[0]) < 2:
        raise ValueError(f"{name} has {len(columns[0])} rows: it must have at least 64")
    values = dict(zip(places, columns, strict=False))
    interval, ends, more = _times(table, timed, columns[-1], given, name)
    notes += more
    motion = np.stack([values[axis] * _scale(units[axis], name, axis)[0] for axis in axes])
    bases = tuple(_scale(units[axis], name, axis)[1] for axis in axes)
    if len(set(bases)) > 1:
        raise ValueError(
            f"{name}: x is in {cut(units['x']) or 'code'} and y in {cut(units['y']) or 'code'}: both must be in one "
            "unit, V, A, N, m or code, with any prefix"
        )
    drives = tuple(axis for axis in ("x", "y") if f"force_{axis}" in values)
    pushed = [f"force_{axis}" for axis in drives]
    force = np.stack([values[each] * _scale(units[each], name, each)[0] for each in pushed]) if drives else None
    state = _state(given, values, units, name)
    found = []
    begin = number(f"{name}: begin", given.begin, least=0.0) if given.begin is not None else 0.0
    end = number(f"{name}: end", given.end, above=begin) if given.end is not None else np.inf
    for first, last in pairwise(ends):
        since = interval * np.arange(last - first) + (columns[-1][first] - columns[-1][0] if len(ends) > 2 else 0.0)
        kept = np.flatnonzero((since >= begin - interval / 4) & (since < end - interval / 4)) + first
        if len(kept):
            one = slice(int(kept[0]), int(kept[-1]) + 1)
            cut_force = None if force is None else force[:, one]
            found.append(
                Segment(
                    name,
                    motion[:, one],
                    cut_force,
                    interval,
                    axes,
                    drives,
                    state,
                    bases,
                    float(since[kept[0] - first]),
                    digest=digest(motion[:, one], cut_force),
                )
            )
    if not found:
        raise ValueError(
            f"{name} has no samples from {begin:g} s to {end:g} s: it is {interval * len(columns[0]):.4g} s long"
        )
    return found, [f"{name}: {note}" for note in notes]


def _quantities(table: Table, columns: Mapping[str, str] | None, name: str) -> tuple[dict[str, int], dict[str, str]]:
    """Places and units of the quantities of a time record, by name."""
    places: dict[str, int] = {}
    units: dict[str, str] = {}
    for i, each in enumerate(table.names):
        matched = QUANTITY.fullmatch(_plain(each))
        if matched and matched[1].lower() not in places:
            places[matched[1].lower()] = i
            units[matched[1].lower()] = (matched[2] or table.known.get(i, "")).strip()
    for quantity, column in (columns or {}).items():
        if quantity not in ("x", "y", "force_x", "force_y"):
            raise ValueError(f"columns has {short(quantity)}: it must have x, y, force_x or force_y")
        numbered = re.fullmatch(r"#(\d+)", column)
        found = [i for i, each in enumerate(table.names) if each == column]
        if not found and numbered and 0 < int(numbered[1]) <= len(table.names):
            found = [int(numbered[1]) - 1]
        if len(found) != 1:
            listed = ", ".join(cut(each) for each in table.names[:12])
            raise ValueError(f"{name}: column {quantity} is {short(column)}: it must be one of {listed}")
        bracketed = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", column)
        places[quantity], units[quantity] = found[0], bracketed[1].strip() if bracketed else ""
    return places, units


def _scale(unit: str, name: str, column: str) -> tuple[float, str]:
    """Factor to the base unit, and that unit: V, A, N, m, or empty for counts."""
    plain = _plain(unit)
    if plain == "" or plain.lower() in COUNTS:
        return 1.0, ""
    for base in BASES:
        if plain.endswith(base) and plain.removesuffix(base) in PREFIXES:
            return PREFIXES[plain.removesuffix(base)], base
    raise ValueError(
        f"{name}: {column} is in {cut(unit)}: it must be in V, A, N, m or code, with a prefix such as m or u"
    )


def _times(
    table: Table, timed: int | None, times: Array, given: Decay, name: str
) -> tuple[float, list[int], list[str]]:
    """Sampling interval, s, the ends of the segments without gaps, and notes."""
    if given.sampling is not None:
        return 1 / number(f"{name}: sampling", given.sampling, above=0.0), [0, len(times)], []
    if timed is None:
        other = next((each for each in table.names if OTHER_TIME.fullmatch(_plain(each))), None)
        if other is not None:
            raise ValueError(
                f"{name}: {cut(other)} must be in s, ms, us or ns; or give --sampling (sampling in Python)"
            )
        raise ValueError(
            f"{name} has no column time: give the sampling rate in Hz with --sampling (sampling in Python)"
        )
    matched = TIME.fullmatch(_plain(table.names[timed]))
    unit = ((matched and matched[1]) or table.known.get(timed, "s")).strip().lower()
    if unit not in SECONDS:
        raise ValueError(f"{name}: time is in {cut(unit)}: it must be in s, ms, us or ns")
    times *= SECONDS[unit]
    found = examine(times - times[0])
    if found is None or len(found.falls):
        raise ValueError(f"{name}: {cut(table.names[timed])} does not increase everywhere: it must increase")
    column = cut(table.names[timed])
    ends = [0, *(int(each) + 1 for each in found.gaps), len(times)]
    interval, notes = found.interval, []
    if len(ends) == 2:  # the line through all times: the first and last are rounded
        at = np.arange(len(times)) - (len(times) - 1) / 2
        interval = float(at @ (times - times[0])) / float(at @ at)
    rounding = _check_even(times, ends, interval, column, table.before, name)
    known = 2 * rounding / interval / len(times) ** 1.5
    if known > NEGLIGIBLE:
        notes.append(
            f"{column} is rounded to {rounding:.2g} s: the sampling rate, and so each frequency, is known to about "
            f"{known:.1g} of it; --sampling (sampling in Python) gives it"
        )
    if len(found.gaps):
        line = table.before + int(found.gaps[0]) + 2
        gaps = "a gap" if len(found.gaps) == 1 else f"{len(found.gaps)} gaps, the first"
        notes.append(f"{gaps} at line {line}, {found.missing} samples are missing: the record is split there")
    return interval, ends, notes


def _check_even(times: Array, ends: list[int], interval: float, column: str, before: int, name: str) -> float:
    """The coarsest rounding of the times, s.

    Raises ValueError for times that repeat, or that are further from an even clock than rounding explains.
    """
    most = coarsest = 0.0
    # Text with a number of digits rounds more coarsely from each power of ten on.
    decades = np.floor(np.log10(np.maximum(np.abs(times), 1e-300)))
    for first, last in pairwise(ends):
        edges = [first, *(first + 1 + np.flatnonzero(np.diff(decades[first:last]))), last]
        for begin, end in pairwise(map(int, edges)):
            steps = np.diff(times[begin:end])
            if len(steps) < FEW_STEPS:
                continue
            # Rounding has one step between its times, gaps at even distances have two.
            rounding = min(resolution(steps), float(steps[steps > 0].min(initial=np.inf)))
            coarsest = max(coarsest, rounding)
            repeats = np.flatnonzero(steps == 0)
            if len(repeats) and rounding < 1.5 * interval:
                line = before + begin + int(repeats[0]) + 2
                raise ValueError(
                    f"{name}, line {line}: {column} repeats the time before it: each sample must have its own"
                )
            off = times[begin:end] - interval * np.arange(end - begin)
            most = max(most, float(np.abs(off - np.median(off)).max()) - 0.5 * rounding)
    if most > MAX_UNEVEN * interval:
        raise ValueError(
            f"{name}: {column} is up to {most / interval:.2g} intervals from an even clock: samples must be evenly "
            "spaced; if they are and only their times are wrong, give --sampling (sampling in Python)"
        )
    return coarsest


def _state(given: Decay, values: dict[str, Array], units: dict[str, str], name: str) -> State:
    """The state that the user or a constant column gives."""
    rate = given.rate
    if rate is None and "rate" in values:
        unit = units["rate"] or "deg/s"
        if unit not in RATES:
            raise ValueError(f"{name}: rate is in {cut(unit)}: it must be in {', '.join(RATES)}")
        if np.ptp(values["rate"]) > 0.01 * max(float(np.abs(values["rate"]).max()), 1e-12):
            raise ValueError(
                f"{name}: rate moves from {values['rate'].min():g} to {values['rate'].max():g}: it must be constant"
            )
        rate = RATES[unit].to_si(float(values["rate"].mean()))
    bias, temperature = given.bias, given.temperature
    if bias is None and "bias" in values:
        bias = float(values["bias"].mean()) * _scale(units["bias"], name, "bias")[0]
    if temperature is None and "temperature" in values:
        offset = 273.15 if units["temperature"].lower() in ("c", "°c", "degc") else 0.0
        temperature = float(values["temperature"].mean()) + offset
    return State(rate, bias, temperature).checked(name)


# -- Sweeps ------------------------------------------------------------------------------------------------------------


def _sweep(table: Table, given: Decay | Sweep) -> Response:
    name = _label(given.path)
    at = next((i for i, each in enumerate(table.names) if _frequency(each)), None)
    if at is None:
        raise ValueError(f"{name} has no column frequency: it must have one, as in frequency [Hz]")
    matched = _frequency(table.names[at])
    assert matched is not None
    columns: dict[tuple[str, str], dict[str, tuple[int, str]]] = {}
    for i, each in enumerate(table.names):
        found = RESPONSE.fullmatch(_plain(each))
        if i != at and found:
            where = ((found[1] or "x").lower(), (found[2] or "x").lower())
            part = PARTS.get(found[3].lower(), "mag")
            columns.setdefault(where, {})[part] = i, (found[4] or table.known.get(i, "")).lower()
    if not columns:
        raise ValueError(
            f"{name} has no response: it must have columns such as xx_re and xx_im, or magnitude and phase"
        )
    for (axis, drive), parts in columns.items():
        if not ({"re", "im"} <= parts.keys() or {"mag", "phase"} <= parts.keys()):
            missing = (
                "phase" if "mag" in parts else "magnitude" if "phase" in parts else "im" if "re" in parts else "re"
            )
            raise ValueError(
                f"{name}: {missing} of {axis}{drive} is missing: feedthrough cannot be separated without it"
            )
    wanted = [at, *(i for parts in columns.values() for i, _ in parts.values())]
    read, _ = table.read(wanted)
    values = dict(zip(wanted, read, strict=True))
    for i, column in values.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            line = table.before + int(bad[0]) + 1
            raise ValueError(f"{name}, line {line}: {cut(table.names[i])} is not finite: it must be a finite number")
    frequency = values[at] * HERTZ[matched[1].lower() if matched[1] else None]
    if len(frequency) < MIN_FREQUENCIES or frequency.min() <= 0:
        raise ValueError(f"{name} has {len(frequency)} frequencies: it must have at least {MIN_FREQUENCIES}, above 0")
    axes, drives = (tuple(sorted({place[k] for place in columns})) for k in (0, 1))
    if len(columns) != len(axes) * len(drives):
        raise ValueError(f"{name} lacks a response: it must have every pick-off of {', '.join(axes)} for every drive")
    response = np.empty((len(frequency), len(axes), len(drives)), dtype=complex)
    for (axis, drive), parts in columns.items():
        if "re" in parts and "im" in parts:
            one = values[parts["re"][0]] + 1j * values[parts["im"][0]]
        else:
            magnitude, phase = values[parts["mag"][0]], values[parts["phase"][0]]
            _check_polar(name, f"{axis}{drive}", magnitude, phase, (parts["mag"][1], parts["phase"][1]))
            magnitude = 10 ** (magnitude / 20) if parts["mag"][1] == "db" else magnitude
            one = magnitude * np.exp(1j * (phase if parts["phase"][1] == "rad" else np.radians(phase)))
        if np.ptp(one.real) == 0 and np.ptp(one.imag) == 0:
            raise ValueError(f"{name}: {axis}{drive} is constant: it must show a resonance; is the device connected?")
        response[:, axes.index(axis), drives.index(drive)] = one
    state = State(given.rate, given.bias, given.temperature).checked(name)
    return Response(name, frequency, response, axes, drives, state, digest(frequency, response.view(float)))


def _check_polar(name: str, where: str, magnitude: Array, phase: Array, units: tuple[str, str]) -> None:
    """Raises ValueError for a magnitude or phase whose unit cannot be the stated one."""
    if units[0] != "db" and magnitude.min() < 0:
        raise ValueError(
            f"{name}: magnitude of {where} is {magnitude.min():g}: a linear one is never negative; for decibels, call "
            "the column magnitude [dB]"
        )
    if units[1] == "rad" and np.abs(phase).max() > MAX_RADIANS:
        raise ValueError(
            f"{name}: phase of {where} reaches {phase[np.argmax(np.abs(phase))]:g} rad: for degrees, call the column "
            "phase [deg]"
        )
