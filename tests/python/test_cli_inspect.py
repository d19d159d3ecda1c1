"""Commands that look at a scenario without running it: check, diff, explain; a scenario as text."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import fracgyro as fg
import pytest
from click.testing import CliRunner, Result
from fracgyro import Scenario
from fracgyro.cli import cli
from fracgyro.cli.terminal import print_table
from fracgyro.scenario.bounded import gain
from fracgyro.scenario.messages import paths
from fracgyro.scenario.shipped import NAMES
from fracgyro.scenario.suspicious import suspicious
from fracgyro.study.space import flat

HARDWARE = Scenario.shipped("hardware")


def ran(*words: str | Path) -> Result:
    return CliRunner().invoke(cli, list(map(str, words)))


def test_check_prints_every_error(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text("[controller]\norder = 3\nkind = 'pdi'\n[plant]\nmas = 3.0\n", encoding="utf-8")
    found = ran("check", bad)
    assert (found.exit_code, found.stdout) == (2, "")
    lines = found.stderr.splitlines()
    fields = [line.split(": ")[1].split(" is ")[0] for line in lines]
    assert fields == ["plant.mas", "controller.kind", "controller.order"]
    assert lines[1].endswith("; did you mean pid?")
    assert ran("check", tmp_path / "none.toml").exit_code == 2


@pytest.mark.parametrize("name", NAMES)
def test_check_warns_of_no_shipped_scenario_but_those_that_are_not_bounded(name: str) -> None:
    found = ran("check", name)
    assert found.exit_code == 0
    warnings = [line for line in found.stdout.splitlines() if line.startswith("Warning: ")]
    if Scenario.shipped(name).controller.switching_limit == float("inf"):
        (warning,) = warnings
        assert "controller.switching_limit is inf: in noise the bound estimates grow" in warning
    else:
        assert warnings == []
        assert found.stdout == f"{name} is a valid scenario\n"


@pytest.mark.parametrize(
    ("changes", "start"),
    [
        ({"run.duration": 5.0}, "run.duration is 5: metrics of the steady window need more than 10"),
        ({"run.step": 0.02, "disturbance.hold": None}, "run.step is 0.02: a period of the fastest resonance has 13"),
        ({"device.actuator_limit": 1e-5}, "controller.force_limit is 6000: the actuator gives at most 55.5556, unit"),
        ({"device.position_range": 5e-7}, "device.position_range is 5e-07 m in x: the reference moves 1e-06 m"),
        ({"adaptation.initial_bound": [200.0, 1.0, 1.0]}, "run.step is 0.001: at the start rho h/delta is "),
    ],
)
def test_a_suspicious_field_is_named_with_its_value(changes: dict[str, Any], start: str) -> None:
    found = list(suspicious(HARDWARE.replace(changes)))
    if "adaptation.initial_bound" in changes:  # the switching limit keeps rho h/delta low
        assert found == []
        found = list(suspicious(HARDWARE.replace({**changes, "controller.switching_limit": float("inf")})))
    assert any(sentence.startswith(start) for sentence in found), found


def test_the_loop_chatters_where_the_check_warns_of_the_start() -> None:
    changes = {"controller.switching_limit": float("inf"), "controller.force_limit": float("inf")}
    steep = HARDWARE.replace({**changes, "adaptation.initial_bound": [400.0, 1.0, 1.0], "run.duration": 12.0})
    assert gain(steep, (400.0, 1.0, 1.0), 0.0, 0.0) > 2
    assert any("at the start rho h/delta" in sentence for sentence in suspicious(steep))
    calm = HARDWARE.replace({"run.duration": 12.0})
    found, usual = (float(fg.metrics.chattering(fg.simulate(each)).max()) for each in (steep, calm))
    assert found > 10 * usual


def test_diff_prints_both_values_and_exits_with_1(tmp_path: Path) -> None:
    same = ran("diff", "disc", "disc")
    assert (same.exit_code, same.stdout) == (0, "no field differs\n")
    stiffness = HARDWARE.plant.stiffness.model_dump() | {"xy": 1.0}
    other = HARDWARE.replace({"controller.kind": "pid", "plant.stiffness": stiffness})
    other.save(tmp_path / "other.toml")
    found = ran("diff", "hardware", tmp_path / "other.toml", "--json")
    assert found.exit_code == 1
    content = json.loads(found.stdout)
    assert content["controller.kind"] == ["fractional_fast_terminal", "pid"]
    assert content["controller.order"] == [0.9, None]
    assert content["plant.stiffness"][1]["xy"] == 1.0
    assert set(content) == set(HARDWARE.differences(other))
    table = ran("diff", "paper", "hardware").stdout.splitlines()
    assert table[1].split() == ["controller.force_limit", "inf", "6000.0"]


VOLTS = Scenario.shipped("dual_mass_volts")
REBALANCED = VOLTS.replace({"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"]})


@pytest.mark.parametrize(
    ("scenario", "changes", "said"),
    [
        (REBALANCED, {"controller.rebalance_bandwidth": 0.5, "controller.demodulation_bandwidth": 0.2}, "0.2: below 5"),
        (VOLTS, {"controller.kind": "whole_angle", "controller.quadrature_bandwidth": 0.5}, "bandwidth is 0.5: above"),
        (
            VOLTS,
            {"controller.kind": "virtual_rotation", "controller.virtual_rate": 0.01, "controller.reversal_turns": 0.3},
            "controller.reversal_turns is 0.3: only over a multiple of 0.5",
        ),
        (VOLTS, {"controller.kind": "virtual_rotation"}, "controller.virtual_rate is 0.0: the vibration is not turned"),
        (
            VOLTS,
            {
                "controller.kind": "mode_reversal",
                "controller.settling_time": 3e4,
                "controller.reversal_interval": 2e4,
            },
            "controller.settling_time is 30000: reversal_interval is 20000, so that the rate is never read",
        ),
        (
            VOLTS,
            {"plant.transverse_rate": [1.0, 0.0]},
            "plant.transverse_rate is [1.0, 0.0]: without plant.centrifugal",
        ),
        (
            REBALANCED,
            {"trim.tuning": "split", "trim.modulation": 1.0, "trim.interval": 50.0},
            "trim.interval is 50 s: the run ends after",
        ),
        (
            REBALANCED,
            {"trim.tuning": "split", "trim.modulation": 1.0, "controller.output_bandwidth": 0.2},
            "controller.output_bandwidth is 785.1 Hz, so that the tone is in the rate",
        ),
    ],
)
def test_check_warns_of_fields_at_which_a_law_does_not_do_its_work(
    scenario: Scenario, changes: dict[str, Any], said: str
) -> None:
    without = list(suspicious(scenario.replace({name: changes[name] for name in changes if name.endswith(".kind")})))
    found = [each for each in suspicious(scenario.replace(changes)) if each not in without]
    assert any(said in each for each in [*found, *(without if len(changes) == 1 else [])]), found


def test_a_text_in_brackets_is_printed_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(["of [device]", "b"], [["nothing of [device] drifts", "[/red] \\[bold]"]])
    assert [line.split("  ") for line in map(str.rstrip, capsys.readouterr().out.splitlines())] == [
        ["of [device]", *[""] * 7, " b"],
        ["nothing of [device] drifts", "[/red] \\[bold]"],
    ]


@pytest.mark.parametrize("path", paths(Scenario))
def test_every_field_and_table_is_explained(path: str) -> None:
    found = ran("explain", path)
    assert found.exit_code == 0, found.output
    assert found.stdout.startswith(f"{path}: ")


@pytest.mark.parametrize("name", ["electrodes[1].gap", "electrodes.gap"])
def test_a_field_of_a_list_of_tables_is_explained(name: str) -> None:
    lines = ran("explain", name).stdout.splitlines()
    assert lines[0].startswith(f"{name}: ")
    assert [line.split() for line in lines[1:3]] == [["unit", "m"], ["range", ">", "0"]]
    assert (
        ran("explain", "disturbance[1].seed").stdout.split(": ")[1]
        == ran("explain", "disturbance.seed").stdout.split(": ")[1]
    )


def test_a_study_does_not_vary_a_field_of_a_list_of_tables() -> None:
    with pytest.raises(
        fg.ScenarioError, match=r"^electrodes\[1\]\.bias is a field of a list of tables, which cannot be"
    ):
        flat({"electrodes[1].bias": {"low": 1.0, "high": 2.0}})


def test_explain_has_unit_range_default_and_kinds() -> None:
    lines = ran("explain", "controller.order").stdout.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["range", "default", "controllers"]
    assert lines[3].split(maxsplit=1)[1] == "fractional_fast_terminal, fractional, fast_terminal, linear"
    assert "unit        kg" in ran("explain", "plant.mass").stdout
    for typo in ("ordr", "controller.ordr"):
        assert "did you mean controller.order?" in str(ran("explain", typo).exception)


# -- Text ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_prints_the_fields_that_are_not_defaults(name: str) -> None:
    scenario = Scenario.shipped(name)
    assert eval(repr(scenario)) == scenario
    lines = str(scenario).splitlines()
    assert [line.split(" ")[0] for line in lines] == list(scenario.changes())
    assert Scenario().replace(scenario.changes()) == scenario
    assert len(lines) < 40


def test_a_scenario_of_another_kind_prints_its_kind_and_not_the_fields_that_it_lacks() -> None:
    scenario = Scenario().replace({"controller.kind": "pid", "controller.damping_ratio": 0.5})
    assert str(scenario) == 'controller.kind = "pid"\ncontroller.damping_ratio = 0.5'
    assert eval(repr(scenario)) == scenario
    assert str(Scenario()) == "the paper's values"
    thermal = str(Scenario().replace({"disturbance.standard_deviation": None, "disturbance.density": 1.0}))
    assert "disturbance.standard_deviation is not set" in thermal


def test_a_scenario_is_changed_only_by_replace() -> None:
    scenario = Scenario()
    for table, field in ((scenario, "run"), (scenario.run, "step")):
        with pytest.raises(AttributeError, match=f"^{field} cannot be set: a scenario is frozen; its method replace"):
            setattr(table, field, 1.0)
    changes: Any = ["controller.order"]
    with pytest.raises(TypeError, match=r"^changes is \['controller.order'\]: it must be a dict of dotted names"):
        scenario.replace(changes)


def test_check_prints_wrong_units_kinds_and_names_together(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text(
        "units = 'si'\n[run]\nstep = '2 kg'\nduratin = 3.0\n[controller]\nkind = 'pdi'\n[plant]\nmass = '1 m'\n"
        "[reference]\nkind = 'table'\nfile = 'none.csv'\n",
        encoding="utf-8",
    )
    fields = [line.split(": ")[1].split(" is ")[0] for line in ran("check", bad).stderr.splitlines()]
    assert sorted(fields) == ["controller.kind", "plant.mass", "reference.file", "run.duratin", "run.step", "units"]


def test_check_warns_of_a_table_that_ends_early(tmp_path: Path) -> None:
    points = [[0.0, 0.0, 0.0], [7.0, 1.0, 1.0]]
    scenario = HARDWARE.replace({"run.duration": 80.0, "reference.kind": "table", "reference.points": points})
    assert any("reference.points ends at 7: run.duration is 80" in each for each in suspicious(scenario))
    longer = scenario.replace({"reference.points": [[0.0, 0.0, 0.0], [9.0, 1.0, 1.0]]})
    assert not any("ends at" in each for each in suspicious(longer))
    added = HARDWARE.replace({"disturbance": [{"kind": "none"}, {"kind": "table", "points": points, "start": 0.5}]})
    assert any(each.startswith("disturbance[1].points ends at 7.5") for each in suspicious(added)) == (
        HARDWARE.run.duration > 75.0
    )


@pytest.mark.parametrize(
    "text",
    [
        "[disturbance]\nkind = 'none'\n[[disturbance]]\nkind = 'none'",
        "[[disturbance]]\nkind = 'none'\n[disturbance]\nkind = 'none'",
        "[disturbance]\nkind = 'none'\n[disturbance]\nkind = 'none'",
    ],
)
def test_a_list_of_tables_with_single_brackets_is_explained(text: str) -> None:
    with pytest.raises(
        fg.ScenarioError, match=r"each table of a list is headed by two brackets, as \[\[disturbance\]\]"
    ):
        Scenario.from_toml(text)


def test_explain_knows_metrics_and_channels_and_labels_kinds() -> None:
    assert "windows  whole, transient, steady" in ran("explain", "rmse").stdout
    assert ran("explain", "rate_estimate").stdout.startswith("rate_estimate: estimate of the angular rate")
    assert "reference.kind  sine, chirp" in ran("explain", "reference.frequency").stdout
    assert "disturbance.kind  pulse" in ran("explain", "disturbance.width").stdout
    for name, said in {
        "frequency": "did you mean reference.frequency, disturbance.frequency, rate.frequency or trim.frequency?",
        "chatering": "is not a known field, channel or metric; did you mean chattering?",
        "qqqq": ", and channels and metrics of runs",
        "duration": "did you mean run.duration?",
    }.items():
        assert said in str(ran("explain", name).exception)


def test_diff_leaves_out_what_only_the_reproduction_sets(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text("[run]\nduration = 20.0\n", encoding="utf-8")
    lines = ran("diff", "paper", mine).stdout.splitlines()
    assert [line.split()[0] for line in lines if line][1:-1] == ["run.duration"]
    assert "disturbance.hold, run.kernel_tolerance; --all prints them" in lines[-1]
    everything = ran("diff", "paper", mine, "--all").stdout
    assert "disturbance.hold" in everything.splitlines()[1]
    assert set(json.loads(ran("diff", "paper", mine, "--json").stdout)) > {"disturbance.hold", "run.duration"}


def test_scenario_prints_a_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text("[run]\nduration = 20.0\n", encoding="utf-8")
    assert 'duration = "20 ms"' in ran("scenario", mine, "--units", "SI").stdout
    assert ran("scenario", mine).stdout == Scenario.load(mine).to_toml()
