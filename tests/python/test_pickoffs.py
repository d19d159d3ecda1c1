"""Known pick-offs: measurements are brought back to the axes of the plant before any controller."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import ScenarioError
from fracgyro.export.targets import answers
from law_oracles import Pid

GAINS, ANGLE = (0.01, -0.02), 0.03
DEVICE = {"device.pickoff_gain_error": GAINS, "device.pickoff_misalignment": ANGLE}
KNOWN = {"datasheet.pickoff_gain_error": GAINS, "datasheet.pickoff_misalignment": ANGLE}
PID = fg.Scenario.paper().replace(
    {"controller.kind": "pid", "controller.natural_frequency": 200.0, "controller.force_limit": 1000.0}
)
SHORT = PID.replace({"run.duration": 1.0})
SENSING: dict[str, dict[str, Any]] = {
    "velocity measured": {},
    "observer": {"device.sensing": "position"},
    "filter": {"controller.filter": "kalman", "datasheet.position_noise": 1e-4, "datasheet.velocity_noise": 1e-2},
    "trigger": {"controller.event_threshold": 5.0, "device.sensing": "position"},
}


def corrected(motion: np.ndarray) -> np.ndarray:
    """In the axes of the plant: gains first, then the turn."""
    x, y = motion[0] / (1 + GAINS[0]), motion[1] / (1 + GAINS[1])
    return np.array([x * math.cos(ANGLE) - y * math.sin(ANGLE), x * math.sin(ANGLE) + y * math.cos(ANGLE)])


class Correcting:
    """PID that corrects what it measures itself."""

    def __init__(self) -> None:
        self.law = Pid()

    def reset(self, scenario: fg.Scenario) -> None:
        self.law.reset(scenario)

    def __call__(self, sample: Any) -> Any:
        names = ("time", "reference", "reference_velocity", "reference_acceleration")
        motion = {name: corrected(getattr(sample, name)) for name in ("position", "velocity")}
        return self.law(SimpleNamespace(**motion, **{name: getattr(sample, name) for name in names}))


def test_it_is_its_transcription() -> None:
    noise = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
    scenario = SHORT.replace({**DEVICE, **noise})
    found, expected = fg.simulate(scenario.replace(KNOWN)), fg.simulate(scenario, Correcting())
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-7)
    assert np.abs(fg.simulate(scenario)["control"].values - expected["control"].values).max() > 1.0


@pytest.mark.parametrize(
    ("kind", "sensing"),
    [(kind, each) for kind in ("pid", "fractional_fast_terminal") for each in SENSING]
    + [("lqg", "velocity measured"), ("lqg", "observer")],
)
def test_a_controller_that_knows_its_pick_offs_has_those_of_an_ideal_device(kind: str, sensing: str) -> None:
    changes = {"controller.kind": kind, "run.duration": 0.4, **SENSING[sensing]}
    base = fg.Scenario.paper().replace(changes)
    ideal, known, unknown = (
        fg.simulate(base.replace(more))["position"].values for more in ({}, {**DEVICE, **KNOWN}, DEVICE)
    )
    assert np.abs(known - ideal).max() < 1e-9
    assert np.abs(unknown - ideal).max() > 1e-4


def test_metrics_of_many_runs_are_those_of_an_ideal_device() -> None:
    base = fg.Scenario.paper().replace({"run.duration": 0.4})
    scenarios = [base, base.replace({**DEVICE, **KNOWN}), base.replace(KNOWN)]
    errors = fg.measure_many(scenarios, transient=0.1)["rmse"].values
    np.testing.assert_allclose(errors[1], errors[0], rtol=1e-9)
    assert np.abs(errors[2] / errors[0] - 1).max() > 1e-3


@pytest.mark.parametrize("sensing", SENSING)
def test_runs_in_parts_and_alone_are_the_same(sensing: str) -> None:
    scenario = SHORT.replace({**DEVICE, **KNOWN, **SENSING[sensing]})
    run = fg.simulate(scenario)
    loop = fg.Loop(scenario)
    first = loop.run(400)
    saved, other = loop.state, fg.Loop(scenario)
    other.state = saved
    np.testing.assert_array_equal(first["control"], run["control"][:400])
    np.testing.assert_array_equal(other.run(601)["control"], run["control"][400:])
    controller = fg.Controller(scenario)
    positions = scenario.device.sensing == "position"
    for n, (q, v) in enumerate(zip(run["measured_position"].values, run["measured_velocity"].values, strict=True)):
        np.testing.assert_array_equal(controller.step(n * 1e-3, q, None if positions else v), run["control"].values[n])


def test_they_cannot_change_while_the_loop_runs() -> None:
    with pytest.raises(ScenarioError, match=r"^datasheet\.pickoff_misalignment cannot be set while the loop runs"):
        fg.Loop(SHORT).set({"datasheet.pickoff_misalignment": ANGLE})


@pytest.mark.parametrize(
    ("target", "changes"),
    [
        ("host", {"controller.kind": "network"}),
        ("host", {"device.sensing": "position", "controller.event_threshold": 5.0}),
        pytest.param("fmu", {"controller.kind": "lqg"}, marks=pytest.mark.nightly),
        ("fmu", {"controller.filter": "kalman"}),
    ],
)
def test_exports_correct_the_same(target: str, changes: dict[str, Any]) -> None:
    scenario = SHORT.replace({**DEVICE, **KNOWN, **changes, "run.duration": 0.2})
    run = fg.simulate(scenario)
    motion = np.hstack([run["measured_position"].values, run["measured_velocity"].values])
    expected = answers("python", scenario, "double", motion)
    np.testing.assert_array_equal(expected[:, :2], run["control"].values)
    np.testing.assert_array_equal(answers(target, scenario, "double", motion), expected)


@pytest.mark.parametrize(
    ("field", "sentence"),
    [
        ("pickoff_gain_error", r"datasheet\.pickoff_gain_error is \[0\.01, -0\.02\]: it must be \[0\.0, 0\.0\] for "),
        ("pickoff_misalignment", r"datasheet\.pickoff_misalignment is 0\.03: it must be 0\.0 for this target"),
    ],
)
def test_a_target_without_it_refuses_in_one_sentence(field: str, sentence: str) -> None:
    path = f"datasheet.{field}"
    with pytest.raises(ScenarioError, match=sentence):
        answers("lanes", SHORT.replace({path: KNOWN[path]}), "double", np.zeros((3, 4)))


def test_a_gain_of_zero_cannot_be_corrected() -> None:
    with pytest.raises(ScenarioError, match=r"^datasheet\.pickoff_gain_error\[1\] is -1\.0: it must be greater than"):
        SHORT.replace({"datasheet.pickoff_gain_error": (0.0, -1.0)})
