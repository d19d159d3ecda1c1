"""Citations: the software, the paper, and the sources of a scenario's controller."""

from __future__ import annotations

from importlib.metadata import version

from .kinds import kinds_with
from .scenario import Scenario, check_scenario

PAPER = {
    "title": "Robust Adaptive Fractional Fast Terminal Sliding Mode Controller for Microgyroscope",
    "journal": "Complexity",
    "year": "2020",
    "volume": "2020",
    "number": "8542961",
    "doi": "10.1155/2020/8542961",
}
SLOTINE = {"author": "Slotine and Li", "title": "Applied Nonlinear Control", "year": "1991"}
BIERMAN = {"author": "Bierman", "title": "Factorization Methods for Discrete Sequential Estimation", "year": "1977"}
FRANCIS = {"author": "Francis and Wonham", "year": "1976", "doi": "10.1016/0005-1098(76)90006-6"}
LELAND = {"author": "Leland", "year": "2005", "doi": "10.1109/JSEN.2005.844538"}
# Sources in EQUATIONS.md, by controller.kind and adaptation.kind; a DOI makes other fields of an entry unnecessary.
SOURCES = {
    "nonsingular_terminal": {"author": "Feng and Yu and Man", "year": "2002", "doi": "10.1016/S0005-1098(02)00147-4"},
    "park_horowitz": {"author": "Park and Horowitz", "year": "2003", "doi": "10.1109/JMEMS.2002.807468"},
    "disturbance_rejection": {"author": "Zheng and Dong and Gao", "year": "2007", "doi": "10.1109/CCA.2007.4389216"},
    "resonant": FRANCIS,
    "super_twisting": {"doi": "10.1371/journal.pone.0189457"},
    "dynamic": {"year": "2021", "doi": "10.3390/mi12020190"},
    "fixed_time": {"author": "Polyakov", "year": "2012", "doi": "10.1109/TAC.2011.2179869"},
    "prescribed": {"year": "2023", "doi": "10.1049/cth2.12484"},
    "network": {"year": "2014", "doi": "10.1155/2014/159047"},
    "open_loop": LELAND,
    "force_rebalance": LELAND,
    "whole_angle": LELAND,
    "virtual_rotation": {"year": "2021", "doi": "10.1038/s41598-020-80885-y"},
    "mode_reversal": {"year": "2025", "doi": "10.1038/s41378-025-01011-4"},
    "least_squares_pid": SLOTINE,
    "lqg": BIERMAN,
    "composite": SLOTINE,
    "joint": BIERMAN,
}


def cite(scenario: Scenario | None = None) -> str:
    """BibTeX of the software, of the paper, and of the sources of the scenario's controller.

    Raises TypeError if `scenario` is not a Scenario.

    >>> print(fg.cite(fg.Scenario.paper().replace({"controller.kind": "park_horowitz"})).splitlines()[-2])
      doi = {10.1109/JMEMS.2002.807468},
    """
    entries = {
        "fracgyro": {"author": "{The fracgyro authors}", "title": "fracgyro", "version": version("fracgyro")},
        "complexity2020": PAPER,
    }
    if scenario is not None:
        check_scenario(scenario)
        kinds = [scenario.controller.kind]
        if kinds[0] in kinds_with("adaptation.kind"):
            kinds.append(scenario.adaptation.kind)
        entries |= {kind: SOURCES[kind] for kind in kinds if kind in SOURCES}
    return "\n\n".join(_entry(key, fields) for key, fields in entries.items())


def _entry(key: str, fields: dict[str, str]) -> str:
    kind = "software" if "version" in fields else "article" if "doi" in fields else "book"
    return "\n".join([f"@{kind}{{{key},", *(f"  {name} = {{{value}}}," for name, value in fields.items()), "}"])
