"""Pages: each one self-contained HTML file, on one base template with one style."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure


def page(package: str, template: str, filters: Mapping[str, Callable[..., Any]] | None = None, **values: Any) -> str:
    """The page that a template of the package, which extends base.html.jinja, makes of the values."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader("fracgyro.analysis", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters or {}
    return environment.get_template(template).render(**values)


def embedded(picture: Figure | bytes) -> str:
    """The source of an HTML image, of a figure or of the contents of an SVG file."""
    if isinstance(picture, Figure):
        svg = io.BytesIO()
        picture.savefig(svg, format="svg", metadata={"Date": None})
        picture = svg.getvalue()
    return "data:image/svg+xml;base64," + base64.b64encode(picture).decode("ascii")
