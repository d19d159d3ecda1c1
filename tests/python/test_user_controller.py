"""User controllers: Python callables and C functions in the closed loop."""

from __future__ import annotations

import ctypes
import math
import pickle
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro.export.compilers import system_compiler
from laws import by_numba

SHORT = fg.Scenario.paper().replace({"run.duration": 2.0})
KP, KD = 1600.0, 56.0
GAINS = {"kp": KP, "kd": KD}


def pd(s: fg.Sample) -> tuple[float, float]:
    (x, y), (vx, vy), (rx, ry), (rvx, rvy) = s.position, s.velocity, s.reference, s.reference_velocity
    return -KP * (x - rx) - KD * (vx - rvx), -KP * (y - ry) - KD * (vy - rvy)


PD_IN_C = """
void pd(const double* in, double* state, const double* p, double* out) {
    state[0] += 1.0;
    for (int i = 0; i < 2; ++i)
        out[i] = -p[0] * (in[1 + i] - in[5 + i]) - p[1] * (in[3 + i] - in[7 + i]);
    out[2] = state[0];
}
void rate(const double* in, double* state, const double* p, double* out) {
    pd(in, state, p, out);
    out[2] = in[0];
}
void beyond(const double* in, double* state, const double* p, double* out) {
    pd(in, state, p, out);
    state[(int)p[2]] = 1.0;
    out[(int)p[3]] = 1.0;
    ((double*)p)[(int)p[4]] = 1.0;
}
void nothing(const double* in, double* state, const double* p, double* out) {
    out[0] = in[0] < 0.5 ? 0.0 : 0.0 / p[0];
    out[1] = 0.0;
}
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder: Path = tmp_path_factory.mktemp("law")
    (folder / "law.c").write_text(PD_IN_C, encoding="utf-8")
    options = ["-x", "c", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
    system_compiler(*options, folder / "law.c", "-o", folder / "law.so")
    return ctypes.CDLL(str(folder / "law.so"))


def same_run(one: xr.Dataset, other: xr.Dataset) -> None:
    for name in ("position", "velocity", "control", "error"):
        scale = np.abs(other[name].values).max()
        np.testing.assert_allclose(one[name].values, other[name].values, rtol=0, atol=1e-9 * scale)


# -- The same law in every form


def test_a_callable_has_the_samples_of_its_scenario_and_its_force_acts() -> None:
    seen = []

    def law(s: fg.Sample) -> tuple[float, float]:
        seen.append(s)
        return pd(s)

    run = fg.simulate(SHORT, law)
    assert len(seen) == SHORT.run.steps + 1
    for name, of in {"position": "position", "velocity": "velocity", "reference": "reference"}.items():
        np.testing.assert_array_equal([getattr(s, of) for s in seen], run[name].values)
    np.testing.assert_array_equal([s.time for s in seen], run["time"].values)
    np.testing.assert_array_equal([pd(s) for s in seen], run["control"].values)
    frequency = np.array(SHORT.reference.frequency)
    np.testing.assert_allclose([s.reference_acceleration for s in seen], -(frequency**2) * run["reference"].values)
    np.testing.assert_allclose(
        [s.reference_velocity for s in seen], run["velocity"].values - run["error_rate"].values, atol=1e-12
    )
    assert "surface" not in run
    assert run.attrs["controller"] == "law"
    assert repr(seen[0]).startswith("Sample(time=0, position=(0.5, 0.5)")


def test_a_c_function_gives_the_run_of_the_callable(compiled: ctypes.CDLL) -> None:
    expected = fg.simulate(SHORT, pd)
    law = fg.native.Law(compiled.pd, state_size=1, parameters=GAINS, reports=["count"])
    run = fg.simulate(SHORT, law)
    same_run(run, expected)
    np.testing.assert_array_equal(run["count"].values, np.arange(SHORT.run.steps + 1) + 1.0)
    address = ctypes.cast(compiled.pd, ctypes.c_void_p).value
    xr.testing.assert_identical(run, fg.simulate(SHORT, fg.native.Law(address, 1, GAINS, ["count"])))


def test_a_numba_function_gives_the_run_of_the_callable() -> None:
    def law(given: Any, state: Any, p: Any, out: Any) -> None:
        for i in range(2):
            out[i] = -p[0] * (given[1 + i] - given[5 + i]) - p[1] * (given[3 + i] - given[7 + i])

    same_run(fg.simulate(SHORT, fg.native.Law(by_numba(law), parameters=GAINS)), fg.simulate(SHORT, pd))


def test_a_cffi_function_gives_the_run_of_the_callable(compiled: ctypes.CDLL) -> None:
    cffi = pytest.importorskip("cffi", reason="cffi, which the test extra asks for, is not installed")
    ffi = cffi.FFI()
    ffi.cdef("void pd(const double*, double*, const double*, double*);")
    library = ffi.dlopen(compiled._name)
    pointer = ffi.addressof(library, "pd")
    same_run(fg.simulate(SHORT, fg.native.Law(pointer, 1, GAINS, ["count"])), fg.simulate(SHORT, pd))


class Pid:
    """The built-in controller.kind = "pid", from its equation."""

    def reset(self, scenario: fg.Scenario) -> None:
        c = scenario.controller
        self.square = c.natural_frequency**2
        self.velocity_gain = 2 * c.damping_ratio * c.natural_frequency
        self.step = scenario.run.step * c.integral_frequency * self.square
        damping, stiffness, rate, _, _ = scenario.plant.nondimensional()
        ratio = scenario.adaptation.initial_ratio
        self.damping = ratio * np.array([[damping[0], damping[1]], [damping[1], damping[2]]])
        self.damping += 2 * ratio * rate * np.array([[0, -1], [1, 0]])
        self.stiffness = ratio * np.array([[stiffness[0], stiffness[1]], [stiffness[1], stiffness[2]]])
        self.integral = np.zeros(2)

    def __call__(self, s: fg.Sample) -> np.ndarray:
        r, v = np.array(s.reference), np.array(s.reference_velocity)
        e = np.array(s.position) - r
        feedforward = self.damping @ v + self.stiffness @ r + np.array(s.reference_acceleration)
        rate = np.array(s.velocity) - v
        force: np.ndarray = feedforward - self.square * e - self.velocity_gain * rate - self.integral
        self.integral = self.integral + self.step * e
        return force


def test_a_callable_pid_is_the_built_in_one() -> None:
    scenario = SHORT.replace({"controller.kind": "pid"})
    same_run(fg.simulate(scenario, Pid()), fg.simulate(scenario))


def test_many_runs_are_those_one_by_one_and_reset_before_each(compiled: ctypes.CDLL) -> None:
    scenario = SHORT.replace({"controller.kind": "pid"})
    pid, law = Pid(), fg.native.Law(compiled.pd, 1, GAINS, ["count"])
    for controller in (pid, law):
        runs = fg.simulate_many([scenario], seeds=range(3), controller=controller)
        for seed in range(3):
            one = fg.simulate(scenario.replace({"disturbance.seed": seed}), controller)
            np.testing.assert_array_equal(runs["control"].values[seed], one["control"].values)
    assert np.isnan(runs["diverged_at"]).all()


class Counting:
    def __init__(self) -> None:
        self.seeds: list[int] = []

    def reset(self, scenario: fg.Scenario) -> None:
        self.seeds.append(scenario.disturbance.seed)

    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        return pd(s)


def test_reset_is_given_the_scenario_of_each_run() -> None:
    counting = Counting()
    fg.simulate_many([SHORT, SHORT], seeds=[3, 5], controller=counting)
    assert counting.seeds == [3, 5, 3, 5]


# -- Properties of every controller


@pytest.mark.parametrize(
    "changes",
    [
        {"controller.force_limit": 300.0},
        {"disturbance.kind": "sine", "disturbance.amplitude": (3.0, 2.0), "disturbance.frequency": (5.0, 6.0)},
        {"rate.kind": "sine", "rate.amplitude": 50.0, "rate.frequency": 3e3},
        {"device.delay": 1, "device.position_noise": 1e-11, "device.actuator_limit": 1e-4},
        {"device.sensing": "position"},
        {"run.units": "SI", "controller.force_limit": 300.0},
        {"run.record_every": 7},
    ],
    ids=str,
)
def test_limit_disturbance_device_rate_and_units_apply_as_to_the_built_in_pid(changes: dict[str, Any]) -> None:
    scenario = SHORT.replace({"controller.kind": "pid", "controller.integral_frequency": 0.0, **changes})
    mine = Pid() if scenario.run.units != "SI" else InSi(Pid())
    run, expected = fg.simulate(scenario, mine), fg.simulate(scenario)
    assert set(run.data_vars) == set(expected.data_vars)
    for name in expected.data_vars:
        scale = np.abs(expected[name].values).max() or 1.0
        np.testing.assert_allclose(run[name].values, expected[name].values, rtol=0, atol=1e-9 * scale)
        assert run[name].attrs == expected[name].attrs


class InSi:
    """A nondimensional law in SI units."""

    def __init__(self, law: Any) -> None:
        self.law = law

    def reset(self, scenario: fg.Scenario) -> None:
        self.law.reset(scenario)
        self.scales, self.time, self.step = scenario.plant.scales, 0.0, scenario.run.step

    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        scales = self.scales
        assert s.time == pytest.approx(self.time * scales.time)
        self.time += self.step
        force = self.law(
            SimpleNamespace(
                position=np.array(s.position) / scales.length,
                velocity=np.array(s.velocity) / scales.velocity,
                reference=np.array(s.reference) / scales.length,
                reference_velocity=np.array(s.reference_velocity) / scales.velocity,
                reference_acceleration=np.array(s.reference_acceleration) * scales.time / scales.velocity,
            )
        )
        return float(force[0] * scales.force), float(force[1] * scales.force)


def test_an_unstable_law_diverges_as_any_other() -> None:
    with pytest.raises(
        fg.DivergedError,
        match=r"^the run diverged at t = \S+: the gains of \S+ are too large for run.step",
    ) as at:
        fg.simulate(SHORT, lambda s: (1e4 * s.position[0], 1e4 * s.position[1]))
    assert 0 < at.value.run.sizes["time"] < SHORT.run.steps
    runs = fg.simulate_many([SHORT], seeds=[0, 1], controller=lambda s: (1e4 * s.position[0], 0.0))
    assert (runs["diverged_at"] > 0).all()
    assert np.isnan(runs["position"].values[:, -1]).all()


def test_metrics_are_those_of_the_record(compiled: ctypes.CDLL) -> None:
    law = fg.native.Law(compiled.rate, 1, GAINS, ["rate_estimate"])
    for controller in (pd, law):
        many = fg.measure_many([SHORT], seeds=[0], controller=controller, transient=1.0)
        summary = fg.metrics.summary(fg.simulate(SHORT, controller), transient=1.0)
        for name in summary.data_vars:
            np.testing.assert_allclose(many[name].values[0], summary[name].values, rtol=1e-9, err_msg=name)
    assert np.isfinite(many["rate_error_rms"]).all()


# -- Reports


class Sensing(Counting):
    def __init__(self, found: Callable[[float], Any] | None = None) -> None:
        super().__init__()
        self.found = found or (lambda time: {"rate_estimate": 2.0 * time, "found": (time, 1)})

    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        self.time = s.time
        return pd(s)

    def report(self) -> Any:
        return self.found(self.time)


class Unready(Counting):
    def reset(self, scenario: fg.Scenario) -> None:
        raise AttributeError("nothing")


class Resting(Sensing):
    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        self.time = s.time
        return 0.0, 0.0


@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_what_is_reported_becomes_channels_in_the_units_of_the_run(units: str) -> None:
    scenario = SHORT.replace({"run.units": units, "device.delay": 1, "run.record_every": 10, "run.duration": 0.5})
    sensing = Resting()
    run = fg.simulate(scenario, sensing)
    time = run["time"].values
    np.testing.assert_array_equal(run["rate_estimate"].values, 2.0 * time)
    np.testing.assert_array_equal(run["found"].values, np.stack([time, np.ones_like(time)], axis=-1))
    assert run["found"].dims == ("time", "axis")
    assert run["rate_estimate"].attrs["units"] == ("rad/s" if units == "SI" else "1")
    assert {"angular_rate", "applied_control"} <= set(run.data_vars)
    assert fg.metrics.rate_error(run).values == pytest.approx(2.0 * time - run["angular_rate"].values)


def test_a_measurement_sees_the_rate_that_is_reported() -> None:
    many = fg.measure_many([SHORT], controller=Sensing())
    assert many["rate_error"].values[0] == pytest.approx(2.0 * 2.0 - 0.1)


BAD_REPORTS: list[tuple[Callable[[float], Any], str]] = [
    (lambda t: [1.0], r"^report\(\) of the controller returned \[1.0\] at t = 0: it must return a dict of names"),
    (lambda t: {1: 2.0}, r"it must return a dict of names to numbers or pairs of numbers$"),
    (lambda t: {"found": "much"}, r"it must return the same names at every sample"),
    (
        lambda t: {"found": 1.0} if t < 0.1 else {"lost": 1.0},
        r"returned \{'lost': 1.0\} at t = 0.1: it must return the same",
    ),
    (lambda t: {"position": 1.0}, r"^the controller reports position: it must not be the name of another channel"),
    (lambda t: {"damping_estimate": 1.0}, r"^the controller reports damping_estimate: it must not be the name"),
]


@pytest.mark.parametrize(("report", "sentence"), BAD_REPORTS)
def test_a_report_that_is_none_is_refused(report: Callable[[float], Any], sentence: str) -> None:
    sensing = Sensing(report)
    with pytest.raises(ValueError, match=sentence):
        fg.simulate(SHORT, sensing)


# -- Errors


def failing(s: fg.Sample) -> tuple[float, float]:
    if s.time > 0.1:
        raise ZeroDivisionError("nothing is left")
    return 0.0, 0.0


def test_an_exception_ends_the_run_with_its_time_and_as_the_cause() -> None:
    for call in (
        lambda: fg.simulate(SHORT, failing),
        lambda: fg.measure_many([SHORT], controller=failing),
        lambda: fg.Loop(SHORT, failing).run(500),
    ):
        with pytest.raises(fg.ControllerError) as raised:
            call()
        assert str(raised.value) == "the controller raised ZeroDivisionError: nothing is left at t = 0.101"
        assert isinstance(raised.value.__cause__, ZeroDivisionError)
    sensing = Sensing(lambda time: {}["none"])
    with pytest.raises(fg.ControllerError, match=r"^the controller raised KeyError: 'none' at t = 0$"):
        fg.simulate(SHORT, sensing)
    with pytest.raises(fg.ControllerError, match=r"^reset\(scenario\) of the controller raised AttributeError"):
        fg.simulate(SHORT, Unready())


def test_an_interrupt_is_not_taken_for_a_failure() -> None:
    def interrupted(s: fg.Sample) -> tuple[float, float]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fg.simulate(SHORT, interrupted)


RETURNED: list[Any] = [
    None, 1.0, (1.0,), (1.0, 2.0, 3.0), "ab", ("1", "2"), (True, False), (math.nan, 0.0), (0.0, -math.inf), {},
    [[1, 2], 3], (1j, 2j), np.eye(2), np.array([["1"], ["2"]]), np.array([[True], [False]]), np.zeros((2, 0)),
    np.ma.masked_array([[1.0], [2.0]], [[True], [False]]), {1.0, 2.0},
]  # fmt: skip


@pytest.mark.parametrize("returned", RETURNED, ids=str)
def test_anything_but_two_finite_numbers_is_refused_in_one_sentence(returned: Any) -> None:
    with pytest.raises(ValueError, match=r"^the controller returned .* at t = 0: it must return two finite numbers$"):
        fg.simulate(SHORT, lambda s: returned)


FORCES: list[Any] = [
    [1.0, 2.0], (1, 2), np.array([1.0, 2.0]), np.array([1, 2], np.float32), np.array([[1.0], [2.0]]), [[1.0, 2.0]],
    np.array([[1.0, 2.0]]), [np.array([1.0]), np.array([2.0])], (np.float32(1), np.array(2.0)), [[1], [2]],
    np.array([[1.0], [2.0]]).view(np.matrix), xr.DataArray([1.0, 2.0]),
]  # fmt: skip


@pytest.mark.parametrize("returned", FORCES, ids=repr)
def test_any_two_numbers_are_a_force(returned: Any) -> None:
    run = fg.simulate(SHORT.replace({"run.duration": 0.01}), lambda s: returned)
    assert (run["control"].values == [1.0, 2.0]).all()


def test_a_c_function_without_a_finite_force_ends_the_run(compiled: ctypes.CDLL) -> None:
    law = fg.native.Law(compiled.nothing, parameters={"zero": 0.0})
    for call in (
        lambda: fg.simulate(SHORT, law),
        lambda: fg.simulate_many([SHORT], seeds=range(4), controller=law),
        lambda: fg.measure_many([SHORT], seeds=range(4), controller=law),
    ):
        with pytest.raises(
            ValueError, match=r"the controller returned \[.*nan, 0\] at t = 0.5: it must return two finite"
        ):
            call()


TIMES: list[Callable[..., Any]] = [
    lambda law: fg.simulate(SHORT, law),
    lambda law: fg.simulate_many([SHORT], seeds=range(3), controller=law),
    lambda law: fg.measure_many([SHORT], seeds=range(3), controller=law),
    lambda law: fg.Loop(SHORT, law).run(10),
]


@pytest.mark.parametrize("run", TIMES, ids=["simulate", "simulate_many", "measure_many", "Loop"])
def test_a_c_function_that_reads_parameters_or_state_it_was_not_given_reads_nan(
    run: Callable[[Any], Any], compiled: ctypes.CDLL
) -> None:
    sentence = (
        r"^the controller returned \[-?nan, -?nan\] at t = 0: it must return two finite numbers; it reads NaN beyond "
        "its 0 parameters and its state_size of 1$"
    )
    with pytest.raises(ValueError, match=sentence):
        run(fg.native.Law(compiled.pd, 1, reports=["count"]))


@pytest.mark.parametrize("run", TIMES, ids=["simulate", "simulate_many", "measure_many", "Loop"])
@pytest.mark.parametrize(
    ("places", "sentence"),
    [
        ({"state": 1}, r"state\[1\], which is beyond its state_size of 1: state_size must be the number of doubles"),
        ({"state": 40}, r"state\[40\], which is beyond its state_size of 1"),
        ({"out": 3}, r"out\[3\], which is beyond the force and its 1 reports$"),
        ({"parameters": 9}, r"parameters\[9\], which is beyond its 5 parameters$"),
    ],
)
def test_a_c_function_that_writes_beyond_what_it_was_given_is_refused(
    run: Callable[[Any], Any], places: dict[str, int], sentence: str, compiled: ctypes.CDLL
) -> None:
    within = {**GAINS, "state": 0, "out": 2, "parameters": 0}
    run(fg.native.Law(compiled.beyond, 1, within, ["count"]))
    with pytest.raises(ValueError, match=f"^the controller wrote to {sentence}"):
        run(fg.native.Law(compiled.beyond, 1, {**within, **places}, ["count"]))


@pytest.mark.parametrize("controller", [3, "pid", Sensing], ids=str)
def test_what_is_no_controller_is_refused(controller: Any) -> None:
    with pytest.raises(
        TypeError, match=r"^controller is .*: it must be a native.Law, or a callable that takes a Sample"
    ):
        fg.simulate(SHORT, controller)


def test_single_precision_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^single_precision is True: it must be False with a controller"):
        fg.measure_many([SHORT], controller=pd, single_precision=True)


# -- native.Law


def test_a_law_with_other_parameters_is_another_law(compiled: ctypes.CDLL) -> None:
    law = fg.native.Law(compiled.pd, 1, GAINS, ["count"])
    other = law.replace({"kp": 900.0})
    assert law.parameters == GAINS
    assert other.parameters == {"kp": 900.0, "kd": KD}
    assert not fg.simulate(SHORT, other)["control"].equals(fg.simulate(SHORT, law)["control"])
    with pytest.raises(ValueError, match=r"^kq is not a parameter of this law: it has kp, kd$"):
        law.replace({"kq": 1.0})


def _laws() -> Iterator[tuple[Callable[[], Any], type[Exception], str]]:
    yield lambda: fg.native.Law(pd), TypeError, "^function is <function pd.*: it must be the address of a C function"
    yield lambda: fg.native.Law(0), TypeError, "^function is 0: it must be the address"
    yield lambda: fg.native.Law(1, -1), ValueError, "^state_size is -1: it must be from 0 to 1000000$"
    yield lambda: fg.native.Law(1, 1.5), TypeError, "^state_size is 1.5: it must be an integer$"
    yield (
        lambda: fg.native.Law(1, 0, {"kp": math.nan}),
        ValueError,
        "^parameters kp is nan: it must be a finite number$",
    )
    yield (
        lambda: fg.native.Law(1, 0, {}, ["a", "a"]),
        ValueError,
        "^reports is .*: it must be a list of different names$",
    )
    yield (
        lambda: (
            fg.native.Law(1, 0, {}, ["velocity"]).reports and fg.simulate(SHORT, fg.native.Law(1, 0, {}, ["velocity"]))
        ),
        (ValueError),
        "^the controller reports velocity: it must not be the name of another",
    )
    yield lambda: pickle.dumps(fg.native.Law(1)), TypeError, "^a Law cannot be pickled: its function's address"


@pytest.mark.parametrize(("make", "error", "sentence"), list(_laws()))
def test_what_makes_no_law_is_refused(make: Callable[[], Any], error: type[Exception], sentence: str) -> None:
    with pytest.raises(error, match=sentence):
        make()


def test_a_sample_that_is_kept_stays_as_it_was() -> None:
    kept: list[fg.Sample] = []

    def law(s: fg.Sample) -> tuple[float, float]:
        if len(kept) < 2:
            kept.append(s)
        return 0.0, 0.0

    fg.simulate(SHORT.replace({"run.duration": 0.01}), law)
    assert [s.time for s in kept] == [0.0, 0.001]
    with pytest.raises(TypeError):
        fg.Sample()


# -- State of a callable


class Learning:
    """Integral action as its state, without `reset`."""

    def __init__(self) -> None:
        self.sum = np.zeros(2)

    def __call__(self, s: fg.Sample) -> Any:
        self.sum += 0.02 * KP * np.subtract(s.position, s.reference)
        return np.array(pd(s)) - self.sum

    def move(self, s: fg.Sample) -> Any:
        return self(s)


class Uncopied(Learning):
    def __deepcopy__(self, memo: object) -> Any:
        raise TypeError("there is only one of it")


class Ready(Uncopied):
    def reset(self, scenario: fg.Scenario) -> None:
        self.sum = np.zeros(2)


def with_operator() -> Any:
    class Operator:
        def __init__(self) -> None:
            self.each = [
                fg.fractional.pid(KP, 10.0, 0.5, KD, 1.0, step=SHORT.run.step, longest=SHORT.run.duration) for _ in "xy"
            ]

        def __call__(self, s: fg.Sample) -> list[float]:
            return [-pid.step(e) for pid, e in zip(self.each, np.subtract(s.position, s.reference), strict=True)]

    return Operator()


@pytest.mark.parametrize(
    "make",
    [Learning, lambda: Learning().move, Ready, with_operator],
    ids=["an object", "a method", "one with reset", "one with operators"],
)
def test_no_run_begins_with_what_another_has_learned(make: Callable[[], Any]) -> None:
    law = make()
    first, second = fg.simulate(SHORT, law), fg.simulate(SHORT, law)
    np.testing.assert_array_equal(first["control"].values, second["control"].values)
    runs = fg.simulate_many([SHORT, SHORT], controller=law)
    np.testing.assert_array_equal(runs["control"].values, np.stack([first["control"].values] * 2))
    rows = fg.measure_many([SHORT, SHORT], controller=law)["rmse"].values
    np.testing.assert_array_equal(rows[0], rows[1])


def test_a_callable_that_keeps_what_it_learned_and_has_no_copy_runs_only_once() -> None:
    sentence = (
        r"^controller is Uncopied: it can run only once, as it cannot be copied \(TypeError: there is only one of "
        r"it\) and would start a run with the state of the previous one; give it a method reset\(scenario\)"
    )
    fg.simulate(SHORT, Uncopied())
    for call in (fg.simulate_many, fg.measure_many):
        with pytest.raises(ValueError, match=sentence):
            call([SHORT], seeds=range(2), controller=Uncopied())
    counted = 0

    def counting(s: fg.Sample) -> tuple[float, float]:
        nonlocal counted
        counted += 1
        return pd(s)

    fg.simulate(SHORT, counting)
    assert counted == SHORT.run.steps + 1
    with pytest.raises(ValueError, match=r"^controller is .*counting: .* as it is a function that changes variables"):
        fg.measure_many([SHORT], seeds=range(2), controller=counting)


def test_a_run_that_diverges_blames_the_clock_and_the_gains_of_the_controller() -> None:
    si = SHORT.replace({"run.units": "SI"})
    with pytest.raises(fg.DivergedError) as said:
        fg.simulate(si, controller=lambda s: tuple(1e3 * np.array(s.position)))
    assert re.fullmatch(
        r"the run diverged at t = 0\.000\d+ s: the gains of <lambda> are too large for run\.step, which is 1e-06 s, or "
        r'it assumes another sampling time; try run\.step = "5e-07 s" or less, or smaller gains; as run\.units is SI, '
        r"its samples are in m and m/s, and its force is in N",
        str(said.value),
    )


@pytest.mark.parametrize("name", ["", "a/b", " a", "a\n", "."])
def test_a_name_that_no_file_can_have_is_refused(name: str, compiled: ctypes.CDLL) -> None:
    for controller in (Sensing(lambda time: {name: 1.0}), fg.native.Law(compiled.pd, 1, GAINS, [name])):
        with pytest.raises(ValueError, match=r"^the controller reports '.*': a name must be printable, without / or"):
            fg.simulate(SHORT, controller)


# -- Names for the arrays ------------------------------------------------------------------------------------

NAMED = """
#include "fracgyro_law.h"

void named(const double* in, double* state, const double* p, double* out) {
    out[FRACGYRO_FORCE] = -p[0] * (in[FRACGYRO_POSITION] - in[FRACGYRO_REFERENCE]) - p[1] * in[FRACGYRO_VELOCITY];
    out[FRACGYRO_FORCE + 1] = 0.0;
    out[FRACGYRO_REPORTS] = in[FRACGYRO_TIME];
    for (int i = 0; i < 2; ++i) {
        out[FRACGYRO_REPORTS + 1 + i] = in[FRACGYRO_REFERENCE + i];
        out[FRACGYRO_REPORTS + 3 + i] = in[FRACGYRO_REFERENCE_VELOCITY + i];
        out[FRACGYRO_REPORTS + 5 + i] = in[FRACGYRO_REFERENCE_ACCELERATION + i];
        out[FRACGYRO_REPORTS + 7 + i] = in[FRACGYRO_VELOCITY + i];
        out[FRACGYRO_REPORTS + 9 + i] = in[FRACGYRO_POSITION + i];
    }
    (void)state;
}
"""
REPORTED = ["now", "rx", "ry", "rvx", "rvy", "rax", "ray", "vx", "vy", "qx", "qy"]


@pytest.mark.parametrize("language", ["c", "c++"])
def test_the_header_names_the_places_of_a_c_function(tmp_path: Path, language: str) -> None:
    """Also in C99, without a warning; the names are those of what the same sample has in Python."""
    text = NAMED if language == "c" else f'extern "C" {{{NAMED}}}'
    (tmp_path / "named.c").write_text(text, encoding="utf-8")
    strict = ["-std=c99" if language == "c" else "-std=c++20", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    command = ["-x", language, *strict, "-shared", "-fPIC", f"-I{fg.native.INCLUDE}", tmp_path / "named.c"]
    system_compiler(*command, "-o", tmp_path / "named.so")
    function = ctypes.CDLL(str(tmp_path / "named.so")).named
    run = fg.simulate(SHORT, fg.native.Law(function, parameters=GAINS, reports=REPORTED))
    seen: list[list[float]] = []

    def same(s: fg.Sample) -> tuple[float, float]:
        pairs = (s.reference, s.reference_velocity, s.reference_acceleration, s.velocity, s.position)
        seen.append([s.time, *(number for pair in pairs for number in pair)])
        return -KP * (s.position[0] - s.reference[0]) - KD * s.velocity[0], 0.0

    fg.simulate(SHORT, same)
    found = np.array([run[name].values for name in REPORTED]).T
    np.testing.assert_allclose(found[: len(seen)], seen[: len(found)], rtol=1e-9, atol=1e-9)


def test_a_sample_has_its_error() -> None:
    seen: list[fg.Sample] = []
    noisy = SHORT.replace({"run.duration": 0.01, "device.position_noise": 1e-8, "run.units": "SI"})

    def law(s: fg.Sample) -> tuple[float, float]:
        for error, measured, wanted in (
            (s.error, s.position, s.reference),
            (s.error_rate, s.velocity, s.reference_velocity),
        ):
            assert error == (measured[0] - wanted[0], measured[1] - wanted[1])
        seen.append(s)
        return 0.0, 0.0

    fg.simulate(noisy, law)
    assert len(seen) > 5
