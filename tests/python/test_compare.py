"""`fracgyro compare`: the contenders and their settings, resuming after a kill, and the report."""

from __future__ import annotations

import importlib
import itertools
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
from browser import faults_of_report
from children import run_until
from command_server import fracgyro
from figure_data import column, figure_data
from fracgyro.scenario.device_core import device_values
from fracgyro.scenario.schema import ZERO
from fracgyro.scenario.to_core import core_numbers
from fracgyro.study.space import value_of
from fracgyro.study.tune.criteria import Measured, measure
from fracgyro_lab.comparison import limits
from fracgyro_lab.comparison.contender import Contained, Contender, Gain
from fracgyro_lab.comparison.converge import AGREED, Point, converged, search
from fracgyro_lab.comparison.own import own_contender
from fracgyro_lab.comparison.plan import FIRST_HELD_OUT, QUICK, planned
from fracgyro_lab.comparison.plots import Fronts
from fracgyro_lab.comparison.rate import Rate
from fracgyro_lab.comparison.report import limit_row, remarks
from fracgyro_lab.comparison.rows import Tuned, made, other, ratio, ratio_of, verdict
from fracgyro_lab.comparison.run import Compared, compare
from fracgyro_lab.comparison.task import Cell, sensed
from fracgyro_lab.comparison.track import HIGH, LOW, Track, sampled
from fracgyro_lab.comparison.track_contenders import LAYER as LAYER_RANGE
from fracgyro_lab.comparison.tuning import front

TRACK = Track()
PAPER = TRACK.scenarios()["paper"]
COMPARE = "fracgyro_lab.comparison.run", "compare"
SMALL: dict[str, Any] = {"only": ["paper", "pid"], "classes": ["F"], "noise": [0.0], "trials": 4, "quick": True}
WORDS = ["--only", "paper,pid", "--class", "F", "--noise", "0", "--trials", "4", "--quick"]
LAYER = "controller.layer_thickness"
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
    filtered = [c.name for c in TRACK.contenders if c.fixed.get("controller.filter") == "kalman"]
    assert {"paper_kalman", "resonant_kalman"} < set(filtered)
    assert [name for (name, information), found in fields.items() if found and information == "F"] == filtered
    assert not fields["paper_as_published", "P"], "it runs as it is"


def test_every_contender_has_the_same_effort_and_no_seed_of_training_judges() -> None:
    whole = plan()
    effort = whole.effort
    assert (effort.trials, effort.seeds, effort.search_seeds, effort.samplers) == (1200, 8, 2, 2)
    waves = whole.waves()
    tuned = [row for wave in waves for row in wave]
    assert sorted(row.name for row in tuned) == sorted(row.name for row in whole.rows if row.contender.gains)
    for row in tuned:
        tuning = whole.tuning(row, {})
        assert (tuning.trials, tuning.seeds, tuning.few, tuning.samplers) == (1200, list(range(8)), 2, 2)
        assert tuning.starts == (), "a start needs earlier results"
    for row in whole.rows[:3]:
        judging = whole.judging(row, {})
        assert min(judging.seeds) == 10_000
        assert len(judging.seeds) == 100
    assert len({row.name for row in whole.rows}) == len(whole.rows)


def test_special_cases_and_lower_ceilings_are_tuned_before_what_starts_from_them() -> None:
    whole = plan(only=["paper", "paper_integer_order", "linear"], classes=["F"], noise=[0.0])
    waves = [[row.name for row in wave if row.cell.scenario == "paper"] for wave in whole.waves()]
    assert waves == [
        ["linear-paper-F-0-0.0035"],
        ["paper_integer_order-paper-F-0-0.0035", "linear-paper-F-0-0.05"],
        ["paper-paper-F-0-0.0035", "paper_integer_order-paper-F-0-0.05"],
        ["paper-paper-F-0-0.05"],
    ]
    rows = {row.name: row for row in whole.rows}
    found = {
        "paper_integer_order-paper-F-0-0.05": {"controller.fractional_gain": 20.0, "adaptation.damping_gain": 3.0},
        "paper-paper-F-0-0.0035": {"controller.order": 0.4, "controller.fractional_gain": 2e6},
        "linear-paper-F-0-0.05": None,
    }
    integer, lower = whole.tuning(rows["paper-paper-F-0-0.05"], found).starts
    assert integer["controller.order"] == 1.0, "the integer order is that of the special case"
    assert integer["controller.fractional_gain"] == 20.0
    assert integer["adaptation.damping_gain"] == 3.0
    middle = (LAYER_RANGE.low * LAYER_RANGE.high) ** 0.5
    assert integer["controller.layer_thickness"] == pytest.approx(middle, rel=1e-3), "unknown: the middle"
    assert lower["controller.order"] == 0.4
    assert lower["controller.fractional_gain"] == 1e5, "values beyond a range are moved to its end"
    assert whole.tuning(rows["paper_integer_order-paper-F-0-0.05"], found).starts == ()


@pytest.mark.parametrize(
    ("mine", "contained"),
    [pytest.param(c, part, id=f"{c.name}-{part.name}") for c in TRACK.contenders for part in c.contains],
)
def test_a_law_at_the_gains_of_its_special_case_does_nearly_as_that_does(mine: Contender, contained: Contained) -> None:
    base = sensed(PAPER, "F", 1e-13)
    other_law = next(c for c in TRACK.contenders if c.name == contained.name)
    middle = {gain.field: gain.value(0.5) for gain in other_law.gains} | {LAYER: 0.5, "adaptation.initial_bound": 200.0}
    values = mine.started("F", contained, middle)
    scenarios = [other_law.scenario(base, middle), mine.scenario(base, values)]
    theirs, own = (TRACK.error(found)[0] for found in TRACK.measure(scenarios, [0], base, None))
    assert own == pytest.approx(theirs, abs=math.log(1.5)), "ranges whose end is nearly off"


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


def test_of_several_searches_the_best_counts_and_the_others_are_judged_too() -> None:
    searches = [{"best": {"a": i}, "error": e} for i, e in enumerate([3.0, 1.0, 2.0])]
    common: dict[str, Any] = {"trials": 30, "converged": False, "front": [[1.0, 2.0]]}
    found = Tuned.of({"samplers": searches, **common})
    assert (found.values, found.searched, found.errors) == ({"a": 1}, [{"a": 2}, {"a": 0}], [3.0, 1.0, 2.0])
    assert (found.trials, found.converged, found.front) == (30, False, [[1.0, 2.0]])
    lost = {"best": None, "error": None}
    found = Tuned.of({"samplers": [lost, searches[0]], **common})
    assert (found.values, found.searched) == ({"a": 0}, [])
    assert Tuned.of({"samplers": [lost, lost], **common}).values is None


def test_a_ratio_covers_all_pairs_of_searches() -> None:
    def judged(*errors: float) -> dict[str, Any]:
        first, *others = ([math.log(error)] * 4 for error in errors)
        return {"error": first, "searched": others}

    found = ratio_of(judged(2.0, 3.0), judged(4.0, 5.0), False, False)
    assert [found[end] for end in ("value", "low", "high")] == pytest.approx([0.5, 0.4, 0.75])
    assert ratio_of(judged(2.0), judged(4.0), True, False) == {"value": 0.5, "low": 0.5, "high": None}
    assert ratio_of(judged(2.0), judged(4.0), False, True) == {"value": 0.5, "low": None, "high": 0.5}
    diverged = ratio_of({"error": [0.0], "searched": [[math.inf]]}, judged(1.0), False, False)
    assert (diverged["value"], diverged["high"]) == (1.0, None)


def test_an_error_is_less_or_more_only_where_the_interval_of_all_searches_leaves_one_out() -> None:
    def row(low: float | None, high: float | None, kept: bool = True) -> dict[str, Any]:
        return {"ratio": {"value": 1.0, "low": low, "high": high}, "kept": kept}

    cases = [
        (row(0.5, 0.9), "less"),
        (row(1.1, 2.0), "more"),
        (row(0.9, 1.1), "undecided"),
        (row(0.5, 1.0), "undecided"),
    ]
    cases += [(row(0.5, None), "undecided"), (row(1.1, None), "more"), (row(None, 0.9), "less")]
    cases += [(row(None, None), "undecided"), (row(0.5, 0.9, kept=False), None), ({"ratio": None, "kept": True}, None)]
    for given, expected in cases:
        assert verdict(given) == expected, given


def test_a_run_with_an_error_as_large_as_the_reference_is_lost() -> None:
    base = np.full(4, math.log(1e-3))
    with_change = np.array([math.log(1e-3), math.log(0.9), math.log(1.1), math.inf])
    assert other(TRACK, base, with_change)["lost"] == 2
    assert other(Rate(), base, with_change)["lost"] == 1


def test_nothing_is_a_multiple_of_what_breaks_a_limit() -> None:
    whole = plan(only=["paper", "pid"], classes=["F"], noise=[0.0])
    errors: dict[str, Any] = {"error": [0.0, 0.1], "diverged": 0, "others": {}, "limited": {}, "searched": []}
    names = [row.name for row in whole.rows]
    tuned = {name: Tuned({}, [], [0.0], 10, True) for name in names}

    def judged(chattering: float) -> dict[str, Any]:
        return {**errors, "metrics": {axis: [chattering] * 2 for axis in ("chattering_x", "chattering_y")}}

    kept = made(whole, tuned, dict.fromkeys(names, judged(0.001)), [])
    assert all(row["ratio"] for row in kept.values())
    assert {row["verdict"] for row in kept.values() if row["name"] == "paper"} == {None}
    assert {row["verdict"] for row in kept.values() if row["name"] == "pid"} == {"undecided"}
    hasty = plan(only=["paper", "pid"], classes=["F"], noise=[0.0], quick=True)
    of_none = made(hasty, tuned, dict.fromkeys(names, judged(0.001)), []).values()
    assert {row["verdict"] for row in of_none} == {None}, "nothing was tuned"
    assert {row["seeds"] for row in made(whole, tuned, {}, []).values()} == {0}
    above = {name: judged(1.0 if name.startswith("paper") else 0.001) for name in names}
    assert not any(row["ratio"] or row["verdict"] for row in made(whole, tuned, above, []).values())


def test_what_has_not_converged_says_so_with_its_range() -> None:
    row = {
        "metrics": {"error": {}},
        "kept": True,
        "converged": False,
        "tuned": True,
        "range": [7e-4, 9.3e-4],
        "range_ends": [],
    }
    assert remarks(row) == "not converged: 0.0007 to 0.00093"
    assert remarks({**row, "converged": True}) == ""
    assert remarks({**row, "tuned": False}) == "", "nothing was tuned"
    assert remarks({**row, "range": None}) == "not converged"


def test_the_front_is_what_no_trial_beats_in_error_and_chattering() -> None:
    trials = [[0.0, 1.0], [1.0, 0.5], [2.0, 0.7], [None, None], [0.0, 2.0]]
    assert front(trials) == [[0.5, pytest.approx(math.e)], [1.0, 1.0]]


# -- Searches ------------------------------------------------------------------------------------------------


def bowl(point: Point) -> float:
    """A curved valley, ill-conditioned; its least value is -4."""
    weights = 10.0 ** np.linspace(0.0, 2.0, len(point))
    return float(np.log(math.exp(-4.0) + np.sum(weights * (point - 0.37) ** 2)))


@pytest.mark.parametrize("size", [1, 2, 4])
def test_searches_agree_on_the_minimum_and_few_gains_need_few_trials(size: int) -> None:
    found = search(lambda _, points: [bowl(point) for point in points], size, [], (1, 2), 1500)
    best = [sampler.best for sampler in found]
    assert converged(best)
    assert min(best) < -3.9
    assert max(sampler.trials for sampler in found) < {1: 100, 2: 250, 4: 1000}[size]


def test_searches_that_disagree_go_on_to_the_cap_and_say_so() -> None:
    """Every search has minima of its own, at 0 and 1."""
    found = search(lambda which, points: [which + bowl(point) for point in points], 2, [], (1, 2), 700)
    assert not converged([sampler.best for sampler in found])
    assert found[1].trials == 700, "the one that lags goes on"
    assert found[0].trials < 700
    assert converged([0.0, AGREED])
    assert not converged([0.0, 1.01 * AGREED])
    assert not converged([0.0]), "a single search agrees with none"


@pytest.mark.parametrize("size", [1, 3])
def test_a_start_that_all_share_is_no_agreement_before_each_has_searched(size: int) -> None:
    """Both have the start's value at once, which no random point has, and a better one only by a descent."""
    trials = [0, 0]

    def measure(which: int, points: list[Point]) -> list[float]:
        assert all(len(point) == size for point in points)
        trials[which] += len(points)
        return [bowl(point) for point in points]

    start = np.full(size, 0.38 if size > 1 else 0.44)
    found = search(measure, size, [start], (1, 2), 1500)
    assert -3.8 < bowl(start) < -3.2
    assert all(sampler.best < -3.9 for sampler in found)
    assert trials == [sampler.trials for sampler in found]


def test_a_narrow_minimum_is_found_from_a_start_within_it() -> None:
    def pit(point: Point) -> float:
        return min(bowl(point), -8.0 + 1e3 * float(np.sum((point - 0.9) ** 2)))

    def best(starts: list[Point]) -> float:
        found = search(lambda _, points: [pit(point) for point in points], 4, starts, (1,), 1500)
        return found[0].best

    assert best([]) > -4.1
    assert best([np.full(4, 0.92)]) < -7.9


def test_a_search_in_which_everything_diverges_ends() -> None:
    found = search(lambda _, points: [1000.0] * len(points), 3, [], (1, 2), 1500)
    assert [sampler.best for sampler in found] == [1000.0, 1000.0]
    assert all(sampler.trials < 300 for sampler in found)


# -- Limits, ceilings and devices ----------------------------------------------------------------------------


def test_the_limit_is_that_of_the_package_in_the_figures_of_the_comparison() -> None:
    base = sensed(PAPER, "P", 1e-13)
    limits_of = limits.limit_of(base, (LOW, HIGH), 10.0)
    expected = fg.limit.tracking(base, chattering=[LOW, HIGH], transient=10.0)
    for i, at in enumerate(limits_of["ceilings"]):
        steady, transient = expected["rmse_steady"].values[i], expected["rmse_transient"].values
        assert [at["rmse_steady_x"], at["rmse_steady_y"]] == pytest.approx(steady)
        assert at["steady"] == pytest.approx(math.sqrt(steady[0] * steady[1]))
        assert at["error"] == pytest.approx((steady[0] * steady[1] * transient[0] * transient[1]) ** 0.25)
    steady = [point[1] for point in limits_of["front"]]
    assert steady == sorted(steady, reverse=True), "more chattering, less error"
    assert limits_of["front"][0][0] < LOW < HIGH < limits_of["front"][-1][0]
    figures = {"error": 2 * limits_of["ceilings"][0]["error"], "rmse_steady_x": 3e-4, "rmse_steady_y": 3e-4}
    over = limits.over(limits_of, LOW, figures)
    assert over == {"error": pytest.approx(2.0), "steady": pytest.approx(3e-4 / limits_of["ceilings"][0]["steady"])}
    assert limits.over(limits_of, 0.02, figures) is None
    row = limit_row([{"scenario": "a", "class": "P", "noise": 1e-13, **limits_of}], {**ROW, "ceiling": LOW})
    assert row is not None
    assert row["metrics"]["error"]["value"] == limits_of["ceilings"][0]["error"]


ROW = {"scenario": "a", "class": "P", "noise": 1e-13}


def test_a_scenario_without_a_limit_says_why() -> None:
    sine = {"disturbance.added": [{"kind": "sine", "amplitude": [1.0, 1.0], "frequency": [3.0, 3.0]}]}
    found = limits.limit_of(PAPER.replace(sine), (LOW,), 10.0)
    assert found["ceilings"] == found["front"] == []
    assert "disturbance" in found["why"]


def test_in_noise_the_published_gains_have_a_ceiling_of_their_own() -> None:
    assert TRACK.ceilings("paper", sensed(PAPER, "F", 0.0)) == (LOW, HIGH)
    base = sensed(PAPER, "F", 1e-13)
    low, own, high = TRACK.ceilings("paper", base)
    (found,) = TRACK.measure([base], range(8), base, None)
    assert (low, high) == (LOW, HIGH)
    assert own == pytest.approx(max(found.metrics[f"chattering_{axis}"].mean() for axis in "xy"), rel=1e-2)
    assert TRACK.ceilings("paper", sensed(PAPER, "P", 1e-13)) == (LOW, HIGH), "there it is within 10 % of the high one"


def test_ranges_follow_the_device_in_units_of_its_frequency() -> None:
    second = TRACK.scenarios()["dual_mass"]
    contenders = {c.name: TRACK.scaled(c, second) for c in TRACK.contenders}
    same = {c.name: TRACK.scaled(c, PAPER) for c in TRACK.contenders}
    assert all(
        gain.low == pytest.approx(own.low)
        for c in TRACK.contenders
        for gain, own in zip(same[c.name].gains, c.gains, strict=True)
    )
    natural = contenders["pid"].gains[0]
    # 18.3 rad per unit of time on paper, 1 here; 1000 samples per unit, 20 here.
    assert natural.low == pytest.approx(5.0 / 18.3, rel=0.03)
    assert natural.high * second.run.step == pytest.approx(600.0 * PAPER.run.step)
    twisting = next(gain for gain in contenders["super_twisting"].gains if gain.field.endswith("twisting_gain"))
    assert twisting.low == pytest.approx(0.1 / 18.3**1.5, rel=0.05)
    ratio = contenders["pid"].gains[1]
    assert (ratio.low, ratio.high) == (0.1, 10.0)
    assert Gain("law.kp", 1.0, 2.0).power() is None
    for contender in contenders.values():
        for gain in contender.gains:
            assert gain.low < gain.high, gain.field


@pytest.mark.parametrize("name", ["paper", "dual_mass"])
def test_another_period_of_control_is_physically_the_same(name: str) -> None:
    base = sensed(TRACK.scenarios()[name], "P", 1e-13)
    for times in (0.5, 2.0):
        other = base.replace(sampled(base, times))
        assert other.run.step == pytest.approx(times * base.run.step)
        before, after = core_numbers(base), core_numbers(other)
        assert after["datasheet.force_noise"] ** 2 * other.run.step == pytest.approx(
            before["datasheet.force_noise"] ** 2 * base.run.step
        )
        assert device_values(other)["position_noise"] ** 2 * times == pytest.approx(
            device_values(base)["position_noise"] ** 2
        )
    loop = base.replace({"controller.kind": "internal_model", "controller.loop_bandwidth": 0.5})
    assert loop.replace(sampled(loop, 0.5)).controller.loop_bandwidth == 0.25


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
        assert 1 <= row["trials"] <= 8, "with a steeper penalty once more, if nothing kept the limits"
        assert row["converged"] is False, "a single search agrees with none"
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
        assert row["over_limit"]["error"] > 1.0
        assert row["over_limit"]["steady"] > 1.0
        assert row["others"]["h/2"]["chattering"] > 0
    (limit,) = found["limits"]
    assert (limit["class"], limit["noise"], limit["why"]) == ("F", 0.0, None)
    assert [at["ceiling"] for at in limit["ceilings"]] == [0.0035, 0.05]
    assert [row["ratio"]["value"] for row in found["contenders"] if row["name"] == "paper" and row["metrics"]]
    assert {row["ratio"]["value"] for row in found["contenders"] if row["name"] == "paper" and row["ratio"]} == {1.0}


def test_the_report_is_accessible_and_fits(browser: Any, small: Compared) -> None:
    assert faults_of_report(browser, small.report) == []


def test_no_two_contenders_of_the_fronts_have_one_color() -> None:
    """With all contenders of the committed comparison, of which many are among the best of a table."""
    path = Path(__file__).resolve().parents[2] / "benchmarks/results/compare-track.json"
    rows = json.loads(path.read_text(encoding="utf-8"))["contenders"]
    colors = [color for color, _ in Fronts(rows, [])._looks.values()]
    assert len(colors) == len(set(colors)) > 8


def test_the_numbers_behind_the_figures_are_those_of_compare_json(small: Compared) -> None:
    data = figure_data(small.report)
    assert list(data) == ["fronts", "errors", "robustness"], "the front comes first"
    contenders = json.loads(small.data.read_text(encoding="utf-8"))["contenders"]
    found = {(row["table"].rpartition(" ")[2], row["contender"]): row for row in data["errors"]}
    error = "error (q0)"
    for row in contenders:
        shown = found[f"{row['ceiling']:g}", row["name"]]
        wanted = row["metrics"].get("error", {"value": None})["value"]
        assert shown[error] == ("" if wanted is None else f"{wanted:.9g}")
        assert shown["within the limits"] == str(row["kept"]).lower()
        assert shown[f"{error}: search 1, when trained"] == "".join(f"{e:.9g}" for e in row["sampler_errors"] if e)
    others = {(row["name"], what): of["value"] for row in contenders[2:] for what, of in row["others"].items()}
    ratio = "error over that without the change"
    shown = {(row["contender"], row["condition, plant or noise"]): row[ratio] for row in data["robustness"]}
    assert shown == {key: "" if value is None else f"{value:.9g}" for key, value in others.items()}
    points = [p for row in contenders if row["name"] == "pid" for p in row["front"]]
    steady = "steady error on the held-out seeds (q0)"
    (limit,) = json.loads(small.data.read_text(encoding="utf-8"))["limits"]
    drawn = [row for row in data["fronts"] if row["contender"] == "limit"]
    assert column(drawn, steady) == pytest.approx([point[1] for point in limit["front"]])
    pid = [row for row in data["fronts"] if row["contender"] == "pid" and not row[steady]]
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
    (folder / "tunings" / "pid-paper-F-0-0.05.json").unlink()
    resumed = compare("track", folder, **SMALL, resume=True)
    assert resumed.resumed == 3
    assert without_cost(resumed.data) == without_cost(small.data)


@pytest.mark.nightly
def test_searches_of_an_earlier_comparison_are_kept_where_their_gains_have_the_same_errors(
    small: Compared, tmp_path: Path
) -> None:
    earlier = json.loads(small.data.read_text(encoding="utf-8"))
    first, *others = earlier["contenders"]
    first["sampler_errors"] = [1.01 * first["sampler_errors"][0]]  # an error that a change of the core has lowered
    file = tmp_path / "earlier.json"
    file.write_text(json.dumps(earlier), encoding="utf-8")
    found = compare("track", tmp_path / "out", **SMALL, searched=file)
    assert found.resumed == len(others)
    assert without_cost(found.data) == without_cost(small.data)


@pytest.mark.parametrize("text", ["{", "[]", '{"contenders": [1]}'])
def test_a_file_without_searches_is_refused_by_its_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "earlier.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"earlier\.json is not the compare\.json of a comparison"):
        compare("track", tmp_path / "out", **SMALL, searched=file)
    with pytest.raises(ValueError, match=r"none\.json cannot be read: No such file"):
        compare("track", tmp_path / "out", **SMALL, searched=tmp_path / "none.json")


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
    (tuning,) = (folder / "tunings").glob("pid-*-0.05.json")
    (judging,) = (folder / "judgings").glob("pid-*-0.05.json")
    tuning.write_bytes(b"[]")
    judging.write_bytes(good[judging].replace(b"1", b"2", 1))
    resumed = compare("track", folder, **chosen, resume=True)
    assert resumed.resumed == len(good) - 2
    assert without_cost(resumed.data) == without_cost(whole.data)
    assert {path: path.read_bytes() for path in good} == good


def test_the_hashes_of_a_comparison_can_be_checked_with_sha256sum(small: Compared) -> None:
    lines = (small.data.parent / "finished.sha256").read_text(encoding="utf-8").splitlines()
    found = {line[66:]: line[:64] for line in lines}
    folder = small.data.parent
    files = {path.relative_to(folder).as_posix(): path for path in folder.glob("*ings/*.json")}
    assert found == {name: sha256(path.read_bytes()).hexdigest() for name, path in files.items()}


# -- A controller of one's own -------------------------------------------------------------------------------


def shortened(folder: Path) -> dict[str, Any]:
    """Options with the paper's scenario in a tenth of the time, for laws in Python."""
    PAPER.replace({"run.duration": 2.0}).save(folder / "short.toml")
    return {**SMALL, "scenarios": [folder / "short.toml"], "trials": 2}


def test_a_controller_of_ones_own_takes_part_with_the_same_effort(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE, encoding="utf-8")
    given = f"{tmp_path / 'mine.py'}:MyController"
    scales = {gain.field: (gain.low, gain.high, gain.log) for gain in own_contender(given, TRACK).gains}
    assert scales == {"law.kp": (1e3, 1e5, True), "law.kd": (10.0, 500.0, True), "law.offset": (-1.0, 1.0, False)}
    options = {**shortened(tmp_path), "only": ["MyController", "pid"]}
    result = compare("track", tmp_path / "out", **options, controller=given)
    mine = [row for row in result.rows if row["name"] == "MyController"]
    theirs = [row for row in result.rows if row["name"] == "pid"]
    # Equal trials count once.
    assert max(row["trials"] for row in mine) == max(row["trials"] for row in theirs) == options["trials"]
    assert any(row["metrics"] for row in mine)
    for row in mine:
        if row["metrics"]:
            assert set(row["gains"]) == {"law.kp", "law.kd", "law.offset"}
            assert 1e3 <= row["gains"]["law.kp"] <= 1e5
            assert row["diverged"] == 0
    (tmp_path / "mine.py").write_text(MINE.replace("500.0", "400.0"), encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match="differs in the contenders and the file of --controller"):
        compare("track", tmp_path / "out", **options, controller=given, resume=True)


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


@pytest.mark.nightly
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
        rows = compare("track", tmp_path / name, **{**shortened(tmp_path), "only": [name]}, controller=given).rows
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


def test_the_fronts_of_the_log_have_steps_of_some_percent(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).resolve().parents[2]
    for folder in ("benchmarks", "lab"):
        monkeypatch.syspath_prepend(root / folder)
    log = importlib.import_module("compare")
    front = [[float(i), 0.99**i] for i in range(200)]
    kept = log.thinned(front)
    assert (kept[0], kept[-1]) == (front[0], front[-1])
    steps = [later[1] / point[1] for point, later in itertools.pairwise(kept[:-1])]
    assert all(0.95 < step < log.STEP for step in steps)
