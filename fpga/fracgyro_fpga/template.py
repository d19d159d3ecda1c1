"""Microcode as Verilog: the datapath around the units, the decisions, and the memories' contents."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .arithmetic import Arithmetic
from .graph import UNBOUNDED, Graph
from .microcode import MEMORY, RESULT, Microcode

LEVELS = 4  # choices in a row in one cycle
ROWS = 512  # words per block of the microcode memory, which has registers between the blocks and their selection


@dataclass(frozen=True)
class Field:
    """Bits of a word of microcode: those that are not 0 in all words, and how many the hardware takes them for."""

    name: str
    low: int
    width: int
    wide: int


def fields(code: Microcode) -> list[Field]:
    """Widths of the fields."""
    banks, address = code.machine.banks, code.address_bits
    outputs = len(code.graph.force) + code.graph.reported
    widths: dict[str, int] = {}
    for _, _, port in code.ports():
        widths |= {f"{port}_source": _bits(len(sources(code, port))), f"{port}_place": address}
        widths |= {f"{port}_{name}": 1 for name in ("relative", "negative", "magnitude")}
    for bank in banks:
        widths |= {f"{bank}_write": 1, f"{bank}_place": address if bank == banks[-1] else code.near_bits}
    widths |= {"condition": _bits(len(code.conditions) + 1), "what": 4}
    widths |= {"flag_write": 1, "flag": _bits(len(compared(code.graph))), "out_write": 1, "out": _bits(outputs)}
    widths |= {"settled": 1, "soon": 1, "last": 1} | {f"{unit}_load": 1 for unit in code.loaded}
    found, low = [], 0
    for name, wide in widths.items():
        used = sources(code, name.removesuffix("_source")) if name.endswith("_source") else None
        most = max(word.get(name, 0) for word in code.words) if used is None else len(used) - 1
        width = max(most, 0).bit_length()
        found.append(Field(name, low, width, wide))
        low += width
    return found


def sources(code: Microcode, port: str) -> list[int]:
    """Sources of an operand in any word. The hardware selects by the index in this list, which is short."""
    return sorted({word[f"{port}_source"] for word in code.words if f"{port}_source" in word})


def compared(graph: Graph) -> list[int]:
    """The nodes whose comparisons are kept, each as one bit."""
    return sorted({one.of for one in graph.predicates if one.question == 0})


def deciding(graph: Graph) -> int:
    """Cycles from the last comparison until the results of all decisions are known.

    One cycle for the predicates, one for reading the program, one for comparing it.
    """
    return 3 + max(graph.levels[root] for root in graph.roots) // LEVELS


def microcode_hex(code: Microcode) -> str:
    """In line k the words k, k + ROWS, …, the first one last."""
    layout = fields(code)
    width = layout[-1].low + layout[-1].width
    chosen = {f"{port}_source": sources(code, port) for _, _, port in code.ports()}
    lines = [0] * ROWS
    for number, word in enumerate(code.words):
        value = 0
        for one in layout:
            part = word.get(one.name, 0)
            part = chosen[one.name].index(part) if one.name in chosen and one.name in word else part
            assert part < 1 << one.width
            value |= part << one.low
        lines[number % ROWS] |= value << number // ROWS * width
    digits = -(-width * _blocks(code) // 4)
    return "".join(f"{line:0{digits}x}\n" for line in lines)


def _blocks(code: Microcode) -> int:
    return -(-len(code.words) // ROWS)


def constants_hex(code: Microcode) -> str:
    """Initial contents of the memories."""
    arithmetic = code.graph.arithmetic
    digits = -(-arithmetic.inside // 4)
    values = {
        place: arithmetic.encoded(code.graph.nodes[node].bits)
        for node, place in code.given.items()
        if code.graph.nodes[node].op == "constant"
    }
    return "".join(f"{values.get(place, 0):0{digits}x}\n" for place in range(1 << code.address_bits))


def values(code: Microcode) -> dict[str, Any]:
    """Values for the template of the controller."""
    graph, layout = code.graph, fields(code)
    arithmetic = graph.arithmetic
    outputs = len(graph.force) + graph.reported
    parts = [(node, graph.inputs[graph.nodes[node].bits]) for node in code.given if graph.nodes[node].op == "input"]
    measured = {one.measured: code.given[node] for node, one in parts if one.measured >= 0}
    turning = [(node, one) for node, one in parts if one.measured < 0]
    convert = arithmetic.from_integer + 2  # cycles from a phase until the first of its parts is a number
    phases = _phases(graph)
    program_of = {program: k for k, one in enumerate(code.schedules) for program in one.routine.programs}
    integers = _integers(graph)
    return {
        "words": len(code.words),
        "width": layout[-1].low + layout[-1].width,
        "rows": ROWS,
        "blocks": _blocks(code),
        "programs": len(graph.programs),
        "machine": f"{code.machine.adders} adders, {code.machine.multipliers} multipliers",
        "reported": graph.reported,
        "numbers": len(code.state),
        "whole_words": _whole_words(code),
        "forces": [(code.state[word], axis) for word, axis in zip(graph.force, "xy", strict=True)],
        "in_bits": in_bits(code),
        "read_bits": out_bits(code),
        "pc_bits": _bits(max(len(code.words) + 1, 2 * ROWS)),
        "row_bits": _bits(ROWS),
        "program_bits": _bits(len(graph.programs)),
        "part_bits": _bits(len(turning) + convert + 1),
        "put_bits": _bits(len(turning) + 1),
        "quiet_bits": _bits(deciding(graph)),
        "convert": convert,
        "prefix": arithmetic.prefix,
        "dividers": code.machine.dividers,
        "word": arithmetic.word,
        "inside": arithmetic.inside,
        "floats": arithmetic.number == "float",
        "address_bits": code.address_bits,
        "near_bits": code.near_bits,
        "out_bits": _bits(outputs),
        "outputs": outputs,
        "half": code.half,
        "fields": layout,
        "flags": len(compared(graph)),
        "integers": [
            {"word": place, "range": _range(_width(graph, place)), "initial": graph.words[place].low}
            for place in integers
        ],
        "decisions": list(_decisions(graph, integers)),
        "bases": [(program, code.bases[program_of[program]]) for program in sorted(program_of)],
        "start_base": code.bases[-1],
        "conditions": [sorted(one) for one in code.conditions],
        "wait": deciding(graph),
        "measured": [measured.get(k, max(code.given.values(), default=0) + 1) for k in range(4)],
        "phases": [dict(zip(("start", "increment", "word"), one, strict=True)) for one in phases],
        "parts": [
            {
                "place": code.given[node],
                "whole": _whole(arithmetic, phases.index((one.start, one.increment, one.word)), one.part),
            }
            for node, one in turning
        ],
        "banks": code.machine.banks,
        "ports": list(_ports(code)),
    }


def in_bits(code: Microcode) -> int:
    """Bits of the input index: the motion, then the state."""
    return _bits(4 + state_words(code))


def out_bits(code: Microcode) -> int:
    """Bits of the output index: the report, then the state."""
    return _bits(code.graph.reported + state_words(code))


def state_words(code: Microcode) -> int:
    """Number of 32-bit words of the state: numbers, integers, phases of the reference."""
    return len(code.state) + len(_whole_words(code))


def _whole_words(code: Microcode) -> list[str]:
    """The integers of the state and the phases, in pieces of at most 32 bits."""
    graph = code.graph
    whole = [part for place in _integers(graph) for part in _parts(f"i{place}", _width(graph, place))]
    return whole + [part for number in range(len(_phases(graph))) for part in _parts(f"phase{number}", 64)]


def _integers(graph: Graph) -> list[int]:
    return [place for place in graph.integers if graph.words[place].varies]


def _phases(graph: Graph) -> list[tuple[int, int, int]]:
    """Start, increment and word (-1: none) of each. The hardware relies on a word that stays or increases by one."""
    found = sorted({(one.start, one.increment, one.word) for one in graph.inputs if one.measured < 0})
    for word in {word for _, _, word in found if word >= 0}:
        assert {graph.leaves[leaf][1:] for leaf in _reached(graph, graph.roots[word])} <= {(word, 0), (word, 1)}
    return found


def _reached(graph: Graph, root: int) -> set[int]:
    """The leaves that a diagram leads to."""
    seen, left, found = {root}, [root], set()
    while left:
        diagram = graph.diagrams[left.pop()]
        if diagram.predicate < 0:
            found.add(diagram.yes)
            continue
        fresh = {diagram.yes, diagram.no} - seen
        seen |= fresh
        left += fresh
    return found


def _parts(name: str, width: int) -> list[str]:
    """An integer in pieces of at most 32 bits, the least first."""
    if width <= 32:
        return [name]
    return [f"{name}[{min(low + 32, width) - 1}:{low}]" for low in range(0, width, 32)]


def _bits(count: int) -> int:
    """For numbers below `count`."""
    return max(1, (count - 1).bit_length())


def _range(width: int) -> str:
    return f"[{width - 1}:0] " if width > 1 else ""


def _width(graph: Graph, place: int) -> int:
    """Width of an integer of the state."""
    word = graph.words[place]
    return word.bits if word.high == UNBOUNDED else max(1, word.high.bit_length())


def _whole(arithmetic: Arithmetic, phase: int, part: int) -> str:
    parts = (f"rest{phase}", f"quadrant{phase}[0]", f"quadrant{phase}[1]", f"next{phase}[1]")
    return arithmetic.whole(part, parts[part])


def _decisions(graph: Graph, integers: list[int]) -> Iterator[str]:
    """Each predicate, and what integers, status and program become: one choice for each node of a diagram."""
    flags = {node: k for k, node in enumerate(compared(graph))}
    several = len(flags) > 1
    for number, (question, of, limit) in enumerate(graph.predicates):
        width = _width(graph, of) if question else 0
        if question == 0:
            text = f"flag[{flags[of]}]" if several else "flag"
        elif question == 1:
            text = f"i{of} >= {width}'d{limit}"
        else:
            text = f"i{of} % {width}'d{limit} == 0"
        yield f"reg p{number}; always @(posedge clk) p{number} <= {text};"
    for place in integers:
        yield from _choices(graph, graph.roots[place], f"next_i{place}", _width(graph, place))
    yield from _choices(graph, graph.roots[-2], "next_status", 3)
    yield from _choices(graph, graph.roots[-1], "wanted", _bits(len(graph.programs)), programs=True)


def _choices(graph: Graph, root: int, name: str, width: int, programs: bool = False) -> Iterator[str]:
    def leaf(number: int) -> str:
        _, word, offset = graph.leaves[number]
        if word < 0:
            return f"{width}'d{offset}"
        step = f" {'+' if offset > 0 else '-'} {width}'d{abs(offset)}" if offset else ""
        return f"i{word}{step}"

    made: dict[int, str] = {}
    left = [root]
    while left:
        at = left[-1]
        diagram = graph.diagrams[at]
        missing = [one for one in (diagram.no, diagram.yes) if diagram.predicate >= 0 and one not in made]
        if at in made or missing:
            left = left[:-1] if at in made else [*left, *missing]
            continue
        if diagram.predicate < 0:
            made[at] = f"{width}'d{diagram.yes}" if programs else leaf(diagram.yes)
        else:
            made[at] = f"{name}_{at}"
            text = f"p{diagram.predicate} ? {made[diagram.yes]} : {made[diagram.no]}"
            if graph.levels[at] % LEVELS == 0:
                yield f"reg {_range(width)}{made[at]}; always @(posedge clk) {made[at]} <= {text};"
            else:
                yield f"wire {_range(width)}{made[at]} = {text};"
        left.pop()
    yield f"wire {_range(width)}{name} = {made[root]};"


def _ports(code: Microcode) -> Iterator[dict[str, Any]]:
    """Each operand with the sources that some word of microcode chooses."""
    banks = code.machine.banks
    for _, _, name in code.ports():
        used = sources(code, name)
        texts = [
            {MEMORY: f"{name}_{banks[source // 2]}", RESULT: banks[source // 2]}[source % 2] for source in used
        ] or [f"{code.graph.arithmetic.inside}'d0"]
        yield {
            "name": name,
            "memories": [banks[source // 2] for source in used if source % 2 == MEMORY],
            "high": _bits(len(texts)) - 1,
            "chosen": _tree(f"{name}_source", texts, _bits(len(texts))),
        }


def _tree(name: str, texts: list[str], bits: int) -> str:
    """One of the texts, chosen by the bits of a number."""
    if len(texts) == 1:
        return texts[0]
    half = 1 << (bits - 1)
    if len(texts) <= half:
        return _tree(name, texts, bits - 1)
    low, high = _tree(name, texts[:half], bits - 1), _tree(name, texts[half:], bits - 1)
    return f"({name}[{bits - 1}] ? {high} : {low})"
