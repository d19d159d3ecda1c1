"""The controller `internal_model` again, in NumPy and SciPy, from its equations: Riccati equations by SciPy, the
feedforward from the inverse of a transfer function, the reference as a formula. It shares only the scenario with the
package.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from fracgyro import Scenario
from fracgyro.scenario.to_core import datasheet
from scipy.linalg import block_diag, solve_discrete_are
from smooth_feedback_oracle import AXES, SmoothFeedback, held


def turn(angle: float) -> np.ndarray:
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


class InternalModel:
    """A controller whose `step` takes the measured motion and returns the force."""

    def __init__(self, scenario: Scenario) -> None:
        c, sheet, h = scenario.controller, datasheet(scenario), scenario.run.step
        damping, stiffness, rate, *_ = scenario.plant.nondimensional()
        ratio = scenario.adaptation.initial_ratio
        (dxx, dxy, dyy), (kxx, kxy, kyy) = ratio * np.array(damping), ratio * np.array(stiffness)
        coriolis = 2 * ratio * rate
        flow = np.zeros((4, 4))
        flow[:2, 2:] = np.eye(2)
        flow[2:] = [[-kxx, -kxy, -dxx, coriolis - dxy], [-kxy, -kyy, -dxy - coriolis, -dyy]]
        self.f, self.g = held(flow, np.vstack([np.zeros((2, 2)), np.eye(2)]), h)
        self.own = self.g * np.tile(np.eye(2), (2, 1))  # a force moves its own axis
        self.step_size, self.limit, self.delay = h, c.force_limit, sheet.delay
        r = scenario.reference
        self.amplitude, self.frequency, self.phase = map(np.array, (r.amplitude, r.frequency, r.phase))
        self.frequencies = list(dict.fromkeys(self.frequency.tolist()))
        self.measures_velocity = scenario.device.sensing == "full"
        self.n = 0

        mean = (kxx + kyy) / 2
        seen = mean * sheet.position_noise
        if self.measures_velocity:
            seen = min(seen, math.sqrt(mean) * sheet.velocity_noise)
        force = max(sheet.force_noise, seen, 1e-6 * mean)
        noise = [max(sheet.position_noise, 0.005 * h * h * force), max(sheet.velocity_noise, 0.01 * h * force)]
        per_axis = [(kxx, dxx), (kyy, dyy)]
        self.gain = [self.filter(k, d, c.learning_bandwidth, force, noise) for k, d in per_axis]
        self.feedback = SmoothFeedback(c, per_axis, h, sheet.delay)
        self.regulated = [self.feedforward(w) for w in self.frequency]

        # On each axis: e, its rate, the constant, then cosine and sine at each frequency.
        self.states = np.zeros((AXES, 3 + 2 * len(self.frequencies)))

    def ripple(self, w: float) -> float:
        tangent = math.tan(w * self.step_size / 2)
        return self.step_size / (2 * tangent) * (1 - w * self.step_size / (2 * tangent))

    def filter(self, k: float, d: float, learning: float, force: float, noise: list[float]) -> np.ndarray:
        """The gain of the Kalman filter of one axis, for its position and velocity."""
        h, count = self.step_size, len(self.frequencies)
        f, g = held(np.array([[0, 1], [-k, -d]]), np.array([[0.0], [1.0]]), h)
        a = block_diag(f, 1.0, *[turn(w * h) for w in self.frequencies])
        shown = np.array([1.0, *[1.0, 0.0] * count])
        a[:2, 2:] = g * shown
        q = np.diag([0, 0, 1.0, *[2.0] * (2 * count)]) * (learning * h) ** 2
        q[:2, :2] += g @ g.T
        rows = np.zeros((2, len(a)))
        rows[0, 0] = rows[1, 1] = 1.0
        rows[1, 4::2] = [self.ripple(w) for w in self.frequencies]
        rows = rows if self.measures_velocity else rows[:1]
        variance = np.diag(np.square(noise[: len(rows)]) / force**2)
        units = np.diag([h * h, h, *[1.0] * (len(a) - 2)])  # in which SciPy succeeds
        scale = np.diag([h * h, h][: len(rows)])
        inverse, of_rows = np.linalg.inv(units), np.linalg.inv(scale)
        a, q, rows = inverse @ a @ units, inverse @ q @ inverse, of_rows @ rows @ units
        variance = of_rows @ variance @ of_rows
        p = solve_discrete_are(a.T, rows.T, q, variance)
        found: np.ndarray = units @ p @ rows.T @ np.linalg.inv(rows @ p @ rows.T + variance) @ of_rows
        return found

    def feedforward(self, w: float) -> dict[str, np.ndarray]:
        """The held force U and the velocity for a position exp(iwt) of each axis: the transfer function, inverted."""
        z = np.exp(1j * w * self.step_size)
        states = np.linalg.solve(z * np.eye(4) - self.f, self.g.astype(complex))
        force = np.linalg.inv(states[:2])
        return {"force": force, "velocity": states[2:] @ force}

    def step(self, position: Any, velocity: Any) -> np.ndarray:
        h, t = self.step_size, self.n * self.step_size
        angle = self.frequency * t + self.phase
        moved = self.amplitude * np.exp(1j * (angle - math.pi / 2))
        r, rate = moved.real, (1j * self.frequency * moved).real
        known, offset = np.zeros(2), np.zeros(2)
        for axis, (w, of) in enumerate(zip(self.frequency, self.regulated, strict=True)):
            ahead = moved[axis] * np.exp(1j * w * h * self.delay)
            known += (of["force"][:, axis] * ahead).real
            own = 1j * w * np.eye(2)[:, axis]
            offset += (1j * (of["velocity"][:, axis] - own).imag * moved[axis]).real
        z = self.states
        seen = np.array([position - r, velocity - rate - offset]).T
        ripples = [self.ripple(w) for w in self.frequencies]
        if self.n == 0:
            z[:, 0] = seen[:, 0]
            z[:, 1] = seen[:, 1] if self.measures_velocity else -rate
        else:
            for axis in range(AXES):
                miss = seen[axis] - [z[axis, 0], z[axis, 1] + z[axis, 4::2] @ ripples]
                z[axis] += self.gain[axis] @ miss[: self.gain[axis].shape[1]]

        follows = self.feedback.force(z[:, 0], z[:, 1])
        for axis in range(AXES):
            known[axis] -= z[axis, 2]
            for i, w in enumerate(self.frequencies):
                known[axis] -= (turn(w * h * self.delay) @ z[axis, 3 + 2 * i : 5 + 2 * i])[0]
        wanted = known + follows
        force: np.ndarray = np.clip(wanted, -self.limit, self.limit)
        self.feedback.remember(follows + force - wanted)
        acts = self.feedback.past[:, self.delay]
        z[:, :2] = (self.f @ z[:, :2].T.ravel() + self.own @ acts).reshape(2, 2).T
        for i, w in enumerate(self.frequencies):
            z[:, 3 + 2 * i : 5 + 2 * i] = z[:, 3 + 2 * i : 5 + 2 * i] @ turn(w * h).T
        self.n += 1
        return force
