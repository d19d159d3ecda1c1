"""`fracgyro check`, `fracgyro diff` and `fracgyro explain`."""

from __future__ import annotations

import json
import math
import textwrap
from typing import Any

import click
from pydantic import BaseModel

from ..scenario import Scenario, ScenarioError
from ..scenario.named import named
from ..scenario.table import toml_value
from .completion import fields, scenarios
from .options import scenario_argument
from .terminal import print_table

INVALID = 2
DIFFERENT = 1
WIDTH = 100


@click.command()
@scenario_argument()
def check(scenario: str) -> None:
    """Check SCENARIO without running it. Print every error; if it is valid, print warnings."""
    from ..scenario.suspicious import suspicious

    try:
        found = named(scenario)
    except ScenarioError as error:
        first = str(error).removesuffix(f" (and {len(error.others)} more)")
        for sentence in (first, *error.others):
            click.echo(f"fracgyro: {sentence}", err=True)
        raise click.exceptions.Exit(INVALID) from None
    warnings = list(suspicious(found))
    for sentence in warnings:
        click.echo(f"Warning: {sentence}.")
    count = f", {len(warnings)} warning{'s' if len(warnings) > 1 else ''}" if warnings else ""
    click.echo(f"{scenario} is a valid scenario{count}")


@click.command()
@click.argument("first", metavar="A", shell_complete=scenarios)
@click.argument("second", metavar="B", shell_complete=scenarios)
@click.option("--all", "everything", is_flag=True, help="Also print what only the paper's reproduction needs.")
@click.option("--json", "as_json", is_flag=True, help="Print the fields as JSON.")
def diff(first: str, second: str, everything: bool, as_json: bool) -> None:
    """Print the fields in which scenarios A and B differ, with both values. Exit with 1 if any does."""
    one, other = named(first), named(second)
    found = one.differences(other)
    hidden = [] if everything or as_json else _of_reproduction(found, (first, second))
    found = {field: pair for field, pair in found.items() if field not in hidden}
    if as_json:
        content = {field: [_plain(each) for each in pair] for field, pair in found.items()}
        click.echo(json.dumps(content))
    elif found:
        print_table(("field", first, second), [(field, *map(_shown, pair)) for field, pair in found.items()])
    else:
        click.echo("no field differs")
    if hidden:
        click.echo(f"\nleft out, as only the paper scenarios set them: {', '.join(hidden)}; --all prints them")
    if found:
        raise click.exceptions.Exit(DIFFERENT)


def _of_reproduction(found: dict[str, tuple[Any, Any]], names: tuple[str, str]) -> list[str]:
    """Differing fields that a paper scenario sets for the reproduction and the other scenario leaves as they are."""
    plain, paper = Scenario(), Scenario.paper()
    return [
        field
        for field, pair in found.items()
        if field in plain.differences(paper)
        and any(
            name in ("paper", "paper-printed") and pair[1 - place] == plain.differences(paper)[field][0]
            for place, name in enumerate(names)
        )
    ]


def _shown(value: Any) -> str:
    return "–" if value is None else toml_value(value)


def _plain(value: Any) -> Any:
    """The value for JSON, which has no infinity."""
    if isinstance(value, BaseModel):
        return value.model_dump()
    return toml_value(value) if value in (math.inf, -math.inf) else value


@click.command()
@click.argument("field", shell_complete=fields)
def explain(field: str) -> None:
    """Explain FIELD, a metric or a channel: meaning, unit, range, default, and the controllers that have the field."""
    from ..scenario.reference import explained

    meaning, rows = explained(field)
    width = max(len(name) for name, _ in rows) + 2
    click.echo(textwrap.fill(f"{field}: {meaning}", WIDTH))
    for name, text in rows:
        click.echo(
            textwrap.fill(f"{name:<{width}}{text}", WIDTH, initial_indent="  ", subsequent_indent=" " * (width + 2))
        )
