"""Check the English of comments, docstrings, messages and Markdown; print file:line: the word: what to say.

python tests/english.py [FILE ...]    all tracked files by default; exits with 1 if there are findings
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SKIPPED = re.compile(
    r"benchmarks/results/|docs/best_order\.md|integrations/firmware/measured\.md|tests/data/|.*/corpus/"
    r"|.*/test_english\.py|.*/zoo/facts/2021_dynamic\.toml"  # a title in its own spelling
)
# Their strings are the text of logs, which changes only with the logs, or quotes logs and messages.
QUOTING = re.compile(r"(fpga/)?(benchmarks|tests)/|lab/(best_order|compare|article/sensing)\.py")

FIRST = re.compile(r"(?i)[\s/*#!<>|-]*(of|what|whether|where|as)\b")
WORDS = {
    r"tells?|told": "reports, states, documented",
    r"anew|once more|made again": "again; regenerated",
    r"besides?": "alongside, next to, with; also",
    r"(?<!there )(is|are) no(?! (longer|more|less|larger|smaller|better|worse))": "is not a; no X is",
    r"so (many|much)": "n, count; this much",
    r"(some|any)body": "a user, anyone",
    r"page one": "entry point",
    r"mend(s|ed|ing)?": "fix",
    r"faces?": "integration, interface",
    r"in the place of": "instead of; at",
    r"on the way": "during the run",
    r"fore(see|saw|seen|sees)": "predict",
    r"(?<!let )alone": "only",
    r"sa(ys|id)": "states, reports",
    r"(?<!to )the truth": "the simulated value, the true value",
    r"where (there (is|are)|nothing|none)": "if, when, without",
    r"none (is|are)": "no X is",
    r"(go|goes|going) on": "continue",
    r"of others": "other; by other",
    r"learnt|spelt|whilst|amongst": "learned, spelled, while, among",
    r"(behavi|col|fav|neighb|hon|lab|harb|rig)our\w*": "-or",
    r"(cent|met|lit|fib|calib)re[ds]?": "-er",
    r"(dev|adv)?(character|normal|quant|optim|minim|maxim|initial|organ|recogn|summar|standard|general|discret|linear"
    r"|parametr|parameter|serial|synchron|util|visual|factor|real|penal|stabil|regular|sanit|token|random|symbol)"
    r"is(e[drs]?|ing|ations?)": "-ize",
    r"analy[sz]e?ing|analyse[dr]?|catalys\w+": "analyze",
    r"(mod|lab|trav|canc|chann|lev|fu)ell(ed|ing)|signall(ed|ing)": "-el-, -al- (modeled, canceled)",
    r"grey|artefacts?|defence|licence|programme|judgement|fulfil|ageing": "American spelling",
}
WRONG = [(re.compile(rf"(?i)(?<![\w./:-])(?:{word})(?![\w/-]|\.\w|\()"), say) for word, say in WORDS.items()]
# In comments only: a question or a heading of a page may begin so.
CLAUSE = (re.compile(r"(?i)\bwhat (is|are|has|have)\b"), "the noun: outputs, estimates, ...")

STRING = r'"(?P<string>(?:\\.|[^"\\\n])*)"'
C_LIKE = re.compile(STRING + r"|`(?:\\.|[^`\\])*`|//(?P<line>[^\n]*)|/\*(?P<block>.*?)\*/", re.DOTALL)
HASHED = re.compile(STRING + r"|(?:^|(?<=\s))#(?P<line>[^\n]*)(?P<block>(?!))?", re.MULTILINE)
PERCENT = re.compile(STRING + r"|'[^'\n]*'|%(?P<line>[^\n]*)(?P<block>(?!))?")
SYNTAX = {
    **dict.fromkeys((".hpp", ".cpp", ".h", ".c", ".mjs", ".js", ".ts", ".v", ".css"), C_LIKE),
    **dict.fromkeys((".toml", ".yml", ".sh", ".txt", "Makefile"), HASHED),
    ".m": PERCENT,
}
Passage = tuple[int, str, bool]  # first line, text, whether it is a comment


def _python(text: str) -> Iterator[Passage]:
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string[1:], True
    tree = ast.parse(text)
    docstrings = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and node.body:
            first = node.body[0]
            docstrings.add(id(first.value) if isinstance(first, ast.Expr) else None)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value, id(node) in docstrings


def _by_syntax(text: str, syntax: re.Pattern[str]) -> Iterator[Passage]:
    for found in syntax.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        if comment := found["line"] or found["block"]:
            yield line, comment, True
        elif " " in (found["string"] or ""):
            yield line, found["string"], False


def passages(name: str, text: str) -> Iterator[Passage]:
    """Comments, docstrings, strings with a space, and the lines of Markdown without code."""
    path = Path(name)
    if path.suffix == ".md":
        text = re.sub(r"(?ms)^```.*?^```$", lambda code: "\n" * code[0].count("\n"), text)
        yield 1, text, False
    elif path.suffix in (".py", ".pyi"):
        yield from _python(text)
    elif syntax := SYNTAX.get(path.suffix or path.name):
        yield from _by_syntax(text, syntax)


def findings(name: str, text: str) -> list[str]:
    """One line for each fault in a file's text."""
    lines = text.splitlines()
    found: list[tuple[int, str]] = []
    last = -1  # line of the comment before
    for line, passage, comment in sorted(passages(name, text)):
        end = line + passage.count("\n")
        if comment:
            continued = line == last + 1 and lines[line - 1].lstrip().startswith(("//", "#", "%"))
            if not continued and (first := FIRST.match(passage)):
                found.append((line, f"{first[1]}: begin with a noun or a verb"))
            last = end
        elif QUOTING.match(name) and not name.endswith(".md"):
            continue
        prose = re.sub(r"`[^`]*`", lambda code: "`" + "\n" * code[0].count("\n"), passage)
        for pattern, say in [*WRONG, CLAUSE] if comment else WRONG:
            found += [
                (line + prose.count("\n", 0, each.start()), f"{each[0]}: {say}") for each in pattern.finditer(prose)
            ]
    return [f"{name}:{line}: {fault}" for line, fault in sorted(set(found))]


def main(arguments: list[str]) -> int:
    tracked = arguments or subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True).stdout.split()
    count = 0
    for name in tracked:
        if SKIPPED.match(name):
            continue
        if name.endswith((".md", ".py", ".pyi", *SYNTAX)):
            for line in findings(name, (ROOT / name).read_text(encoding="utf-8")):
                count += 1
                print(line)
    return int(count > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
