"""Measurements of tuned laws beyond those of the comparison: traces, drift in long runs, convergence, bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from fracgyro.scenario import Scenario
from fracgyro.scenario.messages import ScenarioError
from fracgyro.simulation.measure import measure_many
from fracgyro.simulation.simulate import DivergedError, simulate
from numpy.typing import NDArray

WINDOWS = 60  # numbers of a trace
LONG, KEPT = 1000.0, 5000  # duration of the run for drift, 1e6 steps of 1e-3, and steps between its samples
NEAR = 0.02  # q0: |e_x| below which a run has converged
STAYS = 1.0  # 1/omega0: time for which a converged run stays near zero, at least
STARTS = (0.1, 1.0, 10.0, 100.0)  # e_x(0), q0
FAR = 100.0  # 1/omega0: the longest run for a convergence
CLOSE = 0.05  # share of the true value within which an estimate is right
THRESHOLDS = (1.0, 2.0, 3.0, 10.0, 30.0)  # m omega0^2 q0: of the event trigger
SETTLED = 80.0  # duration of the runs for estimates, as in the paper of this project
NOTHING = 1e-6  # a smaller norm is none
LEARNED = ("weight_norm", "learned_gain", "bound_estimate", "stiffness_estimate")


def trace(scenario: Scenario, seed: int) -> list[float | None]:
    """The largest |e_x| in equal parts of a run; empty if it diverges."""
    try:
        return parts(simulate(_seeded(scenario, seed))["error"].sel(axis="x").values)
    except DivergedError:
        return []


def parts(errors: NDArray[np.float64]) -> list[float | None]:
    """The largest |error| in equal parts; None if it is not finite or a part is empty."""
    found = [float(np.abs(part).max()) if len(part) else math.nan for part in np.array_split(errors[1:], WINDOWS)]
    return [value if math.isfinite(value) else None for value in found]


def drift(scenario: Scenario, seed: int) -> tuple[str, list[float]] | None:
    """Norm of what a law has learned at a tenth, half and all of 1e6 steps, and its channel; None if it learns nothing.

    Estimates of a plant count less their first values. Raises DivergedError.
    """
    steps = round(LONG / scenario.run.step)
    long = {"run.duration": steps * scenario.run.step, "run.record_every": min(KEPT, steps)}
    run = simulate(_seeded(scenario, seed).replace(long))
    for name in LEARNED:
        if name in run:
            values = run[name].transpose("time", ...).values.reshape(run.sizes["time"], -1)
            norm = np.linalg.norm(values - (values[0] if name.endswith("estimate") else 0.0), axis=1)
            if norm.max() > NOTHING:
                last = len(norm) - 1
                return name, [float(norm[round(share * last)]) for share in (0.1, 0.5, 1.0)]
    return None


def time_to(scenario: Scenario, start: float) -> float | None:
    """Time after which |e_x| stays below 0.02 q0, from e_x(0) = `start` without noise; None if it never does.

    Raises ScenarioError if the start makes no scenario, and DivergedError.
    """
    first = simulate(scenario.replace({"run.duration": scenario.run.step}))["reference"].transpose("time", "axis")[0]
    far = scenario.replace(
        {
            "run.duration": FAR,
            "run.initial_position": (float(first[0]) + start, float(first[1])),
            "run.initial_velocity": (0.0, 0.0),
            "disturbance.kind": "none",
            "device.position_noise_density": 0.0,
            "device.velocity_noise_density": 0.0,
        }
    )
    run = simulate(far)
    outside = ~(np.abs(run["error"].sel(axis="x").values) < NEAR)
    if outside[run["time"].values > FAR - STAYS].any():
        return None
    return float(run["time"][outside.nonzero()[0][-1] + 1]) if outside.any() else 0.0


def convergence_times(scenario: Scenario) -> dict[float, float | None]:
    """Time to |e_x| < 0.02 q0 for each start; None if it never is, or the run diverges."""
    found: dict[float, float | None] = {}
    for start in STARTS:
        try:
            found[start] = time_to(scenario, start)
        except (ScenarioError, DivergedError):
            found[start] = None
    return found


def right_estimates(scenario: Scenario, seeds: Sequence[int]) -> dict[str, float]:
    """Share of seeds with an estimate within 5 % at t = 80, for the rate, D and K; empty if a law estimates none."""
    rows = measure_many([scenario.replace({"run.duration": SETTLED})], seeds=list(seeds))
    truth = abs(scenario.plant.nondimensional()[2])
    errors = {
        "rate": np.abs(rows["rate_error"].values) / truth,
        "D": rows["damping_error"].values,
        "K": rows["stiffness_error"].values,
    }
    return {name: float((e <= CLOSE).mean()) for name, e in errors.items() if np.isfinite(e).any()}


def largest_share(scenario: Scenario, seeds: Sequence[int]) -> list[float]:
    """By seed: the largest |e| over its prescribed bound, of either axis and over the run; inf if it diverges.

    The bound is the one of the law's own course: a bound that was widened counts as left.
    """
    found = []
    law = scenario.controller
    for seed in seeds:
        try:
            run = simulate(_seeded(scenario, seed))
        except DivergedError:
            found.append(math.inf)
            continue
        falling = (law.bound_start - law.bound_final) * np.exp(-law.bound_rate * run["time"])
        found.append(float((np.abs(run["error"]) / (falling + law.bound_final)).max()))
    return found


def sending(scenario: Scenario, seeds: Sequence[int]) -> dict[float, tuple[float, float]]:
    """By threshold of the event trigger: the share of steps with a new force, and the error over that with all forces.

    Raises DivergedError if the law diverges without a trigger; a share of 1 and an infinite error if it does with one.
    """
    found: dict[float, tuple[float, float]] = {}
    every = [_sent(_seeded(scenario, seed), 0.0)[1] for seed in seeds]
    for threshold in THRESHOLDS:
        try:
            runs = [_sent(_seeded(scenario, seed), threshold) for seed in seeds]
        except DivergedError:
            found[threshold] = (1.0, math.inf)
            continue
        ratio = np.mean([np.log(error) for _, error in runs]) - np.mean(np.log(every))
        found[threshold] = (float(np.mean([share for share, _ in runs])), float(np.exp(ratio)))
    return found


def _sent(scenario: Scenario, threshold: float) -> tuple[float, float]:
    """The share of steps with a new force, and the RMS of |e| after the first half."""
    changes = {"controller.event_threshold": threshold, "controller.event_share": 0.0, "run.record_every": 1}
    run = simulate(scenario.replace(changes))
    force = run["control"].transpose("time", "axis").values
    error = run["error"].transpose("time", "axis").values
    new = (np.diff(force, axis=0) != 0.0).any(axis=1)
    return float(new.mean()), float(np.sqrt((error[len(error) // 2 :] ** 2).mean()))


def _seeded(scenario: Scenario, seed: int) -> Scenario:
    return scenario.replace({"disturbance.seed": seed})
