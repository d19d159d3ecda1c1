"""The controller `lqg` in whole runs: its feedback from SciPy's Riccati equation, its error near the limit, delay."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from smooth_feedback_oracle import SmoothFeedback

PAPER = fg.Scenario.paper().replace({"controller.kind": "lqg", "adaptation.initial_rate": 0.095})
FULL = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
POSITIONS = {"device.sensing": "position", "device.position_noise_density": 1e-13}
NONE: dict[str, Any] = {}
SEEDS = range(4)


def along(scenario: fg.Scenario, run: Any) -> np.ndarray:
    """The held force for the reference on the plant of the reports, which are those before each sample."""
    h, r = scenario.run.step, scenario.reference
    times = (np.arange(run.sizes["time"]) + scenario.device.delay + 0.5) * h
    rate = np.array(r.frequency)
    sinc = np.sin(rate * h / 2) / (rate * h / 2)
    angle = np.outer(times, rate) + np.array(r.phase)
    position = np.array(r.amplitude) / sinc * np.sin(angle)
    velocity = np.array(r.amplitude) / sinc * rate * np.cos(angle)
    (dxx, dxy, dyy), (kxx, kxy, kyy) = (run[name].values.T for name in ("damping_estimate", "stiffness_estimate"))
    twice = 2 * run["rate_estimate"].values
    (x, y), (vx, vy) = position.T, velocity.T
    plant = [dxx * vx + (dxy - twice) * vy + kxx * x + kxy * y, (dxy + twice) * vx + dyy * vy + kxy * x + kyy * y]
    force: np.ndarray = np.array(plant).T - rate**2 * position
    return force


# Without noise the filter's motion is the measured one.
@pytest.mark.parametrize(
    "changes",
    [
        NONE,
        {"controller.delay_margin": 0.0, "controller.loop_bandwidth": 2.0},
        {"controller.delay_margin": 0.3, "controller.loop_bandwidth": 0.4},
        {"device.delay": 1},
        {"device.delay": 4, "controller.loop_bandwidth": 0.3, "controller.delay_margin": 0.5},
    ],
    ids=["as shipped", "exact delay", "some margin", "delay", "delay of four"],
)
def test_it_computes_the_forces_of_its_equations(changes: dict[str, Any]) -> None:
    scenario = PAPER.replace({"run.duration": 1.0, "run.record_every": 1, "controller.force_limit": 1000.0, **changes})
    run = fg.simulate(scenario)
    known, forces = along(scenario, run), run["control"].values
    error = (run["position"] - run["reference"]).values
    rate = run["error_rate"].values
    damping, stiffness, *_ = scenario.plant.nondimensional()
    ratio, h = scenario.adaptation.initial_ratio, scenario.run.step
    per_axis = [(ratio * stiffness[i], ratio * damping[i]) for i in (0, 2)]
    feedback = SmoothFeedback(scenario.controller, per_axis, h, scenario.device.delay)
    ours, limited = [], 0
    for n, force in enumerate(forces):
        offset = -h / 12 * (known[n] - known[n - 1]) if n else 0.0
        follows = feedback.force(error[n], rate[n] - offset)
        wanted = known[n] + follows
        ours.append(np.clip(wanted, -1000.0, 1000.0))
        limited += int((np.abs(wanted) > 1000.0).any())
        feedback.remember(force - known[n])
    assert limited > 10
    np.testing.assert_allclose(ours, forces, rtol=0, atol=1e-4 * 1000.0)


def measured(changes: dict[str, Any]) -> tuple[float, float]:
    """RMS error and the larger chattering, after the transient."""
    scenario = PAPER.replace({"run.duration": 20.0, "controller.force_limit": 1000.0, **changes})
    run = fg.simulate_many([scenario], seeds=SEEDS)
    steady = run.sel(time=slice(10.0, None))
    error = (steady["position"] - steady["reference"]) ** 2
    return float(np.sqrt(error.mean())), float(max(fg.metrics.chattering(run).mean("run").values))


@pytest.mark.parametrize(
    ("changes", "bandwidth", "margin", "ceiling", "over"),
    [
        (FULL, 0.82, 0.0, 0.0035, 1.08),
        (FULL, 0.77, 1.0, 0.0035, 1.2),
        (FULL, 2.4, 0.0, 0.05, 1.06),
        (POSITIONS, 0.5, 1.0, 0.0035, 1.08),
        (POSITIONS, 1.1, 0.0, 0.05, 1.06),
    ],
)
def test_its_error_is_near_the_limit(
    changes: dict[str, Any], bandwidth: float, margin: float, ceiling: float, over: float
) -> None:
    chosen = {"controller.loop_bandwidth": bandwidth, "controller.delay_margin": margin}
    error, used = measured({**changes, **chosen})
    limit = fg.limit.tracking(PAPER.replace({"controller.force_limit": 1000.0, **changes}), ceiling)["rmse_steady"]
    assert used < ceiling
    assert float(np.sqrt((limit**2).mean())) * 0.97 < error < over * float(np.sqrt((limit**2).mean()))


def test_the_margin_decides_whether_a_hidden_step_is_borne() -> None:
    late = {**FULL, "device.delay": 1, "datasheet.delay": 0}
    robust, _ = measured(late)
    known, _ = measured(FULL)
    assert known < robust < 2.2 * known
    exact, _ = measured({**late, "controller.delay_margin": 0.0})
    assert exact > 100.0 * known


# Without noise of the sensors a fast loop is so exact that the late feedforward of `lqg` shows, and from noisy
# positions its filter follows their noise once it suspects the delay.
@settings(max_examples=8)
@given(
    st.floats(0.3, 1.1),
    st.sampled_from(
        [
            ("lqg", FULL, 2.6),
            ("internal_model", FULL, 2.1),
            ("internal_model", POSITIONS, 1.2),
            ("internal_model", {}, 2.3),
        ]
    ),
)
def test_at_every_bandwidth_a_hidden_step_costs_little(
    bandwidth: float, case: tuple[str, dict[str, Any], float]
) -> None:
    law, sensors, factor = case
    chosen = {**sensors, "controller.kind": law, "controller.loop_bandwidth": bandwidth}
    known, _ = measured(chosen)
    hidden, _ = measured({**chosen, "device.delay": 1, "datasheet.delay": 0})
    assert hidden < factor * known


def test_without_noise_it_has_at_most_the_error_of_nearly_exact_sensors() -> None:
    exact, _ = measured({})
    nearly, _ = measured({"device.position_noise_density": 1e-15, "device.velocity_noise_density": 1e-12})
    assert exact < 1.01 * nearly
