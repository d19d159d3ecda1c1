"""`fracgyro tune`: its search, its statements about the result, and the shipped scenario."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tomllib
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
import sqlalchemy
from children import run_until
from command_server import fracgyro
from figure_data import column, figure_data
from fracgyro.analysis.metric_names import METRICS
from fracgyro.study import tune
from fracgyro.study.tune.criteria import Constraint, Measured, Objective, Score, measure, score
from fracgyro.study.tune.hold_out import _gap
from fracgyro.study.tune.plan import read_tuning
from fracgyro.study.tune.search import Trial, choose, front
from nightly import nightly_unless

ROOT = Path(__file__).resolve().parents[2]
TUNE = "fracgyro.study.tune.run", "tune"
WITHIN_A_BATCH = "done > 3 + 5 * 3"  # after the base, only in the first batch, and one of 4: each trial has 3 runs

HEAD = """
seeds = 3
[fixed]
run.duration = 2.0
[metrics]
transient = 1.0
[vary]
controller.order = { low = 0.5, high = 1.0 }
controller.layer_thickness = { low = 0.02, high = 0.3, scale = "log" }
"""
TWO = """
[[objective]]
metric = "rmse_steady_x"
[[objective]]
metric = "rate_error_rms"
statistic = "quantile 0.9"
[[constraint]]
metric = "effort_x"
at_most_base = 1.01
"""
ONE = """
[[objective]]
metric = "rmse_steady_x"
[[constraint]]
metric = "chattering_x"
at_most_base = 1.5
"""


def study(folder: Path, *, tail: str = TWO, head: str = HEAD, **options: object) -> Path:
    options = {"trials": 10, "held_out_seeds": 6, **options}
    text = "\n".join(f"{name} = {json.dumps(value)}" for name, value in options.items())
    path = folder / "study.toml"
    path.write_text(f"{head}\n[tune]\n{text}\n{tail}", encoding="utf-8")
    return path


def rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def trials(out: Path) -> str:
    return (out / "trials.csv").read_text(encoding="utf-8")


def command(*words: str | Path) -> list[str]:
    return [sys.executable, "-m", "fracgyro", "tune", *map(str, words)]


def sentence(*words: str | Path) -> str:
    ran = fracgyro("tune", *words)
    assert ran.returncode == 2, ran
    (line,) = ran.stderr.splitlines()
    return line.removeprefix("fracgyro: ")


# -- A whole tuning ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tune")
    done: list[float] = []
    result = tune(study(folder), folder / "out", progress=lambda now, total, _: done.append(now / total))
    assert done == sorted(done), "progress goes forward"
    assert done[-1] == pytest.approx(1.0)
    assert result.trials == 10
    return folder / "out"


def test_every_file_is_there_and_nothing_else(out: Path) -> None:
    names = {
        "study.json",
        "study.db",
        "trials.csv",
        "pareto.csv",
        "pareto.svg",
        "pareto.png",
        "tune.html",
        "tuned.toml",
    }
    assert {path.name for path in out.iterdir()} == names


def test_the_first_trial_is_the_base_scenario(out: Path) -> None:
    first = rows(out / "trials.csv")[0]
    assert first["controller.order"] == "0.9"
    assert float(first["mean of rmse_steady_x over base"]) == 1.0
    assert first["feasible"] == "true"


def test_the_tuned_scenario_is_the_base_with_the_chosen_values(out: Path) -> None:
    text = (out / "tuned.toml").read_text(encoding="utf-8")
    chosen = re.search(r"trial (\d+) of 10", text)
    assert chosen
    row = rows(out / "trials.csv")[int(chosen[1])]
    values = {name: float(row[name]) for name in ("controller.order", "controller.layer_thickness")}
    assert fg.Scenario.load(out / "tuned.toml") == fg.Scenario.paper().replace({"run.duration": 2.0, **values})


def test_half_a_tuned_scenario_is_refused(out: Path, tmp_path: Path) -> None:
    text = (out / "tuned.toml").read_text(encoding="utf-8")
    (tmp_path / "half.toml").write_text(text[: len(text) // 2], encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match="cut off"):
        fg.Scenario.load(tmp_path / "half.toml")


def test_a_trial_says_what_its_scenario_measures(out: Path) -> None:
    row = rows(out / "trials.csv")[4]
    values = {name: float(row[name]) for name in ("controller.order", "controller.layer_thickness")}
    scenario = fg.Scenario.paper().replace({"run.duration": 2.0, **values})
    runs = fg.measure_many([scenario], seeds=[0, 1, 2], transient=1.0)
    assert float(row["mean of rmse_steady_x"]) == float(runs["rmse"].sel(window="steady", axis="x").mean())
    assert float(row["quantile 0.9 of rate_error_rms"]) == float(np.quantile(runs["rate_error_rms"], 0.9))


def test_no_feasible_trial_beats_a_member_of_the_front(out: Path) -> None:
    names = ["mean of rmse_steady_x", "quantile 0.9 of rate_error_rms"]
    feasible = [r for r in rows(out / "trials.csv") if r["feasible"] == "true"]
    points = np.array([[float(r[name]) for name in names] for r in feasible])
    for member in rows(out / "pareto.csv"):
        point = np.array([float(member[name]) for name in names])
        assert not ((points <= point).all(axis=1) & (points < point).any(axis=1)).any()


def test_the_report_needs_nothing_but_itself_and_says_the_hold_out(out: Path) -> None:
    page = (out / "tune.html").read_text(encoding="utf-8")
    assert page.index("<figure") < page.index("<table")
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert [s for s in sources if not s.startswith(("data:", "#"))] == []
    assert all(f'id="{s[1:]}"' in page for s in sources if s.startswith("#"))
    assert "{{" not in page
    assert "{%" not in page
    assert re.search(r"confirmed</td>|refuted</td>|undecided</td>", page)
    assert all(f"<code>{metric}</code>" in page for metric in METRICS)


def test_the_numbers_behind_the_figures_are_those_of_the_trials(out: Path) -> None:
    data = figure_data(out / "tune.html")["objectives"]
    found, front = rows(out / "trials.csv"), {row["trial"] for row in rows(out / "pareto.csv")}
    assert [row["trial"] for row in data] == [row["trial"] for row in found]
    assert {row["trial"] for row in data if row["on the front"] == "true"} == front
    assert [row["feasible"] for row in data] == [row["feasible"] for row in found]
    (chosen,) = (row["trial"] for row in data if row["chosen"] == "true")
    assert f"trial {chosen} of 10" in (out / "tuned.toml").read_text(encoding="utf-8")
    ratios = []
    for name in ("mean of rmse_steady_x over base", "quantile 0.9 of rate_error_rms over base"):
        ratios.append([float(row[name]) for row in found])
        assert column(data, name) == pytest.approx(ratios[-1], rel=1e-8)
    assert column(data, "geometric mean") == pytest.approx(np.sqrt(np.prod(ratios, axis=0)), rel=1e-8)


@pytest.mark.parametrize(
    ("sampler", "tail"),
    nightly_unless(lambda sampler, _: sampler != "nsga2", [("tpe", TWO), ("nsga2", TWO), ("cmaes", ONE)]),
)
def test_the_same_study_finds_the_same_trials_killed_anywhere_or_not(tmp_path: Path, sampler: str, tail: str) -> None:
    path = study(tmp_path, tail=tail, sampler=sampler, trials=14, batch=4)
    tune(path, tmp_path / "whole")
    seen: list[float] = []

    def dies(done: float, _: float, doing: str) -> None:
        seen.append(done)
        if doing == "searching" and len(seen) in (7, 8, 9):  # in the middle of a batch
            raise RuntimeError("killed")

    for _ in range(3):
        with pytest.raises(RuntimeError, match="killed"):
            tune(path, tmp_path / "killed", resume=bool(seen), progress=dies)
    tune(path, tmp_path / "killed", resume=True, progress=dies)
    assert trials(tmp_path / "killed") == trials(tmp_path / "whole")


def test_a_study_killed_with_signal_9_is_finished_by_resume(tmp_path: Path) -> None:
    path, folder = study(tmp_path, trials=16, batch=4), tmp_path / "out"
    killed = run_until(WITHIN_A_BATCH, signal.SIGKILL, *TUNE, "tune", path, "--out", folder)
    assert killed.returncode == -signal.SIGKILL
    assert finished(folder / "study.db") == 5
    assert not (folder / "tuned.toml").exists()
    ran = subprocess.run(command(path, "--out", folder, "--resume", "--json"), capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    said = json.loads(ran.stdout)
    assert said["trials"] == 16
    whole = tune(path, tmp_path / "whole")
    assert [o["verdict"] for o in said["held_out"]["objectives"]] == [o.verdict for o in whole.held_out.objectives]
    assert trials(folder) == trials(tmp_path / "whole")


def finished(database: Path) -> int:
    if not database.is_file():
        return 0
    reader = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
    try:
        count = reader.execute("SELECT COUNT(*) FROM trials WHERE state = 'COMPLETE'").fetchone()
        return int(count[0])
    except sqlite3.OperationalError:  # not made yet, or being written
        return 0
    finally:
        reader.close()


def test_a_finished_study_can_be_given_more_trials(tmp_path: Path) -> None:
    tune(study(tmp_path, trials=4), tmp_path / "out")
    before = trials(tmp_path / "out")
    assert tune(study(tmp_path, trials=6), tmp_path / "out", resume=True).trials == 6
    assert trials(tmp_path / "out").startswith(before)


def test_an_interrupt_is_one_sentence_and_loses_no_finished_trial(tmp_path: Path) -> None:
    path, folder = study(tmp_path, batch=4), tmp_path / "out"
    ran = run_until(WITHIN_A_BATCH, signal.SIGINT, *TUNE, "tune", path, "--out", folder)
    assert ran.returncode == 130, ran.stderr
    assert ran.stdout == ""
    assert "Traceback" not in ran.stderr
    assert ran.stderr.endswith("fracgyro: interrupted; the files written so far are complete\n")
    assert finished(folder / "study.db") == 5


# -- Constraints, divergence, the choice ---------------------------------------------------------------------


def test_a_constraint_that_nothing_keeps_is_named_with_how_far_off_the_nearest_is(tmp_path: Path) -> None:
    path = study(
        tmp_path, tail='[[objective]]\nmetric = "rmse_steady_x"\n[[constraint]]\nmetric = "effort_x"\nat_most = 1.0'
    )
    with pytest.raises(fg.ScenarioError, match=r"no feasible trial among 10; .* misses: mean of effort_x by \d"):
        tune(path, tmp_path / "out")
    assert not (tmp_path / "out" / "tuned.toml").exists()


@pytest.mark.parametrize("sampler", ["tpe", "nsga2", "cmaes"])
def test_scenarios_that_diverge_or_are_none_are_infeasible_trials(tmp_path: Path, sampler: str) -> None:
    head = HEAD.replace("[vary]", '[vary]\nrun.step = { low = 1e-3, high = 2e-2, scale = "log" }').replace(
        "run.duration = 2.0", "run.duration = 2.0\ndisturbance.hold = 1.0"
    )
    tune(study(tmp_path, head=head, tail=ONE, sampler=sampler, batch=4), tmp_path / "out")
    found = rows(tmp_path / "out" / "trials.csv")
    lost = [row for row in found if float(row["diverged"]) > 0]
    assert lost
    assert {row["feasible"] for row in lost} == {"false"}
    assert found[0]["feasible"] == "true"


def test_a_single_objective_has_no_front(tmp_path: Path) -> None:
    result = tune(study(tmp_path, tail=ONE, sampler="cmaes", batch=4), tmp_path / "out")
    found = [r for r in rows(tmp_path / "out" / "trials.csv") if r["feasible"] == "true"]
    least = min(found, key=lambda r: float(r["mean of rmse_steady_x"]))
    assert result.trial == int(least["trial"])
    assert not list((tmp_path / "out").glob("pareto*"))


def test_what_never_comes_about_is_infinite() -> None:
    values = np.array([1.0, -2.0, 3.0, np.nan])
    assert Objective(metric="rate_error").of(values[:3]) == 2.0
    assert Objective(metric="rate_error").of(values) == math.inf
    assert Objective(metric="rate_error", statistic="median").of(values) == 2.5
    assert Objective(metric="rate_error", statistic="max").of(values[:3]) == 3.0
    assert Objective(metric="rate_error", statistic="quantile 0.25").of(values[:3]) == 1.5
    # Between two that are infinite.
    assert Objective(metric="rate_error", statistic="quantile 0.9").of(np.array([1.0, np.nan, np.nan])) == math.inf
    assert Objective(metric="rate_error", statistic="quantile 0").of(values[:3]) == 1.0
    assert Objective(metric="rate_error", statistic="quantile 1").of(values[:3]) == 3.0


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"metric": "rmse_stedy_x"}, "not a known metric; did you mean rmse_steady_x?"),
        ({"metric": "zzzzzz"}, "not a known metric; known are rmse_whole_x, rmse_whole_y"),
        ({"metric": "effort_x", "statistic": "mean 0.5"}, "it must be mean, median, max, or quantile and a number"),
        (
            {"metric": "effort_x", "statistic": "quantile 1.01"},
            "it must be mean, median, max, or quantile and a number",
        ),
        ({"metric": "effort_x", "statistic": "quantile"}, "it must be mean, median, max, or quantile and a number"),
    ],
)
def test_an_objective_that_is_none_is_refused_with_what_is_near(entry: dict[str, str], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        Objective(**entry)


def test_a_diverged_run_counts_for_nothing_but_its_divergence() -> None:
    coarse = fg.Scenario.paper().replace({"run.step": 0.01, "disturbance.hold": 0.01, "run.duration": 2.0})
    (measured,) = measure([coarse], [0, 1], {})
    assert measured.diverged.all()
    assert np.isnan(measured.metrics["effort_x"]).all()
    assert not score(measured, [Objective(metric="effort_x")], [], []).feasible


def test_a_limit_is_kept_when_met_exactly_and_the_excess_is_relative_to_it() -> None:
    measured = Measured({"effort_x": np.array([2.0, 4.0])}, np.array([False, False]))
    found = score(
        measured,
        [Objective(metric="effort_x")],
        [Constraint(metric="effort_x", at_most=3.0), Constraint(metric="effort_x", at_most_base=0.5)],
        [3.0, 2.0],
    )
    assert found.objectives == (3.0,)
    assert found.excess == (0.0, 0.5)
    assert not found.feasible
    of_nothing = score(measured, [], [Constraint(metric="effort_x", at_most=0.0)], [0.0])
    assert of_nothing.excess == (3.0,), "with a limit of 0 there is nothing to be relative to"


def test_an_excess_without_end_stays_a_number_for_the_optimiser() -> None:
    measured = Measured({"effort_x": np.array([np.nan, 4.0])}, np.array([False, False]))
    found = score(measured, [], [Constraint(metric="effort_x", at_most=3.0)], [3.0])
    assert found.constraints == (math.inf,)
    assert found.excess == (1e6,)


def trial(number: int, *objectives: float, diverged: float = 0.0) -> Trial:
    return Trial(number, {}, Score(objectives, (), (), diverged))


def test_the_front_is_what_no_other_beats() -> None:
    points = [trial(0, 2.0, 2.0), trial(1, 1.0, 3.0), trial(2, 3.0, 1.0), trial(3, 2.0, 3.0), trial(4, 2.0, 2.0)]
    assert [t.number for t in front([*points, trial(5, 0.0, 0.0, diverged=0.5)])] == [1, 0, 2]
    assert front([trial(0, math.inf)]) == []


def test_what_beats_the_base_is_chosen_before_a_better_compromise() -> None:
    base = Score((1.0, 1.0), (), (), 0.0)
    compromise, beats, only_base = trial(1, 0.01, 2.0), trial(2, 0.8, 0.9), trial(3, 1.0, 1.0)
    assert choose([compromise, beats, only_base], base) == beats
    assert choose([compromise, only_base], base) == compromise


def test_the_bootstrap_interval_of_a_shift_holds_the_shift() -> None:
    theirs = np.random.default_rng(0).exponential(size=200)
    shift = _gap(Objective(metric="effort_x", statistic="quantile 0.9"), theirs, theirs + 0.25)
    assert shift.mean == pytest.approx(0.25)
    assert shift.low == pytest.approx(0.25)
    other = np.random.default_rng(1).exponential(size=200)
    assert _gap(Objective(metric="effort_x", statistic="median"), theirs, other).low < 0
    assert _gap(Objective(metric="effort_x", statistic="median"), theirs, other).high > 0


# -- Bad input -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('metric = "rmse_steady_x"', 'metric = "rmse_stead_x"', "did you mean rmse_steady_x?"),
        ("quantile 0.9", "quantile 9", "statistic is"),
        ("at_most_base = 1.01", "", "neither of at_most and at_most_base"),
        ("at_most_base = 1.01", "at_most_base = 1.0\nat_most = 3.0", "both of at_most and at_most_base"),
        ("at_most_base = 1.01", "at_mst_base = 1.0", "constraint[0].at_mst_base is not a known field; did you mean"),
        ('metric = "rmse_steady_x"', "", "objective[0].metric is missing: it must be given"),
        ("trials = 10", "trials = 0", "tune.trials is 0: it must lie between 1 and 1000000"),
        ("held_out_seeds = 6", "held_out_seeds = 4611686018427387904", "it must lie between 2 and 1000000"),
        ("trials = 10", "batch = 4611686018427387904", "it must lie between 2 and 1000000"),
        ("trials = 10", "trails = 10", "did you mean tune.trials?"),
        ("trials = 10", 'sampler = "cma"', 'tune.sampler is "cma"'),
        ("trials = 10", 'sampler = "cmaes"', "objective is given 2 times"),
        ("controller.order = {", "controller.oder = {", "did you mean controller.order?"),
        ("[vary]", "[vary]\ndisturbance.seed = { low = 0, high = 9 }", "disturbance.seed is in [vary]"),
        ("[vary]", '[vary]\ncontroller.kind = ["lin"]', 'controller.kind is "lin"'),
        ("run.duration = 2.0", 'disturbance.kind = "none"', "disturbance.kind is"),
        (
            "run.duration = 2.0",
            "run.duration = 0.5",
            "run.duration is 0.5: it must be greater than metrics.transient, 1,",
        ),
        ("trials = 10", 'storage = "nowhere://x:secret@y/z"', "nowhere://y/z cannot be opened as a database"),
        ("trials = 10", 'storage = "sqlite:////nowhere/study.db"', "cannot be"),
    ],
)
def test_a_bad_study_is_one_sentence(tmp_path: Path, old: str, new: str, expected: str) -> None:
    path = study(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(expected)) as caught:
        tune(path, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)
    assert not (tmp_path / "out" / "tuned.toml").exists()


def test_a_folder_in_use_and_a_changed_study_are_refused(tmp_path: Path) -> None:
    path, folder = study(tmp_path, trials=2), tmp_path / "out"
    tune(path, folder)
    with pytest.raises(fg.ScenarioError, match="has no study"):
        tune(path, tmp_path)
    with pytest.raises(fg.ScenarioError, match="cannot be read"):
        tune(tmp_path / "none.toml", folder)
    assert "already has a study" in sentence(path, "--out", folder)
    study(tmp_path, trials=3, tail=ONE)
    assert "differs in objective and constraint" in sentence(path, "--out", folder, "--resume")


def test_a_title_with_line_breaks_stays_a_comment(tmp_path: Path) -> None:
    title = "x\n[plant]\nmass = 1.0\r\x0c\x01\u2028end"
    path = study(tmp_path, head=f"title = {json.dumps(title)}\n{HEAD}", trials=2)
    named = path.rename(tmp_path / "my\nstudy.toml")
    tune(named, tmp_path / "out")
    text = (tmp_path / "out" / "tuned.toml").read_text(encoding="utf-8")
    assert "# x\n# [plant]\n# mass = 1.0\n" in text
    assert r"`fracgyro tune my\nstudy.toml`" in text
    assert fg.Scenario.load(tmp_path / "out" / "tuned.toml").plant.mass == fg.Scenario.paper().plant.mass


@pytest.mark.parametrize(
    "edit",
    [
        "DELETE FROM trial_user_attributes",
        "UPDATE trial_user_attributes SET value_json = '{\"objectives\": 1}' WHERE key = 'score'",
        "UPDATE trial_user_attributes SET value_json = 'null' WHERE key = 'score'",
        "UPDATE trial_user_attributes SET value_json = '[1' WHERE key = 'score'",
        "UPDATE trial_user_attributes SET value_json = '{}' WHERE key = 'values'",
        "UPDATE trial_user_attributes SET value_json = replace(value_json, '0.9', '0.1') WHERE key = 'values'",
        "UPDATE trial_user_attributes SET value_json = replace(value_json, '1', '2') WHERE key = 'score'",
        "UPDATE trial_user_attributes SET value_json = '\"0\"' WHERE key = 'hash'",
        "UPDATE trial_values SET value = value - 1",
        "UPDATE trial_params SET param_value = 'x'",
        "UPDATE trial_params SET distribution_json = '{}'",
        "DELETE FROM trial_params",
    ],
)
def test_a_damaged_database_is_one_sentence(out: Path, tmp_path: Path, edit: str) -> None:
    shutil.copytree(out, tmp_path / "out")
    with sqlite3.connect(tmp_path / "out" / "study.db") as database:
        assert database.execute(edit).rowcount > 0
    database.close()
    with pytest.raises(fg.ScenarioError, match=r"damaged: start the study again|cannot be used: ") as caught:
        tune(out.parent / "study.toml", tmp_path / "out", resume=True)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("text", ['{"parts": []}', "null", '"abc"', "[" * 100000])
def test_a_damaged_manifest_is_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "study.json").write_text(text, encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match=r"study\.json is damaged: start the study again in another folder$"):
        tune(study(tmp_path), tmp_path / "out", resume=True)


@pytest.mark.parametrize(
    "address",
    [
        "postgresql://host/name?password=hunter2",
        "postgresql://me:hunter2@host/name",
        "postgresql://me:hun?ter2@host/name?options=-c+hunter2",
        "postgresql://host/name?password=a@hunter2",
        "sqlite:////nowhere/trials.db?password=hunter2",
        pytest.param(
            "sqlite:///:memory:?password=hunter2",
            marks=pytest.mark.skipif(sqlalchemy.__version__ < "2.1", reason="SQLAlchemy before 2.1 overlooks it"),
        ),
        "hunter2",
        "postgresql://me:hunter2@host:port/name",
    ],
)
def test_no_sentence_shows_a_password(tmp_path: Path, address: str) -> None:
    with pytest.raises(ValueError, match=r"cannot be opened as a database|cannot be used") as caught:
        tune(study(tmp_path, storage=address), tmp_path / "out")
    assert "hunter2" not in str(caught.value)
    assert "ter2" not in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_storage_of_ones_own_holds_the_trials(tmp_path: Path) -> None:
    path = study(tmp_path, trials=3, storage=f"sqlite:///{tmp_path / 'mine.db'}")
    tune(path, tmp_path / "out")
    assert not (tmp_path / "out" / "study.db").exists()
    assert finished(tmp_path / "mine.db") == 3
    with pytest.raises(fg.ScenarioError, match="already has this study"):
        tune(path, tmp_path / "another")


def test_no_file_shows_a_password(tmp_path: Path) -> None:
    """Python's own driver receives requests for SQLite and opens the file."""
    address = f"sqlite:///file:{tmp_path / 'mine.db'}?uri=true&nolock=1&vfs=unix"
    path = study(tmp_path, trials=3, storage=address)
    tune(path, tmp_path / "out")
    assert finished(tmp_path / "mine.db") == 3
    for name in ("study.json", "tune.html"):
        text = (tmp_path / "out" / name).read_text(encoding="utf-8")
        assert "mine.db" in text, name
        assert "nolock" not in text, name


# -- The shipped scenario ------------------------------------------------------------------------------------


def test_the_shipped_study_can_be_read() -> None:
    plan = read_tuning(ROOT / "examples" / "tuning" / "gains.toml")
    assert plan.base == fg.Scenario.paper()
    untouched = ("plant.", "disturbance.", "reference.", "run.", "adaptation.initial")
    assert not [d.field for d in plan.dimensions if d.field.startswith(untouched)]


def test_the_shipped_gains_keep_their_word_on_seeds_of_their_own() -> None:
    tuned, paper = fg.Scenario.load(ROOT / "examples" / "scenarios" / "tuned.toml"), fg.Scenario.paper()
    for table in ("plant", "reference", "disturbance", "run"):
        assert getattr(tuned, table) == getattr(paper, table)
    assert tuned.adaptation.initial_ratio == paper.adaptation.initial_ratio
    mine, theirs = measure([tuned, paper], range(5000, 5012), {})
    for metric in ("rmse_steady_x", "rmse_steady_y", "rate_error_rms", "rate_error_peak"):
        assert (mine.metrics[metric] < theirs.metrics[metric]).all(), metric
    for metric in ("effort_x", "effort_y", "chattering_x", "chattering_y"):
        assert mine.metrics[metric].mean() <= theirs.metrics[metric].mean(), metric


@pytest.mark.parametrize("rate", [0.0, 300.0])
def test_the_shipped_gains_sense_other_rates_as_well(rate: float) -> None:
    tuned = fg.Scenario.load(ROOT / "examples" / "scenarios" / "tuned.toml")
    nominal, other = measure([tuned, tuned.replace({"plant.angular_rate": rate})], range(5000, 5004), {})
    assert other.metrics["rate_error_rms"] == pytest.approx(nominal.metrics["rate_error_rms"], rel=0.1)


def test_the_shipped_scenario_is_of_the_shipped_study() -> None:
    path = ROOT / "examples" / "tuning" / "gains.toml"
    text = (ROOT / "examples" / "scenarios" / "tuned.toml").read_text(encoding="utf-8")
    assert f"# sha256 of gains.toml: {hashlib.sha256(path.read_bytes()).hexdigest()}" in text
    changed = dict(re.findall(r"^#   (\w+\.\w+) = (.*), was ", text, re.MULTILINE))
    values = {name: tomllib.loads(f"value = {value}")["value"] for name, value in changed.items()}
    hardware = {
        "controller.force_limit": 6000.0,
        "controller.switching_limit": 0.5,
    }  # documented as an addition that changes nothing
    assert fg.Scenario.from_toml(text) == fg.Scenario.paper().replace({**values, **hardware})
    assert all(f"#   {field} = {value}\n" in text for field, value in hardware.items())
    assert set(values) == {dimension.field for dimension in read_tuning(path).dimensions}
