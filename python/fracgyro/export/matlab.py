"""A scenario's controller as a self-contained folder with a class for MATLAB and Octave."""

from __future__ import annotations

import os
import shutil

from ..files import whole_folder
from ..scenario import Scenario
from ..scenario.bounded import check_bounded
from .compilers import SOURCES, Number
from .firmware import add_controller
from .host import flags
from .settings import check_rounding


def matlab(
    scenario: Scenario, folder: str | os.PathLike[str], number: Number = "double", *, unbounded: bool = False
) -> None:
    """Writes a scenario's controller as a class for MATLAB and Octave, which is compiled there.

    `number`: number type, "float" or "double". `unbounded`: export even if the bound estimates may grow until the loop
    diverges. A folder whose name starts with + is a package: +gyro has the class gyro.Fracgyro. The folder is complete
    or absent. Raises ValueError if the folder cannot be written, or the controller may become unbounded without
    `unbounded`.

    >>> fg.export.matlab(fg.Scenario.shipped("hardware"), "matlab")
    """
    check_bounded(scenario, unbounded)
    check_rounding(scenario)
    firmware = SOURCES / "integrations/firmware"
    with whole_folder(folder) as scratch:
        shutil.copytree(SOURCES / "integrations/matlab", scratch, dirs_exist_ok=True)
        (scratch / "firmware").mkdir()
        for name in ("fracgyro.h", "fracgyro.cpp"):
            shutil.copyfile(firmware / name, scratch / "firmware" / name)
        add_controller(scenario, number, scratch / "firmware")
        build = scratch / "build.m"
        bits = " ".join(flags(firmware, "BITS"))
        text = build.read_text(encoding="utf-8").replace("FRACGYRO_BITS", bits)
        build.write_text(text, encoding="utf-8", newline="\n")
