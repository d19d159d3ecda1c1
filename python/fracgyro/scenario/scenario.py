"""A scenario: everything that a run depends on, and its round trip through TOML.

Reading order: schema.py, `Scenario`, messages.py.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from ..arguments import short
from ..files import whole_file
from .checks import check
from .device import Device, Rate
from .disturbance import NEEDS, Disturbance
from .kinds import KINDS
from .messages import ScenarioError, did_you_mean, paths, scenario_error, unknown
from .motion import Reference
from .plants import Constraints, constraints
from .points import FILES
from .printing import (
    BEGIN,
    BY_KIND,
    END,
    OWN_KINDS,
    brief,
    differing,
    fields_of_table,
    fields_shown,
    own_fields,
    scenario_text,
    values,
)
from .quantities import in_si, with_numbers
from .sampled import Function, points_of
from .schema import (
    ERRATA_SWITCHES,
    Adaptation,
    Controller,
    Datasheet,
    Guard,
    Plant,
    Run,
)
from .shipped import NAMES, SHIPPED, shipped_text
from .table import Table, format_value, toml_value
from .toml import read_tables, read_text
from .volts import Electrodes, Electronics, Trim
from .volts_core import drive


def _add_units(schema: dict[str, Any]) -> None:
    """The key `units` at the head of a file, which is read before its tables."""
    others = "[plant], [rate], [device], [[electrodes]], [electronics] and [trim]"
    said = f"Units of plain numbers: with SI those of all tables, otherwise only of {others}."
    schema["properties"]["units"] = {"enum": ["nondimensional", "SI"], "description": said, "type": "string"}


class Scenario(Table):
    """Everything that a run depends on: tables of fields, as plant.mass. Frozen: `replace` makes a changed copy.

    `Scenario()` has the paper's corrected values, as has every table or field that is left out. Raises ScenarioError,
    in one sentence, for a value that is not allowed. Numbers may be text with a unit, which `to_toml` prints as given.

    >>> fg.Scenario.paper().controller.order
    0.9
    >>> fg.Scenario(run={"step": "2 us", "duration": "20 ms"}).run.step
    0.002
    """

    model_config = ConfigDict(json_schema_extra=_add_units)

    plant: Plant = Plant()
    reference: Reference = Reference()
    controller: Controller = Controller()
    adaptation: Adaptation = Adaptation()
    guard: Guard = Guard()
    datasheet: Datasheet = Datasheet()
    disturbance: Disturbance = Disturbance()
    rate: Rate = Rate()
    device: Device = Device()
    electrodes: Electrodes = Electrodes()
    electronics: Electronics = Electronics()
    trim: Trim = Trim()
    run: Run = Run()

    def __init__(self, **tables: Any) -> None:
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise scenario_error(error, Scenario) from None

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """A scenario from a table of its tables, as `Scenario(**obj)`. Raises ScenarioError."""
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            raise scenario_error(error, Scenario) from None

    @classmethod
    def model_validate_json(cls, json_data: str | bytes | bytearray, **options: Any) -> Self:
        """The same from JSON."""
        try:
            return super().model_validate_json(json_data, **options)
        except ValidationError as error:
            raise scenario_error(error, Scenario) from None

    @model_validator(mode="before")
    @classmethod
    def _numbers(cls, tables: Any) -> Any:
        """Text with units becomes numbers; `units`: that of the plain numbers of all tables."""
        return with_numbers(tables, cls) if isinstance(tables, Mapping) else tables

    @model_validator(mode="after")
    def _check(self) -> Self:
        check(self)
        return self

    @classmethod
    def paper(cls, variant: Literal["corrected", "printed"] = "corrected") -> Scenario:
        """The paper's study, eqs (47)-(53), with its errata corrected, or as printed: see docs/errata.md.

        Raises ScenarioError for another `variant`.

        >>> fg.Scenario.paper("printed").controller.rate_law, fg.Scenario.paper().controller.rate_law
        ('printed', 'skew')
        """
        if variant not in ("corrected", "printed"):
            raise ScenarioError(f"variant is {format_value(variant)}: it must be corrected or printed")
        switches = {path: getattr(readings, variant) for path, readings in ERRATA_SWITCHES.items()}
        # The hold is stated, so that a finer step leaves the noise as it is; the tolerance, so that the reproduction
        # has no error of its own.
        return cls().replace({**switches, "disturbance.hold": 1e-3, "run.kernel_tolerance": 1e-6})

    @classmethod
    def shipped(cls, name: str) -> Scenario:
        """A scenario that comes with the package, by a name of `fracgyro scenario --list`.

        Raises ScenarioError for another name.

        >>> fg.Scenario.shipped("dual_mass").device.sensing
        'position'
        """
        if name in SHIPPED:
            return cls.from_toml(shipped_text(name), source=name)
        if name in ("paper", "paper-printed"):
            return cls.paper("corrected" if name == "paper" else "printed")
        near = did_you_mean(str(name), NAMES)
        raise ScenarioError(f"scenario is {format_value(name)}: it must be one of {', '.join(NAMES)}{near}")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scenario:
        """Reads a TOML file, as `save` or a person wrote it.

        Raises ScenarioError, in one sentence, when it cannot be read or is not a scenario.

        >>> fg.Scenario.paper().save("paper.toml")
        >>> fg.Scenario.load("paper.toml") == fg.Scenario.paper()
        True
        """
        return cls.from_toml(read_text(path), source=str(path), folder=Path(path).parent)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the file whole or not at all: neither a reader nor a kill meets half a file.

        Raises ScenarioError when it cannot be written.

        >>> fg.Scenario.paper().replace({"controller.order": 0.8}).save("mine.toml")
        """
        try:
            with whole_file(path) as scratch:
                scratch.write_text(self.to_toml(), encoding="utf-8", newline="\n")
        except ValueError as error:
            raise ScenarioError(str(error)) from None

    @classmethod
    def from_toml(cls, text: str, *, source: str = "the text", folder: str | os.PathLike[str] = Path()) -> Scenario:
        """A scenario from TOML. Missing tables and fields take the paper's corrected values.

        `source` names the text in errors, and files that it names are looked for in `folder`. Raises ScenarioError, in
        one sentence, when the text is not a scenario.

        >>> fg.Scenario.from_toml("controller.order = 0.8").controller.order
        0.8
        """
        if text.startswith(BEGIN) and END not in text:
            raise ScenarioError(f"{source} is cut off: its last line, {END!r}, is missing")
        tables = read_tables(text, source)
        for table, file in FILES.items():
            named = tables.get(table)
            for entry in named if isinstance(named, list) else [named]:
                if isinstance(entry, dict) and isinstance(entry.get(file.field), str):
                    entry[file.field] = str(Path(folder) / entry[file.field])
        return cls(**tables)

    def to_toml(self) -> str:
        """Complete and commented TOML; reading it gives this scenario back, and writing that the same text.

        >>> text = fg.Scenario.paper().to_toml()
        >>> "order = 0.9" in text, fg.Scenario.from_toml(text).to_toml() == text
        (True, True)
        """
        return scenario_text(self)

    def replace(self, changes: Mapping[str, Any]) -> Scenario:
        """A copy with fields changed, by their dotted names, and validated as a whole; None unsets.

        Fields that another controller.kind or controller.filter does not have are dropped. `disturbance` takes a table
        or a list of tables; a number of a list of tables is electrodes[1].bias or disturbance[1].start. Raises
        ScenarioError, in one sentence, for a name or a value that is not allowed, and TypeError for anything but a
        dict.

        >>> fg.Scenario.paper().replace({"controller.order": 0.8, "run.duration": 20.0}).run.duration
        20.0
        """
        if not isinstance(changes, Mapping):
            raise TypeError(f"changes is {short(changes)}: it must be a dict of dotted names to values")
        changed = {re.split(r"[.\[]", str(path))[0] for path in changes}
        kinds = {"controller.kind", "controller.filter"} & set(changes)
        # Tables that stay as they are have been validated; the fields of some depend on the kind of controller.
        kept: dict[str, Any] = {name: table for name, table in self if name not in changed}
        kept = {name: table for name, table in kept.items() if not (kinds and name in BY_KIND)}
        tables: dict[str, Any] = {name: table.model_dump() for name, table in self if name not in kept}
        kind = changes.get("controller.kind", self.controller.kind)
        filtered = str(changes.get("controller.filter", self.controller.filter))
        for name in filter(tables.__contains__, BY_KIND):  # fields that the other kind does not have are dropped
            known = fields_of_table(Scenario, name, kind, filtered) if kind in KINDS else tables[name]
            tables[name] = {field: value for field, value in tables[name].items() if field in known}
        for name in filter(tables.__contains__, OWN_KINDS):
            of = changes.get(f"{name}.kind", tables[name]["kind"])
            kinds_of = tuple(map(str, of)) if isinstance(of, list | tuple) else (str(of),)
            known = own_fields(Scenario, name, kinds_of)
            tables[name] = {field: value for field, value in tables[name].items() if field in known}
        if "disturbance.kind" in changes:
            for kind, field in NEEDS.items():
                if kind != changes["disturbance.kind"]:
                    tables["disturbance"].pop(field, None)
        for path, value in changes.items():
            if isinstance(value, np.ndarray | np.generic):
                value = value.tolist()
            elif isinstance(value, BaseModel):
                value = value.model_dump()
            if found := IN_A_LIST.fullmatch(str(path)):
                entry = _entry(tables[found[1]], found[1], int(found[2]))
                if found[3] not in entry:
                    raise ScenarioError(unknown(str(path), Scenario))
                entry[found[3]] = value
                continue
            if path not in paths(Scenario):
                raise ScenarioError(unknown(str(path), Scenario))
            node: Any = tables
            *parents, leaf = path.split(".")
            for depth, parent in enumerate(parents, start=1):
                node = node.setdefault(parent, {})
                if not isinstance(node, dict):
                    table = ".".join(parents[:depth])
                    raise ScenarioError(f"{table} is {format_value(node)}: it must be a table")
            node[leaf] = value
        return _with_tables(kept, tables)

    def with_reference(self, function: Function, every: int = 1) -> Scenario:
        """A copy that follows a function of time: `function(time)` returns (x, y), in the units of run.units.

        It becomes a table of its values at every `every`-th step, through which a cubic spline passes, so every
        controller and target follows it. Raises ScenarioError if a value is not two finite numbers, or for more than
        100,000 rows.

        >>> circle = fg.Scenario.paper().with_reference(lambda t: (math.cos(t), math.sin(t)), every=20)
        >>> circle.reference.kind, len(circle.reference.points)
        ('table', 4001)
        """
        points = points_of(function, self.plant, self.run, every)
        return self.replace({"reference.kind": "table", "reference.points": points})

    def with_disturbance(self, function: Function, every: int = 1) -> Scenario:
        """A copy with a force added that is a function of time: `function(time)` returns (x, y), in run.units.

        It becomes a table of its values at every `every`-th step, linear in between and zero after the run, and adds to
        the disturbance. Raises ScenarioError if a value is not two finite numbers, or for more than 100,000 rows.

        >>> pull = fg.Scenario.paper().with_disturbance(lambda t: (100 * math.exp(-t), 0.0), every=20)
        >>> pull.disturbance.kinds, len(pull.disturbance.added[0].points)
        ('noise + table', 4001)
        """
        table = {"kind": "table", "points": points_of(function, self.plant, self.run, every, "disturbance")}
        first = {name: value for name, value in self.disturbance if name != "added"}
        if self.disturbance.kind == "none" and not self.disturbance.added:
            return self.replace({"disturbance": {"seed": self.disturbance.seed, **table}})
        return self.replace({"disturbance": [first, *map(dict, self.disturbance.added), table]})

    def in_si(self) -> Scenario:
        """The same scenario, whose `to_toml` has every number with a unit as text in SI: time as "1 us".

        >>> fg.Scenario.paper().in_si() == fg.Scenario.paper()
        True
        """
        return self.replace(in_si(self, fields_shown(self)))

    def constraints(self) -> Constraints:
        """The limits of force, motion and angular rate, in the units of `run.units`; infinite for no limit.

        >>> fg.Scenario.paper().constraints().angular_rate
        0.1
        """
        si = self.run.units == "SI"
        drives = min(drive(self)[0])
        return constraints(self.plant, self.rate, self.device, self.controller.force_limit, drives, si)

    def differences(self, other: Scenario) -> dict[str, tuple[Any, Any]]:
        """Fields whose values differ, by dotted name, with both values; None: not set, or no field of that kind.

        Those of a term of a list have its place in their names, as disturbance[1].start.

        >>> fg.Scenario.paper().differences(fg.Scenario.paper().replace({"controller.order": 0.8}))
        {'controller.order': (0.9, 0.8)}
        """
        mine, theirs = values(self), values(other)
        pairs = {name: (mine.get(name), theirs.get(name)) for name in dict.fromkeys([*mine, *theirs])}
        return dict(differing(pairs))

    def changes(self) -> dict[str, Any]:
        """Fields that differ from the defaults of the kind of controller, by dotted name, for `replace`.

        >>> fg.Scenario().replace({"controller.order": 0.8}).changes()
        {'controller.order': 0.8}
        """
        kind = {"controller.kind": self.controller.kind}
        default = values(Scenario().replace(kind))
        found = {} if self.controller.kind == KINDS[0] else kind
        for name, value in values(self).items():
            table, _, field = name.partition(".")
            usual = default[name] if name in default else type(getattr(self, table)).model_fields[field].default
            if value != usual:
                found[name] = value
        return found

    def __str__(self) -> str:
        lines = [
            name + (" is " if new is None else " = ") + toml_value(brief(new)) for name, new in self.changes().items()
        ]
        return "\n".join(lines) or "the paper's values"

    def __repr__(self) -> str:
        return f"Scenario().replace({ {name: brief(new) for name, new in self.changes().items()} })"

    def content_hash(self) -> str:
        """SHA-256 of `to_toml` with plain numbers, in hexadecimal: equal for equal scenarios.

        >>> fg.Scenario.paper().content_hash() == fg.Scenario.paper().replace({}).content_hash()
        True
        """
        return hashlib.sha256(scenario_text(self, texts=False).encode()).hexdigest()


IN_A_LIST = re.compile(r"(electrodes|disturbance)\[(\d{1,4})\]\.(\w+)")


def _entry(table: Any, name: str, place: int) -> dict[str, Any]:
    """The table of a list, as TOML counts them, in a table that may be changed. Raises ScenarioError if it has none."""
    field = "each" if name == "electrodes" else "added"
    if not isinstance(table, dict):
        raise ScenarioError(f"{name} and {name}[{place}] are both given: at most one of the two can be")
    table[field] = [dict(entry) for entry in table[field]]
    entries: list[dict[str, Any]] = table[field] if name == "electrodes" else [table, *table[field]]
    if place >= len(entries):
        count = f"{len(entries)} {'electrodes' if name == 'electrodes' else 'disturbances'}"
        raise ScenarioError(f"{name}[{place}] is not in the scenario: it has {count}, from 0 on")
    return entries[place]


def _with_tables(kept: dict[str, Any], changed: dict[str, Any]) -> Scenario:
    """The scenario `Scenario(**kept, **changed)`, of whose tables only those are validated that are not models yet."""
    try:
        tables = with_numbers({**kept, **changed}, Scenario)
        for name, table in tables.items():
            if not isinstance(table, BaseModel):
                tables[name] = type(getattr(DEFAULT, name)).model_validate(table)
        found = Scenario.model_construct(**tables)
        check(found)
        return found
    except (ValidationError, PydanticCustomError):
        return Scenario(**kept, **changed)  # raises the error of the whole, in one sentence


DEFAULT = Scenario()


def check_scenario(scenario: object) -> None:
    """Raises TypeError unless it is one."""
    if not isinstance(scenario, Scenario):
        raise TypeError(f"scenario is {short(scenario)}: it must be a Scenario")
