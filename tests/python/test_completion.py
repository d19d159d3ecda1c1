"""Completions of a shell, through click's own classes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import fracgyro as fg
import pytest
from click.shell_completion import CompletionItem, ShellComplete
from fracgyro.cli import cli
from fracgyro.scenario.shipped import NAMES


def offered(*words: str) -> list[CompletionItem]:
    """After all words but the last, which is only begun."""
    return ShellComplete(cli, {}, "fracgyro", "_FRACGYRO_COMPLETE").get_completions(list(words[:-1]), words[-1])


def values(*words: str) -> list[str]:
    return [item.value for item in offered(*words)]


def test_set_offers_fields_with_their_meaning() -> None:
    found = offered("simulate", "--set", "controller.la")
    assert [item.value for item in found] == ["controller.layer_thickness=", "controller.layer=", "controller.layout="]
    assert found[0].help.startswith("delta, unit of s")
    everything = values("simulate", "--set", "")
    assert "plant.stiffness.xx=" in everything
    assert "plant.stiffness=" not in everything


def test_of_a_single_field_the_choices_are_offered() -> None:
    assert values("simulate", "--set", "run.uni") == ["run.units=nondimensional", "run.units=SI"]
    assert values("simulate", "--set", "controller.layer=") == ["controller.layer=linear", "controller.layer=quadratic"]
    assert values("simulate", "--set", "controller.layer=q") == ["controller.layer=quadratic"]
    assert values("simulate", "--set", "controller.adap") == ["controller.adaptive=true", "controller.adaptive=false"]
    assert values("simulate", "--set", "controller.ord") == ["controller.order="]
    assert values("simulate", "--set", "controller.order=") == []
    assert values("simulate", "--set", "nothing") == []


@pytest.mark.parametrize("choice", values("simulate", "--set", "disturbance.kind="))
def test_what_is_offered_is_accepted(choice: str) -> None:
    field, _, value = choice.partition("=")
    size = {"amplitude": [1.0, 0.0]}
    needed: dict[str, dict[str, Any]] = {
        "pulse": {"width": 1.0, **size},
        "sine": size,
        "step": size,
        "vibration": {"psd": [[1.0, 1.0], [2.0, 1.0]]},
        "table": {"points": [[0.0] * 3]},
    }
    strength = {f"disturbance.{name}": given for name, given in needed.get(value, {"standard_deviation": 1.0}).items()}
    assert fg.Scenario.paper().replace({field: value, **strength}).disturbance.kind == value


@pytest.mark.parametrize(
    "command", ["simulate", "rate", "export fmu", "export firmware", "export web", "sweep", "tune", "compare track"]
)
def test_files_that_end_in_toml_are_offered(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "deep").mkdir()
    for name in ("mine.toml", "mine.csv", "other.toml", "deep/mine.toml"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    assert values(*command.split(), "m")[1:] == ["mine.toml"]
    names = [] if command in ("sweep", "tune") else [*NAMES]
    assert values(*command.split(), "")[1:] == ["mine.toml", "other.toml", *names]
    assert values(*command.split(), "deep/")[1:] == ["deep/mine.toml"]
    assert values(*command.split(), "nowhere/")[1:] == []
    assert offered(*command.split(), "m")[0].type == "dir"


def test_bash_is_answered() -> None:
    line = "fracgyro simulate --set run.uni"
    asked = {"_FRACGYRO_COMPLETE": "bash_complete", "COMP_WORDS": line, "COMP_CWORD": "3"}
    command = [sys.executable, "-c", "import sys; sys.argv = ['fracgyro']; from fracgyro.cli import main; main()"]
    ran = subprocess.run(command, env={**os.environ, **asked}, capture_output=True, text=True)
    assert ran.stdout.splitlines() == ["plain,run.units=nondimensional", "plain,run.units=SI"], ran.stderr
