"""The gyroscope without a controller and the closed loop in parts: the samples of `simulate`, bit for bit."""

from __future__ import annotations

import copy
import math
import pickle
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from laws import by_numba

SHORT = fg.Scenario.paper().replace({"run.duration": 1.0})
DEVICE = {
    "device.delay": 2,
    "device.position_noise": 1e-11,
    "device.position_bits": 20,
    "device.position_range": 2e-6,
    "device.actuator_limit": 1e-4,
    "rate.kind": "sine",
    "rate.amplitude": 30.0,
    "rate.frequency": 5e3,
}
SCENARIOS = {
    "paper": SHORT,
    "composite": SHORT.replace({"adaptation.kind": "composite"}),
    "joint": SHORT.replace({"adaptation.kind": "joint", "adaptation.covariance_steps": 2}),
    "pid": SHORT.replace({"controller.kind": "pid"}),
    "device": SHORT.replace(DEVICE),
    "device in SI": SHORT.replace({**DEVICE, "run.units": "SI"}),
    "positions": SHORT.replace({"device.sensing": "position", "run.units": "SI"}),
    "drift": SHORT.replace({"device.stiffness_drift": 100.0, "device.temperature_ramp": 1e5}),
    "electronics": SHORT.replace(
        {
            "device.position_noise": 1e-10,
            "device.position_noise_corner": 2e4,
            "device.pickoff_gain_error": 0.01,
            "device.force_misalignment": 0.01,
            "device.damping_drift": 3e3,
            "device.temperature_ramp": 1e4,
            "device.bias_instability": 3.0,
            "device.rate_random_walk": 200.0,
        }
    ),
}
of_each = pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS.keys())
AT_MOST = SHORT.run.steps + 1


def equal(one: xr.Dataset, other: xr.Dataset) -> None:
    xr.testing.assert_identical(one.drop_attrs(), other.drop_attrs())


# -- Plant


@of_each
def test_the_plant_under_the_forces_of_a_run_moves_as_in_the_run(scenario: fg.Scenario) -> None:
    run = fg.simulate(scenario)
    measured = "measured_position" in run
    position, velocity = (run[f"measured_{name}" if measured else name].values for name in ("position", "velocity"))
    plant = fg.Plant(scenario)
    control = run["control"].values
    for n, force in enumerate(control):
        motion = plant.motion if n == 0 else plant.step(control[n - 1])
        assert motion == plant.motion or math.isnan(motion.velocity[0])
        assert motion.time == run["time"].values[n]
        np.testing.assert_allclose(motion.position, position[n], rtol=1e-15 if scenario.run.units == "SI" else 0)
        if scenario.device.sensing == "full":
            np.testing.assert_allclose(motion.velocity, velocity[n], rtol=1e-12 if scenario.run.units == "SI" else 0)
        else:
            assert np.isnan(motion.velocity).all()
        if scenario.run.units == "SI" and n > 100:
            break  # forces that were divided by their unit are others in the last place
        assert force.shape == (2,)


def test_the_controller_and_the_plant_make_the_loop() -> None:
    scenario = SHORT.replace(DEVICE)
    run, plant, controller = fg.simulate(scenario), fg.Plant(scenario), fg.Controller(scenario)
    motion, forces = plant.motion, []
    for _ in range(AT_MOST):
        forces.append(controller.step(motion.time, motion.position, motion.velocity))
        motion = plant.step(forces[-1])
    np.testing.assert_array_equal(forces, run["control"].values)


@pytest.mark.parametrize(
    "force",
    [
        (1, 2),
        [1.0, 2.0],
        np.array([1.0, 2.0]),
        np.array([1, 2]),
        np.array([1.0, 9, 2])[::2],
        np.array([[1.0], [2.0]]),
        [[1.0, 2.0]],
    ],
)
def test_any_two_numbers_are_a_force(force: Any) -> None:
    assert fg.Plant(SHORT).step(force) == fg.Plant(SHORT).step((1.0, 2.0))


@pytest.mark.parametrize(
    ("force", "error"),
    [
        ("ab", TypeError),
        (None, TypeError),
        (1.0, TypeError),
        ((1.0,), ValueError),
        ((1.0, math.nan), ValueError),
        (("1", 2.0), TypeError),
        (np.eye(2), ValueError),
        ([[1.0], 2.0], TypeError),
    ],
)
def test_what_is_no_force_is_refused_and_moves_nothing(force: Any, error: type[Exception]) -> None:
    plant = fg.Plant(SHORT)
    before = plant.motion
    with pytest.raises(error, match=r"^force is .*: it must be two finite numbers$"):
        plant.step(force)
    assert plant.motion == before


def test_a_plant_that_has_diverged_goes_on_no_longer() -> None:
    plant = fg.Plant(SHORT)
    plant.step((1e15, 0.0))
    with pytest.raises(ValueError, match=r"^the motion has diverged"):
        plant.step((0.0, 0.0))


# -- Loop


@of_each
def test_a_loop_in_parts_is_the_run(scenario: fg.Scenario) -> None:
    loop, run = fg.Loop(scenario), fg.simulate(scenario)
    parts = [loop.run(1), loop.run(99), loop.run(AT_MOST - 100)]
    equal(xr.concat(parts, "time"), run)
    assert loop.time == pytest.approx(
        AT_MOST * SHORT.run.step * (scenario.plant.scales.time if parts[0].units == "SI" else 1)
    )


def pd(s: fg.Sample) -> tuple[float, float]:
    (x, y), (vx, vy), (rx, ry), (rvx, rvy) = s.position, s.velocity, s.reference, s.reference_velocity
    return -1600 * (x - rx) - 56 * (vx - rvx), -1600 * (y - ry) - 56 * (vy - rvy)


@pytest.mark.parametrize("changes", [{}, DEVICE], ids=["ideal", "device"])
def test_a_loop_takes_a_controller_from_outside(changes: dict[str, Any]) -> None:
    scenario = SHORT.replace(changes)
    loop = fg.Loop(scenario, pd)
    equal(xr.concat([loop.run(10), loop.run(AT_MOST - 10)], "time"), fg.simulate(scenario, pd))
    with pytest.raises(ValueError, match=r"^a loop with a Python callable cannot be saved"):
        _ = loop.state


def test_a_step_is_one_sample() -> None:
    loop, run = fg.Loop(SHORT), fg.simulate(SHORT)
    for n in range(3):
        sample = loop.step()
        assert sample["time"] == run["time"].values[n]
        np.testing.assert_array_equal(sample["control"], run["control"].values[n])
        assert sample["rate_estimate"] == run["rate_estimate"].values[n]


@of_each
def test_a_saved_state_resumes_bit_for_bit(scenario: fg.Scenario) -> None:
    loop = fg.Loop(scenario)
    loop.run(300)
    loop.set({"plant.angular_rate": 60.0})
    saved = loop.state
    expected = loop.run(200)
    loop.set({"plant.angular_rate": 80.0})
    loop.state = saved
    equal(loop.run(200), expected)
    other = fg.Loop(scenario)
    other.state = saved
    equal(other.run(200), expected)
    assert other.scenario.plant.angular_rate == 60.0


def test_the_state_of_a_law_is_saved_with_it() -> None:
    def law(given: Any, state: Any, p: Any, out: Any) -> None:
        for i in range(2):
            state[i] += given[1 + i] - given[5 + i]
            out[i] = -p[0] * state[i]

    of = fg.native.Law(by_numba(law), 2, {"ki": 1.0})
    loop = fg.Loop(SHORT, of)
    loop.run(100)
    saved = loop.state
    expected = loop.run(100)
    other = fg.Loop(SHORT, of)
    other.state = saved
    equal(other.run(100), expected)
    with pytest.raises(ValueError, match=r"another scenario or controller$"):
        fg.Loop(SHORT, of.replace({"ki": 2.0})).state = saved


def test_no_other_state_is_taken() -> None:
    loop = fg.Loop(SHORT)
    loop.run(5)
    saved = loop.state
    for bad in (saved[:-1], saved[:-1] + bytes([saved[-1] ^ 1]), saved[: saved.index(b"\n") + 1], saved + b"x"):
        with pytest.raises(ValueError, match=r"^state is damaged: it is not as it was saved$"):
            loop.state = bad
    with pytest.raises(ValueError, match=r"^state was saved by another version, or by a loop of another scenario"):
        fg.Loop(SHORT.replace({"controller.order": 0.8})).state = saved
    number: Any = 3
    with pytest.raises(TypeError, match=r"^state is 3: it must be bytes"):
        loop.state = number
    assert loop.state == saved


def test_what_is_set_acts_from_the_next_sample_on() -> None:
    loop, plain = fg.Loop(SHORT), fg.simulate(SHORT)
    equal(loop.run(100), plain.isel(time=slice(100)))
    loop.set(
        {"plant.angular_rate": 50.0, "controller.fractional_gain": [12.0, 12.0], "reference.amplitude": [0.9, 0.9]}
    )
    changed = loop.run(100)
    at = plain.isel(time=slice(100, 200))
    assert (changed["reference"].values == 0.9 * at["reference"].values).all()
    assert changed["rate_estimate"].values[0] == at["rate_estimate"].values[0], "estimates stay"
    assert not changed["control"].equals(at["control"])
    np.testing.assert_array_equal(changed["position"].values[0], at["position"].values[0])
    assert loop.scenario.plant.angular_rate == 50.0
    back = fg.Loop(SHORT)
    back.run(100)
    back.set({"plant.angular_rate": 50.0})
    back.set({"plant.angular_rate": SHORT.plant.angular_rate})
    equal(back.run(100), at)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"reference.frequency": [1.0, 1.0]},
            "^reference.frequency cannot be set while the loop runs: it acts only at the",
        ),
        ({"run.initial_position": [0.0, 0.0]}, "^run.initial_position cannot be set while the loop runs"),
        ({"run.step": 2e-3}, "^run.step cannot be set while the loop runs"),
        ({"disturbance.seed": 3}, "^disturbance.seed cannot be set while the loop runs"),
        ({"controller.kind": "linear"}, "^controller.kind cannot be set while the loop runs"),
        (
            {"controller.order": 0.8},
            "^controller.order cannot be set while the loop runs: the controller would be another",
        ),
        ({"adaptation.kind": "composite"}, "^adaptation.kind cannot be set while the loop runs: the controller would"),
        ({"controller.fractional_gain": -1.0}, "^controller.fractional_gain"),
        ({"controller.nothing": 1.0}, "^controller.nothing"),
    ],
)
def test_what_cannot_be_set_is_refused_and_changes_nothing(changes: dict[str, Any], sentence: str) -> None:
    loop = fg.Loop(SHORT)
    loop.run(50)
    with pytest.raises(fg.ScenarioError, match=sentence):
        loop.set(changes)
    assert loop.scenario == SHORT
    equal(loop.run(50), fg.simulate(SHORT).isel(time=slice(50, 100)))


def test_a_loop_that_diverges_says_so_with_its_samples() -> None:
    scenario = SHORT.replace({"run.step": 0.05, "run.duration": 100.0, "disturbance.hold": None})
    with pytest.raises(fg.DivergedError) as whole:
        fg.simulate(scenario)
    loop = fg.Loop(scenario)
    with pytest.raises(fg.DivergedError) as raised:
        loop.run(2001)
    equal(raised.value.run, whole.value.run)
    assert str(raised.value) == str(whole.value)


@pytest.mark.parametrize(
    ("samples", "error", "sentence"),
    [
        (0, ValueError, "^samples is 0: it must be at least 1$"),
        (1.5, TypeError, "^samples is 1.5: it must be an integer$"),
        (10**9, ValueError, r"^samples is 1000000000: their record of \d+ GB may be at most 2 GB$"),
    ],
)
def test_so_many_samples_are_refused(samples: Any, error: type[Exception], sentence: str) -> None:
    with pytest.raises(error, match=sentence):
        fg.Loop(SHORT).run(samples)


# -- Copies, and several callers

COPIES = [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))]
by_copy = pytest.mark.parametrize("copied", COPIES, ids=["copy", "deepcopy", "pickle"])


@of_each
@by_copy
def test_a_copy_of_a_plant_goes_on_by_itself(copied: Callable[[fg.Plant], fg.Plant], scenario: fg.Scenario) -> None:
    plant = fg.Plant(scenario)
    force = 1e-4 * np.array([1.0, -2.0]) if scenario.run.units == "SI" else np.array([100.0, -200.0])
    for _ in range(20):
        plant.step(force)
    other = copied(plant)
    np.testing.assert_array_equal(other.motion[1:], plant.motion[1:])  # NaN where the velocity is not sensed
    ahead = [plant.step(-force)[1:] for _ in range(20)]
    np.testing.assert_array_equal([other.step(-force)[1:] for _ in range(20)], ahead)
    assert other.motion.time == plant.motion.time


@of_each
@by_copy
def test_a_copy_of_a_loop_goes_on_by_itself(copied: Callable[[fg.Loop], fg.Loop], scenario: fg.Scenario) -> None:
    loop = fg.Loop(scenario)
    loop.run(50)
    loop.set({"plant.angular_rate": 50.0})
    other = copied(loop)
    assert other.scenario == loop.scenario
    equal(other.run(50), loop.run(50))


def test_a_loop_with_a_law_is_copied_and_one_with_a_callable_is_not() -> None:
    def law(given: Any, state: Any, parameters: Any, found: Any) -> None:
        state[0] += given[1] - given[5]
        found[0], found[1] = -parameters[0] * state[0], 0.0

    loop = fg.Loop(SHORT, fg.native.Law(by_numba(law), 1, {"ki": 1.0}))
    loop.run(50)
    equal(copy.deepcopy(loop).run(50), loop.run(50))
    with pytest.raises(TypeError, match=r"^a Law cannot be pickled"):
        pickle.dumps(loop)
    with pytest.raises(ValueError, match=r"^a loop with a Python callable cannot be saved or copied"):
        copy.deepcopy(fg.Loop(SHORT, pd))


def test_a_damaged_state_of_a_plant_is_refused() -> None:
    plant = fg.Plant(SHORT)
    remake, (scenario, own, state, units) = plant.__reduce__()
    assert remake(scenario, own, state, units).motion == plant.motion
    for damaged in (b"", state[:-1], state[:99] + bytes([state[99] ^ 1]) + state[100:]):
        with pytest.raises(ValueError, match=r"^state is damaged"):
            remake(scenario, own, damaged, units)


def test_a_loop_that_its_own_controller_runs_or_sets_says_so_once() -> None:
    loops: list[fg.Loop] = []
    for use in (lambda loop: loop.run(1), lambda loop: loop.set({"plant.angular_rate": 1.0})):

        def controller(s: fg.Sample, use: Callable[[fg.Loop], Any] = use) -> tuple[float, float]:
            use(loops[-1])
            return pd(s)

        loop = fg.Loop(SHORT, controller)
        loops.append(loop)
        with pytest.raises(fg.ControllerError) as said:
            loop.run(3)
        assert str(said.value) == (
            "the controller raised ValueError: the loop is running: its controller or another thread cannot run "
            "or change it at t = 0"
        )


def test_a_callable_in_a_loop_is_tuned_while_it_runs() -> None:
    class Gain:
        size = 1.0

        def __call__(self, s: fg.Sample) -> tuple[float, float]:
            return self.size, 0.0

    controller = Gain()
    loop = fg.Loop(SHORT, controller)
    loop.run(5)
    controller.size = 2.0
    assert loop.run(1)["control"].values[0, 0] == 2.0


def in_threads(task: Callable[[], None]) -> None:
    """Four at once, which take turns as often as Python lets them."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            for future in [pool.submit(task) for _ in range(4)]:
                future.result()
    finally:
        sys.setswitchinterval(interval)


def test_a_controller_in_several_threads_gives_a_force_or_says_why_not() -> None:
    controller = fg.Controller(SHORT)
    found: list[Any] = []
    refused: list[str] = []

    def step() -> None:
        for _ in range(5000):
            try:  # integers take the slower way, on which another thread may come first
                found.append(controller.step(controller.time, (1, 0), (0, 0)))
            except ValueError as error:
                refused.append(str(error))

    in_threads(step)
    assert all(sentence.startswith("time is ") for sentence in refused)
    assert all(isinstance(force, np.ndarray) for force in found)
    assert len(found) == round(controller.time / SHORT.run.step)


def test_a_step_that_another_thread_took_first_is_refused() -> None:
    controller = fg.Controller(SHORT)

    class Late:  # another thread steps while this one looks at its arguments
        def __len__(self) -> int:
            return 2

        def __getitem__(self, place: int) -> float:
            if controller.time == 0.0:
                controller.step(0.0, (0.5, 0.5), (0.0, 0.0))
            return [0.5, 0.5][place]

    Sequence.register(Late)
    with pytest.raises(ValueError, match=r"^time is 0.0: the next step is at 0.001, and steps must be consecutive"):
        controller.step(0.0, Late(), (0.0, 0.0))  # type: ignore[arg-type]


def test_a_loop_in_several_threads_runs_in_one_of_them() -> None:
    loop, refused = fg.Loop(SHORT, pd), []
    times: list[float] = []

    def run() -> None:
        for _ in range(20):
            try:
                times.extend(loop.run(3)["time"].values)
            except ValueError as error:
                refused.append(str(error))

    in_threads(run)
    assert all(sentence.startswith("the loop is running") for sentence in refused)
    np.testing.assert_allclose(np.sort(times), SHORT.run.step * np.arange(len(times)), atol=1e-12)
