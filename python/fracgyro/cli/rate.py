"""`fracgyro rate`."""

from __future__ import annotations

from pathlib import Path

import click

from ..scenario import Scenario
from .terminal import print_table, progress


@click.command()
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@click.option("--quick", is_flag=True, help="Use 2 noise seeds instead of 8: takes seconds.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def rate(scenario: Path, out: Path, quick: bool, as_json: bool) -> None:
    """Measure SCENARIO as a rate sensor. Report scale factor, Allan deviation, bandwidth, grade and more."""
    from ..rate.characterise import characterise
    from ..rate.report import interval_of, value_of

    with progress("starting") as show:
        found = characterise(Scenario.load(scenario), out, quick=quick, progress=show)
    if as_json:
        click.echo((out / "rate.json").read_text(encoding="utf-8"), nl=False)
        return
    titles = ("figure", "value", "unit", "interval", "grade")
    print_table(titles, [(r.name, value_of(r), r.unit, interval_of(r), r.grade or "") for r in found])
    click.echo(f"\nThe report: {out / 'report.html'}")
