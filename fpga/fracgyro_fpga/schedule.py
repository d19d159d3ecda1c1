"""List scheduling of a routine onto pipelined units that take an operation every cycle.

Cycle t requests the operands of an operation, t + 2 selects them, and its unit works from t + 3 on. In t + 3 + stages
the result is in the unit's register. An operation may read it from that register in cycle t + 1 + stages, and from
memory from the next cycle on. Values copied into the state are read in the next step only.

The sources of every operand are wired: a choice between few sources is fast and small. Therefore an operation goes to
the unit, and a sum or a product has the order of operands, that need the fewest new wires. All routines are scheduled
twice. The second time starts with the wires that were used most in the first, and an operation waits for an existing
wire as long as that does not make its routine longer.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush
from random import Random

from .routines import Operation, Routine

FETCH = 3  # cycles until fetched operands reach the unit
SOON = 4  # words from the fetch of the next step's words to the end
FORCES = (0, 1)  # ports
VARIANTS, MOST_VARIANTS = 16, 64  # variants of a schedule that are tried; more if memories or steps become long
JITTER = 4  # cycles of random change of the priority
LEAST_BITS = 4  # address bits of the smallest memory
WIRED = 50  # wires that are there when everything is scheduled for the second time
PATIENCE = 12  # cycles for which an operation waits for a wire; half of them where more is tried
LONGER = 1.1  # how much longer than the first time a step lasts without more being tried
LARGER = 1.25  # how much longer a step may last for memories of half the size


@dataclass(frozen=True)
class Machine:
    """How many units there are. All that is not a sum or a product shares one register for its results.

    With three of each, results come as fast as they can be copied into the state.
    """

    adders: int = 3
    multipliers: int = 3
    dividers: int = 1
    roots: int = 2

    @property
    def banks(self) -> list[str]:
        """The units that have a memory of their own for their results. The last one has state, inputs and constants."""
        sums, products = (f"add{k}" for k in range(self.adders)), (f"mul{k}" for k in range(self.multipliers))
        return [*sums, *products, "other", "kept"]

    @property
    def other(self) -> int:
        return self.adders + self.multipliers

    @property
    def kept(self) -> int:
        return self.other + 1

    def of(self, unit: str) -> list[int]:
        """The banks of a kind of unit."""
        first = {"add": 0, "multiply": self.adders, "other": self.other, "copy": self.kept}[unit]
        return list(range(first, first + {"add": self.adders, "multiply": self.multipliers}.get(unit, 1)))


Wire = tuple[int, int, int, bool]  # bank, operand; from the memory of which bank, or from its register
Wires = set[Wire]


@dataclass(frozen=True)
class Slot:
    """When an operation reads its operands, and in which bank its result is."""

    cycle: int
    bank: int
    wires: Wires
    swapped: bool = False  # the operands of a sum or a product
    which: int = 0  # index among several units for quotients or roots


@dataclass(frozen=True)
class Schedule:
    routine: Routine
    slots: list[Slot]  # one per operation
    wait: int  # cycles until it is known what other comparisons than those of the last step lead to

    def result(self, place: int) -> int:
        """The cycle in which the result of an operation is in its unit's register."""
        return self.slots[place].cycle + FETCH + self.routine.operations[place].stages

    @property
    def settled(self) -> int:
        """The first cycle in which the forces are known, and what was compared; what came out as it did in the last
        step changes no decision.
        """
        ends = [self.result(place) + _after(one) for place, one in enumerate(self.routine.operations)]
        return max((end for one, end in zip(self.routine.operations, ends, strict=True) if _after(one)), default=1)

    @property
    def decided(self) -> int:
        """The first cycle in which it is known in any case whether this routine is the right one."""
        return self.settled + self.wait

    @property
    def cycles(self) -> int:
        """Its last words are those while it becomes known which routine the next step begins with."""
        return max(*map(self.result, range(len(self.slots))), self.decided + 2) + 2

    @cached_property
    def near(self) -> dict[int, int]:
        """The place of each result that is read from memory. A place is free again after the last reading."""
        operations = self.routine.operations
        read: dict[int, int] = {}  # by operation: the last cycle that asks for it
        for place, one in enumerate(operations):
            cycle = self.slots[place].cycle
            for producer in one.after:
                if cycle + FETCH - 1 != self.result(producer):
                    read[producer] = max(read.get(producer, 0), cycle)
        found: dict[int, int] = {}
        until: dict[int, list[int]] = {}  # by bank, for each place: the last cycle that requests its value
        for place in sorted(read, key=self.result):
            of = until.setdefault(self.slots[place].bank, [])
            free = [number for number, last in enumerate(of) if last + FETCH - 1 <= self.result(place)]
            found[place] = free[0] if free else len(of)
            of[found[place] : found[place] + 1] = [read[place]]
        return found

    @property
    def near_bits(self) -> int:
        """Address bits of a memory with these places, at least 4."""
        return max(LEAST_BITS, max(self.near.values(), default=0).bit_length())


def schedules(routines: Sequence[Routine], machine: Machine, wait: int) -> list[Schedule]:
    """Schedule of each routine. `wait`: cycles until the result of other comparisons is known."""
    wires: Wires = set()
    first = [_shortest(one, machine, wires, wait) for one in routines]
    uses = Counter(wire for one in first for slot in one.slots for wire in slot.wires)
    wires = set(sorted(uses, key=lambda wire: (-uses[wire], wire))[:WIRED])
    return [_shortest(one, machine, wires, wait, before) for one, before in zip(routines, first, strict=True)]


def _shortest(routine: Routine, machine: Machine, wires: Wires, wait: int, before: Schedule | None = None) -> Schedule:
    """The shortest of several schedules that take the smallest memories of them. Adds to the wires."""
    tried: list[tuple[tuple[float, ...], Schedule, Wires]] = []
    most = MOST_VARIANTS if before else VARIANTS  # the first time only counts wires
    enough = LONGER * before.settled if before else math.inf
    while len(tried) < VARIANTS or (
        len(tried) < most and (tried[0][1].near_bits > LEAST_BITS or tried[0][1].settled > enough)
    ):
        needed = set(wires)
        one = _listed(routine, machine, needed, wait, len(tried), before)
        cost = one.settled * LARGER ** (one.near_bits - LEAST_BITS)
        tried.append(((cost, one.cycles, len(needed)), one, needed))
        tried.sort(key=lambda each: each[0])
    _, found, needed = tried[0]
    wires |= needed
    return found


def _listed(
    routine: Routine, machine: Machine, wires: Wires, wait: int, variant: int, before: Schedule | None
) -> Schedule:
    """Schedule the operations that forces and decisions need first, then by the longest path after them.

    Adds to the wires.
    """
    operations = routine.operations
    made = {one.node: place for place, one in enumerate(operations) if one.node >= 0}
    heights = least = _heights(operations)
    # The last cycles in which each operation makes its routine no longer than it was before.
    ends = (before.settled, before.cycles) if before else (0, 0)
    latest = [min(end + height for end, height in zip(ends, own, strict=True)) - 1 for own in least]
    random, patience = Random(variant), PATIENCE if variant < VARIANTS else PATIENCE // 2
    if 0 < variant < VARIANTS:
        heights = [(first - int(JITTER * random.random()), second) for first, second in heights]
    elif variant >= VARIANTS:  # equal urgency: in program order, which shortens lifetimes
        grain, start = 8 + int(193 * random.random()), int(201 * random.random())
        heights = [((first - start) // grain, place) for place, (first, _) in enumerate(heights)]
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
    again = {"divide": [0] * machine.dividers, "square_root": [0] * machine.roots}  # when each unit may begin
    earliest = [one.given for one in operations]
    for place, count in enumerate(waits):
        if count == 0:
            heappush(waiting, (operations[place].given, heights[place], place))
    sizes = Counter(wire[:2] for wire in wires)  # number of sources of each choice
    cycle = 0
    while len(slots) < len(operations):
        while waiting and waiting[0][0] <= cycle:
            _, height, place = heappop(waiting)
            heappush(ready, (height, place))
        free = {unit: machine.of(unit) for unit in ("add", "multiply", "other", "copy")}
        later = []
        while ready and any(free.values()):
            height, place = heappop(ready)
            one = operations[place]
            result = cycle + FETCH + one.stages
            urgent = one.output is None or one.output.port in FORCES  # other copies wait for memory
            readable = all(urgent or cycle + FETCH - 1 > results[producer] for producer in one.after)
            idle = [number for number, at in enumerate(again.get(one.op, [0])) if at <= cycle or not one.busy]
            if not free[one.unit] or not readable or not idle or (one.unit == "other" and result in taken):
                later.append((height, place))
                continue
            sources = [
                (slots[made[of]].bank, cycle + FETCH - 1 == results[made[of]]) if of in made else (machine.kept, False)
                for of in (operand.node for operand in one.operands)
            ]
            slot = _cheapest(one, cycle, free[one.unit], sources, wires, sizes)
            new = slot.wires - wires
            if new and cycle < min(latest[place], earliest[place] + patience):
                later.append((height, place))
                continue
            slots[place] = slot
            wires |= new
            sizes.update(wire[:2] for wire in new)
            if one.busy:
                slots[place] = replace(slots[place], which=idle[0])
                again[one.op][idle[0]] = cycle + one.busy
            free[one.unit].remove(slots[place].bank)
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


def _cheapest(
    one: Operation,
    cycle: int,
    banks: list[int],
    sources: list[tuple[int, bool]],
    wires: Wires,
    sizes: Counter[tuple[int, int]],
) -> Slot:
    found: list[tuple[int, int, bool, int, Wires]] = []
    for bank in banks:
        for swapped in (False, True) if one.unit in ("add", "multiply") else (False,):
            order = enumerate(reversed(sources) if swapped else sources)
            needed = {(bank, operand, *source) for operand, source in order}
            new = needed - wires
            largest = max((sizes[wire[:2]] for wire in new), default=0)
            found.append((len(new), largest, swapped, bank, needed))
    *_, swapped, bank, needed = min(found, key=lambda each: each[:4])
    return Slot(cycle, bank, needed, swapped)


def _after(one: Operation) -> int:
    """Cycles from a result until a comparison counts, or a force can be taken; 0: it is neither."""
    if one.op == "less":
        return 1
    return 1 if one.output is not None and one.output.port in FORCES else 0


def _heights(operations: list[Operation]) -> list[tuple[int, int]]:
    """Minus the cycles from each operation to the last force or decision, and to the end."""
    force, end = [0] * len(operations), [0] * len(operations)
    for place in range(len(operations) - 1, -1, -1):
        one = operations[place]
        own = 1 + one.stages
        end[place] += own
        force[place] = max(force[place], _after(one))
        if force[place]:
            force[place] += own
        for producer in one.after:
            end[producer] = max(end[producer], end[place])
            force[producer] = max(force[producer], force[place])
    return [(-a, -b) for a, b in zip(force, end, strict=True)]
