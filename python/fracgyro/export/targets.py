"""A scenario's controller on every target: outputs for a sequence of measured motions."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import EntryPoints, entry_points
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..scenario import Scenario
from ..scenario.kinds import KINDS, LOOP_CHANNELS, Channel, persistent_channels
from ..scenario.to_core import core_setup
from ..simulation.controller import Controller
from .compilers import FLAGS, SOURCES, Number, compiler, include, make, need, run, system_compiler
from .firmware import firmware
from .fmu import System, fmu
from .matlab import matlab
from .settings import check_controller, columns, core_kernel, core_numbers, observer_bandwidth, reference_lists
from .web import build, web

AnyNumber = Literal["float", "double", "fixed"]  # fixed: only on targets that other packages register

MOTION = ["position", "velocity"]
DTYPES: dict[AnyNumber, np.dtype[np.floating]] = {
    "float": np.dtype("<f4"),
    "double": np.dtype("<f8"),
    "fixed": np.dtype("<f8"),  # represents all fixed-point numbers exactly
}
FAULT = 2  # smallest status of the firmware for a rejected motion

BOARDS = {"m4f": "mps2-an386", "m7": "mps2-an500"}
EMULATOR = ["qemu-system-arm", "-nographic", "-monitor", "none", "-serial", "none", "-semihosting"]
OCTAVE = ["octave-cli", "--norc", "--quiet", "--eval"]
SYSTEMS: dict[str, System] = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}

Answer = Callable[[Scenario, Any, NDArray[np.floating], Path], NDArray[np.floating]]


@dataclass(frozen=True)
class Target:
    """Something that a controller runs on.

    `answer`: for scenario, number and motion, (steps, 4), returns rows of answer_columns; it may use an empty folder.
    `numbers`: what it computes in. `reference`: answers in those that the Python Controller lacks, for comparison.
    """

    answer: Answer
    numbers: tuple[AnyNumber, ...] = ("float", "double")
    reference: Answer | None = None


def answered(scenario: Scenario) -> list[Channel]:
    """Output channels of a controller: the force and its reports."""
    force = [channel for channel in LOOP_CHANNELS if channel.name == "control"]
    return [*force, *persistent_channels(core_setup(scenario))]


def answer_columns(scenario: Scenario) -> list[str]:
    return [name for channel in answered(scenario) for name in columns(channel)]


def answers(target: str, scenario: Scenario, number: AnyNumber, motion: NDArray[np.float64]) -> NDArray[np.floating]:
    """One row of answer_columns for each motion (x, y and their rates, nondimensional), from t = 0 on.

    The motion is rounded to `number`, the type of the rows. Raises ValueError if a program is missing or fails, or the
    target rejects a motion as a sensor fault.
    """
    chosen = target_named(target)
    if number not in chosen.numbers:
        others = [name for name in sorted(registered().names) if number in target_named(name).numbers]
        hint = "" if number == "double" else f"; only {' and '.join(others)} has {number}"
        raise ValueError(f"number is {number}: it must be {' or '.join(chosen.numbers)} for {target}{hint}")
    return _rows(chosen.answer, target, scenario, number, motion)


def expected(target: str, scenario: Scenario, number: AnyNumber, motion: NDArray[np.float64]) -> NDArray[np.floating]:
    """The rows that `answers` has to return, by the Python Controller or, in other numbers, the target's reference."""
    reference = TARGETS["python"].answer if number in TARGETS["python"].numbers else target_named(target).reference
    if reference is None:
        raise ValueError(f"{target} has nothing to be compared with in {number}")
    return _rows(reference, f"the reference of {target}", scenario, number, motion)


def registered() -> EntryPoints:
    """Targets of other packages: each is an instance of Target."""
    return entry_points(group="fracgyro.targets")


def target_named(name: str) -> Target:
    """Return a target of this package, or one that another package registers."""
    if name in TARGETS:
        return TARGETS[name]
    found: Target = registered()[name].load()
    return found


def _rows(
    answer: Answer, name: str, scenario: Scenario, number: AnyNumber, motion: NDArray[np.float64]
) -> NDArray[np.floating]:
    dtype = DTYPES[number]
    with tempfile.TemporaryDirectory() as folder:
        rows = answer(scenario, number, motion.astype(dtype), Path(folder))
    if rows.shape != (len(motion), len(answer_columns(scenario))):
        raise ValueError(f"{name} answered {len(rows)} of {len(motion)} motions")
    return rows.astype(dtype, copy=False)


def _python(scenario: Scenario, number: Number, motion: NDArray[np.floating], _: Path) -> NDArray[np.floating]:
    controller, rows = Controller(scenario, single_precision=number == "float"), []
    for n, (x, y, vx, vy) in enumerate(motion.tolist()):
        report = controller.report
        force = controller.step(n * scenario.run.step, (x, y), (vx, vy))
        rows.append(np.hstack([force, *report.values()]))
    return np.array(rows)


@cache
def _lanes_program(_: tuple[str, ...]) -> tempfile.TemporaryDirectory[str]:
    """The replay program of this compiler, used for every scenario and deleted with the process."""
    folder = tempfile.TemporaryDirectory()
    source, headers = SOURCES / "integrations/lanes/replay.cpp", include(SOURCES / "include")
    system_compiler(*FLAGS, "-O1", "-march=native", *headers, source, "-o", Path(folder.name) / "replay")
    return folder


def _lanes(scenario: Scenario, number: Number, motion: NDArray[np.floating], folder: Path) -> NDArray[np.floating]:
    """Outputs of the lanes, in the widest registers of this processor. Raises ScenarioError for a filter."""
    check_controller(scenario)
    observer = observer_bandwidth(scenario)
    program = Path(_lanes_program(tuple(compiler())).name) / "replay"
    lists = dict(zip(("poles", "weights"), core_kernel(scenario), strict=True))
    lists |= dict(zip(("terms", "rows"), reference_lists(scenario), strict=True))
    lists |= {"numbers": list(core_numbers(scenario).values()), "observer": [observer]}
    for name, values in lists.items():
        np.array(values).tofile(folder / name)
    motion.tofile(folder / "motion")
    run([str(program), str(KINDS.index(scenario.controller.kind)), number], folder)
    return np.fromfile(folder / "answer", DTYPES[number]).reshape(len(motion), -1)


def _firmware(
    target: Literal["host", "m4f", "m7"],
    scenario: Scenario,
    number: Number,
    motion: NDArray[np.floating],
    folder: Path,
) -> NDArray[np.floating]:
    """Outputs of exported firmware, compiled by its Makefile; on an emulated board unless the target is host."""
    exported, image = folder / "firmware", f"build/{target}/replay"
    choice = []
    if target == "host":
        choice = [f"CC={os.environ.get('CC', 'cc')}", f"CXX={' '.join(compiler())}"]
        command = [str(exported / image)]
    else:
        need("arm-none-eabi-g++", "qemu-system-arm")
        command = [*EMULATOR, "-M", BOARDS[target], "-kernel", image]
    firmware(scenario, exported, number, unbounded=True)
    motion.tofile(exported / "motion")
    make(exported, image, *choice)
    run(command, exported)
    return without_status(target, scenario, np.fromfile(exported / "answer", DTYPES[number]).reshape(len(motion), -1))


def _octave(scenario: Scenario, number: Number, motion: NDArray[np.floating], folder: Path) -> NDArray[np.floating]:
    """Outputs of the exported MATLAB class in Octave, compiled by its build.m."""
    need("octave-cli", "mkoctfile")
    exported = folder / "matlab"
    matlab(scenario, exported, number, unbounded=True)
    motion.tofile(exported / "motion")
    run([*OCTAVE, "build(); replay(Fracgyro())"], exported)
    rows = np.fromfile(exported / "answer", DTYPES[number]).reshape(len(motion), -1)
    return without_status("octave", scenario, rows)


def without_status(target: str, scenario: Scenario, rows: NDArray[np.floating]) -> NDArray[np.floating]:
    """Force and report of rows that begin with the firmware's status. Raises ValueError where that is a fault."""
    for n, status in enumerate(rows[:, 0].tolist()):
        if status >= FAULT:
            fault = f"rejects the motion at step {n} as a sensor fault, status {status:.0f}"
            raise ValueError(f"{target} {fault}: the trace must not have faults")
    return rows[:, 1 : 1 + len(answer_columns(scenario))]  # a C report is never empty


def _wasm(scenario: Scenario, number: Number, motion: NDArray[np.floating], folder: Path) -> NDArray[np.floating]:
    need("node")
    build(folder, [number])
    web(scenario, folder / "own.json", unbounded=True)
    shutil.copyfile(SOURCES / "integrations/web/replay.mjs", folder / "replay.mjs")
    motion.astype(np.float64).tofile(folder / "motion")
    run(["node", "replay.mjs", "own.json", number], folder)
    return np.fromfile(folder / "answer").reshape(len(motion), -1)


# FMPy calls the logger of the instance created last, even after its deletion: keep all loggers alive.
LOGGERS: list[Any] = []


def _fmu(scenario: Scenario, number: Number, motion: NDArray[np.floating], folder: Path) -> NDArray[np.floating]:
    """Outputs of the controller FMU, imported by FMPy."""
    path = folder / "replay.fmu"
    system = SYSTEMS[platform.system()]
    fmu(scenario, path, content="controller", systems=[system], number=number, unbounded=True)
    import fmpy
    from fmpy.simulation import instantiate_fmu

    description = fmpy.read_model_description(str(path))
    place = {variable.name: variable.valueReference for variable in description.modelVariables}
    columns_of_motion = [name for channel in LOOP_CHANNELS if channel.name in MOTION for name in columns(channel)]
    inputs = {column: place[name] for column, name in enumerate(columns_of_motion) if name in place}
    outputs = [place[name] for name in answer_columns(scenario)]
    unpacked = fmpy.extract(str(path), unzipdir=str(folder / "unpacked"))
    instance = instantiate_fmu(unpacked, description, logger=lambda *_: None)
    LOGGERS.append(instance.callbacks)
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    rows, step = [], scenario.run.step
    for n, measured in enumerate(motion.tolist()):
        instance.setReal(list(inputs.values()), [measured[column] for column in inputs])
        instance.doStep(n * step, step)
        rows.append(instance.getReal(outputs))
    instance.terminate()
    instance.freeInstance()
    return np.array(rows)


TARGETS = {
    "python": Target(_python),
    "lanes": Target(_lanes),
    "host": Target(partial(_firmware, "host")),
    "m4f": Target(partial(_firmware, "m4f")),
    "m7": Target(partial(_firmware, "m7")),
    "octave": Target(_octave),
    "wasm": Target(_wasm),
    "fmu": Target(_fmu),
}
