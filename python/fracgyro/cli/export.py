"""`fracgyro export` and `fracgyro replay` on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import click

from ..scenario import Scenario
from .completion import toml_files

DIFFERENT = 1
Number = Literal["float", "double"]


def _number(default: Number) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return click.option(
        "--number",
        type=click.Choice(["float", "double"]),
        default=default,
        show_default=True,
        help="Number type of the controller.",
    )


_unbounded = click.option(
    "--unbounded",
    is_flag=True,
    help="Export even if the bound estimates may grow until the loop diverges.",
)


@click.group()
def export() -> None:
    """Export a scenario: FMU, firmware or WebAssembly."""


@export.command(name="web")
@click.argument("scenario", type=click.Path(path_type=Path), shell_complete=toml_files)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE", help="A new JSON file.")
@_unbounded
def web_command(scenario: Path, out: Path, unbounded: bool) -> None:
    """Write SCENARIO as JSON for the browser. The WebAssembly module is built by `make web`."""
    from ..export import web

    web(Scenario.load(scenario), out, unbounded=unbounded)
    click.echo(f"{out}: load it with fracgyro.mjs, whose first lines show how")


@export.command(name="fmu")
@click.argument("scenario", type=click.Path(path_type=Path), shell_complete=toml_files)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE", help="A new FMU.")
@click.option("--controller", is_flag=True, help="Export the controller only, without the plant.")
@click.option("--fmi", type=click.Choice(["2.0", "3.0"]), default="2.0", show_default=True, help="FMI version.")
@click.option("--windows", is_flag=True, help="Add a binary for Windows to that for Linux; needs ziglang.")
@click.option("--macos", is_flag=True, help="Add a binary for macOS to that for Linux; needs ziglang.")
@_number("double")
@_unbounded
def fmu_command(
    scenario: Path,
    out: Path,
    controller: bool,
    fmi: Literal["2.0", "3.0"],
    windows: bool,
    macos: bool,
    number: Number,
    unbounded: bool,
) -> None:
    """Write SCENARIO as an FMU. It has the closed loop, for co-simulation in Simulink, OpenModelica and others."""
    from ..export import fmu
    from ..export.fmu import System

    wanted: dict[System, bool] = {"linux": True, "windows": windows, "macos": macos}
    systems = [system for system, chosen in wanted.items() if chosen]
    content: Literal["controller", "loop"] = "controller" if controller else "loop"
    loaded = Scenario.load(scenario)
    fmu(loaded, out, content=content, fmi=fmi, systems=systems, number=number, unbounded=unbounded)
    words = ["controller" if controller else "closed loop", f"FMI {fmi}", *(["float"] if number == "float" else [])]
    click.echo(f"{out}: {', '.join(words)}, for {', '.join(systems)}")


@export.command(name="firmware")
@click.argument("scenario", type=click.Path(path_type=Path), shell_complete=toml_files)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@_number("float")
@_unbounded
def firmware_command(scenario: Path, out: Path, number: Number, unbounded: bool) -> None:
    """Write SCENARIO as firmware. The controller is C++ with a C interface, for a microcontroller."""
    from ..export import firmware

    firmware(Scenario.load(scenario), out, number, unbounded=unbounded)
    click.echo(f"{out}: add it to your project, as its README.md says")


@click.command()
@click.argument("trace", type=click.Path(path_type=Path))
@click.option(
    "--target",
    required=True,
    type=click.Choice(["host", "m4f", "m7", "wasm", "fmu", "lanes"]),
    help="Firmware on this computer, an emulated Cortex-M4F or M7; WebAssembly; FMU; SIMD lanes.",
)
@_number("double")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def replay(
    trace: Path,
    target: Literal["host", "m4f", "m7", "wasm", "fmu", "lanes"],
    number: Number,
    as_json: bool,
) -> None:
    """Run a recorded motion on a target and compare bits. TRACE is a run that `simulate --out` wrote.

    Double is compared with the record, float with the Python Controller. Exit with 1 if a bit differs.
    """
    from ..export import replay as run

    found = run(trace, target, number)
    against = "the trace" if number == "double" else "the Python Controller"
    if as_json:
        click.echo(json.dumps(asdict(found)))
    elif found.difference:
        d = found.difference
        click.echo(f"{target}, {number}: step {d.step}, {d.variable} is {d.found}, in {against} {d.expected}")
    else:
        click.echo(f"{target}, {number}: {found.steps} steps, every bit of forces and estimates is that of {against}")
        click.echo(f"parity hash (SHA-256): {found.hash}")
    if found.difference:
        raise click.exceptions.Exit(DIFFERENT)
