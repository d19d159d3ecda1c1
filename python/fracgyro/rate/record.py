"""A gyroscope's record in a CSV file of any length: one column of rates, and a sampling interval."""

from __future__ import annotations

import os
import re
import unicodedata
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from ..arguments import number
from ..arguments import short as shown
from ..files import check_regular, cut, reason
from .allan import MIN_RECORD
from .units import RATES

Array = NDArray[np.float64]

BLOCK = 2**22  # bytes read at a time
BEGINNING = 2**16  # bytes that header and comments may have
LINE_END = re.compile(r"\r\n|\n|\r")  # of a CSV file; str.splitlines knows others, as the vertical tab is
COMMA = re.compile(r"\d,\d|^\s*,\d")  # in a number
FRACTION = re.compile(r"\s*-0+,\d+\s*|\s*[+-]?\d+,0\d+\s*")  # no whole number is written -0 or 05
MOST_NAMED = 20  # columns in a sentence
UNEVEN = 0.5  # of the median interval: how far any other may be off; a missing sample is off by 1
# What a time column may be called, and its units; names are compared in NFKC, where both signs for micro are one.
SECONDS = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "μs": 1e-6, "ns": 1e-9}
TIME = re.compile(rf"(?:time|timestamp|t)(?:[ _]*[\[(]?({'|'.join(SECONDS)})[\])]?)?", re.IGNORECASE)
SLOWEST = 2.0  # Hz: below this a time without a unit is hardly in seconds. 1000 Hz in ms would be 1 Hz
AGREES = 0.05  # of a rate that is given: how far that of the times may be off


@dataclass(frozen=True)
class Record:
    """Rates in rad/s, `interval` s apart; `note`: what was assumed of the times, for the user to judge."""

    column: str
    values: Array
    interval: float
    note: str = ""


@dataclass(frozen=True)
class _Layout:
    """Of a CSV file: its columns, and how many lines come before the first row of numbers."""

    names: list[str]
    before: int
    delimiter: str
    decimal: str  # the sign before fractions

    @property
    def times(self) -> list[str]:
        return [name for name in self.names if _time(name)]


def read_record(
    path: str | os.PathLike[str],
    column: str | None = None,
    rate: float | None = None,
    unit: str = "deg/s",
    *,
    dashes: str = "",
) -> Record:
    """The record in a CSV file, with a line of names or without: its columns then are 1, 2, and so on.

    `column`: need not be given where there is only one but the time. `rate`: in Hz; need not be given where a column
    is called time, timestamp or t, in the unit that its name ends with (s, ms, us, ns), as in `time [ns]`, else in
    seconds. Where both are there, they must agree. Commas, semicolons or tabs separate columns; decimals may be commas
    unless commas separate columns. Lines that begin with # are comments, but for the names. `dashes`: what sentences
    write before the name of an argument, for a command line.
    Raises ValueError in one sentence for what is not a record of evenly spaced, finite numbers.
    """
    if unit not in RATES:
        raise ValueError(f"{dashes}unit is {shown(unit)}: it must be one of {', '.join(RATES)}")
    if rate is not None:
        rate = number(f"{dashes}rate", rate, above=0.0)
    try:
        check_regular(path)
        with open(path, "rb") as file:
            layout = _layout(path, file.read(BEGINNING))
        chosen = _chosen(path, layout, column, dashes)
        if rate is None and not layout.times:
            raise ValueError(
                f"{dashes}rate is needed, in Hz, as {path} has no column called time, timestamp or t, as in time [ns]"
            )
        values, times = _columns(path, layout, chosen, needed=rate is None)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {reason(error)}") from None
    if len(values) < 2 * MIN_RECORD:
        raise ValueError(f"{path} has {len(values)} rows: it must have at least {2 * MIN_RECORD}")
    if (values == values[0]).all():
        raise ValueError(f"{path}: {chosen} is {values[0]:g} in every row: it must vary")
    if rate is None:
        assert times is not None
        interval, note = _interval(path, layout, times, f"{dashes}rate")
    else:
        interval, note = 1 / rate, "" if times is None else _compared(path, layout, times, rate, f"{dashes}rate")
    values /= RATES[unit].per_si
    return Record(chosen, values, interval, note)


def _time(name: str) -> re.Match[str] | None:
    return TIME.fullmatch(unicodedata.normalize("NFKC", name))


def _unit(name: str) -> float | None:
    """Seconds in the unit of a time column; None where it names none."""
    matched = _time(name)
    return SECONDS[matched[1].lower()] if matched and matched[1] else None


def _columns(path: str | os.PathLike[str], layout: _Layout, chosen: str, *, needed: bool) -> tuple[Array, Array | None]:
    """The chosen column and the times, if there are any; those that are not needed need not be numbers."""
    if layout.times:
        try:
            values, times = _numbers(path, layout, [chosen, layout.times[0]])
            return values, times
        except ValueError:
            if needed:
                raise
    return _numbers(path, layout, [chosen])[0], None


def _layout(path: str | os.PathLike[str], beginning: bytes) -> _Layout:
    lines = LINE_END.split(beginning.decode("utf-8-sig", "replace"))
    comments = sum(1 for _ in takewhile(lambda line: line.startswith("#") or not line.strip(), lines))
    first = lines[comments] if comments < len(lines) else ""
    delimiter = max(";\t,", key=first.count)
    for other in ";\t":  # which no number has
        if other in first and all(map(_is_decimal, first.split(other))):
            delimiter = other
    named = not all(map(_is_decimal if delimiter != "," else _is_number, first.split(delimiter)))
    rows = lines[comments + named :]
    decimal = "," if delimiter != "," and rows and any(map(COMMA.search, rows[0].split(delimiter))) else "."
    if named:
        return _Layout(_names(first, delimiter), comments + 1, delimiter, decimal)
    count = first.count(delimiter) + 1
    above = lines[comments - 1] if comments else ""
    if above.startswith("#") and above.count(delimiter) + 1 == count:
        return _Layout(_names(above, delimiter), comments, delimiter, decimal)
    if delimiter == "," and count == 2 and any(map(FRACTION.fullmatch, rows)):
        raise ValueError(
            f"{path} has no names, and its rows can be two columns or one of decimal commas: it must have decimal "
            "points, or a first line with the names of its columns"
        )
    return _Layout([str(i + 1) for i in range(count)], comments, delimiter, decimal)


def _names(line: str, delimiter: str) -> list[str]:
    return [name.strip().strip('"').strip() for name in line.removeprefix("#").split(delimiter)]


def _is_decimal(text: str) -> bool:
    return _is_number(text.replace(",", ".", 1))


def _is_number(text: str) -> bool:
    try:
        float(text.strip().strip('"') or "nan")
    except ValueError:
        return False
    return True


def _chosen(path: str | os.PathLike[str], layout: _Layout, column: str | None, dashes: str) -> str:
    others = [name for name in layout.names if not _time(name)]
    if column is None and len(others) == 1:
        return others[0]
    if column not in others:
        given = "is needed" if column is None else f"is {shown(column)}"
        what = ", which is the time" if column in layout.names else ""
        more = ", ..." if len(others) > MOST_NAMED else ""
        allowed = ", ".join(map(cut, others[:MOST_NAMED])) + more
        raise ValueError(f"{dashes}column {given}{what}: it must be one of those of {path}: {allowed}")
    if layout.names.count(column) > 1:
        raise ValueError(
            f"{dashes}column is {shown(column)}: {path} must have one of that name, not {layout.names.count(column)}"
        )
    return column


def _numbers(path: str | os.PathLike[str], layout: _Layout, wanted: list[str]) -> list[Array]:
    """The columns of these names."""
    places = [f"f{layout.names.index(name)}" for name in wanted]
    read = pyarrow.csv.ReadOptions(
        column_names=[f"f{i}" for i in range(len(layout.names))],
        skip_rows=layout.before,
        block_size=BLOCK,
        use_threads=False,  # or errors would not say in which line
    )
    convert = pyarrow.csv.ConvertOptions(
        include_columns=places, column_types=dict.fromkeys(places, pa.float64()), decimal_point=layout.decimal
    )
    parse = pyarrow.csv.ParseOptions(delimiter=layout.delimiter)
    parts: list[list[Array]] = [[] for _ in wanted]
    try:
        for batch in pyarrow.csv.open_csv(path, read, parse, convert):
            for part, values in zip(parts, batch.columns, strict=True):
                part.append(values.to_numpy(zero_copy_only=False))
    except pa.ArrowInvalid as error:
        raise ValueError(_refusal(path, layout, str(error))) from None
    columns = [np.concatenate(part) if part else np.empty(0) for part in parts]
    for name, values in zip(wanted, columns, strict=True):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            line, found = layout.before + int(bad[0]) + 1, values[bad[0]]
            words = "empty or not a number" if np.isnan(found) else "infinite"
            raise ValueError(f"{path}, line {line}: {name} is {words}: it must be a finite number")
    return columns


def _refusal(path: str | os.PathLike[str], layout: _Layout, error: str) -> str:
    value = re.search(r"CSV column #(\d+): Row #(\d+): .*invalid value '(.*)'", error, re.DOTALL)
    if value:
        name = layout.names[int(value[1])] if int(value[1]) < len(layout.names) else value[1]
        return f"{path}, line {value[2]}: {name} is {shown(value[3])}: it must be a finite number"
    count = re.search(r"Row #(\d+): Expected (\d+) columns, got (\d+)", error)
    if count:
        return f"{path}, line {count[1]}: it has {count[3]} columns: it must have {count[2]}"
    if "Empty CSV" in error:
        return f"{path} has 0 rows: it must have at least {2 * MIN_RECORD}"
    return f"{path} cannot be read as CSV: {cut(error)}"


def _interval(path: str | os.PathLike[str], layout: _Layout, times: Array, option: str) -> tuple[float, str]:
    """Mean interval of evenly spaced times, s, and what was assumed for it."""
    name = layout.times[0]
    steps = np.diff(times)
    median = float(np.median(steps))
    if median <= 0:
        raise ValueError(f"{path}: {name} does not rise from line to line: it must, or give {option}")
    late, early = _uneven(steps)
    if late.any() or early.any():
        at = int(np.argmax(late | early))
        advice = f"if samples are evenly spaced and only their times jitter, give {option}"
        if not early.any():
            more = f", the first of {late.sum()}" if late.sum() > 1 else ""
            advice = f"samples are missing there; split the record at this gap{more}"
        raise ValueError(
            f"{path}, line {layout.before + at + 2}: {name} is {steps[at]:g} later than in the line before: it must be "
            f"{median:g} later, as in most lines, within {100 * UNEVEN:g} %; {advice}"
        )
    interval = float(times[-1] - times[0]) / (len(times) - 1)
    unit = _unit(name)
    if unit is None and interval * SLOWEST > 1:
        raise ValueError(
            f"{path}: {name} has no unit, and in seconds its samples would be {interval:.6g} s apart: name the unit in "
            f"the first line, as {name} [s], {name} [ms], {name} [us] or {name} [ns], or give {option}"
        )
    return interval * (unit or 1.0), "" if unit else f"{name} names no unit and is taken for seconds"


def _compared(path: str | os.PathLike[str], layout: _Layout, times: Array, rate: float, option: str) -> str:
    """What to know of a rate that is given; that of the times must be the same, in any unit where they name none."""
    name, steps = layout.times[0], np.diff(times)
    if (steps < 0).any() or times[-1] == times[0]:
        return ""  # what does not rise tells no time
    interval, unit = float(times[-1] - times[0]) / len(steps), _unit(name)
    units = SECONDS.values() if unit is None else [unit]
    if not any(abs(rate * interval * each - 1) <= AGREES for each in units):
        have = f"{1 / (interval * unit):.6g} a second" if unit else f"{interval:.6g} apart in an unnamed unit"
        raise ValueError(
            f"{option} is {rate:g}: it must be that of {name} in {path} within {100 * AGREES:g} %, whose samples are "
            f"{have}; rename that column if it is not the time"
        )
    late, early = _uneven(steps)
    if not late.any() or early.any():
        return ""
    gaps = "a gap" if late.sum() == 1 else f"{late.sum()} gaps, the first"
    return f"{name} has {gaps} at line {layout.before + int(np.argmax(late)) + 2}, which {option} hides"


def _uneven(steps: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which samples come late and which early. Times that jitter are both; where samples are missing, none is early."""
    median = float(np.median(steps))
    return steps > (1 + UNEVEN) * median, steps < (1 - UNEVEN) * median
