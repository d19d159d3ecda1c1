"""A traced controller, run in Python: what the hardware has to compute, operation by operation in float32."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .graph import Diagram, Graph, Input, Operand, members

FRACTION = 23
ORIGIN = 0x3F3504F3  # sqrt(1/2), as float32


class Interpreter:
    """A controller with its state. `programs` counts how often each ran."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.words: list[np.float32 | int] = [word.low if word.bits else _number(word.initial) for word in graph.words]
        self.programs: dict[int, int] = {}
        self.status = 0

    def step(self, motion: Sequence[float]) -> tuple[list[np.float32], list[np.float32]]:
        """The force, and what was reported before it."""
        with np.errstate(all="ignore"):
            return self._step(np.asarray(motion, np.float32))

    def _step(self, motion: np.ndarray) -> tuple[list[np.float32], list[np.float32]]:
        graph, values = self.graph, _Values(self, motion)
        *words, status, chosen = (values.leaf(root) for root in graph.roots)
        program = graph.programs[chosen]
        self.programs[chosen] = self.programs.get(chosen, 0) + 1
        becomes = dict(zip(graph.numbers, program, strict=False))
        found: list[np.float32 | int] = []
        for place, leaf in enumerate(words[: len(graph.words)]):
            if place in becomes:
                found.append(values.operand(becomes[place]))
            else:
                found.append(self._integer(leaf))
        self.status = self._integer(status)
        reported = [values.operand(operand) for operand in program[len(graph.numbers) :]]
        self.words = found
        return [np.float32(found[place]) for place in graph.force], reported

    def _integer(self, leaf: int) -> int:
        _, word, offset = self.graph.leaves[leaf]
        return offset + (int(self.words[word]) if word >= 0 else 0)


class _Values:
    """Of the nodes of one step, each computed when it is needed."""

    def __init__(self, interpreter: Interpreter, motion: np.ndarray) -> None:
        self.graph, self.words, self.motion = interpreter.graph, interpreter.words, motion
        self.known: dict[int, np.float32] = {}
        self.have = 0  # a bit for each node that is known
        self.answers: dict[int, bool] = {}

    def leaf(self, root: int) -> int:
        """The number of the leaf that a diagram leads to."""
        diagram: Diagram = self.graph.diagrams[root]
        while diagram.predicate >= 0:
            diagram = self.graph.diagrams[diagram.yes if self._answer(diagram.predicate) else diagram.no]
        return diagram.yes

    def _answer(self, number: int) -> bool:
        if number not in self.answers:
            question, of, limit = self.graph.predicates[number]
            if question == 0:
                a, b = (self.operand(one) for one in self.graph.nodes[of].operands)
                self.answers[number] = bool(a < b)
            else:
                word = int(self.words[of])
                self.answers[number] = word >= limit if question == 1 else word % limit == 0
        return self.answers[number]

    def operand(self, operand: Operand) -> np.float32:
        value = self.node(operand.node)
        value = np.abs(value) if operand.magnitude else value
        return -value if operand.negative else value

    def node(self, place: int) -> np.float32:
        if place not in self.known:
            for node in members(self.graph.needs[place] & ~self.have):
                self.known[node] = self._computed(node)
            self.have |= self.graph.needs[place]
        return self.known[place]

    def _computed(self, place: int) -> np.float32:
        op, bits, operands = self.graph.nodes[place]
        if op == "constant":
            return _number(bits)
        if op == "state":
            return np.float32(self.words[bits])
        if op == "input":
            return phase_or_motion(self.graph.inputs[bits], self.motion, self.words)
        return _operation(op, *(self.operand(one) for one in operands))


def _operation(op: str, a: np.float32, *others: np.float32) -> np.float32:
    if op == "square_root":
        return np.float32(np.sqrt(a))
    if op == "exponent":
        return np.float32((_bits(a) - ORIGIN) >> FRACTION)
    if op == "mantissa":
        return _number(((_bits(a) - ORIGIN) & ((1 << FRACTION) - 1)) + ORIGIN)
    b, *chosen = others
    match op:
        case "add":
            return np.float32(a + b)
        case "multiply":
            return np.float32(a * b)
        case "divide":
            return np.float32(a / b)
        case "select":
            yes, no = chosen
            return yes if a < b else no
        case "copy_sign":
            return np.float32(np.copysign(b, a))
        case "scale":
            return _number((_bits(a) + (_bits(b) << FRACTION)) & 0xFFFFFFFF)
    return np.float32(a < b)


def phase_or_motion(one: Input, motion: np.ndarray, words: Sequence[np.float32 | int]) -> np.float32:
    """The value of an input: a measured number, or a part of a phase as include/fracgyro/core/elementary.hpp has it."""
    if one.measured >= 0:
        return np.float32(motion[one.measured])
    steps = int(words[one.word]) if one.word >= 0 else 0
    phase = ((one.start + one.increment * steps) >> 32) & 0xFFFFFFFF
    quadrant = ((phase + (1 << 29)) >> 30) & 3
    rest = (phase - (quadrant << 30)) & 0xFFFFFFFF
    signed = rest - (1 << 32) if rest >> 31 else rest
    parts = (signed, quadrant & 1, quadrant >> 1 & 1, (quadrant + 1) >> 1 & 1)
    return np.float32(parts[one.part])


def _number(bits: int) -> np.float32:
    return np.float32(np.array([bits], np.uint32).view(np.float32)[0])


def _bits(value: np.float32) -> int:
    return int(np.array([value], np.float32).view(np.uint32)[0])
