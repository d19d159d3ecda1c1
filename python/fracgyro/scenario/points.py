"""Points in time of a scenario: lists [time, value, ...] whose times rise, given as such or as a CSV file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

from pydantic import PlainValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from ..files import read_input, reason
from .table import message_error, toml_value
from .units import Quantity

MAX_POINTS = 100_000
Points = tuple[tuple[float, float], ...]
Rows = tuple[tuple[float, float, float], ...]
COUNTS = {2: ("pairs", "two"), 3: ("rows", "three")}  # words for the numbers of a point


class Hashed(tuple[Any, ...]):
    """Plain numbers whose hash is computed once: scenarios are looked up by theirs."""

    def __hash__(self) -> int:
        found: int | None = self.__dict__.get("hash")
        if found is None:
            found = self.__dict__["hash"] = super().__hash__()
        return found


@dataclass(frozen=True)
class AsPoints:
    """Tuples of numbers from lists; `names`: of the columns."""

    names: tuple[str, ...]

    def __call__(self, value: Any) -> tuple[tuple[float, ...], ...] | None:
        if value is None or isinstance(value, Hashed):
            return value
        each = f"{COUNTS[len(self.names)][0]} [{', '.join(self.names)}]"
        rule = f"it must be a list of 1 to {MAX_POINTS} {each} of finite numbers whose times rise"
        problem = PydanticCustomError("rule", "{rule}", {"rule": rule})
        if not isinstance(value, list | tuple) or not 1 <= len(value) <= MAX_POINTS:
            raise problem
        for point in value:
            if not isinstance(point, list | tuple) or len(point) != len(self.names):
                raise problem
            for number in point:
                if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                    raise problem
        if any(not after[0] > before[0] for before, after in pairwise(value)):
            raise problem
        kept = (tuple(n if isinstance(n, Quantity) else float(n) + 0.0 for n in point) for point in value)  # no -0.0
        quantities = any(isinstance(number, Quantity) for point in value for number in point)
        return tuple(kept) if quantities else Hashed(kept)


def _schema(count: int) -> dict[str, Any]:
    point = {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}
    return {"type": "array", "items": point, "minItems": 1, "maxItems": MAX_POINTS}


OptionalPoints = Annotated[Points | None, PlainValidator(AsPoints(("time", "value"))), WithJsonSchema(_schema(2))]
OptionalRows = Annotated[Rows | None, PlainValidator(AsPoints(("time", "x", "y"))), WithJsonSchema(_schema(3))]


def read_file(values: Any, table: str, field: str, points: str, columns: tuple[str, ...]) -> Any:
    """The table with the points that its file holds in place of the file: a scenario depends on nothing outside it."""
    if not isinstance(values, Mapping) or not isinstance(values.get(field), str):
        return values
    if values.get(points) is not None:
        raise message_error(f"{table}.{field} and {table}.{points} are both given: at most one of the two can be")
    read = read_points(values[field], f"{table}.{field}", columns)
    return {**values, field: None, points: read}


def read_points(path: str, name: str, columns: tuple[str, ...]) -> list[list[float]]:
    """Rows of a CSV file whose header is `time` and the columns. Raises, in one sentence, when it is not one.

    The sentence shows nothing of the file: a scenario from elsewhere may name any.
    """
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
    wanted = ("time", *columns)
    if header != list(wanted):
        raise message_error(f"{place}: its first line must be {','.join(wanted)!r}")
    found: list[list[float]] = []
    for line, row in enumerate(rows, start=2):
        try:
            point = list(map(float, row))
            if len(point) != len(wanted) or not all(map(math.isfinite, point)):
                raise ValueError
        except ValueError:
            count = COUNTS[len(wanted)][1]
            raise message_error(f"{place}: row {line} must be {count} finite numbers") from None
        if found and not point[0] > found[-1][0]:
            raise message_error(f"{place}: row {line}: times must rise from row to row")
        found.append(point)
    return found
