"""The error of a linear controller in noise, by a program of its own: no seeds, no core.

The loop is run once without noise, from the start. Then, on the reference, each noise pushes it once by its standard
deviation: the squares of what follows, added up, are the variance that the noise causes, as all samples of noise are
independent and the loop is linear there.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import fracgyro as fg
import numpy as np
from device_oracle import Observer
from internal_model_oracle import InternalModel
from reference_oracle import motion
from scipy.linalg import expm

SETTLED, FORGOTTEN = 10_000, 6_000  # steps: when the start is over; after which a push has no effect


class Loop:
    """The paper's plant and a controller with its sensors; advanced by one step at a time."""

    def __init__(self, scenario: fg.Scenario, law: Callable[[Any], np.ndarray]) -> None:
        self.h, self.law = scenario.run.step, law
        damping, stiffness, rate, *_ = scenario.plant.nondimensional()
        (dxx, dxy, dyy), (kxx, kxy, kyy) = damping, stiffness
        flow = np.zeros((6, 6))
        flow[:2, 2:4] = flow[2:4, 4:] = np.eye(2)
        flow[2:4, :4] = [[-kxx, -kxy, -dxx, 2 * rate - dxy], [-kxy, -kyy, -dxy - 2 * rate, -dyy]]
        self.advance = expm(self.h * flow)[:4]
        self.state = np.array([*scenario.run.initial_position, *scenario.run.initial_velocity])
        self.observer = Observer(scenario) if needs_observer(scenario) else None
        self.references = motion(scenario, self.h * np.arange(scenario.run.steps + 1))
        self.n = 0

    def step(self, noise: np.ndarray) -> np.ndarray:
        """The error before the step; `noise`: of positions, velocities and forces."""
        r, rate, _ = self.references[:, self.n]
        position, velocity = self.state[:2] + noise[:2], self.state[2:] + noise[2:4]
        if self.observer is not None:
            velocity = self.observer.velocity(position)
        seen = SimpleNamespace(
            time=self.n * self.h, position=position, velocity=velocity, reference=r, reference_velocity=rate
        )
        force = self.law(seen)
        if self.observer is not None:
            self.observer.predict(force)
        error = self.state[:2] - r
        self.state = self.advance @ np.concatenate([self.state, force + noise[4:]])
        self.n += 1
        return error

    def run(self, steps: int, first: np.ndarray | None = None) -> np.ndarray:
        silence = np.zeros(6)
        return np.array([self.step(silence if n or first is None else first) for n in range(steps)])


def needs_observer(scenario: fg.Scenario) -> bool:
    return scenario.device.sensing == "position" and scenario.controller.kind != "internal_model"


class WithoutReference:
    """The oracle of the internal model, which knows the reference as a formula, as a law."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.inside = InternalModel(scenario)

    def __call__(self, s: Any) -> np.ndarray:
        return self.inside.step(s.position, s.velocity)


def standard_deviations(scenario: fg.Scenario) -> np.ndarray:
    """Standard deviations of positions, velocities and forces, drawn every step; a density is one-sided."""
    scales, h, device = scenario.plant.scales, scenario.run.step, scenario.device
    assert scenario.disturbance.kinds == "noise"
    assert scenario.disturbance.hold in (None, h)
    share = np.sqrt(scales.rate / (2 * h))
    position = device.position_noise_density / scales.length * share
    velocity = device.velocity_noise_density / (scales.length * scales.rate) * share
    return np.repeat([position, velocity, scenario.disturbance.standard_deviation], 2)


def errors(scenario: fg.Scenario, law: Any) -> np.ndarray:
    """RMS errors before and after half of the run, shape (2, 2): rows before, after; columns x, y."""
    law.reset(scenario)
    loop, half = Loop(scenario, law), scenario.run.steps // 2
    start = loop.run(SETTLED)
    settled = copy.deepcopy(loop)
    quiet = np.concatenate([start, loop.run(scenario.run.steps - SETTLED)])
    variance = np.zeros(2)
    for i, deviation in enumerate(standard_deviations(scenario)):
        if deviation:
            push = np.eye(6)[i] * deviation
            moved = copy.deepcopy(settled).run(FORGOTTEN, push)
            variance += ((moved - quiet[SETTLED : SETTLED + FORGOTTEN]) ** 2).sum(axis=0)
    squares = [(part**2).mean(axis=0) + variance for part in (quiet[:half], quiet[half:])]
    return np.sqrt(squares)
