"""Independent reference for the loop with a dynamic rate and a real device: plain NumPy, and solve_ivp between samples.

The control law is fracgyro.Controller's, which oracle.py checks; everything around it is transcribed here. Noise is an
input: the measurement errors of a run, and its disturbance rate.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import fracgyro as fg
import numpy as np
from fracgyro.scenario.to_core import datasheet
from oracle import symmetric
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
Rate = Callable[[int, float], tuple[float, float]]  # (sample, time since it) -> Omega_z and its derivative


def simulate(
    scenario: fg.Scenario,
    disturbance: np.ndarray,
    position_noise: np.ndarray,
    velocity_noise: np.ndarray,
    rate: Rate,
    rate_bias: np.ndarray,
) -> dict[str, np.ndarray]:
    """Histories of a nondimensional run; all arrays (samples, 2)."""
    device, scales, step = scenario.device, scenario.plant.scales, scenario.run.step
    observer = Observer(scenario) if device.sensing == "position" else None
    known = datasheet(scenario)
    velocity = observer.gain[1] * known.position_noise if observer else known.velocity_noise
    noise = {"datasheet.position_noise": known.position_noise, "datasheet.velocity_noise": velocity}
    law = fg.Controller(scenario.replace({"device": fg.Scenario().device, **noise}))
    waiting = deque([np.zeros(2)] * device.delay)
    move = plant(scenario, rate, rate_bias)
    sensed = np.diag(1 + np.array(device.pickoff_gain_error)) @ rotation(device.pickoff_misalignment).T
    pushed = rotation(device.force_misalignment) @ np.diag(1 + np.array(device.force_gain_error))
    reach = np.array(device.position_range) / scales.length, np.array(device.velocity_range) / scales.velocity
    q, v = np.array(scenario.run.initial_position), np.array(scenario.run.initial_velocity)
    run: dict[str, list[np.ndarray]] = {}
    for n, force in enumerate(disturbance):
        seen = digital(sensed @ q + position_noise[n], reach[0], device.position_bits)
        if observer:
            seen_velocity = observer.velocity(seen)
        else:
            seen_velocity = digital(sensed @ v + velocity_noise[n], reach[1], device.velocity_bits)
        u = law.step(n * step, seen, seen_velocity)
        if observer:
            observer.predict(u)
        waiting.append(u)
        applied = pushed @ digital(
            waiting.popleft(), np.array(device.actuator_limit / scales.force), device.actuator_bits
        )
        sample = {"position": q, "velocity": v, "control": u, "applied_control": applied}
        sample |= {"measured_position": seen, "measured_velocity": seen_velocity}
        for name, value in sample.items():
            run.setdefault(name, []).append(value)
        q, v = move(n, q, v, applied + force)
    return {name: np.array(values) for name, values in run.items()}


def rotation(angle: float) -> np.ndarray:
    """From x to y."""
    return math.cos(angle) * np.eye(2) + math.sin(angle) * TURN


def flicker(white: np.ndarray) -> np.ndarray:
    """The noise of include/fracgyro/plant/flicker.hpp, from these draws, pole by pole; (samples, ...)."""
    u = math.log(10) * (1 - np.arange(23) / 2)  # poles, half a decade apart from 10 down
    weight = math.log(10) / 2 / math.pi / (2 * np.cosh(u / 2))
    pole = 1 / (1 + np.exp(u))
    above, below = math.log(10) * np.arange(1.5, 31.5, 0.5), u[-1] - math.log(10) / 2 * np.arange(300)
    weight[-1] = math.log(10) / 2 / math.pi * np.exp(below / 2).sum()
    pole[-1] = 1 / (1 + np.exp(1.5 * below).sum() / np.exp(below / 2).sum())
    found = math.log(10) / 2 / math.pi * (1 / (2 * np.cosh(above / 2))).sum() * white
    for p, w in zip(pole, weight, strict=True):
        found = found + w * lfilter([1.0], [1.0, -p], white, axis=0)
    return np.asarray(found)


def digital(value: np.ndarray, span: np.ndarray, bits: int) -> np.ndarray:
    value = np.clip(value, -span, span)
    if not bits:
        return value
    size = 2 * span / 2**bits
    return np.clip(np.round(value / size), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) * size


def plant(scenario: fg.Scenario, rate: Rate, bias: np.ndarray) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """One step of the equation of motion; with plant.centrifugal in a frame that turns, (d/dt + Omega)^2 q."""
    device, scales, step = scenario.device, scenario.plant.scales, scenario.run.step
    damping, _, _, more_damping, more_stiffness = scenario.plant.nondimensional()
    damping = symmetric(damping + more_damping)
    stiffness = symmetric(scenario.plant.stiffness.entries() / scales.stiffness + more_stiffness)
    cubic = np.array(device.cubic_stiffness) * scales.length**2 / scales.stiffness
    times, temperatures = np.array(device.temperature(scenario.run.duration * scales.time)).T

    def move(n: int, q: np.ndarray, v: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def derivative(since: float, x: np.ndarray) -> np.ndarray:
            q, v = x[:2], x[2:]
            omega, change = rate(n, since)
            omega += bias[n]
            warmer = np.interp((n * step + since) * scales.time, times, temperatures)
            softer, drier = 1 + 1e-6 * device.stiffness_drift * warmer, 1 + 1e-6 * device.damping_drift * warmer
            a = force - (drier * damping + 2 * omega * TURN) @ v - softer * stiffness @ q - cubic * q**3
            if scenario.plant.centrifugal:
                a = a - change * TURN @ q + omega**2 * q
            return np.concatenate([v, a])

        if scenario.plant.centrifugal:  # the Euler force of a jump
            v = v - (bias[n] - (bias[n - 1] if n else 0.0)) * TURN @ q
        solved = solve_ivp(derivative, (0.0, step), np.concatenate([q, v]), "DOP853", rtol=1e-13, atol=1e-13)
        assert solved.success
        return solved.y[:2, -1], solved.y[2:, -1]

    return move


class Observer:
    """The g-h-k filter of include/fracgyro/hardware/observer.hpp, by its matrices, one axis after the other."""

    def __init__(self, scenario: fg.Scenario) -> None:
        self.step = scenario.run.step
        damping, stiffness, rate, _, _ = scenario.plant.nondimensional()
        ratio = scenario.adaptation.initial_ratio if scenario.controller.adaptive else 1.0
        self.damping = ratio * (symmetric(damping) + 2 * rate * TURN)
        self.stiffness = ratio * symmetric(stiffness)
        theta = math.exp(-scenario.controller.observer_bandwidth * self.step)
        g, h, k = 1 - theta**3, 1.5 * (1 - theta) ** 2 * (1 + theta), 0.5 * (1 - theta) ** 3
        self.gain = np.array([g, h / self.step, 2 * k / self.step**2])
        self.state: np.ndarray | None = None  # rows q, v, f; columns x, y

    def velocity(self, measured: np.ndarray) -> np.ndarray:
        if self.state is None:
            self.state = np.array([measured, [0.0, 0.0], [0.0, 0.0]])
        self.state = self.state + np.outer(self.gain, measured - self.state[0])
        return self.state[1]

    def predict(self, force: np.ndarray) -> None:
        assert self.state is not None
        q, v, f = self.state
        a = force + f - self.damping @ v - self.stiffness @ q
        self.state = np.array([q + self.step * v + self.step**2 / 2 * a, v + self.step * a, f])
