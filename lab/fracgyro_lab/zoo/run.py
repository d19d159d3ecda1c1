"""Entry point of `fracgyro zoo report`: all laws, tuned and judged as `compare track` does, and their claims."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fracgyro.scenario import Scenario
from fracgyro.simulation.controller import Controller
from fracgyro.simulation.simulate import DivergedError

from ..board.page import counts, operations_of
from ..comparison.contender import Contender
from ..comparison.output import write_json as write_rows
from ..comparison.plan import FIRST_HELD_OUT, Comparison, Effort, Row
from ..comparison.run import Done, finished
from ..comparison.task import Cell, Changes
from ..comparison.track import Track
from ..verdicts import Claim
from . import extra
from .criteria import Laws, Material, judge
from .facts import Facts, entries
from .laws import HOUSE, NOISE, SCENARIO, SWITCHES, base, cell, contender_of, laws, with_gains
from .page import write_report
from .printed import SWITCHES as ERRORS
from .printed import Curves, PrintedRun, integrated
from .result import CONDITIONS, Zoo

FULL = Effort(100, 4, 2, 2, 20, 8, False)
QUICK = Effort(0, 1, 1, 1, 4, 1, True)
SETTINGS = {"noise": NOISE, "none": 0.0}
VARIANTS = {"printed": frozenset(ERRORS), "corrected": frozenset[str]()}
COARSE = 5e-4  # step of the published runs in a quick report
Progress = Callable[[float, float, str], object]
Published = dict[str, dict[str, Curves]]  # by variant and run


class Task(Track):
    """The task `track` with the three changes that the report shows, and the same plant for all."""

    def plants(self, base: Scenario) -> Changes:
        return {}

    def conditions(self, base: Scenario) -> Changes:
        known = super().conditions(base)
        return {name: known[name] for name in CONDITIONS}


@dataclass(frozen=True)
class Plan(Comparison):
    """The comparison of the laws of the zoo; a quick one has the gains of the log and tunes nothing."""

    @cached_property
    def rows(self) -> list[Row]:
        every = super().rows
        if not self.effort.quick:
            return every
        return [replace(row, contender=with_gains(row.contender, setting_of(row.cell))) for row in every]


def setting_of(where: Cell) -> str:
    """The name of a setting: "noise" or "none"."""
    return "noise" if where.noise else "none"


def plan(quick: bool) -> Plan:
    """All laws, in noise and without: positions and velocities measured, except for laws of positions only."""
    every = laws()
    classes = dict.fromkeys(information for law in every.values() for information in law.classes)
    cells = tuple(cell(information, noise) for information in sorted(classes) for noise in SETTINGS.values())
    effort = QUICK if quick else FULL
    return Plan(Task(), {SCENARIO: base()}, tuple(every.values()), cells, effort, None)


def report(
    out: str | os.PathLike[str],
    *,
    quick: bool = False,
    resume: bool = False,
    operations: Path | None = None,
    progress: Progress | None = None,
) -> Zoo:
    """Tunes and judges all laws of the zoo, and the claims of its entries; writes zoo.json, report.html and report.md.

    `quick`: gains of the log, fewer seeds, in a minute. `resume`: finish the report that the folder `out` has.
    `operations`: a log with the operations of a step, benchmarks/results/flops.md. `progress` is called with (done,
    total, activity). Raises ValueError if `out` cannot be written, is in use or has another report.
    """
    begin = time.perf_counter()
    show = progress or (lambda done, total, doing: None)
    mine = plan(quick)
    counted = counts(operations.read_text(encoding="utf-8")) if operations else {}
    with finished(mine, Path(out), resume=resume, progress=progress) as done:
        laws_of = {setting: _laws(mine, done, noise) for setting, noise in SETTINGS.items()}
        rows = _rows(mine, done, counted, show)
        printed, curves = _printed(quick, show)
        found: dict[str, dict[str, Any]] = {}
        for number, (name, facts) in enumerate(entries().items()):
            show(number, len(entries()), "judging claims")
            law = contender_of(name, facts).name
            claims = [] if law not in laws_of["noise"].scenarios else _claims(facts, law, laws_of, curves.get(name, {}))
            found[name] = {**summary(name, facts), "law": law, "claims": [asdict(claim) for claim in claims]}
        result = Zoo(
            done.folder,
            rows,
            found,
            _switches(laws_of),
            printed,
            done.limits,
            mine.effort,
            done.resumed,
            time.perf_counter() - begin,
        )
        head = {"version": version("fracgyro"), "effort": asdict(mine.effort), "limits": done.limits}
        more = {"laws": rows, "entries": found, "switches": result.switches, "printed": printed}
        write_rows(done.folder / "zoo.json", {**head, **more}, list(done.rows.values()))
        write_report(done.folder, result)
    return result


def summary(name: str, facts: Facts) -> dict[str, Any]:
    """The facts of an entry that a table has."""
    return {
        "name": name,
        "year": facts.year,
        "title": facts.title,
        "doi": facts.doi,
        "seen": facts.seen,
        "words": facts.words,
        "reduces_to": facts.reduces_to,
        "remark": facts.remark,
        "information": facts.information,
        "errata": len(facts.erratum),
        "untestable": [claim.text for claim in facts.claim if not claim.criterion],
    }


def printed_run(facts: Facts, name: str, variant: str) -> PrintedRun:
    """A published run, as printed or as corrected, from the numbers of the TOML only."""
    given = dict(facts.given)
    for run in facts.run:
        if run.name == name:
            given |= run.given
    return PrintedRun({field: each.si() for field, each in given.items()}, VARIANTS[variant])


def _printed(quick: bool, show: Progress) -> tuple[dict[str, dict[str, Any]], dict[str, Published]]:
    """Figures and curves of all published runs, by entry that has some, variant and run."""
    figures: dict[str, dict[str, Any]] = {}
    curves: dict[str, Published] = {}
    for entry, facts in entries().items():
        for run in facts.run:
            for variant in VARIANTS:
                show(0, 1, f"integrating {run.name} as {variant}")
                made = printed_run(facts, run.name, variant)
                found = integrated(made, step=COARSE) if quick else integrated(made)
                curves.setdefault(entry, {}).setdefault(variant, {})[run.name] = found
                figures.setdefault(entry, {}).setdefault(variant, {})[run.name] = figures_of(found)
    return figures, curves


def figures_of(curves: Curves) -> dict[str, Any]:
    """RMS errors after t = 5 on both axes, the largest share of the bound, and when it is left; None for none."""
    rms = [None if value != value else value for value in curves.rms(5.0)]
    return {"rms": rms, "share": curves.largest_share(), "leaves": curves.leaves()}


def _laws(mine: Plan, done: Done, noise: float) -> Laws:
    judged, scenarios, failed = {}, {}, {}
    for row in mine.rows:
        if row.cell.noise != noise or row.name not in done.judged:
            continue
        name = row.contender.name
        judged[name] = done.judged[row.name]
        scenarios[name] = scenario_of(mine, row, done)
        failed[name] = None in done.rows[row.name]["sampler_errors"]
    seeds = range(FIRST_HELD_OUT, FIRST_HELD_OUT + mine.effort.held_out)
    return Laws(judged, scenarios, failed, seeds)


def scenario_of(mine: Plan, row: Row, done: Done) -> Scenario:
    """The scenario of a row with its gains."""
    return row.contender.scenario(mine.base(row.cell)).replace(done.rows[row.name]["gains"])


def _rows(mine: Plan, done: Done, counted: Mapping[tuple[str, ...], int], show: Progress) -> dict[str, dict[str, Any]]:
    """By law: its rows of the comparison in both settings, a trace of its error, operations and bytes of a step."""
    found: dict[str, dict[str, Any]] = {}
    for number, row in enumerate(mine.rows):
        show(number, len(mine.rows), "tracing errors")
        law = found.setdefault(row.contender.name, _described(row.contender))
        setting = setting_of(row.cell)
        law[setting] = done.rows[row.name]
        if row.name not in done.judged:
            continue
        scenario = scenario_of(mine, row, done)
        if setting == "noise":
            law["drift"] = None if mine.effort.quick else _drift(scenario)
            law["trace"] = extra.trace(scenario, FIRST_HELD_OUT)
            law["bytes"] = len(Controller(scenario)._core.state)
            law["operations"] = operations_of(row.contender, row.cell.information, counted)
    return found


def _drift(scenario: Scenario) -> list[float] | None:
    """Norm of what a law has learned at a tenth, half and all of 1e6 steps in noise; None if nothing.

    Empty if the law diverges.
    """
    try:
        found = extra.drift(scenario, FIRST_HELD_OUT)
    except DivergedError:
        return []
    return None if found is None else found[1]


def _described(law: Contender) -> dict[str, Any]:
    return {
        "name": law.name,
        "words": law.words,
        "house": law.name in HOUSE,
        "trace": [],
        "drift": None,
        "bytes": None,
        "operations": None,
        "noise": None,
        "none": None,
    }


def _claims(facts: Facts, law: str, laws_of: Mapping[str, Laws], curves: Published) -> list[Claim]:
    variants = curves or {"tuned": {}}
    noisy, exact = laws_of["noise"], laws_of["none"]
    return judge(facts, {name: Material(facts, law, noisy, exact, of) for name, of in variants.items()})


def _open(found: tuple[float, float, float] | None) -> tuple[float | None, ...] | None:
    """A ratio with its interval, without an infinite end, which JSON has not."""
    return None if found is None else tuple(None if math.isinf(each) else each for each in found)


def _switches(laws_of: Mapping[str, Laws]) -> list[dict[str, Any]]:
    """Ratio of the error with a part of a law to the error without it, with its interval over seeds and searches."""
    return [
        {
            "words": switch.words,
            "having": switch.having,
            "lacking": switch.lacking,
            **{setting: _open(found.ratio(switch.having, switch.lacking)) for setting, found in laws_of.items()},
        }
        for switch in SWITCHES
    ]
