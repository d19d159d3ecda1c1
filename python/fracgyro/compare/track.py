"""The task `track`: the reference of the paper, off resonance, as exactly and with as little chattering as possible."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.metric_names import METRICS
from ..analysis.metrics import TRANSIENT
from ..scenario import Scenario, ScenarioError
from ..scenario.kinds import having
from ..scenario.table import shown
from ..study.tune.criteria import Constraint, Measured, Objective
from .track_contenders import CONTENDERS, PAPER

DURATION = 20.0  # of the paper's run: as long again as its transient
FORCE_LIMIT = 1000.0
CEILINGS = (0.0035, 0.05)  # of chattering: the paper's own, and what an error may be bought with
ERRORS = ("rmse_steady_x", "rmse_steady_y", "rmse_transient_x", "rmse_transient_y")
CHATTERING = ("chattering_x", "chattering_y")
SHOWN = (*ERRORS, *CHATTERING, "largest_force", "error_settling_time")
DEG = math.pi / 180


@dataclass(frozen=True)
class Cell:
    """One table of the comparison: what all of its rows have in common."""

    scenario: str  # its name
    information: str  # F: positions and velocities are measured; P: positions only
    noise: float  # of the measured position, m/sqrt(Hz)
    ceiling: float  # of the chattering index on either axis

    @property
    def name(self) -> str:
        return f"{self.scenario}-{self.information}-{self.noise:g}-{self.ceiling:g}"


class Track:
    """What the comparison asks of a task. Another is another file with these names."""

    name = "track"
    title = "Tracking"
    contenders = CONTENDERS
    reference = PAPER
    metrics = SHOWN
    ceilings = CEILINGS
    objectives = tuple(Objective(metric=metric) for metric in ERRORS)

    @staticmethod
    def scenario(given: Scenario | None) -> Scenario:
        """What all contenders run, their own tables aside; without one the paper's. Raises ScenarioError."""
        base = given or Scenario.paper().replace({"run.duration": DURATION, "run.kernel_tolerance": 3e-5})
        if base.disturbance.kind != "noise":
            raise ScenarioError(
                f"disturbance.kind is {shown(base.disturbance.kind)}: it must be noise, or no seed can be held out"
            )
        changes: dict[str, Any] = {"run.units": "nondimensional", "run.record_every": 1}
        if base.controller.force_limit == math.inf:
            changes["controller.force_limit"] = FORCE_LIMIT
        if base.adaptation.initial_rate is None:  # it must stay when the plant's rate is another
            rate = base.plant.nondimensional()[2]
            changes["adaptation.initial_rate"] = base.adaptation.initial_ratio * rate
        return base.replace(changes)

    @staticmethod
    def sensed(base: Scenario, information: str, noise: float) -> Scenario:
        """With noise of the same nondimensional density on what is measured."""
        both = information == "F"
        return base.replace(
            {
                "device.sensing": "full" if both else "position",
                "device.position_noise_density": noise,
                "device.velocity_noise_density": noise * base.plant.reference_frequency if both else 0.0,
            }
        )

    @staticmethod
    def constraints(ceiling: float) -> list[Constraint]:
        return [Constraint(metric=metric, at_most=ceiling) for metric in CHATTERING]

    @staticmethod
    def thresholds(base: Scenario) -> dict[str, float]:
        """Of the metrics: until when the run is transient."""
        return {"transient": min(TRANSIENT, base.run.duration / 2)}

    @staticmethod
    def error(measured: Measured) -> NDArray[np.float64]:
        """Of each seed: the mean logarithm of the RMS errors, infinite where the run diverged."""
        with np.errstate(divide="ignore"):
            logs = np.log(np.stack([measured.metrics[metric] for metric in ERRORS]))
        found: NDArray[np.float64] = np.where(measured.diverged, np.inf, logs.mean(axis=0))
        return found

    @staticmethod
    def words(metric: str) -> tuple[str, str]:
        return METRICS[metric]

    @staticmethod
    def plants(base: Scenario) -> dict[str, dict[str, Any]]:
        """Changes by what they are: plants that no tuning saw. What a contender knows of the plant stays."""
        plant, scales = base.plant, base.plant.scales
        d, k, m = plant.damping, plant.stiffness, plant.mass
        more_d, more_k = plant.damping_deviation, plant.stiffness_deviation
        found: dict[str, dict[str, Any]] = {}
        for sign in (1, -1):
            by = 0.05 * sign
            found[f"K {100 * by:+.0f} %"] = {"plant.stiffness_deviation": more_k.plus(by * k.xx, by * k.xy, by * k.yy)}
            found[f"D {100 * by:+.0f} %"] = {"plant.damping_deviation": more_d.plus(by * d.xx, by * d.xy, by * d.yy)}
            w = math.sqrt(k.xx / m), math.sqrt(k.yy / m)
            split = m * (w[1] + 0.2 * sign * (w[1] - w[0])) ** 2 - k.yy
            found[f"split {20 * sign:+d} %"] = {"plant.stiffness_deviation": more_k.plus(0.0, 0.0, split)}
            cross = 0.1 * sign * math.sqrt(d.xx * d.yy)
            found[f"dxy {10 * sign:+d} %"] = {"plant.damping_deviation": more_d.plus(0.0, cross, 0.0)}
            rate = 300 * DEG * sign
            quadrature = 2 * m * rate * base.reference.frequency[0] * scales.rate
            found[f"kxy {300 * sign:+d} deg/s"] = {"plant.stiffness_deviation": more_k.plus(0.0, quadrature, 0.0)}
            found[f"rate {300 * sign:+d} deg/s"] = {"plant.angular_rate": rate}
        found["rate 0"] = {"plant.angular_rate": 0.0}
        device = base.device
        if device.position_noise_density:
            for words, factor in (("noise / 3", 1 / 3), ("noise x 3", 3.0)):
                found[words] = {
                    "device.position_noise_density": factor * device.position_noise_density,
                    "device.velocity_noise_density": factor * device.velocity_noise_density,
                }
        return found

    @staticmethod
    def conditions(base: Scenario, kind: str) -> dict[str, dict[str, Any]]:
        """Changes by what they are: what the gains, frozen, have to bear."""
        scales, run = base.plant.scales, base.run
        late: dict[str, Any] = {"device.delay": base.device.delay + 1}
        unaware = {"datasheet.delay": base.device.delay} if kind in having("datasheet.delay") else {}
        reach = [1.25 * a * scales.length for a in base.reference.amplitude]
        # Far above the reference's, so that no start clips.
        pairs = zip(base.reference.amplitude, base.reference.frequency, strict=True)
        speed = [10 * amplitude * frequency * scales.velocity for amplitude, frequency in pairs]
        found = {"one step of delay": late, "one step of hidden delay": {**late, **unaware}}
        for bits in (16, 12):
            converters: dict[str, Any] = {"device.position_range": reach, "device.position_bits": bits}
            if base.device.sensing == "full":
                converters |= {"device.velocity_range": speed, "device.velocity_bits": bits}
            found[f"{bits} bit"] = converters
        # The paper's reference needs 0.57 of it: with half nobody could follow.
        found["0.7 of the force"] = {"controller.force_limit": 0.7 * base.controller.force_limit}
        seconds = run.duration * scales.time
        found["K -300 ppm, drifting"] = {"device.stiffness_drift": -30.0, "device.temperature_ramp": 10.0 / seconds}
        found["4 times as long"] = {"run.duration": 4 * run.duration}
        return found
