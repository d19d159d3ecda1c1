"""Checks of an entry, and the skeleton of a new one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from .criteria import CRITERIA
from .facts import OURS, READ, Facts
from .laws import contender_of
from .pdf import NO_PAGE, NOT_FOUND, Document, Looked, page_of
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

{pdf}# Fields of a scenario that differ from those of the contender, as "controller.kind" = "pid".
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


READ_PDF = """# The PDF that was read: it is neither copied nor quoted. `fracgyro zoo check FILE --pdf PDF` looks up
# each number and equation whose `from` names a page. `seen` is "text" only if each does.
[pdf]
sha256 = "{sha256}"
pages = {pages}

"""


def skeleton(doi: str, year: int, document: Document | None = None) -> str:
    """The text of a new entry: every field with a comment, and the hash of a PDF."""
    pdf = "" if document is None else READ_PDF.format(sha256=document.sha256, pages=len(document.pages))
    return SKELETON.format(doi=doi, year=year, criteria=", ".join(CRITERIA), pdf=pdf)


def differences(facts: Facts, document: Document, looked: Iterable[Looked]) -> Iterator[str]:
    """Sentences about what the PDF of an entry does not have."""
    if facts.pdf is not None and facts.pdf.sha256 != document.sha256:
        yield f"pdf.sha256 is {facts.pdf.sha256}: it must be that of the file, {document.sha256}"
    for each in looked:
        if each.result in (NOT_FOUND, NO_PAGE):
            pages = f"the PDF has {len(document.pages)} pages"
            where = f"page {each.page} lacks it" if each.result == NOT_FOUND else pages
            yield f"{each.place} is {each.printed}: it must be in the text of its page, but {where}"


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
    if facts.pdf is not None and facts.seen == "text":
        sources = [(place_, given.source) for place_, given in facts.every_given()]
        sources += [(f"equation[{number}]", equation.source) for number, equation in enumerate(facts.equation)]
        for place_, source in sources:
            if page_of(source) is None:
                yield f'{place_}.from is "{source}": it must name a page, as "page 7", as seen is text of a PDF'
