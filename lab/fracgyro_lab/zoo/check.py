"""Checks of an entry, and the skeleton of a new one."""

from __future__ import annotations

from collections.abc import Iterator

from .criteria import CRITERIA
from .facts import OURS, READ, Facts
from .laws import contender_of
from .printed import SWITCHES

SKELETON = """# An entry of the zoo. `fracgyro zoo check FILE` reports what is missing.

# The DOI of the paper; "" if it has none.
doi = "{doi}"
title = ""
year = {year}
# The parts of the paper that were read: code, text, abstract or citation (from memory). Only with code or text, and
# with a source for each number below, a result may be called "as published".
seen = "abstract"
# The law in a line.
words = ""
# The contender of `fracgyro compare track` with the law's kind and the ranges of its gains.
contender = "pid"
# F: positions and velocities are measured; P: positions only.
information = "F"
# The plant of the paper, of plants.toml: paper or second.
plant = "paper"
# The simplest law that this one equals nearly; "" if unknown.
reduces_to = ""
# A sentence for the report; "" for none.
remark = ""

# Fields of a scenario that differ from those of the contender, as "controller.kind" = "pid".
[law]

# An equation by its number, the place of the code that evaluates it, and where it was read.
#[[equation]]
#number = "(13)"
#is = "file.hpp::Name"
#from = "page 4"

# Each number as printed, with its unit ("" if the paper prints no unit) and where it is; without `from` it is ours.
#[given]
#mass = {{ value = 1.8e-7, unit = "kg", from = "page 7" }}

# An error of the paper, as printed and as corrected, and the switch between them.
#[[erratum]]
#id = "a_name"
#printed = ""
#corrected = ""
#switch = ""
#effect = ""

# A claim in your words. criterion: one of {criteria};
# without it the claim is listed as not testable.
[[claim]]
text = ""
criterion = ""
metric = ""
from = "abstract"
"""


def skeleton(doi: str, year: int) -> str:
    """The text of a new entry: every field with a comment."""
    return SKELETON.format(doi=doi, year=year, criteria=", ".join(CRITERIA))


def missing(name: str, facts: Facts) -> Iterator[str]:
    """Sentences about what an entry lacks. Raises ScenarioError if its law makes no scenario."""
    contender_of(name, facts)
    for field in ("title", "words"):
        if not getattr(facts, field):
            yield f'{field} is "": it must be given'
    if not facts.claim:
        yield "claim is missing: an entry needs at least one"
    for place, claim in enumerate(facts.claim):
        if not claim.text:
            yield f'claim[{place}].text is "": it must be a claim of the paper in your words'
        if claim.criterion and claim.criterion not in CRITERIA:
            yield f"claim[{place}].criterion is {claim.criterion}: it must be among {', '.join(CRITERIA)}, or left out"
    for erratum in facts.erratum if facts.run else ():
        if erratum.switch not in SWITCHES:
            yield f"erratum {erratum.id}.switch is {erratum.switch}: it must be among {', '.join(SWITCHES)}"
    if facts.seen in READ:
        if not facts.equation:
            yield f"equation is missing: it must be given, as seen is {facts.seen}"
        for place_, given in facts.every_given():
            if given.source == OURS:
                yield f'{place_}.from is missing: without it no result is called "as published"'
