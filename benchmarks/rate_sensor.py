"""Performance of each law as a rate sensor, and on real devices.

Writes benchmarks/results/rate_sensor.md and docs/rate_sensor.svg.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path

import fracgyro as fg
import numpy as np
from fracgyro.analysis.style import own_style, save_svg
from fracgyro.rate.allan import allan
from fracgyro.rate.measure import Characterization, measure
from fracgyro.rate.merit import static
from fracgyro.rate.report import value_of
from fracgyro.rate.results import results, short
from fracgyro.rate.runs import WITHIN, run_all
from fracgyro.rate.sensor import Sensor
from fracgyro.rate.units import DEG_PER_H, DEG_PER_ROOT_H, DEG_PER_S, PERCENT, PPM
from fracgyro.scenario.named import exactly_sensed
from machine import command, machine, write
from matplotlib.figure import Figure

DEPENDS_ON = ["sliding_mode", "composite", "joint"]

DRAWING = Path(__file__).resolve().parents[1] / "docs" / "rate_sensor.svg"
SEEDS = 4
DEVICES = ["dual_mass", "tuned_in_air"]
ALL_DEVICES = ["paper_resonance", "dual_mass", "tuned_in_air", "disc"]
MINUTE = 60.0  # s
QUADRATURE = DEG_PER_S.to_si(250.0)
RANGE = 1.25  # range of the sensors, over the maximum amplitude
PICK_OFF = 1e-13  # m/sqrt(Hz), one-sided, as the devices are shipped
CORNER = 1e3  # Hz, corner of flicker noise
WARMING = 10.0  # K over a run
DRIFT = -30.0  # ppm/K, silicon
KEYS = [
    "scale_factor_error",
    "nonlinearity",
    "zero_rate_output",
    "zero_rate_rms",
    "angle_random_walk",
    "bandwidth",
    "full_scale",
    "turn_on_time",
    "quadrature_residual",
]
COLOURS = ["#E69F00", "#0072B2", "#009E73", "#CC79A7"]


def sensing(scenario: fg.Scenario) -> fg.Scenario:
    """The same with least squares as the sensor, with a bandwidth of 100 Hz for Omega_z."""
    rate = 2 * math.pi * 100.0 * scenario.plant.scales.time
    return scenario.replace({"adaptation.kind": "composite", "adaptation.rate_forgetting": rate})


def cases() -> list[tuple[str, str, fg.Scenario]]:
    """Device, law, scenario."""
    paper = fg.Scenario.paper().replace({"run.duration": 800.0})
    found = [
        ("paper, its noise, off resonance", "laws (44), the paper's gains", paper),
        ("paper, its noise, off resonance", "composite", sensing(paper)),
        ("paper, thermal noise, off resonance", "laws (44), the paper's gains", fg.Scenario.shipped("paper_thermal")),
        ("paper, thermal noise, off resonance", "composite", sensing(fg.Scenario.shipped("paper_thermal"))),
    ]
    for name in ALL_DEVICES:
        scenario = exactly_sensed(name)
        found.append((name, "laws (44), gains for resonance", scenario.replace({"adaptation.kind": "gradient"})))
        found.append((name, "composite", scenario))
        found.append((f"{name}, positions only, {PICK_OFF:g} m/√Hz", "joint", fg.Scenario.shipped(name)))
    return found


def converters(scenario: fg.Scenario, bits: int, *quantities: str) -> dict[str, object]:
    plant = scenario.plant
    largest = {"position": plant.reference_length, "velocity": plant.reference_length * plant.reference_frequency}
    ranges = {f"device.{quantity}_range": RANGE * largest[quantity] for quantity in quantities}
    return {**ranges, **{f"device.{quantity}_bits": bits for quantity in quantities}}


def falling(scenario: fg.Scenario) -> dict[str, object]:
    pace = WARMING / (scenario.run.duration * scenario.plant.scales.time)
    return {"device.stiffness_drift": DRIFT, "device.temperature_ramp": pace}


def forgetting(scenario: fg.Scenario, bandwidth: float) -> dict[str, object]:
    return {"adaptation.forgetting": 2 * math.pi * bandwidth * scenario.plant.scales.time}


Effects = list[tuple[str, dict[str, object]]]


def of_exact_sensing(scenario: fg.Scenario) -> Effects:
    """Effects of a real device, one at a time, and then together."""
    noise: dict[str, object] = {
        "device.position_noise_density": PICK_OFF,
        "device.velocity_noise_density": PICK_OFF * scenario.plant.reference_frequency,
    }
    delay: dict[str, object] = {"device.delay": 1}
    drift, fine = falling(scenario), converters(scenario, 16, "position", "velocity")
    # The observer starts at rest, and so does the mass, at a turning point.
    x, y = scenario.reference.amplitude
    position: dict[str, object] = {
        "device.sensing": "position",
        "controller.observer_bandwidth": 10.0,
        "reference.phase": (math.pi / 2, math.pi / 2),
        "run.initial_position": (x, y),
        "run.initial_velocity": (0.0, 0.0),
    }
    step, steps = scenario.run.step, scenario.run.steps
    finer = {"controller.observer_bandwidth": 30.0, "run.step": step / 5, "run.duration": steps * step / 5}
    return [
        ("ideal", {}),
        ("16 bit sensing", fine),
        ("12 bit sensing", converters(scenario, 12, "position", "velocity")),
        ("sensing noise", noise),
        ("loop delay of one step", delay),
        (f"stiffness drift of {DRIFT:g} ppm/K, {WARMING:g} K", drift),
        ("… D and K forgotten at 10 Hz", {**drift, **forgetting(scenario, 10.0)}),
        ("16 bit, noise, delay and drift", {**fine, **noise, **delay, **drift}),
        ("positions only, observer at 10 ω0", position),
        ("… at 30 ω0, a fifth of the step", {**position, **finer}),
        ("… and 16 bit", {**position, **finer, **converters(scenario, 16, "position", "velocity")}),
    ]


def of_positions(scenario: fg.Scenario) -> Effects:
    """The same for a device that senses positions, with noise."""
    fine, drift, tracked = converters(scenario, 16, "position"), falling(scenario), forgetting(scenario, 100.0)
    flicker: dict[str, object] = {"device.position_noise_corner": CORNER}
    delay: dict[str, object] = {"device.delay": 1}
    return [
        ("as shipped", {}),
        ("without sensing noise", {"device.position_noise_density": 0.0}),
        (f"flicker noise too, corner {CORNER:g} Hz", flicker),
        ("16 bit", fine),
        ("12 bit", converters(scenario, 12, "position")),
        ("delay of one step, in the datasheet", delay),
        ("… not in the datasheet", {**delay, "datasheet.delay": 0}),
        (f"stiffness drift of {DRIFT:g} ppm/K, {WARMING:g} K", drift),
        ("… D and K forgotten at 100 Hz", {**drift, **tracked}),
        (
            "damping drift of 3000 ppm/K, the same",
            {**drift, "device.stiffness_drift": 0.0, "device.damping_drift": 3e3},
        ),
        ("pick-off of x 1 % off", {"device.pickoff_gain_error": (0.01, 0.0)}),
        ("force on x 1 % off", {"device.force_gain_error": (0.01, 0.0)}),
        ("pick-offs turned by 1 mrad", {"device.pickoff_misalignment": 1e-3}),
        ("actuators turned by 1 mrad", {"device.force_misalignment": 1e-3}),
        ("16 bit, flicker, delay known, drift tracked", {**fine, **flicker, **delay, **drift, **tracked}),
    ]


def of_a_minute(_: fg.Scenario) -> Effects:
    """A stiffness that falls slowly, for much longer than the scenario's own run."""
    slow: dict[str, object] = {"device.stiffness_drift": -1.0, "device.temperature_ramp": 1.0}
    words = "stiffness falls by 1 ppm/s for a minute"
    scenario = fg.Scenario.shipped(DEVICES[0])
    return [
        (words, slow),
        *((f"… D and K forgotten at {f:g} Hz", {**slow, **forgetting(scenario, f)}) for f in (10.0, 100.0)),
    ]


def of_hidden_delay(scenario: fg.Scenario) -> Effects:
    """An unstated delay of the force by one step, at rest and with quadrature."""
    plant = scenario.plant
    hidden: dict[str, object] = {"device.delay": 1, "datasheet.delay": 0}
    coupling = 2 * plant.mass * math.sqrt(plant.stiffness.xx / plant.mass) * QUADRATURE
    pulled: dict[str, object] = {"plant.stiffness_deviation": {"xx": 0.0, "xy": coupling, "yy": 0.0}}
    degrees = f"{DEG_PER_S.of(QUADRATURE):g} deg/s"
    return [("hidden delay of one step", hidden), (f"… and quadrature of {degrees}", {**hidden, **pulled})]


def device_row(name: str, effect: str, scenario: fg.Scenario, seconds: float | None = None) -> str:
    """Figures of the static ladder and of the record at rest, on the scenario's own duration or a longer one."""
    sensor = Sensor.of(scenario, options.seeds)
    ladder = WITHIN[-1:] if seconds else WITHIN[::2]
    rates = np.concatenate([-ladder[::-1], [0.0], ladder])
    steps = round(seconds / scenario.run.step / scenario.plant.scales.time) if seconds else None
    outputs = [sensor.output(float(rate), steps=steps).settled() for rate in rates]
    line = static(rates, np.array([output.rate.mean(axis=1) for output in outputs]))
    rest = outputs[len(ladder)]
    noise = allan(rest.rate, rest.interval)
    walk = noise.angle_random_walk
    zero = [DEG_PER_H.of(value) for value in line.zero_rate_output]
    cells = [
        name,
        effect,
        short(PPM.of(line.scale_factor.mean - 1.0)),
        short(PERCENT.of(line.nonlinearity.mean)),
        f"{short(zero[0])} ({short(zero[1])} to {short(zero[2])})",
        short(DEG_PER_H.of(float(np.sqrt((rest.rate**2).mean())))),
        short(DEG_PER_ROOT_H.of(walk.value)) if walk else "–",
        f"{short(DEG_PER_H.of(float(noise.deviation[-1])))} at {1e3 * noise.tau[-1]:.0f} ms",
    ]
    return f"| {' | '.join(cells)} |"


def device_lines(
    title: str,
    words: str,
    scenario_of: Callable[[str], fg.Scenario],
    effects: Callable[[fg.Scenario], Effects],
    devices: list[str] = DEVICES,
    seconds: float | None = None,
) -> list[str]:
    """A table of effects on each device."""
    lines = [
        "",
        f"## {title}",
        "",
        words,
        "",
        "| scenario | effect | scale factor error (ppm) | non-linearity (%) | zero-rate output (deg/h) | "
        "RMS at rest (deg/h) | angle random walk (deg/sqrt(h)) | Allan deviation (deg/h) |",
        "|---" * 8 + "|",
    ]
    for name in devices:
        scenario = scenario_of(name)
        for effect, changes in effects(scenario):
            lines.append(device_row(name, effect, scenario.replace(changes), seconds))
            print(lines[-1], flush=True)
    return lines


def not_ideal() -> list[str]:
    shared = (
        "Rates of ±10, ±100, ±300 deg/s and 0. In brackets the 95 % interval over seeds of the mean; the RMS is that "
        "of the same output, mean, noise and ripple together. No angle random walk where "
        "the Allan deviation shows no white noise; the last column is the deviation over the longest time that the "
        f"record has ten of. Converters reach to ±{RANGE:g} times the largest amplitude and speed."
    )
    exact = (
        "Composite adaptation, thermal noise; `[device]` as said, and the rest as shipped. Sensing noise: "
        f"{PICK_OFF:g} m/√Hz of position, ω0 times that of velocity. With positions only the mass starts where it "
        "turns."
    )
    noisy = f"Joint adaptation; {PICK_OFF:g} m/√Hz of the position, thermal noise, and what is said."
    return [
        *device_lines(
            "Exact sensors, and what a device is not ideal in", f"{exact} {shared}", exactly_sensed, of_exact_sensing
        ),
        *device_lines("Positions with sensing noise, and more", f"{noisy} {shared}", fg.Scenario.shipped, of_positions),
        *device_lines(
            "A slow drift for a minute",
            f"{noisy} The second half of {MINUTE:g} s counts; rates of ±300 deg/s and 0.",
            fg.Scenario.shipped,
            of_a_minute,
            DEVICES[:1],
            MINUTE,
        ),
        *device_lines(
            "Hidden delay on each device",
            f"{noisy} The force is a step late, and the datasheet does not say so.",
            fg.Scenario.shipped,
            of_hidden_delay,
            ALL_DEVICES,
        ),
    ]


def main() -> None:
    begin = time.perf_counter()
    lines = [
        "# The gyroscope as a rate sensor",
        "",
        f"Made by `{command()}`, which is part of `make bench`; {options.seeds} seeds. Machine: {machine()}.",
        "",
        "As `fracgyro rate` defines each figure. As printed the law never moves Ω̂z: there is nothing to measure.",
        "",
    ]
    measured: list[tuple[str, str, Characterization]] = []
    for place, law, scenario in cases():
        sensor = Sensor.of(scenario, options.seeds)
        found = measure(sensor, run_all(sensor))
        measured.append((place, law, found))
        by_key = {result.key: result for result in results(found)}
        if len(measured) == 1:
            names = [f"{by_key[key].name} ({by_key[key].unit})" for key in KEYS]
            lines.append(
                "| where | law | "
                + " | ".join(names)
                + " | the bound of ARW, D and K known | ARW over it | over that with D, K unknown |"
            )
            lines.append("|---" * (len(KEYS) + 5) + "|")
        walk = found.allan.angle_random_walk
        bounds = ["–", "–", "–"]
        if found.bound:
            bounds[0] = short(DEG_PER_ROOT_H.of(found.bound.known))
        if walk and found.bound:
            bounds[1:] = [
                f"{walk.value / found.bound.known:.2f} ({walk.low / found.bound.known:.2f} to "
                f"{walk.high / found.bound.known:.2f})",
                f"{walk.value / found.bound.unknown:.2f}",
            ]
        cells = [place, law, *(value_of(by_key[key]) for key in KEYS), *bounds]
        lines.append(f"| {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    draw(measured)
    lines += not_ideal()
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("rate_sensor", lines)


def draw(measured: list[tuple[str, str, Characterization]]) -> None:
    """Allan deviations of the paper's gyroscope, off and on resonance, with the bounds."""
    titles = ["paper, its noise, off resonance", "paper, thermal noise, off resonance", "paper_resonance"]
    heads = ["off resonance, the paper's noise", "off resonance, thermal noise", "at resonance, thermal noise"]
    with own_style():
        figure = Figure(figsize=(170 / 25.4, 70 / 25.4), layout="constrained")
        panels = figure.subplots(1, 3, sharex=True)
        for panel, title, head in zip(panels, titles, heads, strict=True):
            for i, (_, law, found) in enumerate(m for m in measured if m[0] == title):
                deviation = DEG_PER_H.per_si * found.allan.deviation
                label = "with least squares" if law == "composite" else "the laws (44)"
                panel.loglog(found.allan.tau, deviation, marker="o", markersize=2.5, color=COLOURS[i], label=label)
            if found.bound:
                bound = DEG_PER_H.per_si * found.bound.known / np.sqrt(found.allan.tau)
                label = "Cramér-Rao bound, D and K known"
                panel.loglog(found.allan.tau, bound, color="black", dashes=(4, 2), linewidth=0.8, label=label)
            panel.set_title(head, fontsize=8)
            panel.set_xlabel("averaging time (s)")
            panel.grid(True, linewidth=0.3)
        panels[0].set_ylabel("Allan deviation (deg/h)")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        save_svg(figure, DRAWING, "Allan deviation of the rate")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    options = parser.parse_args()
    main()
