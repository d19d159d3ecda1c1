"""From a study file to a tuned scenario, validated on held-out seeds."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...files import whole_file
from ...scenario import ScenarioError
from ...simulation.many import at_most
from ...simulation.user_controller import ControllerLike
from ..controller import fields_of_scenario, with_values
from ..folder import claim, free_if_nothing_came, locked
from ..preview import Preview, seconds
from .criteria import Score, measure
from .hold_out import HoldOut, hold_out
from .plan import Plan, read_tuning
from .report import Result, tuned_toml, write_report
from .search import Trial, choose, front, opened, ratios, study_text

DATABASE = "study.db"


@dataclass(frozen=True)
class Tuned:
    """Result of a tuning: paths of the tuned scenario and the report, counts and comparisons."""

    scenario: Path
    report: Path
    trials: int
    feasible: int
    trial: int  #: number of the chosen trial
    held_out: HoldOut
    seconds: float
    controller: ControllerLike | None  #: a law with its tuned parameters


def tune(
    study: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    controller: ControllerLike | None = None,
    resume: bool = False,
    jobs: int | None = None,
    progress: Callable[[float, float, str], object] | None = None,
) -> Tuned:
    """Tunes the fields of a study file, and compares the result with the base scenario on held-out seeds.

    Writes tuned.toml, tune.html, trials.csv and, for several objectives, pareto.csv, pareto.svg and pareto.png into the
    folder `out`. Finished trials are stored in `out`/study.db or in the study's storage. `controller`: as in `sweep`;
    the result has it with the chosen parameters. `resume`: continue the study in `out`, up to the file's number of
    trials. `jobs`: number of processors to use, by default all. `progress`: called with (runs finished, all runs,
    current step). On one machine the result depends only on the study file and the controller, not on interruptions or
    the number of processors.

    Raises ValueError for an invalid study, before anything runs; an `out` that is in use or has another study or
    controller; a storage that cannot be used; no trial that meets every constraint; also the errors that `simulate`
    raises for a controller.

    >>> with open("gains.toml", "w") as file:
    ...     print("seeds = 2", file=file)
    ...     print("fixed.run.duration = 12.0", file=file)
    ...     print("vary.controller.fractional_gain = { low = 5.0, high = 20.0 }", file=file)
    ...     print("tune = { trials = 4, held_out_seeds = 2 }", file=file)
    ...     print('objective = [{ metric = "rmse_steady_x" }]', file=file)
    >>> fg.study.tune("gains.toml", "gains").trials
    4
    """
    begin = time.perf_counter()
    plan = read_tuning(study, controller)
    with at_most(jobs), locked(Path(out)):
        folder = claim(Path(out), plan.parts(), {"study": study_text(plan)}, resume=resume)
        seeds = plan.file.seeds
        total = _runs(plan)
        done = 0

        def advance(runs: int, doing: str = "searching") -> None:
            nonlocal done
            done += runs
            if progress:
                progress(min(done, total), total, doing)

        advance(0)
        with free_if_nothing_came(folder, resume=resume):
            (base,) = measure([plan.base], seeds, plan.thresholds, advance, controller, plan.tasks)
        address = plan.file.tune.storage or f"sqlite:///{(folder / DATABASE).absolute()}"
        with opened(plan, address, base, resume=resume) as search:
            advance(len(search.finished()) * len(seeds))
            search.run(advance)
            trials = search.finished()
        members = front(trials)
        if not members:
            raise ScenarioError(_nearest(plan, trials))
        chosen = choose(members, search.base)
        tuned = plan.base.replace(fields_of_scenario(chosen.values))
        held = hold_out(plan, search, chosen, tuned, lambda runs: advance(runs, "holding out"))
        result = Result(plan, search.base, search.limits, trials, members, chosen, tuned, held)

        _write_trials(folder / "trials.csv", plan, search.base, trials)
        if len(plan.file.objective) > 1:
            _write_trials(folder / "pareto.csv", plan, search.base, members)
        with whole_file(folder / "tuned.toml") as scratch:
            scratch.write_text(tuned_toml(result), encoding="utf-8", newline="\n")
        write_report(result, folder)
    feasible = sum(trial.score.feasible for trial in trials)
    seconds = time.perf_counter() - begin
    files, own = (folder / "tuned.toml", folder / "tune.html"), with_values(controller, chosen.values)
    return Tuned(*files, len(trials), feasible, chosen.number, held, seconds, own)


def preview(study: str | os.PathLike[str], *, controller: ControllerLike | None = None) -> Preview:
    """The size and the estimated time of a tuning, which is not run. Raises ValueError for an invalid study."""
    plan = read_tuning(study, controller)
    runs, trials = _runs(plan), plan.file.tune.trials
    steps = runs * plan.base.run.steps
    base = plan.base_values()
    rows = [] if base is None else [base]
    return Preview(
        runs, trials, len(plan.file.seeds), steps, seconds(plan.base, runs, steps, controller, plan.tasks), rows
    )


def _runs(plan: Plan) -> int:
    """Number of runs: those of the base and the trials, and both again on the held-out seeds."""
    return (plan.file.tune.trials + 1) * len(plan.file.seeds) + 2 * len(plan.held_out)


def _nearest(plan: Plan, trials: list[Trial]) -> str:
    def excess(trial: Trial) -> float:
        return 1e9 * trial.score.diverged + sum(max(0.0, over) for over in trial.score.excess)

    nearest = min(trials, key=excess)
    broken = [
        f"{c.label} by {over:.2g} of its limit"
        for c, over in zip(plan.file.constraint, nearest.score.excess, strict=True)
        if over > 0
    ]
    missed = "it diverged" if nearest.score.diverged else " and ".join(broken) or "an objective has no value"
    return (
        f"no feasible trial among {len(trials)}; the nearest, trial {nearest.number}, misses: {missed}; relax a "
        "constraint, widen vary, or increase tune.trials and use --resume"
    )


def _write_trials(path: Path, plan: Plan, base: Score, trials: list[Trial]) -> None:
    """Writes one row per trial: number, values, objectives, their ratios to the base, constraints, feasible."""
    file = plan.file
    header = ["trial", *(d.field for d in plan.dimensions), *(o.label for o in file.objective)]
    header += [f"{o.label} over base" for o in file.objective]
    header += [*(f"constraint: {c.label}" for c in file.constraint), "diverged", "feasible"]
    with whole_file(path) as scratch, open(scratch, "w", newline="", encoding="utf-8") as text:
        rows = csv.writer(text)
        rows.writerow(header)
        for trial in trials:
            score = trial.score
            found = [*score.objectives, *ratios(score, base), *score.constraints, score.diverged]
            values = (trial.values[d.field] for d in plan.dimensions)
            rows.writerow([trial.number, *values, *found, str(score.feasible).lower()])
