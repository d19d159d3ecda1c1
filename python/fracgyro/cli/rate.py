"""`fracgyro rate` and `fracgyro allan`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from ..scenario import Scenario
from .commands import did_you_mean
from .completion import toml_files
from .terminal import print_table, progress

if TYPE_CHECKING:
    from ..rate.results import Result

NOT_KEPT = 1


def _limits(context: click.Context, parameter: click.Parameter, value: str | None) -> dict[str, float]:
    """{key: limit}"""
    if not value:
        return {}
    from ..rate.require import KEYS, SHORT

    found = {}
    for word in value.split(","):
        name, _, text = (part.strip() for part in word.partition("="))
        key = SHORT.get(name, name)
        if key not in KEYS:
            hint = did_you_mean(name, KEYS) or f"; known are {', '.join((*SHORT, *KEYS))}"
            raise click.UsageError(f"--require {name} is not a figure{hint}")
        try:
            found[key] = float(text)
        except ValueError:
            found[key] = math.nan
        if not 0 < found[key] < math.inf:
            raise click.UsageError(f"--require {name} is {text!r}: it must be a number above 0, as in {name}=0.1")
    return found


@click.command()
@click.argument("scenario", type=click.Path(path_type=Path), shell_complete=toml_files)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@click.option("--quick", is_flag=True, help="Use 2 noise seeds instead of 8: a third of the time, wider intervals.")
@click.option(
    "--rest",
    type=float,
    metavar="SECONDS",
    help="Length of the record at rest, in device time. Bias instability and rate random walk take minutes to hours to "
    "show.  [default: 2 million steps]",
)
@click.option(
    "--imu",
    type=click.Choice(["kalibr", "gnss-ins-sim"]),
    help="Write the noise model for that navigation simulation, too.",
)
@click.option(
    "--require",
    "limits",
    callback=_limits,
    metavar="NAME=NUMBER,...",
    help="Exit with 1 unless the figures are within these limits, for example arw=0.1,bias=10,bandwidth=50. Names are "
    "those of rate.json, arw for angle_random_walk, bias for bias_instability; units are those of the figures.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def rate(
    scenario: Path,
    out: Path,
    quick: bool,
    rest: float | None,
    imu: Literal["kalibr", "gnss-ins-sim"] | None,
    limits: dict[str, float],
    as_json: bool,
) -> None:
    """Measure SCENARIO as a rate sensor. Report scale factor, Allan deviation, bandwidth, grade and more."""
    from ..rate import characterise
    from ..rate.require import required

    with progress("starting") as show:
        found = characterise(Scenario.load(scenario), out, quick=quick, rest=rest, imu=imu, progress=show)
    verdicts = required(found, limits)
    if as_json:
        content = json.loads((out / "rate.json").read_text(encoding="utf-8"))
        content |= {"required": [asdict(each) for each in verdicts]} if limits else {}
        click.echo(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))
    else:
        _print_figures(found)
        for each in verdicts:
            click.echo(f"{each.key}, {each.rule}: {each.verdict}")
        click.echo(f"The report: {out / 'report.html'}")
    if any(each.verdict != "pass" for each in verdicts):
        raise click.exceptions.Exit(NOT_KEPT)


@click.command(name="allan")
@click.argument("record", type=click.Path(path_type=Path))
@click.option("--column", metavar="NAME", help="Column of the rate; without names, columns are 1, 2, ...")
@click.option(
    "--rate",
    "rate_hz",
    type=float,
    metavar="HZ",
    help="Sampling rate. Needed unless a column is called time, timestamp or t; its unit may follow, as in "
    "'time [ns]': s, ms, us or ns.",
)
@click.option("--unit", default="deg/s", show_default=True, help="Unit of the rate: deg/s, rad/s, deg/h or mdeg/s.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Write allan.json and allan.svg there.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures and the curve as JSON.")
def allan_command(
    record: Path, column: str | None, rate_hz: float | None, unit: str, out: Path | None, as_json: bool
) -> None:
    """Find the noise terms in RECORD, a CSV file of a gyroscope at rest. Report N, B and K with their intervals."""
    from ..rate import analyse_record

    found, content = analyse_record(record, out, column=column, rate=rate_hz, unit=unit, dashes="--")
    if as_json:
        click.echo(json.dumps(content, ensure_ascii=False, allow_nan=False))
        return
    click.echo(f"{content['column']}: {content['samples']} samples in {unit}, {content['rate_hz']:.6g} a second")
    if content["note"]:
        click.echo(f"Note: {content['note']}")
    click.echo()
    _print_figures(found)
    if out:
        click.echo(f"The plot: {out / 'allan.svg'}")


def _print_figures(found: Sequence[Result]) -> None:
    from ..rate.report import grade_of, interval_of, value_of

    titles = ("figure", "value", "unit", "interval", "grade")
    print_table(titles, [(r.name, value_of(r), r.unit, interval_of(r), grade_of(r)) for r in found])
    notes = [f"{r.name}: {r.note}." for r in found if r.note]
    click.echo("\n".join(["", *notes] if notes else []))
