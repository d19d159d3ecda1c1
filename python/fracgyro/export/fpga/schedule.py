"""List scheduling of a routine onto pipelined units that take an operation every cycle.

Cycle t reads the operands of an operation from memory, which takes until t + 2; that cycle chooses them, and from t + 3
on its unit works. In t + 3 + stages the result stands in the unit's register. An operation may read it from cycle
t + 1 + stages on: from that register in the first of these cycles, from a second one in the next, not at all in the
third, and from memory afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

from .routines import Operation, Routine

FETCH = 3  # cycles until the operands are those of the unit


@dataclass(frozen=True)
class Machine:
    """How many units there are. All that is not a sum or a product shares one register for its results."""

    adders: int = 2
    multipliers: int = 2

    @property
    def banks(self) -> list[str]:
        """The units that have a memory of their own for their results."""
        return [*(f"add{k}" for k in range(self.adders)), *(f"mul{k}" for k in range(self.multipliers)), "other"]

    def of(self, unit: str) -> list[int]:
        """The banks of a kind of unit."""
        first = {"add": 0, "multiply": self.adders, "other": self.adders + self.multipliers}[unit]
        return list(range(first, first + {"add": self.adders, "multiply": self.multipliers, "other": 1}[unit]))


@dataclass(frozen=True)
class Slot:
    """When an operation reads its operands, and in which bank its result is."""

    cycle: int
    bank: int


@dataclass(frozen=True)
class Schedule:
    routine: Routine
    slots: list[Slot]  # of its operations
    wait: int  # cycles until it is known what the comparisons lead to

    def result(self, place: int) -> int:
        """The cycle in which the result of an operation stands in its unit's register."""
        return self.slots[place].cycle + FETCH + self.routine.operations[place].stages

    @property
    def settled(self) -> int:
        """The first cycle in which the forces are known, and whether this routine is the right one."""
        last = [
            self.result(place)
            for place, one in enumerate(self.routine.operations)
            if one.op == "less" or (one.output is not None and one.output.port in (0, 1))
        ]
        return max(last, default=0) + 1 + self.wait

    @property
    def cycles(self) -> int:
        return max(*map(self.result, range(len(self.slots))), self.settled - 1) + 2


def schedule(routine: Routine, machine: Machine, wait: int = 0) -> Schedule:
    """What the forces and the decisions need comes first, then what has most to come after it."""
    operations = routine.operations
    heights = _heights(operations)
    readers: list[list[int]] = [[] for _ in operations]
    waits = [len(one.after) for one in operations]
    for place, one in enumerate(operations):
        for producer in one.after:
            readers[producer].append(place)
    waiting: list[tuple[int, tuple[int, int], int]] = []  # the earliest cycle, minus its height, place
    ready: list[tuple[tuple[int, int], int]] = []
    slots: dict[int, Slot] = {}
    results: dict[int, int] = {}  # in which cycle
    taken: set[int] = set()  # cycles in which "other" has a result
    earliest = [0] * len(operations)
    for place, count in enumerate(waits):
        if count == 0:
            heappush(ready, (heights[place], place))
    cycle = 0
    while len(slots) < len(operations):
        while waiting and waiting[0][0] <= cycle:
            _, height, place = heappop(waiting)
            heappush(ready, (height, place))
        free = {unit: machine.of(unit) for unit in ("add", "multiply", "other")}
        later = []
        while ready and any(free.values()):
            height, place = heappop(ready)
            one = operations[place]
            result = cycle + FETCH + one.stages
            between = any(results[producer] == cycle for producer in one.after)  # in no register, not yet in memory
            if not free[one.unit] or between or (one.unit == "other" and result in taken):
                later.append((height, place))
                continue
            slots[place] = Slot(cycle, free[one.unit].pop(0))
            results[place] = result
            if one.unit == "other":
                taken.add(result)
            for reader in readers[place]:
                earliest[reader] = max(earliest[reader], result - FETCH + 1)
                waits[reader] -= 1
                if waits[reader] == 0:
                    heappush(waiting, (earliest[reader], heights[reader], reader))
        for entry in later:
            heappush(ready, entry)
        cycle += 1
    return Schedule(routine, [slots[place] for place in range(len(operations))], wait)


def _heights(operations: list[Operation]) -> list[tuple[int, int]]:
    """Minus the cycles from each operation to the last force or decision, and to the end."""
    force, end = [0] * len(operations), [0] * len(operations)
    for place in range(len(operations) - 1, -1, -1):
        one = operations[place]
        own = 1 + one.stages
        end[place] += own
        if one.op == "less" or (one.output is not None and one.output.port in (0, 1)):
            force[place] = max(force[place], 1)
        if force[place]:
            force[place] += own
        for producer in one.after:
            end[producer] = max(end[producer], end[place])
            force[producer] = max(force[producer], force[place])
    return [(-a, -b) for a, b in zip(force, end, strict=True)]
