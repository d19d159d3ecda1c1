"""Summary of a study, on made-up rows with known results: sampled designs, signed metrics, divergence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from fracgyro.analysis.confidence import mean_interval
from fracgyro.study.sweep import effects
from test_sweep import rows_of

SAMPLE = '[design]\nkind = "random"\npoints = 4\n[vary]\ncontroller.order = { low = 0.2, high = 0.4 }\n'


def sample(tmp_path: Path, values: list[float | None], diverged: list[float | None] | None = None) -> effects.Rows:
    """Four points at random, two seeds each."""
    return rows_of(tmp_path, "seeds = 2\n" + SAMPLE, values, diverged or [None] * 8)


def one_bin(rows: effects.Rows) -> effects.Effect:
    """All runs in one: the points lie in both halves."""
    return effects.effect(rows, "effort_x", rows.plan.dimensions[0])


def test_the_interval_of_a_sample_is_that_of_its_points_which_are_drawn_and_not_of_the_seeds(tmp_path: Path) -> None:
    # By point 1, 3, 5, 7, by seed 1 more or less: the means of the seeds are the farther apart.
    rows = sample(tmp_path, [-9.0, 11.0, -7.0, 13.0, -5.0, 15.0, -3.0, 17.0])
    assert rows.units().tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    found = one_bin(rows)
    assert len(found.means) == 2  # the fewest bins
    low = found.axis.index[::2] == 0
    for place, here in enumerate((low, ~low)):
        assert found.means[place] == mean_interval(np.array([1.0, 3.0, 5.0, 7.0])[here])
    grid = rows_of(tmp_path, "seeds = 2\n[vary]\ncontroller.order = [0.2, 0.4]\n", [1.0, 2.0, 3.0, 4.0], [None] * 4)
    assert found.quantiles is not None
    assert found.quantiles[:, 0].tolist() == effects._quantiles(rows, "effort_x", found.axis.index == 0).tolist()
    assert grid.units().tolist() == [0, 1, 0, 1]
    assert effects.effect(grid, "effort_x", grid.plan.dimensions[0]).quantiles is None


def test_a_cell_of_a_sample_shows_the_median_and_of_a_grid_the_mean(tmp_path: Path) -> None:
    two = SAMPLE + "controller.terminal_exponent = { low = 0.2, high = 0.4 }\n"
    rows = rows_of(
        tmp_path, "seeds = 10\n" + two, [1.0, 2.0, 30.0, 2.0, 1.0, 1.0, 3.0, 3.0, 40.0, 2.0] * 4, [None] * 40
    )
    table = effects.cells(rows, "effort_x", *rows.plan.dimensions)
    assert (table.values[~table.empty] == 2.0).all()
    assert not table.partial.any()
    assert table.empty.sum() == 4 - len(np.unique(2 * table.up.index + table.across.index))


def test_quantiles_leave_out_the_runs_that_diverged_and_count_never_as_infinite(tmp_path: Path) -> None:
    values: list[float | None] = [1.0, 2.0, 3.0, 4.0, None, 100.0, 200.0, 300.0]
    diverged: list[float | None] = [None] * 5 + [0.1, 0.2, 0.3]
    rows = sample(tmp_path, values, diverged)
    # With five values, 5, 25, 50, 75 and 95 % are the first, second, third, fourth and fifth.
    assert effects.quantiles(rows, "effort_x").tolist() == [1.0, 2.0, 3.0, 4.0, math.inf]
    assert rows.diverged == 3
    assert np.isnan(rows.metric("effort_x")[4:]).all()
    nothing = sample(tmp_path, [None] * 8, [0.1] * 8)
    assert np.isnan(effects.quantiles(nothing, "effort_x")).all()


def test_the_best_of_a_signed_metric_is_the_nearest_to_zero(tmp_path: Path) -> None:
    text = "seeds = 2\n[vary]\ncontroller.order = [0.2, 0.4, 0.6]\n"
    rows = rows_of(tmp_path, text, [-5.0, -3.0, 1.0, 2.0, -1.5, 0.5], [None] * 6)
    found, eligible = effects.best(rows, "effort_x", ["effort_x"], 2)
    assert [b.point for b in found] == [2, 1]  # means -4, 1.5, -0.5
    assert [b.means[0].mean for b in found] == [-0.5, 1.5]
    assert [b.values for b in found] == [(0.6,), (0.4,)]
    assert eligible == 3


def test_bins_of_a_range_are_even_or_even_in_their_logarithm(tmp_path: Path) -> None:
    text = (
        '[design]\nkind = "random"\npoints = 64\n[vary]\ncontroller.order = { low = 0.2, high = 0.6 }\n'
        'adaptation.rate_gain = { low = 1.0, high = 10000.0, scale = "log" }\n'
    )
    rows = rows_of(tmp_path, text, [float(i) for i in range(64)], [None] * 64)
    order, gain = (effects.axis(rows, dimension, 4) for dimension in rows.plan.dimensions)
    assert order.edges is not None
    assert gain.edges is not None
    assert order.edges == pytest.approx([0.2, 0.3, 0.4, 0.5, 0.6])
    assert order.places == pytest.approx([0.25, 0.35, 0.45, 0.55])
    assert gain.edges == pytest.approx([1.0, 10.0, 100.0, 1e3, 1e4])
    assert gain.places == pytest.approx([10**0.5, 10**1.5, 10**2.5, 10**3.5])
    assert (order.log, gain.log) == (False, True)
    assert order.numeric
    assert gain.numeric
    for axis, place in ((order, 0), (gain, 1)):
        values = np.array([float(point[place]) for point in rows.plan.points])
        assert axis.edges is not None
        assert ((axis.edges[axis.index] <= values) & (values <= axis.edges[axis.index + 1])).all()
    assert order.names[0] == "0.2 to 0.3"
    # 64 runs make 64/16 bins.
    assert len(effects.effect(rows, "effort_x", rows.plan.dimensions[0]).means) == 4


def test_levels_rise_where_they_are_numbers_and_keep_their_order_where_not(tmp_path: Path) -> None:
    text = '[vary]\ncontroller.order = [0.8, 0.2, 0.4]\ncontroller.kind = ["linear", "fractional"]\n'
    rows = rows_of(tmp_path, text, [float(i) for i in range(6)], [None] * 6)
    order, kind = (effects.axis(rows, dimension, 4) for dimension in rows.plan.dimensions)
    assert (order.names, order.places.tolist(), order.numeric) == (["0.2", "0.4", "0.8"], [0.2, 0.4, 0.8], True)
    assert order.log  # each twice the one before
    assert order.index.tolist() == [2, 2, 0, 0, 1, 1]
    assert (kind.names, kind.places.tolist(), kind.numeric) == (["linear", "fractional"], [0.0, 1.0], False)
    assert not kind.log
    switch = rows_of(tmp_path, "[vary]\ncontroller.adaptive = [true, false]\n", [1.0, 2.0], [None] * 2)
    assert effects.axis(switch, switch.plan.dimensions[0], 4).names == ["true", "false"]
    even = rows_of(tmp_path, "[vary]\ncontroller.order = [0.2, 0.4, 0.6]\n", [1.0, 2.0, 3.0], [None] * 3)
    assert not effects.axis(even, even.plan.dimensions[0], 4).log
    zero = rows_of(tmp_path, "[vary]\ncontroller.order = [0.0, 0.25, 1.0]\n", [1.0, 2.0, 3.0], [None] * 3)
    assert not effects.axis(zero, zero.plan.dimensions[0], 4).log


def test_values_are_even_to_a_millionth_of_their_gaps() -> None:
    for size in (1e-4, 1.0, 1e4):
        assert effects._even(size * np.array([0.0, 1.0, 2.0 + 5e-7]))
        assert not effects._even(size * np.array([0.0, 1.0, 2.0 + 5e-6]))


def test_a_rank_correlation_is_spearmans(tmp_path: Path) -> None:
    text = "seeds = 2\n[vary]\ncontroller.order = [0.2, 0.4, 0.6, 0.8, 1.0]\n"
    # Means of the points 2, 1, 4, 3, 3: ranks 2, 1, 5, 3.5, 3.5 against 1 to 5.
    rows = rows_of(tmp_path, text, [1.0, 3.0, 0.0, 2.0, 4.0, 4.0, 3.0, 3.0, 3.0, 3.0], [None] * 10)
    assert effects._ranks(np.array([2.0, 1.0, 4.0, 3.0, 3.0])).tolist() == [2.0, 1.0, 5.0, 3.5, 3.5]
    ranks = np.array([2.0, 1.0, 5.0, 3.5, 3.5]) - 3
    expected = float(ranks @ np.arange(-2, 3) / math.sqrt(ranks @ ranks * 10))
    assert effects.rank_correlation(rows, "effort_x", rows.plan.dimensions[0]) == pytest.approx(expected)
    three = rows_of(tmp_path, "[vary]\ncontroller.order = [0.2, 0.4, 0.6]\n", [1.0, 2.0, 3.0], [None] * 3)
    assert effects.rank_correlation(three, "effort_x", three.plan.dimensions[0]) == pytest.approx(1.0)
    few = rows_of(tmp_path, "[vary]\ncontroller.order = [0.2, 0.4, 0.6]\n", [1.0, None, 3.0], [None] * 3)
    assert math.isnan(effects.rank_correlation(few, "effort_x", few.plan.dimensions[0]))
    same = rows_of(tmp_path, "[vary]\ncontroller.order = [0.2, 0.4, 0.6]\n", [1.0, 1.0, 1.0], [None] * 3)
    assert math.isnan(effects.rank_correlation(same, "effort_x", same.plan.dimensions[0]))
