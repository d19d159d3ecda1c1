"""The points of a design, in 8 bytes for each value that is drawn or listed, and none for those of a grid."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ..space import Dimension

AT_ONCE = 4096  # points that are tuples at a time

Point = tuple[Any, ...]


@dataclass(frozen=True)
class Column:
    """The values of one field at all points."""

    drawn: NDArray[Any]
    choices: tuple[Any, ...] | None = None  # then `drawn` has their places

    def values(self, begin: int, end: int) -> list[Any]:
        found: list[Any] = self.drawn[begin:end].tolist()
        return found if self.choices is None else [self.choices[place] for place in found]

    def cut(self, begin: int, end: int) -> Column:
        return replace(self, drawn=self.drawn[begin:end])


@dataclass(frozen=True)
class GridColumn:
    """The same in a grid: each choice `stride` times, all again and again."""

    choices: tuple[Any, ...]
    stride: int
    first: int = 0

    def values(self, begin: int, end: int) -> list[Any]:
        places = np.arange(self.first + begin, self.first + end) // self.stride % len(self.choices)
        return [self.choices[place] for place in places.tolist()]

    def cut(self, begin: int, end: int) -> GridColumn:
        return replace(self, first=self.first + begin)


class Points(Sequence[Point]):
    """Tuples of the values of all fields. A slice of it shares its arrays, and is sent without the rest of them."""

    def __init__(self, columns: Sequence[Column | GridColumn], count: int) -> None:
        self._columns, self._count = tuple(columns), count

    @classmethod
    def grid(cls, axes: Sequence[tuple[Any, ...]]) -> Points:
        """Every combination, the last axis fastest."""
        lengths = [len(axis) for axis in axes]
        strides = [math.prod(lengths[place + 1 :]) for place in range(len(axes))]
        return cls(list(map(GridColumn, axes, strides)), math.prod(lengths))

    @classmethod
    def listed(cls, axes: Sequence[tuple[Any, ...]]) -> Points:
        """Axes of equal length, side by side."""
        count = len(axes[0])
        return cls([Column(np.arange(count), axis) for axis in axes], count)

    @classmethod
    def drawn(cls, dimensions: Sequence[Dimension], units: NDArray[np.float64]) -> Points:
        """Each dimension's values at its column of `units`, (points, dimensions), from 0 to below 1."""
        columns = [Column(d.at_each(of), d.choices) for d, of in zip(dimensions, units.T, strict=True)]
        return cls(columns, len(units))

    def column(self, place: int) -> list[Any]:
        """The values of one field at all points."""
        return self._columns[place].values(0, self._count)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, key: int) -> Point: ...
    @overload
    def __getitem__(self, key: slice) -> Points: ...
    def __getitem__(self, key: int | slice) -> Point | Points:
        if isinstance(key, slice):
            begin, end, step = key.indices(self._count)
            if step != 1:
                raise ValueError(f"the step of a slice is {step}: it must be 1")
            end = max(begin, end)
            return Points([column.cut(begin, end) for column in self._columns], end - begin)
        at = range(self._count)[key]
        return tuple(column.values(at, at + 1)[0] for column in self._columns)

    def __iter__(self) -> Iterator[Point]:
        for begin in range(0, self._count, AT_ONCE):
            end = min(begin + AT_ONCE, self._count)
            if not self._columns:
                yield from [()] * (end - begin)
            yield from zip(*(column.values(begin, end) for column in self._columns), strict=True)
