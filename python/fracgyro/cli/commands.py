"""Command groups and choices that suggest the nearest name for a misspelled one."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any

import click


def help_without_command(context: click.Context) -> None:
    """Prints the help of a group that is called without a command."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


class Commands(click.Group):
    """A group of commands: its own, and those that installed packages register as entry points.

    `known`: by name, "module:command" within this package and its line in the list; imported when it is run.
    `registered`: the name of the group of entry points. A registered command is imported when it is run or listed.
    """

    def __init__(
        self, *arguments: Any, known: Mapping[str, tuple[str, str]] | None = None, registered: str = "", **named: Any
    ) -> None:
        super().__init__(*arguments, **named)
        self.known, self.entry_points = known or {}, registered

    @cached_property
    def _registered(self) -> dict[str, tuple[str, str]]:
        found: dict[str, tuple[str, str]] = {}
        for name, module, command in entry_points(self.entry_points) if self.entry_points else ():
            found.setdefault(name, (module, command))
        return found

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted({*super().list_commands(ctx), *self.known, *self._registered})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.commands:
            if cmd_name in self.known:
                module, _, name = self.known[cmd_name][0].partition(":")
                self.add_command(getattr(import_module(f".{module}", __package__), name), cmd_name)
            elif cmd_name in self._registered:
                module, name = self._registered[cmd_name]
                self.add_command(attrgetter(name)(import_module(module)), cmd_name)
        return super().get_command(ctx, cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Writes the list of commands without importing those that are known."""
        names = self.list_commands(ctx)
        room = formatter.width - 6 - max(map(len, names))
        rows = [(name, self._line(ctx, name, room)) for name in names]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def _line(self, ctx: click.Context, name: str, room: int) -> str:
        if name in self.known:
            return self.known[name][1]
        command = self.get_command(ctx, name)
        return command.get_short_help_str(room) if command else ""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if not name.startswith("-") and self.get_command(ctx, name) is None:
            from ..scenario.messages import did_you_mean  # slow to import

            near = did_you_mean(name, self.list_commands(ctx)) or f"; known are {', '.join(self.list_commands(ctx))}"
            raise click.UsageError(f"{name} is not a command{near}")
        return super().resolve_command(ctx, args)


def entry_points(group: str) -> Iterator[tuple[str, str, str]]:
    """Name, module and object of the entry points that installed packages register in a group, in the path's order.

    Reads the files of https://packaging.python.org/specifications/entry-points, as importlib.metadata does, which takes
    a third of the time of `--help` to import.
    """
    for folder in map(Path, sys.path):
        for pattern in ("*.dist-info", "*.egg-info"):
            for path in sorted(folder.glob(f"{pattern}/entry_points.txt")):
                section = ""
                for line in map(str.strip, path.read_text(encoding="utf-8", errors="replace").splitlines()):
                    if line.startswith("["):
                        section = line.strip("[] ")
                    elif section == group and "=" in line and not line.startswith(("#", ";")):
                        name, _, value = line.partition("=")
                        module, _, rest = value.partition("[")[0].partition(":")
                        yield name.strip(), module.strip(), rest.strip()
