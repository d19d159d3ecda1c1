"""Pages: each one self-contained HTML file, on one base template with one style."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from .style import svg


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


def embedded(picture: Figure | bytes, title: str = "") -> str:
    """The source of an HTML image, of a figure with a title or of the contents of an SVG file."""
    if isinstance(picture, Figure):
        picture = svg(picture, title).encode()
    return "data:image/svg+xml;base64," + base64.b64encode(picture).decode("ascii")
