"""The table [disturbance] of a scenario: one entry, or a list of entries that add up."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from .points import OptionalSpectrum, OptionalTriples
from .table import Frequencies, NonNegative, Pair, Table, as_tuple, field, message_error, of_other_kinds, toml_value

MAX_ENTRIES = 64
FORCE = "m*omega0^2*q0"
RANDOM = ("noise", "vibration")
SIZED = ("sine", "step", "pulse")  # kinds that must have an amplitude
NEEDS = {"pulse": "width", "vibration": "psd", "table": "points"}  # fields of these kinds, and of no other
Kind = Literal["none", "noise", "sine", "step", "pulse", "vibration", "table"]
Weights = Annotated[tuple[NonNegative, NonNegative], as_tuple("x y")]
Band = Annotated[tuple[NonNegative, NonNegative], as_tuple("low high")]


class Entry(Table):
    """One entry of the disturbance."""

    kind: Kind = field(
        "noise",
        "noise: Gaussian, piecewise constant or within a band; sine: amplitude*sin(frequency*t + phase); step: "
        "amplitude; pulse: a half-sine of amplitude, from start on; vibration: Gaussian, with the spectrum psd; table: "
        "points. none: off.",
    )
    quantity: Literal["force", "acceleration"] = field(
        "force",
        "Physical quantity of the values: a force, or a force over plant.mass. Their nondimensional numbers are the "
        "same. An acceleration a of the frame is the entry -a.",
    )
    start: float = field(0.0, "Unit 1/omega0: the entry acts from this time on. 0.0: off.", ge=0, unit="1/omega0")
    end: float = field(
        math.inf,
        "Unit 1/omega0, > start: the entry acts before this time. inf: off.",
        gt=0,
        allow_inf_nan=True,
        unit="1/omega0",
    )
    standard_deviation: float | None = field(
        None, "Unit of force; noise needs this or density, and only one. 0.0: off.", ge=0, unit=FORCE
    )
    density: float | None = field(
        None,
        "S, unit force^2 time: white noise of density S held for h has variance S/h. 0.0: off.",
        ge=0,
        unit="(m*omega0^2*q0)^2/omega0",
    )
    hold: float | None = field(
        None, "h, unit 1/omega0: time between noise draws, whole steps. Not set: off, one step.", gt=0, unit="1/omega0"
    )
    band: Band | None = field(
        None,
        "[low, high], unit omega0, at most pi over the step: noise with a flat spectrum from low to high and none "
        "outside; of density S its variance is S (high - low)/pi. Not set: off, white noise.",
        unit="omega0",
    )
    amplitude: Pair | None = field(
        None, "[x, y], unit of force: required for sine, step and pulse. Zeros: off.", unit=FORCE
    )
    frequency: Frequencies = field(
        (0.0, 0.0), "Frequency of the sine, [x, y], unit omega0. Zeros: constant force.", unit="omega0"
    )
    phase: Pair = field((0.0, 0.0), "Phase of the sine, [x, y], rad. Zeros: off.", unit="rad")
    width: float | None = field(
        None, "Unit 1/omega0: duration of the pulse. Not set: off, for other kinds.", gt=0, unit="1/omega0"
    )
    psd: OptionalSpectrum = field(
        None,
        "Spectrum of the vibration of each axis: [[frequency, density], ...], unit omega0, at most pi over the step, "
        "and force^2/omega0. One-sided: its integral over the frequency is the variance. Straight lines in logarithmic "
        "scales, zero beyond the ends.",
        unit="omega0, (m*omega0^2*q0)^2/omega0/rad",
    )
    weights: Weights = field((1.0, 1.0), "Factors of the vibration on [x, y], whose vibrations are independent.")
    file: str | None = field(
        None,
        "A CSV file with the header time,x,y, or with units as time (ms),x (uN),y (uN), next to the scenario: read at "
        "once and kept as points.",
    )
    points: OptionalTriples = field(
        None,
        "Points of the table: [[time since start, x, y], ...], unit 1/omega0 and unit of force; linear in between and "
        "zero beyond the ends.",
        unit=f"1/omega0, {FORCE}",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        self._check_needs()
        if not self.start < self.end:
            raise message_error(
                f"disturbance.end is {toml_value(self.end)}: it must be greater than disturbance.start, which is "
                f"{toml_value(self.start)}"
            )
        if self.kind == "noise":
            self._check_noise()
        return self

    def _check_needs(self) -> None:
        for name, kind in (*((name, kind) for kind, name in NEEDS.items()), ("file", "table")):
            if self.kind != kind and (value := getattr(self, name)) is not None:
                raise of_other_kinds(f"disturbance.{name}", value, (kind,), self.kind)
        needed = [NEEDS[self.kind]] if self.kind in NEEDS else []
        rules = {"amplitude": "one, [x, y]; zeros are allowed", "points": "points, or a file of them"}
        for name in [*needed, "amplitude"] if self.kind in SIZED else needed:
            if getattr(self, name) is None:
                raise message_error(f"disturbance.{name} is missing: a {self.kind} must have {rules.get(name, 'one')}")

    def _check_noise(self) -> None:
        given = {"standard_deviation": self.standard_deviation, "density": self.density}
        if list(given.values()).count(None) != 1:
            names = " and ".join(
                f"disturbance.{name} is {'missing' if value is None else toml_value(value)}"
                for name, value in given.items()
            )
            raise message_error(f"{names}: noise must have exactly one of the two")
        if self.band is None:
            return
        if not self.band[0] < self.band[1]:
            raise message_error(f"disturbance.band is {toml_value(self.band)}: its second number must be greater")
        if self.hold is not None:
            raise message_error(
                f"disturbance.hold is {toml_value(self.hold)}: it must be left out with disturbance.band, whose noise "
                "is not held"
            )


class AddedEntry(Entry):
    """A further entry of the disturbance. Its noise comes from a stream of its own of disturbance.seed."""

    kind: Kind = Field(description=Entry.model_fields["kind"].description)


def _added(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) >= MAX_ENTRIES:
        rule = f"it must be a list of at most {MAX_ENTRIES - 1} tables"
        raise PydanticCustomError("rule", "{rule}", {"rule": rule})
    return tuple(value)


class Disturbance(Entry):
    """The force d of (9), on each axis. A list of such tables, headed [[disturbance]], adds up."""

    seed: int = field(0, "Same seed, same noise; 0 to 2^63 - 1. Without effect on other kinds.", ge=0, le=2**63 - 1)
    added: Annotated[tuple[AddedEntry, ...], BeforeValidator(_added)] = field(
        (), "The further tables of a list: the same fields without seed. An empty list: off."
    )

    @model_validator(mode="before")
    @classmethod
    def _default(cls, values: Any) -> Any:
        """A list of tables: the first, with the others added to it.

        Without kind and strength it is the paper's randn. A kind that is given needs its strength.
        """
        if isinstance(values, list | tuple):
            if not 1 <= len(values) <= MAX_ENTRIES or not all(isinstance(entry, Mapping | Entry) for entry in values):
                raise message_error(
                    f"disturbance is {toml_value(values)}: it must be a table or a list of 1 to {MAX_ENTRIES} tables; "
                    'a table with kind = "none" switches it off'
                )
            first, *added = (dict(entry) for entry in values)
            values = {**first, "added": added} if added else first
        if isinstance(values, Mapping) and not {"kind", "standard_deviation", "density"} & set(values):
            return {**values, "standard_deviation": 1.0}
        return values

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All entries, which add up."""
        return (self, *self.added)

    @property
    def random(self) -> bool:
        """True if the disturbance depends on the seed."""
        return any(entry.kind in RANDOM for entry in self.entries)

    @property
    def kinds(self) -> str:
        """The kinds of the entries, as text."""
        return " + ".join(entry.kind for entry in self.entries)


def named_entries(disturbance: Disturbance) -> Iterator[tuple[str, Entry]]:
    """Each entry with its name in messages: disturbance, disturbance[1], and so on."""
    for place, entry in enumerate(disturbance.entries):
        yield f"disturbance[{place}]" if place else "disturbance", entry
