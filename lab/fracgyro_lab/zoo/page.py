"""The report of the zoo as HTML and Markdown, and a trace of an error in block characters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fracgyro.analysis.html import page
from fracgyro.files import whole_file

from ..board.chart import trace
from ..comparison.report import limit_row, number, times
from ..comparison.track import LOW
from ..verdicts import HELD
from .facts import SEEN_WORDS, entries
from .laws import HOUSE, NOISE
from .result import CONDITIONS, Zoo

TRACES = 1e-6, 1.0  # range of all traces
BLOCKS = "▁▂▃▄▅▆▇█"
WIDTH = 24
HEADS = (
    "Law",
    "Error over time",
    "Error in noise",
    "over the limit",
    "Error without noise",
    "over the limit",
    "Chattering",
    "Settling time",
    "Hidden delay",
    "12 bit",
    "0.7 of the force",
    "Drift",
    "Operations",
    "Bytes",
    "Claims: held, failed, untestable",
)
BEYOND = "\nabove the ceiling"  # the ceiling of chattering
Row = dict[str, Any]


def blocks(errors: Sequence[float | None], width: int = WIDTH) -> str:
    """The trace of an error in `width` block characters, logarithmic from 1e-6 to 1; blank after a divergence."""
    low, high = map(math.log10, TRACES)
    found = ""
    for place in range(width):
        part = errors[place * len(errors) // width : (place + 1) * len(errors) // width]
        known = [each for each in part if each is not None]
        if not known:
            found += " "
            continue
        share = (math.log10(max(*known, 1e-30, TRACES[0])) - low) / (high - low)
        found += BLOCKS[min(round(share * (len(BLOCKS) - 1)), len(BLOCKS) - 1)]
    return found


def rows_of(zoo: Zoo) -> list[Row]:
    """The rows of the table: the limit, the laws of the house, and the entries by year."""
    return [*_house(zoo), *(_entry(zoo, name, entry) for name, entry in zoo.entries.items())]


def _house(zoo: Zoo) -> Iterator[Row]:
    like = next((law["noise"] for law in zoo.laws.values() if law["noise"]), None)
    quiet = next((law["none"] for law in zoo.laws.values() if law["none"]), None)
    limits = [limit_row(zoo.limits, row) if row else None for row in (like, quiet)]
    errors = [power(limit["metrics"].get("error", {}).get("value")) if limit else "–" for limit in limits]
    if any(limits):
        cells = [errors[0], "1", errors[1], "1", *["–"] * (len(HEADS) - 6)]
        yield _row("the least error of any controller", "limit", [], cells)
    for name in HOUSE:
        if name in zoo.laws:
            law = zoo.laws[name]
            yield _row(law["words"], name, law["trace"], [*_numbers(law), "–"])


def _entry(zoo: Zoo, name: str, entry: Mapping[str, Any]) -> Row:
    law = zoo.laws[entry["law"]]
    held = sum(claim["verdict"] == HELD for claim in entry["claims"])
    tally = f"{held}, {len(entry['claims']) - held}, {len(entry['untestable'])}"
    errata = f", {entry['errata']} errata" if entry["errata"] else ""
    only = ", positions only" if entry["information"] == "P" else ""
    about = f"{name}, {SEEN_WORDS[entry['seen']]}{errata}{only}"
    found = _row(entry["words"], about, law["trace"], [*_numbers(law), tally])
    return found | {"year": entry["year"], "doi": entry["doi"], "reduces_to": entry["reduces_to"]}


def _row(words: str, about: str, errors: Sequence[float | None], cells: list[str]) -> Row:
    picture = trace(errors, *TRACES) if errors else ""
    given = {"words": words, "about": about, "trace": errors, "picture": picture, "cells": cells}
    return {"year": None, "doi": "", "reduces_to": "", **given}


def _numbers(law: Mapping[str, Any]) -> list[str]:
    noisy, exact = law["noise"], law["none"]
    metrics = (noisy or {}).get("metrics", {})
    chattering = [metrics.get(f"chattering_{axis}", {}).get("value") for axis in "xy"]
    known = [each for each in chattering if each is not None]
    changed = (noisy or {}).get("others", {})
    return [
        *_error(noisy),
        *_error(exact),
        number(max(known) if known else None, 2),
        number(metrics.get("error_settling_time", {}).get("value"), 2),
        *(times(changed[name]) if name in changed else "–" for name in CONDITIONS),
        _growth(law["drift"]),
        str(law["operations"] if law["operations"] is not None else "–"),
        str(law["bytes"] if law["bytes"] is not None else "–"),
    ]


def _growth(norms: Sequence[float] | None) -> str:
    """Growth of the norm over the second half of the run."""
    if norms is None or 0.0 in norms[1:2]:
        return "–"
    return f"{norms[2] / norms[1]:.3g}" if norms else "lost"


def _error(row: Mapping[str, Any] | None) -> tuple[str, str]:
    """The error with its interval on a second line, and its ratio to the limit."""
    found = (row or {}).get("metrics", {}).get("error")
    if row is None or not found or found["value"] is None:
        return "–", "–"
    low, value, high = (power(found[name]) for name in ("low", "value", "high"))
    mark = "" if row["kept"] else BEYOND
    return f"{value}\n{low} to {high}{mark}", number((row["over_limit"] or {}).get("error"))


def power(value: float | None) -> str:
    """Three digits and, below 0.01, a power of ten."""
    if value is None:
        return "–"
    return number(value) if value >= 0.01 else f"{value:.2e}".replace("e-0", "e-").replace("-", "\N{MINUS SIGN}")


def findings(zoo: Zoo) -> list[str]:
    """The verdict in plain sentences, from the numbers of this report."""
    claims = [claim for entry in zoo.entries.values() for claim in entry["claims"]]
    held = sum(claim["verdict"] == HELD for claim in claims)
    untestable = sum(len(entry["untestable"]) for entry in zoo.entries.values())
    found = [
        f"Of {len(claims)} verdicts on claims of {len(zoo.entries)} papers {held} are “reproduced”; {untestable} "
        "further claims cannot be tested here."
    ]
    ranked = [(law, _value(law)) for law in zoo.laws.values() if _value(law) is not None]
    published = {entry["law"] for entry in zoo.entries.values()}
    best = min((pair for pair in ranked if pair[0]["name"] in published), key=lambda pair: pair[1] or 0.0, default=None)
    lqg = _value(zoo.laws["lqg"]) if "lqg" in zoo.laws else None
    if best and best[1] and lqg:
        found.append(
            f"In noise the published law with the least error is {best[0]['words']} ({best[0]['name']}), with "
            f"{best[1] / lqg:.2f} times the error of LQG on the joint Kalman filter."
        )
    network = next((switch for switch in zoo.switches if switch["having"] == "network"), None)
    if network and network["noise"]:
        found.append(
            "Sixteen Gaussian nodes instead of one constant node, which is an integral, change the error in noise by a "
            f"factor of {triple(network['noise'])}."
        )
    return found


def _value(law: Mapping[str, Any]) -> float | None:
    row = law["noise"]
    if row is None or not row["kept"]:
        return None
    value: float | None = row["metrics"]["error"]["value"]
    return value


def triple(found: Sequence[float | None] | None) -> str:
    """A ratio with its interval, whose end is open for None."""
    if found is None:
        return "–"
    value, low, high = ("–" if each is None else format(each, ".2f") for each in found)
    return f"{value} [{low}, {high}]"


def rms(value: float | None) -> str:
    """A published error, or that control is lost."""
    return "lost" if value is None else f"{value:.4f}"


def leaves(value: float | None) -> str:
    """The time at which a bound is left."""
    return "–" if value is None else f"{value:.2f}"


def capitalize_first(text: str) -> str:
    return text[:1].upper() + text[1:]


FILTERS: dict[str, Callable[..., str]] = {
    "triple": triple,
    "rms": rms,
    "leaves": leaves,
    "capitalize_first": capitalize_first,
}


def write_report(folder: Path, zoo: Zoo) -> None:
    """Writes report.html and report.md into the folder."""
    known = entries()
    judged = [
        {**entry, "heading": known[name].heading(own_numbers=bool(known[name].run))}
        for name, entry in zoo.entries.items()
        if entry["claims"] or entry["untestable"]
    ]
    text = page(
        "fracgyro_lab.zoo",
        "zoo.html.jinja",
        filters=FILTERS,
        version=version("fracgyro"),
        effort=zoo.effort,
        heads=HEADS,
        rows=rows_of(zoo),
        judged=judged,
        switches=zoo.switches,
        printed=zoo.printed,
        findings=findings(zoo),
        noise=f"{NOISE:g}",
        ceiling=LOW,
    )
    for name, content in (("report.html", text), ("report.md", "\n".join(markdown(zoo)) + "\n")):
        with whole_file(folder / name) as scratch:
            scratch.write_text(content, encoding="utf-8", newline="\n")


def markdown(zoo: Zoo) -> list[str]:
    """The tables of the report as lines of Markdown."""
    lines = ["# The zoo", "", *(line for sentence in findings(zoo) for line in (sentence, "")), "## Laws", ""]
    lines += table(
        ("year", *HEADS),
        (
            (str(row["year"] or "–"), f"{row['words']} ({row['about']})", f"`{blocks(row['trace'])}`", *row["cells"])
            for row in rows_of(zoo)
        ),
    )
    lines += ["", "## Claims", ""]
    lines += table(
        ("entry", "claim", "variant", "verdict", "evidence"),
        (
            (name, claim["claim"], claim["variant"], claim["verdict"], claim["evidence"])
            for name, entry in zoo.entries.items()
            for claim in entry["claims"]
        ),
    )
    lines += ["", "## What each part of a law buys", ""]
    lines += table(
        ("part", "error with it over that without, in noise", "without noise"),
        ((switch["words"], triple(switch["noise"]), triple(switch["none"])) for switch in zoo.switches),
    )
    for name, variants in zoo.printed.items():
        lines += ["", f"## Published runs of {name}", ""]
        lines += table(
            ("run", "variant", "RMS x", "RMS y", "largest share of the bound", "leaves it at"),
            (
                (run, variant, *map(rms, found["rms"]), f"{found['share']:.2f}", leaves(found["leaves"]))
                for variant, runs in variants.items()
                for run, found in runs.items()
            ),
        )
    return lines


def table(heads: Sequence[str], rows: Iterator[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown."""
    shown = [[_one_line(cell.replace("|", "\\|")) for cell in row] for row in rows]
    heads = [head.replace("|", "\\|") for head in heads]
    return [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *(f"| {' | '.join(row)} |" for row in shown)]


def _one_line(cell: str) -> str:
    first, *others = cell.split("\n")
    return f"{first} ({', '.join(others)})" if others else first
