"""Sobol's indices of a sweep: against closed forms, from real runs, after an interruption, and undefined indices."""

from __future__ import annotations

import csv
import html
import json
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pyarrow.parquet as pq
import pytest
from command_server import fracgyro
from figure_data import LINK, Rows, read
from fracgyro.study import sweep
from fracgyro.study.sweep import blocks, indices
from fracgyro.study.sweep.design import Plan, read_plan
from numpy.typing import NDArray
from test_sweep import rows_of, study

Array = NDArray[np.float64]
VARY = """
[vary]
controller.order = { low = 0.2, high = 0.8 }
adaptation.rate_gain = { low = 1.0, high = 100.0, scale = "log" }
plant.angular_rate = { low = -100.0, high = 100.0 }
"""
# Without adaptation its gain has no effect, and only the rest of the force acts on the plant's stiffness.
REAL = """
seeds = 2
show = ["effort_x", "rate_error_rms"]
[fixed]
run.duration = 2.0
controller.adaptive = false
[design]
kind = "sobol_indices"
points = 64
[vary]
plant.stiffness.xx = { relative = 0.1 }
adaptation.rate_gain = { low = 1.0, high = 100.0, scale = "log" }
"""


def design(points: int) -> str:
    return f'show = ["effort_x"]\n[design]\nkind = "sobol_indices"\npoints = {points}\n'


def uniform(plan: Plan) -> Array:
    """The points in the unit cube."""
    order, gain, rate = np.array(plan.points, dtype=float).T
    return np.array([(order - 0.2) / 0.6, np.log10(gain) / 2, (rate + 100) / 200]).T


def of(found: list[indices.Index], order: str) -> list[list[float]]:
    """The index of each field with the ends of its interval."""
    return [[getattr(each, f"{order}{end}") for end in ("", "_low", "_high")] for each in found]


def table(path: Path) -> Rows:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# -- Closed forms --------------------------------------------------------------------------------------------


def test_the_blocks_are_two_samples_and_the_first_with_each_field_of_the_second(tmp_path: Path) -> None:
    cube = uniform(read_plan(study(tmp_path, design(16) + VARY))).reshape(5, 16, 3)
    a, b = cube[:2]
    for i, mixed in enumerate(cube[2:]):
        np.testing.assert_array_equal(mixed[:, i], b[:, i])
        others = [j for j in range(3) if j != i]
        np.testing.assert_array_equal(mixed[:, others], a[:, others])
    for column in (*a.T, *b.T):  # one in each of 16 stripes
        assert sorted(np.floor(16 * column).astype(int)) == list(range(16))
    assert (a != b).all()


def ishigami(x: Array) -> Array:
    """sin x1 + 7 sin² x2 + x3⁴ sin x1 / 10 over -π to π."""
    first, second, third = (2 * np.pi * x - np.pi).T
    return np.asarray(np.sin(first) + 7 * np.sin(second) ** 2 + 0.1 * third**4 * np.sin(first))


@pytest.mark.nightly
def test_the_indices_of_the_ishigami_function_are_its_closed_forms(tmp_path: Path) -> None:
    text = design(2048) + VARY
    values = ishigami(uniform(read_plan(study(tmp_path, text)))).tolist()
    found = indices.sensitivity(rows_of(tmp_path, text, values, [None] * len(values))).indices
    assert [each.field for each in found] == ["controller.order", "adaptation.rate_gain", "plant.angular_rate"]
    single = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 49 / 8, 0.0
    together = 0.01 * np.pi**8 * (1 / 18 - 1 / 50)  # the first and the third
    first = np.array(single) / (sum(single) + together)
    total = first + np.array([1, 0, 1]) * together / (sum(single) + together)
    for order, exact in (("first", first), ("total", total)):
        for (value, low, high), wanted in zip(of(found, order), exact, strict=True):
            assert low < wanted < high
            assert high - low < 0.2
            assert value == pytest.approx(wanted, abs=0.05)


def test_of_a_sum_both_indices_of_each_term_are_its_part_of_the_variance(tmp_path: Path) -> None:
    text = design(256) + VARY
    values = (uniform(read_plan(study(tmp_path, text))) @ [3.0, 4.0, 0.0]).tolist()
    found = indices.sensitivity(rows_of(tmp_path, text, values, [None] * len(values))).indices
    for order in ("first", "total"):
        for (value, low, high), wanted in zip(of(found, order), (9 / 25, 16 / 25, 0.0), strict=True):
            assert low <= wanted <= high
            assert value == pytest.approx(wanted, abs=0.03)


def test_of_a_single_field_both_indices_are_one(tmp_path: Path) -> None:
    text = design(64) + "[vary]\ncontroller.order = { low = 0.2, high = 0.8 }\n"
    values = [float(point[0]) ** 2 for point in read_plan(study(tmp_path, text)).points]
    (found,) = indices.sensitivity(rows_of(tmp_path, text, values, [None] * len(values))).indices
    assert (found.first, found.total) == (pytest.approx(1.0, abs=0.02), pytest.approx(1.0, abs=0.02))


def test_an_interval_holds_the_index_19_times_of_20() -> None:
    rng, parts, held = np.random.default_rng(0), np.array([0.36, 0.64]), 0
    for seed in range(40):
        a, b = rng.standard_normal((2, 128, 2)) * np.sqrt(parts)  # variance of the sum
        points = [a, b, np.stack([b[:, 0], a[:, 1]], axis=1), np.stack([a[:, 0], b[:, 1]], axis=1)]
        found = indices.indices(np.array(points).sum(axis=2), seed).reshape(2, 3, 2)
        held += int(((found[:, 1] < parts) & (parts < found[:, 2])).sum())
    assert 142 <= held <= 158  # 160 in all


# -- Real runs -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("real")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blocks, "RUNS_PER_BLOCK", 64)  # eight of them
        result = sweep(study(folder, REAL), folder / "out")
    assert result.runs == 2 * 4 * 64
    assert result.sensitivity is not None
    assert {each.metric for each in result.sensitivity.indices} == {"effort_x", "rate_error_rms"} - set(
        result.sensitivity.missing
    )
    return folder


def test_the_force_depends_on_the_stiffness_and_not_on_a_gain_that_is_off(real: Path) -> None:
    stiffness, gain = (row for row in table(real / "out" / "indices.csv") if row["metric"] == "effort_x")
    for order in ("first", "total"):
        assert float(stiffness[f"{order}_low"]) < 1.0 < float(stiffness[f"{order}_high"])
        assert float(gain[order]) == 0.0
    rows = pq.read_table(real / "out" / "runs")
    by_point = np.array(rows["effort_x"]).reshape(4, 64, 2).mean(axis=2)
    np.testing.assert_array_equal(by_point[0], by_point[3], "only the gain differs")
    again = indices.indices(by_point, 0)[:, 0]
    assert [float(each) for each in list(stiffness.values())[2:]] == pytest.approx(again.tolist(), rel=1e-8)


def test_the_page_has_the_indices_and_a_spread_of_independent_points_only(real: Path) -> None:
    page = (real / "out" / "summary.html").read_text(encoding="utf-8")
    saved = {name: unquote(html.unescape(text)) for name, text in LINK.findall(page)}
    assert read(saved["indices"]) == table(real / "out" / "indices.csv")
    assert '<h2 id="indices">' in page
    assert "Quantiles over 256 runs" in page
    rows = pq.read_table(real / "out" / "runs", filters=[("point", "<", 128)])["effort_x"].to_numpy()
    effect = next(row for row in read(saved["effort_x"]) if row["field"] == "adaptation.rate_gain")
    assert float(effect["5 % quantile"]) >= rows.min()
    assert f"{np.quantile(rows, 0.95, method='inverted_cdf'):.3g}</td>" in page


def test_a_study_that_was_cut_has_the_same_indices_and_page_when_resumed(
    real: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blocks, "RUNS_PER_BLOCK", 64)

    def cut(done: int, _: int) -> None:
        if done > 200:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(real / "study.toml", tmp_path / "out", progress=cut)
    assert not (tmp_path / "out" / "indices.csv").exists()
    assert 0 < sweep(real / "study.toml", tmp_path / "out", resume=True).resumed < 512
    for name in ("indices.csv", "summary.html"):
        assert (tmp_path / "out" / name).read_bytes() == (real / "out" / name).read_bytes()


# -- Undefined indices ---------------------------------------------------------------------------------------


def test_a_metric_that_a_point_lacks_or_that_never_changes_has_no_indices(tmp_path: Path) -> None:
    text = "seeds = 2\n" + design(16) + VARY
    values: list[float | None] = [float(i) for i in range(160)]
    diverged: list[float | None] = [None] * 160
    values[7] = None
    diverged[90] = 0.5
    found = indices.sensitivity(rows_of(tmp_path, text, values, diverged))
    assert found.indices == []
    assert found.missing == {
        "effort_x": "2 of 80 points have a run without it, and indices require all points",
    }
    same = indices.sensitivity(rows_of(tmp_path, text, [1.0] * 160, [None] * 160))
    assert same.missing == {"effort_x": "it is the same at every point"}


def test_runs_that_diverge_are_said_in_the_terminal_and_on_the_page(tmp_path: Path) -> None:
    text = """
show = ["rmse_whole_x"]
[fixed]
run.duration = 12.0
disturbance.hold = 0.008
[design]
kind = "sobol_indices"
points = 16
[vary]
run.step = [0.001, 0.008]
controller.order = { low = 0.5, high = 0.9 }
"""
    words = ["sweep", study(tmp_path, text), "--out", tmp_path / "out"]
    ran = fracgyro(*words)
    assert ran.returncode == 0, ran.stderr
    why = "32 of 64 points have a run without it, and indices require all points"
    assert f"rmse_whole_x has no Sobol indices: {why}." in ran.stdout
    assert "32 diverged" in ran.stdout
    assert f"has no indices: {why}." in (tmp_path / "out" / "summary.html").read_text(encoding="utf-8")
    assert table(tmp_path / "out" / "indices.csv") == []
    shown = json.loads(fracgyro(*words, "--resume", "--json").stdout)
    assert shown["sensitivity"] == {"indices": [], "missing": {"rmse_whole_x": why}}
