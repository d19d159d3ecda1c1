"""Time that a controller's step takes on microcontrollers, from the instruction counts in measured.md."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..scenario import Scenario
from ..scenario.to_core import core_setup
from .compilers import SOURCES

MEASURED = "integrations/firmware/measured.md"
FASTEST = "a Cortex-M7 at 1 GHz"  # the last column of the table of times


@dataclass(frozen=True)
class Clock:
    """Cost of a step of a measured controller that costs at least as much as the scenario's."""

    row: str  # its name in measured.md
    instructions: int  # most of any step, in float on a Cortex-M4F
    step: float  # s
    fastest: tuple[float, float]  # s, estimated time of a step on FASTEST, from and to

    @property
    def sentence(self) -> str:
        """Instructions of a step, and the speed that they need."""
        return (
            f"a step takes about {self.instructions} instructions in float at most (counted for {self.row}): steps of "
            f"{1e6 * self.step:.3g} µs need {self.instructions / self.step / 1e6:.0f} million instructions per second; "
            f"see {MEASURED}"
        )

    @property
    def warning(self) -> str:
        """Warning if even the fastest listed microcontroller is too slow, or may be; otherwise empty."""
        low, high = (1e6 * time for time in self.fastest)
        if 1e6 * self.step >= high:
            return ""
        never = "no listed microcontroller reaches this" if 1e6 * self.step < low else "this is close to the limit"
        return (
            f"{never}: {FASTEST} takes an estimated {low:g} to {high:g} µs per step, and run.step is "
            f"{1e6 * self.step:.3g} µs; a longer run.step needs fewer instructions per second"
            + (", and so does adaptation.covariance_steps = 8" if self.row.startswith("linear, joint") else "")
        )


def clock_of(scenario: Scenario) -> Clock | None:
    """The cost of a step of the scenario's controller; None if no similar one was measured."""
    text = (SOURCES / MEASURED).read_text(encoding="utf-8")
    counted = re.findall(r"^\| ([^|]+) \| (\d+) \| float \| \d+ / (\d+) \|", text, re.MULTILINE)
    times = r"^\| ([^|]+) \| \d+ \|(?: [\d.]+ to [\d.]+ \|){2} ([\d.]+ to [\d.]+) \|$"
    timed = dict(re.findall(times, text, re.MULTILINE))
    names = _similar(scenario)
    setup = core_setup(scenario)
    exponentials = setup.kernel.count if setup.has_memory and scenario.adaptation.kind != "joint" else 0
    found = [(int(most), name) for name, count, most in counted if name in names and int(count) >= exponentials]
    if not found:
        return None
    instructions, name = max(found)
    low, high = map(float, timed[name].split(" to "))
    return Clock(name, instructions, scenario.run.step * scenario.plant.scales.time, (1e-6 * low, 1e-6 * high))


def _similar(scenario: Scenario) -> list[str]:
    """Names of measured controllers of the same kind and adaptation."""
    controller, adaptation = scenario.controller, scenario.adaptation
    if controller.kind not in ("fractional_fast_terminal", "linear", "fast_terminal"):
        return []
    kind = adaptation.kind if controller.adaptive else "gradient"
    if kind == "joint":
        divided = ", divided by 8" if adaptation.covariance_steps == 8 else ""
        sensed = f"positions{divided}" if scenario.device.sensing == "position" else "velocities too"
        return [f"linear, joint, {sensed}"]
    fractional = controller.kind == "fractional_fast_terminal"
    if kind == "composite":
        return ["paper, composite" if fractional else "linear, composite"]
    return ["paper, c = 0.6"] if fractional else ["fast terminal, no exponentials"]
