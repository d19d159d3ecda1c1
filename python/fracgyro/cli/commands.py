"""Command groups and choices that suggest the nearest name for a misspelled one."""

from __future__ import annotations

from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import click

from ..scenario.messages import did_you_mean


def help_without_command(context: click.Context) -> None:
    """Prints the help of a group that is called without a command."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


class Commands(click.Group):
    """A group of commands: its own, and those that installed packages register as entry points.

    `registered`: the name of the group of entry points. A registered command is imported when it is run or listed.
    """

    def __init__(self, *arguments: Any, registered: str = "", **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.entry_points = registered

    @cached_property
    def _registered(self) -> dict[str, EntryPoint]:
        return {each.name: each for each in entry_points(group=self.entry_points)} if self.entry_points else {}

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted({*super().list_commands(ctx), *self._registered})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.commands and cmd_name in self._registered:
            self.add_command(self._registered[cmd_name].load(), cmd_name)
        return super().get_command(ctx, cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if not name.startswith("-") and self.get_command(ctx, name) is None:
            near = did_you_mean(name, self.list_commands(ctx)) or f"; known are {', '.join(self.list_commands(ctx))}"
            raise click.UsageError(f"{name} is not a command{near}")
        return super().resolve_command(ctx, args)
