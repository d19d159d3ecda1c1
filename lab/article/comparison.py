"""The comparison of controllers: tables and sentences, formed from benchmarks/results/compare-*.json."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from words import concise, interval, listed, short, spelled

PAPER, PUBLISHED = "paper", "paper_as_published"
NOISE = 1e-13  # m/sqrt(Hz), the one whose results are put in sentences
END = "†"  # marks a gain at the end of its range
UNIT = 1e6  # errors of tracking are shown in millionths of q0
Row = dict[str, Any]
Values = dict[str, Any]

# Columns of the tables of `rate`: entry of `metrics`, its heading, its unit and the factor to it.
RATE_COLUMNS = {
    "error": ("ARW", "deg/√h", 1.0),
    "equal_motion": ("ARW at equal total motion", "deg/√h", 1.0),
    "over_bound": ("ARW over the bound", "", 1.0),
    "scale_factor_error": ("scale factor", "ppm", 1.0),
    "bias_damping": ("bias by dxy", "deg/h", 1.0),
    "bias_quadrature_hidden": ("bias by quadrature, hidden delay", "deg/h", 1.0),
    "bias_drift": ("bias by drift of K", "deg/h", 1.0),
    "rms_drift": ("RMS by drift of K", "deg/h", 1.0),
    "start_up": ("start-up", "ms", 1.0),
}
MOST_COLUMNS, MOST_TABLES = 9, 2
NOTHING = 0.01  # smaller values, in any of these units, are shown as less than this


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


def error(row: Row, of: str = "value") -> float:
    found = row["metrics"].get("error", {}).get(of)
    return math.inf if found is None else float(found)


def effort(data: dict[str, Any]) -> Values:
    e = data["effort"]
    return {
        **{name: str(e[name]) for name in ("trials", "seeds", "held_out", "few")},
        "samplers": spelled(e["samplers"]),
        "quick": bool(e["quick"]),
        "version": data["version"],
    }


# -- track ---------------------------------------------------------------------------------------------------


def track(data: dict[str, Any]) -> Values:
    rows = of_paper(data["contenders"])
    if not any(row["name"] == PAPER for row in rows):
        raise ValueError(f"compare-track.json has no contender {PAPER}, to which all others are compared")
    ceilings = sorted({float(row["ceiling"]) for row in rows})
    classes = sorted({row["class"] for row in rows})
    noises = sorted({float(row["noise"]) for row in rows})
    if classes != ["F", "P"]:
        raise ValueError(f"compare-track.json has the classes {listed(classes)}: F and P are needed")
    return {
        "effort": effort(data),
        "contenders": spelled(len({row["name"] for row in rows})),
        "ceilings": [short(c) for c in ceilings],
        "noises": [short(n) if n else "0" for n in noises],
        "tables": {c: _track_table([row for row in rows if row["class"] == c], noises, ceilings) for c in classes},
        "robustness": _robustness(rows, noises[-1]),
        "samplers": _samplers(rows),
        "ceiling": _of_ceiling(rows, ceilings),
        "ends": _ends(rows),
        "classes": classes,
        "variants": _variants(rows, classes, noises[-1], ceilings),
        "verdicts": {c: _verdict(rows, c, noises[-1], ceilings) for c in classes},
        "flattery": _flattery(rows, noises, ceilings[-1]),
    }


def of_paper(rows: list[Row]) -> list[Row]:
    """The rows of the paper's device, which is the first, under the ceilings that all sensing has."""
    here = [row for row in rows if row.get("scenario") == rows[0].get("scenario")]
    by_sensing: dict[tuple[str, float], set[float]] = {}
    for row in here:
        by_sensing.setdefault((row["class"], float(row["noise"])), set()).add(float(row["ceiling"]))
    common = set.intersection(*by_sensing.values()) if by_sensing else set()
    return [row for row in here if float(row["ceiling"]) in common]


def cell(rows: Iterable[Row], **of: Any) -> Row | None:
    """The one row with these values."""
    return next((row for row in rows if of.items() <= row.items()), None)


def _track_table(rows: list[Row], noises: Sequence[float], ceilings: Sequence[float]) -> list[Values]:
    """Contenders from the least error with noise under the looser ceiling down."""
    names = list(dict.fromkeys(row["name"] for row in rows))

    def place(name: str) -> tuple[bool, float]:
        row = cell(rows, name=name, noise=noises[-1], ceiling=ceilings[-1])
        return row is None or not row["kept"], math.inf if row is None else error(row)

    lines = []
    for name in sorted(names, key=place):
        last = cell(rows, name=name, noise=noises[-1], ceiling=ceilings[-1])
        ratio, cost = (last or {}).get("ratio") or {}, (last or {}).get("cost") or {}
        lines.append(
            {
                "name": name.replace("_", " "),
                "paper": name.startswith(PAPER),
                "cells": [_cell(cell(rows, name=name, noise=n, ceiling=c)) for n in noises for c in ceilings],
                "ratio": "–" if ratio.get("value") is None else f"{short(ratio['value'])} ({_within(ratio)})",
                "spread": _times(spread(last)) if last else "–",
                "ns": short(cost.get("ns_per_step"), 2),
            }
        )
    return lines


def _within(found: dict[str, Any]) -> str:
    """An end that a search without a result leaves open is infinite, or 0."""
    low, high = found["low"], found["high"]
    return interval(0.0 if low is None else low, math.inf if high is None else high)


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    if not row["metrics"]:
        return "no trial"
    if row["diverged"]:
        return f"{row['diverged']} diverged"
    text = short(UNIT * error(row), 3) + (END if row["range_ends"] else "")
    return text if row["kept"] else f"({text})"


def spread(row: Row) -> float | None:
    """Ratio of the largest to the smallest error over the samplers' tunings of equal effort; infinite if one failed."""
    errors = row["sampler_errors"]
    if len(errors) < 2:
        return None
    return math.inf if None in errors else max(errors) / min(errors)


def _times(value: float | None) -> str:
    if value is None:
        return "–"
    return "one failed" if math.isinf(value) else f"× {short(value)}"


def _samplers(rows: list[Row]) -> Values:
    spreads = [s for row in rows if (s := spread(row)) is not None]
    finite = [s for s in spreads if math.isfinite(s)]
    seeds = [
        error(row, "high") / error(row, "low") for row in rows if math.isfinite(error(row)) and error(row, "low") > 0
    ]
    widest = max(finite, default=None)
    return {
        "known": bool(finite),
        "median": short(median(finite)) if finite else "–",
        "largest": short(widest) if widest else "–",
        "failed": spelled(len(spreads) - len(finite), "row"),
        "seeds": short(median(seeds), 3) if seeds else "–",
    }


def _of_ceiling(rows: list[Row], ceilings: Sequence[float]) -> Values:
    """How much less error the looser ceiling allows."""
    gains = []
    for row in rows:
        if row["ceiling"] == ceilings[0] and row["kept"] and row["gains"]:
            loose = cell(rows, **{k: row[k] for k in ("name", "class", "noise")}, ceiling=ceilings[-1])
            if loose and loose["kept"]:
                gains.append(error(row) / error(loose))
    return {"median": short(median(gains)) if gains else "–", "largest": short(max(gains)) if gains else "–"}


def _ends(rows: list[Row]) -> Values:
    found = Counter(row["name"] for row in rows if row["range_ends"])
    return {"rows": str(sum(found.values())), "all": str(len([row for row in rows if row["gains"]]))}


def _flattery(rows: list[Row], noises: Sequence[float], ceiling: float) -> Values:
    """How many times larger the error is with noise than without, by class: the median contender."""
    found = {}
    for information in sorted({row["class"] for row in rows}):
        gains = []
        for row in rows:
            if (row["class"], row["noise"], row["ceiling"]) == (information, noises[-1], ceiling) and row["kept"]:
                exact = cell(rows, name=row["name"], **{"class": information}, noise=noises[0], ceiling=ceiling)
                if exact and exact["kept"]:
                    gains.append(error(row) / error(exact))
        found[information] = short(median(gains)) if gains else "–"
    return found


def _conditions(rows: list[Row]) -> list[str]:
    """Conditions other than a changed plant or noise, in the order of the file."""
    plants = ("K +", "K -5", "D +", "D -", "split", "dxy", "kxy", "rate", "noise")
    return [name for name in rows[0]["others"] if not name.startswith(plants)]


def _robustness(rows: list[Row], noise: float) -> Values:
    """The error under each condition over that without it: the largest of all classes and ceilings."""
    here = [row for row in rows if row["noise"] == noise and row["others"]]
    heads = _conditions(here)
    plants = [name for name in here[0]["others"] if name not in heads]
    lines = []
    for name in dict.fromkeys(row["name"] for row in sorted(here, key=lambda row: (row["class"] != "P", error(row)))):
        mine = [row["others"] for row in here if row["name"] == name]
        lines.append(
            {
                "name": name.replace("_", " "),
                "paper": name.startswith(PAPER),
                "cells": [_changed([others[head] for others in mine]) for head in heads],
                "plants": _changed([others[plant] for others in mine for plant in plants]),
            }
        )
    return {"heads": heads, "rows": lines, "plants": str(len(plants))}


def _changed(found: list[Values]) -> str:
    """The largest ratio, or in how many there is none."""
    lost = sum(each["lost"] > 0 for each in found)
    return f"lost in {lost}" if lost else short(max(each["value"] for each in found))


def _verdict(rows: list[Row], information: str, noise: float, ceilings: Sequence[float]) -> Values:
    """Who is better than the paper's controller, who worse: only where that is decided under both ceilings."""
    here = [row for row in rows if row["class"] == information and row["noise"] == noise]
    names = [n for n in dict.fromkeys(row["name"] for row in here) if not n.startswith(PAPER)]
    pairs = {n: [cell(here, name=n, ceiling=c) for c in (ceilings[0], ceilings[-1])] for n in names}
    papers = [cell(here, name=PAPER, ceiling=c) for c in (ceilings[0], ceilings[-1])]
    better = [n for n, both in pairs.items() if all(_sign(*pair) < 0 for pair in zip(both, papers, strict=True))]
    worse = [n for n, both in pairs.items() if all(_sign(*pair) > 0 for pair in zip(both, papers, strict=True))]
    open_ = [n for n in names if n not in better and n not in worse]
    best = {}
    for c in ceilings:
        kept = [row for row in here if row["ceiling"] == c and row["kept"]]
        first = min(kept, key=error, default=None)
        if first:
            best[short(c)] = {
                "words": first["words"],
                "error": short(UNIT * error(first), 3),
                "interval": interval(UNIT * error(first, "low"), UNIT * error(first, "high"), 3),
            }
    if not best:
        raise ValueError(f"compare-track.json has no contender of class {information} that kept a ceiling")
    return {
        "others": spelled(len(names)),
        "sentence": _ranking(better, worse, open_),
        "best": [{"ceiling": c, **found} for c, found in best.items()],
        "papers": [
            {"ceiling": short(c), "error": _cell(row).replace(END, "")}
            for c, row in zip(ceilings, (cell(here, name=PAPER, ceiling=c) for c in ceilings), strict=True)
            if row
        ],
    }


def _sign(row: Row | None, paper: Row | None) -> int:
    """-1: less error than the paper's controller, by all pairs of searches; 1: more; 0: undecided. To keep the
    ceiling counts as less error than not to keep it."""
    if row is None or paper is None:
        return 0
    if not row["kept"] or not paper["kept"]:
        return int(paper["kept"]) - int(row["kept"])
    return {"less": -1, "more": 1}.get(row["verdict"] or "", 0)


def _ranking(better: list[str], worse: list[str], open_: list[str]) -> str:
    def group(names: list[str]) -> str:
        return listed([n.replace("_", " ") for n in names])

    parts = []
    if better:
        parts.append(f"{spelled(len(better))} {_have(better)} less error than the paper's ({group(better)})")
    if worse:
        parts.append(f"{spelled(len(worse))} {_have(worse)} more error or no gains within a ceiling ({group(worse)})")
    if open_:
        parts.append(f"of {spelled(len(open_))} the order depends on the ceiling or is undecided ({group(open_)})")
    return "; ".join(parts) + "."


def _have(names: list[str]) -> str:
    return "has" if len(names) == 1 else "have"


def _variants(rows: list[Row], classes: Sequence[str], noise: float, ceilings: Sequence[float]) -> list[Values]:
    """The paper's controller with parts left out or exchanged: the error over its own, for classes and ceilings."""
    here = [row for row in rows if row["noise"] == noise and row["name"].startswith(f"{PAPER}_")]
    return [
        {
            "words": next(row["words"] for row in here if row["name"] == name),
            "ratios": [_ratio(cell(here, name=name, **{"class": c}, ceiling=at)) for c in classes for at in ceilings],
        }
        for name in dict.fromkeys(row["name"] for row in here)
    ]


def _ratio(row: Row | None) -> str:
    if row is None or not row["kept"]:
        return "–"
    ratio = row["ratio"] or {}
    return "–" if ratio.get("value") is None else f"{short(ratio['value'])} ({_within(ratio)})"


# -- rate ----------------------------------------------------------------------------------------------------


def rate(data: dict[str, Any]) -> Values:
    rows: list[Row] = data["contenders"]
    columns = _columns(rows)
    cells = sorted({_place(row) for row in rows}, key=lambda of: (of[2] != NOISE, of[1] != "P", of))
    shown = cells[:MOST_TABLES]
    tables = [_rate_table(of, [row for row in rows if _place(row) == of], columns) for of in shown]
    return {
        "effort": effort(data),
        "contenders": spelled(len({row["name"] for row in rows})),
        "heads": [", ".join(filter(None, _of_column(name)[:2])) for name in columns],
        "tables": tables,
        "others": spelled(len(cells) - len(shown), "further setting"),
        "industry": _industry([row for row in rows if row["class"] == "P" and row["noise"] == NOISE]),
    }


REBALANCE, FILTER, CLASSICAL = "force_rebalance", "lqg", "park_horowitz"


def _industry(rows: list[Row]) -> Values:
    """Force rebalance, the joint filter and Park and Horowitz's control; `known`: all three keep the limits."""
    by_name = {row["name"]: row for row in rows if row["kept"]}
    if not {REBALANCE, FILTER, CLASSICAL} <= by_name.keys():
        return {"known": False}

    def of(name: str, metric: str, digits: int = 2) -> str:
        return short((by_name[name]["metrics"].get(metric) or {}).get("value"), digits)

    ratio = by_name[FILTER]["ratio"]
    return {
        "known": True,
        "ratio": f"{short(ratio['value'])} ({_within(ratio)})",
        "paper": PAPER in by_name,
        **{
            f"{key}_{metric}": of(name, metric)
            for key, name in (("rebalance", REBALANCE), ("filter", FILTER), ("classical", CLASSICAL))
            for metric in RATE_COLUMNS
        },
        "motion": {name: _rate_cell(by_name[name], "equal_motion") for name in (REBALANCE, FILTER)},
        "stiffness": {name: short(by_name[name]["others"]["K +5 %"]["value"]) for name in (FILTER, CLASSICAL)},
    }


def _columns(rows: list[Row]) -> list[str]:
    """The RATE_COLUMNS that any row has; without any, all metrics of the rows."""
    there = list(dict.fromkeys(name for row in rows for name in row["metrics"]))
    if not there:
        raise ValueError("compare-rate.json has no metrics")
    return ([name for name in RATE_COLUMNS if name in there] or there)[:MOST_COLUMNS]


def _place(row: Row) -> tuple[str, str, float, float]:
    return row.get("scenario", ""), row["class"], float(row["noise"] or 0), float(row["ceiling"] or 0)


def _rate_table(of: tuple[str, str, float, float], rows: list[Row], columns: list[str]) -> Values:
    first = columns[0]
    ordered = sorted((row for row in rows if row["kept"]), key=lambda row: _size(row, first))
    return {
        "scenario": of[0].replace("_", " "),
        "class": of[1],
        "noise": short(of[2]) if of[2] else "0",
        "rows": [
            {
                "name": row["name"].replace("_", " "),
                "paper": row["name"].startswith(PAPER),
                "cells": [_rate_cell(row, name) for name in columns],
            }
            for row in ordered
        ],
        "outside": [row["name"].replace("_", " ") for row in rows if not row["kept"]],
    }


def _of_column(name: str) -> tuple[str, str, float]:
    """Words, unit, factor; of what RATE_COLUMNS lacks the name."""
    return RATE_COLUMNS.get(name, (name.replace("_", " "), "", 1.0))


def _rate_cell(row: Row, name: str) -> str:
    if row["diverged"]:
        return f"{row['diverged']} diverged"
    found, factor = row["metrics"].get(name) or {}, _of_column(name)[2]
    if found.get("value") is None:
        return "–"
    if found.get("low") is None or found.get("high") is None:
        return short(factor * found["value"], 3)
    if max(abs(found["low"]), abs(found["high"])) < NOTHING:
        return f"< {NOTHING:g}"
    return concise(factor * found["value"], factor * abs(found["high"] - found["low"]) / 2)


def _size(row: Row, name: str) -> float:
    value = (row["metrics"].get(name) or {}).get("value")
    return math.inf if value is None else abs(value)
