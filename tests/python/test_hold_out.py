"""Comparison of a tuned scenario with its base, on made-up metrics with known results."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fracgyro.study.tune.criteria import Constraint, Measured, Objective
from fracgyro.study.tune.hold_out import Compared, Constrained, _compared, _constrained, _objected

SPREAD = np.linspace(-1.0, 1.0, 20)  # the interval of a mean is ±0.2916
NONE = np.zeros(20, dtype=bool)


def measured(values: np.ndarray) -> Measured:
    return Measured({"effort_x": values, "rate_error": values}, NONE)


@pytest.mark.parametrize(
    ("gap", "verdict"),
    [(-0.30, "confirmed"), (-0.28, "undecided"), (0.0, "undecided"), (0.28, "undecided"), (0.30, "refuted")],
)
def test_a_gain_is_confirmed_or_refuted_where_the_interval_of_the_paired_difference_excludes_zero(
    gap: float, verdict: str
) -> None:
    theirs = 10 + np.arange(20.0)  # far more spread than the difference, which is by seed
    found = _objected(Objective(metric="effort_x"), measured(theirs), measured(theirs + gap + SPREAD), 7.0, 6.0)
    assert found.verdict == verdict
    assert found.difference.mean == pytest.approx(gap)
    assert (found.searched_base, found.searched) == (7.0, 6.0)
    assert (found.base, found.tuned) == (pytest.approx(19.5), pytest.approx(19.5 + gap))
    assert (found.label, found.metric) == ("mean of effort_x", "effort_x")


def test_of_a_signed_metric_the_magnitude_is_compared() -> None:
    theirs, ours = np.full(20, -3.0), np.full(20, 2.0)
    found = _objected(Objective(metric="rate_error"), measured(theirs), measured(ours), 3.0, 2.0)
    assert (found.base, found.tuned, found.verdict) == (3.0, 2.0, "confirmed")
    assert found.difference == (-1.0, -1.0, -1.0)


def test_what_never_comes_about_decides_nothing() -> None:
    theirs, ours = np.full(20, 3.0), np.append(np.full(19, 1.0), math.nan)
    found = _objected(Objective(metric="effort_x"), measured(theirs), measured(ours), 3.0, 1.0)
    assert (found.tuned, found.verdict) == (math.inf, "undecided")
    assert found.difference == (math.inf, -math.inf, math.inf)


def test_the_bootstrap_draws_every_seed() -> None:
    theirs = np.zeros(20)
    for place in (0, 19):
        ours = np.where(np.arange(20) == place, 1.0, 0.0)
        found = _objected(Objective(metric="effort_x", statistic="max"), measured(theirs), measured(ours), 3.0, 1.0)
        assert found.difference == (1.0, 0.0, 1.0)  # in 36 % of the draws it is not there


@pytest.mark.parametrize(("value", "kept"), [(2.99, True), (3.0, True), (3.01, False)])
def test_a_constraint_is_kept_up_to_its_limit_on_the_seeds_held_out(value: float, kept: bool) -> None:
    base, mine = measured(np.full(20, 6.0)), measured(np.full(20, value))
    for constraint in (
        Constraint(metric="effort_x", at_most=3.0),
        Constraint(metric="effort_x", at_most_base=0.5),
    ):
        found = _constrained(constraint, base, mine, 2.5, 2.4)
        assert found == Constrained("mean of effort_x", "effort_x", 2.5, 2.4, 3.0, found.tuned, kept)
        assert found.tuned == pytest.approx(value)


def compared(theirs: np.ndarray, ours: np.ndarray, metric: str = "effort_x") -> Compared:
    return _compared(metric, theirs, ours)


@pytest.mark.parametrize(("gap", "verdict"), [(-0.30, "better"), (-0.28, ""), (0.28, ""), (0.30, "worse")])
def test_a_metric_is_better_or_worse_by_its_interval(gap: float, verdict: str) -> None:
    found = compared(np.full(20, 5.0), 5.0 + gap + SPREAD)
    assert (found.verdict, found.neutral) == (verdict, False)
    assert (found.base, found.tuned) == (pytest.approx(5.0), pytest.approx(5.0 + gap))
    assert (found.never_base, found.never_tuned) == (0, 0)


def test_a_metric_that_comes_about_more_often_is_better_whatever_its_mean() -> None:
    some = np.array([1.0, 2.0, math.nan, math.nan])
    found = compared(some, np.array([9.0, 9.0, 9.0, math.nan]))
    assert (found.never_base, found.never_tuned, found.verdict) == (2, 1, "better")
    assert (found.base, found.tuned) == (1.5, 9.0)
    assert found.difference is not None
    assert found.difference.mean == 7.5  # the two in which both occurred
    assert compared(np.array([9.0, 9.0, 9.0, math.nan]), some).verdict == "worse"
    alone = compared(np.array([1.0, math.nan]), np.array([2.0, math.nan]))
    assert (alone.difference, alone.verdict) == (None, "")
    never = compared(np.full(2, math.nan), np.full(2, math.nan))
    assert math.isnan(never.base)
    assert math.isnan(never.tuned)


def test_magnitudes_are_compared_and_the_bounds_are_neither_better_nor_worse() -> None:
    found = compared(np.full(4, -3.0), np.full(4, 2.0), "rate_error")
    assert (found.base, found.tuned, found.verdict) == (3.0, 2.0, "better")
    assert compared(np.full(4, 1.0), np.full(4, 2.0), "bound_final_0").neutral
