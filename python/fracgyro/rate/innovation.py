"""Information on D, K and Omega_z along any motion, from the sensitivities of the Kalman filter's innovation.

The filter knows D, K and Omega_z. A small error of one of them shifts the mean of the innovation, which is white with
covariance Lambda, by psi times the error: each sample adds psi psi^T/Lambda to the information. psi follows from the
filter's error w, driven by the parameter's derivative of the plant's exact step x' = A x + B u:

    w' = A (I - L C) w + A_j x + B_j u,    psi = C w
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from ..scenario import Scenario
from ..scenario.volts_core import plant_at_bias

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MIN_PERIOD = 0.8  # fraction of the samples: shortest period of the motion that is tried


@dataclass(frozen=True)
class Noise:
    """White noise: two-sided densities in the units of eq. (9); sensing densities of x and y, inf if not sensed."""

    force: float
    position: Array
    velocity: Array

    def at(self, frequency: float) -> Array:
        """Both sensors combined, as density of a position measurement: (N^-1 + w^2 Nv^-1)^-1."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / (1 / self.position + frequency**2 / self.velocity))

    @property
    def of_sensing(self) -> bool:
        """True if every sensor has noise."""
        return bool((self.position > 0).all() and (self.velocity > 0).all())


@dataclass(frozen=True)
class Plant:
    """q'' + (D + 2 Omega) q' + K q = u, nondimensional."""

    damping: Array  # D + 2 Omega
    stiffness: Array

    @classmethod
    def of(cls, scenario: Scenario) -> Plant:
        """The plant of a scenario with its deviations, at plant.angular_rate."""
        d, k, rate, by_d, by_k = plant_at_bias(scenario).nondimensional()
        return cls(_matrix(d + by_d) + rate * ACROSS, _matrix(k + by_k))

    def inverse_response(self, frequency: float) -> Complex:
        """Transfer function from position to force: (2, 2)."""
        return np.asarray(-(frequency**2) * np.eye(2) + 1j * frequency * self.damping + self.stiffness)

    def steps(self, step: float) -> tuple[Array, Array]:
        """Zero-order-hold [A B] (4, 6) of position and velocity, and its seven derivatives (7, 4, 6)."""
        rates = np.zeros((6, 6))
        rates[:2, 2:4], rates[2:4, 4:] = np.eye(2), np.eye(2)
        rates[2:4, :2], rates[2:4, 2:4] = -self.stiffness, -self.damping
        found = []
        for place, entries in PARAMETERS:
            both = np.zeros((12, 12))
            both[:6, :6] = both[6:, 6:] = rates
            both[2:4, 6 + place : 8 + place] = -entries
            found.append(expm(both * step)[:4, 6:])
        return np.asarray(expm(rates * step)[:4]), np.array(found)


def _matrix(entries: Array) -> Array:
    return np.asarray(entries[[0, 1, 1, 2]].reshape(2, 2), dtype=float)


ACROSS = np.array([[0.0, -2.0], [2.0, 0.0]])  # Coriolis matrix of Omega_z = 1
ENTRIES = [np.array(entries) for entries in ([[1.0, 0], [0, 0]], [[0.0, 1], [1, 0]], [[0.0, 0], [0, 1]])]
# First column and matrix for Dxx, Dxy, Dyy, Kxx, Kxy, Kyy, Omega_z.
PARAMETERS = [(2, entries) for entries in ENTRIES] + [(0, entries) for entries in ENTRIES] + [(2, ACROSS)]


def information_of_motion(
    plant: Plant, step: float, noise: Noise, position: Array, velocity: Array, force: Array
) -> Array:
    """Information per unit of time, (7, 7), on Dxx, Dxy, Dyy, Kxx, Kxy, Kyy, Omega_z.

    The motion, (samples, 2), is steady. A narrow filter needs longer to settle than the motion lasts; the motion is
    therefore repeated periodically, with the period after which it returns closest to its first sample.
    """
    from scipy.signal import lfilter  # takes more than a second

    exact, by_parameter = plant.steps(step)
    a, b = exact[:, :4], exact[:, 4:]
    sensed = np.isfinite(np.concatenate([noise.position, noise.velocity]))
    c = np.eye(4)[sensed]
    r = np.concatenate([noise.position, noise.velocity])[sensed] / step
    unit = r.max()
    p = solve_discrete_are(a.T, c.T, b @ b.T * noise.force / step / unit, np.diag(r / unit)) * unit
    covariance = c @ p @ c.T + np.diag(r)
    gain = np.linalg.solve(covariance, c @ p).T
    modes, shapes = np.linalg.eig(a @ (np.eye(4) - gain @ c))
    period = _period(np.concatenate([position, velocity], axis=1))
    known = np.concatenate([position, velocity, force], axis=1)[:period]
    outputs = []
    for derivative in by_parameter:
        drive = np.linalg.solve(shapes, (known @ derivative.T).T)
        error = np.empty((4, period), dtype=complex)
        for mode, driven, out in zip(modes, drive, error, strict=True):
            found = lfilter([0.0, 1.0], [1.0, -mode], driven)
            after = mode * found[-1] + driven[-1]
            start = after / (1 - mode**period)  # periodic steady state
            out[:] = found + start * mode ** np.arange(period)
        outputs.append(np.real((c @ shapes) @ error))
    psi = np.array(outputs)
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), psi.transpose(1, 0, 2).reshape(len(c), -1))
    rows = whitened.reshape(len(c), 7, period).transpose(1, 0, 2).reshape(7, -1)
    return np.asarray(rows @ rows.T / (period * step))


def _period(state: Array) -> int:
    shortest = int(MIN_PERIOD * len(state))
    scale = np.abs(state).max(axis=0)
    scale[scale == 0] = 1.0
    return shortest + int(np.argmin((((state[shortest:] - state[0]) / scale) ** 2).sum(axis=1)))
