"""Controllers of the compiled core: the numbers of a run of each kind, and the reports of each kind."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import Annotated, Any, Literal

from pydantic import Field

from .. import _core
from .scales import si_unit
from .table import as_tuple, choice_pair, field, without_default

KINDS: tuple[str, ...] = tuple(_core.controller_kinds)
MEANINGS: tuple[str, ...] = tuple(_core.controller_meanings)
SINE_DRIVES: tuple[str, ...] = tuple(_core.sine_drives)  # kinds that drive x at the frequency of a sine
TWO_SINE_DRIVES: tuple[str, ...] = tuple(_core.two_sine_drives)  # kinds that drive both axes so
PLANT_KINDS: tuple[str, ...] = tuple(_core.plant_kinds)
PLANT_MEANINGS: tuple[str, ...] = tuple(_core.plant_meanings)

Definitions = dict[str, tuple[Any, Any]]  # fields as pydantic's create_model takes them


@dataclass(frozen=True)
class Number:
    """One number of a run: a field of a table of the scenario, or a part of it, [0], .x or .xx."""

    table: str
    field: str
    part: str
    unit: str  # nondimensional
    meaning: str
    low: float
    high: float
    strict: bool  # low < value < high
    infinite: bool  # may be infinity, which switches off
    whole: bool  # an integer
    settable: Literal["any_time", "at_start", "beforehand", "never"]  # same as in fields.hpp
    choices: tuple[str, ...]  # their places are the numbers; of a switch false and true
    kinds: tuple[str, ...]  # the kinds of its table that have it; none: all
    default: float

    @cached_property
    def path(self) -> str:
        return f"{self.table}.{self.field}"

    @cached_property
    def name(self) -> str:
        return self.path + self.part


def _numbers(listed: list[dict[str, Any]]) -> tuple[Number, ...]:
    found = []
    for one in listed:
        units = one["unit"].split(", ")
        place = int(one["part"][1:-1]) if one["part"].startswith("[") else 0
        found.append(Number(**{**one, "unit": units[place] if len(units) > 1 else units[0]}))
    return tuple(found)


@lru_cache
def numbers(kind: str) -> tuple[Number, ...]:
    """The numbers of a run of this kind, in the core's order."""
    return _numbers(_core.fields_of_kind(KINDS.index(kind)))


@lru_cache
def plant_numbers(kind: str) -> tuple[Number, ...]:
    """The numbers that plants of this kind have of their own, in the core's order."""
    return _numbers(_core.fields_of_plant(PLANT_KINDS.index(kind)))


@lru_cache
def filtered_types(kind: str) -> tuple[bool, ...]:
    """True for each type of this kind, in the order of adaptation.kind, that takes a filter of the measured motions."""
    return tuple(_core.filtered_types_of_kind(KINDS.index(kind)))


@lru_cache
def place_of_type(scenario: Any) -> int:
    """The place, among the types of the scenario's kind of controller, of the one that it has."""
    c = scenario.controller
    choices = [number.choices for number in numbers(c.kind) if number.path == "adaptation.kind"]
    return choices[0].index(scenario.adaptation.kind) if choices and c.adaptive else 0


def force_aware_types(kind: str) -> tuple[bool, ...]:
    """True for each type of this kind that receives the force to which a converter rounds its request."""
    return tuple(_core.force_aware_types_of_kind(KINDS.index(kind)))


# Fields of datasheet that the filter of the measured motions needs, whatever the kind.
OF_FILTER = ("force_noise", "position_noise", "velocity_noise", "delay")


# Those that a dynamic rate and a real device add: of the tables rate and device.
DEVICE_NUMBERS = _numbers(_core.device_fields())
# Those of amplifiers and timing, of an electrode, and of a trim, in SI.
ELECTRONICS_NUMBERS = _numbers(_core.electronics_fields())
ELECTRODE_NUMBERS = _numbers(_core.electrode_fields())
TRIM_NUMBERS = _numbers(_core.trim_fields())
# Those of a term of the disturbance.
TERM_NUMBERS = _numbers(_core.term_fields())


def core_values(listed: tuple[Number, ...], tables: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """The listed numbers by name, from tables of nondimensional values: a choice is its place, a switch 0 or 1."""
    found = {}
    for number in listed:
        value = tables[number.table].get(number.field)
        if value is None:  # not set
            found[number.name] = number.default
            continue
        if number.part and not isinstance(value, str):
            value = value[PARTS[number.part] if number.part in PARTS else int(number.part[1:-1])]
        found[number.name] = float(number.choices.index(value) if isinstance(value, str) else value)
    return found


PARTS = {".x": 0, ".y": 1, ".xx": 0, ".xy": 1, ".yy": 2}


@lru_cache
def own_kinds(table: str) -> dict[str, tuple[str, ...]]:
    """The fields of a table with kinds of its own, such as reference, and the kinds that have each; none: all."""
    return {number.field: number.kinds for number in numbers(KINDS[0]) if number.table == table}


@lru_cache
def plants_with(name: str) -> list[str]:
    """The kinds of plants that have this field of their own; none: every kind has it, or there is no such field."""
    return [kind for kind in PLANT_KINDS if any(number.field == name for number in plant_numbers(kind))]


@lru_cache
def fields_of(kind: str, table: str) -> tuple[str, ...]:
    """The fields that controllers of this kind have in this table."""
    return tuple(dict.fromkeys(number.field for number in numbers(kind) if number.table == table))


def kinds_with(path: str) -> list[str]:
    """The kinds that have this field."""
    table, _, name = path.partition(".")
    return [kind for kind in KINDS if name in fields_of(kind, table)]


def table_fields(table: str, *, derived: bool = False, unset: tuple[str, ...] = (), **paper: Any) -> Definitions:
    """The fields of a scenario's table, of all kinds together, as pydantic's create_model takes them.

    `derived`: all but switches may be left out and then follow from the rest of the scenario. `paper`: values of
    the paper instead of the core's own. `unset`: fields without a default. A field that kinds describe differently may
    be left out, and is otherwise checked as its kind describes it (fields_of_its_kind).
    """
    found = {}
    for name, kinds in _descriptions(table).items():
        first, *others = kinds.values()
        if all(other == first for other in others):
            found[name] = _field(first, derived, paper.get(name))
        else:
            meanings = "; ".join(f"{kind}: {parts[0].meaning}" for kind, parts in kinds.items())
            found[name] = (Any, field(None, meanings))
    return found | {name: without_default(*found[name]) for name in unset}


@lru_cache
def fields_of_its_kind(table: str, kind: str) -> Definitions:
    """The fields of this kind that other kinds describe differently."""
    return {
        name: _field(kinds[kind], False, None)
        for name, kinds in _descriptions(table).items()
        if kind in kinds and any(other != kinds[kind] for other in kinds.values())
    }


def _descriptions(table: str) -> dict[str, dict[str, list[Number]]]:
    """By field and kind of controller: the numbers of the field."""
    found: dict[str, dict[str, list[Number]]] = {}
    for kind in KINDS:
        own = [number for number in numbers(kind) if number.table == table and _stated(number)]
        for name, parts in groupby(own, lambda number: number.field):
            found.setdefault(name, {})[kind] = list(parts)
    return found


def si_table_fields(table: str, instead: Mapping[str, Definitions], unset: tuple[str, ...] = ()) -> Definitions:
    """The fields of rate or device, in SI units. `instead`: fields that state one of the core's in other terms.

    `unset`: fields without a default.
    """
    found: Definitions = {}
    listed = [number for number in DEVICE_NUMBERS if number.table == table and _stated(number) and not number.choices]
    for name, parts in groupby(listed, lambda number: number.field):
        found |= instead.get(name) or {name: _si_field(list(parts))}
    return found | {name: without_default(*found[name]) for name in unset}


def plant_fields() -> Definitions:
    """The fields that kinds of plants have of their own, in SI units."""
    found: dict[str, list[Number]] = {}
    for kind in PLANT_KINDS:
        for name, parts in groupby(plant_numbers(kind), lambda number: number.field):
            listed = list(parts)
            if found.setdefault(name, listed) != listed:
                raise ValueError(f"plant.{name} has two meanings among the plants")
    return {name: _si_field(parts) for name, parts in found.items()}


def listed_fields(listed: tuple[Number, ...]) -> Definitions:
    """The fields of a table whose numbers the core has in SI."""
    return {name: _si_field(list(parts), True) for name, parts in groupby(listed, lambda number: number.field)}


def _si_field(parts: list[Number], in_si: bool = False) -> tuple[Any, Any]:
    first = parts[0]
    unit = first.unit if in_si else OTHER_UNITS.get(first.unit) or si_unit(first.unit)
    meaning = first.meaning
    if unit not in ("1", "h"):
        meaning = f"{unit}{', ' if meaning[0] in '[>' else ': '}{meaning}"
    return _field([replace(part, unit=unit, meaning=meaning) for part in parts], False, None, expand=True)


OTHER_UNITS = {"h": "h", "1/K": "ppm/K"}  # that do not follow from those of the plant


MAX_INTEGER = 2**63 - 1
# The nominal plant, which a scenario states as initial_ratio of its plant.
NOMINAL = {"initial_damping", "initial_stiffness", "initial_rate"}


def _stated(number: Number) -> bool:
    """True if a scenario has a field for it: it does not follow from others."""
    return number.settable != "never" and number.field not in NOMINAL


def _field(parts: list[Number], derived: bool, paper: Any, *, expand: bool = False) -> tuple[Any, Any]:
    first = parts[0]
    if first.choices:
        switch = first.choices == ("false", "true")
        default: Any = bool(first.default) if switch else first.choices[int(first.default)]
        if len(parts) == 2:
            return choice_pair(first.choices), field(default, first.meaning)
        return (bool if switch else Literal[first.choices]), field(default, first.meaning)
    limits = _limits(first)
    unit = ", ".join(dict.fromkeys(part.unit for part in parts))
    if len(parts) == 1:
        number: Any = int if first.whole else float
        if derived:
            return number | None, field(None, first.meaning, unit=unit, **limits)
        return number, field(number(first.default) if paper is None else paper, first.meaning, unit=unit, **limits)
    labelled = re.match(r"(?:\S+, )?\[(.*?)\]", first.meaning)
    labels = labelled[1].replace(",", "") if labelled and not first.part.startswith(".") else "x y"
    entry = Annotated[float, Field(**limits)] if limits else float
    entries: Any = tuple.__class_getitem__((entry,) * len(parts))
    expand = (expand or first.strict) and first.part.startswith(".")
    return (
        Annotated[entries, as_tuple(labels, expand=expand)],
        field(tuple(part.default for part in parts) if paper is None else paper, first.meaning, unit=unit),
    )


def _limits(number: Number) -> Mapping[str, Any]:
    low, high = ("gt", "lt") if number.strict else ("ge", "le")
    as_given = int if number.whole else float
    found: dict[str, Any] = {}
    if number.low > -float("inf"):
        found[low] = as_given(number.low)
    if number.high < float("inf"):
        found[high] = as_given(number.high)
    elif number.whole:
        found[high] = MAX_INTEGER
    if number.infinite:
        found["allow_inf_nan"] = True
    return found


@dataclass(frozen=True)
class Channel:
    """One variable of a run: number of columns, their units, and its meaning."""

    name: str
    width: int
    units: tuple[str, ...]  # nondimensional, of every column or of all
    meaning: str
    dimension: str | None  # its columns' dimension: axis, entry, or for an array the first word of its name
    momentary: bool = False  # known only while a step is computed

    @property
    def labels(self) -> list[str] | list[int]:
        """Labels of its columns."""
        if self.dimension == "axis":
            return AXES
        return ENTRIES if self.dimension == "entry" else list(range(self.width))


AXES = ["x", "y"]
ENTRIES = ["xx", "xy", "yy"]


def columns(channels: Iterable[Channel]) -> int:
    """The number of their columns."""
    return sum(channel.width for channel in channels)


def _channels(found: tuple[tuple[str, int, str, str, str, bool], ...]) -> tuple[Channel, ...]:
    dimensions = {"": None, ".x": "axis", ".xx": "entry"}
    return tuple(
        Channel(name, width, tuple(unit.split(", ")), meaning, dimensions.get(part, name.partition("_")[0]), momentary)
        for name, width, unit, meaning, part, momentary in found
    )


METRICS = _channels(_core.metrics)
WINDOWS = ["whole", "transient", "steady"]  # windows of the RMS error
LOOP_CHANNELS = _channels(_core.loop_channels)
DEVICE_CHANNELS = _channels(_core.device_channels)
VOLTS_CHANNELS = _channels(_core.volts_channels)  # in addition with electrodes


@lru_cache
def reports(kind: str) -> tuple[tuple[Channel, ...], ...]:
    """Reports of the controllers of this kind, for each of its types."""
    return tuple(map(_channels, _core.reports_of_kind(KINDS.index(kind))))


def reported_channels(setup: _core.Setup) -> tuple[Channel, ...]:
    """Reports of the controller of a run."""
    kind, chosen = _core.chosen_type(setup)
    return reports(KINDS[kind])[chosen]


def persistent_channels(setup: _core.Setup) -> tuple[Channel, ...]:
    """Reports that are also known between steps."""
    return tuple(channel for channel in reported_channels(setup) if not channel.momentary)
