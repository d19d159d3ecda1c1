"""From nothing to the report."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import as_completed
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from fracgyro.extras import require
from fracgyro.files import writable_folder
from fracgyro.simulation.dataset import write_run
from fracgyro.simulation.many import threads_available

from ..verdicts import Claim, write_claims
from . import figures
from .claims import judge
from .errata import ERRATA
from .report import write_report
from .runs import CONTROLLERS, VARIANTS, Results, record_all, study, study_cases
from .step_cost import time_steps
from .table import draw_table, table, write_table

SEEDS = 100
QUICK_SEEDS = 8
# Rough costs of the stages, in units of one simulated run, for the remaining time shown.
RECORD_COST, FILE_COST, FIGURE_COST, JUDGE_COST = 6, 20, 60, 150


@dataclass(frozen=True)
class Reproduction:
    """Paths of the results, and the verdicts."""

    report: Path
    claims: list[Claim]
    seconds: float


def reproduce(
    out: str | os.PathLike[str] = "out",
    *,
    seeds: int | None = None,
    quick: bool = False,
    progress: Callable[[float, float, str], object] | None = None,
) -> Reproduction:
    """Reruns the paper; writes report.html, figures/, table1.csv, claims.json and `runs/*.nc` into the folder `out`.

    `seeds`: noise seeds for Table 1 and the claims, 2 or more (100; 8 when `quick`, which takes seconds). `progress` is
    called with (done, total, activity). Every file is complete or absent. Raises ValueError if `out` cannot be written
    or `seeds` is too small.

    >>> result = lab.reproduce("out", quick=True)  # doctest: +SKIP
    >>> {claim.id: claim.verdict for claim in result.claims if claim.variant == "printed"}["e"]  # doctest: +SKIP
    'reproduced'
    """
    seeds = (QUICK_SEEDS if quick else SEEDS) if seeds is None else seeds
    if seeds < 2:
        raise ValueError(f"seeds is {seeds}: it must be at least 2, or there are no confidence intervals")
    require("netcdf", "h5netcdf")
    begin = time.perf_counter()
    folder = writable_folder(out)
    drawn, kept = writable_folder(folder / "figures"), writable_folder(folder / "runs")

    cases = len(VARIANTS) * len(CONTROLLERS)
    total = cases * (RECORD_COST + FILE_COST) + seeds * len(study_cases()) + JUDGE_COST
    total += len(figures.FIGURES) * FIGURE_COST
    done = 0.0

    def advance(cost: float, doing: str) -> None:
        nonlocal done
        done += cost
        if progress:
            progress(done, total, doing)

    costs = {variant: time_steps(variant) for variant in VARIANTS}  # while nothing else runs
    with figures.workers(threads_available()) as pool:
        advance(0, "recording runs")
        runs = record_all(lambda n: advance(n * RECORD_COST, "recording runs"))
        drawing = figures.start_all(runs, drawn, pool)  # alongside all that follows
        for (variant, controller), run in runs.items():
            write_run(run, kept / f"{variant}_{controller}.nc")
            advance(FILE_COST, "writing runs")
        results = study(seeds, lambda n: advance(n, f"simulating {seeds} seeds"))
        rows = table(results)
        write_table(rows, folder / "table1.csv")
        draw_table(rows, drawn / "table1.svg")
        claims = judge(runs, results, costs)
        write_claims(claims, folder / "claims.json")
        advance(JUDGE_COST, "drawing figures")
        for figure in as_completed(drawing):
            figure.result()
            advance(FIGURE_COST, "drawing figures")
    seconds = time.perf_counter() - begin
    report = folder / "report.html"
    write_report(
        report,
        claims=claims,
        rows=rows,
        errata=[(erratum, erratum.evidence(Results(runs, results))) for erratum in ERRATA],
        study=results,
        captions={number: spec.caption for number, spec in figures.FIGURES.items()},
        figures=drawn,
        version=version("fracgyro"),
        seconds=seconds,
    )
    return Reproduction(report, claims, seconds)
