"""Pages: each one self-contained HTML file, on one base template with one style."""

from __future__ import annotations

import base64
import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any
from urllib.parse import quote

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
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
    environment.filters |= {"data_link": data_link, **(filters or {})}
    return environment.get_template(template).render(**values)


def embedded(picture: Figure | bytes, title: str = "") -> str:
    """The source of an HTML image, of a figure with a title or of the contents of an SVG file."""
    if isinstance(picture, Figure):
        picture = svg(picture, title).encode()
    return "data:image/svg+xml;base64," + base64.b64encode(picture).decode("ascii")


def csv_text(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """The numbers of a figure as CSV, to nine digits; what is NaN or None is blank."""
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(_cell, row) for row in rows)
    return written.getvalue()


def _cell(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return "" if math.isnan(value) else f"{value:.9g}"


def data_link(text: str, name: str) -> Markup:
    """A link that saves the CSV text as NAME.csv. The page itself holds it, and stays one file."""
    link = '<a class="data" download="{}.csv" href="data:text/csv;charset=utf-8,{}">data&nbsp;(CSV)</a>'
    return Markup(link).format(name, quote(text, safe=",:;/()"))
