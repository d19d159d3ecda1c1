"""Export as FMU for co-simulation, FMI 2.0 or 3.0: the closed loop with its plant, or only the controller.

The entry point is `fmu`. The C++ code is in integrations/fmu; this module writes a header with the FMU's variables,
numbers and kernel, the model description and the archive. The same scenario and the same compilers give the same bytes.
"""

from __future__ import annotations

import hashlib
import importlib.util
import math
import os
import platform
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Literal, NamedTuple

from .. import _core
from ..extras import needs
from ..files import whole_file
from ..scenario import Scenario, ScenarioError
from ..scenario.bounded import check_bounded
from ..scenario.device_core import device_channels, is_ideal, profiles, transverse_list
from ..scenario.kinds import LOOP_CHANNELS, SINE_DRIVES, reported_channels
from ..scenario.terms import first_part, term_list, terms
from ..scenario.to_core import check_single, core_setup
from ..scenario.volts_core import NO_ELECTRODES
from .compilers import FLAGS, SOURCES, Number, include, join_macos, system_compiler, zig
from .converters import amplifier_volts, driver
from .settings import (
    check_rounding,
    columns,
    core_kernel,
    core_numbers,
    device_numbers,
    device_settings,
    knows_rounding,
    meaning,
    reference_lists,
    sensing,
    settings,
    unit,
    without_plant,
)
from .settings import volts as device_in_volts
from .units import base_unit, scale_and_unit

Content = Literal["loop", "controller"]
Fmi = Literal["2.0", "3.0"]
System = Literal["linux", "linux-arm", "windows", "macos"]
Reference = Literal["scenario", "input"]
Units = Literal["V"]
Role = Literal["time", "constant", "fixed", "tunable", "input", "output"]

MAX_DOUBLE = sys.float_info.max  # replaces infinity, which some importers cannot read
MAX_SEED = 2**31 - 1  # largest integer of FMI
MAX_TOGETHER = 10**7  # steps per call of the importer, as in integrations/fmu/instance.hpp
FIRST_DATE = (1980, 1, 1, 0, 0, 0)  # date of every file in the archive, for reproducible bytes
INPUTS = ("position", "velocity")
REFERENCE_INPUTS = {"position": "q0", "velocity": "q0*omega0", "acceleration": "q0*omega0^2"}
NOT_OF_THE_CONTROLLER = {"position", "velocity", "disturbance"}
ROLES: dict[str, Role] = {"any_time": "tunable", "at_start": "fixed", "beforehand": "constant"}
OF_DISTURBANCE = {
    "none": (),
    "noise": ("standard_deviation", "hold_steps", "seed"),
    "sine": ("amplitude", "frequency", "phase"),
}
OF_RATE: dict[str, tuple[str, ...]] = {
    "constant": (),
    "staircase": ("amplitude", "start_steps", "hold_steps", "levels"),
    "sine": ("amplitude", "start_steps", "frequency"),
    "chirp": ("amplitude", "start_steps", "frequency", "final_frequency"),
    "noise": ("amplitude", "start_steps", "frequency", "seed"),
    "table": (),
}
# zig's name, with the oldest C library that will do; FMI 3.0's name; ending
TARGETS = {
    "linux": [("x86_64-linux-gnu.2.17", "x86_64-linux", ".so")],
    "linux-arm": [("aarch64-linux-gnu.2.17", "aarch64-linux", ".so")],
    "windows": [("x86_64-windows-gnu", "x86_64-windows", ".dll")],
    "macos": [("x86_64-macos", "x86_64-darwin", ".dylib"), ("aarch64-macos", "aarch64-darwin", ".dylib")],
}
# Platform folders of FMI 2.0.5; names of FMI 3.0 for platforms that it lacks.
FMI2_FOLDERS = {"linux": "linux64", "linux-arm": "aarch64-linux", "windows": "win64", "macos": "darwin64"}


@dataclass(frozen=True)
class Variable:
    """One variable; its value reference is its index in the list. `role`, `place`: integrations/fmu/variable.hpp."""

    name: str
    role: Role
    place: int = 0
    start: float = 0.0
    scale: float = 1.0
    unit: str = "1"
    description: str = ""
    low: float = -math.inf
    high: float = math.inf
    strict: bool = False  # low < value < high

    @property
    def integer(self) -> bool:
        return self.name in ("disturbance.seed", "rate.seed")

    @property
    def causality(self) -> str:
        words = {"time": "independent", "constant": "local", "fixed": "parameter", "tunable": "parameter"}
        return words.get(self.role, self.role)

    @property
    def variability(self) -> str:
        return self.role if self.role in ("constant", "fixed", "tunable") else "continuous"


def fmu(
    scenario: Scenario,
    path: str | os.PathLike[str],
    *,
    content: Content = "loop",
    reference: Reference = "scenario",
    fmi: Fmi = "2.0",
    systems: Sequence[System] = ("linux",),
    number: Number = "double",
    units: Units | None = None,
    unbounded: bool = False,
) -> None:
    """Writes a scenario as an FMU for co-simulation. Requires the extra export and a C++ compiler.

    `content`: the closed loop, "loop", or only the "controller". `reference`: that of the "scenario", or
    position, velocity and acceleration as an "input". `fmi`: "2.0" or "3.0". `systems`: any of linux, linux-arm (64
    bit), windows and macos; other systems than this one require ziglang. `number`: internal number type, "double" or
    "float"; the importer sees doubles. `units`: those of `run.units`, or "V" for a controller of a device with
    [[electrodes]], which is in SI and has as inputs the outputs of the charge amplifiers, V, for positions, and as
    outputs the voltages of the drivers, in steps of their converters, for forces. `unbounded`: export even if the bound
    estimates may grow until the loop diverges. The file is complete or absent.

    Raises ScenarioError if the reference is an input of a controller that drives a sine of its own, and in `units` "V"
    without drivers or charge amplifiers along x and y. Raises ValueError if `units` "V" are those of a closed loop, a
    compiler or FMPy is missing, the seed is too large for an FMU, the file cannot be written, float is requested for a
    dynamic rate or device imperfections, a coefficient exceeds float, or the controller may become unbounded without
    `unbounded`.

    >>> fg.export.fmu(fg.Scenario.shipped("hardware"), "gyro.fmu")  # doctest: +SKIP
    """
    check_bounded(scenario, unbounded)
    if reference == "input" and scenario.controller.kind in SINE_DRIVES:
        raise ScenarioError(
            f"controller.kind is {scenario.controller.kind}, which drives the sine of its scenario: it must be another "
            "if the reference is an input"
        )
    volts = None
    if content == "controller":
        if units is None:
            check_rounding(scenario)
        else:
            scenario = scenario.replace({"run.units": "SI"})
            volts = _Volts.of(scenario)
        scenario = without_plant(scenario)
    elif units is not None:
        raise ValueError('units is "V": it must be None for a closed loop, whose signals are those of its plant')
    ideal = content == "controller" or is_ideal(scenario)
    if number == "float" and not ideal:
        raise ValueError(
            "number is float: it must be double for a closed loop with a dynamic rate or device imperfections"
        )
    if number == "float":
        check_single(scenario)
    variables = list(_variables(scenario, content, reference, fmi, volts))
    token = _token(scenario, content, reference, fmi, number, volts)
    header = _header(scenario, content, reference, number, token, variables, volts)
    description = _description(scenario, content, fmi, token, variables)
    with whole_file(path, replaces="nothing") as scratch, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "exported.hpp").write_text(header, encoding="utf-8")
        files = {"modelDescription.xml": description.encode(), "resources/scenario.toml": scenario.to_toml().encode()}
        for system in systems:
            files |= _binaries(folder, system, content, fmi)
        with zipfile.ZipFile(scratch, "w", zipfile.ZIP_DEFLATED) as archive:
            for file, data in files.items():
                entry = zipfile.ZipInfo(file, FIRST_DATE)
                entry.external_attr = 0o644 << 16  # readable by all, once unpacked
                archive.writestr(entry, data, zipfile.ZIP_DEFLATED)


class _Volts(NamedTuple):
    """A controller between voltages."""

    amplifiers: tuple[float, float]  #: outputs for a unit of length
    driver: list[float]  #: numbers in the core's order, without those of the ADC
    knows_rounding: bool

    @classmethod
    def of(cls, scenario: Scenario) -> _Volts:
        needed = 'in units "V"'
        if not scenario.electrodes.of("force"):
            raise ScenarioError(f"electrodes of role force are missing: {needed} a scenario must have them")
        if (amplifiers := amplifier_volts(scenario)) is None:
            raise ScenarioError(
                f"electronics.amplifier is {scenario.electronics.amplifier}: {needed} it must be charge, with a "
                "feedback_capacitance"
            )
        for name, one in scenario.electrodes.named():
            if one.role == "pickoff" and all(one.axis):
                raise ScenarioError(f"{name}.angle is {one.angle}: {needed} a pick-off must be along x or y")
        numbers = [number for each in driver(scenario).numbers().values() for number in each]
        return cls(amplifiers, numbers, knows_rounding(scenario))


def _variables(
    scenario: Scenario, content: Content, reference: Reference, fmi: Fmi, volts: _Volts | None
) -> Iterator[Variable]:
    """Variables in the order of their value references."""
    if fmi == "3.0":  # required there; some FMI 2.0 importers read it as a variable without start value
        yield Variable("time", "time", unit=_shown("1/omega0", scenario)[1], description="Time.")
    without = {"plant", "disturbance"} if content == "controller" else set()
    yield from _parameters(scenario, content, without | ({"reference"} if reference == "input" else set()))
    if content == "controller":
        yield from _inputs(scenario, volts)
    if reference == "input":
        yield from _reference_inputs(scenario)
    yield from _outputs(scenario, content, volts)


def _parameters(scenario: Scenario, content: Content, without: set[str]) -> Iterator[Variable]:
    places = {name: place for place, name in enumerate([*core_numbers(scenario), *device_numbers(scenario)])}
    draws = scenario.disturbance.random or not is_ideal(scenario)  # the sensors' noise uses the seed, too
    used = (*OF_DISTURBANCE[first_part(scenario)["kind"]], *(("seed",) if draws else ()))
    moving = OF_RATE["staircase" if scenario.rate.kind == "step" else scenario.rate.kind]
    of_loop = device_settings(scenario) if content == "loop" else []
    for s in [*settings(scenario), *of_loop]:
        n, table, field = s.number, s.number.table, s.number.field
        if n.choices or (table == "reference" and n.kinds and not set(n.kinds) & set(scenario.reference.kinds)):
            continue
        if table in without:
            continue
        if (table == "disturbance" and field not in used) or (table == "rate" and field not in moving):
            continue
        high = MAX_SEED if field == "seed" else n.high
        if s.value > high:
            raise ScenarioError(f"{n.path} is {s.value:.0f}: it must be at most {MAX_SEED} in an FMU")
        start, note = (MAX_DOUBLE, f" {MAX_DOUBLE}: off.") if math.isinf(s.value) else (s.value, "")
        limits = (n.low, high, n.strict)
        yield Variable(s.name, ROLES[n.settable], places[s.name], start, s.scale, unit(n), meaning(n) + note, *limits)


def _inputs(scenario: Scenario, volts: _Volts | None) -> Iterator[Variable]:
    names = INPUTS[:1] if scenario.device.sensing == "position" else INPUTS
    measured = [(name, c) for c in LOOP_CHANNELS if c.name in names for name in columns(c)]
    for place, (name, channel) in enumerate(measured):
        scale, symbol = _shown(channel.units[0], scenario)
        said = f"{channel.meaning}, measured"
        if volts and channel.name == "position":
            scale, symbol, said = volts.amplifiers[place], "V", f"{said}: output of the charge amplifier"
        yield Variable(name, "input", place, scale=scale, unit=symbol, description=said)


def _reference_inputs(scenario: Scenario) -> Iterator[Variable]:
    place = 2 * len(INPUTS)
    for name, of in REFERENCE_INPUTS.items():
        scale, symbol = _shown(of, scenario)
        said = f"{name} of the reference"
        for axis in "xy":
            yield Variable(f"reference_{name}.{axis}", "input", place, scale=scale, unit=symbol, description=said)
            place += 1


def _outputs(scenario: Scenario, content: Content, volts: _Volts | None) -> Iterator[Variable]:
    place = 0
    device = device_channels(scenario) if content == "loop" else ()
    for channel in (*LOOP_CHANNELS, *reported_channels(core_setup(scenario)), *device):
        for part, name in enumerate(columns(channel)):
            scale, symbol = _shown(channel.units[part % len(channel.units)], scenario)
            said = channel.meaning
            if volts and channel.name == "control":
                scale, symbol, said = 1.0, "V", "voltage of the driver"
            if content == "loop" or channel.name not in NOT_OF_THE_CONTROLLER:
                yield Variable(name, "output", place, scale=scale, unit=symbol, description=said)
            place += 1


def _shown(unit: str, scenario: Scenario) -> tuple[float, str]:
    """Factor and symbol of a signal's unit, for run.units."""
    return scale_and_unit(unit, scenario.plant.scales, scenario.run.units == "SI")


def _token(
    scenario: Scenario, content: Content, reference: Reference, fmi: Fmi, number: Number, volts: _Volts | None
) -> str:
    """Token that links binary and description: in GUID form, equal for equal FMUs."""
    made_from = f"fracgyro {version('fracgyro')} {content} {reference} {fmi} {number}\n{scenario.to_toml()}"
    if volts:
        made_from += f"\n{volts}"
    digest = hashlib.sha256(made_from.encode()).hexdigest()
    return "{" + "-".join([digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32]]) + "}"


def _header(
    scenario: Scenario,
    content: Content,
    reference: Reference,
    number: Number,
    token: str,
    variables: Sequence[Variable],
    volts: _Volts | None,
) -> str:
    poles, weights = core_kernel(scenario)
    kind, chosen = _core.chosen_type(core_setup(scenario))
    step = scenario.run.step * _shown("1/omega0", scenario)[0]
    ideal = content == "controller" or is_ideal(scenario)
    sines, table = reference_lists(scenario)
    rate, temperature = (([], []), ([], [])) if ideal else profiles(scenario)
    rows = []
    for v in variables:
        flags = [_cpp(v.strict), _cpp(v.integer)]
        given = map(_cpp, (v.start, v.scale, v.low, v.high))
        values = ", ".join([f'"{v.name}"', f"Role::{v.role}", str(v.place), *given, *flags])
        rows.append(f"    {{{values}}},")
    lines = [
        "// Made by `fracgyro export fmu`.",
        "#pragma once",
        '#include "variable.hpp"',
        "#include <array>",
        "#include <cstddef>",
        "namespace fracgyro::exported {",
        f"using Number = {number};",
        f"inline constexpr std::size_t kind = {kind}, chosen = {chosen};",
        f"inline constexpr bool closed_loop = {_cpp(content == 'loop')};",
        f"inline constexpr bool reference_is_input = {_cpp(reference == 'input')};",
        f'inline constexpr char token[] = "{token}";',
        f"inline constexpr double step = {_cpp(step)};",
        f"inline constexpr std::array sensing{{{', '.join(map(_cpp, sensing(scenario)))}}};",
        f"inline constexpr bool ideal = {_cpp(ideal)};",
        _array("numbers", [*core_numbers(scenario).values(), *(() if ideal else device_numbers(scenario).values())]),
        f"inline constexpr bool in_volts = {_cpp(volts is not None)};",
        f"inline constexpr bool knows_rounding = {_cpp(volts is not None and volts.knows_rounding)};",
        f"inline constexpr std::size_t control = {next(v.place for v in variables if v.name == 'control.x')};",
        _array("driver", volts.driver if volts else []),
        _array("poles", poles),
        _array("weights", weights),
        _array("reference_terms", sines),
        _array("reference_rows", table),
        _array("rate_times", rate[0]),
        _array("rate_values", rate[1]),
        _array("transverse", [] if ideal else transverse_list(scenario)),
        _array("temperature_times", temperature[0]),
        _array("temperature_values", temperature[1]),
        f"inline constexpr bool has_electrodes = {_cpp(content == 'loop' and scenario.electrodes != NO_ELECTRODES)};",
        _array("volts", device_in_volts(scenario) if content == "loop" else []),
        _array("terms", term_list(terms(scenario)) if content == "loop" else []),
        "inline constexpr Variable variables[] = {",
        *rows,
        "};",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _array(name: str, values: Iterable[float]) -> str:
    texts = list(map(_cpp, values))
    return f"inline constexpr std::array<double, {len(texts)}> {name}{{{', '.join(texts)}}};"


def _cpp(value: float | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return float(value).hex() if math.isfinite(value) else ("" if value > 0 else "-") + "infinity"


def _description(scenario: Scenario, content: Content, fmi: Fmi, token: str, variables: Sequence[Variable]) -> str:
    run = scenario.run
    scale, second = _shown("1/omega0", scenario)
    with needs("export"):
        import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("fracgyro", "export"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    what = "The closed loop of gyroscope and" if content == "loop" else "The"
    return environment.get_template(f"fmi{fmi[0]}.xml.jinja").render(
        identifier=_identifier(content),
        token=token,
        version=version("fracgyro"),
        description=f"{what} controller of Complexity 2020, 8542961; time in {second}; "
        f"scenario {scenario.content_hash()[:16]}",
        variables=variables,
        units={unit: base_unit(unit, scenario.plant) for unit in sorted({v.unit for v in variables} - {"1"})},
        step=run.step * scale,
        communication_step=run.step * min(run.record_every, run.steps, MAX_TOGETHER) * scale,
        stop=run.duration * scale,
        finite=math.isfinite,
    )


def _identifier(content: Content) -> str:
    return f"fracgyro_{content}"


def _binaries(folder: Path, system: System, content: Content, fmi: Fmi) -> dict[str, bytes]:
    """{path in the archive: binary} for one system. Linked with the C library only, also by zig."""
    face = SOURCES / "integrations/fmu"
    source = face / f"fmi{fmi[0]}.cpp"
    headers = include(folder, face, SOURCES / "include", _fmi_headers())
    options = [*FLAGS, "-O2", *headers]
    built = {}
    for target, tuple_name, ending in TARGETS[system]:
        binary = folder / f"{tuple_name}{ending}"
        if tuple_name == f"{platform.machine()}-{platform.system().lower()}" and ending == ".so":
            link = ["-fPIC", "-shared", "-static-libgcc", "-static-libstdc++", "-s"]
            system_compiler(*options, source, *link, "-o", binary)
        else:
            compiled = folder / f"{tuple_name}.o"
            position = [] if system == "windows" else ["-fPIC"]
            zig("c++", "-target", target, *options, *position, "-c", source, "-o", compiled)
            # Otherwise the binary would contain the path of the scratch folder.
            itself = ["-install_name", f"@rpath/{_identifier(content)}.dylib"] if system == "macos" else []
            zig("cc", "-target", target, "-O2", "-shared", "-s", *itself, compiled, "-o", binary)
        built[tuple_name] = binary
    name = f"{_identifier(content)}{TARGETS[system][0][2]}"
    if fmi == "3.0":
        return {f"binaries/{tuple_name}/{name}": binary.read_bytes() for tuple_name, binary in built.items()}
    parts = [binary.read_bytes() for binary in built.values()]
    return {f"binaries/{FMI2_FOLDERS[system]}/{name}": parts[0] if len(parts) == 1 else join_macos(parts)}


def _fmi_headers() -> Path:
    found = importlib.util.find_spec("fmpy")
    if found is None or found.origin is None:
        raise ValueError("FMI's headers are missing: install FMPy; in your clone, pip install '.[export]'")
    return Path(found.origin).parent / "c-code"
