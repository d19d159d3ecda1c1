"""The summary page of a study: one self-contained HTML file."""

from __future__ import annotations

from importlib.metadata import version
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.confidence import Mean
from ...analysis.html import csv_text, page
from ...analysis.metric_names import ALL_METRICS
from ...files import whole_file
from ...scenario import Scenario
from ...scenario.kinds import reports
from ...scenario.table import toml_value
from ...simulation.user_controller import controller_words
from ..controller import is_parameter
from ..space import Dimension
from . import effects, plots
from .design import Plan
from .effects import QUANTILES, Best, Rows
from .indices import Sensitivity
from .totals import Totals

BEST = 5  # points listed for each metric
MAX_MAPPED = 4  # fields, up to which pairs are drawn as heat maps
DESIGN_WORDS = {
    "grid": "every combination of the values",
    "list": "the listed values side by side",
    "random": "a random sample",
    "latin_hypercube": "a Latin hypercube sample",
    "sobol": "a scrambled Sobol sample",
    "sobol_indices": "a scrambled Sobol sample in blocks for Sobol indices",
}


def write_summary(path: Path, rows: Rows, sensitivity: Sensitivity | None) -> None:
    """Writes the page of all rows of the plan to `path`."""
    plan, sample = rows.plan, rows.independent()
    numeric = [d for d in plan.dimensions if effects.axis(rows, d, 2).numeric]
    correlated = rows.sampled and len(numeric) > 1
    _write(
        path,
        plan,
        diverged=rows.diverged,
        diverged_where=_diverged_where(rows) if rows.diverged else [],
        metrics=[_metric(rows, sample, name) for name in plan.study.show],
        independent=len(sample.plan.points),
        counted=sample.plan.runs - sample.diverged,
        sensitivity=sensitivity,
        spread_of=[f"{100 * q:g} %" for q in QUANTILES] if rows.sampled else [],
        **(_correlation(sample, numeric) if correlated else {"correlation": None}),
        chance=1.96 / np.sqrt(max(len(sample.plan.points) - 1, 1)),
    )


def write_summary_of_totals(path: Path, totals: Totals) -> None:
    """Writes the page without what needs rows to `path`."""
    _write(
        path,
        totals.plan,
        diverged=totals.diverged,
        diverged_where=_diverged_in(totals) if totals.diverged else [],
        metrics=[_metric_of_totals(totals, name) for name in totals.plan.study.show],
        counted=totals.runs - totals.diverged,
        sensitivity=None,
        spread_of=["mean", "standard deviation", "least", "greatest"],
        correlation=None,
    )


def _write(path: Path, plan: Plan, **values: Any) -> None:
    text = page(
        "fracgyro.study.sweep",
        "summary.html.jinja",
        title=plan.study.title or "A study",
        version=version("fracgyro"),
        plan=plan,
        base=BASE_WORDS.get(plan.study.scenario, f"from {plan.study.scenario}"),
        fixed=plan.study.fixed,
        user_controller=controller_words(plan.controller),
        design=DESIGN_WORDS[plan.study.design.kind],
        durations=" or ".join(f"{d:g}" for d in sorted(plan.facts.durations)[:9]),
        fields=[_field(dimension) for dimension in plan.dimensions],
        words={name: ALL_METRICS[name][0] for name in plan.study.show},
        max_mapped=MAX_MAPPED,
        thresholds=plan.study.metrics.model_dump(),
        **values,
    )
    with whole_file(path) as scratch:
        scratch.write_text(text, encoding="utf-8", newline="\n")


BASE_WORDS = {"paper": "the paper's, corrected", "paper-printed": "the paper's, as printed"}


def _metric(rows: Rows, sample: Rows, name: str) -> dict[str, Any]:
    """Values of the page for one metric; `sample`: rows of independent points."""
    plan, values = rows.plan, rows.metric(name)
    never = int((np.isnan(values) & rows.kept).sum())
    found, eligible = effects.best(rows, name, plan.study.show, BEST)
    dimensions = plan.dimensions if np.isfinite(sample.metric(name)).any() else ()
    maps, pairs, blank = [], [], False
    if 2 <= len(dimensions) <= MAX_MAPPED and plan.study.design.kind != "list":
        pairs = [effects.cells(sample, name, a, b) for a, b in combinations(dimensions, 2)]
        blank = any(bool(pair.empty.any()) for pair in pairs)
        every = np.concatenate([pair.values[np.isfinite(pair.values)] for pair in pairs])
        limits = float(every.min()), float(every.max())
        maps = [(pair.across.field, pair.up.field, plots.heat_map(name, pair, limits)) for pair in pairs]
    along = [effects.effect(sample, name, dimension) for dimension in dimensions]
    spread = effects.quantiles(sample, name) if rows.sampled else np.empty(0)
    return {
        **_known(plan, name, never, along, spread),
        "maps": maps,
        "data": plots.numbers(name, along, pairs, sampled=rows.sampled),
        "blank": blank,
        "mapped_partial": never + rows.diverged > 0,
        **_best(plan, found, eligible),
    }


def _known(plan: Plan, name: str, never: int, along: list[effects.Effect], spread: np.ndarray) -> dict[str, Any]:
    """The part that needs no rows; `spread` has the figures of the table of spreads."""
    power = plots.power_of(spread)
    return {
        "name": name,
        "label": plots.label(name, power),
        "words": ALL_METRICS[name][0],
        "never": never,
        "reported": _reported(plan, name, bool(along)),
        "partial": any(any(effect.partial) for effect in along),
        "spread": [_number(figure / 10.0**power) for figure in spread],
        "effects": plots.effects_chart(name, along) if along else None,
    }


def _metric_of_totals(totals: Totals, name: str) -> dict[str, Any]:
    """The same without rows: no quantiles, no maps."""
    plan, spread, never = totals.plan, totals.spread[name], totals.never(name)
    along = [totals.effect(name, dimension) for dimension in plan.dimensions] if spread.count else []
    figures = np.array([spread.mean, spread.deviation, spread.least, spread.greatest] if spread.count else [np.nan] * 4)
    found, eligible = totals.best(name)
    return {
        **_known(plan, name, never, along, figures),
        "maps": [],
        "data": plots.numbers(name, along, [], sampled=False),
        **_best(plan, found, eligible),
    }


def _best(plan: Plan, found: list[Best], eligible: int) -> dict[str, Any]:
    return {
        "eligible": eligible,
        "best": [(b.point, [_value(v) for v in b.values]) for b in found],
        "best_means": [_means([b.means[i] for b in found], shown) for i, shown in enumerate(plan.study.show)],
    }


# Channel of a metric, by the first word of the metric's name.
REPORTS = {
    "rate": "rate_estimate",
    "damping": "damping_estimate",
    "stiffness": "stiffness_estimate",
    "bound": "bound_estimate",
    "surface": "surface",
}


def _reported(plan: Plan, name: str, found: bool) -> bool:
    """True if a controller of the study reports the metric's channel; `found`: some run has the metric."""
    channel = REPORTS.get(name.partition("_")[0])
    if channel is None or plan.controller is not None:
        return channel is None or found
    return any(channel == own.name for kind in plan.facts.controllers for listed in reports(kind) for own in listed)


def _correlation(rows: Rows, numeric: list[Dimension]) -> dict[str, str]:
    shown, fields = rows.plan.study.show, [dimension.field for dimension in numeric]
    values = [[effects.rank_correlation(rows, name, dimension) for dimension in numeric] for name in shown]
    header = ["metric", *(f"rank correlation with {field}" for field in fields)]
    table = csv_text(header, ([name, *line] for name, line in zip(shown, values, strict=True)))
    return {"correlation": plots.correlation_chart(shown, fields, np.array(values)), "correlation_data": table}


def _diverged_where(rows: Rows) -> list[tuple[str, list[tuple[str, int, int]]]]:
    """For each field: level or bin, diverged runs, all runs."""
    where = []
    for dimension in rows.plan.dimensions:
        axis = effects.axis(rows, dimension, 5)
        counts = np.bincount(axis.index, minlength=len(axis.names))
        gone = np.bincount(axis.index[~rows.kept], minlength=len(axis.names))
        lines = [(n, int(g), int(c)) for n, g, c in zip(axis.names, gone, counts, strict=True) if g]
        where.append((dimension.field, lines))
    return where


def _diverged_in(totals: Totals) -> list[tuple[str, list[tuple[str, int, int]]]]:
    return [
        (along.field, [(name, gone, runs) for name, (runs, gone) in zip(along.names, counts, strict=True) if gone])
        for along, counts in totals.diverged_where()
    ]


def _field(dimension: Dimension) -> tuple[str, str, str]:
    """Name, values and meaning of a field."""
    model: Any = Scenario
    meaning = "a parameter of the controller" if is_parameter(dimension.field) else ""
    for name in [] if meaning else dimension.field.split("."):
        info = model.model_fields[name]
        meaning, model = info.description or meaning, info.annotation
    grid = dimension.grid()
    if grid is None:
        spread = "log-uniform" if dimension.scale == "log" else "uniform"
        return dimension.field, f"{_value(dimension.low)} to {_value(dimension.high)}, {spread}", meaning
    return dimension.field, ", ".join(map(_value, grid)), meaning


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.5g}"
    return value if isinstance(value, str) else toml_value(value)


def _number(value: float) -> str:
    return "never" if value == np.inf else "–" if np.isnan(value) else f"{value:.3g}"


def _means(means: list[Mean], name: str) -> tuple[str, list[str]]:
    """Heading and cells of a table column, with intervals if available."""
    power = plots.power_of(np.array([mean.mean for mean in means]))
    cells = []
    for mean in means:
        scaled = Mean(*(value / 10.0**power for value in mean))
        number = _number(scaled.mean)
        cells.append(f"{scaled:.3g}" if np.isfinite(scaled.low) else number)
    return plots.label(name, power), cells
