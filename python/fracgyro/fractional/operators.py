"""Fractional operators of sampled signals, eq. (7), most accurate if both values and rates are known.

With given rates they are causal. They use fixed memory per sample and the code of the controller,
include/fracgyro/core/fractional.hpp. Between samples the signal is its cubic Hermite interpolant. `full_history` has
full-history reference methods.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import real, signal
from .kernel import core_kernel
from .rates import local_rates

TOLERANCE = 1e-9  # default relative error of the kernel


def caputo(
    values: ArrayLike, rates: ArrayLike | None, step: float, order: float, *, tolerance: float = TOLERANCE
) -> NDArray[Any]:
    """Caputo derivative of `order` in [0, 1] from t = 0, eq. (7).

    `values`, `rates`: shape (samples,) or (samples, channels), at 0, step, 2 step, …; float32 input is computed in
    single precision. `rates` None: rates from `local_rates`, which needs three later samples. `tolerance`: relative
    error of the kernel. Returns the same shape, in units of values per time^order. Order 0 returns the values, as in
    eq. (7), and order 1 the rates; for orders between, the derivative at t = 0 is 0, and the limit order -> 0 is values
    - values[0]. Raises TypeError or ValueError for an invalid argument.

    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> found = fg.fractional.caputo(t, np.ones_like(t), 1e-3, order=0.5)
    >>> bool(abs(found - 2 * np.sqrt(t / np.pi)).max() < 1e-9)
    True
    """
    return _apply(values, rates, step, order, tolerance)[1]


def integral(
    values: ArrayLike, rates: ArrayLike | None, step: float, order: float, *, tolerance: float = TOLERANCE
) -> NDArray[Any]:
    """Riemann-Liouville integral I^order, 0 <= order <= 1, from t = 0; the surface's D^(alpha-1) is order 1-alpha.

    Arguments and errors as for `caputo`; units of values times time^order. In single precision, orders near 1 lose
    accuracy over long records: use double precision.

    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> found = fg.fractional.integral(np.ones_like(t), np.zeros_like(t), 1e-3, order=0.5)
    >>> bool(abs(found - 2 * np.sqrt(t / np.pi)).max() < 1e-9)
    True
    """
    _check_order(order)
    return _apply(values, rates, step, 1.0 - order, tolerance)[0]


def riemann_liouville(
    values: ArrayLike, rates: ArrayLike | None, step: float, order: float, *, tolerance: float = TOLERANCE
) -> NDArray[Any]:
    """Riemann-Liouville derivative: the Caputo one plus values[0] t^(-order)/Gamma(1-order).

    The result is infinite at t = 0 unless values[0] is 0. (The controller, which holds its force for a step, uses the
    mean over the step instead.) Arguments, units and errors as for `caputo`.

    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> found = fg.fractional.riemann_liouville(np.ones_like(t), np.zeros_like(t), 1e-3, order=0.5)
    >>> bool(abs(found[1:] - 1 / np.sqrt(np.pi * t[1:])).max() < 1e-9)
    True
    """
    derivative = _apply(values, rates, step, order, tolerance)[1]
    if order in (0.0, 1.0):
        return derivative
    time = np.arange(len(derivative)) * step
    singular = np.asarray(_core.kernel(time, order))
    start = np.asarray(values)[:1].astype(derivative.dtype)
    singular = singular.astype(derivative.dtype).reshape((-1,) + (1,) * (derivative.ndim - 1))
    with np.errstate(invalid="ignore"):
        return derivative + np.where(start == 0, 0, start * singular)


def _check_order(order: float) -> None:
    if not 0 <= real("order", order) <= 1:
        raise ValueError(f"order is {order}: it must lie between 0 and 1")


def _apply(
    values: ArrayLike, rates: ArrayLike | None, step: float, order: float, tolerance: float
) -> tuple[NDArray[Any], NDArray[Any]]:
    """I^(1-order) of the signal and of its rate."""
    given = signal("values", values)
    slopes = local_rates(given, step).rates if rates is None else signal("rates", rates)
    single = given.dtype == np.float32 and slopes.dtype == np.float32
    dtype = np.float32 if single else np.float64
    if given.shape != slopes.shape or given.ndim not in (1, 2) or given.size == 0:
        raise ValueError(
            f"values has shape {given.shape} and rates {slopes.shape}: both must be (samples,) or "
            "(samples, channels), equal and not empty"
        )
    if not (np.isfinite(given).all() and np.isfinite(slopes).all()):
        raise ValueError("values and rates must be finite")
    step, tolerance = real("step", step), real("tolerance", tolerance)
    if not 0 < step < math.inf:
        raise ValueError(f"step is {step}: it must be a positive number")
    _check_order(order)
    columns = (-1, 1) if given.ndim == 1 else given.shape
    kernel = core_kernel(order, step, len(given) * step, tolerance)
    operate = _core.apply_operator_single if single else _core.apply_operator
    result = operate(
        np.ascontiguousarray(given.reshape(columns), dtype=dtype),
        np.ascontiguousarray(slopes.reshape(columns), dtype=dtype),
        kernel,
        step,
    )
    integral_part, derivative_part = (np.asarray(part).reshape(given.shape) for part in result)
    return integral_part, derivative_part
