"""Integral sliding mode with a disturbance observer: an independent transcription, and what it is for."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from in_lanes import assert_lanes_agree
from law_oracles import IntegralSliding

PAPER = fg.Scenario.paper().replace({"controller.kind": "integral_sliding", "controller.force_limit": 1000.0})
SHORT = PAPER.replace({"run.duration": 4.0})
QUIET = {"disturbance.kind": "none", "disturbance.hold": None, "disturbance.standard_deviation": None}
NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
# Gains tuned for that noise and a chattering of 0.0035 (docs/decisions/0051).
TUNED = {"surface_gain": 36.0, "reaching_rate": 82.0, "integral_rate": 24.0, "disturbance_observer": 330.0}


def with_gains(scenario: fg.Scenario, gains: dict[str, float]) -> fg.Scenario:
    return scenario.replace({f"controller.{name}": value for name, value in gains.items()})


@pytest.mark.parametrize("gains", [{}, TUNED, {"integral_rate": 0.0}, {"disturbance_observer": 0.0}], ids=str)
@pytest.mark.parametrize("limit", [np.inf, 700.0])
def test_it_is_its_transcription(limit: float, gains: dict[str, float]) -> None:
    scenario, law = with_gains(SHORT.replace({"controller.force_limit": limit, **NOISE}), gains), IntegralSliding()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-9 * scale)


def late_error(scenario: fg.Scenario) -> float:
    return float(fg.metrics.rmse(fg.simulate(scenario), (0.75 * scenario.run.duration, None)).max())


def test_the_observer_removes_a_constant_force() -> None:
    pushed = {
        **QUIET,
        "disturbance.kind": "step",
        "disturbance.amplitude": (40.0, -60.0),
        "adaptation.initial_ratio": 1.0,
    }
    only = with_gains(PAPER.replace({**pushed, "run.duration": 8.0}), {"integral_rate": 0.0})
    # The velocity between held forces, 1e-4 at the samples, is a remaining error.
    assert late_error(only) < 1e-5
    assert late_error(with_gains(only, {"disturbance_observer": 0.0})) > 0.01


def as_pid(gains: dict[str, float]) -> dict[str, Any]:
    """The PID that has its poles without noise: those of the surface, of s and of the observer."""
    surface, kappa, bandwidth = gains["surface_gain"], gains["reaching_rate"], gains["disturbance_observer"]
    square = surface * kappa + bandwidth * (surface + kappa)
    return {
        "controller.kind": "pid",
        "controller.natural_frequency": square**0.5,
        "controller.damping_ratio": (surface + kappa + bandwidth) / (2 * square**0.5),
        "controller.integral_frequency": surface * kappa * bandwidth / square,
    }


POLES = {"surface_gain": 60.0, "reaching_rate": 60.0, "integral_rate": 0.0, "disturbance_observer": 290.0}


def test_without_noise_the_observer_is_the_integral_of_a_pid() -> None:
    # But for terms of the order L h, and for the plant's own spring, which it cancels and a PID does not: 1 %.
    both = PAPER.replace({**QUIET, "run.duration": 4.0, "run.step": 1e-4})
    ours, theirs = late_error(with_gains(both, POLES)), late_error(both.replace(as_pid(POLES)))
    assert ours == pytest.approx(theirs, rel=0.05)


def test_in_noise_its_force_has_far_less_of_the_position_than_that_of_a_pid() -> None:
    noisy = PAPER.replace({**NOISE, "device.velocity_noise_density": 0.0, "run.duration": 6.0})
    ours = fg.metrics.chattering(fg.simulate(with_gains(noisy, POLES)), (3.0, None)).max()
    theirs = fg.metrics.chattering(fg.simulate(noisy.replace(as_pid(POLES))), (3.0, None)).max()
    assert ours < 0.3 * theirs


def test_it_bears_what_nobody_stated() -> None:
    def error(changes: dict[str, Any]) -> float:
        tuned = with_gains(PAPER.replace({**NOISE, "run.duration": 20.0}), TUNED)
        runs = fg.simulate_many([tuned.replace(changes)], seeds=range(3))
        return float(np.sqrt((runs["error"].values[:, 10_000:] ** 2).mean()))

    known = error({})
    assert known < 1.6e-5
    assert error({"device.delay": 1}) < 1.1 * known
    assert error({"plant.stiffness_deviation": {"xx": 3.2, "xy": 0.64, "yy": 4.8}}) < 1.2 * known


def test_lanes_and_single_precision() -> None:
    assert_lanes_agree([with_gains(SHORT, gains) for gains in ({}, TUNED, POLES, {"integral_rate": 0.0})])
