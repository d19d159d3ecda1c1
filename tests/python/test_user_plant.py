"""Other plants than the gyroscope: kinds of the scenario, Python callables and C functions."""

from __future__ import annotations

import copy
import ctypes
import math
import pickle
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro.export.compilers import system_compiler
from fracgyro.interop.matrices import matrices
from fracgyro.scenario.kinds import KINDS, PLANT_KINDS
from scipy.linalg import expm

PAPER = fg.Scenario.paper()
SHORT = PAPER.replace({"run.duration": 0.5})
Numbers = Sequence[float]


class Linear:
    """The equations of the linear gyroscope, nondimensional, in plain Python."""

    def __init__(self, scenario: fg.Scenario) -> None:
        damping, stiffness, self.rate, _, _ = scenario.plant.nondimensional()
        self.numbers = [*damping.tolist(), *stiffness.tolist()]

    def __call__(self, time: float, state: Numbers, force: Numbers) -> list[float]:
        x, y, vx, vy = state
        dxx, dxy, dyy, kxx, kxy, kyy = self.numbers
        ax = force[0] - dxx * vx - dxy * vy - kxx * x - kxy * y + 2 * self.rate * vy
        ay = force[1] - dxy * vx - dyy * vy - kxy * x - kyy * y - 2 * self.rate * vx
        return [vx, vy, ax, ay]


def resonance(time: float, state: Numbers, force: Numbers) -> tuple[float, ...]:
    """A resonator in its own form: 2 states."""
    return state[1], force[0] - 100.0 * state[0]


class Lagging:
    """The gyroscope behind actuators that lag: 6 states, of which the first two are the forces."""

    initial_state = (0.0, 0.0, 0.5, 0.5, 0.0, 0.0)

    def __init__(self, lag: float) -> None:
        self.lag, self.gyroscope = lag, Linear(PAPER)

    def __call__(self, time: float, state: Numbers, force: Numbers) -> list[float]:
        acting = state[:2]
        change = [(u - a) / self.lag for u, a in zip(force, acting, strict=True)]
        return [*change, *self.gyroscope(time, state[2:], acting)]

    def motion(self, state: Numbers) -> Numbers:
        return state[2:]


class Turning:
    """A gyroscope that takes the angular rate."""

    takes_rate = True

    def __init__(self) -> None:
        self.rates: list[float] = []
        self.still = Linear(PAPER.replace({"plant.angular_rate": 0.0}))

    def __call__(self, time: float, state: Numbers, force: Numbers, rate: float) -> list[float]:
        self.rates.append(rate)
        vx, vy, ax, ay = self.still(time, state, force)
        return [vx, vy, ax + 2 * rate * vy, ay - 2 * rate * vx]


IN_C = """
void turning(const double* in, const double* s, const double* p, double* out) {
    out[0] = s[2];
    out[1] = s[3];
    out[2] = in[1] - p[0] * s[2] - p[1] * s[3] - p[3] * s[0] - p[4] * s[1] + 2.0 * in[3] * s[3];
    out[3] = in[2] - p[1] * s[2] - p[2] * s[3] - p[4] * s[0] - p[5] * s[1] - 2.0 * in[3] * s[2];
}
void beyond(const double* in, const double* s, const double* p, double* out) {
    out[0] = out[1] = 0.0;
    out[3] = s[0];
}
void late(const double* in, const double* s, const double* p, double* out) {
    for (int i = 0; i < 6; ++i) out[i] = in[0] < 0.25 ? s[i] : 0.0 / p[0];
}
void nothing(const double* in, const double* s, const double* p, double* out) {
    out[0] = in[0] < 0.25 ? 0.0 : 0.0 / p[0];
    out[1] = 0.0;
}
"""


STEP_IN_C = """
void stepped(const double* in, const double* s, const double* p, double* out) {
    const double h = in[6];
    double k1[4], k2[4], k3[4], k4[4], at[4];
    const double middle[4] = {in[0] + 0.5 * h, in[1], in[2], in[4]}, end[4] = {in[0] + h, in[1], in[2], in[5]};
    turning(in, s, p, k1);
    for (int i = 0; i < 4; ++i) at[i] = s[i] + 0.5 * h * k1[i];
    turning(middle, at, p, k2);
    for (int i = 0; i < 4; ++i) at[i] = s[i] + 0.5 * h * k2[i];
    turning(middle, at, p, k3);
    for (int i = 0; i < 4; ++i) at[i] = s[i] + h * k3[i];
    turning(end, at, p, k4);
    for (int i = 0; i < 4; ++i) out[i] = s[i] + h / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i]));
}
void behind(const double* in, const double* s, const double* p, double* out) {
    stepped(in, s + 1, p, out + 1);  /* behind a state that counts the steps */
    out[0] = s[0] + 1.0;
}
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder: Path = tmp_path_factory.mktemp("plant")
    (folder / "plant.c").write_text(IN_C + STEP_IN_C, encoding="utf-8")
    options = ["-x", "c", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
    system_compiler(*options, folder / "plant.c", "-o", folder / "plant.so")
    return ctypes.CDLL(str(folder / "plant.so"))


def native(compiled: ctypes.CDLL, scenario: fg.Scenario = PAPER, **instead: Any) -> fg.native.Plant:
    damping, stiffness, _, _, _ = scenario.plant.nondimensional()
    names = [f"{matrix}{part}" for matrix in "dk" for part in ("xx", "xy", "yy")]
    values = dict(zip(names, [*damping, *stiffness], strict=True))
    function = {} if "step" in instead else {"derivative": compiled.turning}
    return fg.native.Plant(parameters=values, takes_rate=True, **function, **instead)


def difference(one: xr.Dataset, other: xr.Dataset, name: str = "position") -> float:
    assert one.sizes == other.sizes
    return float(np.abs(one[name].values - other[name].values).max())


def refused(message: str, run: Callable[[], object], kind: type[Exception] = ValueError) -> None:
    with pytest.raises(kind, match=f"^{re.escape(message)}$"):
        run()


# -- A callable with the equations of the gyroscope


@pytest.mark.parametrize("kind", KINDS)
def test_a_plant_like_the_gyroscope_runs_like_it_with_every_controller(kind: str) -> None:
    scenario = SHORT.replace({"controller.kind": kind, "device.sensing": "position", "disturbance.seed": 3})
    run = fg.simulate(scenario, plant=Linear(scenario))
    assert 0 < difference(run, fg.simulate(scenario)) < 1e-4
    assert run.attrs["plant"] == "Linear"
    assert np.isfinite(run["control"].values).all()


def test_errors_of_a_run_shrink_with_the_fourth_power_of_the_step() -> None:
    def error(step: float) -> float:
        scenario = PAPER.replace({"run.step": step, "disturbance.kind": "none", "run.duration": 1.0})
        plants = fg.Plant(scenario), fg.Plant(scenario, Linear(scenario))
        for _ in range(scenario.run.steps):
            motions = [plant.step((0.0, 0.0)) for plant in plants]
        return math.dist(motions[0].position, motions[1].position)

    assert error(4e-3) / error(2e-3) == pytest.approx(16, rel=0.1)
    assert error(2e-3) / error(1e-3) == pytest.approx(16, rel=0.1)


def test_units_are_those_of_the_run() -> None:
    si = SHORT.replace({"run.units": "SI"})
    scales = PAPER.plant.scales
    plain = Linear(PAPER)

    def derivative(time: float, state: Numbers, force: Numbers) -> list[float]:
        assert 0 <= time < 0.502 * scales.time
        x, y, vx, vy = state
        own = [x / scales.length, y / scales.length, vx / scales.velocity, vy / scales.velocity]
        units = [scales.velocity] * 2 + [scales.acceleration] * 2
        found = plain(time, own, [u / scales.force for u in force])
        return [rate * unit for rate, unit in zip(found, units, strict=True)]

    run, other = fg.simulate(si, plant=derivative), fg.simulate(SHORT, plant=plain)
    np.testing.assert_allclose(run["position"].values, other["position"].values * scales.length, rtol=0, atol=1e-12)
    assert run["position"].attrs["units"] == "m"


def test_a_controller_and_a_plant_of_ones_own_run_together() -> None:
    def spring(sample: fg.Sample) -> tuple[float, float]:
        return -400 * (sample.position[0] - sample.reference[0]), -400 * (sample.position[1] - sample.reference[1])

    run = fg.simulate(SHORT, controller=spring, plant=Linear(PAPER))
    assert difference(run, fg.simulate(SHORT, controller=spring)) < 1e-6
    assert (run.attrs["controller"], run.attrs["plant"]) != ("", "")


# -- States


def test_a_plant_has_states_of_its_own() -> None:
    lag = 1e-2
    run, ideal = fg.simulate(SHORT, plant=Lagging(lag)), fg.simulate(SHORT)
    assert difference(run, ideal) > 1e-4
    assert difference(fg.simulate(SHORT, plant=Lagging(1e-3)), ideal) < difference(run, ideal)


def test_a_plant_may_have_two_states() -> None:
    class Single:
        initial_state = np.array([0.25, 0.0])
        __call__ = staticmethod(resonance)

        def motion(self, state: Numbers) -> tuple[float, ...]:
            return state[0], 0.0, state[1], 0.0

    quiet = SHORT.replace({"disturbance.kind": "none"})
    run = fg.simulate(quiet, controller=lambda sample: (0.0, 5.0), plant=Single())
    times = run["time"].values
    np.testing.assert_allclose(run["position"].sel(axis="x").values, 0.25 * np.cos(10 * times), rtol=0, atol=1e-8)
    assert not run["position"].sel(axis="y").values.any()


@pytest.mark.parametrize(
    "returned", [np.zeros(4), [0, 0, 0, 0], (0.0,) * 4, np.zeros((4, 1)), [np.float64(0)] * 4, np.zeros(4, dtype="f4")]
)
def test_a_derivative_is_four_numbers_in_any_form(returned: Any) -> None:
    run = fg.simulate(SHORT, controller=lambda sample: (1.0, 1.0), plant=lambda time, state, force: returned)
    assert (run["position"].values == 0.5).all()


# -- Rate and device


def test_a_dynamic_rate_acts_on_a_plant_that_takes_it() -> None:
    moving = SHORT.replace({"rate.kind": "sine", "rate.amplitude": 500.0, "rate.frequency": 4000.0})
    plant = Turning()
    run = fg.simulate(moving, plant=plant)
    assert difference(run, fg.simulate(moving)) < 1e-4
    assert difference(run, fg.simulate(SHORT), "velocity") > 1e-2
    middle = 0.1 + 0.5 * math.sin(4.0 * 0.0005)
    assert plant.rates[:2] == pytest.approx([0.1, middle], abs=1e-9)
    assert np.array_equal(run["angular_rate"].values, fg.simulate(moving)["angular_rate"].values)


def test_sensors_and_actuators_stay_those_of_the_scenario() -> None:
    noisy = SHORT.replace(
        {
            "device.position_noise": 1e-10,
            "device.delay": 1,
            "device.actuator_bits": 14,
            "device.actuator_limit": 2e-5,
            "controller.force_limit": 100.0,
        }
    )
    run, other = fg.simulate(noisy, plant=Linear(PAPER)), fg.simulate(noisy)
    assert difference(run, other, "applied_control") < 0.1
    assert difference(run, other) < 1e-4
    assert (run["measured_position"].values != run["position"].values).any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"rate.kind": "step", "rate.amplitude": 1.0},
            'rate.kind is "step": it must be constant with a user\'s plant, which takes no angular rate',
        ),
        (
            {"device.bias_instability": 1e-3},
            "device.bias_instability is 0.001: it must be 0.0 with a user's plant, which takes no angular rate",
        ),
        (
            {"device.cubic_stiffness": (1e12, 0.0)},
            "device.cubic_stiffness is [1000000000000.0, 0.0]: it must be [0.0, 0.0] with a user's plant, which has "
            "its own springs",
        ),
    ],
)
def test_what_needs_the_gyroscope_is_refused(changes: dict[str, Any], message: str) -> None:
    refused(message, lambda: fg.simulate(SHORT.replace(changes), plant=Linear(PAPER)), fg.ScenarioError)


# -- Bad plants


def test_an_exception_of_the_plant_is_reported_with_its_time() -> None:
    def fails(time: float, state: Numbers, force: Numbers) -> Numbers:
        return [1 / (0.25 - time), 0.0, 0.0, 0.0]

    with pytest.raises(fg.PlantError, match=r"^the plant raised ZeroDivisionError: .* at t = 0\.25$") as caught:
        fg.simulate(SHORT, plant=fails)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ([0.0] * 3, "the plant returned [0.0, 0.0, 0.0] at t = 0: it must return 4 finite numbers"),
        (None, "the plant returned None at t = 0: it must return 4 finite numbers"),
        ("four", "the plant returned 'four' at t = 0: it must return 4 finite numbers"),
        ([0.0, 0.0, math.nan, 0.0], "the plant returned [0, 0, nan, 0] at t = 0: it must return 4 finite numbers"),
    ],
)
def test_a_derivative_that_is_not_four_finite_numbers_is_refused(returned: Any, message: str) -> None:
    refused(message, lambda: fg.simulate(SHORT, plant=lambda time, state, force: returned))
    refused(message, lambda: fg.measure_many([SHORT], plant=lambda time, state, force: returned))
    refused(message, lambda: fg.Plant(SHORT, lambda time, state, force: returned).step((0.0, 0.0)))


def test_a_plant_that_is_none_is_refused() -> None:
    sentence = (
        ": it must be a native.Plant, or a callable that takes the time, the state and the force (ux, uy) and returns "
        "the derivative of the state"
    )
    number: Any = 3
    refused("plant is 3" + sentence, lambda: fg.simulate(SHORT, plant=number), TypeError)
    refused("plant is a class, not an instance" + sentence, lambda: fg.simulate(SHORT, plant=Lagging), TypeError)
    plant: Any = Lagging(1.0)
    plant.initial_state = (0.0,)
    refused(
        "initial_state of the plant is (0.0,): it must have 2 to 8 numbers", lambda: fg.simulate(SHORT, plant=plant)
    )
    plant.initial_state = (0.0,) * 5 + (math.nan,)
    refused("initial_state of the plant is nan: it must be a finite number", lambda: fg.simulate(SHORT, plant=plant))


def test_states_need_a_motion() -> None:
    class Silent:
        initial_state = (0.0,) * 5

        def __call__(self, time: float, state: Numbers, force: Numbers) -> Numbers:
            return state

    refused(
        "initial_state of the plant has 5 numbers: it must have the 4 states x, y, vx, vy, or the plant a method "
        "motion(state), which returns them",
        lambda: fg.simulate(SHORT, plant=Silent()),
    )


def test_a_plant_that_explodes_diverges_like_the_Linear() -> None:
    def explodes(time: float, state: Numbers, force: Numbers) -> Numbers:
        return [state[0] * abs(state[0]) ** 3 * 1e3, 0.0, 0.0, 0.0]

    with pytest.raises(fg.DivergedError, match="too large for explodes") as caught:
        fg.simulate(SHORT, plant=explodes)
    assert 1 <= caught.value.run.sizes["time"] < 501
    many = fg.simulate_many([SHORT], seeds=range(2), plant=explodes)
    assert np.isfinite(many["diverged_at"].values).all()


# -- Many runs, loops in parts


def test_many_runs_with_a_plant_are_its_single_runs(compiled: ctypes.CDLL) -> None:
    for plant in (Linear(PAPER), native(compiled)):
        many = fg.simulate_many([SHORT, SHORT.replace({"controller.order": 0.8})], seeds=range(3), plant=plant)
        one = fg.simulate(SHORT.replace({"controller.order": 0.8, "disturbance.seed": 1}), plant=plant)
        assert np.array_equal(many["position"].values[4], one["position"].values)
        measured = fg.measure_many([SHORT], seeds=range(3), plant=plant, transient=0.1)
        wanted = fg.metrics.summary(many.isel(run=slice(0, 3)), transient=0.1)["rmse"]
        np.testing.assert_allclose(measured["rmse"], wanted.transpose(*measured["rmse"].dims), rtol=1e-9)


def test_single_precision_is_refused() -> None:
    message = "single_precision is True: it must be False with a plant, which runs in double precision"
    refused(message, lambda: fg.measure_many([SHORT], plant=Linear(PAPER), single_precision=True))


@pytest.mark.parametrize("of", ["python", "native", "duffing"])
def test_a_loop_in_parts_is_the_whole_run(of: str, compiled: ctypes.CDLL) -> None:
    scenario = SHORT.replace({"plant.kind": "duffing"}) if of == "duffing" else SHORT
    plants: dict[str, Any] = {"python": Lagging(1e-2), "native": native(compiled), "duffing": None}
    plant = plants[of]
    loop = fg.Loop(scenario, plant=plant)
    first = loop.run(200)
    state = loop.state
    rest = loop.run(301)
    whole = fg.simulate(scenario, plant=plant)
    parts = xr.concat([first, rest], "time")
    assert np.array_equal(parts["position"].values, whole["position"].values)
    again = fg.Loop(scenario, plant=plant)
    again.state = state
    assert again.run(301).equals(rest)
    refused(
        "state was saved by another version, or by a loop of another scenario or controller",
        lambda: setattr(
            fg.Loop(scenario, plant=fg.native.Plant(compiled.nothing, 2, motion=(0, None, 1, None))), "state", state
        ),
    )


def test_a_plant_by_itself_is_that_of_the_run_and_can_be_copied() -> None:
    quiet = SHORT.replace({"disturbance.kind": "none"})
    plant = fg.Plant(quiet, Lagging(1e-2))
    for _ in range(10):
        plant.step((30.0, -20.0))
    twin, third = copy.deepcopy(plant), pickle.loads(pickle.dumps(plant))
    run = fg.simulate(quiet, controller=lambda sample: (30.0, -20.0), plant=Lagging(1e-2))
    assert plant.motion.position == tuple(run["position"].values[10])
    assert plant.step((1.0, 2.0)) == twin.step((1.0, 2.0)) == third.step((1.0, 2.0))


# -- C functions


def test_a_native_plant_runs_like_the_Linear(compiled: ctypes.CDLL) -> None:
    run = fg.simulate(SHORT, plant=native(compiled))
    assert difference(run, fg.simulate(SHORT)) < 1e-4
    assert difference(run, fg.simulate(SHORT, plant=Linear(PAPER))) < 1e-9


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"run.units": "SI"},
        {"controller.kind": "pid"},
        {"rate.kind": "sine", "rate.amplitude": 50.0, "rate.frequency": 3000.0},
        {"device.position_noise": 1e-9},
    ],
)
def test_a_function_of_the_whole_step_has_the_bits_of_the_same_step_of_its_derivative(
    compiled: ctypes.CDLL, changes: dict[str, Any]
) -> None:
    scenario = SHORT.replace(changes)
    of_derivative, of_step = native(compiled, scenario), native(compiled, scenario, step=compiled.stepped)
    run = fg.simulate(scenario, plant=of_step)
    assert np.array_equal(run["position"].values, fg.simulate(scenario, plant=of_derivative)["position"].values)
    start = (0.0, *scenario.run.initial_position, *scenario.run.initial_velocity)
    if scenario.run.units != "SI":
        more = {"states": 5, "motion": (1, 2, 3, 4), "initial_state": start}
        again = fg.simulate(scenario, plant=native(compiled, scenario, step=compiled.behind, **more))
        assert np.array_equal(run["position"].values, again["position"].values)
    rows = [
        fg.measure_many([scenario], plant=plant, transient=0.1)["rmse"].values for plant in (of_derivative, of_step)
    ]
    assert np.array_equal(*rows)


def test_a_recorded_run_has_the_bits_of_any_other_loop(compiled: ctypes.CDLL) -> None:
    """Runs of the paper's controllers with a plant have a loop of their own."""
    for kind in KINDS[:5]:
        scenario = SHORT.replace({"controller.kind": kind, "run.record_every": 7})
        for plant in (native(compiled), None):
            of = scenario if plant else scenario.replace({"plant.kind": "duffing"})
            run, loop = fg.simulate(of, plant=plant), fg.Loop(of, plant=plant).run(501)
            assert np.array_equal(run["position"].values, loop["position"].values[::7])
            assert set(run) == set(loop)


def test_a_native_plant_with_errors_is_refused(compiled: ctypes.CDLL) -> None:
    single: dict[str, Any] = {"states": 2, "motion": (0, None, 1, None)}
    refused(
        "the plant wrote to out[3], which is beyond its 2 numbers",
        lambda: fg.simulate(SHORT, plant=fg.native.Plant(compiled.beyond, **single)),
    )
    refused(
        "the plant returned [nan, 0] at t = 0.25: it must return 2 finite numbers; it reads NaN beyond its 2 states "
        "and 0 parameters",
        lambda: fg.simulate(SHORT, plant=fg.native.Plant(compiled.nothing, **single)),
    )
    six: dict[str, Any] = {"states": 6, "initial_state": (0.0,) * 6}
    refused(
        "the plant returned [nan, nan, nan, nan, nan, nan] at t = 0.25: it must return 6 finite numbers; it reads NaN "
        "beyond its 6 states and 0 parameters",
        lambda: fg.simulate(SHORT, plant=fg.native.Plant(step=compiled.late, **six)),
    )
    refused(
        "the plant wrote to out[5], which is beyond its 4 numbers",
        lambda: fg.simulate(SHORT, plant=fg.native.Plant(step=compiled.late, parameters={"one": 1.0})),
    )
    one_of = "derivative or step must be given, as a C function: "
    refused(one_of + "neither is", fg.native.Plant, TypeError)
    both: dict[str, Any] = {"derivative": compiled.turning, "step": compiled.stepped}
    refused(one_of + "both are", lambda: fg.native.Plant(**both), TypeError)
    refused("states is 9: it must be an integer from 2 to 8", lambda: fg.native.Plant(compiled.turning, 9))
    refused(
        "motion is (0, 1, 2): it must be the places of x, y, vx and vy, each from 0 to 3 or None",
        lambda: fg.native.Plant(compiled.turning, motion=(0, 1, 2)),
    )
    refused(
        "initial_state is (0.0,): it must have 4 numbers, as states",
        lambda: fg.native.Plant(compiled.turning, initial_state=(0.0,)),
    )


# -- Kinds of the scenario


def test_duffing_without_cubic_springs_is_the_gyroscope_and_with_them_as_its_equations() -> None:
    duffing = SHORT.replace({"plant.kind": "duffing"})
    assert difference(fg.simulate(duffing), fg.simulate(SHORT)) < 1e-4
    unit = PAPER.plant.scales.of("m*omega0^2/q0^2")
    stiff = duffing.replace({"plant.cubic_stiffness": (40.0 * unit, 30.0 * unit), "plant.cubic_coupling": 20.0 * unit})
    linear = Linear(PAPER)

    def springs(time: float, state: Numbers, force: Numbers) -> list[float]:
        x, y = state[:2]
        pulled = force[0] - 40 * x**3 - 20 * x * y * y, force[1] - 30 * y**3 - 20 * x * x * y
        return linear(time, state, pulled)

    run = fg.simulate(stiff)
    assert difference(run, fg.simulate(SHORT, plant=springs)) < 1e-9
    assert difference(run, fg.simulate(duffing)) > 1e-4


def test_duffing_on_one_axis_is_the_gyroscope_with_the_devices_cubic_stiffness() -> None:
    kappa = 40.0 * PAPER.plant.scales.of("m*omega0^2/q0^2")
    one = SHORT.replace({"plant.kind": "duffing", "plant.cubic_stiffness": (kappa, kappa)})
    other = SHORT.replace({"device.cubic_stiffness": (kappa, kappa)})
    assert difference(fg.simulate(one), fg.simulate(other)) < 1e-4


GENERAL: dict[str, Any] = {
    "plant.kind": "general",
    "plant.mass_ratio": 1.3,
    "plant.damping_asymmetry": -2e-6,
    "plant.stiffness_asymmetry": 20.0,
}


def test_the_general_plant_without_its_own_numbers_is_the_gyroscope() -> None:
    run = fg.simulate(SHORT.replace({"plant.kind": "general"}))
    assert run.drop_attrs().equals(fg.simulate(SHORT).drop_attrs())


def test_the_general_plant_moves_by_its_equation() -> None:
    scenario = SHORT.replace({**GENERAL, "disturbance.kind": "none", "run.units": "SI"})
    p = scenario.plant
    masses = np.diag([p.mass, 1.3 * p.mass])
    stiffness = np.array([[p.stiffness.xx, p.stiffness.xy], [p.stiffness.xy + 20.0, p.stiffness.yy]])
    damping = np.array([[p.damping.xx, p.damping.xy], [p.damping.xy - 2e-6, p.damping.yy]])
    damping += 2.0 * p.mass * p.angular_rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    a = np.zeros((6, 6))
    a[:2, 2:4] = np.eye(2)
    a[2:4] = np.linalg.solve(masses, np.hstack([-stiffness, -damping, np.eye(2)]))
    moves = expm(a * scenario.run.step * p.scales.time)[:4]
    run = fg.simulate(scenario)
    states = np.hstack([run["position"].values, run["velocity"].values])
    expected = np.hstack([states, run["control"].values])[:-1] @ moves.T
    for part in (slice(0, 2), slice(2, 4)):  # positions, velocities
        size = np.abs(states[:, part]).max()
        np.testing.assert_allclose(states[1:, part], expected[:, part], rtol=0, atol=1e-11 * size)


def test_the_general_plant_may_be_unstable_but_its_numbers_are_finite() -> None:
    free, quiet = (lambda sample: (0.0, 0.0)), {"disturbance.kind": "none", "run.duration": 2.0}
    whirling = PAPER.replace({**quiet, "plant.kind": "general", "plant.stiffness_asymmetry": -60.0})
    amplitude = np.abs(fg.simulate(whirling, controller=free)["position"].values).max(axis=1)
    assert amplitude[-500:].max() > 10.0 * amplitude[:500].max()
    for name, value in (("mass_ratio", 0.0), ("stiffness_asymmetry", math.inf), ("damping_asymmetry", math.nan)):
        with pytest.raises(fg.ScenarioError, match=rf"^plant\.{name} is .*: it must be "):
            PAPER.replace({"plant.kind": "general", f"plant.{name}": value})


def test_the_resonator_moves_on_x_only() -> None:
    run = fg.simulate(SHORT.replace({"plant.kind": "resonator"}))
    assert not run["position"].sel(axis="y").values.any()
    alone = {f"plant.{matrix}.xy": 0.0 for matrix in ("damping", "stiffness")} | {"plant.angular_rate": 0.0}
    free, quiet = (lambda sample: (0.0, 0.0)), {**alone, "disturbance.kind": "none"}
    one = fg.simulate(SHORT.replace({**quiet, "plant.kind": "resonator"}), controller=free)
    other = fg.simulate(SHORT.replace(quiet), controller=free)
    np.testing.assert_allclose(one["position"].values[:, 0], other["position"].values[:, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", PLANT_KINDS)
def test_a_scenario_with_a_kind_of_plant_is_read_back_and_measured(kind: str) -> None:
    scenario = SHORT.replace({"plant.kind": kind})
    assert fg.Scenario.from_toml(scenario.to_toml()) == scenario
    plant = scenario.to_toml().partition("\n[plant]\n")[2].partition("\n[")[0]
    assert ("cubic_coupling" in plant) == (kind == "duffing")
    assert scenario.replace({"plant.kind": "gyroscope"}) == SHORT
    run, measured = fg.simulate(scenario), fg.measure_many([scenario], transient=0.1)
    wanted = fg.metrics.summary(run, transient=0.1)
    np.testing.assert_allclose(measured["rmse"].values[0], wanted["rmse"].values, rtol=1e-6)
    plant = fg.Plant(scenario)
    for control in run["control"].values[:20]:
        motion = plant.step(control)
    assert motion.position == tuple(run["position"].values[20])


def test_fields_of_other_kinds_are_refused() -> None:
    refused(
        'plant.cubic_coupling is 1.0: it needs plant.kind = "duffing", but plant.kind is "gyroscope"',
        lambda: PAPER.replace({"plant.cubic_coupling": 1.0}),
        fg.ScenarioError,
    )
    refused(
        'rate.kind is "step": it must be constant with plant.kind resonator, which takes no angular rate',
        lambda: PAPER.replace({"plant.kind": "resonator", "rate.kind": "step", "rate.amplitude": 1.0}),
        fg.ScenarioError,
    )
    moving = {"plant.kind": "duffing", "rate.kind": "step", "rate.amplitude": 1.0}
    assert np.isfinite(fg.simulate(SHORT.replace(moving))["position"].values).all()
    refused(
        'plant.centrifugal is true: it must be false with plant.kind duffing when rate.kind is "step"',
        lambda: PAPER.replace({**moving, "plant.centrifugal": True}),
        fg.ScenarioError,
    )


def test_a_loop_takes_other_cubic_springs_while_it_runs() -> None:
    loop = fg.Loop(SHORT.replace({"plant.kind": "duffing"}))
    loop.run(10)
    loop.set({"plant.cubic_coupling": 1e13})
    loop.run(10)
    refused(
        "plant.kind cannot be set while the loop runs: it acts only at the start",
        lambda: loop.set({"plant.kind": "gyroscope"}),
        fg.ScenarioError,
    )


def test_only_the_gyroscope_is_exported_or_linear(tmp_path: Path) -> None:
    duffing = SHORT.replace({"plant.kind": "duffing"})
    message = "plant.kind is duffing: it must be gyroscope, the only plant that is exported"
    refused(message, lambda: fg.export.firmware(duffing, tmp_path / "firmware", unbounded=True), fg.ScenarioError)
    assert not (tmp_path / "firmware").exists()
    message = "plant.kind is duffing: it must be gyroscope, the only plant with matrices"
    refused(message, lambda: matrices(duffing, sampled=True), fg.ScenarioError)
    a, b, c, d = matrices(PAPER, sampled=True)
    plant = fg.Plant(PAPER.replace({"disturbance.kind": "none", "run.initial_velocity": (2.0, 1.0)}))
    state = np.array([0.5, 0.5, 2.0, 1.0])
    motion = plant.step((3.0, -4.0))
    found = a @ state + b @ [3.0, -4.0]
    np.testing.assert_allclose(c @ found + d @ [3.0, -4.0], [*motion.position, *motion.velocity], rtol=1e-14)


# -- Constraints


def test_constraints_are_the_limits_of_a_scenario() -> None:
    free = PAPER.constraints()
    assert (free.force, free.position, free.velocity) == (math.inf, (math.inf,) * 2, (math.inf,) * 2)
    changes: dict[str, Any] = {
        "controller.force_limit": 50.0,
        "device.position_range": (2e-6, 3e-6),
        "device.actuator_limit": 20 * PAPER.plant.scales.force,
        "rate.kind": "staircase",
        "rate.amplitude": -300.0,
        "rate.levels": 2,
        "rate.hold": 1e-3,
    }
    limited = PAPER.replace(changes)
    found = limited.constraints()
    assert (found.force, *found.position) == pytest.approx((20, 2, 3))
    assert found.angular_rate == pytest.approx(0.5)
    si = limited.replace({"run.units": "SI"}).constraints()
    assert (si.force, *si.position) == pytest.approx((20 * PAPER.plant.scales.force, 2e-6, 3e-6))
    assert si.angular_rate == 500.0
    assert PAPER.replace({"controller.force_limit": 5.0}).constraints().force == 5.0
