"""Contenders of a comparison, as data."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.quantities import EXPONENTS, unit_of
from fracgyro.scenario.scales import OF_ONE
from fracgyro.scenario.schema import Controller
from fracgyro.scenario.units import parse_with
from fracgyro.simulation.own_file import ControllerFile
from fracgyro.study.space import Dimension

END_FRACTION = 0.05  # fraction of a range: a best value closer to an end is flagged
DIGITS = 4  # significant digits of a tuned value


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

    def share(self, value: float) -> float:
        """Its place in the range on the gain's scale, 0 to 1; one outside the range is moved to its end."""
        value = min(max(value, self.low), self.high)
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def value(self, share: float) -> float:
        """The value at this place in the range, to DIGITS significant digits."""
        if self.log:
            found = self.low * math.exp(share * math.log(self.high / self.low))
        else:
            found = self.low + share * (self.high - self.low)
        return min(max(float(f"{found:.{DIGITS}g}"), self.low), self.high)

    def power(self) -> float | None:
        """Exponent of the unit of frequency in its unit; None if it has none that is a number."""
        mine, theirs = _power(self.field), _power(self.times) if self.times else 0.0
        return None if mine is None or theirs is None else mine - theirs

    def scaled(self, frequency: float, rate: float) -> Gain:
        """The range for a device with these multiples of the paper's frequency and of its samples per unit of time.

        The faster end goes by the smaller: some are limits of the device's motion, some of the sampling.
        """
        power = self.power()
        if not power:
            return self
        slow, fast = frequency**power, min(frequency, rate) ** power
        low, high = (slow, fast) if power > 0 else (fast, slow)
        return replace(self, low=self.low * low, high=self.high * high)

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


def _power(name: str) -> float | None:
    table, _, entry = name.partition(".")
    fields = getattr(Scenario.model_fields.get(table), "annotation", None)
    if fields is None or entry not in fields.model_fields:
        return None
    unit = unit_of(fields.model_fields[entry]).partition(",")[0]  # a list has the unit of its first number
    for symbol, exponent in EXPONENTS.items():  # powers that another gain sets: with the default of that gain
        default = Controller.model_fields[exponent].default
        unit = re.sub(rf"\((\d)-{symbol}\)", partial(_difference, default), unit)
        unit = unit.replace(f"^{symbol}", f"^{default:g}")
    return -parse_with(unit, OF_ONE.get).powers[2] or 0.0


def _difference(exponent: float, found: re.Match[str]) -> str:
    return f"{float(found[1]) - exponent:g}"


@dataclass(frozen=True)
class Contained:
    """A contender that is a special case of another one: its best gains are a start of the other's tuning."""

    name: str
    at: Mapping[str, float] = field(default_factory=dict)  # gains of the larger law that the smaller lacks


@dataclass(frozen=True)
class Contender:
    """A controller in a comparison."""

    name: str
    words: str
    source: str  # reference of the method
    fixed: Mapping[str, Any]  # changes of the scenario, including controller.kind
    gains: tuple[Gain, ...]  # empty: not tuned
    classes: tuple[str, ...] = ("F", "P")
    without_noise: bool = True  # takes part with exact measurements
    observer: Gain | None = None  # also tuned if only positions are measured
    bandwidth: Gain | None = None  # bandwidth of the rate estimate: solved for, not tuned
    own: ControllerFile | None = None  # a user's controller, made of its gains
    group: str = field(default="", compare=False)  # for ablations: the full controller
    contains: tuple[Contained, ...] = ()  # special cases among the contenders

    def tuned(self, information: str) -> tuple[Gain, ...]:
        """The gains in this class of information."""
        return (*self.gains, self.observer) if self.observer and information == "P" else self.gains

    def started(self, information: str, contained: Contained, values: Mapping[str, Any]) -> dict[str, float]:
        """The best values of a special case as gains of this contender, within its ranges; a gain that neither has is
        in the middle."""
        known = {**values, **contained.at}
        gains = self.tuned(information)
        return {
            gain.field: gain.value(gain.share(float(known[gain.field])) if gain.field in known else 0.5)
            for gain in gains
        }

    def scaled(self, frequency: float, rate: float) -> Contender:
        """With the ranges for another device, as in `Gain.scaled`."""
        return replace(
            self,
            gains=tuple(gain.scaled(frequency, rate) for gain in self.gains),
            observer=self.observer and self.observer.scaled(frequency, rate),
        )

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
