"""`fracgyro compare`: the contenders and their settings, resuming after a kill, and the report."""

from __future__ import annotations

import json
import math
import re
import signal
from hashlib import sha256
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from children import run_until
from command_server import fracgyro
from figure_data import column, figure_data
from fracgyro.scenario.device_core import device_values
from fracgyro.scenario.schema import ZERO
from fracgyro.scenario.to_core import core_numbers
from fracgyro.study.space import value_of
from fracgyro.study.tune.criteria import Measured, measure
from fracgyro_lab.comparison.contender import Contender, Gain
from fracgyro_lab.comparison.own import own_contender
from fracgyro_lab.comparison.plan import FIRST_HELD_OUT, FULL, QUICK, planned
from fracgyro_lab.comparison.rate import Rate
from fracgyro_lab.comparison.rows import Tuned, front, made, median_of, other, ratio, verdict
from fracgyro_lab.comparison.run import Compared, compare
from fracgyro_lab.comparison.task import Cell, sensed
from fracgyro_lab.comparison.track import Track

TRACK = Track()
PAPER = TRACK.scenarios()["paper"]
COMPARE = "fracgyro_lab.comparison.run", "compare"
SMALL: dict[str, Any] = {"only": ["paper", "pid"], "classes": ["F"], "noise": [0.0], "trials": 4, "quick": True}
WORDS = ["--only", "paper,pid", "--class", "F", "--noise", "0", "--trials", "4", "--quick"]
METRICS = [*(f"rmse_{window}_{axis}" for window in ("steady", "transient") for axis in "xy"), "chattering_x"]

MINE = '''
"""PD with feedforward of the reference's acceleration."""


class MyController:
    ranges = {"kp": (1e3, 1e5), "kd": (10.0, 500.0), "offset": (-1.0, 1.0)}

    def __init__(self, kp, kd, offset):
        self.kp, self.kd, self.offset = kp, kd, offset

    def __call__(self, s):
        return tuple(
            s.reference_acceleration[i] - self.kp * (s.position[i] - s.reference[i])
            - self.kd * (s.velocity[i] - s.reference_velocity[i]) + self.offset
            for i in range(2)
        )
'''


def sentence(*words: str | Path) -> str:
    ran = fracgyro("compare", *words)
    assert ran.returncode == 2, ran
    (line,) = ran.stderr.splitlines()
    return line.removeprefix("fracgyro: ")


def plan(**options: Any) -> Any:
    given = {"scenarios": (), "only": (), "classes": (), "noise": (), "controller": None, "trials": None}
    return planned("track", **{**given, "quick": False, "storage": None, **options})


def without_cost(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    for row in found["contenders"]:
        del row["cost"]  # which is measured time
    return found


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Compared:
    done: list[float] = []
    folder = tmp_path_factory.mktemp("compare")
    result = compare("track", folder / "out", **SMALL, progress=lambda now, total, _: done.append(now / total))
    assert done == sorted(done), "progress goes forward"
    assert done[-1] == pytest.approx(1.0)
    return result


# -- Contenders ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("contender", "information"),
    [pytest.param(c, information, id=f"{c.name}-{information}") for c in TRACK.contenders for information in c.classes],
)
def test_every_contender_is_a_scenario_at_both_ends_of_every_range(contender: Contender, information: str) -> None:
    base = sensed(PAPER, information, 1e-13)
    gains = contender.tuned(information)
    assert len(gains) <= 8
    for end in ("low", "high"):
        values = {gain.field: getattr(gain, end) for gain in gains}
        mine = contender.scenario(base, values)
        for gain in gains:
            for field, held in gain.changes(values).items():
                found = value_of(field, mine)
                assert found in (held, (held, held)), field


def test_all_contenders_have_the_same_task_but_for_their_own_tables() -> None:
    base = sensed(PAPER, "F", 1e-13)
    for contender in TRACK.contenders:
        mine = contender.scenario(base)
        for table in ("plant", "reference", "disturbance", "rate", "device", "run", "datasheet"):
            assert getattr(mine, table) == getattr(base, table), (contender.name, table)
        assert mine.controller.force_limit == 1000.0
        nominal = {n: v for n, v in core_numbers(mine).items() if n.startswith(("adaptation.initial_", "reference."))}
        of_plant = {n: v for n, v in nominal.items() if "bound" not in n}
        assert of_plant == {n: v for n, v in core_numbers(base).items() if n in of_plant}, contender.name


def test_positions_only_means_no_velocity_and_the_noise_is_the_same_on_what_is_measured() -> None:
    full, positions = sensed(PAPER, "F", 1e-13), sensed(PAPER, "P", 1e-13)
    assert (full.device.sensing, positions.device.sensing) == ("full", "position")
    # 1e-13 m/sqrt(Hz), one-sided, at 1 MHz over q0 = 1 um.
    sigma = 1e-13 * math.sqrt(0.5e6) / 1e-6
    assert device_values(full)["position_noise"] == pytest.approx(sigma)
    assert device_values(full)["velocity_noise"] == pytest.approx(sigma)
    assert device_values(positions)["position_noise"] == pytest.approx(sigma)
    assert device_values(positions)["velocity_noise"] == 0.0


def test_an_observer_is_tuned_where_one_is_needed_and_nowhere_else() -> None:
    fields = {
        (c.name, of): "controller.observer_bandwidth" in [gain.field for gain in c.tuned(of)]
        for c in TRACK.contenders
        for of in ("F", "P")
    }
    assert fields["pid", "P"]
    assert fields["paper", "P"]
    assert not fields["paper_joint", "P"], "its filter needs no velocity"
    assert not any(found for (_, information), found in fields.items() if information == "F")
    assert not fields["paper_as_published", "P"], "it runs as it is"


def test_every_contender_has_the_same_effort_and_no_seed_of_training_judges() -> None:
    whole = plan()
    assert (FULL.trials, FULL.seeds, FULL.samplers, FULL.held_out) == (200, 8, 3, 100)
    for row in whole.rows():
        tunings = whole.tunings(row)
        assert [t.sampler for t in tunings] == ([1, 2, 3] if row.contender.gains else [])
        assert {(t.trials, tuple(t.seeds)) for t in tunings} <= {(200, tuple(range(8)))}
        judging = whole.judging(row, {})
        assert min(judging.seeds) == 10_000
        assert len(judging.seeds) == 100
    assert len({row.name for row in whole.rows()}) == len(whole.rows())


def test_a_tuning_starts_from_no_known_gains_and_goes_by_one_number() -> None:
    (row, *_) = plan(only=["pid"]).rows()
    tuning = plan().tunings(row)[0]
    first = [tuning._plan(TRACK.constraints(ceiling)) for ceiling in (0.0035, 0.05)]
    assert all(p.base_values() is None and p.joined for p in first)
    assert first[0].hash != first[1].hash, "or one database could not hold both"


def test_a_best_value_near_the_end_of_its_range_is_flagged_unless_the_end_has_a_reason() -> None:
    gain = Gain("controller.surface_gain", 1.0, 100.0)
    assert [gain.at_end(value) for value in (1.0, 1.2, 1.3, 10.0, 79.0, 80.0, 100.0)] == [
        *(True, True, False),
        *(False, False, True, True),
    ]
    layer = Gain("controller.layer_thickness", 0.1, 1.0)
    rho = Gain("adaptation.initial_bound", 1.0, 9.0, shape=(1.0, 0.0, 0.5), times=layer.field)
    assert rho.changes({layer.field: 0.5, rho.field: 4.0}) == {rho.field: (2.0, 0.0, 1.0)}
    linear = Gain("controller.order", 0.0, 1.0, log=False)
    assert [linear.at_end(value) for value in (0.04, 0.06, 0.94, 0.96)] == [True, False, False, True]
    limited = Gain("controller.order", 0.0, 1.0, log=False, above="by definition")
    assert [limited.at_end(value) for value in (0.01, 0.99)] == [True, False]
    limited = Gain("controller.order", 0.0, 1.0, log=False, below="by definition")
    assert [limited.at_end(value) for value in (0.01, 0.99)] == [False, True]


# -- Criteria ------------------------------------------------------------------------------------------------


def test_the_error_is_the_mean_logarithm_of_the_four_and_infinite_where_a_run_diverged() -> None:
    names = ("rmse_steady_x", "rmse_steady_y", "rmse_transient_x", "rmse_transient_y")
    metrics = {name: np.array([10.0**-i, 1.0, np.nan]) for i, name in enumerate(names)}
    found = TRACK.error(Measured(metrics, np.array([False, False, True])))
    assert found[:2] == pytest.approx([-1.5 * math.log(10), 0.0])
    assert found[2] == math.inf


def test_ratios_are_paired_by_seed_and_have_no_value_where_a_run_diverged() -> None:
    theirs = np.random.default_rng(1).normal(size=50)  # far more from seed to seed than between the two
    found = ratio(theirs + math.log(2), theirs)
    assert [found["value"], found["low"], found["high"]] == pytest.approx([2.0, 2.0, 2.0])
    assert ratio(np.array([0.0, np.inf]), np.zeros(2)) == {"value": None, "low": None, "high": None}
    assert ratio(np.zeros(2), np.array([0.0, np.inf]))["value"] is None
    wide = ratio(np.array([1.0, -1.0, 1.0, -1.0]), np.zeros(4))
    assert wide["low"] is not None
    assert wide["high"] is not None
    assert wide["low"] < 1.0 < wide["high"]


def test_of_three_samplers_the_median_counts() -> None:
    results = [{"best": {"a": i}, "error": e, "trials": []} for i, e in enumerate([3.0, 1.0, 2.0])]
    assert median_of(results).values == {"a": 2}
    assert median_of([*results[:1], {"best": None, "error": None, "trials": []}, results[1]]).values == {"a": 0}
    five = [{"best": {"a": i}, "error": float(i), "trials": []} for i in range(5)]
    assert median_of(five).values == {"a": 2}
    lost = {"best": None, "error": None, "trials": []}
    assert median_of([lost, results[0], lost]).values is None, "most samplers found nothing"


def test_an_error_is_less_or_more_only_where_all_tunings_agree() -> None:
    def row(value: float, low: float, high: float, samplers: list[float | None], kept: bool = True) -> dict[str, Any]:
        ratio = {"value": value, "low": low, "high": high}
        return {"ratio": ratio, "kept": kept, "sampler_errors": samplers, "metrics": {"error": {"value": value}}}

    theirs = row(1.0, 1.0, 1.0, [1.0, 1.2, 0.9])
    assert verdict(row(0.5, 0.4, 0.6, [0.5, 0.6, 0.8]), theirs) == "less"
    assert verdict(row(0.5, 0.4, 0.6, [0.5, 0.6, 0.95]), theirs) == "undecided", (
        "one tuning is worse than one of theirs"
    )
    assert verdict(row(0.5, 0.4, 0.6, [0.5, 0.6, None]), theirs) == "undecided", "one found nothing"
    assert verdict(row(0.5, 0.4, 1.1, [0.5, 0.6, 0.8]), theirs) == "undecided"
    assert verdict(row(2.0, 1.5, 2.5, [1.3, 2.0, None]), theirs) == "more"
    assert verdict(row(2.0, 1.5, 2.5, [1.1, 2.0, 3.0]), theirs) == "undecided"
    assert verdict(row(2.0, 1.0, 2.5, [2.0]), theirs) == "undecided", "1 is in the interval"
    assert verdict(row(2.0, 1.5, 2.5, [1.2, 2.0]), theirs) == "undecided", "one is as good as the worst of theirs"
    assert verdict(row(2.0, 1.5, 2.5, []), theirs) == "more", "what is not tuned has its own error"
    assert verdict(row(0.5, 0.4, 0.6, [0.5], kept=False), theirs) is None
    assert verdict({"ratio": None}, theirs) is None


def test_a_run_with_an_error_as_large_as_the_reference_is_lost() -> None:
    base = np.full(4, math.log(1e-3))
    with_change = np.array([math.log(1e-3), math.log(0.9), math.log(1.1), math.inf])
    assert other(TRACK, base, with_change)["lost"] == 2
    assert other(Rate(), base, with_change)["lost"] == 1


def test_nothing_is_a_multiple_of_what_breaks_a_limit() -> None:
    whole = plan(only=["paper", "pid"], classes=["F"], noise=[0.0])
    errors: dict[str, Any] = {"error": [0.0, 0.1], "diverged": 0, "others": {}}
    names = [row.name for row in whole.rows()]
    tuned = {name: Tuned({}, [0.0], []) for name in names}

    def judged(chattering: float) -> dict[str, Any]:
        return {**errors, "metrics": {axis: [chattering] * 2 for axis in ("chattering_x", "chattering_y")}}

    kept = made(whole, tuned, dict.fromkeys(names, judged(0.001)))
    assert all(row["ratio"] for row in kept.values())
    assert {row["verdict"] for row in kept.values() if row["name"] == "paper"} == {None}
    assert {row["verdict"] for row in kept.values() if row["name"] == "pid"} == {"undecided"}
    hasty = plan(only=["paper", "pid"], classes=["F"], noise=[0.0], quick=True)
    of_none = made(hasty, tuned, dict.fromkeys(names, judged(0.001))).values()
    assert {row["verdict"] for row in of_none} == {None}, "nothing was tuned"
    assert {row["seeds"] for row in made(whole, tuned, {}).values()} == {0}
    above = {name: judged(1.0 if name.startswith("paper") else 0.001) for name in names}
    assert not any(row["ratio"] or row["verdict"] for row in made(whole, tuned, above).values())


def test_the_front_is_what_no_trial_beats_in_error_and_chattering() -> None:
    trials = [[0.0, 1.0, True], [1.0, 0.5, False], [2.0, 0.7, True], [None, None, False], [0.0, 2.0, True]]
    assert front(trials) == [[0.5, pytest.approx(math.e)], [1.0, 1.0]]


def test_another_plant_changes_the_truth_and_nothing_that_a_contender_knows() -> None:
    base = sensed(PAPER, "F", 1e-13)
    known = {n: v for n, v in core_numbers(base).items() if n.startswith(("adaptation.", "datasheet."))}
    seen = set()
    for name, change in TRACK.plants(base).items():
        other = base.replace(change)
        numbers = core_numbers(other)
        if "noise" not in name:  # whose density all know
            assert {n: numbers[n] for n in known} == known, name
        seen.add(other.content_hash())
        assert other != base
    assert len(seen) == len(TRACK.plants(base)) == 17
    stiffer = base.replace(TRACK.plants(base)["K +5 %"]).plant
    assert stiffer.stiffness_deviation.entries() == pytest.approx(0.05 * base.plant.stiffness.entries())
    wider = base.replace(TRACK.plants(base)["split +20 %"]).plant
    before = np.sqrt(base.plant.stiffness.entries()[[0, 2]] / base.plant.mass)
    total = base.plant.stiffness.entries() + wider.stiffness_deviation.entries()
    after = np.sqrt(total[[0, 2]] / base.plant.mass)
    assert after[1] - after[0] == pytest.approx(1.2 * (before[1] - before[0]))
    assert base.plant.stiffness_deviation == ZERO


def test_a_hidden_delay_is_hidden_from_those_who_would_use_it() -> None:
    base = sensed(PAPER, "F", 1e-13)
    joint = base.replace({"adaptation.kind": "joint"})
    conditions = TRACK.conditions(joint)
    known, hidden = (joint.replace(conditions[n]) for n in ("one step of delay", "one step of hidden delay"))
    assert core_numbers(known)["datasheet.delay"] == 1.0
    assert core_numbers(hidden)["datasheet.delay"] == 0.0
    assert known.device == hidden.device
    pid = base.replace({"controller.kind": "pid"})
    of_pid = TRACK.conditions(pid)
    assert of_pid["one step of delay"] == of_pid["one step of hidden delay"]
    assert all(pid.replace(change) != pid for change in of_pid.values())


# -- A whole comparison --------------------------------------------------------------------------------------


def test_compare_json_has_what_others_rely_on(small: Compared) -> None:
    found = json.loads(small.data.read_text(encoding="utf-8"))
    assert found["task"] == "track"
    assert found["class"] == ["F"]
    assert found["noise"] == [0.0]
    assert [(row["name"], row["ceiling"]) for row in found["contenders"]] == [
        *(("paper", 0.0035), ("pid", 0.0035)),
        *(("paper", 0.05), ("pid", 0.05)),
    ]
    for row in found["contenders"]:
        assert row["tuned"] is False, "--quick tunes nothing"
        assert row["trials"] == 4
        if not row["metrics"]:
            continue
        assert len(row["gains"]) == {"paper": 9, "pid": 3}[row["name"]]
        assert row["diverged"] == 0
        assert row["seeds"] == QUICK.held_out
        for name in ("error", *METRICS):
            interval = row["metrics"][name]
            assert interval["low"] <= interval["value"] <= interval["high"]
        assert set(row["others"]) == {
            *TRACK.plants(PAPER),
            *TRACK.conditions(PAPER),
        }
        assert row["cost"]["ns_per_step"] > 0
        assert row["cost"]["state_bytes"] > 0
    assert [row["ratio"]["value"] for row in found["contenders"] if row["name"] == "paper" and row["metrics"]]
    assert {row["ratio"]["value"] for row in found["contenders"] if row["name"] == "paper" and row["ratio"]} == {1.0}


def test_the_numbers_behind_the_figures_are_those_of_compare_json(small: Compared) -> None:
    data = figure_data(small.report)
    assert list(data) == ["errors", "fronts", "robustness"]
    contenders = json.loads(small.data.read_text(encoding="utf-8"))["contenders"]
    found = {(row["table"].rpartition(" ")[2], row["contender"]): row for row in data["errors"]}
    error = "error (q0)"
    for row in contenders:
        shown = found[f"{row['ceiling']:g}", row["name"]]
        wanted = row["metrics"].get("error", {"value": None})["value"]
        assert shown[error] == ("" if wanted is None else f"{wanted:.9g}")
        assert shown["within the limits"] == str(row["kept"]).lower()
        assert shown[f"{error}: tuning 1, when trained"] == "".join(f"{e:.9g}" for e in row["sampler_errors"] if e)
    others = {(row["name"], what): of["value"] for row in contenders[2:] for what, of in row["others"].items()}
    ratio = "error over that without the change"
    shown = {(row["contender"], row["condition, plant or noise"]): row[ratio] for row in data["robustness"]}
    assert shown == {key: "" if value is None else f"{value:.9g}" for key, value in others.items()}
    points = [p for row in contenders if row["name"] == "pid" for p in row["front"]]
    pid = [row for row in data["fronts"] if row["contender"] == "pid"]
    assert min(column(pid, "error on the seeds of training (q0)")) == pytest.approx(min(e for _, e in points))
    assert min(column(pid, "chattering index, larger axis")) == pytest.approx(min(c for c, _ in points))


def test_the_gains_are_scenarios_that_give_the_numbers_again(small: Compared) -> None:
    files = sorted((small.data.parent / "gains").glob("*.toml"))
    rows = {f"{r['name']}-paper-F-0-{r['ceiling']:g}": r for r in small.rows if r["metrics"]}
    assert [path.stem for path in files] == sorted(rows)
    for path in files:
        scenario, row = fg.Scenario.load(path), rows[path.stem]
        assert ", untuned: by fracgyro" in path.read_text(encoding="utf-8")
        for field, held in row["gains"].items():
            assert value_of(field, scenario) in (held, (held, held)), field
        seeds = range(FIRST_HELD_OUT, FIRST_HELD_OUT + QUICK.held_out)
        (again,) = measure([scenario], seeds, {})
        for name in METRICS:
            assert again.metrics[name].mean() == pytest.approx(row["metrics"][name]["value"], rel=1e-6)


def test_a_comparison_killed_anywhere_goes_on_to_the_same_numbers(small: Compared, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    words = ["compare", "track", *WORDS, "--out", folder]
    killed = run_until("doing == 'judging'", signal.SIGKILL, *COMPARE, *words)
    assert killed.returncode == -signal.SIGKILL
    assert not (folder / "compare.json").exists()
    assert len(list((folder / "tunings").glob("*.json"))) == 4
    (folder / "tunings" / "pid-paper-F-0-0.05-1.json").unlink()
    resumed = compare("track", folder, **SMALL, resume=True)
    assert resumed.resumed == 3
    assert without_cost(resumed.data) == without_cost(small.data)


def test_an_interrupt_ends_in_one_sentence_and_leaves_whole_files(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    ran = run_until("done > 0", signal.SIGINT, *COMPARE, "compare", "track", *WORDS, "--out", folder)
    assert ran.returncode == 130, ran.stderr
    assert "Traceback" not in ran.stderr
    assert all(json.loads(path.read_text(encoding="utf-8")) for path in (folder / "tunings").glob("*.json"))


def test_a_damaged_result_is_computed_again_and_no_other(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    chosen: Any = {**SMALL, "only": ["pid"], "trials": 1}
    whole = compare("track", folder, **chosen)
    good = {path: path.read_bytes() for path in folder.glob("*ings/*.json")}
    (tuning,) = (folder / "tunings").glob("pid-*-0.05-1.json")
    (judging,) = (folder / "judgings").glob("pid-*-0.05.json")
    for path in (tuning, judging):
        for data in (b"[]", good[path].replace(b"1", b"2", 1)):
            path.write_bytes(data)
            resumed = compare("track", folder, **chosen, resume=True)
            assert resumed.resumed == len(good) - 1
            assert without_cost(resumed.data) == without_cost(whole.data)
            assert {path: path.read_bytes() for path in good} == good


def test_the_hashes_of_a_comparison_can_be_checked_with_sha256sum(small: Compared) -> None:
    lines = (small.data.parent / "finished.sha256").read_text(encoding="utf-8").splitlines()
    found = {line[66:]: line[:64] for line in lines}
    folder = small.data.parent
    files = {path.relative_to(folder).as_posix(): path for path in folder.glob("*ings/*.json")}
    assert found == {name: sha256(path.read_bytes()).hexdigest() for name, path in files.items()}


# -- A controller of one's own -------------------------------------------------------------------------------


def test_a_controller_of_ones_own_takes_part_with_the_same_effort(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE, encoding="utf-8")
    given = f"{tmp_path / 'mine.py'}:MyController"
    scales = {gain.field: (gain.low, gain.high, gain.log) for gain in own_contender(given, TRACK).gains}
    assert scales == {"law.kp": (1e3, 1e5, True), "law.kd": (10.0, 500.0, True), "law.offset": (-1.0, 1.0, False)}
    result = compare("track", tmp_path / "out", **{**SMALL, "only": ["MyController", "pid"]}, controller=given)
    mine = [row for row in result.rows if row["name"] == "MyController"]
    theirs = [row for row in result.rows if row["name"] == "pid"]
    assert [row["trials"] for row in mine] == [row["trials"] for row in theirs]
    assert any(row["metrics"] for row in mine)
    for row in mine:
        if row["metrics"]:
            assert set(row["gains"]) == {"law.kp", "law.kd", "law.offset"}
            assert 1e3 <= row["gains"]["law.kp"] <= 1e5
            assert row["diverged"] == 0
    (tmp_path / "mine.py").write_text(MINE.replace("500.0", "400.0"), encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match="differs in the contenders and the file of --controller"):
        compare("track", tmp_path / "out", **{**SMALL, "only": ["MyController", "pid"]}, controller=given, resume=True)


NATIVE = """
import numba
import fracgyro as fg

pointer = numba.types.CPointer(numba.types.double)


@numba.cfunc(numba.types.void(pointer, pointer, pointer, pointer))
def compiled(given, state, gains, out):
    for i in range(2):
        out[i] = given[9 + i] - gains[0] * (given[1 + i] - given[5 + i]) - gains[1] * (given[3 + i] - given[7 + i])


def law(kp, kd):
    return fg.native.Law(compiled, parameters={"kp": kp, "kd": kd})


law.ranges = {"kp": (1e3, 1e5), "kd": (10.0, 500.0)}
"""


def test_a_controller_of_ones_own_takes_part_whatever_else_does(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE, encoding="utf-8")
    both = plan(only=["paper"], controller=f"{tmp_path / 'mine.py'}:MyController")
    assert [contender.name for contender in both.contenders] == ["paper", "MyController"]


def test_a_native_law_takes_part_and_does_what_the_same_in_python_does(tmp_path: Path) -> None:
    pytest.importorskip("numba", reason="this Python has no Numba, which the test extra asks for up to 3.14")
    (tmp_path / "mine.py").write_text(
        MINE.replace(', "offset": (-1.0, 1.0)', "").replace("kd, offset)", "kd, offset=0)")
    )
    (tmp_path / "fast.py").write_text(NATIVE)
    names = {"MyController": "mine.py", "law": "fast.py"}
    found = []
    for name, file in names.items():
        given = f"{tmp_path / file}:{name}"
        rows = compare("track", tmp_path / name, **{**SMALL, "only": [name]}, controller=given).rows
        found.append([(row["gains"], row["sampler_errors"], row["others"]) for row in rows])
    assert found[0][1][0], "the looser ceiling is kept by some trial"
    for mine, fast in zip(*found, strict=True):
        assert mine[0] == fast[0]
        assert mine[1] == pytest.approx(fast[1], rel=1e-9)
        assert set(mine[2]) == set(fast[2])


@pytest.mark.parametrize(
    ("text", "given", "said"),
    [
        (MINE, "mine.py", "it must be FILE.py:NAME"),
        (MINE, "none.py:MyController", "cannot be read: No such file"),
        (MINE, "mine.py:Yours", "names Yours: it must be a class, a function or"),
        ("1 +", "mine.py:MyController", "cannot be run: SyntaxError"),
        (MINE.replace("ranges", "range"), "mine.py:MyController", "MyController.ranges is not set: it must be a dict"),
        (MINE.replace("(1e3, 1e5)", "(1e5, 1e3)"), "mine.py:MyController", "low must be less than high"),
        (MINE.replace("(1e3, 1e5)", "1e3"), "mine.py:MyController", "it must be (low, high), two finite numbers"),
        (MINE.replace("kp, kd, offset):", "kp, kd):"), "mine.py:MyController", "raised TypeError"),
        (MINE.replace("MyController", "paper"), "mine.py:paper", "a name that no contender of the task has"),
        (
            f"{MINE}\ndef law(kp):\n    return 3\n\nlaw.ranges = {{'kp': (1, 2)}}\n",
            "mine.py:law",
            "is 3: it must be a controller",
        ),
    ],
)
def test_what_is_no_controller_is_refused_in_one_sentence(tmp_path: Path, text: str, given: str, said: str) -> None:
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        compare("track", tmp_path / "out", **SMALL, controller=str(tmp_path / given))
    assert len(str(caught.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


# -- Bad input -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["walk"], 'the task is "walk": it must be track or rate'),
        (["track", "--only", "paper,lqr"], '--only is "lqr": it must be among paper, paper_as_published'),
        (["track", "--class", "Q"], '--class is "Q": it must be F, P or both, as in F,P'),
        (["track", "--only", "adrc", "--class", "F"], "together they must leave a contender"),
        (["track", "--noise", "1e-13,x"], "it must be numbers, as in 0,1e-13"),
        (["track", "--noise", "-1"], "--noise is -1.0: it must be finite and not negative"),
        (["track", "--trials", "0"], "--trials is 0: it must lie between 1 and 1000000"),
        (["track", "--storage", "nowhere://me@y/z"], "nowhere://y/z cannot be opened as a database"),
        (["track", "--storage", "nowhere://me:secret@y/z"], "--storage has a password, which every user"),
        (["track", "--storage", "nowhere://y/z?password=secret"], "--storage has a password"),
        (["track", "none.toml"], "none.toml cannot be read"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path: Path, words: list[str], said: str) -> None:
    line = sentence(*words, "--out", tmp_path / "out")
    assert said in line
    assert "secret" not in line
    assert not (tmp_path / "out").exists()


def test_a_scenario_whose_noise_has_no_seeds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "still.toml"
    fg.Scenario.paper().replace({"disturbance.kind": "none"}).save(path)
    with pytest.raises(fg.ScenarioError, match=r"disturbance\.kind is .*none.*: it must be noise"):
        compare("track", tmp_path / "out", scenarios=[path], **SMALL)


def test_cells_have_names_of_their_own() -> None:
    assert Cell("paper", "F", 1e-13, 0.0035).name == "paper-F-1e-13-0.0035"
    assert Cell("dual_mass", "P", 0.0, 0.0).name == "dual_mass-P-0"
