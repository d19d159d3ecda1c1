"""The clock that a microcontroller needs for a controller, from the instructions counted in measured.md."""

from __future__ import annotations

import re

from ..scenario import Scenario
from .compilers import SOURCES

MEASURED = "integrations/firmware/measured.md"


def clock_note(scenario: Scenario) -> str:
    """A sentence for a scenario with the joint filter, the most expensive part of any controller; else "".

    The number is the maximum of any step, counted in float on a Cortex-M4F with the linear surface.
    """
    if scenario.adaptation.kind != "joint":
        return ""
    divided = ", divided by 8" if scenario.adaptation.covariance_steps == 8 else ""
    sensed = f"positions{divided}" if scenario.device.sensing == "position" else "velocities too"
    row = re.search(rf"^\| linear, joint, {sensed} \| 0 \| float \| \d+ / (\d+) \|", _measured(), re.MULTILINE)
    if row is None:
        return ""
    instructions, step = int(row[1]), scenario.run.step * scenario.plant.scales.time
    return (
        f"adaptation.kind is joint, which takes up to {instructions} instructions a step, and a step is "
        f"{1e6 * step:.3g} µs: the processor must do {instructions / step / 1e6:.0f} million instructions a second "
        f"({MEASURED} has more); a longer run.step or adaptation.covariance_steps = 8 asks for less"
    )


def _measured() -> str:
    return (SOURCES / MEASURED).read_text(encoding="utf-8")
