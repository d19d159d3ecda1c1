"""SI units: one parser for all units of the core, each run of many in its own scales, every kind of controller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from fracgyro.export.units import base_unit
from fracgyro.scenario.kinds import DEVICE_CHANNELS, KINDS, LOOP_CHANNELS, reported_channels
from fracgyro.scenario.scales import Powers, Scales, powers, si_unit
from fracgyro.scenario.to_core import core_setup
from fracgyro.simulation import native
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
