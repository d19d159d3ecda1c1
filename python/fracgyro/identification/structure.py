"""From K_y, C_y and B_y as the pick-offs see them to the device: K, D, angular rates, pick-off ratio, drives.

With the pick-offs' matrix P = [[1, 0], [s, g]] (s skew, g ratio of y to x) and y = P q:

    K_y = P K P^-1,    C_y = P (D + 2 Omega [[0, -1], [1, 0]]) P^-1,    B_y = P turn(beta) diag(b1, b2)

Least squares with the covariances of the first stage, over the couplings and the characteristic polynomial (see
`invariants`). Everything but g and s enters linearly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from .model import Shape

Array = NDArray[np.float64]

STEPS = 30
SMALL_STEP = 1e-6  # in standard deviations
MAX_RATIO_STEP, MAX_LOG_RATIO = 1.0, 16.0  # limits of the logarithm of the pick-off ratio
COMPLEX_STEP = 1e-30
EXACT = 1e-12  # deviation of a value that is assumed exactly, in units of omega0
SINGULAR = 1e-14  # smallest eigenvalue of a correlation matrix
GAINS = {"x": "b1", "y": "b2"}  # force per unit of the drive, by axis
EARTH = 7.3e-5  # rad/s: a device at rest on its bench turns with the earth, by at most this


@dataclass(frozen=True)
class Group:
    """Result of the first stage for one state of the device, with two pick-offs.

    `drives`: the axes of its drives; `rate`, rad/s, of the turntable; None: unknown, and the same in all groups.
    """

    parameters: Array
    covariance: Array
    rate: float | None = None
    drives: tuple[str, ...] = ()


def invariants(parameters: NDArray[Any]) -> NDArray[Any]:
    """The couplings and the characteristic polynomial instead of the entries of K and C: (count, ...).

    det(s^2 + s C + K) = u^2 + u (s p + q) + s r + t with u = s^2 + 1. A record shows p, q, r and t, which are the
    modes, far better than the couplings, and the diagonal of K and C depends on products of couplings: over K and C the
    likelihood is a curved valley that no covariance describes, over these numbers it is nearly normal.
    """
    k11, k12, k21, k22, c11, c12, c21, c22 = parameters[:8]
    k11, k22 = k11 - 1, k22 - 1
    determinant = c11 * c22 - c12 * c21
    p, q = c11 + c22, k11 + k22 + determinant
    r, t = c11 * k22 + c22 * k11 - c12 * k21 - c21 * k12, k11 * k22 - k12 * k21 - determinant
    return np.concatenate([np.stack([k12, k21, c12, c21, p, q, r, t]), parameters[8:]])


def invariants_by(parameters: Array) -> Array:
    """Derivative of `invariants`, exact: by complex steps."""
    moved = parameters[:, None] + 1j * COMPLEX_STEP * np.eye(len(parameters))
    return np.asarray(np.imag(invariants(moved)) / COMPLEX_STEP)


@dataclass(frozen=True)
class Structure:
    """The problem of the second stage: groups, the unit of time (omega0, rad/s) and the assumptions.

    `priors`: by name of a parameter, its value and deviation, in units of omega0; `skew`: s is unknown;
    `skewed_drives`: the second drive is not at a right angle to the first.
    """

    groups: Sequence[Group]
    unit: float
    skew: bool = False
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    skewed_drives: bool = False

    @cached_property
    def known(self) -> list[float]:
        """The different known rates, rad/s."""
        return sorted({each.rate for each in self.groups if each.rate is not None})

    @cached_property
    def names(self) -> list[str]:
        """Parameters, in their order. `rate`: the unknown one; `rate_offset`: added to each of several known rates."""
        rates = ["rate"] if any(each.rate is None for each in self.groups) else []
        offset = ["rate_offset"] if len(self.known) > 1 else []
        used = {axis for each in self.groups for axis in each.drives}
        drives = [GAINS[axis] for axis in sorted(used)] + (["beta"] if used else [])
        if self.skewed_drives:
            drives.append("drive_skew")
        skew = ["skew"] if self.skew else []
        return ["kxx", "kxy", "kyy", "dxx", "dxy", "dyy", *rates, *offset, "log_ratio", *skew, *drives]

    def predicted(self, parameters: NDArray[Any]) -> NDArray[Any]:
        """The parameters of the first stage of all groups that these of the second stage give.

        `parameters`: (count,) or (count, variants); the result likewise.
        """
        value = dict(zip(self.names, parameters, strict=True))
        ratio, skew = np.exp(value["log_ratio"]), value.get("skew", 0.0)
        found = []
        for each in self.groups:
            known = value.get("rate_offset", 0.0) + (each.rate or 0.0) / self.unit
            rate = value["rate"] if each.rate is None else known
            found += _seen(ratio, skew, value["kxx"], value["kxy"], value["kxy"], value["kyy"])
            coriolis = value["dxy"] - 2 * rate, value["dxy"] + 2 * rate
            found += _seen(ratio, skew, value["dxx"], *coriolis, value["dyy"])
            columns = []
            for axis in each.drives:
                turn = value["beta"] + (value.get("drive_skew", 0.0) if axis == "y" else 0.0)
                along = (np.cos(turn), np.sin(turn)) if axis == "x" else (-np.sin(turn), np.cos(turn))
                columns.append([value[GAINS[axis]] * part for part in along])
            found += [x for x, _ in columns]
            found += [skew * x + ratio * y for x, y in columns]
        return np.stack(found)

    @cached_property
    def _whitening(self) -> Array:
        """Inverse of the root of the covariance of the invariants of all groups."""
        found = []
        for each in self.groups:
            by = invariants_by(each.parameters)
            found.append(np.linalg.inv(_root(by @ each.covariance @ by.T)))
        return np.asarray(block_diag(*found))

    @cached_property
    def _found(self) -> Array:
        return np.concatenate([np.real(invariants(each.parameters)) for each in self.groups])

    def residuals(self, parameters: NDArray[Any]) -> NDArray[Any]:
        """Predicted less found, over the deviations of the first stage; then the priors."""
        found = self._found if parameters.ndim == 1 else self._found[:, None]
        predicted = np.split(self.predicted(parameters), np.cumsum([len(each.parameters) for each in self.groups])[:-1])
        white = self._whitening @ (np.concatenate(list(map(invariants, predicted))) - found)
        value = dict(zip(self.names, parameters, strict=True))
        prior = [(value[name] - mean) / max(sd, EXACT) for name, (mean, sd) in self.priors.items() if name in value]
        return np.concatenate([white, np.stack(prior)]) if prior else white

    def jacobian(self, parameters: Array) -> Array:
        """Derivative of `residuals`, exact: by complex steps."""
        moved = parameters[:, None] + 1j * COMPLEX_STEP * np.eye(len(parameters))
        return np.asarray(np.imag(self.residuals(moved)) / COMPLEX_STEP)

    def start(self, ratio: float) -> Array:
        """First values for this pick-off ratio."""
        stiffness, damping = _matrices(self.groups[0])[:2]
        value = dict.fromkeys(self.names, 0.0)
        value |= {"kxx": stiffness[0, 0], "kyy": stiffness[1, 1], "dxx": damping[0, 0], "dyy": damping[1, 1]}
        value["kxy"] = (stiffness[0, 1] * ratio + stiffness[1, 0] / ratio) / 2
        value["dxy"] = (damping[0, 1] * ratio + damping[1, 0] / ratio) / 2
        if "rate" in value:
            damping = _matrices(next(each for each in self.groups if each.rate is None))[1]
            value["rate"] = (damping[1, 0] / ratio - damping[0, 1] * ratio) / 4
        value["log_ratio"] = np.log(ratio)
        for axis in sorted({axis for each in self.groups for axis in each.drives}, reverse=True):  # beta: of x, if any
            own = next(each for each in self.groups if axis in each.drives)
            x, y = _matrices(own)[2][:, own.drives.index(axis)] / (1.0, ratio)
            along, across = (x, y) if axis == "x" else (y, -x)
            sign = -1.0 if along < 0 else 1.0  # a negative gain rather than a turn by half a circle
            value["beta"] = float(np.arctan2(sign * across, sign * along))
            value[GAINS[axis]] = float(sign * np.hypot(along, across))
        return np.array([float(value[name]) for name in self.names])


def _matrices(group: Group) -> tuple[Array, Array, Array]:
    return Shape(2, len(group.drives)).matrices(group.parameters)


def _seen(ratio: Any, skew: Any, xx: Any, xy: Any, yx: Any, yy: Any) -> list[Any]:
    """Entries of P M P^-1, by rows."""
    below = skew * xy + ratio * yy
    return [xx - xy * skew / ratio, xy / ratio, skew * xx + ratio * yx - below * skew / ratio, below / ratio]


@dataclass(frozen=True)
class Solution:
    """Parameters of the second stage, their covariance, the sum of squares; `fixed`: those that were held."""

    parameters: Array
    covariance: Array
    squares: float
    fixed: tuple[int, ...] = ()


def _root(covariance: Array) -> Array:
    """Lower triangular root of a covariance, scaled so that small entries keep their digits."""
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    whole = (vectors * np.sqrt(np.maximum(values, SINGULAR))).T
    return np.asarray(sd[:, None] * np.linalg.qr(whole)[1].T)


def solve(problem: Structure, start: Array, fixed: Sequence[int] = ()) -> Solution:
    """Least squares from this start, with some parameters held."""
    free = np.array([i for i in range(len(start)) if i not in fixed])
    at = problem.names.index("log_ratio")
    values = start.copy()
    rest = np.real(problem.residuals(values))
    squares = float(rest @ rest)
    for _ in range(STEPS):
        jacobian = problem.jacobian(values)[:, free]
        norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        step = -np.linalg.lstsq(jacobian / norms, rest, rcond=1e-13)[0]
        size = float(np.linalg.norm(jacobian / norms @ step))
        if at in free:  # a far ratio is reached in several steps
            far = abs(float((step / norms)[list(free).index(at)]))
            step = step / max(far / MAX_RATIO_STEP, 1.0)
        for _ in range(20):
            moved = values.copy()
            moved[free] += step / norms
            moved[at] = min(max(moved[at], -MAX_LOG_RATIO), MAX_LOG_RATIO)
            trial = np.real(problem.residuals(moved))
            if float(trial @ trial) <= squares or size < SMALL_STEP:
                break
            step = step / 2
        if not float(trial @ trial) <= squares:
            break
        values, rest, squares = moved, trial, float(trial @ trial)
        if size < SMALL_STEP:
            break
    jacobian = problem.jacobian(values)[:, free]
    norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    inverse = np.linalg.pinv(jacobian / norms, rcond=1e-10)
    covariance = np.zeros((len(values), len(values)))
    covariance[np.ix_(free, free)] = (inverse @ inverse.T) / np.outer(norms, norms)
    return Solution(values, covariance, squares, tuple(fixed))


def best(problem: Structure) -> Solution:
    """The solution with the smallest sum of squares, from the pick-off ratio that K_y shows and from 1."""
    stiffness = problem.groups[0].parameters[:4].reshape(2, 2)
    starts = [1.0]
    if stiffness[0, 1] * stiffness[1, 0] > 0:
        starts.append(float(np.sqrt(stiffness[1, 0] / stiffness[0, 1])))
    held = replace(problem, skew=False)
    found = []
    for ratio in starts:
        if not 1e-4 < ratio < 1e4:
            continue
        start = solve(held, held.start(ratio), [held.names.index("log_ratio")])
        values = dict(zip(held.names, start.parameters, strict=True))
        found.append(solve(problem, np.array([values.get(name, 0.0) for name in problem.names])))
    return min(found, key=lambda each: each.squares)
