"""Controllers of every kind: their fields in a scenario, and the contents of a run."""

from __future__ import annotations

import dataclasses
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.scenario import Scenario, ScenarioError, kinds
from fracgyro.scenario.kinds import KINDS, LOOP_CHANNELS, fields_of, numbers, reported_channels
from fracgyro.scenario.table import Table
from fracgyro.scenario.to_core import core_setup
from pydantic import ValidationError, create_model

PAPER = Scenario.paper()
QUIET = {"disturbance.kind": "none", "disturbance.hold": None, "disturbance.standard_deviation": None}
KNOWN = {"adaptation.initial_ratio": 1.0, "run.initial_position": (0.0, 1.0)}
KNOWN["run.initial_velocity"] = (float(np.pi), 0.0)


def of_kind(kind: str) -> Scenario:
    return PAPER.replace({"controller.kind": kind, "run.duration": 4.0})


@pytest.mark.parametrize("kind", KINDS)
def test_a_scenario_of_any_kind_survives_toml_and_states_the_fields_of_its_kind_only(kind: str) -> None:
    scenario = of_kind(kind)
    text = scenario.to_toml()
    assert Scenario.from_toml(text) == scenario
    table = text.split("[controller]")[1].split("\n[")[0]
    others = {name for other in KINDS for name in fields_of(other, "controller")} - set(fields_of(kind, "controller"))
    assert not [name for name in others if f"\n{name} = " in table]


@pytest.mark.parametrize("kind", KINDS)
def test_every_number_of_a_kind_has_a_unit_and_a_meaning_and_its_default_is_allowed(kind: str) -> None:
    assert numbers(kind)
    for number in numbers(kind):
        assert number.unit, number.name
        assert number.meaning.endswith(".") or number.table in ("plant", "run"), number.name
        assert number.low <= number.default <= number.high, number.name


def test_a_field_of_another_kind_is_refused_and_left_behind_when_the_kind_changes() -> None:
    with pytest.raises(ScenarioError) as caught:
        of_kind("pid").replace({"controller.order": 0.8})
    assert str(caught.value) == (
        'controller.order is 0.8: it needs controller.kind = "fractional_fast_terminal", "fractional", "fast_terminal" '
        'or "linear", but controller.kind is "pid"'
    )
    back = PAPER.replace({"controller.order": 0.8, "adaptation.leakage": 0.5}).replace({"controller.kind": "pid"})
    assert back.replace({"controller.kind": "linear"}).controller.order == 0.9
    assert back.replace({"controller.kind": "linear"}).adaptation.leakage == 0.0


@pytest.mark.parametrize("adaptation", ["gradient", "composite", "joint"])
@pytest.mark.parametrize("kind", KINDS)
def test_between_steps_a_controller_reports_what_the_coming_one_records(kind: str, adaptation: str) -> None:
    scenario = of_kind(kind).replace({"run.duration": 0.1})
    if "kind" in fields_of(kind, "adaptation"):
        scenario = scenario.replace({"adaptation.kind": adaptation})
    run, controller = fg.simulate(scenario), fg.Controller(scenario)
    momentary = {channel.name for channel in reported_channels(core_setup(scenario)) if channel.momentary}
    for n in range(run.sizes["time"]):
        found = controller.report
        assert not momentary & set(found), "the coming step's is not known yet"
        for name, value in found.items():
            np.testing.assert_array_equal(value, run[name].values[n], err_msg=f"{name} at step {n}")
        controller.step(n * 1e-3, run["position"].values[n], run["velocity"].values[n])
    others = {channel.name for channel in LOOP_CHANNELS} | momentary
    assert set(found) == set(run.data_vars) - others


def test_pid_tracks_to_what_the_held_force_leaves() -> None:
    # The velocity's ripple, h^2/12 K r', through the gain 2 0.7 200 of the rate, over the loop's stiffness.
    run = fg.simulate(of_kind("pid").replace({**QUIET, **KNOWN, "controller.integral_frequency": 0.0}))
    assert "rate_estimate" not in run
    late = run.isel(time=slice(2000, None))
    stiffness = np.array([[355.3, 70.99], [70.99, 532.9]])
    velocity = np.gradient(late["reference"].values, 1e-3, axis=0)
    ripple = 280.0 * 1e-6 / 12 * (velocity @ stiffness) / (200.0**2 + np.diag(stiffness))
    assert np.abs(late["error"].values).max() == pytest.approx(np.abs(ripple).max(), rel=0.2)


def test_super_twisting_beats_pid_under_a_disturbance_and_its_rate_wanders() -> None:
    pushed = {"disturbance.kind": "sine", "disturbance.hold": None, "disturbance.standard_deviation": None}
    pushed |= {"disturbance.amplitude": (5.0, 5.0), "disturbance.frequency": (8.0, 8.0), "run.duration": 20.0}
    runs = {kind: fg.simulate(of_kind(kind).replace(pushed)) for kind in ("pid", "super_twisting")}
    late = {kind: float(fg.metrics.rmse(run, (10.0, None)).max()) for kind, run in runs.items()}
    assert late["super_twisting"] < 0.5 * late["pid"]
    off = np.abs(runs["super_twisting"]["rate_estimate"].values - 0.1)
    assert off.max() > 0.1, "k2 and the laws compete for the same signal"


@pytest.mark.parametrize("kind", KINDS)
def test_metrics_on_the_way_are_those_of_the_record(kind: str) -> None:
    scenario = of_kind(kind).replace({"run.duration": 12.0})
    recorded = fg.metrics.summary(fg.simulate(scenario))
    measured = fg.measure_many([scenario]).isel(run=0)
    for name, value in recorded.items():
        np.testing.assert_allclose(measured[name].values, value.values, rtol=1e-6, atol=1e-12, err_msg=str(name))


def test_runs_of_kinds_that_report_different_things_are_recorded_together() -> None:
    scenarios = [of_kind("pid"), of_kind("linear"), of_kind("super_twisting")]
    runs = fg.simulate_many(scenarios)
    assert np.isnan(runs["bound_estimate"].values[[0, 2]]).all()
    assert np.isnan(runs["twisting_integral"].values[:2]).all()
    for i, scenario in enumerate(scenarios):
        separate = fg.simulate(scenario)
        for name, values in separate.data_vars.items():
            np.testing.assert_array_equal(runs[name].values[i], values.values, err_msg=str(name))


def test_a_rate_sensor_must_estimate_the_rate() -> None:
    from fracgyro.rate.sensor import Sensor

    with pytest.raises(ScenarioError, match=r"controller\.kind is pid: it must be one that estimates"):
        Sensor.of(of_kind("pid"), 2)


@pytest.mark.parametrize(
    ("kind", "changes", "most"),
    [
        # An integral that grows at the limit, too, drives the force from limit to limit for ever.
        ("pid", {"controller.force_limit": 1000.0, "controller.integral_frequency": 60.0}, 1e-4),
        # One that does here keeps the error at 0.05 until t = 2.7.
        ("super_twisting", {"controller.force_limit": 2000.0}, 1e-3),
    ],
)
def test_at_the_force_limit_the_integral_does_not_wind_up(kind: str, changes: dict[str, float], most: float) -> None:
    known = {"adaptation.initial_ratio": 1.0, "run.duration": 5.0}
    run = fg.simulate(of_kind(kind).replace({**QUIET, **known, **changes}))
    assert np.abs(run["control"].values).max() == changes["controller.force_limit"]
    assert np.abs(run["error"].values[1000:]).max() < most


def test_a_name_that_two_kinds_describe_differently_is_checked_as_the_kind_describes_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A stranger's controller may call a field what another controller calls something else."""
    usual = kinds.numbers

    def with_clash(kind: str) -> tuple[kinds.Number, ...]:
        gain = {"pid": (0.0, 10.0, 1.0), "lqg": (-5.0, 0.0, -2.0)}.get(kind)
        if gain is None:
            return usual(kind)
        low, high, default = gain
        meaning = f"Gain of {kind}."
        own = dataclasses.replace(
            usual("pid")[-1],
            table="controller",
            field="gain",
            part="",
            unit="1",
            meaning=meaning,
            low=low,
            high=high,
            strict=False,
            infinite=False,
            whole=False,
            settable="any_time",
            choices=(),
            kinds=(),
            default=default,
        )
        return (*usual(kind), own)

    monkeypatch.setattr(kinds, "numbers", with_clash)
    kinds.fields_of_its_kind.cache_clear()
    try:
        kind_of_field, info = kinds.table_fields("controller")["gain"]
        assert (kind_of_field, info.default) == (Any, None)
        assert info.description == "pid: Gain of pid.; lqg: Gain of lqg."
        assert set(kinds.fields_of_its_kind("controller", "pid")) == {"gain"}
        assert not kinds.fields_of_its_kind("controller", "linear")
        pid = create_model("pid", __base__=Table, **kinds.fields_of_its_kind("controller", "pid"))
        lqg = create_model("lqg", __base__=Table, **kinds.fields_of_its_kind("controller", "lqg"))
        assert pid().gain, lqg().gain == (1.0, -2.0)
        with pytest.raises(ValidationError):
            pid(gain=-1.0)
        lqg(gain=-1.0)
        listed = [number for number in with_clash("lqg") if number.field == "gain"]
        assert kinds.core_values(tuple(listed), {"controller": {"gain": None}}) == {"controller.gain": -2.0}
    finally:
        kinds.fields_of_its_kind.cache_clear()
