"""Free motion with cubic springs, from its analytic signal, which needs far fewer steps than the motion has samples.

s' = A s + N(s) with s = (z, z') of positive frequencies only: N is slow in the frame that turns with exp(A t), so the
steps of Runge and Kutta are taken there (J. Lawson, SIAM J. Numer. Anal. 4, 1967, 372-380), and between them the motion
in that frame is a cubic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import signm

from .model import Complex, Shape, exponential_less_one, generator, poles

Array = NDArray[np.float64]

PHASE = 0.4  # rad: largest change of the slow force in a step


@dataclass(frozen=True)
class Grid:
    """Samples of a record, their interval in 1/omega0, and the samples in a step."""

    samples: int
    interval: float
    every: int

    @property
    def steps(self) -> int:
        return -(-self.samples // self.every)


def grid_of(shape: Shape, parameters: Array, shift: float, samples: int, interval: float) -> Grid:
    """Steps that resolve the beat of the modes, their decay and a `shift` of the frequency, over omega0."""
    modes = poles(shape, parameters)
    fastest = abs(shift) + 2 * float(np.ptp(modes.imag)) + 2 * float(np.abs(modes.real).max())
    every = int(PHASE / max(fastest * interval, PHASE / samples))
    return Grid(samples, interval, min(max(every, 1), samples))


def positive(shape: Shape, parameters: Array) -> Complex:
    """The matrix that makes the analytic signal of a real state: (2 axes, 2 axes)."""
    matrix = generator(shape, parameters)[: 2 * shape.axes, : 2 * shape.axes]
    return np.asarray(np.eye(len(matrix)) + signm(-1j * matrix), dtype=complex)


def motions(
    shape: Shape, axes: Array, parameters: Array, strength: Array, start: Array, analytic: Complex, grid: Grid
) -> list[Array]:
    """The motion of all pick-offs, (axes, samples), of each variant.

    `axes`: (variants, axes, axes), whose columns are those along which the springs act; `parameters`: (variants,
    count), K and C in units of omega0; `strength`: (variants, axes); `start`: (variants, 2 axes); `analytic`: of
    `positive`.
    """
    n = shape.axes
    matrices = np.stack([generator(shape, each)[: 2 * n, : 2 * n] for each in parameters])
    squared = np.stack([np.diagonal(shape.matrices(each)[0]) for each in parameters])
    step, inverse = grid.interval * grid.every, np.linalg.inv(axes)
    half = _exponential(matrices * (step / 2))
    whole = half @ half

    def along(maps: NDArray[Any], states: NDArray[Any]) -> Complex:
        return np.asarray((maps @ states[:, :, None])[:, :, 0])

    def force(states: Complex) -> Complex:
        z = along(inverse, states[:, :n])
        size = np.abs(z) ** 2
        found = np.zeros_like(states)
        found[:, n:] = -along(axes, strength * (0.75 * size - 51 / 128 * strength / squared * size**2) * z)
        return np.asarray(found @ (analytic / 2).T)

    state: Complex = np.asarray(start @ analytic.T, dtype=complex)
    nodes, forces = [state], [force(state)]
    for _ in range(grid.steps):
        first = forces[-1]
        second = force(along(half, state + step / 2 * first))
        middle = along(half, state)
        third = force(middle + step / 2 * second)
        fourth = force(along(whole, state) + step * along(half, third))
        state = along(whole, state + step / 6 * first) + step / 3 * along(half, second + third) + step / 6 * fourth
        nodes.append(state)
        forces.append(force(state))
    times = np.arange(grid.every)
    maps = _exponential(matrices[:, None] * (times * grid.interval)[:, None, None])
    back = np.linalg.inv(whole)
    part = times / grid.every
    kept = np.stack([part * (1 - part) ** 2 * step, part**2 * (3 - 2 * part), part**2 * (part - 1) * step], axis=1)
    states, pushed = np.stack(nodes, axis=1), np.stack(forces, axis=1)  # (variants, steps + 1, 2 axes)
    found = []
    for i in range(len(parameters)):
        moved = states[i, 1:] @ back[i].T - states[i, :-1], pushed[i, :-1], pushed[i, 1:] @ back[i].T
        frame = (
            states[i, :-1, None]
            + kept[:, 1, None] * moved[0][:, None]
            + kept[:, 0, None] * moved[1][:, None]
            + kept[:, 2, None] * moved[2][:, None]
        )
        seen = np.einsum("mas,jms->ajm", inverse[i] @ maps[i, :, :n], frame, optimize=True)
        bent = 3 / 16 * (strength[i] / squared[i])[:, None, None]
        seen = np.einsum("ab,bjm->ajm", axes[i], np.real(seen * (1 - bent * np.abs(seen) ** 2)))
        found.append(np.ascontiguousarray(seen.reshape(n, -1)[:, : grid.samples]))
    return found


def _exponential(matrices: Array) -> Array:
    flat = matrices.reshape(-1, *matrices.shape[-2:])
    return np.asarray((np.eye(flat.shape[-1]) + exponential_less_one(flat)).reshape(matrices.shape))
