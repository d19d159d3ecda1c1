"""Self-contained HTML pages from one base template."""

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
    """The HTML text of a template of the package, which extends base.html.jinja, with these values."""
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
    """Source of an HTML image, from a figure with a title or from the contents of an SVG file."""
    if isinstance(picture, Figure):
        picture = svg(picture, title).encode()
    return "data:image/svg+xml;base64," + base64.b64encode(picture).decode("ascii")


def csv_text(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Data of a plot as CSV, to nine digits; NaN and None become blank cells."""
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
    """A link that saves the CSV text, embedded in the page, as NAME.csv."""
    link = '<a class="data" download="{}.csv" href="data:text/csv;charset=utf-8,{}">data&nbsp;(CSV)</a>'
    return Markup(link).format(name, quote(text, safe=",:;/()"))
