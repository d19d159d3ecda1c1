"""The controllers compared in full; writes benchmarks/results/compare.md. Resumes what build/compare holds."""

from __future__ import annotations

import argparse
import shutil
import sys
from itertools import groupby
from pathlib import Path
from typing import Any

from fracgyro.compare.report import interval, number, rank, times, title
from fracgyro.compare.run import Compared, compare
from machine import command, machine, write

OUT = Path(__file__).parents[1] / "build" / "compare"
TASKS = ["track"]
Row = dict[str, Any]


def show(done: float, total: float, doing: str) -> None:
    print(f"\r{doing} {100 * done / total:5.1f} %", end="", file=sys.stderr, flush=True)


def compared(task: str, quick: bool) -> Compared:
    """What lies there is finished; of another version or of other contenders, it is made again."""
    folder = OUT / f"{task}{'-quick' if quick else ''}"
    try:
        return compare(task, folder, quick=quick, resume=folder.is_dir(), progress=show)
    except ValueError as error:
        if "holds another study" not in str(error):
            raise
        shutil.rmtree(folder)
        return compare(task, folder, quick=quick, progress=show)


def lines_of(rows: list[Row]) -> list[str]:
    metrics = ["rmse_steady_x", "rmse_steady_y", "rmse_transient_x", "rmse_transient_y", "chattering_x", "chattering_y"]
    heads = ["contender", "error (95 %)", "over the paper's (95 %)", "samplers", *metrics, "largest force", "diverged"]
    heads += ["time", "state (B)", "remarks"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in sorted(rows, key=rank):
        found, cost = row["metrics"], row["cost"] or {}
        values = [number(found.get(name, {}).get("value")) for name in (*metrics, "largest_force")]
        remarks = ["" if row["kept"] else "above the ceiling" if found else "no trial kept the ceiling"]
        remarks += [f"at range end: {', '.join(row['range_ends'])}"] if row["range_ends"] else []
        cells = [
            row["name"] + ("" if row["tuned"] or not row["gains"] else " (untuned)"),
            interval(found.get("error")),
            interval(row["ratio"]),
            ", ".join(map(number, row["sampler_errors"])) or "–",
            *values,
            f"{row['diverged']}/{row['seeds']}" if found else "–",
            f"×{number(cost.get('relative'), 2)}",
            str(cost.get("state_bytes", "–")),
            "; ".join(filter(None, remarks)),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def others(rows: list[Row]) -> list[str]:
    rows = [row for row in sorted(rows, key=rank) if row["others"]]
    names = list(rows[0]["others"]) if rows else []
    lines = [f"| error over that without the change | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    return [
        *lines,
        *(f"| {row['name']} | {' | '.join(times(row['others'][name]) for name in names)} |" for row in rows),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a minute's look; the log is marked as untuned")
    quick = parser.parse_args().quick
    lines = ["# Which controller?", ""]
    lines += [f"Made by `{command()}`, which is `make compare`. Machine: {machine('optuna')}.", ""]
    for task in TASKS:
        result = compared(task, quick)
        lines += ["**Untuned.**" if quick else "Rules and words: [the comparison](../../docs/compare.md)."]
        lines += [f"{len(result.rows)} rows, {result.seconds:.0f} s, {result.resumed} pieces found finished.", ""]
        lines += [f"## {task}", ""]

        def key(row: Row) -> tuple[Any, ...]:
            return "", row["class"], row["noise"], row["ceiling"]

        for of, found in groupby(sorted(result.rows, key=key), key):
            rows = list(found)
            lines += [f"### {title(*of)}", "", *lines_of(rows), "", *others(rows), ""]
    write("compare", lines[:-1])


if __name__ == "__main__":
    main()
