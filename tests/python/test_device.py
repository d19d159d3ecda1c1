"""A dynamic rate and a real device: against the oracle, each effect by itself, and refused input. Reading order:
agreement with the oracle, rates, effects of the device, many runs and metrics, files, other integrations.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import device_oracle
import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro import _core
from fracgyro.rate.allan import allan
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.kinds import DEVICE_CHANNELS
from fracgyro.scenario.to_core import core_setup
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import periodogram

PAPER = Scenario.paper()
SHORT = PAPER.replace({"run.duration": 0.5})
MEAN = 0.1  # the paper's rate, nondimensional; 1 is 1000 rad/s
RATES: dict[str, dict[str, Any]] = {
    "step": {"rate.kind": "step", "rate.amplitude": 700.0, "rate.start": 1e-4},
    "staircase": {
        "rate.kind": "staircase",
        "rate.amplitude": -300.0,
        "rate.start": 1e-4,
        "rate.hold": 5e-5,
        "rate.levels": 3,
    },
    "sine": {"rate.kind": "sine", "rate.amplitude": 2000.0, "rate.start": 1e-4, "rate.frequency": 3e4},
    "chirp": {"rate.kind": "chirp", "rate.amplitude": 900.0, "rate.frequency": 5e3, "rate.final_frequency": 9e4},
    "noise": {"rate.kind": "noise", "rate.amplitude": 900.0, "rate.frequency": 4e4, "rate.seed": 3},
    "table": {"rate.kind": "table", "rate.points": [[0.0, 0.0], [2e-4, 800.0], [4e-4, -500.0]]},
}
EFFECTS: dict[str, dict[str, Any]] = {
    "position alone": {"device.sensing": "position"},
    "position alone, noisy": {
        "device.sensing": "position",
        "device.position_noise": 1e-9,
        "controller.observer_bandwidth": 150.0,
    },
    "noise": {"device.position_noise": 1e-9, "device.velocity_noise": 1e-6},
    "density": {"device.position_noise_density": 1e-12, "device.velocity_noise_density": 1e-9},
    "converters": {
        "device.position_range": 2e-6,
        "device.position_bits": 14,
        "device.velocity_range": 1e-2,
        "device.velocity_bits": 14,
    },
    "clipping": {"device.position_range": 4e-7, "device.velocity_range": 3e-3},
    "delay": {"device.delay": 1},
    "actuator": {"device.actuator_limit": 6e-5, "device.actuator_bits": 10},
    "drift": {"device.stiffness_drift": -60.0, "device.temperature_ramp": 1e6},
    "drift of points": {
        "device.stiffness_drift": 500.0,
        "device.temperature_points": [[1e-4, 0.0], [2e-4, 80.0], [3e-4, 20.0]],
    },
    "cubic": {"device.cubic_stiffness": (2e13, -1e13)},
    "converters of each axis": {
        "device.position_range": [2e-6, 6e-7],
        "device.position_bits": 14,
        "device.velocity_range": [1e-2, 1.4e-2],
        "device.velocity_bits": 14,
    },
    "damping drift": {"device.damping_drift": 5e5, "device.temperature_ramp": 1e4},
    "gains of the pick-offs": {"device.pickoff_gain_error": [0.01, -0.02]},
    "turned pick-offs": {"device.pickoff_misalignment": 0.01},
    "gains of the force": {"device.force_gain_error": [0.05, -0.03]},
    "turned actuators": {"device.force_misalignment": -0.02},
    "gains and turns": {
        "device.pickoff_gain_error": [0.01, -0.02],
        "device.pickoff_misalignment": -0.015,
        "device.force_gain_error": [0.05, -0.03],
        "device.force_misalignment": 0.02,
        "device.actuator_limit": 6e-5,
    },
    "flicker": {
        "device.position_noise": 1e-10,
        "device.position_noise_corner": 2e5,
        "device.velocity_noise_density": 1e-9,
        "device.velocity_noise_corner": 3e5,
    },
    "flicker of the rate": {"device.bias_instability": 20.0},
    "walk of the rate": {"device.rate_random_walk": 1e4},
}


def true_rate(scenario: Scenario, recorded: np.ndarray) -> device_oracle.Rate:
    """Omega_z and its slope by the words of the scenario; noise, of no closed form, through what was recorded."""
    r, h = scenario.rate, scenario.run.step
    scales = scenario.plant.scales
    amplitude, low, high = (a / scales.rate for a in (r.amplitude or 0.0, r.frequency, r.final_frequency))
    start, hold = r.start / scales.time, (r.hold or 0.0) / scales.time
    spline = CubicSpline(h * np.arange(len(recorded)), recorded)

    def at(n: int, since: float) -> tuple[float, float]:
        tau = n * h + since - start
        if r.kind == "noise":
            return float(spline(n * h + since)), float(spline(n * h + since, 1))
        if r.kind == "table":
            times, values = np.array(r.points).T
            return float(np.interp((n * h + since) * 1e-3, times, values)) / 1000, math.nan
        if r.kind == "constant" or n < round(start / h):
            return MEAN, 0.0
        if r.kind in ("step", "staircase"):
            climbed = 1 if r.kind == "step" else min(1 + (n - round(start / h)) // round(hold / h), r.levels)
            return MEAN + climbed * amplitude, 0.0
        sweep = (high - low) / (scenario.run.duration - start) if r.kind == "chirp" else 0.0
        angle, turning = low * tau + sweep * tau**2 / 2, low + sweep * tau
        return MEAN + amplitude * math.sin(angle), amplitude * turning * math.cos(angle)

    return at


def expected(scenario: Scenario, run: xr.Dataset) -> dict[str, np.ndarray]:
    device, samples = scenario.device, run.sizes["time"]
    draws = {}
    for stream, name in ((1, "position"), (2, "velocity")):
        density = getattr(device, f"{name}_noise_density")
        # A one-sided density N up to half of f_s = 1 MHz has variance N² f_s/2.
        deviation = getattr(device, f"{name}_noise") + density * math.sqrt(1e6 / 2)
        deviation /= getattr(scenario.plant.scales, "length" if stream == 1 else "velocity")
        draws[name] = deviation * drawn(scenario, samples, stream)
        # That of 1/f is the white one at the corner f_c: two-sided A^2/omega = sigma^2 h there.
        corner = 2 * math.pi * getattr(device, f"{name}_noise_corner") * 1e-6
        draws[name] += deviation * math.sqrt(corner) * device_oracle.flicker(drawn(scenario, samples, stream + 3))
    rate = true_rate(scenario, run["angular_rate"].values)
    bias = rate_bias(scenario, samples)
    return device_oracle.simulate(scenario, run["disturbance"].values, draws["position"], draws["velocity"], rate, bias)


def drawn(scenario: Scenario, samples: int, stream: int) -> np.ndarray:
    """Normals of a stream of the seed, (samples, 2)."""
    changes = {"disturbance.kind": 1.0, "disturbance.standard_deviation": 1.0, "disturbance.hold_steps": 1.0}
    return np.asarray(_core.disturbance(core_setup(scenario, changes), 0, samples, stream))


def rate_bias(scenario: Scenario, samples: int) -> np.ndarray:
    """Disturbance rate, nondimensional: 1 is 1000 rad/s. The square root of a step is that of 1e-6 s."""
    white = drawn(scenario, samples, 6)
    flicker, walk = device_oracle.flicker(white[:, 0]), np.cumsum(white[:, 1]) * 1e-3
    return np.asarray(scenario.device.bias_instability * flicker + scenario.device.rate_random_walk * walk) / 1000


def assert_agrees(scenario: Scenario, tolerance: float = 1e-9) -> None:
    """Positions to `tolerance`, forces, hundreds that answer velocities by hundreds, to a million times that."""
    run = fg.simulate(scenario)
    factors = {"position": 1, "velocity": 1e3, "control": 1e6, "applied_control": 1e6}
    factors |= {"measured_position": 1, "measured_velocity": 1e3}
    wanted = expected(scenario, run)
    for name, factor in factors.items():
        np.testing.assert_allclose(run[name].values, wanted[name], rtol=0, atol=factor * tolerance, err_msg=name)
    np.testing.assert_allclose(run["rate_bias"], rate_bias(scenario, run.sizes["time"]), rtol=0, atol=1e-12)
    ideal = fg.simulate(scenario.replace({"rate": {}, "device": {}}))
    assert np.abs(run["position"].values - ideal["position"].values).max() > 1e3 * tolerance, "it has no effect"


# -- Agreement with the oracle -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", RATES)
def test_under_every_rate_the_loop_agrees_with_the_oracle(kind: str) -> None:
    assert_agrees(SHORT.replace(RATES[kind]))


@pytest.mark.parametrize("effect", EFFECTS)
def test_with_every_effect_alone_the_loop_agrees_with_the_oracle(effect: str) -> None:
    assert_agrees(SHORT.replace(EFFECTS[effect]))


@pytest.mark.parametrize("kind", ["sine", "chirp"])
def test_the_centrifugal_and_euler_forces_follow_the_rate(kind: str) -> None:
    assert_agrees(SHORT.replace({**RATES[kind], "plant.centrifugal": True}))


def test_rates_about_x_and_y_turn_the_springs_as_equation_1_says() -> None:
    end, points = 2.0, [[0.0, 1000.0, -2000.0], [1e-3, -3000.0, 500.0], [2e-3, 2000.0, 2500.0]]
    made = PAPER.replace(
        {
            "plant.centrifugal": True,
            "plant.transverse_rate": [700.0, -300.0],
            "rate.transverse_points": points,
            "run.initial_velocity": [0.3, -0.7],
            "run.duration": end,
            "disturbance": {"kind": "none"},
        }
    )
    run = fg.simulate(made, controller=lambda sample: (0.0, 0.0))
    damping, _, z, *_ = made.plant.nondimensional()
    springs = made.plant.stiffness.entries() / made.plant.scales.stiffness
    times, *rates = np.array(points).T

    def derivative(t: float, state: np.ndarray) -> np.ndarray:
        x, y = (np.interp(1e-3 * t, times, rate) / made.plant.scales.rate for rate in rates)
        d = np.array([[damping[0], damping[1] - 2 * z], [damping[1] + 2 * z, damping[2]]])
        k_xx, k_xy, k_yy = springs + np.array([-(y * y + z * z), x * y, -(x * x + z * z)])
        k = np.array([[k_xx, k_xy], [k_xy, k_yy]])
        return np.concatenate([state[2:], -d @ state[2:] - k @ state[:2]])

    start = np.array([*made.run.initial_position, *made.run.initial_velocity])
    found = solve_ivp(derivative, (0.0, end), start, t_eval=run["time"], rtol=1e-11, atol=1e-13, max_step=0.02)
    np.testing.assert_allclose(run["position"], found.y[:2].T, atol=1e-9)
    constant = made.replace({"rate.transverse_points": [[0.0, 700.0, -300.0]]})
    held = fg.simulate(made.replace({"rate.transverse_points": None}), controller=lambda sample: (0.0, 0.0))
    same = fg.simulate(constant, controller=lambda sample: (0.0, 0.0))
    np.testing.assert_allclose(same["position"], held["position"], atol=1e-12)
    assert abs(held["position"].values - run["position"].values).max() > 1e-3


def test_everything_at_once_agrees_with_the_oracle() -> None:
    changes = {**RATES["sine"], "plant.centrifugal": True, "run.step": 5e-4, "disturbance.hold": None}
    for effect in ("noise", "converters", "delay", "cubic"):
        changes |= EFFECTS[effect]
    scenario = SHORT.replace(changes)
    run = fg.simulate(scenario)
    wanted = expected(scenario, run)
    np.testing.assert_allclose(run["position"].values, wanted["position"], rtol=0, atol=1e-9)


# -- Rates ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["step", "staircase", "sine", "chirp", "table"])
def test_the_recorded_rate_is_the_one_asked_for(kind: str) -> None:
    scenario = SHORT.replace(RATES[kind])
    run = fg.simulate(scenario)
    at = true_rate(scenario, run["angular_rate"].values)
    wanted = [at(n, 0.0)[0] for n in range(run.sizes["time"])]
    np.testing.assert_allclose(run["angular_rate"].values, wanted, rtol=0, atol=1e-9)
    assert np.ptp(wanted) > 0.1


def test_in_si_units_the_rate_is_in_radians_per_second() -> None:
    run = fg.simulate(SHORT.replace({**RATES["step"], "run.units": "SI"}))
    assert float(run["angular_rate"][0]) == pytest.approx(100.0)
    assert float(run["angular_rate"][-1]) == pytest.approx(800.0)
    assert run["angular_rate"].attrs["units"] == "rad/s"
    assert run["measured_position"].attrs["units"] == "m"


def test_noise_of_the_rate_has_its_own_seed() -> None:
    rates = [
        fg.simulate(SHORT.replace({**RATES["noise"], "rate.seed": rate, "disturbance.seed": force}))["angular_rate"]
        for rate, force in ((1, 1), (1, 2), (2, 1))
    ]
    assert (rates[0] == rates[1]).all()
    assert not (rates[0] == rates[2]).any()


# -- Effects of the device -----------------------------------------------------------------------------------


def test_the_ideal_device_has_none_of_their_channels() -> None:
    run = fg.simulate(SHORT)
    assert not set(run) & {channel.name for channel in DEVICE_CHANNELS}


def test_a_device_with_nothing_but_a_name_for_an_effect_has_the_bits_of_the_ideal_one() -> None:
    run, ideal = fg.simulate(SHORT.replace({"device.temperature_ramp": 5.0})), fg.simulate(SHORT)
    for name in ideal:
        assert run[name].values.tobytes() == ideal[name].values.tobytes(), name
    assert (run["measured_position"] == run["position"]).all()
    assert (run["applied_control"] == run["control"]).all()


def test_the_true_error_is_recorded_and_not_the_measured_one() -> None:
    run = fg.simulate(SHORT.replace({"device.position_noise": 1e-8}))
    np.testing.assert_array_equal(run["error"], run["position"] - run["reference"])
    off = (run["measured_position"] - run["position"]).values
    assert off.std() == pytest.approx(1e-2, rel=0.1)


def test_seeds_draw_the_noise_of_the_sensors_anew() -> None:
    runs = fg.simulate_many([SHORT.replace({**EFFECTS["noise"], "disturbance.kind": "none"})], seeds=[1, 2])
    off = runs["measured_position"] - runs["position"]
    assert np.abs(np.corrcoef(off[0, :, 0], off[1, :, 0])[0, 1]) < 0.2


def test_a_delayed_force_is_the_one_asked_for_before() -> None:
    run = fg.simulate(SHORT.replace({"device.delay": 2}))
    np.testing.assert_array_equal(run["applied_control"][2:], run["control"].values[:-2])
    assert (run["applied_control"][:2] == 0).all()


def test_the_actuator_saturates_without_the_controller_knowing() -> None:
    run = fg.simulate(SHORT.replace({"device.actuator_limit": 1.8e-5}))  # 100 units of force
    asked, given_ = run["control"].values, run["applied_control"].values
    assert np.abs(asked).max() > 200
    np.testing.assert_array_equal(given_, np.clip(asked, -100.0, 100.0))


def test_a_device_that_diverges_on_y_alone_ends_where_an_ideal_one_does() -> None:
    """Uncoupled axes, with all known: x neither knows of y nor of its gain."""
    diagonal = {"xx": 64.0, "xy": 0.0, "yy": 96.0}
    uncoupled = SHORT.replace(
        {
            "plant.stiffness": diagonal,
            "plant.damping": {name: 2e-8 * value for name, value in diagonal.items()},
            "plant.angular_rate": 0.0,
            "controller.kind": "linear",
            "controller.adaptive": False,
            "controller.fractional_gain": (10.0, 3000.0),
            "run.duration": 2.0,
        }
    )
    ends = []
    for limit in (math.inf, 1e300):  # actuator limits: the second makes it a real device, and is never reached
        with pytest.raises(fg.DivergedError) as caught:
            fg.simulate(uncoupled.replace({"device.actuator_limit": limit}))
        position = caught.value.run["position"].values
        assert np.abs(position[:, 0]).max() < 2.0
        assert np.isfinite(position).all()
        ends.append(len(position))
    assert ends[0] == ends[1]


def test_positions_alone_track_nearly_as_well_as_with_a_sensor_of_velocity() -> None:
    rmse = {}
    for sensing in ("full", "position"):
        run = fg.simulate(PAPER.replace({"device.sensing": sensing, "run.duration": 20.0}))
        rmse[sensing] = fg.metrics.rmse(run, (10.0, None)).values
        assert (rmse[sensing] < 1e-4).all()
    assert (rmse["position"] < 2 * rmse["full"]).all()


def test_the_drift_is_parts_per_million_a_kelvin_of_the_temperature() -> None:
    run = fg.simulate(SHORT.replace({"device.stiffness_drift": -30.0, "device.temperature_ramp": 1e5}))
    np.testing.assert_allclose(run["stiffness_drift"], -30e-6 * 1e5 * run["time"].values * 1e-3, rtol=1e-9, atol=1e-18)


def test_the_damping_drift_is_parts_per_million_a_kelvin_of_the_temperature() -> None:
    run = fg.simulate(SHORT.replace({"device.damping_drift": 3e3, "device.temperature_ramp": 1e5}))
    np.testing.assert_allclose(run["damping_drift"], 3e-3 * 1e5 * run["time"].values * 1e-3, rtol=1e-9, atol=1e-18)


def test_flicker_noise_and_white_noise_are_as_dense_at_the_corner() -> None:
    """65 ms at 1 MHz, one-sided densities N^2 (1 + f_c/f) of both axes; 2 % are two deviations of the wider bands."""
    density, corner = 1e-14, 2e4
    changes = {"device.position_noise_density": density, "device.position_noise_corner": corner}
    run = fg.simulate(
        PAPER.replace({**changes, "controller.kind": "linear", "run.duration": 65.535, "run.units": "SI"})
    )
    off = (run["measured_position"] - run["position"]).values
    frequency, found = periodogram(off, fs=1e6, axis=0)
    for low, high, tolerance in ((100.0, 1e3, 0.2), (2e3, 8e3, 0.08), (1.6e4, 2.4e4, 0.06), (5e4, 1.5e5, 0.02)):
        band = (low <= frequency) & (frequency < high)
        wanted = density**2 * np.mean(1 + corner / frequency[band])
        assert found[band].mean() == pytest.approx(wanted, rel=tolerance)


def test_what_acts_as_a_rate_has_the_allan_deviation_of_its_datasheet() -> None:
    """0.664 B where it is flicker noise, K sqrt(tau/3) where it is a walk; over 0.1 s at 1 us."""
    base = PAPER.replace({"controller.kind": "linear", "run.duration": 100.0, "run.units": "SI", "disturbance.seed": 7})
    flicker = fg.simulate_many([base.replace({"device.bias_instability": 0.02})], seeds=range(8))["rate_bias"].values
    walk = fg.simulate_many([base.replace({"device.rate_random_walk": 3.0})], seeds=range(8))["rate_bias"].values
    found = allan(flicker, 1e-6)
    assert found.deviation[4:12] == pytest.approx(np.full(8, 0.664 * 0.02), rel=0.08)
    found = allan(walk, 1e-6)
    assert found.deviation[1:12] == pytest.approx(3.0 * np.sqrt(found.tau[1:12] / 3), rel=0.15)


def test_what_acts_as_a_rate_is_none_and_counts_as_an_error() -> None:
    run = fg.simulate(SHORT.replace(EFFECTS["walk of the rate"]))
    assert (run["angular_rate"] == MEAN).all()
    assert np.ptp(run["rate_bias"].values) > 1e-3
    run["rate_estimate"] = run["angular_rate"] + run["rate_bias"]
    np.testing.assert_allclose(fg.metrics.rate_error(run), run["rate_bias"], rtol=0, atol=1e-15)


# -- Many runs and metrics -----------------------------------------------------------------------------------


def mixed() -> list[Scenario]:
    base = PAPER.replace({"run.duration": 3.0})
    changes = [{}, RATES["sine"], {}, EFFECTS["drift"], EFFECTS["position alone"], EFFECTS["actuator"]]
    changes += [
        EFFECTS["damping drift"],
        EFFECTS["flicker"],
        {**EFFECTS["walk of the rate"], **EFFECTS["gains and turns"]},
    ]
    return [base.replace({**change, "disturbance.seed": i}) for i, change in enumerate(changes)]


def test_metrics_alone_are_those_of_the_recorded_runs_ideal_or_not() -> None:
    found = fg.measure_many(mixed(), transient=1.0)
    for i, scenario in enumerate(mixed()):
        wanted = fg.metrics.summary(fg.simulate(scenario), transient=1.0)
        for name in wanted:
            np.testing.assert_allclose(
                found[name].isel(run=i), wanted[name], rtol=1e-8, atol=1e-12, err_msg=f"{name} of {i}"
            )


def test_recorded_side_by_side_they_have_the_bits_of_single_runs() -> None:
    runs = fg.simulate_many(mixed())
    for i, scenario in enumerate(mixed()):
        alone = fg.simulate(scenario)
        for name in alone:
            assert runs[name].isel(run=i).values.tobytes() == alone[name].values.tobytes(), (name, i)
    assert (runs["angular_rate"].isel(run=0) == MEAN).all()


def test_a_rate_has_settled_within_a_tolerance_of_its_largest_size() -> None:
    run = fg.simulate(SHORT.replace(RATES["step"]))
    run["rate_estimate"] = run["angular_rate"] + xr.where(run["time"] < 0.3, 0.0805, 0.0795)  # at most .8
    assert float(fg.metrics.rate_settling_time(run)) == pytest.approx(0.3)
    np.testing.assert_allclose(fg.metrics.rate_error(run).values[-1], 0.0795)


def test_a_stiffness_estimate_is_judged_by_the_drifting_truth() -> None:
    run = fg.simulate(SHORT.replace(EFFECTS["drift"]))
    truth = np.array([355.3, 70.99, 532.9]) * (1 - 60e-6 * 1e6 * 0.5e-3)
    run["stiffness_estimate"] = run["stiffness_estimate"] * 0 + truth
    assert float(fg.metrics.stiffness_error(run)[-1]) < 1e-4
    assert float(fg.metrics.stiffness_error(run)[0]) == pytest.approx(0.03, rel=1e-2)


def test_a_damping_estimate_is_judged_by_the_drifting_truth() -> None:
    run = fg.simulate(SHORT.replace(EFFECTS["damping drift"]))
    truth = np.array([0.01, 0.002, 0.01]) * (1 + 0.5 * 1e4 * 0.5e-3)
    run["damping_estimate"] = run["damping_estimate"] * 0 + truth
    assert float(fg.metrics.damping_error(run)[-1]) < 1e-12
    assert float(fg.metrics.damping_error(run)[0]) == pytest.approx(2.5, rel=1e-9)


# -- Files ---------------------------------------------------------------------------------------------------


def test_a_file_is_read_beside_the_scenario_and_kept_in_it(tmp_path: Path) -> None:
    (tmp_path / "rate.csv").write_text("time,rate\n0,1\n0.001, 2.5\n")
    (tmp_path / "oven.csv").write_text("time,temperature\n0,0\n1,-40\n")
    (tmp_path / "my.toml").write_text(
        '[rate]\nkind = "table"\nfile = "rate.csv"\n[device]\nstiffness_drift = 30.0\ntemperature_file = "oven.csv"\n'
    )
    scenario = Scenario.load(tmp_path / "my.toml")
    assert scenario.rate.points == ((0.0, 1.0), (0.001, 2.5))
    assert scenario.device.temperature_points == ((0.0, 0.0), (1.0, -40.0))
    assert scenario.rate.file is None
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    (tmp_path / "rate.csv").unlink()
    scenario.save(tmp_path / "copy.toml")
    assert Scenario.load(tmp_path / "copy.toml").content_hash() == scenario.content_hash()
    assert scenario == Scenario().replace({"rate.kind": "table", "rate.points": [[0, 1], [1e-3, 2.5]]}).replace(
        {"device.stiffness_drift": 30.0, "device.temperature_file": str(tmp_path / "oven.csv")}
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "it cannot be read: No such file or directory"),
        ("", "its first line must be 'time,rate'"),
        ("t,rate\n0,1\n", "its first line must be 'time,rate'"),
        ("time,rate\n0,1\n0,2\n", "row 3: times must rise from row to row"),
        ("time,rate\n0,1,2\n", "row 2 must be two finite numbers"),
        ("time,rate\n0,nan\n", "row 2 must be two finite numbers"),
        ("time,rate\n0,fast\n", "row 2 must be two finite numbers"),
        ("time,rate\n", "it must be a list of 1 to 100000 pairs"),
    ],
)
def test_a_file_that_is_none_is_refused_in_one_sentence(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "rate.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        PAPER.replace({"rate.kind": "table", "rate.file": str(path)})
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rate.kind": "ramp"}, 'rate.kind is "ramp": it must be constant, step, staircase, sine'),
        ({"rate.kind": "table"}, "rate.points is missing: a table must have points, or a file of them"),
        (
            {"rate.points": [[0, 1]]},
            'rate.points is [[0.0, 1.0]]: it needs rate.kind = "table", but rate.kind is "constant"',
        ),
        ({"rate.kind": "table", "rate.points": [[0, 1], [0, 2]]}, "pairs [time, value] of finite numbers whose times"),
        ({"rate.kind": "table", "rate.points": [[0, math.inf]]}, "pairs [time, value] of finite numbers whose times"),
        ({"rate.kind": "table", "rate.points": 3}, "rate.points is 3: it must be a list of 1 to 100000 pairs"),
        (
            {"rate.kind": "step", "rate.amplitude": 1.0, "rate.start": 1.5e-6},
            "it must be a whole number of run.step, which is 1e-06 s",
        ),
        ({"rate.start": -1.0}, "rate.start is -1.0: it must be at least 0"),
        ({"rate.kind": "step"}, "rate.amplitude is missing: rate.kind step must have one; 0.0 is allowed"),
        (
            {"rate.kind": "staircase", "rate.amplitude": 1.0},
            "rate.hold is missing: a staircase must have a time on each level",
        ),
        (
            {"rate.kind": "staircase", "rate.amplitude": 1.0, "rate.hold": 1e-7},
            "rate.hold is 1e-07: it must be a whole number of run.step",
        ),
        (
            {"rate.kind": "step", "rate.amplitude": 1.0, "rate.hold": 0.02},
            'rate.hold is 0.02: it needs rate.kind = "staircase", but rate.kind is "step"',
        ),
        ({"rate.levels": 0}, "rate.levels is 0: it must lie between 1 and 1000000000"),
        (
            {"rate.kind": "sine", "rate.amplitude": 1.0},
            'rate.frequency is 0.0: it must be greater than 0 when rate.kind is "sine"',
        ),
        (
            {"rate.kind": "sine", "rate.amplitude": 1.0, "rate.frequency": 4e6},
            "it must be at most pi over the step, which is 3.14159e+06",
        ),
        (
            {"rate.kind": "chirp", "rate.amplitude": 1.0, "rate.final_frequency": 4e6},
            "rate.final_frequency is 4000000.0: it must be at most",
        ),
        ({"rate.amplitude": math.nan}, "rate.amplitude is nan: it must be a finite number"),
        ({"device.sensing": "velocity"}, 'device.sensing is "velocity": it must be full or position'),
        ({"device.position_noise": -1.0}, "device.position_noise is -1.0: it must be at least 0"),
        (
            {"device.position_noise": 1e-9, "device.position_noise_density": 1e-12},
            "device.position_noise is 1e-09 and device.position_noise_density is 1e-12: at most one of the two",
        ),
        ({"device.velocity_bits": 12}, "device.velocity_bits is 12 and device.velocity_range is [inf, inf]: a conv"),
        ({"device.actuator_bits": 12}, "device.actuator_bits is 12 and device.actuator_limit is inf: a converter must"),
        ({"device.position_bits": 33}, "device.position_bits is 33: it must lie between 0 and 32"),
        ({"device.position_range": 0.0}, "device.position_range[0] is 0.0: it must be greater than 0"),
        ({"device.position_range": [1.0, math.nan]}, "device.position_range[1] is nan: it must be greater than 0"),
        (
            {"device.position_range": [1.0, math.inf], "device.position_bits": 12},
            "device.position_bits is 12 and device.position_range is [1.0, inf]: a converter must have a finite range",
        ),
        ({"device.pickoff_gain_error": -1.0}, "device.pickoff_gain_error[0] is -1.0: it must be greater than -1"),
        ({"device.force_gain_error": [0.0, -2.0]}, "it must be greater than -1"),
        ({"device.force_misalignment": math.inf}, "device.force_misalignment is inf: it must be a finite number"),
        (
            {"device.position_noise_corner": 1e3},
            "device.position_noise_corner is 1000.0 without white noise: device.position_noise or device.posi",
        ),
        (
            {"device.velocity_noise": 1e-9, "device.velocity_noise_corner": 5.1e5},
            "device.velocity_noise_corner is 510000.0: it must be at most half the sampling frequency, which is 500000",
        ),
        (
            {"device.damping_drift": 1e4, "device.temperature_points": [[0, -100]]},
            "device.damping_drift is 10000.0: over -100 K it multiplies the damping by 0, which must be greater than 0",
        ),
        ({"device.bias_instability": -1.0}, "device.bias_instability is -1.0: it must be at least 0"),
        ({"device.rate_random_walk": -1.0}, "device.rate_random_walk is -1.0: it must be at least 0"),
        ({"device.delay": 1.5}, "device.delay is 1.5: it must be an integer"),
        ({"device.delay": 1001}, "device.delay is 1001: it must lie between 0 and 1000"),
        ({"device.cubic_stiffness": [1.0]}, "cubic_stiffness is [1.0]: it must be a list of 2 numbers [x, y] or one"),
        (
            {"device.temperature_ramp": 1.0, "device.temperature_points": [[0, 1]]},
            "device.temperature_ramp is 1.0 and device.temperature_points is given: at most one of the two can be",
        ),
        (
            {"device.stiffness_drift": -1e4, "device.temperature_points": [[0, 100]]},
            "device.stiffness_drift is -10000.0: over 100 K it multiplies the stiffness by 0, which must be greater",
        ),
        ({"controller.observer_bandwidth": 0.0}, "controller.observer_bandwidth is 0.0: it must be greater than 0"),
        (
            {"rate.transverse_points": [[0.0, 1.0, 2.0]]},
            "rate.transverse_points is given: it needs plant.centrifugal =",
        ),
        (
            {"rate.transverse_points": [[0.0, 1.0, 2.0]], "plant.centrifugal": True, "plant.kind": "duffing"},
            "rate.transverse_points is given: it must be left out with plant.kind duffing",
        ),
    ],
)
def test_bad_values_are_refused_in_one_sentence(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        PAPER.replace(changes)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


# -- Other integrations --------------------------------------------------------------------------------------


def test_the_controller_alone_observes_the_velocity_and_resumes() -> None:
    scenario = SHORT.replace({"device.sensing": "position"})
    run = fg.simulate(scenario)
    ours = fg.Controller(scenario)
    for n, position in enumerate(run["position"].values):
        if n == 100:
            resumed = fg.Controller(scenario)
            resumed.state = ours.state
            ours = resumed
        assert (ours.step(n * 1e-3, position) == run["control"].values[n]).all()


def test_with_a_sensor_of_velocity_the_velocity_must_be_given() -> None:
    with pytest.raises(ValueError, match=r"velocity is missing: it must be given unless device.sensing is"):
        fg.Controller(PAPER).step(0.0, (0.5, 0.5))


def test_cubic_springs_of_the_device_are_those_of_the_plant_of_that_kind() -> None:
    """Two integrators: Lawson's method, and Runge-Kutta's of plant.kind duffing."""
    short = fg.Scenario.paper().replace({"run.duration": 5.0, "controller.kind": "pid", "disturbance.kind": "none"})
    own, coupling = (3e12, 1e12), 2e12
    device = short.replace({"device.cubic_stiffness": own, "device.cubic_coupling": coupling})
    plant = short.replace({"plant.kind": "duffing", "plant.cubic_stiffness": own, "plant.cubic_coupling": coupling})
    found, expected, linear = (fg.simulate(each)["control"].values for each in (device, plant, short))
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    assert np.abs(found - linear).max() > 1e-3 * np.abs(expected).max()
    skewed = fg.simulate(device.replace({"device.cubic_skew": (1e12, 0.0)}))["control"].values
    assert np.abs(skewed - found).max() > 1e-4 * np.abs(expected).max()
