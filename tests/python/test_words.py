"""Firmware between converters: from the words of the ADC to those of the DAC, as `simulate` rounds."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.export.compilers import FLAGS, Number, compiler
from fracgyro.scenario.volts_core import at_bias
from nightly import nightly_unless
from numpy.typing import NDArray

PROGRAM = """
#include "fracgyro.h"
#include <stdio.h>
int main(void) {
    static fracgyro_state state;
    fracgyro_init(&state);
    fracgyro_words position, velocity, drive;
    while (scanf("%d %d %d %d", &position.x, &position.y, &velocity.x, &velocity.y) == 4) {
        const fracgyro_status status = fracgyro_step_words(&state, &position, &velocity, &drive);
        printf("%d %d %d\\n", (int)status, drive.x, drive.y);
    }
    return 0;
}
"""
ADC = 20  # bits


def answers(scenario: fg.Scenario, rows: NDArray[Any], folder: Path, number: Number = "double") -> NDArray[np.int64]:
    """Status and words of the DAC for rows of words: position x, y, velocity x, y."""
    fg.export.firmware(scenario, folder, number)
    (folder / "words.c").write_text(PROGRAM, encoding="utf-8")
    made = [*compiler(), "-O1", *FLAGS, "-Iinclude", "fracgyro.cpp", "-x", "c++", "words.c", "-o", "words"]
    subprocess.run(made, cwd=folder, check=True)
    given = "\n".join(" ".join(map(str, row)) for row in rows.tolist())
    ran = subprocess.run([folder / "words"], input=given, capture_output=True, text=True, check=True)
    return np.array([list(map(int, line.split())) for line in ran.stdout.splitlines()])


def words(values: NDArray[Any], step: Any) -> NDArray[np.int64]:
    """The words of values that a converter has rounded."""
    found = values / step
    np.testing.assert_allclose(found, np.round(found), rtol=0, atol=1e-6)
    return np.round(found).astype(np.int64)


def in_volts(**changes: Any) -> fg.Scenario:
    """Known to have plates on y, whose driver may know that they grow, and a filter that knows the rounded force."""
    converters = {"device.position_range": [7.5e-6, 7.5e-6], "device.position_bits": ADC, "run.duration": 100.0}
    return fg.Scenario.shipped("dual_mass_volts").replace({**converters, "run.record_every": 1, **changes})


@pytest.mark.parametrize("linearized", nightly_unless(bool, [True, False]))
def test_words_are_those_to_which_a_simulation_rounds(linearized: bool, tmp_path: Path) -> None:
    made = in_volts(**{"electronics.linearized": linearized})
    run = fg.simulate(made)
    position = words(run["measured_position"].values, 1.5 / 2 ** (ADC - 1))
    given = np.column_stack([position, np.zeros_like(position)])
    wanted = words(run["applied_control"].values * made.plant.scales.force, at_bias(made).gain[[0, 2]] * 20.0 / 2**16)
    assert np.abs(wanted).max() > 1000
    np.testing.assert_array_equal(answers(made, given, tmp_path / "firmware")[:, 1:], wanted)


def test_words_of_a_converter_that_gives_the_force_itself(tmp_path: Path) -> None:
    made = fg.Scenario.shipped("hardware").replace({"run.duration": 2.0, "run.record_every": 1})
    scales = made.plant.scales
    device = {"position_bits": ADC, "velocity_bits": ADC, "actuator_bits": 12, "actuator_limit": 500.0 * scales.force}
    device["position_range"] = [2.0 * scales.length] * 2
    device["velocity_range"] = [9.0 * scales.velocity, 8.0 * scales.velocity]
    made = made.replace({f"device.{name}": value for name, value in device.items()})
    run = fg.simulate(made)
    position = words(run["measured_position"].values, 2.0 / 2 ** (ADC - 1))
    velocity = words(run["measured_velocity"].values, np.array([9.0, 8.0]) / 2 ** (ADC - 1))
    wanted = words(run["applied_control"].values, 500.0 / 2**11)
    assert wanted.max() > 100
    found = answers(made, np.column_stack([position, velocity]), tmp_path / "firmware")
    np.testing.assert_array_equal(found[:, 1:], wanted)
    single = answers(made, np.column_stack([position, velocity]), tmp_path / "float", "float")
    controller, step = fg.Controller(made, single_precision=True), np.float32(500.0 / 2**11)
    for n, motion in enumerate(zip(run["measured_position"].values, run["measured_velocity"].values, strict=True)):
        force = controller.step(controller.time, *motion).astype(np.float32)
        assert single[n, 1:].tolist() == np.clip(np.rint(force / step), -2048, 2047).tolist()


def test_a_word_at_the_plate_or_beyond_is_a_fault_like_others(tmp_path: Path) -> None:
    gap = next(one.gap for one in in_volts().electrodes.of("force") if one.kind == "plate")
    made = in_volts(
        **{"electronics.linearized": True, "device.position_range": [2 * gap, 2 * gap], "guard.checked": False}
    )
    given = words(fg.simulate(made)["measured_position"].values, 2 * gap / 2 ** (ADC - 1) / made.plant.scales.length)
    rows = np.column_stack([given, np.zeros_like(given)])
    rows[500], rows[700] = [0, 2 ** (ADC - 2), 0, 0], [2 ** (ADC - 1) - 1, -(2 ** (ADC - 1)), 0, 0]
    found = answers(made, rows, tmp_path / "firmware")
    assert np.abs(found[:, 1:]).max() <= 2**15
    assert set(found[:, 0]) <= {0, 1}, "no force was other than finite"
    assert np.unique(found[1500:, 1:]).size > 100


@pytest.mark.parametrize(
    ("changes", "number", "reason"),
    [
        ({"device.position_bits": 0}, "double", "without device.position_bits"),
        (
            {"electrodes": [{**dict(one), "bits": 0} for one in in_volts().electrodes.each]},
            "double",
            "without bits of electrodes of role force",
        ),
        ({"device.position_bits": 24}, "float", "24 bits are not exact in float"),
    ],
)
def test_without_all_converters_there_is_no_function_of_words(
    changes: dict[str, Any], number: Number, reason: str, tmp_path: Path
) -> None:
    fg.export.firmware(in_volts(**changes), tmp_path / "firmware", number)
    header = (tmp_path / "firmware/fracgyro_coefficients.h").read_text(encoding="utf-8")
    assert f"#define FRACGYRO_WORDS 0 /* no fracgyro_step_words: {reason} */" in header


def test_the_header_says_what_the_words_are(tmp_path: Path) -> None:
    fg.export.firmware(in_volts(), tmp_path / "firmware", "float")
    header = (tmp_path / "firmware/fracgyro_coefficients.h").read_text(encoding="utf-8")
    assert "/* DAC: 16, 16 bits over 10, 10 V */" in header
    assert "/* ADC of the position: 20 bits over 7.5e-06, 7.5e-06 m" in header
