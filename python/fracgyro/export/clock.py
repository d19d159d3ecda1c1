"""Time that a controller's step takes on microcontrollers, from the instruction counts in measured.md."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from ..scenario import Scenario
from ..scenario.to_core import core_setup
from .compilers import SOURCES

MEASURED = "integrations/firmware/measured.md"
PROCESSORS = ["a Cortex-M4F at 168 MHz", "a Cortex-M7 at 480 MHz", "a Cortex-M7 at 1 GHz"]  # columns
FASTEST = PROCESSORS[-1]


@dataclass(frozen=True)
class Clock:
    """Cost of a step of a measured controller that costs at least as much as the scenario's."""

    row: str  # its name in measured.md
    instructions: int  # most of any step, in float on a Cortex-M4F
    step: float  # s
    times: dict[str, tuple[float, float]]  # s, estimated time of a step on each of PROCESSORS, from and to

    @property
    def sentence(self) -> str:
        """Instructions of a step, and the speed that they need."""
        return (
            f"a step takes about {self.instructions} instructions in float at most (counted for {self.row}): steps of "
            f"{1e6 * self.step:.3g} µs need {self.instructions / self.step / 1e6:.0f} million instructions per second; "
            f"{self.verdict}; see {MEASURED}"
        )

    @property
    def verdict(self) -> str:
        """The slowest listed microcontroller that surely keeps up, or that none does."""
        for name, (_, high) in self.times.items():
            if high <= self.step:
                return f"{name} keeps up"
        return "no listed microcontroller surely keeps up"

    @property
    def warning(self) -> str:
        """Warning if even the fastest listed microcontroller is too slow, or may be; otherwise empty."""
        low, high = (1e6 * time for time in self.times[FASTEST])
        if 1e6 * self.step >= high:
            return ""
        never = "no listed microcontroller reaches this" if 1e6 * self.step < low else "this is close to the limit"
        return (
            f"{never}: {FASTEST} takes an estimated {low:g} to {high:g} µs per step, and run.step is "
            f"{1e6 * self.step:.3g} µs; a longer run.step needs fewer instructions per second"
            + (", and so does controller.kind = lock_in" if self.row.startswith("linear, joint") else "")
        )


def clock_of(scenario: Scenario) -> Clock | None:
    """The cost of a step of the scenario's controller; None if no similar one was measured."""
    text = (SOURCES / MEASURED).read_text(encoding="utf-8")
    counted = re.findall(r"^\| ([^|]+) \| (\d+) \| float \| \d+ / (\d+) \|", text, re.MULTILINE)
    times = r"^\| ([^|]+) \| \d+ \| ([\d.]+ to [\d.]+) \| ([\d.]+ to [\d.]+) \| ([\d.]+ to [\d.]+) \|$"
    timed = {name: cells for name, *cells in re.findall(times, text, re.MULTILINE)}
    names = _similar(scenario)
    setup = core_setup(scenario)
    exponentials = setup.kernel.count if setup.has_memory and scenario.adaptation.kind != "joint" else 0
    found = [(int(most), name) for name, count, most in counted if name in names and int(count) >= exponentials]
    if not found:
        return None
    instructions, name = max(found)
    estimated = {}
    for processor, cell in zip(PROCESSORS, timed[name], strict=True):
        low, high = map(float, cell.split(" to "))
        estimated[processor] = (1e-6 * low, 1e-6 * high)
    return Clock(name, instructions, scenario.run.step * scenario.plant.scales.time, estimated)


def _similar(scenario: Scenario) -> list[str]:
    """Names of measured controllers of the same kind and adaptation."""
    controller, adaptation = scenario.controller, scenario.adaptation
    if controller.kind == "lock_in":
        return ["lock-in, samples checked" if scenario.guard.checked else "lock-in"]
    if controller.kind == "internal_model" and not scenario.guard.checked:
        limited = ", force limit" if math.isfinite(controller.force_limit) else ""
        sensed = "positions" if scenario.device.sensing == "position" else f"velocities too{limited}"
        return [] if limited and sensed == "positions" else [f"internal model, {sensed}"]
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
