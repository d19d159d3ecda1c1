"""Set-ups of scenarios that differ from a base in few fields: the base's parts, with the numbers that vary.

Only fields from which nothing else follows are set so: their numbers in the core, and for the order the exponentials.
Every other field makes a set-up of its own, from a scenario that is validated as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any

import numpy as np

from .. import _core
from ..fractional.kernel import core_kernel
from .kinds import Number, core_values, numbers
from .quantities import EXPONENTS, texts_of
from .scenario import Scenario
from .to_core import parts

AT_ONCE = 1024  # set-ups made at a time
TABLES = ("controller", "adaptation")
# Their fields that checks of a whole scenario or other parts of a set-up read.
READ_ELSEWHERE = frozenset(
    {
        "controller.kind",
        "controller.adaptive",
        "controller.force_limit",
        "controller.filter",
        "controller.observer_bandwidth",
        "controller.event_threshold",
        "controller.event_share",
        "controller.compensation_bandwidth",
        "controller.layer_thickness",
        "controller.switching_limit",
        "adaptation.kind",
        "adaptation.initial_rate",
    }
)
# Fields that decide which fields there are, or how they are described.
KINDS_OF_FIELDS = frozenset({"controller.kind", "controller.filter", "controller.adaptive", "adaptation.kind"})
_IN_UNITS = frozenset(f"controller.{name}" for name in EXPONENTS.values())  # texts with units follow from them


def patched_fields(base: Scenario, varied: list[str]) -> list[str]:
    """The varied fields whose numbers are set in the base's set-up; the others make scenarios of their own."""
    if KINDS_OF_FIELDS & set(varied):
        return []
    of_core = {number.path for number in numbers(base.controller.kind)}
    held = READ_ELSEWHERE | (_IN_UNITS if texts_of(base) else set())
    return [name for name in varied if name.partition(".")[0] in TABLES and name in of_core - held]


class Patch:
    """Set-ups for values of these fields, which must be among `patched_fields` and valid."""

    def __init__(self, base: Scenario, fields: list[str]) -> None:
        self.base, self.fields, self.parts = base, fields, parts(base)
        self._listed = [(field, _numbers(base.controller.kind, field)) for field in fields]

    def setup(self, values: tuple[Any, ...]) -> _core.DeviceSetup:
        """The set-up of `base.replace(dict(zip(fields, values)))`, bit for bit."""
        found = dict(self.parts.numbers)
        memory = self.parts.memory
        for (field, listed), value in zip(self._listed, values, strict=True):
            table, _, name = field.partition(".")
            for key, number in core_values(listed, {table: {name: value}}).items():
                found[key] = number + 0.0  # -0.0 becomes 0.0
            if field == "controller.order":
                memory = (float(value) + 0.0, *memory[1:])
        return self.parts._replace(numbers=found, memory=memory).setup()

    def setups(self, points: Iterable[tuple[Any, ...]]) -> Iterator[_core.DeviceSetup]:
        """`setup` of each point, made in the core, many at a time."""
        names = list(self.parts.numbers)
        changed = [(names.index(n.name), at, n) for at, (_, listed) in enumerate(self._listed) for n in listed]
        changed.sort(key=lambda each: each[0])
        places = [place for place, *_ in changed]
        order = self.fields.index("controller.order") if "controller.order" in self.fields else None
        waiting = iter(points)
        while taken := list(islice(waiting, AT_ONCE)):
            columns = list(zip(*taken, strict=True))
            rows = np.empty((len(taken), len(changed)))
            for place, (_, at, number) in enumerate(changed):
                rows[:, place] = _core_column(number, columns[at])
            made = _core.with_settings(self._unchanged, places, rows)
            if order is not None and self._unchanged.has_memory:
                for setup, value in zip(made, columns[order], strict=True):
                    setup.kernel = core_kernel(float(value) + 0.0, *self.parts.memory[1:])
            yield from made

    @cached_property
    def _unchanged(self) -> _core.DeviceSetup:
        return self.parts.setup()


def _core_column(number: Number, values: tuple[Any, ...]) -> np.ndarray:
    """A number of the core for each value of its field."""
    if number.part or not set(map(type, values)) <= {float, int}:
        values = tuple(core_values((number,), {number.table: {number.field: value}})[number.name] for value in values)
    return np.array(values, dtype=float) + 0.0  # -0.0 becomes 0.0


@lru_cache
def _numbers(kind: str, path: str) -> tuple[Number, ...]:
    return tuple(number for number in numbers(kind) if number.path == path)


def are_valid(base: Scenario, values: Mapping[str, tuple[Any, ...]]) -> bool:
    """True if the base is valid with each of these values; of a range its ends, as the limits of a field are a range.

    For fields of `patched_fields`, all combinations are then valid.
    """
    try:
        for field, each in values.items():
            for value in each:
                base.replace({field: value})
    except ValueError:
        return False
    return True
