"""Schedules as microcode: one word a cycle, whose fields say what every unit reads and where results go.

Each operand has memories of its own: a copy of every bank that it reads. Those of sums and products are small: a result
is there from when it is written until it is read for the last time. The bank "other" has the words of the state, twice:
a routine reads those in one half and writes all of those in the other half; then the halves change places. It also has
inputs and constants, and its results have one place each within a routine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from .graph import SOURCES_OF_NUMBERS, Graph, Operand
from .schedule import COPIED, FETCH, Machine, Schedule

MEMORY, RESULT = range(2)  # where an operand comes from
# What fp_choose makes the result of "other".
CHOICES = (
    "select",
    "copy_sign",
    "mantissa",
    "scale",
    "exponent",
    "divide0",
    "divide1",
    "square_root0",
    "square_root1",
    "copy",
)
OPERANDS = {"add": 2, "mul": 2, "oth": 4}

Word = dict[str, int]


@dataclass
class Microcode:
    graph: Graph
    machine: Machine
    schedules: list[Schedule]
    words: list[Word] = field(default_factory=list)
    bases: list[int] = field(default_factory=list)  # where each routine begins
    conditions: list[frozenset[int]] = field(default_factory=list)  # condition k + 1: one of these programs runs

    def __post_init__(self) -> None:
        for one in self.schedules:
            self.bases.append(len(self.words))
            self.words += _Writer(self, one).words()

    @cached_property
    def other(self) -> int:
        return len(self.machine.banks) - 1

    @cached_property
    def state(self) -> dict[int, int]:
        """Places of the words of the state, in either half of "other"."""
        varying = [place for place in self.graph.numbers if self.graph.words[place].varies]
        return {word: place for place, word in enumerate(varying)}

    @cached_property
    def given(self) -> dict[int, int]:
        """Places of inputs and constants, by node; they follow the state in the first half."""
        nodes = self.graph.nodes
        chosen = [place for place, node in enumerate(nodes) if node.op in ("input", "constant")]
        return {node: len(self.state) + place for place, node in enumerate(chosen)}

    @cached_property
    def half(self) -> int:
        """A power of 2: the places in half of "other"."""
        results = max(sum(slot.bank == self.other for slot in one.slots) for one in self.schedules)
        needed = len(self.state) + max(len(self.given), results)
        return 1 << (needed - 1).bit_length()

    @cached_property
    def address_bits(self) -> int:
        return self.half.bit_length()

    @property
    def near_bits(self) -> int:
        """Of the places of sums and products."""
        return max(one.near_bits for one in self.schedules)

    @property
    def loaded(self) -> list[str]:
        """The units that compute digit by digit."""
        machine = self.machine
        counts = {"divide": machine.dividers, "square_root": machine.roots}
        return [f"{op}{number}" for op, count in counts.items() for number in range(count)]

    def ports(self) -> Iterator[tuple[int, int, str]]:
        """Bank, operand, and the name of each operand of each unit."""
        for bank, name in enumerate(self.machine.banks):
            for operand in range(OPERANDS[name[:3]]):
                yield bank, operand, f"{name}_{'abcd'[operand]}"

    def condition(self, programs: frozenset[int] | None) -> int:
        if programs is None:
            return 0
        if programs not in self.conditions:
            self.conditions.append(programs)
        return self.conditions.index(programs) + 1


class _Writer:
    """Of one routine."""

    def __init__(self, code: Microcode, scheduled: Schedule) -> None:
        self.code, self.scheduled = code, scheduled
        self.operations = scheduled.routine.operations
        self.made = {one.node: place for place, one in enumerate(self.operations) if one.node >= 0}
        self.addresses = dict(scheduled.near)
        used = code.half + len(code.state)
        for place, one in enumerate(self.operations):
            if one.output is not None and one.output.word >= 0:
                self.addresses[place] = code.half + code.state[one.output.word]
            elif scheduled.slots[place].bank == code.other:
                self.addresses[place] = used
                used += 1

    def words(self) -> list[Word]:
        found: list[Word] = [{} for _ in range(self.scheduled.cycles)]
        banks = self.code.machine.banks
        for place, one in enumerate(self.operations):
            slot, result = self.scheduled.slots[place], self.scheduled.result(place)
            name = banks[slot.bank]
            read, written = found[slot.cycle], found[result]
            fetched = reversed(one.operands) if slot.swapped else one.operands
            for port, operand in enumerate(fetched, 0 if one.node >= 0 else COPIED):
                read |= self._fetch(f"{name}_{'abcd'[port]}", operand, slot.cycle)
            if place in self.addresses:
                # Next to the units, what is to be written is asked for a cycle before.
                asked = written if name == "other" else found[result - 1]
                asked |= {f"{name}_write": 1, f"{name}_place": self.addresses[place]}
            if one.busy:
                found[slot.cycle + FETCH][f"{one.op}{slot.which}_load"] = 1
            if name == "other":
                self._other(place, found[result - 2], found[result - 1], written)
        for word in found[self.scheduled.settled : self.scheduled.decided + 1]:
            word["settled"] = 1
        found[-1]["last"] = 1
        return found

    def _other(self, place: int, early: Word, before: Word, written: Word) -> None:
        one, slot = self.operations[place], self.scheduled.slots[place]
        op = "copy" if one.node < 0 else "select" if one.op == "less" else one.op
        early["what"] = CHOICES.index(f"{op}{slot.which}" if one.busy else op)
        if one.op == "less":
            asked = [p.of for p in self.code.graph.predicates if p.question == 0]
            written |= {"other_write": 0, "flag_write": 1, "flag": sorted(set(asked)).index(one.node)}
        if one.output is not None:
            before["condition"] = self.code.condition(one.output.programs)
            written |= {"other_write": int(one.output.word >= 0), "relative": int(one.output.word >= 0)}
            if one.output.port >= 0:
                written |= {"out_write": 1, "out": one.output.port}

    def _fetch(self, port: str, operand: Operand, cycle: int) -> Word:
        node, other = self.code.graph.nodes[operand.node], self.code.other
        found = {f"{port}_negative": int(operand.negative), f"{port}_magnitude": int(operand.magnitude)}
        if node.op in SOURCES_OF_NUMBERS:
            state = node.op == "state"
            place = self.code.state[node.bits] if state else self.code.given[operand.node]
            return found | {f"{port}_source": 2 * other, f"{port}_place": place, f"{port}_relative": int(state)}
        producer = self.made[operand.node]
        bank = self.scheduled.slots[producer].bank
        if cycle + FETCH - 1 == self.scheduled.result(producer):
            return found | {f"{port}_source": 2 * bank + RESULT}
        return found | {f"{port}_source": 2 * bank, f"{port}_place": self.addresses[producer]}
