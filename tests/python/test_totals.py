"""A summary without rows, against that of the rows: from the metadata of blocks of any size."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fracgyro.scenario import ScenarioError
from fracgyro.study import sweep
from fracgyro.study.space import Dimension
from fracgyro.study.sweep import blocks, effects
from fracgyro.study.sweep.block_files import BlockFiles, aggregates
from fracgyro.study.sweep.design import Plan, read_plan
from fracgyro.study.sweep.point_columns import Points
from fracgyro.study.sweep.totals import MAX_GROUPS, Moments, Totals, kept
from test_sweep import study

SHOW = 'show = ["effort_x", "rate_error_rms"]\nquantiles = false\n'
SAMPLE = """[design]
kind = "random"
points = 40
[vary]
controller.order = { low = 0.2, high = 0.8 }
adaptation.rate_gain = { low = 1.0, high = 300.0, scale = "log" }
controller.adaptive = [true, false]
"""
GRID = '[vary]\ncontroller.order = [0.2, 0.4, 0.9]\ncontroller.kind = ["linear", "fractional"]\n'
LIST = '[design]\nkind = "list"\n' + GRID.replace(", 0.9", "")


def rows_and_totals(folder: Path, text: str) -> tuple[Plan, effects.Rows, Totals]:
    """Made-up rows, some of which diverged or lack a metric, and the sums over the blocks that they are in."""
    plan = read_plan(study(folder, SHOW + text))
    work = blocks.blocks(plan)
    rng = np.random.default_rng(1)
    tables, sums = [], Totals(plan)
    for block in work:
        table = block.keys()
        gone = rng.random(block.runs) < 0.03
        for name in ("effort_x", "rate_error_rms"):
            values = rng.normal(0.1, 1.0, block.runs)
            values[rng.random(block.runs) < 0.05] = np.nan
            table = table.append_column(name, pa.array(values, pa.float64(), from_pandas=True))
        ended = pa.array(np.where(gone, 1.0, np.nan), pa.float64(), from_pandas=True)
        table = table.append_column("diverged_at", ended)
        tables.append(table)
        found = json.loads(json.dumps(aggregates(table) | {"summary": kept(plan, block, table)}, allow_nan=False))
        sums.add(block, found)
    return plan, effects.Rows.of(plan, pa.concat_tables(tables)), sums


@pytest.mark.parametrize("most", [4096, 24, 7, 1], ids="blocks of {}".format)
@pytest.mark.parametrize(("text", "seeds"), [(SAMPLE, 1), (SAMPLE, 9), (GRID, 1), (GRID, 9), (LIST, 9)])
def test_figures_of_blocks_are_those_of_all_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, seeds: int, most: int
) -> None:
    monkeypatch.setattr(blocks, "RUNS_PER_BLOCK", most)
    plan, rows, sums = rows_and_totals(tmp_path, f"seeds = {seeds}\n{text}")
    assert (sums.runs, sums.diverged) == (plan.runs, rows.diverged)
    for name in plan.study.show:
        values = rows.metric(name)[~np.isnan(rows.metric(name))]
        spread = sums.spread[name]
        expected = [len(values), values.mean(), values.std(ddof=1), values.min(), values.max()]
        found = [spread.count, spread.mean, spread.deviation, spread.least, spread.greatest]
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        assert sums.never(name) == int((np.isnan(rows.metric(name)) & rows.kept).sum())
        for dimension in plan.dimensions:
            by_rows, by_sums = effects.effect(rows, name, dimension), sums.effect(name, dimension)
            assert by_sums.partial == by_rows.partial
            assert by_sums.axis.names == by_rows.axis.names
            assert [m is None for m in by_sums.means] == [m is None for m in by_rows.means]
            for mine, theirs in zip(by_sums.means, by_rows.means, strict=True):
                if mine is not None and theirs is not None:
                    np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)
        mine, eligible = sums.best(name)
        best, of_rows = effects.best(rows, name, plan.study.show, 5)
        assert eligible == of_rows
        assert eligible > 0 or text != SAMPLE
        assert [each.point for each in mine] == [each.point for each in best]
        assert [each.values for each in mine] == [each.values for each in best]
        for one, other in zip(mine, best, strict=True):
            np.testing.assert_allclose(one.means, other.means, rtol=1e-9, atol=1e-12)


def test_divergences_are_counted_at_each_place(tmp_path: Path) -> None:
    plan, rows, sums = rows_and_totals(tmp_path, f"seeds = 9\n{GRID}")
    assert rows.diverged
    for dimension, (along, counts) in zip(plan.dimensions, sums.diverged_where(), strict=True):
        index = effects.axis(rows, dimension, 8).index
        expected = [(int((index == at).sum()), int((~rows.kept)[index == at].sum())) for at in range(len(along.places))]
        assert counts == expected


def test_more_seeds_than_groups_give_an_interval_over_groups(tmp_path: Path) -> None:
    seeds = 4 * MAX_GROUPS
    plan, rows, sums = rows_and_totals(tmp_path, f"seeds = {seeds}\n{GRID}")
    dimension = plan.dimensions[0]
    here = effects.axis(rows, dimension, 8).index == 1
    group = np.tile(np.arange(seeds) // 4, len(plan.points))
    metric = rows.metric("effort_x")
    means = [np.nanmean(metric[here & (group == g)]) for g in range(MAX_GROUPS)]
    found = sums.effect("effort_x", dimension).means[1]
    assert found is not None
    np.testing.assert_allclose(found, effects.mean_interval(means), rtol=1e-9)


def test_moments_of_parts_are_those_of_all() -> None:
    values = np.random.default_rng(0).normal(1e6, 1.0, 1000)
    sums = Moments()
    for part in np.split(values, [1, 1, 400, 999]):
        sums.add(Moments.of(part))
    assert sums.count == 1000
    assert sums.deviation == pytest.approx(values.std(ddof=1), rel=1e-9)


# -- From the command


RUN = """seeds = 2
show = ["effort_x", "rate_error_rms"]
[fixed]
run.duration = 0.2
metrics.transient = 0.1
"""


def test_the_page_comes_from_the_metadata_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = RUN.replace("metrics.transient = 0.1\n", "") + "[metrics]\ntransient = 0.1\n" + SAMPLE
    path = study(tmp_path, "quantiles = false\n" + text)
    monkeypatch.setattr(blocks, "RUNS_PER_BLOCK", 16)
    first = sweep(path, tmp_path / "out")
    page = first.summary.read_text(encoding="utf-8")
    for part in ("standard deviation", "Best points", "effort_x", "<code>quantiles = false</code>"):
        assert part in page
    assert "rank correlation" not in page.replace("maps and rank correlations", "")

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("rows are read")

    monkeypatch.setattr(BlockFiles, "finished", lambda *_: True)
    monkeypatch.setattr(pq, "read_table", refused)
    sweep(path, tmp_path / "out", resume=True)
    assert first.summary.read_text(encoding="utf-8") == page


def test_blocks_that_were_written_for_another_summary_are_read(tmp_path: Path) -> None:
    text = RUN.replace("metrics.transient = 0.1\n", "") + "[metrics]\ntransient = 0.1\n" + SAMPLE
    made = sweep(study(tmp_path, text), tmp_path / "out")
    sweep(study(tmp_path, "quantiles = false\n" + text), tmp_path / "out", resume=True)
    again = made.summary.read_text(encoding="utf-8")
    sweep(study(tmp_path, "quantiles = false\n" + text), tmp_path / "new")
    assert again == (tmp_path / "new" / "summary.html").read_text(encoding="utf-8")
    assert "standard deviation" in again


def test_indices_need_rows(tmp_path: Path) -> None:
    text = 'quantiles = false\n[design]\nkind = "sobol_indices"\npoints = 16\n'
    with pytest.raises(ScenarioError, match=r'^quantiles is false: it must be true when design\.kind is "sobol_ind'):
        read_plan(study(tmp_path, text + "[vary]\ncontroller.order = { low = 0.2, high = 0.8 }\n"))


# -- Points


DIMENSIONS = (
    Dimension("a", -1.0, 3.0),
    Dimension("b", 0.1, 30.0, scale="log"),
    Dimension("c", 1.0, 7.0, integer=True),
    Dimension("d", 1.0, 700.0, scale="log", integer=True),
    Dimension("e", 0.0, 0.0, choices=(True, "x", (1.0, 2.0))),
)


def test_drawn_points_are_those_of_one_value_at_a_time() -> None:
    units = np.random.default_rng(3).random((5000, len(DIMENSIONS)))
    units[0] = 0.0
    units[1] = np.nextafter(1.0, 0.0)
    points = Points.drawn(DIMENSIONS, units)
    expected = [tuple(d.at(float(u)) for d, u in zip(DIMENSIONS, row, strict=True)) for row in units]
    assert list(points) == expected
    assert [list(map(type, point)) for point in points] == [list(map(type, point)) for point in expected]
    assert (points[4999], points[-1], len(points)) == (expected[4999], expected[-1], 5000)
    assert list(points[4000:4200]) == expected[4000:4200]
    assert points[10:20].column(2) == [point[2] for point in expected[10:20]]
    assert len(points[7:3]) == 0


def test_points_of_grids_are_every_combination() -> None:
    axes: list[tuple[Any, ...]] = [(1.0, 2.0, 3.0), ("a", "b"), (True,), (4, 5)]
    expected = [(a, b, c, d) for a in axes[0] for b in axes[1] for c in axes[2] for d in axes[3]]
    points = Points.grid(axes)
    assert list(points) == expected
    assert list(points[3:9][1:]) == expected[4:9]
    assert list(Points.grid([])) == [()]
    with pytest.raises(ValueError, match="the step of a slice is 2: it must be 1"):
        points[::2]


def test_a_grid_of_a_million_points_needs_no_memory() -> None:
    axis = tuple(map(float, range(1000)))
    tracemalloc.start()
    points = Points.grid([axis, axis])
    assert sum(1 for _ in points) == len(points) == 10**6
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6
