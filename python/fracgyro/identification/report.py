"""The report of an identification: one self-contained HTML file, figures first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from ..analysis.html import page
from . import plots
from .advice import Advice
from .first_stage import Fitted
from .prediction import Prediction
from .quantity import Quantity
from .results import Results
from .sweep import SweepFit
from .to_scenario import correction

MAX_FIGURES = 6  # spectra; further records are only in the numbers


def write_report(
    path: Path, found: Results, scenario: str, advice: Sequence[Advice], prediction: Prediction | None
) -> None:
    """Writes the report of `found` to `path`; `scenario`: its TOML."""
    first = found.conditions[0]
    timed = [fit for _, fit in first.fits if isinstance(fit, Fitted)]
    swept = [fit for _, fit in first.fits if isinstance(fit, SweepFit)]
    spectra = [figure for fit in timed for figure in plots.spectra_figures(fit)]
    decays = [plots.decay_figure(fit) for fit in timed if fit.shape.drives == 0]
    bent = [plots.backbone_figure(fit) for fit in timed if fit.cubic is not None and fit.cubic.fitted]
    text = page(
        "fracgyro.identification",
        "report.html.jinja",
        version=version("fracgyro"),
        files=found.files,
        notes=found.notes,
        failed=[each for each in found.tests if each.verdict == "fail"],
        tests=found.tests,
        spectra=spectra[:MAX_FIGURES],
        decays=decays[:1],
        backbones=bent[:1],
        circles=[(plots.circle_figure(fit), plots.response_figure(fit), fit.response.name) for fit in swept],
        whiteness=plots.whiteness_figure([fit for _, fit in first.fits]),
        profile=plots.profile_figure(first.device) if first.device else None,
        ellipse=plots.ellipse_figure(first.device) if first.device else None,
        axes=plots.axes_figure(first.device) if first.device else None,
        trends=[(each, plots.trend_figure(each)) for each in found.trends],
        rows=[row_of(each) for each in found.values()],
        scale_factor=scale_factor(found),
        prediction=prediction,
        matrix=correction(found),
        advice=advice_table(found, advice),
        scenario=scenario,
    )
    path.write_text(text, encoding="utf-8", newline="\n")


def scale_factor(found: Results) -> str | None:
    """Scale factor error, ppm, of a joint filter that is not corrected for the pick-off ratio.

    The filter attributes half of a mismatch of the pick-offs to the rate (docs/rate_sensor.md).
    """
    ratio = found.get("pickoff_ratio")
    if ratio is None or not ratio.determined:
        return None
    return f"{-5e5 * (ratio.value - 1):.4g}"


def advice_table(
    found: Results, advice: Sequence[Advice]
) -> tuple[list[str], list[tuple[str, list[tuple[str, bool]]]], list[str]] | None:
    """Quantities; for each further record its words, and for each quantity the factor of its interval and whether that
    is halved; and sentences about what halves what."""
    if not advice:
        return None
    names = list(dict.fromkeys(name for each in advice for name in each.halves))
    rows = []
    for each in advice:
        cells = [(_factor(*each.halves.get(name, (math.nan, math.nan))), name in each.halved) for name in names]
        rows.append((each.words, cells))
    return names, rows, [_sentence(name, found, advice) for name in names if _sentence(name, found, advice)]


def _factor(now: float, then: float) -> str:
    if not math.isfinite(then):
        return "" if math.isnan(then) else "not determined"
    return f"{then / now:.2f}" if math.isfinite(now) else "becomes known"


def _sentence(name: str, found: Results, advice: Sequence[Advice]) -> str:
    """The cheapest record that makes a quantity known; an empty text if it is known, or if none does."""
    quantity = found.get(name)
    if quantity is not None and quantity.determined:
        return ""
    best = next((each for each in advice if name in each.halved), None)
    return "" if best is None else f"{name}: {best.words}, ± {best.halves[name][1]:.2g}"


def row_of(quantity: Quantity) -> dict[str, str]:
    """A quantity as texts: name, meaning, value, interval, unit, scale and note."""
    kind = "relative" if quantity.relative else "absolute"
    row = {"name": quantity.name, "meaning": quantity.meaning, "unit": quantity.unit, "note": quantity.note}
    if not quantity.determined:
        return row | {"value": "not determined", "interval": "", "kind": kind}
    half = quantity.half
    digits = 4 if not half > 0 or quantity.value == 0 else math.ceil(math.log10(max(abs(quantity.value) / half, 1))) + 2
    digits = min(digits, 15)
    low, high = (_plain(each, digits) for each in quantity.interval)
    return row | {"value": _plain(quantity.value, digits), "interval": f"{low} to {high}", "kind": kind}


def _plain(value: float, digits: int) -> str:
    """The value with this number of digits, without an exponent below a million."""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text and 1 <= abs(value) < 1e6 else text
