"""Intervals of the second stage by the profile of the likelihood over the pick-off ratio, and undetermined numbers.

Given the pick-off ratio all else is nearly linear. So the ratio is scanned; a value belongs to the 95 % interval if
some ratio has it within chi^2 <= min + 3.84. D must not be negative: |dxy| <= sqrt(dxx dyy), which bounds the ratio.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .structure import Solution, Structure, solve

Array = NDArray[np.float64]

LEVEL = 3.841458820694124  # 95 % of chi^2 with one degree of freedom
WIDEST = math.log(2.0)  # the scan covers pick-off ratios from 1/2 to 2 times the best one and 1
POINTS = 121
LOOSE = 30.0  # times the interval at a known ratio: wider ones are not determined
DERIVATIVE_STEP = 0.01  # standard deviations


@dataclass(frozen=True)
class Point:
    """The solution at one pick-off ratio, and its sum of squares above the minimum."""

    solution: Solution
    excess: float


@dataclass(frozen=True)
class Profile:
    """Points of the scan within the 95 % region, the best first; `open`: the region reaches an end of the scan."""

    points: tuple[Point, ...]
    open: bool
    curve: Array  # (points, 3): ratio, dxy over omega0, excess; of the whole scan
    level: float = LEVEL


def scan(problem: Structure, found: Solution, widen: float = 1.0) -> Profile:
    """The profile around a solution; `widen`: factor on all deviations. A free skew follows the ratio."""
    names = problem.names
    at = names.index("log_ratio")
    center, sd = found.parameters[at], math.sqrt(found.covariance[at, at])
    fine = center + min(max(sd, 1e-13), WIDEST / 4) * np.linspace(-6, 6, POINTS)
    coarse = np.linspace(-WIDEST, WIDEST, POINTS)
    level = LEVEL * widen**2
    if 6 * sd > WIDEST:  # hardly known: only ratios of the coarse grid are considered
        grid = coarse
    else:
        grid = np.unique(np.concatenate([fine, coarse + (0.0 if abs(center) < WIDEST / 2 else center)]))
    points = _followed(problem, found, grid, at)
    least = min(squares for _, squares in points)
    excess = np.array([squares - least for _, squares in points])
    inside = np.flatnonzero(excess <= level)
    finer = _between(grid, excess, level)
    if len(finer):
        more = _followed(problem, points[int(np.argmin(excess))][0], finer, at)
        points += more
        grid = np.concatenate([grid, finer])
        places = np.argsort(grid, kind="stable")
        points, grid = [points[i] for i in places], grid[places]
        least = min(squares for _, squares in points)
        excess = np.array([squares - least for _, squares in points])
        inside = np.flatnonzero(excess <= level)
    reaches = bool(inside[0] == 0 or inside[-1] == len(grid) - 1)
    dxy = names.index("dxy")
    curve = np.array([[math.exp(g), s.parameters[dxy], e] for g, (s, _), e in zip(grid, points, excess, strict=True)])
    if reaches:  # no ratio is preferred: 1 is shown
        order = sorted(map(int, inside), key=lambda i: (abs(grid[i]), excess[i]))
    else:
        order = sorted(map(int, inside), key=lambda i: excess[i])
    return Profile(tuple(Point(points[i][0], float(excess[i])) for i in order), reaches, curve, level)


def _between(grid: Array, excess: Array, level: float) -> Array:
    """More points where the profile crosses the level or has its minimum, if the scan is coarse there."""
    inside = excess <= level
    edges = np.flatnonzero(inside[1:] != inside[:-1])
    parts = [np.linspace(grid[i], grid[i + 1], 12)[1:-1] for i in edges]
    least = int(np.argmin(excess))
    for i in (least - 1, least):
        if 0 <= i < len(grid) - 1:
            parts.append(np.linspace(grid[i], grid[i + 1], 12)[1:-1])
    return np.unique(np.concatenate(parts)) if parts else np.empty(0)


def _followed(problem: Structure, found: Solution, grid: Array, at: int) -> list[tuple[Solution, float]]:
    """Solutions along the grid, outward from the middle, each from its neighbor; with their sums of squares."""
    results: dict[int, tuple[Solution, float]] = {}
    middle = int(np.argmin(np.abs(grid - found.parameters[at])))
    for places in (range(middle, len(grid)), range(middle - 1, -1, -1)):
        last = found
        for i in places:
            start = last.parameters.copy()
            start[at] = grid[i]
            last = solve(problem, start, [at])
            results[i] = last, last.squares + _negative(problem, last)
    return [results[i] for i in range(len(grid))]


def _negative(problem: Structure, found: Solution) -> float:
    """Excess of the sum of squares because D must be positive semidefinite."""
    value = dict(zip(problem.names, found.parameters, strict=True))
    i, j, k = (problem.names.index(name) for name in ("dxx", "dxy", "dyy"))
    product = value["dxx"] * value["dyy"]
    limit = math.sqrt(product) if product > 0 else 0.0
    beyond = abs(value["dxy"]) - limit
    if beyond <= 0:
        return 0.0
    gradient = np.zeros(len(problem.names))
    gradient[j] = math.copysign(1.0, value["dxy"])
    if limit > 0:
        gradient[i], gradient[k] = -value["dyy"] / (2 * limit), -value["dxx"] / (2 * limit)
    variance = float(gradient @ found.covariance @ gradient)
    return beyond**2 / variance if variance > 0 else math.inf


@dataclass(frozen=True)
class Interval:
    """Value and 95 % interval of a quantity, and the deviation at a known pick-off ratio."""

    value: float
    low: float
    high: float
    deviation: float
    determined: bool


def intervals(
    problem: Structure, profile: Profile, quantities: Mapping[str, Callable[[Array], float]]
) -> dict[str, Interval]:
    """The interval of each quantity, a function of the parameters of the second stage."""
    best = profile.points[0].solution
    found = {}
    for name, function in quantities.items():
        value, low, high = function(best.parameters), math.inf, -math.inf
        for point in profile.points:
            here = function(point.solution.parameters)
            half = deviation_of(function, point.solution) * math.sqrt(max(profile.level - point.excess, 0.0))
            low, high = min(low, here - half), max(high, here + half)
        deviation = deviation_of(function, best) * math.sqrt(profile.level / LEVEL)
        width = high - low
        loose = profile.open and width > LOOSE * deviation and width > abs(value) / 2
        finite = all(map(math.isfinite, (value, low, high)))
        found[name] = Interval(float(value), float(low), float(high), deviation, bool(finite and not loose))
    return found


def deviation_of(function: Callable[[Array], float], solution: Solution) -> float:
    """Standard deviation of a function of the parameters, to first order."""
    sd = np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
    gradient = np.zeros(len(sd))
    for i, one in enumerate(sd):
        if one > 0:
            step = np.zeros(len(sd))
            step[i] = max(DERIVATIVE_STEP * one, 1e-9 * abs(solution.parameters[i]))
            gradient[i] = (function(solution.parameters + step) - function(solution.parameters - step)) / (2 * step[i])
    return math.sqrt(max(float(gradient @ solution.covariance @ gradient), 0.0))
