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

MODULES = ("comparison", "logs", "replication", "sensing", "words")
comparison, logs, replication, sensing, words = map(importlib.import_module, MODULES)

# Loaded by its path, because a package on PyPI has the same name.
_spec = importlib.util.spec_from_file_location("article_build", ARTICLE / "build.py")
assert _spec is not None
assert _spec.loader is not None
build = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(build)

CEILINGS = (0.0035, 0.05)
CONDITIONS = ("one step of delay", "12 bit", "K -300 ppm, drifting", "4 times as long", "K +5 %", "rate 0")
EFFORT = {"trials": 200, "seeds": 8, "samplers": 3, "held_out": 100, "few": 10, "quick": False}
Row = dict[str, Any]


def about(value: float, by: float = 0.02) -> dict[str, float]:
    return {"value": value, "low": value * (1 - by), "high": value * (1 + by)}


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
        "metrics": {"error": about(error * 1e-4)},
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


def test_the_article_is_a_pdf_of_6_to_10_pages(written: Path) -> None:
    assert (written / "article.pdf").read_bytes().startswith(b"%PDF")
    assert 6 <= pages(written) <= 10


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
    found: str = comparison.track(track({"paper": 1.0, **errors}, **changes))["verdicts"]["P"]["sentence"]
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
        comparison.track(half)
    with pytest.raises(ValueError, match="no contender of class F that kept"):
        comparison.track(track({"paper": 1.0}, paper={"kept": False}))
    with pytest.raises(ValueError, match="no contender paper"):
        comparison.track(track({"pid": 1.0}))


def test_a_difference_within_the_spread_of_the_samplers_has_no_mark() -> None:
    wide = {"sampler_errors": [1e-5, 1e-4, 1.1e-4]}
    assert "(pid)" in ranking({"pid": 0.1}, pid=wide)
    failed = {"sampler_errors": [1e-5, None, 1e-5]}
    assert "(pid)" in ranking({"pid": 0.1}, pid=failed)


def test_a_run_that_diverged_is_counted_in_its_cell() -> None:
    lost = {"diverged": 3, "metrics": {"error": dict.fromkeys(("value", "low", "high"))}, "kept": False}
    found = comparison.track(track({"paper": 1.0, "pid": 2.0}, pid={**lost, "ratio": None}))
    (pid,) = (line for line in found["tables"]["F"] if line["name"] == "pid")
    assert pid["cells"] == ["3 diverged"] * 4
    assert pid["ratio"] == "–"


def test_the_spread_of_the_samplers_is_over_that_of_the_seeds() -> None:
    samplers = comparison.track(track({"paper": 1.0, "pid": 2.0}, pid={"sampler_errors": [1.0, 2.0, 4.0]}))["samplers"]
    assert (samplers["median"], samplers["largest"], samplers["failed"]) == ("2.6", "4.0", "no rows")
    assert samplers["seeds"] == "1.04"


def test_the_rate_table_shows_what_is_there_from_the_least_walk_up() -> None:
    found = comparison.rate(rate(adrc=0.04, lqg=0.02, force_rebalance=0.0201))
    assert found["heads"] == ["ARW, deg/√h", "scale factor, ppm"]
    (table,) = found["tables"]
    assert [line["name"] for line in table["rows"]] == ["lqg", "force rebalance", "adrc"]
    assert table["rows"][0]["cells"] == ["0.0200(4)", "−0.200(4)"]


def test_who_keeps_no_limit_is_named_and_not_shown() -> None:
    data = rate(lqg=1.0, adrc=2.0, paper=3.0)
    for each in data["contenders"][1:]:
        each["kept"] = False
    (table,) = comparison.rate(data)["tables"]
    assert [line["name"] for line in table["rows"]] == ["lqg"]
    assert table["outside"] == ["adrc", "paper"]


def test_what_is_said_of_force_rebalance_needs_all_three_that_it_is_about() -> None:
    def known(**walks: float) -> dict[str, Any]:
        data = rate(**walks)
        for each in data["contenders"]:
            each["others"] = {"K +5 %": {**about(4.0), "lost": 0, "seeds": 10}}
        return comparison.rate(data)["industry"]

    assert known(lqg=1.0, force_rebalance=2.0) == {"known": False}
    found = known(lqg=1.0, force_rebalance=2.0, park_horowitz=3.0)
    assert found["known"]
    assert (found["filter_error"], found["rebalance_error"], found["classical_error"]) == ("1.0", "2.0", "3.0")
    assert found["ratio"] == "1.0 (0.98 to 1.0)"
    assert found["stiffness"] == {"lqg": "4.0", "park_horowitz": "4.0"}


def test_metrics_that_nobody_named_are_shown_by_their_own_name() -> None:
    data = rate(lqg=1.0, adrc=2.0)
    for each in data["contenders"]:
        each["metrics"] = {"some_figure": about(1.0)}
    assert comparison.rate(data)["heads"] == ["some figure"]


def test_no_time_is_measured_for_a_copy_of_the_article(written: Path) -> None:
    values = json.loads((written / "values.json").read_text(encoding="utf-8"))
    (cost,) = (row for row in values["claims"]["rows"] if row["id"] == "i")
    for variant in ("printed", "corrected"):
        evidence = logs.row("reproduction", **{"": "i", "variant": variant})["evidence"]
        ratio = re.search(r"takes ([\d.]+) times", evidence)
        assert ratio is not None
        assert cost[variant]["seen"] == f"{ratio[1]} times the time of a step"


def test_targets_have_the_same_bits_for_each_kind_of_number(monkeypatch: pytest.MonkeyPatch) -> None:
    assert build.method()["numbers"] == ["double", "float", "fixed"]
    rows = logs.rows

    def broken(log: str, *headings: str) -> list[dict[str, str]]:
        found: list[dict[str, str]] = rows(log, *headings)
        return [{**row, "parity hash": row["target"]} for row in found] if log == "parity" else found

    monkeypatch.setattr(logs, "rows", broken)
    with pytest.raises(ValueError, match="different bits"):
        build.method()


def test_the_abstract_says_that_a_correction_makes_a_stable_loop_unstable(written: Path) -> None:
    found = text(written)
    assert "This correction makes a stable loop unstable" in found.partition("Introduction")[0]
    assert "Cited from memory" in found
    assert "github.com/fracgyro/fracgyro" in found


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
    ],
)
def test_an_interval_is_the_last_digits(value: float, half: float, expected: str) -> None:
    assert words.concise(value, half) == expected
