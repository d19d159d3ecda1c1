"""Sweeps of a network analyzer or a lock-in: from the response over frequency to K, C, B and the feedthrough."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .diagnostics import REJECTED, Test, correlation, whiteness
from .model import Complex, Shape, poles
from .records import Response
from .start import stacked
from .sweep_model import DELAY, SweepModel, searched
from .sweep_start import starts

Array = NDArray[np.float64]

POLISH = 5  # steps before the starts are compared
ENDED = 3  # starts that are followed to their minimum
MAX_STEPS = 60
WEIGHTINGS = 3
MAX_CORRELATED = 60  # points


@dataclass(frozen=True)
class SweepResult:
    """K, C and B, their covariance, the sum of squares, its degrees of freedom, noise and residuals over it."""

    parameters: Array
    covariance: Array
    squares: float
    freedom: int
    noise: Array
    residuals: tuple[Complex, ...]


@dataclass(frozen=True)
class SweepFit:
    """The fit of a sweep. `unit`: omega0, rad/s; `model`: the fitted response, (frequencies, axes, drives); `widened`:
    factor on all deviations, because the residuals of neighbors are correlated; `direction`: up or down; `lean`: score
    of a cubic spring along each axis, in deviations; `lean_shift`: of the frequency by it at the peak, Hz; `problem`:
    the model with widened noise; `parts`: linear parts of each drive."""

    fit: SweepResult
    shape: Shape
    unit: float
    response: Response
    model: Complex
    feedthrough: Complex
    phase: float
    delay: float
    delay_deviation: float
    widened: float
    feedthrough_deviation: Array
    direction: str
    lean: Array
    lean_shift: Array
    problem: SweepModel
    parts: Sequence[Array]

    def plain(self) -> dict[str, Any]:
        """The fit as JSON."""
        return {
            "kind": "sweep",
            "records": [self.response.name],
            "omega0": self.unit,
            "names": self.shape.names(),
            "parameters": self.fit.parameters.tolist(),
            "covariance": self.fit.covariance.tolist(),
            "noise": self.fit.noise.tolist(),
            "chi_squared": self.fit.squares,
            "degrees_of_freedom": self.fit.freedom,
            "frequencies": len(self.response.frequency),
            "feedthrough": [[[each.real, each.imag] for each in row] for row in self.feedthrough],
            "phase": self.phase,
            "delay": self.delay,
            "widened": self.widened,
        }


def fit_sweep(response: Response) -> SweepFit:
    """The fit of a sweep. Raises ValueError, in one sentence, if it shows no mode."""
    order = np.argsort(response.frequency, kind="stable")
    frequency, values = 2 * np.pi * response.frequency[order], response.values[order]
    shape = Shape(len(response.axes), len(response.drives))
    unit = float(frequency[np.argmax(_distance(values))])
    w = frequency / unit
    problem = SweepModel(shape, unit, w, float(w.mean()), values, _first_noise(values))
    polished = sorted((searched(problem, each, POLISH) for each in starts(problem)), key=lambda each: each[1])
    ended = [searched(problem, each, MAX_STEPS) for each, _ in polished[:ENDED]]
    parameters = min(ended, key=lambda each: each[1])[0]
    points = 2 * values.size
    count = 2 * shape.axes**2 + 2
    free = points - count - shape.drives * 4 * shape.axes
    if free < 1:
        raise ValueError(f"{response.name} has {len(w)} frequencies: it must have more for this model")
    squares = 0.0
    for i in range(WEIGHTINGS):
        parameters, squares = searched(problem, parameters, MAX_STEPS)
        if i < WEIGHTINGS - 1:
            rest = _complex(problem.evaluate(parameters)[0], shape, len(w))
            spread = np.sqrt(np.mean(np.abs(rest) ** 2, axis=(0, 2)) / 2 / (free / points))
            least = 1e-14 * np.abs(values).max()
            problem = replace(problem, noise=np.maximum(problem.noise * spread, least))
    widened = _correlated(_residuals(problem, parameters))
    if widened > 1:  # knowledge of delay and feedthrough counts as much more
        problem = replace(problem, noise=widened * problem.noise)
        parameters, squares = searched(problem, parameters, MAX_STEPS)
    return _result(problem, response, order, parameters, widened**2 * squares, free, widened)


def _distance(values: Complex) -> Array:
    """Distance of the response from its median, which is the feedthrough, summed over the channels."""
    about = np.median(values.real, axis=0) + 1j * np.median(values.imag, axis=0)
    return np.asarray((np.abs(values - about) ** 2).sum(axis=(1, 2)))


def _first_noise(values: Complex) -> Array:
    """Noise of each pick-off from second differences, real and imaginary part each."""
    second = values[2:] - 2 * values[1:-1] + values[:-2]
    found = np.median(np.abs(second), axis=(0, 2)) / np.sqrt(12 * np.log(2))
    return np.asarray(np.maximum(found, 1e-9 * np.abs(values).max()))


def _complex(rest: Array, shape: Shape, bins: int) -> Complex:
    """Residuals as (frequencies, axes, drives)."""
    parts = np.split(rest[:-1], shape.drives)
    half = bins * shape.axes
    return np.stack([(each[:half] + 1j * each[half : 2 * half]).reshape(bins, shape.axes) for each in parts], axis=2)


def _residuals(model: SweepModel, parameters: Array) -> tuple[Complex, ...]:
    """Residual of the fit over the noise, for each drive: (frequencies, axes)."""
    rest = _complex(model.evaluate(parameters)[0], model.shape, len(model.w))
    return tuple(rest[:, :, drive] for drive in range(model.shape.drives))


def _correlated(residuals: tuple[Complex, ...]) -> float:
    """Factor on deviations for noise that is correlated between neighbors, as drifts and readings' jumps are.

    The model changes slowly over the points, so it averages n correlated values as well as n/(1 + 2 sum of the
    correlations) independent ones. 1 if the residuals are white.
    """
    largest = 1.0
    for part in residuals:
        for row in part.T:
            if whiteness(row) < REJECTED / (len(residuals) * part.shape[1]):
                found = np.real(correlation(row, min(MAX_CORRELATED, len(row) // 4)))
                until = int(np.argmax(found < 2 / np.sqrt(len(row)))) or len(found)
                largest = max(largest, 1 + 2 * float(found[:until].sum()))
    return float(np.sqrt(largest))


def _result(
    model: SweepModel,
    response: Response,
    order: NDArray[np.int64],
    parameters: Array,
    squares: float,
    free: int,
    widened: float,
) -> SweepFit:
    """The fit with the joint covariance of all parameters, of which that of K, C and B is kept.

    `model`: with noise that is `widened`.
    """
    shape, n = model.shape, model.shape.axes
    columns = model.linear(parameters)[0]
    rest, _, parts = model.evaluate(parameters)
    covariance, whole = _joint(model, parameters, parts)
    residuals = tuple(widened * each for each in _residuals(model, parameters))
    count, size, square, places = len(parameters), 4 * n, 2 * n * n, _places(shape)
    drives = np.stack([part[:n] for part in parts], axis=1)
    through: Complex = np.stack([part[2 * n : 3 * n] + 1j * part[3 * n :] for part in parts], axis=1)
    feedthrough: Complex = np.asarray(np.exp(-1j * parameters[-2]) * through, dtype=complex)  # at the middle
    lines = [np.asarray(columns @ part, dtype=complex) for part in parts]
    fitted: Complex = np.asarray(np.stack(lines, axis=2) * model.noise[:, None], dtype=complex)
    found = np.concatenate([parameters[:square], drives.ravel()])
    noise = model.noise / widened
    result = SweepResult(found, covariance[np.ix_(places, places)], squares, free, noise, residuals)
    sorted_response = Response(
        response.name, response.frequency[order], response.values[order], response.axes, response.drives,
        response.state, response.digest,
    )  # fmt: skip
    delay, deviation = (
        float(each) / model.unit for each in (parameters[-1], np.sqrt(covariance[count - 1, count - 1]))
    )
    spread = np.stack(
        [_size_deviation(covariance, count + drive * size, n, through[:, drive]) for drive in range(shape.drives)],
        axis=1,
    )
    lean, lean_shift = _lean(model, parameters, whole, rest, drives)
    return SweepFit(
        result,
        shape,
        model.unit,
        sorted_response,
        fitted,
        feedthrough,
        float(parameters[-2]),
        delay,
        deviation,
        widened,
        spread,
        "up" if response.frequency[-1] > response.frequency[0] else "down",
        lean,
        lean_shift,
        model,
        parts,
    )


def _joint(model: SweepModel, parameters: Array, parts: Sequence[Array]) -> tuple[Array, Array]:
    """Covariance of K, C, phase, delay and the linear parts of each drive, and the scaled derivatives behind it."""
    columns, derivatives, _ = model.linear(parameters)
    count, size, drives = len(parameters), 4 * model.shape.axes, model.shape.drives
    matrix = model.stacked_columns(columns)
    height = len(matrix)
    whole = np.zeros((height * drives + 1, count + drives * size))
    whole[-1, count - 1] = 1 / DELAY
    for drive, linear in enumerate(parts):
        rows = slice(drive * height, (drive + 1) * height)
        whole[rows, :count] = model.moved(derivatives, linear)
        whole[rows, count + drive * size : count + (drive + 1) * size] = matrix
    norms = np.maximum(np.linalg.norm(whole, axis=0), np.finfo(float).tiny)
    inverse = np.linalg.pinv(whole / norms, rcond=1e-13)
    return (inverse @ inverse.T) / np.outer(norms, norms), whole / norms


def _places(shape: Shape) -> list[int]:
    """Places of K, C and B in the covariance of all."""
    square = 2 * shape.axes**2
    first = square + 2
    drives = (first + 4 * shape.axes * drive + row for row in range(shape.axes) for drive in range(shape.drives))
    return [*range(square), *drives]


def of_another(swept: SweepFit, parameters: Array) -> Array:
    """Covariance of K, C and B in a sweep such as this one of a device with these."""
    n = swept.shape.axes
    square = 2 * n * n
    drive = parameters[square:].reshape(n, swept.shape.drives)
    parts = [np.concatenate([drive[:, k], part[n:]]) for k, part in enumerate(swept.parts)]
    model = swept.problem
    found = _joint(model, np.concatenate([parameters[:square], [swept.phase, swept.delay * model.unit]]), parts)[0]
    places = _places(swept.shape)
    return np.asarray(found[np.ix_(places, places)])


def _size_deviation(covariance: Array, first: int, n: int, through: Complex) -> Array:
    """Deviation of the size of the feedthrough to each pick-off; its phase is known less well, as that of the
    instrument is. `first`: place of the linear parts of this drive."""
    found = []
    for i, each in enumerate(through):
        places = [first + 2 * n + i, first + 3 * n + i]
        along = np.array([each.real, each.imag]) / abs(each) if each else np.array([1.0, 1.0])
        found.append(float(along @ covariance[np.ix_(places, places)] @ along))
    return np.asarray(np.sqrt(found))


def _lean(model: SweepModel, parameters: Array, others: Array, rest: Array, drives: Array) -> tuple[Array, Array]:
    """Score of a cubic spring along each axis, and the shift of its frequency at the largest motion, Hz.

    At a frequency the spring is a force -3/4 k |x|^2 x, known but for k from the fitted motion x of a drive.
    """
    n, square = model.shape.axes, model.shape.axes**2
    inverse = model.linear(parameters)[2]
    phase, delay = parameters[2 * square :]
    turn = np.exp(-1j * (phase + (model.w - model.middle) * delay))[:, None] / model.noise
    scores, shifts = [], []
    for i in range(n):
        column, largest = [], 0.0
        for drive in drives.T:
            x = inverse[:, i, :] @ drive
            largest = max(largest, float(np.abs(x).max()))
            column += [stacked((turn * inverse[:, :, i] * (0.75 * np.abs(x) ** 2 * x)[:, None]).ravel()), np.zeros(n)]
        along = np.concatenate([*column, [0.0]])
        clear = along - others @ np.linalg.lstsq(others, along, rcond=1e-12)[0]
        size = max(float(np.linalg.norm(clear)), np.finfo(float).tiny)
        scores.append(-float(clear @ rest) / size)
        own = math.sqrt(max(float(parameters[i * n + i]), 1e-6))
        shifts.append(3 / 8 * scores[-1] / size / own * largest**2 * model.unit / (2 * np.pi))
    return np.array(scores), np.array(shifts)


def sweep_tests(found: SweepFit) -> list[Test]:
    """Whiteness of each response of a sweep, in the order of its frequencies."""
    response = found.response
    channels = len(response.axes) * len(response.drives)
    result = []
    for k, drive in enumerate(response.drives):
        for i, axis in enumerate(response.axes):
            p = whiteness(found.fit.residuals[k][:, i])
            failed = p < REJECTED / channels
            where = f"response {axis}{drive} of {response.name}"
            words = f"{where}: the residual is white (p = {p:.2g})"
            if failed:
                words = (
                    f"{where}: the residual is not white (p = {p:.1g}): the sweep is too fast, the amplitude too "
                    f"large, the instrument drifts, or another mode is near; all intervals are {found.widened:.2g} "
                    "times wider"
                )
            result.append(Test("whiteness", "fail" if failed else "pass", words, p))
    return result + _band_tests(found)


def _band_tests(found: SweepFit) -> list[Test]:
    """A failed test for a mode outside the sweep. Raises ValueError if no mode is inside."""
    shape, at = Shape(found.shape.axes), found.response.frequency
    modes = np.abs(poles(shape, found.fit.parameters[: 2 * shape.axes**2])) * found.unit / (2 * np.pi)
    outside = [float(mode) for mode in modes if not at.min() <= mode <= at.max()]
    words = f"outside the sweep, which is from {at.min():.8g} to {at.max():.8g} Hz"
    if len(outside) == len(modes):
        raise ValueError(
            f"{found.response.name}: no resonance is inside the sweep: the fit has {outside[0]:.6g} Hz, {words}"
        )
    return [
        Test("band", "fail", f"{found.response.name}: the mode at {mode:.6g} Hz is {words}: sweep over it")
        for mode in outside
    ]
