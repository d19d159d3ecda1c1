"""The disturbance of a scenario as the core takes it: a first part that integrations can set, and terms added to it.

The first part is the first entry if it is always on and none, a sine or white noise, unless it is an acceleration that
also moves a common mode. All other entries are terms.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from .. import _core
from .disturbance import Entry
from .kinds import TERM_NUMBERS, core_values
from .scenario import Scenario
from .schema import HOLD_TOLERANCE

MAX_DEVIATIONS = 8.0  # standard deviations: noise is never so far off
ADDED_STREAM = 16  # the first added entry's; smaller ones belong to the device and the rate
NO_NOISE: dict[str, Any] = {"hold_steps": 1, "standard_deviation": 1.0}  # for other kinds, which draw nothing
SETTABLE = ("none", "noise", "sine")
Columns = tuple[list[float], list[float], list[float]]


def acting(scenario: Scenario) -> tuple[Entry, ...]:
    """The entries of the disturbance as they drive the modes: accelerations times device.acceleration_share."""
    share = scenario.device.acceleration_share
    if share is None:
        return scenario.disturbance.entries
    return tuple(
        _shared(entry, share) if entry.quantity == "acceleration" else entry for entry in scenario.disturbance.entries
    )


def _shared(entry: Entry, share: tuple[float, float]) -> Entry:
    along_x, along_y = share
    if rows := spectrum(entry):
        x, y = _weights(entry)
        weights = (abs(along_x) * x, abs(along_y) * y)
        return entry.model_copy(update={"kind": "vibration", "psd": tuple(rows), "weights": weights, "band": None})
    if entry.kind == "noise":  # checks.py requires shares of the same size
        deviation, density = entry.standard_deviation, entry.density
        if deviation is not None:
            return entry.model_copy(update={"standard_deviation": abs(along_x) * deviation})
        return entry.model_copy(update={"density": along_x * along_x * (density or 0.0)})
    if entry.points is not None:
        points = tuple((time, along_x * x, along_y * y) for time, x, y in entry.points)
        return entry.model_copy(update={"points": points})
    if entry.amplitude is not None:
        x, y = entry.amplitude
        return entry.model_copy(update={"amplitude": (along_x * x, along_y * y)})
    return entry


def first_part(scenario: Scenario) -> dict[str, Any]:
    """Numbers of the first part of the force d of eq. (9)."""
    d = acting(scenario)[0]
    found = {name: getattr(d, name) for name in ("amplitude", "frequency", "phase")}
    found["seed"] = scenario.disturbance.seed
    if not _is_first_part(scenario):
        return found | {"kind": "none", **NO_NOISE}
    return found | {"kind": d.kind, **_drawn(d, scenario.run.step)}


def terms(scenario: Scenario) -> list[tuple[dict[str, float], Columns]]:
    """The terms: their numbers by name, and the columns of their rows."""
    return [
        _term(entry, place, scenario.run.step)
        for place, entry in enumerate(acting(scenario))
        if entry.kind != "none" and (place or not _is_first_part(scenario))
    ]


def frame_terms(scenario: Scenario) -> list[tuple[dict[str, float], Columns]]:
    """The same of all accelerations of the frame, whatever their share on the modes."""
    return [
        _term(entry, place, scenario.run.step)
        for place, entry in enumerate(scenario.disturbance.entries)
        if entry.kind != "none" and entry.quantity == "acceleration"
    ]


def _term(entry: Entry, place: int, step: float) -> tuple[dict[str, float], Columns]:
    values = {
        "kind": "vibration" if spectrum(entry) else entry.kind,
        "start_steps": _in_steps(entry.start, step),
        "end_steps": _in_steps(entry.end, step),
        "stream": ADDED_STREAM + place if place else 0,
        "amplitude": entry.amplitude,
        "frequency": entry.frequency,
        "phase": entry.phase,
        "width_steps": 1.0 if entry.width is None else _in_steps(entry.width, step),
        **_drawn(entry, step),
    }
    return core_values(TERM_NUMBERS, {"disturbance": values}), _columns(entry, step)


def term_list(found: list[tuple[dict[str, float], Columns]]) -> list[float]:
    """Terms as one list, which `take_terms` in settings.hpp reads."""
    return [
        number
        for named, columns in found
        for number in (*named.values(), float(len(columns[0])), *columns[0], *columns[1], *columns[2])
    ]


def spectrum(entry: Entry) -> list[tuple[float, float]]:
    """Rows of the one-sided spectrum of vibration and of noise within a band; none for other kinds."""
    if entry.psd is not None:
        return list(entry.psd)
    if entry.kind != "noise" or entry.band is None:
        return []
    low, high = entry.band
    if entry.density is None:
        density = (entry.standard_deviation or 0.0) ** 2 / (high - low)
    else:
        density = entry.density / math.pi  # one-sided and per rad; given two-sided and per cycle
    return [(low, density), (high, density)]


def largest_force(scenario: Scenario) -> float:
    """A bound of the disturbance on each axis, which noise practically never exceeds."""
    return sum((_largest(entry, scenario.run.step) for entry in acting(scenario)), 0.0)


def white_noise(scenario: Scenario) -> float:
    """Standard deviation of white noise, drawn every step, that is as dense as the random entries at their densest."""
    found = []
    for entry in acting(scenario):
        if rows := spectrum(entry):
            densest = max(density for _, density in rows) * max(_weights(entry)) ** 2
            found.append(math.sqrt(math.pi * densest / scenario.run.step))
        elif entry.kind == "noise":
            # Held for several steps it is as strong as one drawn every step, of the same density.
            steps = 1.0 if entry.hold is None else entry.hold / scenario.run.step
            found.append(_drawn(entry, scenario.run.step)["standard_deviation"] * math.sqrt(steps))
    return math.hypot(*found)


def white_density(scenario: Scenario) -> float | None:
    """Two-sided density of the disturbance; None if it is more than white noise that is always on."""
    total = 0.0
    for entry in acting(scenario):
        if entry.kind == "none":
            continue
        if entry.kind != "noise" or not _is_settable(entry):
            return None
        hold = scenario.run.step if entry.hold is None else entry.hold
        total += entry.density if entry.density is not None else (entry.standard_deviation or 0.0) ** 2 * hold
    return total


def _is_first_part(scenario: Scenario) -> bool:
    """True if the first entry is the part that integrations can set, on which nothing else may depend."""
    first = acting(scenario)[0]
    shifts_gaps = scenario.device.has_common_mode and first.quantity == "acceleration"
    return _is_settable(first) and not shifts_gaps


def _is_settable(entry: Entry) -> bool:
    always = entry.start == 0.0 and entry.end == math.inf
    return entry.kind in SETTABLE and always and not spectrum(entry)


def _drawn(entry: Entry, step: float) -> dict[str, Any]:
    """Hold and standard deviation of white noise."""
    if entry.kind != "noise" or entry.band is not None:
        return NO_NOISE
    hold = step if entry.hold is None else entry.hold
    # White noise of density S, held for h, has variance S/h.
    deviation = math.sqrt(entry.density / hold) if entry.density is not None else entry.standard_deviation
    return {"hold_steps": round(hold / step), "standard_deviation": deviation}


def _in_steps(time: float, step: float) -> float:
    """A time in steps, a whole number if it is one except for rounding."""
    ratio = time / step
    if math.isfinite(ratio) and abs(ratio - round(ratio)) <= HOLD_TOLERANCE * ratio:
        return float(round(ratio))
    return ratio


def _columns(entry: Entry, step: float) -> Columns:
    if rows := spectrum(entry):
        (along_x, along_y), densities = _weights(entry), [density for _, density in rows]
        return (
            [frequency for frequency, _ in rows],
            [along_x * along_x * density for density in densities],
            [along_y * along_y * density for density in densities],
        )
    points = entry.points or ()
    return [_in_steps(time, step) for time, _, _ in points], [x for _, x, _ in points], [y for _, _, y in points]


def _weights(entry: Entry) -> tuple[float, float]:
    """Factors of the axes."""
    return entry.weights if entry.kind == "vibration" else (1.0, 1.0)


def _largest(entry: Entry, step: float) -> float:
    if spectrum(entry):
        columns = _columns(entry, step)
        return MAX_DEVIATIONS * math.sqrt(max(_core.spectral_power(columns[0], values) for values in columns[1:]))
    if entry.kind == "noise":
        return MAX_DEVIATIONS * float(_drawn(entry, step)["standard_deviation"])
    if entry.kind == "table":
        return max(abs(value) for _, *values in entry.points or () for value in values)
    return max(map(abs, entry.amplitude)) if entry.kind != "none" and entry.amplitude else 0.0


def named_terms(scenario: Scenario) -> Iterator[dict[str, Any]]:
    """The terms in JSON: null is infinity."""
    for named, columns in terms(scenario):
        numbers = {name: value if math.isfinite(value) else None for name, value in named.items()}
        yield {"numbers": numbers, "rows": list(columns)}
