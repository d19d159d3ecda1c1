"""The comparison of controllers, shared by both tasks: reading benchmarks/results/compare-*.json."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from words import interval, spelled

PAPER, PUBLISHED = "paper", "paper_as_published"
NOISE = 1e-13  # m/sqrt(Hz), the one whose results are put in sentences
Row = dict[str, Any]
Values = dict[str, Any]


def load(folder: Path, task: str) -> dict[str, Any]:
    """Raises ValueError in one sentence where it is missing or is not a comparison."""
    path = folder / f"compare-{task}.json"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path} is missing: `make compare` writes it") from None
    except ValueError as error:
        raise ValueError(f"{path} is not JSON: {error}") from None
    if not isinstance(found, dict) or not {"task", "effort", "contenders"} <= found.keys() or not found["contenders"]:
        raise ValueError(f"{path} must have task, effort and contenders, as `make compare` writes them")
    return found


def effort(data: dict[str, Any]) -> Values:
    e = data["effort"]
    return {
        **{name: str(e[name]) for name in ("trials", "seeds", "held_out", "few")},
        "samplers": spelled(e["samplers"]),
        "quick": bool(e["quick"]),
        "version": data["version"],
    }


def metric(row: Row, name: str, of: str = "value") -> float:
    """Infinite if the row has none."""
    found = (row["metrics"].get(name) or {}).get(of)
    return math.inf if found is None else float(found)


def within(found: dict[str, Any]) -> str:
    return interval(found["low"], found["high"])
