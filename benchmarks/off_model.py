"""The rate sensor with model errors: sensor faults, drifts and turns; writes benchmarks/results/off_model.md.

    python benchmarks/off_model.py [--quick]

Faults of 20, 2,000 and 20,000 samples on each shipped device, from positions or with velocities too, with samples
checked by the guard or not. Stiffness that drifts, and rates that turn. Quick: one device and six faults.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.export.compilers import FLAGS, SOURCES, include, system_compiler
from fracgyro.scenario.device_core import profiles
from fracgyro.scenario.kinds import KINDS
from fracgyro.scenario.to_core import device_numbers
from machine import command, machine, write
from scenario_files import write_files

DEPENDS_ON = ["sliding_mode", "joint", "composite", "benchmarks/off_model.cpp", "benchmarks/scenario_files.hpp"]

DEVICES = ["dual_mass", "tuned_in_air", "disc", "paper_resonance"]
LENGTHS = [20, 2_000, 20_000]
FROM, UNTIL = 100_000, 200_000
SAMPLES = 400_000  # without faults
TURNS = ((1, 300), (10, 100), (50, 30), (100, 30))  # Hz, deg/s; the bandwidth is 100 Hz
FAST = ((150, 30), (200, 30), (300, 30), (400, 30))
ALLOWED = 50.0  # ms, after the end of a fault
# Kind, size in q0 or as a factor.
FAULTS: list[tuple[str, float]] = [
    *(("x", size) for size in (1e-5, 1e-4, 1e-3, 1e-2, 1.0, 100.0, 1e5)),
    ("y", -0.01),
    ("x and y", 0.1),
    *(("x times", size) for size in (1.0001, 1.001, 1.01, -1.0, 0.0)),
    *(("y times", size) for size in (1.01, 0.5, -1.0, 0.0)),
    *(("both times", size) for size in (1.01, -1.0, 0.0)),
    *((what, 0.0) for what in ("x stuck", "y stuck", "both stuck", "x is NaN", "both are NaN", "axes swapped")),
    *(("axes turned by", size) for size in (1e-3, 0.01, 0.1, 1.5708)),
    *(("samples late", size) for size in (1.0, 10.0)),
    *(("noise", size) for size in (1e-4, 1e-2)),
    ("every 2nd x", 1.0),
    ("every 10th x", 1e-3),
    ("every 100th x", 1.0),
    ("ramp of x to", 0.1),
    ("steps of", 0.01),
    ("clipped at", 0.9),
    ("tone on x", 1e-3),
    ("tone on y", 0.1),
]
QUICK = [
    ("x", 0.01),
    ("x times", 1.01),
    ("y times", -1.0),
    ("both stuck", 0.0),
    ("axes turned by", 0.01),
    ("noise", 1e-4),
]


def both(scenario: fg.Scenario) -> fg.Scenario:
    """The same device with a velocity sensor, with the position sensor's noise at the natural frequency."""
    density = scenario.device.position_noise_density * scenario.plant.reference_frequency
    return scenario.replace({"device.sensing": "full", "device.velocity_noise_density": density})


class Program:
    """off_model.cpp, compiled, for one scenario after another."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        source = Path(__file__).with_suffix(".cpp")
        system_compiler(*FLAGS, "-O2", *include(SOURCES / "include"), source, "-o", folder / "off_model")

    def __call__(self, scenario: fg.Scenario, checked: bool, faults: list[str], until: int = UNTIL) -> list[Any]:
        with tempfile.TemporaryDirectory(dir=self._folder) as name:
            folder = Path(name)
            write_files(scenario, folder)
            np.array(list(device_numbers(scenario).values())).tofile(folder / "device")
            for kind, points in zip(("rate", "temperature"), profiles(scenario), strict=True):
                np.array(points).tofile(folder / kind)
            sensing = "both" if scenario.device.sensing == "full" else "position"
            if scenario.adaptation.kind == "composite":
                sensing = "composite"
            guard = "checked" if checked else "unchecked"
            words = [str(KINDS.index(scenario.controller.kind)), sensing, guard, str(FROM), str(until)]
            ran = subprocess.run(
                [self._folder / "off_model", *words],
                cwd=folder,
                input="\n".join(faults) + "\n",
                capture_output=True,
                text=True,
                check=True,
            )
        return [json.loads(line.replace("nan", "null").replace("inf", "null")) for line in ran.stdout.splitlines()]


def least_squares(scenario: fg.Scenario) -> fg.Scenario:
    """Composite adaptation, for position and velocity sensors with a hundredth of the noise used for joint
    adaptation."""
    fine = both(scenario.replace({"device.position_noise_density": 1e-2 * scenario.device.position_noise_density}))
    return fine.replace({"adaptation.kind": "composite"})


SENSED = {"position": lambda scenario: scenario, "both": both, "composite": least_squares}


def fault_table(
    program: Program, devices: list[str], faults: list[tuple[str, float]], sensings: tuple[str, ...]
) -> list[str]:
    cases = [(d, s, g, n) for d in devices for s in sensings for g in (True, False) for n in LENGTHS]

    def row(case: tuple[str, str, bool, int]) -> str:
        device, sensing, checked, length = case
        scenario = SENSED[sensing](fg.Scenario.shipped(device))
        found = program(scenario, checked, [f"{what},{size},{length}" for what, size in faults])
        step = 1e3 * scenario.run.step * scenario.plant.scales.time  # ms
        back = [one["back"] * step if one["back"] >= 0 else math.inf for one in found]
        late = [f"{what} {size:g}" for (what, size), t in zip(faults, back, strict=True) if not t <= ALLOWED]
        wrong = sum(
            one[part][0] * one[part][1] * samples
            for one in found
            for part, samples in (("during", length), ("after", UNTIL - FROM - length))
        )
        trusted = sum(
            one[part][0] * samples
            for one in found
            for part, samples in (("during", length), ("after", UNTIL - FROM - length))
        )
        return (
            f"| {device} | {sensing} | {'checked' if checked else 'not'} | {length:,} | {len(found)} | "
            f"{100 * wrong / trusted:.3f} | {np.median(back):.1f} | {max(t for t in back if math.isfinite(t)):.1f} | "
            f"{len(late)}{': ' + ', '.join(late) if late else ''} |"
        )

    with ThreadPoolExecutor() as pool:
        rows = list(pool.map(row, cases))
    return [
        "| device | sensing | samples | length | faults | wrong while trusted, % | back, median, ms | largest, ms | "
        f"not within {ALLOWED:g} ms |",
        "|---|---|---|---|---|---|---|---|---|",
        *rows,
    ]


Case = tuple[str, fg.Scenario, int]  # first cells of its row, scenario, samples


def without_faults(program: Program, cases: list[Case]) -> list[str]:
    """A row for each case: RMS error, stated deviation, shares of trusted samples and of wrong samples among these."""

    def row(case: Case) -> str:
        words, scenario, until = case
        (found,) = program(scenario, True, ["none,0,0"], until)
        deg = math.degrees(scenario.plant.scales.rate)
        trusted, wrong = found["after"]
        return (
            f"| {words} | {deg * found['rms']:.3g} | {deg * found['deviation']:.3g} | {100 * trusted:.2f} | "
            f"{100 * wrong:.3f} |"
        )

    with ThreadPoolExecutor() as pool:
        return list(pool.map(row, cases))


MEASURED = "RMS error, deg/s | stated, mean, deg/s | trusted, % | wrong while trusted, % |"


def drift_table(program: Program, devices: list[str], minute: bool) -> list[str]:
    cases: list[Case] = []
    for long, drift, device in itertools.product((False, True), (0.0, 1.0, 10.0), devices):
        if long and not (minute and drift == 1.0):
            continue
        ramp = {"device.stiffness_drift": -1.0, "device.temperature_ramp": drift, "plant.angular_rate": 0.0}
        scenario, until = fg.Scenario.shipped(device).replace(ramp), SAMPLES
        second = 1.0 / (scenario.run.step * scenario.plant.scales.time)  # samples
        if long:
            until = round(60.0 * second)
            scenario = scenario.replace({"run.duration": until * scenario.run.step})
        cases.append((f"{device} | {drift:g} | {until / second:.3g} s", scenario, until))
    return [
        f"| device | drift, ppm/s | for | {MEASURED}",
        "|---|---|---|---|---|---|---|",
        *without_faults(program, cases),
    ]


def delay_table(program: Program, devices: list[str]) -> list[str]:
    late = {"device.delay": 1, "datasheet.delay": 0}
    cases: list[Case] = [(device, fg.Scenario.shipped(device).replace(late), SAMPLES) for device in devices]
    return [f"| device | {MEASURED}", "|---|---|---|---|---|", *without_faults(program, cases)]


def turn_table(
    program: Program, devices: list[str], sensing: str, turns: tuple[tuple[int, int], ...] = TURNS
) -> list[str]:
    cases: list[Case] = []
    for device, (hertz, size) in itertools.product(devices, turns):
        base = SENSED[sensing](fg.Scenario.shipped(device))
        start = FROM * base.run.step * base.plant.scales.time
        for begin, words in ((start, "from rest"), (0.0, "from the first sample")):
            turn = {
                "plant.angular_rate": 0.0,
                "rate.kind": "sine",
                "rate.amplitude": math.radians(size),
                "rate.frequency": 2 * math.pi * hertz,
                "rate.start": begin,
            }
            cases.append((f"{device} | {hertz} Hz, {size} deg/s, {words}", base.replace(turn), SAMPLES))
    return [f"| device | rate | {MEASURED}", "|---|---|---|---|---|---|", *without_faults(program, cases)]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    devices, faults = (DEVICES[:1], QUICK) if quick else (DEVICES, FAULTS)
    with tempfile.TemporaryDirectory() as name:
        program = Program(Path(name))
        parts = [
            "# The rate sensor off its model",
            f"`{command()}`, on {machine()}.",
            "The shipped devices at 300 deg/s, joint adaptation, in closed loop with the exact plant. Wrong is an "
            "error beyond four stated deviations.",
            "## Faults of sensors",
            f"{len(faults)} faults, begun at sample {FROM:,} and watched to {UNTIL:,}. Back is the time from the end "
            "of the fault until 99 % of all later samples are trusted and not wrong.",
            "\n".join(fault_table(program, devices, faults, ("position", "both"))),
            "## Faults of sensors, composite adaptation",
            "Positions and velocities, with a hundredth of the noise.",
            "\n".join(fault_table(program, devices, faults, ("composite",))),
            "## Stiffness that drifts",
            "At rest; the datasheets state 10 ppm/s. From sample 100,000 on.",
            "\n".join(drift_table(program, devices, not quick)),
            "## A delay that the datasheet does not state",
            "The force acts one step late, at 300 deg/s.",
            "\n".join(delay_table(program, devices)),
            "## Rates that turn",
            "From sample 100,000, where the rate begins to turn or has turned from the first sample, to 400,000.",
            "\n".join(turn_table(program, devices, "position")),
            "## Rates that turn faster than the bandwidth",
            "\n".join(turn_table(program, devices, "position", FAST)),
            "## Rates that turn, composite adaptation",
            "Positions and velocities, with a hundredth of the noise.",
            "\n".join(turn_table(program, devices, "composite")),
        ]
    write("off_model", ["\n\n".join(parts)], keep=not quick)


if __name__ == "__main__":
    main()
