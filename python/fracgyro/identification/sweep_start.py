"""First values for the fit of a sweep: by linear least squares, and from the clearest resonances without coupling.

The linear start weighs the equation of motion, so a pick-off that hardly exceeds its noise can turn it to a mode that
is only noise; the fit then stays there. The second kind of start looks for resonances in all responses together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .model import Complex, Shape
from .start import least_squares, stable, stacked
from .sweep_model import SweepModel

Array = NDArray[np.float64]

PASSES = 12
PHASES = 4  # first values of the instrument's phase
WIDTHS = 12  # number that is tried
CANDIDATES = 300  # frequencies at which they are tried
ZOOMS, NEAR = 6, 4  # refinements, and values on both sides in each
MAX_POINTS = 2000  # limit in the search for resonances


def starts(problem: SweepModel) -> list[Array]:
    """First values of K, C, phi and tau."""
    return _linear(problem) + _uncoupled(problem)


def _linear(problem: SweepModel) -> list[Array]:
    """First values for several phases of the instrument.

    (-w^2 + jw C + K) H is a cubic in w with complex coefficients if the phase is constant: linear least squares,
    weighted by the inverse of the last pass.
    """
    n, w = problem.shape.axes, problem.w
    square = n * n
    stiffness, damping = float((w @ w) / len(w)) * np.eye(n), 1e-3 * np.eye(n)
    about = w - problem.middle
    powers = np.stack([about**k for k in range(4)], axis=1) / np.ptp(w) ** np.arange(4)
    for _ in range(PASSES):
        weight = np.linalg.inv(-((w**2)[:, None, None] * np.eye(n)) + 1j * w[:, None, None] * damping + stiffness)
        rows, targets = [], []
        for drive in range(problem.shape.drives):
            one = problem.values[:, :, drive] / problem.noise
            drives = problem.shape.drives
            columns = np.zeros((len(w), n, 2 * square + 8 * n * drives), dtype=complex)
            for row in range(n):
                columns[:, row, row * n : (row + 1) * n] = one
                columns[:, row, square + row * n : square + (row + 1) * n] = 1j * w[:, None] * one
                begin = 2 * square + 8 * (drive * n + row)
                columns[:, row, begin : begin + 4], columns[:, row, begin + 4 : begin + 8] = -powers, -1j * powers
            rows.append(stacked((weight @ columns).reshape(len(w) * n, -1)))
            targets.append(stacked((weight @ ((w**2)[:, None] * one)[:, :, None]).ravel()))
        found = least_squares(np.concatenate(rows), np.concatenate(targets))
        both = stable(Shape(n), found[: 2 * square])
        stiffness, damping = both[:square].reshape(n, n), both[square:].reshape(n, n)
    turn = np.outer(problem.noise, 1 / problem.noise)
    first = np.concatenate([(stiffness * turn).ravel(), (damping * turn).ravel()])
    return [np.concatenate([first, [phase, 0.0]]) for phase in np.pi * np.arange(PHASES) / PHASES]


def _uncoupled(problem: SweepModel) -> list[Array]:
    """First values without coupling: the clearest resonances of all responses, each one axis, in both orders."""
    n = problem.shape.axes
    every = max(len(problem.w) // MAX_POINTS, 1)
    w, values = problem.w[::every], (problem.values / problem.noise[:, None])[::every]
    left = values.reshape(len(w), -1)
    basis = np.linalg.qr(np.stack([np.ones(len(w)), w - problem.middle], axis=1).astype(complex))[0]
    modes: list[tuple[float, float]] = []
    phase = 0.0
    for _ in range(n):
        frequency, width = _clearest(w, basis, left)
        modes.append((frequency, width))
        shape = _resonance(w, np.array([frequency]), width)[0]
        shape = shape - basis @ (basis.conj().T @ shape)
        if len(modes) == 1:  # the residue of a real force on a real mode has the instrument's phase
            residues = shape.conj() @ left
            phase = float(-np.angle(residues[np.argmax(np.abs(residues))])) % np.pi
        basis = np.column_stack([basis, shape / np.linalg.norm(shape)])
    found = []
    for order in (modes, modes[::-1])[:n]:
        stiffness = np.diag([frequency**2 for frequency, _ in order])
        damping = np.diag([width for _, width in order])
        found.append(np.concatenate([stiffness.ravel(), damping.ravel(), [phase, 0.0]]))
    return found


def _resonance(w: Array, frequency: Array, width: float) -> Complex:
    """Response of modes of these frequencies and of one width: (frequencies, bins)."""
    at = frequency[:, None]
    return np.asarray(1 / (at**2 - w**2 + 1j * w * width))


def _clearest(w: Array, basis: Complex, values: Complex) -> tuple[float, float]:
    """Frequency and width of the resonance that explains most of the responses beyond the basis.

    It is refined, because what a strong resonance leaves must be less than a weak one.
    """
    places = np.unique(np.sort(w)[np.linspace(0, len(w) - 1, CANDIDATES).astype(int)])
    span = float(np.ptp(w))
    widths = np.geomspace(max(float(np.diff(np.unique(w)).min()), 1e-4 * span), span / 3, WIDTHS)
    frequency, width = _best(w, basis, values, places, widths)
    ratio = float(widths[1] / widths[0])
    reach = max(float(np.diff(places).max(initial=0.0)) if len(places) < len(w) else 0.0, width)
    for _ in range(ZOOMS):
        near = frequency + reach * np.linspace(-1, 1, 2 * NEAR + 1)
        frequency, width = _best(w, basis, values, near, width * ratio ** np.linspace(-1, 1, 2 * NEAR + 1))
        reach, ratio = 2 * reach / NEAR, ratio ** (2 / NEAR)
    return frequency, width


def _best(w: Array, basis: Complex, values: Complex, places: Array, widths: Array) -> tuple[float, float]:
    """The best of these frequencies and widths."""
    best = -1.0, 0.0, 0.0
    for width in widths:
        shapes = _resonance(w, places, float(width))
        shapes = shapes - (shapes @ basis.conj()) @ basis.T
        size = np.linalg.norm(shapes, axis=1)
        gain = (np.abs(shapes.conj() @ values) ** 2).sum(axis=1) / size**2
        at = int(np.argmax(gain))
        if gain[at] > best[0]:
            best = float(gain[at]), float(places[at]), float(width)
    return best[1:]
