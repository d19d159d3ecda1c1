"""The report of a comparison, report.html."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any

from fracgyro.analysis.html import embedded, page
from fracgyro.analysis.style import own_style
from fracgyro.files import whole_file
from fracgyro.scenario.table import toml_value

from . import plots
from .plan import Comparison
from .plots import DEAD, Fronts, Robustness, Row, error_legend, error_panel


def write_report(path: Path, plan: Comparison, rows: Sequence[Row], limits: Sequence[Row]) -> None:
    named = next(iter(plan.scenarios)) if len(plan.scenarios) > 1 else None
    tables = tables_of(rows, with_ceiling=True, unnamed=named)
    ranked = [(words, sorted(of, key=rank)) for words, of in tables]
    joined = tables_of(rows, with_ceiling=False, unnamed=named)
    highest = {_sensing(of[0]): max(row["ceiling"] for row in of) for _, of in joined}
    loose = [(words, of) for words, of in ranked if of[0]["ceiling"] == highest[_sensing(of[0])]]
    conditions = list(dict.fromkeys(name for base in plan.scenarios.values() for name in plan.task.conditions(base)))
    plants = list(dict.fromkeys(name for row in rows for name in row["others"] if name not in conditions))
    ceilings = any(cell.ceiling for cell in plan.cells)
    with own_style():
        robustness = Robustness(conditions)
        panels = {
            "errors": [
                embedded(error_legend(), "Legend"),
                *(embedded(error_panel(*table, labelled(plan.task.error_words)), "Errors") for table in ranked),
            ],
            "robustness": [
                embedded(robustness.legend(), "Legend"),
                *(embedded(robustness.panel(*table), "Robustness") for table in loose),
            ],
        }
        data = {
            "errors": plots.error_data(ranked, "{} ({})".format(*plan.task.error_words)),
            "robustness": plots.robustness_data(loose),
        }
        if ceilings:
            fronts = Fronts(rows, limits)
            panels["fronts"] = [
                embedded(fronts.legend(), "Legend"),
                *(
                    embedded(panel(*table), "Error over chattering")
                    for table in joined
                    for panel in (fronts.panel, fronts.steady)
                ),
            ]
            data["fronts"] = plots.front_data(joined, limits)
    text = page(
        "fracgyro_lab.comparison",
        f"{plan.task.name}.html.jinja",
        filters={
            "number": number,
            "interval": interval,
            "times": times,
            "toml": toml_value,
            "chattering": chattering,
            "remarks": remarks,
        },
        title=f"{plan.task.title}: controllers compared",
        version=version("fracgyro"),
        plan=plan,
        effort=plan.effort,
        ceilings=ceilings,
        tables=[(words, limit_row(limits, of[0]), of) for words, of in ranked],
        limits=limits,
        metrics=[labelled(plan.task.words(name)) for name in plan.task.metrics],
        error_words=labelled(plan.task.error_words),
        conditions=conditions,
        plants=plants,
        unscaled=unscaled(plan),
        panels=panels,
        data=data,
    )
    with whole_file(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _sensing(row: Row) -> tuple[str, str, float]:
    return row["scenario"], row["class"], row["noise"]


def limit_row(limits: Sequence[Row], like: Row) -> Row | None:
    """The limit as a row of the table that `like` is in; None where it has none."""
    for limit in limits:
        if _sensing(limit) == _sensing(like):
            for at in limit["ceilings"]:
                if at["ceiling"] == like["ceiling"]:
                    found = {name: value for name, value in at.items() if name.startswith("rmse") or name == "error"}
                    plain = {name: {"value": value, "low": None, "high": None} for name, value in found.items()}
                    return {"name": "limit", "words": "the least of any controller", "metrics": plain}
    return None


def unscaled(plan: Comparison) -> list[str]:
    """Tuned fields whose ranges are not in units of the device's frequency."""
    gains = [gain for contender in plan.contenders for gain in (*contender.gains, contender.observer) if gain]
    return list(dict.fromkeys(gain.field for gain in gains if gain.power() is None))


def chattering(row: Row) -> str:
    """The chattering that the error was reached with, of the larger axis."""
    return number(plots.largest(row, plots.CHATTERING))


def remarks(row: Row) -> str:
    """Remarks that a reader of a table must know of the row."""
    found = []
    if not row["metrics"]:
        found.append("no trial kept the limits")
    elif not row["kept"]:
        found.append("beyond a limit on held-out seeds")
    if row["converged"] is False and row["tuned"]:
        low, high = row["range"] or (None, None)
        found.append("not converged" + (f": {number(low)} to {number(high)}" if low is not None else ""))
    if row["range_ends"]:
        found.append(f"at range end: {', '.join(row['range_ends'])}")
    return "; ".join(found)


def tables_of(rows: Sequence[Row], *, with_ceiling: bool, unnamed: str | None = None) -> list[tuple[str, list[Row]]]:
    """Tables of comparable rows with their titles. Classes of information are in separate tables.

    `unnamed`: of several scenarios the one that titles do not name.
    """

    def key(row: Row) -> tuple[Any, ...]:
        first = unnamed is None or row["scenario"] == unnamed
        return not first, row["scenario"], row["class"], row["noise"], row["ceiling"] if with_ceiling else 0.0

    return [
        (title("" if not other else scenario, *of), list(found))
        for (other, scenario, *of), found in groupby(sorted(rows, key=key), key)
    ]


def title(scenario: str, information: str, noise: float, ceiling: float) -> str:
    sensing = f"{noise:g} m/√Hz" if noise else "no noise"
    words = f"{scenario}{', ' if scenario else ''}class {information}, {sensing}"
    return f"{words}, chattering ≤ {ceiling:g}" if ceiling else words


def labelled(words: tuple[str, str]) -> str:
    """A quantity with its unit."""
    return ", ".join(filter(None, words))


def rank(row: Row) -> tuple[bool, float]:
    """Sort key: rows within the limits first, then by error."""
    error = row["metrics"].get("error", {}).get("value")
    return not row["kept"], math.inf if error is None else error


def number(value: float | None, digits: int = 3) -> str:
    if value is None:
        return "–"
    return f"{value:.{digits}g}".replace("e-0", "e-").replace("-", "\N{MINUS SIGN}")


def interval(found: dict[str, float | None] | None) -> str:
    if not found or found["value"] is None:
        return "–"
    if found["low"] is None and found["high"] is None:  # a single value
        return number(found["value"])
    return f"{number(found['value'])} [{number(found['low'])}, {number(found['high'])}]"


def times(found: dict[str, Any]) -> str:
    """A ratio, or the number of lost runs."""
    if found["lost"]:
        return f"lost {found['lost']}/{found['seeds']}"
    return number(found["value"]) if found["value"] is None or found["value"] > DEAD else "dead zone"
