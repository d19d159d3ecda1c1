"""The live page (integrations/web/live): module, data and scripts in one self-contained file.

`make web` runs `python -m fracgyro.export.live DIR`: the module goes into DIR, the page into DIR/live.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..scenario import Scenario
from ..scenario.kinds import KINDS, MEANINGS, fields_of
from .compilers import SOURCES
from .web import BESIDES, build, document, module_data

FACE = SOURCES / "integrations/web"
OF_LAWS = ("controller", "adaptation", "datasheet")  # tables that belong to a controller

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


def page_data() -> dict[str, Any]:
    """Data of the page: settings of every controller, device and default."""
    base, all_laws = document(Scenario.paper()), laws()

    def settings(scenario: Scenario, tables: Sequence[str]) -> dict[str, Any]:
        said = document(scenario)["settings"]
        return {name: value for name, value in said.items() if name.partition(".")[0] in tables}

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
        "base": {"settings": shared, "scales": base["scales"]},
        "laws": {
            key: {"label": label, "settings": settings(scenario, OF_LAWS)}
            for key, (label, scenario) in all_laws.items()
        },
        "rates": {key: {"label": label, "scenario": changes} for key, (label, changes) in RATES.items()},
        "sensors": {
            key: {
                "label": label,
                "scenario": changes,
                "settings": settings(sensors[key], ("device", "datasheet")) if changes else {},
            }
            for key, (label, changes) in SENSORS.items()
        },
        "devices": devices,
        "defaults": {"command": defaults(Scenario.paper()), "toml": defaults(Scenario())},
    }


def write_page(folder: Path, wasm: Path) -> None:
    """Writes index.html, with the compiled module, into the folder."""
    source = FACE / "live"
    contents = {
        "live.css": (source / "live.css").read_text(encoding="utf-8"),
        "live.mjs": bundled(source / "live.mjs"),
        "worker.mjs": bundled(source / "worker.mjs"),
        "data": packed(json.dumps(page_data(), allow_nan=False).encode()),
        "module": packed(wasm.read_bytes()),
    }
    page = (source / "index.html").read_text(encoding="utf-8")
    for name, content in contents.items():
        page = page.replace(f"{{{{ {name} }}}}", content)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "index.html").write_text(page, encoding="utf-8", newline="\n")


def packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


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
    build(Path(sys.argv[1]))
    write_page(Path(sys.argv[1]) / "live", Path(sys.argv[1]) / "fracgyro.wasm")
