"""Rates of a signal from samples of its values, with an error estimate."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import real, signal

# Derivative of the interpolating polynomial at its points, for unit spacing; the other half is the mirror image.
OF_SEVEN = np.array(
    [
        [-147, 360, -450, 400, -225, 72, -10],
        [-10, -77, 150, -100, 50, -15, 2],
        [2, -24, -35, 80, -30, 8, -1],
        [-1, 9, -45, 0, 45, -9, 1],
    ]
)
OF_FIVE = np.array([[-25, 48, -36, 16, -3], [-3, -10, 18, -6, 1], [1, -8, 0, 8, -1]])
UNIT_SEVEN, UNIT_FIVE = 60, 12


class LocalRates(NamedTuple):
    """Result of `local_rates`."""

    rates: NDArray[Any]  #: shape of the values, unit of values per time
    error: NDArray[Any]  #: of each channel (0-dimensional for one channel), same unit: an estimate, not a bound


def local_rates(values: ArrayLike, step: float) -> LocalRates:
    """Rates of sampled values, from the polynomial through the seven nearest samples: error of order step^6.

    `values`: shape (samples,) or (samples, channels), at least 7 samples, `step` apart. The error estimate is the
    largest difference from the polynomial through the five nearest samples, whose error is of order step^4; it is
    pessimistic for smooth signals. Noise of standard deviation s becomes 1.08 s/step. The method is not causal: a rate
    needs three later samples. An error of the rates of at most E changes `caputo` by at most E
    t^(1-order)/Gamma(2-order). Raises TypeError or ValueError for an invalid argument.

    >>> t = np.linspace(0.0, 1.0, 101)
    >>> found = fg.fractional.local_rates(np.sin(t), 0.01)
    >>> bool(abs(found.rates - np.cos(t)).max() < found.error < 3e-9)
    True
    """
    given, step = signal("values", values), real("step", step)
    if given.ndim not in (1, 2) or len(given) < OF_SEVEN.shape[1]:
        raise ValueError(
            f"values has shape {given.shape}: it must be (samples,) or (samples, channels), and no fewer than 7 samples"
        )
    if not 0 < step < math.inf:
        raise ValueError(f"step is {step}: it must be a positive number")
    if not np.isfinite(given).all():
        raise ValueError("values must be finite")
    exact = given.astype(np.float64)
    rates = _derivative(exact, OF_SEVEN, UNIT_SEVEN * step)
    error = abs(rates - _derivative(exact, OF_FIVE, UNIT_FIVE * step)).max(axis=0)
    return LocalRates(rates.astype(given.dtype) if given.dtype == np.float32 else rates, error)


def _derivative(values: NDArray[Any], formulas: NDArray[Any], unit: float) -> NDArray[Any]:
    """Central differences if there are enough samples on both sides, otherwise one-sided."""
    points, half = formulas.shape[1], formulas.shape[1] // 2
    found = np.empty_like(values)
    centered = len(values) - points + 1
    found[half : half + centered] = _weighted(formulas[half], [values[k : k + centered] for k in range(points)])
    for place in range(half):
        found[place] = _weighted(formulas[place], values[:points])
        found[-1 - place] = _weighted(-formulas[place], values[: -points - 1 : -1])
    return found / unit


def _weighted(weights: NDArray[Any], terms: Any) -> Any:
    """Weighted sum in a fixed order: the same bits on every processor."""
    return sum(weight * term for weight, term in zip(weights.tolist(), terms, strict=True))
