"""`fracgyro schema`."""

from __future__ import annotations

import json
from importlib.metadata import EntryPoint, entry_points
from typing import Literal, cast

import click

KINDS = ("scenario", "study", "tuning")
# Files of other packages, whose entry points are functions that return a schema.
REGISTERED: dict[str, EntryPoint] = {each.name: each for each in entry_points(group="fracgyro.schemas")}


@click.command(name="schema")
@click.argument("kind", type=click.Choice([*KINDS, "identify", *sorted(REGISTERED)]))
def schema_command(kind: str) -> None:
    """Print the JSON Schema of a scenario or a study, with which editors check TOML, or of a JSON file.

    identify: the identify.json of `fracgyro identify`; entry: an entry of the board; zoo: an
    entry of the zoo.
    """
    if kind in REGISTERED:
        found = REGISTERED[kind].load()()
    elif kind == "identify":
        from ..identification.json_schema import schema as of_identification

        found = of_identification()
    else:
        from ..study.json_schema import schema

        found = schema(cast(Literal["scenario", "study", "tuning"], kind))
    click.echo(json.dumps(found, indent=1, allow_nan=False))
