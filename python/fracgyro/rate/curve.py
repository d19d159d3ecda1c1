"""The Allan variance of noise terms: its mean over each averaging time, and its degrees of freedom.

The Allan variance over averages of length tau is sigma²(tau) = 2 ∫ S(f) G(f, tau) df over f > 0, with
G = 2 sin⁴(π f tau)/(π f tau)²: 3 Q²/tau² + N²/tau + (2 ln 2/π) B² + K² tau/3 if tau is much longer than the response
time and the sampling interval. Its variance over overlapping averages of one record of length t is 4/(t - 2 tau) ∫ S²
G² df. f goes up to half the sampling frequency, and G is the discrete-time transfer function.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .noise_terms import DRIFT, FLICKER, QUANTIZATION, WALK, WHITE, Fit, Response, densities
from .spectrum import Spectrum

Array = NDArray[np.float64]

PER_OCTAVE = 48  # integration points


class Curve:
    """An Allan variance over averaging times, from `records` records of `samples` samples each."""

    def __init__(self, tau: Array, interval: float, samples: int, records: int) -> None:
        self.tau, self.interval = tau, interval
        length = samples * interval
        octaves = math.log2(500 * samples)
        self.frequency = np.geomspace(1e-3 / length, 0.5 / interval, int(PER_OCTAVE * octaves))
        self._width = np.gradient(self.frequency)
        sine = np.sin(np.pi * self.frequency * interval)
        averaged = np.round(tau / interval)[:, None]
        self._gain = 2 * np.sin(np.pi * self.frequency * interval * averaged) ** 4 / (averaged * sine) ** 2
        ones = np.ones_like(self.frequency)
        self._plain = densities(Spectrum(self.frequency, ones, ones, ones, interval, ()))
        self._span = (length - 2 * tau) * records

    def columns(self, response: Response) -> Array:
        """Variance at each averaging time for N, B, K, Q and drift = 1 behind this response: (times, terms)."""
        columns = 2 * (self._gain * self._width) @ self._behind(response)
        if response.time == 0:
            columns[:, WHITE] = 1 / self.tau  # closed form
        columns[:, QUANTIZATION] = 3 / self.tau**2
        return np.asarray(columns)

    def freedom(self, fit: Fit | None) -> Array:
        """Degrees of freedom at each averaging time, for the fitted noise or, without a fit, for white noise."""
        power = np.zeros(self._plain.shape[1])
        power[WHITE] = 1.0
        if fit is not None:
            power = np.array([fit.terms[i].value if i in fit.terms else 0.0 for i in range(len(power))])
            power[DRIFT] = 0.0  # deterministic: not a random process
            power[WHITE] = power[WHITE] if power.any() else 1.0
        response = fit.response if fit else Response()
        density = self._behind(response) @ power
        spread = 4 * (self._gain**2 * self._width) @ density**2 / self._span
        return np.asarray(2 * (self.columns(response) @ power) ** 2 / spread)

    def _behind(self, response: Response) -> Array:
        density = self._plain.copy()
        density[:, [WHITE, FLICKER, WALK, DRIFT]] *= response.gain(self.frequency, self.interval)[:, None]
        return density
