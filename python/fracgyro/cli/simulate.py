"""`fracgyro simulate` and `fracgyro scenario`."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from ..analysis.metric_names import nondimensional_unit
from ..extras import needs
from ..scenario import Scenario
from ..scenario.named import named
from ..scenario.shipped import NAMES, SHIPPED, shipped_text
from .commands import Names
from .completion import changes
from .options import scenario_argument
from .terminal import print_table

STEADY = ["chattering", "rate_error_rms"]  # metrics of the steady window, like rmse steady
MAX_UNSAVED = 100_000  # samples of a record that is not saved
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
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the run as NetCDF.")
@click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help="Draw the run: .svg, .png or .pdf.")
@click.option("--json", "as_json", is_flag=True, help="Print the metrics as JSON.")
def simulate_command(
    scenario: str | None, changes: Sequence[str], out: Path | None, plot: Path | None, as_json: bool
) -> None:
    """Simulate SCENARIO and print its metrics. Without SCENARIO: the paper, corrected."""
    from ..analysis.metrics import TRANSIENT, measured
    from ..simulation.dataset import check_run, write_run
    from ..simulation.simulate import DivergedError, simulate

    wanted = dict(map(_change, changes))
    chosen = _paper(wanted) if scenario in (None, "paper") else named(scenario).replace(wanted)
    if out:
        check_run(out)
    if plot:
        with needs("report"):
            from ..analysis.plots import check_plot, write_plot
        check_plot(plot)
    diverged = None
    # Metrics use every step and need no record. A short record that is not saved explains a divergence.
    thinned = {} if out or plot else {"run.record_every": max(1, chosen.run.steps // MAX_UNSAVED)}
    try:
        run = simulate(chosen.replace(thinned))
    except DivergedError as error:
        run, diverged = error.run, error
    if out:
        write_run(run, out)
    if plot:
        write_plot(run, plot)
    if diverged:
        saved = f"; {out} has the samples up to then" if out else ""
        raise click.UsageError(f"{diverged}{saved}")
    figures = measured(chosen).drop_vars("diverged_at")
    steady = chosen.run.duration >= TRANSIENT
    if as_json:
        click.echo(json.dumps({name: _plain(values) for name, values in figures.items()}))
        return
    si = chosen.run.units == "SI"
    seen = figures if steady else figures.drop_vars(STEADY).sel(window=["whole", "transient"])
    print_table(("metric", "value", "unit"), _rows(seen, si))
    if not steady:
        click.echo(
            f"\nrun.duration is {chosen.run.duration:g}: rmse steady, {' and '.join(STEADY)} need samples from "
            f"{TRANSIENT:g}/ω0 on."
        )
    if not si:
        plant = chosen.plant
        click.echo(
            f"\nq0 is {plant.reference_length:g} m, ω0 {plant.reference_frequency:g} rad/s, m {plant.mass:g} kg. "
            "For SI units: --set run.units=SI"
        )


@click.command(name="scenario")
@click.argument("name", type=Names(list(NAMES)), required=False)
@click.option("--list", "listed", is_flag=True, help="List the available scenarios.")
def scenario_command(name: str | None, listed: bool) -> None:
    """Print a scenario to edit and run. The paper scenarios explain every field; the others are devices."""
    if listed:
        width = max(map(len, NAMES))
        for each, words in NAMES.items():
            click.echo(f"{each:<{width}}  {words}")
    else:
        chosen = name or "paper"
        text = shipped_text(chosen) if chosen in SHIPPED else Scenario.shipped(chosen).to_toml()
        click.echo(text, nl=False)


def _paper(changes: dict[str, Any]) -> Scenario:
    """The paper scenario with changes; the noise is held for one step if its hold is not a multiple of the step."""
    paper, step = Scenario.paper(), changes.get("run.step")
    hold = paper.disturbance.hold
    if hold and isinstance(step, float) and step > 0 and abs(hold / step - max(round(hold / step), 1)) > 1e-9:
        changes = {"disturbance.hold": None, **changes}
    return paper.replace(changes)


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


def _plain(values: Any) -> Any:
    """Values for JSON: NaN, which means never, becomes null."""
    if values.ndim == 0:
        number = float(values)
        return number if number == number else None
    return {str(label): _plain(values[i]) for i, label in enumerate(values[values.dims[0]].values)}


def _rows(figures: Any, si: bool) -> Iterator[tuple[str, str, str]]:
    for name, values in figures.items():
        in_si = values.attrs.get("units") or values.attrs["column_units"]
        unit = in_si.removeprefix("1") if si else nondimensional_unit(name)
        text = json.dumps(_plain(values), default=str)
        cells = json.loads(text, parse_float=lambda number: f"{float(number):.6g}")
        yield str(name), _words(cells), unit


def _words(cells: Any) -> str:
    if cells is None:
        return "never"
    if not isinstance(cells, dict):
        return str(cells)
    nested = any(isinstance(inner, dict) for inner in cells.values())
    parts = [f"{label}: {_words(inner)}" if nested else f"{label} {_words(inner)}" for label, inner in cells.items()]
    return ("\n" if nested else ", ").join(parts)
