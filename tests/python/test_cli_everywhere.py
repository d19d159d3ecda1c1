"""Names of shipped scenarios, and a user's controller, wherever a command or a function takes one."""

from __future__ import annotations

import json
from pathlib import Path

import fracgyro as fg
import pytest
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.export.web import document
from fracgyro.scenario.named import named
from fracgyro.scenario.shipped import NAMES
from fracgyro.study.file import base_scenario
from fracgyro_lab.comparison.plan import planned


def ran(*words: str | Path) -> str:
    """What a command prints; it must succeed."""
    found = CliRunner().invoke(cli, list(map(str, words)))
    assert found.exit_code == 0, found.output + str(found.exception)
    return found.output


def refused(*words: str | Path) -> str:
    """The sentence of a command that fails before it does anything."""
    found = CliRunner().invoke(cli, list(map(str, words)), standalone_mode=False)
    assert isinstance(found.exception, Exception)
    return str(found.exception)


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_scenario_has_a_name_in_python_and_on_the_command_line(name: str) -> None:
    printed = fg.Scenario.from_toml(ran("scenario", name))
    assert fg.Scenario.shipped(name) == named(name) == printed
    assert f"\n{name} " in "\n" + ran("scenario", "--list")


def test_a_name_wins_over_a_file_and_a_path_is_always_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mine = fg.Scenario.paper().replace({"run.duration": 2.0})
    mine.save("dual_mass")
    mine.save("mine")
    assert named("dual_mass") == fg.Scenario.shipped("dual_mass")
    assert named("./dual_mass") == named(Path("dual_mass")) == named("mine") == mine
    assert base_scenario("dual_mass", tmp_path, {}) == fg.Scenario.shipped("dual_mass")
    assert base_scenario("./dual_mass", tmp_path, {}) == mine


@pytest.mark.parametrize(
    "words",
    [
        ["simulate"],
        ["rate", "--out", "out"],
        ["export", "firmware", "--out", "out"],
        ["export", "fmu", "--out", "out.fmu"],
        ["export", "web", "--out", "out.json"],
        ["export", "matlab", "--out", "out"],
        ["export", "fpga", "--out", "out"],
        ["compare", "track", "--quick", "--out", "out"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_every_command_suggests_the_name_that_was_meant(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refused(*words, "dual_mas")
    assert said == '"dual_mas" is neither a shipped scenario nor a file; did you mean dual_mass?'
    assert not list(tmp_path.iterdir())


def test_the_names_reach_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ran("export", "web", "dual_mass", "--out", "out.json")
    found = json.loads(Path("out.json").read_text())
    assert found == found | document(fg.Scenario.shipped("dual_mass"))
    found = ran("simulate", "paper-printed", "--set", "run.duration=2.0", "--json")
    printed = fg.simulate(fg.Scenario.paper("printed").replace({"run.duration": 2.0}))
    assert json.loads(found)["rmse"]["whole"]["x"] == pytest.approx(float(fg.metrics.rmse(printed)[0]), rel=1e-12)
    everything = {"classes": (), "noise": (), "only": (), "controller": None, "trials": 1, "quick": True}
    plan = planned("rate", scenarios=["disc"], storage=None, **everything)
    assert list(plan.scenarios) == ["disc"]


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(fg.ScenarioError, match='scenario is "rocket": it must be one of paper, paper-printed, '):
        fg.Scenario.shipped("rocket")
    with pytest.raises(fg.ScenarioError, match="; did you mean dual_mass"):
        fg.Scenario.shipped("dual_mas")
