"""Records of a bench, simulated exactly and independently of the package: by the modes of the equation of motion."""

from __future__ import annotations

from dataclasses import dataclass

import fracgyro as fg
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

Array = NDArray[np.float64]

RATE = 5.2359878  # rad/s, 300 deg/s


@dataclass(frozen=True)
class Device:
    """Frequencies, Hz, quality factors, turn of the principal axes, rad, rate, rad/s, and pick-offs."""

    frequency: tuple[float, float] = (3925.0, 3978.0)
    quality: tuple[float, float] = (4673.0, 449.0)
    turn: float = 0.02
    rate: float = RATE
    ratio: float = 1.01
    skew: float = 0.0

    @property
    def omega(self) -> float:
        return 2 * np.pi * self.frequency[0]

    @property
    def principal(self) -> tuple[Array, Array]:
        """K and D over the mass, in units of omega, in the axes of the x pick-off."""
        second = self.frequency[1] / self.frequency[0]
        turn = np.array([[np.cos(self.turn), -np.sin(self.turn)], [np.sin(self.turn), np.cos(self.turn)]])
        stiffness = turn @ np.diag([1.0, second**2]) @ turn.T
        return stiffness, turn @ np.diag([1 / self.quality[0], second / self.quality[1]]) @ turn.T

    @property
    def seen(self) -> tuple[Array, Array]:
        """K and C as the pick-offs see them."""
        stiffness, damping = self.principal
        pickoffs = np.array([[1.0, 0.0], [self.skew, self.ratio]])
        inverse = np.linalg.inv(pickoffs)
        coriolis = 2 * self.rate / self.omega * np.array([[0.0, -1.0], [1.0, 0.0]])
        return pickoffs @ stiffness @ inverse, pickoffs @ (damping + coriolis) @ inverse

    @property
    def parameters(self) -> Array:
        return np.concatenate([each.ravel() for each in self.seen])

    def motion(
        self, samples: int, per_period: float, start: tuple[float, float, float, float] = (1, 0.1, 0.1, -1)
    ) -> Array:
        """The free motion of both pick-offs from (x, y, x', y') at the first sample."""
        stiffness, damping = self.seen
        matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
        values, vectors = np.linalg.eig(matrix)
        weights = np.linalg.solve(vectors, np.array(start, dtype=complex))
        step = 2 * np.pi / per_period
        times = step * np.arange(samples)
        return np.real((vectors[:2] * weights) @ np.exp(np.outer(values, times)))

    def thermal_motion(self, samples: int, per_period: float, size: float, seed: int = 0) -> Array:
        """Thermal motion of both pick-offs, from rest; `size`: its root of the mean square along x, if K is 1.

        The force has the covariance 2 k_B T D, and k_B T is size^2. Its covariance over an interval by quadrature.
        """
        stiffness, damping = self.seen
        pickoffs = np.array([[1.0, 0.0], [self.skew, self.ratio]])
        matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
        force = np.zeros((4, 4))
        force[2:, 2:] = 2 * size**2 * pickoffs @ self.principal[1] @ pickoffs.T
        step = 2 * np.pi / per_period
        places, quadrature = np.polynomial.legendre.leggauss(24)
        maps = [expm(matrix * step * (place + 1) / 2) for place in places]
        covariance = sum(step / 2 * w * (one @ force @ one.T) for w, one in zip(quadrature, maps, strict=True))
        values, vectors = np.linalg.eig(expm(matrix * step))
        root = np.linalg.cholesky(covariance)
        kicks = np.linalg.solve(vectors, root @ np.random.default_rng((seed, 1)).normal(size=(4, samples)))
        modes = [lfilter([0.0, 1.0], [1.0, -value], row) for value, row in zip(values, kicks, strict=True)]
        return np.real(vectors[:2] @ np.stack(modes))

    def interval(self, per_period: float) -> float:
        return 2 * np.pi / per_period / self.omega

    def record(
        self,
        samples: int,
        per_period: float = 12.6,
        noise: float = 1e-3,
        seed: int = 0,
        start: tuple[float, float, float, float] = (1, 0.1, 0.1, -1),
        scale: float = 1.0,
        thermal: float = 0.0,
        **state: float | None,
    ) -> fg.identify.Record:
        """A record with white noise in both pick-offs, of this deviation, and thermal motion of this size."""
        motion = self.motion(samples, per_period, start)
        if thermal:
            motion = motion + self.thermal_motion(samples, per_period, thermal, seed)
        motion = scale * (motion + noise * np.random.default_rng(seed).normal(size=motion.shape))
        return fg.identify.Record(*motion, interval=self.interval(per_period), name=f"record {seed}", **state)

    def forced(
        self, samples: int, per_period: float, drive: Array, through: Array, noise: float, seed: int = 0
    ) -> fg.identify.Record:
        """A record from rest under a held random force, which acts one sample late; `noise`: over the amplitude."""
        generator = np.random.default_rng(seed)
        force = generator.normal(size=(2, samples))
        late = np.concatenate([np.zeros((2, 1)), force[:, :-1]], axis=1)
        stiffness, damping = self.seen
        matrix = np.zeros((6, 6))
        matrix[:2, 2:4], matrix[2:4, :2], matrix[2:4, 2:4], matrix[2:4, 4:] = np.eye(2), -stiffness, -damping, drive
        step = expm(2 * np.pi / per_period * matrix)
        values, vectors = np.linalg.eig(step[:4, :4])
        kicks = np.linalg.solve(vectors, step[:4, 4:] @ late)
        modes = [lfilter([0.0, 1.0], [1.0, -value], row) for value, row in zip(values, kicks, strict=True)]
        motion = np.real(vectors[:2] @ np.stack(modes)) + through @ late
        motion = motion + noise * np.abs(motion).max() * generator.normal(size=motion.shape)
        return fg.identify.Record(*motion, interval=self.interval(per_period), force=force)

    def response(self, frequency: Array, drive: Array, through: Array, delay: float) -> NDArray[np.complex128]:
        """The response to two drives over frequency, Hz; `delay` in units of 1/omega."""
        stiffness, damping = self.seen
        w = (2 * np.pi * frequency / self.omega)[:, None, None]
        inside = np.linalg.inv(-(w**2) * np.eye(2) + 1j * w * damping + stiffness) @ drive + through
        return inside * np.exp(-1j * w * delay)


DUAL_MASS = Device()
DISC = Device((10000.0, 10050.0), (2e6, 2e6))
PAPER = Device((3000.0, 3674.0), (60.0, 75.0), 0.35, 100.0)
IN_AIR = Device((3216.0, 3251.0), (120.0, 10.0))
