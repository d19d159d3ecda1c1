"""Independent reference motions in NumPy and SciPy: position, velocity and acceleration of one axis at given times."""

from __future__ import annotations

import fracgyro as fg
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator, CubicSpline
from scipy.special import gammainc

Array = NDArray[np.float64]


def motion(scenario: fg.Scenario, times: Array, hold: float = 0.0) -> Array:
    """Shape (3, times, 2): r, r' and r'' of both axes; with a hold, at its held points."""
    kinds, middle = scenario.reference.kinds, times + hold / 2
    return np.stack([axis(scenario.reference, kind, i, middle, hold) for i, kind in enumerate(kinds)], -1)


def axis(reference: object, kind: str, i: int, t: Array, hold: float) -> Array:
    """Shape (3, times)."""
    r: fg.Scenario = reference
    zero = np.zeros_like(t)
    found = np.array([zero, zero, zero])
    if kind == "sine":
        found = sine(r.amplitude[i], r.frequency[i], r.phase[i], t, hold)
    elif kind == "sines":
        found = sum(sine(term.amplitude[i], term.frequency[i], term.phase[i], t, hold) for term in r.terms)
    elif kind == "step":
        found = r.amplitude[i] * (filtered_step(r, t - r.start) - filtered_step(r, t - r.end))
    elif kind == "staircase":
        found = sum(r.amplitude[i] * filtered_step(r, t - r.start - k * r.hold) for k in range(r.levels))
    elif kind == "ramp":
        found = r.slope[i] * (filtered_ramp(r, t - r.start) - filtered_ramp(r, t - r.end))
    elif kind == "chirp":
        growth = (r.final_frequency[i] - r.frequency[i]) / (r.end - r.start)
        within = np.clip(t, r.start, r.end) - r.start
        frequency = r.frequency[i] + growth * within
        angle = r.phase[i] + r.frequency[i] * within + growth * within**2 / 2
        angle += r.final_frequency[i] * np.maximum(t - r.end, 0)
        found = r.amplitude[i] * np.array([np.sin(angle), frequency * np.cos(angle), -(frequency**2) * np.sin(angle)])
        found[2] += np.where(t < r.end, r.amplitude[i] * growth * np.cos(angle), 0.0)
        found = np.where(t >= r.start, found, 0.0)
    elif kind == "table":
        found = spline(np.array(r.points), 1 + i, t)
    return found + np.array([[r.offset[i]], [0.0], [0.0]])


def sine(amplitude: float, frequency: float, phase: float, t: Array, hold: float) -> Array:
    angle = frequency * t + phase
    amplitude /= np.sinc(frequency * hold / (2 * np.pi))  # a hold leaves this share of a sine
    return amplitude * np.array([np.sin(angle), frequency * np.cos(angle), -(frequency**2) * np.sin(angle)])


def filtered_step(r: fg.Scenario, t: Array) -> Array:
    """The response of 1/(1 + s T)^n is the distribution of a sum of n exponential waiting times."""
    n, constant, on = r.smoothing_order, r.smoothing, t >= 0
    if constant == 0:
        return np.array([on, np.zeros(len(t)), np.zeros(len(t))], float)
    x = np.where(on, t / constant, 0.0)
    density = [x ** (k - 1) * np.exp(-x) / np.prod(np.arange(1, k, dtype=float)) for k in (n, n - 1) if k > 0]
    slope = (density[1] if n > 1 else 0.0) - density[0]
    return np.where(on, np.array([gammainc(n, x), density[0] / constant, slope / constant**2]), 0.0)


def filtered_ramp(r: fg.Scenario, t: Array) -> Array:
    """The integral of the response to a step: t P(n, x) - n T P(n + 1, x)."""
    n, constant = r.smoothing_order, r.smoothing
    step = filtered_step(r, t)
    since = np.maximum(t, 0.0)
    if constant:
        x = since / constant
        since = since * gammainc(n, x) - n * constant * gammainc(n + 1, x)
    return np.array([since, step[0], step[1]])


def spline(points: Array, column: int, t: Array) -> Array:
    times, values = points[:, 0], points[:, column]
    if len(times) == 1:
        return np.array([np.full_like(t, values[0]), 0 * t, 0 * t])

    def slope(at: float, nearest: Array) -> float:
        return float(BarycentricInterpolator(times[nearest], values[nearest]).derivative(at))

    last = np.arange(max(len(times) - 4, 0), len(times))
    ends = slope(times[0], np.arange(min(4, len(times)))), slope(times[-1], last)
    curve = CubicSpline(times, values, bc_type=((1, ends[0]), (1, ends[1])))
    inside = (t >= times[0]) & (t <= times[-1])
    found = np.array([np.where(inside, curve(t, order), 0.0) for order in range(3)])
    found[0] = curve(np.clip(t, times[0], times[-1]))
    return found
