"""The comparison of controllers that track: tables and sentences, formed from benchmarks/results/compare-track.json.

Nothing here knows who is better: every comparative word follows from a range of ratios over the tunings of both.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import geometric_mean, median
from typing import Any, NamedTuple

import limits
from comparison import PAPER, PUBLISHED, Row, Values, effort, metric
from words import interval, listed, short, spelled

SCENARIO = "paper"  # whose rows the tables show; others have a sentence each
CLASSES = ["F", "P"]
HIDDEN = "one step of hidden delay"
END, FAILED = "†", "‡"  # a gain at the end of its range; a tuning that found no gains within the ceiling
UNIT = 1e6  # errors are shown in millionths of q0
NEAR = 1.5  # times the limit: contenders called near it
SHOWN = 3.0  # times the limit in some setting: contenders of the last table
ALWAYS = (PAPER, PUBLISHED, "pid")  # in all tables
MOST_ROWS = 14  # a table has; the log has all
BEARS = 2.0  # an error that is at most doubled is called borne
LOST = math.inf

# Special cases of the paper's law: the law that contains them can be tuned to at most their error.
CONTAINED = (PAPER, "paper_no_terminal", "paper_integer_order", "paper_no_adaptation")


class Step(NamedTuple):
    """Two contenders that differ in one thing."""

    group: str
    words: str
    of: str
    over: str


STEPS = (
    Step("Filter", "PID, with a Kalman filter of the nominal plant", "pid_kalman", "pid"),
    Step("Filter", "PID with resonators, with that filter", "resonant_kalman", "resonant"),
    Step("Filter", "linear surface, with that filter", "linear_kalman", "linear"),
    Step("Filter", "the original's, with that filter", "paper_kalman", PAPER),
    Step("Filter, learning", "the original's surface, on the joint Kalman filter", "paper_joint", PAPER),
    Step("Learning", "joint Kalman filter, over that of the nominal plant", "paper_joint", "paper_kalman"),
    Step("Learning", "PID, with the plant that least squares find", "pid_least_squares", "pid"),
    Step("Learning", "the original's, with least squares", "paper_least_squares", PAPER),
    Step("Learning", "the original's, with its gradient laws", PAPER, "paper_no_adaptation"),
    Step("Operator", "the original's, with an order below 1", PAPER, "paper_integer_order"),
    Step("Surface", "the original's, with its terminal term", PAPER, "paper_no_terminal"),
    Step("Surface", "the original's, over the linear one, both on that filter", "paper_kalman", "linear_kalman"),
    Step("Surface", "integral and disturbance observer, over the linear one", "integral_sliding", "linear"),
    Step("Frequencies", "PID, with resonators at those of the reference", "resonant", "pid"),
    Step("Tuning", "the original's, tuned", PAPER, PUBLISHED),
)


class Setting(NamedTuple):
    """A table of the comparison."""

    information: str
    noise: float
    ceiling: float

    @property
    def words(self) -> str:
        return f"{self.information}, {short(self.noise) if self.noise else 'exact'}, ≤ {short(self.ceiling)}"

    @property
    def place(self) -> str:
        return f"{self.information} ≤ {short(self.ceiling)}"

    def holds(self, row: Row) -> bool:
        return setting(row) == self


def setting(row: Row) -> Setting:
    return Setting(row["class"], float(row["noise"]), float(row["ceiling"]))


def values(data: dict[str, Any]) -> Values:
    """Raises ValueError in one sentence for a comparison that the text cannot be about."""
    every = [row for row in data["contenders"] if row["name"] != "limit"]
    rows = [row for row in every if row.get("scenario", SCENARIO) == SCENARIO]
    if not any(row["name"] == PAPER for row in rows):
        raise ValueError(f"compare-track.json has no contender {PAPER}, to which all others are compared")
    settings = sorted({setting(row) for row in rows}, key=lambda s: (s.noise, s.information, s.ceiling))
    if {s.information for s in settings} != set(CLASSES):
        found = listed(sorted({s.information for s in settings}))
        raise ValueError(f"compare-track.json has the classes {found}: F and P are needed")
    noisy = [s for s in settings if s.noise == settings[-1].noise]
    return {
        "effort": effort(data),
        "contenders": spelled(len({row["name"] for row in rows})),
        "names": sorted({row["name"] for row in rows}),
        "noise": short(settings[-1].noise),
        "near": short(NEAR),
        "bears": short(BEARS, 1),
        "nearest": [_nearest(rows, s) for s in settings],
        "spans": _spans(rows, noisy),
        "tables": {c: _table(rows, [s for s in settings if s.information == c], noisy) for c in CLASSES},
        "published": _published(rows, settings),
        "samplers": _samplers(rows),
        "ends": _ends(rows),
        "contained": _contained(rows, noisy),
        "steps": _steps(rows, noisy),
        "places": [s.place for s in noisy],
        "verdicts": {c: _verdict(rows, [s for s in noisy if s.information == c]) for c in CLASSES},
        "flattery": _flattery(rows, settings),
        "delay": _delay(rows, noisy),
        "robustness": _robustness(rows, noisy),
        "elsewhere": _elsewhere(every),
    }


# -- A row ---------------------------------------------------------------------------------------------------


def find(rows: Iterable[Row], name: str, at: Setting) -> Row | None:
    return next((row for row in rows if row["name"] == name and at.holds(row)), None)


def error(row: Row, of: str = "value") -> float:
    return metric(row, "error", of)


def tunings(row: Row | None) -> list[float]:
    """Errors of all tunings that found gains, or of the contender without any; none if it exceeds the ceiling."""
    if row is None or not row["kept"]:
        return []
    found = row["sampler_errors"] or [error(row)]
    return [each for each in found if each is not None and math.isfinite(each)]


def ratio(mine: Row | None, theirs: Row | None) -> tuple[float, float] | None:
    """Range of the ratio of errors over all pairs of tunings; None if either has none."""
    own, other = tunings(mine), tunings(theirs)
    return (min(own) / max(other), max(own) / min(other)) if own and other else None


def _range(found: tuple[float, float] | None) -> str:
    if found is None:
        return "–"
    low, high = (short(each) for each in found)
    return low if low == high else f"{low}–{high}"


def over_limit(row: Row) -> float:
    """Steady error over the limit of its setting."""
    return limits.over([metric(row, f"rmse_steady_{axis}") for axis in "xy"], limits.limit(*setting(row)))


def _times(value: float) -> str:
    return f"× {short(value)}" if math.isfinite(value) else "–"


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    if not row["metrics"]:
        return "no trial"
    if row["diverged"]:
        return f"{row['diverged']} diverged"
    marks = (END if row["range_ends"] else "") + (FAILED if None in row["sampler_errors"] else "")
    text = short(UNIT * error(row), 3) + marks
    return text if row["kept"] else f"({text})"


def name_of(name: str) -> str:
    return name.replace("_", " ")


# -- The limit -----------------------------------------------------------------------------------------------


def _nearest(rows: list[Row], at: Setting) -> Values:
    """The contender with the least steady error over the limit; the paper's and PID next to it."""
    here = [row for row in rows if at.holds(row) and row["kept"]]
    found = limits.limit(*at)
    first = min(here, key=lambda row: (over_limit(row), error(row)), default=None)
    if first is None:
        raise ValueError(f"compare-track.json has no contender that kept the ceiling in {at.words}")
    paper, pid = (next((row for row in here if row["name"] == name), None) for name in (PAPER, "pid"))
    chattering = max(metric(first, f"chattering_{axis}") for axis in "xy")
    return {
        "setting": at.words,
        "limit": ", ".join(short(UNIT * each, 3) for each in found.steady) if found else "–",
        "name": name_of(first["name"]),
        "times": _times(over_limit(first)),
        "chattering": short(chattering),
        "paper": _times(over_limit(paper)) if paper else "–",
        "pid": _times(over_limit(pid)) if pid else "–",
    }


def _spans(rows: list[Row], noisy: Sequence[Setting]) -> Values:
    """Over the settings with noise: from where to where the nearest contender and the paper's are from the limit."""
    found = {}
    for key, names in (("nearest", None), ("paper", (PAPER,))):
        least = []
        for at in noisy:
            kept = [r for r in rows if at.holds(r) and r["kept"] and (names is None or r["name"] in names)]
            least.append(min(map(over_limit, kept), default=math.inf))
        finite = [each for each in least if math.isfinite(each)]
        found[key] = interval(min(finite), max(finite)) if finite else "–"
    return {"settings": spelled(len(noisy)), **found}


def _table(rows: list[Row], settings: Sequence[Setting], noisy: Sequence[Setting]) -> Values:
    """Contenders from the smallest errors with noise up: error, steady error over the limit, ratio to the paper's."""
    heads: list[str] = []
    for at in settings:
        words = at.words.partition(", ")[2]
        heads += [words, "over, limit", "over the, paper's"] if at in noisy else [words]
    mine = [at for at in settings if at in noisy]

    def place(name: str) -> tuple[bool, float]:
        found = [row for at in mine if (row := find(rows, name, at)) and row["kept"] and math.isfinite(error(row))]
        return len(found) < len(mine), geometric_mean(map(error, found)) if found else math.inf

    names = sorted({row["name"] for row in rows if row["class"] == settings[0].information}, key=place)
    names, rest = first(names)
    lines = []
    for name in names:
        cells: list[str] = []
        for at in settings:
            row = find(rows, name, at)
            cells.append(_cell(row))
            if at in noisy:
                over = _times(over_limit(row)) if row and row["kept"] else "–"
                cells += [over, "1" if name == PAPER else _range(ratio(row, find(rows, PAPER, at)))]
        last = find(rows, name, settings[-1])
        cost = (last or {}).get("cost") or {}
        lines.append(
            {
                "name": name_of(name),
                "paper": name.startswith(PAPER),
                "cells": cells,
                "ns": short(cost.get("ns_per_step"), 2),
            }
        )
    return {"heads": heads, "rows": lines, "rest": list(map(name_of, rest))}


def first(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """The first names, with those that are always shown, in order; and the others."""
    fixed = [name for name in names if name in ALWAYS]
    found = [name for name in names if name not in ALWAYS][: MOST_ROWS - len(fixed)]
    return [name for name in names if name in (*fixed, *found)], [n for n in names if n not in (*fixed, *found)]


# -- The effort ----------------------------------------------------------------------------------------------


def _published(rows: list[Row], settings: Sequence[Setting]) -> Values:
    """Chattering of the paper's published gains in each kind of sensing."""
    found = {}
    for at in settings:
        row = find(rows, PUBLISHED, at)
        if row is not None and row["metrics"]:
            chattering = max(metric(row, f"chattering_{axis}") for axis in "xy")
            found[f"{at.information}_noisy" if at.noise else f"{at.information}_exact"] = short(chattering)
    known = len(found) == 2 * len(CLASSES)
    return {"known": known, **(found if known else {})}


def spread(row: Row) -> float | None:
    """Ratio of the largest to the smallest error over the tunings of equal effort; infinite if one failed."""
    errors = row["sampler_errors"]
    if len(errors) < 2:
        return None
    return math.inf if None in errors else max(errors) / min(errors)


def _samplers(rows: list[Row]) -> Values:
    spreads = [s for row in rows if (s := spread(row)) is not None]
    finite = [s for s in spreads if math.isfinite(s)]
    seeds = [
        error(row, "high") / error(row, "low") for row in rows if math.isfinite(error(row)) and error(row, "low") > 0
    ]
    return {
        "known": bool(finite),
        "median": short(median(finite), 3) if finite else "–",
        "largest": short(max(finite)) if finite else "–",
        "failed": spelled(len(spreads) - len(finite), "row"),
        "agree": str(sum(s <= 1.05 for s in finite)),
        "all": str(len(spreads)),
        "seeds": short(median(seeds), 3) if seeds else "–",
    }


def _ends(rows: list[Row]) -> Values:
    found = Counter(row["name"] for row in rows if row["range_ends"])
    return {"rows": str(sum(found.values())), "all": str(len([row for row in rows if row["gains"]]))}


def _contained(rows: list[Row], noisy: Sequence[Setting]) -> Values:
    """How often a special case of the paper's law, tuned by itself, has less error than the law as tuned."""
    gains, reached = [], []
    for at in noisy:
        paper = find(rows, PAPER, at)
        found = [each for name in CONTAINED for each in tunings(find(rows, name, at))]
        if paper is None or not found:
            continue
        as_tuned = median(tunings(paper)) if tunings(paper) else math.inf
        gains.append(as_tuned / min(found))
        reached.append(f"{short(UNIT * min(found), 3)} instead of {short(UNIT * as_tuned, 3)}")
    better = [gain for gain in gains if gain > 1.05]  # a difference that a tuning is converged to
    largest = max((gain for gain in better if math.isfinite(gain)), default=1.0)
    return {
        "settings": spelled(len(gains)),
        "better": spelled(len(better)),
        "any": bool(better),
        "largest": short(largest),
        "reached": listed(reached),
    }


# -- Parts of an advantage -----------------------------------------------------------------------------------


def _steps(rows: list[Row], noisy: Sequence[Setting]) -> list[Values]:
    """For each step the range of ratios in each setting; steps of contenders that did not take part are left out."""
    there = {row["name"] for row in rows}
    return [
        {
            "group": step.group,
            "words": step.words,
            "ratios": [
                {"range": _range(found), "decided": found is not None and not found[0] <= 1.0 <= found[1]}
                for found in (ratio(find(rows, step.of, at), find(rows, step.over, at)) for at in noisy)
            ],
        }
        for step in STEPS
        if {step.of, step.over} <= there
    ]


def _verdict(rows: list[Row], noisy: Sequence[Setting]) -> Values:
    """Smaller or larger errors than the paper's: only if decided in all settings of the class."""
    names = list(dict.fromkeys(row["name"] for at in noisy for row in rows if at.holds(row)))
    names = [name for name in names if not name.startswith(PAPER)]
    signs = {n: {_sign(find(rows, n, at), find(rows, PAPER, at)) for at in noisy} for n in names}
    less = [n for n in names if signs[n] == {-1}]
    more = [n for n in names if signs[n] == {1}]
    return {
        "others": spelled(len(names)),
        "sentence": _ranking(less, more, [n for n in names if n not in less and n not in more]),
    }


def _sign(row: Row | None, paper: Row | None) -> int:
    """-1: less error than the paper's controller, by intervals and all tunings; 1: more; 0: undecided. To keep the
    ceiling counts as less error than not to keep it."""
    if row is None or paper is None:
        return 0
    if not row["kept"] or not paper["kept"]:
        return int(paper["kept"]) - int(row["kept"])
    return {"less": -1, "more": 1}.get(row.get("verdict") or "", 0)


def _ranking(less: list[str], more: list[str], open_: list[str]) -> str:
    def group(names: list[str]) -> str:
        return listed([name_of(n) for n in names])

    parts = []
    if less:
        parts.append(f"{spelled(len(less))} {_have(less)} less error than the paper's ({group(less)})")
    if more:
        parts.append(f"{spelled(len(more))} {_have(more)} more error or no gains within a ceiling ({group(more)})")
    if open_:
        parts.append(f"of {spelled(len(open_))} the order depends on the ceiling or is undecided ({group(open_)})")
    return "; ".join(parts) + "."


def _have(names: list[str]) -> str:
    return "has" if len(names) == 1 else "have"


def _flattery(rows: list[Row], settings: Sequence[Setting]) -> Values:
    """Error with noise over that without, by class: the median contender under the loosest common ceiling."""
    found = {}
    for information in CLASSES:
        ends = [[s for s in settings if s.information == information and bool(s.noise) == with_] for with_ in (0, 1)]
        gains = []
        for row in rows:
            if all(ends) and ends[1][-1].holds(row) and row["kept"]:
                exact = find(rows, row["name"], ends[0][-1])
                if exact is not None and exact["kept"]:
                    gains.append(error(row) / error(exact))
        found[information] = short(median(gains)) if gains else "–"
    return found


# -- Frozen gains, elsewhere ---------------------------------------------------------------------------------


def _factor(row: Row | None, condition: str) -> float | None:
    """The error under a condition over that without it; LOST if it lost what it had to follow; None if not run."""
    found = ((row or {}).get("others") or {}).get(condition)
    if found is None:
        return None
    return LOST if found["lost"] or found["value"] is None else float(found["value"])


def _delay(rows: list[Row], noisy: Sequence[Setting]) -> Values:
    """The cost of a hidden delay to those near the limit, and who has the least error with it."""
    near = [
        (row, factor)
        for row in rows
        for at in noisy
        if at.holds(row) and row["kept"] and over_limit(row) <= NEAR
        if (factor := _factor(row, HIDDEN)) is not None
    ]
    worst = max(near, key=lambda pair: pair[1], default=None)
    firsts = []
    for at in noisy:
        here = [(error(row) * f, row) for row in rows if at.holds(row) and row["kept"] if (f := _factor(row, HIDDEN))]
        least = min(here, key=lambda pair: pair[0], default=None)
        if least is not None and math.isfinite(least[0]):
            firsts.append(f"{name_of(least[1]['name'])} ({at.place}: {short(UNIT * least[0], 3)})")
    return {
        "near": spelled(len(near), "result"),
        "any": bool(near),
        "borne": spelled(sum(factor <= BEARS for _, factor in near)),
        "worst": "–" if worst is None else f"{name_of(worst[0]['name'])}, {_lost(worst[1])}",
        "firsts": listed(firsts),
    }


def _lost(factor: float) -> str:
    return f"× {short(factor)}" if math.isfinite(factor) else "lost"


PLANTS = ("K +", "K -5", "D +", "D -", "split", "dxy", "kxy", "rate", "noise")  # changes of the plant and the noise


def _robustness(rows: list[Row], noisy: Sequence[Setting]) -> Values:
    """The hidden delay in each setting; of every other condition the largest of all settings."""
    here = [row for row in rows if row["others"] and any(at.holds(row) for at in noisy)]
    over = {row["name"]: math.inf for row in here}
    for row in here:
        over[row["name"]] = min(over[row["name"]], over_limit(row) if row["kept"] else math.inf)
    shown, _ = first(sorted((n for n, least in over.items() if least <= SHOWN or n in ALWAYS), key=lambda n: over[n]))
    here = [row for row in here if row["name"] in shown]
    there = list(dict.fromkeys(name for row in here for name in row["others"]))
    heads = [name for name in there if not name.startswith(PLANTS) and name != HIDDEN]
    plants = [name for name in there if name.startswith(PLANTS)]

    def place(name: str) -> float:
        found = [factor for at in noisy if (factor := _factor(find(here, name, at), HIDDEN)) is not None]
        return max(found, default=math.inf)

    lines = []
    for name in sorted({row["name"] for row in here}, key=lambda name: (place(name), name)):
        mine = [row for row in here if row["name"] == name]
        delays = [_factor(find(here, name, at), HIDDEN) for at in noisy]
        lines.append(
            {
                "name": name_of(name),
                "paper": name.startswith(PAPER),
                "delays": ["–" if each is None else "lost" if each == LOST else short(each) for each in delays],
                "cells": [_largest(mine, [head]) for head in heads],
                "plants": _largest(mine, plants),
            }
        )
    always = [name_of(name) for name in ALWAYS]
    return {
        "heads": heads,
        "rows": lines,
        "plants": str(len(plants)),
        "within": short(SHOWN, 1),
        "most": str(MOST_ROWS),
        "always": always,
    }


def _largest(rows: list[Row], conditions: Sequence[str]) -> str:
    """The largest factor, or how many were lost."""
    found = [factor for row in rows for name in conditions if (factor := _factor(row, name)) is not None]
    lost = found.count(LOST)
    if not found:
        return "–"
    return f"{lost} lost" if lost else short(max(found))


def _elsewhere(rows: list[Row]) -> list[Values]:
    """Other scenarios: in each setting the contender with the least error, and its ratio to the paper's."""
    found = []
    for scenario in sorted({row.get("scenario", SCENARIO) for row in rows} - {SCENARIO}):
        mine = [row for row in rows if row.get("scenario") == scenario and row["kept"]]
        for at in sorted({setting(row) for row in mine}):
            here = [row for row in mine if at.holds(row)]
            first = min(here, key=error)
            found.append(
                {
                    "scenario": name_of(scenario),
                    "setting": at.words,
                    "name": name_of(first["name"]),
                    "ratio": _range(ratio(first, find(here, PAPER, at))),
                }
            )
    return found
