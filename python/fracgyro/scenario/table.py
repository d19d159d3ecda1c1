"""Tables of scenarios and studies: a frozen pydantic model, its field types, their TOML."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator
from pydantic_core import PydanticCustomError

from ..files import cut

MAX_STEPS = 10**9  # steps of a run, and of anything counted in steps
MAX_FREQUENCY = 1e6  # unit omega0: of a reference or a force
MAX_DEPTH = 16  # lists and tables in one another; a scenario needs 4


def toml_value(value: Any, depth: int = 0) -> str:
    """A value as TOML writes it; floats in the fewest digits that read back the same."""
    if value is None:
        return "not set"  # only for sentences: TOML has no such value
    if isinstance(value, BaseModel):
        value = dict(value)
    if depth > MAX_DEPTH and isinstance(value, Mapping | list | tuple):
        return "..."  # only for sentences: no valid value is nested so deeply
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {toml_value(entry, depth + 1)}" for key, entry in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(entry, depth + 1) for entry in value) + "]"
    if isinstance(value, int) and value.bit_length() > 1024:
        return f"an integer of {value.bit_length()} bits"  # only for sentences: Python refuses to print it
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", r"\u007f")  # TOML forbids it raw, JSON does not
    return str(value)


def format_value(value: Any) -> str:
    """A value in a message; a long one is shortened."""
    return cut(toml_value(value))


def message_error(text: str) -> PydanticCustomError:
    """An error inside a validator, already worded in full; `_describe` passes it through."""
    return PydanticCustomError("message", "{text}", {"text": text})


def field(default: Any, description: str, *, unit: str = "1", **limits: Any) -> Any:
    """The description becomes the TOML comment: symbol, unit, effect, and the value that switches it off.

    `unit` is a keyword of its own in JSON Schema, and a column of docs/reference.md.
    """
    return Field(default, description=description, json_schema_extra={"unit": unit} if unit != "1" else None, **limits)


@dataclass(frozen=True)
class AsTuple:
    """A tuple from a list of `names` numbers, for frozen models; `expand`: one number applies to every entry."""

    names: tuple[str, ...]
    expand: bool

    def __call__(self, value: Any) -> tuple[Any, ...]:
        count = len(self.names)
        if self.expand and isinstance(value, int | float) and not isinstance(value, bool):
            return (value,) * count
        if not isinstance(value, list | tuple) or len(value) != count:
            rule = f"it must be a list of {count} numbers [{', '.join(self.names)}]"
            rule += " or one number for all of them" if self.expand else ""
            raise PydanticCustomError("rule", "{rule}", {"rule": rule})
        return tuple(value)


def as_tuple(names: str, *, expand: bool = False) -> BeforeValidator:
    return BeforeValidator(AsTuple(tuple(names.split()), expand))


NonNegative = Annotated[float, Field(ge=0)]
Pair = Annotated[tuple[float, float], as_tuple("x y")]
Frequency = Annotated[float, Field(ge=-MAX_FREQUENCY, le=MAX_FREQUENCY)]
Frequencies = Annotated[tuple[Frequency, Frequency], as_tuple("x y")]
Vector = NDArray[np.float64]


class Table(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name} cannot be set: a scenario is frozen; its method replace makes a changed copy")

    @field_validator("*", mode="after")
    @classmethod
    def _one_zero(cls, value: Any) -> Any:
        """-0.0 becomes 0.0, so that equal scenarios have equal text and equal hashes."""
        if isinstance(value, tuple):
            return tuple(cls._one_zero(entry) for entry in value)
        return value + 0.0 if isinstance(value, float) else value


class Symmetric(Table):
    """A symmetric 2x2 matrix."""

    xx: float
    xy: float
    yy: float

    def smallest_eigenvalue(self) -> float:
        return self.xx / 2 + self.yy / 2 - math.hypot(self.xx / 2 - self.yy / 2, self.xy)

    def entries(self) -> Vector:
        """[xx, xy, yy]"""
        return np.array([self.xx, self.xy, self.yy])

    def plus(self, xx: float, xy: float, yy: float) -> Symmetric:
        """The sum, not validated: an overflow is for the check of definiteness to report."""
        return Symmetric.model_construct(xx=self.xx + xx, xy=self.xy + xy, yy=self.yy + yy)


ZERO = Symmetric(xx=0.0, xy=0.0, yy=0.0)
