"""`fracgyro schema`."""

from __future__ import annotations

import json
from typing import Literal

import click


@click.command(name="schema")
@click.argument("kind", type=click.Choice(["scenario", "study", "tuning"]))
def schema_command(kind: Literal["scenario", "study", "tuning"]) -> None:
    """Print the JSON Schema of a scenario or of a study. Editors check and complete TOML files with it."""
    from ..study.json_schema import schema

    click.echo(json.dumps(schema(kind), indent=1, allow_nan=False))
