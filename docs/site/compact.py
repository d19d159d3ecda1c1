"""A site that is built faster and is smaller: one sidebar for the pages that are not in it, plots with few colors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PIL import Image
from sphinx.application import Sphinx

COLORS = 96  # curves and letters of a plot, with their edges

_sidebars: dict[tuple[Any, ...], str] = {}


def _shared_sidebar(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Orphans in the same folder have the same sidebar: no entry is the current one, and links are relative to it."""
    if "orphan" not in (context.get("meta") or {}):
        return
    toctree: Callable[..., str] = context["toctree"]

    def shared(**options: Any) -> str:
        key = (page.rpartition("/")[0], *sorted(options.items()))
        if key not in _sidebars:
            _sidebars[key] = toctree(**options)
        return _sidebars[key]

    context["toctree"] = shared


def _smaller(app: Sphinx, failed: Exception | None) -> None:
    """Plots with a palette; no maps of the theme's sources, which only debuggers ask for."""
    if failed or app.builder.format != "html":
        return
    for path in (app.outdir / "_static").rglob("*.map"):
        path.unlink()
    for path in (app.outdir / "_images").glob("*.png"):
        with Image.open(path) as picture:
            picture.load()
        if picture.mode != "P":
            drawn = picture.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
            drawn.save(path, optimize=True)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", _shared_sidebar, priority=400)  # before the theme's
    app.connect("build-finished", _smaller)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
