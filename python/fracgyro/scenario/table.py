"""Tables of scenarios and studies: a frozen pydantic model, its field types, their TOML."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    field_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from ..files import cut
from .units import Quantity

MAX_STEPS = 10**9  # steps of a run, and of anything counted in steps
MAX_FREQUENCY = 1e6  # unit omega0: of a reference or a force
OF_CONTROLLERS = ("controller", "adaptation", "guard", "datasheet")  # tables without a kind of their own
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
    if isinstance(value, Quantity):
        value = value.text
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", r"\u007f")  # TOML forbids it raw, JSON does not
    return str(value)


def format_value(value: Any) -> str:
    """A value in a message; a long one is shortened."""
    return cut(toml_value(value))


def message_error(text: str) -> PydanticCustomError:
    """An error inside a validator, already worded in full; `_describe` passes it through."""
    # A file name may hold bytes that are not text, which pydantic cannot show.
    shown = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return PydanticCustomError("message", "{text}", {"text": shown})


class Wrong(str):
    """The error of a value, worded in full, in its place: validation reports it together with all other errors."""


def found_wrong(value: Any) -> Wrong | None:
    """The first error in a value, or in a list of rows."""
    if isinstance(value, Wrong):
        return value
    inner = value if isinstance(value, list | tuple) else ()
    return next((each for each in map(found_wrong, inner) if each is not None), None)


def of_other_kinds(path: str, value: Any, kinds: Iterable[str], kind: Any) -> PydanticCustomError:
    """The error for a field that only these kinds of its table have, or of the controller; `kind`: the given one."""
    table = "controller" if path.partition(".")[0] in OF_CONTROLLERS else path.rpartition(".")[0]
    *others, last = map(toml_value, kinds)
    wanted = f"{', '.join(others)} or {last}" if others else last
    given = f"{table}.kind is {format_value(kind)}"
    return message_error(f"{path} is {format_value(value)}: it needs {table}.kind = {wanted}, but {given}")


def field(default: Any, description: str, *, unit: str = "1", **limits: Any) -> Any:
    """The description becomes the TOML comment: symbol, unit, effect, and the value that switches it off.

    `unit` is a keyword of its own in JSON Schema, and a column of docs/reference.md.
    """
    return Field(default, description=description, json_schema_extra={"unit": unit} if unit != "1" else None, **limits)


def without_default(annotation: Any, info: FieldInfo) -> tuple[Any, Any]:
    """A field without limits that may be left out and has no default."""
    extra = info.json_schema_extra
    unit = str(extra["unit"]) if isinstance(extra, dict) else "1"
    return annotation | None, field(None, info.description or "", unit=unit)


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


def choice_pair(choices: tuple[str, ...]) -> Any:
    """The type of a choice for both axes, or a list [x, y] of two; equal ones become one."""

    def checked(value: Any) -> str | tuple[str, str]:
        each = value if isinstance(value, list | tuple) else (value,) * 2
        for one in each or [None]:
            if one not in choices or len(each) != 2:
                near = difflib.get_close_matches(one, choices, n=1) if isinstance(one, str) else []
                rule = f"it must be {', '.join(choices[:-1])} or {choices[-1]}, or a list of two of these for x and y"
                rule += f"; did you mean {near[0]}?" if near else ""
                raise PydanticCustomError("rule", "{rule}", {"rule": rule})
        return str(each[0]) if each[0] == each[1] else (str(each[0]), str(each[1]))

    one = {"enum": list(choices), "type": "string"}
    both = {"type": "array", "prefixItems": [one, one], "minItems": 2, "maxItems": 2}
    return Annotated[str | tuple[str, str], PlainValidator(checked), WithJsonSchema({"anyOf": [one, both]})]


NonNegative = Annotated[float, Field(ge=0)]
Pair = Annotated[tuple[float, float], as_tuple("x y")]
Frequency = Annotated[float, Field(ge=-MAX_FREQUENCY, le=MAX_FREQUENCY)]
Frequencies = Annotated[tuple[Frequency, Frequency], as_tuple("x y")]
Vector = NDArray[np.float64]


def as_given(given: Any, found: Any) -> Any:
    """A validated value with the quantities that were given: pydantic makes them plain floats.

    -0.0 becomes 0.0, so that equal scenarios have equal text and equal hashes.
    """
    if type(found) is tuple:  # points are without quantities
        entries = given if isinstance(given, list | tuple) else [given] * len(found)
        return tuple(map(as_given, entries, found))
    if isinstance(found, float):
        return given if isinstance(given, Quantity) else found + 0.0
    return found


def plain(value: Any) -> Any:
    """A value without the texts of its quantities."""
    if isinstance(value, BaseModel):
        return {name: plain(each) for name, each in value}
    if isinstance(value, tuple):
        return tuple(map(plain, value))
    return float(value) if isinstance(value, Quantity) else value


class Table(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name} cannot be set: a scenario is frozen; its method replace makes a changed copy")

    @field_validator("*", mode="wrap")
    @classmethod
    def _as_given(cls, value: Any, validate: ValidatorFunctionWrapHandler) -> Any:
        return as_given(value, validate(value))


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
