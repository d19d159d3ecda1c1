"""Schedules as microcode: one word a cycle, whose fields choose what every unit reads and where results go.

Each operand has memories of its own: a copy of every bank that it reads. Those of results are small: a result is there
from when it is written until it is read for the last time. The bank "kept" has the words of the state and the parts of
phases, twice: a routine reads those in one half and writes all of the state in the other half; then the halves change
places. It also has the motion and constants.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from .graph import SOURCES_OF_NUMBERS, Graph, Operand
from .routines import Output
from .schedule import FETCH, SOON, Machine, Schedule

MEMORY, RESULT = range(2)  # source of an operand
# Selections of fp_choose for the result of "other".
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
)
OPERANDS = {"add": 2, "mul": 2, "oth": 4, "kep": 1}

Word = dict[str, int]


@dataclass
class Microcode:
    graph: Graph
    machine: Machine
    schedules: list[Schedule]
    words: list[Word] = field(default_factory=list)
    bases: list[int] = field(default_factory=list)  # first word of each routine
    conditions: list[frozenset[int]] = field(default_factory=list)  # condition k + 1: one of these programs runs

    def __post_init__(self) -> None:
        for one in self.schedules:
            self.bases.append(len(self.words))
            self.words += _Writer(self, one).words()

    @cached_property
    def state(self) -> dict[int, int]:
        """Places of the words of the state, in either half of "kept"."""
        varying = [place for place in self.graph.numbers if self.graph.words[place].varies]
        return {word: place for place, word in enumerate(varying)}

    @cached_property
    def given(self) -> dict[int, int]:
        """Places of inputs and constants, by node; they follow the state in the first half, parts of phases in both."""
        nodes = self.graph.nodes
        chosen = [place for place, node in enumerate(nodes) if node.op in ("input", "constant")]
        return {node: len(self.state) + place for place, node in enumerate(chosen)}

    @cached_property
    def half(self) -> int:
        """A power of 2: the places in half of "kept"."""
        return 1 << (len(self.state) + len(self.given) - 1).bit_length()

    @cached_property
    def address_bits(self) -> int:
        return self.half.bit_length()

    @property
    def near_bits(self) -> int:
        """Address bits of the results."""
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
    """The words of one routine."""

    def __init__(self, code: Microcode, scheduled: Schedule) -> None:
        self.code, self.scheduled = code, scheduled
        self.operations = scheduled.routine.operations
        self.made = {one.node: place for place, one in enumerate(self.operations) if one.node >= 0}

    def words(self) -> list[Word]:
        found: list[Word] = [{} for _ in range(self.scheduled.cycles)]
        banks = self.code.machine.banks
        for place, one in enumerate(self.operations):
            slot, result = self.scheduled.slots[place], self.scheduled.result(place)
            name = banks[slot.bank]
            read, written = found[slot.cycle], found[result]
            fetched = reversed(one.operands) if slot.swapped else one.operands
            for port, operand in enumerate(fetched):
                read |= self._fetch(f"{name}_{'abcd'[port]}", operand, slot.cycle)
            if place in self.scheduled.near:  # data to be written is fetched one cycle earlier
                found[result - 1] |= {f"{name}_write": 1, f"{name}_place": self.scheduled.near[place]}
            if one.busy:
                found[slot.cycle + FETCH][f"{one.op}{slot.which}_load"] = 1
            if name == "other":
                self._other(place, found[result - 2], written)
            elif one.output is not None:
                found[result - 1]["condition"] = self.code.condition(one.output.programs)
                written |= self._output(one.output)
        for word in found[self.scheduled.settled : self.scheduled.decided + 1]:
            word["settled"] = 1
        found[-SOON]["soon"] = found[-1]["last"] = 1
        return found

    def _other(self, place: int, early: Word, written: Word) -> None:
        one, slot = self.operations[place], self.scheduled.slots[place]
        op = "select" if one.op == "less" else one.op
        early["what"] = CHOICES.index(f"{op}{slot.which}" if one.busy else op)
        if one.op == "less":
            asked = [p.of for p in self.code.graph.predicates if p.question == 0]
            written |= {"flag_write": 1, "flag": sorted(set(asked)).index(one.node)}

    def _output(self, output: Output) -> Word:
        found = (
            {"kept_write": 1, "kept_place": self.code.half + self.code.state[output.word]} if output.word >= 0 else {}
        )
        return found | ({"out_write": 1, "out": output.port} if output.port >= 0 else {})

    def _fetch(self, port: str, operand: Operand, cycle: int) -> Word:
        node, kept = self.code.graph.nodes[operand.node], self.code.machine.kept
        found = {f"{port}_negative": int(operand.negative), f"{port}_magnitude": int(operand.magnitude)}
        if node.op in SOURCES_OF_NUMBERS:
            place = self.code.state[node.bits] if node.op == "state" else self.code.given[operand.node]
            relative = int(node.op == "state" or self.code.graph.turns(operand.node))
            return found | {f"{port}_source": 2 * kept, f"{port}_place": place, f"{port}_relative": relative}
        producer = self.made[operand.node]
        bank = self.scheduled.slots[producer].bank
        if cycle + FETCH - 1 == self.scheduled.result(producer):
            return found | {f"{port}_source": 2 * bank + RESULT}
        return found | {f"{port}_source": 2 * bank, f"{port}_place": self.scheduled.near[producer]}
