"""Arguments and options that several commands share, each defined once."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from .completion import scenarios

if TYPE_CHECKING:
    from ..simulation.user_controller import ControllerLike
    from ..simulation.user_plant import PlantLike

Decorator = Callable[[Callable[..., None]], Callable[..., None]]


def scenario_argument(**settings: Any) -> Decorator:
    """The argument SCENARIO: the name of a shipped scenario or a file, which `scenario.named` reads."""
    return click.argument("scenario", **{"metavar": "SCENARIO", "shell_complete": scenarios, **settings})


def controller_option(text: str = "Use your own controller instead of the scenario's.") -> Decorator:
    """The option --controller FILE.py:NAME, which `own_controller` loads."""
    return click.option("--controller", metavar="FILE.py:NAME", help=text)


def jobs_option(**settings: Any) -> Decorator:
    """The option --jobs, which holds until the command ends; a command that takes `jobs` gets it, too."""
    text = "Use N processors.  [default: all]"
    return click.option("--jobs", type=int, metavar="N", callback=_at_most, help=text, **settings)


def _at_most(context: click.Context, _: click.Parameter, jobs: int | None) -> int | None:
    if jobs is not None:
        from ..simulation.many import at_most

        context.with_resource(at_most(jobs))
    return jobs


def own_controller(given: str | None) -> ControllerLike | None:
    """The controller of --controller; None without the option. Raises ScenarioError if it is not a controller."""
    if given is None:
        return None
    from ..simulation.own_file import ControllerFile

    return ControllerFile.read(given).controller()


def own_plant(given: str | None) -> PlantLike | None:
    """The plant of --plant; None without the option. Raises ScenarioError if it is not a plant."""
    if given is None:
        return None
    from ..simulation.own_file import PlantFile

    return PlantFile.read(given).plant()
