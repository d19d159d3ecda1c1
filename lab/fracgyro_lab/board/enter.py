"""Entry point of `fracgyro enter`: one law through the task, as an entry of the board."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from secrets import randbits
from typing import Any

import numpy as np
from fracgyro.files import whole_file

from ..comparison.limits import over
from ..comparison.rows import interval, other
from ..comparison.track import CHATTERING, DURATION, ERRORS, Track
from . import trial
from .entrant import Entrant, contender, entrant
from .entry import Change, Entry, Interval, OverLimit, Row, Rows, Seeds, Setting, Trace, Versions
from .room import LIMITS, Limits, Progress, run

OURS = "the fracgyro authors"
DIGITS = 4
FRONT, TRACE_DIGITS = 12, 3


def enter(
    law: str,
    *,
    information: str = "F",
    author: str | None = None,
    limits: Limits = LIMITS,
    progress: Progress | None = None,
) -> Entry:
    """The entry of a law: FILE.py, FILE.py:NAME or a compiled one, in class F or P of information.

    `author`: for the board. `progress`: called with (runs finished, all runs, current step). Raises ScenarioError, in
    one sentence, for a law that is refused.
    """
    who = entrant(law, information)
    return made(who, author, raw(who, limits=limits, progress=progress))


def write(entry: Entry, path: Path) -> None:
    with whole_file(path) as scratch:
        scratch.write_text(entry.to_json(), encoding="utf-8", newline="\n")


def raw(
    who: Entrant,
    *,
    gains: Mapping[str, Any] | None = None,
    limits: Limits = LIMITS,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """The result of the law's process, as `trial.tried` returns it."""
    seeds = {
        "training": who.seeds("training", trial.TRAINING),
        "judging": who.seeds("judging", trial.JUDGING),
        "secret": [randbits(63) for _ in range(trial.JUDGING)],
    }
    job: dict[str, Any] = {"information": who.information, "seeds": seeds}
    if gains is not None:
        job["gains"] = dict(gains)
    return run(job, who.law, who.text, limits, progress)


def made(who: Entrant, author: str | None, result: Mapping[str, Any]) -> Entry:
    """The entry from the result of the law's process."""
    task, rows, search = Track(), result["rows"], result["search"] or {"trials": 0, "front": []}
    found = {name: _row(who, task, rows[name]) if name in rows else None for name in ("as_given", "tuned")}
    best = rows.get("tuned") or rows["as_given"]
    error = _array(best["error"])
    setting = trial.cell(who.information)
    return Entry(
        format=1,
        law=who.law,
        words=who.words[:200],
        author=(OURS if who.text is None else "") if author is None else author,
        sha256=who.sha256,
        versions=Versions(fracgyro=version("fracgyro"), python=platform.python_version(), numpy=np.__version__),
        setting=Setting(
            task="track",
            scenario=setting.scenario,
            information="P" if who.information == "P" else "F",
            noise=setting.noise,
            ceiling=setting.ceiling,
            trials=search["trials"],
        ),
        seeds=Seeds(
            training=who.seeds("training", trial.TRAINING),
            judging=who.seeds("judging", trial.JUDGING),
        ),
        rows=Rows(**found),
        robustness={
            name: Change(**_rounded(other(task, error, _array(errors)))) for name, errors in result["others"].items()
        },
        step_over_pid=_short(result["step_over_pid"]),
        state_bytes=result["state_bytes"],
        front=_thinned(search["front"]),
        trace=Trace(until=DURATION, error=[_short(value, TRACE_DIGITS) for value in result["trace"]]),
        own_network=result["own_network"],
    )


def _row(who: Entrant, task: Track, row: Mapping[str, Any]) -> Row:
    """Statistics of a row over its seeds, and its distance to the limit at its own chattering."""
    metrics = {name: _array(values) for name, values in row["metrics"].items()}
    error = interval(task, "error", _array(row["error"]))
    means = {name: interval(task, name, metrics[name])["value"] for name in (*ERRORS, *CHATTERING)}
    chattering = None if row["diverged"] else max(means[name] or 0.0 for name in CHATTERING)
    steady = [means[name] for name in ERRORS if "steady" in name]
    distance = None
    if chattering and error["value"] is not None:
        limit = task.limit(trial.base(who.information), [chattering])
        distance = over(limit, chattering, {**means, "error": error["value"]})
    gains = row["gains"]
    if (own := contender(who.law)) is not None:
        changes = [gain.changes(gains) for gain in own.tuned(who.information) if gain.field in gains]
        listed = {name: value for change in changes for name, value in change.items()}
        gains = {name: list(value) if isinstance(value, tuple) else value for name, value in listed.items()}
    return Row(
        gains={name.removeprefix("law."): value for name, value in gains.items()},
        error=Interval(**_rounded(error)),
        steady=None if None in steady else _short(math.exp(np.mean(np.log(np.array(steady, dtype=float))))),
        chattering=_short(chattering),
        kept=not row["diverged"] and chattering is not None and chattering <= trial.CEILING,
        diverged=row["diverged"],
        over_limit=None if distance is None else OverLimit(**_rounded(distance)),
    )


def _thinned(points: Sequence[Sequence[float]]) -> list[list[float]]:
    """At most FRONT points of a front, evenly on the logarithm of the chattering."""
    known = [point for point in points if point[0] > 0]
    if len(known) > FRONT:
        at = np.log([point[0] for point in known])
        wanted = np.linspace(at[0], at[-1], FRONT)
        known = [known[i] for i in sorted({int(np.abs(at - each).argmin()) for each in wanted})]
    return [[_short(number) for number in point] for point in known]


def _rounded(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _short(value) if isinstance(value, float) else value for name, value in values.items()}


def _short(value: Any, digits: int = DIGITS) -> Any:
    """To some significant digits; None as it is."""
    return None if value is None else float(f"{value:.{digits}g}")


def _array(values: Sequence[float | None]) -> Any:
    return np.array([math.inf if value is None else value for value in values])
