"""A scenario's controller as a self-contained folder of Verilog, with what simulates and routes it."""

from __future__ import annotations

import os
import re
import shutil
from importlib.metadata import version
from pathlib import Path

from fracgyro.export.settings import columns
from fracgyro.extras import require
from fracgyro.files import whole_folder
from fracgyro.scenario import Scenario
from fracgyro.scenario.bounded import check_bounded
from fracgyro.scenario.kinds import persistent_channels
from fracgyro.scenario.to_core import core_setup

from .arithmetic import HardwareNumber
from .graph import ENTRY, Graph, trace
from .microcode import Microcode
from .proof import check
from .routines import routines
from .schedule import Machine, schedules
from .template import constants_hex, deciding, in_bits, microcode_hex, out_bits, state_words, values

VERILOG = Path(__file__).parent / "verilog"


def fpga(
    scenario: Scenario,
    folder: str | os.PathLike[str],
    number: HardwareNumber = "float",
    *,
    unbounded: bool = False,
) -> None:
    """Writes a scenario's controller as a self-contained folder of Verilog, whole or not at all.

    number: float, with the bits of the firmware; or fixed, 48 bits of which 28 are after the point. Raises ValueError,
    in one sentence, when the folder cannot be written, the controller cannot be hardware, or it may become unbounded
    without `unbounded`.

    >>> from fracgyro_fpga import fpga
    >>> fpga(fg.Scenario.shipped("hardware").replace({"controller.kind": "pid"}), "hardware")
    """
    check_bounded(scenario, unbounded)
    require("export", "jinja2")
    with whole_folder(folder) as scratch:
        code = compiled(trace(scenario, number))
        made = f"fracgyro {version('fracgyro')}, scenario {scenario.content_hash()}, {number}"
        files = {
            "controller.v": _controller(code, made),
            "controller.hex": microcode_hex(code),
            "constants.hex": constants_hex(code),
            "controller.h": _header(scenario, code, made),
            "cycles.md": _cycles(scenario, code),
            "scenario.toml": scenario.to_toml(),
        }
        for name in ("digits.v", "pins.lpf", "testbench.cpp", "Makefile", "README.md"):
            shutil.copyfile(VERILOG / name, scratch / name)
        arithmetic = code.graph.arithmetic
        shutil.copyfile(VERILOG / arithmetic.units, scratch / "units.v")
        spi = (VERILOG / "spi.v").read_text(encoding="utf-8")
        files["spi.v"] = _sized(spi, WORD=arithmetic.word, IN_BITS=in_bits(code), OUT_BITS=out_bits(code))
        for name, text in files.items():
            (scratch / name).write_text(text, encoding="utf-8", newline="\n")


def compiled(graph: Graph) -> Microcode:
    """Verified microcode of a traced controller."""
    machine = Machine(dividers=graph.arithmetic.dividers)
    code = Microcode(graph, machine, schedules(routines(graph), machine, deciding(graph)))
    check(code)
    return code


def _controller(code: Microcode, made: str) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(VERILOG),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template("controller.v.jinja").render(made=made, **values(code))


def _sized(text: str, **parameters: int) -> str:
    """A module of Verilog with other values of its parameters."""
    for name, value in parameters.items():
        text = re.sub(rf"parameter {name} = \d+", f"parameter {name} = {value}", text)
    return text


def _cycles(scenario: Scenario, code: Microcode) -> str:
    """Cycles of each routine."""
    machine = code.machine
    rows = [
        f"| {number} | {len(one.routine.programs)} | {len(one.routine.operations)} | {one.settled + ENTRY + 1} "
        f"| {one.cycles + ENTRY} |"
        for number, one in enumerate(code.schedules[:-1])
    ]
    longest = max(one.cycles for one in code.schedules[:-1]) + ENTRY
    period = scenario.run.step * scenario.plant.scales.time * 1e6
    lines = [
        "# Cycles of a step",
        "",
        f"{machine.adders} adders, {machine.multipliers} multipliers; units for quotients: {machine.dividers}, "
        f"for roots: {machine.roots}.",
        "A routine serves programs that differ in what they write. Its cycles are those of a step whose program is the",
        "expected one. Where a step decides otherwise than the one before, the routines that this leads to run one",
        "after another: two, seldom three. Where only a comparison comes out otherwise, the force comes up to "
        f"{deciding(code.graph)} cycles",
        "later.",
        "",
        f"The scenario has a sample every {period:.4g} µs. The longest routine ends in this time from "
        f"{longest / period:.4g} MHz on.",
        "",
        "| routine | programs | operations | from start to force | to ready |",
        "|---|---|---|---|---|",
        *rows,
    ]
    return "\n".join(lines) + "\n"


def _header(scenario: Scenario, code: Microcode, made: str) -> str:
    """For the test bench, and for what reads the report: its numbers by index."""
    arithmetic = code.graph.arithmetic
    scales = scenario.plant.scales
    names = [name for channel in persistent_channels(core_setup(scenario)) for name in columns(channel)]
    lines = [
        f"/* Made by `fracgyro export fpga`: {made}. */",
        f"#define FRACGYRO_LENGTH {scales.length!r} /* m: what a position is divided by */",
        f"#define FRACGYRO_VELOCITY {scales.velocity!r} /* m/s: what a rate of it is divided by */",
        f"#define FRACGYRO_FORCE {scales.force!r} /* N: what a force is multiplied by */",
        f"#define FRACGYRO_REPORTED {len(names)} /* numbers; by out_index: */",
        *(f"/* {index}: {name} */" for index, name in enumerate(names)),
        f"#define FRACGYRO_WORD {arithmetic.word} /* bits */",
        f"#define FRACGYRO_FRACTION {arithmetic.fraction} /* of them after the point; 0: it floats */",
        f"#define FRACGYRO_STATE {state_words(code)} /* words: from out_index FRACGYRO_REPORTED, in_index 4 on */",
    ]
    return "\n".join(lines) + "\n"
