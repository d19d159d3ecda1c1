"""`fracgyro rate`, `fracgyro datasheet` and `fracgyro allan`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from ..extras import needs
from ..scenario.messages import did_you_mean
from ..scenario.named import named
from .arrays import plain_arrays
from .options import controller_option, jobs_option, own_controller, scenario_argument
from .terminal import print_table, progress

if TYPE_CHECKING:
    from ..rate.results import Result

NOT_KEPT = 1


def _limits(context: click.Context, parameter: click.Parameter, value: str | None) -> dict[str, float]:
    """Limits by key."""
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
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@controller_option("Use your own controller instead of the scenario's; it must report rate_estimate.")
@jobs_option(expose_value=False)
@click.option("--quick", is_flag=True, help="Use 2 noise seeds instead of 8: a third of the time, wider intervals.")
@click.option(
    "--rest",
    type=float,
    metavar="SECONDS",
    help="Set the length of the static test, in device time. Bias instability and rate random walk need minutes to "
    "hours.  [default: 2 million steps]",
)
@click.option(
    "--imu",
    type=click.Choice(["kalibr", "gnss-ins-sim", "kf-gins"]),
    help="Also write the noise model for this navigation simulation.",
)
@click.option(
    "--require",
    "limits",
    callback=_limits,
    metavar="NAME=NUMBER,...",
    help="Exit with 1 unless the figures are within these limits, for example arw=0.1,bias=10,bandwidth=50. Names as "
    "in rate.json, with arw for angle_random_walk and bias for bias_instability; units as printed.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def rate(
    scenario: str,
    out: Path,
    controller: str | None,
    quick: bool,
    rest: float | None,
    imu: Literal["kalibr", "gnss-ins-sim", "kf-gins"] | None,
    limits: dict[str, float],
    as_json: bool,
) -> None:
    """Measure SCENARIO as a rate sensor. Report scale factor, Allan deviation, bandwidth, grade and more."""
    if controller is None:
        plain_arrays()
    from ..rate import characterise
    from ..rate.require import required

    with progress("starting") as show:
        found = characterise(
            named(scenario),
            out,
            controller=own_controller(controller),
            quick=quick,
            rest=rest,
            imu=imu,
            progress=show,
        )
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


@click.command(name="datasheet")
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@controller_option("Use your own controller instead of the scenario's; it must report rate_estimate.")
@jobs_option(expose_value=False)
@click.option("--quick", is_flag=True, help="Use 2 noise seeds instead of 8, and 6 power cycles instead of 16.")
@click.option("--rest", type=float, metavar="SECONDS", help="Set the length of the static test, in device time.")
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON.")
def datasheet_command(
    scenario: str, out: Path, controller: str | None, quick: bool, rest: float | None, as_json: bool
) -> None:
    """Measure SCENARIO by the clauses of IEEE Std 1431. Report every row with what was varied, and all points."""
    if controller is None:
        plain_arrays()
    from ..rate.datasheet import as_result, datasheet, shown
    from ..rate.report import interval_of

    with progress("starting") as show:
        rows = datasheet(
            named(scenario), out, controller=own_controller(controller), quick=quick, rest=rest, progress=show
        )
    if as_json:
        click.echo((out / "datasheet.json").read_text(encoding="utf-8"), nl=False)
        return
    texts = [(row.clause, row.name, shown(row), row.unit, interval_of(as_result(row)), row.note) for row in rows]
    print_table(("clause", "row", "value", "unit", "interval", "note"), texts)
    click.echo(f"\nThe datasheet: {out / 'datasheet.html'}")


@click.command(name="allan")
@click.argument("records", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RECORD...")
@click.option(
    "--column",
    "columns",
    multiple=True,
    metavar="NAME|#N",
    help="Select the column of the rate, by name or number. Repeatable.",
)
@click.option(
    "--rate",
    "rate_hz",
    type=float,
    metavar="HZ",
    help="Set the sampling rate. Required unless a column has the times.",
)
@click.option(
    "--time",
    metavar="NAME|#N",
    help="Select the column of the times, if it is not called time, timestamp or t. Its name may include a unit, as in "
    "'time [ns]'.",
)
@click.option(
    "--time-unit", type=click.Choice(["s", "ms", "us", "ns"]), help="Set the unit of the times, if their name has none."
)
@click.option(
    "--unit",
    metavar="UNIT",
    help="Set the unit of the rate: deg/s (or dps), rad/s, deg/h, mdeg/s, mrad/s, urad/s, arcsec/s or rpm.  "
    "[default: the unit in the file, else deg/s]",
)
@click.option("--from", "begin", type=float, metavar="S", help="Start here, s from the first sample.")
@click.option("--to", "end", type=float, metavar="S", help="End here, s from the first sample.")
@click.option("--scale", type=float, default=1.0, metavar="X", help="Multiply the numbers by X, for raw counts.")
@click.option("--increments", is_flag=True, help="Read the values as angle increments, in deg for deg/s.")
@click.option(
    "--skip-empty", is_flag=True, help="Skip rows in which the column is empty, as in a log of several sensors."
)
@click.option(
    "--imu",
    type=click.Choice(["kalibr", "gnss-ins-sim", "kf-gins"]),
    help="With --out, also write the noise for this navigation filter or simulation.",
)
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="DIR", help="Write report.html, allan.json and pictures there."
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures and the curve as JSON.")
def allan_command(
    records: tuple[Path, ...],
    columns: tuple[str, ...],
    rate_hz: float | None,
    time: str | None,
    time_unit: str | None,
    unit: str | None,
    begin: float | None,
    end: float | None,
    scale: float,
    increments: bool,
    skip_empty: bool,
    imu: Literal["kalibr", "gnss-ins-sim", "kf-gins"] | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Estimate the noise terms in RECORD, a file from a gyroscope at rest. Report N, B and K with their intervals."""
    with needs("rate"):
        from ..rate.of_record import analyze_series
        from ..rate.record import Options
        from ..rate.series import Series, left_out

    options = Options(
        columns, rate_hz, unit, time, time_unit, begin, end, scale, increments, skip_empty, dashes="--"
    )  # fmt: skip
    series, content = analyze_series(records, out, options, imu)
    if as_json:
        click.echo(json.dumps(content, ensure_ascii=False, allow_nan=False))
        return

    def show(one: Series) -> None:
        record = one.record
        of = f" of {one.path}" if len(records) > 1 else ""
        samples = f"{record.values.shape[1]} samples in {record.unit} at {1 / record.interval:.6g} Hz"
        click.echo(f"{one.name}{of}: {samples}")
        for event in one.found.events:
            click.echo(f"Found: {event.sentence}.")
        for note in one.notes:
            click.echo(f"Note: {note}.")
        click.echo(left_out(one))
        click.echo()
        _print_figures(one.figures, si=True)

    for one in series:
        show(one)
    if out:
        click.echo(f"Report: {out / 'report.html'}")


def _print_figures(found: Sequence[Result], *, si: bool = False) -> None:
    from ..rate.report import grade_of, interval_of, si_of, value_of

    titles = ("figure", "value", "unit", "interval", *(["SI"] if si else []), "grade")
    rows = [(r.name, value_of(r), r.unit, interval_of(r), *([si_of(r)] if si else []), grade_of(r)) for r in found]
    print_table(titles, rows)
    notes = [f"{r.name}: {r.note}." for r in found if r.note]
    click.echo("\n".join(["", *notes] if notes else []))
