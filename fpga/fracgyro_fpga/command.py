"""`fracgyro export fpga` on the command line."""

from __future__ import annotations

from pathlib import Path

import click
from fracgyro.cli.export import number_option, unbounded_option
from fracgyro.cli.options import scenario_argument
from fracgyro.scenario.named import named

from .arithmetic import HardwareNumber


@click.command(name="fpga")
@scenario_argument()
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new or an empty folder.")
@number_option("float", "float", "fixed")
@unbounded_option
def command(scenario: str, out: Path, number: HardwareNumber, unbounded: bool) -> None:
    """Export SCENARIO as Verilog for an FPGA.

    In float it has the bits of the firmware. Fixed, 48 bits of which 28 are after the point, is faster.
    """
    from .folder import fpga

    fpga(named(scenario), out, number, unbounded=unbounded)
    click.echo(f"{out}: add it to your design; see its README.md")
