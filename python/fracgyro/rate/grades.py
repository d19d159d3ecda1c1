"""Grades of gyroscopes, and the grade of a figure of merit."""

from __future__ import annotations

from typing import Literal

Grade = Literal["navigation", "tactical", "consumer", "below consumer"]
Quantity = Literal["bias", "angle_random_walk", "scale_factor", "full_scale", "bandwidth"]

# Unit and limit of each grade, best first: common industry classes.
GRADES: dict[Quantity, tuple[str, dict[Grade, float]]] = {
    "bias": ("deg/h, at most", {"navigation": 0.01, "tactical": 10.0, "consumer": 1000.0}),
    "angle_random_walk": ("deg/sqrt(h), at most", {"navigation": 0.001, "tactical": 0.5, "consumer": float("inf")}),
    "scale_factor": ("ppm, at most", {"navigation": 10.0, "tactical": 1000.0, "consumer": 10000.0}),
    "full_scale": ("deg/s, at least", {"navigation": 400.0, "tactical": 500.0, "consumer": 50.0}),
    "bandwidth": ("Hz, at least", {"navigation": 90.0, "tactical": 90.0, "consumer": 70.0}),  # about 100, 100, over 70
}


def grade(quantity: Quantity, value: float) -> Grade:
    """The best grade whose limit |`value`| meets, in the unit of GRADES; NaN meets none."""
    rule, limits = GRADES[quantity]
    for name, limit in limits.items():
        if abs(value) >= limit if rule.endswith("at least") else abs(value) <= limit:
            return name
    return "below consumer"
