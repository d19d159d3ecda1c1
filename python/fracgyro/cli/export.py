"""`fracgyro export` and `fracgyro replay` on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import entry_points
from pathlib import Path
from typing import Literal

import click

from ..scenario.named import named
from .commands import Commands, help_without_command
from .options import scenario_argument

DIFFERENT = 1
Number = Literal["float", "double"]
TARGETS = ["host", "m4f", "m7", "octave", "wasm", "fmu", "lanes", *sorted(entry_points(group="fracgyro.targets").names)]


def number_option(default: str, *allowed: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return click.option(
        "--number",
        type=click.Choice(allowed or ["float", "double"]),
        default=default,
        show_default=True,
        help="Select the number type.",
    )


unbounded_option = click.option(
    "--unbounded",
    is_flag=True,
    help="Export even if the bound estimates may grow until the loop diverges.",
)


@click.group(cls=Commands, registered="fracgyro.exports", invoke_without_command=True)
@click.pass_context
def export(context: click.Context) -> None:
    """Export a scenario, or a fractional operator: FMU, firmware, FPGA, MATLAB or WebAssembly."""
    help_without_command(context)


@export.command(name="web")
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE", help="A new JSON file.")
@unbounded_option
def web_command(scenario: str, out: Path, unbounded: bool) -> None:
    """Export SCENARIO as JSON for the browser. `make web` builds the WebAssembly module."""
    from ..export import web

    web(named(scenario), out, unbounded=unbounded)
    click.echo(f"{out}: load it with fracgyro.mjs; its first lines have an example")


@export.command(name="fmu")
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE", help="A new FMU.")
@click.option("--controller", is_flag=True, help="Export only the controller, without the plant.")
@click.option(
    "--reference",
    type=click.Choice(["scenario", "input"]),
    default="scenario",
    show_default=True,
    help="Follow the scenario's reference, or make position, velocity and acceleration inputs.",
)
@click.option("--fmi", type=click.Choice(["2.0", "3.0"]), default="2.0", show_default=True, help="FMI version.")
@click.option("--linux-arm", is_flag=True, help="Add a binary for Linux on ARM, 64 bit; needs ziglang.")
@click.option("--windows", is_flag=True, help="Add a binary for Windows to that for Linux; needs ziglang.")
@click.option("--macos", is_flag=True, help="Add a binary for macOS to that for Linux; needs ziglang.")
@number_option("double")
@click.option("--units", type=click.Choice(["V"]), help="With --controller: voltages for positions and forces.")
@unbounded_option
def fmu_command(
    scenario: str,
    out: Path,
    controller: bool,
    reference: Literal["scenario", "input"],
    fmi: Literal["2.0", "3.0"],
    linux_arm: bool,
    windows: bool,
    macos: bool,
    number: Number,
    units: Literal["V"] | None,
    unbounded: bool,
) -> None:
    """Export SCENARIO as an FMU: the closed loop, for co-simulation in Simulink, OpenModelica and others."""
    from ..export import fmu
    from ..export.fmu import System

    wanted: dict[System, bool] = {"linux": True, "linux-arm": linux_arm, "windows": windows, "macos": macos}
    systems = [system for system, chosen in wanted.items() if chosen]
    content: Literal["controller", "loop"] = "controller" if controller else "loop"
    loaded = named(scenario)
    fmu(
        loaded,
        out,
        content=content,
        reference=reference,
        fmi=fmi,
        systems=systems,
        number=number,
        units=units,
        unbounded=unbounded,
    )
    words = ["controller" if controller else "closed loop", *(["reference as input"] if reference == "input" else [])]
    words += [f"FMI {fmi}", *(["float"] if number == "float" else [])]
    words += ["in volts"] if units else []
    click.echo(f"{out}: {', '.join(words)}, for {', '.join(systems)}")


@export.command(name="firmware")
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@number_option("float")
@unbounded_option
def firmware_command(scenario: str, out: Path, number: Number, unbounded: bool) -> None:
    """Export SCENARIO as firmware: the controller in C++ with a C interface, for a microcontroller."""
    from ..export import firmware
    from ..export.clock import clock_of

    loaded = named(scenario)
    firmware(loaded, out, number, unbounded=unbounded)
    click.echo(f"{out}: add it to your project; see its README.md")
    if clock := clock_of(loaded):
        click.echo(f"{clock.sentence[0].upper()}{clock.sentence[1:]}.")
        if clock.warning:
            click.echo(f"Warning: {clock.warning}.", err=True)


@export.command(name="matlab")
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@number_option("double")
@unbounded_option
def matlab_command(scenario: str, out: Path, number: Number, unbounded: bool) -> None:
    """Export SCENARIO as a class for MATLAB and Octave, which is compiled there."""
    from ..export import matlab

    matlab(named(scenario), out, number, unbounded=unbounded)
    click.echo(f"{out}: run build in it, then Fracgyro; see its README.md")


@export.command(name="operator")
@click.option("--order", type=float, metavar="A", help="Derivative D^A, 0 < A <= 1, or integral, -1 <= A < 0.")
@click.option(
    "--pid", type=float, nargs=5, metavar="KP KI LAM KD MU", help="Five numbers: kp e + ki I^lam e + kd D^mu e."
)
@click.option("--step", type=float, default=1e-3, show_default=True, help="Time between samples, in any unit.")
@click.option("--longest", type=float, default=100.0, show_default=True, help="Time after which the past fades.")
@click.option("--tolerance", type=float, default=1e-6, show_default=True, help="Relative error of the kernel.")
@click.option(
    "--between",
    type=click.Choice(["lines", "parabolas"]),
    default="lines",
    show_default=True,
    help="Signal between samples; parabolas are more accurate for smooth signals.",
)
@click.option("--name", default="operator", show_default=True, help="Name of the files and of the functions in them.")
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@number_option("float")
def operator_command(
    order: float | None,
    pid: tuple[float, float, float, float, float] | None,
    step: float,
    longest: float,
    tolerance: float,
    between: Literal["lines", "parabolas"],
    name: str,
    out: Path,
    number: Number,
) -> None:
    """Export a fractional derivative, integral or PID as C. Writes one C99 file and its header, without heap or libm.

    Needs no scenario.
    """
    from ..export import operator
    from ..fractional import pid as fractional_pid

    if (order is None) == (pid is None):
        raise click.UsageError("exactly one of --order and --pid must be given")
    if order is not None and not 0 < abs(order) <= 1:
        raise click.UsageError(f"--order is {order:g}: it must be above 0 and at most 1, or at least -1 and below 0")
    if pid is not None:
        gains = pid
        meaning = "{:g} e + {:g} I^{:g} e + {:g} D^{:g} e".format(*gains)
    elif order is not None and order > 0:
        gains, meaning = (0.0, 0.0, 1.0, 1.0, order), f"Derivative of order {order:g} of a signal that starts from 0"
    else:
        gains, meaning = (0.0, 1.0, -(order or 0.0), 0.0, 1.0), f"Integral of order {-(order or 0.0):g}"
    found = fractional_pid(*gains, step=step, longest=longest, tolerance=tolerance, between=between)
    meaning += f", its kernels to {tolerance:g} up to times of {longest:g}, {between} between samples"
    operator(found, out, number, name=name, meaning=meaning)
    click.echo(f"{out / name}.c: {found.count} exponentials, {number}, one sample every {step:g}")


@click.command()
@click.argument("trace", type=click.Path(path_type=Path))
@click.option(
    "--target",
    required=True,
    type=click.Choice(TARGETS),
    help="Firmware on this computer, an emulated Cortex-M4F or M7; Octave; WebAssembly; FMU; lanes; simulated FPGA.",
)
@number_option("double", "float", "double", "fixed")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def replay(
    trace: Path,
    target: str,
    number: Literal["float", "double", "fixed"],
    as_json: bool,
) -> None:
    """Run a recorded motion on a target and compare bits. TRACE is a run from `simulate --out`.

    Double is compared with the record, float with the Python Controller, fixed (only fpga) with the core on this
    computer. Exit with 1 if a bit differs.
    """
    from ..export import replay as run

    found = run(trace, target, number)
    against = {"double": "the trace", "float": "the Python Controller", "fixed": "the core in fixed"}[number]
    if as_json:
        click.echo(json.dumps(asdict(found)))
    elif found.difference:
        d = found.difference
        click.echo(f"{target}, {number}: step {d.step}, {d.variable} is {d.found}, in {against} {d.expected}")
    else:
        click.echo(f"{target}, {number}: {found.steps} steps, all bits of forces and estimates equal {against}")
        click.echo(f"parity hash (SHA-256): {found.hash}")
    if found.difference:
        raise click.exceptions.Exit(DIFFERENT)
