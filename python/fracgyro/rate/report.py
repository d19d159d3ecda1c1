"""The report of a characterisation: one self-contained HTML file."""

from __future__ import annotations

import math
from importlib.metadata import version
from pathlib import Path

from ..analysis.html import page
from ..simulation.outside import controller_words
from . import plots
from .grades import GRADES
from .measure import Characterisation
from .results import Result, short


def write_report(path: Path, measured: Characterisation, found: list[Result]) -> None:
    """Writes `path`."""
    rest = measured.rest
    text = page(
        "fracgyro.rate",
        "report.html.jinja",
        version=version("fracgyro"),
        measured=measured,
        outside=controller_words(measured.controller),
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
    )
    path.write_text(text, encoding="utf-8", newline="\n")


def value_of(result: Result) -> str:
    """The value, or the side on which it lies."""
    if math.isfinite(result.value):
        return short(result.value)
    if math.isfinite(result.high):
        return f"< {short(result.high)}"
    return f"≥ {short(result.low)}" if math.isfinite(result.low) else "–"


def interval_of(result: Result) -> str:
    """Of 95 %, where there is one."""
    whole = all(map(math.isfinite, (result.value, result.low, result.high)))
    return f"{short(result.low)} to {short(result.high)}" if whole else ""


def si_of(result: Result) -> str:
    """The value in the unit of navigation filters, where there is one."""
    if result.si is None or not math.isfinite(result.value if math.isfinite(result.value) else result.high):
        return ""
    unit, per_si = result.si
    sign = "" if math.isfinite(result.value) else "< "
    value = result.value if math.isfinite(result.value) else result.high
    return f"{sign}{value / per_si:.3g} {unit}"


def grade_of(result: Result) -> str:
    """The grade; of a figure that was not observed, that of its limit."""
    if result.grade is None:
        return ""
    return result.grade if math.isfinite(result.value) else f"{result.grade} (limit only)"


def _limit(value: float) -> str:
    return "any" if math.isinf(value) else f"{value:g}"
