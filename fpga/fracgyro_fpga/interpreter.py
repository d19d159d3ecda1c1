"""A traced controller, run in Python operation by operation: the reference for the hardware."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arithmetic import Value
from .graph import Diagram, Graph, Input, Operand, members


class Interpreter:
    """A controller with its state. `programs` counts how often each ran; `values`: of the nodes in the last step."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        number = graph.arithmetic.of_bits
        self.words: list[Value] = [word.low if word.bits else number(word.initial) for word in graph.words]
        self.programs: dict[int, int] = {}
        self.values: dict[int, Value] = {}
        self.status = 0

    def step(self, motion: Sequence[float]) -> tuple[list[Value], list[Value]]:
        """The force, and what was reported before it."""
        with np.errstate(all="ignore"):
            return self._step(self.graph.arithmetic.values(np.asarray(motion)))

    def _step(self, motion: Sequence[Value]) -> tuple[list[Value], list[Value]]:
        graph, values = self.graph, _Values(self, motion)
        *words, status, chosen = (values.leaf(root) for root in graph.roots)
        program = graph.programs[chosen]
        self.programs[chosen] = self.programs.get(chosen, 0) + 1
        becomes = dict(zip(graph.numbers, program, strict=False))
        found: list[Value] = []
        for place, leaf in enumerate(words[: len(graph.words)]):
            if place in becomes:
                found.append(values.operand(becomes[place]))
            else:
                found.append(self._integer(leaf))
        self.status = self._integer(status)
        reported = [values.operand(operand) for operand in program[len(graph.numbers) :]]
        self.words, self.values = found, values.known
        return [found[place] for place in graph.force], reported

    def _integer(self, leaf: int) -> int:
        _, word, offset = self.graph.leaves[leaf]
        return offset + (int(self.words[word]) if word >= 0 else 0)


class _Values:
    """Values of the nodes of one step, each computed on demand."""

    def __init__(self, interpreter: Interpreter, motion: Sequence[Value]) -> None:
        self.graph, self.words, self.motion = interpreter.graph, interpreter.words, motion
        self.known: dict[int, Value] = {}
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

    def operand(self, operand: Operand) -> Value:
        value = self.node(operand.node)
        value = abs(value) if operand.magnitude else value
        return -value if operand.negative else value

    def node(self, place: int) -> Value:
        if place not in self.known:
            for node in members(self.graph.needs[place] & ~self.have):
                self.known[node] = self._computed(node)
            self.have |= self.graph.needs[place]
        return self.known[place]

    def _computed(self, place: int) -> Value:
        arithmetic = self.graph.arithmetic
        op, bits, operands = self.graph.nodes[place]
        if op == "constant":
            return arithmetic.of_bits(bits)
        if op == "state":
            return self.words[bits]
        if op == "input":
            one = self.graph.inputs[bits]
            return self.motion[one.measured] if one.measured >= 0 else arithmetic.of_phase(one.part, self._phase(one))
        return arithmetic.compute(op, *(self.operand(one) for one in operands))

    def _phase(self, one: Input) -> int:
        """Its part of the phase, as include/fracgyro/core/elementary.hpp has it."""
        steps = int(self.words[one.word]) if one.word >= 0 else 0
        phase = ((one.start + one.increment * steps) >> 32) & 0xFFFFFFFF
        quadrant = ((phase + (1 << 29)) >> 30) & 3
        rest = (phase - (quadrant << 30)) & 0xFFFFFFFF
        signed = rest - (1 << 32) if rest >> 31 else rest
        return (signed, quadrant & 1, quadrant >> 1 & 1, (quadrant + 1) >> 1 & 1)[one.part]
