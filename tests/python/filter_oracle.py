"""The filter of measured motions again, in NumPy and SciPy, from its equations: the Riccati equation by SciPy, the map
of the plant by a matrix exponential. It shares only the scenario with the package.
"""

from __future__ import annotations

import math

import numpy as np
from fracgyro import Scenario
from fracgyro.scenario.to_core import datasheet
from internal_model_oracle import held
from scipy.linalg import solve_discrete_are


class MotionFilter:
    """`estimate` takes a measured motion and returns the estimated one; `sent` takes the force that follows."""

    def __init__(self, scenario: Scenario) -> None:
        sheet, self.h = datasheet(scenario), scenario.run.step
        ratio = scenario.adaptation.initial_ratio if scenario.controller.adaptive else 1.0
        damping, stiffness, rate, *_ = scenario.plant.nondimensional()
        (dxx, dxy, dyy), (kxx, kxy, kyy) = ratio * np.array(damping), ratio * np.array(stiffness)
        turning = 2 * ratio * rate
        flow = np.zeros((4, 4))
        flow[:2, 2:] = np.eye(2)
        flow[2:] = [[-kxx, -kxy, -dxx, turning - dxy], [-kxy, -kyy, -dxy - turning, -dyy]]
        self.f, self.g = held(flow, np.vstack([np.zeros((2, 2)), np.eye(2)]), self.h)
        self.both = scenario.device.sensing == "full"
        self.forces = [np.zeros(2)] * sheet.delay  # on their way
        self.state: np.ndarray | None = None  # columns x, y; rows position, velocity, missing acceleration

        mean = (kxx + kyy) / 2
        seen = mean * sheet.position_noise
        if self.both:
            seen = min(seen, math.sqrt(mean) * sheet.velocity_noise)
        force = max(sheet.force_noise, seen, 1e-6 * mean)
        least = [0.005 * self.h**2 * force, 0.01 * self.h * force]
        noise = np.maximum([sheet.position_noise, sheet.velocity_noise], least)[: 2 if self.both else 1]
        learned = scenario.controller.observer_bandwidth * self.h
        self.gain = [self.gains(k, d, learned, noise / force) for k, d in ((kxx, dxx), (kyy, dyy))]

    def gains(self, k: float, d: float, learned: float, noise: np.ndarray) -> np.ndarray:
        """The gain of one axis, per sensor; `noise` in units of the force's."""
        h = self.h
        f, g = held(np.array([[0, 1], [-k, -d]]), np.array([[0.0], [1.0]]), h)
        a = np.vstack([np.hstack([f, g]), [0.0, 0.0, 1.0]])
        units = np.diag([h * h, h, 1.0])  # in which SciPy succeeds
        scale = units[: len(noise), : len(noise)]
        a = np.linalg.inv(units) @ a @ units
        push = np.array([g[0, 0] / h**2, g[1, 0] / h, 0.0])
        q = np.outer(push, push) + np.diag([0.0, 0.0, learned**2])
        c = np.eye(3)[: len(noise)]
        r = np.diag((noise / np.diag(scale)) ** 2)
        p = solve_discrete_are(a.T, c.T, q, r)
        found: np.ndarray = units @ p @ c.T @ np.linalg.inv(c @ p @ c.T + r) @ np.linalg.inv(scale)
        return found

    def estimate(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        seen = np.array([position, velocity if self.both else [0.0, 0.0]])
        if self.state is None:
            self.state = np.vstack([seen, [0.0, 0.0]])
        sensors = len(self.gain[0][0])
        missed = (seen - self.state[:2])[:sensors]
        self.state = self.state + np.array([self.gain[axis] @ missed[:, axis] for axis in range(2)]).T
        return self.state[0].copy(), self.state[1].copy()

    def sent(self, force: np.ndarray) -> None:
        assert self.state is not None
        self.forces.append(np.asarray(force))
        acts = self.forces.pop(0) + self.state[2]
        self.state[:2] = (self.f @ self.state[:2].ravel() + self.g @ acts).reshape(2, 2)
