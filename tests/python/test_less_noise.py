"""Better sensors never track worse, and a hidden delay costs little more than one that the filter knows."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

STEPS, SEEDS = 3000, 2
DEVICES = ("paper", "dual_mass", "tuned_in_air", "disc", "paper_resonance")
LAWS: dict[str, dict[str, Any]] = {
    "lqg": {"controller.kind": "lqg"},
    "sliding mode": {"adaptation.kind": "joint"},
    "PID behind the filter": {"controller.kind": "pid", "controller.filter": "kalman"},
}
DENSITIES = (0.0, 1e-17, 1e-16, 1e-15, 1e-14, 1e-13)  # m/sqrt(Hz)
MARGIN = 1.1  # for statistics: with these steps an RMS is within 3 % of its expectation


def scenario(device: str, law: str, sensing: str, density: float, **more: Any) -> fg.Scenario:
    base = fg.Scenario.paper() if device == "paper" else fg.Scenario.shipped(device)
    changes = {
        "device.sensing": sensing,
        "device.position_noise_density": density,
        "device.velocity_noise_density": density * base.plant.reference_frequency if sensing == "full" else 0.0,
        "run.duration": STEPS * base.run.step,
        "run.record_every": 1,
        "run.units": "nondimensional",
        **LAWS[law],
        **{key.replace("__", "."): value for key, value in more.items()},
    }
    if law == "PID behind the filter":
        changes["controller.natural_frequency"] = 0.3 / base.run.step
    if device == "paper":
        changes["controller.force_limit"] = 1000.0
    return base.replace(changes)


def error(given: fg.Scenario) -> float:
    """Geometric mean over the axes of the RMS error in the second half of some runs."""
    run = fg.simulate_many([given], seeds=range(SEEDS))
    assert not run["diverged_at"].notnull().any()
    missed = (run["position"] - run["reference"]).values[:, STEPS // 2 :]
    return float(np.prod((missed**2).mean(axis=(0, 1))) ** 0.25)


@settings(max_examples=20)
@given(
    st.sampled_from(DEVICES),
    st.sampled_from(list(LAWS)),
    st.sampled_from(("full", "position")),
    st.integers(0, len(DENSITIES) - 2),
    st.integers(1, len(DENSITIES) - 1),
)
def test_less_noise_never_gives_a_larger_error(device: str, law: str, sensing: str, less: int, more: int) -> None:
    fine, coarse = DENSITIES[less], DENSITIES[min(less + more, len(DENSITIES) - 1)]
    assert error(scenario(device, law, sensing, fine)) < MARGIN * error(scenario(device, law, sensing, coarse))


def test_a_floor_on_the_stated_noise_gains_nothing() -> None:
    said = {"datasheet__position_noise": 7e-7, "datasheet__velocity_noise": 7e-7}
    exact = error(scenario("paper", "lqg", "full", 0.0))
    assert exact < MARGIN * error(scenario("paper", "lqg", "full", 0.0, **said))


@pytest.mark.parametrize(("sensing", "density"), [("full", 0.0), ("full", 1e-13), ("position", 0.0)])
def test_a_hidden_step_of_delay_costs_little_more_than_a_known_one(sensing: str, density: float) -> None:
    late: dict[str, Any] = {"device__delay": 1}
    known = error(scenario("paper", "lqg", sensing, density, **late))
    hidden = scenario("paper", "lqg", sensing, density, **late, datasheet__delay=0)
    # Its feedforward is a step late, which costs half of the error again.
    assert error(hidden) < 1.7 * known
    assert (fg.simulate(hidden)["rate_trusted"].values == 0.0).all()
