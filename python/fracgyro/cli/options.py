"""Arguments and options that several commands share, each defined once."""

from __future__ import annotations

from typing import Any

import click

from .completion import scenarios


def scenario_argument(**settings: Any) -> Any:
    """The argument SCENARIO: the name of a shipped scenario or a file, which `scenario.named` reads."""
    return click.argument("scenario", **{"metavar": "SCENARIO", "shell_complete": scenarios, **settings})
