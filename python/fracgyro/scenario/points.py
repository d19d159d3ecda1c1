"""Rows of numbers in a scenario: functions of time and spectra, as lists or in CSV files."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

from pydantic import PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from ..files import cut, read_input, reason
from .table import message_error, toml_value
from .units import EXACT, Quantity, UnitError

MAX_POINTS = 100_000
NUMBERS = {1: "one", 2: "two", 3: "three"}
LISTS = {2: "pairs", 3: "triples"}
HEAD = re.compile(r"(\w+)(?: *\((.+)\))?")  # head of a column: its name, and a unit
PLURALS = {"time": "times", "frequency": "frequencies"}


class Hashed(tuple[Any, ...]):
    """Plain numbers whose hash is computed once: scenarios are looked up by theirs."""

    def __hash__(self) -> int:
        found: int | None = self.__dict__.get("hash")
        if found is None:
            found = self.__dict__["hash"] = super().__hash__()
        return found


@dataclass(frozen=True)
class Rows:
    """Validates rows of as many numbers as `names`, of which the first rises.

    `positive`: numbers whose ratios and powers are finite and greater than 0.
    """

    names: str
    least: int = 1
    positive: bool = False

    def __call__(self, value: Any) -> tuple[tuple[float, ...], ...] | None:
        if value is None or isinstance(value, Hashed):
            return value
        first, *_ = names = self.names.split(", ")
        least, most = (1e-60, 1e60) if self.positive else (-math.inf, math.inf)
        numbers = f"numbers from {least:g} to {most:g}" if self.positive else "finite numbers"
        rule = (
            f"it must be a list of {self.least} to {MAX_POINTS} {LISTS[len(names)]} [{self.names}] of {numbers} whose "
            f"{PLURALS[first]} rise"
        )
        problem = PydanticCustomError("rule", "{rule}", {"rule": rule})
        if not isinstance(value, list | tuple) or not self.least <= len(value) <= MAX_POINTS:
            raise problem
        for row in value:
            if not isinstance(row, list | tuple) or len(row) != len(names):
                raise problem
            for number in row:
                if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                    raise problem
                if not least <= number <= most:
                    raise problem
        if any(not after[0] > before[0] for before, after in pairwise(value)):
            raise problem
        kept = (tuple(n if isinstance(n, Quantity) else float(n) + 0.0 for n in row) for row in value)  # no -0.0
        return tuple(kept) if any(isinstance(n, Quantity) for row in value for n in row) else Hashed(kept)

    def schema(self) -> WithJsonSchema:
        """The rows in JSON Schema."""
        count = len(self.names.split(", "))
        row = {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}
        return WithJsonSchema({"type": "array", "items": row, "minItems": self.least, "maxItems": MAX_POINTS})


PAIRS, TRIPLES = Rows("time, value"), Rows("time, x, y")
SPECTRUM = Rows("frequency, density", least=2, positive=True)
Points = tuple[tuple[float, float], ...]
Triples = tuple[tuple[float, float, float], ...]
OptionalPoints = Annotated[Points | None, PlainValidator(PAIRS), PAIRS.schema()]
OptionalTriples = Annotated[Triples | None, PlainValidator(TRIPLES), TRIPLES.schema()]
OptionalSpectrum = Annotated[Points | None, PlainValidator(SPECTRUM), SPECTRUM.schema()]


class PointsFile(NamedTuple):
    """A field of a table that names a CSV file, the field that takes its rows, and the columns of the file."""

    field: str
    points: str
    columns: tuple[str, ...]

    @property
    def header(self) -> str:
        return ",".join(self.columns)


FILES = {
    "reference": PointsFile("file", "points", ("time", "x", "y")),
    "disturbance": PointsFile("file", "points", ("time", "x", "y")),
    "rate": PointsFile("file", "points", ("time", "rate")),
    "device": PointsFile("temperature_file", "temperature_points", ("time", "temperature")),
}
# The factor of a column, by its place and the unit in its head, which may have none; None: its numbers are as they are.
Factor = Callable[[int, str | None], Decimal | None]


def with_rows(table: Mapping[str, Any], of: PointsFile, path: str, factor: Factor) -> dict[str, Any]:
    """The table with the points that its file holds in place of the file: a scenario depends on nothing outside it.

    `path`: of the table. Raises PydanticCustomError, in one sentence, for a file that does not have such rows.
    """
    name = f"{path}.{of.field}"
    if table.get(of.points) is not None:
        raise message_error(f"{name} and {path}.{of.points} are both given: at most one of the two can be")
    others = {field: value for field, value in table.items() if field != of.field}
    return {**others, of.points: _read(table[of.field], name, of, factor)}


def _read(path: str, name: str, of: PointsFile, factor: Factor) -> list[list[float]]:
    """The rows of a file. Messages show nothing of it but its units: a scenario from elsewhere may name any."""
    place = f"{name} is {toml_value(path)}"
    try:
        text = io.StringIO(read_input(path).decode("utf-8-sig"), newline="")
        header, *rows = [[cell.strip() for cell in row] for row in csv.reader(text) if row] or [[]]
    except UnicodeDecodeError:
        raise message_error(f"{place}: it cannot be read: it is not UTF-8") from None
    except OSError as error:
        raise message_error(f"{place}: it cannot be read: {reason(error)}") from None
    except (ValueError, csv.Error) as error:
        raise message_error(f"{place}: it cannot be read: {error}") from None
    heads = [HEAD.fullmatch(cell) for cell in header]
    if tuple(head and head[1] for head in heads) != of.columns:
        raise message_error(
            f"{place}: its first line must be '{of.header}', where a unit may follow each name in parentheses, as in "
            "'time (ms)'"
        )
    factors = []
    for column, head in enumerate(filter(None, heads)):
        try:
            factors.append(factor(column, head[2]))
        except UnitError as error:
            raise message_error(f"{place}: its column {head[1]} is in {cut(str(head[2]))}: {error}") from None
    found: list[list[float]] = []
    for line, row in enumerate(rows, start=2):
        try:
            numbers = list(map(float, row))
            if len(numbers) != len(factors) or not all(map(math.isfinite, numbers)):
                raise ValueError
            for column, by in enumerate(factors):
                if by is not None:  # in decimals, as text with a unit
                    numbers[column] = float(EXACT.multiply(EXACT.create_decimal(row[column]), by))
            if not all(map(math.isfinite, numbers)):
                raise ValueError
        except ValueError:
            raise message_error(f"{place}: row {line} must be {NUMBERS[len(factors)]} finite numbers") from None
        if found and not numbers[0] > found[-1][0]:
            raise message_error(f"{place}: row {line}: times must rise from row to row")
        found.append(numbers)
    return found
