"""`fracgyro sweep` and `fracgyro tune`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..extras import needs
from ..scenario.table import toml_value
from ..simulation.user_controller import controller_words
from .completion import toml_files
from .options import controller_option, jobs_option, own_controller
from .terminal import json_text, print_table, progress

if TYPE_CHECKING:
    from ..study.preview import Preview

out_option = click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results.")
dry_run_option = click.option(
    "--dry-run", is_flag=True, help="Print the number of runs and an estimate of the time, and run nothing."
)


def _folder(out: Path | None) -> Path:
    """The folder of --out. Raises UsageError without one."""
    if out is None:
        raise click.UsageError("--out is missing: it must name a folder, unless --dry-run is given")
    return out


def _print_preview(found: Preview, points: str, as_json: bool) -> None:
    """Prints the size of a study that is not run."""
    if as_json:
        click.echo(json_text(asdict(found)))
        return
    click.echo(f"{found.runs} runs: {found.points} {points}, {found.seeds} seeds, {found.steps:.3g} steps in all")
    click.echo(f"estimated time on this machine: {found.time}")
    if found.rows:
        names = list(found.rows[0])
        print_table(names, [[toml_value(row[name]) for name in names] for row in found.rows])


@click.command()
@click.argument("study", type=click.Path(path_type=Path), shell_complete=toml_files)
@out_option
@controller_option()
@jobs_option()
@dry_run_option
@click.option("--resume", is_flag=True, help="Finish the study that DIR holds.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on this Dask cluster, for example tcp://host:8786.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def sweep(
    study: Path,
    out: Path | None,
    controller: str | None,
    jobs: int | None,
    dry_run: bool,
    resume: bool,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Run every scenario of STUDY. Write one row of metrics per run, and a summary page."""
    from ..study import sweep as run_all

    own = own_controller(controller)
    if dry_run:
        with needs("study"):
            from ..study.sweep.run import preview
        return _print_preview(preview(study, controller=own), "points", as_json)
    with progress("simulating", rate="runs/s") as show:
        result = run_all(
            study, _folder(out), controller=own, resume=resume, scheduler=scheduler, jobs=jobs, progress=show
        )
    if as_json:
        click.echo(json_text(asdict(result)))
        return
    new = result.runs - result.resumed
    found = f" ({result.resumed} already finished)" if result.resumed and new else ""
    did = f"{result.runs} runs{found}, {result.diverged} diverged" if new else "already finished: no runs left"
    if result.sensitivity is not None:
        titles = ("metric", "field", "S [95 %]", "S_T [95 %]")
        print_table(titles, [(i.metric, i.field, *i.cells()) for i in result.sensitivity.indices])
        for metric, why in result.sensitivity.missing.items():
            click.echo(f"{metric} has no Sobol indices: {why}.")
    click.echo(f"{did}; {result.seconds:.1f} s. Rows: {result.data}, summary: {result.summary}")


@click.command()
@click.argument("study", type=click.Path(path_type=Path), shell_complete=toml_files)
@out_option
@controller_option()
@jobs_option()
@dry_run_option
@click.option("--resume", is_flag=True, help="Continue the study that DIR holds, up to its number of trials.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def tune(
    study: Path,
    out: Path | None,
    controller: str | None,
    jobs: int | None,
    dry_run: bool,
    resume: bool,
    as_json: bool,
) -> None:
    """Search for the best parameters of STUDY. Write the tuned scenario, validated on unseen noise seeds."""
    from ..study import tune as run_all

    own = own_controller(controller)
    if dry_run:
        with needs("study"):
            from ..study.tune.run import preview
        return _print_preview(preview(study, controller=own), "trials", as_json)
    with progress("starting") as show:
        result = run_all(study, _folder(out), controller=own, resume=resume, jobs=jobs, progress=show)
    if as_json:
        click.echo(json_text(asdict(result)))
        return
    for objective in result.held_out.objectives:
        values = f"{objective.tuned:.4g}, base {objective.base:.4g}"
        click.echo(f"{objective.label}: {values} on held-out seeds: {objective.verdict}")
    for constraint in result.held_out.constraints:
        verdict = "met" if constraint.kept else "violated"
        click.echo(f"{constraint.label}: {constraint.tuned:.5g}, at most {constraint.limit:.5g}: {verdict}")
    if result.controller is not None:
        click.echo(f"controller: {controller_words(result.controller)}")
    found = f"{result.trials} trials, {result.feasible} feasible, the best is number {result.trial}"
    click.echo(f"{found}; {result.seconds:.0f} s. Scenario: {result.scenario}, report: {result.report}")
