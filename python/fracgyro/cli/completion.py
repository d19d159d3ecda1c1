"""Shell completion: fields and their choices after --set, TOML files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import click
from click.shell_completion import CompletionItem


def changes(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """FIELD= for every field with this beginning; the choices if there is only one field."""
    from ..scenario import Scenario
    from ..scenario.messages import leaves

    field, equals, _ = begun.partition("=")
    fields = leaves(Scenario)
    near = {path: info for path, info in fields.items() if path.startswith(field) and (path == field or not equals)}
    if len(near) != 1:
        return [CompletionItem(f"{path}=", help=info.description) for path, info in near.items()]
    [(path, info)] = near.items()
    words = ["true", "false"] if info.annotation is bool else _choices(info.annotation)
    found = [f"{path}={word}" for word in words or ([] if equals else [""])]
    return [CompletionItem(each, help=info.description) for each in found if each.startswith(begun)]


def _choices(annotation: Any) -> list[str]:
    return [choice for choice in get_args(annotation) if isinstance(choice, str)]


def fields(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Every field of a scenario with this beginning."""
    from ..scenario import Scenario
    from ..scenario.messages import leaves

    found = leaves(Scenario).items()
    return [CompletionItem(path, help=info.description) for path, info in found if path.startswith(begun)]


def scenarios(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """Names of shipped scenarios and TOML files with this beginning."""
    from ..scenario.shipped import NAMES

    names = [CompletionItem(name, help=words) for name, words in NAMES.items() if name.startswith(begun)]
    return [*toml_files(context, parameter, begun), *names]


def toml_files(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """TOML files with this beginning; the shell completes folders."""
    head, slash, _ = begun.rpartition("/")
    folder = Path(head + slash)
    names = sorted(path.name for path in folder.glob("*.toml")) if folder.is_dir() else []
    files = [name for name in (f"{head}{slash}{name}" for name in names) if name.startswith(begun)]
    return [CompletionItem(begun, type="dir"), *map(CompletionItem, files)]
