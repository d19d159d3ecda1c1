"""Requirements on the figures of a rate sensor, and verdicts on the measured figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from .results import Result

Verdict = Literal["pass", "fail", "undecided"]

SHORT = {"arw": "angle_random_walk", "bias": "bias_instability"}
AT_LEAST = ("bandwidth", "full_scale")  # every other figure: |figure| at most its limit
KEYS = (
    "scale_factor_error",
    "nonlinearity",
    "zero_rate_output",
    "angle_random_walk",
    "bias_instability",
    "rate_random_walk",
    "bandwidth",
    "phase_lag",
    "full_scale",
    "turn_on_time",
    "quadrature_residual",
    "damping_residual",
)


@dataclass(frozen=True)
class Requirement:
    """A requirement with its verdict."""

    key: str
    rule: str
    verdict: Verdict


def required(found: Sequence[Result], limits: Mapping[str, float]) -> list[Requirement]:
    """The verdicts; `limits` by key, in the units of the figures."""
    by_key = {result.key: result for result in found}
    return [
        Requirement(
            key,
            f"{'at least' if key in AT_LEAST else 'at most'} {limit:g} {by_key[key].unit}",
            verdict(by_key[key], limit),
        )
        for key, limit in limits.items()
    ]


def verdict(result: Result, limit: float) -> Verdict:
    """The verdict, from the interval if the figure has one; a figure that was not observed passes only by its limit."""
    low, high = _magnitudes(result)
    if result.key in AT_LEAST:
        low, high, limit = -high, -low, -limit
    return "pass" if high <= limit else "fail" if low > limit else "undecided"


def _magnitudes(result: Result) -> tuple[float, float]:
    """Smallest and largest magnitude of the figure that the measurement allows."""
    value, low, high = result.value, result.low, result.high
    if math.isnan(value):
        return (0.0 if math.isnan(low) else abs(low)), (math.inf if math.isnan(high) else abs(high))
    if math.isnan(low) or math.isnan(high):
        return abs(value), abs(value)
    return (0.0 if low <= 0.0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))
