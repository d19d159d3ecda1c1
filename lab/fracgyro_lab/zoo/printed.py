"""Numerical integration of the prescribed-performance law of a public code, with each of its errors as a switch.

The equations are those of doi 10.1049/cth2.12484, as its authors' MATLAB code evaluates them; the numbers come from the
entry's TOML. A Runge-Kutta method of order 4 integrates each run. Scalars are several times as fast as arrays of two.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# Errors of the code, in the order of the entry; each can be corrected.
SWITCHES = (
    "plant_exchanged",
    "damping_scale",
    "complex_powers",
    "slope_of_barrier",
    "log_of_modulus",
    "triple_estimate",
)
ROOT, CUBE = 0.5**0.75, 0.5**2  # factors of roots and cubes
FLOOR = 1e-3  # least argument of a root in its slope, with signed powers
LOST = 1e6  # q0: control is lost
State = list[float]


@dataclass(frozen=True)
class PrintedRun:
    """A run of the published code: its numbers by name, and the errors of the code that it has."""

    numbers: Mapping[str, Any]
    errors: frozenset[str] = frozenset(SWITCHES)
    learns: bool = True  # False: the estimates rest, at 0 and at the true gain of the actuator


@dataclass(frozen=True)
class Curves:
    """A run at its samples: `time` [n] in 1/omega0, `error` [n, 2] and `bound` [n] in q0; NaN once control is lost."""

    time: NDArray[np.float64]
    error: NDArray[np.float64]
    bound: NDArray[np.float64]
    gain: NDArray[np.float64] = field(repr=False)  # estimate of the actuator's gain, [n, 2]

    def rms(self, begin: float) -> tuple[float, float]:
        """RMS error of both axes after `begin`; NaN for a run that is lost or shorter."""
        late = self.error[self.time > begin]
        x, y = np.sqrt((late**2).mean(axis=0)) if len(late) else (math.nan, math.nan)
        return float(x), float(y)

    def largest_share(self) -> float:
        """The largest |e|/bound of either axis while the run lasts."""
        return float(np.nanmax(np.abs(self.error) / self.bound[:, None]))

    def leaves(self) -> float | None:
        """Time of the first sample at which |e| is not within the bound; None if there is none."""
        with np.errstate(invalid="ignore"):
            outside = ~(np.abs(self.error) < self.bound[:, None]).all(axis=1)
        return float(self.time[outside.argmax()]) if outside.any() else None


def integrated(
    run: PrintedRun,
    *,
    step: float = 2e-4,
    sample: float = 1e-2,
    progress: Callable[[float, float, str], object] | None = None,
) -> Curves:
    """The run until its `duration`; `step` and `sample` are in 1/omega0, and `sample` is a multiple of `step`."""
    loop = _Loop(run)
    every, count = round(sample / step), round(float(run.numbers["duration"]) / sample)
    state = loop.start()
    rows = [state]
    try:
        for n in range(count):
            for k in range(every):
                state = _stepped(loop.slope, (n * every + k) * step, state, step)
            if not all(abs(number) < LOST for number in state[:2]):
                break
            rows.append(state)
            if progress:
                progress(n + 1, count, "integrating")
    except (OverflowError, ZeroDivisionError, ValueError):  # log and powers outside of the bound
        pass
    time = np.linspace(0.0, sample * count, count + 1)
    states = np.full((count + 1, len(state)), np.nan)
    states[: len(rows)] = rows
    motion = np.array([[loop.axes[axis].motion(t)[0] for axis in (0, 1)] for t in time])
    bound = np.array([loop.bound(t)[0] for t in time])
    return Curves(time, states[:, :2] - motion, bound, states[:, 10:])


def _stepped(slope: Callable[[float, State], State], t: float, x: State, h: float) -> State:
    half, sixth = h / 2, h / 6
    a = slope(t, x)
    b = slope(t + half, [p + half * s for p, s in zip(x, a, strict=True)])
    c = slope(t + half, [p + half * s for p, s in zip(x, b, strict=True)])
    d = slope(t + h, [p + h * s for p, s in zip(x, c, strict=True)])
    return [p + sixth * (i + 2 * (j + k) + m) for p, i, j, k, m in zip(x, a, b, c, d, strict=True)]


class _Leaks(NamedTuple):
    linear: float
    cubic: float

    def of(self, estimate: float) -> float:
        return self.linear * estimate + self.cubic * estimate**3


@dataclass(frozen=True)
class _Axis:
    """Numbers of an axis."""

    offset: float
    amplitude: float
    frequency: float
    start: float  # position
    push: float  # the disturbance during a pulse
    estimates: tuple[float, float, float, float]  # at the start: of plant, fault and disturbance, and of the gain

    def motion(self, t: float) -> tuple[float, float, float]:
        w, a = self.frequency, self.amplitude
        sine = math.sin(w * t)
        return self.offset + a * sine, a * w * math.cos(w * t), -a * w * w * sine


class _Loop:
    """The closed loop. State: two positions, two velocities, and pairs of the four estimates."""

    def __init__(self, run: PrintedRun) -> None:
        n = run.numbers
        self.errors, self.learns = run.errors, run.learns
        self.axes = tuple(self._axis(n, axis) for axis in (0, 1))
        self.final, self.rate, self.scale = (float(n[name]) for name in ("bound_final", "bound_rate", "barrier_scale"))
        self.k = tuple(float(n[f"k{place}"]) for place in (1, 2, 3, 4))
        self.limit, self.gain = float(n["force_limit"]), float(n["actuator_gain"])
        self.fault, self.fault_rate, self.disturbance = (
            float(n[name]) for name in ("fault", "fault_rate", "disturbance")
        )
        self.pulse = tuple(map(float, n["pulse"]))  # its begin and end
        self.leaks = [_Leaks(*map(float, n[f"leak_{of}"])) for of in ("plant", "fault", "disturbance", "gain")]
        mass, rate = float(n["mass"]), float(n["reference_frequency"])
        scale = 1.0 if "damping_scale" in run.errors else mass * rate
        xx, xy, yy = (float(each) / scale for each in n["damping"])
        turn = 2.0 * float(n["angular_rate"])
        self.damping = (xx, xy - turn, xy + turn, yy)
        xx, xy, yy = (float(each) / (mass * rate**2) for each in n["stiffness"])
        self.stiffness = (xx, xy, xy, yy)

    def _axis(self, n: Mapping[str, Any], axis: int) -> _Axis:
        def of(name: str) -> float:
            return float(n[name][axis])

        known = (0.0, 0.0, 0.0, float(n["actuator_gain"]))
        first = tuple(of(f"start_{name}") for name in ("plant", "fault", "disturbance", "gain"))
        plant, fault, disturbance, gain = first if self.learns else known
        single = "triple_estimate" not in self.errors  # one of three integrators with the same input
        return _Axis(
            of("offset"),
            of("amplitude"),
            of("frequency"),
            of("start_position"),
            of("push"),
            (plant, 0.0 if single else fault, 0.0 if single else disturbance, gain),
        )

    def start(self) -> State:
        pairs = zip(*(axis.estimates for axis in self.axes), strict=True)
        return [*(axis.start for axis in self.axes), 0.0, 0.0, *(each for pair in pairs for each in pair)]

    def bound(self, t: float) -> tuple[float, float]:
        falling = (1.0 - self.final) * math.exp(-self.rate * t)
        return falling + self.final, -self.rate * falling

    def slope(self, t: float, state: State) -> State:
        exchanged = "plant_exchanged" in self.errors
        (x, y, vx, vy), (dx, dy), (kx, ky) = state[:4], state[:2], state[2:4]
        if not exchanged:
            (dx, dy), (kx, ky) = (vx, vy), (x, y)
        d, k = self.damping, self.stiffness
        plant = (
            -d[0] * dx - d[1] * dy - k[0] * kx - k[1] * ky,
            -d[2] * dx - d[3] * dy - k[2] * kx - k[3] * ky,
        )
        fault = self.fault * math.exp(self.fault_rate * t)
        pushed = self.pulse[0] <= t <= self.pulse[1]
        bound = self.bound(t)
        found = [vx, vy, *[0.0] * 10]
        for axis in (0, 1):
            force, learned = self._law(t, axis, bound, state[axis::2])
            outside = fault + (self.axes[axis].push if pushed else self.disturbance)
            found[2 + axis] = plant[axis] + self.gain * force + outside
            found[4 + axis :: 2] = learned
        return found

    def _law(self, t: float, axis: int, bound: tuple[float, float], state: State) -> tuple[float, State]:
        """The force of an axis, and the slopes of its estimates."""
        q, v, *estimates = state
        r, dr, ddr = self.axes[axis].motion(t)
        (rho, drho), k = bound, self.k
        e, de = q - r, v - dr
        share, dshare = e / rho, (de * rho - drho * e) / rho**2
        room = 1.0 - share * share
        ratio = (1.0 + share) / (1.0 - share)
        eps = math.log(abs(ratio) if "log_of_modulus" in self.errors else ratio) / (2.0 * self.scale)
        deps = dshare / (self.scale * room)
        factor = self.scale * rho * room
        # With the code's sign and square, or the derivative of 1 - share^2.
        droom = 2.0 * share * dshare / room**2 if "slope_of_barrier" in self.errors else -2.0 * share * dshare
        dfactor = self.scale * (drho * room + rho * droom)
        root, slope = self._root(eps)
        pull = -ROOT * k[0] * root - CUBE * k[1] * eps**3
        dpull = -deps * (ROOT * k[0] * slope + CUBE * 3.0 * k[1] * eps**2)
        shrink, dshrink = 1.0 - self.final / rho, self.final * drho / rho**2
        alpha = dr - self.rate * e * shrink + factor * pull
        dalpha = ddr - self.rate * (de * shrink + e * dshrink) + dfactor * pull + factor * dpull
        z = v - alpha
        wanted = dalpha - sum(estimates[:3]) - eps / factor
        wanted += -ROOT * k[2] * self._root(z)[0] - CUBE * k[3] * z**3
        force = (wanted / estimates[3]).real
        force = min(max(force, -self.limit), self.limit)
        if not self.learns:
            return force, [0.0] * 4
        inputs = (z.real, z.real, z.real, (z * wanted / estimates[3]).real)
        if "triple_estimate" not in self.errors:
            inputs = (z.real, 0.0, 0.0, inputs[3])
        learned = [
            given - leak.of(estimate) for given, leak, estimate in zip(inputs, self.leaks, estimates, strict=True)
        ]
        return force, learned

    def _root(self, x: complex) -> tuple[complex, complex]:
        """x^(1/2) and its slope: the complex root of the code, or the signed root of |x|."""
        if "complex_powers" in self.errors:
            root = cmath.sqrt(x)
            return root, 0.5 / root if root else math.inf
        size = abs(x.real)
        return math.copysign(math.sqrt(size), x.real), 0.5 / math.sqrt(max(size, FLOOR))
