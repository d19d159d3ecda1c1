"""Verdicts on claims of papers: each claim has a numeric criterion, and a function that judges it on its material."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from fracgyro.files import whole_file
from numpy.typing import ArrayLike

MIN_SHARE = 0.95  # fraction of seeds in which a criterion must hold
HELD, FAILED = "reproduced", "not reproduced"

M = TypeVar("M")
Judged = tuple[bool, str]  # does the criterion hold, and the evidence
Criteria = Mapping[str, tuple[str, str, Callable[[M], Judged]]]  # by identifier: claim, criterion, judging function


@dataclass(frozen=True)
class Claim:
    """A claim of a paper with its verdict, for one variant: as printed, as corrected, or tuned."""

    id: str
    claim: str
    variant: str
    verdict: str  # reproduced | not reproduced
    criterion: str
    evidence: str


def verdicts(criteria: Criteria[M], material: Mapping[str, M]) -> list[Claim]:
    """Every claim in its order, for each variant of the material."""
    return [
        Claim(
            id=identifier,
            claim=claim,
            variant=variant,
            verdict=HELD if held else FAILED,
            criterion=criterion,
            evidence=evidence,
        )
        for identifier, (claim, criterion, judged) in criteria.items()
        for variant, of in material.items()
        for held, evidence in [judged(of)]
    ]


def write_claims(claims: Sequence[Claim], path: Path) -> None:
    """Writes the claims as a JSON list."""
    with whole_file(path) as scratch:
        text = json.dumps([asdict(claim) for claim in claims], indent=2, ensure_ascii=False)
        scratch.write_text(text + "\n", encoding="utf-8")


def share(holds: ArrayLike) -> float:
    """The fraction of seeds in which a criterion holds."""
    return float(np.asarray(holds, dtype=float).mean())
