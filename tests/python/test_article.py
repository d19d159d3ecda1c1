"""The article: it builds, has the length of one, and its numbers and sentences are those of runs, logs and results."""

from __future__ import annotations

import html
import importlib
import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typst
from fracgyro_lab.comparison.track_contenders import CONTENDERS

ROOT = Path(__file__).resolve().parents[2]
ARTICLE = ROOT / "lab/article"
sys.path += [str(ARTICLE), str(ROOT / "benchmarks")]

MODULES = ("comparison", "limits", "logs", "rating", "replication", "sensing", "tracking", "words")
comparison, limits, logs, rating, replication, sensing, tracking, words = map(importlib.import_module, MODULES)

# Loaded by its path, because a package on PyPI has the same name.
_spec = importlib.util.spec_from_file_location("article_build", ARTICLE / "build.py")
assert _spec is not None
assert _spec.loader is not None
build = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(build)

CEILINGS = (0.0035, 0.05)
CONDITIONS = (
    "one step of delay",
    "one step of hidden delay",
    "12 bit",
    "K -300 ppm, drifting",
    "4 times as long",
    "K +5 %",
    "rate 0",
)
EFFORT = {"trials": 200, "seeds": 8, "samplers": 3, "held_out": 100, "few": 10, "quick": False}
Row = dict[str, Any]


def about(value: float, by: float = 0.02) -> dict[str, float]:
    return {"value": value, "low": value * (1 - by), "high": value * (1 + by)}


STEADY = 1e-4  # steady error of a contender whose error is that of the paper's


def steady(value: float) -> dict[str, Any]:
    return {f"rmse_steady_{axis}": about(value) for axis in "xy"}


def chattering(value: float) -> dict[str, Any]:
    return {f"chattering_{axis}": about(value) for axis in "xy"}


def row(name: str, information: str, noise: float, ceiling: float, error: float, **changes: Any) -> Row:
    """Entry of compare-track.json: a made-up contender with a given multiple of the paper's error."""
    return {
        "name": name,
        "words": f"the controller called {name}",
        "class": information,
        "noise": noise,
        "ceiling": ceiling,
        "gains": {"controller.kp": 1.0},
        "sampler_errors": [error * 1e-4 * factor for factor in (1.0, 1.1, 1.2)],
        "range_ends": [],
        "diverged": 0,
        "metrics": {"error": about(error * 1e-4), **steady(error * STEADY), **chattering(ceiling / 2)},
        "ratio": about(error),
        "verdict": "less" if error < 0.9 else "more" if error > 1.1 else "undecided",
        "kept": True,
        "others": {name: {**about(1.5), "lost": 0, "seeds": 10} for name in CONDITIONS},
        "front": [[ceiling / 2, error * 2e-4], [ceiling, error * 1e-4]],
        "cost": {"ns_per_step": 100.0, "relative": 1.0, "state_bytes": 100},
        **changes,
    }


def track(errors: dict[str, float], **changes: dict[str, Any]) -> dict[str, Any]:
    """Contenders by name, with their errors in every cell; `changes` to rows, by name."""
    rows = [
        row(name, information, noise, ceiling, error, **changes.get(name, {}))
        for information in ("F", "P")
        for noise in (0.0, 1e-13)
        for ceiling in CEILINGS
        for name, error in errors.items()
    ]
    return {"task": "track", "version": "0.1.0", "effort": EFFORT, "contenders": rows}


def rate(**walks: float) -> dict[str, Any]:
    found = []
    for name, walk in walks.items():
        made = row(name, "P", 1e-13, 0.0, 1.0, scenario="dual_mass", front=[], others={})
        made["metrics"] = {"error": about(walk), "scale_factor_error": about(-10 * walk)}
        found.append(made)
    return {"task": "rate", "version": "0.1.0", "effort": EFFORT, "contenders": found}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The article on few seeds, with a comparison of all contenders of the package, made up."""
    out = tmp_path_factory.mktemp("article")
    errors = {contender.name: 0.5 + 0.1 * place for place, contender in enumerate(CONTENDERS)}
    rates = rate(force_rebalance=0.02, open_loop=0.021, adrc=0.03, lqg=0.018, paper=0.05, paper_joint=0.018)
    data = {"track": track({**errors, "paper": 1.0}), "rate": rates}
    build.write(out, replication.replicate(2), sensing.errors(2), data)
    return out


def pages(out: Path) -> int:
    found = typst.compile(out / "article.typ", format="png", ppi=10, **build.fonts())
    return len(found) if isinstance(found, list) else 1


def text(out: Path) -> str:
    """Text for the reader, including tables, which typst's HTML loses if they extend into the margin."""
    main = out / "text.typ"
    main.write_text('#show pad: it => it.body\n#include "article.typ"\n', encoding="utf-8")
    page = typst.compile(main, format="html", **build.fonts()).decode()
    page = re.sub(r"<style.*?</style>", "", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", page)))


def test_the_article_is_a_pdf_of_6_to_12_pages(written: Path) -> None:
    assert (written / "article.pdf").read_bytes().startswith(b"%PDF")
    assert 6 <= pages(written) <= 12  # 10, and up to two more where more settings and contenders take part


def test_the_article_has_its_tables_and_no_hole_where_a_value_belongs(written: Path) -> None:
    found = text(written)
    for there in ("least squares added", "nonsingular fast terminal", "force rebalance", "Mathematische Zeitschrift"):
        assert there in found
    assert not re.findall(r"\b(?:None|none|NaN|nan|inf|null)\b", found.replace("since the paper has none", ""))
    values = json.loads((written / "values.json").read_text(encoding="utf-8"))
    assert not [place for place, value in leaves(values) if value is None or value in ("", "nan", "inf", "None")]


def leaves(value: Any, place: str = "") -> list[tuple[str, Any]]:
    """Every value that a text can show, with its place."""
    items: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [leaf for key, each in items for leaf in leaves(each, f"{place}.{key}")] or (
        [] if isinstance(value, dict | list) else [(place, value)]
    )


def test_a_value_that_the_article_shows_and_nobody_wrote_stops_it(written: Path, tmp_path: Path) -> None:
    values = json.loads((written / "values.json").read_text(encoding="utf-8"))
    del values["end"]["threshold"]
    (tmp_path / "figures").symlink_to(written / "figures")
    with pytest.raises(typst.TypstError, match="threshold"):
        build.typeset(values, tmp_path)


def test_the_article_shows_verdicts_of_the_claims_code(written: Path) -> None:
    values = json.loads((written / "values.json").read_text(encoding="utf-8"))
    claims = values["claims"]
    printed = [line["id"] for line in claims["rows"] if line["printed"]["held"]]
    assert claims["names"]["printed"] == printed
    assert claims["held"]["printed"] == words.spelled(len(printed))
    assert f"{claims['held']['printed']} of nine claims hold as printed ({', '.join(printed)})" in text(written)


# Numbers of the original and limits chosen by the text; every other number with a point is a value.
STATED = {"0.9", "0.08", "3.11", "1.3", "1.5e-5", "0.1", "0.2", "0.81"}


def test_no_measured_number_is_typed_by_hand() -> None:
    source = (ARTICLE / "article.typ").read_text(encoding="utf-8")
    source = re.sub(r"//.*|#image\([^)]*\)|\b\d+(?:\.\d+)?(?:mm|pt|em|%|fr)", "", source)
    assert set(re.findall(r"(?<![\w.])\d+\.\d+(?:e-?\d+)?", source)) <= STATED


def test_a_missing_comparison_ends_in_one_sentence(tmp_path: Path) -> None:
    command = [sys.executable, ARTICLE / "build.py", "--comparison", tmp_path, "--out", tmp_path / "out"]
    ran = subprocess.run(command, capture_output=True, text=True)
    sentence = f"article: {tmp_path / 'compare-track.json'} is missing: `make compare` writes it\n"
    assert (ran.returncode, ran.stderr) == (1, sentence)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("content", ["[1, 2]", "{", '{"task": "track", "effort": {}, "contenders": []}'])
def test_what_is_not_a_comparison_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "compare-rate.json").write_text(content, encoding="utf-8")
    with pytest.raises(ValueError, match=r"compare-rate\.json"):
        comparison.load(tmp_path, "rate")


# -- The sentences -------------------------------------------------------------------------------------------


def ranking(errors: dict[str, float], **changes: dict[str, Any]) -> str:
    found: str = tracking.values(track({"paper": 1.0, **errors}, **changes))["verdicts"]["P"]["sentence"]
    return found


def test_who_is_better_and_who_is_worse_is_read_from_the_intervals() -> None:
    found = ranking({"pid": 0.8, "lqg": 0.1, "adrc": 1.01, "linear": 9.0, "paper_joint": 0.1})
    assert "two have less error than the paper's (pid and lqg)" in found
    assert "one has more error or no gains within a ceiling (linear)" in found
    assert "undecided (adrc)" in found
    assert "joint" not in found  # a variant of the paper's own


def test_a_contender_without_gains_within_a_ceiling_is_not_called_better() -> None:
    assert "(pid)" in ranking({"pid": 0.1})
    lost = ranking({"pid": 0.1}, pid={"kept": False})
    assert "less error" not in lost
    assert "no gains within a ceiling (pid" in lost
    assert "less error than the paper's (pid" in ranking({"pid": 2.0}, paper={"kept": False})
    assert "undecided (pid)" in ranking({"pid": 2.0, "lqg": 1.0}, paper={"kept": False}, pid={"kept": False})


def test_a_comparison_that_the_text_cannot_speak_of_is_refused() -> None:
    half = track({"paper": 1.0})
    half["contenders"] = [each for each in half["contenders"] if each["class"] == "F"]
    with pytest.raises(ValueError, match="F and P are needed"):
        tracking.values(half)
    with pytest.raises(ValueError, match="no contender that kept the ceiling in F, exact"):
        tracking.values(track({"paper": 1.0}, paper={"kept": False}))
    with pytest.raises(ValueError, match="no contender paper"):
        tracking.values(track({"pid": 1.0}))


def settings(found: dict[str, Any], name: str) -> dict[str, list[str]]:
    """Cells of a contender in the table of class F, by the first words of their heads."""
    table = found["tables"]["F"]
    (line,) = (line for line in table["rows"] if line["name"] == name)
    cells: dict[str, list[str]] = {}
    for head, cell in zip(table["heads"], line["cells"], strict=True):
        cells.setdefault(head, []).append(cell)
    return cells


def test_a_ratio_is_a_range_over_all_pairs_of_tunings() -> None:
    wide = {"sampler_errors": [1e-5, 1e-4, 1.1e-4]}
    found = settings(tracking.values(track({"paper": 1.0, "pid": 0.1}, pid=wide)), "pid")
    assert found["over the, paper's"] == ["0.083–1.1"] * 2  # 1e-5/1.2e-4 to 1.1e-4/1e-4
    failed = {"sampler_errors": [1e-5, None, 2e-5]}
    found = settings(tracking.values(track({"paper": 1.0, "pid": 0.1}, pid=failed)), "pid")
    assert found["over the, paper's"] == ["0.083–0.20"] * 2
    assert found["1e-13, ≤ 0.0035"] == ["10.0‡"]
    beyond = settings(tracking.values(track({"paper": 1.0, "pid": 0.1}, pid={"kept": False})), "pid")
    assert beyond["over the, paper's"] == ["–"] * 2
    assert beyond["over, limit"] == ["–"] * 2


@pytest.mark.parametrize(("information", "times"), [("F", (1e-4 / 3.1e-6, 1e-4 / 2.3e-6)), ("P", (2.6, 3.1))])
def test_errors_are_measured_by_the_computed_limit(information: str, times: tuple[float, float]) -> None:
    """The limits are those of docs/limit.md."""
    data = track({"paper": 1.0, "lqg": 0.5})["contenders"]
    rows = [each for each in data if (each["class"], each["noise"], each["name"]) == (information, 1e-13, "paper")]
    assert [tracking.over_limit(each) for each in rows] == pytest.approx(list(times), rel=0.05)
    for each in rows:
        of = limits.limit(information, 1e-13, each["ceiling"])
        at_limit = {f"rmse_steady_{axis}": about(value) for axis, value in zip("xy", of.steady, strict=True)}
        assert tracking.over_limit({**each, "metrics": at_limit}) == pytest.approx(1.0)
        assert of.steady[0] < of.total < 1e-3  # the transient weighs as much as the rest


def test_a_ceiling_that_no_law_keeps_has_no_limit() -> None:
    assert limits.limit("F", 1e-13, 1e-6) is None
    assert tracking.over_limit(row("pid", "F", 1e-13, 1e-6, 1.0)) == float("inf")


def test_the_nearest_to_the_limit_is_read_from_steady_errors() -> None:
    data = track({"paper": 1.0, "pid": 2.0, "lqg": 0.5, "adrc": 0.1}, adrc={"kept": False})
    found = tracking.values(data)
    assert {line["name"] for line in found["nearest"]} == {"lqg"}
    assert found["nearest"][-1]["setting"] == "P, 1e-13, ≤ 0.050"
    assert found["nearest"][-1]["chattering"] == "0.025"
    assert found["spans"]["nearest"] == "1.3 to 22"
    assert found["spans"]["paper"] == "2.6 to 43"


def test_a_difference_is_taken_apart_by_the_pairs_that_take_part() -> None:
    errors = {"paper": 1.0, "paper_integer_order": 2.0, "paper_joint": 0.5, "pid": 1.0, "lqg": 0.2}
    found = tracking.values(track(errors))["steps"]
    ranges = {line["words"]: (line["ratios"][0]["range"], line["ratios"][0]["decided"]) for line in found}
    assert ranges == {
        "the original's surface, on the joint Kalman filter": ("0.42–0.60", True),
        "the original's, with an order below 1": ("0.42–0.60", True),
    }
    (filtered,) = tracking.values(track({"paper": 1.0, "pid": 1.0, "pid_kalman": 1.1}))["steps"]
    assert (filtered["group"], filtered["ratios"][0]) == ("Filter", {"range": "0.92–1.3", "decided": False})


def test_a_special_case_that_is_better_than_the_law_is_counted_as_tuning() -> None:
    found = tracking.values(track({"paper": 1.0, "paper_no_terminal": 0.5, "lqg": 0.1}))["contained"]
    assert (found["settings"], found["better"], found["any"], found["largest"]) == ("four", "four", True, "2.2")
    assert found["reached"].startswith("50.0 instead of 110")
    equal = {"sampler_errors": [1e-4, 1e-4]}
    converged = tracking.values(track({"paper": 1.0, "paper_no_terminal": 2.0, "lqg": 0.1}, paper=equal))["contained"]
    assert (converged["better"], converged["any"]) == ("no", False)


def test_the_cost_of_a_hidden_delay_is_that_of_those_near_the_limit() -> None:
    late = {"others": {"one step of hidden delay": {"value": 20.0, "lost": 0}}}
    lost = {"others": {"one step of hidden delay": {"value": None, "lost": 10}}}
    near = {"metrics": {"error": about(1e-5), **steady(2.5e-6), **chattering(1e-3)}}
    found = tracking.values(track({"paper": 1.0, "lqg": 0.1, "pid": 0.1}, lqg={**late, **near}, pid=near))
    assert found["delay"]["near"] == "eight results"
    assert found["delay"]["borne"] == "four"
    assert found["delay"]["worst"] == "lqg, × 20"
    assert found["delay"]["firsts"].startswith("pid (F ≤ 0.0035: 15.0), pid (F ≤ 0.050: 15.0)")
    found = tracking.values(track({"paper": 1.0, "lqg": 0.1, "pid": 0.1}, lqg={**lost, **near}, pid=near))
    assert found["delay"]["worst"] == "lqg, lost"
    (line,) = (line for line in found["robustness"]["rows"] if line["name"] == "lqg")
    assert line["delays"] == ["lost"] * 4
    nobody = tracking.values(track({"paper": 1.0, "lqg": 0.9}))["delay"]
    assert nobody["any"] is False


def test_a_comparison_with_a_row_of_the_limit_and_another_device_is_read() -> None:
    data = track({"paper": 1.0, "lqg": 0.5})
    plain = tracking.values(data)
    data["contenders"] += [row("limit", "F", 1e-13, 0.0035, 0.1)]
    data["contenders"] += [row(name, "P", 1e-13, 0.05, 2.0, scenario="dual_mass") for name in ("paper", "lqg")]
    data["contenders"][-1]["sampler_errors"] = [1e-4]
    found = tracking.values(data)
    assert found.pop("elsewhere") == [
        {"scenario": "dual mass", "setting": "P, 1e-13, ≤ 0.050", "name": "paper", "ratio": "0.83–1.2"}
    ]
    del plain["elsewhere"]
    assert found == plain


def test_more_settings_make_more_columns() -> None:
    data = track({"paper": 1.0, "lqg": 0.5})
    data["contenders"] += [row(name, "F", 1e-13, 0.0129, 1.0) for name in ("paper", "lqg")]
    found = tracking.values(data)
    assert found["places"] == ["F ≤ 0.0035", "F ≤ 0.013", "F ≤ 0.050", "P ≤ 0.0035", "P ≤ 0.050"]
    assert [len(found["tables"][c]["heads"]) for c in ("F", "P")] == [11, 8]


def test_a_table_has_the_first_contenders_and_those_always_shown() -> None:
    errors = {f"law_{place}": 0.1 + 0.01 * place for place in range(20)}
    table = tracking.values(track({**errors, "paper": 1.0, "pid": 2.0}))["tables"]["F"]
    names = [line["name"] for line in table["rows"]]
    assert names == [*(f"law {place}" for place in range(tracking.MOST_ROWS - 2)), "paper", "pid"]
    assert table["rest"] == [f"law {place}" for place in range(tracking.MOST_ROWS - 2, 20)]


def test_a_run_that_diverged_is_counted_in_its_cell() -> None:
    lost = {"diverged": 3, "metrics": {"error": dict.fromkeys(("value", "low", "high"))}, "kept": False}
    found = tracking.values(track({"paper": 1.0, "pid": 2.0}, pid={**lost, "ratio": None}))
    (pid,) = (line for line in found["tables"]["F"]["rows"] if line["name"] == "pid")
    assert pid["cells"] == ["3 diverged"] * 2 + ["3 diverged", "–", "–"] * 2


def test_the_spread_of_the_samplers_is_over_that_of_the_seeds() -> None:
    samplers = tracking.values(track({"paper": 1.0, "pid": 2.0}, pid={"sampler_errors": [1.0, 2.0, 4.0]}))["samplers"]
    assert (samplers["median"], samplers["largest"], samplers["failed"]) == ("2.60", "4.0", "no rows")
    assert (samplers["agree"], samplers["all"]) == ("0", "16")
    assert samplers["seeds"] == "1.04"


def test_the_rate_table_shows_what_is_there_from_the_least_walk_up() -> None:
    found = rating.values(rate(adrc=0.04, lqg=0.02, force_rebalance=0.0201))
    assert found["heads"] == ["ARW, deg/√h", "scale factor, ppm"]
    (table,) = found["tables"]
    assert [line["name"] for line in table["rows"]] == ["lqg", "force rebalance", "adrc"]
    assert table["rows"][0]["cells"] == ["0.0200(4)", "−0.200(4)"]


def test_who_keeps_no_limit_is_named_and_not_shown() -> None:
    data = rate(lqg=1.0, adrc=2.0, paper=3.0)
    for each in data["contenders"][1:]:
        each["kept"] = False
    (table,) = rating.values(data)["tables"]
    assert [line["name"] for line in table["rows"]] == ["lqg"]
    assert table["outside"] == ["adrc", "paper"]


def test_what_is_said_of_force_rebalance_needs_all_three_that_it_is_about() -> None:
    def known(**walks: float) -> dict[str, Any]:
        data = rate(**walks)
        for each in data["contenders"]:
            each["others"] = {"K +5 %": {**about(4.0), "lost": 0, "seeds": 10}}
        return rating.values(data)["industry"]

    assert known(lqg=1.0, force_rebalance=2.0) == {"known": False}
    found = known(lqg=1.0, force_rebalance=2.0, park_horowitz=3.0)
    assert found["known"]
    assert (found["filter_error"], found["rebalance_error"], found["classical_error"]) == ("1.0", "2.0", "3.0")
    assert found["ratio"] == "1.0 (0.98 to 1.0)"
    assert found["stiffness"] == {"lqg": "4.0", "park_horowitz": "4.0"}
    assert found["full_hidden"] == "–"


def test_the_filter_with_velocities_is_quoted_next_to_the_one_without() -> None:
    data = rate(lqg=1.0, force_rebalance=2.0, park_horowitz=3.0)
    for each in data["contenders"]:
        each["others"] = {"K +5 %": {**about(4.0), "lost": 0, "seeds": 10}}
    full = {**data["contenders"][0], "class": "F"}
    full["metrics"] = {"error": about(1.0), "bias_quadrature_hidden": about(1e5, 2.0)}
    data["contenders"].append(full)
    assert rating.values(data)["industry"]["full_hidden"] == "1(2)e5"


def test_metrics_that_nobody_named_are_shown_by_their_own_name() -> None:
    data = rate(lqg=1.0, adrc=2.0)
    for each in data["contenders"]:
        each["metrics"] = {"some_figure": about(1.0)}
    assert rating.values(data)["heads"] == ["some figure"]


def test_no_time_is_measured_for_a_copy_of_the_article(written: Path) -> None:
    values = json.loads((written / "values.json").read_text(encoding="utf-8"))
    (cost,) = (row for row in values["claims"]["rows"] if row["id"] == "i")
    for variant in ("printed", "corrected"):
        evidence = logs.row("reproduction", **{"": "i", "variant": variant})["evidence"]
        found = re.search(r"takes ([\d.]+) times.*range ([\d.]+) to ([\d.]+) over (\d+) paired", evidence)
        assert found is not None
        ratio, low, high, count = found.groups()
        assert cost[variant]["seen"] == f"{ratio} times the time of a step ({low} to {high} in {count} timings)"


def test_targets_have_the_same_bits_for_each_kind_of_number(monkeypatch: pytest.MonkeyPatch) -> None:
    assert build.method()["numbers"] == ["double", "float", "fixed"]
    rows = logs.rows

    def broken(log: str, *headings: str) -> list[dict[str, str]]:
        found: list[dict[str, str]] = rows(log, *headings)
        return [{**row, "parity hash": row["target"]} for row in found] if log == "parity" else found

    monkeypatch.setattr(logs, "rows", broken)
    with pytest.raises(ValueError, match="different bits"):
        build.method()


def test_the_abstract_says_once_that_a_correction_makes_a_stable_loop_unstable(written: Path) -> None:
    found = text(written)
    assert "This correction makes a stable loop unstable" in found.partition("Introduction")[0]
    assert len(re.findall(r"stable loop unstable", found)) == 1


@pytest.mark.parametrize(("diverged", "instead"), [("8 of 8", "7 of 8"), ("0 of 8", "1 of 8")])
def test_the_text_refuses_a_log_in_which_the_layer_does_not_decide(
    diverged: str, instead: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = logs.row("boundedness", reading="as corrected", layer="linear (its own)")
    assert replication._layers() == {"runs": "8", "at": own["at t"]}
    rows = logs.rows

    def changed(log: str, *headings: str) -> list[dict[str, str]]:
        found = rows(log, *headings)
        return [{**row, "diverged": instead if row["diverged"] == diverged else row["diverged"]} for row in found]

    monkeypatch.setattr(logs, "rows", changed)
    with pytest.raises(ValueError, match="it is not the layer that decides"):
        replication._layers()


def test_every_reference_states_which_part_of_it_was_read() -> None:
    found = (ARTICLE / "bibliography.yml").read_text(encoding="utf-8")
    sources = re.split(r"^(?=\w+:$)", found, flags=re.MULTILINE)[1:]
    assert len(sources) == 13
    for source in sources:
        assert len(re.findall(r"^  note: .*(Cited from memory|Abstract read|Read, as text)", source, re.MULTILINE)) == 1


CITED = """cff-version: 1.2.0
title: fracgyro
repository-code: https://example.org/code
authors:
  - given-names: Ada
    family-names: Example
  - name: The others
"""


def test_authors_and_address_are_those_of_the_citation_file(
    written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = text(written)
    assert "The fracgyro authors" in found
    assert "a clone of the repository" in found
    assert "http" not in found.partition("Abstract")[0].replace("https://doi.org", "")
    values = json.loads((written / "values.json").read_text(encoding="utf-8"))
    (tmp_path / "out").mkdir()
    (tmp_path / "out/figures").symlink_to(written / "figures")
    (tmp_path / "CITATION.cff").write_text(CITED, encoding="utf-8")
    monkeypatch.setattr(build, "CITATION", tmp_path / "CITATION.cff")
    build.typeset(values, tmp_path / "out")
    cited = text(tmp_path / "out")
    assert "Ada Example, The others" in cited
    assert "a clone of https://example.org/code" in cited
    assert "fracgyro authors" not in cited


# -- Logs and words ------------------------------------------------------------------------------------------


def test_a_log_gives_the_cell_that_it_prints() -> None:
    paper = logs.row("boundedness", surface="fractional fast terminal (paper)")
    text_of_log = (ROOT / "benchmarks/results/boundedness.md").read_text(encoding="utf-8")
    assert f"| fractional fast terminal (paper) | {paper['predicted']} | {paper['measured']} |" in text_of_log
    with pytest.raises(ValueError, match="0 rows"):
        logs.row("boundedness", surface="no such surface")
    with pytest.raises(ValueError, match="no table"):
        logs.rows("boundedness", "no such heading")
    with pytest.raises(ValueError, match="make bench"):
        logs.rows("no_such_log", "surface")


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (0.0, 2, "0"),
        (1234.5, 2, "1200"),
        (0.05, 2, "0.050"),
        (-0.051, 1, "−0.05"),
        (1.5e-5, 2, "1.5e-5"),
        (-1e-5, 2, "−1e-5"),
        (1e7, 2, "1e7"),
        (0.9996, 3, "1.00"),
        (float("nan"), 2, "–"),
        (None, 2, "–"),
    ],
)
def test_numbers_are_short(value: float | None, digits: int, expected: str) -> None:
    assert words.short(value, digits) == expected


@pytest.mark.parametrize(
    ("value", "half", "expected"),
    [
        (0.0181, 0.0021, "0.018(2)"),
        (-125.4, 13.0, "−130(10)"),
        (7.26, 1.0, "7(1)"),
        (7.26, 0.096, "7.3(1)"),
        (53.98, 0.001, "53.98"),
        (5.0, 0.0, "5.000"),
        (103600.0, 200.0, "1.036(2)e5"),
        (-1e5, 2e5, "−1(2)e5"),
    ],
)
def test_an_interval_is_the_last_digits(value: float, half: float, expected: str) -> None:
    assert words.concise(value, half) == expected
