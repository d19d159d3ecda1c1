"""Rates of samples: exact for polynomials, with an estimate that is larger than the error."""

from __future__ import annotations

import math
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.fractional import local_rates

SAMPLES = pytest.mark.parametrize("samples", [7, 8, 50])


@SAMPLES
@pytest.mark.parametrize("degree", range(8))
def test_a_polynomial_of_degree_6_has_exact_rates_at_every_sample(samples: int, degree: int) -> None:
    t = 0.5 * np.arange(samples) - 1.0
    found = local_rates(t**degree, 0.5)
    exact = degree * t ** max(degree - 1, 0)
    if degree <= 6:
        np.testing.assert_allclose(found.rates, exact, atol=1e-12 * abs(t).max() ** degree)
    else:
        assert abs(found.rates - exact).max() > 1e-3
    assert (found.error > 1e-3) == (degree > 4)


def test_the_error_is_below_its_estimate_and_of_sixth_order() -> None:
    errors = []
    for step in (0.1, 0.05):
        t = step * np.arange(round(20.0 / step))
        found = local_rates(np.stack([np.sin(t), np.cos(2.0 * t)], axis=1), step)
        error = abs(found.rates - np.stack([np.cos(t), -2.0 * np.sin(2.0 * t)], axis=1)).max(axis=0)
        assert (error < found.error).all()
        errors.append(error)
    assert errors[0] / errors[1] == pytest.approx(64.0, rel=0.15)


def test_noise_is_amplified_as_stated() -> None:
    noise = np.random.default_rng(6).normal(size=100_000)
    assert local_rates(noise, 0.01).rates.std() == pytest.approx(1.08 / 0.01, rel=0.01)


@pytest.mark.parametrize("order", [0.1, 0.5, 0.9])
def test_a_derivative_of_values_only_is_as_wrong_as_the_rates_at_most(order: float) -> None:
    step = 0.1
    t = step * np.arange(300)
    values, rates = np.sin(t) + 0.3 * np.cos(2.0 * t), np.cos(t) - 0.6 * np.sin(2.0 * t)
    off = abs(fg.fractional.caputo(values, None, step, order) - fg.fractional.caputo(values, rates, step, order))
    bound = local_rates(values, step).error * t ** (1.0 - order) / math.gamma(2.0 - order)
    assert (off <= bound).all()
    assert off.max() > 1e-9
    for operator in (fg.fractional.integral, fg.fractional.riemann_liouville):
        found = operator(values[:, None], None, step, order)[1:, 0]
        np.testing.assert_allclose(found, operator(values, rates, step, order)[1:], atol=bound.max())


def test_single_precision_stays_single() -> None:
    values = np.sin(0.1 * np.arange(50)).astype(np.float32)
    assert local_rates(values, 0.1).rates.dtype == np.float32
    assert fg.fractional.caputo(values, None, 0.1, 0.5).dtype == np.float32


@pytest.mark.parametrize(
    ("values", "step", "message"),
    [
        (np.zeros(6), 0.1, r"values has shape \(6,\): it must be .* no fewer than 7 samples"),
        (np.zeros((9, 2, 2)), 0.1, r"values has shape \(9, 2, 2\): it must be \(samples,\) or \(samples, channels\)"),
        (np.zeros(9), 0.0, "step is 0.0: it must be a positive number"),
        (np.zeros(9), math.inf, "step is inf: it must be a positive number"),
        (np.append(np.zeros(9), math.nan), 0.1, "values must be finite"),
    ],
)
def test_what_has_no_rates_is_refused(values: Any, step: float, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}"):
        local_rates(values, step)
