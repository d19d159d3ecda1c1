"""The rate from statistics of whole spans of samples: its deviation over the bound, before any law is simulated.

Writes benchmarks/results/decimation.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import fracgyro as fg
import numpy as np
from fracgyro.rate.bound import bound_angle_random_walk, noise_of
from fracgyro.rate.innovation import Plant
from machine import command, machine, write
from numpy.typing import NDArray
from scipy.linalg import expm

DEPENDS_ON: list[str] = []

DEVICES = ["paper_resonance", "dual_mass", "tuned_in_air", "disc"]
SPANS = [16, 32, 64, 128, 256]
NOISES = [0.0, 1e-14]  # m/sqrt(Hz); the shipped devices have 1e-13
DESIGNS = {
    "mean": "mean of the positions",
    "own": "projections on the axis's own line",
    "other": "projections on the line of the other axis",
}
TIME = 0.2  # s
STATES, PARAMETERS = 4, 7
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Span:
    """n steps of a device with state z = [e, e'] at their start, and statistics Y of their positions.

    z' = A z + Re(force e^(i phase)) + w,  Y = H z + Re(force e^(i phase)) + v
    """

    transition: Array
    measured: Array
    noise: Array  # covariance of [w, v]
    force: dict[tuple[int, int], NDArray[Any]]  # response of [z', Y] to a force on axis a at the frequency of axis b

    @classmethod
    def of(cls, scenario: fg.Scenario, n: int, design: str) -> Span:
        h, frequency, noise = scenario.run.step, scenario.reference.frequency, noise_of(scenario)
        assert noise is not None
        plant = Plant.of(scenario)
        system = np.zeros((6, 6))
        system[:2, 2:4] = system[2:4, 4:] = np.eye(2)
        system[2:4, :2], system[2:4, 2:4] = -plant.stiffness, -plant.damping
        step = expm(system * h)
        weights = _weights(n, h, frequency, design)
        count = len(weights)
        both = np.zeros((STATES + count, STATES))
        both[:STATES] = np.eye(STATES)
        covariance = np.zeros((STATES + count,) * 2)
        force = {(i, k): np.zeros(STATES + count, complex) for i in range(2) for k in range(2)}
        grow = np.eye(STATES + count)
        grow[:STATES, :STATES] = step[:4, :4]
        push = step[:4, 4:]
        for j in range(n):
            grow[STATES:, :2] = weights[:, j]
            both, covariance = grow @ both, grow @ covariance @ grow.T
            covariance[:STATES, :STATES] += push * noise.force / h @ push.T
            covariance[STATES:, STATES:] += weights[:, j] @ np.diag(noise.position / h) @ weights[:, j].T
            for (i, k), response in force.items():
                response[:] = grow @ response
                response[:STATES] += push[:, i] * np.exp(1j * frequency[k] * h * (j + 0.5))
        return cls(both[:STATES], both[STATES:], covariance, force)


def _weights(n: int, h: float, frequency: tuple[float, float], design: str) -> Array:
    """Weights of the samples: (statistic, sample, axis)."""
    middle = (np.arange(n) - 0.5 * (n - 1)) * h
    rows = []
    for axis in range(2):
        angle = frequency[axis if design == "own" else 1 - axis] * middle
        for shape in [np.ones(n)] if design == "mean" else [np.cos(angle), np.sin(angle)]:
            row = np.zeros((n, 2))
            row[:, axis] = shape / n
            rows.append(row)
    return np.array(rows)


def over_the_bound(scenario: fg.Scenario, n: int, design: str) -> float:
    """Deviation of the rate after TIME over the bound, if the filter neglects the correlation of w and v."""
    span = Span.of(scenario, n, design)
    scales, reference, size = scenario.plant.scales, scenario.reference, STATES + PARAMETERS
    h, unit = scenario.run.step, np.sqrt(np.diag(span.noise)[STATES:])
    padded, cross = np.zeros((size, size)), np.zeros((size, len(unit)))
    padded[:STATES, :STATES], cross[:STATES] = span.noise[:STATES, :STATES], span.noise[:STATES, STATES:] / unit
    noise = span.noise[STATES:, STATES:] / np.outer(unit, unit)
    assumed = np.diag(np.diag(noise))
    stated = real = 1e-4 * np.diag([1.0] * STATES + [0.05**2] * PARAMETERS)
    for k in range(round(TIME / scales.time / h / n)):
        columns = np.zeros((STATES + len(unit), PARAMETERS))
        for (i, b), response in span.force.items():
            turn = np.exp(1j * (reference.frequency[b] * h * n * k + reference.phase[b]))
            position = reference.amplitude[b] * np.imag(response * turn)
            velocity = reference.amplitude[b] * reference.frequency[b] * np.real(response * turn)
            columns[:, i + b] -= velocity
            columns[:, 3 + i + b] -= position
            columns[:, 6] += 2 * (b - i) * velocity
        f, m = np.eye(size), np.zeros((len(unit), size))
        f[:STATES, :STATES], f[:STATES, STATES:] = span.transition, columns[:STATES]
        m[:, :STATES], m[:, STATES:] = span.measured / unit[:, None], columns[STATES:] / unit[:, None]
        gain = f @ np.linalg.solve(m @ stated @ m.T + assumed, m @ stated).T
        left, both = f - gain @ m, cross @ gain.T
        stated = left @ stated @ left.T + padded + gain @ assumed @ gain.T
        real = left @ real @ left.T + padded + gain @ noise @ gain.T - both - both.T
        stated, real = 0.5 * (stated + stated.T), 0.5 * (real + real.T)
    bound = bound_angle_random_walk(scenario)
    assert bound is not None
    return math.sqrt(real[-1, -1]) * math.sqrt(TIME) * scales.rate / bound.unknown


def main() -> None:
    lines = ["# The rate from whole spans", "", f"Made by `{command()}`. Machine: {machine()}.", ""]
    lines += [
        f"Deviation of the rate after {TIME:g} s over the bound of Cramér and Rao, from covariances: a Kalman filter",
        "of the motion, D, K and Ωz that computes once in n steps, from statistics of the n positions of each axis. D",
        "and K are unknown, positions have the shipped noise, 10⁻¹³ m/√Hz.",
        "",
        f"| device | statistics | {' | '.join(f'n = {n}' for n in SPANS)} |",
        "|---" * (2 + len(SPANS)) + "|",
    ]
    for name in DEVICES:
        for design, words in DESIGNS.items():
            found = [over_the_bound(fg.Scenario.shipped(name), n, design) for n in SPANS]
            lines.append(f"| {name} | {words} | {' | '.join(f'{ratio:.3f}' for ratio in found)} |")
            print(lines[-1], flush=True)
    lines += [
        "",
        "Projections on the line of the other axis, with less noise of the positions (m/√Hz):",
        "",
        f"| device | noise | {' | '.join(f'n = {n}' for n in SPANS)} |",
        "|---" * (2 + len(SPANS)) + "|",
    ]
    for name in DEVICES:
        for density in NOISES:
            quieter = fg.Scenario.shipped(name).replace({"device.position_noise_density": density})
            found = [over_the_bound(quieter, n, "other") for n in SPANS]
            lines.append(f"| {name} | {density:g} | {' | '.join(f'{ratio:.3f}' for ratio in found)} |")
            print(lines[-1], flush=True)
    write("decimation", lines)


if __name__ == "__main__":
    main()
