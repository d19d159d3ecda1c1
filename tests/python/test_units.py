"""SI units: one parser for all units of the core, each run of many in its own scales, every kind of controller."""

from __future__ import annotations

import contextlib
import functools
import math
import pickle
import re
import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.export.units import base_unit
from fracgyro.scenario.kinds import DEVICE_CHANNELS, KINDS, LOOP_CHANNELS, kinds_with, reported_channels
from fracgyro.scenario.messages import leaves
from fracgyro.scenario.printing import OWN_KINDS, having
from fracgyro.scenario.quantities import number_of
from fracgyro.scenario.scales import Powers, Scales, powers, si_unit
from fracgyro.scenario.shipped import SHIPPED
from fracgyro.scenario.table import toml_value
from fracgyro.scenario.to_core import core_setup
from fracgyro.scenario.units import BASE, DEFINED, PREFIXED, PREFIXES, UnitError, base, parse, printed, quantity
from fracgyro.simulation import native
from fracgyro.study.sweep.design import read_plan
from hypothesis import given
from hypothesis import strategies as st
from laws import by_numba

SI = fg.Scenario.paper().replace({"run.duration": 12.0, "run.units": "SI"})
SCALES = Scales(mass=2.0, length=3.0, rate=5.0)


def scaled(mass: float = 1.0, length: float = 1.0, frequency: float = 1.0) -> fg.Scenario:
    """The same scenario with other scales, whose plant is another one in nondimensional numbers, too."""
    plant = SI.plant
    return SI.replace(
        {
            "plant.mass": mass * plant.mass,
            "plant.reference_length": length * plant.reference_length,
            "plant.reference_frequency": frequency * plant.reference_frequency,
        }
    )


class Proportional:
    """Feedback in the units of the run, which reports its inputs."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.scales = scenario.plant.scales
        self.error = (0.0, 0.0)

    def __call__(self, sample: Any) -> tuple[float, float]:
        s = self.scales
        e = np.subtract(sample.position, sample.reference) / s.length
        v = np.subtract(sample.velocity, sample.reference_velocity) / s.velocity
        self.error = tuple(s.length * e)
        return tuple(s.force * (-400.0 * e - 40.0 * v + np.array(sample.reference_acceleration) / s.acceleration))

    def report(self) -> dict[str, Any]:
        return {"found_error": self.error, "rate_estimate": 0.1 * self.scales.rate}


def assert_each_is_its_own_run(many: xr.Dataset, scenarios: list[fg.Scenario], controller: Any = None) -> None:
    for i, scenario in enumerate(scenarios):
        alone = fg.simulate(scenario, controller)
        for name, values in alone.items():
            np.testing.assert_array_equal(many[name].values[i], values.values, err_msg=str(name))
            assert many[name].attrs == values.attrs, name
        np.testing.assert_array_equal(many["time"], alone["time"])


@pytest.mark.parametrize(
    "others", [{"mass": 2.0}, {"length": 2.0}, {"mass": 3.0, "length": 0.5}], ids=["mass", "length", "both"]
)
@pytest.mark.parametrize("controller", [None, Proportional()], ids=["its own", "a callable"])
def test_runs_recorded_together_in_si_are_each_in_its_own_scales(others: dict[str, float], controller: Any) -> None:
    scenarios = [SI, scaled(**others)]
    many = fg.simulate_many(scenarios, controller=controller)
    assert_each_is_its_own_run(many, scenarios, controller)
    force = np.abs(many["disturbance"].values).max(axis=(1, 2))
    assert force[1] / force[0] == pytest.approx(scenarios[1].plant.scales.force / SI.plant.scales.force)


def test_a_native_law_gets_each_run_in_its_own_scales() -> None:
    def law(given: Any, state: Any, parameters: Any, found: Any) -> None:
        found[0], found[1], found[2] = -parameters[0] * given[1], -parameters[0] * given[2], given[1]

    controller = native.Law(by_numba(law), parameters={"k": 40.0}, reports=["found"])
    scenarios = [SI, scaled(mass=2.0), scaled(length=2.0)]
    assert_each_is_its_own_run(fg.simulate_many(scenarios, controller=controller), scenarios, controller)


def test_seeds_keep_to_the_scales_of_their_scenario() -> None:
    scenarios = [SI, scaled(mass=2.0)]
    many = fg.simulate_many(scenarios, seeds=[4, 9])
    for i, (scenario, seed) in enumerate((s, seed) for s in scenarios for seed in (4, 9)):
        alone = fg.simulate(scenario.replace({"disturbance.seed": seed}))
        np.testing.assert_array_equal(many["control"].values[i], alone["control"].values)


def test_scenarios_in_si_with_another_unit_of_time_are_refused_together_and_nondimensional_ones_are_not() -> None:
    with pytest.raises(ValueError, match=r"^plant\.reference_frequency") as caught:
        fg.simulate_many([SI, scaled(frequency=2.0)])
    assert str(caught.value) == (
        "plant.reference_frequency is 1000.0 and 2000.0: it must be the same in all scenarios that are recorded "
        "together when run.units is SI; measure_many has no such limit"
    )
    plain = [s.replace({"run.units": "nondimensional"}) for s in (SI, scaled(frequency=2.0))]
    assert_each_is_its_own_run(fg.simulate_many(plain), plain)


@pytest.mark.parametrize("units", ["SI", "nondimensional"])
def test_metrics_of_runs_recorded_together_are_those_of_each(units: str) -> None:
    limit = {"run.units": units, "controller.force_limit": 400.0}
    scenarios = [s.replace(limit) for s in (SI, scaled(mass=2.0), scaled(length=0.01))]
    many = fg.metrics.summary(fg.simulate_many(scenarios))
    for i, scenario in enumerate(scenarios):
        alone = fg.metrics.summary(fg.simulate(scenario))
        assert 0 < float(alone["saturated_share"]) < 1
        for name, values in alone.items():
            np.testing.assert_allclose(many[name].isel(run=i).values, values.values, rtol=1e-12, err_msg=str(name))
            assert many[name].attrs == values.attrs, name


def test_the_share_at_the_force_limit_is_the_same_in_si() -> None:
    limited = SI.replace({"controller.force_limit": 400.0})
    plain = limited.replace({"run.units": "nondimensional"})
    assert fg.metrics.saturated_share(fg.simulate(limited)) == fg.metrics.saturated_share(fg.simulate(plain)) > 0


def test_lyapunovs_function_of_runs_recorded_together_is_that_of_each() -> None:
    plain = SI.replace({"run.units": "nondimensional"})
    scenarios = [plain, plain.replace({"adaptation.bound_gain": (2.0, 3.0, 4.0), "plant.mass": 1e-7})]
    many = fg.metrics.lyapunov(fg.simulate_many(scenarios), bounds=(2.0, 1.0, 1.0))
    for i, scenario in enumerate(scenarios):
        alone = fg.metrics.lyapunov(fg.simulate(scenario), bounds=(2.0, 1.0, 1.0))
        np.testing.assert_allclose(many.isel(run=i), alone, rtol=1e-12)


def test_one_of_several_runs_is_drawn_and_measured_and_several_are_not_drawn_as_one() -> None:
    many = fg.simulate_many([SI, scaled(mass=2.0)])
    one = many.isel(run=1)
    assert len(fg.plot(one).axes) == 4
    assert one.fracgyro.scenario == scaled(mass=2.0)
    assert float(one.fracgyro.settling_time()) == float(fg.metrics.settling_time(fg.simulate(scaled(mass=2.0))))
    with pytest.raises(ValueError, match=r"^the Dataset has 2 runs: select one, for example run.isel\(run=0\)$"):
        fg.plot(many)
    with pytest.raises(ValueError, match=r"^the Dataset has 2 runs: select one, for example run.isel\(run=0\)$"):
        _ = many.fracgyro.scenario


def test_a_mat_file_of_several_runs_has_all_their_scenarios(tmp_path: Path) -> None:
    from scipy.io import loadmat

    scenarios = [SI, scaled(mass=2.0)]
    fg.simulate_many(scenarios).fracgyro.to_mat(tmp_path / "runs.mat")
    found = loadmat(tmp_path / "runs.mat", squeeze_me=True)["scenario"]
    assert [str(text) for text in found] == [s.to_toml() for s in scenarios]
    fg.simulate(SI).fracgyro.to_mat(tmp_path / "run.mat")
    assert str(loadmat(tmp_path / "run.mat", squeeze_me=True)["scenario"]) == SI.to_toml()


@pytest.mark.parametrize("kind", KINDS)
def test_a_controller_of_every_kind_runs_in_si(kind: str) -> None:
    plain = SI.replace({"controller.kind": kind, "run.units": "nondimensional", "run.duration": 1.0})
    scenario = plain.replace({"run.units": "SI"})
    si, expected, scales = fg.simulate(scenario), fg.simulate(plain), scenario.plant.scales
    channels = (*LOOP_CHANNELS, *reported_channels(core_setup(scenario)))
    for channel in channels:
        factors = np.array([scales.of(unit) for unit in channel.units])
        factor = factors if channel.dimension else factors[0]
        np.testing.assert_allclose(si[channel.name], expected[channel.name] * factor, rtol=1e-14)
        assert "unit" in " ".join(si[channel.name].attrs), channel.name
    one, other = fg.Controller(scenario), fg.Controller(plain)
    q, v = np.array([0.4, 0.3]), np.array([0.1, 0.2])
    force = one.step(0.0, scales.length * q, scales.velocity * v)
    np.testing.assert_allclose(force, scales.force * other.step(0.0, q, v), rtol=1e-12)
    assert one.report.keys() == other.report.keys()


@pytest.mark.parametrize("kind", KINDS)
def test_every_channel_of_every_kind_has_an_si_unit_and_fmi_can_state_it(kind: str) -> None:
    setup = core_setup(SI.replace({"controller.kind": kind}))
    for channel in (*LOOP_CHANNELS, *reported_channels(setup), *DEVICE_CHANNELS):
        for unit in channel.units:
            symbol = si_unit(unit).replace(" ", ".")
            assert symbol == "1" or base_unit(symbol, SI.plant), f"{channel.name} in {unit}"


def test_a_unit_is_a_product_of_powers() -> None:
    assert powers("m*omega0^2*q0") == Powers(mass=1, length=1, rate=2)
    assert powers("m*omega0^2/q0^2") == Powers(mass=1, length=-2, rate=2)
    assert powers("1/omega0") == Powers(mass=0, length=0, rate=-1)
    assert powers("q0^0.5*omega0^1.5") is None
    assert powers("omega0^(2-alpha)") is None
    assert SCALES.of("m*omega0^2*q0") == SCALES.force == 150.0
    assert SCALES.of("omega0^2*q0") == SCALES.acceleration == 75.0
    assert SCALES.of("1/omega0") == SCALES.time == 0.2
    assert SCALES.of("m/q0^2") == pytest.approx(2.0 / 9.0)
    assert [si_unit(unit) for unit in ("m*omega0", "omega0^2*q0", "m/q0^2", "rad", "1")] == [
        "N s/m",
        "m/s^2",
        "kg m^-2",
        "rad",
        "1",
    ]
    with pytest.raises(ValueError, match=r"^the unit h has no SI unit"):
        SCALES.of("h")


# -- Text with units -----------------------------------------------------------------------------------------

FIELDS = {path: info for path, info in leaves(fg.Scenario).items() if isinstance(info.json_schema_extra, dict)}
WHOLE = {"adaptation.covariance_steps", "controller.span", "datasheet.delay", "device.delay"}  # counts of steps
DEVICES = [fg.Scenario.paper(), *map(fg.Scenario.shipped, SHIPPED)]


def value_at(scenario: fg.Scenario, path: str) -> Any:
    return functools.reduce(getattr, path.split("."), scenario)


def scenario_with(path: str) -> fg.Scenario:
    """A scenario that has the field."""
    kinds, (table, _, field) = kinds_with(path), path.partition(".")
    own = having(table, field) if table in OWN_KINDS else ()
    return SI.replace(({"controller.kind": kinds[0]} if kinds else {}) | NEEDED_BY_KIND.get(own[:1], {}))


# By the first kind of reference or plant that has a field.
NEEDED_BY_KIND: dict[tuple[str, ...], dict[str, Any]] = {
    ("step",): {"reference.kind": "step"},
    ("ramp",): {"reference.kind": "ramp", "reference.slope": (2.0, 3.0)},
    ("chirp",): {"reference.kind": "chirp", "reference.end": 9.0},
    ("staircase",): {"reference.kind": "staircase"},
    ("duffing",): {"plant.kind": "duffing"},
    ("general",): {"plant.kind": "general"},
}
NEEDS: dict[str, dict[str, Any]] = {
    "disturbance.width": {"disturbance.kind": "pulse", "disturbance.amplitude": (1.0, 1.0)},
    "disturbance.amplitude": {"disturbance.amplitude": (2.0, 3.0)},
    "disturbance.density": {"disturbance.standard_deviation": None},
    "disturbance.hold": {"disturbance.hold": 2e-3},
    "device.position_noise_corner": {"device.position_noise": 1e-12},
    "device.velocity_noise_corner": {"device.velocity_noise": 1e-9},
    "rate.hold": {"rate.kind": "staircase", "rate.amplitude": 1.0},
}

COMB = {"kind": "comb", "count": 200, "gap": 2e-6, "overlap": 2e-5, "thickness": 6e-5, "bias": 5.0}
IN_VOLTS: dict[str, Any] = {
    "device.sensing": "position",
    "electrodes": [{"role": role, "angle": a, **COMB} for role in ("force", "pickoff") for a in (0.0, math.pi / 2)],
}
AMPLIFIED = {**IN_VOLTS, "electronics.amplifier": "charge", "electronics.feedback_resistance": 1e7}
CARRIER = {**IN_VOLTS, "electronics.carrier_frequency": 1e6, "electronics.carrier_voltage": 1.0}
NEEDS |= {
    "electronics.feedback_resistance": AMPLIFIED,
    "electronics.feedback_capacitance": {**AMPLIFIED, "electronics.feedback_capacitance": 1e-12},
    "electronics.input_capacitance": {**AMPLIFIED, "electronics.input_capacitance": 4e-12},
    "electronics.voltage_noise": {**AMPLIFIED, "electronics.voltage_noise": 5e-9},
    "electronics.current_noise": {**AMPLIFIED, "electronics.current_noise": 1e-15},
    "electronics.pole": {**IN_VOLTS, "electronics.pole": (1e6, 2e6)},
    "device.common_mode_frequency": IN_VOLTS,
    "electronics.feedthrough_lag": {**AMPLIFIED, "electronics.feedback_capacitance": 1e-12},
    "electronics.carrier_frequency": CARRIER,
    "electronics.carrier_voltage": CARRIER,
    **{
        f"electronics.{name}": {**IN_VOLTS, f"electronics.{name}": 1e-9}
        for name in ("sample_delay", "update_delay", "aperture", "jitter")
    },
}

LISTS = {"disturbance.psd", "disturbance.band"}


@pytest.mark.parametrize("path", [path for path in FIELDS if path not in WHOLE | LISTS and "points" not in path])
def test_every_field_with_a_unit_accepts_text_in_si_and_means_the_number(path: str) -> None:
    scenario = scenario_with(path)
    value = value_at(scenario, path)
    if value is None or value == math.inf or (isinstance(value, tuple) and math.inf in value):
        value = (2.0, 3.0) if isinstance(value, tuple) else 2.0
    changes = NEEDS.get(path, {}) | {path: 0.5 if value == 0.0 else value}
    changes |= {path: NEEDS[path][path]} if path in NEEDS.get(path, {}) else {}
    plain = scenario.replace(changes)
    si = plain.in_si()
    text = [quantity.text for quantity in numbers_in(value_at(si, path))]
    assert text
    assert all(not each.endswith(" 1") for each in text)
    assert value_at(scenario.replace({**changes, path: value_at(si, path)}), path) == value_at(plain, path)
    given = scenario.replace({**changes, path: text if len(text) > 1 else text[0]})  # str, not Quantity
    assert value_at(given, path) == value_at(plain, path)
    assert given.content_hash() == plain.content_hash()
    for each in text:
        assert f'"{each}"' in given.to_toml()
    with pytest.raises(fg.ScenarioError) as refused:
        scenario.replace({**changes, path: [f"1 {WRONG}"] * len(text) if len(text) > 1 else f"1 {WRONG}"})
    assert re.fullmatch(rf'{re.escape(path)}(\[0\])? is "1 {re.escape(WRONG)}": it must be .*', str(refused.value))


WRONG = "kg^3 K^2"  # no field has it


def test_a_band_and_a_spectrum_accept_text() -> None:
    band = SI.replace({"disturbance.hold": None, "disturbance.band": ["10 Hz", "400 Hz"]})
    assert band.disturbance.band == pytest.approx(
        (2 * math.pi * 10 / SI.plant.reference_frequency, 2 * math.pi * 400 / SI.plant.reference_frequency)
    )
    assert fg.Scenario.from_toml(band.to_toml()) == band
    spectrum = [["100 Hz", 1e-3], ["400 Hz", 1e-4]]
    vibration = SI.replace({"disturbance.kind": "vibration", "disturbance.psd": spectrum})
    assert vibration.disturbance.psd[1][0] == pytest.approx(2 * math.pi * 400 / SI.plant.reference_frequency)
    assert fg.Scenario.from_toml(vibration.to_toml()) == vibration


def test_points_accept_text() -> None:
    points = [["0 s", "30 deg/s"], ["2.5 ms", 1.5]]
    scenario = SI.replace({"rate.kind": "table", "rate.points": points})
    np.testing.assert_allclose(np.array(scenario.rate.points), [[0.0, math.pi / 6], [0.0025, 1.5]], rtol=1e-15)
    assert f"points = {toml_value(points)}" in scenario.to_toml()
    assert fg.Scenario.from_toml(scenario.to_toml()) == scenario
    with pytest.raises(fg.ScenarioError, match=r'^device.temperature_points\[0\]\[1\] is "1 s": it is a time; it must'):
        SI.replace({"device.temperature_points": [["0 s", "1 s"]]})


def numbers_in(value: Any) -> list[Any]:
    return list(value) if isinstance(value, tuple) else [value]


GIVEN = [
    ("plant.angular_rate", "300 deg/s", 300 * math.pi / 180),
    ("plant.angular_rate", "300dps", 300 * math.pi / 180),
    ("plant.angular_rate", "15 °/h", 15 * math.pi / 180 / 3600),
    ("plant.angular_rate", "2 rev/s", 4 * math.pi),
    ("plant.angular_rate", "60 rpm", 2 * math.pi),
    ("plant.angular_rate", "1 Hz", 2 * math.pi),
    ("plant.angular_rate", "300 degree / second", 300 * math.pi / 180),  # str of pint's quantity
    ("plant.mass", "180 ug", 1.8e-7),
    ("plant.mass", "1.8e-4 g", 1.8e-7),
    ("plant.stiffness.xx", "64 mN/mm", 64.0),
    ("plant.reference_length", "2 µm", 2e-6),
    ("plant.reference_frequency", "1 kHz", 2000 * math.pi),
    ("run.step", "2 us", 2e-3),
    ("run.duration", "20ms", 20.0),
    ("controller.observer_bandwidth", "50 kHz", 100 * math.pi),
    ("controller.layer_thickness", "60 um/s", 0.06),
    ("controller.terminal_exponent", "40 %", 0.4),
    ("disturbance.standard_deviation", "0.36 µN", 2.0),
    ("device.position_noise_density", "0.1 pm/sqrt(Hz)", 1e-13),
    ("device.position_noise_density", "0.1 pm/Hz**0.5", 1e-13),
    ("device.position_noise", "10 fm", 1e-14),
    ("device.pickoff_misalignment", "0.5 deg", math.pi / 360),
    ("device.frequency_temperature_coefficient", "-31 ppm/degC", -31.0),
    ("device.damping_drift", "0.3 %/K", 3000.0),
    ("device.temperature_ramp", "60 K/h", 1 / 60),
    ("device.rate_random_walk", "1 deg/h/sqrt(h)", math.pi / 180 / 3600 / 60),
    ("device.cubic_stiffness", "2 N/mm^3", (2e9, 2e9)),
    ("device.cubic_stiffness", ["1 N/mm^3", "2 N mm⁻³"], (1e9, 2e9)),
    ("reference.frequency", ["4.5 kHz", "4.6 kHz"], (9 * math.pi, 9.2 * math.pi)),
    ("reference.phase", ["90 deg", "1 rad"], (math.pi / 2, 1.0)),
]


@pytest.mark.parametrize(("path", "text", "number"), GIVEN, ids=[f"{path} {text}" for path, text, _ in GIVEN])
def test_text_with_units_is_converted_and_printed_as_given(path: str, text: Any, number: Any) -> None:
    scenario = fg.Scenario.paper().replace({"disturbance.hold": None, path: text})
    assert value_at(scenario, path) == pytest.approx(number, rel=2e-16)
    again = fg.Scenario.from_toml(scenario.to_toml())
    assert again == scenario
    assert again.to_toml() == scenario.to_toml()
    assert toml_value(text) in scenario.to_toml()
    copied = pickle.loads(pickle.dumps(scenario))
    assert copied == scenario
    assert copied.to_toml() == scenario.to_toml()


REFUSED = [
    ("run.step", "2 uz", 'uz is not a unit; it must be a time such as "2 us" or "20 ms"'),
    ("run.step", "2 kg", 'it is a mass; it must be a time such as "2 us" or "20 ms"'),
    ("run.step", "two", 'it must be a number, or a time such as "2 us" or "20 ms"'),
    ("run.step", "2", 'it must be a number, or a time such as "2 us" or "20 ms"'),
    ("run.step", "1e5", 'it must be a number, or a time such as "2 us" or "20 ms"'),
    ("run.step", "-2 us", "it must be greater than 0"),
    ("run.step", "1e999999999999 s", "it must be finite"),
    ("run.step", "2 s^(1/0)", 'it must be a time such as "2 us" or "20 ms"'),
    ("run.step", "2 " + "(" * 60, "( is not a unit; it must be a time"),
    ("plant.angular_rate", "40 dB", "dB is not a unit; it must be a frequency or an angular rate"),
    ("controller.layer_thickness", "1 um Hz", 'it must be a velocity such as "1 mm/s"'),
    ("controller.force_limit", "5 g", 'it is a mass; it must be a force such as "1 uN"'),
    ("controller.order", "0.9", "it must be a number"),
    ("controller.order", "1 rad", 'it is an angle; it must be a ratio such as "5 %" or "300 ppm"'),
    ("controller.order", "120 %", "it must lie between 0 and 1"),
    ("disturbance.seed", "3 s", "it must be an integer"),
    ("disturbance.hold", "1.5 us", "it must be a whole number of run.step, which is 0.001"),
    ("reference.amplitude", "1 um", "it must be a list of 2 numbers [x, y]"),
]


@pytest.mark.parametrize(
    ("path", "text", "sentence"), REFUSED, ids=[f"{path} {text[:20]}" for path, text, _ in REFUSED]
)
def test_text_that_is_no_such_quantity_is_refused_in_one_sentence(path: str, text: str, sentence: str) -> None:
    with pytest.raises(fg.ScenarioError) as refused:
        fg.Scenario.paper().replace({path: text})
    assert str(refused.value).startswith(f'{path} is "{text}": ' if len(text) < 40 else f"{path} is ")
    assert sentence in str(refused.value)


def test_an_invalid_plant_is_reported_before_text_that_needs_its_scales() -> None:
    with pytest.raises(fg.ScenarioError, match=r'^plant.mass is "0 g": it must be greater than 0$'):
        fg.Scenario(plant={"mass": "0 g"}, run={"step": "2 us"})


def test_g_is_the_gravity_where_an_acceleration_is_meant_and_the_gram_elsewhere() -> None:
    assert quantity("2 g", parse("m/s^2"), "m/s^2") == 2 * 9.80665
    assert quantity("20 ug/sqrt(Hz)", parse("m/s^2/sqrt(Hz)"), "m/s^2/sqrt(Hz)") == pytest.approx(1.96133e-4, rel=1e-15)
    assert quantity("2 g", parse("kg"), "kg") == 0.002


def test_values_of_a_disturbance_are_accelerations_if_it_states_so() -> None:
    shock = {"kind": "pulse", "quantity": "acceleration", "amplitude": ("500 g", 0.0), "start": 1.0, "width": "0.5 ms"}
    scenario = fg.Scenario(disturbance=shock)
    assert scenario.disturbance.amplitude == (500 * 9.80665, 0.0)  # unit omega0^2 q0: 1 m/s^2
    assert scenario.in_si() == fg.Scenario.from_toml(scenario.in_si().to_toml()) == scenario
    assert number_of(scenario, "disturbance.amplitude", ["1 g", 0.0]) == [9.80665, 0.0]
    added = fg.Scenario.paper().replace({"disturbance": [{"kind": "none"}, shock]})
    assert added.disturbance.added[0].amplitude == scenario.disturbance.amplitude
    vibration = {"kind": "vibration", "quantity": "acceleration", "psd": [["20 Hz", "0.04 g^2/Hz"], ["90 Hz", 1.0]]}
    (_, density), _ = fg.Scenario(disturbance=vibration).disturbance.psd
    assert density == pytest.approx(0.04 * 9.80665**2 * 1000 / (2 * math.pi))  # for one-sided spectra over rad/s
    with pytest.raises(fg.ScenarioError, match=r'amplitude\[0\] is "1 uN": it is a force; it must be an acceleration'):
        fg.Scenario(disturbance=shock | {"amplitude": ("1 uN", 0.0)})


def test_physical_values_stay_when_the_scales_change() -> None:
    scenario = fg.Scenario.paper().replace({"run.duration": "20 ms", "disturbance.hold": None})
    slower = scenario.replace({"plant.reference_frequency": 500.0})
    assert (scenario.run.duration, slower.run.duration) == (20.0, 10.0)
    moved = fg.Scenario(plant=slower.plant, run=scenario.run)
    assert moved.run.duration == 10.0
    assert 'duration = "20 ms"' in moved.to_toml()


def test_scenarios_with_equal_numbers_are_equal_and_each_prints_its_own_text() -> None:
    plain = fg.Scenario.paper().replace({"run.step": 1e-3, "disturbance.hold": 1e-3})
    one, other = plain.replace({"run.step": "1 us"}), plain.replace({"disturbance.hold": "1 us"})
    assert plain == one == other
    assert len({plain, one, other}) == 1
    assert plain.content_hash() == one.content_hash() == other.content_hash()
    assert 'step = "1 us"' in one.to_toml()
    assert 'hold = "1 us"' in other.to_toml()
    assert '"1 us"' not in plain.to_toml()
    short = {"run.duration": 1.0}
    np.testing.assert_array_equal(
        fg.simulate(one.replace(short))["position"], fg.simulate(plain.replace(short))["position"]
    )


def test_a_file_in_si_is_wholly_in_si_and_so_are_its_results() -> None:
    text = """
        units = "SI"
        [plant]
        angular_rate = 5.0
        [reference]
        amplitude = [2e-6, 1e-6]
        frequency = [4000, 5000.0]
        phase = [0.0, 1.5]
        [controller]
        fractional_gain = 10.0
        force_limit = inf
        [disturbance]
        kind = "none"
        [run]
        step = 2e-6
        duration = "4 ms"
    """
    scenario = fg.Scenario.from_toml(text)
    assert scenario.plant.angular_rate == 5.0
    assert scenario.reference.amplitude == (2.0, 1.0)
    assert scenario.reference.frequency == (4.0, 5.0)
    assert scenario.controller.fractional_gain == pytest.approx((10 / 1000**1.1,) * 2, rel=1e-15)
    assert scenario.controller.layer_thickness == fg.Scenario().controller.layer_thickness  # left out: the paper's
    assert (scenario.run.step, scenario.run.duration, scenario.run.units) == (2e-3, 4.0, "SI")
    written = scenario.to_toml()
    assert 'step = "2e-06 s"' in written
    assert 'frequency = ["4000 rad/s", "5000.0 rad/s"]' in written
    assert fg.Scenario.from_toml(written) == scenario
    assert float(fg.simulate(scenario)["time"][-1]) == pytest.approx(4e-3, rel=1e-14)
    chosen = fg.Scenario.from_toml(text.replace("[run]", '[run]\nunits = "nondimensional"'))
    assert chosen.run.units == "nondimensional"
    with pytest.raises(fg.ScenarioError, match=r'^units is "si": it must be nondimensional or SI$'):
        fg.Scenario.from_toml('units = "si"')
    assert fg.Scenario(units="SI", run={"step": 2e-6, "duration": 0.01}).run.step == 2e-3


@pytest.mark.parametrize("scenario", DEVICES, ids=["paper", *SHIPPED])
def test_every_shipped_scenario_in_si_reads_back_to_the_same_numbers(scenario: fg.Scenario) -> None:
    si = scenario.in_si()
    text = si.to_toml()
    assert fg.Scenario.from_toml(text) == si == scenario
    assert si.content_hash() == scenario.content_hash()
    plain = tomllib.loads(text)
    for path, info in FIELDS.items():
        value: Any = plain
        for name in path.split("."):
            value = value.get(name, "not set") if isinstance(value, dict) else value
        for each in value if isinstance(value, list) else [value]:
            assert isinstance(each, str) or each == math.inf or path in WHOLE, (path, info)


def test_the_command_prints_a_scenario_in_si() -> None:
    ran = CliRunner().invoke(cli, ["scenario", "dual_mass", "--units", "SI"])
    assert ran.exit_code == 0
    assert 'mass = "1.42 mg"' in ran.output
    assert fg.Scenario.from_toml(ran.output) == fg.Scenario.shipped("dual_mass")


def test_the_command_line_accepts_units_and_the_noise_follows_the_step() -> None:
    words = ["--set", "run.duration=20ms", "--set", "run.step=2 us", "--set", "plant.angular_rate=300 dps", "--json"]
    ran = CliRunner().invoke(cli, ["simulate", *words])
    plain = ["--set", "run.duration=20.0", "--set", "run.step=0.002", "--json"]
    plain += ["--set", f"plant.angular_rate={300 * math.pi / 180!r}"]
    assert ran.exit_code == 0
    assert ran.output == CliRunner().invoke(cli, ["simulate", *plain]).output


def test_a_study_accepts_units(tmp_path: Path) -> None:
    def plan(vary: str) -> Any:
        file = tmp_path / "study.toml"
        file.write_text(f'[fixed]\nrun.initial_position = ["1 um", 0.0]\n[vary]\n{vary}\n[design]\nkind = "grid"\n')
        return read_plan(file)

    ranged = plan('plant.angular_rate = { low = "-300 deg/s", high = "300 deg/s", steps = 3 }')
    assert [point[0] for point in ranged.points] == pytest.approx([-5.23598775598, 0.0, 5.23598775598])
    listed = plan('run.duration = ["10 ms", 20.0]')
    assert list(listed.points) == [(10.0,), (20.0,)]
    assert [listed.scenario(k).run.duration for k in (0, 1)] == [10.0, 20.0]
    with pytest.raises(fg.ScenarioError, match=r'^plant.angular_rate is "3 kg": it is a mass; it must be a frequency'):
        plan('plant.angular_rate = ["3 kg"]')


def test_the_coefficient_of_the_frequency_is_half_that_of_the_stiffness() -> None:
    ramp = {"device.temperature_ramp": 1e5, "run.duration": 5.0}
    one = SI.replace({**ramp, "device.frequency_temperature_coefficient": -15.0})
    other = SI.replace({**ramp, "device.stiffness_drift": -30.0})
    assert one != other
    np.testing.assert_array_equal(fg.simulate(one)["position"], fg.simulate(other)["position"])
    with pytest.raises(fg.ScenarioError) as refused:
        other.replace({"device.frequency_temperature_coefficient": "-15 ppm/K"})
    assert str(refused.value) == (
        "device.stiffness_drift is -30.0 and device.frequency_temperature_coefficient is "
        '"-15 ppm/K": at most one of the two can be given'
    )
    with pytest.raises(fg.ScenarioError, match=r"^device.frequency_temperature_coefficient is -1000000.0: over"):
        SI.replace({"device.frequency_temperature_coefficient": -1e6, "device.temperature_ramp": 1e3})


UNITS = [
    *("s", "m", "kg", "N", "N/m", "N s/m", "rad/s", "rad", "Hz", "m/s", "N/m^3", "ppm/K", "m/sqrt(Hz)", "K/s"),
    *("N^2 s", "kg m^-2", "s^-1.1", "m^0.5 s^-1.5", "rad/s/sqrt(s)", "(m/s)/sqrt(Hz)"),
]


@given(
    st.floats(-1e12, 1e12).filter(lambda value: value == 0 or abs(value) > 1e-12),
    st.sampled_from(UNITS),
    st.floats(1e-9, 1e9),
)
def test_a_printed_number_reads_back_exactly(value: float, unit: str, factor: float) -> None:
    wanted = parse(unit).times(base("1", Decimal(repr(factor))))  # a nondimensional unit
    text = printed(value, wanted, unit)
    assert text == value
    assert quantity(text.text, wanted, unit) == value


@given(st.text("0123456789.eE+-*/^() smkgNHzrad%°µ²⁻", max_size=12))
def test_any_text_is_a_quantity_or_refused(text: str) -> None:
    with contextlib.suppress(UnitError):
        assert math.isfinite(quantity(text, parse("s"), "s"))


def test_units_are_those_of_pint() -> None:
    pint = pytest.importorskip("pint", reason="pint, which the extra interop brings, is not installed")
    registry = pint.UnitRegistry()
    prefixed = [f"{prefix}{unit}" for prefix in PREFIXES for unit in PREFIXED]
    # pint lacks dps, rev and ppb; its Hz is 1/s, of which an angular frequency has 2 pi.
    listed = (*PREFIXED, *DEFINED, *prefixed, *UNITS)
    names = [name for name in listed if not re.search("dps|Hz|degC|rev|ppb|sqrt", name)]
    for name in names:
        theirs = registry.Quantity(1.0, name)
        for unit in ("kg", "m", "s", "K", "A", "rad"):
            power = dict(zip(BASE, parse(name).powers, strict=True))[unit]
            theirs = theirs / registry.Quantity(1.0, unit) ** power
        assert theirs.to("").magnitude == pytest.approx(float(parse(name).factor), rel=1e-12), name
    speed = registry.Quantity(300.0, "deg/s")
    for text in (f"{speed}", f"{speed:~}", f"{speed:P}", f"{speed:~P}", f"{speed:C}", f"{speed:~C}"):
        assert quantity(text, parse("rad/s"), "rad/s") == pytest.approx(300 * math.pi / 180, rel=1e-15), text


def test_the_page_lists_every_unit() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs/units.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.*) \| (.*) \|$", page.partition("## Accepted units")[2], re.M)[1:]
    listed = {name for row in rows for name in re.findall(r"`([^`]+)`", row[0])}
    assert listed == {*PREFIXED, *DEFINED}
    marked = {name for row in rows for name in re.findall(r"`([^`]+)`", row[0]) if "prefix" in row[1]}
    assert marked == set(PREFIXED)
    prefixes = re.search(r"Prefixes: (.*)\.$", page, re.M)
    assert prefixes
    assert re.findall(r"`(\w)`", prefixes[1]) == list(PREFIXES)


SI_ROWS = [[0.0, 0.0, 0.0], [0.01, 1e-6, 2.5e-6], [0.02, 0.0, 0.0]]


def written(folder: Path, header: str, rows: list[list[float]]) -> str:
    path = folder / "rows.csv"
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("table", ["reference", "disturbance"])
def test_a_file_of_a_scenario_in_si_is_in_si(tmp_path: Path, table: str) -> None:
    inline = fg.Scenario(units="SI", **{table: {"kind": "table", "points": SI_ROWS}})
    name = written(tmp_path, "time,x,y", SI_ROWS)
    assert fg.Scenario(units="SI", **{table: {"kind": "table", "file": name}}) == inline
    toml = f"units = 'SI'\n[{table}]\nkind = 'table'\nfile = 'rows.csv'"
    assert fg.Scenario.from_toml(toml, folder=tmp_path) == inline
    plain = fg.Scenario(**{table: {"kind": "table", "file": name}})
    assert value_at(plain, f"{table}.points") == tuple(map(tuple, SI_ROWS))


def test_files_of_added_entries_and_of_si_tables_are_in_si(tmp_path: Path) -> None:
    name = written(tmp_path, "time,x,y", SI_ROWS)
    pair = [{"kind": "none"}, {"kind": "table", "quantity": "acceleration", "file": name}]
    added = fg.Scenario(units="SI", disturbance=pair).disturbance.added[0]
    assert added.points[1] == pytest.approx((10.0, 1e-6, 2.5e-6))  # the unit is omega0^2 q0, 1 m/s^2
    rates = written(tmp_path, "time (ms), rate (deg/s)", [[0.0, 0.0], [10.0, 180.0]])
    for units in ("SI", "nondimensional"):
        rate = fg.Scenario(units=units, rate={"kind": "table", "file": rates}).rate
        assert rate.points[1] == pytest.approx((0.01, math.pi))


def test_the_header_of_a_file_may_have_units(tmp_path: Path) -> None:
    name = written(tmp_path, "time (ms), x (um),y", [[0, 0, 0], [10, 1.5, 2]])
    by_file = {"reference.kind": "table", "reference.file": name}
    assert SI.replace(by_file).reference.points == ((0.0, 0.0, 0.0), (10.0, 1.5, 2.0))
    shock = written(tmp_path, "time (ms),x (g),y (m/s^2)", [[0, 0, 0], [1, 2, 3]])
    table = {"kind": "table", "quantity": "acceleration", "file": shock}
    assert fg.Scenario(disturbance=table).disturbance.points[1] == pytest.approx((1.0, 2 * 9.80665, 3.0))
    for header, said in {
        "time (ms),x (kg),y": 'its column x is in kg: it is a mass; it must be a length such as "1.5 um"',
        "time (m),x,y": "its column time is in m: it is a length; it must be a time",
        "time (bar),x,y": "its column time is in bar: bar is not a unit; it must be a time",
        "time (),x,y": "its first line must be 'time,x,y', where a unit may follow each name in parentheses",
        "t,x,y": "its first line must be 'time,x,y'",
    }.items():
        written(tmp_path, header, [[0, 0, 0]])
        with pytest.raises(fg.ScenarioError) as caught:
            SI.replace(by_file)
        assert said in str(caught.value)


def test_tera_and_peta_are_prefixes() -> None:
    assert parse("TN/m^3").factor == 10**12
    assert parse("petanewton").factor == 10**15


def test_added_entries_and_comments_are_in_si() -> None:
    entries = [{"kind": "none"}, {"kind": "sine", "amplitude": [1.0, 0.0]}]
    text = fg.Scenario(disturbance=entries).in_si().to_toml()
    added = text.partition("# Added to it.")[2]
    assert 'start = "0 s"' in added
    assert 'phase = ["0 rad", "0 rad"]' in added
    comments = [line for line in text.partition("[reference]")[2].splitlines() if line.startswith("#")]
    assert any("[x, y], unit m: amplitude" in line for line in comments)
    assert "q0, m: the unit of length of every other table." in text
    assert fg.Scenario.from_toml(text) == fg.Scenario(disturbance=entries)
