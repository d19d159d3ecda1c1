"""Fractional operators and fractional PID, sample by sample in fixed memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .. import _core
from ..arguments import real, short, signal

Vector = npt.NDArray[np.float64]
Between = Literal["lines", "parabolas"]  # the signal between samples


def has_parabolas(between: Between) -> bool:
    """True for parabolas. Raises ValueError for an unknown interpolation."""
    if between not in ("lines", "parabolas"):
        raise ValueError(f"between is {between!r}: it must be lines or parabolas")
    return between == "parabolas"


@dataclass(eq=False)
class Sampled:
    """A linear system with one input and one output: a sum of first-order recursions and of weighted last samples.

    With samples u_k and changes d_k = u_k - u_(k-1),

        y_k = sum_j weight_j g_j + now u_k + past u_(k-1) + change d_k + past_change d_(k-1),
        then  g_j += decay_j g_j + u_(k-1), or d_k.

    The initial state is 0, as for a signal that starts one step before the first sample. A system can be copied and
    pickled; the copy continues independently from the same state. include/fracgyro/core/sampled_step.h has the code,
    also for the C export of `fg.export.operator`.

    >>> controller = fg.fractional.pid(1.0, 2.0, 0.5, 0.1, 0.5, step=1e-3, longest=10.0)
    >>> force = [controller.step(error) for error in (0.0, 0.1, 0.2)]
    >>> controller.reset()
    """

    interval: float  #: time between samples
    of_values: Vector  #: decay_j and weight_j of the recursions of samples, shape (count, 2)
    of_changes: Vector  #: the same for the recursions of changes
    now: float
    past: float
    change: float
    past_change: float
    _running: _core.Recursion = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for numbers in self._numbers():
            if not np.isfinite(numbers).all():
                raise ValueError("a weight of the operator is not finite: the gains must be smaller")
        self._running = _core.Recursion(*self._numbers())

    def _numbers(self) -> tuple[Vector, Vector, tuple[float, float, float, float]]:
        return self.of_values, self.of_changes, (self.now, self.past, self.change, self.past_change)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_running": self._running.state}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        vars(self).update(saved)
        self._running = _core.Recursion(*self._numbers())
        self._running.state = saved["_running"]

    @property
    def count(self) -> int:
        """Number of recursions."""
        return len(self.of_values) + len(self.of_changes)

    def reset(self) -> None:
        """Resets the state to 0."""
        self._running.reset()

    def step(self, sample: float) -> float:
        """Returns the output at the next sample. A sample that is not finite remains in the state until `reset`.

        Raises TypeError if `sample` is not a number.
        """
        try:
            return self._running.step(float(sample))
        except (TypeError, ValueError, OverflowError):
            raise TypeError(f"sample is {short(sample)}: it must be a number") from None

    def run(self, samples: npt.ArrayLike) -> npt.NDArray[Any]:
        """Outputs for a whole signal from the initial state; the state of `step` is neither used nor changed.

        `samples`: shape (samples,) or (samples, channels); float32 is computed in single precision, with the bits of
        the exported C code. Returns the same shape. Raises TypeError or ValueError for an invalid array.

        >>> fg.fractional.pid(2.0, 0.0, 1.0, 1.0, 1.0, step=0.5, longest=10.0).run([0.0, 1.0, 1.0])
        array([0., 4., 2.])
        """
        given = signal("samples", samples)
        if given.ndim not in (1, 2):
            raise ValueError(f"samples has shape {given.shape}: it must be (samples,) or (samples, channels)")
        found = np.empty(given.shape, np.float32 if given.dtype == np.float32 else np.float64)
        recursion = _core.RecursionSingle if found.dtype == np.float32 else _core.Recursion
        columns = found.reshape(len(found), 1) if found.ndim == 1 else found
        for column, channel in zip(columns.T, given.astype(found.dtype).reshape(columns.shape).T, strict=True):
            column[:] = recursion(*self._numbers()).run(channel)
        return found

    def state_space(self) -> tuple[Vector, Vector, Vector, Vector, float]:
        """Matrices (A, B, C, D, interval); the last two states are the last sample and the last change.

        They fit python-control's `ss` and scipy's `dlti`.
        """
        values, count = len(self.of_values), self.count
        decay, weight = np.concatenate([self.of_values, self.of_changes]).T
        a = np.diag(np.append(1.0 + decay, [0.0, 0.0]))
        a[:values, count], a[values:count, count], a[count + 1, count] = 1.0, -1.0, -1.0
        b = np.append(np.repeat([0.0, 1.0], [values, count - values]), [1.0, 1.0])[:, None]
        c = np.append(weight, [self.past - self.change, self.past_change])[None, :]
        return a, b, c, np.array([[self.now + self.change]]), self.interval

    def frequency_response(self, frequency: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Frequency response at z = exp(j frequency interval), frequency in rad per unit of time; same shape."""
        z = np.exp(1j * self.interval * np.asarray(frequency, dtype=np.float64))

        def response(terms: Vector) -> npt.NDArray[np.complex128]:
            found: npt.NDArray[np.complex128] = (terms[:, 1] / (z[..., None] - 1.0 - terms[:, 0])).sum(axis=-1)
            return found

        of_changes = response(self.of_changes) + self.change + self.past_change / z
        found: npt.NDArray[np.complex128] = (
            (response(self.of_values) + self.past) / z + self.now + of_changes * (1.0 - 1.0 / z)
        )
        return found

    def plus(self, other: Sampled) -> Sampled:
        """The sum of both systems. Raises TypeError for another type, ValueError for another interval."""
        if not isinstance(other, Sampled):
            raise TypeError(f"other is {short(other)}: it must be Sampled")
        if other.interval != self.interval:
            raise ValueError(f"other has interval {other.interval}: it must be {self.interval}")
        return Sampled(
            self.interval,
            np.concatenate([self.of_values, other.of_values]),
            np.concatenate([self.of_changes, other.of_changes]),
            self.now + other.now,
            self.past + other.past,
            self.change + other.change,
            self.past_change + other.past_change,
        )

    def times(self, gain: float) -> Sampled:
        """The system with its output multiplied by `gain`. Raises TypeError if it is not a number."""
        gain = real("gain", gain)
        weighted, numbers = np.array([1.0, gain]), (self.now, self.past, self.change, self.past_change)
        with np.errstate(over="ignore", invalid="ignore"):  # infinite weights are refused
            values, changes = self.of_values * weighted, self.of_changes * weighted
        return Sampled(self.interval, values, changes, *(gain * each for each in numbers))
