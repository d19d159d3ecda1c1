"""`fracgyro selfcheck`."""

from __future__ import annotations

import json
from dataclasses import asdict

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def selfcheck(as_json: bool) -> None:
    """Recompute the published parity hashes, for problem reports. Exit with 1 if they differ."""
    from ..export.parity import selfcheck as check

    found = check()
    if as_json:
        click.echo(json.dumps({**asdict(found), "sound": found.sound}))
    else:
        click.echo(
            f"fracgyro {found.version}, Python {found.python}, NumPy {found.numpy}, compiled by {found.compiler}"
        )
        click.echo(f"processor: {found.processor}; lanes of {found.lanes}")
        for number, hashed in found.hashes.items():
            expected = found.published[number]
            verdict = "as published" if hashed == expected else f"NOT the published {expected}"
            click.echo(f"parity hash, {number}: {hashed}, {verdict}")
    if not found.sound:
        raise click.exceptions.Exit(1)
