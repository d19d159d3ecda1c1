"""The disturbance observer around any controller: its transcription, what it finds, where it runs, refusals."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import ScenarioError
from fracgyro.export.targets import answers
from law_oracles import Pid, nominal
from scipy.linalg import expm

NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
BANDWIDTH = {"controller.compensation_bandwidth": 80.0}
PD = fg.Scenario.paper().replace(
    {
        "controller.kind": "pid",
        "controller.natural_frequency": 200.0,
        "controller.integral_frequency": 0.0,
        "controller.force_limit": 1000.0,
        "run.duration": 2.0,
    }
)
PUSHED = {"disturbance.kind": "step", "disturbance.standard_deviation": None, "disturbance.amplitude": [20.0, -10.0]}


class Compensated:
    """PID less the force that the nominal plant lacks, in states q, v: v of the exact step against that measured."""

    def __init__(self, bandwidth: float) -> None:
        self.law, self.bandwidth = Pid(), bandwidth

    def reset(self, scenario: fg.Scenario) -> None:
        self.law.reset(scenario)
        c, h = scenario.controller, scenario.run.step
        damping, coriolis, stiffness = nominal(scenario)
        a = np.zeros((6, 6))
        a[:2, 2:4] = a[2:4, 4:] = np.eye(2)
        a[2:4, :4] = -np.hstack([stiffness, damping + coriolis])
        self.map = expm(a * h)[2:4]
        self.gain = -np.expm1(-self.bandwidth * h) / h
        self.limit = c.force_limit
        self.found = np.zeros(2)
        self.expected: np.ndarray | None = None

    def __call__(self, sample: Any) -> np.ndarray:
        q, v = np.asarray(sample.position), np.asarray(sample.velocity)
        if self.expected is not None:
            self.found = self.found + self.gain * (v - self.expected)
        force = np.clip(np.asarray(self.law(sample)) - self.found, -self.limit, self.limit)
        self.expected = self.map @ np.hstack([q, v, force + self.found])
        return force


@pytest.mark.parametrize(
    "changes", [{}, NOISE, {**PUSHED, "controller.force_limit": 150.0}], ids=["", "noise", "limit"]
)
def test_it_is_its_transcription(changes: dict[str, Any]) -> None:
    plain = PD.replace(changes)
    found, expected = fg.simulate(plain.replace(BANDWIDTH)), fg.simulate(plain, Compensated(80.0))
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-6)


def test_a_lasting_force_leaves_no_error_and_is_what_is_taken_off() -> None:
    quiet = PD.replace({**PUSHED, "reference.amplitude": [0.0, 0.0], "run.initial_position": [0.0, 0.0]})
    ends = [
        fg.simulate(quiet.replace({"controller.compensation_bandwidth": bandwidth}))["error"].values[-1]
        for bandwidth in (0.0, 80.0)
    ]
    np.testing.assert_allclose(ends[0], np.array([20.0, -10.0]) / 200.0**2, rtol=0.05)  # over the spring of the law
    assert np.abs(ends[1]).max() < 1e-6 * np.abs(ends[0]).max()


def test_a_hidden_step_of_delay_hardly_changes_the_error() -> None:
    def error(delay: int) -> float:
        scenario = PD.replace({**BANDWIDTH, **NOISE, "run.duration": 5.0, "device.delay": delay})
        return float(np.sqrt((fg.simulate(scenario)["error"].values[2500:] ** 2).mean()))

    assert error(1) < 1.5 * error(0)


def test_its_bandwidth_0_is_todays_run_bit_for_bit() -> None:
    scenario = PD.replace(NOISE)
    run = fg.simulate(scenario.replace({"controller.compensation_bandwidth": 0.0}))
    np.testing.assert_array_equal(run["control"], fg.simulate(scenario)["control"])


def test_the_rate_is_a_part_of_what_it_takes_off() -> None:
    """The laws (44) then learn the nominal plant."""

    def last(bandwidth: float) -> float:
        changes = {"controller.kind": "linear", "run.duration": 20.0, "controller.compensation_bandwidth": bandwidth}
        run = fg.simulate(fg.Scenario.paper().replace(changes))
        return float(run["rate_estimate"].values[-5000:].mean())

    true = float(fg.Scenario.paper().plant.angular_rate / fg.Scenario.paper().plant.scales.rate)
    ratio = fg.Scenario.paper().adaptation.initial_ratio
    assert abs(last(40.0) - ratio * true) < abs(last(40.0) - true)
    assert abs(last(0.0) - true) < abs(last(0.0) - ratio * true)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"controller.kind": "linear", "adaptation.kind": "composite"}, r"adaptation\.kind composite"),
        ({"controller.kind": "linear", "adaptation.kind": "joint"}, r"adaptation\.kind joint"),
        ({"controller.kind": "lqg"}, r"controller\.kind lqg"),
        ({"controller.kind": "least_squares_pid"}, r"controller\.kind least_squares_pid"),
    ],
)
def test_a_law_that_would_trust_the_nominal_plant_refuses_it(changes: dict[str, Any], words: str) -> None:
    scenario = fg.Scenario.paper().replace(changes)
    with pytest.raises(ScenarioError, match=rf"^controller\.compensation_bandwidth is 80\.0: for {words}, which would"):
        scenario.replace(BANDWIDTH)


@pytest.mark.parametrize("sensing", [{}, {"device.sensing": "position"}, {"controller.filter": "kalman"}])
def test_runs_in_parts_and_alone_are_the_same(sensing: dict[str, Any]) -> None:
    scenario = PD.replace({**BANDWIDTH, **NOISE, **sensing, "run.duration": 1.0})
    run = fg.simulate(scenario)
    loop = fg.Loop(scenario)
    first = loop.run(400)
    saved, other = loop.state, fg.Loop(scenario)
    other.state = saved
    np.testing.assert_array_equal(first["control"], run["control"][:400])
    np.testing.assert_array_equal(other.run(601)["control"], run["control"][400:])
    controller = fg.Controller(scenario)
    positions = "device.sensing" in sensing
    for n, (q, v) in enumerate(zip(run["measured_position"].values, run["measured_velocity"].values, strict=True)):
        np.testing.assert_array_equal(controller.step(n * 1e-3, q, None if positions else v), run["control"].values[n])


@pytest.mark.parametrize(
    ("target", "kind", "more"),
    [
        ("host", "network", {"controller.event_threshold": 5.0}),
        ("host", "dynamic", {"device.sensing": "position"}),
        ("fmu", "linear", {"device.sensing": "position", "controller.filter": "kalman"}),
        ("wasm", "pid", {}),
    ],
)
def test_exports_have_the_same_forces(target: str, kind: str, more: dict[str, Any]) -> None:
    changes = {"controller.kind": kind, **BANDWIDTH, **NOISE, "run.duration": 0.2, **more}
    scenario = PD.replace(changes)
    run = fg.simulate(scenario)
    motion = np.hstack([run["measured_position"].values, run["measured_velocity"].values])
    expected = answers("python", scenario, "double", motion)
    plain = answers("python", scenario.replace({"controller.compensation_bandwidth": 0.0}), "double", motion)
    assert np.abs(expected - plain).max() > 1e-3
    np.testing.assert_array_equal(answers(target, scenario, "double", motion), expected)


def test_a_law_of_the_user_has_it_too() -> None:
    def still(sample: fg.Sample) -> tuple[float, float]:
        return 0.0, 0.0

    run = fg.simulate(PD.replace({**BANDWIDTH, **PUSHED, "run.initial_position": [0.0, 0.0]}), still)
    np.testing.assert_allclose(run["control"].values[-1], [-20.0, 10.0], rtol=0.02)


def test_a_target_without_it_refuses_in_one_sentence() -> None:
    expected = (
        r"^controller\.compensation_bandwidth is 80\.0: it must be 0\.0 for this target, which has no disturbance"
    )
    with pytest.raises(ScenarioError, match=expected):
        answers("lanes", PD.replace(BANDWIDTH), "double", np.zeros((3, 4)))


def test_that_there_is_one_cannot_change_while_the_loop_runs() -> None:
    loop = fg.Loop(PD.replace(BANDWIDTH))
    with pytest.raises(ScenarioError, match=r"^controller\.compensation_bandwidth cannot be set while the loop runs"):
        loop.set({"controller.compensation_bandwidth": 0.0})
