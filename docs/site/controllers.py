"""A page for each controller: law, when to use it, parameters, cost, picture.

Its words are the comment at the head of the controller's header, its parameters those of fields(), its cost is from the
logs.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
from comments import address, comment_of
from formulas import latex
from fracgyro.scenario.kinds import KINDS, MEANINGS, numbers, reports
from fracgyro.scenario.reference import fields_of_kind, rows_of
from fracgyro.scenario.table import toml_value
from fracgyro_lab.comparison import rate_contenders, track_contenders
from picture import SETUPS, closed_loop, pictures

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))
import logs
import page_numbers

MARK = "<!-- controllers -->"  # place of the overview in a page of the site
SENSING = (page_numbers.BOTH, page_numbers.ONLY)
NOT_FOLLOWED = "With those of the paper's scenario it does not follow the paper's reference."
ARW = "angle random walk, deg/√h (95 %)"


# -- Parameters --------------------------------------------------------------------------------------------------------

GREEK = {"alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ"}
GREEK |= {"lambda": "λ", "mu": "μ", "rho": "ρ", "omega": "ω", "Omega": "Ω", "Gamma": "Γ", "Delta": "Δ"}
NAME = rf"(?:{'|'.join(GREEK)}|[A-Za-z])(?:_\w|\d)?"
SYMBOL = re.compile(rf"({NAME}(?: \[x, y\])?|\[{NAME}(?:, {NAME})*\])(?=[,:] | at )")
RANGE = r"unit [^,:]+|no unit|[<>]=? \S+|\S+ to \S+|strictly between \S+ and \S+"
CLAUSES = re.compile(rf"(?:{RANGE})(?:, (?:{RANGE}))*: ", re.IGNORECASE)


def parameters(kind: str) -> Iterator[tuple[str, ...]]:
    """Rows of docs/reference.md in four columns, which fit a telephone; symbols as formulas."""
    for name, unit, limits, default, meaning in fields_of_kind(kind):
        symbol = SYMBOL.match(meaning)
        rest = meaning[symbol.end() :].removeprefix(",").lstrip(" :") if symbol else meaning
        rest = CLAUSES.sub("", rest, count=1) if CLAUSES.match(rest) else rest
        allowed = limits if unit == "–" else f"{limits}, in {', '.join(map(_formula, unit.split(', ')))}"
        yield name, allowed, default, (f"{_formula(symbol[1])}: " if symbol else "") + _greek(rest)


def _formula(text: str) -> str:
    indexed = re.sub(r"([A-Za-z])([0-9])", r"\1_\2", _greek(text))
    return f"{{math}}`{latex(indexed)}`"


def _greek(text: str) -> str:
    """The text with Greek letters and indices, outside of code: lambda1 is λ₁."""

    def letter(found: re.Match[str]) -> str:
        digits = "".join(chr(ord("₀") + int(each)) for each in found[2] or "")
        return GREEK.get(found[1], found[1]) + digits

    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [re.sub(rf"\b({'|'.join(GREEK)}|q)(\d*)(?![A-Za-z])", letter, part) for part in parts[::2]]
    return "".join(parts)


# -- Cost --------------------------------------------------------------------------------------------------------------


def adaptations(kind: str) -> tuple[str, ...]:
    """Possible values of adaptation.kind; the empty string for a kind that does not have it."""
    return next((number.choices for number in numbers(kind) if number.path == "adaptation.kind"), ("",))


def variant(kind: str, adaptation: str) -> dict[str, object]:
    return {"controller.kind": kind} | ({"adaptation.kind": adaptation} if adaptation else {})


def velocity(kind: str, adaptation: str) -> str:
    """Source of the velocity if only positions are measured, found by short runs."""
    base = fg.Scenario.paper().replace({**variant(kind, adaptation), "run.duration": 0.1})
    positions = base.replace({"device.sensing": "position"})
    slower = positions.replace({"controller.observer_bandwidth": 0.5 * positions.controller.observer_bandwidth})
    full, only, other = (fg.simulate(each)["control"].values for each in (base, positions, slower))
    if np.array_equal(full, only):
        return "not used"
    return "estimated by its own filter" if np.array_equal(only, other) else "estimated by the observer"


def _cost(kind: str, adaptation: str) -> Iterator[str]:
    """Operations and bytes with either sensing, if the log has them."""
    for column in ("flops", "state, bytes"):
        cells = {row["measured"]: row[column] for row in logs.rows("flops", column) if _is(row, kind, adaptation)}
        both, only = (cells.get(sensing, "") for sensing in SENSING)
        yield f"{both}, from positions {only}" if both else only or "–"


def _is(row: logs.Row, kind: str, adaptation: str) -> bool:
    return (row["controller"], row["adaptation"]) == (f"`{kind}`", adaptation or "–")


def properties(kind: str) -> Iterator[str]:
    senses = all(any(each.name == "rate_estimate" for each in channels) for channels in reports(kind))
    yield f"{'It estimates' if senses else 'It does not estimate'} the angular rate."
    yield ""
    rows = [(f"`{each}`", velocity(kind, each), *_cost(kind, each)) for each in adaptations(kind)]
    heads = ["`adaptation.kind`", "velocity, from positions", "operations of a step", "state, bytes"]
    skip = 1 if adaptations(kind) == ("",) else 0
    yield from rows_of(heads[skip:], [row[skip:] for row in rows])
    if any(row[2] != "–" for row in rows):
        yield from ["Operations and bytes are from this [log](../measured/flops.md).", ""]
    yield from _compared(kind)


def _compared(kind: str) -> Iterator[str]:
    """Its places in the logs of both comparisons."""
    tracking = [
        (f"`{each.name}`: {each.words}", *cells)
        for each in track_contenders.CONTENDERS
        if each.fixed.get("controller.kind") == kind and set(cells := _tracked(each.name)) != {"–"}
    ]
    rows = {
        row["contender"]: row[ARW] for row in logs.rows("compare_rate", ARW) if row["section"] == page_numbers.SENSED
    }
    sensing = [
        (f"`{each.name}`: {each.words}", "no gains found" if rows[each.name] == "–" else rows[each.name])
        for each in rate_contenders.CONTENDERS
        if each.fixed.get("controller.kind") == kind and each.name in rows
    ]
    if tracking or sensing:
        yield from ["## In the comparison", "", "[Which controller?](../how-to/compare.md) has rules and words.", ""]
    if tracking:
        heads = [f"{information}, chattering ≤ {ceiling}" for information, ceiling in page_numbers.TRACKED]
        yield from rows_of(["error with noise, over that of the tuned paper's controller", *heads], tracking)
    if sensing:
        yield from rows_of(["as a rate sensor with noise", ARW], sensing)


def _tracked(contender: str) -> list[str]:
    wanted = {page_numbers.section(*place): "–" for place in page_numbers.TRACKED}
    for row in logs.rows("compare_track", "decided"):
        if row["contender"] == contender and row["section"] in wanted:
            ratio = row["over the paper's (95 %)"]
            wanted[row["section"]] = f"{ratio.split()[0]}, undecided" if row["decided"] == "undecided" else ratio
    return list(wanted.values())


# -- Pages -------------------------------------------------------------------------------------------------------------


def page(kind: str) -> tuple[str, dict[str, str]]:
    """The page in Markdown, and its pictures: file names in pictures/ and SVG."""
    comment, header = comment_of(kind)
    place, run = closed_loop(kind)
    name, scenario, changes = SETUPS[place]
    lines = [f"# {comment.name}", "", f"{comment.what} {comment.use}", ""]
    drawn = {}
    for i, (shown, text) in enumerate(pictures(run, comment.name)):
        drawn[f"controller-{kind}-{i}.svg"] = text
        lines.append(f"![{shown} over time](/pictures/controller-{kind}-{i}.svg)")
    lines += ["", f"A run of {scenario}, with its gains." + (f" {NOT_FOLLOWED}" if place else ""), ""]
    lines += ["## Use it", "", "```sh", *_commands(kind, name, changes), "```", ""]
    lines += ["## The law", "", *(line for each in comment.law for line in (each, "")), comment.source, ""]
    lines += ["Numbers in parentheses are the paper's; [equations](../understand/equations.md) has all with their"]
    lines += [f"symbols. The code is in [`{header.name}`]({address(header)}).", "", "## Parameters", ""]
    lines += rows_of(("field", "range and unit", "default", "meaning"), parameters(kind))
    lines += ["The [reference](../reference/scenario.md) has the fields that all controllers share.", ""]
    lines += ["## What it measures and costs", "", *properties(kind)]
    return "\n".join(lines), drawn


def _commands(kind: str, scenario: str, changes: Mapping[str, Any]) -> Iterator[str]:
    """Commands that run the setup of the picture: the paper's is the default."""
    if scenario != "paper":
        yield f"fracgyro scenario {scenario} > device.toml"
    sets = [f"--set controller.kind={kind}"] + [
        f"--set '{name}={toml_value(value)}'" for name, value in changes.items() if name != "run.duration"
    ]
    yield " ".join(["fracgyro simulate", *(["device.toml"] if scenario != "paper" else []), *sets, "--plot run.svg"])


def overview() -> str:
    """A table of all kinds, with links to their pages."""
    rows = []
    for kind, meaning in zip(KINDS, MEANINGS, strict=True):
        senses = any(each.name == "rate_estimate" for each in reports(kind)[0])
        rows.append((f"[`{kind}`](../controllers/{kind}.md)", _greek(meaning), "yes" if senses else "no"))
    return "\n".join(rows_of(("`controller.kind`", "what it is", "estimates the rate"), rows))
