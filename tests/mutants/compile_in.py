"""Mutants of the C++ headers by rule and from cpp.toml, written into a copy of the sources, each behind a switch.

Rules, on code without comments, strings, preprocessor lines and what the compiler computes:

    sum         a + b -> a - b and the reverse
    product     a * b -> a / b and the reverse
    comparison  of integers the other side of equality, of other numbers the operands swapped, == -> !=
    condition   if (c) -> if (!c)
    constant    0 -> 1, any other number doubled
    statement   an assignment or a call dropped

Of what the rules find a share is kept, by a hash of the line: an edit elsewhere or a move keeps the sample.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
SHARE = 0.02
FOLDERS = tuple(sorted(str(folder.relative_to(ROOT)) for folder in (ROOT / "include/fracgyro").iterdir()))
# Number types: what they do is what everything else is tested by; mutated they fail to compile. Of fields.hpp, and of
# fields() everywhere, the compiler computes all.
WITHOUT_RULES = {"lanes.hpp", "unpacked.hpp", "cpu_dispatch.hpp", "fields.hpp"}


@dataclass(frozen=True)
class Mutant:
    """Text put before and after the characters [begin, end) of a file."""

    file: str
    begin: int
    end: int
    before: str  # %d is its number
    after: str
    rule: str
    line: int
    words: str  # its effect, for the log; independent of the line number

    @property
    def edit(self) -> str:
        """Kind of edit, as in survivors.toml; of an edit that is written out, its id."""
        return re.sub(r"(?: \(\d+\))? in `.*", "", self.words)


def blanked(text: str) -> str:
    """The text with comments, strings and preprocessor lines replaced by spaces."""
    pattern = r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*'
    return re.sub(pattern, lambda m: re.sub(r"[^\n]", " ", m[0]), text, flags=re.DOTALL | re.MULTILINE)


def computed_by_the_compiler(code: str) -> list[tuple[int, int]]:
    """Constexpr variables, static assertions, attributes, template heads, macros, pure specifiers, and the defaults of
    members."""
    spans = []
    declared = r"\b(?:constexpr|constinit)\b[^;(){}=]*[={]|\bstatic_assert\b|\bconcept\b|\bconsteval\b|\busing\b"
    for start in re.finditer(rf"\bfields\(\) \{{|{declared}", code):
        end, depth, at = "}" if start[0].startswith("fields") else ";", 0, start.start()
        while at < len(code):
            depth += {"{": 1, "}": -1, "(": 1, ")": -1}.get(code[at], 0)
            at += 1
            if code[at - 1] == end and depth == 0:
                break
        spans.append((start.start(), at))
    words = r"\[\[.*?\]\]|\btemplate <.*?>(?=\s)|\bcase\b[^\n]*?:|\bif constexpr\b[^\n]*|^[A-Z_]+\([^\n]*\)$"
    for found in re.finditer(rf"\) (?:const )?= 0;|{words}", code, re.MULTILINE):
        spans.append(found.span())
    defaults = r"^ {4,8}(?:const )?[\w:<>, ]+ \w+(?: = [\w.+-]+|\{[\w.+, -]*\})(?:, \w+ = [\w.+-]+)*;[ ]*$"
    for found in re.finditer(defaults, code, re.MULTILINE):
        if not re.match(r"\s*(?:const|auto|return)\b", found[0]) and not found[0].startswith(" " * 8):
            spans.append(found.span())
    members = r"^[ ]+[\w:]+<[^\n;]*> \w+(?:\{\})?(?:, \w+(?:\{\})?)*;[ ]*$"
    for found in re.finditer(r"\{ [^{}\n]* \} -> [^\n]*|" + members, code, re.MULTILINE):
        spans.append(found.span())
    return spans


def candidates(file: str, text: str) -> list[Mutant]:
    code = blanked(text)
    fixed = computed_by_the_compiler(code)
    found: list[Mutant] = []
    starts = [0, *(m.end() for m in re.finditer("\n", text))]
    seen: Counter[tuple[str, str]] = Counter()

    def add(rule: str, begin: int, end: int, before: str, after: str, reported: str) -> None:
        if any(a <= begin < b for a, b in fixed):
            return
        number = next(i for i in range(len(starts), 0, -1) if starts[i - 1] <= begin)
        line = text[starts[number - 1] :].split("\n", 1)[0].strip()
        seen[line, reported] += 1
        nth = f" ({seen[line, reported]})" if seen[line, reported] > 1 else ""
        found.append(Mutant(file, begin, end, before, after, rule, number, f"{reported}{nth} in `{line}`"))

    for m in re.finditer(r"(?<=[\w)\]}]) ([+-]) (?=[\w(:-])", code):
        other = {"+": "-", "-": "+"}[m[1]]
        add("sum", m.end(), m.end(), "mutant::Sign{%d} * ", "", f"{m[1]} to {other}")
    for m in re.finditer(r"(?<=[\w)\]}]) ([*/]) (?=[\w(:-])", code):
        other = {"*": "/", "/": "*"}[m[1]]
        add("product", m.end(), m.end(), f"mutant::Factor{{%d}} {m[1]} ", "", f"{m[1]} to {other}")
    for m in re.finditer(r"(?<=[\w)\]}]) (<|<=|>|>=|==|!=) (?=[\w(:-])", code):
        add("comparison", m.end(), m.end(), f"mutant::Than{{%d}} {m[1]} ", "", f"{m[1]} the other way")
    for m in re.finditer(r"\bif \(", code):
        depth, at = 1, m.end()
        while depth:
            depth += {"(": 1, ")": -1}.get(code[at], 0)
            at += 1
        if not re.search(r"[^<>=!]=[^=]|;", code[m.end() : at - 1]):
            add("condition", m.end(), at - 1, "mutant::active(%d) != bool(", ")", "condition negated")
    literal = r"(?<![\w.'<\[])(?<!\de[+-])(?:0x[\da-fA-F.]+p[+-]?\d+|\d+\.?\d*(?:e[+-]?\d+)?)[FU]?(?![\w.'>\]])"
    for m in re.finditer(literal, code):
        add(
            "constant",
            m.start(),
            m.end(),
            "mutant::number(%d, ",
            ")",
            f"{m[0]} to {'1' if float_of(m[0]) == 0 else 'twice it'}",
        )
    statement = r"^[ ]+((?:[\w.:]|->|\[[^\]]*\])+(?: [-+*/]?= [^;{}]+|\([^;{}]*\));)$"
    for m in re.finditer(statement, code, re.MULTILINE):
        goes_on = code[: m.start(1)].rstrip()[-1:] not in ";{}:)"
        if not goes_on and not re.match(r"(?:return|using|throw|static_assert|friend|break|continue)\b", m[1]):
            add("statement", m.start(1), m.end(1), "if (!mutant::active(%d)) { ", " }", "dropped")
    return found


def place_of(code: str, at: int) -> str:
    """Name of the innermost function around a character of blanked code, or of the type if no function is."""
    heads: list[str] = []  # text before each open brace, from the statement before it
    for brace in re.finditer(r"[{}]", code[:at]):
        if brace[0] == "}":
            heads.pop()
        else:
            heads.append(re.split(r"[;{}]", code[: brace.start()])[-1])
    for head in reversed(heads):
        plain = re.sub(r"template <.*?>\s", "", head, flags=re.DOTALL)
        named = re.search(r"\b(?:struct|class) (\w+)", plain) or re.match(r"[^()=]*?(\w+)\(", plain)
        is_lambda = re.search(r"\](?: ?\([^()]*\))?[^()]*$", plain)
        if named and not is_lambda and named[1] not in ("if", "for", "while", "switch"):
            return named[1]
    return ""


def float_of(literal: str) -> float:
    literal = literal.rstrip("FU")
    return float.fromhex(literal) if literal.startswith("0x") else float(literal)


def listed() -> list[dict[str, str]]:
    """The mutants that are written out: id, file, original, replacement, of which the original occurs once."""
    return list(tomllib.loads((HERE / "cpp.toml").read_text(encoding="utf-8"))["mutant"])


def from_table(entry: dict[str, str], text: str) -> Mutant:
    file, original = entry["file"], entry["original"]
    if text.count(original) != 1:
        raise ValueError(
            f"mutant {entry['id']}: its original occurs {text.count(original)} times in {file}: {original}"
        )
    begin, replacement = text.index(original), entry["replacement"]
    if original.endswith(";"):
        before, after = f"if (mutant::active(%d)) {{ {replacement} }} else {{ ", " }"
    else:
        before, after = f"(mutant::active(%d) ? ({replacement}) : (", "))"
    line = text.count("\n", 0, begin) + 1
    return Mutant(file, begin, begin + len(original), before, after, "listed", line, f"{entry['id']}")


def sample() -> list[Mutant]:
    """All that are compiled in, in the order of their numbers."""
    mutants = []
    table = listed()
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).glob("*.hpp")):
            file, text = str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
            mine = [from_table(entry, text) for entry in table if entry["file"] == file]
            if path.name not in WITHOUT_RULES:
                mine += [m for m in candidates(file, text) if kept(m) and not any(crosses(m, other) for other in mine)]
            mutants += mine
    return mutants


def kept(mutant: Mutant) -> bool:
    return int(hashlib.sha256(mutant.words.encode()).hexdigest()[:8], 16) < SHARE * 2**32


def crosses(a: Mutant, b: Mutant) -> bool:
    """True if the two overlap and neither contains the other."""
    return a.begin < b.begin < a.end < b.end or b.begin < a.begin < b.end < a.end


def mutated(text: str, mutants: list[tuple[int, Mutant]]) -> str:
    """The text with all mutants. Of two that begin at the same place the longer is outside; one without an end is
    outside of both."""
    puts: list[tuple[int, int, int, str]] = []
    for number, m in mutants:
        length = m.end - m.begin
        puts.append((m.begin, 1, -length if length else -len(text), m.before.replace("%d", str(number))))
        if m.after:
            puts.append((m.end, 0, length, m.after))
    for at, _, _, words in sorted(puts, reverse=True):
        text = text[:at] + words + text[at:]
    # A table that the compiler computes is computed when the program starts, with its mutants.
    for name in re.findall(r"^inline constexpr [^=;]* = \w+::(\w+)\(\);$", text, re.MULTILINE):
        text = re.sub(rf"^inline constexpr (?=[^=;]* = \w+::{name}\(\);$)", "inline const ", text, flags=re.MULTILINE)
        text = re.sub(rf"\bconstexpr (?=[\w:]+ {name}\(\) \{{)", "", text)
    return text.replace("#pragma once\n", '#pragma once\n#include "fracgyro/core/switch.hpp"\n', 1)


def write(mutants: list[Mutant], folder: Path) -> None:
    """The headers with every mutant in them, below `folder`."""
    for source in FOLDERS:
        for path in sorted((ROOT / source).glob("*.h*")):
            file = str(path.relative_to(ROOT))
            mine = [(number, m) for number, m in enumerate(mutants) if m.file == file]
            text = path.read_text(encoding="utf-8")
            target = folder / file
            new = mutated(text, mine) if mine else text
            target.parent.mkdir(parents=True, exist_ok=True)
            if not target.is_file() or target.read_text(encoding="utf-8") != new:
                target.write_text(new, encoding="utf-8")
    (folder / "include/fracgyro/core/switch.hpp").write_text((HERE / "switch.hpp").read_text(encoding="utf-8"))
