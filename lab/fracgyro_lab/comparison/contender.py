"""What takes part in a comparison, as data: one entry each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.study.space import Dimension

NEAR = 0.05  # of a range: a best value this close to an end is flagged


@dataclass(frozen=True)
class Gain:
    """A number that is tuned: one field of the scenario, several that get the same value, or the scale of a list."""

    field: str
    low: float
    high: float
    log: bool = True
    also: tuple[str, ...] = ()
    shape: tuple[float, ...] = ()  # of the list that the field holds
    times: str = ""  # another gain, which the field is that often as large as
    below: str = ""  # why the range cannot begin lower; without a reason a value there is flagged
    above: str = ""  # why it cannot end higher

    @property
    def dimension(self) -> Dimension:
        return Dimension(self.field, self.low, self.high, "log" if self.log else "linear")

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Of the scenario, with these values of all gains."""
        value = values[self.field] * (values[self.times] if self.times else 1.0)
        held = tuple(value * part for part in self.shape) if self.shape else value
        return dict.fromkeys((self.field, *self.also), held)

    def at_end(self, value: float) -> bool:
        """Whether a wider range might have had something better."""
        low, high, at = self.low, self.high, value
        if self.log:
            low, high, at = math.log(low), math.log(high), math.log(at)
        near = NEAR * (high - low)
        return (not self.below and at - low < near) or (not self.above and high - at < near)


@dataclass(frozen=True)
class Contender:
    """A controller as it takes part."""

    name: str
    words: str
    source: str  # of the method
    fixed: Mapping[str, Any]  # changes of the scenario, of which controller.kind is one
    gains: tuple[Gain, ...]  # none: it runs as it is
    classes: tuple[str, ...] = ("F", "P")
    observer: Gain | None = None  # tuned too, where positions only are measured
    bandwidth: Gain | None = None  # of the rate estimate: found, not tuned
    own: tuple[str, str] | None = None  # a user's: the text of its file, and its name there
    group: str = field(default="", compare=False)  # of the ablations, what they are of

    def tuned(self, information: str) -> tuple[Gain, ...]:
        """The gains in this class of information."""
        return (*self.gains, self.observer) if self.observer and information == "P" else self.gains

    def scenario(self, base: Scenario, values: Mapping[str, Any] | None = None) -> Scenario:
        """Raises ScenarioError where these values make none."""
        gains = {gain.field: gain for gain in (*self.gains, self.observer, self.bandwidth) if gain}
        changes = dict(self.fixed)
        for name in values or {}:
            if name in gains:
                changes |= gains[name].changes(values or {})
        return base.replace({name: value for name, value in changes.items() if not name.startswith("law.")})


def chosen(known: tuple[Contender, ...], only: tuple[str, ...]) -> tuple[Contender, ...]:
    """Those with these names; all without any. Raises ScenarioError for a name that is none's."""
    names = [contender.name for contender in known]
    for name in only:
        if name not in names:
            raise ScenarioError(f'--only is "{name}": it must be among {", ".join(names)}')
    return tuple(contender for contender in known if not only or contender.name in only)
