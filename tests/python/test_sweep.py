"""Studies from the user's view: run, killed, resumed, on a cluster, read by other tools, summarized."""

from __future__ import annotations

import hashlib
import http.server
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread

import duckdb
import fracgyro as fg
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from children import PATIENCE, run_until
from command_server import fracgyro
from figure_data import figure_data
from fracgyro import _core
from fracgyro.analysis.metric_names import METRICS
from fracgyro.scenario import ScenarioError
from fracgyro.study import sweep
from fracgyro.study.sweep import blocks, effects
from fracgyro.study.sweep.block_files import BlockFiles
from fracgyro.study.sweep.design import read_plan

SWEEP = "fracgyro.study.sweep.run", "sweep"
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "studies"
SMALL = """
title = "Small"
seeds = 2
[fixed]
run.duration = 12.0
[vary]
controller.order = { low = 0.5, high = 1.0, steps = 2 }
controller.kind = ["linear", "fractional"]
"""
# Six blocks of 20 runs, 16 million steps.
LONG = """
seeds = 20
[fixed]
run.duration = 800.0
[vary]
controller.terminal_exponent = { low = 0.3, high = 0.8, steps = 6 }
"""


def study(folder: Path, text: str = SMALL) -> Path:
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


def command(*words: str | Path) -> list[str]:
    return [sys.executable, "-m", "fracgyro", "sweep", *map(str, words)]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / "runs").iterdir())}


# -- Rows ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    shown: list[tuple[int, int]] = []
    result = sweep(study(folder), folder / "out", progress=lambda done, total: shown.append((done, total)))
    assert (result.runs, result.resumed, result.diverged) == (8, 0, 0)
    assert shown[0] == (0, 8)
    assert shown[-1] == (8, 8)
    return folder


def test_a_row_is_what_simulating_its_scenario_gives(small: Path) -> None:
    rows = pq.read_table(small / "out" / "runs").to_pylist()
    assert [(r["point"], r["seed"]) for r in rows] == [(p, s) for p in range(4) for s in range(2)]
    row = rows[5]  # the second seed of the third point
    assert (row["controller.order"], row["controller.kind"]) == (1.0, "linear")
    changes = {"controller.order": 1.0, "controller.kind": "linear", "run.duration": 12.0, "disturbance.seed": 1}
    scenario = fg.Scenario.paper().replace(changes)
    metrics = fg.measure_many([scenario]).isel(run=0)
    assert row["rmse_steady_y"] == float(metrics["rmse"].sel(window="steady", axis="y"))
    assert row["bound_final_2"] == float(metrics["bound_final"].sel(bound=2))
    assert row["error_settling_time"] == float(metrics["error_settling_time"])
    assert row["diverged_at"] is None


def test_the_columns_are_the_keys_and_every_metric(small: Path) -> None:
    keys = ["point", "seed", "controller.order", "controller.kind"]
    names = pq.read_table(small / "out" / "runs").column_names
    assert names[:4] == keys
    assert set(names[4:]) == {*METRICS, "diverged_at"}


def test_duckdb_and_pandas_read_the_rows(small: Path) -> None:
    runs = small / "out" / "runs"
    expected = pq.read_table(runs)["rmse_whole_x"].to_pylist()
    with duckdb.connect() as connection:
        query = f"SELECT rmse_whole_x, rate_settling_time FROM '{runs}/*.parquet' ORDER BY point, seed"
        by_duckdb = connection.execute(query).fetchall()
    by_pandas = pd.read_parquet(runs)
    assert [row[0] for row in by_duckdb] == expected
    assert by_pandas["rmse_whole_x"].tolist() == expected
    never = [value is None for value in pq.read_table(runs)["rate_settling_time"].to_pylist()]
    assert any(never)
    assert [row[1] is None for row in by_duckdb] == never
    assert by_pandas["rate_settling_time"].isna().tolist() == never


@pytest.mark.skipif(max(_core.lane_counts()) < 4, reason="polars is compiled for processors with AVX2")
def test_polars_reads_the_rows(small: Path) -> None:
    import polars

    runs = small / "out" / "runs"
    rows, expected = polars.read_parquet(f"{runs}/*.parquet"), pq.read_table(runs)
    for name in ("rmse_whole_x", "rate_settling_time"):
        assert rows[name].to_list() == expected[name].to_pylist()


def test_lists_integers_and_booleans_keep_their_types(tmp_path: Path) -> None:
    text = """
[fixed]
run.duration = 0.1
[vary]
reference.amplitude = [[1.0, 1.0], [2.0, 0.5]]
run.record_every = { low = 1, high = 3, steps = 2 }
controller.adaptive = [true, false]
"""
    sweep(study(tmp_path, text), tmp_path / "out")
    table = pq.read_table(tmp_path / "out" / "runs")
    assert [str(kind) for kind in table.schema.types[2:5]] == ["list<element: double>", "int64", "bool"]
    assert table["reference.amplitude"].to_pylist()[-1] == [2.0, 0.5]


def test_runs_of_different_lengths_and_steps_stand_side_by_side(tmp_path: Path) -> None:
    text = "[vary]\nrun.duration = [1.0, 2.0]\nrun.step = [0.001, 0.01]\n[fixed]\ndisturbance.hold = 0.01\n"
    sweep(study(tmp_path, text), tmp_path / "out")
    rows = pq.read_table(tmp_path / "out" / "runs")
    assert rows["run.duration"].to_pylist() == [1.0, 1.0, 2.0, 2.0]
    assert len(set(rows["effort_x"].to_pylist())) == 4


# -- Killed, resumed -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The long study, uninterrupted."""
    folder = tmp_path_factory.mktemp("long")
    plan = read_plan(study(folder, LONG))
    assert len(blocks.blocks(plan)) == 6
    sweep(folder / "study.toml", folder / "out")
    return folder


def test_a_killed_study_resumes_to_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    runs = tmp_path / "out" / "runs"
    killed = run_until("done > 50", signal.SIGKILL, *SWEEP, "sweep", whole / "study.toml", "--out", tmp_path / "out")
    assert killed.returncode == -signal.SIGKILL
    kept = {path.name: path.stat().st_mtime_ns for path in runs.glob("block-*")}
    assert len(kept) == 2, "killed in the third block of 20 runs"
    assert not (tmp_path / "out" / "summary.html").exists()
    (runs / f".{'0' * 32}.parquet").write_bytes(b"half")  # left by a kill while a block was written

    again = subprocess.run(
        command(whole / "study.toml", "--out", tmp_path / "out", "--resume", "--json"), capture_output=True, text=True
    )
    assert again.returncode == 0, again.stderr
    shown = json.loads(again.stdout)
    assert shown["runs"] == 120
    assert shown["resumed"] == 40
    assert {name: (runs / name).stat().st_mtime_ns for name in kept} == kept, "finished blocks are not run again"
    assert contents(tmp_path / "out") == contents(whole / "out")


def test_a_damaged_block_is_run_again_and_no_other(whole: Path, tmp_path: Path) -> None:
    good = contents(whole / "out")
    first, second, third, fourth, *others = sorted(good)
    middle = len(good[second]) // 2
    damaged = {
        first: good[first][:-100],  # cut off
        second: good[second][:middle] + b"\0\0\0\0" + good[second][middle + 4 :],  # a few bytes lost
        third: good[fourth],  # another's rows
        fourth: b"",
    }
    sweep(whole / "study.toml", whole / "out", resume=True)
    for name, data in damaged.items():
        (whole / "out" / "runs" / name).write_bytes(data)
    times = {name: (whole / "out" / "runs" / name).stat().st_mtime_ns for name in others}
    result = sweep(whole / "study.toml", whole / "out", resume=True)
    assert result.runs - result.resumed == sum(len(pq.read_table(pa.BufferReader(good[name]))) for name in damaged)
    assert contents(whole / "out") == good
    assert {name: (whole / "out" / "runs" / name).stat().st_mtime_ns for name in others} == times


def test_any_change_of_a_block_is_noticed(small: Path, tmp_path: Path) -> None:
    plan = read_plan(small / "study.toml")
    work = blocks.blocks(plan)
    shutil.copytree(small / "out", tmp_path / "out")
    (path,) = (tmp_path / "out" / "runs").iterdir()
    data, folder = path.read_bytes(), BlockFiles(tmp_path / "out", plan, work, resume=True)
    assert folder.finished(work[0])
    for bit in range(0, 8 * len(data), 37):  # the footer too, which has no checksum of its own
        changed = bytearray(data)
        changed[bit // 8] ^= 1 << bit % 8
        path.write_bytes(changed)
        assert not folder.finished(work[0]), bit
    path.write_bytes(data)
    assert folder.finished(work[0])


def test_every_block_has_the_aggregates_of_its_rows(whole: Path) -> None:
    paths = sorted((whole / "out" / "runs").iterdir())
    assert len(paths) > 1
    for path in paths:
        found = json.loads(pq.read_schema(path).metadata[b"fracgyro.aggregates"])
        rows = pd.read_parquet(path)
        kept = rows[rows["diverged_at"].isna()]
        assert (found["rows"], found["diverged"]) == (len(rows), len(rows) - len(kept))
        assert set(found["metrics"]) == set(METRICS)
        for name, (count, *spread) in found["metrics"].items():
            values = kept[name].dropna()
            assert count == len(values)
            expected = [values.mean(), values.var(ddof=0) * count, values.min(), values.max()] if count else []
            np.testing.assert_allclose(spread, expected, rtol=1e-9, atol=1e-300)


def test_rows_with_other_columns_are_not_the_study_even_with_its_label(small: Path, tmp_path: Path) -> None:
    plan = read_plan(small / "study.toml")
    work = blocks.blocks(plan)
    folder = BlockFiles(tmp_path / "out", plan, work, resume=False)
    rows = pq.read_table(small / "out" / "runs")
    renamed = [name.replace("largest_force", "largesu_force") for name in rows.column_names]
    texts = rows.set_column(rows.num_columns - 1, rows.column_names[-1], pa.array(["x"] * rows.num_rows))
    for wrong in (rows.rename_columns(renamed), rows.drop_columns(["point"]), rows.slice(1), texts):
        folder.write(work[0], wrong)
        assert not folder.finished(work[0])
    folder.write(work[0], rows)
    assert folder.finished(work[0])


def test_the_hashes_are_those_of_sha256sum_and_losing_them_costs_time_only(whole: Path) -> None:
    good, sums = contents(whole / "out"), whole / "out" / "runs.sha256"
    text = sums.read_text(encoding="ascii")
    lines = [f"{hashlib.sha256(data).hexdigest()}  runs/{name}\n" for name, data in good.items()]
    assert text == "".join(lines)
    sums.write_text(
        text[: len(lines[0]) + 70] + "".join(lines[3:]), encoding="ascii"
    )  # one cut off and run into another, one lost
    result = sweep(whole / "study.toml", whole / "out", resume=True)
    assert result.runs - result.resumed == 60
    assert contents(whole / "out") == good
    assert sums.read_text(encoding="ascii") == text


def test_a_file_of_anybody_elses_among_the_blocks_is_named(small: Path, tmp_path: Path) -> None:
    shutil.copytree(small / "out", tmp_path / "out")
    runs = tmp_path / "out" / "runs"
    (runs / "block-000099.parquet").write_bytes((runs / "block-000000.parquet").read_bytes())
    with pytest.raises(ScenarioError, match=r"runs has block-000099\.parquet, which is not part of the study"):
        sweep(small / "study.toml", tmp_path / "out", resume=True)


@pytest.mark.parametrize(
    "text", ['{"parts": []}', "null", '"abc"', "[" * 100000, '{"parts": null}', "\udcff", "1" * 5000]
)
def test_a_damaged_manifest_is_one_sentence(small: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "study.json").write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ScenarioError, match=r"study\.json is damaged: start the study again in another folder$"):
        sweep(small / "study.toml", tmp_path / "out", resume=True)


def test_a_study_that_cannot_run_leaves_no_folder(tmp_path: Path) -> None:
    for entry in ("run.record_every = [9223372036854775808]", "rate.levels = [9223372036854775808]"):
        with pytest.raises(ScenarioError, match="integer of more than 64 bits"):
            sweep(study(tmp_path, f"[vary]\n{entry}\n"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_finished_study_says_so_and_runs_nothing(small: Path) -> None:
    again = fracgyro("sweep", small / "study.toml", "--out", small / "out", "--resume")
    assert again.returncode == 0
    assert "already finished: no runs left" in again.stdout


def test_resuming_nothing_starts(tmp_path: Path) -> None:
    assert sweep(study(tmp_path), tmp_path / "out", resume=True).resumed == 0


@pytest.mark.parametrize(
    ("before", "after", "differs"),
    [
        ("seeds = 2", "seeds = 3", "seeds"),
        ("duration = 12.0", "duration = 13.0", "scenario or fixed"),
        ("low = 0.5", "low = 0.6", "vary or design"),
        ("[fixed]", "[metrics]\ntransient = 5.0\n[fixed]", "metrics"),
    ],
)
def test_a_changed_study_does_not_resume(small: Path, tmp_path: Path, before: str, after: str, differs: str) -> None:
    assert before in SMALL
    was = contents(small / "out")
    with pytest.raises(ScenarioError, match=f"has another study, which differs in .*{differs}"):
        sweep(study(tmp_path, SMALL.replace(before, after)), small / "out", resume=True)
    assert contents(small / "out") == was


def test_a_study_that_only_reads_differently_resumes(small: Path, tmp_path: Path) -> None:
    same = SMALL.replace("[fixed]\nrun.duration = 12.0", '[fixed]\n"run.duration" = 12  # quoted\n')
    same = same.replace('title = "Small"', 'title = "Renamed"\nshow = ["effort_x"]')
    assert sweep(study(tmp_path, same), small / "out", resume=True).resumed == 8
    assert "<h1>Renamed</h1>" in (small / "out" / "summary.html").read_text(encoding="utf-8")
    sweep(small / "study.toml", small / "out", resume=True)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["study.toml"], "--out is missing: it must name a folder, unless --dry-run is given"),
        (["nowhere.toml", "--out", "new"], "nowhere.toml cannot be read: No such file or directory"),
        (["study.toml", "--out", "study.toml"], "study.toml cannot be"),
        (["study.toml", "--out", "full"], "full is not empty and has no study: --out must be an empty or new"),
        (["study.toml", "--out", "full", "--resume"], "full is not empty and has no study"),
        (["study.toml", "--out", "done"], "done already has a study: finish it with --resume, or name another"),
        (["study.toml", "--out", "broken", "--resume"], "study.json is damaged"),
        (["study.toml", "--out", "new", "--scheduler", "nonsense://x"], 'scheduler is "nonsense://x": it cannot be'),
        (["study.toml", "--out", "new", "--scheduler", "garbage"], 'scheduler is "garbage": it cannot be reached'),
        (["study.toml", "--out", "new", "--scheduler", ""], 'scheduler is "": it cannot be reached'),
    ],
)
def test_bad_use_ends_with_one_sentence(tmp_path: Path, words: list[str], expected: str) -> None:
    study(tmp_path)
    for folder, name in (("full", "precious.txt"), ("done", "study.json"), ("broken", "study.json")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).write_text("{", encoding="utf-8")
    result = fracgyro("sweep", *words, cwd=tmp_path)
    assert result.returncode == 2, result
    assert result.stdout == ""
    assert expected in result.stderr
    (line,) = result.stderr.splitlines()
    assert line.startswith("fracgyro: ")
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["precious.txt"]


def test_an_interrupt_leaves_whole_blocks_to_resume(whole: Path, tmp_path: Path) -> None:
    ran = run_until("done > 30", signal.SIGINT, *SWEEP, "sweep", whole / "study.toml", "--out", tmp_path / "out")
    assert ran.returncode == 130, ran.stderr
    assert "Traceback" not in ran.stderr
    expected = contents(whole / "out")
    found = contents(tmp_path / "out")
    assert len(found) == 1
    assert all(expected[name] == data for name, data in found.items())


# -- On a cluster --------------------------------------------------------------------------------------------


def linger(inside: str) -> None:
    """In a worker: its next block begins, reports this, and never ends."""

    def measure(*_: object) -> None:
        Path(inside).touch()
        time.sleep(PATIENCE)

    blocks.Block.measure = measure  # type: ignore[method-assign, assignment]


def test_what_listens_but_is_no_scheduler_is_told_in_one_sentence(tmp_path: Path) -> None:
    """A web server answers anything with a page; another server never answers."""

    class Pages(http.server.BaseHTTPRequestHandler):
        def handle_one_request(self) -> None:
            self.wfile.write(b"HTTP/1.0 400 Bad request\r\n\r\n")
            self.close_connection = True

    with http.server.HTTPServer(("127.0.0.1", 0), Pages) as server, socket.create_server(("127.0.0.1", 0)) as silent:
        Thread(target=server.serve_forever, daemon=True).start()
        for port in (server.server_port, silent.getsockname()[1]):
            address = f"tcp://127.0.0.1:{port}"
            words = command(study(tmp_path), "--out", tmp_path / "out", "--scheduler", address)
            result = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
            assert result.returncode == 2
            assert result.stderr.startswith(f'fracgyro: scheduler is "{address}": it cannot be reached: ')
            assert len(result.stderr.splitlines()) == 1
        server.shutdown()
    assert not (tmp_path / "out").exists()


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::DeprecationWarning:distributed", "ignore::ResourceWarning")
def test_a_worker_killed_inside_a_block_costs_nothing(whole: Path, tmp_path: Path) -> None:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        pids = client.run(os.getpid)
        victim = min(pids)
        client.run(linger, str(tmp_path / "inside"), workers=[victim])
        results = []
        running = Thread(
            target=lambda: results.append(
                sweep(whole / "study.toml", tmp_path / "out", scheduler=cluster.scheduler_address)
            )
        )
        running.start()
        while running.is_alive() and not (tmp_path / "inside").exists():
            time.sleep(0.01)
        os.kill(pids[victim], signal.SIGKILL)
        running.join(timeout=PATIENCE)
        client.wait_for_workers(2, timeout=PATIENCE)
        assert pids[victim] not in client.run(os.getpid).values(), "the nanny started another"
    assert [result.runs for result in results] == [120]
    assert contents(tmp_path / "out") == contents(whole / "out")


# -- The summary ---------------------------------------------------------------------------------------------


def test_the_summary_needs_nothing_but_itself(small: Path) -> None:
    page = (small / "out" / "summary.html").read_text(encoding="utf-8")
    assert page.index("<figure") < page.index("<table")
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(source.startswith(("data:image/svg+xml;base64,", "data:text/csv", "#")) for source in sources)
    assert all(f'id="{source[1:]}"' in page for source in sources if source.startswith("#"))
    assert "{{" not in page
    assert "{%" not in page
    assert "8 runs: 4 points" in page
    assert "No run diverged." in page


def test_the_numbers_behind_a_figure_are_means_of_the_rows(small: Path) -> None:
    data = figure_data(small / "out" / "summary.html")["rmse_steady_x"]
    runs = pd.read_parquet(small / "out" / "runs")
    mean, value = "mean of RMS error, steady, x (q0)", "value (of a bin: its center)"
    found = {(row["field"], row[value], row["its value"]): float(row[mean]) for row in data}
    assert len(found) == len(data) == 8, "two levels of each of two fields, and their four pairs"
    for (field, of, other), number in found.items():
        chosen = runs[runs[field].astype(str) == {"1": "1.0"}.get(of, of)]
        chosen = chosen if not other else chosen[chosen["controller.kind"] == other]
        assert number == pytest.approx(chosen["rmse_steady_x"].mean(), rel=1e-8)


def test_the_numbers_of_a_sample_have_medians_and_correlations(tmp_path: Path) -> None:
    text = """
show = ["effort_x", "rate_settling_time"]
[design]
kind = "random"
points = 8
[fixed]
run.duration = 1.0
[vary]
controller.order = { low = 0.5, high = 0.9 }
adaptation.rate_gain = { low = 1.0, high = 100.0, scale = "log" }
"""
    sweep(study(tmp_path, text), tmp_path / "out")
    data, runs = figure_data(tmp_path / "out" / "summary.html"), pd.read_parquet(tmp_path / "out" / "runs")
    assert list(data) == ["rank_correlation", "effort_x"], "no run has the other metric"
    effort, other = data["rank_correlation"]
    ranks = runs["controller.order"].corr(runs["effort_x"], method="spearman")
    assert float(effort["rank correlation with controller.order"]) == pytest.approx(ranks)
    assert other["rank correlation with controller.order"] == ""
    lower = runs[runs["controller.order"] < 0.7]["effort_x"]
    row = data["effort_x"][0]
    assert (row["field"], float(row["value (of a bin: its center)"])) == ("controller.order", pytest.approx(0.6))
    assert float(row["mean of RMS force, x (m ω0² q0)"]) == pytest.approx(lower.mean(), rel=1e-8)
    assert float(row["95 % quantile"]) == pytest.approx(lower.max(), rel=1e-8)
    pair = next(row for row in data["effort_x"] if row["second field"])
    gain = "adaptation.rate_gain"
    inside = runs[(runs["controller.order"] < 0.7) & (runs[gain] < 10.0)]["effort_x"]
    assert pair["second field"] == gain
    assert float(pair["its value"]) == pytest.approx(10**0.5)
    assert float(pair["50 % quantile"] or "nan") == pytest.approx(inside.median(), rel=1e-8, nan_ok=True)


def test_the_summary_says_what_it_leaves_out(tmp_path: Path) -> None:
    text = """
seeds = 2
show = ["rmse_steady_x", "rate_settling_time"]
[fixed]
run.duration = 12.0
disturbance.hold = 0.008
[vary]
run.step = [0.001, 0.008]
"""
    assert sweep(study(tmp_path, text), tmp_path / "out").diverged == 2
    page = (tmp_path / "out" / "summary.html").read_text(encoding="utf-8")
    assert "2 of 4 runs diverged" in page
    assert "Settling time of the rate:</b> 2 of the 2 runs that did not diverge have none" in page
    assert re.search(r"run.step</code></td><td>0.008</td><td class=\"number\">2</td><td class=\"number\">2<", page)
    assert "No run has a value." in page


def test_what_no_controller_of_the_study_reports_is_said_to_be_missing(tmp_path: Path) -> None:
    reasons = {"pid": "as the controller does not report this quantity", "linear": "as they had not settled"}
    for kind, why in reasons.items():
        text = f"""
show = ["rate_settling_time", "effort_x"]
[fixed]
run.duration = 2.0
controller.kind = "{kind}"
[vary]
plant.angular_rate = [10.0, 20.0]
"""
        folder = tmp_path / kind
        folder.mkdir()
        sweep(study(folder, text), folder / "out")
        page = (folder / "out" / "summary.html").read_text(encoding="utf-8")
        assert f"have none, {why}" in page
        assert page.count("have none") == 1


def rows_of(tmp_path: Path, text: str, metric: list[float | None], diverged: list[float | None]) -> effects.Rows:
    """The rows of a study with these made-up values of effort_x."""
    plan = read_plan(study(tmp_path, text))
    keys = pa.concat_tables([block.keys() for block in blocks.blocks(plan)])
    for name, column in (("effort_x", metric), ("diverged_at", diverged)):
        keys = keys.append_column(name, pa.array(column, pa.float64()))
    return effects.Rows.of(plan, keys)


def test_an_effect_is_a_mean_over_seeds_with_its_interval(tmp_path: Path) -> None:
    text = 'seeds = 2\n[vary]\ncontroller.order = [0.2, 0.4]\ncontroller.kind = ["linear", "fractional"]\n'
    none: list[float | None] = [None] * 8
    rows = rows_of(tmp_path, text, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 100.0], [*none[:7], 0.5])
    low, high = effects.effect(rows, "effort_x", rows.plan.dimensions[0]).means
    assert low is not None
    assert low.mean == 2.5  # spread of 2 and 3, the means of the seeds
    assert low.high - low.mean == pytest.approx(12.706 * 0.5, rel=1e-3)
    assert high is not None
    assert high.mean == pytest.approx((6.0 + 6.0) / 2)  # the run that diverged is left out
    assert effects.effect(rows, "effort_x", rows.plan.dimensions[0]).partial == [False, True]
    found, eligible = effects.best(rows, "effort_x", ["effort_x"], 9)
    assert [b.point for b in found] == [0, 1, 2], "not the point one of whose runs diverged"
    assert eligible == 3
    table = effects.cells(rows, "effort_x", *rows.plan.dimensions)
    assert table.values.tolist() == [[1.5, 5.5], [3.5, 7.0]]
    assert table.partial.tolist() == [[False, False], [False, True]]


def test_quantiles_count_never_as_longest(tmp_path: Path) -> None:
    text = '[design]\nkind = "random"\npoints = 20\n[vary]\ncontroller.order = { low = 0.2, high = 0.4 }\n'
    values: list[float | None] = [float(i) for i in range(1, 20)]
    rows = rows_of(tmp_path, text, [*values, None], [None] * 20)
    assert effects.quantiles(rows, "effort_x").tolist() == [1.0, 5.0, 10.0, 15.0, 19.0]
    rows = rows_of(tmp_path, text, [*values[:18], None, None], [None] * 20)
    assert effects.quantiles(rows, "effort_x")[-1] == np.inf


def test_a_monotonic_effect_has_rank_correlation_one(tmp_path: Path) -> None:
    text = '[design]\nkind = "random"\npoints = 9\n[vary]\ncontroller.order = { low = 0.2, high = 0.4 }\n'
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    order = [float(np.exp(point[0])) for point in read_plan(tmp_path / "study.toml").points]
    rows = rows_of(tmp_path, text, list(order), [None] * 9)
    assert effects.rank_correlation(rows, "effort_x", rows.plan.dimensions[0]) == pytest.approx(1.0)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_example_runs(path: Path, tmp_path: Path) -> None:
    result = fracgyro("sweep", path, "--out", tmp_path / "out", "--json")
    assert result.returncode == 0, result.stderr
    shown = json.loads(result.stdout)
    assert shown["runs"] == pq.read_table(tmp_path / "out" / "runs").num_rows
    assert shown["diverged"] == 0
    assert Path(shown["summary"]).read_text(encoding="utf-8").count("data:image/svg+xml") >= 4
