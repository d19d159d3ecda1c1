"""Advice on what to record next: by how much further records would narrow each interval, from the Cramér-Rao bound.

The information of the records at hand is that of their fits. A further decay adds its own: the state and its
derivatives by each parameter and by the start obey one linear map from sample to sample, z+ = M z, so the sum of
z z^T over all samples follows by doubling, exactly and in a time that grows with the logarithm of the length.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .first_stage import Fitted
from .model import Shape, sampled
from .profile import deviation_of
from .quantity import NORMAL, functions, scales
from .results import Results
from .second_stage import MAX_SKEW
from .structure import Group, Solution, Structure
from .sweep import SweepFit, of_another

Array = NDArray[np.float64]

TURN = math.radians(300.0)  # rad/s, of a turntable
NAMES = ("kxx", "kxy", "kyy", "dxx", "dxy", "dyy", "rate", "rate_offset", "pickoff_ratio", "skew")
ONE_MODE = ("frequency_1", "quality_1", "kxx", "dxx")
LOUDER = "twice the amplitude, or half the noise, if the device stays linear"
HALVED = 0.505
LARGEST_RATIO = math.log(2.0)  # 95 % limit of ln g beyond which a ratio is not determined
MOST_PERIODS = 1e6  # in a longer record


@dataclass(frozen=True)
class Advice:
    """A further record in words, and for each quantity half of its 95 % interval now and then; `now` is infinite where
    the quantity is not determined."""

    name: str
    words: str
    halves: Mapping[str, tuple[float, float]]

    @property
    def halved(self) -> list[str]:
        """Quantities whose interval becomes half as wide, or finite."""
        return [name for name, (now, then) in self.halves.items() if math.isfinite(then) and then <= HALVED * now]

    def plain(self) -> dict[str, Any]:
        """The advice as JSON; null for an interval that is not finite."""
        intervals = {
            name: {"now": now if math.isfinite(now) else None, "then": then if math.isfinite(then) else None}
            for name, (now, then) in self.halves.items()
        }
        return {"name": self.name, "words": self.words, "half_intervals": intervals, "halved": self.halved}


def advice(found: Results) -> tuple[Advice, ...]:
    """Gain of each of several further records."""
    condition = found.conditions[0]
    device = condition.device
    if device is None:
        return _of_one_mode(found)
    both = [(state, fit) for state, fit in condition.fits if fit.shape.axes == 2]
    free = next((i for i, (_, fit) in enumerate(both) if isinstance(fit, Fitted) and fit.shape.drives == 0), None)
    unit, names = device.problem.unit, device.problem.names
    parameters = device.solution.parameters
    groups = list(device.problem.groups)
    now = _halves(found, device.problem, parameters)
    value = dict(zip(names, parameters, strict=True))
    turn = -math.copysign(TURN, value.get("rate", max(device.problem.known, key=abs, default=-1.0)))
    listed: list[Advice] = []

    def add(name: str, words: str, more: Sequence[Group], instead: Sequence[Group] | None = None) -> None:
        after = [*(groups if instead is None else instead), *more]
        problem = replace(device.problem, groups=after)
        if not problem.skew and problem.known:  # known rates may show the skew, as in second_stage.py
            skewed = replace(problem, skew=True)
            place = skewed.names.index("skew")
            if _covariance(skewed, _start(skewed, value))[place, place] < MAX_SKEW**2:
                problem = skewed
        start = _start(problem, value)
        then = _halves(found, problem, start)
        listed.append(Advice(name, words, {each: (now.get(each, math.inf), half) for each, half in then.items()}))

    if free is None:  # sweeps and forced records: another of them is as good as the one at hand
        add("repeat", "the same again", groups)
        swept = both[0][1]
        if isinstance(swept, SweepFit):
            turned = _at_rate(groups[0], device.problem, value, turn)
            scale = _units(swept, unit)
            covariance = of_another(swept, turned.parameters / scale) * np.outer(scale, scale)
            add("known rate", f"the sweep on a turntable at {math.degrees(turn):g} deg/s",
                [replace(turned, covariance=covariance)])  # fmt: skip
    else:
        state, fit = both[free]
        assert isinstance(fit, Fitted)
        length, one = fit.segments[0].length, _decay(fit, 0)
        again = _seen(fit, unit, [_information(fit, _decay(fit, i)) for i in range(len(fit.segments))], state.rate)
        add("repeat", "the same again", [again])
        for i, axis in enumerate("xy"):
            start = np.zeros(4)
            start[i] = float(np.abs(one.start).max())
            further = _seen(fit, unit, [_information(fit, replace(one, start=start))], state.rate)
            add(f"start {axis}", f"a decay of {length:.3g} s that starts along {axis}", [further])
        if 2 * one.samples * one.interval < 2 * math.pi * MOST_PERIODS:
            information = [
                _information(fit, replace(_decay(fit, i), samples=2 * _decay(fit, i).samples))
                for i in range(len(fit.segments))
            ]
            longest = _seen(fit, unit, information, state.rate)
            # The fit's own interval over the bound that is computed here: the band, and noise that is not white.
            loss = float(np.mean(np.diag(groups[free].covariance) / np.diag(again.covariance)))
            instead = [replace(longest, covariance=loss * longest.covariance) if i == free else each
                       for i, each in enumerate(groups)]  # fmt: skip
            add("longer", f"records twice as long, {2 * length:.3g} s", [], instead)
        group = _at_rate(groups[free], device.problem, value, turn)
        moved = replace(fit, fit=replace(fit.fit, parameters=group.parameters / _units(fit, unit)))
        add("known rate", f"a decay of {length:.3g} s on a turntable at {math.degrees(turn):g} deg/s",
            [_seen(moved, unit, [_information(moved, one)], turn)])  # fmt: skip
    quieter = [replace(each, covariance=each.covariance / 4) for each in groups]
    add("amplitude", LOUDER, [], quieter)
    share = 0.0 if free is None else _rounding(both[free][1])
    if share > 0.25:
        finer = [replace(each, covariance=each.covariance * (1 - share * 15 / 16)) for each in groups]
        add("bits", "two bits more of the converter", [], finer)
    return tuple(listed)


def _of_one_mode(found: Results) -> tuple[Advice, ...]:
    """With one pick-off: what it shows of its mode, and that the rest needs the other."""
    swept = isinstance(found.groups[0], SweepFit)
    again = "the same in the other direction, which also shows whether the sweep waits" if swept else "the same again"
    known = {name: found[name].half for name in ONE_MODE if name in found and found[name].determined}
    return (
        Advice("both", "both pick-offs: shows the coupling, the other axis and the angular rate", {}),
        Advice("repeat", again, {name: (half, half / math.sqrt(2)) for name, half in known.items()}),
        Advice("amplitude", LOUDER, {name: (half, half / 2) for name, half in known.items()}),
    )


def _start(problem: Structure, value: Mapping[str, float]) -> Array:
    """The parameters of a problem with more records; what the records at hand do not have is zero."""
    rate = value.get("rate", value.get("rate_offset", 0.0))
    return np.array([value.get(name, rate if name == "rate" else 0.0) for name in problem.names])


def _covariance(problem: Structure, parameters: Array) -> Array:
    """Covariance of the parameters of the second stage, as `solve` has it at its end."""
    jacobian = problem.jacobian(parameters)
    norms = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    inverse = np.linalg.pinv(jacobian / norms, rcond=1e-10)
    return np.asarray((inverse @ inverse.T) / np.outer(norms, norms))


def _rounding(fit: Fitted | SweepFit) -> float:
    """Share of the converter's rounding in the variance of the noise of x."""
    assert isinstance(fit, Fitted)
    step = (fit.segments[0].step or (0.0,))[0]
    return min(step**2 / 12 / float(fit.fit.noise[0, 0]) ** 2, 1.0)


# -- The information of a decay ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FreeDecay:
    """`start`: positions and velocities at the first sample, in 1/omega0 of the fit; `interval` likewise."""

    start: Array
    samples: int
    interval: float
    noise: Array


def _decay(fit: Fitted, i: int) -> FreeDecay:
    """The decay of a segment, with the start that its fit gives."""
    segment = fit.segments[i]
    interval, samples = segment.interval * fit.unit, int(segment.motion.shape[1])
    whole = _power(np.eye(4) + sampled(fit.shape, fit.fit.parameters, interval).less_one, samples)
    # The transient is x_0 - x_N; spectra have the factor sqrt(2/N).
    start = np.linalg.solve(np.eye(4) - whole, fit.fit.transients[i][:4]) / math.sqrt(2 / samples)
    return FreeDecay(np.real(start), samples, interval, np.asarray(fit.fit.noise[i]))


def _power(matrix: Array, exponent: int) -> Array:
    return np.asarray(np.linalg.matrix_power(matrix, exponent))


def information(shape: Shape, parameters: Array, decay: FreeDecay) -> Array:
    """Fisher's information of the parameters of the first stage in a free decay with unknown start."""
    maps = sampled(shape, parameters, decay.interval)
    step, n, count = np.eye(2 * shape.axes) + maps.less_one, 2 * shape.axes, shape.count
    size = n * (1 + count + n)
    # z: the state, its derivative by each parameter, and by each number of the start.
    matrix: Array = np.kron(np.eye(1 + count + n), step).astype(float)
    for p in range(count):
        matrix[n * (1 + p) : n * (2 + p), :n] = maps.less_one_by[p]
    first = np.zeros(size)
    first[:n] = decay.start
    first[n * (1 + count) :] = np.eye(n).ravel()
    total = _summed(matrix, first, decay.samples)
    places = np.arange(n, size).reshape(count + n, n)[:, : shape.axes]
    found = sum(total[np.ix_(places[:, i], places[:, i])] / decay.noise[i] ** 2 for i in range(shape.axes))
    own, cross, starts = found[:count, :count], found[:count, count:], found[count:, count:]
    norms = np.sqrt(np.maximum(np.diag(starts), np.finfo(float).tiny))
    return np.asarray(own - cross / norms @ np.linalg.pinv(starts / np.outer(norms, norms)) @ (cross / norms).T)


def _summed(matrix: Array, first: Array, samples: int) -> Array:
    """Sum of z z^T over this many samples of z+ = M z, by doubling."""
    total, vector = np.zeros((len(first), len(first))), first
    power, length = matrix, 1
    while samples:
        if samples & 1:
            # The samples from here on, `length` of them, start at `vector`.
            total += _block(matrix, vector, length)
            vector = power @ vector
        samples >>= 1
        power, length = power @ power, 2 * length
    return total


def _block(matrix: Array, vector: Array, length: int) -> Array:
    """The same for a power of two."""
    found, power = np.outer(vector, vector), matrix
    while length > 1:
        found = found + power @ found @ power.T
        power = power @ power
        length //= 2
    return found


def _information(fit: Fitted, decay: FreeDecay) -> Array:
    return information(fit.shape, fit.fit.parameters, decay)


def _seen(fit: Fitted, unit: float, parts: Sequence[Array], rate: float | None) -> Group:
    """Records with the sum of this information, in units of the second stage's omega0."""
    scale = _units(fit, unit)
    found = sum(parts) / np.outer(scale, scale)
    norms = np.sqrt(np.maximum(np.diag(found), np.finfo(float).tiny))
    covariance = np.linalg.pinv(found / np.outer(norms, norms), rcond=1e-14, hermitian=True)
    return Group(scale * fit.fit.parameters[:8], covariance / np.outer(norms, norms), rate)


def _at_rate(group: Group, problem: Structure, value: Mapping[str, float], rate: float) -> Group:
    """The same record of the device at this rate, rad/s."""
    turned = Structure([replace(group, rate=rate)], problem.unit, problem.skew, {}, problem.skewed_drives)
    seen = turned.predicted(np.array([value.get(each, 0.0) for each in turned.names]))
    return replace(group, parameters=seen, rate=rate)


def _units(fit: Fitted | SweepFit, unit: float) -> Array:
    """Factors of K, C and B from the fit's unit of time to another omega0."""
    turn = fit.unit / unit
    return np.array([turn**2] * 4 + [turn] * 4 + [turn**2] * (2 * fit.shape.drives))


# -- Intervals ---------------------------------------------------------------------------------------------------------


def _halves(found: Results, problem: Structure, parameters: Array) -> dict[str, float]:
    """Half of the 95 % interval of each quantity, to first order, in its unit.

    It is infinite without a known ratio for what was not determined.
    """
    covariance = _covariance(problem, parameters)
    solution = Solution(parameters, covariance, 0.0)
    ratio = problem.names.index("log_ratio")
    known = NORMAL * math.sqrt(covariance[ratio, ratio]) < LARGEST_RATIO
    of = scales(problem.unit, found.known.mass, found.known.pickoff)
    halves = {}
    for name, function in functions(problem).items():
        if name in NAMES:
            half = of[name][0] * NORMAL * deviation_of(function, solution)
            lost = name in found and not found[name].determined
            halves[name] = math.inf if lost and not known else half
    return halves
