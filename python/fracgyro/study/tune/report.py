"""Report of a tuning: tune.html, pareto.svg and .png, and the head of tuned.toml."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from ...analysis.html import csv_text, embedded, page
from ...analysis.metric_names import ALL_METRICS
from ...analysis.style import DPI, own_style, save_svg
from ...files import one_line, whole_file
from ...scenario import Scenario
from ...scenario.table import toml_value
from ...simulation.user_controller import controller_words
from ..controller import is_parameter
from ..space import Dimension, value_of
from .criteria import Score
from .hold_out import HoldOut
from .plan import Plan
from .plots import history_figure, pareto_figure
from .search import Trial, ratios, study_text

SAMPLERS = {"tpe": "TPE", "cmaes": "CMA-ES", "nsga2": "NSGA-II"}
EDGE = 0.02  # fraction of a range: closer to an end counts as at the end


@dataclass(frozen=True)
class Result:
    """Everything that the report of a tuning needs."""

    plan: Plan
    base: Score
    limits: list[float]
    trials: list[Trial]
    members: list[Trial]
    chosen: Trial
    tuned: Scenario
    held_out: HoldOut


def tuned_toml(result: Result) -> str:
    """The tuned scenario, with its provenance in comments below the first line."""
    first, rest = result.tuned.to_toml().split("\n", 1)
    # A title may have line breaks, and TOML allows no control characters even in comments.
    lines = (line for item in _provenance(result) for line in item.splitlines() or [""])
    return "\n".join([first, *(f"# {one_line(line)}".rstrip() for line in lines), "#", rest])


def _provenance(result: Result) -> list[str]:
    plan, held, file = result.plan, result.held_out, result.plan.file
    feasible = sum(trial.score.feasible for trial in result.trials)
    user = controller_words(plan.controller)
    command = "fracgyro.study.tune" if user else "fracgyro tune"
    lines = [
        "",
        f"{file.title or 'Tuned'}: by fracgyro {version('fracgyro')}, `{command} {plan.name}`.",
        f"sha256 of {plan.name}: {hashlib.sha256(plan.text.encode()).hexdigest()}",
        f"{SAMPLERS[file.tune.sampler]}, seed {file.tune.seed}: trial {result.chosen.number} of {len(result.trials)}, "
        f"{feasible} of them feasible; tuned on {len(file.seeds)} noise seeds.",
        f"Compared with the base scenario on {len(plan.held_out)} other seeds, {plan.held_out[0]} to "
        f"{plan.held_out[-1]}:",
    ]
    lines[2:2] = [f"The controller before tuning was {user}, which replaces [controller]."] if user else []
    lines += [
        f"  {o.label}: {o.tuned:.4g}, base {o.base:.4g}: {_percent(o.tuned, o.base)}, {o.verdict}"
        f" (on the tuning seeds {_percent(o.searched, o.searched_base)})"
        for o in held.objectives
    ]
    lines += [
        f"  {c.label}: {c.tuned:.5g}, at most {c.limit:.5g}: {'met' if c.kept else 'VIOLATED'}"
        for c in held.constraints
    ]
    if held.diverged:
        lines.append(f"  DIVERGED in {held.diverged} of these seeds.")
    lines.append("Worse (mean over those seeds, 95 % interval of the paired difference above zero):")
    worse = [
        f"  {m.metric}: {m.tuned:.4g}, base {m.base:.4g}" + _never(m.never_tuned, m.never_base)
        for m in held.metrics
        if m.verdict == "worse" and not m.neutral
    ]
    lines += worse or ["  no metric"]
    lines.append("Changed:")
    lines += [
        f"  {d.field} = {toml_value(result.chosen.values[d.field])}, was {_base(plan, d.field)}"
        for d in plan.dimensions
    ]
    return lines


def _never(tuned: int, base: int) -> str:
    return f" (never in {tuned} seeds, base {base})" if tuned or base else ""


def _percent(value: float, base: float) -> str:
    if not (math.isfinite(value) and 0 < abs(base) < math.inf):
        return "no ratio"
    return f"{100 * (value / base - 1):+.1f} %".replace("-", "\N{MINUS SIGN}")


def _base(plan: Plan, field: str) -> str:
    return toml_value(value_of(field, plan.base, plan.controller))


PARETO = "Pairs of objectives relative to the base scenario"


def write_report(result: Result, folder: Path) -> None:
    """Writes the self-contained tune.html and, for several objectives, pareto.svg and pareto.png."""
    plan, file = result.plan, result.plan.file
    with own_style():
        history = history_figure(file.objective, result.base, result.trials, result.chosen)
        pareto = None
        if len(file.objective) > 1:
            figure = pareto_figure(file.objective, result.base, result.trials, result.members, result.chosen)
            save_svg(figure, folder / "pareto.svg", PARETO)
            with whole_file(folder / "pareto.png") as scratch:
                figure.savefig(scratch, dpi=DPI)
            pareto = embedded((folder / "pareto.svg").read_bytes())
        drawn = embedded(history, "Objectives by trial")
    text = page(
        "fracgyro.study.tune",
        "report.html.jinja",
        filters={"number": _number, "percent": lambda pair: _percent(*pair)},
        title=file.title or f"Tuning {plan.name}",
        version=version("fracgyro"),
        plan=plan,
        study_text=study_text(plan),
        sampler=SAMPLERS[file.tune.sampler],
        trials=len(result.trials),
        feasible=sum(trial.score.feasible for trial in result.trials),
        diverged=sum(trial.score.diverged > 0 for trial in result.trials),
        chosen=result.chosen,
        is_base=result.tuned == plan.base
        and all(
            result.chosen.values[d.field] == value_of(d.field, plan.base, plan.controller)
            for d in plan.dimensions
            if is_parameter(d.field)
        ),
        user_controller=controller_words(plan.controller),
        members=result.members,
        held=result.held_out,
        worse=[m.words for m in result.held_out.metrics if m.verdict == "worse" and not m.neutral],
        parameters=[_parameter(d, result) for d in plan.dimensions],
        pareto=pareto,
        history=drawn,
        data=_data(result),
        scenario=tuned_toml(result),
    )
    with whole_file(folder / "tune.html") as scratch:
        scratch.write_text(text, encoding="utf-8")


def _data(result: Result) -> str:
    """Data of both plots, one row per trial, as CSV."""
    header, front = ["trial"], {trial.number for trial in result.members}
    for objective, base in zip(result.plan.file.objective, result.base.objectives, strict=True):
        unit = ALL_METRICS[objective.metric][1]
        over = " over base" if 0 < base < math.inf else f" ({unit})" if unit else ""
        header.append(f"{objective.label}{over}")
    rows = []
    for trial in result.trials:
        found, number = ratios(trial.score, result.base), trial.number
        mean = math.prod(found) ** (1 / len(found))
        stands = trial.score.feasible, number in front, number == result.chosen.number
        rows.append([number, *found, mean, *(str(yes).lower() for yes in stands)])
    return csv_text([*header, "geometric mean", "feasible", "on the front", "chosen"], rows)


def _parameter(dimension: Dimension, result: Result) -> dict[str, str]:
    value = result.chosen.values[dimension.field]
    if dimension.choices is not None:
        allowed, edge = f"one of {len(dimension.choices)} values", ""
        numbers = all(isinstance(choice, tuple | float | int) for choice in dimension.choices)
        if numbers and value in (dimension.choices[0], dimension.choices[-1]):
            edge = "at the end of its list"
    else:
        allowed = f"{dimension.low:g} to {dimension.high:g}" + (", log" if dimension.scale == "log" else "")
        low, high, at = dimension.low, dimension.high, float(value)
        if dimension.scale == "log":
            low, high, at = math.log(low), math.log(high), math.log(at)
        edge = "at the edge of its range" if min(at - low, high - at) < EDGE * (high - low) else ""
    base = _base(result.plan, dimension.field)
    return {"field": dimension.field, "base": base, "tuned": toml_value(value), "allowed": allowed, "edge": edge}


def _number(value: float, digits: int = 4) -> str:
    """A number as text; small and large numbers as 1.23 × 10⁻⁵."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{float(f'{value:.{digits}g}'):.6g}".replace("-", "\N{MINUS SIGN}")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa} × 10{power}".replace("-", "\N{MINUS SIGN}")
