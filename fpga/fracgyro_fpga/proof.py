"""Proof that microcode computes its graph: cycle-by-cycle execution on node names instead of numbers."""

from __future__ import annotations

from collections.abc import Iterable

from .graph import SOURCES_OF_NUMBERS, Graph, Operand
from .microcode import CHOICES, MEMORY, OPERANDS, Microcode, Word
from .routines import Routine
from .schedule import FETCH, FORCES

OPERATIONS = {"add": "add", "mul": "multiply", "kep": "copy"}  # operation of a bank, by the start of its name

Written = tuple[int, int, frozenset[int] | None]  # word, port, programs


def check(code: Microcode) -> None:
    """Raises ValueError if a routine reads a value before it is written, or writes one that is not in the graph."""
    for number, one in enumerate(code.schedules):
        end = code.bases[number + 1] if number + 1 < len(code.bases) else len(code.words)
        _Machine(code, one.routine).run(code.words[code.bases[number] : end])


class _Machine:
    def __init__(self, code: Microcode, routine: Routine) -> None:
        self.code, self.graph, self.routine = code, code.graph, routine
        computed = [(p, node) for p, node in enumerate(code.graph.nodes) if node.op not in SOURCES_OF_NUMBERS]
        self.known = {(str(node.op), node.operands): place for place, node in computed}
        self.memory: dict[tuple[int, int], int] = {}  # bank, place: the node whose number is there
        for word, place in code.state.items():
            self.memory[code.machine.kept, place] = self._leaf(self.graph, word)
        for node, place in code.given.items():
            self.memory[code.machine.kept, place] = node
        self.results: dict[tuple[int, str, int], Operand] = {}  # bank, operation, cycle: value in its register
        self.written: dict[Written, Operand] = {}
        self.flags: set[int] = set()
        self.again: dict[str, int] = {}  # by unit that computes digit by digit: the first cycle to begin in
        self.force_from = 0  # the first cycle in which all forces can be taken

    @staticmethod
    def _leaf(graph: Graph, word: int) -> int:
        for place, node in enumerate(graph.nodes):
            if node.op == "state" and node.bits == word:
                return place
        return -1  # not read

    def run(self, words: list[Word]) -> None:
        compared = set(self.graph.compared(self.routine.programs))
        for cycle, word in enumerate(words):
            if word.get("settled") and not compared <= self.flags:
                raise ValueError("microcode leaves a decision open")
            if word.get("settled") and cycle < self.force_from:
                raise ValueError("microcode lets go of a force too early")
            # Operands are read from the memories at the units FETCH - 1 cycles after the fetch; data to be written is
            # fetched one cycle earlier.
            if cycle + FETCH - 2 < len(words):
                self._write(words, cycle + FETCH - 2, words[cycle + FETCH - 3], range(self.code.machine.kept))
            self._issue(words, cycle, word)
            self._write(words, cycle, word, [self.code.machine.kept])
            self._compare(cycle, word)
            if word.get("out_write") and word["out"] in FORCES:
                self.force_from = cycle + 1
        expected = {
            (one.output.word, one.output.port, one.output.programs): one.operands[0]
            for one in self.routine.operations
            if one.output is not None
        }
        if self.written != expected:
            raise ValueError("microcode does not write what its routine does")
        if not any(word.get("settled") for word in words):
            raise ValueError("microcode never lets go of a force")

    def _register(self, bank: int, cycle: int, words: list[Word]) -> Operand | None:
        name = self.code.machine.banks[bank]
        other = CHOICES[words[cycle - 2].get("what", 0)]
        op = other if name == "other" else OPERATIONS[name[:3]]
        return self.results.get((bank, op, cycle))

    def _issue(self, words: list[Word], cycle: int, word: Word) -> None:
        """Operations that the units start with the operands of this word."""
        for bank, name in enumerate(self.code.machine.banks):
            operands = [self._fetched(words, cycle, word, f"{name}_{'abcd'[k]}") for k in range(OPERANDS[name[:3]])]
            if name == "kept":
                if operands[0] is not None:
                    self.results[bank, "copy", cycle + FETCH] = operands[0]
                continue
            if name != "other":
                self._begin(bank, OPERATIONS[name[:3]], cycle, operands)
                continue
            for op in ("less", *CHOICES):
                self._begin(bank, op, cycle, operands)
            for unit in self.code.loaded:
                if cycle + FETCH < len(words) and words[cycle + FETCH].get(f"{unit}_load"):
                    if cycle < self.again.get(unit, 0):
                        raise ValueError(f"microcode loads {unit} in cycle {cycle} before it has ended")
                    op = unit[:-1]
                    self.again[unit] = cycle + self.graph.arithmetic.busy[op]
                    self._begin(bank, op, cycle, operands, unit)

    def _begin(self, bank: int, op: str, cycle: int, operands: list[Operand | None], unit: str = "") -> None:
        count = {"square_root": 1, "exponent": 1, "mantissa": 1, "select": 4}.get(op, 2)
        fetched = tuple(one for one in operands[:count] if one is not None)
        node = self.known.get((op, fetched), self.known.get((op, fetched[::-1])) if op in ("add", "multiply") else None)
        stages = self.graph.arithmetic.stages_of(op)
        if node is not None:
            self.results[bank, unit or op, cycle + FETCH + stages] = Operand(node, False, False)

    def _fetched(self, words: list[Word], cycle: int, word: Word, port: str) -> Operand | None:
        if f"{port}_source" not in word:
            return None
        bank, where = divmod(word[f"{port}_source"], 2)
        found: Operand | None
        if where == MEMORY:
            node = self.memory.get((bank, word[f"{port}_place"]))
            late = node is None or cycle < self.graph.given_in(node)
            if node is not None and bank == self.code.machine.kept:
                twice = self.graph.nodes[node].op == "state" or self.graph.turns(node)
                if bool(word[f"{port}_relative"]) != twice:
                    raise ValueError(f"microcode reads {port} in cycle {cycle} from the wrong half")
            found = None if node is None or late else Operand(node, False, False)
        else:
            found = self._register(bank, cycle + FETCH - 1, words)
        if found is None:
            raise ValueError(f"microcode reads {port} in cycle {cycle} before it is there")
        return Operand(found.node, bool(word[f"{port}_negative"]), bool(word[f"{port}_magnitude"]))

    def _write(self, words: list[Word], cycle: int, word: Word, banks: Iterable[int]) -> None:
        for bank in banks:
            name = self.code.machine.banks[bank]
            if word.get(f"{name}_write") or (name == "kept" and word.get("out_write")):
                found = self._register(bank, cycle, words)
                if found is None:
                    raise ValueError(f"microcode writes nothing of {name} in cycle {cycle}")
                self._put(bank, name, word, found, words[cycle - 1].get("condition", 0))

    def _compare(self, cycle: int, word: Word) -> None:
        if word.get("flag_write"):
            asked = sorted({one.of for one in self.graph.predicates if one.question == 0})
            result = self.results.get((self.code.machine.other, "less", cycle))
            if result != Operand(asked[word["flag"]], False, False):
                raise ValueError(f"microcode takes another comparison for decision {word['flag']}")
            self.flags.add(asked[word["flag"]])

    def _put(self, bank: int, name: str, word: Word, found: Operand, condition: int) -> None:
        place = word.get(f"{name}_place", -1)
        if name == "kept":
            state = {of: number for number, of in self.code.state.items()}
            number = state[place - self.code.half] if word.get("kept_write") else -1
            programs = self.code.conditions[condition - 1] if condition else None
            key = (number, word["out"] if word.get("out_write") else -1, programs)
            if key in self.written:
                raise ValueError("microcode writes a word twice")
            self.written[key] = found
            return
        self.memory[bank, place] = found.node
