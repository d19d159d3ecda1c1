"""User controllers as rate sensors."""

from __future__ import annotations

import ctypes
import json
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import metrics
from fracgyro.export.compilers import system_compiler
from fracgyro.rate.bound import bound_angle_random_walk
from fracgyro.rate.sensor import Sensor
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.named import exactly_sensed

DEVICE = exactly_sensed("dual_mass").replace({"run.duration": 400.0})
D, K = DEVICE.plant.nondimensional()[:2]
GAIN = 0.05
NUMBERS = {"gain": GAIN, **{f"{m}{i}": float(of[i]) for m, of in (("d", D), ("k", K)) for i in range(3)}}

IN_C = """
void sensing(const double* in, double* state, const double* p, double* out) {
    const double *q = in + 1, *v = in + 3, *r = in + 5, *rv = in + 7, *ra = in + 9, *d = p + 1, *k = p + 4;
    const double across[2] = {v[1], -v[0]}, rate = state[0];
    for (int i = 0; i < 2; ++i) {
        const double e = q[i] - r[i], de = v[i] - rv[i];
        out[i] = ra[i] + d[i] * v[0] + d[i + 1] * v[1] + k[i] * q[0] + k[i + 1] * q[1];
        out[i] -= 4 * e + 4 * de + 2 * rate * across[i];
        state[0] += p[0] * (de + e) * across[i];
    }
    out[2] = rate;
}
"""


@pytest.fixture(scope="module")
def sensing(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("law")
    (folder / "law.c").write_text(IN_C, encoding="utf-8")
    options = ["-x", "c", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
    system_compiler(*options, folder / "law.c", "-o", folder / "law.so")
    return ctypes.CDLL(str(folder / "law.so"))


@pytest.fixture(scope="module")
def law(sensing: ctypes.CDLL) -> fg.native.Law:
    return fg.native.Law(sensing.sensing, 1, NUMBERS, ["rate_estimate"])


class Sensing:
    """The law of IN_C, in the units of its samples."""

    def reset(self, scenario: fg.Scenario) -> None:
        scales = scenario.plant.scales
        self.units = (scales.time, scales.length, scales.velocity, scales.force, scales.rate)
        if scenario.run.units != "SI":
            self.units = (1.0,) * 5
        self.rate = self.said = 0.0

    def __call__(self, s: fg.Sample) -> tuple[float, float]:
        time, length, velocity, force, _ = self.units
        q, r = ([each / length for each in pair] for pair in (s.position, s.reference))
        v, rv = ([each / velocity for each in pair] for pair in (s.velocity, s.reference_velocity))
        ra = [each * time / velocity for each in s.reference_acceleration]
        across, u, rate = (v[1], -v[0]), [0.0, 0.0], self.rate
        for i in range(2):
            e, de = q[i] - r[i], v[i] - rv[i]
            u[i] = ra[i] + D[i] * v[0] + D[i + 1] * v[1] + K[i] * q[0] + K[i + 1] * q[1]
            u[i] -= 4 * e + 4 * de + 2 * rate * across[i]
            self.rate += GAIN * (de + e) * across[i]
        self.said = rate
        return u[0] * force, u[1] * force

    def report(self) -> dict[str, float]:
        return {"rate_estimate": self.said * self.units[4]}


def test_the_output_is_what_the_controller_reports_in_any_units(law: fg.native.Law) -> None:
    rate = float(DEVICE.plant.angular_rate)
    expected = Sensor.of(DEVICE, 1, law).output(rate)
    run = fg.simulate(DEVICE.replace({"adaptation.initial_rate": 0.0}), law)["rate_estimate"].values
    assert expected.rate[0, 7] == pytest.approx(run[28:32].mean() * DEVICE.plant.scales.rate, rel=1e-12)
    assert expected.settled().rate.mean() == pytest.approx(rate, rel=0.1)
    for units in ("nondimensional", "SI"):
        found = Sensor.of(DEVICE.replace({"run.units": units}), 1, Sensing()).output(rate)
        np.testing.assert_allclose(found.rate, expected.rate, rtol=0, atol=1e-6 * rate)
        assert found.interval == expected.interval


@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_the_error_of_the_estimate_is_the_same_measured_and_recorded_in_any_units(units: str) -> None:
    scenario = DEVICE.replace({"run.units": units, "run.duration": 20.0})
    time, unit = (scenario.plant.scales.time, scenario.plant.scales.rate) if units == "SI" else (1.0, 1.0)
    found = fg.measure_many([scenario], transient=5.0, controller=Sensing()).isel(run=0)
    wanted = metrics.summary(fg.simulate(scenario, Sensing()), transient=5.0 * time)
    for name in ("rate_error", "rate_error_rms", "rate_error_peak"):
        assert unit * float(found[name]) == pytest.approx(float(wanted[name]), rel=1e-9), name


def test_the_bound_is_of_the_motion_that_the_controller_brings_about(law: fg.native.Law) -> None:
    own, found = bound_angle_random_walk(DEVICE), bound_angle_random_walk(DEVICE, law)
    assert own is not None
    assert found is not None
    assert found.known == pytest.approx(own.known, rel=1e-3), "both follow the reference"
    in_si = bound_angle_random_walk(DEVICE.replace({"run.units": "SI"}), Sensing())
    assert in_si is not None
    assert in_si.known == pytest.approx(found.known, rel=1e-6)
    still = bound_angle_random_walk(DEVICE, lambda s: (0.0, 0.0))
    assert still is None or still.known > 1.1 * own.known


def test_a_law_is_characterised(tmp_path: Path, law: fg.native.Law) -> None:
    found = {each.key: each for each in fg.rate.characterise(DEVICE, tmp_path / "out", controller=law, quick=True)}
    assert abs(found["scale_factor_error"].value) < 1e4
    assert 1e3 < found["bandwidth"].value < 1e4
    content = json.loads((tmp_path / "out" / "rate.json").read_text(encoding="utf-8"))
    assert content["controller"].startswith("sensing with gain = 0.05, d0 = ")
    assert {each["key"]: each["value"] for each in content["figures"]}["bandwidth"] == found["bandwidth"].value
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "the controller is sensing with gain = 0.05" in page
    assert "adaptation: composite" not in page


def test_a_controller_without_an_estimate_is_refused(tmp_path: Path, sensing: ctypes.CDLL) -> None:
    silent = fg.native.Law(sensing.sensing, 1, NUMBERS, ["other"])

    def rest(s: fg.Sample) -> tuple[float, float]:
        return 0.0, 0.0

    for controller, name in ((silent, "sensing with gain = 0.05, .*"), (rest, ".*rest")):
        with pytest.raises(ScenarioError, match=rf"^controller is {name}: it must report rate_estimate, the sensor"):
            fg.rate.characterise(DEVICE, tmp_path / "out", controller=controller)
    with pytest.raises(TypeError, match=r"controller is 3: it must be a native\.Law"):
        fg.rate.characterise(DEVICE, tmp_path / "out", controller=3)
    assert list(tmp_path.iterdir()) == []


def test_allan_takes_what_holds_numbers_and_says_what_does_not() -> None:
    noise = np.random.default_rng(0).normal(size=1000)
    assert fg.rate.allan(noise.tolist(), 0.5).tau.tolist() == fg.rate.allan(noise, 0.5).tau.tolist()
    with pytest.raises(ValueError, match=r"interval is 0: it must be greater than 0"):
        fg.rate.allan(noise, 0)
    with pytest.raises(ValueError, match="values has 3 dimensions"):
        fg.rate.allan(np.ones((2, 2, 100)), 1.0)
    with pytest.raises(TypeError, match="values has dtype"):
        fg.rate.allan(["a"] * 30, 1.0)
