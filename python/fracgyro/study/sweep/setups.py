"""Set-ups of a study's points: those of few scenarios, patched where only numbers vary from which nothing follows."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from functools import lru_cache
from itertools import starmap
from typing import Any

from ... import _core
from ...scenario import Scenario, ScenarioError
from ...scenario.patched import Patch, are_valid, patched_fields
from ...scenario.table import format_value
from ..controller import fields_of_scenario
from ..space import Dimension
from .point_columns import Point, Points

KEPT = 256  # scenarios, each with its set-up


def fields_to_patch(base: Scenario, dimensions: Sequence[Dimension]) -> tuple[str, ...]:
    """The fields whose values are known to be valid, column by column, and are set in set-ups of other points."""
    own = patched_fields(base, [dimension.field for dimension in dimensions])
    columns = {dimension.field: dimension.extremes() for dimension in dimensions if dimension.field in own}
    return tuple(own) if are_valid(base, columns) else ()


def scenario_of(base: Scenario, number: int, fields: Sequence[str], point: Point) -> Scenario:
    """The scenario of a point. Raises ScenarioError, with the point's number and values, if it is invalid."""
    values = dict(zip(fields, point, strict=True))
    try:
        return base.replace(fields_of_scenario(values))
    except ScenarioError as error:
        where = ", ".join(f"{field} = {format_value(value)}" for field, value in values.items())
        raise ScenarioError(f"point {number} ({where}) cannot run: {error}") from None


class Setups:
    """Scenarios and set-ups of points with values of `fields`, of which `patched` were valid by columns."""

    def __init__(self, base: Scenario, fields: Sequence[str], patched: Sequence[str]) -> None:
        self._base, self._fields = base, list(fields)
        self._patched = [field for field in fields if field in patched]
        self._own = [fields.index(field) for field in self._patched]
        self._rest = [place for place, field in enumerate(fields) if field not in patched]
        self._kept = lru_cache(KEPT)(self._alike)

    def alike(self, number: int, point: Point) -> Scenario:
        """The scenario of a point but for the patched fields; the same object as for the points before if it is equal.

        Raises ScenarioError, with the point's number and values, if it is invalid.
        """
        return self._of(number, point)[0]

    def setup(self, number: int, point: Point) -> _core.DeviceSetup:
        """Set-up of the scenario of a point, bit for bit."""
        scenario, patches = self._of(number, point)
        if not patches:
            patches.append(Patch(scenario, self._patched))
        return patches[0].setup(tuple(point[place] for place in self._own))

    def each(self, first: int, points: Points) -> Iterator[_core.DeviceSetup]:
        """`setup` of consecutive points, of which `first` is the number of the first one."""
        if self._rest:
            return starmap(self.setup, enumerate(points, first))
        return Patch(self._base, self._patched).setups(points)

    def _of(self, number: int, point: Point) -> tuple[Scenario, list[Patch]]:
        rest = tuple(point[place] for place in self._rest)
        try:
            # Equal values of different types, as 1 and True, are different points.
            return self._kept(rest, tuple(map(type, rest))) if _hashable(rest) else self._alike(rest, ())
        except ScenarioError:
            scenario_of(self._base, number, self._fields, point)
            raise

    def _alike(self, rest: Point, _: Hashable) -> tuple[Scenario, list[Patch]]:
        values = dict(zip((self._fields[place] for place in self._rest), rest, strict=True))
        return self._base.replace(fields_of_scenario(values)) if values else self._base, []


def _hashable(value: Any) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True
