"""What each law gives as a rate sensor; writes benchmarks/results/rate_sensor.md and docs/rate_sensor.svg."""

from __future__ import annotations

import math
import time
from pathlib import Path

import fracgyro as fg
import matplotlib as mpl
import numpy as np
from fracgyro.paper.drawing import RC
from fracgyro.rate.characterise import Characterisation, measure
from fracgyro.rate.report import value_of
from fracgyro.rate.results import results
from fracgyro.rate.units import DEG_PER_H
from fracgyro.shipped import shipped
from machine import command, machine, write
from matplotlib.figure import Figure

DRAWING = Path(__file__).resolve().parents[1] / "docs" / "rate_sensor.svg"
SEEDS = 4
KEYS = [
    "scale_factor_error",
    "nonlinearity",
    "zero_rate_output",
    "angle_random_walk",
    "bandwidth",
    "full_scale",
    "start_up_time",
    "quadrature_residual",
]
COLOURS = ["#E69F00", "#0072B2", "#009E73", "#CC79A7"]


def sensing(scenario: fg.Scenario) -> fg.Scenario:
    """The same with least squares as the sensor, as far as Omega_z is concerned of 100 Hz."""
    rate = 2 * math.pi * 100.0 * scenario.plant.scales.time
    return scenario.replace({"adaptation.kind": "composite", "adaptation.rate_forgetting": rate})


def cases() -> list[tuple[str, str, fg.Scenario]]:
    """Where, which law, scenario."""
    paper = fg.Scenario.paper().replace({"run.duration": 800.0})
    found = [
        ("paper, its noise, off resonance", "laws (44), the paper's gains", paper),
        ("paper, its noise, off resonance", "composite", sensing(paper)),
        ("paper, thermal noise, off resonance", "laws (44), the paper's gains", shipped("paper_thermal")),
        ("paper, thermal noise, off resonance", "composite", sensing(shipped("paper_thermal"))),
    ]
    for name in ("paper_resonance", "dual_mass", "tuned_in_air", "disc"):
        scenario = shipped(name)
        found.append((name, "laws (44), gains for resonance", scenario.replace({"adaptation.kind": "gradient"})))
        found.append((name, "composite", scenario))
    return found


def main() -> None:
    begin = time.perf_counter()
    lines = [
        "# The gyroscope as a rate sensor",
        "",
        f"Made by `{command()}`, which is part of `make bench`; {SEEDS} seeds. Machine: {machine()}.",
        "",
        "As `fracgyro rate` defines each figure. As printed the law never moves Ω̂z: there is nothing to measure.",
        "",
    ]
    measured: list[tuple[str, str, Characterisation]] = []
    for place, law, scenario in cases():
        found = measure(scenario, seeds=SEEDS)
        measured.append((place, law, found))
        by_key = {result.key: result for result in results(found)}
        if len(measured) == 1:
            names = [f"{by_key[key].name} ({by_key[key].unit})" for key in KEYS]
            lines.append("| where | law | " + " | ".join(names) + " | ARW over the bound |")
            lines.append("|---" * (len(KEYS) + 3) + "|")
        walk = found.allan.angle_random_walk
        ratio = f"{walk.value / found.bound:.2f}" if walk and found.bound else "–"
        cells = [place, law, *(value_of(by_key[key]) for key in KEYS), ratio]
        lines.append(f"| {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    draw(measured)
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("rate_sensor", lines)


def draw(measured: list[tuple[str, str, Characterisation]]) -> None:
    """Allan deviations of the paper's gyroscope, off and on resonance, with the bounds."""
    titles = ["paper, its noise, off resonance", "paper, thermal noise, off resonance", "paper_resonance"]
    heads = ["off resonance, the paper's noise", "off resonance, thermal noise", "at resonance, thermal noise"]
    with mpl.rc_context(RC):
        figure = Figure(figsize=(170 / 25.4, 70 / 25.4), layout="constrained")
        panels = figure.subplots(1, 3, sharex=True)
        for panel, title, head in zip(panels, titles, heads, strict=True):
            for i, (_, law, found) in enumerate(m for m in measured if m[0] == title):
                deviation = DEG_PER_H.per_si * found.allan.deviation
                label = "least squares beside them" if law == "composite" else "the laws (44)"
                panel.loglog(found.allan.tau, deviation, marker="o", markersize=2.5, color=COLOURS[i], label=label)
                bound = DEG_PER_H.per_si * (found.bound or math.nan) / np.sqrt(found.allan.tau)
            panel.loglog(found.allan.tau, bound, color="black", dashes=(4, 2), linewidth=0.8, label="Cramér-Rao bound")
            panel.set_title(head, fontsize=8)
            panel.set_xlabel("averaging time (s)")
            panel.grid(True, linewidth=0.3)
        panels[0].set_ylabel("Allan deviation (deg/h)")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        figure.savefig(DRAWING, metadata={"Date": None})


if __name__ == "__main__":
    main()
