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
    alone = fg.identify(replace(DUAL_MASS.record(8000), y=None))
    with pytest.raises(ValueError, match="axes is principal: these records do not determine kxy"):
        alone.scenario(axes="principal")


def test_the_toml_says_in_which_axes_it_is(found: fg.identify.Found, tmp_path: Path) -> None:
    found.save(tmp_path / "device.toml", axes="principal")
    text = (tmp_path / "device.toml").read_text(encoding="utf-8")
    assert "# All is in the principal axes of the stiffness, which the pick-offs see turned: stiffness_axis +- " in text
    assert fg.Scenario.load(tmp_path / "device.toml") == found.scenario(axes="principal")
    assert found.scenario(axes="principal").plant.angular_rate == pytest.approx(RATE, rel=0.01)
