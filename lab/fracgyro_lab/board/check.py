"""An entry reproduced from its law and compared, for the workflow of a pull request."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fracgyro.scenario import ScenarioError

from .enter import made, raw
from .entrant import entrant
from .entry import Change, Entry, read
from .room import LIMITS, Limits, Progress

ROWS = 0.02  # tolerance of the numbers of a row
CHANGES = 0.1  # tolerance of errors under changes, of which some are near instability
CALM = 10.0  # larger ratios are not compared
LUCKY = math.log(1.1)  # stated gains may be better than those that the search finds here by this much


def check(path: Path, *, limits: Limits = LIMITS, progress: Progress | None = None) -> Entry:
    """The entry of a file, reproduced with its gains. A Python law must be next to it.

    Raises ScenarioError, in one sentence, unless its hash, its seeds and its numbers are those found here.
    """
    stated = read(path)
    file, colon, name = stated.law.partition(":")
    who = entrant(f"{path.parent / file}:{name}" if colon else file, stated.setting.information)
    if who.sha256 != stated.sha256:
        law = file if colon else f"the compiled law {file}"
        raise ScenarioError(f"{path}: sha256 is {stated.sha256[:12]}..., but {law} has {who.sha256[:12]}...")
    gains = stated.rows.tuned.gains if stated.rows.tuned else None
    result = raw(who, gains=gains, limits=limits, progress=progress)
    found = made(who, stated.author, result)
    wrong = list(differences(stated, found, result["search"] or {}))
    if wrong:
        old = stated.versions.fracgyro
        remark = "" if old == version("fracgyro") else f" (the entry is of fracgyro {old})"
        raise ScenarioError(f"{path}: {'; '.join(wrong[:5])}{remark}")
    return found


def differences(stated: Entry, found: Entry, search: Mapping[str, Any]) -> Iterator[str]:
    """A clause for each number that differs from that found here by more than its tolerance."""
    if stated.seeds != found.seeds:
        yield "the seeds are not those of its hash"
    if stated.setting.model_dump(exclude={"trials"}) != found.setting.model_dump(exclude={"trials"}):
        yield "the setting is not that of the board"
    for name in ("as_given", "tuned"):
        mine, here = getattr(stated.rows, name), getattr(found.rows, name)
        if (mine is None) != (here is None):
            yield f"rows.{name} is {'missing' if mine is None else 'not reproduced'}"
        elif mine is not None:
            yield from _row(f"rows.{name}", mine.model_dump(exclude={"gains"}), here.model_dump(exclude={"gains"}))
    if stated.robustness.keys() != found.robustness.keys():
        yield "robustness has other changes than the board"
    for name in stated.robustness.keys() & found.robustness.keys():
        if not _alike(stated.robustness[name], found.robustness[name]):
            mine, here = stated.robustness[name].value, found.robustness[name].value
            yield f"robustness.{name} is {_word(mine)}, and {_word(here)} here"
    if search.get("stated") is not None and search.get("found") is not None:
        factor = math.exp(search["found"] - search["stated"])
        if math.log(factor) > LUCKY:
            yield (
                f"the tuned gains are better than those of the search by a factor of {factor:.2f}: put your own gains "
                "into the law, as its defaults"
            )


def _row(place: str, mine: Mapping[str, Any], here: Mapping[str, Any]) -> Iterator[str]:
    for name, value in mine.items():
        other, field = here[name], f"{place}.{name}"
        if isinstance(value, Mapping) and isinstance(other, Mapping):
            yield from _row(field, value, other)
        elif not _close(value, other, ROWS):
            yield f"{field} is {_word(value)}, and {_word(other)} here"


def _close(mine: Any, here: Any, tolerance: float) -> bool:
    if isinstance(mine, float) and isinstance(here, float):
        return math.isclose(mine, here, rel_tol=tolerance)
    return bool(mine == here)


def _alike(mine: Change, here: Change) -> bool:
    """Runs that are lost, or nearly, differ by more than a tolerance."""
    values = mine.value, here.value
    if None in values:
        return values == (None, None)
    large = [value is not None and value > CALM for value in values]
    return all(large) or _close(*values, CHANGES)


def _word(value: Any) -> str:
    if value is None:
        return "null"
    return f"{value:.4g}" if isinstance(value, float) else str(value).lower()
