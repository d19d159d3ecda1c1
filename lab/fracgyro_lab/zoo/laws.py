"""The laws of the zoo as contenders of `compare track`, and the pairs that show what a part of a law buys."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from typing import Any

from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.messages import did_you_mean
from fracgyro.scenario.table import format_value

from ..comparison.contender import Contender
from ..comparison.task import Cell, sensed
from ..comparison.track import LOW, Track
from ..comparison.track_contenders import CONTENDERS
from .contenders import OWN
from .facts import Facts, entries, plant

NOISE = 1e-13  # density of the measured position in the noisy setting, m/sqrt(Hz)
SCENARIO = "paper"
HOUSE = ("lqg", "linear", "pid", "paper")  # laws of the comparison that stand next to those of the zoo
KNOWN = {contender.name: contender for contender in (*CONTENDERS, *OWN)}
GAINS = files(__package__) / "gains.json"


def cell(information: str, noise: float, ceiling: float = LOW) -> Cell:
    """A setting: all laws have the same ceiling of the chattering."""
    return Cell(SCENARIO, information, noise, ceiling)


def base() -> Scenario:
    """The scenario of all laws, without its sensing."""
    return Track().scenarios()[SCENARIO]


def contender_of(name: str, facts: Facts) -> Contender:
    """The law of an entry. Raises ScenarioError if its contender is unknown, or its changes make no scenario."""
    if facts.contender not in KNOWN:
        raise ScenarioError(
            f"contender is {format_value(facts.contender)}: it must be a contender of `fracgyro compare track` or of "
            "the zoo"
            f"{did_you_mean(facts.contender, KNOWN)}"
        )
    known = KNOWN[facts.contender]
    own = {field: value for field, value in facts.law.items() if known.fixed.get(field) != value}
    found = replace(
        known,
        name=name.partition("_")[2] or name if own else known.name,
        fixed={**known.fixed, **own},
        gains=tuple(gain for gain in known.gains if gain.field not in own),
        classes=(facts.information,),
        contains=() if own else known.contains,
        group="",
    )
    found.scenario(base())
    return found


@dataclass(frozen=True)
class Switch:
    """A part of a law: the law with it, and the same law without it or with the simplest part instead."""

    words: str
    having: str
    lacking: str


SWITCHES = (
    Switch("16 Gaussian nodes instead of one constant node", "network", "network_constant"),
    Switch("Chebyshev polynomials instead of one constant node", "network_chebyshev", "network_constant"),
    Switch("the inputs themselves instead of one constant node", "network_linear", "network_constant"),
    Switch("fuzzy rules, products of memberships, instead of Gaussian nodes", "network_product_rules", "network"),
    Switch("fuzzy sets of each input instead of Gaussian nodes", "network_memberships", "network"),
    Switch("an inner loop in each node", "network_inner_loop", "network"),
    Switch("an outer loop around the network", "network_outer_loop", "network"),
    Switch("both loops", "network_loops", "network"),
    Switch("a gate", "network_gate", "network"),
    Switch("moving centers and widths", "network_moving", "network"),
    Switch("fuzzy rules, loops, gate, moving centers and widths together", "network_everything", "network"),
    Switch("a supervisory term next to fuzzy sets without a model", "fuzzy_supervised", "fuzzy_direct"),
    Switch("learning from a prediction, too", "network_predicted", "network"),
    Switch("weights instead of a bound of their norm", "network", "minimal_learning"),
    Switch("the nominal plant under the network", "network", "network_without_model"),
    Switch("a disturbance observer under the integral", "integral_sliding", "integral_without_observer"),
    Switch("the coupling term of backstepping", "backstepping", "linear"),
    Switch("the filter of a dynamic surface", "dynamic_surface", "backstepping"),
    Switch("the integral of a proportional-integral surface", "linear_integral", "linear"),
    Switch("the start of a global surface", "linear_global", "linear"),
    Switch("the terminal term of the fractional surface", "paper", "paper_no_terminal"),
    Switch("the fractional order of the surface", "paper", "paper_integer_order"),
    Switch("the adaptation laws (44)", "paper", "paper_no_adaptation"),
)


def laws() -> dict[str, Contender]:
    """All contenders of the report by name: of the entries, of the house, and of the switches."""
    found = {law.name: law for name, facts in entries().items() for law in [contender_of(name, facts)]}
    wanted = [*HOUSE, *(name for switch in SWITCHES for name in (switch.having, switch.lacking))]
    for name in wanted:
        if name not in found:
            found[name] = replace(KNOWN[name], classes=("F",), group="")
    return found


@lru_cache
def tuned_gains() -> dict[str, dict[str, dict[str, Any]]]:
    """The gains that `make zoo` found: by setting, law and field. Empty before its first run."""
    try:
        found: dict[str, dict[str, dict[str, Any]]] = json.loads(GAINS.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    return found


def with_gains(law: Contender, setting: str) -> Contender:
    """The law with the gains that `make zoo` found in a setting; with its defaults if there are none."""
    gains: Mapping[str, Any] = tuned_gains().get(setting, {}).get(law.name, {})
    changes = {field: tuple(value) if isinstance(value, list) else value for field, value in gains.items()}
    return replace(law, fixed={**law.fixed, **changes}, gains=(), observer=None)


def on_plant(scenario: Scenario, name: str) -> Scenario:
    """The scenario on a plant of the literature, with its reference and a force limit for it."""
    return scenario if name == SCENARIO else scenario.replace(plant(name).changes())


def sensed_base(setting: Cell) -> Scenario:
    """The scenario with the sensing of a setting."""
    return sensed(base(), setting.information, setting.noise)
