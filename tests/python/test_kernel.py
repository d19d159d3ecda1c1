"""The exponentials of the fractional kernel: few enough, positive, and as accurate as they claim."""

from __future__ import annotations

import dataclasses
import math
import re

import mpmath
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.fractional import ExponentialSum, design
from fracgyro.fractional.kernel import _designed
from fracgyro.scenario import Scenario
from fracgyro.scenario.schema import MAX_STEPS
from fracgyro.scenario.to_core import core_setup
from hypothesis import given, settings
from hypothesis import strategies as st


def relative_error(found: ExponentialSum, times: np.ndarray) -> np.ndarray:
    kernel = times**-found.order / math.gamma(1.0 - found.order)
    return np.exp(-np.outer(times, found.poles)) @ found.weights / kernel - 1.0


def sampled_error(found: ExponentialSum, samples: int = 4001) -> float:
    return float(np.abs(relative_error(found, np.geomspace(found.shortest, found.longest, samples))).max())


# The fewest exponentials for [1e-3, 100]: minimax counts from an independent computation.
@pytest.mark.parametrize(
    ("order", "tolerance", "fewest"),
    [
        (0.1, 1e-3, 8), (0.1, 1e-6, 17), (0.1, 1e-9, 26),
        (0.5, 1e-3, 11), (0.5, 1e-6, 20), (0.5, 1e-9, 29),
        (0.9, 1e-3, 12), (0.9, 1e-6, 22), (0.9, 1e-9, 31),
    ],
)  # fmt: skip
def test_as_few_modes_as_the_best_possible_set_hold_the_tolerance(order: float, tolerance: float, fewest: int) -> None:
    found = design(order, 1e-3, 100.0, tolerance)
    assert found.count <= fewest
    assert found.error <= tolerance


@pytest.mark.parametrize("order", [0.1, 0.5, 0.9])
def test_the_error_alternates_twice_per_mode_so_no_set_of_that_size_is_much_better(order: float) -> None:
    # de la Vallee-Poussin: with 2n+1 alternations no n exponentials can beat the least of the peaks.
    found = design(order, 1e-3, 100.0, 1e-6)
    error = relative_error(found, np.geomspace(found.shortest, found.longest, 20001))
    lobes = np.split(error, np.flatnonzero(np.diff(np.sign(error))) + 1)
    peaks = [np.abs(lobe).max() for lobe in lobes]
    assert len(peaks) == 2 * found.count + 1
    assert min(peaks) > 0.95 * found.error


@pytest.mark.parametrize(
    ("order", "ratio", "tolerance"),
    [(0.001, 1e6, 1e-9), (0.01, 1e3, 1e-6), (0.5, 1e5, 1e-9), (0.9, 1e5, 1e-11), (0.999, 1e8, 1e-7)],
)
def test_the_certified_error_bounds_forty_digit_arithmetic_closely(
    order: float, ratio: float, tolerance: float
) -> None:
    found = design(order, 1e-3, 1e-3 * ratio, tolerance)
    with mpmath.workdps(40):
        rates, weights = map(mpmath.mpf, found.poles), map(mpmath.mpf, found.weights)
        pairs = list(zip(rates, weights, strict=True))
        scale = mpmath.gamma(1 - mpmath.mpf(order))
        # Both ends, and the neighborhoods of the highest peaks found in double precision.
        grid = np.geomspace(found.shortest, found.longest, 20001)
        worst = grid[np.argsort(np.abs(relative_error(found, grid)))[-200:]]
        times = [mpmath.mpf(t) for t in [found.shortest, found.longest, *grid[::100], *worst]]
        exact = max(abs(mpmath.fsum(w * mpmath.exp(-s * t) for s, w in pairs) * scale * t**order - 1) for t in times)
    assert exact <= found.error <= tolerance
    assert found.error <= 1.03 * float(exact)


@settings(max_examples=60)
@given(
    order=st.floats(1e-3, 0.999),
    decades=st.floats(1e-3, 6.0),
    digits=st.floats(1.0, 9.0),
    shortest=st.floats(1e-9, 1e9),
)
def test_every_design_is_positive_ascending_and_within_its_certified_error(
    order: float, decades: float, digits: float, shortest: float
) -> None:
    found = design(order, shortest, shortest * 10.0**decades, 10.0**-digits)
    assert len(found.poles) == len(found.weights) == found.count >= 1
    assert (found.poles > 0).all()
    assert (found.weights > 0).all()
    assert (np.diff(found.poles) > 0).all()
    assert found.error <= found.tolerance
    assert sampled_error(found) <= found.error + 1e-13  # the allowance is for the sampling's own rounding


@pytest.mark.parametrize("order", [1e-12, 1e-4, 1 - 1e-4, 1 - 2**-53])
@pytest.mark.parametrize("ratio", [1 + 1e-12, 1.5, 1e10])
def test_orders_and_ranges_at_the_limits_still_give_certified_modes(order: float, ratio: float) -> None:
    found = design(order, 1.0, ratio, 1e-6)
    assert sampled_error(found) <= found.error + 1e-13 <= 1.001e-6


def test_a_nearly_empty_range_needs_a_single_mode() -> None:
    assert design(0.5, 1.0, 1.001, 1e-6).count == 1


def test_a_change_of_the_unit_of_time_scales_rates_and_weights() -> None:
    order, unit = 0.7, 1024.0  # a power of two: the ratio of the range is the same number
    base = design(order, 1.0, 1e4, 1e-7)
    scaled = design(order, unit, unit * 1e4, 1e-7)
    np.testing.assert_allclose(scaled.poles, base.poles / unit, rtol=1e-15)
    np.testing.assert_allclose(scaled.weights, base.weights * unit**-order, rtol=1e-14)
    assert scaled.error == base.error


def test_a_tighter_tolerance_never_takes_fewer_modes() -> None:
    counts = [design(0.6, 1e-3, 10.0, 10.0**-digits).count for digits in range(1, 10)]
    assert counts == sorted(counts)


def test_a_recomputed_design_has_the_same_numbers() -> None:
    first = design(0.3, 1e-2, 10.0, 1e-5)
    _designed.cache_clear()
    again = design(0.3, 1e-2, 10.0, 1e-5)
    np.testing.assert_array_equal(again.poles, first.poles)
    np.testing.assert_array_equal(again.weights, first.weights)


def test_kernel_cannot_be_changed() -> None:
    found = design(0.3, 1e-2, 10.0, 1e-5)
    with pytest.raises(ValueError, match="read-only"):
        found.poles[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        found.weights[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.order = 0.4  # type: ignore[misc]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1.2, 1e-3, 1.0, 1e-6), "order must lie in (0, 1), got 1.2"),
        ((0.0, 1e-3, 1.0, 1e-6), "order must lie in (0, 1), got 0.0"),
        ((1, 1e-3, 1.0, 1e-6), "order must lie in (0, 1), got 1.0"),
        ((math.nan, 1e-3, 1.0, 1e-6), "order must lie in (0, 1), got nan"),
        ((0.5, 0.0, 1.0, 1e-6), "shortest must be a positive time between 1e-200 and 1e200, got 0.0"),
        ((0.5, -1.0, 1.0, 1e-6), "shortest must be a positive time between 1e-200 and 1e200, got -1.0"),
        ((0.5, math.nan, 1.0, 1e-6), "shortest must be a positive time between 1e-200 and 1e200, got nan"),
        ((0.5, 1.0, 1.0, 1e-6), "longest must be finite and greater than shortest = 1.0, got 1.0"),
        ((0.5, 1.0, math.inf, 1e-6), "longest must be finite and greater than shortest = 1.0, got inf"),
        ((0.5, 1.0, math.nan, 1e-6), "longest must be finite and greater than shortest = 1.0, got nan"),
        ((0.5, 1.0, 1e11, 1e-6), "longest must be at most 1e+10 times shortest = 1.0, got 100000000000.0"),
        ((0.5, 1.0, 10.0, 0.2), "tolerance must lie in [1e-11, 0.1], got 0.2"),
        ((0.5, 1.0, 10.0, 1e-13), "tolerance must lie in [1e-11, 0.1], got 1e-13"),
        ((0.5, 1.0, 10.0, math.nan), "tolerance must lie in [1e-11, 0.1], got nan"),
    ],
)
def test_bad_arguments_are_named_with_their_value_and_what_is_allowed(
    arguments: tuple[float, float, float, float], message: str
) -> None:
    with pytest.raises(ValueError, match="^" + re.escape(message) + "$"):
        design(*arguments)


@pytest.mark.parametrize("order", [1e-3, 0.1, 0.5, 0.9, 0.999])
def test_the_longest_run_at_the_smallest_tolerance_fits_into_the_controllers_memory(order: float) -> None:
    longest = Scenario.paper().replace({"controller.order": order, "run.duration": 1e6, "run.kernel_tolerance": 1e-9})
    assert longest.run.steps == MAX_STEPS
    assert 0 < core_setup(longest).kernel.count <= _core.kernel_capacity
