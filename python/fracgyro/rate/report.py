"""The report of a characterization: one self-contained HTML file."""

from __future__ import annotations

import math
from importlib.metadata import version
from pathlib import Path

from ..analysis.html import page
from ..simulation.user_controller import controller_words
from . import plots
from .grades import GRADES
from .in_volts import AngleDrift
from .measure import Characterization
from .results import Result, short


def write_report(path: Path, measured: Characterization, found: list[Result], drift: AngleDrift | None = None) -> None:
    """Writes the report of `measured` with the figures `found` to `path`; `drift`: of a whole-angle gyroscope."""
    rest = measured.rest
    text = page(
        "fracgyro.rate",
        "report.html.jinja",
        version=version("fracgyro"),
        measured=measured,
        user_controller=controller_words(measured.controller),
        found=[(result, value_of(result), interval_of(result), grade_of(result)) for result in found],
        output_rate=f"{1 / rest.interval:.4g}",
        record=f"{rest.rate.shape[1] * rest.interval:.3g}",
        grades=GRADES,
        limit=_limit,
        scenario=measured.scenario.to_toml(),
        allan=plots.allan_chart(measured),
        ladder=plots.ladder_chart(measured),
        start=plots.turn_on_chart(measured),
        response=plots.response_chart(measured),
        angle=plots.angle_chart(drift) if drift else None,
    )
    path.write_text(text, encoding="utf-8", newline="\n")


def value_of(result: Result) -> str:
    """The value, or its limit with < or ≥."""
    if math.isfinite(result.value):
        return short(result.value)
    if math.isfinite(result.high):
        return f"< {short(result.high)}"
    return f"≥ {short(result.low)}" if math.isfinite(result.low) else "–"


def interval_of(result: Result) -> str:
    """The 95 % interval, or empty."""
    whole = all(map(math.isfinite, (result.value, result.low, result.high)))
    return f"{short(result.low)} to {short(result.high)}" if whole else ""


def si_of(result: Result) -> str:
    """The value in the unit of navigation filters, or empty."""
    if result.si is None or not math.isfinite(result.value if math.isfinite(result.value) else result.high):
        return ""
    unit, per_si = result.si
    sign = "" if math.isfinite(result.value) else "< "
    value = result.value if math.isfinite(result.value) else result.high
    return f"{sign}{value / per_si:.3g} {unit}"


def grade_of(result: Result) -> str:
    """The grade; for a figure that was not observed, the grade of its limit."""
    if result.grade is None:
        return ""
    return result.grade if math.isfinite(result.value) else f"{result.grade} (limit only)"


def _limit(value: float) -> str:
    return "any" if math.isinf(value) else f"{value:g}"
