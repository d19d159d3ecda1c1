"""`make mutants`: mutants of the C++ headers and of Python modules, which tests kill them, and the log of it.

Ends with 1 where less than 95 % are killed, or one survives that survivors.toml says nothing of. Its parts, each of
which keeps what it found in build/mutants: cpp, python; log writes benchmarks/results/mutants.md from them.
`make mutants ARGS="python/fracgyro/rate/bound.py include/fracgyro/estimation/joint.hpp"` prints what survives of these
files only.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Collection, Mapping
from pathlib import Path

from compile_in import HERE, ROOT

DEPENDS_ON = ["include/fracgyro/**/*.hpp", "tests/mutants/*"]

BUILD = ROOT / "build/mutants"
LOG = ROOT / "benchmarks/results/mutants.md"
KILLED = 0.95
JOBS = len(os.sched_getaffinity(0))

Found = dict[str, list[list[str]]]  # by file: what each mutant is and what became of it


def keep(part: str, found: Mapping[str, list[list[str]]]) -> None:
    BUILD.mkdir(parents=True, exist_ok=True)
    (BUILD / f"{part}.json").write_text(json.dumps(found, indent=1, ensure_ascii=False), encoding="utf-8")


def cpp(only: Collection[str] = ()) -> Found:
    """Of the headers, or only of some."""
    from compiled import build
    from cpp_kills import killed_by_cpp_tests, killed_by_python_tests

    mutants = build(only)
    killed = killed_by_cpp_tests(range(len(mutants)), JOBS)
    print(f"{len(killed)} of {len(mutants)} mutants of the headers killed by C++ tests", flush=True)
    by_python, unreached = killed_by_python_tests(set(range(len(mutants))) - killed, JOBS)
    print(f"{len(by_python)} more by Python tests", flush=True)
    found: Found = defaultdict(list)
    for number, mutant in enumerate(mutants):
        state = "C++" if number in killed else "Python" if number in by_python else "survived"
        if state == "survived" and number in unreached:
            state = "survived, no Python test comes by"
        found[mutant.file].append([mutant.words, state])
    return found


def python(only: Collection[str] = ()) -> Found:
    """Of the package, or only of some files."""
    from python_kills import MODULES, by_mutmut, killed_listed, listed

    found: Found = defaultdict(list)
    files = {entry["id"]: f"python/fracgyro/{entry['file']}" for entry in listed()}
    chosen = [entry for entry in listed() if not only or files[entry["id"]] in only]
    for identifier, killed in killed_listed(chosen, JOBS).items():
        found[files[identifier]].append([identifier, "Python" if killed else "survived"])
    for name, (state, diff) in by_mutmut(
        [m for m in MODULES if not only or f"python/fracgyro/{m}" in only], JOBS
    ).items():
        file = "python/" + name.partition(".x")[0].replace(".", "/") + ".py"
        lines = [line[1:].strip() for line in diff.splitlines() if re.match(r"[-+](?![-+])", line)]
        words = " -> ".join(f"`{line}`" for line in lines) or name
        found[file].append([words, "Python" if state == "killed" else state])
    return found


def explained() -> dict[str, str]:
    """Why a survivor may: by its file and what it is."""
    entries = tomllib.loads((HERE / "survivors.toml").read_text(encoding="utf-8"))["survivor"]
    return {f"{entry['file']}: {entry['mutant']}": entry["why"] for entry in entries}


def log() -> int:
    sys.path.append(str(ROOT / "benchmarks"))
    from sources import stamp

    found: Found = {}
    for part in ("cpp", "python"):
        found |= json.loads((BUILD / f"{part}.json").read_text(encoding="utf-8"))
    why = explained()
    rows, survivors, silent, total, dead = [], [], 0, 0, 0
    for file, mutants in sorted(found.items()):
        states = [state for _, state in mutants]
        cpp, python = states.count("C++"), states.count("Python")
        rows.append(f"| {file} | {len(states)} | {cpp or ''} | {python or ''} | {len(states) - cpp - python or ''} |")
        total, dead = total + len(states), dead + cpp + python
        for words, state in mutants:
            if state not in ("C++", "Python"):
                reason = why.get(f"{file}: {words}", "")
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
    why, silent = explained(), 0
    for file, mutants in found.items():
        left = [words for words, state in mutants if state not in ("C++", "Python")]
        print(f"{file}: {len(mutants) - len(left)} of {len(mutants)} killed")
        for words in left:
            silent += f"{file}: {words}" not in why
            print(f"  {words}\n    {why.get(f'{file}: {words}', 'NOT EXPLAINED')}")
    return int(silent > 0)


def main() -> int:
    parts = sys.argv[1:] or ["cpp", "python", "log"]
    if all("/" in part for part in parts):
        return of_files(parts)
    for part in parts[:-1] if parts[-1] == "log" else parts:
        keep(part, {"cpp": cpp, "python": python}[part]())
    return log() if parts[-1] == "log" else 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    sys.exit(main())
