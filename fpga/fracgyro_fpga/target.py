"""Exported hardware, simulated, as a target of `fracgyro replay`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fracgyro.export.compilers import make, need, run
from fracgyro.export.targets import Target, without_status
from fracgyro.scenario import Scenario
from numpy.typing import NDArray

from .arithmetic import ARITHMETICS, HardwareNumber
from .desk import on_the_desk
from .folder import fpga


def _simulated(
    scenario: Scenario, number: HardwareNumber, motion: NDArray[np.floating], folder: Path
) -> NDArray[np.floating]:
    """Answers of the exported hardware, simulated by Verilator."""
    need("verilator")
    exported, program, arithmetic = folder / "fpga", "build/controller", ARITHMETICS[number]
    fpga(scenario, exported, number, unbounded=True)
    arithmetic.words(motion).tofile(exported / "motion")
    make(exported, program)
    run([str(exported / program)], exported)
    rows = np.fromfile(exported / "answer", arithmetic.rows).reshape(len(motion), -1)
    return without_status("fpga", scenario, arithmetic.numbers(rows))


def _desk(
    scenario: Scenario, number: HardwareNumber, motion: NDArray[np.floating], folder: Path
) -> NDArray[np.floating]:
    """Expected answers of hardware with a fixed point, from the core on this computer."""
    return without_status("desk", scenario, on_the_desk(scenario, motion, folder))


TARGET = Target(_simulated, numbers=("float", "fixed"), reference=_desk)
