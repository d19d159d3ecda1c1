"""Systems of python-control and scipy.signal compute the same as the core."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from scipy import signal
from test_extras import without

ct = pytest.importorskip("control", reason="python-control, which the extra interop brings, is not installed")

PAPER = fg.Scenario.paper().replace({"disturbance.kind": "none"})
DEVIATING = PAPER.replace(
    {"plant.damping_deviation.xy": 2e-9, "plant.stiffness_deviation.xx": 3.0, "plant.angular_rate": 500.0}
)
REALISTIC = fg.Scenario.shipped("dual_mass")
scenarios = pytest.mark.parametrize("scenario", [PAPER, DEVIATING, REALISTIC], ids=["paper", "deviating", "dual_mass"])


def samples(system: Any, count: int) -> np.ndarray:
    return system.dt * np.arange(count)


@scenarios
def test_the_sampled_gyroscope_moves_as_the_core_moves_it(scenario: fg.Scenario) -> None:
    ideal = fg.Scenario.model_validate({"plant": scenario.plant, "disturbance": {"kind": "none"}})
    ideal = ideal.replace({"run.step": scenario.run.step})
    forces = np.random.default_rng(0).normal(size=(2, 200))
    plant = fg.Plant(ideal)
    expected = [plant.motion, *(plant.step(force) for force in forces.T)][:-1]
    system = fg.interop.control.plant(scenario)
    response = ct.input_output_response(system, samples(system, 200), forces, [0.5, 0.5, 0.0, 0.0])
    measured = np.array([[*motion.position, *motion.velocity] for motion in expected])
    np.testing.assert_allclose(response.outputs.T, measured, rtol=0, atol=1e-11)


@scenarios
def test_the_continuous_gyroscope_becomes_the_sampled_one_by_a_zero_order_hold(scenario: fg.Scenario) -> None:
    continuous, sampled = (fg.interop.control.plant(scenario, sampled=each) for each in (False, True))
    assert (continuous.dt, sampled.dt) == (0, scenario.run.step)
    held = ct.c2d(continuous, scenario.run.step)
    for name in "ABCD":
        np.testing.assert_allclose(getattr(sampled, name), getattr(held, name), rtol=1e-11, atol=1e-13)


def test_the_units_of_a_run_change_no_system() -> None:
    si = PAPER.replace({"run.units": "SI"})
    np.testing.assert_array_equal(fg.interop.control.plant(si).A, fg.interop.control.plant(PAPER).A)
    systems = [fg.interop.control.controller(each) for each in (si, PAPER)]
    forces = [system.output(0.0, np.zeros(system.nstates), [0.5, 0.5, 0.0, 0.0]) for system in systems]
    np.testing.assert_array_equal(*forces)


@pytest.mark.parametrize("kind", ["fractional_fast_terminal", "pid", "lqg"])
def test_the_loop_agrees_with_a_run_over_5000_steps(kind: str) -> None:
    scenario = PAPER.replace({"controller.kind": kind, "run.duration": 5.0})
    run = fg.simulate(scenario)
    system, start = fg.interop.control.loop(scenario)
    response = ct.input_output_response(system, samples(system, 5001), 0, start)
    assert response.output_labels == ["x", "y", "vx", "vy", "u_x", "u_y"]
    np.testing.assert_allclose(response.outputs[:2].T, run["position"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(response.outputs[4:].T, run["control"], rtol=0, atol=1e-7)


@pytest.mark.parametrize(("connected", "expected"), [(False, 1), (True, 2)])
def test_a_sample_of_the_loop_costs_one_step_of_the_controller(
    connected: bool, expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = []
    step, scenario = fg.Controller.step, PAPER.replace({"run.duration": 0.1})
    monkeypatch.setattr(fg.Controller, "step", lambda *args: steps.append(1) or step(*args))
    system, start = fg.interop.control.loop(scenario)
    if connected:
        parts = [fg.interop.control.plant(scenario), fg.interop.control.controller(scenario)]
        system = ct.interconnect(parts, inplist=["plant.u_x", "plant.u_y"], outputs=["x", "y"])
    moved = ct.input_output_response(system, samples(system, 100), 0, start).outputs[:2]
    assert expected * 100 <= len(steps) <= expected * 100 + 4
    np.testing.assert_allclose(moved.T, fg.simulate(scenario)["position"][:100], rtol=0, atol=1e-12)


def test_the_controller_gives_the_forces_of_fg_controller_bit_for_bit_from_a_state_that_was_stored() -> None:
    motions = np.random.default_rng(0).normal(0.5, 1e-3, size=(30, 4))
    expected = fg.Controller(PAPER)
    system = fg.interop.control.controller(PAPER)
    state = np.zeros(system.nstates)
    for i, motion in enumerate(motions):
        force = expected.step(1e-3 * i, motion[:2], motion[2:])
        np.testing.assert_array_equal(system.output(0.0, state, motion), force)
        others = system.output(0.0, state, -motion)  # evaluated in between: it changes nothing
        assert not np.array_equal(others, force)
        following = system.dynamics(0.0, state, motion)
        state = 0.0 + 1.0 * following  # arithmetic may copy it
    assert state.max() < 2**32
    assert np.isfinite(state).all()


def test_a_step_is_computed_once_for_each_input(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []
    step = fg.Controller.step
    monkeypatch.setattr(fg.Controller, "step", lambda self, *given: taken.append(given) or step(self, *given))
    system, start = fg.interop.control.loop(PAPER)
    ct.input_output_response(system, samples(system, 10), 0, start)
    assert len(taken) <= 2 * 10  # python-control evaluates with inputs of 0 before it evaluates with those of the plant


def test_a_state_that_was_computed_with_is_refused() -> None:
    system = fg.interop.control.controller(PAPER)
    for wrong in (0.5, -1.0, 2.0**32, np.nan):
        with pytest.raises(ValueError, match="the state is invalid"):
            system.output(0.0, np.full(system.nstates, wrong), np.zeros(4))


def test_a_disturbance_enters_as_a_force() -> None:
    system, start = fg.interop.control.loop(PAPER)
    responses = [ct.input_output_response(system, samples(system, 2), [[d, d], [0.0, 0.0]], start) for d in (0.0, 1.0)]
    moved = responses[1].outputs[:4, 1] - responses[0].outputs[:4, 1]
    np.testing.assert_allclose(moved, fg.interop.control.plant(PAPER).B[:, 0], rtol=0, atol=1e-15)


def test_a_variable_of_a_run_is_a_response() -> None:
    runs = fg.simulate_many([PAPER.replace({"run.duration": 1.0})] * 2)
    run = runs.isel(run=0)
    error = fg.interop.control.response(run, "error")
    assert error.output_labels == ["error_x", "error_y"]
    np.testing.assert_array_equal(error.outputs, run["error"].values.T)
    np.testing.assert_array_equal(error.time, run["time"])
    rate = fg.interop.control.response(run, "rate_estimate")
    np.testing.assert_array_equal(rate.outputs, [run["rate_estimate"]])
    with pytest.raises(ValueError, match="variable is 'eror': it must be one of position, velocity"):
        fg.interop.control.response(run, "eror")
    with pytest.raises(ValueError, match="the Dataset has several runs: select one"):
        fg.interop.control.response(runs, "error")


def test_scipy_has_the_same_gyroscope() -> None:
    sampled = fg.interop.scipy.plant(PAPER)
    assert isinstance(sampled, signal.dlti)
    assert sampled.dt == 1e-3
    np.testing.assert_array_equal(sampled.A, fg.interop.control.plant(PAPER).A)
    continuous = fg.interop.scipy.plant(PAPER, sampled=False)
    assert isinstance(continuous, signal.lti)
    np.testing.assert_array_equal(continuous.A, fg.interop.control.plant(PAPER, sampled=False).A)


def test_what_is_not_a_scenario_is_refused() -> None:
    made = fg.interop.control
    for make in (made.plant, made.controller, made.loop, fg.interop.scipy.plant):
        with pytest.raises(TypeError, match="scenario is 'paper': it must be a Scenario"):
            make("paper")


def test_every_public_name_is_described() -> None:
    assert fg.interop.__all__ == ["control", "gymnasium", "scipy"]
    assert all(getattr(fg.interop, name).__doc__ for name in fg.interop.__all__)


@pytest.mark.parametrize("module", ["control", "gymnasium", "scipy"])
def test_a_missing_library_is_named_with_its_extra(module: str, tmp_path: Path) -> None:
    code = f"import fracgyro as fg\ntry: fg.interop.{module}\nexcept ImportError as error: print(error)"
    said = without([module], code, tmp_path)
    assert said.stdout == (
        f"{module} is not installed: install the extra interop; in your clone, pip install '.[interop]'\n"
    ), said.stderr
