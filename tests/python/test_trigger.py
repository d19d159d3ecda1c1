"""The event trigger behind any controller: its rule, what it saves, where it runs, refusals."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import ScenarioError
from fracgyro.export.targets import answers
from law_oracles import Pid

NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
PID = fg.Scenario.paper().replace(
    {"controller.kind": "pid", "controller.natural_frequency": 200.0, "controller.force_limit": 1000.0}
)
SHORT = PID.replace({"run.duration": 2.0})
CASES: dict[str, dict[str, Any]] = {
    "threshold": {"controller.event_threshold": 10.0},
    "share": {"controller.event_share": 0.05},
    "both, in noise": {"controller.event_threshold": 5.0, "controller.event_share": 0.05, **NOISE},
}


class Sent:
    """PID whose force is sent by the rule; it also counts."""

    def __init__(self) -> None:
        self.law, self.sends = Pid(), 0

    def reset(self, scenario: fg.Scenario) -> None:
        self.law.reset(scenario)
        self.threshold, self.share = scenario.controller.event_threshold, scenario.controller.event_share
        self.force = np.zeros(2)

    def __call__(self, sample: Any) -> np.ndarray:
        wanted = np.asarray(self.law(sample))
        if np.any(np.abs(wanted - self.force) >= self.threshold + self.share * np.abs(self.force)):
            self.force, self.sends = wanted, self.sends + 1
        return self.force


def sent(run: Any) -> float:
    """Share of the steps with a new force."""
    return float(np.any(np.diff(run["control"].values, axis=0) != 0.0, axis=1).mean())


@pytest.mark.parametrize("name", CASES)
def test_it_is_its_transcription(name: str) -> None:
    scenario, law = SHORT.replace(CASES[name]), Sent()
    found, expected = fg.simulate(scenario), fg.simulate(scenario, law)
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-7)
    assert 20 < law.sends < 1900


def test_without_noise_it_saves_most_forces_and_in_noise_hardly_any() -> None:
    def both(threshold: float, noise: dict[str, Any]) -> tuple[float, float]:
        run = fg.simulate(PID.replace({"run.duration": 5.0, "controller.event_threshold": threshold, **noise}))
        return sent(run), float(np.sqrt((run["error"].values[2500:] ** 2).mean()))

    assert both(0.0, {})[0] > 0.98  # the first forces are the limit
    every, exact = both(0.0, {}), both(3.0, {})
    assert exact[0] < 0.4
    assert exact[1] < 1.1 * every[1]
    assert both(3.0, NOISE)[0] > 2.0 * exact[0]


@pytest.mark.parametrize("sensing", [{}, {"device.sensing": "position"}, {"controller.filter": "kalman"}])
def test_runs_in_parts_and_alone_are_the_same(sensing: dict[str, Any]) -> None:
    scenario = SHORT.replace({**CASES["both, in noise"], **sensing, "run.duration": 1.0})
    run = fg.simulate(scenario)
    assert sent(run) < 1.0
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


@pytest.mark.parametrize(("target", "kind"), [("host", "network"), ("fmu", "lqg")])
def test_exports_send_the_same_forces(target: str, kind: str) -> None:
    scenario = SHORT.replace({"controller.kind": kind, **CASES["both, in noise"], "run.duration": 0.2})
    assert scenario.controller.event_share == 0.05
    run = fg.simulate(scenario)
    motion = np.hstack([run["measured_position"].values, run["measured_velocity"].values])
    expected = answers("python", scenario, "double", motion)
    assert sent(run) < 1.0
    np.testing.assert_array_equal(answers(target, scenario, "double", motion), expected)


def test_a_target_without_it_refuses_in_one_sentence() -> None:
    with pytest.raises(ScenarioError, match=r"^controller\.event_share is 0\.05: it must be 0\.0 for this target"):
        answers("lanes", SHORT.replace(CASES["share"]), "double", np.zeros((3, 4)))


def test_that_there_is_one_cannot_change_while_the_loop_runs() -> None:
    loop = fg.Loop(SHORT.replace(CASES["threshold"]))
    with pytest.raises(ScenarioError, match=r"^controller\.event_threshold cannot be set while the loop runs"):
        loop.set({"controller.event_threshold": 0.0})
