"""Processor speed that a controller needs, from the instruction counts in measured.md."""

from __future__ import annotations

import re

from ..scenario import Scenario
from .compilers import SOURCES

MEASURED = "integrations/firmware/measured.md"


def clock_note(scenario: Scenario) -> str:
    """A note for a scenario with the joint filter, the most expensive part of any controller; otherwise "".

    The number is the maximum over the steps, counted in float on a Cortex-M4F with the linear surface.
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
        f"adaptation.kind is joint, which takes up to {instructions} instructions per step of {1e6 * step:.3g} µs: the "
        f"processor must run {instructions / step / 1e6:.0f} million instructions per second (see {MEASURED}); a "
        "longer run.step or adaptation.covariance_steps = 8 needs fewer"
    )


def _measured() -> str:
    return (SOURCES / MEASURED).read_text(encoding="utf-8")
