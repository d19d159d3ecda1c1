"""Reference fractional operators against closed forms."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from fracgyro.fractional import full_history
from scipy.special import gamma, gammainc

ORDERS = [0.1, 0.5, 0.9]


def grid(duration: float, step: float) -> np.ndarray:
    return step * np.arange(round(duration / step) + 1)


def half_open(function: Callable[[float], complex], times: np.ndarray) -> np.ndarray:
    """`function` at every time but the first, where incomplete gamma functions are 0."""
    return np.array([0.0] + [complex(function(t)) for t in times[1:]])


def exponential_derivative(exponent: complex, order: float) -> Callable[[float], complex]:
    """Caputo derivative of exp(exponent t): exponent^order exp(exponent t) P(1 - order, exponent t)."""

    def at(time: float) -> complex:
        with mpmath.workdps(30):
            z = mpmath.mpmathify(exponent)
            share = mpmath.gammainc(1 - mpmath.mpf(order), 0, z * time, regularized=True)
            return complex(z**order * mpmath.exp(z * time) * share)

    return at


@pytest.mark.parametrize("order", [0.01, 0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_cubics_are_differentiated_and_integrated_to_rounding(order: float, power: int) -> None:
    times = grid(2.0, 1 / 64)
    rates = power * times ** max(power - 1, 0)
    integral, caputo = full_history.hermite(times**power, rates, 1 / 64, order)
    nu = 1.0 - order
    expected = gamma(power + 1) / gamma(power + 1 + nu) * times ** (power + nu)
    np.testing.assert_allclose(integral, expected, rtol=0, atol=1e-14 * expected.max())
    expected = power * gamma(max(power, 1)) / gamma(power + nu) * times ** max(power - order, 0.0)
    np.testing.assert_allclose(caputo, expected, rtol=0, atol=4e-14 * max(expected.max(), 1.0))


@pytest.mark.parametrize("order", ORDERS)
def test_the_exponential_is_reproduced_to_ten_digits(order: float) -> None:
    # For exp both operators are exp(t) P(1 - order, t), P the regularized incomplete gamma function.
    step = 1e-3
    times = grid(2.0, step)
    integral, caputo = full_history.hermite(np.exp(times), np.exp(times), step, order)
    expected = np.exp(times) * gammainc(1.0 - order, times)
    np.testing.assert_allclose(integral, expected, rtol=0, atol=5e-13)
    np.testing.assert_allclose(caputo, expected, rtol=0, atol=2e-10)


def test_the_half_derivative_of_exp_at_one_is_e_times_erf_one() -> None:
    step = 1e-3
    times = grid(1.0, step)
    caputo = full_history.hermite(np.exp(times), np.exp(times), step, 0.5)[1]
    assert caputo[-1] == pytest.approx(math.e * math.erf(1.0), abs=1e-11)
    assert caputo[-1] == pytest.approx(2.290698252303238, abs=1e-11)


@pytest.mark.parametrize("order", ORDERS)
def test_sines_are_differentiated_with_their_start_up_transient(order: float) -> None:
    step, turn = 0.01, 3.0
    times = grid(4.0, step)
    signal = np.column_stack([np.sin(turn * times), np.exp(-0.5 * times) * np.cos(turn * times)])
    rate_of_damped = np.exp(-0.5 * times) * (-0.5 * np.cos(turn * times) - turn * np.sin(turn * times))
    rates = np.column_stack([turn * np.cos(turn * times), rate_of_damped])
    caputo = full_history.hermite(signal, rates, step, order)[1]
    every = slice(0, None, 20)
    sine = half_open(exponential_derivative(1j * turn, order), times[every]).imag
    damped = half_open(exponential_derivative(-0.5 + 1j * turn, order), times[every]).real
    # The rate of sine starts at 3: error of the interpolant 9e-6 at most, of a wrong formula far more.
    np.testing.assert_allclose(caputo[every, 0], sine, rtol=0, atol=2e-5)
    np.testing.assert_allclose(caputo[every, 1], damped, rtol=0, atol=2e-5)


def test_the_half_derivative_of_cosine_has_its_tabulated_value() -> None:
    times = grid(0.34, 1e-3)
    caputo = full_history.hermite(np.cos(times), -np.sin(times), 1e-3, 0.5)[1]
    assert caputo[-1] == pytest.approx(-0.147174774607683, abs=1e-10)


def test_the_quarter_derivative_of_a_gaussian_has_its_tabulated_value() -> None:
    times = grid(2.3, 1e-3)
    bell = np.exp(-(times**2))
    caputo = full_history.hermite(bell, -2.0 * times * bell, 1e-3, 0.25)[1]
    assert caputo[-1] == pytest.approx(-0.762927553656252, abs=1e-10)


@pytest.mark.parametrize("order", ORDERS)
def test_integrating_the_caputo_derivative_gives_back_the_change_of_the_signal(order: float) -> None:
    # I^order D^order f = f - f(0).  For f = t^2 + t^3 the derivative has a closed-form rate of its own.
    step = 1e-3
    times = grid(1.0, step)
    signal, rates = 5.0 + times**2 + times**3, 2.0 * times + 3.0 * times**2
    caputo = full_history.hermite(signal, rates, step, order)[1]
    rate = 2.0 / gamma(2.0 - order) * times ** (1.0 - order)
    rate += 6.0 / gamma(3.0 - order) * times ** (2.0 - order)
    back = full_history.hermite(caputo, rate, step, 1.0 - order)[0]
    np.testing.assert_allclose(back, signal - signal[0], rtol=0, atol=3e-6)


def observed_order(errors: list[float]) -> float:
    return math.log2(errors[-2] / errors[-1])


@pytest.mark.parametrize("order", ORDERS)
def test_hermite_converges_at_four_minus_order_and_its_integral_at_four(order: float) -> None:
    integral_errors, caputo_errors = [], []
    for step in (1 / 32, 1 / 64, 1 / 128):
        times = grid(2.0, step)
        integral, caputo = full_history.hermite(np.exp(times), np.exp(times), step, order)
        expected = np.exp(times) * gammainc(1.0 - order, times)
        integral_errors.append(float(np.abs(integral - expected).max()))
        caputo_errors.append(float(np.abs(caputo - expected).max()))
    assert observed_order(caputo_errors) == pytest.approx(4.0 - order, abs=0.15)
    assert observed_order(integral_errors) == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize("order", [-0.5, 0.3, 0.9])
def test_grunwald_letnikov_converges_at_first_order(order: float) -> None:
    errors = []
    for step in (1 / 128, 1 / 256, 1 / 512):
        times = grid(1.0, step)
        result = full_history.grunwald_letnikov(times**2, step, order)
        errors.append(abs(result[-1] - 2.0 / math.gamma(3.0 - order)))
    assert observed_order(errors) == pytest.approx(1.0, abs=0.02)


def test_grunwald_letnikov_is_the_riemann_liouville_derivative_and_sees_the_jump_at_the_start() -> None:
    step = 1e-3
    result = full_history.grunwald_letnikov(np.ones(1001), step, 0.5)
    assert result[-1] == pytest.approx(1.0 / math.sqrt(math.pi), rel=1e-3)  # t^(-1/2)/Gamma(1/2), not 0


def test_grunwald_letnikov_equals_its_defining_sum() -> None:
    signal = np.sin(np.arange(12.0))
    weights = [(-1) ** k * float(mpmath.binomial(0.7, k)) for k in range(12)]
    expected = [sum(weights[k] * signal[n - k] for k in range(n + 1)) / 0.1**0.7 for n in range(12)]
    found = full_history.grunwald_letnikov(signal, 0.1, 0.7)
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-14)


def test_order_one_returns_values_and_rates_untouched() -> None:
    generator = np.random.default_rng(1)
    values, rates = generator.normal(size=(2, 50, 3))
    integral, caputo = full_history.hermite(values, rates, 0.1, 1.0)
    np.testing.assert_array_equal(integral, values)
    np.testing.assert_array_equal(caputo, rates)


def test_order_zero_returns_the_values_and_their_running_integral() -> None:
    times = grid(1.0, 0.01)
    integral, caputo = full_history.hermite(times**3, 3.0 * times**2, 0.01, 0.0)
    np.testing.assert_array_equal(caputo, times**3)
    np.testing.assert_allclose(integral, times**4 / 4.0, rtol=0, atol=1e-15)


def test_the_limits_of_the_order_are_the_change_of_the_values_and_the_rates() -> None:
    times = grid(1.0, 0.01)
    values, rates = np.cos(times), -np.sin(times)
    near_zero = full_history.hermite(values, rates, 0.01, 1e-12)[1]
    np.testing.assert_allclose(near_zero, values - values[0], rtol=0, atol=1e-11)
    integral, near_one = full_history.hermite(values, rates, 0.01, 1.0 - 1e-12)
    np.testing.assert_allclose(near_one, rates, rtol=0, atol=1e-11)
    np.testing.assert_allclose(integral[1:], values[1:], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("order", "expected"), [(0.0, [1.0, 3.0, 2.0]), (1.0, [2.0, 4.0, -2.0]), (-1.0, [0.5, 2.0, 3.0])]
)
def test_grunwald_letnikov_of_whole_orders_is_exact(order: float, expected: list[float]) -> None:
    assert full_history.grunwald_letnikov([1.0, 3.0, 2.0], 0.5, order).tolist() == expected


def test_channels_are_independent() -> None:
    times = grid(1.0, 0.01)
    values = np.column_stack([np.sin(times), 7.0 * times])
    rates = np.column_stack([np.cos(times), 7.0 + 0.0 * times])
    together = full_history.hermite(values, rates, 0.01, 0.4)
    for channel in (0, 1):
        alone = full_history.hermite(values[:, channel], rates[:, channel], 0.01, 0.4)
        for both, one in zip(together, alone, strict=True):
            np.testing.assert_allclose(both[:, channel], one, rtol=0, atol=1e-15)


def test_a_single_sample_has_no_history() -> None:
    integral, caputo = full_history.hermite([3.0], [1.0], 0.1, 0.5)
    assert integral.tolist() == caputo.tolist() == [0.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 2.0], [1.0], 0.1, 0.5), "rates must have the shape of values, (2,), got (1,)"),
        (([], [], 0.1, 0.5), "values must have shape (n,) or (n, channels) with n > 0, got (0,)"),
        (([1.0], [math.nan], 0.1, 0.5), "rates must be finite"),
        (([1.0], [1.0], 0.0, 0.5), "step must be positive and finite, got 0.0"),
        (([1.0], [1.0], 0.1, 1.5), "order must lie in [0, 1], got 1.5"),
        (([1.0], [1.0], 0.1, math.nan), "order must lie in [0, 1], got nan"),
    ],
)
def test_bad_arguments_of_hermite_are_named(
    arguments: tuple[list[float], list[float], float, float], message: str
) -> None:
    with pytest.raises(ValueError, match="^" + re.escape(message) + "$"):
        full_history.hermite(*arguments)


def test_bad_arguments_of_grunwald_letnikov_are_named() -> None:
    with pytest.raises(ValueError, match=r"^order must lie in \[-1, 1\], got 2$"):
        full_history.grunwald_letnikov([1.0], 0.1, 2)
    with pytest.raises(ValueError, match=r"^step must be positive and finite, got -1.0$"):
        full_history.grunwald_letnikov([1.0], -1.0, 0.5)
