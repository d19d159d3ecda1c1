"""Reference outputs for fixed-point hardware: the core in fixed point on this computer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fracgyro.export.compilers import run
from fracgyro.scenario import Scenario
from numpy.typing import NDArray

from .arithmetic import ARITHMETICS
from .graph import compiled_for, numbers_of

# Published parity hash of the motion of fracgyro.parity, answered by this core and by exported hardware.
IN_FIXED = "09090fe2132ef45fffdccb75df108f6d3c98700f2652749c9c37d581b93134c8"


def on_the_desk(scenario: Scenario, motion: NDArray[np.floating], folder: Path) -> NDArray[np.floating]:
    """Status, force and report of each step. motion: shape (samples, 4), x, y and their rates, nondimensional."""
    fixed = ARITHMETICS["fixed"]
    program = compiled_for(scenario, "desk", folder, "-O1")
    fixed.words(motion).tofile(folder / "motion")
    run([str(program), *numbers_of(scenario)], folder)
    return fixed.numbers(np.fromfile(folder / "answer", fixed.rows).reshape(len(motion), -1))
