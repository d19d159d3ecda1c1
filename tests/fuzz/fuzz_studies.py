"""Studies and tunings: files that are nearly right, and folders that are resumed after damage. The first line of an
input selects one: #sweep or #tune, then TOML; #sweep-folder or #tune-folder, then edits as JSON.
"""

from __future__ import annotations

import atexit
import contextlib
import copy
import json
import random
import shutil
import sqlite3
import tempfile
import tomllib
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import fracgyro as fg
import harness
import mutate
from fracgyro.analysis.metric_names import METRICS
from fracgyro.scenario.messages import paths
from fracgyro.study import sweep, tune
from fracgyro.study.sweep import blocks, design
from fracgyro.study.sweep.block_files import BlockFiles
from fracgyro.study.tune.criteria import measure
from fracgyro.study.tune.plan import read_tuning
from fracgyro.study.tune.search import choose, front, opened

FEW, SHORT = 8, 20_000  # runs and steps that are actually run
OFTEN = 100  # every n-th study runs to its report

SWEEP = """
title = "Small"
scenario = "paper"
seeds = 2
show = ["rmse_steady_x", "effort_x"]
[fixed]
run.duration = 0.02
[vary]
controller.order = { low = 0.5, high = 1.0, steps = 2 }
controller.kind = ["linear", "fractional"]
plant.mass = { relative = 0.1, steps = 2 }
reference.amplitude = [[1.0, 1.0], [2.0, 0.5]]
[design]
kind = "grid"
seed = 1
[metrics]
transient = 0.01
error_bound = 0.1
"""
TUNE = """
title = "Small"
scenario = "paper"
seeds = 2
[fixed]
run.duration = 0.02
[vary]
controller.order = { low = 0.5, high = 1.0 }
controller.kind = ["linear", "fractional"]
controller.layer_thickness = { low = 0.02, high = 0.3, scale = "log" }
[metrics]
transient = 0.01
[tune]
sampler = "tpe"
trials = 3
seed = 1
held_out_seeds = 2
[[objective]]
metric = "rmse_steady_x"
[[objective]]
metric = "effort_x"
statistic = "quantile 0.9"
[[constraint]]
metric = "effort_x"
at_most_base = 1.5
"""
NAMES = (
    *paths(fg.Scenario), *METRICS, *design.DESIGNS, "title", "scenario", "seeds", "fixed", "vary", "design", "metrics",
    "show", "kind", "points", "seed", "low", "high", "relative", "scale", "steps", "sampler", "trials", "batch",
    "storage", "held_out_seeds", "metric", "statistic", "at_most", "at_most_base", "objective", "constraint", "tune",
    "log", "cmaes", "nsga2", "median", "quantile 0.5", "paper-printed",
)  # fmt: skip


def make(rng: random.Random) -> bytes:
    kind = rng.choices(["sweep", "tune", "sweep-folder", "tune-folder"], [56, 36, 6, 2])[0]
    if kind.endswith("folder"):
        edits = [_edit(rng, kind) for _ in range(rng.choice([1, 1, 1, 2, 4]))]
        return f"#{kind}\n{json.dumps(edits)}".encode()
    tree = tomllib.loads(SWEEP if kind == "sweep" else TUNE)
    for _ in range(rng.choice([1, 1, 1, 2, 2, 3, 5])):
        if rng.random() < 0.2:  # meaningful words as values
            place = rng.choice(mutate.paths(tree))
            mutate.at(tree, place[:-1])[place[-1]] = rng.choice(NAMES)
        else:
            mutate.change(rng, tree, NAMES)
    data = mutate.toml(tree).encode()
    return f"#{kind}\n".encode() + (mutate.damage(rng, data) if rng.random() < 0.2 else data)


def check(case: bytes, folder: Path) -> str:
    kind, _, body = case.partition(b"\n")
    tries = {b"#sweep": _sweep, b"#tune": _tune, b"#sweep-folder": _sweep_folder, b"#tune-folder": _tune_folder}
    with harness.quiet():
        try:
            tries[kind](body, folder)
        except Exception as error:
            return harness.refused(error)
    return "worked"


def _often(body: bytes) -> bool:
    return zlib.crc32(body) % OFTEN == 0


def _sweep(body: bytes, folder: Path) -> None:
    path = folder / "study.toml"
    path.write_bytes(body)
    plan = design.read_plan(path)
    work = blocks.blocks(plan)
    if plan.runs > FEW or sum(plan.scenario(i).run.steps for i in range(len(plan.points))) > SHORT:
        BlockFiles(folder / "out", plan, work, resume=False)
    elif _often(body):
        sweep(path, folder / "out")
    else:
        there = BlockFiles(folder / "out", plan, work, resume=False)
        there.write(work[0], work[0].measure())
        assert there.finished(work[0])


def _tune(body: bytes, folder: Path) -> None:
    path = folder / "study.toml"
    path.write_bytes(body)
    plan = read_tuning(path)
    json.dumps([plan.parts(), plan.hash, plan.base_values()])
    runs = (plan.file.tune.trials + 1) * len(plan.file.seeds) + 2 * len(plan.held_out)
    if _often(body) and runs <= 3 * FEW and plan.batch <= FEW and plan.base.run.steps * runs <= SHORT:
        tune(path, folder / "out")


# -- Folders -------------------------------------------------------------------------------------------------


def _scratch() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="fuzz-finished-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def _finished_sweep() -> tuple[Path, Any, list[blocks.Block]]:
    folder = _scratch()
    tree = tomllib.loads(SWEEP)
    del tree["vary"]["plant"], tree["vary"]["reference"]  # leaves four blocks
    (folder / "study.toml").write_text(mutate.toml(tree), encoding="utf-8")
    plan = design.read_plan(folder / "study.toml")
    work = blocks.blocks(plan)
    sweep(folder / "study.toml", folder / "out")
    return folder, plan, work


@cache
def _finished_tuning() -> tuple[Path, Any, Any]:
    folder = _scratch()
    (folder / "study.toml").write_text(TUNE, encoding="utf-8")
    tune(folder / "study.toml", folder / "out")
    (folder / "study.toml").write_text(TUNE.replace("trials = 3", "trials = 5"), encoding="utf-8")
    plan = read_tuning(folder / "study.toml")
    return folder, plan, measure([plan.base], plan.file.seeds, plan.thresholds)[0]


@cache
def _columns() -> list[tuple[str, str]]:
    with contextlib.closing(sqlite3.connect(_finished_tuning()[0] / "out" / "study.db")) as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        columns = [(table, row[1]) for table in tables for row in database.execute(f"PRAGMA table_info({table})")]
    return columns


def _edit(rng: random.Random, kind: str) -> dict[str, Any]:
    if kind == "tune-folder" and rng.random() < 0.6:
        table, column = rng.choice(_columns())
        value = rng.choice(
            ["NULL", "'x'", "''", "-1", "1e999", "'[]'", "'{}'", "'null'", "'[1'", "x'ff00'", "2", "'NaN'"]
        )
        where = rng.choice(["", " WHERE rowid = 1", " WHERE rowid % 2 = 0"])
        return {"sql": rng.choice([f"UPDATE {table} SET {column} = {value}{where}", f"DELETE FROM {table}{where}"])}
    names = ["study.json", "study.db"]
    if kind == "sweep-folder":
        names = ["study.json", "runs.sha256", *(f"runs/block-{n:06d}.parquet" for n in range(4)), "summary.html"]
    edit = rng.choice(["flip", "flip", "cut", "text", "delete", "copy", "folder", "link"])
    found = {"edit": edit, "file": rng.choice(names), "at": rng.random(), "bit": rng.randrange(8)}
    texts = ["", "null", "[]", "{", '{"parts": []}', '{"parts": {}}', '"x"', "[" * 3000, "1" * 5000, "\0", "PAR1", "é"]
    return found | {
        "text": rng.choice(texts),
        "to": rng.choice([*names, "runs/other.parquet", "runs/.hidden", "other"]),
    }


def _apply(edits: list[dict[str, Any]], folder: Path) -> None:
    for edit in edits:
        if "sql" in edit:
            with (
                contextlib.suppress(sqlite3.Error),
                contextlib.closing(sqlite3.connect(folder / "study.db")) as database,
            ):
                database.execute(edit["sql"])
                database.commit()
            continue
        path, other = folder / edit["file"], folder / edit["to"]
        if not path.is_file() or other.is_dir() or other.is_symlink() or not other.parent.is_dir():
            continue
        data = bytearray(path.read_bytes())
        place = int(edit["at"] * len(data))
        if edit["edit"] == "flip" and data:
            data[place] ^= 1 << edit["bit"]
            path.write_bytes(data)
        elif edit["edit"] == "cut":
            path.write_bytes(data[:place])
        elif edit["edit"] == "text":
            path.write_text(edit["text"], encoding="utf-8")
        elif edit["edit"] == "copy":
            other.write_bytes(data)
        elif edit["edit"] in ("delete", "folder", "link"):
            path.unlink()
            if edit["edit"] == "folder":
                path.mkdir()
            if edit["edit"] == "link":
                path.symlink_to(path.name)


def _sweep_folder(body: bytes, folder: Path) -> None:
    finished, plan, work = _finished_sweep()
    shutil.copytree(finished / "out", folder / "out")
    _apply(json.loads(body), folder / "out")
    there = BlockFiles(folder / "out", plan, work, resume=True)
    for block in work:
        if not there.finished(block):
            there.write(block, block.measure())
    there.read(work, ["point"])
    for path in [*(finished / "out" / "runs").iterdir(), finished / "out" / "runs.sha256"]:
        assert (folder / "out" / path.relative_to(finished / "out")).read_bytes() == path.read_bytes()


def _tune_folder(body: bytes, folder: Path) -> None:
    finished, plan, base = _finished_tuning()
    shutil.copytree(finished / "out", folder / "out")
    _apply(json.loads(body), folder / "out")
    if _often(body):
        tune(finished / "study.toml", folder / "out", resume=True)
        return
    with opened(plan, f"sqlite:///{folder / 'out' / 'study.db'}", base, resume=True) as search:
        search.run(lambda runs: None)
        trials = search.finished()
    if members := front(trials):
        plan.base.replace(copy.deepcopy(choose(members, search.base).values))


def limit() -> None:
    """A larger study takes longer without other paths."""
    design.MAX_POINTS = 500
    blocks.RUNS_PER_BLOCK = 2


if __name__ == "__main__":
    harness.main(harness.Face(make, check, limit))
