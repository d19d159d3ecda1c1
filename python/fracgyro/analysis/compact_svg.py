"""Matplotlib's SVG in a tenth of its lines: it looks the same, and a change of a curve is a change of a line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

SVG = "{http://www.w3.org/2000/svg}"
GROUP, PATH, USE, DEFS, METADATA = (f"{SVG}{tag}" for tag in ("g", "path", "use", "defs", "metadata"))
COORDINATES = {"d", "x", "y", "width", "height", "viewBox", "transform"}
ElementTree.register_namespace("", SVG[1:-1])
ElementTree.register_namespace("xlink", "http://www.w3.org/1999/xlink")


def compact(drawn: str) -> str:
    """Rounds coordinates to 0.1 pt (35 µm), drops metadata and groups without effect, joins paths of one look.

    Shapes with a name, which are drawn in several places, keep two decimals. A comment names the version of Matplotlib.
    """
    builder = ElementTree.TreeBuilder(insert_comments=True)  # formulas are spelled in comments
    root = ElementTree.fromstring(drawn, ElementTree.XMLParser(target=builder))
    for element in root.iter():
        _shorten(element)
    shapes = _joined(_shapes(root))
    for shape, following in pairwise([*shapes, root]):
        shape.tail = None if shape.tag == following.tag == USE else "\n"
    root[:] = shapes
    root.text = "\n"
    library = re.search(r"Matplotlib v[\d.]+", drawn)
    head = '<?xml version="1.0" encoding="utf-8"?>\n' + (f"<!-- {library[0]} -->\n" if library else "")
    return f"{head}{ElementTree.tostring(root, encoding='unicode')}\n"


def _shapes(parent: Element) -> Iterator[Element]:
    """The shapes in the order in which they are drawn, without groups that only name them."""
    for child in parent:
        if child.tag == GROUP and not child.attrib.keys() - {"id"}:
            if "axis_" in child.get("id", ""):  # the grid first, then ticks, then their labels
                order = {PATH: 0, DEFS: 1, USE: 2}
                inside = sorted(_shapes(child), key=lambda shape: order.get(str(shape.tag), 3))
                yield from _joined(inside, apart=True)
            else:
                yield from _shapes(child)
        elif child.tag != METADATA:
            yield child


def _joined(shapes: Iterable[Element], apart: bool = False) -> list[Element]:
    """Joins neighbors that differ only in their coordinates.

    Transparent paths are darker where they cross, which one path is not; they are joined only if they are `apart`.
    """
    kept: list[Element] = []
    for shape in shapes:
        solid = "opacity" not in shape.get("style", "opacity")
        if kept and shape.tag == PATH and (solid or apart) and _look(shape) == _look(kept[-1]):
            kept[-1].set("d", f"{kept[-1].get('d')} {shape.get('d')}")
        else:
            kept.append(shape)
    return kept


def _look(shape: Element) -> tuple[object, ...]:
    return shape.tag, *sorted((key, value) for key, value in shape.items() if key != "d")


def _shorten(element: Element) -> None:
    element.text = element.text if (element.text or "").strip() else None
    element.tail = element.tail if (element.tail or "").strip() else None
    for key, text in element.items():
        if key in COORDINATES:
            element.set(key, _shorter(key, " ".join(text.split()), 2 if "id" in element.attrib else 1))
    if element.get("transform") == "":
        del element.attrib["transform"]


def _shorter(key: str, text: str, decimals: int) -> str:
    if key == "transform":
        text = re.sub(r" ?rotate\(-?0 [^)]*\)", "", text)
        return re.sub(r"(?:translate|rotate)\([^)]*\)", lambda part: _rounded(part[0], decimals), text)
    if key == "d" and set("QC").isdisjoint(text):
        text = text.replace(" L ", " ")  # after M and L, lines are implied
    return _rounded(text, decimals)


def _rounded(text: str, decimals: int) -> str:
    return re.sub(r"-?\d+\.\d+(?:e-?\d+)?", lambda number: f"{round(float(number[0]), decimals) + 0.0:g}", text)
