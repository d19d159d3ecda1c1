"""Entry point of `replay`: runs a recorded motion through the controller on a target and compares bits."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..extras import require
from ..files import check_regular, reason
from ..scenario import Scenario
from .settings import knows_rounding
from .targets import MOTION, AnyNumber, answer_columns, answered, answers, expected


@dataclass(frozen=True)
class Difference:
    """First difference: step, variable, and both numbers in hexadecimal."""

    step: int
    variable: str
    found: str
    expected: str


@dataclass(frozen=True)
class Replay:
    """Result of a replay on `target`; `hash` is the SHA-256 of the bits of all forces and estimates."""

    target: str
    number: AnyNumber
    steps: int
    hash: str
    difference: Difference | None  #: None: all bits are equal


@dataclass(frozen=True)
class Trace:
    """A recorded run: the measured motion, (steps, 4), and the controller's outputs, (steps, answer_columns)."""

    scenario: Scenario
    motion: NDArray[np.float64]
    answers: NDArray[np.float64]


def replay(path: str | os.PathLike[str], target: str, number: AnyNumber = "double") -> Replay:
    """Hands the motion recorded in `path` (by `fracgyro simulate --out`) to the controller on the target.

    `target`: host, m4f, m7, octave, wasm, fmu, lanes, or one that another package registers, as fpga, which has float
    and fixed only. In double its answers are compared to those recorded; in float, to those of the Python Controller in
    single precision; in fixed, to those of the core with such numbers on this computer. Raises ValueError, in one
    sentence, when the file is not such a record or a program is missing.

    >>> run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0}))
    >>> run.to_netcdf("run.nc", engine="h5netcdf")
    >>> fg.export.replay("run.nc", "host").difference is None
    True
    """
    trace = load(path)
    found = answers(target, trace.scenario, number, trace.motion)
    right = trace.answers if number == "double" else expected(target, trace.scenario, number, trace.motion)
    difference = first_difference(found, right, answer_columns(trace.scenario))
    return Replay(target, number, len(found), parity_hash(trace.scenario, found), difference)


def load(path: str | os.PathLike[str]) -> Trace:
    """Reads a trace. Raises ValueError unless it has every step of one nondimensional run."""
    require("netcdf", "h5netcdf")
    try:
        check_regular(path)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {reason(error)}") from None
    try:
        with xr.open_dataset(path, engine="h5netcdf") as run:
            run.load()
    except Exception:  # a file that is not NetCDF or damaged may raise anything
        raise ValueError(f"{path} is not a recorded run: it is not NetCDF, or damaged") from None
    scenario = Scenario.from_toml(run.attrs["scenario"]) if "scenario" in run.attrs else None
    variables = [channel.name for channel in answered(scenario)] if scenario else []
    if scenario is None or any(name not in run for name in ("time", *MOTION, *variables)) or "run" in run.dims:
        raise ValueError(f"{path} is not a recorded run: write one with `fracgyro simulate --out`")
    if scenario.run.units != "nondimensional":
        raise ValueError(
            f"{path} was recorded in {scenario.run.units} units, which rounds the motion; record it with "
            "run.units = nondimensional"
        )
    if scenario.run.record_every != 1:
        raise ValueError(f"{path} lacks steps: run.record_every is {scenario.run.record_every}, and must be 1")
    if knows_rounding(scenario):
        raise ValueError(
            f"{path} was recorded with electrodes whose drivers round the force: the controller knew the rounded one, "
            "which a replay lacks; record it with their bits = 0"
        )
    if not np.allclose(run["time"], scenario.run.step * np.arange(run.sizes["time"]), rtol=1e-9, atol=0.0):
        raise ValueError(f"{path} lacks steps: its times must be 0, {scenario.run.step}, and so on")

    measured = [f"measured_{name}" for name in MOTION]  # with device imperfections
    moved = measured if measured[0] in run else MOTION
    rounded = next((name for name in (*moved, *variables) if run[name].dtype != np.float64), None)
    if rounded:
        raise ValueError(f"{path} has {rounded} as {run[rounded].dtype}: it must be float64")
    steps = run.sizes["time"]
    if steps == 0:
        raise ValueError(f"{path} has no steps: it must have at least one")

    def columns(names: list[str], wanted: int) -> NDArray[np.float64]:
        found = np.hstack([run[name].values.reshape(steps, -1) for name in names])
        if found.shape[1] != wanted:
            raise ValueError(
                f"{path} has {found.shape[1]} numbers per step in {' and '.join(names)}: it must have {wanted}"
            )
        return found

    return Trace(scenario, columns(moved, 4), columns(variables, len(answer_columns(scenario))))


def parity_hash(scenario: Scenario, rows: NDArray[np.floating]) -> str:
    """SHA-256 of the rows' bits; excludes channels that were added after the hashes were published."""
    hashed = [not name.startswith("rate_symmetric_estimate") for name in answer_columns(scenario)]
    return hashlib.sha256(np.ascontiguousarray(rows[:, hashed]).tobytes()).hexdigest()


def first_difference(
    found: NDArray[np.floating], expected: NDArray[np.floating], names: list[str]
) -> Difference | None:
    """First difference between two tables of the same type with these columns; the sign of zero counts."""
    unsigned = np.dtype(f"<u{expected.itemsize}")
    a, b = (np.ascontiguousarray(rows).view(unsigned) for rows in (found, expected))
    if not (differing := np.argwhere(a != b)).size:
        return None
    step, column = map(int, differing[0])
    bits = (f"0x{int(rows[step, column]):0{2 * unsigned.itemsize}x}" for rows in (a, b))
    return Difference(step, names[column], *bits)
