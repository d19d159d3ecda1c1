"""Errors of a rate sensor with the numbers of the identified device: what the ratio of the pick-offs leaves.

The controller of the scenario knows the identified ratio. A mismatch d of at most the interval is left, and the force
along y, seen by that pick-off, is (1 + d) times as large. The joint filter's scale factor is then off by -d/2, and its
zero-rate output by d dxy/(4 m), plus what the coupling stiffness adds. So the scenario is run with and without d, with
the same noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..rate.units import DEG_PER_H, PPM
from ..scenario import Scenario
from ..simulation.simulate import DivergedError, simulate
from .quantity import Quantity

DURATION = 6000.0  # 1/omega0
EVERY = 20  # steps


@dataclass(frozen=True)
class Prediction:
    """Largest errors within the 95 % interval of the ratio: `scale_factor`, ppm, and `bias`, deg/h."""

    scale_factor: float
    bias: float

    @property
    def words(self) -> str:
        """The prediction as a sentence."""
        return (
            f"a joint filter with this scenario: scale factor ± {_short(self.scale_factor)} ppm, bias "
            f"± {_short(self.bias)} deg/h"
        )

    def plain(self) -> dict[str, Any]:
        """The prediction as JSON."""
        return {"scale_factor_ppm": self.scale_factor, "bias_deg_per_h": self.bias, "words": self.words}


def _short(value: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):,g}" if value < 1e6 else f"{value:.2g}"


def predict(scenario: Scenario, ratio: Quantity | None) -> Prediction | None:
    """The errors that are left; None if the ratio is not determined, or if the loop diverges with them.

    `scenario`: that of the identified device.
    """
    if ratio is None or not ratio.determined:
        return None
    left = ratio.half / ratio.value
    rate = scenario.plant.angular_rate
    try:
        still = _mean(scenario, left, 0.0) - _mean(scenario, 0.0, 0.0)
        turned = _mean(scenario, left, rate) - _mean(scenario, 0.0, rate)
    except DivergedError:
        return None
    return Prediction(abs(PPM.of((turned - still) / rate)), abs(DEG_PER_H.of(still)))


def _mean(scenario: Scenario, mismatch: float, rate: float) -> float:
    """Mean rate, rad/s, of the second half of a run in which the ratio of the pick-offs is larger by this mismatch."""
    x, y = scenario.datasheet.pickoff_gain_error
    changes = {
        "device.pickoff_gain_error": (x, (1 + mismatch) * (1 + y) - 1),
        "plant.angular_rate": rate,
        "run.units": "SI",
        "run.duration": DURATION,
        "run.record_every": EVERY,
    }
    found = simulate(scenario.replace(changes))["rate_estimate"].values
    return float(found[len(found) // 2 :].mean())
