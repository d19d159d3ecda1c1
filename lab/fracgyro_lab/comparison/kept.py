"""Searches of an earlier comparison, which are kept if their best gains still have the same errors."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fracgyro.scenario import ScenarioError

from .task import Cell
from .tuning import Tuning

SAME = 1e-3  # largest relative difference of an error: the logs have four digits


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Rows of a compare.json by the names of their files. Raises ScenarioError if it is none."""
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["contenders"]
        return {_name(row): row for row in rows if row["sampler_errors"] and row.get("sampler_values")}
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise ScenarioError(f"{path} is not the compare.json of a comparison") from None


def searches(piece: Tuning, row: Mapping[str, Any]) -> dict[str, Any] | None:
    """The result of `Tuning.measure` from a row; None if one of its searches has to be repeated."""
    errors, values = row["sampler_errors"], row["sampler_values"]
    if len(errors) != piece.samplers or len(values) != piece.samplers:
        return None
    fields = [gain.field for gain in piece.contender.tuned(piece.cell.information)]
    if any(each is not None and not set(fields) <= each.keys() for each in values):
        return None
    points = [{field: each[field] for field in fields} for each in values if each is not None]
    scores = iter(piece.scores(points, piece.seeds))
    found: list[dict[str, Any]] = []
    for error, each in zip(errors, values, strict=True):
        if each is None:
            found.append({"best": None, "error": None})
            continue
        score = next(scores)
        now = piece.error(score) if score and score.feasible else math.inf
        if error is None or not abs(math.expm1(now - math.log(error))) <= SAME:
            return None
        found.append({"best": each, "error": now})
    return {"samplers": found, "trials": row["trials"], "converged": row["converged"], "front": row["front"]}


def _name(row: Mapping[str, Any]) -> str:
    return f"{row['name']}-{Cell(row['scenario'], row['class'], row['noise'], row['ceiling']).name}"
