"""Routines: straight-line code that computes all that a step may have to write, for one program or several alike.

Programs that differ little share a routine: what differs is written on the condition that its program is the one that
runs. The routine of the start writes the initial state.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .graph import Graph, Op, Operand, members

# A routine combines programs up to this multiple of the operations of the largest one.
SHARED = 1.15

Unit = str  # "add", "multiply", "other", "copy"


@dataclass(frozen=True)
class Output:
    """Destination of a copied number: a word of the state, an output, or both."""

    word: int = -1
    port: int = -1
    programs: frozenset[int] | None = None  # None: whichever runs


@dataclass
class Operation:
    """One operation of a routine. `node`: what it computes; -1: it copies its operand to an output."""

    op: Op
    stages: int
    busy: int  # cycles until the unit that computes it may begin again; 0: it always may
    operands: tuple[Operand, ...]
    node: int = -1
    output: Output | None = None
    given: int = 0  # the first cycle in which it can read the motion
    after: list[int] = field(default_factory=list)  # operations whose results it reads

    @property
    def unit(self) -> Unit:
        if self.node < 0:
            return "copy"
        return self.op if self.op in ("add", "multiply") else "other"


@dataclass(frozen=True)
class Routine:
    programs: frozenset[int]  # none: the start
    operations: list[Operation]


def routines(graph: Graph) -> list[Routine]:
    """Routines that cover every program once; the last one is the start."""
    found: list[_Shared] = []
    needed = {program: _computed(graph, [program]) for program in range(len(graph.programs))}
    for program in sorted(needed, key=lambda one: (-needed[one].bit_count(), one)):
        nodes = needed[program]
        for shared in found:
            together = shared.nodes | nodes
            if together.bit_count() <= shared.most and 2 * nodes.bit_count() > shared.nodes.bit_count():
                shared.programs.append(program)
                shared.nodes = together
                break
        else:
            found.append(_Shared([program], nodes, int(SHARED * nodes.bit_count())))
    made = [Routine(frozenset(shared.programs), _operations(graph, sorted(shared.programs))) for shared in found]
    return [*made, Routine(frozenset(), _start(graph))]


@dataclass
class _Shared:
    """Programs with the nodes that they need together, a bit for each, and the most that there may be."""

    programs: list[int]
    nodes: int
    most: int


def _computed(graph: Graph, programs: list[int]) -> int:
    outputs = [operand.node for program in programs for operand in graph.programs[program]]
    return graph.computed([*outputs, *graph.compared(programs)])


def _operations(graph: Graph, programs: list[int]) -> list[Operation]:
    found: list[Operation] = []
    arithmetic = graph.arithmetic
    place_of: dict[int, int] = {}
    for node in members(_computed(graph, programs)):  # operands come before what needs them
        op, _, operands = graph.nodes[node]
        place_of[node] = len(found)
        found.append(Operation(op, arithmetic.stages_of(op), arithmetic.busy.get(op, 0), operands, node))
    everywhere = frozenset(programs)
    numbers = graph.numbers
    for place in range(len(graph.programs[0])):
        word = numbers[place] if place < len(numbers) else -1
        port = graph.force.index(word) if word in graph.force else -1
        if place >= len(numbers):
            port = len(graph.force) + place - len(numbers)
        elif port < 0 and not graph.words[word].varies:
            continue
        variants: dict[Operand, set[int]] = {}
        for program in programs:
            variants.setdefault(graph.programs[program][place], set()).add(program)
        for operand, of in variants.items():
            condition = None if frozenset(of) == everywhere else frozenset(of)
            stored = word if word >= 0 and graph.words[word].varies else -1
            found.append(_copied(operand, Output(stored, port, condition)))
    for operation in found:
        operation.given = max(graph.given_in(one.node) for one in operation.operands)
        operation.after = sorted({place_of[one.node] for one in operation.operands if one.node in place_of})
    return found


def _copied(operand: Operand, output: Output) -> Operation:
    """An operand, as it is, is the result."""
    return Operation("select", 0, 0, (operand,), output=output)


def _start(graph: Graph) -> list[Operation]:
    constants = {node.bits: place for place, node in enumerate(graph.nodes) if node.op == "constant"}
    return [
        _copied(Operand(constants[word.initial], False, False), Output(place))
        for place, word in enumerate(graph.words)
        if word.varies and not word.bits
    ]
