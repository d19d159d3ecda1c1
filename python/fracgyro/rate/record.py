"""A gyroscope's record in a CSV file of any length: one column of rates, and a sampling interval."""

from __future__ import annotations

import os
import re
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
MOST_NAMED = 20  # columns in a sentence
UNEVEN = 0.5  # of the median interval: how far any other may be off; a missing sample is off by 1
TIME = re.compile(r"(?:time|timestamp|t)(?:[ _]*[\[(]?(s|sec|seconds|ms|us|µs|ns)[\])]?)?", re.IGNORECASE)
SECONDS = {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


@dataclass(frozen=True)
class Record:
    """Rates in rad/s, `interval` s apart."""

    column: str
    values: Array
    interval: float


@dataclass(frozen=True)
class _Layout:
    """Of a CSV file: its columns, and how many lines come before the first row of numbers."""

    names: list[str]
    before: int
    delimiter: str


def read_record(
    path: str | os.PathLike[str], column: str | None = None, rate: float | None = None, unit: str = "deg/s"
) -> Record:
    """The record in a CSV file, with a line of names or without: its columns then are 1, 2, and so on.

    `column`: need not be given where there is only one but the time. `rate`: in Hz; need not be given where a column
    is called time, timestamp or t, in seconds or the unit that its name ends with, as in `time [ns]`. Commas,
    semicolons or tabs separate columns; lines that begin with # are comments, but for the names.
    Raises ValueError in one sentence for what is not a record of evenly spaced, finite numbers.
    """
    if unit not in RATES:
        raise ValueError(f"unit is {shown(unit)}: it must be one of {', '.join(RATES)}")
    interval = None if rate is None else 1 / number("rate", rate, above=0.0)
    try:
        check_regular(path)
        with open(path, "rb") as file:
            layout = _layout(file.read(BEGINNING))
        times = [name for name in layout.names if TIME.fullmatch(name)] if interval is None else []
        chosen = _chosen(path, layout, column)
        if interval is None and not times:
            raise ValueError(f"rate is not given: it must be, in Hz, as {path} has no column of the name time")
        columns = _numbers(path, layout, [chosen, *times[:1]])
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {reason(error)}") from None
    values = columns[0]
    if len(values) < 2 * MIN_RECORD:
        raise ValueError(f"{path} has {len(values)} rows: it must have at least {2 * MIN_RECORD}")
    if (values == values[0]).all():
        raise ValueError(f"{path}: {chosen} is {values[0]:g} in every row: it must vary")
    if interval is None:
        interval = _interval(path, layout, times[0], columns[1])
    values /= RATES[unit].per_si
    return Record(chosen, values, interval)


def _layout(beginning: bytes) -> _Layout:
    lines = beginning.decode("utf-8-sig", "replace").splitlines()
    comments = sum(1 for _ in takewhile(lambda line: line.startswith("#") or not line.strip(), lines))
    first = lines[comments] if comments < len(lines) else ""
    delimiter = max(",;\t", key=first.count)
    count = first.count(delimiter) + 1
    if not all(map(_is_number, first.split(delimiter))):
        return _Layout(_names(first, delimiter), comments + 1, delimiter)
    above = lines[comments - 1] if comments else ""
    if above.startswith("#") and above.count(delimiter) + 1 == count:
        return _Layout(_names(above, delimiter), comments, delimiter)
    return _Layout([str(i + 1) for i in range(count)], comments, delimiter)


def _names(line: str, delimiter: str) -> list[str]:
    return [name.strip().strip('"').strip() for name in line.removeprefix("#").split(delimiter)]


def _is_number(text: str) -> bool:
    try:
        float(text.strip().strip('"') or "nan")
    except ValueError:
        return False
    return True


def _chosen(path: str | os.PathLike[str], layout: _Layout, column: str | None) -> str:
    others = [name for name in layout.names if not TIME.fullmatch(name)]
    if column is None and len(others) == 1:
        return others[0]
    if column is None or column not in layout.names:
        given = "not given" if column is None else shown(column)
        more = ", ..." if len(others) > MOST_NAMED else ""
        allowed = ", ".join(map(cut, others[:MOST_NAMED])) + more
        raise ValueError(f"column is {given}: it must be one of those of {path}: {allowed}")
    if layout.names.count(column) > 1:
        raise ValueError(
            f"column is {shown(column)}: {path} must have one of that name, not {layout.names.count(column)}"
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
    convert = pyarrow.csv.ConvertOptions(include_columns=places, column_types=dict.fromkeys(places, pa.float64()))
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


def _interval(path: str | os.PathLike[str], layout: _Layout, name: str, times: Array) -> float:
    """Mean interval of evenly spaced times, s."""
    matched = TIME.fullmatch(name)
    scale = SECONDS.get((matched[1] or "").lower(), 1.0) if matched else 1.0
    steps = np.diff(times)
    median = float(np.median(steps))
    off = np.abs(steps - median) > UNEVEN * median if median > 0 else np.ones(len(steps), dtype=bool)
    if off.any():
        at = int(np.argmax(off))
        raise ValueError(
            f"{path}, line {layout.before + at + 2}: {name} is {steps[at]:g} later than in the line before: it must be "
            f"{median:g} later, as in most lines, to one half; fill the gap, or give the rate"
            if median > 0
            else f"{path}: {name} does not rise from line to line: it must, or give the rate"
        )
    return float(times[-1] - times[0]) / (len(times) - 1) * scale
