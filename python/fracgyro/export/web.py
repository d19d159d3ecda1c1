"""Scenarios for the WebAssembly module (integrations/web), as JSON.

There are two kinds of files, both read by integrations/web/fracgyro.mjs and typed in fracgyro.d.ts. `web` writes one
scenario, whose run equals `fracgyro.simulate` to the bit. `write_module_data` writes the module's data: the paper's two
scenarios, and meaning and range of each setting. `build` compiles the modules; live.py builds the live page.
`python -m fracgyro.export.web FOLDER` writes all files but the live page.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Any, get_args

from ..files import Replaced, whole_file
from ..scenario import Scenario, ScenarioError
from ..scenario.bounded import check_bounded
from ..scenario.device import Device
from ..scenario.device_core import is_ideal, profiles, transverse_list
from ..scenario.kinds import (
    DEVICE_CHANNELS,
    DEVICE_NUMBERS,
    KINDS,
    LOOP_CHANNELS,
    OF_FILTER,
    TERM_NUMBERS,
    VOLTS_CHANNELS,
    Channel,
    Number,
    numbers,
    reports,
)
from ..scenario.schema import Controller, Datasheet, Run
from ..scenario.terms import named_terms
from ..scenario.to_core import datasheet
from .compilers import FLAGS, SOURCES, include, zig
from .compilers import Number as Precision
from .settings import (
    check_controller,
    check_rounding,
    columns,
    device_numbers,
    meaning,
    offered,
    reference_lists,
    settings,
    unit,
    volts,
)

TARGET = ["-target", "wasm32-wasi"]
# JSON Schema of the scenario's fields that are not numbers of the core.
BESIDES: dict[str, dict[str, Any]] = {
    f"{table}.{name}": model.model_json_schema()["properties"][name]
    for table, model, names in (
        ("run", Run, ("duration", "record_every", "kernel_tolerance")),
        ("device", Device, ("sensing",)),
        (
            "controller",
            Controller,
            ("filter", "observer_bandwidth", "event_threshold", "event_share", "compensation_bandwidth"),
        ),
    )
    for name in names
}
_KNOWN = Datasheet.model_json_schema()["properties"]
BESIDES |= {
    f"datasheet.pickoff_gain_error[{axis}]": {"unit": "1", "description": _KNOWN["pickoff_gain_error"]["description"]}
    | entry
    for axis, entry in enumerate(_KNOWN["pickoff_gain_error"]["prefixItems"])
}
BESIDES["datasheet.pickoff_misalignment"] = _KNOWN["pickoff_misalignment"]
SWITCH = ("false", "true")


def web(scenario: Scenario, path: str | os.PathLike[str], *, unbounded: bool = False) -> None:
    """Writes a scenario as JSON for the WebAssembly module; its run equals `fracgyro.simulate` to the bit.

    `unbounded`: export even if the bound estimates may grow until the loop diverges. Raises ValueError if the file
    cannot be written, or the controller may become unbounded without `unbounded`.

    >>> fg.export.web(fg.Scenario.shipped("hardware"), "gyro.json")
    """
    check_bounded(scenario, unbounded)
    _write({"version": version("fracgyro"), **document(scenario)}, path, "nothing")


def write_module_data(path: str | os.PathLike[str]) -> None:
    """Writes the data that fracgyro.mjs loads with the module."""
    paper = {name: document(Scenario.paper(name)) for name in ("corrected", "printed")}
    _write({**module_data(), "paper": paper}, path, "its kind")


def module_data() -> dict[str, Any]:
    """Data of the module: names, ranges and meanings of settings, and reports of each controller kind."""
    return {
        "version": version("fracgyro"),
        "fields": _fields(),
        "loop": _columns(LOOP_CHANNELS),
        "device": _columns(DEVICE_CHANNELS),
        "volts": _columns(VOLTS_CHANNELS),
        "device_numbers": {number.name: _allowed(number) for number in DEVICE_NUMBERS},
        "term_numbers": {number.name: _allowed(number) for number in TERM_NUMBERS},
        "kinds": {kind: _kind(kind) for kind in KINDS},
        "momentary": sorted({c.name for kind in KINDS for of in reports(kind) for c in of if c.momentary}),
    }


MODULES = {"double": "fracgyro.wasm", "float": "fracgyro-single.wasm"}  # by the precision of their controllers


def build(folder: Path, precisions: Sequence[Precision] = get_args(Precision)) -> None:
    """Builds the modules and all files of a page into the folder. Raises ValueError if zig is missing or fails."""
    face = SOURCES / "integrations/web"
    folder.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor() as compilers:
        list(compilers.map(lambda precision: build_module(folder / MODULES[precision], precision), precisions))
    write_module_data(folder / "fracgyro.json")
    shutil.copyfile(face / "fracgyro.mjs", folder / "fracgyro.mjs")
    types = (face / "fracgyro.d.ts").read_text(encoding="utf-8") + settings_types()
    (folder / "fracgyro.d.ts").write_text(types, encoding="utf-8", newline="\n")


def build_module(path: Path, precision: Precision = "double") -> None:
    """Builds the WebAssembly module, which has no loop for float. Raises ValueError if zig is missing or fails.

    No C or C++ library is linked: core/ and sim/ use only headers of the C++ library.
    """
    headers, source = include(SOURCES / "include"), SOURCES / "integrations/web/web.cpp"
    with tempfile.TemporaryDirectory() as scratch:
        compiled = Path(scratch) / "web.o"
        # Every browser since 2023 has 128-bit vectors.
        small = ["-Os", "-Xclang", "-fmerge-functions", "-fno-sanitize=all"]  # zig's traps cost time, too
        single = ["-DFRACGYRO_SINGLE"] if precision == "float" else []
        zig("c++", *TARGET, *FLAGS, *small, *single, "-msimd128", *headers, "-c", source, "-o", compiled)
        link = ["-nostdlib", "-s", "-Wl,--no-entry", "-Wl,--export-dynamic"]
        zig("cc", *TARGET, *link, compiled, "-o", path)


def settings_types() -> str:
    """TypeScript types of the settings: one for all kinds, and one for each group of kinds with the same settings."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for kind in KINDS:
        groups.setdefault(tuple(number.name for number in offered(kind)), []).append(kind)
    of_all = set.intersection(*map(set, groups))
    typed = {name: _union(schema["enum"]) if "enum" in schema else "number" for name, schema in BESIDES.items()}
    typed |= {number.name: _type(number) for kind in KINDS for number in offered(kind)}
    shared = {name: said for name, said in typed.items() if name in of_all or name in BESIDES}
    blocks = ["/** Settings of every controller kind. */", *_interface("CommonSettings", shared)]
    names = []
    for group, kinds in groups.items():
        names.append("".join(map(str.capitalize, kinds[0].split("_"))) + "Settings")
        own = {"controller.kind": _union(kinds)} | {name: typed[name] for name in group if name not in of_all}
        blocks += ["", *_interface(f"{names[-1]} extends CommonSettings", own)]
    return "\n".join([*blocks, "", f"export type Settings = {' | '.join(names)};", ""])


def _interface(head: str, members: dict[str, str]) -> list[str]:
    return [f"export interface {head} {{", *(f'  "{name}": {said};' for name, said in members.items()), "}"]


def _type(number: Number) -> str:
    if number.choices:
        return "boolean" if number.choices == SWITCH else _union(number.choices)
    return "number | null" if number.infinite else "number"


def _union(words: Sequence[str]) -> str:
    return " | ".join(f'"{word}"' for word in words)


def document(scenario: Scenario) -> dict[str, Any]:
    """A scenario in the JSON format of fracgyro.mjs."""
    said: dict[str, Any] = {name: _stated(scenario, name) for name in BESIDES}
    said["controller.kind"] = scenario.controller.kind
    listed = settings(scenario)
    for setting in listed:
        value, choices = setting.value, _choices(setting.number)
        # JSON has no infinity: null means no limit.
        said[setting.name] = choices[int(value)] if choices else value if math.isfinite(value) else None
    scales = {setting.name: setting.scale for setting in listed if setting.scale != 1.0}
    assumed = datasheet(scenario)
    found: dict[str, Any] = {"settings": said, "scales": scales}
    found["assumed"] = {name: float(getattr(assumed, name)) for name in OF_FILTER}  # for controller.filter
    lists = dict(zip(("terms", "rows"), reference_lists(scenario), strict=True))
    if any(lists.values()):
        found["reference"] = lists
    if not is_ideal(scenario):
        found["device"] = _device(scenario)
    if in_volts := volts(scenario):
        found["volts"] = _volts(scenario, in_volts)
    if terms := list(named_terms(scenario)):
        found["disturbance"] = terms
    return found


def _stated(scenario: Scenario, name: str) -> Any:
    """The value of a field, or of a part of it: [0] or [1]."""
    path, _, part = name.partition("[")
    value = attrgetter(path)(scenario)
    return value[int(part[0])] if part else value


def _device(scenario: Scenario) -> dict[str, Any]:
    """Numbers of a dynamic rate and a real device by name, and the points of the rate and the temperature."""
    rate, temperature = map(list, profiles(scenario))
    # JSON has no infinity: null is none.
    named = {name: value if math.isfinite(value) else None for name, value in device_numbers(scenario).items()}
    across = transverse_list(scenario)
    return {"numbers": named, "rate": rate, "temperature": temperature, "transverse": across}


def _volts(scenario: Scenario, numbers: list[float]) -> dict[str, Any]:
    """Numbers of a device in volts, and why its controller cannot be used without the loop."""
    listed = [number if math.isfinite(number) else None for number in numbers]
    found: dict[str, Any] = {"electrodes": len(scenario.electrodes.each), "numbers": listed}
    try:
        check_controller(scenario)
        check_rounding(scenario)
    except ScenarioError as error:
        found["refusal"] = str(error)
    return found


def _fields() -> dict[str, Any]:
    """Meaning and range of every setting of all kinds."""
    found: dict[str, Any] = {name: _besides(schema) for name, schema in BESIDES.items()}
    kind = type(Scenario().controller).model_fields["kind"]
    found["controller.kind"] = {"description": kind.description, "choices": KINDS, "fixed": True}
    for number in (number for kind in KINDS for number in offered(kind)):
        fixed = number.settable != "any_time" or number.table == "run"
        words = {"whole": number.whole, "infinite": number.infinite, "fixed": fixed}
        said = {word: True for word, so in words.items() if so}
        if choices := _choices(number):
            found[number.name] = {"description": meaning(number), "choices": choices, **said}
        else:
            found[number.name] = {"unit": unit(number), "description": meaning(number), **_limits(number), **said}
    return found


def _besides(schema: dict[str, Any]) -> dict[str, Any]:
    words = ("unit", "description", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    found = {word: schema[word] for word in words if word in schema}
    choices = {"choices": schema["enum"]} if "enum" in schema else {}
    return found | choices | ({"whole": True} if schema["type"] == "integer" else {}) | {"fixed": True}


def _kind(kind: str) -> dict[str, Any]:
    """Numbers of a controller kind in the core's order, by name or, if fixed, by value; and reports of its types."""
    given = {number.name for number in offered(kind)} | {"run.steps"}
    listed = [number.name if number.name in given else number.default for number in numbers(kind)]
    return {"numbers": listed, "reported": [_columns(channels) for channels in reports(kind)]}


def _columns(channels: Sequence[Channel]) -> list[str]:
    return [name for channel in channels for name in columns(channel)]


def _choices(number: Number) -> list[str | bool]:
    return [False, True] if number.choices == SWITCH else list(number.choices)


def _allowed(number: Number) -> dict[str, Any]:
    """Values of a number that is handed over as the core takes it: a choice by its place."""
    if number.choices:
        return {"minimum": 0, "maximum": len(number.choices) - 1, "whole": True}
    words = {"whole": number.whole, "infinite": number.infinite}
    return {**_limits(number), **{word: True for word, so in words.items() if so}}


def _limits(number: Number) -> dict[str, Any]:
    """Limits of a number in JSON Schema."""
    words = ("exclusiveMinimum", "exclusiveMaximum") if number.strict else ("minimum", "maximum")
    limits = zip(words, (number.low, number.high), strict=True)
    return {word: limit for word, limit in limits if math.isfinite(limit)}


def _write(document: dict[str, Any], path: str | os.PathLike[str], replaces: Replaced) -> None:
    with whole_file(path, replaces=replaces) as scratch:
        scratch.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    build(Path(sys.argv[1]))
