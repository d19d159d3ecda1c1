"""The fractional integral as a linear system: its frequency response, the bound of its error, its matrices."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any, cast

import mpmath
import numpy as np
import pytest
from fracgyro.fractional import ExponentialSum, design, pid
from fracgyro.fractional.sampled import Between, Sampled
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import StateSpace, dlsim, dlti, freqresp

between = pytest.mark.parametrize("between", ["lines", "parabolas"])
orders = pytest.mark.parametrize("order", [0.1, 0.5, 0.9])


def kernel(order: float) -> ExponentialSum:
    return design(order, shortest=1e-4, longest=1e2, tolerance=1e-6)


def relative(modes: ExponentialSum, frequency: np.ndarray) -> np.ndarray:
    """The error of the response, over s^(order-1)."""
    return modes.frequency_response(frequency) * (1j * frequency) ** (1.0 - modes.order) - 1.0


@orders
def test_the_direct_term_is_the_integral_of_what_the_exponentials_lack(order: float) -> None:
    modes = kernel(order)

    def exponentials(t: float) -> mpmath.mpf:
        return mpmath.fsum(w * mpmath.exp(-p * t) for p, w in zip(modes.poles, modes.weights, strict=True))

    kernels = mpmath.mpf(1e-4) ** (1 - order) / mpmath.gamma(2 - order)
    expected = kernels - mpmath.quad(exponentials, [0, 1e-6, 1e-5, 1e-4])
    assert modes.direct == pytest.approx(float(expected), rel=1e-9)


def test_29_exponentials_are_within_2e_5_of_the_exact_response_from_0_1_to_316_rad_per_second() -> None:
    modes = design(0.9, shortest=1e-5, longest=80.0, tolerance=1e-6)
    assert modes.count == 29
    assert modes.frequency_error(0.1, 316.0) <= 2e-5
    without = modes.frequency_response(1.0) - modes.direct
    assert abs(without - 1j**-0.1) > 0.2  # without the direct term it is another operator


@orders
@pytest.mark.parametrize("band", [(0.05, 0.05), (0.05, 3.0), (1.0, 1e3), (200.0, 3e4)])
def test_the_bound_of_the_error_holds_everywhere_and_is_tight(order: float, band: tuple[float, float]) -> None:
    modes = kernel(order)
    bound = modes.frequency_error(*band)
    worst = abs(relative(modes, np.geomspace(*band, 30_011))).max()
    assert worst <= bound <= 1.001 * worst + 1e-8


@given(st.floats(0.02, 0.98), st.floats(-3.0, 4.0), st.floats(0.0, 1e-3), st.floats(0.0, 1.0))
def test_the_bound_holds_within_a_narrow_band(order: float, low: float, width: float, at: float) -> None:
    modes = kernel(round(order, 2))
    found = abs(relative(modes, np.exp([low + at * width])))[0]
    assert found <= modes.frequency_error(math.exp(low), math.exp(low + width)) * (1 + 1e-9) + 1e-13


@orders
def test_the_matrices_have_the_frequency_response(order: float) -> None:
    modes = kernel(order)
    frequency = np.geomspace(1e-2, 1e4, 50)
    _, found = freqresp(StateSpace(*modes.state_space()), frequency)
    assert found == pytest.approx(modes.frequency_response(frequency), rel=1e-9)


@orders
@pytest.mark.parametrize("step", [1e-4, 0.3])
@pytest.mark.parametrize("derivative", [False, True])
def test_sampled_it_is_as_exact_as_the_kernel_for_lines_between_samples(
    order: float, step: float, derivative: bool
) -> None:
    """The slopes are positive, as then no part of the integral of the kernel cancels another."""
    modes = kernel(order)
    slopes = np.random.default_rng(1).uniform(0.5, 2.0, 300)
    t = (1 + np.arange(300)) * step  # the first line begins at 0
    _, found, _ = dlsim(dlti(*modes.state_space(step, derivative=derivative)[:4], dt=step), np.cumsum(slopes) * step)
    since = np.maximum(t[:, None] - np.append(0.0, t[:-1]), 0.0)  # each change of slope
    power = (1.0 if derivative else 2.0) - order
    expected = (since**power @ np.diff(slopes, prepend=0.0)) / math.gamma(1.0 + power)
    assert found[:, 0] == pytest.approx(expected, rel=1.01 * modes.error)
    assert found[:, 0] != pytest.approx(expected, rel=1e-3 * modes.error)


@pytest.mark.parametrize("band", [(0.0, 1.0), (2.0, 1.0), (1.0, math.inf), (math.nan, 1.0)])
def test_a_band_that_is_none_is_refused(band: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"^lowest and highest must be positive, finite and in this order, got "):
        kernel(0.5).frequency_error(*band)


@pytest.mark.parametrize("step", [0.0, -1.0, 0.9e-4, math.inf, math.nan])
def test_a_step_that_is_none_is_refused(step: float) -> None:
    with pytest.raises(ValueError, match=r"^step must be finite and at least shortest = 0.0001, got "):
        kernel(0.5).state_space(step)


def test_a_derivative_in_continuous_time_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^step must be given for a derivative"):
        kernel(0.5).state_space(derivative=True)


@pytest.mark.parametrize(("lam", "mu"), [(0.3, 0.7), (0.9, 1.0), (1.0, 0.2), (1.0, 1.0)])
def test_a_fractional_pid_is_the_sum_of_its_terms_for_lines_between_samples(lam: float, mu: float) -> None:
    step, count = 1e-2, 200
    slopes = np.random.default_rng(2).uniform(0.5, 2.0, count)
    t, samples = (1 + np.arange(count)) * step, np.cumsum(slopes) * step
    controller = pid(3.0, 5.0, lam, 0.7, mu, step=step, longest=10.0, tolerance=1e-8)
    since, changes = np.maximum(t[:, None] - np.append(0.0, t[:-1]), 0.0), np.diff(slopes, prepend=0.0)
    integral = since ** (1.0 + lam) @ changes / math.gamma(2.0 + lam)
    derivative = np.where(since > 0.0, since ** (1.0 - mu), 0.0) @ changes / math.gamma(2.0 - mu)
    expected = 3.0 * samples + 5.0 * integral + 0.7 * derivative
    found = [controller.step(sample) for sample in samples]
    assert found == pytest.approx(expected, rel=1.1e-8)
    controller.reset()
    assert [controller.step(sample) for sample in samples] == found


@between
def test_a_fractional_pid_is_the_same_as_matrices_and_by_frequency(between: Between) -> None:
    controller = pid(3.0, -5.0, 0.4, 0.7, 0.6, step=1e-2, longest=10.0, between=between)
    samples = np.random.default_rng(3).normal(size=300)
    system = dlti(*controller.state_space()[:4], dt=1e-2)
    found = [controller.step(sample) for sample in samples]
    assert found == pytest.approx(dlsim(system, samples)[1][:, 0], rel=1e-9, abs=1e-9)
    angle, unit = np.geomspace(1e-3, 3.0, 40), np.eye(len(system.A))
    solved = [system.C @ np.linalg.solve(np.exp(1j * each) * unit - system.A, system.B) + system.D for each in angle]
    assert controller.frequency_response(angle / 1e-2) == pytest.approx(np.reshape(solved, -1), rel=1e-9)


@pytest.mark.parametrize(("lam", "mu"), [(1.0, 1.0), (0.999999, 0.999999)])
def test_with_parabolas_a_pid_of_whole_orders_is_exact_for_parabolas(lam: float, mu: float) -> None:
    """From the second sample on: the parabola of the first goes through 0 one step before the start."""
    t = 0.01 * np.arange(300)
    found = pid(3.0, 5.0, lam, 0.7, mu, step=0.01, longest=10.0, between="parabolas").run(t**2)
    np.testing.assert_allclose(found[2:], (3.0 * t**2 + 5.0 * t**3 / 3.0 + 0.7 * 2.0 * t)[2:], rtol=1e-4, atol=1e-5)
    lines = pid(3.0, 5.0, lam, 0.7, mu, step=0.01, longest=10.0).run(t**2)
    assert abs(lines - found)[2:].min() > 5e-3


def test_parabolas_are_many_times_as_exact_for_sines() -> None:
    frequency = np.geomspace(0.1, 30.0, 20)
    errors = [
        abs(
            kernel(0.9).sampled(1e-3, derivative=derivative, between=between).frequency_response(frequency)
            / (1j * frequency) ** (0.9 if derivative else -0.1)
            - 1.0
        ).max()
        for derivative in (True, False)
        for between in ("lines", "parabolas")
    ]
    assert errors[0] > 30 * errors[1]
    assert errors[2] > 3 * errors[3]


def test_what_a_signal_is_not_taken_for_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^between is 'cubics': it must be lines or parabolas$"):
        kernel(0.5).sampled(1e-3, between=cast(Any, "cubics"))
    with pytest.raises(ValueError, match=r"^between is 'cubics': it must be lines or parabolas$"):
        pid(1.0, 0.0, 1.0, 0.0, 1.0, step=1e-3, longest=1.0, between=cast(Any, "cubics"))


def test_at_low_frequency_a_fractional_pid_has_the_exact_response() -> None:
    """From ten times the reciprocal of the memory to where a line between samples is good to 1e-5."""
    controller = pid(3.0, 5.0, 0.4, 0.7, 0.6, step=1e-3, longest=1e3, tolerance=1e-9)
    s = 1j * np.geomspace(0.1, 5.0, 20)
    assert controller.frequency_response(s.imag) == pytest.approx(3.0 + 5.0 * s**-0.4 + 0.7 * s**0.6, rel=1e-4)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"kp": math.nan}, "kp must be finite, got nan"),
        ({"kd": math.inf}, "kd must be finite, got inf"),
        ({"lam": 0.0}, r"lam must lie in \(0, 1\], got 0.0"),
        ({"mu": 1.1}, r"mu must lie in \(0, 1\], got 1.1"),
        ({"step": 0.0}, "step must be positive and finite, got 0.0"),
        ({"longest": 1e-9}, "longest must be finite and greater than step = 0.001, got 1e-09"),
        ({"step": 1e-300}, "step must be a positive time between .* and .*, got 1e-300"),
    ],
)
def test_a_pid_that_is_none_is_refused(words: dict[str, float], message: str) -> None:
    good = {"kp": 1.0, "ki": 1.0, "lam": 0.5, "kd": 1.0, "mu": 0.5, "step": 1e-3, "longest": 1.0}
    with pytest.raises(ValueError, match=f"^{message}$"):
        pid(**(good | words))


@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))],
    ids=["copy", "deepcopy", "pickle"],
)
def test_a_copy_of_an_operator_goes_on_by_itself(copied: Callable[[Sampled], Sampled]) -> None:
    one = pid(3.0, 5.0, 0.4, 0.7, 0.6, step=1e-3, longest=1.0, between="parabolas")
    for sample in (1.0, -2.0, 0.5):
        one.step(sample)
    other = copied(one)
    ahead = [one.step(sample) for sample in (1.0, 1.0, 1.0)]
    assert [other.step(sample) for sample in (1.0, 1.0, 1.0)] == ahead
    np.testing.assert_array_equal(other.run(np.ones(5)), one.run(np.ones(5)))


@pytest.mark.parametrize("sample", [10**400, "a", None, [1.0, 2.0]])
def test_a_sample_that_is_no_number_is_refused(sample: Any) -> None:
    with pytest.raises(TypeError, match=r"^sample is .*: it must be a number$"):
        pid(3.0, 5.0, 0.4, 0.7, 0.6, step=1e-3, longest=1.0).step(sample)
