"""Facts about a published law, one TOML file for each paper, and the plants of the literature."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from fracgyro.scenario import ScenarioError
from fracgyro.scenario.messages import did_you_mean, scenario_error
from fracgyro.scenario.scales import Scales
from fracgyro.scenario.table import Table, format_value, message_error
from fracgyro.scenario.toml import read_tables, read_text
from fracgyro.scenario.units import UnitError, parse
from pydantic import (
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    WithJsonSchema,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

Seen = Literal["code", "text", "abstract", "citation"]
READ = ("code", "text")  # enough to print "as published"
SEEN_WORDS = {
    "code": "code read",
    "text": "full text read",
    "abstract": "after the abstract",
    "citation": "from memory",
}
OURS = "ours"  # the source of a number that no paper gives
Line = Annotated[str, Field(max_length=300)]
Number = float | list[float]
NUMBER = {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}, "minItems": 1}]}


class Part(Table):
    model_config = ConfigDict(populate_by_name=True)


class Given(Part):
    """A number as it is printed, with its unit and where it is."""

    value: Annotated[Any, PlainValidator(lambda given: _number(given)), WithJsonSchema(NUMBER)]
    unit: str = ""  # "": without one
    source: Line = Field(OURS, alias="from")

    @field_validator("unit")
    @classmethod
    def _unit(cls, unit: str) -> str:
        try:
            if unit:
                parse(unit)
        except UnitError:
            raise _rule('it must be an SI unit such as "N/m", or "" for a number without one') from None
        return unit

    def si(self) -> Number:
        """The value in SI units; as it is without a unit."""
        value: Number = self.value
        return _times(value, float(parse(self.unit).factor) if self.unit else 1.0)

    def used(self, scales: Scales) -> Number:
        """The nondimensional value: the one function that converts published numbers.

        A number without a unit is used as it is.
        """
        if not self.unit:
            return self.si()
        mass, length, time = parse(self.unit).powers[:3]
        scale = scales.mass**mass * scales.length**length * scales.rate ** (-time)
        return _times(self.si(), 1.0 / scale)


class Equation(Part):
    """An equation of the paper, by its number, and the place of the code that evaluates it."""

    number: Line
    place: Line = Field(alias="is")
    source: Line = Field(alias="from")


class Erratum(Part):
    """An error of a paper or its code: as printed, as corrected, and the switch between them."""

    id: str
    printed: Line
    corrected: Line
    switch: str
    effect: Line


class Claim(Part):
    """A claim of the paper in our words. `criterion`: the name of the test that decides it; "": not testable here."""

    text: Line
    criterion: str = ""
    metric: str = ""
    of: list[str] = Field(default_factory=list)
    published: list[float] = Field(default_factory=list)
    source: Line = Field(alias="from")


class Run(Part):
    """A run that the paper publishes: numbers that differ from `given`, and where its figure is."""

    name: str
    source: Line = Field(alias="from")
    given: dict[str, Given] = Field(default_factory=dict)


class Read(Part):
    """The PDF that was read, which stays with its reader."""

    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    pages: int = Field(ge=1)


class Facts(Part):
    """The facts about a published law."""

    doi: str  # "": the paper has none that is known
    title: Line
    year: int = Field(ge=1900, le=2100)
    seen: Seen
    words: Line  # the law in a line
    contender: str  # in `compare track`: the law's kind, options and ranges of gains
    information: Literal["F", "P"] = "F"
    plant: str = "paper"
    reduces_to: Line = ""  # the simplest law that it equals nearly
    remark: Line = ""
    law: dict[str, Any] = Field(default_factory=dict)  # changes of a scenario, in addition to those of the contender
    equation: list[Equation] = Field(default_factory=list)
    given: dict[str, Given] = Field(default_factory=dict)
    erratum: list[Erratum] = Field(default_factory=list)
    claim: list[Claim] = Field(default_factory=list)
    run: list[Run] = Field(default_factory=list)
    pdf: Read | None = None

    @field_validator("doi")
    @classmethod
    def _doi(cls, doi: str) -> str:
        if doi and not re.fullmatch(r"10\.\d{4,9}/\S+", doi):
            raise _rule('it must be a DOI such as "10.1155/2020/8542961", or ""')
        return doi

    @model_validator(mode="after")
    def _consistent(self) -> Facts:
        for name, given in self.every_given():
            if self.seen == "citation" and given.source != OURS:
                raise message_error(
                    f"{name}.from is {format_value(given.source)}: it must be left out, as seen is "
                    f"{format_value(self.seen)}"
                )
        names = [erratum.id for erratum in self.erratum]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise message_error(f"erratum.id is {format_value(twice)} twice: it must be different in each erratum")
        return self

    def every_given(self) -> Iterator[tuple[str, Given]]:
        """All given numbers, with their places in the file."""
        for name, given in self.given.items():
            yield f"given.{name}", given
        for run in self.run:
            for name, given in run.given.items():
                yield f"run.{run.name}.{name}", given

    @property
    def published(self) -> bool:
        """True if the code or the text was read and the file has its numbers, each with a source."""
        sources = [given.source for _, given in self.every_given()]
        return self.seen in READ and bool(sources) and OURS not in sources

    def heading(self, *, own_numbers: bool, gains: str = "tuned by us") -> str:
        """The words over a result, with the numbers of the paper or with other `gains`.

        "As published" is printed only if that is known.
        """
        where = f"doi:{self.doi}" if self.doi else self.title
        if own_numbers and self.published:
            return f"as published in {where}"
        which = {"code": "the code of ", "abstract": "the abstract of "}.get(self.seen, "")
        return f"after {which}{where}{' (from memory)' if self.seen == 'citation' else ''}, {gains}"


class PlantFacts(Part):
    """A plant of the literature."""

    words: Line
    reference_length: Given
    reference_frequency: Given
    mass: Given
    damping: Given  # [xx, xy, yy]
    stiffness: Given
    angular_rate: Given
    force_limit: Given
    amplitude: Given
    frequency: Given
    phase: Given
    offset: Given

    @property
    def scales(self) -> Scales:
        return Scales(*(_one(given.si()) for given in (self.mass, self.reference_length, self.reference_frequency)))

    def changes(self) -> dict[str, Any]:
        """Changes of a scenario. A damping or rate without a unit is nondimensional."""
        scales = self.scales

        def si(given: Given, scale: float) -> Number:
            return given.si() if given.unit else _times(given.value, scale)

        def symmetric(number: Number) -> dict[str, float]:
            return dict(zip(("xx", "xy", "yy"), _list(number), strict=True))

        return {
            "plant.mass": scales.mass,
            "plant.reference_length": scales.length,
            "plant.reference_frequency": scales.rate,
            "plant.damping": symmetric(si(self.damping, scales.damping)),
            "plant.stiffness": symmetric(si(self.stiffness, scales.stiffness)),
            "plant.angular_rate": si(self.angular_rate, scales.rate),
            "controller.force_limit": self.force_limit.used(scales),
            **{f"reference.{name}": _list(getattr(self, name).used(scales)) for name in MOTION},
        }


MOTION = ("amplitude", "frequency", "phase", "offset")


def _rule(rule: str) -> PydanticCustomError:
    """An error of a field whose place and value are added."""
    return PydanticCustomError("rule", "{rule}", {"rule": rule})


def _number(given: Any) -> Number:
    each = given if isinstance(given, list) else [given]
    if not each or not all(type(one) in (int, float) and math.isfinite(one) for one in each):
        raise _rule("it must be a finite number or a list of such")
    return list(map(float, given)) if isinstance(given, list) else float(given)


def _times(value: Number, factor: float) -> Number:
    return [each * factor for each in value] if isinstance(value, list) else value * factor


def _list(value: Number) -> list[float]:
    return value if isinstance(value, list) else [value]


def _one(value: Number) -> float:
    assert not isinstance(value, list)
    return value


FOLDER = files(__package__) / "facts"
PLANTS = "plants"


def read(path: str | os.PathLike[str]) -> Facts:
    """The facts in a TOML file. Raises ScenarioError, in one sentence, for an invalid one."""
    return _facts(read_text(path), str(path))


def _facts(text: str, place: str) -> Facts:
    try:
        return Facts(**read_tables(text, place))
    except ValidationError as error:
        found = scenario_error(error, Facts)
        raise ScenarioError(f"{place}: {found}") from None


@lru_cache
def entries() -> dict[str, Facts]:
    """All entries of the zoo by name, by year."""
    texts = {
        path.name.removesuffix(".toml"): path.read_text(encoding="utf-8")
        for path in FOLDER.iterdir()
        if path.name.endswith(".toml") and path.name != f"{PLANTS}.toml"
    }
    found = {name: _facts(texts[name], f"{name}.toml") for name in sorted(texts)}
    return dict(sorted(found.items(), key=lambda item: (item[1].year, item[0])))


@lru_cache
def plants() -> dict[str, PlantFacts]:
    """The plants of the literature, by name."""
    tables = read_tables((FOLDER / f"{PLANTS}.toml").read_text(encoding="utf-8"), f"{PLANTS}.toml")
    return {name: PlantFacts(**table) for name, table in tables.items()}


def plant(name: str) -> PlantFacts:
    """A plant by name. Raises ScenarioError for an unknown one."""
    if name not in plants():
        raise ScenarioError(f"plant is {format_value(name)}: it must be {' or '.join(plants())}")
    return plants()[name]


def entry(given: str) -> tuple[str, Facts]:
    """The entry of this name, with or without its year, or in this file: its name and facts.

    Raises ScenarioError for anything else.
    """
    if given.endswith(".toml"):
        return Path(given).stem, read(given)
    known = entries()
    short = {name.partition("_")[2]: name for name in known}
    name = given if given in known else short.get(given)
    if name is None:
        raise ScenarioError(
            f"{format_value(given)} is neither an entry of the zoo nor a .toml file{did_you_mean(given, known)}"
        )
    return name, known[name]


def schema() -> dict[str, Any]:
    """JSON Schema of an entry."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Facts.model_json_schema()}
