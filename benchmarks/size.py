"""Hand-written lines by part, of git revisions; writes benchmarks/results/size.md.

    python benchmarks/size.py [REVISION ...]     0da9e4e and HEAD by default

The mark is at least 10 % fewer lines than the first revision at equal function.
"""

from __future__ import annotations

import argparse
import io
import re
import subprocess
from collections import Counter

from machine import command, write
from sources import ROOT

MEASURES_CODE = True
FIRST = "0da9e4e"
MARK = 0.10
# Files that programs write or that hold data: pictures, records, corpora, locks, logs, and pages made from the code.
GENERATED = re.compile(
    r".*\.(svg|png|csv|json|jsonl|lock)|benchmarks/results/.*|.*/corpus/.*|.*/_core\.pyi|LICENSE"
    r"|docs/(best_order|errata|reference|study_files)\.md|integrations/firmware/measured\.md"
)
# By the first pattern that the path begins with or has as a folder, wherever its folder has moved.
PARTS = {
    "tests": r"(.*/)?tests/",
    "benchmarks": r"(.*/)?bench(marks)?/",
    "documentation": r"docs/|examples/|(lab/)?article/|.*\.md$",
    "C++ core": r"include/",
    "bindings": r"bindings/",
    "integrations": r"integrations/|fpga/(?!.*\.py$)",
    "Python": r"python/|fpga/|lab/",
    "build and settings": r"",
}


def part_of(path: str) -> str:
    return next(part for part, pattern in PARTS.items() if re.match(pattern, path))


def git(*words: str, given: bytes | None = None) -> bytes:
    return subprocess.run(["git", *words], cwd=ROOT, input=given, capture_output=True, check=True).stdout


def lines_of(revision: str) -> Counter[str]:
    """By part, those of generated files included."""
    entries = [entry.partition("\t") for entry in git("ls-tree", "-r", "-z", revision).decode().split("\0")[:-1]]
    blobs = {path: words.split()[2] for words, _, path in entries}
    contents = io.BytesIO(git("cat-file", "--batch", given="\n".join(blobs.values()).encode()))
    found: Counter[str] = Counter()
    for path in blobs:  # <hash> blob <size>, the bytes, and an empty line
        size = int(contents.readline().split()[2])
        part = "generated or data" if GENERATED.fullmatch(path) else part_of(path)
        found[part] += contents.read(size + 1)[:-1].count(b"\n")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revisions", nargs="*", metavar="REVISION", default=[FIRST, "HEAD"])
    revisions = [git("rev-parse", "--short", each).decode().strip() for each in parser.parse_args().revisions]
    counts = [lines_of(revision) for revision in revisions]
    totals = [sum(count[part] for part in PARTS) for count in counts]
    rows = [(part, [count[part] for count in counts]) for part in PARTS]
    rows += [("**hand-written**", totals), ("generated or data", [count["generated or data"] for count in counts])]
    less = 1 - totals[-1] / totals[0]
    lines = [
        "# Size",
        "",
        f"Made by `{command()}`.",
        "",
        "Lines of all files in git, comments and blank lines included. Generated or data are pictures, records,",
        "corpora, locks, logs, and pages and types made from the code (`GENERATED` in benchmarks/size.py).",
        "",
        f"| part | {' | '.join(revisions)} | change |",
        "|---|" + "---:|" * (len(revisions) + 1),
        *(
            f"| {part} | {' | '.join(f'{n:,}' for n in numbers)} | {numbers[-1] / max(numbers[0], 1) - 1:+.1%} |"
            for part, numbers in rows
        ),
        "",
        f"Hand-written lines: {abs(less):.1%} {'fewer' if less >= 0 else 'more'}. The mark at equal function is "
        f"{MARK:.0%} fewer: {'reached' if less >= MARK else 'not reached'}.",
    ]
    write("size", lines)


if __name__ == "__main__":
    main()
