"""Study files: varied fields, visited points, and input refused before anything runs."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fracgyro as fg
import fracgyro_lab as lab
import numpy as np
import pytest
from fracgyro.scenario import ScenarioError
from fracgyro.study.file import base_scenario
from fracgyro.study.folder import locked
from fracgyro.study.space import Dimension, flat, read_space
from fracgyro.study.sweep.blocks import blocks
from fracgyro.study.sweep.design import Plan, read_plan

PAPER = fg.Scenario.paper()
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "studies"


def plan(tmp_path: Path, text: str) -> Plan:
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return read_plan(tmp_path / "study.toml")


def dimension(**entry: Any) -> Dimension:
    (found,) = read_space({"controller.order": entry}, PAPER)
    return found


# -- Space ---------------------------------------------------------------------------------------------------


def test_a_range_is_uniform_from_low_to_high() -> None:
    order = dimension(low=0.2, high=0.6)
    assert [order.at(u) for u in (0.0, 0.25, 0.5)] == pytest.approx([0.2, 0.3, 0.4])
    assert order.at(np.nextafter(1.0, 0.0)) <= 0.6


def test_a_logarithmic_range_has_its_geometric_mean_in_the_middle() -> None:
    (gain,) = read_space({"adaptation.rate_gain": {"low": 1.0, "high": 100.0, "scale": "log", "steps": 3}}, PAPER)
    assert gain.at(0.5) == pytest.approx(10.0)
    assert gain.grid() == (1.0, 10.0, 100.0)


def test_an_integer_range_gives_every_integer_the_same_share() -> None:
    (every,) = read_space({"run.record_every": {"low": 1, "high": 4, "steps": 2}}, PAPER)
    values = [every.at((i + 0.5) / 400) for i in range(400)]
    assert {v: values.count(v) for v in set(values)} == {1: 100, 2: 100, 3: 100, 4: 100}
    assert all(type(v) is int for v in [*values, *every.grid()])


def test_a_relative_range_lies_about_the_value_of_the_base_scenario() -> None:
    base = PAPER.replace({"plant.angular_rate": -50.0})
    (rate,) = read_space({"plant": {"angular_rate": {"relative": 0.1}}}, base)
    assert (rate.low, rate.high) == pytest.approx((-55.0, -45.0))


def test_choices_get_equal_shares_and_are_what_the_field_holds() -> None:
    kind, gain = read_space(
        {"controller.kind": ["linear", "fractional"], "controller.fractional_gain": [5, [1.0, 2.0]]}, PAPER
    )
    assert [kind.at(u) for u in (0.0, 0.49, 0.51, 0.99)] == ["linear", "linear", "fractional", "fractional"]
    assert gain.choices == ((5.0, 5.0), (1.0, 2.0))


def test_grid_values_are_the_decimal_numbers_that_one_writes() -> None:
    assert dimension(low=0.1, high=1.0, steps=10).grid() == (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def test_fields_may_be_quoted_or_written_as_tables() -> None:
    assert flat({"run": {"duration": 1.0}, "plant": {"damping": {"xx": 2.0}}, "controller.order": 0.5}) == {
        "run.duration": 1.0,
        "plant.damping.xx": 2.0,
        "controller.order": 0.5,
    }


def test_a_base_scenario_is_named_or_a_file_beside_the_study(tmp_path: Path) -> None:
    assert base_scenario("paper", tmp_path, {}) == PAPER
    assert base_scenario("paper-printed", tmp_path, {}) == fg.Scenario.paper("printed")
    PAPER.replace({"controller.order": 0.4}).save(tmp_path / "mine.toml")
    assert base_scenario("mine.toml", tmp_path, {"run": {"duration": 3.0}}) == PAPER.replace(
        {"controller.order": 0.4, "run.duration": 3.0}
    )


# -- Designs -------------------------------------------------------------------------------------------------

PAIR = "[vary]\ncontroller.order = [0.3, 0.6]\ncontroller.terminal_exponent = { low = 0.2, high = 0.8, steps = 2 }\n"
RANGES = "[vary]\ncontroller.order = { low = 0.2, high = 0.8 }\nplant.angular_rate = { low = -100.0, high = 100.0 }\n"
INDICES = '[design]\nkind = "sobol_indices"\n'


def test_a_grid_has_every_combination_the_last_field_fastest(tmp_path: Path) -> None:
    found = plan(tmp_path, "seeds = 3\n" + PAIR)
    assert list(found.points) == [(0.3, 0.2), (0.3, 0.8), (0.6, 0.2), (0.6, 0.8)]
    assert found.seeds == [0, 1, 2]
    assert found.scenario(2) == PAPER.replace({"controller.order": 0.6, "controller.terminal_exponent": 0.2})


def test_a_list_goes_row_by_row(tmp_path: Path) -> None:
    assert list(plan(tmp_path, PAIR + '[design]\nkind = "list"').points) == [(0.3, 0.2), (0.6, 0.8)]


@pytest.mark.parametrize("kind", ["random", "latin_hypercube", "sobol"])
def test_a_sample_stays_inside_and_depends_on_its_seed_alone(tmp_path: Path, kind: str) -> None:
    def points(seed: int) -> np.ndarray:
        return np.array(plan(tmp_path, f'{RANGES}[design]\nkind = "{kind}"\npoints = 64\nseed = {seed}').points)

    first = points(1)
    assert (first == points(1)).all()
    assert (first != points(2)).any()
    unit = (first - [0.2, -100.0]) / [0.6, 200.0]
    assert ((unit >= 0) & (unit <= 1)).all()
    if kind != "random":  # one point in each of 64 stripes, along either field
        for column in unit.T:
            assert sorted(np.floor(column * 64).astype(int)) == list(range(64))


def test_without_seeds_the_scenarios_own_is_run(tmp_path: Path) -> None:
    assert plan(tmp_path, "[fixed]\ndisturbance.seed = 7\n" + PAIR).seeds == [7]


def test_blocks_cover_every_run_once_in_order(tmp_path: Path) -> None:
    for seeds, duration in ((3, 8000.0), (9000, 1.0), (1, 1.0)):
        found = plan(tmp_path, f"seeds = {seeds}\n[fixed]\nrun.duration = {duration}\nrun.step = 0.01\n"
                     "disturbance.hold = 0.01\n" + PAIR)  # fmt: skip
        keys = [block.keys() for block in blocks(found)]
        runs = [pair for k in keys for pair in zip(k["point"].to_pylist(), k["seed"].to_pylist(), strict=True)]
        assert runs == list(itertools.product(range(4), range(seeds)))
        assert keys[0]["controller.order"][0].as_py() == 0.3


@pytest.mark.parametrize(("seeds", "duration", "runs"), [(9000, 1.0, 4096), (900, 8000.0, 25)])
def test_a_kill_costs_at_most_20_million_steps_or_4096_runs(
    tmp_path: Path, seeds: int, duration: float, runs: int
) -> None:
    fixed = f"[fixed]\nrun.duration = {duration}\nrun.step = 0.01\ndisturbance.hold = 0.01\n"
    work = blocks(plan(tmp_path, f"seeds = {seeds}\n{fixed}{PAIR}"))
    assert max(block.runs for block in work) == runs


# -- Refused input -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "[vary]\ncontroller.order = { low = 0.1, high = 0.9, steps = 2147483648 }",
            "steps is 2147483648: it must lie between 2 and 1000000",
        ),
        ("show = [[1.0]]", "show has [1.0], which is not a known metric"),
        ("show = [{}]", "show has {}, which is not a known metric"),
        ("show = [1979-05-27]", "show has 1979-05-27, which is not a known metric"),
        ("[vary]\nrun.record_every = [99999999999999999999]", "vary.run.record_every[0] is an integer of more than 64"),
        ("seeds = [" + "9" * 5000 + "]", "line 1 has an integer of more than 64 bits"),
        ("fixed = " + "[" * 40 + "]" * 40, "is nested too deeply"),
        ("fixed = " + "{a = " * 400 + "}" * 400, "nested too deeply"),
        ("[vary", "is not valid TOML"),
        ("[varry]", "varry is not a known field; did you mean vary?"),
        ("seeds = 0", "seeds is 0: it must be their number, from 1 to 1000000, or a list of different integers"),
        ("seeds = [1, 1]", "seeds is [1, 1]: it must be"),
        ("seeds = true", "seeds is true: it must be"),
        ('show = ["rmse_stedy_x"]', 'show has "rmse_stedy_x", which is not a known metric; did you mean rmse_steady'),
        ("[design]\npoint = 3", "design.point is not a known field; did you mean design.points?"),
        ('[design]\nkind = "sobool"', '"sobool": it must be grid, list, random, latin_hypercube, sobol or'),
        ("[metrics]\ntransient = -1.0", "metrics.transient is -1.0: it must be greater than 0"),
        ('scenario = "nowhere.toml"', "nowhere.toml cannot be read: No such file"),
        ("[fixed]\ncontroller.oder = 0.5", "controller.oder is not a known field; did you mean controller.order?"),
        ("[fixed]\ncontroller.order = 1.5", "controller.order is 1.5: it must lie between 0 and 1"),
        ("[fixed]\ncontroller.order = 0.5\n[vary]\ncontroller.order = [0.6]", "is in [fixed] and in [vary]"),
        ("fixed = 3", "fixed is 3: it must be a table"),
        ("title = 3", "title is 3: it must be text in quotes"),
        ("[vary]\ncontroller.oder = [0.5]", "controller.oder is not a known field; did you mean controller.order?"),
        ("[vary]\ncontroller.order = 0.5", "controller.order is 0.5: it must be a list of values or"),
        ("[vary]\ncontroller.order = []", "controller.order is []: it must have at least one value"),
        ("[vary]\ncontroller.order = [0.5, 2]", "controller.order is 2: it must lie between 0 and 1"),
        ("[vary]\ncontroller.order = { low = 0.5 }", "{low = 0.5}: it must have low and high, or relative"),
        ("[vary]\ncontroller.order = { low = 0.5, high = 0.4 }", "low is 0.5: it must be less than high, which is 0.4"),
        ("[vary]\ncontroller.order = { low = 0.5, high = 1.4 }", "controller.order is 1.4: it must lie between"),
        ("[vary]\ncontroller.order = { lo = 0.5 }", "controller.order: lo is not a known field; did you mean low?"),
        ("[vary]\ncontroller.order = { low = 0.0, high = 1.0, scale = \"log\" }", "low is 0.0: it must be greater"),
        ("[vary]\ncontroller.order = { relative = 0.1, low = 0.1 }", "it must have either low and high or relative"),
        ("[vary]\nplant.damping_deviation.xx = { relative = 0.1 }", "the base value must be a number other than 0"),
        ("[vary]\ncontroller.kind = { low = 0.1, high = 1.0 }", "controller.kind is 0.1: it must be fractional_fast"),
        ("[vary]\nplant.damping = { relative = 0.1 }", "plant.damping.relative is not a known field"),
        ('[vary]\ncontroller.order = [0.1]\n"controller.order" = [0.1]', "controller.order is given twice"),
        ("[vary]\ndisturbance.seed = [1, 2]", "disturbance.seed is in [vary]: use seeds"),
        ("[vary]\ncontroller.order = { low = 0.1, high = 1.0 }", "controller.order: steps is missing"),
        (PAIR + "[design]\npoints = 4", 'design.points is 4: it must be left out when design.kind is "grid"'),
        (PAIR + '[design]\nkind = "random"\npoints = 4', "terminal_exponent: steps is 2: it must be left out"),
        (RANGES + '[design]\nkind = "random"', 'design.points is missing: "random" must have a number of points'),
        (RANGES + '[design]\nkind = "sobol"\npoints = 100', "a Sobol design must have a power of 2, such as 128"),
        (RANGES + INDICES + "points = 100", "design.points is 100: a Sobol design must have a power of 2, such as 128"),
        (RANGES + INDICES + "points = 8", "design.points is 8: it must be from 16 to 250000 for Sobol indices"),
        (RANGES + INDICES + "points = 262144", "262144: it must be from 16 to 250000 for Sobol indices, which need 4 "),
        (RANGES + INDICES, 'design.points is missing: "sobol_indices" must have a number of points'),
        (PAIR + INDICES + "points = 16", "terminal_exponent: steps is 2: it must be left out"),
        (INDICES + "points = 16", "vary is empty: at least one field must vary when design.kind is sobol_indices"),
        ('[design]\nkind = "list"', "vary is empty: at least one field must vary"),
        (PAIR.replace("0.6]", "0.6, 0.7]") + '[design]\nkind = "list"', "has 2 values: it must have 3"),
        ('seeds = 2\n[fixed]\ndisturbance.kind = "none"\n' + PAIR, "it must be one seed, as no result"),
        ("[vary]\n" + "".join(f"plant.{m}.{e} = {{ relative = 0.1, steps = 11 }}\n"
         for m in ("damping", "stiffness") for e in ("xx", "xy", "yy")), "the grid has 1771561 points: it must have"),
    ],
)  # fmt: skip
def test_a_bad_study_is_refused_in_one_sentence(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(ScenarioError) as refusal:
        plan(tmp_path, text)
    assert expected in str(refusal.value)
    assert "\n" not in str(refusal.value).removeprefix(str(tmp_path))


def test_a_value_in_a_sentence_is_cut_short(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as refusal:
        plan(tmp_path, 'seeds = 1000000\n[fixed]\ndisturbance.kind = "none"\n')
    assert "seeds is [0, 1, 2, " in str(refusal.value)
    assert len(str(refusal.value)) < 300


def test_a_point_that_cannot_run_is_named_before_anything_runs(tmp_path: Path) -> None:
    text = "[vary]\nplant.stiffness.xx = [60.0, 1.0]\nplant.stiffness.xy = [10.0, 20.0]\n"
    with pytest.raises(ScenarioError, match=r"^point 2 \(plant\.stiffness\.xx = 1\.0, plant\.stiffness\.xy = 10\.0\)"):
        plan(tmp_path, text)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_example_takes_a_minute_at_most(path: Path) -> None:
    found = read_plan(path)
    steps = sum(found.scenario(i).run.steps for i in range(len(found.points))) * len(found.seeds)
    assert steps * 100e-9 < 60


@pytest.mark.parametrize("work", ["sweep", "tune", "compare"])
def test_two_at_once_in_one_folder_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, work: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sweep.toml").write_text("vary.controller.order = [0.8, 0.9]\n", encoding="utf-8")
    tuned = "vary.controller.order = { low = 0.8, high = 0.9 }\nobjective = [{ metric = 'effort_x' }]\n"
    Path("tune.toml").write_text(tuned, encoding="utf-8")
    begin: dict[str, Callable[[], object]] = {
        "sweep": lambda: fg.study.sweep("sweep.toml", "out"),
        "tune": lambda: fg.study.tune("tune.toml", "out"),
        "compare": lambda: lab.compare("track", "out", only=["pid"], quick=True),
    }
    with (
        locked(Path("out")),
        pytest.raises(fg.ScenarioError, match=r"^out is in use by a study in another process"),
    ):
        begin[work]()
    assert not Path("out").exists(), "a folder that was made for nothing"
