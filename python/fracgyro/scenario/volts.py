"""The tables [[electrodes]], [electronics] and [trim] of a scenario: a device in volts. All off by default."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BeforeValidator, create_model, model_validator
from pydantic_core import PydanticCustomError

from ..arguments import short
from .kinds import ELECTRODE_NUMBERS, ELECTRONICS_NUMBERS, TRIM_NUMBERS, listed_fields
from .table import Table, field, message_error, toml_value

MAX_ELECTRODES = 12

if TYPE_CHECKING:

    class _OfCore(Table):
        """Fields that the core lists (kinds.py)."""

        def __init__(self, **fields: Any) -> None: ...

        def __getattr__(self, name: str) -> Any: ...

    class _Electrode(_OfCore): ...

    class _Electronics(_OfCore): ...

    class _Trim(_OfCore): ...

else:
    _Electrode = create_model("_Electrode", __base__=Table, **listed_fields(ELECTRODE_NUMBERS))
    _Electronics = create_model("_Electronics", __base__=Table, **listed_fields(ELECTRONICS_NUMBERS))
    _Trim = create_model("_Trim", __base__=Table, **listed_fields(TRIM_NUMBERS))


class Electrode(_Electrode):
    """An electrode, or a pair of them. In SI units."""

    @property
    def axis(self) -> tuple[float, float]:
        """Its direction; exact on the axes."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return (0.0 if abs(c) < 1e-12 else c), (0.0 if abs(s) < 1e-12 else s)


def _listed(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) > MAX_ELECTRODES:
        rule = f"it must be a list of at most {MAX_ELECTRODES} tables"
        raise PydanticCustomError("rule", "{rule}", {"rule": rule})
    return tuple(value)


class Electrodes(Table):
    """Electrodes between volts and forces: tables headed [[electrodes]], in SI units. None: forces as requested."""

    each: Annotated[tuple[Electrode, ...], BeforeValidator(_listed)] = field(
        (), "The tables of the list. With any, plant.stiffness is that of the springs without voltages. None: off."
    )

    @model_validator(mode="before")
    @classmethod
    def _list(cls, values: Any) -> Any:
        if isinstance(values, list | tuple):
            return {"each": values}
        if isinstance(values, Electrodes) or (isinstance(values, dict) and not set(values) - {"each"}):
            return values
        given = "one table" if isinstance(values, dict) else short(values)
        raise message_error(f"electrodes is {given}: it must be a list of tables, each headed [[electrodes]]")

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, one in self.named():
            if not abs(one.offset) < one.gap:
                raise message_error(
                    f"{name}.offset is {toml_value(one.offset)}: its magnitude must be less than {name}.gap, which is "
                    f"{toml_value(one.gap)}"
                )
            if (one.role == "quadrature") != (one.kind == "skewed" and one.role == "quadrature"):
                raise message_error(f"{name}.kind is {toml_value(one.kind)}: it must be skewed for role quadrature")
            if one.nulling and one.role != "quadrature":
                raise message_error(
                    f"{name}.nulling is {toml_value(one.nulling)}: it must be 0.0 for role {one.role}; only quadrature "
                    "has it"
                )
            if one.noise and one.role != "force":
                raise message_error(
                    f"{name}.noise is {toml_value(one.noise)}: it must be 0.0 for role {one.role}, without driver"
                )
            if one.bits and one.role != "force":
                raise message_error(
                    f"{name}.bits is {one.bits}: it must be 0 for role {one.role}, without a converter of its own"
                )
            if one.bits and not math.isfinite(one.range):
                raise message_error(
                    f"{name}.bits is {one.bits} and {name}.range is inf: a converter must have a finite range"
                )
            if abs(one.angle) > math.tau:
                raise message_error(
                    f"{name}.angle is {toml_value(one.angle)}: it is in rad, and its magnitude must be at most 2 pi"
                )
            if one.role == "force" and not one.bias:
                raise message_error(
                    f"{name}.bias is 0.0: it must be other than 0 for role force, whose force is linear in it"
                )
        for role in ("force", "pickoff"):
            self._check_axes(role)
        return self

    def _check_axes(self, role: str) -> None:
        """Raises unless forces, or pick-offs, span both axes."""
        axes = [one.axis for one in self.each if one.role == role]
        if axes and not any(abs(a * d - b * c) > 1e-6 for a, b in axes for c, d in axes):
            raise message_error(f"electrodes of role {role} have one direction: each axis must have some")

    def named(self) -> Iterator[tuple[str, Electrode]]:
        """Each with its name in messages: electrodes[0], electrodes[1], and so on."""
        for place, one in enumerate(self.each):
            yield f"electrodes[{place}]", one

    def of(self, role: str) -> tuple[Electrode, ...]:
        return tuple(one for one in self.each if one.role == role)


class Electronics(_Electronics):
    """Amplifiers of the pick-offs, feedthrough and timing. In SI units."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        noisy = [name for name in ("voltage_noise", "current_noise") if getattr(self, name)]
        if math.isfinite(self.feedback_resistance):
            noisy.append("feedback_resistance")
        if noisy and self.amplifier == "ideal":
            value = toml_value(getattr(self, noisy[0]))
            raise message_error(
                f'electronics.{noisy[0]} is {value}: it needs electronics.amplifier = "charge" or "transimpedance"'
            )
        if self.amplifier == "transimpedance" and not all(map(math.isfinite, self.pole)):
            raise message_error(
                f"electronics.pole is {toml_value(self.pole)}: it must be finite on both axes for a transimpedance "
                "amplifier"
            )
        if (self.carrier_frequency > 0) != (self.carrier_voltage > 0):
            raise message_error(
                f"electronics.carrier_frequency is {toml_value(self.carrier_frequency)} and "
                f"electronics.carrier_voltage is {toml_value(self.carrier_voltage)}: a carrier must have both"
            )
        return self


class Trim(_Trim):
    """Voltages of the tuning and quadrature electrodes, adjusted while the controller runs. In SI units."""

    @property
    def on(self) -> bool:
        return bool(self.tuning != "fixed" or self.quadrature != "fixed")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.on and not self.modulation:
            raise message_error(
                "trim.modulation is 0.0: it must be above 0 for a trim, which finds its voltages by this tone"
            )
        return self


def wrapped(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a scenario with a list of electrodes as the table that holds it."""
    given = tables.get("electrodes")
    return {**tables, "electrodes": {"each": given}} if isinstance(given, list | tuple) else dict(tables)
