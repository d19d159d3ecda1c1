"""Every field of a scenario and every variable of a run, as a page: docs/reference.md.

Nothing is written here that the core's fields() or the tables of a scenario do not say.
`python -m fracgyro.scenario.reference` prints the page again.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from .disturbance import NEEDS, SIZED
from .kinds import (
    DEVICE_CHANNELS,
    KINDS,
    LOOP_CHANNELS,
    MEANINGS,
    METRICS,
    VOLTS_CHANNELS,
    WINDOWS,
    Channel,
    kinds_with,
    numbers,
    reported_channels,
    reports,
)
from .messages import ScenarioError, did_you_mean, paths, unknown
from .printing import OWN_KINDS, having
from .scenario import Scenario
from .table import Table, toml_value
from .to_core import core_setup
from .volts import Electrode, Electrodes

HEAD = """# Scenario reference

Every field of a scenario with its unit, range, default and meaning, and every variable of a run. The unit of time is
1/omega0, of length q0, of mass m: `plant.reference_frequency`, `plant.reference_length` and `plant.mass`; h is
`run.step`. [EQUATIONS.md](../EQUATIONS.md) has the equations in which the fields stand. Made by
`python -m fracgyro.scenario.reference > docs/reference.md` from the core and the tables of a scenario.
"""
FIELDS = ("field", "unit", "range", "default", "meaning")
VARIABLES = ("variable", "unit", "parts", "meaning")


def page() -> str:
    return "\n".join([HEAD, *_kinds(), *_scenario(), *_recorded()])


def _kinds() -> Iterator[str]:
    rows = [(f"`{kind}`", escaped(meaning)) for kind, meaning in zip(KINDS, MEANINGS, strict=True)]
    yield from ["## Controllers", "", *rows_of(("`controller.kind`", "description"), rows)]


def _scenario() -> Iterator[str]:
    scenario = Scenario()
    for name, whole in scenario:
        listed = isinstance(whole, Electrodes)
        yield from [f"## [[{name}]]" if listed else f"## [{name}]", "", sentences_of(type(whole)), ""]
        table: Any = Electrode() if listed else whole
        schema = type(table).model_json_schema()
        groups: dict[tuple[str, ...], list[Sequence[str]]] = {(): []}
        for field, said in schema["properties"].items():
            groups.setdefault(_having(name, field), []).append(_field(name, field, said, table))
        for kinds, rows in groups.items():
            yield from [*textwrap.wrap(f"For {', '.join(kinds)}:", 120), ""] if kinds else []
            yield from rows_of(FIELDS, rows)


def fields_of_kind(kind: str) -> Iterator[Sequence[str]]:
    """Rows of FIELDS: the fields that controllers of this kind have and not all others."""
    for name, table in Scenario():
        for field, said in type(table).model_json_schema()["properties"].items():
            if kind in _having(name, field):
                yield _field(name, field, said, table)


def explained(path: str) -> tuple[str, list[tuple[str, str]]]:
    """Meaning of a field, with its unit, range, default and kinds; of a table, with the meanings of its fields.

    Also the meaning of a channel or a metric of a run. Raises ScenarioError for another name, with the nearest field.
    """
    path = re.sub(r"^(disturbance|electrodes)\[\d+\]\.", r"\1.", path)
    table, _, rest = path.partition(".")
    name, scenario = rest.partition(".")[0], Scenario()
    of_electrode = table == "electrodes" and rest in Electrode.model_fields
    if path not in paths(Scenario) and not of_electrode:
        if found := _explained_result(path):
            return found
        results = {*_channels(), *_metrics()}
        near = did_you_mean(
            path, sorted(results | set(paths(Scenario)) | {of.rpartition(".")[2] for of in paths(Scenario)})
        )
        if near.removeprefix("; did you mean ").removesuffix("?") in results:
            raise ScenarioError(f"{path} is not a known field, channel or metric{near}")
        field = unknown(path, Scenario)
        raise ScenarioError(field if "did you mean" in field else f"{field}, and channels and metrics of runs")
    model = Electrode() if of_electrode else getattr(scenario, table)
    listed = type(model).model_json_schema()["properties"]
    if not name:
        meanings = [(f"{table}.{each}", said["description"]) for each, said in listed.items()]
        return " ".join((type(model).__doc__ or "").split()), meanings
    _, unit, limits, default, _ = (cell.replace("`", "") for cell in _field(table, name, listed[name], model))
    kinds = _kinds_of_disturbance(name) if table == "disturbance" else _having(table, name)
    label = f"{table}.kind" if table in (*OWN_KINDS, "disturbance") else "controllers"
    rows = [("unit", unit), ("range", limits), ("default", default), (label, ", ".join(kinds) or "every kind")]
    return listed[name]["description"], [row for row in rows if row[1] != "–"]


def _kinds_of_disturbance(field: str) -> tuple[str, ...]:
    """The kinds that need the field."""
    return SIZED if field == "amplitude" else tuple(kind for kind, needed in NEEDS.items() if needed == field)


def _channels() -> dict[str, Channel]:
    """All channels of runs, by name."""
    reported = (channel for kind in KINDS for some in reports(kind) for channel in some)
    return {channel.name: channel for channel in (*reported, *DEVICE_CHANNELS, *VOLTS_CHANNELS, *LOOP_CHANNELS)}


def _metrics() -> dict[str, list[Channel]]:
    """All metrics by name; one name for those that differ in their window."""
    found: dict[str, list[Channel]] = {}
    for metric in METRICS:
        name, _, window = metric.name.partition("_")
        found.setdefault(name if window in WINDOWS else metric.name, []).append(metric)
    return found


def _explained_result(name: str) -> tuple[str, list[tuple[str, str]]] | None:
    """Meaning of a channel or a metric, with its unit and parts; None for another name."""
    channel, metrics = _channels().get(name), _metrics().get(name)
    if channel is None and metrics is None:
        return None
    parts = [channel] if channel else metrics or []
    first = parts[0]
    windows = [("windows", ", ".join(part.name.rpartition("_")[2] for part in parts))] if len(parts) > 1 else []
    kinds = [kind for kind in KINDS if any(one.name == name for some in reports(kind) for one in some)]
    controllers = [("controllers", ", ".join(kinds))] if channel and 0 < len(kinds) < len(KINDS) else []
    rows = [
        ("in", "the record of a run" if channel else "the metrics of a run"),
        ("unit", unit_of(", ".join(first.units))),
        ("parts", ", ".join(map(str, first.labels)) if first.dimension else "–"),
        *windows,
        *controllers,
    ]
    meaning = "; ".join(part.meaning for part in parts)
    return meaning, [row for row in rows if row[1] != "–"]


def _having(table: str, field: str) -> tuple[str, ...]:
    """The kinds of controllers, or of the table, that have the field; none: it does not depend on the kind."""
    if table in OWN_KINDS:
        return having(table, field)
    kinds = tuple(kinds_with(f"{table}.{field}"))
    return () if len(kinds) == len(KINDS) else kinds


def _field(table: str, name: str, said: dict[str, Any], model: Table) -> Sequence[str]:
    default = type(model).model_fields[name].default
    shown = "–" if default is None else f"`{toml_value(default)}`"
    return (
        f"`{table}.{name}`",
        unit_of(said.get("unit", "1")),
        range_of(said, default),
        shown,
        escaped(said["description"]),
    )


def range_of(said: dict[str, Any], default: Any) -> str:
    if "anyOf" in said:
        if "enum" in said["anyOf"][0]:
            return f"{range_of(said['anyOf'][0], default)}, or a list of two for x and y"
        return " or ".join(range_of(each, default) for each in said["anyOf"] if each.get("type") != "null")
    if "enum" in said:
        return ", ".join(f"`{choice}`" for choice in said["enum"])
    if "prefixItems" in said:
        entries = said["prefixItems"]
        limits = range_of(entries[0], None)
        return f"{len(entries)} numbers" + ("" if limits == "any" else f", each {limits}")
    if "$ref" in said:
        return "`{xx, xy, yy}`"
    if said["type"] == "array":
        items = said["items"]
        rows = "pairs" if items.get("minItems") == 2 else "rows"
        lists = {"array": f"list of {rows}", "integer": "list of whole numbers"}
        return "list of tables" if "$ref" in items else lists.get(items.get("type"), "list of names")
    words = {"boolean": "`true`, `false`", "string": "text", "object": "table"}
    return words[said["type"]] if said["type"] in words else _limits(said, default)


def _limits(said: dict[str, Any], default: Any) -> str:
    words = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    low, high, above, below = (re.sub(r"e\+?0*", "e", f"{said[word]:g}") if word in said else "" for word in words)
    if low and high:
        limits = f"{low} to {high}"
    elif above and below:
        limits = f"between {above} and {below}"
    else:
        limits = f"> {above}" if above else f"≥ {low}" if low else "any"
    whole = "whole, " if said["type"] == "integer" else ""
    return whole + limits + (" or `inf`" if default == float("inf") else "")


def _recorded() -> Iterator[str]:
    yield from ["## Recorded variables", "", "Every run:", ""]
    yield from rows_of(VARIABLES, map(_variable, LOOP_CHANNELS))
    groups: dict[tuple[str, tuple[Channel, ...]], list[str]] = {}
    for kind in KINDS:
        for adaptation, channels in _reports(kind):
            groups.setdefault((adaptation, channels), []).append(kind)
    for (adaptation, channels), kinds in groups.items():
        of = ", ".join(kinds) + (f", with `adaptation.kind` {adaptation}" if adaptation else "")
        yield from [f"Additional channels of {of}{':' if channels else ': none.'}", ""]
        yield from rows_of(VARIABLES, map(_variable, channels)) if channels else []
    yield from ["Additional channels of a run whose rate moves or whose device is not ideal:", ""]
    yield from rows_of(VARIABLES, map(_variable, DEVICE_CHANNELS))
    yield from ["Additional channels of a run with electrodes:", ""]
    yield from rows_of(VARIABLES, map(_variable, VOLTS_CHANNELS))


def _reports(kind: str) -> Iterator[tuple[str, tuple[Channel, ...]]]:
    """Reports of the controllers of this kind, by adaptation."""
    scenario = Scenario.paper().replace({"controller.kind": kind})
    choices = next((number.choices for number in numbers(kind) if number.path == "adaptation.kind"), ("",))
    for choice in choices:
        changed = scenario.replace({"adaptation.kind": choice}) if choice else scenario
        yield choice, reported_channels(core_setup(changed))


def _variable(channel: Channel) -> Sequence[str]:
    parts = ", ".join(map(str, channel.labels)) if channel.dimension else "–"
    return f"`{channel.name}`", unit_of(", ".join(channel.units)), parts, escaped(channel.meaning)


def unit_of(unit: str) -> str:
    return "–" if unit == "1" else unit.replace("*", " ")


def escaped(text: str) -> str:
    """Text with Markdown's special characters escaped."""
    return text.replace("*", "\\*").replace("|", "\\|")


def sentences_of(table: type[Table]) -> str:
    """Description of the table, the same as in the TOML."""
    return escaped(" ".join((table.__doc__ or "").split()))


def rows_of(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return [*(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)), ""]


if __name__ == "__main__":
    sys.stdout.buffer.write(page().encode())  # the same bytes on every system
