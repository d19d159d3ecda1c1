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


def write_report(path: Path, plan: Comparison, rows: Sequence[Row]) -> None:
    tables = _tables(rows, with_ceiling=True, named=len(plan.scenarios) > 1)
    ranked = [(words, sorted(of, key=rank)) for words, of in tables]
    loose = [(words, of) for words, of in ranked if of[0]["ceiling"] == plan.task.ceilings[-1]]
    base = next(iter(plan.scenarios.values()))
    conditions = list(plan.task.conditions(base))
    plants = list(dict.fromkeys(name for row in rows for name in row["others"] if name not in conditions))
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
        if len(plan.task.ceilings) > 1:
            fronts = Fronts(rows, plan.task.ceilings)
            joined = _tables(rows, with_ceiling=False, named=len(plan.scenarios) > 1)
            panels["fronts"] = [
                embedded(fronts.legend(), "Legend"),
                *(embedded(fronts.panel(*table), "Error over chattering or effort") for table in joined),
            ]
            data["fronts"] = plots.front_data(joined)
    text = page(
        "fracgyro_lab.comparison",
        f"{plan.task.name}.html.jinja",
        filters={"number": number, "interval": interval, "times": times, "toml": toml_value},
        title=f"{plan.task.title}: controllers compared",
        version=version("fracgyro"),
        plan=plan,
        effort=plan.effort,
        tables=ranked,
        metrics=[labelled(plan.task.words(name)) for name in plan.task.metrics],
        error_words=labelled(plan.task.error_words),
        names={contender.name: contender for contender in plan.contenders},
        conditions=conditions,
        plants=plants,
        panels=panels,
        data=data,
    )
    with whole_file(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _tables(rows: Sequence[Row], *, with_ceiling: bool, named: bool) -> list[tuple[str, list[Row]]]:
    """Tables of comparable rows with their titles. Classes of information are in separate tables."""

    def key(row: Row) -> tuple[Any, ...]:
        return row["scenario"] if named else "", row["class"], row["noise"], row["ceiling"] if with_ceiling else 0.0

    return [(title(*of), list(found)) for of, found in groupby(sorted(rows, key=key), key)]


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
    if found["low"] is None:  # a single value
        return number(found["value"])
    return f"{number(found['value'])} [{number(found['low'])}, {number(found['high'])}]"


def times(found: dict[str, Any]) -> str:
    """A ratio, or the number of lost runs."""
    if found["lost"]:
        return f"lost {found['lost']}/{found['seeds']}"
    return number(found["value"]) if found["value"] is None or found["value"] > DEAD else "dead zone"
