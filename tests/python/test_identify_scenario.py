"""From an identified device to its scenario, its JSON and its report."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from bench_records import DUAL_MASS, RATE
from click.testing import CliRunner
from fracgyro.cli.editors import schema_command
from fracgyro.identification.advice import FreeDecay, information
from fracgyro.identification.model import Shape
from fracgyro.identification.prediction import predict
from fracgyro.identification.to_scenario import correction
from jsonschema import Draft202012Validator

QUIET = {"disturbance.kind": "none", "device.position_noise_density": 0.0, "run.units": "SI"}


@pytest.fixture(scope="module")
def found() -> fg.identify.Found:
    return fg.identify([DUAL_MASS.record(8000)], mass=1.42e-6, pickoff=5e-6)


# -- JSON --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["decay", "forced", "one axis", "undetermined", "trend", "known"])
def test_identify_json_fits_its_schema(kind: str, found: fg.identify.Found) -> None:
    noise = np.random.default_rng(1).normal(size=(2, 8000))
    results = {
        "decay": lambda: found,
        "forced": lambda: fg.identify(
            fg.identify.Record(
                *DUAL_MASS.motion(8000, 12.6) + 1e-3 * noise, DUAL_MASS.interval(12.6), force=noise[::-1]
            )
        ),
        "one axis": lambda: fg.identify(replace(DUAL_MASS.record(8000), y=None)),
        "undetermined": lambda: fg.identify(replace(DUAL_MASS, turn=0.0).record(8000)),
        "trend": lambda: fg.identify([DUAL_MASS.record(6000, seed=i, bias=float(3 + i)) for i in range(3)]),
        "known": lambda: fg.identify([DUAL_MASS.record(8000)], pickoff_ratio=(1.01, 0.01), assume={"dxy": (0.0, 1e-6)}),
    }
    content = json.loads(json.dumps(results[kind]().plain(), allow_nan=False))
    Draft202012Validator(fg.identify.schema()).validate(content)


@pytest.mark.parametrize(
    "spoiled",
    [
        lambda content: content.pop("tests"),
        lambda content: content.update(extra=1),
        lambda content: content["known"].update(mass="1 mg"),
        lambda content: content["conditions"][0]["quantities"]["kxy"].update(value=None),
        lambda content: content["conditions"][0]["quantities"].update(
            kzz=content["conditions"][0]["quantities"]["kxy"]
        ),
        lambda content: content["conditions"][0]["fits"][0].pop("covariance"),
        lambda content: content["conditions"][0]["fits"][0].pop("thermal"),
        lambda content: content["conditions"][0]["fits"][0].update(thermal="none"),
        lambda content: content["conditions"][0]["fits"][0].update(delay={"samples": 1}),
        lambda content: content["tests"][0].update(verdict="maybe"),
    ],
)
def test_another_content_does_not_fit_the_schema(spoiled: Any, found: fg.identify.Found) -> None:
    content = json.loads(json.dumps(found.plain()))
    validator = Draft202012Validator(fg.identify.schema())
    assert validator.is_valid(content)
    changed = copy.deepcopy(content)
    spoiled(changed)
    assert not validator.is_valid(changed)


def test_the_command_prints_the_schema() -> None:
    printed = CliRunner().invoke(schema_command, ["identify"])
    content = json.loads(printed.stdout)
    Draft202012Validator.check_schema(content)
    assert content == fg.identify.schema()


# -- Axes --------------------------------------------------------------------------------------------------------------


def measured(scenario: fg.Scenario, start: np.ndarray, angle: float) -> np.ndarray:
    """Measured positions under constant force, from a start (2, 2) of position and velocity in axes turned back by
    `angle` from those of the plant."""
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    position, velocity = (tuple(map(float, turn @ each)) for each in start)
    plant = fg.Plant(scenario.replace({"run.initial_position": position, "run.initial_velocity": velocity}))
    return np.array([plant.step((2e-5, -1e-5)).position for _ in range(400)])


def test_the_scenario_in_principal_axes_is_the_same_device(found: fg.identify.Found) -> None:
    """The same measured motion from the same start under the same force."""
    pickoffs, turned = found.scenario(), found.scenario(axes="principal")
    angle = math.radians(found["stiffness_axis"].value)
    assert turned.plant.stiffness.xy == 0
    assert turned.device.pickoff_misalignment == pytest.approx(-angle, rel=1e-6)
    assert turned.device.force_misalignment == pytest.approx(-angle, rel=1e-6)
    start = np.array([[0.7, -0.2], [0.1, 0.9]])
    one = measured(pickoffs.replace(QUIET), start, 0.0)
    unit = turned.plant.reference_frequency / pickoffs.plant.reference_frequency
    other = measured(
        turned.replace({**QUIET, "run.step": pickoffs.run.step * unit}), start * [[1.0], [1.0 / unit]], angle
    )
    np.testing.assert_allclose(other, one, atol=2e-7 * abs(one).max())


def test_axes_are_refused_where_they_are_not_known(found: fg.identify.Found) -> None:
    with pytest.raises(ValueError, match="axes is 'east': it must be pickoffs or principal"):
        found.scenario(**{"axes": "east"})
    single = fg.identify(replace(DUAL_MASS.record(8000), y=None))
    with pytest.raises(ValueError, match="axes is principal: these records do not determine kxy"):
        single.scenario(axes="principal")


def test_the_toml_says_in_which_axes_it_is(found: fg.identify.Found, tmp_path: Path) -> None:
    found.save(tmp_path / "device.toml", axes="principal")
    text = (tmp_path / "device.toml").read_text(encoding="utf-8")
    assert "# All is in the principal axes of the stiffness, which the pick-offs see turned: stiffness_axis +- " in text
    assert fg.Scenario.load(tmp_path / "device.toml") == found.scenario(axes="principal")
    assert found.scenario(axes="principal").plant.angular_rate == pytest.approx(RATE, rel=0.01)


# -- Next records ------------------------------------------------------------------------------------------------------


def advised(found: fg.identify.Found) -> dict[str, Any]:
    return {each.name: each for each in found.advice}


def test_the_information_of_a_decay_is_the_sum_over_its_samples() -> None:
    """Central differences of simulated motion, start values unknown too."""
    device, samples = DUAL_MASS, 700
    start, size, noise = np.array([0.8, -0.3, 0.2, 0.9]), 2 * np.pi / 9.0, np.array([1e-3, 2e-3])

    def motion(values: np.ndarray) -> np.ndarray:
        stiffness, damping = values[:4].reshape(2, 2), values[4:8].reshape(2, 2)
        matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
        poles, vectors = np.linalg.eig(matrix)
        weights = np.linalg.solve(vectors, values[8:].astype(complex))
        states = np.real((vectors[:2] * weights) @ np.exp(np.outer(poles, size * np.arange(samples))))
        return (states / noise[:, None]).ravel()

    middle = np.concatenate([device.parameters, start])
    steps = 1e-5 * np.eye(12)
    jacobian = np.stack([(motion(middle + step) - motion(middle - step)) / 2e-5 for step in steps], axis=1)
    whole = jacobian.T @ jacobian
    expected = whole[:8, :8] - whole[:8, 8:] @ np.linalg.solve(whole[8:, 8:], whole[8:, :8])
    found = information(Shape(2), device.parameters, FreeDecay(start, samples, size, noise))
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-5)


@pytest.mark.parametrize("turn", [0.02, 0.0])
def test_the_advice_is_what_such_records_then_give(turn: float) -> None:
    """The same device recorded again, on a turntable, longer and with half the noise: intervals as promised."""
    device = replace(DUAL_MASS, turn=turn, rate=0.0)
    one = device.record(8000, seed=1)
    found = fg.identify(one)
    promised = advised(found)
    rate = -math.copysign(RATE, found["rate"].value)  # the opposite of what the record shows
    assert f"on a turntable at {math.degrees(rate):.0f} deg/s" in promised["known rate"].words
    further = {
        "repeat": [one, device.record(8000, seed=2)],
        "known rate": [one, replace(device, rate=rate).record(8000, seed=2, rate=rate)],
        "longer": [device.record(16_000, seed=3)],
        "amplitude": [device.record(8000, noise=5e-4, seed=4)],
        "start y": [one, device.record(8000, seed=5, start=(0.0, 1.0, 0.0, 0.0))],
    }
    for name, records in further.items():
        got = fg.identify(records)
        assert got["pickoff_ratio"].determined == math.isfinite(promised[name].halves["pickoff_ratio"][1])
        quantities = promised[name].halves.keys() & got.keys()
        if not got["pickoff_ratio"].determined:  # the other intervals cover all ratios, which no bound does
            quantities = {"kxx", "kyy"}
        for quantity in quantities:
            then = promised[name].halves[quantity][1]
            assert got[quantity].half == pytest.approx(then, rel=0.15), (name, quantity)
    assert promised["repeat"].halves["kyy"][0] == pytest.approx(found["kyy"].half, rel=0.05)
    assert ("skew" if turn else "pickoff_ratio") in promised["known rate"].halved
    assert set(promised["amplitude"].halved) >= {"kxx", "dxx", "kyy", "dyy"}
    assert "kyy" not in promised["repeat"].halved


def test_bits_are_advised_where_the_noise_is_that_of_the_converter() -> None:
    record = DUAL_MASS.record(8000, noise=2e-3)
    coarse = replace(
        record, x=np.round(np.asarray(record.x) / 0.01) * 0.01, y=np.round(np.asarray(record.y) / 0.01) * 0.01
    )
    promised = advised(fg.identify(coarse))
    assert "bits" in promised
    assert "bits" not in advised(fg.identify(record))
    now, then = promised["bits"].halves["kyy"]
    assert 0.5 < then / now < 0.8  # the noise of 0.2 steps is left, that of the converter was 0.29


# -- Errors of the sensor ----------------------------------------------------------------------------------------------


def test_the_prediction_is_half_of_what_is_left_of_the_ratio(found: fg.identify.Found) -> None:
    prediction = found.prediction
    assert prediction is not None
    ratio = found["pickoff_ratio"]
    assert prediction.scale_factor == pytest.approx(5e5 * ratio.half / ratio.value, rel=0.01)
    assert f"scale factor ± {float(f'{prediction.scale_factor:.2g}'):,g} ppm" in prediction.words
    # dxy/(4 m) per unit of the ratio, if the stiffness does not couple.
    single = found.scenario().replace({"plant.stiffness.xy": 0.0})
    damped = predict(single, ratio)
    assert damped is not None
    bias = abs(found["dxy"].value) / (4 * 1.42e-6) * ratio.half / ratio.value
    assert damped.bias == pytest.approx(math.degrees(bias) * 3600, rel=0.02)


def test_there_is_no_prediction_without_a_ratio() -> None:
    found = fg.identify(replace(DUAL_MASS, turn=0.0).record(8000))
    assert found.prediction is None
    assert correction(found) is None


@pytest.mark.parametrize("axes", ["pickoffs", "principal"])
def test_the_controller_of_the_scenario_knows_the_pick_offs(axes: Any, found: fg.identify.Found) -> None:
    scenario = found.scenario(axes)
    x, y = scenario.datasheet.pickoff_gain_error
    assert (
        (x, y) == scenario.device.pickoff_gain_error == (0.0, pytest.approx(found["pickoff_ratio"].value - 1, abs=1e-5))
    )
    assert scenario.datasheet.pickoff_misalignment == scenario.device.pickoff_misalignment
    assert (scenario.datasheet.pickoff_misalignment != 0.0) == (axes == "principal")
    assert "multiply what is measured" not in found.to_toml(axes)


def test_the_report_has_its_figures_advice_and_prediction(found: fg.identify.Found, tmp_path: Path) -> None:
    found.save(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("<img ") == 6
    assert page.index("<img ") < page.index("<table")
    for words in ("What to record next", "Joint region of the pick-off ratio", "on a turntable at -300 deg/s"):
        assert words in page
    assert found.prediction is not None
    assert found.prediction.words in page
    content = json.loads((tmp_path / "out" / "identify.json").read_text(encoding="utf-8"))
    assert content["prediction"]["words"] == found.prediction.words
    assert [each["name"] for each in content["record_next"]] == [each.name for each in found.advice]
