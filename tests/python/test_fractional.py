"""The O(1)-memory fractional operators against closed forms, and against the full-history reference.

A test names the error it allows: the kernel error times the signal's size, or the interpolant's.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from fracgyro import fractional
from scipy.special import rgamma

ORDERS = [0.1, 0.5, 0.9]
STEP = 1e-3


def grid(duration: float, step: float = STEP) -> np.ndarray:
    return step * np.arange(round(duration / step) + 1)


def sampled(function: Callable[[float], complex], times: np.ndarray) -> np.ndarray:
    with mpmath.workdps(30):
        return np.array([complex(function(t)) for t in times])


def exponential_derivative(exponent: complex, order: float) -> Callable[[float], complex]:
    """Caputo derivative of exp(exponent t): exponent^order exp(exponent t) P(1 - order, exponent t)."""

    def at(time: float) -> complex:
        if time == 0:
            return 0.0
        z = mpmath.mpmathify(exponent)
        share = mpmath.gammainc(1 - mpmath.mpf(order), 0, z * time, regularized=True)
        return z**order * mpmath.exp(z * time) * share

    return at


def mittag_leffler(order: float, second: float, argument: np.ndarray) -> np.ndarray:
    """E_(order, second) by its series, which for |argument| < 2 loses nothing to cancellation."""
    k = np.arange(600)
    return np.power(argument[:, None], k) @ rgamma(order * k + second)


# -- Closed forms --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0.01, 0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_powers_of_time_have_powers_of_time_as_derivative_and_integral(order: float, power: int) -> None:
    # The interpolant of a cubic is the cubic: only the kernel error remains, 1e-9.
    times = grid(2.0)
    values, rates = times**power, power * times ** max(power - 1, 0)
    found = fractional.integral(values, rates, STEP, 1 - order)
    expected = math.gamma(power + 1) / math.gamma(power + 2 - order) * times ** (power + 1 - order)
    np.testing.assert_allclose(found, expected, rtol=3e-9, atol=1e-12)
    found = fractional.caputo(values, rates, STEP, order)
    if power == 0:
        np.testing.assert_allclose(found, 0.0, atol=1e-14)
    else:
        expected = math.gamma(power + 1) / math.gamma(power + 1 - order) * times ** (power - order)
        np.testing.assert_allclose(found, expected, rtol=3e-9, atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("exponent", [1.0, -2.0, 3.0j, -0.5 + 3.0j])
def test_exponentials_sines_and_damped_sines_have_incomplete_gamma_derivatives(exponent: complex, order: float) -> None:
    times = grid(3.0)
    signal = np.exp(exponent * times)
    slope = exponent * signal
    channels = np.column_stack([signal.real, signal.imag]), np.column_stack([slope.real, slope.imag])
    found = fractional.caputo(*channels, STEP, order) @ [1, 1j]
    every = slice(0, None, 150)
    expected = sampled(exponential_derivative(exponent, order), times[every])
    np.testing.assert_allclose(found[every], expected, rtol=0, atol=1e-8 * max(1.0, abs(slope).max()))


@pytest.mark.parametrize(
    ("function", "order", "time", "expected"),
    [
        (lambda t: (np.exp(t), np.exp(t)), 0.5, 1.0, 2.290698252303238),  # e erf(1)
        (lambda t: (np.cos(t), -np.sin(t)), 0.5, 0.34, -0.147174774607683),
        (lambda t: (np.exp(-(t**2)), -2 * t * np.exp(-(t**2))), 0.25, 2.3, -0.762927553656252),
    ],
)
def test_derivatives_have_their_tabulated_values(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    order: float,
    time: float,
    expected: float,
) -> None:
    values, rates = function(grid(time))
    assert fractional.caputo(values, rates, STEP, order)[-1] == pytest.approx(expected, abs=5e-9)


@pytest.mark.parametrize("order", [0.3, 0.5, 0.9])
def test_the_mittag_leffler_function_is_minus_its_own_derivative(order: float) -> None:
    # D^a E_a(-t^a) = -E_a(-t^a), t > 0. The rate -t^(a-1) E_(a,a)(-t^a) is infinite at t = 0, so it is sampled from t =
    # start on; the part before is integrated here, in y = (t/start)^a, where it is smooth.
    start, step = 0.5, 0.01
    times = start + grid(1.5, step)
    values = mittag_leffler(order, 1.0, -(times**order))
    rates = -(times ** (order - 1)) * mittag_leffler(order, order, -(times**order))
    since = fractional.caputo(values, rates, step, order)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    y = (nodes + 1) / 2
    flow = -(start**order / order) * mittag_leffler(order, order, -(start**order) * y) * weights / 2
    for n in (20, 75, 150):
        before = flow @ (times[n] - start * y ** (1 / order)) ** -order / math.gamma(1 - order)
        assert since[n] + before == pytest.approx(-values[n], abs=1e-7)


@pytest.mark.parametrize("order", ORDERS)
def test_integrating_the_derivative_gives_back_the_change_of_the_signal(order: float) -> None:
    # I^a D^a e = e - e(0). For e = 5 + t^2 + t^3 the derivative has a finite rate in closed form.
    times = grid(1.0)
    values, rates = 5.0 + times**2 + times**3, 2.0 * times + 3.0 * times**2
    derivative = fractional.caputo(values, rates, STEP, order)
    slope = 2.0 / math.gamma(2 - order) * times ** (1 - order) + 6.0 / math.gamma(3 - order) * times ** (2 - order)
    back = fractional.integral(derivative, slope, STEP, order)
    np.testing.assert_allclose(back, values - values[0], rtol=0, atol=5e-6)


def test_half_integrals_compose_to_the_integral() -> None:
    times = grid(2.0)
    half = fractional.integral(times, np.ones_like(times), STEP, 0.5)
    twice = fractional.integral(half, 2 * np.sqrt(times / math.pi), STEP, 0.5)
    np.testing.assert_allclose(twice, times**2 / 2, rtol=0, atol=1e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_the_riemann_liouville_derivative_of_a_constant_is_not_zero(order: float) -> None:
    times = grid(1.0)
    constants = np.tile([3.0, 0.0], (len(times), 1))
    found = fractional.riemann_liouville(constants, np.zeros_like(constants), STEP, order)
    np.testing.assert_allclose(found[1:, 0], 3.0 * times[1:] ** -order / math.gamma(1 - order), rtol=1e-13)
    assert found[0, 0] == math.inf
    np.testing.assert_allclose(found[:, 1], 0.0, atol=1e-280)


@pytest.mark.parametrize("order", ORDERS)
def test_the_riemann_liouville_derivative_is_the_rate_of_the_integral(order: float) -> None:
    times = grid(2.0)
    signal = np.cos(times), -np.sin(times)
    area = fractional.integral(*signal, STEP, 1 - order)
    found = fractional.riemann_liouville(*signal, STEP, order)
    late = slice(200, -1)
    rate = (area[2:] - area[:-2]) / (2 * STEP)
    np.testing.assert_allclose(found[late], rate[199:], rtol=0, atol=2e-5)


def test_signals_that_start_at_zero_have_one_derivative_by_either_definition() -> None:
    times = grid(1.0)
    signal = np.sin(times), np.cos(times)
    np.testing.assert_array_equal(
        fractional.riemann_liouville(*signal, STEP, 0.7), fractional.caputo(*signal, STEP, 0.7)
    )


# -- Limits of the order -------------------------------------------------------------------------------------


def test_orders_zero_and_one_are_exact() -> None:
    times = grid(1.0)
    values, rates = np.cos(5 * times), -5 * np.sin(5 * times)
    for derivative in (fractional.caputo, fractional.riemann_liouville):
        np.testing.assert_array_equal(derivative(values, rates, STEP, 1.0), rates)
        np.testing.assert_array_equal(derivative(values, rates, STEP, 0.0), values)
    np.testing.assert_array_equal(fractional.integral(values, rates, STEP, 0.0), values)
    area = fractional.integral(values, rates, STEP, 1.0)
    np.testing.assert_allclose(area, np.sin(5 * times) / 5, rtol=0, atol=1e-12)


def test_the_limit_of_order_one_is_the_rate_and_of_order_zero_the_change() -> None:
    # D^(1-x) f = f' + O(x) for t > 0, and D^x f = f - f(0) + O(x): errors shrink with x, at its first power.
    times = grid(3.0)
    values, rates = np.cos(2 * times), -2 * np.sin(2 * times)
    late = slice(500, None)
    near_one, near_zero = [], []
    for x in (1e-2, 1e-3):
        near_one.append(np.abs(fractional.caputo(values, rates, STEP, 1 - x) - rates)[late].max())
        near_zero.append(np.abs(fractional.caputo(values, rates, STEP, x) - (values - 1.0))[late].max())
    for errors in (near_one, near_zero):
        assert errors[1] < 0.01
        assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.1)


# -- Accuracy ------------------------------------------------------------------------------------------------


def task_signal(count: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    t = step * np.arange(count)
    decay = np.exp(-0.5 * t)
    values = decay * np.sin(math.pi * t) - 0.3 * np.cos(0.5 * math.pi * t)
    rates = decay * (math.pi * np.cos(math.pi * t) - 0.5 * np.sin(math.pi * t))
    return values, rates + 0.15 * math.pi * np.sin(0.5 * math.pi * t)


def task_derivative(times: np.ndarray, order: float) -> np.ndarray:
    damped, slow = (
        exponential_derivative(-0.5 + math.pi * 1j, order),
        exponential_derivative(0.5j * math.pi, order),
    )
    return sampled(damped, times).imag - 0.3 * sampled(slow, times).real


@pytest.mark.parametrize("order", ORDERS)
def test_the_operator_agrees_with_the_full_history(order: float) -> None:
    values, rates = task_signal(20_001, STEP)
    integral, caputo = fractional.full_history.hermite(values, rates, STEP, order)
    np.testing.assert_allclose(fractional.caputo(values, rates, STEP, order), caputo, rtol=0, atol=1e-8)
    np.testing.assert_allclose(fractional.integral(values, rates, STEP, 1 - order), integral, rtol=0, atol=1e-8)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
def test_the_error_of_the_modes_is_within_the_tolerance_asked_for(tolerance: float) -> None:
    # |I^nu f - its exponentials| <= tolerance I^nu |f|, of the rate for the derivative.
    values, rates = task_signal(20_001, STEP)
    integral, caputo = fractional.full_history.hermite(values, rates, STEP, 0.9)
    size = np.arange(20_001) * STEP
    size = size**0.1 / math.gamma(1.1)
    slack = 1e-11
    found = fractional.integral(values, rates, STEP, 0.1, tolerance=tolerance)
    assert (np.abs(found - integral) <= tolerance * size * np.abs(values).max() + slack).all()
    found = fractional.caputo(values, rates, STEP, 0.9, tolerance=tolerance)
    off = np.abs(found - caputo)
    assert (off <= tolerance * size * np.abs(rates).max() + slack).all()
    assert off.max() > 1e-4 * tolerance  # it is the exponentials that are measured, not rounding


@pytest.mark.parametrize("order", ORDERS)
def test_the_derivative_converges_at_third_order_or_better(order: float) -> None:
    errors = []
    for step in (1 / 8, 1 / 16, 1 / 32, 1 / 64):
        found = fractional.caputo(*task_signal(round(4 / step) + 1, step), step, order, tolerance=1e-9)
        times = grid(4.0, 0.25)
        errors.append(np.abs(found[:: round(0.25 / step)] - task_derivative(times, order)).max())
    orders = [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]
    # The order of the interpolant's rate is 3 at one point, and 4 - order after integration.
    assert min(orders) > 3.0
    assert orders[-1] == pytest.approx(4.0 - order, abs=0.2)


@pytest.fixture(scope="module")
def task() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The task's signal, 80,000 samples, the sample numbers at which its derivative is known, and that."""
    values, rates = task_signal(80_000, STEP)
    # Dense where the error is greatest, just after the start.
    samples = np.unique(np.concatenate([np.arange(200), np.geomspace(200, 79_999, 300).astype(int)]))
    return values, rates, samples, task_derivative(samples * STEP, 0.9)


def test_the_task_signal_is_differentiated_to_1e_7_in_double_precision(task: tuple[np.ndarray, ...]) -> None:
    values, rates, samples, expected = task
    found = fractional.caputo(values, rates, STEP, 0.9, tolerance=1e-6)
    assert found.dtype == np.float64
    assert np.abs(found[samples] - expected).max() <= 1e-7
    # And at every sample, by way of the reference.
    caputo = fractional.full_history.hermite(values, rates, STEP, 0.9)[1]
    assert np.abs(caputo[samples] - expected).max() < 1e-9
    assert np.abs(found - caputo).max() <= 1e-7


def test_the_task_signal_is_differentiated_to_2e_5_in_single_precision(task: tuple[np.ndarray, ...]) -> None:
    values, rates, samples, expected = task
    found = fractional.caputo(values.astype(np.float32), rates.astype(np.float32), STEP, 0.9, tolerance=1e-6)
    assert found.dtype == np.float32
    assert np.abs(found[samples] - expected).max() <= 2e-5
    caputo = fractional.full_history.hermite(values, rates, STEP, 0.9)[1]
    assert np.abs(found - caputo).max() <= 2e-5


# -- Structure -----------------------------------------------------------------------------------------------

OPERATORS = [fractional.caputo, fractional.integral, fractional.riemann_liouville]


@pytest.mark.parametrize("operator", OPERATORS)
@pytest.mark.parametrize("channels", [1, 2, 3, 5])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_channels_do_not_touch_each_other(
    operator: Callable[..., np.ndarray], channels: int, dtype: type[np.floating]
) -> None:
    random = np.random.default_rng(channels)
    values, rates = random.normal(size=(2, 500, channels)).astype(dtype)
    values[0] = 0.0  # so that the Riemann-Liouville derivative is finite
    together = operator(values, rates, STEP, 0.6)
    assert (together.shape, together.dtype) == (values.shape, dtype)
    for i in range(channels):
        np.testing.assert_array_equal(together[:, i], operator(values[:, i], rates[:, i], STEP, 0.6))


@pytest.mark.parametrize("operator", OPERATORS)
def test_a_sample_depends_on_no_later_one(operator: Callable[..., np.ndarray]) -> None:
    random = np.random.default_rng(0)
    values, rates = random.normal(size=(2, 400))
    changed = values.copy(), rates.copy()
    for array in changed:
        array[250:] = 1e3
    whole, other = operator(values, rates, STEP, 0.6), operator(*changed, STEP, 0.6)
    np.testing.assert_array_equal(whole[:250], other[:250])
    assert whole[250] != other[250]
    # Only the part: its exponentials are designed for a shorter time, so that it is the same to their tolerance.
    part = operator(values[:250], rates[:250], STEP, 0.6)
    np.testing.assert_allclose(part[1:], whole[1:250], rtol=0, atol=1e-7)


@pytest.mark.parametrize("order", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_the_operators_are_linear_and_know_no_unit_of_time(order: float) -> None:
    random = np.random.default_rng(3)
    (a, b), (da, db) = random.normal(size=(2, 2, 300))
    combined = fractional.caputo(2 * a - 3 * b, 2 * da - 3 * db, STEP, order)
    separate = 2 * fractional.caputo(a, da, STEP, order) - 3 * fractional.caputo(b, db, STEP, order)
    np.testing.assert_allclose(combined, separate, rtol=0, atol=1e-10 * max(1.0, abs(combined).max()))
    # In microseconds instead of seconds.
    scaled = fractional.caputo(a, da * 1e-6, STEP * 1e6, order)
    plain = fractional.caputo(a, da, STEP, order)
    np.testing.assert_allclose(scaled * 1e6**order, plain, rtol=0, atol=1e-8 * abs(plain).max())


@pytest.mark.parametrize("order", [0.1, 0.5, 0.9, 1.0])
def test_a_constant_has_no_derivative_and_an_integral_that_grows_as_a_power(order: float) -> None:
    times = grid(5.0)
    constant = np.full_like(times, 1e6), np.zeros_like(times)
    np.testing.assert_allclose(fractional.caputo(*constant, STEP, order), 0.0, atol=1e-14 * 1e6)
    found = fractional.integral(*constant, STEP, order)
    np.testing.assert_allclose(found[1:], 1e6 * times[1:] ** order / math.gamma(1 + order), rtol=3e-9)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_records_of_few_samples_work(count: int) -> None:
    times = STEP * np.arange(count)
    np.testing.assert_allclose(
        fractional.caputo(times, np.ones(count), STEP, 0.5),
        2 * np.sqrt(times / math.pi),
        rtol=3e-9,
        atol=1e-15,
    )


@pytest.mark.parametrize("samples", [[1, 2, 3], np.array([1, 2, 3]), np.array([1, 2, 3], dtype=np.float16)])
def test_lists_and_integers_are_taken_as_doubles(samples: object) -> None:
    found = fractional.integral(samples, [0.0, 0.0, 0.0], STEP, 0.5)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, fractional.integral([1.0, 2.0, 3.0], [0.0, 0.0, 0.0], STEP, 0.5))


def test_strided_input_is_read_as_it_stands() -> None:
    random = np.random.default_rng(0)
    wide = random.normal(size=(2, 100, 6))
    strided = fractional.caputo(wide[0, ::2, ::3], wide[1, ::2, ::3], STEP, 0.5)
    packed = fractional.caputo(wide[0, ::2, ::3].copy(), wide[1, ::2, ::3].copy(), STEP, 0.5)
    np.testing.assert_array_equal(strided, packed)


# -- Bad input -----------------------------------------------------------------------------------------------

GOOD = {"values": np.zeros(5), "rates": np.zeros(5), "step": STEP, "order": 0.5}


@pytest.mark.parametrize("operator", OPERATORS)
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"rates": np.zeros(4)}, r"^values has shape \(5,\) and rates \(4,\): both must be \(samples,\) or"),
        ({"values": np.zeros((0,)), "rates": np.zeros((0,))}, r"^values has shape \(0,\)"),
        ({"values": np.zeros((2, 2, 2)), "rates": np.zeros((2, 2, 2))}, r"^values has shape \(2, 2, 2\)"),
        ({"values": np.float64(1), "rates": np.float64(1)}, r"^values has shape \(\)"),
        ({"values": np.array([0, 0, math.nan, 0, 0])}, r"^values and rates must be finite$"),
        ({"rates": np.array([0, 0, math.inf, 0, 0])}, r"^values and rates must be finite$"),
        ({"step": 0.0}, r"^step is 0.0: it must be a positive number$"),
        ({"step": -1.0}, r"^step is -1.0: "),
        ({"step": math.nan}, r"^step is nan: "),
        ({"step": math.inf}, r"^step is inf: "),
        ({"order": -0.1}, r"^order is -0.1: it must lie between 0 and 1$"),
        ({"order": 1.5}, r"^order is 1.5: it must lie between 0 and 1$"),
        ({"order": math.nan}, r"^order is nan: it must lie between 0 and 1$"),
        ({"tolerance": 0.0}, r"tolerance .*0"),
        ({"tolerance": math.nan}, r"tolerance .*nan"),
        ({"values": np.zeros((5, 0)), "rates": np.zeros((5, 0))}, r"^values has shape \(5, 0\).* equal and not empty$"),
        ({"step": 10**400}, r"^step is inf: it must be a positive number$"),
    ],
)
def test_bad_input_is_refused_in_a_sentence_that_names_it(
    operator: Callable[..., np.ndarray], bad: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        operator(**{**GOOD, **bad})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("operator", OPERATORS)
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"values": np.zeros(5, complex)}, r"^values has dtype complex128: it must have real numbers$"),
        (
            {"rates": np.ma.masked_array(np.zeros(5), [0, 0, 1, 0, 0])},
            r"^rates is a masked array: it must not be masked",
        ),
        ({"values": np.zeros(5, "datetime64[s]")}, r"^values has dtype datetime64\[s\]: it must have real numbers$"),
        ({"values": np.zeros(5, bool)}, r"^values has dtype bool: "),
        ({"values": b"12345"}, r"^values has dtype .*: it must have real numbers$"),
        ({"values": [1, 2, 3, 4, 10**400]}, r"^values has dtype object: it must have real numbers$"),
        ({"values": [[1.0], [1.0, 2.0]]}, r"^values is .*: it must be an array of real numbers$"),
        ({"order": "half"}, r"^order is 'half': it must be a number$"),
        ({"order": True}, r"^order is True: it must be a number$"),
        ({"step": 1j}, r"^step is 1j: it must be a number$"),
        ({"tolerance": None}, r"^tolerance is None: it must be a number$"),
    ],
)
def test_what_is_no_real_number_is_refused(
    operator: Callable[..., np.ndarray], bad: dict[str, object], message: str
) -> None:
    with pytest.raises(TypeError, match=message) as caught:
        operator(**{**GOOD, **bad})
    assert "\n" not in str(caught.value)
