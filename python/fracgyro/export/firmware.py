"""A scenario's controller as a self-contained folder of C++ with a C interface, for a microcontroller."""

from __future__ import annotations

import hashlib
import itertools
import math
import os
import shutil
from importlib.metadata import version
from pathlib import Path

from .. import _core
from ..files import whole_folder
from ..scenario import Scenario, ScenarioError
from ..scenario.bounded import check_bounded
from ..scenario.kinds import ENTRIES, KINDS, Channel, persistent_channels
from ..scenario.scales import si_unit
from ..scenario.to_core import check_single, core_numbers, core_setup, is_plain
from .compilers import SOURCES, Number
from .converters import converters
from .course import course
from .initializers import initializer, list_text
from .settings import check_controller, columns

# Units in the header, by their names there.
UNITS = {
    "length": "q0",
    "velocity": "q0*omega0",
    "force": "m*omega0^2*q0",
    "damping": "m*omega0",
    "stiffness": "m*omega0^2",
    "rate": "omega0",
}


def firmware(
    scenario: Scenario, folder: str | os.PathLike[str], number: Number = "float", *, unbounded: bool = False
) -> None:
    """Writes a scenario's controller as a self-contained folder of C++ with a C interface.

    `number`: number type, "float" or "double". `unbounded`: export even if the bound estimates may grow until the loop
    diverges. The folder is complete or absent. Raises ValueError if the folder cannot be written, a coefficient exceeds
    float, or the controller may become unbounded without `unbounded`.

    >>> fg.export.firmware(fg.Scenario.shipped("hardware"), "firmware")
    """
    check_bounded(scenario, unbounded)
    with whole_folder(folder) as scratch:
        shutil.copytree(SOURCES / "integrations/firmware", scratch, dirs_exist_ok=True)
        add_controller(scenario, number, scratch)


def add_controller(scenario: Scenario, number: Number, folder: Path) -> None:
    """Adds the core and the scenario's coefficients, which are compiled with fracgyro.cpp."""
    header = coefficients_header(scenario, number)
    for layer in ("core", "control", "estimation", "hardware", "controllers"):
        shutil.copytree(SOURCES / "include/fracgyro" / layer, folder / "include/fracgyro" / layer)
    (folder / "fracgyro_coefficients.h").write_text(header, encoding="utf-8", newline="\n")


def coefficients_header(scenario: Scenario, number: Number) -> str:
    """The header with everything that depends on the scenario; equal scenarios give equal text."""
    setup, single = core_setup(scenario), number == "float"
    if single:
        check_single(scenario)
    capacity = -(-max(setup.kernel.count, 1) // 2) * 2
    alignment = 8
    size = -(-_core.state_size(setup, capacity, single) // alignment) * alignment
    values = initializer(_core.coefficients(setup, single), number)
    check_controller(scenario)
    channels, values_by_name = persistent_channels(setup), core_numbers(scenario)
    stiffness = [values_by_name[f"adaptation.initial_stiffness.{entry}"] for entry in ENTRIES]
    scales = scenario.plant.scales
    units = {f"{name.upper()}_UNIT": (scales.of(unit), si_unit(unit)) for name, unit in UNITS.items()}
    units = {"STEP_SECONDS": (scenario.run.step * scales.time, "s"), **units}
    velocity, meaning = {
        "full": (1, "fracgyro_motion must have it"),
        "position": (0, "the velocity in fracgyro_motion is ignored"),
    }[scenario.device.sensing]
    words = converters(scenario, number)
    made = f"fracgyro {version('fracgyro')}, scenario {scenario.content_hash()}, {number}"
    lines = [
        f"/* Made by `fracgyro export firmware`: {made}.",
        " * Do not edit: export again. The scenario is at the end. */",
        "#ifndef FRACGYRO_COEFFICIENTS_H",
        "#define FRACGYRO_COEFFICIENTS_H",
        "",
        f"typedef {number} fracgyro_number;",
        f"#define FRACGYRO_STATE_SIZE {size}",
        f"#define FRACGYRO_STATE_ALIGNMENT {alignment}",
        f"#define FRACGYRO_KEY 0x{hashlib.sha256((made + values).encode()).hexdigest()[:8]}U",
        "",
        "/* SI value = nondimensional value * unit. */",
        *(f"#define FRACGYRO_{name} {scale.hex()} /* {scale:.9g} {unit} */" for name, (scale, unit) in units.items()),
        "",
        *_report(channels),
        "",
        f"#define FRACGYRO_VELOCITY_SENSED {velocity} /* {meaning} */",
        *words.definitions,
        *_counted(scenario),
        "",
        "/* Stiffness of the assumed plant: xx, xy, yy, nondimensional. */",
        f"#define FRACGYRO_NOMINAL_STIFFNESS {list_text(stiffness, number)}",
        "",
        *_example(scenario, setup, channels, number),
        "",
        "#ifdef __cplusplus",
        "#define FRACGYRO_PACKS false",
        '#include "fracgyro/hardware/guard.hpp"',
        '#include "fracgyro/control/course.hpp"',
        '#include "fracgyro/controllers/registry.hpp"',
        *words.includes,
        '#include "fracgyro/hardware/pickoffs.hpp"',
        "",
        "// Unnamed, so that two exported controllers can be linked into one program.",
        "namespace fracgyro_exported {",
        "namespace {",
        "",
        *_controller(setup, number, capacity),
        "",
        *([] if is_plain(scenario) else course(scenario)),
        "// In the order of the fields of Coefficients; omitted ones are 0.",
        f"constexpr fracgyro::Guard<Controller>::Coefficients coefficients = {values};",
        *words.constants,
        "",
        "}  // namespace",
        "}  // namespace fracgyro_exported",
        "#endif",
        "",
        *(f"// {line}".rstrip() for line in scenario.to_toml().splitlines()),
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _counted(scenario: Scenario) -> list[str]:
    """The steps that `make count` counts, where the work of 64 differs from that of the next: two whole spans."""
    if scenario.controller.kind != "lock_in":
        return []
    return [f"#define FRACGYRO_COUNTED_STEPS {2 * scenario.controller.span} /* `make count`: two spans */"]


def _report(channels: tuple[Channel, ...]) -> list[str]:
    """The struct of the controller's reports; C has no empty struct."""
    members = []
    for channel in channels:
        size = f"[{channel.width}]" if channel.dimension else ""
        members.append(f"    fracgyro_number {channel.name}{size}; /* {channel.meaning} */")
    return [
        "/* Reports of the controller: vectors as x, y, symmetric matrices as xx, xy, yy. */",
        f"#define FRACGYRO_REPORTED {sum(channel.width for channel in channels)} /* numbers */",
        "typedef struct {",
        *(members or ["    fracgyro_number unused; /* no reports */"]),
        "} fracgyro_report;",
    ]


def _example(scenario: Scenario, setup: _core.DeviceSetup, channels: tuple[Channel, ...], number: Number) -> list[str]:
    """Data of the example main.c: gyroscope, initial motion and names of the reports."""
    moves = [list(map(float, row)) for row in _core.plant_map(setup)]
    if not all(map(math.isfinite, itertools.chain(*moves))):
        raise ScenarioError(
            f"run.step is {scenario.run.step:g}: over it the motion of this plant is beyond all numbers; it must be "
            "shorter, or damping and stiffness be smaller"
        )
    rows = [list_text(row, number) for row in moves]
    start = list_text((*scenario.run.initial_position, *scenario.run.initial_velocity), number)
    names = [f'"{name}"' for channel in channels for name in columns(channel)] or ['""']
    return [
        "/* For main.c only: the gyroscope over one step, its motion at the start, and the names in fracgyro_report */",
        f"#define FRACGYRO_EXAMPLE_GYROSCOPE {{{', '.join(rows)}}}",
        f"#define FRACGYRO_EXAMPLE_START {start}",
        f"#define FRACGYRO_EXAMPLE_NAMES {{{', '.join(names)}}}",
    ]


def _controller(setup: _core.DeviceSetup, number: Number, capacity: int) -> list[str]:
    """Definition of the controller as a new type rather than an alias, so that its parts appear only in this file."""
    kind, chosen = _core.chosen_type(setup)
    registered = f"fracgyro::RegisteredController<{number}, {kind}, {chosen}>"
    controller = f"fracgyro::SizedController<{registered}, {capacity}>::Type"
    lines = [f"// {KINDS[kind]}"]
    positions_only, filtered = (bandwidth > 0.0 for bandwidth in setup.sensing[:2])
    if positions_only:
        lines.append("// Without a velocity sensor: the velocity in fracgyro_motion is ignored.")
    around = positions_only, filtered, any(setup.sensing[6:8]), any(setup.sensing[8:11]), setup.sensing[11] > 0.0
    if any(around):
        seen = ", ".join(str(each).lower() for each in around)
        controller = f"fracgyro::ForDevice<{controller}, {seen}>::Type"
    return [*lines, f"struct Controller : {controller} {{}};"]
