"""A scenario from the numbers of a data sheet: fields, comments, the bound, refusals, the command."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import fracgyro as fg
import pytest
from click.testing import CliRunner
from fracgyro.cli.sheet import device_command

DUAL_MASS = fg.Scenario.shipped("dual_mass")
SHEET: dict[str, Any] = {"frequency": (15e3, 15.2e3), "q": (20_000, 8_000), "mass": 3e-9}


def comments(toml: str) -> dict[str, list[str]]:
    """By dotted name of a field, the comments directly above it."""
    found: dict[str, list[str]] = {}
    table, above = "", []
    for line in toml.splitlines():
        if opened := re.fullmatch(r"\[+(\w+)\]+", line):
            table = opened[1]
        if named := re.match(r"(\w+) = ", line):
            found[f"{table}.{named[1]}"] = above
        above = [*above, line] if line.startswith("# ") else []
    return found


def test_the_data_sheet_of_a_shipped_device_gives_its_scenario_back() -> None:
    """The numbers of python/fracgyro/scenario/shipped/dual_mass.toml, with the digits that a data sheet has."""
    bound = fg.rate.bound_angle_random_walk(DUAL_MASS)
    assert bound is not None
    made = fg.device(
        ("3925 Hz", "3978 Hz"), (4673, 449), mass="1.42 mg", amplitude="5 um", full_scale=300, bandwidth=100,
        angle_random_walk=f"{math.degrees(bound.unknown) * 60:.4g} deg/sqrt(h)", temperature_coefficient=-30,
        sampling=24661.5 / 0.05,
    )  # fmt: skip
    differences = made.scenario().differences(DUAL_MASS)
    assert differences.pop("device.frequency_temperature_coefficient") == (-30.0, 0.0)
    expected = {
        "plant.mass", "plant.stiffness", "plant.damping", "plant.angular_rate", "plant.reference_frequency",
        "reference.frequency", "adaptation.rate_forgetting", "disturbance.density", "device.position_noise_density",
        "datasheet.delay", "run.step", "run.duration",
    }  # fmt: skip
    assert set(differences) <= expected
    assert differences.pop("datasheet.delay") == (0, None)
    for name, (found, given) in differences.items():
        digits = 3e-3 if name == "device.position_noise_density" else 2e-5
        numbers = [dict(each).values() if name.startswith("plant.") and hasattr(each, "xx") else each
                   for each in (found, given)]  # fmt: skip
        for one, other in zip(*(each if not isinstance(each, float) else (each,) for each in numbers), strict=True):
            assert one == pytest.approx(other, rel=digits), name


def test_the_head_of_the_scenario_stays_whole_above_that_of_the_device() -> None:
    text = fg.device(**SHEET).to_toml()
    head = [line for line in DUAL_MASS.to_toml().splitlines() if line]
    whole = head[: next(i for i, line in enumerate(head) if not line.startswith("# ") or line.startswith("# The "))]
    assert len(whole) > 1
    assert text.splitlines()[: len(whole)] == whole


def test_every_number_goes_to_its_field() -> None:
    made = fg.device(
        15e3, 20_000, split=200, mass=3e-9, quadrature=90, full_scale=500, bandwidth=50, temperature_coefficient=-20,
        amplitude=2e-6, delay=6e-6, sampling=5e5,
    ).scenario()  # fmt: skip
    omega = 2 * math.pi * 15e3
    assert made.plant.stiffness.xx == pytest.approx(3e-9 * omega**2)
    assert made.plant.stiffness.yy == pytest.approx(3e-9 * (omega * 15.2 / 15) ** 2)
    assert made.plant.stiffness.xy == pytest.approx(2 * 3e-9 * omega * math.pi / 2)
    assert made.plant.damping.xx == pytest.approx(3e-9 * omega / 20_000)
    assert made.plant.damping.yy == pytest.approx(3e-9 * omega * 15.2 / 15 / 20_000)
    assert made.plant.damping.xy == 0
    assert made.plant.angular_rate == pytest.approx(math.radians(500))
    assert made.plant.reference_length == 2e-6
    assert made.adaptation.rate_forgetting == pytest.approx(2 * math.pi * 50 / omega, rel=1e-5)
    assert made.device.frequency_temperature_coefficient == -20
    assert made.datasheet.stiffness_drift == pytest.approx(40e-6 / 6 / omega, rel=5e-3)
    assert made.run.step == pytest.approx(omega / 5e5)
    assert (made.device.delay, made.datasheet.delay) == (3, 3)
    # Thermal force at 300 K: 2 k_B T c in units of force^2/omega0.
    power = 2 * 1.380649e-23 * 300 * made.plant.damping.yy
    assert made.disturbance.density == pytest.approx(power * omega / (3e-9 * omega**2 * 2e-6) ** 2, rel=1e-5)


def test_the_axes_of_the_damping_are_turned_as_said() -> None:
    damping = fg.device((15e3, 15.2e3), (1000, 5000), damping_axis=12).scenario().plant.damping
    assert 0.5 * math.degrees(math.atan2(2 * damping.xy, damping.xx - damping.yy)) == pytest.approx(12)


@pytest.mark.parametrize("walk", [0.012, 0.2, 5.0])
def test_the_bound_of_the_scenario_is_the_angle_random_walk_of_the_sheet(walk: float) -> None:
    made = fg.device((3925, 3978), (4673, 449), mass=1.42e-6, angle_random_walk=walk).scenario()
    bound = fg.rate.bound_angle_random_walk(made)
    assert bound is not None
    assert math.degrees(bound.unknown) * 60 == pytest.approx(walk, rel=2e-3)


def test_what_was_given_and_what_is_supposed_stands_above_each_field() -> None:
    text = fg.device(**SHEET, full_scale=500, angle_random_walk=0.2).to_toml()
    assert fg.Scenario.from_toml(text) == fg.device(**SHEET, full_scale=500, angle_random_walk=0.2).scenario()
    above = comments(text)
    given = {"plant.mass": "mass 3e-09 kg", "plant.angular_rate": "full scale 500 deg/s",
             "plant.damping": "quality factors 20000 and 8000", "plant.stiffness": "frequencies 15000 and 15200 Hz",
             "device.position_noise_density": "angle random walk 0.2 deg/sqrt(h)"}  # fmt: skip
    for field, words in given.items():
        assert any(each.startswith(f"# given: {words}") for each in above[field]), field
        assert not any("supposed: " in each for each in above[field]) or field in ("plant.damping", "plant.stiffness")
    for field in ("adaptation.rate_forgetting", "plant.reference_length", "run.step", "disturbance.density",
                  "datasheet.stiffness_drift", "datasheet.damping_drift", "device.delay"):  # fmt: skip
        assert any(each.startswith("# supposed: ") for each in above[field]), field
        assert not any("given: " in each for each in above[field]), field
    changed = set(fg.device(**SHEET, full_scale=500, angle_random_walk=0.2).changes) - {"run.duration"}
    assert not [field for field in changed if not re.search("# (given|supposed): ", " ".join(above[field]))]


@pytest.mark.parametrize("q", [20, 60, (20_000, 300), 1e6])
def test_devices_in_air_and_in_vacuum_run_and_find_the_rate(q: Any) -> None:
    """From an estimate of zero to half of the full scale; the force suffices for the amplitude, whatever the Q."""
    made = fg.device((15e3, 15.2e3), q, mass=3e-9, quadrature=20, full_scale=400, sampling=4e5).scenario()
    rate = made.plant.angular_rate / 2
    changes = {"run.duration": 6000.0, "plant.angular_rate": rate, "adaptation.initial_rate": 0.0}
    run = fg.simulate(made.replace({**changes, "run.record_every": 10}))
    late = run["rate_estimate"].values[-300:]
    unit = 1.0 if run["rate_estimate"].attrs["units"] == "rad/s" else made.plant.reference_frequency
    assert abs(late.mean() * unit - rate) < 0.02 * rate
    assert abs(run["error"].values[-300:]).max() < 0.01


def test_a_delay_is_whole_steps_of_a_sampling_rate_that_is_not_given() -> None:
    for seconds in (1e-6, 5.3e-6):
        made = fg.device(**SHEET, delay=seconds).scenario()
        steps = made.device.delay
        assert 1 <= steps <= 8
        assert steps * made.run.step == pytest.approx(seconds * 2 * math.pi * 15e3)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"frequency": 15e3}, "split is missing: frequency is one number, 15000 Hz, so it must be given"),
        ({"frequency": (15e3, 15e3)}, "the frequencies are 15000 and 15000 Hz: both must be above 0 and differ"),
        ({"frequency": "15 kg"}, "frequency is '15 kg': it is a mass; it must be a frequency such as"),
        ({"frequency": (1, 2, 3)}, "frequency is (1, 2, 3): it must be one number, or two for x and y"),
        ({"split": 100}, "split is 100 Hz: it must be left out, as frequency has both frequencies"),
        ({"q": 0}, "q is 0: it must be greater than 0"),
        ({"q": math.nan}, "q is nan: it must be a finite number"),
        ({"mass": "-1 ug"}, "mass is '-1 ug': it must be greater than 0"),
        ({"quadrature": "big"}, "quadrature is 'big': it must be"),
        ({"angle_random_walk": 1e-5}, "angle_random_walk is 1e-05 deg/sqrt(h): it must be more than 0.0208"),
        ({"angle_random_walk": 1e9}, "angle_random_walk is 1e+09 deg/sqrt(h): it must be less than"),
        ({"damping_axis": 44}, "damping_axis is 44 deg: it must be less than 32.1 deg, so that D > 0"),
        ({"delay": 1e-3}, "delay is 0.001 s: without a sampling rate it must be at most 2.7e-05 s"),
        ({"delay": 1e-3, "sampling": 1e5}, "delay is 0.001 s: it must be at most 8 steps of the sampling rate, 8e-05"),
        ({"delay": -1e-6}, "delay is -1e-06 s: it must be at least 0"),
    ],
)
def test_a_number_that_is_not_allowed_is_refused_in_one_sentence(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)) as refused:
        fg.device(**SHEET | changes)
    assert "\n" not in str(refused.value)


def test_the_command_prints_or_writes_a_scenario_that_loads(tmp_path: Path) -> None:
    words = ["--frequency", "15 kHz,15.2 kHz", "--q", "20000,8000", "--mass", "3 ug", "--bandwidth", "50"]
    printed = CliRunner().invoke(device_command, words)
    assert printed.exit_code == 0, printed.output
    written = CliRunner().invoke(device_command, [*words, "--out", str(tmp_path / "device.toml")])
    assert written.output == f"Written: {tmp_path / 'device.toml'}\n"
    assert (tmp_path / "device.toml").read_text(encoding="utf-8") == printed.stdout
    assert tomllib.loads(printed.stdout)["plant"]["mass"] == 3e-9
    assert fg.Scenario.load(tmp_path / "device.toml") == fg.device(**SHEET, bandwidth=50).scenario()


def test_the_scenario_passes_as_a_rate_sensor(tmp_path: Path) -> None:
    made = fg.device(**SHEET, quadrature=20, angle_random_walk=0.2, full_scale=500, sampling=6e5).scenario()
    short = made.replace({"run.duration": 5000.0})
    found = {each.key: each for each in fg.rate.characterise(short, tmp_path / "rate", quick=True, rest=0.25)}
    assert abs(found["scale_factor_error"].value) < 100
    assert found["full_scale"].low >= 500 or found["full_scale"].value >= 500
