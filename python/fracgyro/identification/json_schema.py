"""JSON Schema (draft 2020-12) of identify.json. Fits may have more entries than are listed here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .quantity import MEANINGS

DRAFT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}
NUMBER: Schema = {"type": "number"}
FLAG: Schema = {"type": "boolean"}


def schema() -> Schema:
    """The schema of the content of identify.json, which `Found.plain` returns.

    >>> fg.identify.schema()["title"]
    'identify.json'
    """
    parts = {
        "version": TEXT,
        "files": {"description": "SHA-256 of each record, by name", **_by_name({"type": "string", "minLength": 64})},
        "known": _known(),
        "notes": _list(TEXT),
        "tests": _list(_table({"name": TEXT, "verdict": {"enum": ["pass", "fail", "skipped"]},
                               "p": _or_null(NUMBER), "words": TEXT})),
        "conditions": _list(_condition()) | {"minItems": 1},
        "trends": _list(_trend()),
        "record_next": _list(_advice()),
        "prediction": _or_null(_table({"scale_factor_ppm": NUMBER, "bias_deg_per_h": NUMBER, "words": TEXT})),
    }  # fmt: skip
    return {"$schema": DRAFT, "title": "identify.json", **_table(parts)}


def _known() -> Schema:
    uncertain = {"description": "value and standard deviation", **_numbers(2)}
    number = _or_null({"type": "number", "exclusiveMinimum": 0})
    return _table(
        {"mass": {"description": "kg", **number}, "pickoff": {"description": "m per unit of x", **number},
         "pickoff_ratio": _or_null(uncertain), "assumed": _by_name(uncertain)}
    )  # fmt: skip


def _quantity() -> Schema:
    determined = {"value": NUMBER, "interval": _numbers(2)}
    return _table(
        {
            "value": _or_null(NUMBER),
            "interval": _or_null(_numbers(2)),
            "unit": TEXT,
            "determined": FLAG,
            "relative": {"description": "per unit of mass, or of the record", **FLAG},
            "meaning": TEXT,
            "note": TEXT,
        }
    ) | {"if": {"properties": {"determined": {"const": False}}}, "else": {"properties": determined}}


def _condition() -> Schema:
    fit = _fit()
    device = _table(
        {"omega0": NUMBER, "parameters": _by_name(NUMBER), "covariance": _list(_list(NUMBER)), "chi_squared": NUMBER}
    )
    parts = {
        "bias": {"description": "V", **_or_null(NUMBER)},
        "temperature": {"description": "K", **_or_null(NUMBER)},
        "quantities": {
            "type": "object",
            "properties": {name: {"description": words, **_quantity()} for name, words in MEANINGS.items()},
            "additionalProperties": False,
        },
        "fits": _list(fit),
        "device": device,
    }
    return _table(parts, required=[name for name in parts if name != "device"])


def _fit() -> Schema:
    """A fit of the first stage; those of decays and forced records have the entries of thermal motion."""
    shared = _table(
        {
            "kind": {"enum": ["decay", "forced", "sweep"]},
            "rate": {"description": "rad/s, of the turntable", **_or_null(NUMBER)},
            "records": _list(TEXT),
            "omega0": {"description": "rad/s, unit of the parameters", "type": "number", "exclusiveMinimum": 0},
            "names": _list(TEXT),
            "parameters": _list(NUMBER),
            "covariance": _list(_list(NUMBER)),
            "noise": {"description": "by record and channel", **_list({"type": ["array", "number"]})},
            "thermal": {"description": "density of the thermal force by axis, units of omega0", **_list(NUMBER)},
            "thermal_deviation": _list(NUMBER),
            "thermal_p": {"description": "probability of this thermal motion without one", **NUMBER},
            "delay": {"description": "s, of a sweep's instrument; of the force of a record, in intervals",
                      "anyOf": [NUMBER, _table({"samples": {"type": "integer", "minimum": 0}, "fraction": NUMBER,
                                                "deviation": _or_null(NUMBER)})]},
            "chi_squared": NUMBER,
            "degrees_of_freedom": {"type": "integer"},
            "cubic": _table({"strength": _list(NUMBER), "deviation": _list(NUMBER), "score": _list(NUMBER),
                             "largest": _list(NUMBER)}),
        },
        ["kind", "rate", "records", "omega0", "names", "parameters", "covariance", "noise", "chi_squared",
         "degrees_of_freedom"],
        more=True,
    )  # fmt: skip
    kind = {"properties": {"kind": {"const": "sweep"}}}
    return {
        **shared,
        "if": kind,
        "then": {"required": ["delay"]},
        "else": {"required": ["thermal", "thermal_p", "cubic"]},
    }


def _advice() -> Schema:
    half = _table({"now": _or_null(NUMBER), "then": _or_null(NUMBER)})
    said = {"description": "half of the 95 % interval, now and with that record; null: not determined"}
    return _table({"name": TEXT, "words": TEXT, "half_intervals": {**said, **_by_name(half)}, "halved": _list(TEXT)})


def _trend() -> Schema:
    return _table(
        {
            "name": TEXT, "over": TEXT, "unit": TEXT, "slope": NUMBER, "slope_interval": _numbers(2),
            "intercept": NUMBER, "agrees": FLAG, "points": _list(_numbers(3)),
        }
    )  # fmt: skip


def _table(properties: Mapping[str, Schema], required: list[str] | None = None, *, more: bool = False) -> Schema:
    needed = list(properties) if required is None else required
    found = {"type": "object", "properties": dict(properties), "required": needed}
    return found if more else {**found, "additionalProperties": False}


def _list(of: Schema) -> Schema:
    return {"type": "array", "items": of}


def _by_name(of: Schema) -> Schema:
    return {"type": "object", "additionalProperties": of}


def _numbers(count: int) -> Schema:
    return {**_list(NUMBER), "minItems": count, "maxItems": count}


def _or_null(of: Schema) -> Schema:
    return {**of, "type": [of["type"], "null"]}
