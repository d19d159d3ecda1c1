"""Figures of tasks over seeds, in sweeps and in tunings: those of each recorded run."""

from __future__ import annotations

import json
import math
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from fracgyro.analysis import task_runs
from fracgyro.analysis.metric_names import ALL_METRICS, METRICS, TASK_METRICS, TASKS
from fracgyro.analysis.task_runs import available, measure_tasks, thinned
from fracgyro.analysis.tasks import task_figures
from fracgyro.cli import cli
from pyarrow import parquet

STEP = {"reference.kind": ["step", "rest"], "run.duration": 3.0, "run.initial_position": (0.0, 0.0)}
CHIRP = {
    "reference.kind": ["rest", "chirp"],
    "reference.final_frequency": (0.0, 8.0),
    "reference.end": 12.0,
    "run.duration": 14.0,
}
SCENARIOS = {
    "step": fg.Scenario.paper().replace(STEP),
    "step in SI": fg.Scenario.paper().replace(STEP | {"run.units": "SI"}),
    "chirp": fg.Scenario.paper().replace(CHIRP),
    "chirp in SI": fg.Scenario.paper().replace(CHIRP | {"run.units": "SI"}),
    "drive": fg.Scenario.shipped("dual_mass").replace(
        {"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"], "run.duration": 300.0}
    ),
}
STUDY = """
seeds = 3
fixed = { reference.kind = ["step", "rest"], run = { duration = 3.0, initial_position = [0.0, 0.0] } }
vary.controller.order = [0.8, 0.9]
"""


def one_by_one(scenario: fg.Scenario, seed: int) -> dict[str, float]:
    """Figures of a recorded run by column, in its units."""
    run = fg.simulate(scenario.replace({"disturbance.seed": seed}))
    found = {}
    for name, values in ((str(name), values) for part in task_figures(run) for name, values in part.items()):
        for axis in values["axis"].values if "axis" in values.dims else [""]:
            found[f"{name}_{axis}" if axis else name] = float(values.sel(axis=axis) if axis else values)
    return found


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", SCENARIOS)
def test_figures_over_seeds_are_the_means_of_those_of_each_run(name: str, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    file = written(tmp_path / "scenario.toml", scenario.to_toml())
    ran = CliRunner().invoke(cli, ["simulate", str(file), "--seeds", "3", "--json"], catch_exceptions=False)
    printed = json.loads(ran.stdout)
    runs = [one_by_one(scenario, scenario.disturbance.seed + i) for i in range(3)]
    assert set(runs[0]) == set(available(scenario, own=False)) <= set(TASK_METRICS)
    for column in runs[0]:
        figure, _, axis = column.rpartition("_") if column[-2:] in ("_x", "_y") else (column, "", "")
        stated = printed[figure][axis] if axis else printed[figure]
        each = [run[column] for run in runs]
        never = sum(map(math.isnan, each))
        assert stated.get("never", 0) == never
        assert never or stated["mean"] == pytest.approx(np.mean(each), rel=1e-12)


def test_a_sweep_has_the_figures_of_each_run_as_columns_and_on_its_page(tmp_path: Path) -> None:
    study = written(tmp_path / "study.toml", STUDY + 'show = ["overshoot_x", "settling_time_x", "rmse_steady_x"]\n')
    result = fg.study.sweep(study, tmp_path / "out")
    table = parquet.read_table(result.data)
    steps = [f"{figure}_{axis}" for figure in TASKS["step"].figures for axis in "xy"]
    assert set(table.column_names[3:]) == {*METRICS, *steps, "diverged_at"}
    for row in table.to_pylist():
        expected = one_by_one(SCENARIOS["step"].replace({"controller.order": row["controller.order"]}), row["seed"])
        assert {name: row[name] for name in expected} == pytest.approx(expected, rel=1e-12)
        assert row["overshoot_y"] is None, "y has no step"
    page = result.summary.read_text(encoding="utf-8")
    assert ALL_METRICS["overshoot_x"][0] in page
    plain = fg.study.sweep(written(tmp_path / "plain.toml", STUDY), tmp_path / "plain")
    others = parquet.read_table(plain.data)
    assert set(others.column_names[3:]) == {*METRICS, "diverged_at"}, "no record without such a figure"
    assert others.equals(table.select(others.column_names)), "the other metrics keep their bits"
    changed = written(study, STUDY)
    with pytest.raises(ValueError, match=r"has another study, which differs in the tasks of show"):
        fg.study.sweep(changed, tmp_path / "out", resume=True)


def test_a_tuning_minimizes_a_figure_of_a_task(tmp_path: Path) -> None:
    fields = STUDY.replace("vary.controller.order = [0.8, 0.9]", "vary.controller.fractional_gain = [8.0, 10.0, 20.0]")
    tail = '[[objective]]\nmetric = "settling_time_x"\n[[constraint]]\nmetric = "overshoot_x"\nat_most = 1.0\n'
    study = written(tmp_path / "study.toml", f"{fields}[tune]\ntrials = 6\nheld_out_seeds = 2\n{tail}")
    result = fg.study.tune(study, tmp_path / "out")
    (objective,), (constraint,) = result.held_out.objectives, result.held_out.constraints
    scenario = fg.Scenario.from_toml(result.scenario.read_text(encoding="utf-8"))
    tuned = [one_by_one(scenario, seed) for seed in (3, 4)]
    assert objective.tuned == pytest.approx(np.mean([run["settling_time_x"] for run in tuned]), rel=1e-12)
    assert constraint.tuned == pytest.approx(np.mean([run["overshoot_x"] for run in tuned]), rel=1e-12)
    assert objective.searched <= objective.searched_base
    page = result.report.read_text(encoding="utf-8")
    assert "<code>rise_time_x</code>" in page
    assert "<code>rise_time_y</code>" not in page


def test_figures_do_not_depend_on_which_runs_are_recorded_together(monkeypatch: pytest.MonkeyPatch) -> None:
    scenarios = [
        SCENARIOS["step"],
        SCENARIOS["step"].replace({"controller.order": 0.7}),
        SCENARIOS["chirp"],
        SCENARIOS["step in SI"],
    ]
    seen: list[int] = []
    found = measure_tasks(scenarios, ["step", "chirp"], seeds=range(3), progress=seen.append)
    assert sum(seen) == 12
    monkeypatch.setattr(task_runs, "MAX_NUMBERS", 2 * task_runs.COLUMNS * 3001)
    again = measure_tasks(scenarios, ["step", "chirp"], seeds=range(3))
    assert found.identical(again)
    assert found["overshoot"].values[:3] == pytest.approx(found["overshoot"].values[9:], nan_ok=True, rel=1e-9)
    assert found["rise_time"].values[:3] == pytest.approx(found["rise_time"].values[9:], nan_ok=True, rel=1e-9)
    assert np.isnan(found["overshoot"].values[6:9]).all()
    assert np.isfinite(found["gain_deviation"].values[6:9, 1]).all()


def test_a_diverged_run_has_no_figures() -> None:
    wild = SCENARIOS["step"].replace({"run.step": 0.05, "disturbance.hold": 0.05, "controller.fractional_gain": 400.0})
    found = measure_tasks([wild], ["step"], seeds=range(2))
    assert np.isfinite(found["diverged_at"]).all()
    assert np.isnan(found["overshoot"]).all()


def test_a_controller_of_your_own_has_figures_of_the_reference_but_not_of_a_drive() -> None:
    def law(s: fg.Sample) -> tuple[float, float]:
        x, y = (-4e4 * e - 280 * de for e, de in zip(s.error, s.error_rate, strict=True))
        return x, y

    found = measure_tasks([SCENARIOS["step"]], ["step"], seeds=range(2), controller=law)
    run = fg.simulate(SCENARIOS["step"].replace({"disturbance.seed": 1}), law)
    assert float(found["overshoot"][1, 0]) == float(fg.metrics.step_response(run)["overshoot"][0])
    assert available(SCENARIOS["drive"], own=True) == []
    assert task_figures(fg.simulate(SCENARIOS["drive"].replace({"run.duration": 20.0}), lambda s: (0.0, 0.0))) == []


def test_a_record_is_thinned_unless_a_chirp_needs_its_samples() -> None:
    step = SCENARIOS["step"].replace({"run.duration": 1000.0})
    assert thinned(step).run.record_every == 10
    fast = {"reference.final_frequency": (0.0, 200.0)}
    assert thinned(SCENARIOS["chirp"].replace({**fast, "run.duration": 1000.0})).run.record_every == 7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'show = ["overshoot_x"]\nvary.controller.order = [0.8]',
            "overshoot_x needs reference.kind = step on x, w",
        ),
        (
            'show = ["overshoot_y"]\n' + STUDY.replace("seeds = 3", ""),
            "overshoot_y needs reference.kind = step on y, which every point lacks",
        ),
        (
            'show = ["gain_deviation_x"]\nvary.controller.order = [0.8]',
            "gain_deviation_x needs reference.kind = chirp on x, which every point lacks",
        ),
        (
            'show = ["amplitude_error"]\nvary.controller.order = [0.8]',
            "amplitude_error needs controller.kind = open_loop or force_rebalance or whole_angle or "
            "virtual_rotation or mode_reversal, which every point lacks",
        ),
        ('show = ["overshoot"]', "which is not a known metric; did you mean overshoot_x or overshoot_y?"),
        ('show = ["setling_time_x"]', "did you mean settling_time_x?"),
    ],
)
def test_a_sweep_says_which_task_a_figure_needs(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(fg.ScenarioError) as raised:
        fg.study.sweep(written(tmp_path / "study.toml", text), tmp_path / "out")
    assert message in str(raised.value)
    assert not (tmp_path / "out").exists()


def test_a_tuning_says_which_task_a_figure_needs(tmp_path: Path) -> None:
    text = 'vary.controller.order = [0.8, 0.9]\nobjective = [{ metric = "settling_time_x" }]\n'
    with pytest.raises(fg.ScenarioError) as raised:
        fg.study.tune(written(tmp_path / "study.toml", text), tmp_path / "out")
    assert str(raised.value) == "settling_time_x needs reference.kind = step on x, which the base scenario lacks"
