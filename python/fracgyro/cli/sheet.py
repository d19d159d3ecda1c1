"""`fracgyro device`."""

from __future__ import annotations

from pathlib import Path

import click

from ..extras import needs


@click.command()
@click.option("--frequency", required=True, metavar="X[,Y]", help="Set the frequencies, Hz; or X, and --split.")
@click.option("--split", metavar="HZ", help="Set how much the frequency of y is above that of x.")
@click.option("--q", required=True, metavar="X[,Y]", help="Set the quality factors of x and y, or one for both.")
@click.option("--mass", metavar="KG", help="Set the modal mass, as in '3 ug'.")
@click.option("--quadrature", metavar="DEG/S", help="Set the quadrature error.")
@click.option("--damping-axis", metavar="DEG", help="Set the angle from x to a principal axis of the damping.")
@click.option("--angle-random-walk", metavar="DEG/SQRT(H)", help="Set the noise of the rate.")
@click.option("--full-scale", metavar="DEG/S", help="Set the end of the range of the rate.")
@click.option("--bandwidth", metavar="HZ", help="Set the bandwidth of the rate.")
@click.option("--temperature-coefficient", metavar="PPM/K", help="Set the temperature coefficient of the frequencies.")
@click.option("--amplitude", metavar="M", help="Set the amplitude of the drive mode, as in '5 um'.")
@click.option("--delay", metavar="S", help="Set the delay from a sample to its force, as in '2 us'.")
@click.option("--sampling", metavar="HZ", help="Set the sampling rate.")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE.toml", help="Write the scenario to this file.")
def device_command(frequency: str, q: str, out: Path | None, **more: str | None) -> None:
    """Make a scenario from the numbers of a data sheet, and print it. Missing numbers are supposed, and marked.

    Numbers may have another unit, as in --frequency '15 kHz,15.2 kHz'.
    """
    with needs("rate"):
        from ..devices.sheet import device

    made = device(frequency.split(","), q.split(","), **more)
    if out is None:
        click.echo(made.to_toml(), nl=False)
    else:
        made.save(out)
        click.echo(f"Written: {out}")
