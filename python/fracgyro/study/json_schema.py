"""JSON Schema of scenario and study files, for editors.

Draft 4, the newest in which 1.0 is not an integer, as in TOML. A schema states the values that each field takes; only
the software checks fields together, such as a definite stiffness or whole steps. taplo, and tools built on it, read
TOML's inf, -inf and nan as null: null is accepted wherever inf is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaMode
from pydantic_core import core_schema

from ..scenario import Scenario, ScenarioError
from ..scenario.messages import paths
from ..scenario.table import AsTuple, format_value
from ..scenario.volts import MAX_ELECTRODES
from .space import Range

KINDS = ("scenario", "study", "tuning")
DRAFT = "http://json-schema.org/draft-04/schema#"
REFERENCE = "#/definitions/{model}"
NUMBERS = {"number", "integer"}
TEXT = r"^ *[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?( +\S|[^\s\d.eE])"  # a number with a unit
Schema = dict[str, Any]


def schema(kind: Literal["scenario", "study", "tuning"]) -> Schema:
    """JSON Schema of a scenario, of a study for `sweep` or of one for `tune`, for editors of TOML.

    Raises ScenarioError for another kind.

    >>> fg.schema("scenario")["properties"]["run"]
    {'$ref': '#/definitions/Run'}
    """
    if kind not in KINDS:
        raise ScenarioError(f"kind is {format_value(kind)}: it must be one of {', '.join(KINDS)}")
    model: type[BaseModel] = Scenario
    if kind == "study":
        from .sweep.design import Study as model
    elif kind == "tuning":
        from .tune.plan import TuningFile as model
    found = _of_model(model)
    if kind == "scenario":
        found["properties"]["disturbance"] = _or_list(found["definitions"], "Disturbance", "AddedEntry")
        electrodes = found["definitions"].pop("Electrodes")
        each = electrodes["properties"]["each"]
        each["maxItems"] = MAX_ELECTRODES
        # The list itself, or electrodes.each, its path in studies; not as `anyOf`, like the disturbance.
        found["properties"]["electrodes"] = {**electrodes, **each, "type": ["object", "array"]}
    else:
        found["definitions"] |= _of_model(Scenario)["definitions"] | {"Range": _of_model(Range)}
        del found["definitions"]["Range"]["$schema"]
        of_fields = {field: {"$ref": _reference(field)} for field in paths(Scenario)}
        found["properties"]["fixed"] = _changes(Scenario, of_fields.__getitem__)
        found["properties"]["vary"] = _changes(Scenario, lambda field: _varied(of_fields[field], found))
        law = found["properties"]["vary"]
        law["properties"]["law"] = {"type": "object"}
        law["patternProperties"] = {r"^law\.": {}}
    return found


class _Generator(GenerateJsonSchema):
    """pydantic's generator for draft 4, without features that TOML lacks."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def float_schema(self, schema: core_schema.FloatSchema) -> Schema:
        found = _draft_4(super().float_schema(schema))
        return {**found, "type": ["number", "null"]} if schema.get("allow_inf_nan") else found

    def int_schema(self, schema: core_schema.IntSchema) -> Schema:
        return _draft_4(super().int_schema(schema))

    def generate(self, schema: core_schema.CoreSchema, mode: JsonSchemaMode = "validation") -> Schema:
        found: Schema = _with_items(super().generate(schema, mode))
        return found

    def nullable_schema(self, schema: core_schema.NullableSchema) -> Schema:
        return self.generate_inner(schema["schema"])

    def function_before_schema(self, schema: core_schema.BeforeValidatorFunctionSchema) -> Schema:
        found = super().function_before_schema(schema)
        convert = schema["function"]["function"]
        expanded = isinstance(convert, AsTuple) and convert.expand
        return {"anyOf": [found["prefixItems"][0], found]} if expanded else found

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> Schema:
        found = super().default_schema(schema)
        if not _is_shown(found.get("default", 0)):
            del found["default"]
        return found


class _WithText(_Generator):
    """Numbers may be text with a unit."""

    def float_schema(self, schema: core_schema.FloatSchema) -> Schema:
        found = super().float_schema(schema)
        number = found["type"] if isinstance(found["type"], list) else [found["type"]]
        return {**found, "type": [*number, "string"], "pattern": TEXT}


def _of_model(model: type[BaseModel]) -> Schema:
    generator = _WithText if model in (Scenario, Range) else _Generator
    found = model.model_json_schema(ref_template=REFERENCE, schema_generator=generator)
    definitions = found.pop("$defs", None)
    return {"$schema": DRAFT, **found} | ({"definitions": definitions} if definitions else {})


def _or_list(definitions: Schema, first: str, others: str) -> Schema:
    """A table or a list of tables, whose first has another model; not as `anyOf`, so that editors name the field."""
    one, other = ({"$ref": REFERENCE.format(model=model)} for model in (first, others))
    listed = {"type": ["object", "array"], "items": [one], "additionalItems": other, "minItems": 1}
    return {**definitions[first], **listed}


def _with_items(found: Any) -> Any:
    """A schema whose entries in their order are `items`, as draft 4 has them, also where a type states its schema."""
    if isinstance(found, dict):
        return {"items" if name == "prefixItems" else name: _with_items(part) for name, part in found.items()}
    return list(map(_with_items, found)) if isinstance(found, list) else found


def _draft_4(found: Schema) -> Schema:
    for strict, limit in {"exclusiveMinimum": "minimum", "exclusiveMaximum": "maximum"}.items():
        if strict in found:
            found |= {limit: found[strict], strict: True}
    return found


def _is_shown(default: Any) -> bool:
    """True if a default can be written in TOML and JSON, and is not a whole table."""
    if isinstance(default, list | tuple):
        return all(map(_is_shown, default))
    return default is not None and not isinstance(default, dict) and default != math.inf


def _reference(field: str) -> str:
    """Reference to the definition of a field of a scenario."""
    model: Any = Scenario
    *tables, name = field.split(".")
    for table in tables:
        model = model.model_fields[table].annotation
    return f"{REFERENCE.format(model=model.__name__)}/properties/{name}" if tables else f"#/properties/{name}"


def _changes(model: type[BaseModel], leaf: Callable[[str], Schema], at: str = "") -> Schema:
    """A table of fields by their dotted paths: dotted keys, quoted keys or nested tables."""
    properties = {}
    for path in paths(model):
        inner: Any = model
        for name in path.split("."):
            inner = inner.model_fields[name].annotation
        field = f"{at}{path}"
        table = isinstance(inner, type) and issubclass(inner, BaseModel)
        properties[path] = _changes(inner, leaf, f"{field}.") if table else leaf(field)
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _is_number(kind: str | list[str] | None) -> bool:
    return not NUMBERS.isdisjoint(kind if isinstance(kind, list) else [kind])


def _varied(of_field: Schema, found: Schema) -> Schema:
    """A list of values of the field, or a range of numbers."""
    listed = {"type": "array", "items": of_field, "minItems": 1}
    node: Any = found
    for name in of_field["$ref"].removeprefix("#/").split("/"):
        node = node[name]
    numeric = any(_is_number(part.get("type")) for part in node.get("anyOf", [node]))
    return {"anyOf": [listed, {"$ref": REFERENCE.format(model="Range")}]} if numeric else listed
