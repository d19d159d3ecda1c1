"""Reading a gyroscope's record from a file of any length: columns of rates, and the sampling interval."""

from __future__ import annotations

import math
import os
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arguments import number, short
from ..files import check_regular, cut, reason
from .allan import MIN_RECORD
from .tables import Table, open_table
from .times import JITTER, Times, examine
from .units import RATES, Unit

Array = NDArray[np.float64]

MAX_NAMED = 20  # column names in a message
# Time units in column names; names are compared in NFKC, which unifies the two micro signs.
SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sekunden"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "μs", "usec", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "mins", "minutes"), 60.0),
    **dict.fromkeys(("h", "hr", "hours"), 3600.0),
}
TIME_UNITS = ("s", "ms", "us", "ns")
TIME = re.compile(
    rf"%?(?:time|timestamp|time stamp|t|seconds|stamp)(?:[ _]*[\[(]?({'|'.join(SECONDS)})[\])]?)?", re.IGNORECASE
)
MIN_RATE, MAX_RATE = 2.0, 50_000.0  # plausible sampling rates of gyroscopes, Hz
MAX_ABS_RATE = 1e6  # rad/s
MANY_EMPTY = 0.2  # fraction of rows
MAX_MISMATCH, NOTED_MISMATCH = 0.05, 0.005  # relative difference between a given rate and the times: error, note
# Spellings of units, in lower case without blanks.
_A_SECOND, _DEGREES = r"(/|p|_?per_?|_?)(s|sec|second)|[·*.]?s\^?-1", r"(deg|degs|degree|degrees|°)"
SPELLED = {
    "deg/s": rf"{_DEGREES}({_A_SECOND})|dps",
    "rad/s": rf"(rad|rads|radian|radians)({_A_SECOND})",
    "deg/h": rf"{_DEGREES}(/|p|_?per_?|_?)(h|hr|hour)|dph|{_DEGREES}[·*.]?h\^?-1",
    "mdeg/s": rf"m(illi)?{_DEGREES}({_A_SECOND})|mdps",
    "mrad/s": rf"m(illi)?rad({_A_SECOND})",
    "urad/s": rf"(u|μ|micro)rad({_A_SECOND})",
    "arcsec/s": rf"(arcsec|arcseconds?|as)({_A_SECOND})",
    "rpm": r"rpm|rev/min|r/min",
}
AXIS = re.compile(r"[xyz123]|roll|pitch|yaw", re.IGNORECASE)  # text in brackets that is not a unit


@dataclass(frozen=True)
class Record:
    """Rates in rad/s, (columns, samples), `interval` s apart; `notes`: assumptions and excluded rows."""

    columns: tuple[str, ...]
    values: Array
    interval: float
    unit: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Options:
    """Options for reading a record, as in `analyze_record`; `dashes`: prefix of argument names in messages."""

    columns: tuple[str, ...] = ()
    rate: float | None = None
    unit: str | None = None
    time: str | None = None
    time_unit: str | None = None
    begin: float | None = None
    end: float | None = None
    scale: float = 1.0
    increments: bool = False
    skip_empty: bool = False
    dashes: str = ""

    def checked(self) -> Options:
        """These options. Raises ValueError for an invalid one."""
        if self.unit is not None and unit_of(self.unit) is None:
            raise ValueError(f"{self.dashes}unit is {short(self.unit)}: it must be one of {', '.join(RATES)}")
        if self.time_unit is not None and self.time_unit not in TIME_UNITS:
            rule = f"it must be one of {', '.join(TIME_UNITS)}"
            raise ValueError(f"{self.dashes}{self._word('time_unit')} is {short(self.time_unit)}: {rule}")
        if self.rate is not None:
            number(f"{self.dashes}rate", self.rate, above=0.0)
        if number(f"{self.dashes}scale", self.scale) == 0:
            raise ValueError(f"{self.dashes}scale is 0: it must not be 0")
        begin = 0.0 if self.begin is None else number(f"{self.dashes}{self._word('begin')}", self.begin, least=0.0)
        if self.end is not None:
            number(f"{self.dashes}{self._word('end')}", self.end, above=begin)
        return self

    def _word(self, name: str) -> str:
        return {"begin": "from", "end": "to"}.get(name, name.replace("_", "-")) if self.dashes else name


def unit_of(text: str) -> Unit | None:
    """The unit of rate with this spelling, or None."""
    plain = re.sub(r"\s+", "", unicodedata.normalize("NFKC", text)).lower().replace("\u2212", "-").replace("⋅", "·")
    return next((RATES[name] for name, pattern in SPELLED.items() if re.fullmatch(pattern, plain)), None)


def read_record(path: str | os.PathLike[str], options: Options = Options()) -> Record:
    """The record in a file of any format of tables.py.

    A column must be named unless the file has only one and the time; `#3` is the third column, and so is `3` in a
    file without names. The rate is optional if a column is called time, timestamp or t; its unit is the one at the end
    of the name (s, ms, us, ns), as in `time [ns]`, otherwise the unit that gives a plausible sampling rate, seconds
    first. A given rate must agree with the times within 5 %.

    Raises ValueError for a file that is not a record of evenly spaced, finite numbers, and for an invalid option.
    """
    options.checked()
    dashes = options.dashes
    try:
        check_regular(path)
        table = open_table(path)
        timed = _time_column(table, options)
        chosen = _chosen(table, options, timed)
        if options.rate is None and timed is None:
            raise ValueError(
                f"{dashes}rate is needed, in Hz: {path} has no column called time, timestamp or t, as in time [ns]"
            )
        columns, times, notes = _columns(table, chosen, timed, needed=options.rate is None)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {reason(error)}") from None
    columns, times, lines, left_out = _finite(table, chosen, timed, columns, times, options)
    notes += left_out
    columns, times, lines = _part(table, timed, columns, times, lines, options)
    count = len(columns[0])
    if count < 2 * MIN_RECORD:
        raise ValueError(f"{path} has {count} rows{_between(options)}: it must have at least {2 * MIN_RECORD}")
    interval, more = _interval(table, timed, times, lines, options)
    notes += more
    values = np.stack(columns)
    for i, row in zip(chosen, values, strict=True):
        if (row == row[0]).all():
            raise ValueError(f"{path}: {cut(_name(table, i))} is {row[0]:g} in every row: it must vary")
    unit, said = _unit(table, chosen, options)
    notes += said
    factor = options.scale / unit.per_si
    if options.increments:
        factor /= interval  # samples are angle increments
        notes.append(f"each sample is an angle increment in {unit.name.split('/')[0]} over {interval:g} s")
    values *= factor
    if float(np.max(np.abs(values))) > MAX_ABS_RATE:
        row, at = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
        raise ValueError(
            f"{path}, line {table.before + int(lines[at]) + 1}: {cut(_name(table, chosen[int(row)]))} is "
            f"{columns[int(row)][at]:g}: as a rate it must be below {RATES['deg/s'].of(MAX_ABS_RATE):.3g} deg/s"
        )
    return Record(tuple(_name(table, i) for i in chosen), values, interval, unit.name, tuple(notes))


def _name(table: Table, i: int) -> str:
    """The column's name, with its number if the name is not unique."""
    name = table.names[i]
    return name if table.names.count(name) == 1 else f"{name} (#{i + 1})"


def _is_time(name: str) -> re.Match[str] | None:
    return TIME.fullmatch(unicodedata.normalize("NFKC", name).strip())


def _place(table: Table, name: str) -> list[int]:
    """Columns with this name, or with this number."""
    found = [i for i, each in enumerate(table.names) if each == name]
    numbered = re.fullmatch(r"#(\d+)", name)
    if not found and numbered and 0 < int(numbered[1]) <= len(table.names):
        found = [int(numbered[1]) - 1]
    return found


def _time_column(table: Table, options: Options) -> int | None:
    if options.time is None:
        return next((i for i, name in enumerate(table.names) if _is_time(name)), None)
    found = _place(table, options.time)
    if len(found) != 1:
        raise ValueError(
            f"{options.dashes}time is {short(options.time)}: it must be one of the columns of {table.path}: "
            f"{_listed(table, range(len(table.names)))}"
        )
    return found[0]


def _chosen(table: Table, options: Options, timed: int | None) -> list[int]:
    others = [i for i, name in enumerate(table.names) if i != timed and not (options.time is None and _is_time(name))]
    if not options.columns:
        if len(others) == 1:
            return others
        raise ValueError(_of_columns(table, options, "is needed", others))
    chosen = []
    for name in options.columns:
        found = _place(table, name)
        if len(found) > 1:
            numbers = ", ".join(f"#{i + 1}" for i in found)
            raise ValueError(
                f"{options.dashes}column is {short(name)}: {table.path} has {len(found)} columns of that name; "
                f"use a number, {numbers}"
            )
        if not found or found[0] not in others:
            what = ", which is the time" if found else ""
            raise ValueError(_of_columns(table, options, f"is {short(name)}{what}", others))
        if found[0] in chosen:
            raise ValueError(f"{options.dashes}column is {short(name)} twice: columns must be different")
        chosen.append(found[0])
    return chosen


def _of_columns(table: Table, options: Options, given: str, others: Sequence[int]) -> str:
    if not others:
        return f"{options.dashes}column {given}: {table.path} has only a time column"
    listed = _listed(table, others)
    return f"{options.dashes}column {given}: it must be one of the columns of {table.path}: {listed}"


def _listed(table: Table, columns: Sequence[int]) -> str:
    more = ", ..." if len(columns) > MAX_NAMED else ""
    return ", ".join(cut(_name(table, i)) for i in columns[:MAX_NAMED]) + more


def _columns(
    table: Table, chosen: list[int], timed: int | None, *, needed: bool
) -> tuple[list[Array], Array | None, list[str]]:
    """The chosen columns, the times or None, and notes; unneeded times need not be numbers."""
    if timed is not None:
        try:
            (*columns, times), notes = table.read([*chosen, timed])
            return columns, times, notes
        except ValueError:
            if needed:
                raise
    columns, notes = table.read(chosen)
    return columns, None, notes


def _finite(
    table: Table, chosen: list[int], timed: int | None, columns: list[Array], times: Array | None, options: Options
) -> tuple[list[Array], Array | None, NDArray[np.int64], list[str]]:
    """The columns and times of the complete rows, the row numbers, and notes on excluded rows."""
    empty = np.zeros(len(columns[0]), dtype=bool)
    for column in columns:
        empty |= np.isnan(column)
    rows, notes = np.arange(len(empty)), []
    if options.skip_empty and empty.any():
        kept = ~empty
        columns, rows = [column[kept] for column in columns], rows[kept]
        times = None if times is None else times[kept]
        notes.append(f"{int(empty.sum()):,} rows of {len(empty):,} are empty in this column and excluded")
    needed = [] if times is None or options.rate is not None or timed is None else [(timed, times)]
    for i, column in [*zip(chosen, columns, strict=True), *needed]:
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            found = column[bad[0]]
            words = "empty or not a number" if np.isnan(found) else "infinite"
            advice = ""
            if np.isnan(found) and len(bad) > MANY_EMPTY * len(column):  # other sensors' rows, not lost samples
                option = "--skip-empty" if options.dashes else "skip_empty"
                advice = f"; {option} excludes such rows, of which there are {len(bad):,}"
            where = table.before + int(rows[bad[0]]) + 1
            raise ValueError(
                f"{table.path}, line {where}: {cut(_name(table, i))} is {words}: it must be a finite number{advice}"
            )
    if times is not None and not np.isfinite(times).all():
        times = None
    return columns, times, rows, notes


def _part(
    table: Table,
    timed: int | None,
    columns: list[Array],
    times: Array | None,
    lines: NDArray[np.int64],
    options: Options,
) -> tuple[list[Array], Array | None, NDArray[np.int64]]:
    """The rows from --from to --to, s from the first sample."""
    if options.begin is None and options.end is None:
        return columns, times, lines
    begin, end = options.begin or 0.0, math.inf if options.end is None else options.end
    near = 0.25 / (options.rate or 1.0)  # a quarter of an interval, as messages print rounded times
    since = 4 * near * np.arange(len(columns[0]))
    if times is not None and timed is not None and (options.rate is None or not (np.diff(times) < 0).any()):
        found = examine(times - times[0])
        if found is not None:
            per, _ = _seconds(table, timed, cut(_name(table, timed)), found, options)
            if (rate := options.rate) is not None:  # the unit that fits the given rate
                every = rate * found.interval
                per = min((SECONDS[each] for each in TIME_UNITS), key=lambda unit: abs(every * unit - 1))
            since, near = _since(times, found.interval) * per, 0.25 * found.interval * per
    kept = (since >= begin - near) & (since < end - near)
    return [column[kept] for column in columns], None if times is None else times[kept], lines[kept]


def _since(times: Array, interval: float) -> Array:
    """Times since the first one; a decrease counts as one interval."""
    steps = np.diff(times)
    return np.concatenate([[0.0], np.cumsum(np.where(steps < 0, interval, steps))])


def _between(options: Options) -> str:
    """The selected part, for a message."""
    if options.begin is None and options.end is None:
        return ""
    end = "the end" if options.end is None else f"{options.end:g} s"
    return f" from {options.begin or 0:g} s to {end}"


# -- Times -------------------------------------------------------------------------------------------------------------


def _interval(
    table: Table, timed: int | None, times: Array | None, lines: NDArray[np.int64], options: Options
) -> tuple[float, list[str]]:
    """Sampling interval, s, and notes on assumptions."""
    if times is None or timed is None:
        if options.rate is None:
            raise ValueError(f"{table.path}: the times are not numbers: give {options.dashes}rate")
        return 1 / options.rate, []
    name = cut(_name(table, timed))
    found = examine(times - times[0])
    if found is None:
        if options.rate is not None:
            return 1 / options.rate, []
        raise ValueError(f"{table.path}: {name} does not increase: it must increase, or give {options.dashes}rate")
    per, notes = _seconds(table, timed, name, found, options)
    at = table.before + lines + 1
    if len(found.falls):
        first = int(at[found.falls[0]])
        notes.append(f"{name} decreases {_times(len(found.falls))}, first at line {first:,}")
    if found.repeats:
        notes.append(f"{found.repeats:,} samples repeat the previous {name}: they may be duplicates")
    if len(found.gaps):
        first = int(at[found.gaps[0]]) + 1
        gaps = "a gap" if len(found.gaps) == 1 else f"{len(found.gaps):,} gaps, the first"
        lost = "1 sample is" if found.missing == 1 else f"{found.missing:,} samples are"
        notes.append(f"{name} has {gaps} at line {first:,}; {lost} missing")
    if options.rate is not None:
        return 1 / options.rate, notes
    interval = found.interval * per
    if not found.even:
        begin, end = found.longest(len(times))
        before = options.begin or 0.0
        since = _since(times, found.interval)
        span = before + since[begin] * per, before + (since[end - 1] + found.interval) * per
        words = ("--from", "--to") if options.dashes else ("begin", "end")
        what = notes[-1] if len(found.gaps) else f"{name} decreases, first at line {int(at[found.falls[0]]):,}"
        raise ValueError(
            f"{table.path}: {what}: times must increase evenly. The longest even segment has {end - begin:,} samples: "
            f"use {words[0]} {span[0]:.7g} {words[1]} {span[1]:.7g}, or override the times with {options.dashes}rate"
        )
    if found.jitter > JITTER:
        notes.append(
            f"{name} jitters by up to {found.jitter * interval:.3g} s; samples are assumed to be {interval:.6g} s apart"
        )
    return interval, notes


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count:,} times")


def _seconds(table: Table, timed: int, name: str, found: Times, options: Options) -> tuple[float, list[str]]:
    """Unit of the times in s, and notes on assumptions."""
    matched = _is_time(table.names[timed])
    text = options.time_unit or (matched[1] if matched else None) or _in_brackets(table, timed)
    named = None if text is None else unicodedata.normalize("NFKC", text).strip().lower()
    option = "--time-unit" if options.dashes else "time_unit"
    if named is not None and named in SECONDS:
        per = SECONDS[named]
        return per, _agreeing(table, name, [per], found, options)
    if options.rate is not None:
        return 1.0, _agreeing(table, name, [SECONDS[each] for each in TIME_UNITS], found, options)
    if named is not None:
        rule = f"give {option}, one of {', '.join(TIME_UNITS)}, or {options.dashes}rate"
        raise ValueError(f"{table.path}: {name} is in {cut(named)}, which is not a known unit of time: {rule}")
    if MIN_RATE * found.interval <= 1 < MAX_RATE * found.interval:
        return 1.0, [f"{name} has no unit; seconds are assumed"]
    fitting = [each for each in TIME_UNITS if MIN_RATE <= 1 / (found.interval * SECONDS[each]) < MAX_RATE]
    if len(fitting) == 1:
        per = SECONDS[fitting[0]]
        return per, [f"{name} has no unit; {fitting[0]} are assumed, which gives {1 / (found.interval * per):.6g} Hz"]
    raise ValueError(
        f"{table.path}: {name} has no unit, and in seconds the samples would be {found.interval:.6g} s apart: give "
        f"{option} or {options.dashes}rate, or name the unit in the first line, as in {name} [ms]"
    )


def _agreeing(table: Table, name: str, units: list[float], found: Times, options: Options) -> list[str]:
    """Notes on a given rate. Raises ValueError if it disagrees with the times in all of these units."""
    if options.rate is None:
        return []
    off = [options.rate * found.interval * per - 1 for per in units]
    least = min(off, key=abs)
    if abs(least) > MAX_MISMATCH and not len(found.falls):
        have = f"at {1 / (found.interval * units[0]):.6g} Hz"
        if len(units) > 1:
            have = f"{found.interval:.6g} apart in an unnamed unit"
        raise ValueError(
            f"{options.dashes}rate is {options.rate:g}: it must agree within {100 * MAX_MISMATCH:g} % with {name} in "
            f"{table.path}, whose samples are {have}; rename that column if it is not the time"
        )
    if abs(least) > NOTED_MISMATCH:
        return [f"{options.dashes}rate differs by {100 * least:+.3g} % from that of {name}"]
    return []


# -- Units -------------------------------------------------------------------------------------------------------------


def _unit(table: Table, chosen: list[int], options: Options) -> tuple[Unit, list[str]]:
    """Unit of the rates, and a note if it was assumed."""
    if options.unit is None:
        for i in chosen:
            text = _in_brackets(table, i)
            if text is not None and not AXIS.fullmatch(text) and _named_unit(table, i, options) is None:
                hint = " Angle increments also need --increments." if unit_of(f"{text}/s") else ""
                rule = f"give {options.dashes}unit, one of {', '.join(RATES)}, and for counts {options.dashes}scale"
                raise ValueError(
                    f"{table.path}: {cut(_name(table, i))} is in {cut(text)}, which is not a known unit of rate: "
                    f"{rule}.{hint}"
                )
    named = {unit for i in chosen if (unit := _named_unit(table, i, options)) is not None}
    if options.unit is not None:
        given = unit_of(options.unit)
        assert given is not None
        other = named - {given}
        return given, [f"the file names {other.pop().name}, but {options.dashes}unit is {given.name}"] if other else []
    if len(named) > 1:
        names = ", ".join(sorted(unit.name for unit in named))
        raise ValueError(f"{options.dashes}unit is needed: the columns are in {names}")
    if named:
        unit = named.pop()
        return unit, [f"the unit is {unit.name}, from the file"] if unit.name != "deg/s" else []
    if all("angular_velocity" in table.names[i] for i in chosen):
        return RATES["rad/s"], ["angular_velocity has no unit; rad/s is assumed, as in ROS"]
    name = cut(_name(table, chosen[0]))
    name = f"column {name}" if name.isdigit() else name
    return RATES["deg/s"], [f"{name} has no unit; deg/s is assumed"]


def _in_brackets(table: Table, i: int) -> str | None:
    """Text in brackets at the end of a column's name, or in a line of units; None without it."""
    bracketed = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", table.names[i])
    return bracketed[1].strip() if bracketed else table.known.get(i)


def _named_unit(table: Table, i: int, options: Options) -> Unit | None:
    """Unit of a column: in brackets in its name, in a line below the names, or at the end of the name."""
    text = _in_brackets(table, i)
    if text is not None:
        return unit_of(text) or (unit_of(f"{text}/s") if options.increments else None)
    words = [word for word in re.split(r"[\s,_]+", table.names[i]) if word.lower() != "per"]
    ends = ("/".join(words[-count:]) for count in (1, 2) if len(words) > count)
    return next((unit for end in ends if (unit := unit_of(end)) is not None), None)
