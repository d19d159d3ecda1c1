"""The controllers compared in full; writes compare_track.md and compare_rate.md. Resumes what build/compare holds of
these sources.

The numbers are in compare-track.json and compare-rate.json of the same folder, which the article reads.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fracgyro_lab.comparison.plan import TASKS
from fracgyro_lab.comparison.report import (
    chattering,
    interval,
    labelled,
    limit_row,
    number,
    rank,
    remarks,
    tables_of,
    times,
)
from fracgyro_lab.comparison.run import Compared, compare
from fracgyro_lab.comparison.task import Task

sys.path.append(str(Path(__file__).resolve().parents[1] / "benchmarks"))

from machine import RESULTS, command, machine, write
from sources import digest

LOGS = {"compare_track": [], "compare_rate": []}
OUT = Path(__file__).parents[1] / "build" / "compare" / digest(Path(__file__).resolve())  # by sources
STEP = 0.97  # between points of a front in the JSON files
DIGITS = 4  # significant digits in the JSON files
Row = dict[str, Any]


def show(done: float, total: float, doing: str) -> None:
    print(f"\r{doing} {100 * done / total:5.1f} %", end="", file=sys.stderr, flush=True)


def compared(task: str, quick: bool, again: bool) -> Compared:
    """Finish the comparison in the folder; one of another version or of other contenders is repeated.

    Searches of the committed numbers are kept where their gains have the same errors, unless all are made `again`.
    """
    earlier = RESULTS / f"compare-{task}.json"
    searched = None if quick or again or not earlier.is_file() else earlier
    folder = OUT / f"{task}{'-quick' if quick else ''}"
    try:
        return compare(task, folder, quick=quick, resume=folder.is_dir(), searched=searched, progress=show)
    except ValueError as error:
        if "has another study" not in str(error):
            raise
        shutil.rmtree(folder)
        return compare(task, folder, quick=quick, searched=searched, progress=show)


def lines_of(task: Task, rows: list[Row], limits: list[Row]) -> list[str]:
    limit, ceiling = limit_row(limits, rows[0]), rows[0]["ceiling"]
    heads = ["contender", f"{labelled(task.error_words)} (95 %)"]
    heads += ["over the limit", "steady, over the limit"] if limits else []
    heads += [f"over {task.over} (95 %)", *(["chattering used"] if ceiling else []), "decided"]
    heads += ["searches, training seeds", *(labelled(task.words(name)) for name in task.metrics)]
    heads += ["diverged", "time", "state (B)", "remarks"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    if limit:
        mine = [number(limit["metrics"].get(name, {}).get("value")) for name in task.metrics]
        cells = ["limit", interval(limit["metrics"]["error"]), "1", "1", "–", "–", "–", "–", *mine, "–", "–", "–", ""]
        lines.append(f"| {' | '.join(cells)} |")
    for row in sorted(rows, key=rank):
        found, cost, over = row["metrics"], row["cost"] or {}, row["over_limit"] or {}
        cells = [
            row["name"] + ("" if row["tuned"] or not row["trials"] else " (untuned)"),
            interval(found.get("error")),
            *([number(over.get("error")), number(over.get("steady"))] if limits else []),
            interval(row["ratio"]),
            *([chattering(row)] if ceiling else []),
            row["verdict"] or "–",
            ", ".join(map(number, row["sampler_errors"])) or "–",
            *(number(found.get(name, {}).get("value")) for name in task.metrics),
            f"{row['diverged']}/{row['seeds']}" if found else "–",
            f"×{number(cost.get('relative'), 2)}",
            str(cost.get("state_bytes", "–")),
            remarks(row),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def front(rows: list[Row], limits: list[Row]) -> list[str]:
    """The least error up to each ceiling, on held-out seeds, and where the limit is."""
    ceilings = sorted({row["ceiling"] for row in rows})
    heads = ["error (steady error over the limit)", *(f"chattering ≤ {number(ceiling)}" for ceiling in ceilings)]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    by_place = {(row["name"], row["ceiling"]): row for row in rows if row["kept"]}
    first = [limit_row(limits, {**rows[0], "ceiling": ceiling}) for ceiling in ceilings]
    if any(first):
        lines.append(f"| limit | {' | '.join(interval(at['metrics']['error']) if at else '–' for at in first)} |")

    def cell(name: str, ceiling: float) -> str:
        row = by_place.get((name, ceiling))
        if row is None:
            return "–"
        over = (row["over_limit"] or {}).get("steady")
        return number(row["metrics"]["error"]["value"]) + (f" ({number(over)})" if over else "")

    last = sorted((row for row in rows if row["ceiling"] == ceilings[-1]), key=rank)
    lines += [f"| {' | '.join([row['name'], *(cell(row['name'], c) for c in ceilings)])} |" for row in last]
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
    others = {name: {key: found[key] for key in ("value", "lost")} for name, found in row["others"].items()}
    return {**row, "metrics": shown, "others": others}


def thinned(front: list[list[float]]) -> list[list[float]]:
    """Points of a front whose error is some percent below that of the point before, and its ends."""
    kept: list[list[float]] = []
    for point in front:
        if not kept or point is front[-1] or point[1] < STEP * kept[-1][1]:
            kept.append(point)
    return kept


def keep(data: Path, name: str, task: Task) -> None:
    """compare.json with fewer digits, a line for each row."""
    found = json.loads(data.read_text(encoding="utf-8"))
    metrics = ("error", *task.metrics)
    short = [rounded(shortened(row, metrics)) for row in found.pop("contenders")]
    for row in short:
        row["front"] = thinned(row["front"])
    rows = ",\n".join(json.dumps(row, ensure_ascii=False) for row in short)
    head = json.dumps(rounded(found), ensure_ascii=False)[:-1]
    (RESULTS / name).write_text(f'{head}, "contenders": [\n{rows}\n]}}\n', encoding="utf-8")


def log_of(name: str, result: Compared, quick: bool) -> list[str]:
    """The log of a task."""
    task = TASKS[name]
    lines = [f"# Which controller? {task.title}", ""]
    lines += [f"Made by `{command()}`, which `make compare` runs. Machine: {machine('cmaes')}.", ""]
    lines += ["**Untuned.**" if quick else "Rules and words: [the comparison](../../docs/compare.md).", ""]
    lines += [f"{len(result.rows)} rows, {result.seconds:.0f} s, {result.resumed} pieces found finished.", ""]
    named = result.rows[0]["scenario"]
    for words, rows in tables_of(result.rows, with_ceiling=False, unnamed=named) if result.limits else []:
        lines += [f"## The front: {words}", "", *front(rows, result.limits), ""]
    for limit in result.limits:
        lines += [f"No limit: {limit['scenario']}, class {limit['class']}: {limit['why']}", ""] if limit["why"] else []
    for words, rows in tables_of(result.rows, with_ceiling=True, unnamed=named):
        lines += [f"## {words}", "", *lines_of(task, rows, result.limits), "", *others(rows), ""]
    return lines[:-1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", metavar="TASK", help=f"Tasks to run: {', '.join(TASKS)}; by default all.")
    parser.add_argument("--quick", action="store_true", help="a minute's look; the logs are marked as untuned")
    parser.add_argument("--again", action="store_true", help="make all searches again")
    given = parser.parse_args()
    for name in given.tasks or TASKS:
        if name not in TASKS:
            parser.error(f"TASK is {name}: it must be among {', '.join(TASKS)}")
        result = compared(name, given.quick, given.again)
        if not given.quick:
            keep(result.data, f"compare-{name}.json", TASKS[name])
        write(f"compare_{name}", log_of(name, result, given.quick))


if __name__ == "__main__":
    main()
