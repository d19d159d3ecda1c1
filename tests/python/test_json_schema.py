"""Findings of an editor for a file with its schema, through taplo."""

from __future__ import annotations

import json
import math
import re
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, cast

import fracgyro as fg
import pytest
from embedded import need, where
from fracgyro.scenario.messages import paths
from fracgyro.scenario.shipped import SHIPPED, shipped_text
from fracgyro.scenario.table import toml_value
from fracgyro.study.space import _valid
from fracgyro.study.sweep.design import read_plan
from fracgyro.study.tune.plan import read_tuning
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[2]
TAPLO = str(where("taplo"))
Kind = Literal["scenario", "study", "tuning"]
FIELDS = [path for path in paths(fg.Scenario) if not any(other.startswith(f"{path}.") for other in paths(fg.Scenario))]


def complaints(kind: Kind, texts: Sequence[str], folder: Path) -> list[set[int]]:
    """Lines with findings of taplo, for each text."""
    need("editor")
    schema = folder / "schema.json"
    schema.write_text(json.dumps(fg.schema(kind), allow_nan=False), encoding="utf-8")
    files = [folder / f"{number}.toml" for number in range(len(texts))]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text, encoding="utf-8")
    command = [TAPLO, "lint", "--no-auto-config", "--colors", "never", "--schema", schema.as_uri(), *files]
    ran = subprocess.run(command, capture_output=True, text=True)
    places = re.findall(r"┌─ (.*):(\d+):\d+", ran.stderr)
    assert (ran.returncode == 0) == (not places), ran.stderr
    return [{int(line) for name, line in places if name == str(file)} for file in files]


def refused(kind: Kind, texts: Sequence[str], folder: Path) -> list[bool]:
    return list(map(bool, complaints(kind, texts, folder)))


def test_every_shipped_scenario_and_every_example_is_accepted(tmp_path: Path) -> None:
    scenarios = [fg.Scenario.paper().to_toml(), *map(shipped_text, SHIPPED)]
    scenarios += [path.read_text(encoding="utf-8") for path in (ROOT / "examples/scenarios").glob("*.toml")]
    studies = [path.read_text(encoding="utf-8") for path in (ROOT / "examples/studies").glob("*.toml")]
    tunings = [path.read_text(encoding="utf-8") for path in (ROOT / "examples/tuning").glob("*.toml")]
    assert len(studies) > 2
    assert tunings
    assert not any(refused("scenario", scenarios, tmp_path))
    assert not any(refused("study", studies, tmp_path))
    assert not any(refused("tuning", tunings, tmp_path))


numbers = st.sampled_from([0.0, 1.0, -1.0, 0.5, 1e-3, 1e7, math.inf, 0, 1, -1, 2, 33, 2**40]) | st.floats(-1e3, 1e3)
values = st.one_of(
    numbers,
    st.lists(numbers, max_size=4),
    st.lists(st.lists(numbers, max_size=3), max_size=1),  # a schema cannot require rising times for more points
    st.booleans(),
    st.sampled_from(["", "noise", "linear", "full", "SI", "pid"]),
    st.just({"xx": 1.0, "xy": 0.0, "yy": 1.0}),
)


def takes(field: str, value: Any) -> bool:
    """True if the field accepts the value, independent of other fields."""
    try:
        _valid(field, value)
    except fg.ScenarioError:
        return False
    return True


@settings(max_examples=10, phases=[Phase.generate])  # one taplo each
@given(st.data())
def test_a_field_is_accepted_with_the_values_that_it_takes_and_no_others(data: st.DataObject) -> None:
    cases = [(field, data.draw(values, label=field)) for field in FIELDS]
    text = "".join(f"{field} = {toml_value(value)}\n" for field, value in cases)
    with tempfile.TemporaryDirectory() as folder:
        [lines] = complaints("scenario", [text], Path(folder))
    wrong = [case for line, case in enumerate(cases, start=1) if (line in lines) == takes(*case)]
    assert not wrong


def without(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


STUDY = """
seeds = 4
show = ["chattering_x"]
[fixed]
run.duration = 2.0
"controller.order" = 0.8
[design]
kind = "sobol"
points = 8
[vary]
plant.damping.xx = { relative = 0.1 }
plant."stiffness.xx" = { relative = 0.1 }
"plant.angular_rate" = { low = -200.0, high = 200.0 }
controller.layer = ["linear", "quadratic"]
"""
TUNING = """
seeds = [1, 2]
[vary]
controller.layer_thickness = { low = 0.01, high = 1.0, scale = "log" }
[tune]
trials = 10
[[objective]]
metric = "rmse_steady_x"
statistic = "quantile 0.95"
[[constraint]]
metric = "chattering_x"
at_most_base = 1.1
"""


def expect_refused(kind: Kind, good: str, bad: str, read: Callable[[Path], object], folder: Path) -> None:
    """Rejected by both the software and the editor, which both accept the good text."""
    file = folder / "file.toml"
    file.write_text(good)
    read(file)
    file.write_text(bad)
    with pytest.raises(fg.ScenarioError):
        read(file)
    assert refused(kind, [good, bad], folder) == [False, True]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("seeds = 4", "seeds = 0"),
        ("seeds = 4", "seeds = [1, 1]"),
        ("seeds = 4", 'seeds = "4"'),
        ("chattering_x", "chatter"),
        ('show = ["chattering_x"]', "show = []"),
        ("= 2.0", "= -2.0"),
        ("= 0.8", "= 1.8"),
        ("controller.order", "controller.ordr"),
        ('"sobol"', '"halton"'),
        ("points = 8", "points = 8.0"),
        ("relative = 0.1", "relative = 0.0"),
        ("low = -200.0", "lo = -200.0"),
        ('["linear", "quadratic"]', '["cubic"]'),
        ('["linear", "quadratic"]', "[]"),
        ('["linear", "quadratic"]', "{ low = 0.0, high = 1.0 }"),
        ("plant.damping.xx", "plant.damping"),
        ("seeds", "seed"),
    ],
)
def test_what_a_sweep_refuses_is_refused(old: str, new: str, tmp_path: Path) -> None:
    expect_refused("study", STUDY, without(STUDY, old, new), read_plan, tmp_path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("quantile 0.95", "quantile"),
        ("quantile 0.95", "quantile half"),
        ("rmse_steady_x", "rmse"),
        ("at_most_base = 1.1", ""),
        ("at_most_base = 1.1", "at_most = 1.0\nat_most_base = 1.1"),
        ("trials = 10", "trials = 0"),
        ("[[objective]]", "[[objectives]]"),
        ("seeds = [1, 2]", "seeds = [-1]"),
    ],
)
def test_what_a_tuning_refuses_is_refused(old: str, new: str, tmp_path: Path) -> None:
    expect_refused("tuning", TUNING, without(TUNING, old, new), read_tuning, tmp_path)


def test_a_misspelt_field_is_refused(tmp_path: Path) -> None:
    texts = ["[controller]\nordr = 0.9\n", "[controler]\norder = 0.9\n", "[plant.damping]\nxx = 1.0\n"]
    assert refused("scenario", texts, tmp_path) == [True, True, True]


def test_the_line_for_the_editor_may_follow_the_first_of_a_scenario(tmp_path: Path) -> None:
    first, rest = fg.Scenario.paper().to_toml().split("\n", 1)
    text = f"{first}\n#:schema ./fracgyro.schema.json\n{rest}"
    assert fg.Scenario.from_toml(text) == fg.Scenario.paper()
    with pytest.raises(fg.ScenarioError, match="cut off"):
        fg.Scenario.from_toml(text[:-20])
    need("editor")
    (tmp_path / "fracgyro.schema.json").write_text(json.dumps(fg.schema("scenario")))
    file = tmp_path / "my.toml"
    for changed, code in ((text, 0), (without(text, "order = 0.9", "order = 1.9"), 1)):
        file.write_text(changed)
        assert subprocess.run([TAPLO, "lint", file], cwd=tmp_path, capture_output=True).returncode == code


def test_another_kind_of_file_has_no_schema() -> None:
    with pytest.raises(fg.ScenarioError, match=r"kind is .*tune.*: it must be one of scenario, study, tuning"):
        fg.schema(cast(Any, "tune"))
