"""FMUs, as an importer uses them: validated, loaded and simulated by FMPy."""

from __future__ import annotations

import importlib.util
import math
import re
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any, get_args

import fmpy
import fracgyro as fg
import numpy as np
import pytest
from embedded import need
from every_disturbance import ENTRIES
from fmpy.simulation import instantiate_fmu
from fmpy.validation import validate_fmu
from fracgyro.cli import cli
from fracgyro.export import settings
from fracgyro.export.fmu import FMI2_FOLDERS, Content, Fmi, Reference
from fracgyro.scenario.kinds import DEVICE_CHANNELS, KINDS, LOOP_CHANNELS, VOLTS_CHANNELS, reports
from fracgyro.scenario.volts_core import at_bias
from loop_in_volts import IN_VOLTS
from nightly import nightly_unless
from shared import shared

SHORT = fg.Scenario.paper().replace({"run.duration": 2.0, "controller.switching_limit": 0.5})
SI = SHORT.replace(
    {
        "run.units": "SI",
        "plant.mass": 2.3e-7,
        "plant.stiffness_deviation": {"xx": 1.0, "xy": 0.1, "yy": -1.0},
        "plant.centrifugal": True,
        "controller.force_limit": 900.0,
        "controller.switching_limit": 0.02,
        "controller.terminal_exponent": 0.7,
        "adaptation.leakage": 0.1,
        "adaptation.dead_zone": 0.01,
        "adaptation.projection": 0.5,
        "disturbance.hold": 3e-3,
        "disturbance.seed": 2**31 - 1,
    }
)
SINE = SHORT.replace(
    {
        "controller.kind": "fast_terminal",
        "controller.adaptive": False,
        "disturbance.kind": "sine",
        "disturbance.amplitude": (0.7, -0.3),
        "disturbance.frequency": (2.0, 7.0),
    }
)
# Every device effect and a dynamic rate; no disturbance, so that the seed affects only the device's noise.
DEVICE = SHORT.replace(
    {
        "adaptation.kind": "joint",
        "disturbance.kind": "none",
        "rate.kind": "table",
        "rate.points": [[0.0, 95.0], [1e-3, 105.0]],
        "device.sensing": "position",
        "device.position_noise": 1e-11,
        "device.position_noise_corner": 1e4,
        "device.position_range": [2e-6, 3e-6],
        "device.position_bits": 24,
        "device.actuator_limit": 1e-5,
        "device.actuator_bits": 24,
        "device.force_gain_error": [1e-3, -1e-3],
        "device.force_misalignment": 1e-3,
        "device.pickoff_gain_error": [1e-3, 2e-3],
        "device.delay": 1,
        "device.stiffness_drift": 50.0,
        "device.temperature_ramp": 1e4,
        "device.bias_instability": 0.3,
        "device.rate_random_walk": 20.0,
    }
)
# Every kind of disturbance; the first part is a sine, which an importer can set.
LIST = SHORT.replace({"disturbance": ENTRIES})
SCENARIOS = {
    "the paper's, whole": fg.Scenario.paper(),
    "as printed": fg.Scenario.paper("printed").replace({"run.duration": 2.0}),
    "in SI units": SI,
    "composite adaptation": SHORT.replace({"adaptation.kind": "composite", "adaptation.rate_forgetting": 2.0}),
    "joint adaptation of a device": DEVICE,
    "known parameters, sine": SINE,
    "PID, which reports nothing": SHORT.replace({"controller.kind": "pid"}),
    "super-twisting": SHORT.replace({"controller.kind": "super_twisting"}),
    "PID behind the filter": SHORT.replace(
        {"controller.kind": "pid", "controller.filter": "kalman", "device.velocity_noise": 1e-8, "device.delay": 1}
    ),
    **{
        kind: SHORT.replace({"controller.kind": kind})
        for kind in ("resonant", "nonsingular_terminal", "lqg", "force_rebalance")
    },
    "disturbances that add up": LIST,
    "a device in volts": IN_VOLTS,
    "undisturbed": SHORT.replace({"controller.kind": "linear", "disturbance.kind": "none"}),
}
VERSIONS: tuple[Fmi, ...] = get_args(Fmi)
# The versions differ in names only: every scenario in one of them, those that differ most in both.
IN_BOTH = ("the paper's, whole", "in SI units", "joint adaptation of a device")
LOOPS = [
    (name, fmi) for i, name in enumerate(SCENARIOS) for j, fmi in enumerate(VERSIONS) if name in IN_BOTH or i % 2 == j
]
# Loops that `make test` compiles. The parity of every kind is also tested where it compiles faster.
OFTEN = (*IN_BOTH, "disturbances that add up", "a device in volts")
EVERY_TIME = [(name, dict(reversed(LOOPS))[name]) for name in OFTEN]
# One FMU of each version, for tests that need another one, or any.
OTHER: dict[Fmi, fg.Scenario] = {"2.0": SI, "3.0": LIST}
CHECKED = SHORT.replace({"controller.force_limit": 6000.0, "guard.checked": True})


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """Each FMU is made once."""

    def make(
        scenario: fg.Scenario, fmi: Fmi = "2.0", content: Content = "loop", reference: Reference = "scenario"
    ) -> str:
        name = f"{content} {reference} {fmi} {scenario.content_hash()}.fmu"
        return str(
            shared(
                tmp_path_factory,
                name,
                lambda path: fg.export.fmu(
                    scenario, path, fmi=fmi, content=content, reference=reference, unbounded=True
                ),
            )
        )

    return make


@pytest.fixture
def no_binaries(monkeypatch: pytest.MonkeyPatch) -> None:
    """FMUs of a description only, without a compiler."""
    monkeypatch.setitem(fg.export.fmu.__globals__, "_binaries", lambda *words: {})


def columns(run: Any) -> dict[str, np.ndarray]:
    """A run of ours under the names of an FMU's outputs."""
    channels = (
        *LOOP_CHANNELS,
        *DEVICE_CHANNELS,
        *VOLTS_CHANNELS,
        *(c for kind in KINDS for channels in reports(kind) for c in channels),
    )
    found = {}
    for channel in channels:
        if channel.name in run:
            values = run[channel.name].values.reshape(run.sizes["time"], -1)
            found.update({name: values[:, i] for i, name in enumerate(settings.columns(channel))})
    return found


def assert_same_bits(got: np.ndarray, expected: np.ndarray, name: str) -> None:
    np.testing.assert_array_equal(got.view(np.uint64), np.ascontiguousarray(expected).view(np.uint64), err_msg=name)


# FMPy calls the logger of whichever instance was made last, even if that is gone: none may go.
LOGGERS: list[Any] = []


class Instance:
    """An FMU between two calls of its importer, by names, in either version of FMI."""

    def __init__(self, path: str, folder: Path) -> None:
        self.description = fmpy.read_model_description(path)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.messages: list[str] = []
        # FMPy hands its loggers the text last.
        unpacked = fmpy.extract(path, unzipdir=str(folder / f"{Path(path).stem}"))
        self.fmu = instantiate_fmu(unpacked, self.description, logger=lambda *a: self.messages.append(a[-1].decode()))
        LOGGERS.append(getattr(self.fmu, "callbacks", None))
        self.two = self.description.fmiVersion == "2.0"

    def get(self, name: str) -> float:
        return float((self.fmu.getReal if self.two else self.fmu.getFloat64)([self.references[name]])[0])

    def set(self, name: str, value: float) -> None:
        (self.fmu.setReal if self.two else self.fmu.setFloat64)([self.references[name]], [value])

    def start(self, time: float = 0.0) -> Instance:
        if self.two:
            self.fmu.setupExperiment(startTime=time)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=time)
        self.fmu.exitInitializationMode()
        return self

    def step(self, time: float, length: float) -> None:
        self.fmu.doStep(time, length)

    def save(self) -> bytes:
        if self.two:
            return bytes(self.fmu.serializeFMUstate(self.fmu.getFMUstate()))
        return bytes(self.fmu.serializeFMUState(self.fmu.getFMUState()))

    def load(self, saved: bytes) -> None:
        if self.two:
            self.fmu.setFMUstate(self.fmu.deSerializeFMUstate(saved))
        else:
            self.fmu.setFMUState(self.fmu.deserializeFMUState(saved))

    def complaint(self, act: Callable[[], object]) -> str:
        """Messages to the logger when `act` fails."""
        with pytest.raises(Exception, match=r"status 3|fmi\dError|error"):
            act()
        return self.messages[-1]


@pytest.mark.parametrize(("name", "fmi"), LOOPS)
@pytest.mark.parametrize("content", ["loop", "controller"])
@pytest.mark.usefixtures("no_binaries")
def test_the_description_is_valid(name: str, content: Content, fmi: Fmi, tmp_path: Path) -> None:
    scenario = SCENARIOS[name] if content == "loop" else SCENARIOS[name].replace({"trim": {}})
    fg.export.fmu(scenario, tmp_path / "x.fmu", fmi=fmi, content=content, unbounded=True)
    assert validate_fmu(str(tmp_path / "x.fmu")) == []


@pytest.mark.parametrize(("name", "fmi"), nightly_unless(lambda name, fmi: (name, fmi) in EVERY_TIME, LOOPS))
def test_the_closed_loop_has_the_bits_of_simulate(made: Callable[..., str], name: str, fmi: Fmi) -> None:
    run = fg.simulate(SCENARIOS[name])
    path = made(SCENARIOS[name], fmi)
    assert validate_fmu(path) == []
    simulated = fmpy.simulate_fmu(path, output_interval=float(run.time[1]))
    expected = columns(run)
    assert set(simulated.dtype.names) == {"time", *expected}
    np.testing.assert_allclose(simulated["time"], run["time"].values, rtol=1e-12)
    for variable, values in expected.items():
        assert_same_bits(np.ascontiguousarray(simulated[variable]), values, variable)


SEPARATE = {"nondimensional": SHORT, "SI": SI, "positions only": DEVICE}


def test_one_step_of_the_importer_takes_many_of_the_loop(made: Callable[..., str]) -> None:
    simulated = fmpy.simulate_fmu(made(SHORT), output_interval=0.05)
    expected = columns(fg.simulate(SHORT))["control.y"][::50]
    assert_same_bits(np.ascontiguousarray(simulated["control.y"]), expected, "control.y")


@pytest.mark.parametrize(
    ("name", "fmi"),
    nightly_unless(
        lambda name, fmi: (name == "SI") == (fmi == "2.0") and name != "nondimensional", product(SEPARATE, VERSIONS)
    ),
)
def test_the_controller_alone_answers_each_motion_with_the_force_of_the_loop(
    made: Callable[..., str], tmp_path: Path, name: str, fmi: Fmi
) -> None:
    scenario = SEPARATE[name]
    expected = fg.simulate(scenario.replace({"run.units": "nondimensional"}))
    scales = scenario.plant.scales
    factors = [scales.length, scales.velocity, scales.force, scales.time] if scenario is SI else [1.0] * 4
    fmu = Instance(made(scenario, fmi, "controller"), tmp_path).start()
    assert fmu.get("rate_estimate") == pytest.approx(0.095 * (scales.rate if scenario is SI else 1.0))
    step = scenario.run.step * factors[3]
    motion = {"position": ("position", factors[0]), "velocity": ("velocity", factors[1])}
    if scenario is DEVICE:
        motion = {"position": ("measured_position", 1.0)}
    inputs = [v.name for v in fmu.description.modelVariables if v.causality == "input"]
    assert inputs == [f"{name}.{axis}" for name in motion for axis in "xy"]
    for n in range(500):
        for name, (measured, factor) in motion.items():
            for axis in "xy":
                fmu.set(f"{name}.{axis}", float(expected[measured].sel(axis=axis)[n]) * factor)
        fmu.step(n * step, step)
        force = np.array([fmu.get("control.x"), fmu.get("control.y")]) / factors[2]
        if scenario is not SI:
            np.testing.assert_array_equal(force, expected["control"].values[n])
        else:  # the motion is rounded on its way
            np.testing.assert_allclose(force, expected["control"].values[n], rtol=1e-6)


def with_table(scenario: fg.Scenario) -> tuple[fg.Scenario, np.ndarray]:
    """The scenario with its reference as a table of a row for each step; these rows, (steps + 1, 6)."""
    time = scenario.run.step * np.arange(scenario.run.steps + 1)
    curve = np.column_stack([time, np.sin(4.17 * time), 1.2 * np.sin(5.11 * time)])
    table = scenario.replace({"reference": {"kind": "table", "points": curve.tolist()}})
    return table, np.reshape(settings.reference_lists(table)[1], (-1, 7))[:, 1:]


REFERENCE_INPUTS = [f"reference_{name}.{axis}" for name in ("position", "velocity", "acceleration") for axis in "xy"]


@pytest.mark.parametrize(
    ("scenario", "fmi"),
    [pytest.param(SHORT, "2.0", marks=pytest.mark.nightly, id="ideal"), pytest.param(DEVICE, "3.0", id="device")],
)
def test_a_loop_follows_its_inputs_with_the_bits_of_the_same_reference(
    made: Callable[..., str], tmp_path: Path, scenario: fg.Scenario, fmi: Fmi
) -> None:
    table, rows = with_table(scenario.replace({"run.duration": 0.3}))
    expected, step = columns(fg.simulate(table)), table.run.step
    fmu = Instance(made(table, fmi, "loop", "input"), tmp_path).start()
    assert [v.name for v in fmu.description.modelVariables if v.causality == "input"] == REFERENCE_INPUTS
    assert not [name for name in fmu.references if name.startswith("reference.") and name[10:] not in "xy"]
    saved = b""
    got: dict[str, list[float]] = {name: [] for name in expected}
    for n, row in enumerate(rows):
        for name, value in zip(REFERENCE_INPUTS, row.tolist(), strict=True):
            fmu.set(name, value)
        if n == 100:  # the inputs belong to the state
            saved = fmu.save()
            fmu.set("reference_position.x", 9.0)
            fmu.step(n * step, step)
            fmu.load(saved)
        fmu.step(n * step, step)
        for name, values in got.items():
            values.append(fmu.get(name))
    for name, values in expected.items():
        assert_same_bits(np.array(got[name]), values, name)


def test_feedforward_takes_inputs_for_a_parabola_in_the_middle_of_the_step(
    made: Callable[..., str], tmp_path: Path
) -> None:
    """It lacks half a step of the third derivative; the feedback, which adds to the difference, is slow."""
    controller = {"kind": "pid", "natural_frequency": 1.0, "integral_frequency": 0.0}
    scenario = fg.Scenario(controller=controller, disturbance={"kind": "none"}, run={"duration": 0.3})
    table, rows = with_table(scenario)
    expected, step = fg.simulate(table)["control"].values, table.run.step
    fmu = Instance(made(table, "3.0", "loop", "input"), tmp_path).start()
    found = []
    for n, row in enumerate(rows):
        for name, value in zip(REFERENCE_INPUTS, row.tolist(), strict=True):
            fmu.set(name, value)
        fmu.step(n * step, step)
        found.append([fmu.get("control.x"), fmu.get("control.y")])
    third = np.gradient(rows[:, 4:6], step, axis=0)
    lacks = expected - np.array(found)
    assert np.abs(third).max() > 100
    np.testing.assert_allclose(lacks[5:-5], step / 2 * third[5:-5], rtol=0, atol=0.1 * step / 2 * np.abs(third).max())


@pytest.mark.parametrize("content", nightly_unless(lambda content: content == "controller", ["loop", "controller"]))
def test_the_papers_sine_as_input_gives_the_run_in_si_units(
    made: Callable[..., str], tmp_path: Path, content: Content
) -> None:
    """To 1e-12: the paper's sine is rotated from step to step, a caller's is rounded once."""
    scenario = SI.replace({"run.duration": 0.2, "disturbance.kind": "none"})
    run, scales = fg.simulate(scenario.replace({"run.units": "nondimensional"})), scenario.plant.scales
    time, step = run.time.values, scenario.run.step * scales.time
    a, w = np.array(scenario.reference.amplitude), np.array(scenario.reference.frequency)
    angle = np.outer(time, w) + np.array(scenario.reference.phase)
    unit = {"position": scales.length, "velocity": scales.velocity, "acceleration": scales.velocity / scales.time}
    sine = [a * np.sin(angle), a * w * np.cos(angle), -a * w * w * np.sin(angle)]
    given = np.hstack([part * factor for part, factor in zip(sine, unit.values(), strict=True)])
    fmu = Instance(made(scenario, "3.0", content, "input"), tmp_path).start()
    force = []
    for n, row in enumerate(given):
        for name, value in zip(REFERENCE_INPUTS, row.tolist(), strict=True):
            fmu.set(name, value)
        for name in ("position", "velocity") if content == "controller" else ():
            for axis in "xy":
                fmu.set(f"{name}.{axis}", float(run[name].sel(axis=axis)[n]) * unit[name])
        fmu.step(n * step, step)
        force.append([fmu.get("control.x"), fmu.get("control.y")])
    found, expected = np.array(force) / scales.force, run["control"].values
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_a_drive_with_its_own_sine_takes_no_input(tmp_path: Path) -> None:
    with pytest.raises(fg.ScenarioError, match=r"^controller.kind is force_rebalance, which drives the sine of its sc"):
        fg.export.fmu(SCENARIOS["force_rebalance"], tmp_path / "x.fmu", reference="input", unbounded=True)


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.usefixtures("no_binaries")
def test_an_importer_is_told_to_step_from_one_recorded_sample_to_the_next(tmp_path: Path, fmi: Fmi) -> None:
    for every, expected in ((1, 1e-3), (20, 0.02), (10**6, 2.0)):  # the last is longer than the run
        path = str(tmp_path / f"{every}.fmu")
        fg.export.fmu(SHORT.replace({"run.record_every": every}), path, fmi=fmi, unbounded=True)
        step = fmpy.read_model_description(path).defaultExperiment.stepSize
        assert float(step) == pytest.approx(expected, rel=1e-12)


def test_a_changed_parameter_is_that_of_a_changed_scenario(made: Callable[..., str]) -> None:
    changes = {"controller.terminal_exponent": 0.6, "adaptation.rate_gain": 20.0, "disturbance.seed": 7}
    settings = {"controller.fractional_gain": (8.0, 12.0), "disturbance.standard_deviation": 0.5}
    start = {**changes, "controller.fractional_gain.x": 8.0, "controller.fractional_gain.y": 12.0}
    start |= {
        "disturbance.standard_deviation": 0.5,
        "plant.angular_rate": 130.0,
        "adaptation.initial_rate": 0.95 * 0.13,
    }
    simulated = fmpy.simulate_fmu(made(SHORT), start_values=start, output_interval=0.001)
    expected = columns(fg.simulate(SHORT.replace({**changes, **settings, "plant.angular_rate": 130.0})))
    assert_same_bits(np.ascontiguousarray(simulated["rate_estimate"]), expected["rate_estimate"], "rate_estimate")


@pytest.mark.parametrize("fmi", VERSIONS)
def test_gains_can_be_tuned_while_it_runs_and_starts_cannot(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fmu = Instance(made(SHORT, fmi), tmp_path).start()
    fmu.step(0.0, 0.5)
    before = fmu.get("rate_estimate")
    fmu.set("adaptation.rate_gain", 1e-9)
    fmu.step(0.5, 0.001)  # the force and the estimates of this sample were known already
    resting = fmu.get("rate_estimate")
    fmu.step(0.501, 0.1)
    assert resting != before
    assert fmu.get("rate_estimate") == pytest.approx(resting, abs=1e-9)
    said = fmu.complaint(lambda: fmu.set("run.initial_position.x", 0.1))
    assert said == "run.initial_position.x is fixed: it can be set until the end of the initialization"
    assert fmu.complaint(lambda: fmu.set("controller.order", 0.8)) == "controller.order cannot be set"


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_plant_that_is_none_is_refused_as_in_a_scenario(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    for name, value, said in [
        ("plant.stiffness.xx", -1.0, r"plant.stiffness is \[-1, 12.779, 95.92\]: it must be positive definite"),
        ("plant.stiffness.xy", 1e6, r"plant.stiffness is \[63.955, 1000000, 95.92\]: it must be positive definite"),
        ("plant.damping.yy", -1e-6, r"plant.damping is \[1.8e-06, 3.6e-07, -1e-06\]: it must be positive semidefinite"),
        (
            "plant.stiffness_deviation.xx",
            -1e6,
            r"plant.stiffness plus plant.stiffness_deviation is \[-9.*: it must be positive definite",
        ),
    ]:
        fmu = Instance(made(SHORT, fmi), tmp_path / name)
        fmu.set(name, value)
        assert re.fullmatch(said, fmu.complaint(fmu.start)), fmu.messages
    huge = Instance(made(SHORT, fmi), tmp_path / "huge")
    huge.set("plant.damping.yy", 1e308)
    huge.start()
    running = Instance(made(SHORT, fmi), tmp_path / "running").start()
    running.step(0.0, 0.1)
    running.set("plant.damping.xx", -1.0)
    assert "plant.damping is [-1, " in running.complaint(lambda: running.step(0.1, 0.1))


def test_the_seed_is_that_of_the_noise_of_the_sensors_too(made: Callable[..., str]) -> None:
    simulated = fmpy.simulate_fmu(made(DEVICE), start_values={"disturbance.seed": 7}, output_interval=0.001)
    expected = columns(fg.simulate(DEVICE.replace({"disturbance.seed": 7})))["measured_position.x"]
    assert_same_bits(np.ascontiguousarray(simulated["measured_position.x"]), expected, "measured_position.x")


def test_the_device_is_set_by_the_names_of_its_fields(made: Callable[..., str], tmp_path: Path) -> None:
    fmu = Instance(made(DEVICE), tmp_path)
    assert fmu.get("device.delay") == 1.0
    changes = {"device.force_gain_error": (0.02, -1e-3), "device.pickoff_misalignment": 0.01, "device.delay": 2}
    assumed = {"datasheet.delay": 1}  # the filter was designed for the delay of the export
    fmu.set("device.force_gain_error.x", 0.02)
    fmu.set("device.pickoff_misalignment", 0.01)
    fmu.set("device.delay", 2.0)
    fmu.start()
    fmu.step(0.0, 0.5)
    expected = columns(fg.simulate(DEVICE.replace({**changes, **assumed})))
    assert fmu.get("measured_position.x") == expected["measured_position.x"][500]
    assert fmu.complaint(lambda: fmu.set("device.delay", 3.0)) == (
        "device.delay is fixed: it can be set until the end of the initialization"
    )


@pytest.mark.parametrize(("fmi", "scenario"), [("2.0", DEVICE), ("3.0", SHORT)], ids=["device", "ideal"])
def test_a_saved_state_resumes_bit_for_bit_even_elsewhere(
    made: Callable[..., str], tmp_path: Path, fmi: Fmi, scenario: fg.Scenario
) -> None:
    fmu = Instance(made(scenario, fmi), tmp_path / "1").start()
    fmu.set("controller.layer_thickness", 0.1)
    fmu.step(0.0, 0.7)
    saved = fmu.save()
    fmu.step(0.7, 0.3)
    expected = [fmu.get("position.x"), fmu.get("bound_estimate[2]")]
    fmu.load(saved)
    fmu.step(0.7, 0.3)
    assert [fmu.get("position.x"), fmu.get("bound_estimate[2]")] == expected
    other = Instance(made(scenario, fmi), tmp_path / "2").start()
    other.load(saved)
    assert other.get("controller.layer_thickness") == 0.1
    other.step(0.7, 0.3)
    assert [other.get("position.x"), other.get("bound_estimate[2]")] == expected
    stranger = Instance(made(OTHER[fmi], fmi), tmp_path / "3").start()
    assert stranger.complaint(lambda: stranger.load(saved)) == "the serialized state is not of this FMU"


@pytest.mark.parametrize("fmi", VERSIONS)
def test_reset_starts_anew(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fmu = Instance(made(SHORT, fmi), tmp_path).start()
    fmu.set("controller.layer_thickness", 0.1)
    fmu.step(0.0, 0.2)
    fmu.fmu.reset()
    assert fmu.get("controller.layer_thickness") == SHORT.controller.layer_thickness
    fmu.start(time=3.0)
    if fmi == "3.0":  # FMI 2.0 has no variable for it
        assert fmu.get("time") == 3.0
    fmu.step(3.0, 0.2)
    expected = columns(fg.simulate(SHORT))["error.x"][200]
    assert fmu.get("error.x") == expected


def test_outputs_follow_the_parameters_during_the_initialization(made: Callable[..., str], tmp_path: Path) -> None:
    fmu = Instance(made(SHORT), tmp_path)
    fmu.fmu.setupExperiment(startTime=0.0)
    fmu.fmu.enterInitializationMode()
    assert fmu.get("error.x") == 0.5
    fmu.set("run.initial_position.x", 0.25)
    assert fmu.get("error.x") == 0.25


@pytest.mark.parametrize("fmi", VERSIONS)
def test_what_cannot_be_done_is_told_to_the_logger(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fmu = Instance(made(SHORT, fmi), tmp_path)
    said = fmu.complaint(lambda: fmu.step(0.0, 0.001))
    assert said == "a step can come only between initialization and end: this is before the initialization"
    fmu.start()
    said = fmu.complaint(lambda: fmu.step(0.0, 0.0015))
    assert said == "the communication step is 0.0015: it must be a whole number of 0.001, the step of the controller"
    fmu.step(0.0, 0.1)
    said = fmu.complaint(lambda: fmu.step(0.0, 0.1))
    assert said == "the communication point is 0: the next one is 0.1, and steps follow each other"
    said = fmu.complaint(lambda: fmu.set("controller.terminal_exponent", 1.0))
    assert said == "controller.terminal_exponent is 1: it must lie strictly between 0 and 1"
    said = fmu.complaint(lambda: fmu.set("adaptation.leakage", -1.0))
    assert said == "adaptation.leakage is -1: it must be at least 0"
    said = fmu.complaint(lambda: fmu.set("plant.angular_rate", float("nan")))
    assert said == "plant.angular_rate is nan: it must be a finite number"
    fmu.set("adaptation.stiffness_gain", 1e9)
    assert fmu.complaint(lambda: fmu.step(0.1, 1.0)).startswith("the motion diverged after 0.1")


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_damaged_state_is_refused(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fmu = Instance(made(SHORT, fmi), tmp_path).start()
    fmu.step(0.0, 0.1)
    saved = bytearray(fmu.save())
    saved[len(saved) // 2] ^= 1
    damaged = "the serialized state is damaged: it is not as it was saved"
    assert fmu.complaint(lambda: fmu.load(bytes(saved))) == damaged
    assert fmu.complaint(lambda: fmu.load(bytes(saved[:-1]))) == damaged


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_step_comes_between_initialization_and_end_alone(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fmu = Instance(made(SHORT, fmi), tmp_path)
    said = fmu.complaint(fmu.fmu.exitInitializationMode)
    here = "this is before the initialization"
    assert said == f"the end of the initialization can come only during the initialization: {here}"
    fmu.start()
    here = "this is between initialization and end"
    assert fmu.complaint(fmu.fmu.enterInitializationMode).endswith(here)
    fmu.fmu.terminate()
    said = fmu.complaint(lambda: fmu.step(0.0, 0.001))
    assert said == "a step can come only between initialization and end: this is after the end"
    said = fmu.complaint(lambda: fmu.set("controller.layer_thickness", 0.1))
    assert said == "controller.layer_thickness cannot be set: the simulation is terminated"
    assert fmu.get("error.x") == 0.5, "what was found can still be read"
    fmu.fmu.reset()
    fmu.start().step(0.0, 0.001)


@pytest.mark.parametrize("fmi", nightly_unless(lambda fmi: fmi == "3.0", VERSIONS))
def test_a_step_that_would_take_for_ever_is_refused(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fmu = Instance(made(CHECKED, fmi, "controller"), tmp_path).start()
    said = fmu.complaint(lambda: fmu.step(0.0, 1e9))
    assert said == "the communication step is 1e+09: it must be at most 10000, ten million steps of the controller"


def test_a_variable_is_read_and_set_by_the_functions_of_its_type(made: Callable[..., str], tmp_path: Path) -> None:
    fmu = Instance(made(SHORT), tmp_path)
    seed, exponent = (fmu.references[name] for name in ("disturbance.seed", "controller.terminal_exponent"))
    assert fmu.fmu.getInteger([seed]) == [0]
    assert fmu.complaint(lambda: fmu.fmu.getReal([seed])) == "disturbance.seed is an integer"
    assert fmu.complaint(lambda: fmu.fmu.setInteger([exponent], [1])) == "controller.terminal_exponent is no integer"


def test_a_motion_that_its_bounds_ended_is_told_so_to_the_logger(made: Callable[..., str], tmp_path: Path) -> None:
    fmu = Instance(made(SHORT), tmp_path)
    for i, gain in enumerate((100.0, 160.0, 160.0)):
        fmu.set(f"adaptation.bound_gain[{i}]", gain)
    fmu.set("controller.switching_limit", sys.float_info.max)
    fmu.start()
    said = fmu.complaint(lambda: fmu.step(0.0, 400.0))
    assert "the bound estimates had grown to [" in said
    assert said.endswith("controller.switching_limit = 0.5 bounds them")
    assert float(said.partition("rho h/delta was ")[2].partition(",")[0]) > 1.5


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_sample_that_is_not_believed_is_warned_of_and_leaves_no_force_without_end(
    made: Callable[..., str], tmp_path: Path, fmi: Fmi
) -> None:
    expected, ours = fg.simulate(CHECKED), fg.Controller(CHECKED)
    fmu = Instance(made(CHECKED, fmi, "controller"), tmp_path).start()
    for n in range(200):
        position, velocity = expected["position"].values[n].copy(), expected["velocity"].values[n].copy()
        position[0] += {100: 1e300, 101: 3.0}.get(n, 0.0)
        for name, values in (("position", position), ("velocity", velocity)):
            for axis, value in zip("xy", values, strict=True):
                fmu.set(f"{name}.{axis}", float(value))
        fmu.step(n * 1e-3, 1e-3)
        force = [fmu.get("control.x"), fmu.get("control.y")]
        np.testing.assert_array_equal(force, ours.step(n * 1e-3, position, velocity))
        assert np.abs(force).max() <= 6000.0
    assert fmu.messages == [
        "the sample at 0.1 is out of range: the last force is held",
        "the sample at 0.101 is not a motion of this plant: the last force is held",
    ]


def test_a_binary_refuses_the_description_of_another(made: Callable[..., str], tmp_path: Path) -> None:
    path = made(SHORT)
    description = fmpy.read_model_description(path)
    description.guid = "{00000000-0000-0000-0000-000000000000}"
    said: list[str] = []
    with pytest.raises(Exception, match="instantiate"):
        instantiate_fmu(fmpy.extract(path, str(tmp_path)), description, logger=lambda *a: said.append(a[-1].decode()))
    assert said == ["the GUID is not this FMU's: the model description belongs to another FMU"]


@pytest.mark.usefixtures("no_binaries")
def test_units_convert_to_si(tmp_path: Path) -> None:
    def factor(scenario: fg.Scenario, name: str) -> tuple[float, float]:
        """Unit of the variable, and its powers of kg, m, s as one number."""
        path = tmp_path / f"{scenario.run.units}.fmu"
        if not path.exists():
            fg.export.fmu(scenario, path, fmi="3.0")
        description = fmpy.read_model_description(path)
        unit = next(v.unit for v in description.modelVariables if v.name == name)
        base = next(u.baseUnit for u in description.unitDefinitions if u.name == unit)
        return base.factor, base.kg * 100 + base.m * 10 + base.s

    assert factor(SHORT, "control.x") == (pytest.approx(1.8e-7), 100 + 10 - 2)
    assert factor(SHORT, "time") == (pytest.approx(1e-3), 1)
    assert factor(SHORT, "adaptation.rate_gain") == (pytest.approx(1e12), -20)
    assert factor(SI, "control.x") == (1.0, 100 + 10 - 2)
    assert factor(SI, "plant.damping.xx") == factor(SHORT, "plant.damping.xx") == (1.0, 100 - 1)


def test_the_description_says_what_may_be_changed_and_what_it_means(made: Callable[..., str]) -> None:
    variables = {v.name: v for v in fmpy.read_model_description(made(SHORT)).modelVariables}
    tunable, fixed = variables["plant.angular_rate"], variables["disturbance.seed"]
    assert (tunable.causality, tunable.variability, tunable.unit, float(tunable.start)) == (
        "parameter",
        "tunable",
        "rad/s",
        100,
    )
    assert tunable.description == "Omega_z, rad/s: the rate to be sensed; Coriolis force. 0.0: off."
    assert (fixed.causality, fixed.variability, fixed.type) == ("parameter", "fixed", "Integer")
    assert (variables["controller.order"].variability, variables["controller.order"].start) == ("constant", "0.9")
    assert "plant.angular_rate" not in {
        v.name for v in fmpy.read_model_description(made(CHECKED, "2.0", "controller")).modelVariables
    }


@pytest.mark.parametrize("fmi", nightly_unless(lambda fmi: fmi == "2.0", VERSIONS))
def test_the_same_scenario_gives_the_same_bytes(made: Callable[..., str], tmp_path: Path, fmi: Fmi) -> None:
    fg.export.fmu(SHORT, tmp_path / "again.fmu", fmi=fmi)
    assert (tmp_path / "again.fmu").read_bytes() == Path(made(SHORT, fmi)).read_bytes()


@pytest.mark.skipif(sys.platform != "linux", reason="a binary of Linux is looked at with its own tool")
@pytest.mark.parametrize(
    ("scenario", "content"),
    [(CHECKED, "controller"), (SHORT, "loop"), pytest.param(DEVICE, "loop", marks=pytest.mark.nightly)],
    ids=["law", "loop", "device"],
)
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_binary_for_linux_needs_only_libc(
    made: Callable[..., str], tmp_path: Path, scenario: fg.Scenario, content: Content, fmi: Fmi
) -> None:
    """And none of its newer parts, so that it runs on systems older than the one that made it."""
    with zipfile.ZipFile(made(scenario, fmi, content)) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".so"))
        binary = archive.extract(name, tmp_path)
    said = subprocess.run(["readelf", "-dVW", binary], capture_output=True, text=True, check=True).stdout
    assert re.findall(r"Shared library: \[(.+)\]", said) == ["libc.so.6"]
    parts = {tuple(map(int, part.split("."))) for part in re.findall(r"\bGLIBC_([\d.]+)", said)}
    assert (2, 2, 5) <= max(parts) <= (2, 17)


def looked_at(made: Path, content: Content, fmi: Fmi, folder: Path) -> None:
    """Its binary for Linux on ARM is one, needs only glibc, and has the functions of FMI."""
    with zipfile.ZipFile(made) as archive:
        binary = archive.extract(f"binaries/aarch64-linux/fracgyro_{content}.so", folder)
    said = subprocess.run(["readelf", "-hdVW", "--dyn-syms", binary], capture_output=True, text=True, check=True).stdout
    assert re.search(r"Class: +ELF64\n", said)
    assert re.search(r"Machine: +AArch64\n", said)
    libraries = set(re.findall(r"Shared library: \[(\w+)", said))
    assert libraries <= {"libc", "libdl", "libm", "libpthread", "ld"}, "all of them glibc's"
    parts = {tuple(map(int, part.split("."))) for part in re.findall(r"\bGLIBC_([\d.]+)", said)}
    assert parts == {(2, 17)}
    functions = set(re.findall(rf"FUNC +GLOBAL +DEFAULT +\d+ (fmi{fmi[0]}\w+)", said))
    assert {f"fmi{fmi[0]}{name}" for name in ("DoStep", "GetVersion", "FreeInstance")} <= functions


@pytest.mark.nightly
def test_zig_makes_the_binaries_of_other_systems(tmp_path: Path) -> None:
    need("other systems")
    fg.export.fmu(SHORT, tmp_path / "all.fmu", content="controller", systems=list(FMI2_FOLDERS))
    with zipfile.ZipFile(tmp_path / "all.fmu") as archive:
        binaries = {
            name.split("/")[1]: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")
        }
    assert list(binaries) == list(FMI2_FOLDERS.values())
    for system, processor in (("linux64", 62), ("aarch64-linux", 183)):
        assert binaries[system].startswith(b"\x7fELF")
        assert struct.unpack("<H", binaries[system][18:20]) == (processor,)
    assert binaries["win64"].startswith(b"MZ")
    assert struct.unpack(">II", binaries["darwin64"][:8]) == (0xCAFEBABE, 2)
    for i, processor in enumerate((0x01000007, 0x0100000C)):  # Intel, Apple
        kind, _, place, size, _ = struct.unpack(">5I", binaries["darwin64"][8 + 20 * i : 28 + 20 * i])
        assert kind == processor
        assert binaries["darwin64"][place : place + 4] == b"\xcf\xfa\xed\xfe"
        assert place + size <= len(binaries["darwin64"])
    for binary in binaries.values():
        assert b"fmi2DoStep" in binary
    if sys.platform == "linux":  # whose readelf it is
        looked_at(tmp_path / "all.fmu", "controller", "2.0", tmp_path)
        fg.export.fmu(DEVICE, tmp_path / "loop.fmu", fmi="3.0", systems=["linux-arm"], unbounded=True)
        looked_at(tmp_path / "loop.fmu", "loop", "3.0", tmp_path)


def test_a_seed_that_fmi_cannot_hold_is_refused(tmp_path: Path) -> None:
    too_large = SHORT.replace({"disturbance.seed": 2**31})
    with pytest.raises(ValueError, match=r"disturbance.seed is 2147483648: it must be at most 2147483647 in an FMU"):
        fg.export.fmu(too_large, tmp_path / "x.fmu")


def test_a_device_that_is_not_ideal_is_simulated_in_double_only(tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match=r"^number is float: it must be double for a closed loop with a dynamic rate or"
    ):
        fg.export.fmu(DEVICE, tmp_path / "x.fmu", number="float", unbounded=True)


@pytest.mark.parametrize(
    ("compiler", "said"),
    [("no-such-compiler", "no-such-compiler is not found: set CXX"), ("false", "false failed: no reason")],
)
def test_without_a_compiler_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiler: str, said: str
) -> None:
    monkeypatch.setenv("CXX", compiler)
    with pytest.raises(ValueError, match=said):
        fg.export.fmu(SHORT, tmp_path / "x.fmu")
    assert list(tmp_path.iterdir()) == []


def test_without_fmpy_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "fmpy" else find(name))
    with pytest.raises(ValueError, match="FMI's headers are missing: install FMPy"):
        fg.export.fmu(SHORT, tmp_path / "x.fmu")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("no_binaries")
def test_the_command_writes_one(tmp_path: Path) -> None:
    from click.testing import CliRunner

    SHORT.save(tmp_path / "my.toml")
    words = [
        "export",
        "fmu",
        str(tmp_path / "my.toml"),
        "--out",
        str(tmp_path / "my.fmu"),
        "--controller",
        "--reference",
        "input",
        "--fmi",
        "3.0",
    ]
    ran = CliRunner().invoke(cli, words)
    assert ran.exit_code == 0
    assert ran.output == f"{tmp_path / 'my.fmu'}: controller, reference as input, FMI 3.0, for linux\n"
    assert fmpy.read_model_description(tmp_path / "my.fmu").modelName == "fracgyro_controller"


def test_in_float_it_follows_double_closely_and_is_another_fmu(made: Callable[..., str], tmp_path: Path) -> None:
    from click.testing import CliRunner

    path = tmp_path / "single.fmu"
    SHORT.save(tmp_path / "my.toml")
    words = ["export", "fmu", str(tmp_path / "my.toml"), "--out", str(path), "--number", "float"]
    assert CliRunner().invoke(cli, words).output == f"{path}: closed loop, FMI 2.0, float, for linux\n"
    assert validate_fmu(str(path)) == []
    simulated = fmpy.simulate_fmu(str(path), output_interval=0.001)
    position, expected = simulated["position.x"], columns(fg.simulate(SHORT))["position.x"]
    np.testing.assert_array_equal(position, position.astype(np.float32))
    assert 0 < np.abs(position - expected).max() < 1e-3
    guids = {fmpy.read_model_description(p).guid for p in (str(path), made(SHORT))}
    assert len(guids) == 2, "a saved state of one does not fit the other"


@pytest.mark.parametrize("linearized", nightly_unless(bool, [True, False]))
def test_a_controller_in_volts_answers_amplifiers_with_the_voltages_of_the_drivers(
    tmp_path: Path, linearized: bool
) -> None:
    changes = {"electronics.linearized": linearized, "run.duration": 25.0, "run.record_every": 1}
    scenario = fg.Scenario.shipped("dual_mass_volts").replace(changes)
    run, scales = fg.simulate(scenario), scenario.plant.scales
    at, capacitance = at_bias(scenario), scenario.electronics.feedback_capacitance
    outputs = run["measured_position"].values * (at.charge[[0, 2]] * scales.length / capacitance)
    drives = run["applied_control"].values * (scales.force / at.gain[[0, 2]])
    fg.export.fmu(scenario, tmp_path / "volts.fmu", content="controller", units="V")
    assert validate_fmu(str(tmp_path / "volts.fmu")) == []
    fmu = Instance(str(tmp_path / "volts.fmu"), tmp_path).start()
    assert {v.name: v.unit for v in fmu.description.modelVariables if v.causality == "input"} == {
        "position.x": "V",
        "position.y": "V",
    }
    step, code, found = scenario.run.step * scales.time, 20.0 / 2**16, []
    for n in range(len(outputs)):
        fmu.set("position.x", outputs[n, 0])
        fmu.set("position.y", outputs[n, 1])
        fmu.step(n * step, step)
        found.append([fmu.get("control.x"), fmu.get("control.y")])
    assert np.abs(drives).max() > 0.3
    np.testing.assert_allclose(found, drives, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.divide(found, code), np.round(np.divide(found, code)), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("dual_mass", {}, r"^electrodes of role force are missing: in units \"V\" a scenario must have them"),
        (
            "dual_mass_volts",
            {"electronics.feedback_capacitance": 0.0, "electronics.feedback_resistance": math.inf},
            r"^electronics\.amplifier is charge: in units \"V\" it must be charge, with a feedback_capacitance",
        ),
    ],
)
def test_units_of_volts_need_drivers_and_amplifiers(
    tmp_path: Path, name: str, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(fg.ScenarioError, match=message):
        fg.export.fmu(fg.Scenario.shipped(name).replace(changes), tmp_path / "x.fmu", content="controller", units="V")


def test_a_closed_loop_has_no_units_of_volts(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'^units is "V": it must be None for a closed loop'):
        fg.export.fmu(SHORT, tmp_path / "x.fmu", units="V")
