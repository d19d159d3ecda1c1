"""Result of a report of the zoo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..comparison.plan import Effort

CONDITIONS = ("one step of hidden delay", "12 bit", "0.7 of the force")  # changes that the table shows


@dataclass(frozen=True)
class Zoo:
    """A finished report: `laws`, `entries`, `switches` and `printed` as in zoo.json."""

    folder: Path
    laws: dict[str, dict[str, Any]]
    entries: dict[str, dict[str, Any]]
    switches: list[dict[str, Any]]
    printed: dict[str, dict[str, Any]]
    limits: list[dict[str, Any]]
    effort: Effort
    resumed: int
    seconds: float
