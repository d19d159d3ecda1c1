"""`fracgyro schema`."""

from __future__ import annotations

import json
from typing import Literal

import click


@click.command(name="schema")
@click.argument("kind", type=click.Choice(["scenario", "study", "tuning", "identify"]))
def schema_command(kind: Literal["scenario", "study", "tuning", "identify"]) -> None:
    """Print the JSON Schema of a scenario or of a study, with which editors check TOML; or of identify.json."""
    if kind == "identify":
        from ..identification.json_schema import schema as of_identification

        content = of_identification()
    else:
        from ..study.json_schema import schema

        content = schema(kind)
    click.echo(json.dumps(content, indent=1, allow_nan=False))
