"""Tests of the model on what the fit left: whiteness, a further mode or line, damping that is not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from .likelihood import Fit
from .model import Complex
from .records import Segment
from .spectra import Spectrum

Array = NDArray[np.float64]

LAGS = 20
REJECTED = 0.01
NEAR = 12  # bins on each side of a line that show its pole
PASSES = 4
STEADY = 0.5  # decay times the length of a record, below which a line is steady
LARGE = 12.0  # power of a bin over the mean: for white noise one in exp(12)


@dataclass(frozen=True)
class Test:
    """A test of the model. `verdict`: pass, fail or skipped; `words`: one sentence; `p`: its probability, or None."""

    name: str
    verdict: str
    words: str
    p: float | None = None

    def plain(self) -> dict[str, str | float | None]:
        """The test as JSON."""
        return {"name": self.name, "verdict": self.verdict, "p": self.p, "words": self.words}


def correlation(residuals: Complex, lags: int = LAGS) -> Complex:
    """Correlation of the residual bins of a channel with those 1 to `lags` bins later."""
    power = float(np.sum(np.abs(residuals) ** 2))
    found = [np.vdot(residuals[:-lag], residuals[lag:]) / power for lag in range(1, lags + 1)]
    return np.array(found)


def whiteness(residuals: Complex) -> float:
    """Probability of correlations as large as these in white noise: the test of Ljung and Box for complex bins.

    In few bins the statistic scatters more than chi^2 does, and its tail is longer: as chi^2, or as one scaled to the
    variance, it would raise an alarm at 0.25 % in 1.1 %, or 0.5 %, of records of 100 bins. So it is taken for a chi^2
    that is scaled and shifted to the mean, the variance and the third moment of white noise. The mean is exact; the
    others were simulated (benchmarks/identify.py).
    """
    bins = len(residuals)
    lags = min(LAGS, bins // 5)
    if lags < 1:
        return 1.0
    squared = np.abs(correlation(residuals, lags)) ** 2
    statistic = 2 * bins * (bins + 1) * float(np.sum(squared / (bins - np.arange(1, lags + 1))))
    share = lags / bins
    several = max(1 - 2.2 / lags, 0.0)  # lags that vary together
    variance = 1 + 2 * share * several  # over that of chi^2 with 2 lags degrees of freedom
    third = 1 + (9 + 15 * share) * share * several
    freedom = 2 * lags * variance**3 / third**2
    shifted = variance / third * (statistic - 2 * lags) + freedom
    return float(chdtrc(freedom, max(shifted, 0.0)))


def largest_bin(residuals: Complex, fitted: float = 1.0) -> float:
    """Limit of the probability of a bin as large as the largest in white noise, whose power the other bins show.

    `fitted`: the number of values over the degrees of freedom: a fit lowers the power of the bins near the modes.
    """
    power = np.abs(residuals) ** 2
    at = int(np.argmax(power))
    others = np.delete(power, slice(max(at - 3, 0), at + 4))
    whole = fitted * float(others.sum())
    if len(others) == 0 or not whole > 0:
        return 1.0
    return float(min(len(power) * (1 + power[at] / whole) ** -float(len(others)), 1.0))


def tests(fit: Fit, spectra: Sequence[Spectrum], segments: Sequence[Segment]) -> list[Test]:
    """Whiteness of each channel of each record, after Bonferroni, and the largest line that the model leaves."""
    found = []
    channels = sum(part.shape[1] for part in fit.residuals)
    fitted = 2 * sum(part.size for part in fit.residuals) / max(fit.freedom, 1)
    for part, one, segment, noise in zip(fit.residuals, spectra, segments, fit.noise, strict=True):
        for i, axis in enumerate(segment.axes):
            where = f"{axis} of {segment.name}"
            step = segment.step[i] if segment.step else 0.0
            if step and noise[i] < step:
                words = f"{where}: a converter of step {step:.3g} leaves rounding, which is not white"
                found.append(Test("whiteness", "skipped", words))
                continue
            # A line that fills one bin leaves no correlation: the largest bin is a test of its own.
            p = min(2 * min(whiteness(part[:, i]), largest_bin(part[:, i], fitted)), 1.0)
            failed = p < REJECTED / channels
            words = f"{where}: the residual is white (p = {p:.2g})"
            if failed:
                words = f"{where}: the residual is not white (p = {p:.1g})" + _largest(part[:, i], one)
            found.append(Test("whiteness", "fail" if failed else "pass", words, p))
    noise = fit.thermal
    if noise.is_thermal:
        sizes = [f"{axis}: {each:.2g}" for axis, each in zip(segments[0].axes, noise.thermal, strict=True)]
        words = (
            f"{segments[0].name}: thermal motion is seen (p = {noise.p:.1g}; density of its force, {', '.join(sizes)}):"
            " the fit weighs the bins of the modes accordingly"
        )
        found.append(Test("thermal", "pass", words, noise.p))
    return found


def _largest(residuals: Complex, one: Spectrum) -> str:
    """The line that stands out of a residual, in words."""
    power = np.abs(residuals) ** 2
    at = int(np.argmax(power))
    mean = float(np.delete(power, slice(max(at - 3, 0), at + 4)).mean())
    if power[at] < LARGE * mean:
        return ": the device is not linear with two modes there, or its state changes; intervals may be too small"
    pole = _pole(residuals[max(at - NEAR, 0) : at + NEAR + 1], one.frequency[max(at - NEAR, 0) : at + NEAR + 1])
    hertz, size = pole.real / (2 * np.pi), np.sqrt(power[at])
    length = one.samples * one.interval
    if pole.imag * length < STEADY:
        return (
            f": a line at {hertz:.7g} Hz does not decay, {size:.2g} times the noise: is the drive still on? give its "
            "column as force_x, or begin later; intervals may be too small"
        )
    return (
        f": a line at {hertz:.7g} Hz is left, {size:.2g} times the noise: a further mode with a quality factor near "
        f"{pole.real / (2 * pole.imag):.2g}; intervals may be too small"
    )


def _pole(residuals: Complex, frequency: Array) -> complex:
    """The pole c/(w - pole) of a line, rad/s: its imaginary part is the decay. By least squares, weighted as in
    start.py."""
    middle, span = float(frequency.mean()), float(np.ptp(frequency))
    w = (frequency - middle) / span
    pole = complex(w[int(np.argmax(np.abs(residuals)))])
    for _ in range(PASSES):
        weight = 1 / np.maximum(np.abs(w - pole), 0.5 / len(w))
        columns = np.stack([residuals, np.ones(len(w)), w], axis=1) * weight[:, None]
        found = np.linalg.lstsq(columns, residuals * w * weight, rcond=None)[0]
        pole = complex(found[0])
    return middle + span * (pole.real + 1j * abs(pole.imag))
