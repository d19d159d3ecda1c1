"""Time and size of the documentation site: benchmarks/results/site.md.

    python benchmarks/site.py

Builds the site from nothing with `make docs`, in this clone, whose environment must have the extra `docs`.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import time
from collections import Counter

from machine import ROOT, command, machine, write

# Not the texts and the code that the site shows: they change with every commit.
DEPENDS_ON = ["docs/site/compact.py", "docs/site/static/*", "docs/site/templates/**/*"]

SITE = ROOT / "build/site"
MADE = (SITE, ROOT / "build/site-source", ROOT / "build/site-doctrees")
SECONDS_MARK, BYTES_MARK = 60, 15e6


def main() -> None:
    busy = os.getloadavg()[0]
    for folder in MADE:
        shutil.rmtree(folder, ignore_errors=True)
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["make", "-o", ".venv/installed-docs", "docs"], cwd=ROOT, check=True)
    took, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    sizes: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for path in SITE.rglob("*"):
        if path.is_file():
            sizes[path.suffix] += path.stat().st_size
            files[path.suffix] += 1
    write(
        "site",
        [
            "# The documentation site",
            "",
            f"Made by `{command()}`: `make docs` from nothing, with the gallery, the live page and the board.",
            "",
            f"Machine: {machine('sphinx', 'furo', 'sphinx-gallery')}; load average {busy:.1f} before, on "
            f"{os.cpu_count()} processors.",
            "",
            f"Time: {took:.0f} s; processor time of all processes {processor:.0f} s. The mark of {SECONDS_MARK} s is "
            f"{'kept' if took <= SECONDS_MARK else 'missed'}.",
            "",
            f"Size: {sizes.total() / 1e6:.1f} MB in {files.total()} files. The mark of {BYTES_MARK / 1e6:.0f} MB is "
            f"{'kept' if sizes.total() <= BYTES_MARK else 'missed'}.",
            "",
            "| files | number | bytes |",
            "|---|---|---|",
            *(f"| {suffix or 'others'} | {files[suffix]} | {size:,} |" for suffix, size in sizes.most_common(8)),
        ],
    )


if __name__ == "__main__":
    main()
