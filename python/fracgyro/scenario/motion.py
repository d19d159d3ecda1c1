"""The table [reference] of a scenario: the motion to follow, of one kind for both axes or one for each."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BeforeValidator, create_model, model_validator

from .kinds import table_fields
from .points import OptionalTriples
from .table import Frequencies, Pair, Table, field, message_error, toml_value

if TYPE_CHECKING:

    class _Reference(Table):
        """Fields that the core lists (kinds.py)."""

        def __getattr__(self, name: str) -> Any: ...

else:
    PAPER = {"frequency": (math.pi, math.pi / 2), "phase": (0.0, math.pi / 2)}
    _Reference = create_model("_Reference", __base__=Table, **table_fields("reference", unset=("slope",), **PAPER))


class SineTerm(Table):
    """One sine of a sum."""

    amplitude: Pair = field((1.0, 1.0), "[x, y], unit q0.", unit="q0")
    frequency: Frequencies = field((0.0, 0.0), "[x, y], unit omega0.", unit="omega0")
    phase: Pair = field((0.0, 0.0), "[x, y], rad.", unit="rad")


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


REFERENCE_LISTS = {"terms": ("sines",), "file": ("table",), "points": ("table",)}  # and the kinds that have them


class Reference(_Reference):
    """The motion to follow: a kind of motion for both axes, or one for each."""

    terms: Annotated[tuple[SineTerm, ...] | None, BeforeValidator(_as_tuple)] = field(
        None, "Terms of a sum of sines: a list of {amplitude, frequency, phase}."
    )
    file: str | None = field(
        None,
        "For a table: a CSV file with the header time,x,y, or with units as time (ms),x (um),y (um), next to the "
        "scenario: read at once and kept as points.",
    )
    points: OptionalTriples = field(
        None,
        "Points of a table: [[time, x, y], ...], units 1/omega0 and q0: a cubic spline, at rest before and after it.",
        unit="1/omega0, q0, q0",
    )

    @property
    def kinds(self) -> tuple[str, str]:
        """The kinds of x and y."""
        return (self.kind, self.kind) if isinstance(self.kind, str) else self.kind

    @model_validator(mode="after")
    def _check(self) -> Self:
        if "sines" in self.kinds and not self.terms:
            raise message_error("reference.terms is missing: sines must have a list of {amplitude, frequency, phase}")
        if "table" in self.kinds and self.points is None:
            raise message_error("reference.points is missing: a table must have points, or a file of them")
        if "ramp" in self.kinds and self.slope is None:
            raise message_error("reference.slope is missing: a ramp must have one, [x, y]; zeros are allowed")
        ends = {"step", "ramp", "chirp"} & set(self.kinds)
        if ends and not self.end > self.start:
            raise message_error(
                f"reference.end is {toml_value(self.end)}: it must be greater than reference.start, which is "
                f"{toml_value(self.start)}"
            )
        if "chirp" in self.kinds and self.end == math.inf:
            raise message_error("reference.end is inf: a chirp must reach its final frequency at a finite time")
        if "staircase" in self.kinds and self.smoothing > self.hold:
            raise message_error(
                f"reference.smoothing is {toml_value(self.smoothing)}: it must be at most reference.hold, which is "
                f"{toml_value(self.hold)}"
            )
        return self
