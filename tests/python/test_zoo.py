"""The zoo: facts about published laws, the public code as printed, claims and verdicts, and its commands."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import click
import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.scenario.scales import Scales
from fracgyro_lab.board.page import counts, operations_of
from fracgyro_lab.verdicts import FAILED, HELD
from fracgyro_lab.zoo import criteria, extra, facts, fig, laws, page, pdf, run
from fracgyro_lab.zoo.check import missing
from fracgyro_lab.zoo.criteria import CRITERIA, Laws, Material, judge
from fracgyro_lab.zoo.facts import Facts, Given, entries, entry, plants
from fracgyro_lab.zoo.printed import SWITCHES, Curves, PrintedRun, integrated
from jsonschema import Draft202012Validator

CODE = "2023_prescribed"
HEAD = """
doi = "10.1000/x"
title = "a title"
year = 2000
seen = "text"
words = "a law"
contender = "pid"
"""


def facts_of(more: str = "", **changes: str) -> Facts:
    """The facts of a short file, with lines of it changed."""
    lines = [line for line in HEAD.splitlines() if line.partition(" ")[0] not in changes]
    return facts._facts("\n".join([*lines, *(f"{name} = {value}" for name, value in changes.items()), more]), "x.toml")


def given(value: facts.Number, unit: str = "", source: str = "page 1") -> Given:
    return Given.model_validate({"value": value, "unit": unit, "from": source})


# -- Facts -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", entries())
def test_an_entry_lacks_nothing(name: str) -> None:
    assert list(missing(name, entries()[name])) == []
    assert entries()[name].plant in plants()


def test_the_zoo_has_at_least_twelve_papers_of_different_years() -> None:
    dois = {found.doi for found in entries().values() if found.doi}
    assert len(dois) >= 12
    years = [found.year for found in entries().values()]
    assert years == sorted(years)
    assert all(name.startswith(f"{found.year}_") for name, found in entries().items())


def test_only_numbers_of_a_code_or_a_text_that_was_read_are_called_as_published() -> None:
    number = '[given]\na = { value = 1, from = "page 2" }'
    assert facts_of(number).heading(own_numbers=True) == "as published in doi:10.1000/x"
    assert facts_of(number).heading(own_numbers=False) == "after doi:10.1000/x, tuned by us"
    assert facts_of().heading(own_numbers=True) == "after doi:10.1000/x, tuned by us"
    ours = facts_of("[given]\na = { value = 1 }")
    assert ours.heading(own_numbers=True) == "after doi:10.1000/x, tuned by us"
    abstract = facts_of(number, seen='"abstract"')
    assert abstract.heading(own_numbers=True) == "after the abstract of doi:10.1000/x, tuned by us"
    memory = facts_of(seen='"citation"').heading(own_numbers=True)
    assert memory == "after doi:10.1000/x (from memory), tuned by us"
    assert entries()[CODE].heading(own_numbers=True).startswith("as published in doi:")


@pytest.mark.parametrize(
    ("more", "changes", "message"),
    [
        ("", {"doi": '"x"'}, 'doi is "x": it must be a DOI such as "10.1155/2020/8542961", or ""'),
        ("", {"seen": '"red"'}, 'seen is "red": it must be code, text, abstract or citation'),
        ("", {"year": "20"}, "year is 20: it must lie between 1900 and 2100"),
        ("", {"titel": '""'}, "titel is not a known field; did you mean title?"),
        ("given.a = { value = 'x' }", {}, 'given.a.value is "x": it must be a finite number or a list of such'),
        ("given.a = { value = [] }", {}, "given.a.value is []: it must be a finite number or a list of such"),
        ("given.a = { value = inf }", {}, "given.a.value is inf: it must be a finite number or a list of such"),
        (
            "given.a = { value = 1, unit = 'pc' }",
            {},
            'given.a.unit is "pc": it must be an SI unit such as "N/m", or "" for a number without one',
        ),
        (
            "given.a = { value = 1, from = 'page 1' }",
            {"seen": '"citation"'},
            'given.a.from is "page 1": it must be left out, as seen is "citation"',
        ),
    ],
)
def test_a_wrong_fact_is_one_sentence(more: str, changes: dict[str, str], message: str) -> None:
    with pytest.raises(fg.ScenarioError) as error:
        facts_of(more, **changes)
    assert str(error.value) == f"x.toml: {message}"


def test_an_unknown_entry_is_refused_with_the_nearest_name() -> None:
    assert entry("prescribed")[0] == CODE
    with pytest.raises(fg.ScenarioError, match=r'^"2023_prescribd" is neither .* did you mean 2023_prescribed\?$'):
        entry("2023_prescribd")
    with pytest.raises(fg.ScenarioError, match=r"^plant is .*: it must be paper or second$"):
        facts.plant("third")


def test_published_numbers_are_converted_by_their_units_only() -> None:
    scales = Scales(2.0, 0.5, 10.0)  # kg, m, rad/s
    assert given(4.0, "kg").used(scales) == 2.0
    assert given(1.0, "mm").used(scales) == pytest.approx(2e-3)
    assert given([200.0, 400.0], "N/m").used(scales) == pytest.approx([1.0, 2.0])
    assert given(40.0, "N s/m").used(scales) == pytest.approx(2.0)
    assert given(5.0, "rad/s").used(scales) == pytest.approx(0.5)
    assert given(7.0).used(scales) == 7.0, "a number without a unit is used as it is"
    assert given(3.0, "mm").si() == pytest.approx(3e-3)


def test_the_plant_of_the_paper_is_that_of_its_scenario() -> None:
    paper = fg.Scenario.paper()
    found = paper.replace({**plants()["paper"].changes(), "controller.force_limit": paper.controller.force_limit})
    assert found == paper


def test_every_plant_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in plants():
        scenario = laws.on_plant(laws.base(), name).replace({"controller.kind": "pid", "run.duration": 0.1})
        assert not math.isfinite(fg.simulate(scenario).attrs.get("diverged_at", math.nan))


def test_the_schema_accepts_every_entry() -> None:
    validator = Draft202012Validator(facts.schema())
    for found in entries().values():
        validator.validate(found.model_dump(by_alias=True, mode="json"))
    assert not validator.is_valid({"doi": 1})


# -- The public code ---------------------------------------------------------------------------------------------------

COARSE = 5e-4


@pytest.fixture(scope="module")
def numbers() -> dict[str, Any]:
    return dict(run.printed_run(entries()[CODE], "fixed", "printed").numbers)


@pytest.mark.parametrize(
    ("name", "rms", "share"),
    [("fixed", (0.0241, 0.0250), 0.62), ("finite", (0.1255, 0.1730), 0.62)],
    ids=["fixed", "finite"],
)
def test_a_published_run_follows_from_the_file_only(name: str, rms: tuple[float, float], share: float) -> None:
    curves = integrated(run.printed_run(entries()[CODE], name, "printed"), step=2.5e-4)
    assert curves.rms(5.0) == pytest.approx(rms, rel=0.01)
    assert curves.largest_share() == pytest.approx(share, abs=5e-3)
    assert curves.leaves() is None


def test_the_published_terms_for_a_fixed_time_near_zero_change_nothing(numbers: dict[str, Any]) -> None:
    without = integrated(PrintedRun({**numbers, "k1": 0.0, "k3": 0.0}), step=COARSE)
    assert without.rms(5.0) == pytest.approx((0.0241, 0.0250), abs=5e-5)


def test_the_published_estimates_make_the_error_ten_times_larger(numbers: dict[str, Any]) -> None:
    assert integrated(PrintedRun(numbers, learns=False), step=COARSE).rms(5.0) == pytest.approx(
        (0.0021, 0.0030), abs=5e-5
    )


@pytest.mark.parametrize("errors", [set(SWITCHES) - {"plant_exchanged", "damping_scale"}, set()], ids=["meant", "all"])
def test_on_the_plant_as_meant_the_published_law_loses_the_bound(numbers: dict[str, Any], errors: set[str]) -> None:
    curves = integrated(PrintedRun(numbers, frozenset(errors)), step=1e-4)
    left = curves.leaves()
    assert left is not None
    assert left < 1.0
    assert all(math.isnan(rms) for rms in curves.rms(5.0))


def test_the_corrected_law_keeps_its_bound_with_a_damper(numbers: dict[str, Any]) -> None:
    curves = integrated(PrintedRun({**numbers, "k3": 100.0, "k4": 100.0}, frozenset()), step=2e-4)
    assert curves.rms(5.0) == pytest.approx((0.0230, 0.0240), abs=5e-5)


def test_every_switch_of_the_public_code_is_an_erratum_of_its_entry() -> None:
    assert [erratum.switch for erratum in entries()[CODE].erratum] == list(SWITCHES)


def test_curves_report_their_errors_and_the_bound() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    error = np.array([[0.5, 0.0], [0.0, -0.3], [0.0, 0.4], [0.0, 0.0]])
    curves = Curves(time, error, np.array([1.0, 0.6, 0.4, 0.2]), np.ones((4, 2)))
    assert curves.rms(0.5) == pytest.approx((0.0, math.sqrt(0.25 / 3)))
    assert curves.largest_share() == 1.0
    assert curves.leaves() == 2.0
    assert Curves(time, error * 0.9, curves.bound, curves.gain).leaves() is None


# -- Claims ------------------------------------------------------------------------------------------------------------


def judged(errors: list[float], chattering: float = 0.1) -> dict[str, Any]:
    metrics = {"chattering_x": [chattering] * len(errors), "chattering_y": [0.0] * len(errors)}
    logs = list(map(math.log, errors))
    return {"error": logs, "searched": [], "metrics": {**metrics, "error_settling_time": [1.0] * len(errors)}}


def material(mine: dict[str, Any], curves: dict[str, Curves] | None = None, **others: dict[str, Any]) -> Material:
    every = {"law": mine, **others}
    scenario = fg.Scenario.paper().replace({"controller.force_limit": 1000.0})
    of = Laws(every, dict.fromkeys(every, scenario), dict.fromkeys(every, False), [0, 1])
    return Material(facts_of(), "law", of, of, curves or {})


def test_a_network_must_beat_an_integral_by_a_tenth() -> None:
    held, words = criteria.beats_integral_action(material(judged([0.5, 0.5]), network_constant=judged([1.0, 1.0])))
    assert held
    assert words == "the error is 0.5 [0.5, 0.5] times that with one constant node, an integral."
    assert not criteria.beats_integral_action(material(judged([0.95] * 2), network_constant=judged([1.0] * 2)))[0]
    assert not criteria.beats_integral_action(material(judged([0.5, 1.2]), network_constant=judged([1.0] * 2)))[0]
    assert not criteria.beats_integral_action(material(judged([0.5])))[0], "without the integral nothing is decided"


@pytest.mark.parametrize(
    ("criterion", "other", "words"),
    [
        ("beats_nodes", "network", "of the plain network of 16 nodes"),
        ("beats_unsupervised", "fuzzy_direct", "without the supervisory term"),
    ],
)
def test_a_part_must_lower_the_error_by_a_tenth(criterion: str, other: str, words: str) -> None:
    decide = CRITERIA[criterion][1]
    held, found = decide(material(judged([0.8, 0.8]), **{other: judged([1.0, 1.0])}))
    assert held
    assert found == f"the error is 0.8 [0.8, 0.8] times that {words}."
    assert not decide(material(judged([0.95] * 2), **{other: judged([1.0] * 2)}))[0]


def test_loops_are_judged_on_the_network_whatever_the_law() -> None:
    others = {"network": judged([1.0, 1.0]), "network_loops": judged([0.5, 0.5])}
    assert criteria.loops_help(material(judged([9.0, 9.0]), **others))[0]
    others["network_loops"] = judged([1.0, 1.0])
    assert not criteria.loops_help(material(judged([0.1, 0.1]), **others))[0]


def test_a_transient_is_smaller_by_a_tenth() -> None:
    def law(transient: float | None) -> dict[str, Any]:
        found = judged([1.0])
        found["metrics"] |= {"rmse_transient_x": [transient], "rmse_transient_y": [transient]}
        return found

    held, words = criteria.smaller_transient(material(law(0.08), linear=law(0.1)))
    assert held
    assert words == "transient RMS error 0.08 against 0.1 of the linear surface."
    assert not criteria.smaller_transient(material(law(0.095), linear=law(0.1)))[0]
    assert not criteria.smaller_transient(material(law(None), linear=law(0.1)))[0]


def test_an_event_trigger_saves_if_a_threshold_keeps_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def sent(scenario: fg.Scenario, seeds: Any) -> dict[float, tuple[float, float]]:
        quiet = scenario.device.position_noise_density == 0.0
        return {1.0: (0.9, 1.0), 3.0: (0.3 if quiet else 0.7, 1.01), 10.0: (0.1, 2.0)}

    monkeypatch.setattr(extra, "sending", sent)
    noisy = material(judged([1.0])).noisy
    loud = fg.Scenario.paper().replace({"device.position_noise_density": 1e-13})
    m = Material(facts_of(), "law", Laws(noisy.judged, {"law": loud}, noisy.failed, [0]), noisy, {})
    assert not criteria.saves(m)[0]
    held, words = criteria.saves_without_noise(m)
    assert held
    assert words == (
        "forces sent with thresholds of 1, 3, 10: 90% at 1.00 times the error, 30% at 1.01 times the error, "
        "10% at 2.00 times the error."
    )


def test_less_chattering_counts_only_at_no_larger_an_error() -> None:
    others = {"linear": judged([1.0], chattering=0.2)}
    assert criteria.less_chattering(material(judged([1.0]), **others))[0]
    assert not criteria.less_chattering(material(judged([1.1]), **others))[0]
    assert not criteria.less_chattering(material(judged([0.5], chattering=0.3), **others))[0]


@pytest.mark.parametrize(("norms", "held"), [([1.0, 2.0, 2.1], True), ([1.0, 2.0, 4.0], False)])
def test_weights_are_bounded_if_they_stop_growing(
    norms: list[float], held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extra, "drift", lambda scenario, seed: ("weight_norm", norms))
    assert criteria.weights_bounded(material(judged([1.0])))[0] is held


def test_a_fixed_time_is_judged_with_and_without_the_force_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def times(scenario: fg.Scenario) -> dict[float, float | None]:
        free = scenario.controller.force_limit == math.inf
        return dict(zip(extra.STARTS, (1.0, 1.1, 1.2, 1.2 if free else 4.0), strict=True))

    monkeypatch.setattr(extra, "convergence_times", times)
    m = material(judged([1.0]))
    held, words = criteria.fixed_time(m)
    assert not held
    assert "with |u| <= 1000 1.00, 1.10, 1.20, 4.00" in words
    held, words = criteria.fixed_time_free(m)
    assert held
    assert "without a limit 1.00, 1.10, 1.20, 1.20" in words


def test_the_kind_with_a_fixed_time_needs_an_unlimited_force() -> None:
    m = Material(entries()["2012_fixed_time"], "fixed_time", *[material(judged([1.0])).noisy] * 2, {})
    assert not criteria.fixed_time(m)[0]
    assert criteria.fixed_time_free(m)[0]


def test_a_bound_is_kept_only_without_a_sample_outside() -> None:
    inside = Curves(np.arange(3.0), np.full((3, 2), 0.5), np.ones(3), np.ones((3, 2)))
    outside = Curves(np.arange(3.0), np.full((3, 2), 1.5), np.ones(3), np.ones((3, 2)))
    for curves, held in ((inside, True), (outside, False)):
        assert criteria.bound_kept(material(judged([1.0]), {"fixed": curves}))[0] is held


def test_a_claim_has_a_verdict_for_each_variant_and_an_untestable_one_has_none() -> None:
    claims = """
[[claim]]
text = "better"
criterion = "beats_linear"
from = "abstract"
[[claim]]
text = "elegant"
from = "abstract"
"""
    better, worse = (material(judged([error]), linear=judged([1.0])) for error in (0.5, 2.0))
    found = judge(facts_of(claims), {"printed": better, "corrected": worse})
    assert [(claim.id, claim.claim, claim.variant, claim.verdict) for claim in found] == [
        ("1", "better", "printed", HELD),
        ("1", "better", "corrected", FAILED),
    ]
    assert {claim.criterion for claim in found} == {CRITERIA["beats_linear"][0]}


# -- Measurements ------------------------------------------------------------------------------------------------------


def paper(**changes: Any) -> fg.Scenario:
    return fg.Scenario.paper().replace({"run.duration": 20.0, **{k.replace("__", "."): v for k, v in changes.items()}})


def test_the_estimates_of_the_paper_grow_and_a_pid_learns_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extra, "LONG", 20.0)
    monkeypatch.setattr(extra, "KEPT", 100)
    found = extra.drift(paper(), 0)
    assert found is not None
    name, norms = found
    assert name == "bound_estimate"
    assert 0.0 < norms[0] < norms[2]
    assert extra.drift(paper(controller__kind="pid"), 0) is None


def test_a_higher_threshold_sends_less_at_a_larger_error() -> None:
    scenario = paper(controller__kind="pid", controller__natural_frequency=200.0, disturbance__kind="none")
    found = extra.sending(scenario, [0])
    assert list(found) == list(extra.THRESHOLDS)
    shares, errors = zip(*found.values(), strict=True)
    assert list(shares) == sorted(shares, reverse=True)
    assert 0.0 < shares[-1] < 0.2 < shares[0]
    assert errors[0] < 1.05 < errors[-1]


def test_a_pid_converges_sooner_from_near(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extra, "FAR", 10.0)
    scenario = paper(controller__kind="pid", controller__natural_frequency=50.0, adaptation__initial_ratio=1.0)
    near, far = (extra.time_to(scenario, start) for start in (0.1, 100.0))
    assert near is not None
    assert far is not None
    assert 0.0 < near < far < 1.0
    assert extra.time_to(paper(controller__kind="open_loop"), 1.0) is None


def test_estimates_are_right_if_they_start_right_and_rest() -> None:
    rests = paper(
        adaptation__initial_ratio=1.0,
        adaptation__damping_gain=1e-12,
        adaptation__stiffness_gain=1e-12,
        adaptation__rate_gain=1e-12,
    )
    assert extra.right_estimates(rests, [0, 1]) == {"rate": 1.0, "D": 1.0, "K": 1.0}
    wrong = rests.replace({"adaptation.initial_ratio": 0.9})
    assert extra.right_estimates(wrong, [0, 1]) == {"rate": 0.0, "D": 0.0, "K": 0.0}
    assert extra.right_estimates(paper(controller__kind="pid"), [0]) == {}


def test_a_trace_has_the_largest_error_of_each_part_and_blocks_show_it() -> None:
    errors = np.concatenate([[9.0], np.full(60, 1e-6), np.full(60, -1.0)])
    found = extra.parts(errors)
    assert found == [1e-6] * 30 + [1.0] * 30
    assert page.blocks(found) == "▁" * 12 + "█" * 12
    assert page.blocks([*found[:30], *[None] * 30]) == "▁" * 12 + " " * 12
    assert page.blocks([1e-3] * 60, width=4) == "▅▅▅▅"


@pytest.mark.parametrize(
    ("norms", "words"), [(None, "–"), ([], "lost"), ([1.0, 2.0, 3.0], "1.5"), ([0.0, 0.0, 0.0], "–")]
)
def test_drift_is_the_growth_over_the_second_half(norms: list[float] | None, words: str) -> None:
    law = {"noise": None, "none": None, "operations": None, "bytes": None, "drift": norms}
    assert page._numbers(law)[page.HEADS.index("Drift") - page.HEADS.index("Error in noise")] == words


def test_an_interval_without_an_end_is_open() -> None:
    assert run._open((0.5, 0.4, math.inf)) == (0.5, 0.4, None)
    assert page.triple(run._open((0.5, 0.4, math.inf))) == "0.50 [0.40, –]"
    assert page.triple((0.5, 0.4, 0.6)) == "0.50 [0.40, 0.60]"


# -- Laws that reduce to others ----------------------------------------------------------------------------------------


def steady(changes: dict[str, Any]) -> np.ndarray:
    """Steady RMS errors of a law without noise, for two seeds of the disturbance."""
    scenario = laws.sensed_base(laws.cell("F", 0.0)).replace(changes)
    return np.asarray(fg.measure_many([scenario], seeds=[0, 1])["rmse"].sel(window="steady"))


def test_a_disturbance_observer_is_a_constant_node_with_the_same_poles() -> None:
    pole, rate, observer = 5.0, 10.0, 20.0  # the loops of both have these three poles
    observed = steady(
        {
            "controller.kind": "integral_sliding",
            "controller.surface_gain": pole,
            "controller.reaching_rate": rate,
            "controller.integral_rate": 0.0,
            "controller.disturbance_observer": observer,
        }
    )
    learned = steady(
        {
            "controller.kind": "network",
            "controller.basis": "constant",
            "controller.surface_gain": pole,
            "controller.reaching_rate": rate + observer,
            "controller.learning_frequency": math.sqrt(rate * observer),
        }
    )
    assert observed == pytest.approx(learned, rel=0.01)


@pytest.mark.parametrize(("first", "second", "difference"), [(20.0, 25.0, 2e-3), (200.0, 220.0, 1e-4)])
def test_backstepping_is_the_linear_surface_but_for_the_error_over_both_gains(
    first: float, second: float, difference: float
) -> None:
    linear: dict[str, Any] = {
        "controller.kind": "linear",
        "controller.fractional_gain": (first, first),
        "controller.layer_thickness": 100.0,
        "controller.switching_limit": 0.8,
        "adaptation.initial_bound": (100.0 * second, 0.0, 0.0),
        "adaptation.bound_gain": (1e-12,) * 3,
    }
    without, coupled = steady(linear), steady({**linear, "controller.coupling": 1.0})
    assert (without != coupled).all()
    assert coupled == pytest.approx(without, rel=difference)


# -- The report --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quick report of two entries."""
    folder = tmp_path_factory.mktemp("zoo") / "report"
    few = {name: entries()[name] for name in ("2003_park_horowitz", "2018_super_twisting")}
    with pytest.MonkeyPatch.context() as patch:
        for module in (laws, run, page):
            patch.setattr(module, "entries", lambda: few)
        patch.setattr(laws, "SWITCHES", (laws.Switch("the laws (44)", "super_twisting_adaptive", "super_twisting"),))
        patch.setattr(run, "SWITCHES", laws.SWITCHES)
        first = run.report(folder, quick=True)
        again = run.report(folder, quick=True, resume=True)
    assert again.resumed > 0
    assert again.laws.keys() == first.laws.keys()
    return folder


def test_a_report_has_the_entries_the_house_and_the_limit(report: Path) -> None:
    found = json.loads((report / "zoo.json").read_text(encoding="utf-8"))
    assert set(found["laws"]) == {"park_horowitz", "super_twisting_adaptive", "super_twisting", *laws.HOUSE}
    assert list(found["entries"]) == ["2003_park_horowitz", "2018_super_twisting"]
    law = found["laws"]["super_twisting_adaptive"]
    assert law["noise"]["metrics"]["error"]["value"] > 0.0
    assert len(law["trace"]) == extra.WINDOWS
    assert set(law["noise"]["others"]) == {"one step of hidden delay", "12 bit", "0.7 of the force"}
    (switch,) = found["switches"]
    value, low, high = switch["noise"]
    assert low <= value <= high
    names = {claim["claim"]: claim["verdict"] for claim in found["entries"]["2018_super_twisting"]["claims"]}
    assert names["superior to conventional sliding mode control"] in (HELD, FAILED)


def test_the_page_shows_what_was_seen_and_that_nothing_was_tuned(report: Path) -> None:
    html = (report / "report.html").read_text(encoding="utf-8")
    assert "Nothing was tuned here" in html
    assert "after the abstract of doi:10.1371/journal.pone.0189457, tuned by us" in html
    assert "as published" not in html.replace("“", "").lower()
    assert html.count("<polyline") == 2 + len(laws.HOUSE)
    lines = (report / "report.md").read_text(encoding="utf-8").splitlines()
    tables = [line for line in lines if line.startswith("| 2003 |")]
    assert len(tables) == 1
    assert sum(mark in page.BLOCKS for mark in tables[0]) == page.WIDTH


def test_a_report_of_other_laws_is_not_resumed(report: Path) -> None:
    with pytest.raises(ValueError, match="has another study"):
        run.report(report, quick=True, resume=True)


# -- Commands ----------------------------------------------------------------------------------------------------------


def test_the_list_has_a_line_for_each_entry() -> None:
    found = CliRunner().invoke(cli, ["zoo"])
    assert found.exit_code == 0
    assert [line.split()[0] for line in found.output.splitlines()[1:]] == list(entries())


def test_numbers_are_shown_as_printed_and_as_used() -> None:
    found = CliRunner().invoke(cli, ["zoo", "show", "prescribed"]).output
    assert "as published in doi:10.1049/cth2.12484" in found
    (stiffness,) = [line for line in found.splitlines() if line.startswith("given.stiffness")]
    assert "63.955, 12.779, 95.92 N/m" in stiffness
    assert "355.306, 70.9944, 532.889" in stiffness
    assert "Erratum plant_exchanged" in found


def invoked(*arguments: str) -> str:
    """The output of a command that succeeds."""
    found = CliRunner().invoke(cli, ["zoo", *arguments])
    assert found.exit_code == 0, found.exception
    return found.output


def refused(*arguments: str) -> str:
    """The sentence with which a command is refused."""
    with pytest.raises((fg.ScenarioError, click.UsageError, ValueError)) as error:
        CliRunner().invoke(cli, ["zoo", *arguments], standalone_mode=False, catch_exceptions=False)
    return str(error.value)


def test_runs_that_were_not_published_are_refused() -> None:
    found = refused("run", "2018_backstepping", "--printed")
    assert found.startswith("2018_backstepping has no published runs: --printed needs an entry with some")
    found = refused("run", "2018_backstepping", "--plant", "moon")
    assert found == '--plant is "moon": it must be theirs or paper or second'
    found = refused("run", "prescribed", "--printed", "--plant", "paper")
    assert found == "--printed takes neither --plant nor --controller"


def test_a_published_run_has_its_heading_and_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def short(made: PrintedRun, **_: Any) -> Curves:
        return integrated(PrintedRun({**made.numbers, "duration": 0.05}, made.errors), step=1e-3)

    monkeypatch.setattr("fracgyro_lab.zoo.single.integrated", short)
    found = CliRunner().invoke(cli, ["zoo", "run", CODE, "--printed", "--out", str(tmp_path), "--json"])
    assert found.exit_code == 0, found.output
    data = json.loads(found.output)
    assert data["heading"] == "as published in doi:10.1049/cth2.12484"
    assert [row["run"] for row in data["runs"]] == ["fixed", "finite", "fault"]
    text = (tmp_path / f"{CODE}_fixed_printed.csv").read_text(encoding="utf-8").splitlines()
    assert text[0] == "t,e_x,e_y,bound"
    assert text[1] == "0,0.47,0.62,1"


def test_a_law_runs_on_both_plants_without_the_claim_that_it_is_published() -> None:
    found = CliRunner().invoke(cli, ["zoo", "run", "2003_park_horowitz", "--plant", "second", "--json"])
    data = json.loads(found.output)
    assert data["heading"].startswith("after doi:10.1109/JMEMS.2002.807468 (from memory), gains ")
    assert [(row["plant"], row["noise, m/sqrt(Hz)"]) for row in data["runs"]] == [("second", 1e-13), ("second", 0.0)]


MINE = """
import fracgyro as fg


class PD:
    def __call__(self, s):
        return [a + 355.3 * r - 4e4 * e - 280 * d for a, r, e, d in
                zip(s.reference_acceleration, s.reference, s.error, s.error_rate)]
"""


def test_a_stranger_adds_a_law(tmp_path: Path) -> None:
    file, law = tmp_path / "2024_mine.toml", tmp_path / "mine.py"
    law.write_text(MINE, encoding="utf-8")
    invoked("new", "10.1000/mine", "--year", "2024", "--out", str(file))
    lacking = refused("check", str(file))
    assert lacking.startswith('title is "": it must be given; words is "": it must be given; claim[0].text is "": it')
    text = file.read_text(encoding="utf-8")
    for old, new in (
        ('title = ""', 'title = "PD control"'),
        ('words = ""', 'words = "a PD"'),
        ('text = ""', 'text = "it tracks"'),
        ('criterion = ""', 'criterion = "settles"'),
    ):
        text = text.replace(old, new, 1)
    file.write_text(text, encoding="utf-8")
    found = invoked("check", str(file))
    assert found == "2024_mine: complete; after the abstract of doi:10.1000/mine, tuned by us\n"
    ran = invoked("run", str(file), "--plant", "paper", "--controller", f"{law}:PD", "--json")
    rows = json.loads(ran)["runs"]
    assert [row["diverged"] for row in rows] == ["0/4", "0/4"]
    assert all(0.0 < row["error, q0"] < 0.1 for row in rows)
    assert "already exists" in refused("new", "10.1000/mine", "--out", str(file))


def pdf_of(pages: list[str], path: Path) -> Path:
    """A PDF with a line of text on each page, none on an empty one."""
    kids = " ".join(f"{4 + 2 * n} 0 R" for n in range(len(pages)))
    objects = [
        "<< /Type /Catalog /Pages 2 0 R >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>",
    ]
    for n, text in enumerate(pages):
        shown = f"BT /F1 12 Tf 72 720 Td <{text.encode('cp1252').hex()}> Tj ET" if text else ""
        font = "/Resources << /Font << /F1 3 0 R >> >> /MediaBox [0 0 612 792]"
        objects += [
            f"<< /Type /Page /Parent 2 0 R {font} /Contents {5 + 2 * n} 0 R >>",
            f"<< /Length {len(shown)} >>\nstream\n{shown}\nendstream",
        ]
    data, places = b"%PDF-1.4\n", []
    for number, content in enumerate(objects, 1):
        places.append(len(data))
        data += f"{number} 0 obj\n{content}\nendobj\n".encode()
    table = "".join(f"{place:010} 00000 n \n" for place in places)
    data += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}".encode()
    data += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{data.rindex(b'xref')}\n%%EOF\n".encode()
    path.write_bytes(data)
    return path


def test_numbers_of_a_text_have_their_powers_of_ten() -> None:
    text = "m = 1.8 × 10−7 kg, 1.8e-7, 2x10^3, .5 and 63.955 (13)"
    assert pdf.numbers_of(text) == [1.8e-7, 1.8e-7, 2e3, 0.5, 63.955, 13.0]


def test_an_entry_of_ones_own_pdf_is_looked_up_page_by_page(tmp_path: Path) -> None:
    pages = ["m = 1.8 × 10-7 kg, k = 63.955, 12.779 and 95.92 N/m (13)", ""]
    paper_, file = pdf_of(pages, tmp_path / "paper.pdf"), tmp_path / "2024_mine.toml"
    invoked("new", "10.1000/mine", "--year", "2024", "--pdf", str(paper_), "--out", str(file))
    text = file.read_text(encoding="utf-8")
    hashed = hashlib.sha256(paper_.read_bytes()).hexdigest()
    assert f'[pdf]\nsha256 = "{hashed}"\npages = 2\n' in text
    for old, new in (('title = ""', 'title = "A"'), ('words = ""', 'words = "a"'), ('text = ""', 'text = "it tracks"')):
        text = text.replace(old, new, 1)
    text = text.replace('criterion = ""', 'criterion = "settles"').replace('seen = "abstract"', 'seen = "text"')
    text += """
[[equation]]
number = "(13)"
is = "pid.hpp::Pid"
from = "page 1"
[given]
mass = { value = 1.8e-7, unit = "kg", from = "page 1" }
stiffness = { value = [63.955, 12.779, 95.92], unit = "N/m", from = "page 1, table 1" }
rate = { value = 0.1, from = "page 2" }
"""
    file.write_text(text, encoding="utf-8")
    lines = invoked("check", str(file), "--pdf", str(paper_)).splitlines()
    assert [line.split()[-1] for line in lines[1:5]] == ["found", "found", "scanned", "found"]
    assert lines[-1] == "2024_mine: complete; as published in doi:10.1000/mine"
    file.write_text(text.replace("12.779", "12.78").replace('0.1, from = "page 2"', '0.1, from = "page 3"'))
    assert refused("check", str(file), "--pdf", str(paper_)) == (
        "given.stiffness is 63.955, 12.78, 95.92: it must be in the text of its page, but page 1 lacks it; "
        "given.rate is 0.1: it must be in the text of its page, but the PDF has 2 pages"
    )
    file.write_text(text.replace('from = "page 2"', 'from = "table 2"'), encoding="utf-8")
    assert refused("check", str(file)) == (
        'given.rate.from is "table 2": it must name a page, as "page 7", as seen is text of a PDF'
    )
    file.write_text(text, encoding="utf-8")
    other = pdf_of(["(13)", ""], tmp_path / "other.pdf")
    assert refused("check", str(file), "--pdf", str(other)).startswith(f"pdf.sha256 is {hashed}: it must be that of")
    assert refused("new", "10.1000/x", "--pdf", str(file)).startswith(f"{file} is not a PDF that can be read: ")
    assert refused("new", "10.1000/x", "--pdf", str(tmp_path / "none.pdf")).endswith("No such file or directory")


def test_curves_are_read_from_a_figure(tmp_path: Path) -> None:
    from scipy.io import savemat

    line = {"type": "line", "properties": {"XData": [0.0, 1.0, 2.0], "YData": [3.0, 4.0, 5.0]}, "children": []}
    axes = {"type": "axes", "properties": {"Title": ""}, "children": line}
    figure = {"type": "figure", "properties": {"Name": ""}, "children": axes}
    path = tmp_path / "one.fig"
    savemat(path, {"hgS_070000": figure}, appendmat=False)
    (found,) = fig.lines(str(path))
    assert (found.x.tolist(), found.y.tolist(), found.axes) == ([0.0, 1.0, 2.0], [3.0, 4.0, 5.0], 0)
    assert CliRunner().invoke(cli, ["zoo", "curve", str(path), "--out", str(tmp_path)]).exit_code == 0
    assert (tmp_path / "one_1.csv").read_text(encoding="utf-8") == "x,y\n0,3\n1,4\n2,5\n"
    other = tmp_path / "other.fig"
    other.write_text("text", encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match=r"is not a MATLAB figure: "):
        fig.lines(str(other))
    savemat(other, {"x": 1.0}, appendmat=False)
    with pytest.raises(fg.ScenarioError, match=r"has no curves: it must be a MATLAB figure with lines"):
        fig.lines(str(other))


def test_operations_are_those_of_a_law_with_its_settings() -> None:
    counted = counts((Path(__file__).parents[2] / "benchmarks/results/flops.md").read_text(encoding="utf-8"))
    found = {name: operations_of(law, "F", counted) for name, law in laws.laws().items() if "F" in law.classes}
    known = {name: count for name, count in found.items() if count is not None}
    assert known.keys() == found.keys()
    one, linear, nodes, loops, everything = (
        known[f"network{name}"] for name in ("_constant", "_linear", "", "_loops", "_everything")
    )
    assert one < linear < nodes < loops < everything
    assert known["integral_sliding"] < known["lqg"] / 10
