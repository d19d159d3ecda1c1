"""`fracgyro simulate` and `fracgyro scenario`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from ..extras import needs
from ..scenario import Scenario
from ..scenario.kinds import reported_channels
from ..scenario.named import named
from ..scenario.quantities import number_of
from ..scenario.shipped import NAMES, SHIPPED, shipped_text
from ..scenario.to_core import core_setup
from ..scenario.volts_core import bias_rows
from ..simulation.user_controller import ControllerLike, controller_name
from ..simulation.user_plant import PlantLike, UserPlant
from .arrays import plain_arrays
from .completion import changes, scenarios
from .figures import Cell, followed, left_out, of_one, of_seeds, plain, reported, rows, shown
from .options import controller_option, jobs_option, own_controller, own_plant, scenario_argument
from .terminal import json_text, print_table, progress

MAX_SEEDS = 10**6
BARE_POINT = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?")  # numbers that are not valid TOML


@click.command(name="simulate")
@scenario_argument(required=False)
@click.option(
    "--set",
    "changes",
    multiple=True,
    shell_complete=changes,
    metavar="FIELD=VALUE",
    help="Change a field, for example controller.order=0.8; an empty value unsets it. Repeatable.",
)
@controller_option()
@click.option("--plant", metavar="FILE.py:NAME", help="Use your own plant instead of the scenario's.")
@click.option("--seeds", type=int, metavar="N", help="Run N noise seeds, and print means with 95 % intervals.")
@jobs_option(expose_value=False)
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the run: .nc, .csv, .parquet, .mat."
)
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw the run: .svg, .png or .pdf.")
@click.option("--json", "as_json", is_flag=True, help="Print the metrics as JSON.")
def simulate_command(
    scenario: str | None,
    changes: Sequence[str],
    controller: str | None,
    plant: str | None,
    seeds: int | None,
    out: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Simulate SCENARIO and print its metrics. Without SCENARIO: the paper, corrected."""
    if controller is None and plant is None:  # a user's file may use any array
        plain_arrays()
    from ..analysis.metrics import TRANSIENT

    wanted = dict(map(_change, changes))
    chosen = _paper(wanted) if scenario in (None, "paper") else named(scenario or "").replace(wanted)
    own, model = own_controller(controller), own_plant(plant)
    cell: Cell = of_one if seeds is None else of_seeds
    tasks: list[Any] = []
    notes: list[str] = []
    if seeds is None:
        figures, tasks, notes, channels = _one_run(chosen, own, model, out, plot)
    else:
        for option in (name for name, path in (("--out", out), ("--plot", plot)) if path):
            raise click.UsageError(f"--seeds is given with {option}: it must be left out, as many runs have no record")
        figures, tasks = _many_runs(chosen, own, model, seeds)
        channels = [] if own else [channel.name for channel in reported_channels(core_setup(chosen))]
    figures = reported(figures, "surface" in channels)
    about: dict[str, Any] = {} if own is None else {"controller": controller_name(own)}
    about |= {} if model is None else {"plant": UserPlant(model).name}
    about |= {} if seeds is None else {"seeds": seeds}
    if as_json:
        parts = [*tasks, *followed(chosen, figures)]
        content = {name: plain(values, cell) for part in parts for name, values in part.items()}
        click.echo(json_text(content | about))
        return
    steady, si = chosen.run.duration >= TRANSIENT, chosen.run.units == "SI"
    titles = ("metric", "value" if seeds is None else "mean [95 %]", "unit")
    print_table(titles, rows([*tasks, *followed(chosen, shown(figures, steady))], si, cell))
    files = {"controller": controller, "plant": plant}
    notes += [f"{name}: {about[name]}, of {file}" for name, file in files.items() if file]
    notes += [] if steady else [left_out(chosen, figures, TRANSIENT)]
    if not si:
        p = chosen.plant
        notes.append(
            f"q0 is {p.reference_length:g} m, ω0 {p.reference_frequency:g} rad/s, m {p.mass:g} kg. "
            "For SI units: --set run.units=SI"
        )
    click.echo("".join(f"\n{note}\n" for note in notes), nl=False)


def _one_run(
    scenario: Scenario, own: ControllerLike | None, plant: PlantLike | None, out: Path | None, plot: Path | None
) -> tuple[Any, list[Any], list[str], list[str]]:
    """Metrics, figures of tasks, notes and channels of a run, after its record was written and drawn."""
    from ..analysis.metrics import measured, summary
    from ..analysis.run_files import check_file, write_file
    from ..analysis.task_runs import thinned
    from ..analysis.tasks import task_figures
    from ..simulation.simulate import DivergedError, simulate

    if out:
        check_file(out)
    if plot:
        with needs("report"):
            from ..analysis.plots import check_plot, write_plot
        check_plot(plot)
    diverged = None
    # Metrics use every step and need no record. A short record that is not saved explains a divergence.
    recorded = scenario if out or plot else thinned(scenario)
    try:
        run = simulate(recorded, own, plant)
    except DivergedError as error:
        run, diverged = error.run, error
    if out:
        write_file(run, out)
    if plot:
        write_plot(run, plot)
    if diverged:
        saved = f"; {out} has the samples up to then" if out else ""
        raise click.UsageError(f"{diverged}{saved}")
    try:
        tasks, notes = task_figures(run), []
    except ValueError as error:
        tasks, notes = [], [f"figures of the reference are left out: {error}"]
    channels = [str(name) for name in run]
    if (own or plant) and recorded.run.record_every == 1:
        return summary(run), tasks, notes, channels  # a second run of a Python callable would take as long again
    return measured(scenario, own, plant).drop_vars("diverged_at"), tasks, notes, channels


def _many_runs(
    scenario: Scenario, own: ControllerLike | None, plant: PlantLike | None, seeds: int
) -> tuple[Any, list[Any]]:
    """Metrics and figures of tasks of a run for each seed, over `run`. Raises UsageError if a run diverges."""
    if not 2 <= seeds <= MAX_SEEDS:
        raise click.UsageError(f"--seeds is {seeds}: it must lie between 2 and {MAX_SEEDS}")
    with needs("report"):  # scipy, for the intervals
        import_module("fracgyro.analysis.confidence")
    from ..analysis.metrics import in_units
    from ..analysis.task_runs import measure_tasks, tasks_in_units, tasks_of

    first, done = scenario.disturbance.seed, 0
    with progress("simulating", rate="runs/s") as show:

        def advance(runs: int) -> None:
            nonlocal done
            done += runs
            show(done, seeds)

        found = measure_tasks(
            [scenario],
            tasks_of(scenario, own=own is not None),
            seeds=range(first, first + seeds),
            controller=own,
            plant=plant,
            progress=advance,
        )
    at = found["diverged_at"].values
    if lost := [place for place, time in enumerate(at) if time == time]:
        raise click.UsageError(
            f"{len(lost)} of {seeds} runs diverged, the first with disturbance.seed {first + lost[0]} at "
            f"{at[lost[0]]:g}/ω0; run that seed for the cause: --set disturbance.seed={first + lost[0]}"
        )
    return in_units(scenario, found).drop_vars("diverged_at"), tasks_in_units(scenario, found)


@click.command(name="scenario")
@click.argument("name", metavar="SCENARIO", shell_complete=scenarios, required=False)
@click.option("--units", type=click.Choice(["SI"]), help="Print every number with its unit.")
@click.option("--at-bias", "biased", is_flag=True, help="Print the values of its electrodes at bias instead.")
@click.option("--list", "listed", is_flag=True, help="List the available scenarios.")
def scenario_command(name: str | None, units: str | None, biased: bool, listed: bool) -> None:
    """Print SCENARIO, a name or a file, to edit and run. The paper scenarios explain every field."""
    if listed:
        width = max(map(len, NAMES))
        for each, words in NAMES.items():
            click.echo(f"{each:<{width}}  {words}")
    else:
        chosen = named(name or "paper")
        if biased:
            print_table(("at bias", "x, y"), bias_rows(chosen))
        elif name in SHIPPED and not units:
            click.echo(shipped_text(name), nl=False)
        else:
            click.echo((chosen.in_si() if units else chosen).to_toml(), nl=False)


def _paper(changes: dict[str, Any]) -> Scenario:
    """The paper scenario with changes; the noise is held for one step if its hold is not a multiple of the step."""
    paper = Scenario.paper()
    step, hold = number_of(paper.replace(_plant(changes)), "run.step", changes.get("run.step")), paper.disturbance.hold
    if hold and isinstance(step, float) and step > 0 and abs(hold / step - max(round(hold / step), 1)) > 1e-9:
        changes = {"disturbance.hold": None, **changes}
    return paper.replace(changes)


def _plant(changes: dict[str, Any]) -> dict[str, Any]:
    return {field: value for field, value in changes.items() if field.startswith("plant.")}


def _change(text: str) -> tuple[str, Any]:
    """Parses FIELD=VALUE with VALUE in TOML; a bare word is a string, and an empty value unsets."""
    field, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise click.UsageError(f"--set {text} has no '=': write --set field=value")
    if not value:
        return field, None
    try:
        tables = tomllib.loads(f"value = {value}")
    except ValueError:
        return field, float(value) if BARE_POINT.fullmatch(value) else value
    except RecursionError:
        raise click.UsageError(f"--set {field}: its value is nested too deeply") from None
    return field, tables["value"] if len(tables) == 1 else value  # several keys: the value had line breaks
