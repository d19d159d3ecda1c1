"""Figures of merit as in a datasheet: name, definition, value with its interval, unit, grade."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from ..analysis.confidence import Mean
from .allan import Allan, Estimate
from .bound import Bound
from .grades import Grade, Quantity, grade
from .measure import Characterization
from .units import (
    ARCSECOND,
    DEG_PER_H,
    DEG_PER_H_PER_ROOT_H,
    DEG_PER_ROOT_H,
    DEG_PER_S,
    DEGREE,
    HERTZ,
    MILLISECOND,
    PERCENT,
    PPM,
    Unit,
)


@dataclass(frozen=True)
class Result:
    """One line of the datasheet; numbers in `unit`, NaN if not available, with the reason in `note`.

    >>> noise = np.random.default_rng(0).normal(size=2000)
    >>> np.savetxt("still.csv", noise, header="rate")
    >>> figures, content = fg.rate.analyze_record("still.csv", rate=100.0)
    >>> figures[0].name, figures[0].unit
    ('Angle random walk', 'deg/sqrt(h)')
    """

    key: str
    name: str
    definition: str
    unit: str
    value: float
    low: float = math.nan
    high: float = math.nan
    note: str = ""
    grade: Grade | None = None
    si: tuple[str, float] | None = None  # unit of navigation filters, and its value in `unit`

    def plain(self) -> dict[str, Any]:
        """The result as JSON; null for numbers that are not finite."""
        numbers = {name: getattr(self, name) for name in ("value", "low", "high")}
        finite = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        rest = {"name": self.name, "unit": self.unit, "definition": self.definition, "note": self.note}
        content = {"key": self.key, **rest, **finite, "grade": self.grade}
        if self.si is not None:
            unit, per_si = self.si
            content["si_unit"] = unit
            content |= {f"si_{name}": None if each is None else each / per_si for name, each in finite.items()}
        return content


def results(m: Characterization) -> list[Result]:
    """Every figure of a characterization."""
    error = Mean(*(value - 1.0 for value in m.static.scale_factor))
    stiffness, damping = (short(DEG_PER_S.of(leak.offered)) for leak in (m.quadrature, m.damping))
    leaks = [
        _mean(
            "quadrature_residual",
            "Quadrature residual",
            f"change of the zero-rate output for an error of kxy of 2 m ω · {stiffness} deg/s",
            DEG_PER_S,
            m.quadrature.residual,
        ),
        _mean(
            "damping_residual",
            "Damping coupling residual",
            f"the same for an error of dxy of 2 m · {damping} deg/s, 10 % of √(dxx dyy)",
            DEG_PER_S,
            m.damping.residual,
        ),
    ]
    return [
        _mean(
            "scale_factor_error",
            "Scale factor error",
            "slope minus 1 of the least-squares line through the mean outputs from −300 to 300 deg/s",
            PPM,
            error,
            "scale_factor",
        ),
        _mean(
            "nonlinearity",
            "Non-linearity",
            "largest deviation of a mean output from that line, in % of 300 deg/s",
            PERCENT,
            m.static.nonlinearity,
        ),
        _mean(
            "zero_rate_output",
            "Zero-rate output",
            "mean output at rest",
            DEG_PER_H,
            m.static.zero_rate_output,
            "bias",
        ),
        _mean(
            "zero_rate_rms",
            "Zero-rate output, RMS",
            "RMS output at rest, including its mean: noise, ripple and beats",
            DEG_PER_H,
            m.zero_rate_rms,
        ),
        *noise_terms(m.allan, m.bound),
        *_response(m),
        _full_scale(m),
        Result(
            "turn_on_time",
            "Turn-on time",
            "time until the output stays within 1 % of its final value, at 300 deg/s from an estimate of 0; median",
            MILLISECOND.name,
            MILLISECOND.of(m.turn_on_time),
            note="" if math.isfinite(m.turn_on_time) else "the output does not stay within 1 %",
        ),
        *leaks,
    ]


def noise_terms(found: Allan, bound: Bound | None = None) -> list[Result]:
    """N, B and K of an Allan deviation, and Q if it was observed."""
    terms = [
        _angle_random_walk(found, bound),
        _estimate(
            "bias_instability",
            "Bias instability",
            "B of the flicker noise: the flat part of the Allan deviation is 0.664 B",
            DEG_PER_H,
            found.bias_instability,
            found,
            "bias",
        ),
        _estimate(
            "rate_random_walk",
            "Rate random walk",
            "K of the rate's random walk: the part of the Allan deviation that rises as the root of the averaging time "
            "is K at 3 s",
            DEG_PER_H_PER_ROOT_H,
            found.rate_random_walk,
            found,
        ),
    ]
    if not found.quantization.limit:
        definition = "Q of an angle that is rounded before it is differenced: the Allan deviation falls as 1.73 Q/tau"
        terms.append(_estimate("quantization", "Quantization", definition, ARCSECOND, found.quantization, found))
    return terms


def _mean(key: str, name: str, definition: str, unit: Unit, mean: Mean, graded: Quantity | None = None) -> Result:
    """A mean over runs, graded only if it was observed: if its interval does not include 0."""
    value, low, high = (unit.of(number) for number in mean)
    found = Result(key, name, definition, unit.name, value, low, high)
    if graded is None:
        return found
    if low <= 0.0 <= high:
        return replace(found, note="not observed: its interval includes 0")
    return replace(found, grade=grade(graded, value))


def _estimate(
    key: str,
    name: str,
    definition: str,
    unit: Unit,
    found: Estimate,
    record: Allan,
    graded: Quantity | None = None,
) -> Result:
    value, low, high = (unit.of(number) for number in (found.value, found.low, found.high))
    of = grade(graded, high if found.limit else value) if graded else None
    si = (unit.si, unit.per_si)
    spoiled = any(each.spoils for each in record.events)
    if found.limit:
        note = _unseen(record)
        return Result(
            key, name, definition, unit.name, math.nan, high=high, note=note, grade=None if spoiled else of, si=si
        )
    if spoiled:
        return Result(key, name, definition, unit.name, value, note=_spoiled(record), si=si)
    return Result(key, name, definition, unit.name, value, low, high, "", of, si)


def _spoiled(record: Allan) -> str:
    """Reason for a figure without an interval: the first event that spoils it, and how many follow."""
    first, *others = (each.sentence for each in record.events if each.spoils)
    return f"no interval or grade: {first}" + (f"; and {len(others)} more" if others else "")


def _unseen(record: Allan) -> str:
    if any(each.kind == "steps" and each.spoils for each in record.events):
        return "not measured: the sensor's quantization hides it"
    if record.drifts:
        return "only a limit: the longest averages rise, which may be K or a drift, as in a warm-up"
    if record.undecided:
        return "only a limit: slow noise is observed, but the record does not distinguish B from K"
    if record.fitted and record.fitted[1] < record.tau[-1]:
        return f"only a limit: averages above {short(record.fitted[1])} s have more than this noise"
    return "not observed, only a limit: the record is too short, or has other noise"


def _angle_random_walk(record: Allan, bound: Bound | None) -> Result:
    found = record.angle_random_walk
    name = "Angle random walk"
    definition = (
        "N of the white noise: the part of the Allan deviation that falls as the root of the averaging time is N at 1 s"
    )
    unit = DEG_PER_ROOT_H
    si = (unit.si, unit.per_si)
    if found is None:
        note = (
            "not observed: no averaging range of four octaves fits white noise, with or without B and K; a longer "
            "record may have one"
        )
        if bound:
            note = (
                "not observed, the record is too short: no four octaves fit white noise of at least half the "
                f"Cramér-Rao bound, {short(unit.of(bound.known))}"
            )
        return Result("angle_random_walk", name, definition, unit.name, math.nan, note=note, si=si)
    value, low, high = (unit.of(number) for number in (found.value, found.low, found.high))
    if found.limit:
        note = "only a limit: the sensor's quantization hides it"
        return Result("angle_random_walk", name, definition, unit.name, math.nan, high=high, note=note, si=si)
    if any(each.spoils for each in record.events):
        return Result("angle_random_walk", name, definition, unit.name, value, note=_spoiled(record), si=si)
    note = ""
    if bound:
        known, unknown = bound.known, bound.unknown
        note = (
            f"{found.value / known:.2f} times the Cramér-Rao bound under this noise with damping and stiffness known, "
            f"{short(unit.of(known))}; {found.value / unknown:.2f} times the bound with both unknown, "
            f"{short(unit.of(unknown))}"
        )
    graded = grade("angle_random_walk", value)
    return Result("angle_random_walk", name, definition, unit.name, value, low, high, note, graded, si)


def _response(m: Characterization) -> list[Result]:
    wide, frequency = m.response.bandwidth, m.response.frequency
    names = ("bandwidth", "Bandwidth", "frequency at which the gain for a sinusoidal rate has fallen by 3 dB")
    lag = ("phase_lag", "Phase lag", "at that frequency")
    if math.isnan(wide.mean):
        note = "not observed: the sinusoidal rates are lost in the noise"
        return [
            Result(*names, HERTZ.name, math.nan, note=note),
            Result(*lag, DEGREE.name, math.nan, note="bandwidth not observed"),
        ]
    if not math.isfinite(wide.mean):
        beyond = f"at least {short(frequency[-1])} Hz, the highest frequency tried"
        found = Result(
            *names, HERTZ.name, math.nan, low=float(frequency[-1]), note=beyond, grade=grade("bandwidth", frequency[-1])
        )
        return [found, Result(*lag, DEGREE.name, math.nan, note="bandwidth not reached")]
    if wide.mean == 0.0:
        below = f"below {short(frequency[0])} Hz, the lowest frequency tried"
        found = Result(
            *names, HERTZ.name, math.nan, high=float(frequency[0]), note=below, grade=grade("bandwidth", 0.0)
        )
        return [found, Result(*lag, DEGREE.name, math.nan, note="bandwidth below the frequencies tried")]
    value = DEGREE.of(m.response.lag_at_bandwidth)
    return [_mean(*names, HERTZ, wide, "bandwidth"), Result(*lag, DEGREE.name, value)]


def _full_scale(m: Characterization) -> Result:
    names = (
        "full_scale",
        "Full scale",
        "largest rate tried up to which, for both signs, the mean output is within 1 % of the rate of the line and the "
        "device within the limits of its forces and sensors",
        DEG_PER_S.name,
    )
    value = DEG_PER_S.of(m.full_scale)
    limited = math.isfinite(m.scenario.constraints().force)
    graded = grade("full_scale", value) if limited else None
    free = ""
    if not limited:
        free = "not graded: without controller.force_limit or device.actuator_limit the simulated force is unlimited"
    if m.full_scale_is_last:
        notes = ["at least this, the largest rate tried", free]
        return Result(*names, math.nan, low=value, note="; ".join(filter(None, notes)), grade=graded)
    why = ""
    if m.full_scale_is_limited:
        why = "above it more than 1 % of the samples reach a limit of force or sensors"
    elif value == 0:
        why = "none: the mean output is outside 1 % at the smallest rate tried"
    notes = [why, free]
    return Result(*names, value, note="; ".join(filter(None, notes)), grade=graded)


def short(number: float) -> str:
    """Three digits; exponential notation only for large or small numbers."""
    text = f"{number:.3g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(number) < 1e7 else text
