"""Exported firmware: built by any compiler, called in this process, closed into a loop."""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.setup import controller_params, disturbance_params
from scipy.linalg import expm

# What a face needs, and what brings it.
TOOLS = {
    "Cortex-M": ("arm-none-eabi-g++", "qemu-system-arm"),
    "clang": ("clang", "clang++"),
}
SCALARS = {"float": (ctypes.c_float, np.float32), "double": (ctypes.c_double, np.float64)}


def need(face: str) -> None:
    """Skips the test where a tool is missing, unless nothing may be skipped."""
    missing = [tool for tool in TOOLS[face] if shutil.which(tool) is None]
    if missing:
        reason = f"face {face}: {', '.join(missing)} missing, which `make setup-embedded` installs"
        if os.environ.get("FRACGYRO_SKIP_NOTHING"):
            pytest.fail(reason)
        pytest.skip(reason)


def make(folder: Path, *words: str) -> str:
    ran = subprocess.run(["make", "-s", *words], cwd=folder, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def flags(folder: Path, *names: str) -> list[str]:
    """Variables of the exported Makefile, so that tests compile as users do."""
    text = (folder / "Makefile").read_text()
    return " ".join(re.findall(rf"^(?:{'|'.join(names)}) := (.*)$", text, re.MULTILINE)).split()


class Host:
    """The firmware compiled for this computer."""

    def __init__(self, folder: Path, number: str, compiler: str = "g++") -> None:
        library = folder / f"{compiler}.so"
        options = ["-std=c++20", "-shared", "-fPIC", *flags(folder, "OPTIMISE", "BITS", "LEAN", "WARNINGS")]
        command = [compiler, *options, "-I.", "-Icore", "fracgyro.cpp", "-o", library.name]
        subprocess.run(command, cwd=folder, check=True)
        self._library = ctypes.CDLL(str(library))
        self._number, self.dtype = SCALARS[number]
        header = (folder / "fracgyro_coefficients.h").read_text()
        size, alignment = (int(text) for text in re.findall(r"STATE_(?:SIZE|ALIGNMENT) (\d+)", header))
        self._saved = alignment + size  # of key, checksum, padding, state
        self._room = (ctypes.c_uint64 * (size // 8 + 16))()  # and room to align
        self._state = _aligned(self._room)
        self._force = (self._number * 2)()
        self._motion = (self._number * 4)()
        self._library.fracgyro_init(self._state)

    def step(self, position: tuple[float, float], velocity: tuple[float, float]) -> int:
        """The status; `force` has the force."""
        self._motion[:] = (*position, *velocity)
        return int(self._library.fracgyro_step(self._state, self._motion, self._force))

    @property
    def force(self) -> tuple[float, float]:
        return self._force[0], self._force[1]

    @property
    def estimates(self) -> list[float]:
        room = (self._number * 10)()
        self._library.fracgyro_read_estimates(self._state, room)
        return list(room)

    def save(self) -> bytes:
        room = (ctypes.c_uint64 * (self._saved // 8 + 16))()
        self._library.fracgyro_save(self._state, _aligned(room))
        return ctypes.string_at(_aligned(room), self._saved)

    def restore(self, saved: bytes) -> int:
        room = (ctypes.c_uint64 * (self._saved // 8 + 16))()
        ctypes.memmove(_aligned(room), saved, self._saved)
        return int(self._library.fracgyro_restore(self._state, _aligned(room)))


def _aligned(room: ctypes.Array) -> ctypes.c_void_p:
    return ctypes.c_void_p((ctypes.addressof(room) + 63) // 64 * 64)


def plant_of(scenario: fg.Scenario) -> list[list[float]]:
    """Rows x, y and their rates at the next sample; columns the same at this one, and force x, y. Eq. (9), exact."""
    damping, stiffness, rate, more_damping, more_stiffness = scenario.plant.nondimensional()

    def matrix(entries: np.ndarray) -> np.ndarray:
        return np.array([[entries[0], entries[1]], [entries[1], entries[2]]])

    flow = np.zeros((6, 6))
    flow[:2, 2:4] = flow[2:4, 4:] = np.eye(2)
    flow[2:4, :2] = -matrix(stiffness + more_stiffness)
    flow[2:4, 2:4] = -matrix(damping + more_damping) - 2 * np.array([[0.0, -rate], [rate, 0.0]])
    return [list(map(float, row)) for row in expm(scenario.run.step * flow)[:4]]


def closed_loop(scenario: fg.Scenario, host: Host) -> Iterator[tuple[float, float, float, float]]:
    """The motion at every sample, of a plant in double under a controller in whatever it computes with."""
    plant, samples = plant_of(scenario), scenario.run.steps + 1
    noise = _core.disturbance(disturbance_params(scenario), scenario.run.step, 0, samples).tolist()
    x, y = scenario.plant.initial_position
    v, w = scenario.plant.initial_velocity
    for d in noise:
        yield x, y, v, w
        status = host.step((x, y), (v, w))
        assert status == 0, (status, x, y, v, w, host.force, host.estimates)
        fx, fy = host.force
        fx, fy = fx + d[0], fy + d[1]
        x, y, v, w = (a * x + b * y + c * v + e * w + f * fx + g * fy for a, b, c, e, f, g in plant)


def rmse(scenario: fg.Scenario, host: Host, start: float = 0.0) -> np.ndarray:
    """Of x and y, from `start` on."""
    position = np.array(list(closed_loop(scenario, host)))[:, :2]
    t = scenario.run.step * np.arange(len(position))
    r = scenario.reference
    error = position - np.array(r.amplitude) * np.sin(np.outer(t, r.frequency) + np.array(r.phase))
    return np.sqrt(np.mean(error[t >= start] ** 2, axis=0))


def mode_count(scenario: fg.Scenario) -> int:
    return int(controller_params(scenario).surface.modes.count)
