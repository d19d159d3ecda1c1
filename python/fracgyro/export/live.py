"""The live page (integrations/web/live): module, data and scripts in one self-contained file.

The entry point is `live`, for one scenario. `make web` builds the page of the paper's device: it runs `python -m
fracgyro.export.live DIR`, and the module goes into DIR, the page into DIR/live.
"""

from __future__ import annotations

import base64
import gzip
import json
import os
import re
import string
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..files import whole_file
from ..scenario import Scenario, ScenarioError
from ..scenario.kinds import KINDS, MEANINGS, fields_of
from ..scenario.printing import scenario_text
from ..scenario.terms import first_part, named_terms
from ..scenario.volts_core import has_volts
from .compilers import SOURCES
from .fmu import OF_DISTURBANCE
from .settings import check_plant, settings
from .web import BESIDES, build, build_module, document, module_data

FACE = SOURCES / "integrations/web"
OWN_LAW = "own"
YOURS = "yours"  # a function of the visitor's; settings around it are those of a controller that it replaces
YOUR_LABEL = "a function of your own"
OF_LAWS = ("controller", "adaptation", "datasheet")  # tables that belong to a controller

SPEEDS = {"minimum": 0.1, "maximum": 40.0}  # ms a second
FASTEST = 40_000  # steps a second, as with the maximum of the paper's device
# In steps, as with the paper's device: the times that the plots can show, the bins that they show, and the usual speed.
SHOWN = (2_000, 5_000, 20_000, 80_000)
BIN = 10
SPEED = 7_000

# The page changes the rate, so estimators must not assume that it is constant.
FOLLOWING = {"adaptation.rate_forgetting": 0.5}


def laws() -> dict[str, tuple[str, Scenario]]:
    """Controllers of the page, each with a label and a scenario: the paper's variants, then every other kind."""
    paper = Scenario.paper()
    found = {
        "printed": ("the paper, as printed", Scenario.paper("printed")),
        "corrected": ("the paper, corrected", paper),
        "least_squares": ("the paper with least squares", paper.replace({"adaptation.kind": "composite", **FOLLOWING})),
        "joint": ("the paper with a Kalman filter", paper.replace({"adaptation.kind": "joint", **FOLLOWING})),
    }
    for kind, meaning in zip(KINDS[1:], MEANINGS[1:], strict=True):
        changes: dict[str, Any] = {"controller.kind": kind}
        if "rate_forgetting" in fields_of(kind, "adaptation"):
            changes |= FOLLOWING
        found[kind] = (f"{kind.replace('_', ' ')}: {meaning}", paper.replace(changes))
    return found


# Choices that apply to both runs: a label and changes of the scenario.
RATES: dict[str, tuple[str, dict[str, Any]]] = {
    "constant": ("set by the slider", {}),
    "sine": ("a sine about it", {"rate.kind": "sine", "rate.amplitude": 50.0, "rate.frequency": 300.0}),
}
SENSORS: dict[str, tuple[str, dict[str, Any]]] = {
    "exact": ("exact positions and velocities", {}),
    "positions": (
        "noisy positions only",
        {"device.sensing": "position", "device.position_noise_density": 1e-13},
    ),
}


# Shipped scenarios with presets on the page, and controllers of each in addition to the kinds.
GYROSCOPES: dict[str, dict[str, tuple[str, dict[str, Any]]]] = {
    "dual_mass": {"gradient": ("the paper's adaptation laws", {"adaptation.kind": "gradient"})}
}


def live(scenario: Scenario, path: str | os.PathLike[str], *, name: str = "my.toml") -> None:
    """Writes the live page of a scenario, one HTML file: its run, and any other kind of controller.

    `name`: that of the scenario or its file, for the command that the page shows. Raises ScenarioError for a plant that
    a page cannot simulate, and ValueError if zig is missing, which the extra export installs, or the file cannot be
    written.

    >>> fg.export.live(fg.Scenario.shipped("dual_mass"), "live.html", name="dual_mass")  # doctest: +SKIP
    """
    check_plant(scenario)
    data = scenario_data(scenario, name)
    with whole_file(path, replaces="nothing") as scratch, tempfile.TemporaryDirectory() as folder:
        wasm = Path(folder) / "fracgyro.wasm"
        build_module(wasm)
        scratch.write_text(page(data, wasm), encoding="utf-8", newline="\n")


def scenario_data(
    scenario: Scenario, name: str, more: dict[str, tuple[str, dict[str, Any]]] | None = None
) -> dict[str, Any]:
    """Data of the page of one scenario. Settings that would need other fields of its file are hidden.

    `more`: controllers in addition to the other kinds, each with a label and changes of the scenario.
    """
    base = document(scenario)
    base.get("volts", {}).pop("refusal", None)  # a law without its loop, which a page does not use
    kind = scenario.controller.kind
    found: dict[str, tuple[str, dict[str, Any]]] = {OWN_LAW: (f"the scenario's: {kind.replace('_', ' ')}", {})}
    for other, meaning in zip(KINDS, MEANINGS, strict=True):
        if other != kind and (changes := _changes_to_kind(scenario, other)):
            found[other] = (f"{other.replace('_', ' ')}: {meaning}", changes)
    found |= more or {}
    found[YOURS] = (YOUR_LABEL, {"controller.filter": "none"})
    laws = {key: (label, scenario.replace(changes), changes) for key, (label, changes) in found.items()}
    step = scenario.run.step
    unit = 1e3 * scenario.plant.scales.time  # the unit of time, ms
    maximum = FASTEST * step * unit
    speeds = {"minimum": min(0.1 * unit, maximum / 400), "maximum": maximum}
    windows = [float(f"{steps * step:.6g}") for steps in SHOWN]
    sentence = (
        f"The run of {name} (A); B can be another kind of controller, with its usual gains. The kinds of reference, "
        "disturbance, rate and sensors are those of the scenario and cannot be changed here."
    )
    preset: dict[str, Any] = {"key": "scenario", "title": name, "sentence": sentence, "a": OWN_LAW}
    preset |= {"speed": float(f"{SPEED * step * unit:.3g}"), "window": windows[2]}
    shared = {key: value for key, value in base["settings"].items() if key.partition(".")[0] not in OF_LAWS}
    rest = {key: base[key] for key in ("assumed", "reference", "disturbance", "volts") if key in base}
    return {
        **module_data(),
        "besides": [*BESIDES, "controller.kind"],
        "base": {"settings": shared, "scales": base["scales"], "length": 1e6 * scenario.plant.scales.length, **rest},
        "laws": {
            key: {
                "label": label,
                "settings": _settings(each, OF_LAWS),
                "toml": scenario_text(each, texts=False),
                "changes": changes,
            }
            for key, (label, each, changes) in laws.items()
        },
        "rates": {"constant": {"label": "", "scenario": {}}},
        "sensors": {"exact": {"label": "", "scenario": {}, "settings": {}}},
        "devices": {"constant exact": base.get("device")},
        "hidden": _hidden(scenario),
        "own": {"name": name, "law": OWN_LAW, "density": scenario.disturbance.density is not None},
        "presets": [preset],
        "speeds": speeds,
        "windows": windows,
        "bin": BIN * step,
        "degrees": True,
    }


def _changes_to_kind(scenario: Scenario, kind: str) -> dict[str, Any]:
    """Changes of the scenario for another kind of controller, with its filter if the kind takes one.

    Empty if the kind cannot follow the reference.
    """
    to_kind = {"controller.kind": kind}
    for changes in (to_kind, {**to_kind, "controller.filter": "none"}):
        with suppress(ScenarioError):
            scenario.replace(changes)
            return changes
    return {}


def _hidden(scenario: Scenario) -> list[str]:
    """Shared settings that do not act in this scenario, or that its file could not have."""
    added, first = bool(list(named_terms(scenario))), first_part(scenario)
    acting = ("seed",) if added else (*OF_DISTURBANCE[first["kind"]], "seed")
    found = []
    for setting in settings(scenario):
        number = setting.number
        other_kind = number.kinds and not set(number.kinds) & set(scenario.reference.kinds)
        at_bias = number.path == "plant.stiffness" and has_volts(scenario)  # the file has that without voltages
        of_others = number.table == "reference" and (number.field == "kind" or other_kind)
        if at_bias or of_others or (number.table == "disturbance" and number.field not in acting):
            found.append(setting.name)
    return found


def _settings(scenario: Scenario, tables: Sequence[str]) -> dict[str, Any]:
    said = document(scenario)["settings"]
    return {name: value for name, value in said.items() if name.partition(".")[0] in tables}


def page_data() -> dict[str, Any]:
    """Data of the page of the paper's device: settings of every controller, device and default."""
    base, all_laws = document(Scenario.paper()), laws()

    def defaults(scenario: Scenario) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for kind in reversed(KINDS):
            found |= document(scenario.replace({"controller.kind": kind}))["settings"]
        return found

    shared = {name: value for name, value in base["settings"].items() if name.partition(".")[0] not in OF_LAWS}
    sensors = {key: all_laws["joint"][1].replace(changes) for key, (_, changes) in SENSORS.items()}
    devices = {
        f"{rate} {sensing}": document(sensors[sensing].replace(RATES[rate][1])).get("device")
        for rate in RATES
        for sensing in SENSORS
    }
    return {
        **module_data(),
        "besides": [*BESIDES, "controller.kind"],
        "base": {"settings": shared, "scales": base["scales"], "assumed": base["assumed"]},
        "laws": {
            key: {"label": label, "settings": _settings(scenario, OF_LAWS)}
            for key, (label, scenario) in {**all_laws, YOURS: (YOUR_LABEL, all_laws["pid"][1])}.items()
        },
        "rates": {key: {"label": label, "scenario": changes} for key, (label, changes) in RATES.items()},
        "sensors": {
            key: {
                "label": label,
                "scenario": changes,
                "settings": _settings(sensors[key], ("device", "datasheet")) if changes else {},
            }
            for key, (label, changes) in SENSORS.items()
        },
        "devices": devices,
        "hidden": [],
        "speeds": SPEEDS,
        "windows": [1e-3 * steps for steps in SHOWN],
        "bin": 1e-3 * BIN,
        "degrees": False,
        "gyroscopes": {name: _gyroscope(name, more) for name, more in GYROSCOPES.items()},
        "defaults": {"command": defaults(Scenario.paper()), "toml": defaults(Scenario())},
    }


def _gyroscope(name: str, more: dict[str, tuple[str, dict[str, Any]]]) -> dict[str, Any]:
    """Data of a shipped scenario that replace those of the paper's device in its presets."""
    shared = {*module_data(), "besides", "presets"}
    data = scenario_data(Scenario.shipped(name), name, more)
    return {key: value for key, value in data.items() if key not in shared}


def write_page(folder: Path, wasm: Path) -> None:
    """Writes index.html, the page of the paper's device with the compiled module, into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "index.html").write_text(page(page_data(), wasm), encoding="utf-8", newline="\n")


def page(data: dict[str, Any], wasm: Path) -> str:
    """The page with this data and the compiled module."""
    source = FACE / "live"
    contents = {
        "live.css": (source / "live.css").read_text(encoding="utf-8"),
        "boot.js": (source / "boot.js").read_text(encoding="utf-8"),
        "live": packed(bundled(source / "live.mjs").encode()),
        "worker": packed(bundled(source / "worker.mjs").encode()),
        "data": packed(json.dumps(data, allow_nan=False).encode()),
        "module": packed(wasm.read_bytes()),
    }
    text = (source / "index.html").read_text(encoding="utf-8")
    for name, content in contents.items():
        text = text.replace(f"{{{{ {name} }}}}", content)
    return text


# Those of base 85 that HTML takes for themselves, as in boot.js, in place of Python's.
PYTHONS = string.digits + string.ascii_uppercase + string.ascii_lowercase + "!#$%&()*+-;<=>?@^_`{|}~"
DIGITS = "".join(chr(code) for code in range(ord("!"), ord("~") + 1) if chr(code) not in "\"&'<>\\`{}")
OURS = str.maketrans(PYTHONS, DIGITS)


def packed(content: bytes) -> str:
    return base64.b85encode(gzip.compress(content, 9, mtime=0)).decode().translate(OURS)


IMPORT = re.compile(r'^import \{[^}]*\} from "(\./|\.\./)([\w.]+)";\n', re.MULTILINE)
DECLARED = re.compile(r"^(?:async )?(?:const|let|class|function\*?) (\w+)", re.MULTILINE)


def bundled(script: Path) -> str:
    """The script and its imported modules as one script. Raises ValueError if two declare the same name."""
    parts: dict[Path, str] = {}

    def add(path: Path) -> None:
        text = path.read_text(encoding="utf-8")
        parts.setdefault(path, "")
        for folder, name in IMPORT.findall(text):
            if (imported := (path.parent / folder / name).resolve()) not in parts:
                add(imported)
        del parts[path]  # moves it after its imports
        parts[path] = re.sub(r"^export ", "", IMPORT.sub("", text), flags=re.MULTILINE)

    add(script.resolve())
    # A page from a file cannot start a worker that is a module.
    whole = "\n".join(parts.values()).replace("import.meta.url", "location.href")
    names = DECLARED.findall(whole)
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"{script.name} declares {min(twice)} twice: names must differ in modules that are bundled")
    return whole


if __name__ == "__main__":
    made = Path(sys.argv[1])
    build(made, ["double"])
    write_page(made / "live", made / "fracgyro.wasm")
