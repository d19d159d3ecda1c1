"""The figures of merit as a datasheet has them: name, definition, value with its interval, unit, grade."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from ..analysis.confidence import Mean
from .allan import Allan, Estimate
from .bound import Bound
from .grades import Grade, Quantity, grade
from .measure import Characterisation
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
    """One line of the datasheet; numbers in `unit`, NaN where there is none and `note` says why.

    >>> noise = np.random.default_rng(0).normal(size=2000)
    >>> np.savetxt("still.csv", noise, header="rate")
    >>> figures, content = fg.rate.analyse_record("still.csv", rate=100.0)
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
    si: tuple[str, float] | None = None  # unit of navigation filters, and how many of `unit` make one

    def plain(self) -> dict[str, Any]:
        """As JSON: null for what is not finite."""
        numbers = {name: getattr(self, name) for name in ("value", "low", "high")}
        finite = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        rest = {"name": self.name, "unit": self.unit, "definition": self.definition, "note": self.note}
        content = {"key": self.key, **rest, **finite, "grade": self.grade}
        if self.si is not None:
            unit, per_si = self.si
            content["si_unit"] = unit
            content |= {f"si_{name}": None if each is None else each / per_si for name, each in finite.items()}
        return content


def results(m: Characterisation) -> list[Result]:
    """Every figure of a characterisation."""
    error = Mean(*(value - 1.0 for value in m.static.scale_factor))
    stiffness, damping = (short(DEG_PER_S.of(leak.offered)) for leak in (m.quadrature, m.damping))
    leaks = [
        _mean(
            "quadrature_residual",
            "Quadrature residual",
            f"change of the zero-rate output when kxy is wrong by 2 m ω · {stiffness} deg/s",
            DEG_PER_S,
            m.quadrature.residual,
        ),
        _mean(
            "damping_residual",
            "Damping coupling residual",
            f"the same when dxy is wrong by 2 m · {damping} deg/s, 10 % of √(dxx dyy)",
            DEG_PER_S,
            m.damping.residual,
        ),
    ]
    return [
        _mean(
            "scale_factor_error",
            "Scale factor error",
            "slope, less 1, of the line of least squares through the mean outputs from −300 to 300 deg/s",
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
        _zero_rate_output(m.static.zero_rate_output),
        _mean(
            "zero_rate_rms",
            "Zero-rate output, RMS",
            "RMS output at rest, its mean included: what a mean leaves out, as noise, ripple or a beat",
            DEG_PER_H,
            m.zero_rate_rms,
        ),
        *noise_terms(m.allan, m.bound),
        *_response(m),
        _full_scale(m),
        Result(
            "turn_on_time",
            "Turn-on time",
            "at 300 deg/s, from an estimate of 0 until every output is within 1 % of the final one; median of the runs",
            MILLISECOND.name,
            MILLISECOND.of(m.turn_on_time),
            note="" if math.isfinite(m.turn_on_time) else "the output does not stay within 1 %",
        ),
        *leaks,
    ]


def _zero_rate_output(mean: Mean) -> Result:
    found = _mean("zero_rate_output", "Zero-rate output", "mean output at rest", DEG_PER_H, mean, "bias")
    if found.low <= 0.0 <= found.high:
        return replace(found, note="not observed: its interval includes 0, and it may be only noise", grade=None)
    return found


def noise_terms(found: Allan, bound: Bound | None = None) -> list[Result]:
    """N, B and K of an Allan deviation, and Q where it is seen."""
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
            "K of a rate that walks: the part of the Allan deviation that rises as the root of the averaging time is "
            "K at 3 s",
            DEG_PER_H_PER_ROOT_H,
            found.rate_random_walk,
            found,
        ),
    ]
    if not found.quantization.limit:
        definition = (
            "Q of an angle that is rounded before its differences are taken: the Allan deviation falls as 1.73 Q/tau"
        )
        terms.append(_estimate("quantization", "Quantization", definition, ARCSECOND, found.quantization, found))
    return terms


def _mean(key: str, name: str, definition: str, unit: Unit, mean: Mean, graded: Quantity | None = None) -> Result:
    value, low, high = (unit.of(number) for number in mean)
    return Result(key, name, definition, unit.name, value, low, high, "", grade(graded, value) if graded else None)


SPOILED = "no interval or grade because of the events above"


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
        return Result(key, name, definition, unit.name, value, note=SPOILED, si=si)
    return Result(key, name, definition, unit.name, value, low, high, "", of, si)


def _unseen(record: Allan) -> str:
    if any(each.kind == "steps" and each.spoils for each in record.events):
        return "not measured: the steps of the sensor hide it"
    if record.drifts:
        return "only bounded: the longest averages rise, which may be K or a drift, as in a warm-up"
    if record.undecided:
        return "only bounded: slow noise is observed, but the record does not tell whether it is B or K"
    if record.fitted and record.fitted[1] < record.tau[-1]:
        return f"only bounded: averages above {short(record.fitted[1])} s show more than noise of this kind"
    return "not observed, only bounded: the record is too short, or has other noise"


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
            "not observed: no averaging range of four octaves looks like white noise, with or without B and K; a "
            "longer record may show one"
        )
        if bound:
            note = (
                "not observed, the record is too short: over no four octaves does the noise look white, or not with "
                f"half of its Cramér-Rao bound, {short(unit.of(bound.known))}"
            )
        return Result("angle_random_walk", name, definition, unit.name, math.nan, note=note, si=si)
    value, low, high = (unit.of(number) for number in (found.value, found.low, found.high))
    if found.limit:
        note = "only bounded: the steps of the sensor hide it"
        return Result("angle_random_walk", name, definition, unit.name, math.nan, high=high, note=note, si=si)
    if any(each.spoils for each in record.events):
        return Result("angle_random_walk", name, definition, unit.name, value, note=SPOILED, si=si)
    note = ""
    if bound:
        known, unknown = bound.known, bound.unknown
        note = (
            f"{found.value / known:.2f} times the Cramér-Rao bound of this noise of force and sensing if damping and "
            f"stiffness are known, {short(unit.of(known))}; {found.value / unknown:.2f} times that if they are not, "
            f"{short(unit.of(unknown))}"
        )
    graded = grade("angle_random_walk", value)
    return Result("angle_random_walk", name, definition, unit.name, value, low, high, note, graded, si)


def _response(m: Characterisation) -> list[Result]:
    wide, frequency = m.response.bandwidth, m.response.frequency
    names = ("bandwidth", "Bandwidth", "where the gain for a sinusoidal rate has fallen by 3 dB")
    lag = ("phase_lag", "Phase lag", "at that frequency")
    if math.isnan(wide.mean):
        note = "not observed: the sinusoidal rates are lost in the noise"
        return [
            Result(*names, HERTZ.name, math.nan, note=note),
            Result(*lag, DEGREE.name, math.nan, note="bandwidth not observed"),
        ]
    if not math.isfinite(wide.mean):
        least = f"at least {short(frequency[-1])} Hz, the highest frequency tried"
        found = Result(
            *names, HERTZ.name, math.nan, low=float(frequency[-1]), note=least, grade=grade("bandwidth", frequency[-1])
        )
        return [found, Result(*lag, DEGREE.name, math.nan, note="bandwidth not reached")]
    if wide.mean == 0.0:
        most = f"below {short(frequency[0])} Hz, the lowest frequency tried"
        found = Result(*names, HERTZ.name, math.nan, high=float(frequency[0]), note=most, grade=grade("bandwidth", 0.0))
        return [found, Result(*lag, DEGREE.name, math.nan, note="bandwidth below the frequencies tried")]
    value = DEGREE.of(m.response.lag_at_bandwidth)
    return [_mean(*names, HERTZ, wide, "bandwidth"), Result(*lag, DEGREE.name, value)]


def _full_scale(m: Characterisation) -> Result:
    names = (
        "full_scale",
        "Full scale",
        "largest rate tried up to which, both ways, the mean output keeps within 1 % of the rate of the line",
        DEG_PER_S.name,
    )
    value = DEG_PER_S.of(m.full_scale)
    limited = math.isfinite(m.scenario.controller.force_limit)
    graded = grade("full_scale", value) if limited else None
    free = "" if limited else "not graded: without controller.force_limit it is that of a device without limits"
    if m.full_scale_is_last:
        notes = ["at least this, the largest rate tried; it may go further", free]
        return Result(*names, math.nan, low=value, note="; ".join(filter(None, notes)), grade=graded)
    notes = ["none: the mean output is further off at the smallest rate already" if value == 0 else "", free]
    return Result(*names, value, note="; ".join(filter(None, notes)), grade=graded)


def short(number: float) -> str:
    """Three digits; in powers of ten only where that is much shorter."""
    text = f"{number:.3g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(number) < 1e7 else text
