"""The command line. Bad input ends with exit code 2 and one sentence."""

from __future__ import annotations

import io
import json
import logging
import os
import signal
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from .export.commands import export, replay
from .files import one_line, reason
from .scenario import Scenario
from .shipped import SHIPPED, shipped_text
from .simulate import DivergedError, simulate

BAD_INPUT = 2
UNASKED = 100_000  # samples of a record that is kept nowhere, at most
INTERRUPTED = 130
WIDEST = 10_000  # columns of a table, whatever the terminal's: it may break lines, but nothing is cut off


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="fracgyro")
def cli() -> None:
    """Simulate, study and export a fractional sliding-mode controller for MEMS gyroscopes."""


@cli.command()
@click.option("--out", default="out", show_default=True, metavar="DIR", help="Folder for the results.")
@click.option("--seeds", type=int, metavar="N", help="Noise seeds for Table 1 and the claims.  [default: 100]")
@click.option("--quick", is_flag=True, help="Use 8 seeds: takes seconds.")
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
def reproduce(out: str, seeds: int | None, quick: bool, as_json: bool) -> None:
    """Rerun the paper and write a report. It has every figure, Table 1 and a verdict on every claim."""
    from .paper.reproduce import reproduce as run_all

    with _progress("starting") as show:
        result = run_all(out, seeds=seeds, quick=quick, progress=show)
    verdicts = [{"id": c.id, "variant": c.variant, "verdict": c.verdict} for c in result.claims]
    if as_json:
        click.echo(json.dumps({"report": str(result.report), "seconds": result.seconds, "claims": verdicts}))
        return
    by_claim: dict[str, dict[str, str]] = {}
    for claim in result.claims:
        by_claim.setdefault(f"({claim.id}) {claim.claim}", {})[claim.variant] = claim.verdict
    for text, both in by_claim.items():
        click.echo(f"{text}\n      as printed: {both['printed']}; as corrected: {both['corrected']}")
    click.echo(f"\n{result.seconds:.0f} s. The report: {result.report}")


@cli.command()
@click.argument("study", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results.")
@click.option("--resume", is_flag=True, help="Finish the study that DIR holds.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on this Dask cluster, for example tcp://host:8786.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def sweep(study: Path, out: Path, resume: bool, scheduler: str | None, as_json: bool) -> None:
    """Run every scenario of STUDY. Write one row of metrics per run, and a summary page."""
    from .study.sweep import sweep as run_all

    with _progress("simulating", rate="runs/s") as show:
        result = run_all(study, out, resume=resume, scheduler=scheduler, progress=show)
    if as_json:
        click.echo(json.dumps(asdict(result), default=str))
        return
    new = result.runs - result.resumed
    found = f" ({result.resumed} found finished)" if result.resumed and new else ""
    did = (
        f"{result.runs} runs{found}, {result.diverged} diverged" if new else "it was finished: nothing was left to run"
    )
    click.echo(f"{did}; {result.seconds:.1f} s. Rows: {result.data}, summary: {result.summary}")


@cli.command()
@click.argument("study", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results.")
@click.option("--resume", is_flag=True, help="Continue the study that DIR holds, up to its number of trials.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def tune(study: Path, out: Path, resume: bool, as_json: bool) -> None:
    """Search for the best parameters of STUDY. Write the scenario, tested on unseen noise seeds."""
    from .study.tune import tune as run_all

    with _progress("starting") as show:
        result = run_all(study, out, resume=resume, progress=show)
    if as_json:
        click.echo(json.dumps(_finite(asdict(result)), default=str))
        return
    for objective in result.held_out.objectives:
        values = f"{objective.tuned:.4g}, base {objective.base:.4g}"
        click.echo(f"{objective.label}: {values} on held-out seeds: {objective.verdict}")
    for constraint in result.held_out.constraints:
        kept = "kept" if constraint.kept else "broken"
        click.echo(f"{constraint.label}: {constraint.tuned:.5g}, at most {constraint.limit:.5g}: {kept}")
    found = f"trial {result.trial} of {result.trials}, {result.feasible} feasible"
    click.echo(f"{found}; {result.seconds:.0f} s. Scenario: {result.scenario}, report: {result.report}")


@cli.command(name="simulate")
@click.argument("scenario", required=False, type=click.Path(path_type=Path))
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="FIELD=VALUE",
    help="Change a field, for example controller.order=0.8; nothing after = unsets it. Repeatable.",
)
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the run as NetCDF.")
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw the run: .svg, .png or .pdf.")
@click.option("--json", "as_json", is_flag=True, help="Print the metrics as JSON.")
def simulate_command(
    scenario: Path | None, changes: Sequence[str], out: Path | None, plot: Path | None, as_json: bool
) -> None:
    """Simulate SCENARIO and print its metrics. Without SCENARIO: the paper, corrected."""
    from .metrics import measured
    from .paper.reproduce import write_run

    chosen = Scenario.load(scenario) if scenario else Scenario.paper()
    chosen = chosen.replace(dict(map(_change, changes)))
    diverged = None
    # The metrics are of every step, and gathered on the way. A record that nobody asked for tells why a run diverged.
    unasked = {} if out or plot else {"run.record_every": max(1, chosen.run.steps // UNASKED)}
    try:
        run = simulate(chosen.replace(unasked))
    except DivergedError as error:
        run, diverged = error.run, error
    if out:
        write_run(run, out)
    if plot:
        from .plot import plot_run

        plot_run(run, plot)
    if diverged:
        kept = f"; the samples until then are in {out}" if out else ""
        raise click.UsageError(f"{diverged}{kept}")
    figures = measured(chosen).drop_vars("diverged_at")
    if as_json:
        click.echo(json.dumps({name: _plain(values) for name, values in figures.items()}))
        return
    _print_table(figures)


@cli.command()
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@click.option("--quick", is_flag=True, help="Use 2 noise seeds instead of 8: takes seconds.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def rate(scenario: Path, out: Path, quick: bool, as_json: bool) -> None:
    """Measure SCENARIO as a rate sensor. Report scale factor, Allan deviation, bandwidth, grade and more."""
    from .rate.characterise import characterise
    from .rate.report import interval_of, value_of

    with _progress("starting") as show:
        found = characterise(Scenario.load(scenario), out, quick=quick, progress=show)
    if as_json:
        click.echo((out / "rate.json").read_text(encoding="utf-8"), nl=False)
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("figure", "value", "unit", "interval", "grade", box=None, header_style="bold", pad_edge=False)
    for result in found:
        table.add_row(result.name, value_of(result), result.unit, interval_of(result), result.grade or "")
    Console(soft_wrap=True, width=WIDEST).print(table)
    click.echo(f"\nThe report: {out / 'report.html'}")


@cli.command(name="scenario")
@click.argument("name", type=click.Choice(["paper", *SHIPPED]), required=False)
@click.option(
    "--variant",
    type=click.Choice(["corrected", "printed"]),
    default="corrected",
    show_default=True,
    help="Paper scenario: as printed or corrected.",
)
@click.option("--list", "listed", is_flag=True, help="List the available scenarios.")
def scenario_command(name: str | None, variant: str, listed: bool) -> None:
    """Print a scenario to edit and run. The paper's has every field explained; others are devices."""
    if listed:
        width = max(map(len, SHIPPED))
        for each, words in {"paper": "the paper's, every field explained", **SHIPPED}.items():
            click.echo(f"{each:<{width}}  {words}")
    elif name in SHIPPED:
        click.echo(shipped_text(name), nl=False)
    else:
        click.echo(Scenario.paper("printed" if variant == "printed" else "corrected").to_toml(), nl=False)


@cli.command()
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def selfcheck(as_json: bool) -> None:
    """Compute the published parity hashes again. Exit with 1 if they differ. For problem reports."""
    from .selfcheck import selfcheck as check

    found = check()
    if as_json:
        click.echo(json.dumps({**asdict(found), "sound": found.sound}))
    else:
        click.echo(
            f"fracgyro {found.version}, Python {found.python}, NumPy {found.numpy}, compiled by {found.compiler}"
        )
        click.echo(f"processor: {found.processor}; lanes of {found.lanes}")
        for number, hashed in found.hashes.items():
            expected = found.published[number]
            verdict = "as published" if hashed == expected else f"NOT the published {expected}"
            click.echo(f"parity hash, {number}: {hashed}, {verdict}")
    if not found.sound:
        raise click.exceptions.Exit(1)


cli.add_command(export)
cli.add_command(replay)


@contextmanager
def _progress(doing: str, rate: str = "") -> Iterator[Callable[..., None]]:
    """A bar, given (done, total, what is being done); with `rate`, the unit of what is done per second."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text(f"{speed:.0f} {rate}" if speed and rate else "")

    # The bar goes to standard error: standard output holds results alone.
    columns = (TextColumn("{task.description:<22}"), BarColumn(), TaskProgressColumn())
    bar = Progress(*columns, Remaining(elapsed_when_finished=True), Rate(), console=Console(stderr=True))
    task = bar.add_task(doing, start=False)

    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> None:
        # Raised anywhere, KeyboardInterrupt may be swallowed by a callback; raised from `show` it arrives.
        interrupts.append(number)
        if len(interrupts) > 1:
            raise KeyboardInterrupt

    def show(done: float, total: float, doing: str | None = None) -> None:
        if interrupts:
            raise KeyboardInterrupt
        if not bar.live.is_started:  # now that the input has been found good
            bar.start()
            bar.reset(task, completed=int(done))  # what was done before counts for no speed
        bar.update(task, completed=done, total=total, description=doing)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield show
    finally:
        signal.signal(signal.SIGINT, before)
        if bar.live.is_started:  # stopped unstarted, it would print itself
            with suppress(OSError):  # no work is lost because nobody can see the bar
                bar.stop()


def _change(text: str) -> tuple[str, Any]:
    """FIELD=VALUE with VALUE in TOML; a bare word is a string, and nothing at all unsets."""
    field, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise click.UsageError(f"--set {text} has no '=': write --set field=value")
    if not value:
        return field, None
    try:
        tables = tomllib.loads(f"value = {value}")
    except ValueError:
        return field, value
    except RecursionError:
        raise click.UsageError(f"--set {field}: its value is nested too deeply") from None
    return field, tables["value"] if len(tables) == 1 else value  # more: it had lines of its own


def _finite(value: Any) -> Any:
    """The same for what is no array: NaN and infinity become null."""
    if isinstance(value, dict):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not -float("inf") < value < float("inf") else value


def _plain(values: Any) -> Any:
    """Numbers that JSON can hold: NaN, which means never, becomes null."""
    if values.ndim == 0:
        number = float(values)
        return number if number == number else None
    return {str(label): _plain(values[i]) for i, label in enumerate(values[values.dims[0]].values)}


def _print_table(figures: Any) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("metric", "value", box=None, header_style="bold", pad_edge=False)
    for name, values in figures.items():
        text = json.dumps(_plain(values), default=str)
        cells = json.loads(text, parse_float=lambda number: f"{float(number):.6g}")
        table.add_row(str(name), _words(cells))
    Console(soft_wrap=True, width=WIDEST).print(table)


def _words(cells: Any) -> str:
    if cells is None:
        return "never"
    if not isinstance(cells, dict):
        return str(cells)
    nested = any(isinstance(inner, dict) for inner in cells.values())
    parts = [f"{label}: {_words(inner)}" if nested else f"{label} {_words(inner)}" for label, inner in cells.items()]
    return ("\n" if nested else ", ").join(parts)


def main() -> None:
    """Entry point: turns every foreseen failure into one sentence."""
    _prepare()
    try:
        code = cli(standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.Exit as stop:
        code = stop.exit_code
    except click.ClickException as error:
        code = _refused(error.format_message())
    except (KeyboardInterrupt, click.Abort):
        _refused("interrupted; the files written so far are complete")
        code = INTERRUPTED
    except ValueError as error:
        code = _refused(str(error))
    except MemoryError:
        code = _refused("there is not enough memory: make run.record_every larger, or record fewer runs")
    except OSError as error:
        code = _refused(f"the output cannot be written: {reason(error)}")
        sys.stdout = None  # or Python would try once more, and fail aloud
    sys.exit(code)


def _prepare() -> None:
    """What the surroundings may not change: closed streams, names that are not UTF-8, Matplotlib's settings."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed: nobody wants to hear
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="surrogateescape" if stream is sys.stdout else "backslashreplace")
    os.environ |= {"MPLBACKEND": "agg", "MATPLOTLIBRC": os.devnull}
    logging.getLogger("matplotlib").setLevel(logging.ERROR)


def _refused(words: str) -> int:
    """Says it in one line, if anybody listens."""
    try:
        click.echo(f"fracgyro: {one_line(words)}", err=True)
        sys.stderr.flush()
    except OSError:
        sys.stderr = None  # or Python would try once more, and end with another code
    return BAD_INPUT
