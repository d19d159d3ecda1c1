"""Reference outputs for fixed-point hardware: the core in fixed point on this computer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scenario import Scenario
from ..compilers import run
from .arithmetic import ARITHMETICS
from .graph import compiled_for, numbers_of


def on_the_desk(scenario: Scenario, motion: NDArray[np.floating], folder: Path) -> NDArray[np.floating]:
    """Status, force and report of each step. motion: shape (samples, 4), x, y and their rates, nondimensional."""
    fixed = ARITHMETICS["fixed"]
    program = compiled_for(scenario, "desk", folder, "-O1")
    fixed.words(motion).tofile(folder / "motion")
    run([str(program), *numbers_of(scenario)], folder)
    return fixed.numbers(np.fromfile(folder / "answer", fixed.rows).reshape(len(motion), -1))
