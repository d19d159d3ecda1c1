"""Exported firmware on this computer: compiled, called in this process, and simulated with the plant."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..scenario import Scenario
from ..scenario.to_core import core_setup
from .compilers import Number, compiler, run
from .firmware import firmware

SCALARS: dict[Number, Any] = {"float": ctypes.c_float, "double": ctypes.c_double}


class Host:
    """A folder of exported firmware, compiled once as its Makefile does, by the system's compiler.

    All values are nondimensional. Raises ValueError if it does not compile.
    """

    def __init__(self, folder: Path, number: Number) -> None:
        library = folder / "host.so"
        if not library.exists():
            options = ["-std=c++20", "-shared", "-fPIC", *flags(folder, "OPTIMISE", "BITS", "LEAN", "WARNINGS")]
            run([*compiler(), *options, "-I.", "-Iinclude", "fracgyro.cpp", "-o", library.name], folder)
        self._library = ctypes.CDLL(str(library))
        self._number = SCALARS[number]
        header = (folder / "fracgyro_coefficients.h").read_text(encoding="utf-8")
        size, alignment = (int(text) for text in re.findall(r"STATE_(?:SIZE|ALIGNMENT) (\d+)", header))
        self._saved = alignment + size  # bytes: key, checksum, padding, state
        self._room = (ctypes.c_uint64 * (size // 8 + 16))()  # includes space for alignment
        self._state = _aligned(self._room)
        members = header.partition("#define FRACGYRO_REPORTED")[2].partition("} fracgyro_report;")[0]
        widths = re.findall(r"^    fracgyro_number (\w+)(?:\[(\d+)\])?;", members, re.MULTILINE)
        empty = "FRACGYRO_REPORTED 0 " in header
        self._reported = {} if empty else {name: int(width or 1) for name, width in widths}
        self._force = (self._number * 2)()
        self._motion = (self._number * 4)()
        self._library.fracgyro_init(self._state)

    def step(self, position: Sequence[float], velocity: Sequence[float]) -> int:
        """Runs one step and returns the status; `force` is the force."""
        self._motion[:] = (*position, *velocity)
        return int(self._library.fracgyro_step(self._state, self._motion, self._force))

    @property
    def force(self) -> tuple[float, float]:
        return self._force[0], self._force[1]

    @property
    def report(self) -> dict[str, list[float]]:
        """Reports by the members of fracgyro_report."""
        room = (self._number * sum(self._reported.values()))()
        self._library.fracgyro_read_report(self._state, room)
        numbers = iter(room)
        return {name: list(islice(numbers, width)) for name, width in self._reported.items()}

    def save(self) -> bytes:
        room = (ctypes.c_uint64 * (self._saved // 8 + 16))()
        self._library.fracgyro_save(self._state, _aligned(room))
        return ctypes.string_at(_aligned(room), self._saved)

    def restore(self, saved: bytes) -> int:
        """Restores a saved state; returns the status."""
        room = (ctypes.c_uint64 * (self._saved // 8 + 16))()
        ctypes.memmove(_aligned(room), saved, self._saved)
        return int(self._library.fracgyro_restore(self._state, _aligned(room)))


def flags(folder: Path, *names: str) -> list[str]:
    """Variables of the exported Makefile."""
    text = (folder / "Makefile").read_text(encoding="utf-8")
    return " ".join(re.findall(rf"^(?:{'|'.join(names)}) := (.*)$", text, re.MULTILINE)).split()


def _aligned(room: ctypes.Array[ctypes.c_uint64]) -> ctypes.c_void_p:
    return ctypes.c_void_p((ctypes.addressof(room) + 63) // 64 * 64)


def plant_of(scenario: Scenario) -> list[list[float]]:
    """Exact step of eq. (9): rows x, y and their rates at the next sample; columns the same now, and force x, y."""
    return [list(map(float, row)) for row in _core.plant_map(core_setup(scenario))]


def closed_loop(scenario: Scenario, host: Host) -> Iterator[tuple[float, float, float, float]]:
    """Motion at every sample: a plant in double under the exported controller.

    Raises ValueError if the firmware reports a fault.
    """
    plant, samples = plant_of(scenario), scenario.run.steps + 1
    noise = _core.disturbance(core_setup(scenario), 0, samples).tolist()
    x, y = scenario.run.initial_position
    v, w = scenario.run.initial_velocity
    for d in noise:
        yield x, y, v, w
        if status := host.step((x, y), (v, w)):
            raise ValueError(f"the firmware's status is {status} at {(x, y, v, w)}, with force {host.force}")
        fx, fy = host.force
        fx, fy = fx + d[0], fy + d[1]
        x, y, v, w = (a * x + b * y + c * v + e * w + f * fx + g * fy for a, b, c, e, f, g in plant)


def rmse(scenario: Scenario, host: Host, start: float = 0.0) -> NDArray[np.float64]:
    """RMS error of x and y in the closed loop, from `start` on: (2,)."""
    position = np.array(list(closed_loop(scenario, host)))[:, :2]
    t = scenario.run.step * np.arange(len(position))
    error = position - np.array(_core.reference(core_setup(scenario), len(position), 1))[:, :2]
    found: NDArray[np.float64] = np.sqrt(np.mean(error[t >= start] ** 2, axis=0))
    return found


def answers(scenario: Scenario, motion: NDArray[np.floating], folder: Path) -> NDArray[np.float32]:
    """Status, force and report of each step in float, from firmware exported to `folder` and compiled here.

    `motion`: shape (samples, 4), x, y and their rates, nondimensional.
    """
    firmware(scenario, folder, "float", unbounded=True)
    host, rows = Host(folder, "float"), []
    for x, y, vx, vy in motion.tolist():
        reported = [number for numbers in host.report.values() for number in numbers]
        rows.append([host.step((x, y), (vx, vy)), *host.force, *reported])
    return np.array(rows, np.float32)
