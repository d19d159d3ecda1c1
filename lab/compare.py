"""The controllers compared in full; writes benchmarks/results/compare.md. Resumes what build/compare holds of
these sources.

The numbers are in compare-track.json and compare-rate.json of the same folder, which the article reads.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from fracgyro_lab.comparison.plan import TASKS
from fracgyro_lab.comparison.report import interval, labelled, number, rank, times, title
from fracgyro_lab.comparison.run import Compared, compare
from fracgyro_lab.comparison.task import Task

sys.path.append(str(Path(__file__).resolve().parents[1] / "benchmarks"))

from machine import RESULTS, command, machine, write
from sources import digest

OUT = Path(__file__).parents[1] / "build" / "compare" / digest(Path(__file__).resolve())  # by sources
DIGITS = 4  # significant digits in the JSON files
Row = dict[str, Any]


def show(done: float, total: float, doing: str) -> None:
    print(f"\r{doing} {100 * done / total:5.1f} %", end="", file=sys.stderr, flush=True)


def compared(task: str, quick: bool) -> Compared:
    """Finish the comparison in the folder; one of another version or of other contenders is repeated."""
    folder = OUT / f"{task}{'-quick' if quick else ''}"
    try:
        return compare(task, folder, quick=quick, resume=folder.is_dir(), progress=show)
    except ValueError as error:
        if "has another study" not in str(error):
            raise
        shutil.rmtree(folder)
        return compare(task, folder, quick=quick, progress=show)


def lines_of(task: Task, rows: list[Row]) -> list[str]:
    heads = [
        "contender",
        f"{labelled(task.error_words)} (95 %)",
        f"over {task.over} (95 %)",
        "decided",
        "samplers, training seeds",
    ]
    heads += [*(labelled(task.words(name)) for name in task.metrics), "diverged", "time", "state (B)", "remarks"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in sorted(rows, key=rank):
        found, cost = row["metrics"], row["cost"] or {}
        values = [number(found.get(name, {}).get("value")) for name in task.metrics]
        remarks = ["" if row["kept"] else "beyond a limit" if found else "no trial kept the limits"]
        remarks += [f"at range end: {', '.join(row['range_ends'])}"] if row["range_ends"] else []
        cells = [
            row["name"] + ("" if row["tuned"] or not row["trials"] else " (untuned)"),
            interval(found.get("error")),
            interval(row["ratio"]),
            row["verdict"] or "–",
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


def rounded(value: Any) -> Any:
    """Numbers to DIGITS significant ones."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {name: rounded(part) for name, part in value.items()}
    return [rounded(part) for part in value] if isinstance(value, list) else value


def shortened(row: Row, metrics: Sequence[str]) -> Row:
    """Without what no table shows."""
    shown = {name: value for name, value in row["metrics"].items() if name in metrics}
    others = {name: {"value": found["value"], "lost": found["lost"]} for name, found in row["others"].items()}
    return {**row, "metrics": shown, "others": others}


def keep(data: Path, name: str, task: Task) -> None:
    """compare.json with fewer digits, a line for each row."""
    found = json.loads(data.read_text(encoding="utf-8"))
    metrics = ("error", *task.metrics)
    short = [rounded(shortened(row, metrics)) for row in found.pop("contenders")]
    rows = ",\n".join(json.dumps(row, ensure_ascii=False) for row in short)
    head = json.dumps(rounded(found), ensure_ascii=False)[:-1]
    (RESULTS / name).write_text(f'{head}, "contenders": [\n{rows}\n]}}\n', encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a minute's look; the log is marked as untuned")
    quick = parser.parse_args().quick
    lines = ["# Which controller?", ""]
    lines += [f"Made by `{command()}`, which is `make compare`. Machine: {machine('optuna')}.", ""]
    lines += ["**Untuned.**" if quick else "Rules and words: [the comparison](../../docs/compare.md).", ""]
    for name, task in TASKS.items():
        result = compared(name, quick)
        if not quick:
            keep(result.data, f"compare-{name}.json", task)
        lines += [f"## {name}", ""]
        lines += [f"{len(result.rows)} rows, {result.seconds:.0f} s, {result.resumed} pieces found finished.", ""]

        def key(row: Row) -> tuple[Any, ...]:
            return "", row["class"], row["noise"], row["ceiling"]

        for of, found in groupby(sorted(result.rows, key=key), key):
            rows = list(found)
            lines += [f"### {title(*of)}", "", *lines_of(task, rows), "", *others(rows), ""]
    write("compare", lines[:-1])


if __name__ == "__main__":
    main()
