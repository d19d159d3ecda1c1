"""The rate's bandwidth against its noise, beside a Kalman filter; writes benchmarks/results/rate_response.md."""

from __future__ import annotations

import math
import time

import fracgyro as fg
import numpy as np
from fracgyro.rate.figures import gain_and_lag, response
from fracgyro.rate.units import DEG_PER_S
from fracgyro.shipped import shipped
from machine import command, machine, write
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCENARIOS = ["paper_resonance", "dual_mass"]
RATE = DEG_PER_S.to_si(100.0)
CORNERS = [10.0, 30.0, 100.0, 300.0]  # Hz, of adaptation.rate_forgetting
SPREAD = np.geomspace(0.25, 4.0, 9)  # sine frequencies over the corner
SEEDS = range(4)
EVERY = 4  # steps between recorded samples


def kalman(position: Array, velocity: Array, force: Array, scenario: fg.Scenario, walk: float) -> Array:
    """The rate as the Kalman filter has it that knows D and K and takes Omega_z for a random walk of this intensity.

    Nondimensional; `walk` is variance per unit of time. From every step of the same run: the impulse of eq. (9) over a
    step that D, K and the force leave unexplained is 2 Omega_z J dq, plus noise of variance S h on each axis. The true
    rate, times what moved, enters exactly so; the estimate holds the information of the steps before it.
    """
    h = scenario.run.step
    damping, stiffness = (_matrix(entries) for entries in scenario.plant.nondimensional()[:2])
    moved = np.diff(position, axis=0)
    held = h / 2 * (position[1:] + position[:-1]) + h**2 / 12 * (velocity[:-1] - velocity[1:])
    # Hermite's rule lacks h^5/720 times the fourth derivative, which with K known is heard as a beat of the two axes.
    held += h**5 / 720 * np.array(scenario.reference.frequency) ** 4 * position[1:]
    left = np.diff(velocity, axis=0) - h * force[:-1] + moved @ damping + held @ stiffness
    # left = -2 Omega_z (-dq_y, dq_x) + noise
    row = 2 * np.stack([moved[:, 1], -moved[:, 0]], axis=1)
    density = scenario.disturbance.density or 0.0
    information = (row**2).sum(axis=1) / (density * h)
    score = (row * left).sum(axis=1) / (density * h)
    estimate, variance = 0.0, 1.0
    found = np.empty(len(moved) + 1)
    found[0] = 0.0
    for i, (gained, seen) in enumerate(zip(information.tolist(), score.tolist(), strict=True)):
        variance = 1.0 / (1.0 / (variance + walk * h) + gained)
        estimate += variance * (seen - gained * estimate)
        found[i + 1] = estimate
    return found


def _matrix(entries: Array) -> Array:
    xx, xy, yy = entries
    return np.array([[xx, xy], [xy, yy]])


def settings(scenario: fg.Scenario, corner: float) -> dict[str, object]:
    rate = 2 * math.pi * corner * scenario.plant.scales.time
    return {"adaptation.kind": "composite", "adaptation.forgetting": 0.0, "adaptation.rate_forgetting": rate}


def noise(rate: Array, scenario: fg.Scenario) -> float:
    """Standard deviation over the steady half of all runs, rad/s."""
    steady = rate[..., rate.shape[-1] // 2 :]
    return float(np.sqrt(np.mean((steady - steady.mean(axis=-1, keepdims=True)) ** 2)) * scenario.plant.scales.rate)


def bandwidth(scenario: fg.Scenario, corner: float, walk: float | None) -> tuple[float, float]:
    """-3 dB in Hz and the lag there in rad: of the estimate, or of the Kalman filter on the same runs."""
    scales, frequencies = scenario.plant.scales, corner * SPREAD
    gains = []
    for frequency in frequencies:
        moving = {
            "rate.kind": "sine",
            "rate.amplitude": RATE,
            "rate.frequency": 2 * math.pi * frequency * scales.time,
            "plant.angular_rate": 0.0,
            "run.record_every": 1 if walk is not None else EVERY,
            "disturbance.density": (scenario.disturbance.density or 0.0) * 1e-6,  # of which the gain does not depend
        }
        run = fg.simulate(scenario.replace(moving))
        if walk is None:
            rate = run["rate_estimate"].values
        else:
            channels = (run[name].values for name in ("position", "velocity", "control"))
            rate = kalman(*channels, scenario, walk)
        half = len(rate) // 2
        time = run["time"].values[half:] * scales.time
        gains.append([gain_and_lag(time, rate[half:] * scales.rate, RATE, float(frequency), 0.0)])
    found = response(frequencies, np.array(gains), 1.0)
    return found.bandwidth.mean, found.lag_at_bandwidth


def main() -> None:
    begin = time.perf_counter()
    lines = [
        "# The rate estimate: bandwidth against noise",
        "",
        f"Made by `{command()}`, which is part of `make bench`. Machine: {machine()}.",
        "",
        "Composite adaptation, adaptation.rate_forgetting from 2π · 10 Hz to 2π · 300 Hz. Noise: standard deviation "
        f"of Ω̂z about its mean at rest, steady half of {len(SEEDS)} runs, beside of one. Bandwidth and lag: from sines "
        "of 100 deg/s. Beside it the Kalman filter that knows D, K and the noise and takes Ωz for a random walk, on "
        "the same steps, its walk chosen for the corner. Noise grows as the root of the bandwidth: the last column is "
        "noise over noise, each over the root of its own bandwidth.",
        "",
        "| scenario | set | bandwidth | lag there | noise | Kalman: bandwidth | lag | noise | ratio |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in SCENARIOS:
        base = shipped(name).replace({"plant.angular_rate": 0.0})
        for corner in CORNERS:
            lines.append(row(name, base, corner))
            print(lines[-1], flush=True)
    lines += ["", f"{time.perf_counter() - begin:.0f} s."]
    write("rate_response", lines)


def row(name: str, base: fg.Scenario, corner: float) -> str:
    scales = base.plant.scales
    # Long enough for 12 periods of the slowest sine in the steady half.
    duration = max(24 / (corner * SPREAD[0]) / scales.time, 4000.0)
    duration = base.run.step * round(min(duration, 900_000 * base.run.step) / base.run.step)
    scenario = base.replace({**settings(base, corner), "run.duration": duration})
    runs = fg.simulate_many([scenario.replace({"run.record_every": EVERY})], seeds=SEEDS)
    ours = noise(runs["rate_estimate"].values, scenario)
    wide, lag = bandwidth(scenario, corner, None)
    # The steady filter is of first order: corner sqrt(walk)/N, with N^2 = S/(4 mean |v|^2).
    one = fg.simulate(scenario)
    channels = [one[channel].values for channel in ("position", "velocity", "control")]
    power = float((channels[1] ** 2).sum(axis=1).mean())
    walk = (2 * math.pi * corner * scales.time) ** 2 * (scenario.disturbance.density or 0.0) / (4 * power)
    best = noise(kalman(*channels, scenario, walk), scenario)
    # The filter's gain is that of the noise it is told of, whatever the run's; its answer is linear.
    best_wide, best_lag = bandwidth(scenario, corner, walk)
    ratio = ours / math.sqrt(wide) / (best / math.sqrt(best_wide))
    units = [f"{DEG_PER_S.of(value) * 1e3:.3g} mdeg/s" for value in (ours, best)]
    lags = [f"{math.degrees(value):.0f}°" for value in (lag, best_lag)]
    cells = [name, f"{corner:g} Hz", f"{wide:.1f} Hz", lags[0], units[0], f"{best_wide:.1f} Hz", lags[1], units[1]]
    return f"| {' | '.join(cells)} | {ratio:.2f} |"


if __name__ == "__main__":
    main()
