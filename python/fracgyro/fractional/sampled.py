"""Fractional operators and fractional PID, sample by sample in fixed memory, exact for lines between samples."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


@dataclass(eq=False)
class Sampled:
    """A linear system with one input and one output that also needs the last sample.

    With u_k the samples, x' = kept x + late u_k + early u_(k-1) and y_k = seen x + last u_(k-1) + now u_k, where x' is
    the next state. It starts with states and last sample 0: as if the signal began one step before the first sample.

    >>> controller = fg.fractional.pid(1.0, 2.0, 0.5, 0.1, 0.5, step=1e-3, longest=10.0)
    >>> force = [controller.step(error) for error in (0.0, 0.1, 0.2)]
    >>> controller.reset()
    """

    interval: float  #: time between samples
    kept: Vector  #: shape (count,), as are the next three
    late: Vector
    early: Vector
    seen: Vector
    last: float
    now: float
    _state: Vector = field(init=False, repr=False)
    _sample: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets all samples."""
        self._state, self._sample = np.zeros(len(self.kept)), 0.0

    def step(self, sample: float) -> float:
        """The output at the next sample."""
        sample = float(sample)
        found = float(self.seen @ self._state) + self.last * self._sample + self.now * sample
        self._state = self.kept * self._state + self.late * sample + self.early * self._sample
        self._sample = sample
        return found

    def state_space(self) -> tuple[Vector, Vector, Vector, Vector, float]:
        """(A, B, C, D, interval), the last sample as the last state; for python-control's `ss` and scipy's `dlti`."""
        count = len(self.kept)
        a = np.diag(np.append(self.kept, 0.0))
        a[:count, count] = self.early
        b, c = np.append(self.late, 1.0)[:, None], np.append(self.seen, self.last)[None, :]
        return a, b, c, np.array([[self.now]]), self.interval

    def frequency_response(self, frequency: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """At z = exp(j frequency interval), frequency in rad per unit of time; the shape is that of `frequency`."""
        z = np.exp(1j * self.interval * np.asarray(frequency, dtype=np.float64))
        states = (self.seen * (self.late + self.early / z[..., None]) / (z[..., None] - self.kept)).sum(axis=-1)
        found: npt.NDArray[np.complex128] = states + self.last / z + self.now
        return found

    def plus(self, other: Sampled) -> Sampled:
        """The sum of both outputs."""
        return Sampled(
            self.interval,
            np.append(self.kept, other.kept),
            np.append(self.late, other.late),
            np.append(self.early, other.early),
            np.append(self.seen, other.seen),
            self.last + other.last,
            self.now + other.now,
        )

    def times(self, gain: float) -> Sampled:
        """The output times a number."""
        return Sampled(
            self.interval, self.kept, self.late, self.early, gain * self.seen, gain * self.last, gain * self.now
        )
