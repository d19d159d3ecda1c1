"""`fracgyro zoo`."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from fracgyro.cli.options import controller_option
from fracgyro.cli.terminal import print_table, progress

if TYPE_CHECKING:
    from .facts import Facts


@click.group(invoke_without_command=True)
@click.pass_context
def zoo(context: click.Context) -> None:
    """List, run and judge control laws that papers on gyroscopes publish."""
    if context.invoked_subcommand is None:
        context.invoke(list_command)


@zoo.command("list")
def list_command() -> None:
    """List the entries by year."""
    from .facts import SEEN_WORDS, entries

    rows = [
        [name, facts.contender, SEEN_WORDS[facts.seen], f"{len(facts.erratum) or '-'}", f"{len(facts.claim)}"]
        for name, facts in entries().items()
    ]
    print_table(("entry", "law", "seen", "errata", "claims"), rows)


@zoo.command()
@click.argument("name")
def show(name: str) -> None:
    """Show the facts of an entry: equations, numbers as printed and as used, errata and claims."""
    from .facts import entry, plant

    name, facts = entry(name)
    click.echo(f"{facts.title} ({facts.year})")
    click.echo(f"{facts.heading(own_numbers=bool(facts.run))}: {facts.words}")
    for words, value in (("reduces to", facts.reduces_to), ("remark", facts.remark)):
        if value:
            click.echo(f"{words}: {value}")
    if facts.equation:
        click.echo("\nEquations")
        print_table(("number", "code", "from"), [[e.number, e.place, e.source] for e in facts.equation])
    if facts.given:
        scales = plant(facts.plant).scales
        click.echo("\nNumbers")
        rows = []
        for place, given in facts.every_given():
            used = given.used(scales)
            rows.append([place, f"{_numbers(given.value)} {given.unit or '(no unit)'}", _numbers(used), given.source])
        print_table(("field", "printed", "used, nondimensional", "from"), rows)
    for erratum in facts.erratum:
        click.echo(f"\nErratum {erratum.id}\n  printed: {erratum.printed}\n  corrected: {erratum.corrected}")
        click.echo(f"  effect: {erratum.effect}")
    for claim in facts.claim:
        click.echo(
            f"\nClaim: {claim.text}\n  from: {claim.source}; decided by: {claim.criterion or 'not testable here'}"
        )


def _numbers(value: float | list[float]) -> str:
    return ", ".join(f"{each:g}" for each in (value if isinstance(value, list) else [value]))


@zoo.command()
@click.argument("name")
@click.option("--printed", "variant", flag_value="printed", help="Integrate the published runs with all errors.")
@click.option("--corrected", "variant", flag_value="corrected", help="Integrate them with all errors corrected.")
@click.option("--plant", metavar="NAME", help="paper, second, or theirs: the one of the paper.  [default: both]")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Write the curves as CSV into this folder.")
@controller_option("Run your own controller for an entry of yours.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def run(
    name: str, variant: str | None, plant: str | None, out: Path | None, controller: str | None, as_json: bool
) -> None:
    """Run the law of an entry, by name or by FILE.toml, with the gains of the log.

    It runs on the plant of its paper and on the one of this project, in noise and without. --printed and --corrected
    integrate the runs that a public code has published.
    """
    from .facts import entry
    from .single import published, simulated

    name, facts = entry(name)
    if variant is not None:
        if plant is not None or controller is not None:
            raise click.UsageError(f"--{variant} takes neither --plant nor --controller")
        with progress("starting") as shown:
            rows = published(name, facts, variant, out, shown)
    else:
        rows = simulated(name, facts, plant, out, controller)
    _print(facts, rows, variant, as_json)


def _print(facts: Facts, rows: list[dict[str, Any]], variant: str | None, as_json: bool) -> None:
    if variant is None:
        heading = facts.heading(own_numbers=False, gains=f"gains {rows[0]['gains']}")
    else:
        heading = facts.heading(own_numbers=True) + (", with its errors corrected" if variant == "corrected" else "")
    if as_json:
        click.echo(json.dumps({"heading": heading, "runs": rows}))
        return
    click.echo(heading)
    print_table(tuple(rows[0]), [list(map(_cell, row.values())) for row in rows])


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(map(_cell, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


@zoo.command()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results.")
@click.option("--quick", is_flag=True, help="Use few seeds and the gains of the log: takes a minute, tunes nothing.")
@click.option("--resume", is_flag=True, help="Finish the report that DIR holds.")
@click.option("--operations", type=click.Path(path_type=Path), metavar="FILE", help="A log with operations of a step.")
def report(out: Path, quick: bool, resume: bool, operations: Path | None) -> None:
    """Tune and judge all laws and their claims, and write report.html, report.md and zoo.json."""
    from fracgyro.extras import require

    require("study", "cmaes")
    from .run import report as run_all

    with progress("starting", rate="runs/s") as shown:
        result = run_all(out, quick=quick, resume=resume, operations=operations, progress=shown)
    for name, found in result.entries.items():
        for claim in found["claims"]:
            which = "" if claim["variant"] == "tuned" else f" as {claim['variant']}"
            click.echo(f"{name}: {claim['claim']}: {claim['verdict']}{which}")
    click.echo(f"{result.seconds:.0f} s. Report: {result.folder / 'report.html'}")


@zoo.command()
@click.argument("doi")
@click.option("--year", type=int, help="Year of the paper.  [default: this year]")
@click.option("--pdf", type=click.Path(path_type=Path), metavar="PDF", help="A PDF of yours; only its hash is kept.")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write it to this new TOML file.")
def new(doi: str, year: int | None, pdf: Path | None, out: Path | None) -> None:
    """Print an entry with every field and a comment, to fill in."""
    from fracgyro.files import whole_file

    from .check import skeleton
    from .pdf import opened

    text = skeleton(doi, year or date.today().year, None if pdf is None else opened(pdf))
    if out is None:
        click.echo(text, nl=False)
        return
    with whole_file(out, replaces="nothing") as scratch:
        scratch.write_text(text, encoding="utf-8", newline="\n")


@zoo.command()
@click.argument("file")
@click.option("--pdf", type=click.Path(path_type=Path), metavar="PDF", help="Look up its numbers in this PDF.")
def check(file: str, pdf: Path | None) -> None:
    """Check an entry, and report what it lacks."""
    from fracgyro.scenario import ScenarioError

    from .check import differences, missing
    from .facts import entry
    from .pdf import looked_up, opened

    name, facts = entry(file)
    found = list(missing(name, facts))
    if pdf is not None:
        document = opened(pdf)
        looked = list(looked_up(facts, document))
        if looked:
            rows = [[each.place, each.printed, f"{each.page}", each.result] for each in looked]
            print_table(("field", "printed", "page", "in its text"), rows)
        found += differences(facts, document, looked)
    if found:
        raise ScenarioError("; ".join(found))
    click.echo(f"{name}: complete; {facts.heading(own_numbers=bool(facts.given))}")


@zoo.command()
@click.argument("figure")
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Folder for the CSV files.")
def curve(figure: str, out: Path) -> None:
    """Write the curves of a MATLAB figure, a .fig file of yours, as CSV."""
    from fracgyro.analysis.html import csv_text
    from fracgyro.files import whole_file, writable_folder

    from .fig import lines

    stem = Path(figure).stem
    for number, line in enumerate(lines(figure), 1):
        path = writable_folder(out) / f"{stem}_{number}.csv"
        with whole_file(path) as scratch:
            rows = zip(line.x.tolist(), line.y.tolist(), strict=True)
            scratch.write_text(csv_text(("x", "y"), rows), encoding="utf-8", newline="\n")
        click.echo(f"{path}: {len(line.x)} points, axes {line.axes + 1}")
