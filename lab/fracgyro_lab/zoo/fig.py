"""Curves of a MATLAB figure: a .fig file is a MAT file with a tree of graphics objects."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from fracgyro.files import read_input, reason
from fracgyro.scenario import ScenarioError
from numpy.typing import NDArray

ROOT = "hgS"  # first letters of the variable with the tree
AXES = "axes"


@dataclass(frozen=True)
class Line:
    """A curve: the number of its axes in the figure, from 0, and its points."""

    axes: int
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def lines(path: str) -> list[Line]:
    """The curves of a figure, in the order of the file. Raises ScenarioError if it is not a figure with curves."""
    from scipy.io import loadmat

    try:
        tree = loadmat(io.BytesIO(read_input(path)), squeeze_me=True, struct_as_record=False)
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {reason(error)}") from None
    except Exception as error:  # the reader has many, for any other file
        raise ScenarioError(f"{path} is not a MATLAB figure: {error}") from None
    roots = [tree[name] for name in tree if name.startswith(ROOT)]
    axes = [each for root in roots for each in _below(root) if each.type == AXES]
    found = [line for place, each in enumerate(axes) for line in _lines(place, each)]
    if not found:
        raise ScenarioError(f"{path} has no curves: it must be a MATLAB figure with lines, a .fig file")
    return found


def _below(node: Any) -> Iterator[Any]:
    yield node
    for child in np.atleast_1d(getattr(node, "children", [])):
        if hasattr(child, "type"):
            yield from _below(child)


def _lines(place: int, axes: Any) -> Iterator[Line]:
    for node in _below(axes):
        given: Any = getattr(node, "properties", None)
        if hasattr(given, "XData") and hasattr(given, "YData"):
            x, y = (np.ravel(np.asarray(data, dtype=float)) for data in (given.XData, given.YData))
            if len(x) == len(y) > 1:
                yield Line(place, x, y)
