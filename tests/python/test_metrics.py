"""Metrics against answers worked by hand: in recorded runs and without a record."""

from __future__ import annotations

import re
from collections.abc import Callable

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro import metrics

PAPER = fg.Scenario.paper().replace({"run.duration": 2.0})
KNOWN = {"controller.adaptive": False}  # the estimates are the true values except for the parameters unknown to the
# controller


def both(scenario: fg.Scenario, **limits: float) -> list[xr.Dataset]:
    """The metrics from a record, and without one."""
    lean = fg.measure_many([scenario], **limits)
    return [metrics.summary(fg.simulate(scenario), **limits), lean.isel(run=0)]


@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_a_run_measured_without_a_record_has_the_figures_of_its_record(units: str) -> None:
    scenario = PAPER.replace({"run.duration": 11.0, "run.units": units})
    found, wanted = metrics.measured(scenario), metrics.summary(fg.simulate(scenario))
    for name, figure in wanted.data_vars.items():
        np.testing.assert_allclose(found[name], figure, rtol=1e-9, err_msg=str(name))
        if units == "SI":
            assert found[name].attrs == figure.attrs, name


def test_a_run_is_measured_with_the_controller_that_is_given() -> None:
    found = metrics.measured(PAPER, controller=lambda sample: (3.0, 4.0))
    assert float(found["largest_force"]) == 4.0


@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_what_the_controller_is_not_told_of_the_plant_is_missing_from_its_estimates(units: str) -> None:
    # The plant has 4 D, and the controller knows D: 3/4 are missing. It has 2 K, and K is known: 1/2.
    plant = PAPER.plant
    damping, stiffness = ({e: getattr(m, e) for e in ("xx", "xy", "yy")} for m in (plant.damping, plant.stiffness))
    scenario = PAPER.replace(
        {
            **KNOWN,
            "plant.damping_deviation": {e: 3 * v for e, v in damping.items()},
            "plant.stiffness_deviation": stiffness,
            "run.units": units,
        }
    )
    for found in both(scenario):
        assert float(found["damping_error"]) == pytest.approx(0.75, rel=1e-9)
        assert float(found["stiffness_error"]) == pytest.approx(0.5, rel=1e-9)


def test_errors_of_matrices_count_the_entry_beside_the_diagonal_twice() -> None:
    # The known K is diag(3, 4), the true K also has 6 off the diagonal: the squared error is 2 * 36 of 9 + 16 + 2 * 36.
    unit = PAPER.plant.scales.stiffness
    scenario = PAPER.replace(
        {
            **KNOWN,
            "plant.stiffness": {"xx": 30 * unit, "xy": 0.0, "yy": 40 * unit},
            "plant.stiffness_deviation": {"xx": 0.0, "xy": 6 * unit, "yy": 0.0},
        }
    )
    for found in both(scenario):
        assert float(found["stiffness_error"]) == pytest.approx((72 / (900 + 1600 + 72)) ** 0.5, rel=1e-9)


@pytest.mark.parametrize("rate", [100.0, -100.0])
@pytest.mark.parametrize(("ratio", "settled"), [(0.91, True), (1.09, True), (0.89, False), (1.11, False)])
def test_a_rate_has_settled_within_a_tenth_of_its_size_whatever_its_sign(
    rate: float, ratio: float, settled: bool
) -> None:
    scenario = PAPER.replace(
        {"plant.angular_rate": rate, "adaptation.rate_gain": 1e-9, "adaptation.initial_ratio": ratio}
    )
    for found in both(scenario):
        assert float(found["rate_error"]) == pytest.approx((ratio - 1) * rate * 1e-3, rel=1e-6)
        assert float(found["rate_error_peak"]) == pytest.approx(abs(ratio - 1) * 0.1, rel=1e-6)
        assert float(found["rate_settling_time"]) == (0.0 if settled else pytest.approx(np.nan, nan_ok=True))


def made_up() -> xr.Dataset:
    """Ten samples, one a unit of time, as if recorded."""
    t = np.arange(10.0)
    error = np.stack([np.where(t < 4, 3.0, 0.003), np.where(t < 4, 4.0, 0.004)], axis=1)
    surface = np.stack([np.where(t < 6, 0.06, 0.036), np.where(t < 6, 0.08, 0.048)], axis=1)
    control = np.stack([(-1.0) ** t * 5.0, t**2], axis=1)
    run = xr.Dataset(
        {
            "error": (["time", "axis"], error),
            "surface": (["time", "axis"], surface),
            "control": (["time", "axis"], control),
            "rate_estimate": ("time", 0.1 + np.where(t < 3, -0.4, 0.005)),
            "damping_estimate": (["time", "entry"], np.zeros((10, 3))),
            "stiffness_estimate": (["time", "entry"], np.zeros((10, 3))),
            "bound_estimate": (["time", "bound"], np.stack([t + 1, 10 * t, 20 * t], axis=1)),
        },
        coords={"time": t, "axis": ["x", "y"], "bound": [0, 1, 2]},
    )
    limited = PAPER.replace({"controller.force_limit": 49.0})
    return run.assign_attrs(units="nondimensional", scenario=limited.to_toml())


def test_the_metrics_of_ten_samples_are_those_worked_by_hand() -> None:
    found = metrics.summary(made_up(), transient=4.0)
    # Four samples of 3 and 4, then six of a thousandth of that.
    whole = [(0.4 * 9 + 0.6 * 9e-6) ** 0.5, (0.4 * 16 + 0.6 * 16e-6) ** 0.5]
    np.testing.assert_allclose(found["rmse"].values, [whole, [3.0, 4.0], [0.003, 0.004]], rtol=1e-12)
    assert list(found["window"].values) == ["whole", "transient", "steady"]
    assert float(found["error_settling_time"]) == 4.0  # the norm is 0.005 from there on
    assert float(found["surface_settling_time"]) == 6.0  # 0.06 exactly counts as within
    # From t = 4 on: a sign that flips has second differences of 4 times its size; of t^2 they are 2.
    squares = np.mean(np.arange(4.0, 10.0) ** 4)
    np.testing.assert_allclose(found["chattering"].values, [4.0, 2 / squares**0.5], rtol=1e-12)
    np.testing.assert_allclose(found["effort"].values, [5.0, np.mean(np.arange(10.0) ** 4) ** 0.5], rtol=1e-12)
    assert float(found["rate_error"]) == pytest.approx(0.005)
    assert float(found["rate_error_rms"]) == pytest.approx(0.005)
    assert float(found["rate_error_peak"]) == pytest.approx(0.4)
    assert float(found["rate_settling_time"]) == 3.0
    assert float(found["damping_error"]) == float(found["stiffness_error"]) == 1.0
    assert found["bound_final"].values.tolist() == [10.0, 90.0, 180.0]
    assert float(found["bound_0_halfway"]) == 5.0  # the last sample before 4.5
    assert float(found["largest_force"]) == 81.0
    assert float(found["saturated_share"]) == 0.3  # |u| of 7, 8 and 9 squared
    assert set(found.coords) == {"window", "axis", "bound"}


def test_limits_of_ones_own_and_windows_without_a_sample() -> None:
    brief = metrics.summary(made_up(), transient=0.5)  # one sample
    np.testing.assert_allclose(brief["rmse"].sel(window="transient"), [3.0, 4.0], rtol=1e-12)
    found = metrics.summary(made_up(), error_bound=0.0049, surface_bound=0.1, rate_tolerance=0.04)
    assert np.isnan(float(found["error_settling_time"]))
    assert float(found["surface_settling_time"]) == 0.0
    assert np.isnan(float(found["rate_settling_time"]))
    # The transient lasts 10, and so does the run.
    assert np.isnan(found["rmse"].sel(window="steady")).all()
    np.testing.assert_array_equal(found["rmse"].sel(window="transient"), found["rmse"].sel(window="whole"))
    assert np.isnan(found["chattering"]).all()
    assert np.isnan(found["rate_error_rms"])
    with pytest.raises(ValueError, match=r"window is \(10\.0, None\): the run has no sample in it"):
        metrics.cut(made_up(), metrics.STEADY)
    for wrong in [(1,), (1, 2, 3), (np.nan, 2), ("1", 2), 1.0, "12", None]:
        rule = f"window is {wrong!r}: it must be (from, until), two numbers, or None for an open end"
        measures: list[Callable[..., object]] = [metrics.cut, metrics.rmse, metrics.chattering]
        for measure in measures:
            if not (wrong is None and measure is metrics.chattering):
                with pytest.raises(ValueError, match=f"^{re.escape(rule)}$"):
                    measure(made_up(), wrong)
    assert metrics.cut(made_up(), (-np.inf, np.inf)).sizes == made_up().sizes


def test_an_error_of_exactly_the_bound_is_within_it_and_one_that_is_no_number_is_none() -> None:
    assert float(metrics.settling_time(made_up(), 5.0)) == 0.0
    lost = made_up()
    lost["damping_estimate"][-1, 1] = np.nan
    assert np.isnan(float(metrics.damping_error(lost)[-1]))
    lost["error"][-1, 0] = np.nan
    assert np.isnan(metrics.rmse(lost)).values.tolist() == [True, False]


def test_a_rate_that_moves_is_judged_by_its_largest_size() -> None:
    truth = xr.DataArray(np.where(np.arange(10) < 5, 1.0, 0.0), dims="time")
    run = made_up().assign(angular_rate=truth, rate_estimate=truth + 0.09)
    assert float(metrics.rate_settling_time(run)) == 0.0
    assert np.isnan(float(metrics.rate_settling_time(run, tolerance=0.08)))
    exact = made_up().assign(angular_rate=truth, rate_estimate=truth + 0.25)
    assert float(metrics.rate_settling_time(exact, tolerance=0.25)) == 0.0


def test_the_limits_of_an_si_run_are_scaled_to_its_units() -> None:
    scenario = PAPER.replace({"run.duration": 11.0, "controller.kind": "linear", "adaptation.rate_gain": 1e-9})
    plain = fg.simulate(scenario)
    inside = scenario.replace({"run.units": "SI"})
    for si in (fg.simulate(inside), fg.simulate_many([inside]).isel(run=[0])):
        for metric, unit in (
            (metrics.settling_time, 1e-3),
            (metrics.surface_settling_time, 1e-3),
            (metrics.chattering, 1.0),
            (metrics.rate_settling_time, 1e-3),
        ):
            found = np.squeeze(metric(si).values)
            assert np.isfinite(found).all()
            np.testing.assert_allclose(found, unit * metric(plain).values, rtol=1e-9)
        np.testing.assert_allclose(np.squeeze(metrics.true_rate(si).values), 100.0, rtol=1e-12)


def test_v_of_one_sample_is_that_worked_by_hand() -> None:
    damping, stiffness = PAPER.plant.scales.damping, PAPER.plant.scales.stiffness
    scenario = PAPER.replace(
        {
            "plant.damping": {"xx": 3 * damping, "xy": 1 * damping, "yy": 2 * damping},
            "plant.stiffness": {"xx": 30 * stiffness, "xy": 10 * stiffness, "yy": 20 * stiffness},
            "adaptation.damping_gain": 7.0,
            "adaptation.stiffness_gain": 9.0,
            "adaptation.rate_gain": 5.32,
            "adaptation.bound_gain": (1.0, 2.0, 3.0),
        }
    )
    parts = {
        "damping_estimate": [1.0, 0.0, 1.0],  # off by (2, 1, 1): 4 + 2 + 1 = 7
        "stiffness_estimate": [31.0, 8.0, 17.0],  # by (1, 2, 3): 1 + 8 + 9 = 18
        "rate_symmetric_estimate": [1.0, 0.0, 2.0],  # 5, and 2 (0.4)^2 of the rate
    }
    run = made_up().assign({name: (["time", "entry"], np.tile(value, (10, 1))) for name, value in parts.items()})
    found = metrics.lyapunov(run.assign_attrs(scenario=scenario.to_toml()), (0.0, 2.0, 3.0))
    # s = (0.06, 0.08); the bounds' estimates are (1, 0, 0), off by (1, 2, 3).
    assert float(found[0]) == pytest.approx(0.5 * (0.01 + 1 + 2 + 1 + (1 + 2 + 3)), rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"run.units": "SI"}, r"units is SI: V of eq\. \(39\) requires a nondimensional run"),
        ({"adaptation.kind": "composite"}, r"adaptation\.kind is composite: it must be gradient for V of eq\. \(39\)"),
        ({"adaptation.kind": "joint"}, r"adaptation\.kind is joint: it must be gradient for V of eq\. \(39\)"),
    ],
)
def test_v_is_refused_of_runs_that_it_is_not_defined_for(changes: dict[str, object], said: str) -> None:
    run = fg.simulate(PAPER.replace({"run.duration": 0.01, **changes}))
    with pytest.raises(ValueError, match=said):
        metrics.lyapunov(run, (0.1, 0.2, 0.3))


@pytest.mark.parametrize("kind", ["fractional_fast_terminal", "fractional"])
def test_a_run_of_a_few_steps_is_the_beginning_of_one_of_ten(kind: str) -> None:
    ten = fg.simulate(PAPER.replace({"controller.kind": kind, "run.duration": 10e-3}))
    for steps in (1, 3, 9):
        few = fg.simulate(PAPER.replace({"controller.kind": kind, "run.duration": steps * 1e-3}))
        xr.testing.assert_identical(few.drop_attrs(), ten.isel(time=slice(steps + 1)).drop_attrs())


@pytest.mark.parametrize(
    "effect",
    [
        {"device.position_noise": 1e-9},
        {"device.velocity_noise": 1e-6},
        {"device.delay": 1},
        {"device.cubic_stiffness": (1e12, 0.0)},
    ],
)
def test_each_effect_of_a_device_alone_is_in_the_metrics_without_a_record(effect: dict[str, object]) -> None:
    scenario = PAPER.replace({"run.duration": 0.2, **effect})
    recorded, lean = both(scenario)
    np.testing.assert_allclose(lean["rmse"].sel(window="whole"), recorded["rmse"].sel(window="whole"), rtol=1e-9)
    (ideal,) = fg.measure_many([PAPER.replace({"run.duration": 0.2})])["rmse"].sel(window="whole")
    assert (abs(lean["rmse"].sel(window="whole") / ideal - 1) > 1e-8).any()
