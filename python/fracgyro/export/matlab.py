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


def matlab(
    scenario: Scenario, folder: str | os.PathLike[str], number: Number = "double", *, unbounded: bool = False
) -> None:
    """Writes a scenario's controller as a class for MATLAB and Octave, to be compiled there, whole or not at all.

    `number`: what it computes with, float or double. A folder whose name starts with + is a package: +gyro has the
    class gyro.Fracgyro. Raises ValueError, in one sentence, when the folder cannot be written, or the controller would
    not stay bounded and `unbounded` does not say that it need not.

    >>> from fracgyro.scenario.shipped import shipped
    >>> fg.export.matlab(shipped("hardware"), "matlab")
    """
    check_bounded(scenario, unbounded)
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
