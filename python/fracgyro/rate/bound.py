"""The Cramér-Rao bound of the rate estimate, as an angle random walk, under force noise and sensing noise.

The motion is known to about 1e-5 of its amplitude. Omega_z is therefore the amplitude of a known force in noise of
known density, and so are the entries of D and K: phi^T theta in eq. (9). Force noise has the two-sided density S.
Sensing noise of density N acts like force noise G^-1 N G^-H, G^-1 = -w^2 + j w (D + 2 Omega) + K, which is small near
the resonances:

    I_jk = sum over the lines w of 1/2 Re phi_j^H (S + G^-1 N G^-H)^-1 phi_k,    N^2 = (I^-1)_Omega,Omega

`bound_angle_random_walk` evaluates this for the lines of the reference; `bound_of_motion` uses the Kalman filter's
innovation (innovation.py) along any motion. Flicker noise of the sensors is neglected; it could only raise the bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scenario import Scenario
from ..scenario.device_core import device_values, sensor_variance
from ..scenario.terms import white_density
from ..scenario.to_core import is_plain
from ..simulation.simulate import simulate
from ..simulation.user_controller import ControllerLike, units
from .innovation import Noise, Plant, information_of_motion

Array = NDArray[np.float64]

MAX_CONDITION = 1e10  # condition number of the scaled information, above which parameters are not identifiable


@dataclass(frozen=True)
class Bound:
    """Lower bound of the angle random walk N, rad/sqrt(s), of any unbiased estimate of a constant Omega_z.

    >>> bound = fg.rate.bound_angle_random_walk(fg.Scenario.paper())
    >>> 0 < bound.known < bound.unknown
    True
    """

    known: float  #: D and K are known, as after a long observation that forgets only Omega_z
    unknown: float  #: D and K are unknown constants, estimated from the same record as Omega_z


def bound_angle_random_walk(scenario: Scenario, controller: ControllerLike | None = None) -> Bound | None:
    """The Cramér-Rao bounds of the rate estimate at plant.angular_rate; takes milliseconds, without a run.

    The noise is that of [disturbance] and [device]: densities or standard deviations, and converter steps as white
    noise with a twelfth of their square as variance; with device.sensing = "position" no velocity is measured. The
    motion is the reference; a user's `controller` is run to obtain its motion. bound.py has the derivation.

    Returns None without noise, for a disturbance that is not noise, with a trim, which moves the resonances, for a
    reference that is not only sines about 0, and if the motion does not identify the parameters.

    >>> quiet = fg.Scenario.paper().replace({"disturbance.kind": "none"})
    >>> print(fg.rate.bound_angle_random_walk(quiet))
    None
    """
    if controller is not None:
        return bound_of_motion(scenario, controller)
    noise = noise_of(scenario)
    return None if noise is None else bound_of_noise(scenario, noise)


def bound_of_noise(scenario: Scenario, noise: Noise) -> Bound | None:
    """The bounds of the scenario's reference with this noise instead; None as `bound_angle_random_walk`."""
    lines = lines_of(scenario)
    if lines is None:
        return None
    plant = Plant.of(scenario)
    exact = noise.force == 0 and not noise.of_sensing
    information = np.zeros((7, 7))
    for frequency, position in lines:
        rows = _regressors(position, 1j * frequency * position)
        inverse = plant.inverse_response(frequency)
        density = (1.0 if exact else noise.force) * np.eye(2) + inverse * noise.at(frequency) @ inverse.conj().T
        information += 0.5 * np.real(rows.conj() @ np.linalg.solve(density, rows.T))
    return _bound(information, scenario, 0.0 if exact else 1.0)


def lines_of(scenario: Scenario) -> list[tuple[float, NDArray[Any]]] | None:
    """Frequencies and phasors of the reference; None if it is not only sines about 0."""
    reference = scenario.reference
    if is_plain(scenario):
        # The phase does not matter: if a bound exists, only one axis moves at each frequency.
        return [
            (frequency, np.where(np.equal(reference.frequency, frequency), reference.amplitude, 0.0))
            for frequency in sorted(set(reference.frequency))
        ]
    if set(reference.kinds) != {"sines"} or any(reference.offset):
        return None
    found: dict[float, NDArray[Any]] = {}
    for term in reference.terms or ():
        for axis, frequency in enumerate(term.frequency):
            phasors = found.setdefault(frequency, np.zeros(2, complex))
            phasors[axis] += term.amplitude[axis] * np.exp(1j * term.phase[axis])
    return sorted(found.items(), key=lambda line: line[0])


def bound_of_motion(scenario: Scenario, controller: ControllerLike | None = None) -> Bound | None:
    """The bounds along the motion in the second half of a run; takes seconds."""
    noise = noise_of(scenario)
    if noise is None:
        return None
    run = simulate(scenario.replace({"run.record_every": 1}), controller)
    motion = _nondimensional(scenario, run)
    if noise.of_sensing:
        return _bound(information_of_motion(Plant.of(scenario), scenario.run.step, noise, *motion), scenario, 1.0)
    position, velocity, _ = motion
    rows = np.concatenate(_regressors(position.T, velocity.T).transpose(1, 0, 2), axis=1)
    exact = noise.force == 0
    information = rows @ rows.T / len(position) / (1.0 if exact else noise.force)
    return _bound(information, scenario, 0.0 if exact else 1.0)


def noise_of(scenario: Scenario) -> Noise | None:
    """The white noise of a scenario, nondimensional; None without noise, for another disturbance, or with a trim.

    A trim moves the resonances of the plant that a bound is for.
    """
    step, force = scenario.run.step, white_density(scenario)
    if force is None or scenario.trim.on:
        return None
    device = device_values(scenario)
    position, velocity = (sensor_variance(device, of) * step for of in ("position", "velocity"))
    if scenario.device.sensing == "position":
        velocity = np.full(2, math.inf)
    # Mean power of both axes, as a bound has one density of the force.
    force += float(np.mean(np.square(device["drive_noise"]))) * step
    noise = Noise(force, position, velocity)
    return noise if scenario.disturbance.random or noise.of_sensing else None


def _regressors(position: NDArray[Any], velocity: NDArray[Any]) -> NDArray[Any]:
    """Force on x and y for Dxx, Dxy, Dyy, Kxx, Kxy, Kyy, Omega_z = 1 in eq. (9): (7, 2, ...)."""
    (x, y), (vx, vy) = position, velocity
    none = np.zeros_like(x)
    pairs = [(vx, none), (vy, vx), (none, vy), (x, none), (y, x), (none, y), (-2 * vy, 2 * vx)]
    return np.array([np.stack(pair) for pair in pairs])


def _bound(information: Array, scenario: Scenario, factor: float) -> Bound | None:
    scale = np.sqrt(np.diag(information))
    if not scale.all():
        return None
    scaled = information / np.outer(scale, scale)
    if np.linalg.cond(scaled) > MAX_CONDITION:
        return None
    scales = scenario.plant.scales
    known = factor / float(scale[-1]) * scales.rate * math.sqrt(scales.time)
    return Bound(known, known * math.sqrt(float(np.linalg.inv(scaled)[-1, -1])))


def _nondimensional(scenario: Scenario, run: Any) -> tuple[Array, Array, Array]:
    """Position, velocity and force of the second half, (samples, 2)."""
    unit, half = units(scenario), run.sizes["time"] // 2
    force = "applied_control" if "applied_control" in run else "control"
    parts = (("position", unit.length), ("velocity", unit.velocity), (force, unit.force))
    position, velocity, acting = (run[name].values[half:] / scale for name, scale in parts)
    return position, velocity, acting
