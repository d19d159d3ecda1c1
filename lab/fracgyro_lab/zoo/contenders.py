"""Contenders of the zoo only: settings of known laws that a paper has, and what a part of a law is compared with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..comparison.contender import Contender, Gain
from ..comparison.track_contenders import CONTENDERS, PRESCRIBED, kind

OFF = "0 is the law without it"
WITH = "the part is nearly off below"
INNER = Gain("controller.inner_loop", 0.1, 1.0, log=False, below=WITH, above="1 is the range of the field")
OUTER = Gain("controller.outer_loop", 0.1, 1.0, log=False, below=WITH, above="1 is the range of the field")
GATE = Gain("controller.gate", 0.1, 0.95, log=False, below=WITH, above="1 never learns")
CENTERS = Gain("controller.center_rate", 0.01, 1000.0, below=OFF)
WIDTHS = Gain("controller.width_rate", 0.01, 1000.0, below=OFF)
SUPERVISOR = (
    Gain("controller.switching_force", 0.1, 300.0, below=OFF),
    Gain("controller.surface_layer", 1e-3, 10.0),
)
FUNNEL = (
    *PRESCRIBED[:3],
    replace(PRESCRIBED[5], above="0.8 over the step"),
    Gain("controller.velocity_bound", 1.0, 1000.0, above="no bound of the velocity"),
)
INTEGRAL = Gain("controller.error_integral", 10.0, 1e5)
START = Gain("controller.start_rate", 0.3, 100.0)
FILTER = Gain("controller.surface_filter", 1e-3, 0.3, log=True, below="the filter is as fast as the step")
COMPARED = {contender.name: contender for contender in CONTENDERS}


def variant(known: str, name: str, words: str, *more: Gain, source: str = "", **changes: Any) -> Contender:
    """A contender with other gains to tune and fixed fields, whose names have two underscores for a dot."""
    law = COMPARED[known]
    fixed = {field.replace("__", "."): value for field, value in changes.items()}
    gains = (*(gain for gain in law.gains if gain.field not in fixed), *more)
    return replace(
        law,
        name=name,
        words=words,
        source=source or law.source,
        fixed={**law.fixed, **fixed},
        gains=gains,
        contains=(),
        group="",
    )


def nodes(name: str, words: str, *more: Gain, **changes: Any) -> Contender:
    """The network of 16 Gaussian nodes with settings."""
    return variant("network", name, words, *more, source="docs/decisions/0053", **changes)


FUZZY: dict[str, Any] = {"controller__basis": "membership", "controller__nodes": 20, "controller__normalized": True}
OWN = (
    nodes("network_linear", "a network of the inputs themselves", controller__basis="linear"),
    nodes("network_without_model", "a network instead of the nominal plant", controller__model=False),
    nodes("network_product_rules", "16 fuzzy rules, products of memberships", controller__normalized=True),
    nodes("network_memberships", "20 fuzzy sets, five of each input", **FUZZY),
    nodes("fuzzy_direct", "20 fuzzy sets instead of the nominal plant", controller__model=False, **FUZZY),
    nodes(
        "fuzzy_supervised",
        "20 fuzzy sets instead of the nominal plant, with a supervisory term",
        *SUPERVISOR,
        controller__model=False,
        **FUZZY,
    ),
    nodes("network_inner_loop", "16 nodes, each fed with its last value", INNER),
    nodes("network_outer_loop", "16 nodes, fed with the network's last force", OUTER),
    nodes("network_loops", "16 nodes with both loops", INNER, OUTER),
    nodes("network_gate", "16 nodes behind a gate", GATE),
    nodes("network_moving", "16 nodes with moving centers and widths", CENTERS, WIDTHS),
    nodes(
        "network_outer_moving",
        "16 nodes with an outer loop, moving centers and widths",
        *(OUTER, CENTERS, WIDTHS),
    ),
    nodes(
        "network_everything",
        "16 fuzzy rules with both loops, a gate, moving centers and widths",
        *(INNER, OUTER, GATE, CENTERS, WIDTHS),
        controller__normalized=True,
    ),
    variant(
        "integral_sliding",
        "integral_without_observer",
        "integral sliding mode without the observer",
        controller__disturbance_observer=0.0,
    ),
    variant("linear", "linear_integral", "adaptive sliding mode on a proportional-integral surface", INTEGRAL),
    variant("linear", "linear_global", "adaptive sliding mode on a global surface", START),
    variant("backstepping", "dynamic_surface", "adaptive backstepping with a filtered virtual control", FILTER),
    Contender(
        "funnel",
        "a funnel of gains on the nominal plant",
        "doi 10.1137/100799903 (abstract read); docs/decisions/0053",
        kind("prescribed") | {"controller.barrier_shape": "funnel", "controller.adaptive": False},
        FUNNEL,
    ),
)
