"""`fracgyro live`."""

from __future__ import annotations

import tempfile
import webbrowser
from pathlib import Path

import click

from ..scenario.named import named
from .options import scenario_argument


@click.command(name="live")
@scenario_argument()
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="FILE", help="Write the page to a new HTML file instead."
)
def live_command(scenario: str, out: Path | None) -> None:
    """Simulate SCENARIO in the browser, with controls that act while it runs. Needs ziglang."""
    from ..export import live

    loaded = named(scenario)
    if out is not None:
        live(loaded, out, name=scenario)
        click.echo(f"{out}: open it in a browser")
        return
    path = Path(tempfile.mkdtemp(prefix="fracgyro-")) / "live.html"
    live(loaded, path, name=scenario)
    opened = webbrowser.open(path.as_uri())
    click.echo(f"{path}: {'opened in the browser' if opened else 'open it in a browser; none was found'}")
