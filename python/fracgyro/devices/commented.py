"""The TOML of a scenario with comments: a head, and lines above its fields."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence

from ..scenario import Scenario

WIDTH = 110  # characters of a comment


def commented(scenario: Scenario, head: Sequence[str], comments: Mapping[str, Sequence[str]]) -> str:
    """The TOML of `scenario`; `head`: sentences below its own; `comments`: sentences by dotted name of a field.

    Each sentence becomes a comment of its own. Raises KeyError for a field that the scenario does not have.
    """
    lines = scenario.to_toml().split("\n")
    end = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    written = [*lines[:end], *(line for words in head for line in _wrapped(words))]
    lines = lines[end:]
    left, table = dict(comments), ""
    for line in lines:
        opened = re.fullmatch(r"\[+(\w+)\]+", line)
        table = opened[1] if opened else table
        if named := re.match(r"(?:# )?(\w+) (?:= |is not set$)", line):
            written += [each for words in left.pop(f"{table}.{named[1]}", ()) for each in _wrapped(words)]
        written.append(line)
    if left:
        raise KeyError(f"{', '.join(left)} is not a field of this scenario")
    return "\n".join(written)


def _wrapped(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(" ".join(text.split()), WIDTH)]
