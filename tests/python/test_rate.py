"""`fracgyro rate` and the shipped scenarios: their properties, and the user's view."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from browser import faults_of_report
from figure_data import column, figure_data
from fracgyro.rate.bound import Bound, bound_angle_random_walk
from fracgyro.rate.measure import measure
from fracgyro.rate.results import _full_scale, results
from fracgyro.rate.runs import _couplings, run_all
from fracgyro.rate.sensor import Output, Sensor
from fracgyro.rate.units import DEG_PER_S, thermal_force_density
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.schema import Plant
from fracgyro.scenario.shipped import SHIPPED, shipped_text
from fracgyro.scenario.volts_core import has_volts, plant_at_bias
from test_cli import run, sentence

DEG = math.pi / 180

# -- Shipped scenarios ---------------------------------------------------------------------------------------


DEVICES = [name for name in SHIPPED if name != "hardware"]  # which is the paper's, its rate and noise too


IN_VOLTS = [name for name in DEVICES if has_volts(fg.Scenario.shipped(name))]


@pytest.mark.parametrize("name", [name for name in DEVICES if name not in IN_VOLTS])
def test_a_shipped_scenario_tracks_and_senses_its_rate(name: str) -> None:
    scenario = fg.Scenario.shipped(name)
    assert scenario.plant.angular_rate == pytest.approx(300 * DEG, rel=1e-6)
    for rate in (0.0, 300 * DEG):
        steady = fg.simulate(scenario.replace({"plant.angular_rate": rate, "run.record_every": 10}))
        steady = steady.isel(time=slice(steady.sizes["time"] // 2, None))
        assert float(abs(steady["error"]).max()) < 2e-4
        assert float(abs(steady["control"]).max()) < 0.9 * scenario.controller.force_limit
        sensed = float(steady["rate_estimate"].mean()) * scenario.plant.reference_frequency
        assert sensed == pytest.approx(rate, abs=0.02 * 300 * DEG)


@pytest.mark.parametrize("name", IN_VOLTS)
def test_a_shipped_device_in_volts_senses_its_rate_and_follows_but_for_the_lag_of_its_amplifiers(name: str) -> None:
    """Its tracking error is that lag, and what its plates bend: 3/4 of X² of their amplitude X over the gap."""
    scenario = fg.Scenario.shipped(name)
    bent, e = [0.0, 0.0], scenario.electronics
    for one in scenario.electrodes.each:
        if one.kind == "plate" and one.role in ("force", "pickoff"):
            axis = int(one.axis[1])
            share = scenario.reference.amplitude[axis] * scenario.plant.reference_length / one.gap
            bent[axis] = max(bent[axis], share**2 * scenario.reference.amplitude[axis])
    omega = scenario.plant.reference_frequency
    late = math.atan(omega / math.tau / e.pole[0]) - math.atan(1 / (omega * e.feedback_resistance * 2e-12))
    for rate in (0.0, 300 * DEG):
        steady = fg.simulate(scenario.replace({"plant.angular_rate": rate, "run.record_every": 10}))
        steady = steady.isel(time=slice(steady.sizes["time"] // 2, None))
        error = abs(steady["error"]).max("time").values
        assert error[0] == pytest.approx(late, abs=bent[0] + 1e-4)
        assert (error < 1.1 * late + np.array(bent)).all()
        assert float(abs(steady["control"]).max()) < 0.9 * scenario.controller.force_limit
        sensed = float(steady["rate_estimate"].mean()) * omega
        assert sensed == pytest.approx(rate, abs=0.02 * 300 * DEG)


@pytest.mark.parametrize("name", DEVICES)
def test_the_noise_of_a_shipped_scenario_is_thermal_at_300_kelvin(name: str) -> None:
    scenario = fg.Scenario.shipped(name)
    plant, scales = scenario.plant, scenario.plant.scales
    force = thermal_force_density(max(plant.damping.xx, plant.damping.yy), 300.0)
    # N^2 s over (m omega0^2 q0)^2 / omega0
    assert scenario.disturbance.density is not None
    assert scenario.disturbance.density * scales.force**2 * scales.time / force == pytest.approx(1.0, rel=1e-5)


def natural_frequencies(name: str) -> list[float]:
    """Hz, at bias."""
    plant = plant_at_bias(fg.Scenario.shipped(name))
    return [math.sqrt(k / plant.mass) / (2 * math.pi) for k in (plant.stiffness.xx, plant.stiffness.yy)]


def quality_factors(name: str) -> list[float]:
    plant = plant_at_bias(fg.Scenario.shipped(name))
    (kx, _, ky), (cx, _, cy) = plant.stiffness.entries(), plant.damping.entries()
    return [math.sqrt(k * plant.mass) / c for k, c in ((kx, cx), (ky, cy))]


def test_the_devices_have_the_published_frequencies_and_quality_factors() -> None:
    assert natural_frequencies("dual_mass") == pytest.approx([3925, 3978], rel=1e-6)
    assert quality_factors("dual_mass") == pytest.approx([4673, 449], rel=1e-4)
    assert natural_frequencies("tuned_in_air") == pytest.approx([3216, 3251], rel=1e-6)
    assert fg.Scenario.shipped("tuned_in_air").plant.stiffness.xx == pytest.approx(242.3, rel=1e-4)
    assert quality_factors("tuned_in_air") == pytest.approx([120, 10], rel=1e-4)
    assert natural_frequencies("disc") == pytest.approx([10e3, 10e3], rel=1e-6)
    assert quality_factors("disc") == pytest.approx([2e6, 2e6], rel=1e-4)
    assert natural_frequencies("dual_mass_volts") == pytest.approx([3925.29, 3978.45], rel=1e-8)
    assert quality_factors("dual_mass_volts") == pytest.approx([4673, 449], rel=1e-4)
    assert natural_frequencies("tuned_in_air_volts") == pytest.approx([3216, 3251], rel=1e-8)
    assert natural_frequencies("baw_disc") == pytest.approx([976e3, 976000.4], rel=1e-8)


def test_the_papers_gyroscope_at_resonance_is_the_papers_in_its_principal_axes() -> None:
    """The same invariants: trace and determinant of K and D, and tr(K D)."""
    paper, turned = fg.Scenario.paper().plant, fg.Scenario.shipped("paper_resonance").plant
    assert turned.mass == paper.mass
    assert turned.stiffness.xy == 0.0

    def matrix(entries: np.ndarray) -> np.ndarray:
        return entries[[0, 1, 1, 2]].reshape(2, 2)

    def invariants(plant: Plant) -> list[float]:
        k, d = matrix(plant.stiffness.entries()), matrix(plant.damping.entries())
        return [float(x) for x in (np.trace(k), np.linalg.det(k), np.trace(d), np.linalg.det(d), np.trace(k @ d))]

    assert invariants(turned) == pytest.approx(invariants(paper), rel=1e-5)
    assert natural_frequencies("paper_resonance") == pytest.approx([2893, 3759], rel=2e-4)


@pytest.mark.parametrize("name", ["paper_resonance", "dual_mass", "tuned_in_air", "disc"])
def test_a_driven_device_starts_on_its_reference_with_x_at_resonance(name: str) -> None:
    scenario = fg.Scenario.shipped(name)
    plant, reference = scenario.plant, scenario.reference
    assert plant.reference_frequency == pytest.approx(math.sqrt(plant.stiffness.xx / plant.mass), rel=1e-9)
    assert reference.frequency[0] == 1.0
    for i, phase in enumerate(reference.phase):
        at_start = reference.amplitude[i] * complex(math.sin(phase), reference.frequency[i] * math.cos(phase))
        start = complex(scenario.run.initial_position[i], scenario.run.initial_velocity[i])
        assert start == pytest.approx(at_start, abs=1e-12)


def test_a_shipped_scenario_is_printed_with_its_sources(tmp_path: Path) -> None:
    printed = run("scenario", "dual_mass")
    assert printed.stdout == shipped_text("dual_mass")
    assert "Micromachines 2018" in printed.stdout
    (tmp_path / "device.toml").write_text(printed.stdout, encoding="utf-8")
    assert fg.Scenario.load(tmp_path / "device.toml") == fg.Scenario.shipped("dual_mass")
    listed = run("scenario", "--list").stdout
    assert re.findall(r"^([\w-]+)", listed, re.MULTILINE) == ["paper", "paper-printed", *SHIPPED]


def test_an_unknown_scenario_is_refused() -> None:
    assert "did you mean dual_mass?" in sentence(run("scenario", "dual_mas"))
    with pytest.raises(ScenarioError, match=r"it must be one of paper, .*; did you mean dual_mass"):
        fg.Scenario.shipped("dual_mas")


# -- The command ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rate")
    fg.Scenario.shipped("dual_mass").replace({"run.duration": 8000.0}).save(folder / "device.toml")
    done = run("rate", folder / "device.toml", "--out", folder / "out", "--quick", "--json", "--imu", "kalibr")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == json.loads((folder / "out" / "rate.json").read_text(encoding="utf-8"))
    return folder / "out"


def test_the_report_is_accessible_and_fits(browser: Any, report: Path) -> None:
    assert faults_of_report(browser, report / "report.html") == []


def test_the_folder_has_the_report_and_its_numbers(report: Path) -> None:
    assert sorted(path.name for path in report.iterdir()) == ["imu.yaml", "rate.json", "report.html"]
    content = json.loads((report / "rate.json").read_text(encoding="utf-8"))
    keys = [figure["key"] for figure in content["figures"]]
    assert keys == [
        "scale_factor_error",
        "nonlinearity",
        "zero_rate_output",
        "zero_rate_rms",
        "angle_random_walk",
        "bias_instability",
        "rate_random_walk",
        "bandwidth",
        "phase_lag",
        "full_scale",
        "turn_on_time",
        "quadrature_residual",
        "damping_residual",
    ]
    assert all(figure["unit"] and figure["definition"] for figure in content["figures"])
    assert fg.Scenario.from_toml(content["scenario"]).plant.mass == 1.42e-06
    density = re.search(r"^gyroscope_noise_density: (\S+)", (report / "imu.yaml").read_text(), re.MULTILINE)
    walk = next(figure["value"] for figure in content["figures"] if figure["key"] == "angle_random_walk")
    assert density is not None
    assert float(density[1]) == pytest.approx(walk * DEG / 60, rel=1e-5)  # deg/sqrt(h)


def test_the_measured_response_is_one_of_python_control(report: Path, tmp_path: Path) -> None:
    pytest.importorskip("control", reason="python-control, which the extra interop brings, is not installed")
    found = fg.interop.control.rate_response(report)
    data = figure_data(report / "report.html")["response"]
    np.testing.assert_allclose(found.omega / (2 * np.pi), column(data, "frequency of the rate (Hz)"), rtol=1e-8)
    np.testing.assert_allclose(20 * np.log10(found.magnitude), column(data, "gain (dB)"), atol=1e-7)
    lag = -np.degrees(np.unwrap(found.phase))
    np.testing.assert_allclose(lag, column(data, "phase lag (deg)"), rtol=1e-7)
    assert lag[-1] > lag[0]
    with pytest.raises(ValueError, match=r"rate\.json has no measured response"):
        fg.interop.control.rate_response(tmp_path / "none")
    for content in ("{}", "no JSON", '{"response": {"frequency": [1], "gain": ["a"], "lag": [0]}}'):
        (tmp_path / "rate.json").write_text(content, encoding="utf-8")
        with pytest.raises(
            ValueError, match=r"rate\.json has no measured response: create it with fracgyro rate --out$"
        ):
            fg.interop.control.rate_response(tmp_path)


def test_the_report_needs_nothing_but_itself(report: Path) -> None:
    page = (report / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == 4
    assert not re.findall(r"(?:src|href)=\"(?!data:|#)", page)
    for figure in json.loads((report / "rate.json").read_text(encoding="utf-8"))["figures"]:
        assert f"<td>{figure['name']}</td>" in page


def test_the_numbers_behind_the_figures_give_the_figures_of_merit(report: Path) -> None:
    data = figure_data(report / "report.html")
    assert list(data) == ["allan_deviation", "constant_rates", "response", "turn_on"]
    content = json.loads((report / "rate.json").read_text(encoding="utf-8"))
    found = {figure["key"]: figure["value"] for figure in content["figures"]}
    rates = data["constant_rates"]
    assert column(rates, "rate (deg/s)") == pytest.approx([-300, -200, -100, -30, -10, 0, 10, 30, 100, 200, 300])
    worst = max(map(abs, column(rates, "mean output minus the line (deg/s)")))
    assert 100 * worst / 300 == pytest.approx(abs(found["nonlinearity"]), rel=1e-6)
    allan = data["allan_deviation"]
    tau, walk = (column(allan, name) for name in ("averaging time (s)", "slope −1/2: angle random walk (deg/h)"))
    assert walk == pytest.approx([60 * found["angle_random_walk"] / math.sqrt(t) for t in tau], rel=1e-6)
    low, output, high = (
        np.array(column(allan, f"{name} (deg/h)")) for name in ("low end of the 95 % interval", "output", "high end")
    )
    assert (low < output).all()
    assert (output < high).all()
    frequency, gain = (column(data["response"], name) for name in ("frequency of the rate (Hz)", "gain (dB)"))
    below = [f for f, g in zip(frequency, gain, strict=True) if g > -3]
    assert below[-1] < found["bandwidth"] < frequency[len(below)]
    runs = np.array([column(data["turn_on"], name) for name in data["turn_on"][0] if "run" in name])
    time = np.array(column(data["turn_on"], "time (ms)"))
    assert runs.shape == (2, len(time)), "two seeds"
    mean = runs.mean(axis=0)
    assert time[abs(mean - mean[-1]) > 3.0][-1] == pytest.approx(found["turn_on_time"], rel=0.5)


def test_a_folder_that_is_there_is_left_alone(report: Path, tmp_path: Path) -> None:
    fg.Scenario.shipped("dual_mass").save(tmp_path / "device.toml")
    before = (report / "rate.json").read_bytes()
    assert "it already exists" in sentence(run("rate", tmp_path / "device.toml", "--out", report))
    assert (report / "rate.json").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"controller.adaptive": False}, "controller.adaptive is false: it must be true"),
        ({"controller.rate_law": "printed"}, 'controller.rate_law is "printed": it must be "skew"'),
        ({"run.duration": 100.0}, "run.duration is 100: it must be at least 4000 steps"),
    ],
)
def test_a_scenario_that_senses_nothing_is_refused(tmp_path: Path, change: dict[str, object], words: str) -> None:
    base = {"adaptation.kind": "gradient"}
    exactly_sensed("dual_mass").replace({**base, **change}).save(tmp_path / "bad.toml")
    assert words in sentence(run("rate", tmp_path / "bad.toml", "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_run_that_diverges_within_the_range_leaves_nothing(tmp_path: Path) -> None:
    scenario = fg.Scenario.paper().replace({"run.step": 1e-2, "disturbance.hold": None, "run.duration": 80.0})
    scenario.save(tmp_path / "coarse.toml")
    done = run("rate", tmp_path / "coarse.toml", "--out", tmp_path / "out")
    assert done.returncode == 2
    # After the progress bar, which had begun.
    assert done.stderr.splitlines()[-1] == (
        "fracgyro: run.step is 0.01: it must be less, as the run at -300 deg/s diverges"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["coarse.toml"]


# -- Measurements --------------------------------------------------------------------------------------------


def test_the_controller_is_not_told_the_rate() -> None:
    slow = exactly_sensed("dual_mass").replace({"run.duration": 2000.0, "adaptation.kind": "gradient"})
    assert abs(Sensor.of(slow, 1).output(300 * DEG).rate[0, 0]) < 30 * DEG


def test_an_output_is_the_mean_of_the_estimate_over_its_interval() -> None:
    scenario = fg.Scenario.shipped("dual_mass").replace({"run.duration": 1000.0, "adaptation.initial_rate": 0.0})
    sensor = Sensor.of(scenario, 1)
    every, block = sensor.block
    assert (every, block) == (1, 10)
    output = sensor.output(scenario.plant.angular_rate)
    estimate = fg.simulate(scenario)["rate_estimate"].values * scenario.plant.reference_frequency
    assert output.rate[0, 7] == pytest.approx(estimate[70:80].mean(), rel=1e-12)
    assert output.interval == pytest.approx(10 * 0.05 / scenario.plant.reference_frequency, rel=1e-12)


def test_knowing_damping_and_stiffness_lowers_the_bound_where_the_speeds_differ() -> None:
    # N^2 = S/(4 (mean vx^2 + mean vy^2)), the speeds those of the reference: 1/sqrt(2) on x, half of that on y in air.
    scenario = exactly_sensed("tuned_in_air")
    scales = scenario.plant.scales
    bound = bound_angle_random_walk(scenario)
    assert bound is not None
    assert scenario.disturbance.density is not None
    speeds = 0.5 * (1.0 + (0.5 * 1.010883085) ** 2)
    worked = math.sqrt(scenario.disturbance.density / (4 * speeds)) * scales.rate * math.sqrt(scales.time)
    assert bound.known == pytest.approx(worked, rel=1e-3)
    # With D unknown, y at w1 measures d + 2 W and x at w2 d - 2 W, with information vx^2 and vy^2: the variance of half
    # their difference.
    a, b = 0.5, 0.5 * (0.5 * 1.010883085) ** 2
    assert (bound.unknown / bound.known) ** 2 == pytest.approx((1 / a + 1 / b) / 4 * (a + b), rel=1e-2)


def test_the_bound_is_of_the_density_that_held_noise_has_and_the_start_does_not_matter() -> None:
    scenario = exactly_sensed("tuned_in_air").replace({"run.duration": 2000.0})
    density, hold = scenario.disturbance.density, 4 * scenario.run.step
    assert density is not None
    held = {"density": None, "standard_deviation": math.sqrt(density / hold), "hold": hold}
    bound, of_held, from_rest = (
        bound_angle_random_walk(scenario.replace(changes))
        for changes in (
            {},
            {f"disturbance.{name}": value for name, value in held.items()},
            {"run.initial_position": (0.0, 0.0), "run.initial_velocity": (0.0, 0.0)},
        )
    )
    assert bound is not None
    assert of_held is not None
    assert from_rest is not None
    assert of_held.known == pytest.approx(bound.known, rel=1e-3)
    assert from_rest.known == pytest.approx(bound.known, rel=3e-4)


def test_without_noise_the_bound_is_0_and_a_motion_that_tells_nothing_apart_has_none() -> None:
    still = {"disturbance.density": None, "disturbance.standard_deviation": 0.0, "run.duration": 200.0}
    scenario = exactly_sensed("tuned_in_air").replace(still)
    bound = bound_angle_random_walk(scenario)
    assert bound is not None
    assert (bound.known, bound.unknown) == (0.0, 0.0)
    assert bound_angle_random_walk(scenario.replace({"disturbance.kind": "none"})) is None
    # Motions of very different sizes separate parameters as well as others.
    small = {"reference.amplitude": (1.0, 5e-4), "run.initial_position": (0.0, 5e-4)}
    assert bound_angle_random_walk(scenario.replace(small)) is not None
    line = {"reference.amplitude": (1.0, 0.0), "reference.phase": (0.0, 0.0)}  # y rests
    start = {"run.initial_position": (0.0, 0.0), "run.initial_velocity": (1.0, 0.0)}
    assert bound_angle_random_walk(scenario.replace({**line, **start})) is None


# adaptation.rate_forgetting is 2 pi 100 Hz: least squares have an answer of first order with 45 degrees of lag there.
@pytest.mark.parametrize(
    ("scenario", "bandwidth", "lag"),
    [
        pytest.param(fg.Scenario.shipped("dual_mass"), (85, 105), (45, 100), id="joint"),
        pytest.param(exactly_sensed("dual_mass"), (97, 103), (43, 47), marks=pytest.mark.nightly, id="composite"),
    ],
)
def test_the_measured_noise_is_near_the_bound_and_its_figures_are_finite(
    scenario: fg.Scenario, bandwidth: tuple[float, float], lag: tuple[float, float]
) -> None:
    sensor = Sensor.of(scenario.replace({"run.duration": 8000.0}), 2)
    measured = measure(sensor, run_all(sensor))
    found = {result.key: result for result in results(measured)}
    # The output is right up to the largest rate tried, 9600 deg/s, but the forces are not.
    limited = found["full_scale"]
    assert (limited.value, limited.grade) == (pytest.approx(4800), "navigation")
    assert limited.note == "above it more than 1 % of the samples reach a limit of force or sensors"
    last = results(replace(measured, full_scale_is_last=True, full_scale_is_limited=False))
    reached = next(result for result in last if result.key == "full_scale")
    assert math.isnan(reached.value)
    assert (reached.low, reached.note) == (pytest.approx(4800), "at least this, the largest rate tried")
    walk = measured.allan.angle_random_walk
    assert walk is not None
    assert measured.bound is not None
    assert 0.8 < walk.value / measured.bound.known < 1.3
    assert abs(found["scale_factor_error"].value) < 10
    assert found["zero_rate_output"].low < 0 < found["zero_rate_output"].high
    assert found["zero_rate_rms"].value > 2 * abs(found["zero_rate_output"].value)  # the noise is in it
    assert bandwidth[0] < found["bandwidth"].value < bandwidth[1]
    assert lag[0] < found["phase_lag"].value < lag[1]
    # In full it would be 300 deg/s. Noise drops out of the difference, which is far below what noise leaves at rest.
    noise = found["zero_rate_output"].high - found["zero_rate_output"].low  # deg/h
    assert abs(found["quadrature_residual"].value * 3600) < 1e-2 * noise
    assert abs(found["damping_residual"].value * 3600) < 1e-2 * noise
    # Half the walk over one bound, a quarter over the other.
    doubled = replace(measured, bound=Bound(2 * walk.value, 4 * walk.value))
    note = next(result.note for result in results(doubled) if result.key == "angle_random_walk")
    assert re.findall(r"\b0\.\d\d times", note) == ["0.50 times", "0.25 times"]


def test_the_second_half_of_a_run_counts_as_steady() -> None:
    output = Output(np.arange(16.0).reshape(2, 8), 0.5).settled()
    np.testing.assert_array_equal(output.rate, [[4, 5, 6, 7], [12, 13, 14, 15]])
    assert output.interval == 0.5


def test_a_record_at_rest_lasts_as_long_as_asked_for_and_leaves_the_start_out() -> None:
    sensor = Sensor.of(fg.Scenario.shipped("dual_mass").replace({"run.duration": 1000.0}), 2)
    assert sensor.steps_at_rest(None) == 4_000_000
    unbounded = sensor.scenario.replace({"controller.switching_limit": math.inf, "adaptation.kind": "gradient"})
    assert Sensor.of(unbounded.replace({"device.sensing": "full"}), 2).steps_at_rest(None) == 1_000_000
    # 0.02 s of 0.05/24661.5 s, after half a run of 20,000.
    assert sensor.steps_at_rest(0.02) == 10_000 + 9865
    found, whole = sensor.at_rest(0.02), sensor.output(0.0, steps=10_000 + 9865)
    np.testing.assert_array_equal(found.rate, whole.rate[:, 1000:])
    assert found.rate.shape[1] * found.interval == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        ("0", "rest is 0.0: it must be greater than 0"),
        ("1e-5", "rest is 1e-05: it must lie between 0.00811 and 2027.05 s"),
        ("1e5", "rest is 100000: it must lie between 0.00811 and 2027.05 s"),
    ],
)
def test_a_record_too_short_or_too_long_is_refused_at_once(tmp_path: Path, rest: str, words: str) -> None:
    fg.Scenario.shipped("dual_mass").save(tmp_path / "device.toml")
    refused = run("rate", tmp_path / "device.toml", "--rest", rest, "--out", tmp_path / "out")
    assert refused.returncode == 2
    assert words in refused.stderr.splitlines()[-1]
    assert not (tmp_path / "out").exists()


def test_the_couplings_tried_are_as_worked_by_hand() -> None:
    (quadrature, stiffness, rate), (damping, coupling, as_rate) = _couplings(fg.Scenario.shipped("dual_mass"))
    assert (quadrature, damping) == ("plant.stiffness_deviation", "plant.damping_deviation")
    # 2 m w 300 deg/s = 2 * 1.42e-6 * 24661.5 * 5.23599 N/m; a tenth of sqrt(7.49397e-6 * 7.90472e-5) N s/m, over 2 m.
    assert stiffness == pytest.approx(0.366720, rel=1e-4)
    assert rate == pytest.approx(300 * DEG)
    assert coupling == pytest.approx(2.43388e-6, rel=1e-4)
    assert as_rate == pytest.approx(0.857, rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, True),
        ({"controller.force_limit": 0.0001}, False),
        ({"device.actuator_limit": 1e-9}, False),
        ({"device.position_range": [1e-7, 1.0]}, False),
    ],
)
def test_a_rate_that_forces_or_sensors_cannot_follow_is_beyond_the_limits(
    changes: dict[str, object], expected: bool
) -> None:
    """0.0001 of the unit of force, 1 nN and 0.1 µm are less than the motion at 300 deg/s takes."""
    sensor = Sensor.of(fg.Scenario.shipped("dual_mass").replace({"run.duration": 8000.0, **changes}), 1)
    assert sensor.keeps_its_limits(DEG_PER_S.to_si(300.0)) == expected


def test_without_a_limit_of_force_the_full_scale_has_no_grade_and_says_why() -> None:
    free = fg.Scenario.shipped("dual_mass").replace({"controller.force_limit": math.inf})
    measured: Any = SimpleNamespace(
        scenario=free, full_scale=1.0, full_scale_is_last=False, full_scale_is_limited=False
    )
    assert _full_scale(measured).note.startswith("not graded: without controller.force_limit or device.actuator_limit")
    measured.scenario = free.replace({"device.actuator_limit": 1e-5})
    assert (_full_scale(measured).note, _full_scale(measured).grade) == ("", "consumer")
