"""Files of a scenario for the C++ programs of faults.py and off_model.py, as read by scenario_files.hpp."""

from __future__ import annotations

from pathlib import Path

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup


def write_files(scenario: fg.Scenario, folder: Path) -> None:
    setup = core_setup(scenario)
    poles, weights = _core.setup_kernel(setup)
    files = {"numbers": _core.setup_settings(setup), "sensing": setup.sensing, "poles": poles, "weights": weights}
    for name, values in files.items():
        np.array(values).tofile(folder / name)
