"""Scenarios for the WebAssembly module (faces/web), as JSON.

Two kinds of file, both read by faces/web/fracgyro.mjs and typed in fracgyro.d.ts. `export` writes one scenario,
whose run equals `fracgyro.simulate` to the bit. `write_module_data` writes what goes with the module: the paper's two
scenarios, and what each setting means and may be. `build` makes the module: `python -m fracgyro.export.web DIR`.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .. import _core
from ..bounded import check_bounded
from ..files import whole_file
from ..scenario import Scenario
from ..table import MOST_STEPS
from .compilers import FLAGS, SOURCES, include, zig
from .settings import CHOICES, core_numbers, describe, limits, settings

TARGET = ["-target", "wasm32-wasi"]
WHOLE_STEPS = {"minimum": 1, "maximum": MOST_STEPS}
# Said by a scenario as they are.
UNSCALED = ["run.duration", "run.step", "run.record_every", "run.mode_tolerance", "controller.order"]

SWITCHES = ["controller.adaptive", "guard.checked"]


def export(scenario: Scenario, path: str | os.PathLike[str], *, unbounded: bool = False) -> None:
    """Writes the scenario.

    Raises ValueError, in one sentence, when it cannot be written, or the controller would not stay bounded (bounded.py)
    and `unbounded` does not say that it need not.
    """
    check_bounded(scenario, unbounded)
    _write({"version": version("fracgyro"), **_document(scenario)}, path)


def write_module_data(path: str | os.PathLike[str]) -> None:
    """Writes what fracgyro.mjs loads beside the module."""
    corrected = Scenario.paper("corrected")
    described: dict[str, Any] = {
        setting.name: {"unit": setting.unit, "description": setting.description, **_limits(setting.path)}
        for setting in settings(corrected)
    }
    described |= {name: {"description": describe(name), **_limits(name)} for name in UNSCALED}
    described |= {name: {"description": describe(name), "choices": choices} for name, choices in _choices().items()}
    described |= {name: {"description": describe(name)} for name in SWITCHES}
    described |= {"disturbance.hold_steps": {"description": "Steps from one noise draw to the next."} | WHOLE_STEPS}
    module = {
        "version": version("fracgyro"),
        "fields": described,
        "paper": {"corrected": _document(corrected), "printed": _document(Scenario.paper("printed"))},
    }
    _write(module, path)


def build(folder: Path) -> None:
    """Leaves in the folder all that a page needs. Raises ValueError in one sentence when there is no zig, or it fails.

    Nothing is linked in, neither a C nor a C++ library: what core/ and sim/ use of C++ is in its headers.
    """
    face, headers = SOURCES / "faces/web", include(SOURCES / "core", SOURCES / "sim")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        compiled = Path(scratch) / "web.o"
        # 128-bit vectors are in every browser since 2023.
        zig("c++", *TARGET, *FLAGS, "-Os", "-msimd128", *headers, "-c", face / "web.cpp", "-o", compiled)
        link = ["-nostdlib", "-s", "-Wl,--no-entry", "-Wl,--export-dynamic", "-Wl,--export=__heap_base"]
        zig("cc", *TARGET, *link, compiled, "-o", folder / "fracgyro.wasm")
    write_module_data(folder / "fracgyro.json")
    for name in ("fracgyro.mjs", "fracgyro.d.ts"):
        shutil.copyfile(face / name, folder / name)


def _document(scenario: Scenario) -> dict[str, Any]:
    numbers = core_numbers(scenario)
    said = {name: getattr(getattr(scenario, name.split(".")[0]), name.split(".")[1]) for name in UNSCALED}
    said |= {"controller.kind": scenario.controller.kind}
    said |= {name: bool(numbers[name]) for name in SWITCHES}
    said |= {name: choices[int(numbers[name])] for name, choices in CHOICES.items()}
    said |= {"disturbance.hold_steps": int(numbers["disturbance.hold_steps"])}
    # JSON has no infinity: null is none.
    said |= {setting.name: setting.value if math.isfinite(setting.value) else None for setting in settings(scenario)}
    scales = {setting.name: setting.scale for setting in settings(scenario) if setting.scale != 1.0}
    return {"settings": said, "scales": scales}


def _choices() -> dict[str, list[str]]:
    return {"controller.kind": list(_core.controller_kinds), **CHOICES}


def _limits(path: str) -> dict[str, Any]:
    """As JSON Schema words them."""
    low, high, strict = (found := limits(path)).low, found.high, found.strict
    words = ("exclusiveMinimum", "exclusiveMaximum") if strict else ("minimum", "maximum")
    return {word: limit for word, limit in zip(words, (low, high), strict=True) if math.isfinite(limit)}


def _write(document: dict[str, Any], path: str | os.PathLike[str]) -> None:
    with whole_file(path, replaces_any=False) as scratch:
        scratch.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    build(Path(sys.argv[1]))
