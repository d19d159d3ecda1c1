"""Quantities of the device from the results of both stages, each with its interval, in SI or relative."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .model import Shape, poles
from .profile import DERIVATIVE_STEP, LEVEL, Interval
from .structure import Structure

Array = NDArray[np.float64]
Functions = dict[str, Callable[[Array], float]]

NORMAL = math.sqrt(LEVEL)  # standard deviations of a 95 % interval
MIN_SEEN = 2.0  # standard deviations: a quality factor whose damping is less is not determined

MEANINGS = {
    "kxx": "stiffness of the x axis",
    "kxy": "coupling stiffness, the quadrature error",
    "kyy": "stiffness of the y axis",
    "dxx": "damping of the x axis",
    "dxy": "coupling damping",
    "dyy": "damping of the y axis",
    "rate": "angular rate",
    "rate_offset": "angular rate at zero of the table",
    "pickoff_ratio": "gain of the y pick-off over that of x",
    "skew": "x motion that the y pick-off sees",
    "b1": "force of the x drive per unit of its record",
    "b2": "force of the y drive per unit of its record",
    "drive_skew": "angle of the y drive's force beyond 90 degrees from that of the x drive",
    "beta": "angle by which the drives are turned from the axes of the pick-offs",
    "quadrature": "coupling stiffness as a rate",
    "stiffness_axis": "angle from the x axis to the nearest principal axis of K",
    "damping_axis": "angle from the x axis to the nearest principal axis of D",
    "split": "difference of the frequencies",
    "frequency_1": "frequency of the lower mode",
    "frequency_2": "frequency of the upper mode",
    "quality_1": "quality factor of the lower mode",
    "quality_2": "quality factor of the upper mode",
    "feedthrough": "direct coupling of drive and pick-off at the resonance",
    "delay": "delay of the force",
    "thermal_pickoff": "motion per unit of the x pick-off, from its thermal motion",
    "backbone_x": "shift of the frequency over the square of the amplitude, along x",
    "backbone_y": "shift of the frequency over the square of the amplitude, along y",
    "cubic_x": "cubic stiffness along x",
    "cubic_y": "cubic stiffness along y",
}


@dataclass(frozen=True)
class Quantity:
    """A number of the device with its 95 % interval.

    `value`, `interval` are in `unit`; `determined`: False if the records do not determine it, with the reason in
    `note`; `relative`: True if it is per unit of mass or of the record, because a calibration is missing.

    >>> kxy = fg.identify.Quantity("kxy", 0.46, (0.45, 0.47), "N/m")
    >>> print(kxy)
    kxy = 0.46 (0.45 to 0.47) N/m
    """

    name: str
    value: float
    interval: tuple[float, float]
    unit: str
    determined: bool = True
    relative: bool = False
    note: str = ""

    @property
    def meaning(self) -> str:
        """The quantity in words."""
        return MEANINGS.get(self.name, self.name)

    @property
    def half(self) -> float:
        """Half of the interval's width."""
        return (self.interval[1] - self.interval[0]) / 2

    def __str__(self) -> str:
        if not self.determined:
            return f"{self.name} is not determined"
        digits = _digits(self.value, self.half)
        low, high = (f"{each:.{digits}g}" for each in self.interval)
        return f"{self.name} = {self.value:.{digits}g} ({low} to {high}) {self.unit}".rstrip()

    def plain(self) -> dict[str, Any]:
        """The quantity as JSON."""
        finite = self.determined and all(map(math.isfinite, (self.value, *self.interval)))
        return {
            "value": self.value if finite else None,
            "interval": list(self.interval) if finite else None,
            "unit": self.unit,
            "determined": self.determined,
            "relative": self.relative,
            "meaning": self.meaning,
            "note": self.note,
        }


def _digits(value: float, half: float) -> int:
    """Significant digits that show a value to a tenth of half its interval."""
    if not half > 0 or value == 0 or not math.isfinite(value / half):
        return 3
    return int(min(max(math.ceil(math.log10(abs(value) / half)) + 2, 2), 17))


def modal(shape: Shape, parameters: Array, covariance: Array, unit: float) -> dict[str, Quantity]:
    """Frequency and quality factor of each mode, from the first stage."""
    count = shape.axes**2 * 2

    def numbers(values: Array) -> Array:
        found = poles(shape, values) * unit
        size = np.abs(found)
        frequency = size / (2 * np.pi)
        split = [frequency[-1] - frequency[0]] if shape.axes == 2 else []
        return np.concatenate([frequency, -2 * found.real / size, split])

    best = [float(each) for each in numbers(parameters)]
    sd = np.sqrt(np.diag(covariance))
    gradient = np.zeros((len(best), shape.count))
    for i in range(count):
        step = np.zeros(shape.count)
        step[i] = max(DERIVATIVE_STEP * sd[i], 1e-10)
        gradient[:, i] = (numbers(parameters + step) - numbers(parameters - step)) / (2 * step[i])
    spread = [float(each) for each in np.sqrt(np.maximum(np.diag(gradient @ covariance @ gradient.T), 0.0))]
    found = {}
    n = shape.axes
    for i in range(n):
        half = NORMAL * spread[i]
        name = f"frequency_{i + 1}"
        found[name] = Quantity(name, best[i], (best[i] - half, best[i] + half), "Hz")
        loss, deviation = best[n + i], spread[n + i]
        seen = loss > MIN_SEEN * deviation
        low, high = loss - NORMAL * deviation, loss + NORMAL * deviation
        note = "" if seen else "the decay is too short: record for longer"
        limits = 1 / high, 1 / low if low > 0 else math.inf
        name = f"quality_{i + 1}"
        found[name] = Quantity(name, 1 / loss if seen else math.inf, limits, "", seen, note=note)
    if n == 2:
        half = NORMAL * spread[-1]
        found["split"] = Quantity("split", best[-1], (best[-1] - half, best[-1] + half), "Hz")
    return found


def pooled(several: Sequence[dict[str, Quantity]]) -> dict[str, Quantity]:
    """Weighted means of the modes that independent records of one state show; quality factors by their inverse.

    Where they differ by more than their intervals, those of the mean are wider by the root of chi^2 over its degrees.
    """
    if len(several) == 1:
        return several[0]
    found = {}
    for name, first in several[0].items():
        known = [each[name] for each in several if each[name].determined and each[name].half > 0]
        if not known:
            found[name] = first
            continue
        inverse = name.startswith("quality")
        ends = [(1 / each.interval[1], 1 / each.interval[0]) if inverse else each.interval for each in known]
        half = np.array([(high - low) / 2 for low, high in ends])
        value = np.array([1 / each.value if inverse else each.value for each in known])
        mean = float(np.average(value, weights=half**-2))
        squares = float((((value - mean) * NORMAL / half) ** 2).sum())
        wide = float((half**-2).sum()) ** -0.5 * max(math.sqrt(squares / max(len(known) - 1, 1)), 1.0)
        low, high = mean - wide, mean + wide
        limits = (1 / high, 1 / low if low > 0 else math.inf) if inverse else (low, high)
        found[name] = replace(known[0], value=1 / mean if inverse else mean, interval=limits)
    return found


def functions(problem: Structure) -> Functions:
    """Quantities as functions of the parameters of the second stage, in units of omega0 and rad."""
    place = {name: i for i, name in enumerate(problem.names)}

    def entry(name: str) -> Callable[[Array], float]:
        return lambda values: float(values[place[name]])

    found: Functions = {name: entry(name) for name in problem.names if name != "log_ratio"}
    found["pickoff_ratio"] = lambda values: math.exp(values[place["log_ratio"]])
    found["quadrature"] = lambda values: float(values[place["kxy"]]) / 2

    def axis(letter: str) -> Callable[[Array], float]:
        xx, xy, yy = (place[f"{letter}{each}"] for each in ("xx", "xy", "yy"))

        def angle(values: Array) -> float:
            difference = values[xx] - values[yy]
            sign = math.copysign(1.0, difference)
            return 0.5 * math.atan2(2 * values[xy] * sign, abs(difference))

        return angle

    found["stiffness_axis"], found["damping_axis"] = axis("k"), axis("d")
    return found


def scales(unit: float, mass: float | None, pickoff: float | None) -> Mapping[str, tuple[float, str, bool]]:
    """For each quantity of the second stage the factor from units of omega0, its unit, and whether it is relative."""
    m = 1.0 if mass is None else mass
    per = mass is None
    stiffness = (unit**2 * m, "1/s^2" if per else "N/m", per)
    damping = (unit * m, "1/s" if per else "N s/m", per)
    known = mass is not None and pickoff is not None
    force = (unit**2 * m * (pickoff or 1.0), "N per unit of drive" if known else "per unit of drive", not known)
    degrees = (math.degrees(1.0), "deg", False)
    return {
        **dict.fromkeys(("kxx", "kxy", "kyy"), stiffness),
        **dict.fromkeys(("dxx", "dxy", "dyy"), damping),
        **dict.fromkeys(("rate", "rate_offset"), (unit, "rad/s", False)),
        **dict.fromkeys(("b1", "b2"), force),
        **dict.fromkeys(("beta", "drive_skew", "stiffness_axis", "damping_axis"), degrees),
        "quadrature": (math.degrees(unit), "deg/s", False),
        "pickoff_ratio": (1.0, "", False),
        "skew": (1.0, "", False),
    }


def quantities(
    found: Mapping[str, Interval], unit: float, mass: float | None, pickoff: float | None, reasons: Mapping[str, str]
) -> dict[str, Quantity]:
    """The quantities of the second stage; `reasons`: why those of these names are not determined."""
    of = scales(unit, mass, pickoff)
    result = {}
    for name, each in found.items():
        factor, words, relative = of[name]
        note = reasons.get(name, reasons.get("", "")) if not each.determined else ""
        interval = (factor * each.low, factor * each.high)
        result[name] = Quantity(name, factor * each.value, interval, words, each.determined, relative, note)
    return result
