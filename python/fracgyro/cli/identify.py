"""`fracgyro identify`."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any, Literal

import click

from ..extras import needs
from .terminal import print_table


def _uncertain(text: str, name: str) -> tuple[float, float]:
    """A number with a deviation, as in 1+-0.02 or 1; the interval is 95 %, so the deviation is about half of it."""
    value, _, half = re.sub(r"±|\+/-", "+-", text).partition("+-")
    try:
        found = float(value), float(half or 0.0)
    except ValueError:
        found = math.nan, math.nan
    if not all(map(math.isfinite, found)) or found[1] < 0:
        raise click.UsageError(f"{name} is {text}: it must be a number, or a number and its 95 % limit, as in 1+-0.02")
    return found[0], found[1] / 1.96


@click.command()
@click.argument("records", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RECORD...")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR|FILE.toml",
    help="Write device.toml, identify.json and report.html into this new folder; or only the scenario to FILE.toml.",
)
@click.option("--report", type=click.Path(path_type=Path), metavar="DIR", help="Write all three into this new folder.")
@click.option("--mass", metavar="KG", help="Set the mass, for stiffness in N/m. A number, or text such as '1.42 mg'.")
@click.option("--pickoff", metavar="M", help="Set the motion per unit of the x pick-off, for noise in m.")
@click.option(
    "--pickoff-ratio", metavar="X[+-Y]", help="Set the gain of the y pick-off over that of x, with its 95 % limit."
)
@click.option(
    "--assume", multiple=True, metavar="NAME=X[+-Y]", help="Set a quantity that is known, as in dxy=0. Repeatable."
)
@click.option(
    "--axes",
    type=click.Choice(["pickoffs", "principal"]),
    default="pickoffs",
    help="Select the axes of the scenario: of the pick-offs, with kxy; or the principal axes of the stiffness, with "
    "device.pickoff_misalignment.  [default: pickoffs]",
)
@click.option("--rate", metavar="RATE", help="Set the rate at which the device was turned, as in '0' or '300 deg/s'.")
@click.option(
    "--sampling", metavar="HZ", help="Set the sampling rate, as in '50 kHz'. Required without a column of times."
)
@click.option("--from", "begin", type=float, metavar="S", help="Start here, s from the first sample.")
@click.option("--to", "end", type=float, metavar="S", help="End here, s from the first sample.")
@click.option("--x", "x_column", metavar="NAME|#N", help="Select the column of the x pick-off, if it is not called x.")
@click.option("--y", "y_column", metavar="NAME|#N", help="Select the column of the y pick-off, if it is not called y.")
@click.option("--json", "as_json", is_flag=True, help="Print the content of identify.json.")
def identify_command(
    records: tuple[Path, ...],
    out: Path | None,
    report: Path | None,
    mass: str | None,
    pickoff: str | None,
    pickoff_ratio: str | None,
    assume: tuple[str, ...],
    axes: Literal["pickoffs", "principal"],
    rate: str | None,
    sampling: str | None,
    begin: float | None,
    end: float | None,
    x_column: str | None,
    y_column: str | None,
    as_json: bool,
) -> None:
    """Identify a device from RECORD, files of decays, forced records and sweeps, or a bench.toml that lists them."""
    with needs("identify"):
        from ..identification.bench import read_bench
        from ..identification.entry import identify
        from ..identification.records import Decay, Sweep
        from ..scenario.amounts import amount

    columns = {name: each for name, each in (("x", x_column), ("y", y_column)) if each is not None}
    rate_of_samples = None if sampling is None else amount("--sampling", sampling, "Hz")
    turned = None if rate is None else amount("--rate", rate, "rad/s")
    given: list[Any] = []
    known: dict[str, Any] = {}
    for path in records:
        if path.suffix == ".toml":
            listed, more = read_bench(path)
            given += listed
            known |= more
        else:
            given.append(Decay(path, turned, None, None, rate_of_samples, begin, end, columns or None))
    if mass is not None:
        known["mass"] = amount("--mass", mass, "kg")
    if pickoff is not None:
        known["pickoff"] = amount("--pickoff", pickoff, "m")
    if pickoff_ratio is not None:
        known["pickoff_ratio"] = _uncertain(pickoff_ratio, "--pickoff-ratio")
    for each in assume:
        name, _, text = each.partition("=")
        known.setdefault("assume", {})[name.strip()] = _uncertain(text, f"--assume {name}")
    assert all(isinstance(each, Decay | Sweep) for each in given)
    found = identify(given, **known)
    for where in (out, report):
        if where is not None:
            found.save(where, axes)
    if as_json:
        click.echo(json.dumps(found.plain(), ensure_ascii=False, allow_nan=False))
        return
    from ..identification.report import row_of

    rows = [row_of(each) for each in found.values()]
    titles = ("quantity", "value", "95 % interval", "unit", "scale", "meaning")
    keys = ("name", "value", "interval", "unit", "kind", "meaning")
    print_table(titles, [[row[key] for key in keys] for row in rows])
    click.echo()
    for note in found.notes:
        click.echo(f"Note: {note}.")
    for test in found.tests:
        if test.verdict == "fail":
            click.echo(f"Test failed: {test.words}.")
    for where in (out, report):
        if where is not None:
            click.echo(f"Written: {where}")
