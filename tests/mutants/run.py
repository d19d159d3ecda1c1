"""`make mutants`: mutants of the C++ headers and of Python modules, which tests kill them, and the log of it.

Ends with 1 if less than 95 % are killed, or if one survives that no rule of survivors.toml expects. Its parts: check
compares the tables with the sources; cpp and python keep their outcomes in build/mutants; log writes
benchmarks/results/mutants.md from them.
`make mutants ARGS="python/fracgyro/rate/bound.py include/fracgyro/estimation/joint.hpp"` prints what survives of these
files only.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import NamedTuple

import python_kills
from compile_in import HERE, ROOT, blanked, candidates, from_table, place_of
from compile_in import listed as listed_in_cpp

MEASURES_CODE = True
DEPENDS_ON = ["include/fracgyro/**/*.hpp", "tests/mutants/*"]

BUILD = ROOT / "build/mutants"
LOG = ROOT / "benchmarks/results/mutants.md"
KILLED = 0.95
JOBS = len(os.sched_getaffinity(0))


class Outcome(NamedTuple):
    """`words`: the mutant; `place`: function or type around it; `edit`: its kind; `state`: the tests that kill it."""

    words: str
    place: str
    edit: str
    state: str


Found = dict[str, list[Outcome]]  # by file


def keep(part: str, found: Mapping[str, list[Outcome]]) -> None:
    BUILD.mkdir(parents=True, exist_ok=True)
    (BUILD / f"{part}.json").write_text(json.dumps(found, indent=1, ensure_ascii=False), encoding="utf-8")


def cpp(only: Collection[str] = ()) -> Found:
    """Mutants of the headers, or only of some headers."""
    from compiled import build
    from cpp_kills import killed_by_cpp_tests, killed_by_python_tests

    mutants = build(only)
    killed = killed_by_cpp_tests(range(len(mutants)), JOBS)
    print(f"{len(killed)} of {len(mutants)} mutants of the headers killed by C++ tests", flush=True)
    by_python, unreached = killed_by_python_tests(set(range(len(mutants))) - killed, JOBS)
    print(f"{len(by_python)} more by Python tests", flush=True)
    found: Found = defaultdict(list)
    code = {file: blanked((ROOT / file).read_text(encoding="utf-8")) for file in {m.file for m in mutants}}
    for number, mutant in enumerate(mutants):
        state = "C++" if number in killed else "Python" if number in by_python else "survived"
        if state == "survived" and number in unreached:
            state = "survived, no Python test comes by"
        place = place_of(code[mutant.file], mutant.begin)
        found[mutant.file].append(Outcome(mutant.words, place, mutant.edit, state))
    return found


def python(only: Collection[str] = ()) -> Found:
    """Mutants of the package, or only of some files."""
    found: Found = defaultdict(list)
    files = {entry["id"]: python_kills.path_of(entry["file"]) for entry in python_kills.listed()}
    chosen = [entry for entry in python_kills.listed() if not only or files[entry["id"]] in only]
    for identifier, killed in python_kills.killed_listed(chosen, JOBS).items():
        found[files[identifier]].append(Outcome(identifier, "", identifier, "Python" if killed else "survived"))
    for name, (state, diff) in python_kills.by_mutmut(
        [m for m in python_kills.MODULES if not only or python_kills.path_of(m) in only], JOBS
    ).items():
        file = python_kills.path_of(name.partition(".x")[0].replace(".", "/") + ".py")
        lines = [line for line in diff.splitlines() if re.match(r"[-+](?![-+])", line)]
        words = " -> ".join(f"`{line[1:].strip()}`" for line in lines) or name
        place = re.sub(r".*\.x(?:ǁ\w+?ǁ|_)(\w+)__mutmut_\d+$", r"\1", name)
        before, after = (" ".join(line[1:] for line in lines if line[0] == sign) for sign in "-+")
        found[file].append(Outcome(words, place, edit_of(before, after), "Python" if state == "killed" else state))
    return found


def edit_of(before: str, after: str) -> str:
    """The tokens in which two lines differ, as "True to False"."""
    a, b = (re.findall(r"[\w.]+|[<>=!*/+-]+|\S", line) for line in (before, after))
    while a and b and a[0] == b[0]:
        a, b = a[1:], b[1:]
    while a and b and a[-1] == b[-1]:
        a, b = a[:-1], b[:-1]
    return f"{' '.join(a)} to {' '.join(b)}"


def rules() -> dict[tuple[str, str, str], str]:
    """Reasons why mutants may survive, by file, place and kind of edit."""
    files = tomllib.loads((HERE / "survivors.toml").read_text(encoding="utf-8"))
    parted = ((file, *rule.split(": ", 1), why) for file, reasons in files.items() for rule, why in reasons.items())
    return {(file, place, kind): why for file, place, kind, why in parted}


def check() -> list[str]:
    """Entries of the tables that do not fit the sources: an edit of the sources may require one of them."""
    found = []
    for entry in listed_in_cpp():
        try:
            from_table(entry, (ROOT / entry["file"]).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            found.append(str(error))
    for entry in python_kills.listed():
        try:
            compile(python_kills.edited(entry), entry["file"], "exec")
        except (OSError, ValueError, SyntaxError) as error:
            found.append(str(error))
    for name, tests in python_kills.TESTS.items():
        text = (ROOT / f"tests/python/test_{name}.py").read_text(encoding="utf-8")
        found += [f"test_{name}.py has no {test}" for test in tests if f"def {test}(" not in text]
    for file, place, kind in rules():
        path = ROOT / file
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        if file.endswith(".hpp"):
            alike = [m for m in candidates(file, text) if m.edit == kind]
            there = place in {place_of(blanked(text), m.begin) for m in alike}
        else:
            functions = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef))
            there = place in {function.name for function in functions}
        if not there:
            found.append(f"survivors.toml: {file} has no mutant {kind} in {place}")
    return found


def log() -> int:
    sys.path.append(str(ROOT / "benchmarks"))
    from sources import stamp

    found: Found = {}
    for part in ("cpp", "python"):
        kept = json.loads((BUILD / f"{part}.json").read_text(encoding="utf-8"))
        found |= {file: [Outcome(*outcome) for outcome in outcomes] for file, outcomes in kept.items()}
    why = rules()
    rows, survivors, silent, total, dead = [], [], 0, 0, 0
    for file, mutants in sorted(found.items()):
        states = [outcome.state for outcome in mutants]
        cpp, python = states.count("C++"), states.count("Python")
        rows.append(f"| {file} | {len(states)} | {cpp or ''} | {python or ''} | {len(states) - cpp - python or ''} |")
        total, dead = total + len(states), dead + cpp + python
        for words, place, edit, state in mutants:
            if state not in ("C++", "Python"):
                reason = why.get((file, place, edit), "")
                silent += not reason
                survivors.append(f"| {file} | {words.replace('|', '&#124;')} | {reason or '**not explained**'} |")
    version = subprocess.run([sys.executable, "-m", "pip", "show", "mutmut"], capture_output=True, text=True).stdout
    tool = re.search(r"^Version: (.*)$", version, re.MULTILINE)
    lines = [
        "# Mutants: which edits of the code the tests notice",
        "",
        "Made by `make mutants`; rules are in `tests/mutants/compile_in.py` and `python_kills.py`, edits that are",
        f"written out in `cpp.toml` and `python.toml` there. Python by mutmut {tool[1] if tool else ''}.",
        "",
        f"**{dead} of {total} killed, {dead / total:.1%}**; {len(survivors)} survived.",
        "",
        "| file | mutants | killed by C++ tests | by Python tests | survived |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "## What survived, and why it may",
        "",
        "| file | mutant | why |",
        "|---|---|---|",
        *survivors,
        "",
        stamp(Path(__file__).resolve()),
        "",
    ]
    LOG.write_text("\n".join(lines), encoding="utf-8")
    print(
        f"{dead} of {total} killed; {len(survivors)} survived, {silent} of them not explained: {LOG.relative_to(ROOT)}"
    )
    return int(dead < KILLED * total or silent > 0)


def of_files(files: list[str]) -> int:
    """Only prints what survives, and ends with 1 where something does that is not explained."""
    found: Found = {}
    for part, suffix in ((cpp, ".hpp"), (python, ".py")):
        if only := [file for file in files if file.endswith(suffix)]:
            found |= part(only)
    why, silent = rules(), 0
    for file, mutants in found.items():
        left = [outcome for outcome in mutants if outcome.state not in ("C++", "Python")]
        print(f"{file}: {len(mutants) - len(left)} of {len(mutants)} killed")
        for words, place, edit, _ in left:
            silent += (file, place, edit) not in why
            print(f"  {words}\n    {why.get((file, place, edit), f'NOT EXPLAINED: {edit} in {place}')}")
    return int(silent > 0)


def main() -> int:
    parts = sys.argv[1:] or ["check", "cpp", "python", "log"]
    if all("/" in part for part in parts):
        return of_files(parts)
    if parts[0] == "check" and (misfits := check()):
        print(*misfits, sep="\n")
        return 1
    for part in [part for part in parts if part not in ("check", "log")]:
        keep(part, {"cpp": cpp, "python": python}[part]())
    return log() if parts[-1] == "log" else 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    sys.exit(main())
