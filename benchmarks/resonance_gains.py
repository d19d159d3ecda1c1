"""Adaptation gains for a gyroscope driven at resonance; writes benchmarks/results/resonance_gains.md."""

from __future__ import annotations

import math
import time

import fracgyro as fg
import numpy as np
from fracgyro.rate.merit import turn_on_time
from fracgyro.rate.sensor import Sensor
from fracgyro.rate.units import DEG_PER_S
from fracgyro.scenario.named import exactly_sensed
from machine import command, machine, write

DEPENDS_ON = ["sliding_mode"]

NAME = "paper_resonance"
RATE = DEG_PER_S.to_si(300.0)
RATE_GAINS = [150.0, 1.0, 0.3, 0.1, 0.03, 0.01, 0.003]
SWITCHING = [0.1, 0.3, 1.0, 3.0]  # rho/delta over omega0
SEEDS = 4


def changes(rate_gain: float, switching: float) -> dict[str, object]:
    """Only the laws; M and N a third of P, as in the shipped scenario."""
    layer = exactly_sensed(NAME).controller.layer_thickness
    return {
        "adaptation.kind": "gradient",
        "adaptation.rate_gain": rate_gain,
        "adaptation.damping_gain": rate_gain / 3,
        "adaptation.stiffness_gain": rate_gain / 3,
        "adaptation.initial_bound": (switching * layer, 1e-9, 1e-9),
    }


def cell(scenario: fg.Scenario) -> str:
    """Steady error of the rate's mean and its spread, deg/s; time until it stays within 1 %, ms."""
    try:
        output = Sensor.of(scenario, SEEDS).output(RATE)
    except ValueError:
        return "diverges"
    steady = output.settled().rate
    off = DEG_PER_S.of(float(steady.mean()) - RATE)
    spread = DEG_PER_S.of(float(np.sqrt(steady.var(axis=1).mean())))
    start = 1e3 * turn_on_time(output.time, output.rate)
    started = f"{start:.0f} ms" if math.isfinite(start) else "never"
    return f"{off:+.3g} ± {spread:.2g}, {started}"


def lag_of_surface(base: fg.Scenario, switching: float) -> float:
    """rad: phase lag of s on y behind the force of a wrong Omega_z, which is in phase with q'_x, without adaptation."""
    still = {
        "adaptation.damping_gain": 1e-12,
        "adaptation.stiffness_gain": 1e-12,
        "adaptation.rate_gain": 1e-12,
        "adaptation.initial_rate": 0.0,
        "disturbance.kind": "none",
        "run.duration": 1000.0,
    }
    runs = [
        fg.simulate(base.replace({**changes(0.1, switching), **still, "plant.angular_rate": rate}))
        for rate in (0.0, RATE)
    ]
    without, wrong = (run.isel(time=slice(run.sizes["time"] // 2, None)) for run in runs)
    answer = (wrong["surface"] - without["surface"]).values[:, 1]  # contribution of the rate to s
    force = -wrong["velocity"].values[:, 0]  # times 2 Omega_z
    carrier = np.exp(-1j * wrong["time"].values) * np.hanning(len(force))  # the x axis moves at 1
    return float(np.angle((force * carrier).sum() / (answer * carrier).sum()))


def thrown(base: fg.Scenario) -> str:
    """The largest estimate over the rate, of each seed, from rest and from the reference, with only the laws."""
    cells = []
    for start in ({"run.initial_position": (0.0, 0.0), "run.initial_velocity": (0.0, 0.0)}, {}):
        scenario = base.replace(
            {**changes(0.1, 3.0), **start, "plant.angular_rate": RATE, "adaptation.initial_rate": 0.0}
        )
        estimates = (
            fg.simulate_many([scenario], seeds=range(SEEDS))["rate_estimate"].values * scenario.plant.scales.rate
        )
        cells.append(f"{abs(estimates).max() / RATE:.3g}")
    return f"{cells[0]} times the rate from rest, {cells[1]} times from the reference"


def main() -> None:
    begin = time.perf_counter()
    base = exactly_sensed(NAME)
    papers = {
        "adaptation.kind": "gradient",
        "adaptation.damping_gain": 150.0,
        "adaptation.rate_gain": 150.0,
        "adaptation.stiffness_gain": 150.0 / 18.177**2,
        "controller.fractional_gain": 10.0 / 18.177**1.1,
        "controller.terminal_gain": 0.5 / 18.177,
        "controller.layer_thickness": 0.06 / 18.177,
        "adaptation.initial_bound": (0.1 / 18.177**2, 0.2 / 18.177**2, 0.3 / 18.177),
        "adaptation.bound_gain": (1 / 18.177**2, 1.6 / 18.177**2, 1.6),
    }
    lines = [
        "# Adaptation gains at resonance",
        "",
        f"Made by `{command()}`, which is part of `make bench`. Machine: {machine()}.",
        "",
        f"Scenario {NAME}, the laws (44) alone, the rate 300 deg/s, the first estimate 0, {SEEDS} seeds. In each "
        "place: the mean output of the steady half less the rate, ± its spread, deg/s; how long until every output is "
        "within 1 % of the final one. P in 1/q0², M = N = P/3 in their units.",
        "",
        "The paper's gains in these units (M = P = 150, N = 150/18.2², λ1, λ2, δ, b̂(0) and x alike): "
        f"{cell(base.replace(papers))}.",
        "",
        "| P | " + " | ".join(f"ρ/δ = {s:g} ω0" for s in SWITCHING) + " |",
        "|---" * (1 + len(SWITCHING)) + "|",
    ]
    for gain in RATE_GAINS:
        cells = [cell(base.replace(changes(gain, switching))) for switching in SWITCHING]
        lines.append(f"| {gain:g} | {' | '.join(cells)} |")
    finer = base.replace({"run.step": base.run.step / 2})
    cells = [cell(finer.replace(changes(0.03, switching))) for switching in SWITCHING]
    lines.append(f"| 0.03, half the step | {' | '.join(cells)} |")
    lags = [f"{math.degrees(lag_of_surface(base, switching)):.0f}°" for switching in SWITCHING]
    first_order = [f"{math.degrees(math.atan(1 / switching)):.0f}°" for switching in SWITCHING]
    lines += [
        "",
        "How far s lags behind the force of a wrong Ω̂z when nothing adapts, at these ρ/δ: "
        f"{', '.join(lags)}; atan(ω0 δ/ρ), of a lag of first order: {', '.join(first_order)}.",
        "",
        f"The largest estimate, against the force limit, P = 0.1, ρ/δ = 3 ω0: {thrown(base)}.",
    ]
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("resonance_gains", lines)


if __name__ == "__main__":
    main()
