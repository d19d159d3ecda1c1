"""[trim]: voltages of the tuning and quadrature electrodes, adjusted while a controller runs."""

from __future__ import annotations

import math
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro.export.firmware import coefficients_header
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.volts_core import at_bias, plant_at_bias

SHIPPED = fg.Scenario.shipped("dual_mass_volts")
RATE = math.radians(10.0)
MODULATION, TONE = 1.2, 300.0  # V, Hz: of the tone, which pretends 10 deg/s
REBALANCED = SHIPPED.replace(
    {
        "controller.kind": "force_rebalance",
        "plant.angular_rate": RATE,
        "run.initial_position": (0.0, 0.0),
        "electronics.feedthrough": (0.0,) * 4,
        "run.duration": 0.215 * SHIPPED.plant.scales.rate,
        "run.record_every": 50,
        "run.units": "SI",
    }
)
SPLIT = {"trim.tuning": "split", "trim.modulation": MODULATION}
NULL = {"trim.quadrature": "null", "trim.modulation": MODULATION}


def nulling(run: xr.Dataset) -> float:
    """The nulling voltage since the last adjustment, without its tone."""
    last = run["nulling_voltage"][-120:]
    angle = math.tau * TONE * last["time"].values
    columns = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    return float(np.linalg.lstsq(columns, last.values, rcond=None)[0][0])


def left(scenario: fg.Scenario, run: xr.Dataset) -> tuple[float, float]:
    """Split, Hz, and quadrature, deg/s, of the plant at the last voltages of a run."""
    last = {"tuning": {"bias": float(run["tuning_voltage"][-1])}, "quadrature": {"nulling": nulling(run)}}
    each = [{**dict(one), **last.get(one.role, {})} for one in scenario.electrodes.each]
    plant = plant_at_bias(scenario.replace({"electrodes": each, "trim": {}}))
    k, m = plant.effective_stiffness(), plant.mass
    x, y = math.sqrt(k.xx / m), math.sqrt(k.yy / m)
    return (y - x) / math.tau, math.degrees(k.xy / (2 * m * math.sqrt(x * y)))


def settled_rate(run: xr.Dataset) -> float:
    """deg/s: the mean of the last tenth."""
    rate = run["rate_estimate"].values
    return float(np.degrees(rate[-len(rate) // 10 :].mean()))


@pytest.mark.parametrize("target", [0.0, 20.0])
def test_the_modes_are_matched_or_held_at_a_split(target: float) -> None:
    scenario = REBALANCED.replace({**SPLIT, "trim.target": target})
    assert left(scenario, fg.simulate(scenario.replace({"trim": {}})))[0] == pytest.approx(53.16, abs=0.1)
    run = fg.simulate(scenario)
    assert left(scenario, run)[0] == pytest.approx(target, abs=1.5)  # noise of a reading .6 Hz
    assert settled_rate(run) == pytest.approx(10.0, abs=0.1)
    wanted = 7.25 if target == 0.0 else 5.72
    assert float(run["tuning_voltage"][-1]) == pytest.approx(wanted, abs=0.15)
    share = run["tone_share"].values
    assert share[0] == 0.0
    assert share[len(share) // 2 :] == pytest.approx(1.0, abs=0.1)


def test_fringing_fields_show_in_the_share_and_do_not_move_the_split() -> None:
    fringing = {"quadrature": {"fringe": 1.2}}
    each = [{**dict(one), **fringing.get(one.role, {})} for one in REBALANCED.electrodes.each]
    scenario = REBALANCED.replace({**SPLIT, "electrodes": each})
    run = fg.simulate(scenario)
    assert float(run["tone_share"][-1]) == pytest.approx(1.2, abs=0.1)
    assert left(scenario, run)[0] == pytest.approx(0.0, abs=1.5)


def test_where_y_does_not_answer_the_tone_the_voltages_stay() -> None:
    """A law that holds y with all that the drivers have, against its own noise, hides the tone."""
    loud = fg.simulate(REBALANCED.replace({**SPLIT, "controller.kind": "pid", "reference.kind": ["sine", "rest"]}))
    share, volts = loud["tone_share"].values, loud["tuning_voltage"].values
    changed = np.flatnonzero(np.diff(volts)) + 1
    found = np.flatnonzero(np.diff(share)) + 1
    assert len(found) > 8
    assert len(changed) < len(found) / 2
    assert ((share[changed] > 0.5) & (share[changed] < 2.0)).all()


def test_the_quadrature_is_nulled_at_the_split_and_at_matched_modes() -> None:
    springs = dict(REBALANCED.plant.stiffness)
    more = {"plant.stiffness": {**springs, "xy": springs["xy"] + 0.02}}
    for trim in (NULL, SPLIT | NULL):
        scenario = REBALANCED.replace({**trim, **more})
        untrimmed = left(scenario, fg.simulate(scenario.replace({"trim": {}})))[1]
        assert untrimmed > 10.0
        run = fg.simulate(scenario)
        assert abs(left(scenario, run)[1]) < 0.02 * untrimmed
        assert settled_rate(run) == pytest.approx(10.0, abs=0.1)


def test_a_lag_that_the_datasheet_denies_moves_the_split_by_the_bandwidth_of_the_law() -> None:
    """By about the phase that it costs times the bandwidth: the force that acts is taken for an earlier one."""
    of_law = {"rebalance_bandwidth": 200.0, "demodulation_bandwidth": 2000.0, "output_bandwidth": 90.0}
    changes = {f"controller.{name}": value / 3925.29 for name, value in of_law.items()}
    calm = {"trim.modulation": 5.0, "trim.gain": 0.5, "electronics.pole": 1e5, "run.duration": 1e4}
    known = REBALANCED.replace({**SPLIT, **changes, **calm})
    found = [left(each, fg.simulate(each))[0] for each in (known, known.replace({"datasheet.lag": 0.0}))]
    assert found[0] == pytest.approx(0.0, abs=0.3)
    phase = math.atan(3925.29 / 1e5)
    assert found[1] - found[0] == pytest.approx(-0.9 * phase * 200.0, rel=0.05)


def test_the_voltages_are_recorded_and_stay_within_their_range() -> None:
    run = fg.simulate(REBALANCED.replace({"run.duration": 100.0}))
    assert run["drive_voltage"].dims == ("time", "axis")
    assert {run[f"{name}_voltage"].attrs["units"] for name in ("drive", "tuning", "nulling")} == {"V"}
    assert set(run["tuning_voltage"].values) == {0.0}
    assert set(run["nulling_voltage"].values) == {5.0}
    force = run["drive_voltage"].values[1:] * at_bias(REBALANCED).gain[[0, 2]]
    np.testing.assert_allclose(force, run["applied_control"].values[1:], rtol=1e-9, atol=1e-15)
    each = [{**dict(one), **({"range": 5.0} if one.role == "tuning" else {})} for one in REBALANCED.electrodes.each]
    limited = fg.simulate(REBALANCED.replace({**SPLIT, "electrodes": each}))
    assert float(limited["tuning_voltage"].max()) == 5.0


@pytest.mark.parametrize("ratio", [0.95, 1.0])
def test_open_loop_reads_the_rate_by_the_split_that_the_trim_holds(ratio: float) -> None:
    """Whatever split the modes have without it."""
    slow = {"trim.interval": 0.3, "trim.target": 30.0, "run.duration": 60000.0, "adaptation.initial_ratio": ratio}
    of_law = {"controller.kind": "open_loop", "controller.output_bandwidth": 20.0 / 3925.29}
    run = fg.simulate(REBALANCED.replace({**of_law, **SPLIT, **NULL, **slow}))
    assert settled_rate(run) == pytest.approx(10.0, rel=0.01)


def test_the_tuning_acts_from_the_first_instant_on() -> None:
    """Before the first update of the voltages, too, which comes late; the tone is as good as silent."""
    each = [{**dict(one), **({"bias": 4.0} if one.role == "tuning" else {})} for one in REBALANCED.electrodes.each]
    start = {"run.units": "nondimensional", "run.initial_position": (0.0, 1e-6), "run.duration": 0.1}
    late = {"run.record_every": 1, "electronics.update_delay": 0.02 / REBALANCED.plant.scales.rate}
    fixed = REBALANCED.replace({**start, **late})
    soft = fixed.replace({"electrodes": each})
    trimmed = soft.replace({**SPLIT, "trim.modulation": 1e-6})
    speed, of_fixed, of_trimmed = (float(fg.simulate(one)["velocity"][1, 1]) for one in (soft, fixed, trimmed))
    assert speed - of_fixed > 4e-10
    assert of_trimmed == pytest.approx(speed, abs=1e-13)


def test_without_a_trim_its_fields_change_no_bit() -> None:
    short = REBALANCED.replace({"run.duration": 200.0})
    fields = {"interval": 0.1, "gain": 0.2, "modulation": 0.5, "frequency": 200.0, "target": 3.0}
    other = fg.simulate(short.replace({f"trim.{name}": value for name, value in fields.items()}))
    for name, values in fg.simulate(short).items():
        np.testing.assert_array_equal(values, other[name])


def test_runs_with_and_without_electrodes_are_recorded_together() -> None:
    short = REBALANCED.replace({"run.duration": 50.0, "run.record_every": 1})
    springs = dict(plant_at_bias(short).stiffness)
    forces = short.replace({"plant.stiffness": springs, "electrodes": [], "electronics": {}})
    runs = fg.simulate_many([short, forces])
    assert np.isfinite(runs["drive_voltage"][0]).all()
    assert np.isnan(runs["drive_voltage"][1]).all()
    assert np.isfinite(runs["position"]).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"trim.tuning": "split"}, "trim.modulation is 0.0: it must be above 0 for a trim"),
        (
            {**SPLIT, "electrodes": [dict(one) for one in SHIPPED.electrodes.each if one.role != "quadrature"]},
            'trim.tuning is "split": it needs one electrode of role quadrature, with a bias and along x or y, whose '
            "nulling has the tone; there are 0",
        ),
        (
            {**SPLIT, "electrodes": [dict(one) for one in SHIPPED.electrodes.each if one.role != "tuning"]},
            'trim.tuning is "split": it needs one electrode of role tuning, plates along y; there are 0',
        ),
        ({**NULL, "reference.kind": ["rest", "sine"]}, "it needs a reference of kind sine on x"),
        ({**NULL, "reference.kind": "sine"}, "it needs a reference of y at rest, or with the frequency of x"),
        (
            {**NULL, "controller.kind": "whole_angle"},
            'trim.quadrature is "null": it must be fixed with controller.kind whole_angle, whose vibration leaves x',
        ),
        ({**NULL, "trim.frequency": 2000.0}, "trim.frequency is 2000.0: it must be less than a quarter"),
        ({**NULL, "trim.interval": 0.01}, "trim.interval is 0.01: it must be at least 4 periods"),
        ({**SPLIT, "controller.kind": "open_loop"}, "it must be at least 5 times its decay, 0.1796"),
        ({**SPLIT, "trim.target": 400.0}, "trim.target is 400.0: its magnitude must be less than trim.frequency"),
    ],
    ids=["modulation", "quadrature", "tuning", "x", "y", "pattern", "frequency", "interval", "decay", "target"],
)
def test_a_trim_that_cannot_work_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        SHIPPED.replace({"reference.kind": ["sine", "rest"], **changes})
    assert said in str(refused.value)


def test_a_target_without_a_trim_refuses_it() -> None:
    with pytest.raises(ScenarioError, match=r"trim\.tuning is split: it must be fixed for a controller without its"):
        coefficients_header(REBALANCED.replace(SPLIT), "float")
