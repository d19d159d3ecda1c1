"""`fracgyro datasheet` and the figures in volts of `fracgyro rate`: rows, files, and closed forms."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.rate import accelerations, procedures, thermal
from fracgyro.rate.datasheet import TITLES
from fracgyro.rate.in_volts import angle_drift, angle_figures, ripple_figures, slopes, volts_figures
from fracgyro.rate.plots import angle_chart
from fracgyro.rate.procedures import MISSING, Sheet
from fracgyro.rate.runs import RATES
from fracgyro.rate.sensor import Sensor
from fracgyro.scenario.terms import white_density
from fracgyro.scenario.volts_core import plant_at_bias
from test_volts import BOLTZMANN, CHARGE, DUAL, EPSILON, REBALANCE, both, combs

ROOT = Path(__file__).resolve().parents[2]
STILL = DUAL.replace({**REBALANCE, "run.duration": 3000.0, "run.record_every": 1})
PLANT = STILL.plant
OMEGA = math.sqrt(PLANT.stiffness.xx / PLANT.mass)
SPLIT = math.sqrt(PLANT.stiffness.yy / PLANT.mass) - OMEGA
COUPLED = 2 * PLANT.mass * PLANT.reference_frequency * math.radians(300.0)
# Combs so far from each other that nothing bends.
VOLTS = [*both(combs, "force", gap=1e-3, count=100_000), *both(combs, "pickoff", gap=1e-3, count=100_000)]
SLOPE = 4 * 100_000 * EPSILON * 6e-5 / 1e-3  # F/m; the gain is 5 V times it
QUADRATURE = {"plant.stiffness_deviation": {"xx": 0.0, "xy": COUPLED, "yy": 0.0}}


def sensor(changes: dict[str, Any]) -> Sensor:
    return Sensor.of(STILL.replace(changes), 2)


def figure(changes: dict[str, Any], key: str) -> float:
    return {each.key: each.value for each in volts_figures(sensor(changes))}[key]


# -- Figures in volts --------------------------------------------------------------------------------------------------


def test_feedthrough_is_read_as_a_rate_in_proportion_to_the_split() -> None:
    """1 fF from the drive of x to the pick-off of y: -delta beta F_x/A, beta = C_f/(V_b C' G)."""
    fields = {"electrodes": VOLTS, "electronics.feedthrough": (0.0, 0.0, 1e-15, 0.0)}
    beta = 1e-15 / (5.0 * SLOPE * 5.0 * SLOPE)
    force = PLANT.damping.xx * OMEGA * PLANT.reference_length
    closed = -math.degrees(SPLIT * beta * force / PLANT.reference_length) * 3600
    assert figure(fields, "bias_by_feedthrough") == pytest.approx(closed, rel=0.03)


def test_a_pole_that_is_not_known_turns_quadrature_into_a_bias() -> None:
    fields = {**QUADRATURE, "electronics.pole": 1e6, "datasheet.lag": 0.0}
    closed = 300.0 * 3600 * math.sin(math.atan(OMEGA / math.tau / 1e6))
    assert abs(figure(fields, "bias_by_phase")) == pytest.approx(closed, rel=0.03)


def test_voltages_are_those_of_the_drive_and_of_the_rotation() -> None:
    """Drive of x: d omega A over the gain; at 300 deg/s y is held by 2 m Omega omega A more."""
    gain, length = 5.0 * SLOPE, PLANT.reference_length
    found = {each.key: each.value for each in volts_figures(sensor({"electrodes": VOLTS}))}
    assert found["voltage_at_rest_x"] == pytest.approx(PLANT.damping.xx * OMEGA * length / gain, rel=0.02)
    turning = 2 * PLANT.mass * math.radians(300.0) * OMEGA * length / gain
    assert found["voltage_at_range_y"] == pytest.approx(turning, rel=0.02)
    assert found["voltage_at_rest_y"] < 0.01 * turning


def test_the_readout_is_stated_in_meters_and_farads_with_its_shares() -> None:
    made = STILL.replace({"electrodes": VOLTS, **CHARGE})
    slope, capacitance = SLOPE, SLOPE * 2e-5
    assert slopes(made) == pytest.approx((slope, slope), rel=1e-12)
    found = {each.key: each for each in volts_figures(Sensor.of(made, 2))}
    omega = math.sqrt(plant_at_bias(made).stiffness.xx / PLANT.mass)
    parts = np.array([5e-9 * (capacitance + 4e-12), math.sqrt(4 * BOLTZMANN * 300 / 1e7) / omega]) / (5.0 * slope)
    assert found["readout_x_m"].value == pytest.approx(math.hypot(*parts), rel=1e-9)
    assert found["readout_x_farad"].value == pytest.approx(1e18 * slope * math.hypot(*parts), rel=1e-9)
    shares = 100 * parts**2 / (parts**2).sum()
    assert f"{shares[0]:.3g} % by the amplifiers' voltage noise, {shares[1]:.3g} % by" in found["readout_x_m"].note


def test_the_bound_of_each_noise_is_below_that_of_all() -> None:
    thermal = {"disturbance": {"kind": "noise", "density": 8.66e-16}}
    made = STILL.replace({**thermal, "reference.kind": "sine", "electrodes": VOLTS, **CHARGE})
    found = {each.key: each.value for each in volts_figures(Sensor.of(made, 2)) if each.key.startswith("bound")}
    whole = fg.rate.bound_angle_random_walk(made)
    assert whole is not None
    all_of_them = math.degrees(whole.known) * 60
    assert found.keys() == {"bound_thermal", "bound_voltage_noise", "bound_feedback_resistance"}
    assert max(found.values()) < all_of_them
    quiet = {"electronics.voltage_noise": 0.0, "electronics.feedback_resistance": math.inf}
    single = fg.rate.bound_angle_random_walk(made.replace(quiet))
    assert single is not None
    assert found["bound_thermal"] == pytest.approx(math.degrees(single.known) * 60)


def test_jitter_counts_as_noise_of_the_position_that_grows_with_the_speed() -> None:
    """1 ns at A omega: sigma A omega/sqrt(2) a sample, 1.8e-13 m/sqrt(Hz)."""
    moving = {"reference.kind": "sine", "disturbance": {"kind": "noise", "density": 8.66e-16}}
    made = STILL.replace({**moving, "electronics.jitter": 1e-9})
    found = {each.key: each.value for each in volts_figures(Sensor.of(made, 2))}
    scales, step = PLANT.scales, made.run.step
    speeds = [a * f * scales.velocity for a, f in zip(made.reference.amplitude, made.reference.frequency, strict=True)]
    density = 1e-9 * speeds[0] / math.sqrt(2) * math.sqrt(2 * step * scales.time)
    assert density == pytest.approx(1.8e-13, rel=0.02)
    # Both axes move, at nearly the same speed.
    walks = []
    for speed in speeds:
        noise = {"device.position_noise": 1e-9 * abs(speed) / math.sqrt(2), "disturbance": {"kind": "none"}}
        single = fg.rate.bound_angle_random_walk(STILL.replace({**moving, **noise}))
        assert single is not None
        walks.append(math.degrees(single.known) * 60)
    assert min(walks) < found["bound_jitter"] < max(walks)
    whole = fg.rate.bound_angle_random_walk(made)
    assert whole is not None
    assert found["bound_jitter"] ** 2 + found["bound_thermal"] ** 2 > (math.degrees(whole.known) * 60) ** 2


def test_the_steps_of_the_drivers_count_as_white_noise() -> None:
    thermal = {"disturbance": {"kind": "noise", "density": 8.66e-16}, "reference.kind": "sine"}
    pushed = both(combs, "force", gap=1e-3, count=100_000, bits=12, range=10.0)
    made = STILL.replace({**thermal, "electrodes": [*pushed, *both(combs, "pickoff")]})
    found = {each.key: each for each in volts_figures(Sensor.of(made, 2))}
    step = 20.0 / 2**12 * 5.0 * SLOPE / PLANT.scales.force
    share = step**2 / 12 * made.run.step / (white_density(made) or math.nan)
    walk, of_heat = found["bound_drive_steps"], found["bound_thermal"]
    assert walk.value == pytest.approx(of_heat.value * math.sqrt(share), rel=1e-9)
    assert walk.note.startswith(f"{100 * share:.3g} % of the power of all other noise")


def test_the_noise_of_the_drivers_counts_as_force() -> None:
    thermal = {"disturbance": {"kind": "noise", "density": 8.66e-16}, "reference.kind": "sine"}
    pushed = both(combs, "force", gap=1e-3, count=100_000, noise=1e-5)
    made = STILL.replace({**thermal, "electrodes": [*pushed, *both(combs, "pickoff")]})
    found = {each.key: each for each in volts_figures(Sensor.of(made, 2))}
    # One-sided in N^2/Hz; half of it is two-sided, in units of (m omega0^2 q0)^2/omega0.
    density = 0.5 * (1e-5 * 5.0 * SLOPE / PLANT.scales.force) ** 2 / PLANT.scales.time
    walk, of_heat = found["bound_drivers"], found["bound_thermal"]
    assert walk.value == pytest.approx(of_heat.value * math.sqrt(density / 8.66e-16), rel=1e-9)
    quiet = made.replace({"electrodes": [{**dict(one), "noise": 0.0} for one in made.electrodes.each]})
    without = {each.key: each.value for each in volts_figures(Sensor.of(quiet, 2))}
    assert of_heat.value == pytest.approx(without["bound_thermal"], rel=1e-9)
    assert "bound_drivers" not in without


def test_a_spring_common_to_both_axes_ripples_at_the_split_and_others_do_not() -> None:
    """An isotropic quartic of 1 Hz at the amplitude: 127 deg/s after a filter of 100 Hz."""
    made = fg.Scenario.shipped("dual_mass")
    plant = made.plant
    kappa = 8 * plant.stiffness.xx / (3 * OMEGA / math.tau * plant.reference_length**2)
    own = {"device.cubic_stiffness": (kappa, kappa)}
    (common,) = ripple_figures(Sensor.of(made.replace({**own, "device.cubic_coupling": kappa}), 1))
    assert common.value == pytest.approx(127.0, rel=0.03)
    assert "at 53 Hz" in common.definition
    (apart,) = ripple_figures(Sensor.of(made.replace({**own, "device.cubic_skew": (1e-9 * kappa, 0.0)}), 1))
    assert apart.note.startswith("not above noise")
    assert ripple_figures(Sensor.of(made.replace(own), 1)) == []
    short = made.replace({**own, "device.cubic_coupling": kappa, "run.duration": 5000.0})
    (few,) = ripple_figures(Sensor.of(short, 1))
    assert math.isnan(few.value)
    assert few.note == "not available: the record has fewer than 20 periods of it"


def test_a_device_without_volts_has_none_of_these() -> None:
    assert volts_figures(sensor({})) == angle_figures(angle_drift(sensor({}))) == []


def test_whole_angle_states_its_drift_against_the_angle_and_its_gain() -> None:
    """p = half the difference of the rates of decay, 162 deg/h at .3 rad; the quadrature loop takes 200 ppm."""
    made = fg.Scenario.load(ROOT / "examples/scenarios/disc_whole_angle.toml")
    found = angle_drift(Sensor.of(made, 1))
    drift, lock_in, resolution, gain = angle_figures(found)
    assert lock_in.value == drift.value
    # 2.7e-5 to 2.8e-5 rad by the demodulation's lag and ripple; noise ten times that of the example adds to it.
    assert resolution.value == pytest.approx(math.degrees(2.75e-5) * 3600, rel=0.3)
    noisy = angle_figures(angle_drift(Sensor.of(made.replace({"device.position_noise_density": 1e-12}), 1)))
    assert {each.key: each.value for each in noisy}["angle_resolution"] > 1.2 * resolution.value
    assert drift.value == pytest.approx(162.0, rel=0.1)
    axis = re.match(r"ϑτ = (\S+) deg", drift.note)
    assert axis is not None
    assert math.radians(float(axis[1])) == pytest.approx(0.3, abs=0.02)
    assert gain.value == pytest.approx(1 - 200e-6, abs=2e-6)
    assert "are not separated" not in drift.note
    assert found is not None
    rows = list(csv.reader(angle_chart(found).data.splitlines()))
    assert len(rows) == 61
    measured, fitted = np.array(rows[1:], dtype=float).T[1:]
    assert np.polyfit(fitted, measured, 1)[0] == pytest.approx(1.0, abs=0.1)
    assert np.ptp(fitted) == pytest.approx(2 * drift.value, rel=0.01)


# -- Procedures --------------------------------------------------------------------------------------------------------


def test_polarity_and_asymmetry_of_known_outputs() -> None:
    outputs = np.stack([np.where(RATES > 0, 1.01, 0.99) * RATES] * 3, axis=1)
    assert procedures.polarity(outputs) == 1.0
    assert procedures.polarity(-outputs) == -1.0
    assert procedures.polarity(outputs * [1.0, -1.0, 1.0]) == 0.0
    assert procedures.asymmetry(outputs) == pytest.approx([0.02] * 3)


def rows(fill: Any, *arguments: Any) -> tuple[dict[str, procedures.Row], Sheet]:
    sheet = Sheet()
    fill(sheet, *arguments)
    return {row.key: row for row in sheet.rows}, sheet


def test_rates_about_x_and_y_are_a_quadrature_of_their_product_times_the_sine_of_the_lag() -> None:
    """kxy = m Omega_x Omega_y, as a rate Omega_x Omega_y/(2 omega), of which a hidden phase lets its sine through."""
    hidden = {"plant.centrifugal": True, "electronics.pole": 1e5, "datasheet.lag": 0.0, "run.duration": 6000.0}
    found, sheet = rows(procedures.axes, sensor(hidden))
    rate = math.radians(300.0)
    closed = math.degrees(rate * rate / (2 * OMEGA)) * 3600 * math.sin(math.atan(OMEGA / math.tau / 1e5))
    assert abs(found["rate_about_both"].value) == pytest.approx(closed, rel=0.05)
    assert abs(found["rate_about_x"].value) < 0.05 * closed
    assert len(sheet.points) == 3 * 2 * 2
    assert rows(procedures.axes, sensor({}))[0]["rate_about_both"].note.startswith(MISSING)


def test_a_bias_by_the_dampers_follows_their_temperature() -> None:
    """dxy/2m, 1 deg/s, at 3,000 ppm/K: 10.8 deg/h/K."""
    dampers = {"plant.damping_deviation": {"xx": 0.0, "xy": 2 * PLANT.mass * math.radians(1.0), "yy": 0.0}}
    found, sheet = rows(thermal.temperature, sensor({**dampers, "device.damping_drift": 3000.0}))
    assert abs(found["zero_rate_per_kelvin"].value) == pytest.approx(10.8, rel=0.01)
    assert found["zero_rate_residual"].value < 1.0
    assert {point.at for point in sheet.points} == {-40.0, -20.0, 0.0, 20.0, 40.0}
    assert MISSING in found["temperature_hysteresis"].note
    for fill in (thermal.temperature, thermal.warm_up):
        without, _ = rows(fill, sensor(dampers))
        assert all(math.isnan(row.value) and MISSING in row.note for row in without.values())


def test_axes_of_the_damping_that_turn_give_bias_hysteresis_and_warm_up() -> None:
    """Theta (dxx - dyy)/2m per kelvin; 2w of it by the backlash; a tenth is left after ln 10 time constants."""
    d, per_kelvin = PLANT.damping, 2e-3
    turning = {"device.damping_axis_drift": 1e6 * per_kelvin, "device.hysteresis": 1.5}
    made = sensor({**turning, "device.warm_up_rise": 4.0, "device.warm_up_time": 30.0})
    closed = abs(math.degrees(per_kelvin * (d.xx - d.yy) / (2 * PLANT.mass)) * 3600)  # deg/h/K
    found, _ = rows(thermal.temperature, made)
    assert abs(found["zero_rate_per_kelvin"].value) == pytest.approx(closed, rel=0.02)
    assert abs(found["temperature_hysteresis"].value) == pytest.approx(3.0 * closed, rel=0.02)
    warming, sheet = rows(thermal.warm_up, made)
    assert abs(warming["warm_up_change"].value) == pytest.approx(4.0 * closed, rel=0.02)
    assert warming["warm_up"].value == pytest.approx(30.0 * math.log(10.0), rel=0.02)
    assert [point.at for point in sheet.points] == [0.0, 0.0, 2.0, 2.0, 4.0, 4.0]


def test_the_warm_up_time_of_a_bias_that_is_not_linear_is_that_of_its_course() -> None:
    """T²: the rest of the change, 1 - (1 - e)², is a tenth at e = 1 - sqrt(0.9)."""
    found = thermal.warm_up_time(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0, 4.0]), 10.0)
    assert found == pytest.approx(-10.0 * math.log(1 - math.sqrt(0.9)), rel=1e-3)


@pytest.mark.parametrize("name", ["dual_mass", "tuned_in_air", "disc"])
def test_the_undriven_vibration_runs_down_by_its_dampers(name: str) -> None:
    scenario = fg.Scenario.shipped(name)
    found, _ = rows(procedures.undriven, scenario)
    assert found["run_down_time"].value == pytest.approx(2 * scenario.plant.mass / scenario.plant.damping.xx, rel=0.01)
    if name == "disc":
        assert found["angle_gain"].value == pytest.approx(1.0, abs=1e-5)
    else:
        assert MISSING in found["angle_gain"].note


def test_a_power_cycle_starts_later_on_the_same_motion() -> None:
    made = procedures.turned(fg.Scenario.shipped("dual_mass"), math.pi / 2)
    assert made["run.initial_position"] == pytest.approx((1.0, 0.0), abs=1e-12)
    assert made["run.initial_velocity"] == pytest.approx((0.0, -1.013503185), abs=1e-9)
    assert made["reference.phase"] == pytest.approx((math.pi / 2, math.pi))
    noisy = sensor({"disturbance": {"kind": "noise", "density": 1e-12}})
    found, sheet = rows(procedures.power_cycles, noisy, 4)
    values = [3600 * point.value for point in sheet.points]
    assert found["repeatability"].value == pytest.approx(np.std(values, ddof=1))
    assert found["repeatability"].low < found["repeatability"].value < found["repeatability"].high
    assert len({point.at for point in sheet.points}) == 4


def test_a_vibration_near_the_mode_is_read_as_a_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Share a/(2 A omega), as the force m share a of y resembles that of the rate, 2 m Omega omega A, at that phase."""
    monkeypatch.setattr(accelerations, "FREQUENCIES", ())
    monkeypatch.setattr(accelerations, "NEAR", 1 + 5 / (OMEGA / math.tau))  # 5 Hz, by loops of 90 Hz and more
    ripples = []
    for share in (1e-3, 5e-4, 0.0):
        found, sheet = rows(
            accelerations.accelerations, sensor({"device.acceleration_share": (0.0, share), "run.duration": 9000.0})
        )
        ripples.append(found["sine_ripple_y"].value)
        for key, row in found.items():
            assert row.value == 0.0 or (share > 0.0 and not key.endswith("_x")), key
    amplitude = math.degrees(1e-3 * 9.80665 / (2 * PLANT.reference_length * OMEGA))
    assert ripples[0] == pytest.approx(amplitude / math.sqrt(2), rel=0.05)
    assert ripples[1] == pytest.approx(ripples[0] / 2, rel=0.01)
    assert {point.clause for point in sheet.points} == {"12.11", "12.17"}


def test_an_acceleration_that_a_run_does_not_survive_is_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accelerations, "SHOCK", 1e9)
    found, _ = rows(accelerations.accelerations, sensor({"device.acceleration_share": (1.0, 1.0)}))
    assert math.isnan(found["shock_x"].value)
    assert "diverges" in found["shock_x"].note
    assert math.isfinite(found["sine_ripple_x"].value)


# -- The datasheet -----------------------------------------------------------------------------------------------------


def test_a_datasheet_has_every_clause_and_never_a_zero_for_what_is_missing(tmp_path: Path) -> None:
    noisy = {"disturbance": {"kind": "noise", "density": 8.66e-16}, "device.position_noise_density": 1e-13}
    STILL.replace(noisy).save(tmp_path / "device.toml")
    words = ["datasheet", tmp_path / "device.toml", "--quick", "--rest", 0.3, "--out", tmp_path / "out", "--json"]
    ran = CliRunner().invoke(cli, list(map(str, words)))
    assert ran.exit_code == 0, ran.output
    content = json.loads(ran.stdout)
    assert content == json.loads((tmp_path / "out/datasheet.json").read_text(encoding="utf-8"))
    found = content["rows"]
    assert [row["clause"] for row in found] == sorted(
        (row["clause"] for row in found), key=lambda clause: int(clause[3:])
    )
    assert {row["clause"] for row in found} == TITLES.keys()
    missing = [row for row in found if MISSING in row["note"]]
    assert {"warm_up", "g_sensitivity_x", "shock_y", "voltage", "readout", "angle_drift"} <= {
        row["key"] for row in missing
    }
    assert all(row["value"] is None for row in missing)
    measured = {row["key"]: row["value"] for row in found if row not in missing}
    assert measured["polarity"] == 1.0
    assert abs(measured["scale_factor_error"]) < 1e4
    with open(tmp_path / "out/points.csv", encoding="utf-8", newline="") as file:
        points = list(csv.DictReader(file))
    assert sum(point["procedure"] == "constant rates" for point in points) == 2 * len(RATES)
    assert sum(point["procedure"] == "power cycles" for point in points) == 6
    html = (tmp_path / "out/datasheet.html").read_text(encoding="utf-8")
    assert all(f'id="c{clause}"' in html for clause in TITLES)
