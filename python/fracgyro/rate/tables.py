"""Reading tables of numbers from loggers, spreadsheets and programs: column names and selected columns.

Supported are text with any separator, comments and free text above the table, units in a line or in brackets, decimal
commas, compression and UTF-16; and NumPy's .npy, MATLAB's .mat and Parquet. The first bytes determine the format, not
the name. pyarrow reads the numbers; this module finds the layout (decision 0034).
"""

from __future__ import annotations

import bz2
import csv
import gzip
import io
import lzma
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from ..arguments import short
from ..files import cut

Array = NDArray[np.float64]

BLOCK = 2**22  # bytes read at a time
BEGINNING = 2**16  # bytes in which comments, names and the first rows must fit
ROWS = 20  # rows of numbers used to find the layout
MIN_ROWS = 2
BLANKS = " "  # separator: any run of blanks
COMMENT = re.compile(r"^\s*(#|//|%|!|;(?=\s|$))\s?")
LINE_END = re.compile(r"\r\n|\n|\r")  # str.splitlines also splits at other characters, such as the vertical tab
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)
FRACTION = re.compile(r"-0+,\d+|[+-]?\d+,0\d+")  # integers are not written as -0 or 05
UNIT = re.compile(r"[\[(]?[\wµμ°%]{0,8}([/*^·. -]?[\w°√()^-]{1,9}){0,3}[\])]?")
EMPTY = {"", "nan", "na", "n/a", "null", "none", "-"}
OPENERS: dict[bytes, Callable[[Any], Any]] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\x00": lzma.open}
# First bytes of files that are not tables or cannot be read.
OTHERS = {
    b"PK\x03\x04": "a zip archive or a spreadsheet: save its table as CSV",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet: save its table as CSV",
    b"\x89HDF": "an HDF5 file, as MATLAB writes with -v7.3: save it as CSV, or in MATLAB with -v7",
    b"SQLite format 3": "an SQLite database, as of ROS 2: export the topic as CSV",
    b"#ROSBAG": "a ROS bag: export the topic, as with rostopic echo -p",
    b"\x89MCAP": "an MCAP file: export the topic as CSV",
    b"%PDF": "a PDF",
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
    b"ARROW1": "an Arrow file: save it as Parquet or CSV",
    b"{": "JSON: save its numbers as CSV",
    b"[{": "JSON: save its numbers as CSV",
    b"<": "XML or HTML: save its numbers as CSV",
    b"\x7fELF": "a program",
}


@dataclass(frozen=True)
class Table:
    """Column names of a file, and a function that reads selected columns."""

    path: str
    names: list[str]
    read: Callable[[Sequence[int]], tuple[list[Array], list[str]]]  # columns by number, and notes
    before: int = 0  # lines of text before the first row
    known: dict[int, str] = field(default_factory=dict)  # units by column, from a line below the names


def open_table(path: str | os.PathLike[str]) -> Table:
    """A file's columns. Raises ValueError for a file that is not a table, OSError if it cannot be read."""
    where = os.fspath(path)
    with open(path, "rb") as file:
        first = file.read(BEGINNING)
    if first.startswith(b"\x93NUMPY"):
        return _of_array(where, "a NumPy array", _loaded(where, "a NumPy array", lambda: np.load(path, mmap_mode="r")))
    if first.startswith(b"MATLAB 5.0"):
        return _of_matlab(where)
    if first.startswith(b"PAR1"):
        return _of_parquet(where)
    for beginning, words in OTHERS.items():
        if first.lstrip().startswith(beginning) and not _is_text_of_numbers(first):
            raise ValueError(f"{where} is {words}")
    return _of_text(where, first)


def _is_text_of_numbers(first: bytes) -> bool:
    """True if the first bytes of another format are only free text above a table."""
    return first.lstrip()[:1] in b"<{" and first.count(b"\n") > MIN_ROWS and b"}" not in first and b">" not in first


# -- Text --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Layout:
    names: list[str]
    units: dict[int, str]
    before: int  # lines before the first row of numbers
    separator: str
    decimal: str  # decimal separator
    columns: int


def _of_text(path: str, first: bytes) -> Table:
    opener = next((each for beginning, each in OPENERS.items() if first.startswith(beginning)), None)
    if opener is not None:
        try:
            with opener(path) as file:
                first = file.read(BEGINNING)
        except (OSError, EOFError, lzma.LZMAError) as error:
            raise ValueError(f"{path} cannot be unpacked: {cut(str(error))}") from None
    encoding = _encoding(first)
    if encoding is None:
        raise ValueError(f"{path} is not a supported file: save its table as CSV")
    layout = _layout(path, first.decode(encoding, "replace"), len(first) == BEGINNING)

    def read(columns: Sequence[int]) -> tuple[list[Array], list[str]]:
        return _numbers(path, opener, encoding, layout, columns)

    return Table(path, layout.names, read, layout.before, layout.units)


def _encoding(first: bytes) -> str | None:
    if first.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        first.decode("utf-8")
        plain = True
    except UnicodeDecodeError as error:
        plain = error.start > len(first) - 4  # a character cut at the end
    zeros = first[:400].count(0)
    if zeros > len(first[:400]) // 3:
        return "utf-16-le" if first[1:2] == b"\0" else "utf-16-be"
    if zeros:
        return None
    return "utf-8-sig" if plain else "cp1252"


def _layout(path: str, beginning: str, cut_off: bool) -> _Layout:
    lines = LINE_END.split(beginning.lstrip("\ufeff"))
    if cut_off or (lines and not lines[-1]):
        lines = lines[:-1]
    if not any(line.strip() for line in lines):
        raise ValueError(f"{path} has 0 rows: it must have at least 20")
    found = [each for separator in (",", ";", "\t", "|", BLANKS) if (each := _rows(lines, separator)) is not None]
    if not found:
        raise ValueError(
            f"{path} has no rows of numbers: it must be a table with columns separated by commas, semicolons, tabs or "
            "blanks"
        )
    # Prefer as many names as columns, then most numbers per row, then a separator that numbers do not contain.
    found.sort(key=lambda each: (_heads_fit(lines[: each[1]], each[2], each[3]), each[0]))
    _, begin, separator, columns, decimal = found[-1]
    if separator == "," and columns == 2 and begin == _heading(lines, begin) and _ambiguous(lines[begin:]):
        raise ValueError(
            f"{path} has no column names, and a comma in its rows may be a separator or a decimal comma: it must have "
            "decimal points, or a first line with the names of its columns"
        )
    names, units = _named(lines[:begin], separator, columns)
    return _Layout(names, units, begin, separator, decimal, columns)


def _rows(lines: list[str], separator: str) -> tuple[tuple[float, ...], int, str, int, str] | None:
    """Score, first row, decimal separator and columns of the table with this separator, or None."""
    decimal = "."
    split = [_split(line, separator) for line in lines]
    for sign in (".",) if separator == "," else (".", ","):
        numeric = [[_is_number(each, sign) for each in fields] for fields in split]
        for i in range(len(lines)):
            if not any(numeric[i]) or COMMENT.match(lines[i]):
                continue
            block = [k for k in range(i, len(lines)) if lines[k].strip()][:ROWS]
            widths = [len(split[k]) for k in block]
            width = max(set(widths), key=widths.count)
            alike = [k for k in block if len(split[k]) == width]
            if len(split[i]) != width or len(alike) < max(MIN_ROWS, 0.7 * len(block)):
                continue
            full = [column for column in range(width) if any(numeric[k][column] and split[k][column] for k in alike)]
            good = [
                column for column in full if all(numeric[k][column] or split[k][column].lower() in EMPTY for k in alike)
            ]
            if not good or not any(numeric[i][column] for column in good):
                continue
            comma = sign == "," and any("," in split[k][column] for k in alike for column in good)
            if sign == "," and not comma:
                continue
            decimal = sign
            first = i
            score = (len(good) / width >= 0.5, len(good), -first, separator != ",", separator != BLANKS)
            return (tuple(map(float, score)), first, separator, width, decimal)
    return None


def _split(line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return line.split()
    try:
        fields = next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        fields = line.split(separator)
    return [each.strip() for each in fields]


def _is_number(text: str, decimal: str = ".") -> bool:
    return NUMBER.fullmatch(text.replace(",", ".", 1) if decimal == "," else text) is not None


def _heading(lines: list[str], begin: int) -> int:
    """Number of lines above the first row, at its start, that are empty or comments."""
    return sum(1 for line in lines[:begin] if not line.strip() or COMMENT.match(line))


def _heads_fit(above: list[str], separator: str, columns: int) -> bool:
    """True if the line above the first row has `columns` fields, or does not exist."""
    last = next((line for line in reversed(above) if line.strip()), "")
    return not last or separator == BLANKS or len(_split(COMMENT.sub("", last), separator)) == columns


def _ambiguous(rows: list[str]) -> bool:
    return any(FRACTION.fullmatch(row.strip()) for row in rows)


def _named(above: list[str], separator: str, columns: int) -> tuple[list[str], dict[int, str]]:
    """Column names, or numbers without names, and the units in a line below the names."""
    heads = [_heads(line, separator, columns) for line in above]
    last = len(heads) - 1
    while last >= 0 and not above[last].strip():
        last -= 1
    if last < 0 or heads[last] is None:
        return [str(i + 1) for i in range(columns)], {}
    names, units = heads[last], {}
    assert names is not None
    over = heads[last - 1] if last else None
    if over is not None and all(each == "" or UNIT.fullmatch(each) for each in names) and _are_units(names):
        units = {i: unit.strip("[]()") for i, unit in enumerate(names) if unit}
        names = over
    return [name or f"#{i + 1}" for i, name in enumerate(names)], units


def _are_units(names: Sequence[str]) -> bool:
    """True if most fields of a line are units, such as s, [deg/s], (rad/s) or g."""
    known = re.compile(r"[\[(].*[\])]|s|sec|ms|us|µs|ns|g|m/s\^?2|V|A|K|C|°C|hz|\S*(deg|rad|dps|°)\S*", re.IGNORECASE)
    given = [name for name in names if name]
    return bool(given) and sum(known.fullmatch(name) is not None for name in given) >= 0.6 * len(given)


def _heads(line: str, separator: str, columns: int) -> list[str] | None:
    """The line as names of `columns` columns, or None."""
    text = COMMENT.sub("", line)
    if not text.strip():
        return None
    ways = [text.split("\t"), re.split(r"\s{2,}|\t", text.strip()), text.split()] if separator == BLANKS else []
    ways = ways or [_split(text, separator)]
    if separator == "\t":
        ways.append(text.split())
    for fields in ways:
        names = [each.strip().strip('"').strip() for each in fields]
        if len(names) == columns + 1 and not names[-1]:
            names = names[:-1]
        if len(names) == columns - 1 and columns > 1:
            names = [*names, ""]  # every row ends in a separator
        if len(names) == columns and any(names) and not all(_is_number(each) for each in names if each):
            return names
    return None


class _Cleaned(io.RawIOBase):
    """A text file converted for pyarrow: UTF-8, one blank between fields, none before the first."""

    def __init__(self, file: IO[bytes], encoding: str, separator: str) -> None:
        self._text = io.TextIOWrapper(file, encoding=encoding, errors="replace", newline="")
        self._blanks = separator == BLANKS
        self._rest = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if not self._rest:
            text = self._text.read(BLOCK) if not self._blanks else self._text.read(BLOCK) + self._text.readline()
            if self._blanks:
                text = re.sub(r"[ \t]+", "\t", text)
                text = re.sub(r"(?m)^\t|\t(?=\r?$)", "", text)
            self._rest = text.encode()
        count = min(len(buffer), len(self._rest))
        buffer[:count] = self._rest[:count]
        self._rest = self._rest[count:]
        return count


@contextmanager
def _opened(path: str, opener: Callable[[Any], Any] | None, encoding: str, separator: str) -> Iterator[Any]:
    """Source for pyarrow: the file itself if it can read it, else the converted text."""
    if opener is None and encoding == "utf-8-sig" and separator != BLANKS:
        yield path
        return
    with opener(path) if opener is not None else open(path, "rb") as file:
        yield file if encoding == "utf-8-sig" and separator != BLANKS else _Cleaned(file, encoding, separator)


def _numbers(
    path: str, opener: Callable[[Any], Any] | None, encoding: str, layout: _Layout, wanted: Sequence[int]
) -> tuple[list[Array], list[str]]:
    """The columns, NaN for an empty field, and notes on excluded rows."""
    places = [f"f{i}" for i in wanted]
    odd: list[tuple[int | None, int, str]] = []

    def handle(row: pyarrow.csv.InvalidRow) -> str:
        text = row.text or ""
        if not COMMENT.match(text) or _is_number(text.strip()[:1]):
            odd.append((row.number, row.actual_columns, text))
        return "skip" if len(odd) < 2 or COMMENT.match(text) else "error"

    read = pyarrow.csv.ReadOptions(
        column_names=[f"f{i}" for i in range(layout.columns)],
        skip_rows=layout.before,
        block_size=BLOCK,
        use_threads=False,  # for line numbers in errors
    )
    convert = pyarrow.csv.ConvertOptions(
        include_columns=places,
        column_types=dict.fromkeys(places, pa.float64()),
        decimal_point=layout.decimal,
        null_values=["", "-", "NA", "N/A", "n/a", "na", "null", "NULL", "None", "none", "#N/A", "nan", "NaN", "NAN"],
        strings_can_be_null=True,
    )
    separator = "\t" if layout.separator == BLANKS else layout.separator
    parse = pyarrow.csv.ParseOptions(delimiter=separator, invalid_row_handler=handle)
    parts: list[list[Array]] = [[] for _ in wanted]
    rows = 0
    try:
        with _opened(path, opener, encoding, layout.separator) as source:
            for batch in pyarrow.csv.open_csv(source, read, parse, convert):
                rows += batch.num_rows
                for part, values in zip(parts, batch.columns, strict=True):
                    part.append(values.to_numpy(zero_copy_only=False))
    except pa.ArrowInvalid as error:
        raise ValueError(_refusal(path, layout, str(error), odd)) from None
    except (EOFError, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise ValueError(f"{path} cannot be unpacked: {cut(str(error))}") from None
    columns = [np.concatenate(part) if part else np.empty(0) for part in parts]
    notes = []
    for number, actual, _ in odd:
        if number is None or number < layout.before + rows:
            raise ValueError(f"{path}, line {number}: it has {actual} columns: it must have {layout.columns}")
        notes.append(f"the last row has {actual} of {layout.columns} columns and is excluded")
    return columns, notes


def _refusal(path: str, layout: _Layout, error: str, odd: list[tuple[int | None, int, str]]) -> str:
    value = re.search(r"CSV column #(\d+): Row #(\d+): .*invalid value '(.*)'", error, re.DOTALL)
    if value:
        name = layout.names[int(value[1])] if int(value[1]) < len(layout.names) else value[1]
        return f"{path}, line {value[2]}: {cut(name)} is {short(value[3])}: it must be a finite number"
    if odd:
        number, actual, _ = odd[0]
        return f"{path}, line {number}: it has {actual} columns: it must have {layout.columns}"
    if "Empty CSV" in error:
        return f"{path} has 0 rows: it must have at least 20"
    return f"{path} cannot be read as CSV: {cut(error)}"


# -- Files of numbers --------------------------------------------------------------------------------------------------


def _loaded(path: str, kind: str, load: Callable[[], Any]) -> Any:
    try:
        return load()
    except (ValueError, EOFError, TypeError, NotImplementedError, pa.ArrowException) as error:
        raise ValueError(f"{path} is {kind} that cannot be read: {cut(str(error))}") from None


def _of_array(path: str, kind: str, array: Any) -> Table:
    if array.dtype.names:
        columns = {name: array[name] for name in array.dtype.names}
        return _of_columns(path, kind, columns)
    if array.ndim > 2:
        raise ValueError(f"{path} is {kind} of shape {array.shape}: it must have rows and columns")
    flat = array.reshape(-1, 1) if array.ndim < 2 else array
    if flat.shape[0] < flat.shape[1]:
        flat = flat.T  # the longer axis is time
    return _of_columns(path, kind, {str(i + 1): flat[:, i] for i in range(flat.shape[1])})


def _of_columns(path: str, kind: str, columns: dict[str, Any]) -> Table:
    names = list(columns)

    def read(wanted: Sequence[int]) -> tuple[list[Array], list[str]]:
        found = []
        for i in wanted:
            values = np.asarray(columns[names[i]])
            if values.dtype.kind not in "iufb":
                raise ValueError(f"{path}: {names[i]} holds {values.dtype}: it must hold numbers")
            found.append(values.astype(np.float64))
        return found, []

    return Table(path, names, read)


def _of_matlab(path: str) -> Table:
    from scipy.io import loadmat

    content = _loaded(path, "a MATLAB file", lambda: loadmat(path))
    columns: dict[str, Any] = {}
    for name, value in content.items():
        if name.startswith("__") or not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
            continue
        array = value.squeeze()
        if array.ndim == 1 and len(array) > 1:
            columns[name] = array
        elif array.ndim == 2:
            long = array if array.shape[0] >= array.shape[1] else array.T
            columns |= {f"{name}.{i + 1}": long[:, i] for i in range(long.shape[1])}
    longest = max((len(values) for values in columns.values()), default=0)
    columns = {name: values for name, values in columns.items() if len(values) == longest}
    if not columns:
        raise ValueError(f"{path} is a MATLAB file without a vector or a matrix of numbers")
    return _of_columns(path, "a MATLAB file", columns)


def _of_parquet(path: str) -> Table:
    import pyarrow.parquet

    file = _loaded(path, "a Parquet file", lambda: pyarrow.parquet.ParquetFile(path))
    names = list(file.schema_arrow.names)

    def read(wanted: Sequence[int]) -> tuple[list[Array], list[str]]:
        found = []
        for i in wanted:
            column = file.read(columns=[names[i]]).column(0)
            if pa.types.is_timestamp(column.type):
                column = column.cast(pa.int64())
            if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
                raise ValueError(f"{path}: {names[i]} holds {column.type}: it must hold numbers")
            found.append(column.cast(pa.float64(), safe=False).to_numpy().astype(np.float64))
        return found, []

    return Table(path, names, read)
