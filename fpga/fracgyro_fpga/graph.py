"""A controller with its guard as a graph of operations, recorded by running the core on a number that traces.

A step has many ways through its decisions. What each word of the state becomes is a diagram: predicates to leaves. All
words that are numbers together are a program, of which one runs in each step.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import or_
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from fracgyro import _core
from fracgyro.export.compilers import FLAGS, SOURCES, compiler, include, run
from fracgyro.export.settings import core_kernel, core_numbers, observer_bandwidth
from fracgyro.scenario import Scenario
from fracgyro.scenario.kinds import kinds_with
from fracgyro.scenario.to_core import check_single, core_setup, is_plain

from .arithmetic import ARITHMETICS, Arithmetic, HardwareNumber

CPP = Path(__file__).parent / "cpp"

Op = Literal[
    "constant",
    "state",
    "input",
    "add",
    "multiply",
    "divide",
    "square_root",
    "select",
    "copy_sign",
    "less",
    "exponent",
    "mantissa",
    "scale",
]
# Same as in trace.hpp.
OPS: tuple[Op, ...] = get_args(Op)
SOURCES_OF_NUMBERS = ("constant", "state", "input")
UNBOUNDED = 2**63 - 1
ENTRY = 1  # cycles from `start` to the first one of a step
ROOT = 0.5  # the exponent for which the core takes a square root


class Operand(NamedTuple):
    """A node, with what becomes of the sign of its value: first dropped, then changed."""

    node: int
    negative: bool
    magnitude: bool


class Node(NamedTuple):
    op: Op
    bits: int  # bits of a constant; otherwise the index among words or inputs
    operands: tuple[Operand, ...]


class Input(NamedTuple):
    """A measured number by its place in the motion, or, where that is -1, a part of start + increment * word."""

    measured: int
    part: int  # 0: remainder after whole quadrants; 1: an odd quadrant; 2, 3: sine, cosine are negative; 1.0 or 0.0
    start: int
    increment: int
    word: int


class Predicate(NamedTuple):
    """0: the node `of`, a less, holds; 1: the word `of` is at least `limit`; 2: it is a multiple of it."""

    question: int
    of: int
    limit: int


class Word(NamedTuple):
    """One number or integer of the state. What never varies is its initial value."""

    bits: int  # width of an integer; 0: a number
    varies: bool
    initial: int  # initial value; for a number its bits
    low: int
    high: int


class Leaf(NamedTuple):
    """Next value of a word: an operand, or an integer word (-1: none) plus an offset."""

    operand: Operand | None
    word: int
    offset: int


class Diagram(NamedTuple):
    predicate: int  # -1: a leaf, whose number is `yes`
    yes: int
    no: int


@dataclass(frozen=True)
class Graph:
    arithmetic: Arithmetic
    nodes: list[Node]
    inputs: list[Input]
    predicates: list[Predicate]
    words: list[Word]
    force: list[int]
    leaves: list[Leaf]
    diagrams: list[Diagram]
    programs: list[list[Operand]]  # by program: what all numbers become, then the reported numbers
    asked: list[list[int]]  # by program: the predicates on all ways to it
    roots: list[int]  # diagrams: of each word, each reported number, the status, the program
    paths: int

    @cached_property
    def numbers(self) -> list[int]:
        """The words that are numbers, in the order of a program."""
        return [place for place, word in enumerate(self.words) if not word.bits]

    @cached_property
    def integers(self) -> list[int]:
        return [place for place, word in enumerate(self.words) if word.bits]

    def given_in(self, node: int) -> int:
        """The first cycle of a step in which a node's number can be read, if it is one of the motion.

        The four are written in one cycle each, the last one with `start`.
        """
        op, place, _ = self.nodes[node]
        return max(0, self.inputs[place].measured - ENTRY) if op == "input" else 0

    def turns(self, node: int) -> bool:
        """True if a node is a part of a phase."""
        op, place, _ = self.nodes[node]
        return op == "input" and self.inputs[place].measured < 0

    @property
    def reported(self) -> int:
        """How many numbers are reported."""
        return len(self.roots) - len(self.words) - 2

    @cached_property
    def needs(self) -> list[int]:
        """By node: a bit for each node that it needs, itself included. Operands come before what needs them."""
        found: list[int] = []
        for place, node in enumerate(self.nodes):
            bits = 1 << place
            for operand in node.operands:
                bits |= found[operand.node]
            found.append(bits)
        return found

    @cached_property
    def given(self) -> int:
        """A bit for each node that is not computed."""
        return sum(1 << place for place, node in enumerate(self.nodes) if node.op in SOURCES_OF_NUMBERS)

    def computed(self, nodes: Iterable[int]) -> int:
        """A bit for each node that is computed for these, themselves included."""
        return reduce(or_, (self.needs[node] for node in nodes), 0) & ~self.given

    @cached_property
    def levels(self) -> list[int]:
        """By diagram: decisions from it to the furthest of its leaves."""
        found: list[int] = []
        for diagram in self.diagrams:  # those that one leads to come before it
            below = [] if diagram.predicate < 0 else [found[diagram.yes], found[diagram.no]]
            found.append(1 + max(below) if below else 0)
        return found

    def compared(self, programs: Iterable[int]) -> list[int]:
        """The nodes that are compared on the paths to these programs."""
        asked = {predicate for program in programs for predicate in self.asked[program]}
        return sorted(self.predicates[one].of for one in asked if self.predicates[one].question == 0)


def members(bits: int) -> list[int]:
    """The places of the ones, in ascending order."""
    return [place for place, bit in enumerate(reversed(f"{bits:b}")) if bit == "1"]


def trace(scenario: Scenario, number: HardwareNumber = "float") -> Graph:
    """The graph of the scenario's controller with its guard.

    Raises ValueError, in one sentence, when it cannot be traced, float cannot hold a coefficient, or the tracer cannot
    be compiled.
    """
    if not is_plain(scenario):
        reference = scenario.reference
        raise ValueError(
            f"reference.kind is {reference.kind!r} and reference.offset {list(reference.offset)}: "
            "for hardware it must be sine, without an offset"
        )
    if scenario.adaptation.kind == "joint":  # known before the tracer is compiled, which takes half a minute
        raise ValueError(
            "adaptation.kind is 'joint': it cannot be exported as hardware: counters in its state choose what is "
            "computed, which is not traced; choose another"
        )
    if scenario.controller.kind == "lock_in":
        raise ValueError(
            "controller.kind is 'lock_in': it cannot be exported as hardware: counters in its state choose what is "
            "computed, which is not traced; choose another"
        )
    if number == "float":
        check_single(scenario)
    with tempfile.TemporaryDirectory() as folder:
        program = compiled_for(scenario, "trace", Path(folder), f"-DFRACGYRO_FIXED={int(number == 'fixed')}", "-O1")
        try:
            text = run([str(program), *numbers_of(scenario)])
        except ValueError as error:
            why, controller = str(error).partition("failed: ")[2], scenario.controller
            named = [("controller.kind", repr(controller.kind))]
            if controller.kind in kinds_with("adaptation.kind") and scenario.adaptation.kind != "gradient":
                named.append(("adaptation.kind", repr(scenario.adaptation.kind)))
            if "powers" in why and controller.terminal_exponent != ROOT:
                named.append(("controller.terminal_exponent", str(controller.terminal_exponent)))
            field, value = named[-1]
            raise ValueError(f"{field} is {value}: it cannot be exported as hardware: {why}; choose another") from None
    return parsed(text, number)


def compiled_for(scenario: Scenario, name: str, folder: Path, *options: str) -> Path:
    """A program of cpp/ that chosen.hpp makes one for the scenario's controller."""
    setup = core_setup(scenario)
    kind, chosen = _core.chosen_type(setup)
    which = {
        "KIND": kind,
        "CHOSEN": chosen,
        "OBSERVED": int(observer_bandwidth(scenario) > 0.0),
        "CAPACITY": -(-max(setup.kernel.count, 1) // 2) * 2,
    }
    program, source = folder / name, CPP / f"{name}.cpp"
    chosen_by = [f"-DFRACGYRO_{name}={value}" for name, value in which.items()]
    headers = include(SOURCES / "include")
    run([*compiler(), *FLAGS, *options, *headers, *chosen_by, str(source), "-o", str(program)])
    return program


def numbers_of(scenario: Scenario) -> list[str]:
    """Arguments of the tracer."""
    lists: list[Iterable[float]] = [
        core_numbers(scenario).values(),
        [observer_bandwidth(scenario)],
        *core_kernel(scenario),
    ]
    return [" ".join(float(one).hex() for one in numbers) for numbers in lists]


def parsed(text: str, number: HardwareNumber) -> Graph:
    """Reads the output of the tracer."""
    found: dict[str, Any] = json.loads(text)
    return Graph(
        arithmetic=ARITHMETICS[number],
        nodes=[Node(OPS[op], bits, tuple(map(_operand, filter(_is_one, of)))) for op, bits, *of in found["nodes"]],
        inputs=[Input(*one) for one in found["inputs"]],
        predicates=[Predicate(*one) for one in found["predicates"]],
        words=[Word(bits, bool(varies), *rest) for bits, varies, *rest in found["words"]],
        force=found["force"],
        leaves=[Leaf(_operand(of) if _is_one(of) else None, *rest) for of, *rest in found["leaves"]],
        diagrams=[Diagram(*one) for one in found["diagrams"]],
        programs=[list(map(_operand, one)) for one in found["programs"]],
        asked=found["asked"],
        roots=found["roots"],
        paths=found["paths"],
    )


def _is_one(code: int) -> bool:
    return code >= 0


def _operand(code: int) -> Operand:
    return Operand(code >> 2, bool(code & 1), bool(code & 2))
