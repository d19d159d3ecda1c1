"""Contenders of a comparison, as data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.simulation.own_file import ControllerFile
from fracgyro.study.space import Dimension

END_FRACTION = 0.05  # fraction of a range: a best value closer to an end is flagged


@dataclass(frozen=True)
class Gain:
    """A number that is tuned: one field of the scenario, several that get the same value, or the scale of a list."""

    field: str
    low: float
    high: float
    log: bool = True
    also: tuple[str, ...] = ()
    shape: tuple[float, ...] = ()  # factors, for a field that is a list
    times: str = ""  # another gain that the value is multiplied by
    below: str = ""  # why the range cannot start lower; without a reason a value at this end is flagged
    above: str = ""  # why it cannot end higher

    @property
    def dimension(self) -> Dimension:
        return Dimension(self.field, self.low, self.high, "log" if self.log else "linear")

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Changes of the scenario for these values of all gains."""
        value = values[self.field] * (values[self.times] if self.times else 1.0)
        held = tuple(value * part for part in self.shape) if self.shape else value
        return dict.fromkeys((self.field, *self.also), held)

    def at_end(self, value: float) -> bool:
        """True if a wider range might have a better value."""
        low, high, at = self.low, self.high, value
        if self.log:
            low, high, at = math.log(low), math.log(high), math.log(at)
        near = END_FRACTION * (high - low)
        return (not self.below and at - low < near) or (not self.above and high - at < near)


@dataclass(frozen=True)
class Contender:
    """A controller in a comparison."""

    name: str
    words: str
    source: str  # reference of the method
    fixed: Mapping[str, Any]  # changes of the scenario, including controller.kind
    gains: tuple[Gain, ...]  # empty: not tuned
    classes: tuple[str, ...] = ("F", "P")
    observer: Gain | None = None  # also tuned if only positions are measured
    bandwidth: Gain | None = None  # bandwidth of the rate estimate: solved for, not tuned
    own: ControllerFile | None = None  # a user's controller, made of its gains
    group: str = field(default="", compare=False)  # for ablations: the full controller

    def tuned(self, information: str) -> tuple[Gain, ...]:
        """The gains in this class of information."""
        return (*self.gains, self.observer) if self.observer and information == "P" else self.gains

    def scenario(self, base: Scenario, values: Mapping[str, Any] | None = None) -> Scenario:
        """The scenario with these gains. Raises ScenarioError if it is invalid."""
        gains = {gain.field: gain for gain in (*self.gains, self.observer, self.bandwidth) if gain}
        changes = dict(self.fixed)
        for name in values or {}:
            if name in gains:
                changes |= gains[name].changes(values or {})
        return base.replace({name: value for name, value in changes.items() if not name.startswith("law.")})


def chosen(known: tuple[Contender, ...], only: tuple[str, ...]) -> tuple[Contender, ...]:
    """The contenders with these names, by default all. Raises ScenarioError for an unknown name."""
    names = [contender.name for contender in known]
    for name in only:
        if name not in names:
            raise ScenarioError(f'--only is "{name}": it must be among {", ".join(names)}')
    return tuple(contender for contender in known if not only or contender.name in only)
