"""One recorded run through every target: the same bits, and the message if they differ."""

from __future__ import annotations

import json
import re
import shutil
from itertools import product
from pathlib import Path
from typing import get_args

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner, Result
from embedded import need
from fracgyro.cli import cli
from fracgyro.export import compilers
from fracgyro.export.compilers import Number
from fracgyro.export.host import Host
from fracgyro.export.replay import Difference, Trace, first_difference, load, parity_hash
from fracgyro.export.targets import DTYPES, answer_columns, answered, answers
from fracgyro.simulation.dataset import write_run
from nightly import nightly_unless

pytestmark = pytest.mark.usefixtures("lanes")
STEPS = 20_000
PAPER = fg.Scenario.paper().replace({"run.duration": STEPS * 1e-3})
GCC, CLANG = {"CC": "gcc", "CXX": "g++"}, {"CC": "clang", "CXX": "clang++"}
NUMBERS: tuple[Number, ...] = get_args(Number)

# How it is called here: target, what it needs beyond the Python package, compilers.
TARGETS: dict[str, tuple[str, str, dict[str, str]]] = {
    "Python Controller": ("python", "", {}),
    "lanes": ("lanes", "", {}),
    "host": ("host", "", {}),
    "host, gcc": ("host", "gcc", GCC),
    "host, clang": ("host", "clang", CLANG),
    "Cortex-M4F": ("m4f", "Cortex-M", {}),
    "Cortex-M7": ("m7", "Cortex-M", {}),
    "Octave": ("octave", "Octave", {}),
    "WebAssembly": ("wasm", "WebAssembly", {}),
    "FMU": ("fmu", "", {}),
}
# Other paths through the law, on a short run: other surfaces, powers and orders, and options that the paper does not
# use.
SCENARIOS = {
    "power, printed": fg.Scenario.paper("printed").replace({"controller.terminal_exponent": 0.6}),
    "fractional of order zero, limited": fg.Scenario.paper().replace(
        {
            "controller.kind": "fractional",
            "controller.order": 0.0,
            "controller.force_limit": 400.0,
            "controller.switching_limit": 0.02,
            "adaptation.projection": 0.3,
        }
    ),
    "composite, forgetting": fg.Scenario.paper().replace(
        {"adaptation.kind": "composite", "adaptation.forgetting": 0.1, "adaptation.rate_forgetting": 2.0}
    ),
    "joint, forgetting, positions only": fg.Scenario.paper().replace(
        {
            "adaptation.kind": "joint",
            "adaptation.forgetting": 0.1,
            "adaptation.rate_forgetting": 2.0,
            "device.sensing": "position",
            "device.position_noise": 1e-12,
        }
    ),
    "PID, which reports nothing": fg.Scenario.paper().replace({"controller.kind": "pid"}),
    **{
        f"PID behind the filter, {sensing}": fg.Scenario.paper().replace(
            {
                "controller.kind": "pid",
                "controller.filter": "kalman",
                "controller.force_limit": 1000.0,
                "device.sensing": sensing,
                "device.position_noise": 1e-12,
                "device.delay": delay,
            }
        )
        for sensing, delay in (("full", 0), ("position", 2))
    },
    "super-twisting": fg.Scenario.paper().replace({"controller.kind": "super_twisting"}),
    **{
        kind: fg.Scenario.paper().replace({"controller.kind": kind})
        for kind in ("resonant", "nonsingular_terminal", "lqg", "force_rebalance")
    },
    "fast terminal, sine": fg.Scenario.paper().replace(
        {
            "controller.kind": "fast_terminal",
            "adaptation.dead_zone": 0.02,
            "adaptation.leakage": 0.1,
            "disturbance.kind": "sine",
            "disturbance.amplitude": (0.7, -0.3),
        }
    ),
}
OF_NO_OTHER_FMU = ("fractional of order zero, limited", "fast terminal, sine")


def record(scenario: fg.Scenario, path: Path) -> Trace:
    write_run(fg.simulate(scenario), path)
    return load(path)


@pytest.fixture(scope="session")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    return record(PAPER, tmp_path_factory.mktemp("parity") / "run.nc")


@pytest.fixture(scope="session")
def expected(trace: Trace) -> dict[Number, np.ndarray]:
    """In float one target is the reference: firmware on this computer."""
    return {"double": trace.answers, "float": answers("host", PAPER, "float", trace.motion)}


def compare(name: str, number: Number, trace: Trace, expected: np.ndarray) -> None:
    target, _, _ = TARGETS[name]
    found = answers(target, trace.scenario, number, trace.motion)
    assert found.dtype.itemsize == {"float": 4, "double": 8}[number]
    difference = first_difference(found, expected, answer_columns(trace.scenario))
    assert difference is None, f"{name}, {number}: {difference}, hash {parity_hash(trace.scenario, found)}"


# Octave takes six seconds, and test_matlab.py replays there in both number types.
# Single precision on the targets that compile fastest.
@pytest.mark.parametrize(
    ("name", "number"),
    nightly_unless(
        lambda name, number: name != "Octave" and (number == "double" or name not in ("lanes", "WebAssembly", "FMU")),
        product(TARGETS, NUMBERS),
    ),
)
def test_every_target_answers_a_recorded_run_with_the_same_bits(
    name: str,
    number: Number,
    trace: Trace,
    expected: dict[Number, np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, tools, choice = TARGETS[name]
    need(tools)
    for variable, value in choice.items():
        monkeypatch.setenv(variable, value)
    assert len(trace.motion) == STEPS + 1
    compare(name, number, trace, expected[number])


@pytest.mark.parametrize(
    ("scenario", "number"),
    nightly_unless(
        lambda scenario, number: number == "double" or scenario.startswith(("composite", "fast", "PID behind")),
        product(SCENARIOS, NUMBERS),
    ),
)
def test_every_way_through_the_law_has_the_same_bits(scenario: str, number: Number, tmp_path: Path) -> None:
    short = record(SCENARIOS[scenario].replace({"run.duration": 2.0}), tmp_path / "run.nc")
    double = number == "double"
    expected = short.answers if double else answers("python", short.scenario, number, short.motion)
    lanes = () if short.scenario.controller.filter == "kalman" else ("lanes",)
    # An FMU takes longest to compile: test_fmu.py compares closed loops of the other kinds, and one in float is above.
    fmu = ("FMU",) if double and scenario in OF_NO_OTHER_FMU else ()
    for name in (*lanes, "host", *fmu):
        compare(name, number, short, expected)


@pytest.mark.parametrize(
    ("adaptation", "sensing", "filtered", "number"),
    nightly_unless(
        lambda *kinds: (
            kinds
            in {
                ("gradient", "full", "none", "double"),
                ("joint", "position", "none", "double"),
                ("composite", "full", "kalman", "float"),
                ("gradient", "position", "kalman", "float"),
            }
        ),
        [
            (*kinds, number)
            for number in NUMBERS
            for kinds in [
                ("gradient", "full", "none"),
                ("composite", "full", "none"),
                ("joint", "position", "none"),
                ("composite", "full", "kalman"),
                ("gradient", "position", "kalman"),
            ]
        ],
    ),
)
def test_a_run_with_faults_has_the_same_bits_on_every_face(
    number: Number, adaptation: str, sensing: str, filtered: str, tmp_path: Path
) -> None:
    need("WebAssembly")
    checked = {"guard.checked": True, "controller.force_limit": 6000.0, "run.duration": 2.0}
    kinds = {"adaptation.kind": adaptation, "device.sensing": sensing, "controller.filter": filtered}
    scenario = fg.Scenario.paper().replace(checked | kinds)
    motion = record(scenario, tmp_path / "run.nc").motion.astype(DTYPES[number])
    motion[500, 0] += 1e3
    motion[600, 3] = motion[610, 1] = 1e30
    motion[700:740] = motion[699]
    motion[900, 2] += 0.5
    motion[1200:1400, :2] *= -1.0
    fg.export.firmware(scenario, tmp_path / "firmware", number, unbounded=True)
    compared = [channel.name for channel in answered(scenario)[1:]]
    host, rows, statuses = Host(tmp_path / "firmware", number), [], set()
    for x, y, vx, vy in motion.tolist():
        report = host.report
        statuses.add(host.step((x, y), (vx, vy)))
        rows.append([*host.force, *(number for name in compared for number in report[name])])
    assert statuses >= {0, 3, 6, 7}
    expected = np.array(rows).astype(DTYPES[number])
    assert np.isfinite(expected).all()
    # An FMU takes longest to compile: each adaptation in one, each type and each way of sensing in one.
    kind_of_fmu = (number, adaptation, filtered)
    in_fmu = {("float", "gradient", "kalman"), ("double", "composite", "none"), ("double", "joint", "none")}
    fmu = ("fmu",) if kind_of_fmu in in_fmu else ()
    for target in ("python", "wasm", *fmu):
        difference = first_difference(answers(target, scenario, number, motion), expected, answer_columns(scenario))
        assert difference is None, f"{target}, {number}: {difference}"


def test_a_device_that_is_not_ideal_is_replayed_from_what_the_controller_measured(tmp_path: Path) -> None:
    device = {"device.position_noise": 1e-12, "device.delay": 1, "rate.kind": "sine", "rate.amplitude": 10.0}
    observed = {"device.sensing": "position", "adaptation.kind": "composite"}
    changes = {**device, **observed, "rate.frequency": 1e3, "run.duration": 0.5}
    short = record(fg.Scenario.paper().replace(changes), tmp_path / "run.nc")
    for name in ("Python Controller", "host", "lanes", "WebAssembly", "FMU"):
        compare(name, "double", short, short.answers)


# -- Messages ------------------------------------------------------------------------------------------------


def command(*words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["replay", *map(str, words)])


@pytest.fixture
def short(tmp_path: Path) -> Path:
    record(fg.Scenario.paper().replace({"run.duration": 0.2}), tmp_path / "run.nc")
    return tmp_path / "run.nc"


@pytest.mark.parametrize("number", NUMBERS)
def test_the_command_says_equal_and_the_hash(short: Path, number: Number) -> None:
    said = command(short, "--target", "host", "--number", number)
    assert said.exit_code == 0
    against = {"double": "the trace", "float": "the Python Controller"}[number]
    first, last = said.output.splitlines()
    assert first == f"host, {number}: 201 steps, all bits of forces and estimates equal {against}"
    found = json.loads(command(short, "--target", "host", "--number", number, "--json").output)
    assert last == f"parity hash (SHA-256): {found['hash']}"
    assert (found["steps"], found["difference"]) == (201, None)
    if number == "double":
        assert found["hash"] == parity_hash(PAPER, load(short).answers)


def test_the_command_names_the_first_bit_that_differs_and_fails(short: Path, tmp_path: Path) -> None:
    with xr.open_dataset(short, engine="h5netcdf") as run:
        run.load()
    run["stiffness_estimate"].values[17, 1] = 1.0
    run["control"].values[100, 0] = 0.0  # comes later
    write_run(run, tmp_path / "changed.nc")
    is_really = int(load(short).answers.view(np.uint64)[17, 6])
    said = command(tmp_path / "changed.nc", "--target", "host")
    assert said.exit_code == 1
    bits = f"is 0x{is_really:016x}, in the trace 0x3ff0000000000000"
    assert said.output == f"host, double: step 17, stiffness_estimate.xy {bits}\n"
    found = json.loads(command(tmp_path / "changed.nc", "--target", "host", "--json").output)
    assert found["difference"]["variable"] == "stiffness_estimate.xy"


def test_a_last_bit_and_the_sign_of_zero_are_differences() -> None:
    table = np.zeros((3, 15), np.float32)
    other = table.copy()
    assert first_difference(table, other, answer_columns(PAPER)) is None
    other[2, 14] = -0.0
    found = first_difference(other, table, answer_columns(PAPER))
    assert found == Difference(2, "bound_estimate[2]", "0x80000000", "0x00000000")
    other[1, 0] = np.nextafter(np.float32(0), np.float32(1))
    found = first_difference(other, table, answer_columns(PAPER))
    assert found == Difference(1, "control.x", "0x00000001", "0x00000000")
    assert parity_hash(PAPER, other) != parity_hash(PAPER, table)


def refused(path: Path, *words: str) -> str:
    """The sentence."""
    with pytest.raises(ValueError, match=r".") as report:
        CliRunner().invoke(cli, ["replay", str(path), "--target", "host", *words], catch_exceptions=False)
    assert "\n" not in str(report.value)
    return str(report.value).removeprefix(f"{path} ")


def test_what_is_no_record_of_every_step_is_refused_in_one_sentence(short: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.nc"
    assert refused(path) == "cannot be read: No such file or directory"
    path.write_text("no NetCDF")
    assert refused(path) == "is not a recorded run: it is not NetCDF, or damaged"
    path.unlink()
    with xr.open_dataset(short, engine="h5netcdf") as run:
        run.load()
    write_run(run.drop_vars("control"), path)
    assert refused(path) == "is not a recorded run: write one with `fracgyro simulate --out`"
    write_run(run.isel(time=slice(1, None)), path)
    assert refused(path) == "lacks steps: its times must be 0, 0.001, and so on"
    write_run(run.isel(time=slice(0, 0)), path)
    assert refused(path) == "has no steps: it must have at least one"
    write_run(run.assign(position=run["position"].astype("float32")), path)
    assert refused(path) == "has position as float32: it must be float64"
    write_run(run.isel(axis=[0]), path)
    assert refused(path) == "has 2 numbers per step in position and velocity: it must have 4"
    write_run(run.isel(entry=[0]), path)
    assert re.match(r"has \d+ numbers per step in control and .*: it must have \d+$", refused(path))
    base = fg.Scenario.paper().replace({"run.duration": 0.2})
    for change, report in {
        "run.record_every": "lacks steps: run.record_every is 4, and must be 1",
        "run.units": "was recorded in SI units, which rounds the motion; record it with run.units = nondimensional",
    }.items():
        write_run(fg.simulate(base.replace({change: 4 if change == "run.record_every" else "SI"})), path)
        assert refused(path) == report


def test_a_motion_that_firmware_takes_for_a_fault_is_no_difference_of_bits(short: Path, tmp_path: Path) -> None:
    with xr.open_dataset(short, engine="h5netcdf") as run:
        run.load()
    run["velocity"].values[5, 0] = 1e7
    write_run(run, tmp_path / "wild.nc")
    report = refused(tmp_path / "wild.nc")
    fault = "host rejects the motion at step 5 as a sensor fault, status 3"
    assert report == f"{fault}: the trace must not have faults"


@pytest.mark.parametrize(
    ("target", "absent", "package"),
    [
        ("m7", "arm-none-eabi-g++", "gcc-arm-none-eabi"),
        ("m4f", "qemu-system-arm", "qemu-system-arm"),
        ("octave", "octave-cli", "octave,"),
        ("octave", "mkoctfile", "octave-dev"),
        ("wasm", "node", "nodejs"),
        ("host", "make", "make"),
    ],
)
def test_a_missing_program_is_named_with_what_installs_it(
    short: Path, monkeypatch: pytest.MonkeyPatch, target: str, absent: str, package: str
) -> None:
    find = shutil.which
    there = set(compilers.PACKAGES) - {absent}
    monkeypatch.setattr(shutil, "which", lambda name: name if name in there else find(name) if name != absent else None)
    report = refused(short, "--target", target)
    assert report.startswith(f"{absent} is not found: install {package}")
