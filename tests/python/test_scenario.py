"""The scenario: accepted values, messages for others, and an unchanged round trip through TOML."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fracgyro.scenario import Scenario, ScenarioError
from fracgyro.scenario.kinds import KINDS, kinds_with
from fracgyro.scenario.messages import paths
from fracgyro.scenario.printing import OWN_KINDS, having
from fracgyro.scenario.schema import ERRATA_SWITCHES
from fracgyro.scenario.table import Symmetric, toml_value
from fracgyro.simulation.simulate import simulate
from hypothesis import given, settings
from hypothesis import strategies as st

PAPER = Scenario.paper()


def refusal(changes: dict[str, Any]) -> str:
    with pytest.raises(ScenarioError) as caught:
        PAPER.replace(changes)
    return only_sentence(caught.value)


def toml_refusal(text: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_toml(text)
    return only_sentence(caught.value)


def only_sentence(error: ScenarioError) -> str:
    assert error.__cause__ is None
    assert error.__context__ is None or error.__suppress_context__
    assert "\n" not in str(error)
    assert "pydantic" not in str(error)
    return str(error)


def matrix(xx: float, xy: float, yy: float) -> dict[str, float]:
    return {"xx": xx, "xy": xy, "yy": yy}


# The paper


def test_the_si_numbers_of_eq_47_become_the_nondimensional_numbers_of_eq_48() -> None:
    damping, stiffness, rate, damping_deviation, stiffness_deviation = PAPER.plant.nondimensional()
    np.testing.assert_allclose(damping, [0.01, 0.002, 0.01], rtol=1e-12)
    assert [f"{value:.4g}" for value in stiffness] == ["355.3", "70.99", "532.9"]
    assert rate == 0.1
    assert not damping_deviation.any()
    assert not stiffness_deviation.any()


def test_the_scales_turn_one_millisecond_one_micrometre_and_0_18_micronewton_into_one() -> None:
    scales = PAPER.plant.scales
    assert scales.time == 1e-3
    assert scales.length == 1e-6
    assert scales.rate == 1000.0
    assert scales.velocity == pytest.approx(1e-3, rel=1e-15)
    assert scales.force == pytest.approx(1.8e-7, rel=1e-15)
    assert scales.damping == pytest.approx(1.8e-4, rel=1e-15)
    assert scales.stiffness == pytest.approx(0.18, rel=1e-15)


def test_the_nondimensional_plant_is_scaled_by_all_three_references() -> None:
    plant = PAPER.replace({"plant.mass": 2.0, "plant.reference_frequency": 10.0, "plant.angular_rate": 5.0}).plant
    damping, stiffness, rate, *_ = plant.nondimensional()
    assert damping[0] == pytest.approx(1.8e-6 / 20, rel=1e-14)
    assert stiffness[2] == pytest.approx(95.92 / 200, rel=1e-14)
    assert rate == 0.5


def test_the_deviations_are_scaled_like_what_they_deviate_from() -> None:
    changes = {
        "plant.damping_deviation": matrix(1.8e-7, 0.0, -1.8e-7),
        "plant.stiffness_deviation": matrix(0.18, 0.36, -0.18),
    }
    _, _, _, damping, stiffness = PAPER.replace(changes).plant.nondimensional()
    np.testing.assert_allclose(damping, [1e-3, 0, -1e-3], rtol=1e-12)
    np.testing.assert_allclose(stiffness, [1, 2, -1], rtol=1e-12)


def test_centrifugal_forces_soften_the_springs_and_couple_the_axes_as_in_eq_1() -> None:
    changes = {
        "plant.mass": 1.0,
        "plant.stiffness": matrix(100.0, 7.0, 100.0),
        "plant.angular_rate": 3.0,
        "plant.transverse_rate": [1.0, 2.0],
    }
    off = PAPER.replace(changes).plant
    on = PAPER.replace({**changes, "plant.centrifugal": True}).plant
    assert off.effective_stiffness() == off.stiffness
    assert on.effective_stiffness() == Symmetric(xx=100 - 13.0, xy=7 + 2.0, yy=100 - 10.0)
    np.testing.assert_allclose(on.nondimensional()[1] * on.scales.stiffness, [87, 9, 90], rtol=1e-14)


def test_the_paper_is_eqs_49_to_53() -> None:
    reference, controller, adaptation = PAPER.reference, PAPER.controller, PAPER.adaptation
    assert PAPER.run.initial_position == (0.5, 0.5)
    assert PAPER.run.initial_velocity == (0, 0)
    assert reference.amplitude == (1, 1)
    assert reference.frequency == (math.pi, math.pi / 2)
    assert reference.phase == (0, math.pi / 2)
    assert (controller.order, controller.terminal_exponent, controller.layer_thickness) == (0.9, 0.5, 0.06)
    assert controller.fractional_gain == (10, 10)
    assert controller.terminal_gain == (0.5, 0.5)
    assert adaptation.damping_gain == adaptation.stiffness_gain == adaptation.rate_gain == 150
    assert adaptation.bound_gain == (1, 1.6, 1.6)
    assert adaptation.initial_bound == (0.1, 0.2, 0.3)
    assert adaptation.initial_ratio == 0.95
    assert (PAPER.disturbance.kind, PAPER.disturbance.standard_deviation) == ("noise", 1)
    assert (PAPER.disturbance.hold, PAPER.disturbance.seed) == (1e-3, 0)
    assert (PAPER.run.duration, PAPER.run.step, PAPER.run.steps) == (80, 1e-3, 80_000)


def test_what_the_paper_lacks_is_off() -> None:
    assert (PAPER.adaptation.leakage, PAPER.adaptation.dead_zone, PAPER.adaptation.projection) == (0, 0, 0)
    assert PAPER.controller.force_limit == math.inf
    assert not PAPER.plant.centrifugal
    assert PAPER.plant.transverse_rate == (0, 0)


def test_the_printed_and_the_corrected_paper_differ_in_the_errata_and_in_nothing_else() -> None:
    printed = Scenario.paper("printed")
    assert {path: value.printed for path, value in ERRATA_SWITCHES.items()} == {
        "controller.layer": "quadratic",
        "controller.derivative": "caputo",
        "controller.rate_law": "printed",
    }
    for path, erratum in ERRATA_SWITCHES.items():
        table, field = path.split(".")
        assert getattr(getattr(printed, table), field) == erratum.printed
        assert getattr(getattr(PAPER, table), field) == erratum.corrected
    assert printed.replace({path: value.corrected for path, value in ERRATA_SWITCHES.items()}) == PAPER


def test_a_third_reading_of_the_paper_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r'^variant is "improved": it must be corrected or printed$'):
        Scenario.paper("improved")  # type: ignore[arg-type]


# Defaults and types


def test_an_empty_file_is_the_corrected_paper_with_the_noise_held_for_one_step_and_a_looser_kernel() -> None:
    looser = {"disturbance.hold": None, "run.kernel_tolerance": 3e-5}
    assert Scenario.from_toml("") == Scenario() == PAPER.replace(looser)


def test_missing_fields_take_the_papers_values() -> None:
    changed = Scenario.from_toml("[controller]\norder = 0.8\n[disturbance]\nseed = 3\n[run]\nstep = 2e-3")
    assert changed == Scenario().replace({"controller.order": 0.8, "disturbance.seed": 3, "run.step": 2e-3})


def test_density_may_replace_the_standard_deviation() -> None:
    disturbance = Scenario.from_toml("[disturbance]\ndensity = 1e-3").disturbance
    assert (disturbance.kind, disturbance.density, disturbance.standard_deviation) == ("noise", 1e-3, None)


def test_none_unsets_a_field_in_replace() -> None:
    changed = PAPER.replace({"disturbance.density": 1e-3, "disturbance.standard_deviation": None})
    assert changed.disturbance.standard_deviation is None


def test_one_number_stands_for_the_gains_of_both_axes() -> None:
    assert Scenario.from_toml("[controller]\nfractional_gain = 7").controller.fractional_gain == (7.0, 7.0)
    assert PAPER.replace({"controller.terminal_gain": 0.2}).controller.terminal_gain == (0.2, 0.2)


def test_an_integer_is_a_number_and_leaves_the_same_text() -> None:
    assert Scenario.from_toml("[run]\nduration = 5").to_toml() == Scenario.from_toml("[run]\nduration = 5.0").to_toml()


def test_minus_zero_is_zero_in_value_text_and_hash() -> None:
    minus = PAPER.replace({"plant.angular_rate": -0.0, "reference.phase": [-0.0, 0.0]})
    plus = PAPER.replace({"plant.angular_rate": 0.0, "reference.phase": [0.0, 0.0]})
    assert minus == plus
    assert minus.content_hash() == plus.content_hash()


def test_numpy_values_are_taken_as_the_numbers_they_are() -> None:
    changed = PAPER.replace({"disturbance.seed": np.int64(4), "controller.fractional_gain": np.array([1.0, 2.0])})
    assert changed.disturbance.seed == 4
    assert changed.controller.fractional_gain == (1.0, 2.0)


def test_infinite_force_means_no_limit_and_travels_through_toml() -> None:
    assert "\nforce_limit = inf\n" in PAPER.to_toml()
    assert Scenario.from_toml("[controller]\nforce_limit = inf").controller.force_limit == math.inf


@pytest.mark.parametrize(
    "changes",
    [
        {"controller.order": 0.0},
        {"controller.order": 1.0},
        {"controller.layer_thickness": 0.0},
        {"plant.damping": matrix(0.0, 0.0, 0.0)},
        {"plant.damping": matrix(0.1, 0.3, 0.9)},  # singular up to rounding: semidefinite
        {"disturbance.seed": 2**63 - 1},
        {"disturbance.standard_deviation": 0.0},
        {"disturbance.hold": 7e-3},
        {"disturbance.hold": 1e-3 * (1 + 5e-10)},
        {"disturbance.kind": "none", "disturbance.hold": 1.5e-3},  # nothing is held
        {"disturbance.kind": "sine", "disturbance.standard_deviation": None, "disturbance.amplitude": (0.0, 0.0)},
        {"run.duration": 1e-3},
        {"run.duration": 1000.0},
        {"controller.kind": "linear", "run.duration": 1e5},
    ],
)
def test_the_edge_of_what_is_allowed_is_allowed(changes: dict[str, Any]) -> None:
    PAPER.replace(changes)


# Bad input: one sentence with the field, the value and the allowed values

BAD = [
    ({"controller.order": 1.2}, "controller.order is 1.2: it must lie between 0 and 1"),
    ({"controller.order": -0.1}, "controller.order is -0.1: it must lie between 0 and 1"),
    ({"controller.order": math.nan}, "controller.order is nan: it must be a finite number"),
    ({"controller.order": math.inf}, "controller.order is inf: it must be a finite number"),
    ({"controller.order": "0.9"}, 'controller.order is "0.9": it must be a number'),
    ({"controller.order": True}, "controller.order is true: it must be a number"),
    ({"controller.order": [0.9]}, "controller.order is [0.9]: it must be a number"),
    ({"controller.order": 10**400}, "it must be a number"),
    ({"controller.oder": 0.9}, "controller.oder is not a known field; did you mean controller.order?"),
    ({"run.order": 0.9}, "run.order is not a known field; did you mean controller.order?"),
    ({"order": 0.9}, "order is not a known field; did you mean controller.order?"),
    ({"contoller.order": 0.9}, "contoller.order is not a known field; did you mean controller.order?"),
    ({"runn": {}}, "runn is not a known field; did you mean run?"),
    ({"plant.damping.zz": 1.0}, "plant.damping.zz is not a known field"),
    ({"controller.order.x": 1.0}, "controller.order.x is not a known field"),
    ({"run.qqqqq": 1}, "run.qqqqq is not a known field; known are run.duration, run.step, "),
    ({"": 1}, " is not a known field; known are plant, reference, "),
    ({"controller.terminal_exponent": 0.0}, "exponent is 0.0: it must lie strictly between 0 and 1"),
    ({"controller.terminal_exponent": 1}, "exponent is 1: it must lie strictly between 0 and 1"),
    ({"controller.fractional_gain": 0.0}, "controller.fractional_gain[0] is 0.0: it must be greater than 0"),
    ({"controller.fractional_gain": [1.0, -2.0]}, "fractional_gain[1] is -2.0: it must be greater than 0"),
    ({"controller.fractional_gain": True}, "it must be a list of 2 numbers [x, y] or one number for all"),
    ({"controller.terminal_gain": [0.5, math.nan]}, "controller.terminal_gain[1] is nan: it must be"),
    (
        {"controller.terminal_gain": 0},
        "controller.terminal_gain[0] is 0: it must be greater than 0 (and 1 more)",
    ),
    (
        {"controller.kind": "bang_bang"},
        'controller.kind is "bang_bang": it must be fractional_fast_terminal, fractional',
    ),
    ({"controller.layer": None}, "controller.layer is not set: it must be linear or quadratic"),
    ({"controller.layer_thickness": -0.06}, "layer_thickness is -0.06: it must be at least 0"),
    ({"controller.singularity_floor": 0.0}, "singularity_floor is 0.0: it must be greater than 0"),
    ({"controller.force_limit": math.nan}, "controller.force_limit is nan: it must be greater than 0"),
    ({"controller.force_limit": 0.0}, "controller.force_limit is 0.0: it must be greater than 0"),
    ({"controller.adaptive": 1}, "controller.adaptive is 1: it must be true or false"),
    ({"adaptation.kind": "kalman"}, 'adaptation.kind is "kalman": it must be gradient, composite or joint'),
    ({"adaptation.damping_gain": 0.0}, "adaptation.damping_gain is 0.0: it must be greater than 0"),
    ({"adaptation.stiffness_gain": -1}, "adaptation.stiffness_gain is -1: it must be greater than 0"),
    ({"adaptation.rate_gain": "150"}, 'adaptation.rate_gain is "150": it must be a number'),
    (
        {"adaptation.bound_gain": [1.0, 0.0, 1.6]},
        "adaptation.bound_gain[1] is 0.0: it must be greater than 0",
    ),
    ({"adaptation.bound_gain": [1.0, 1.6]}, "is [1.0, 1.6]: it must be a list of 3 numbers [x0, x1, x2]"),
    ({"adaptation.bound_gain": 1.0}, "adaptation.bound_gain is 1.0: it must be a list of 3 numbers"),
    ({"adaptation.initial_bound": [0.1, 0.2, -0.3]}, "initial_bound[2] is -0.3: it must be at least 0"),
    ({"adaptation.initial_ratio": 0.0}, "adaptation.initial_ratio is 0.0: it must be greater than 0"),
    (
        {"adaptation.initial_ratio": 1e308},
        "initial_ratio is 1e+308: times D, K and Omega_z, of which the largest is 532.889, it must be finite",
    ),
    ({"adaptation.leakage": -1e-9}, "adaptation.leakage is -1e-09: it must be at least 0"),
    ({"adaptation.dead_zone": -1.0}, "adaptation.dead_zone is -1.0: it must be at least 0"),
    ({"adaptation.projection": -1.0}, "adaptation.projection is -1.0: it must be at least 0"),
    ({"plant": 3}, "plant is 3: it must be a table"),
    ({"plant.mass": 0.0}, "plant.mass is 0.0: it must be greater than 0"),
    ({"plant.mass": -1.8e-7}, "plant.mass is -1.8e-07: it must be greater than 0"),
    ({"plant.mass": 5e-324, "plant.reference_frequency": 0.1}, "it must give finite nondimensional numbers"),
    ({"plant.mass": 1e300, "plant.reference_frequency": 1e300}, "it must give finite nondimensional"),
    ({"plant.reference_length": 0.0}, "plant.reference_length is 0.0: it must be greater than 0"),
    ({"plant.reference_frequency": -1.0}, "plant.reference_frequency is -1.0: it must be greater than 0"),
    ({"plant.centrifugal": "yes"}, 'plant.centrifugal is "yes": it must be true or false'),
    ({"plant.damping": 1.0}, "plant.damping is 1.0: it must be a table"),
    ({"plant.damping": {"xx": 1.0, "yy": 1.0}}, "plant.damping.xy is missing: it must be a number"),
    ({"plant.damping": [1.0], "plant.damping.xx": 1.0}, "plant.damping is [1.0]: it must be a table"),
    ({"plant.damping.xy": 1.0}, "it must be positive semidefinite, but its smallest eigenvalue is -0.999998"),
    (
        {"plant.stiffness": matrix(1.0, 2.0, 1.0)},
        "plant.stiffness is {xx = 1.0, xy = 2.0, yy = 1.0}: it must be positive definite, "
        "but its smallest eigenvalue is -1 N/m",
    ),
    ({"plant.stiffness": matrix(1.0, 1.0, 1.0)}, "positive definite, but its smallest eigenvalue is 0"),
    (
        {"plant.stiffness_deviation": matrix(-100.0, 0.0, 0.0)},
        "plant.stiffness plus plant.stiffness_deviation is",
    ),
    ({"plant.stiffness": matrix(1e308, 1e308, 1e308)}, "plant.stiffness is"),
    ({"plant.centrifugal": True, "plant.angular_rate": 1e5}, "less its centrifugal part is {xx = -1736.045"),
    ({"plant.centrifugal": True, "plant.angular_rate": 1e200}, "less its centrifugal part is"),
    (
        {"run.initial_position": [0.5]},
        "run.initial_position is [0.5]: it must be a list of 2 numbers [x, y]",
    ),
    ({"run.initial_velocity": 0.0}, "run.initial_velocity is 0.0: it must be a list of 2 numbers [x, y]"),
    ({"reference.frequency": [math.inf, 1.0]}, "reference.frequency[0] is inf: it must be a finite number"),
    ({"reference.phase": ["0", 1.0]}, 'reference.phase[0] is "0": it must be a number'),
    ({"disturbance.kind": "pink"}, 'disturbance.kind is "pink": it must be none, noise, sine, step, pulse, vibration'),
    (
        {"disturbance.density": 1e-3},
        "disturbance.standard_deviation is 1.0 and disturbance.density is 0.001: "
        "noise must have exactly one of the two",
    ),
    (
        {"disturbance.standard_deviation": None},
        "disturbance.standard_deviation is missing and disturbance.density is missing: "
        "noise must have exactly one of the two",
    ),
    ({"disturbance.standard_deviation": -1.0}, "standard_deviation is -1.0: it must be at least 0"),
    ({"disturbance.hold": 0.0}, "disturbance.hold is 0.0: it must be greater than 0"),
    (
        {"disturbance.hold": 1.5e-3},
        "disturbance.hold is 0.0015: it must be a whole number of run.step, which is 0.001",
    ),
    ({"disturbance.hold": 1e-3 * (1 + 2e-9)}, "it must be a whole number of run.step"),
    ({"disturbance.hold": 1e-13}, "disturbance.hold is 1e-13: it must be a whole number of run.step"),
    ({"run.step": 2e-3}, "disturbance.hold is 0.001: it must be a whole number of run.step, which is 0.002"),
    ({"disturbance.seed": -1}, "disturbance.seed is -1: it must lie between 0 and 9223372036854775807"),
    (
        {"disturbance.seed": 2**63},
        "seed is 9223372036854775808: it must lie between 0 and 9223372036854775807",
    ),
    ({"disturbance.seed": 1.0}, "disturbance.seed is 1.0: it must be an integer"),
    ({"run.step": 0.0}, "run.step is 0.0: it must be greater than 0"),
    ({"run.step": -1e-3}, "run.step is -0.001: it must be greater than 0"),
    ({"run.duration": 0}, "run.duration is 0: it must be greater than 0"),
    ({"run.duration": 5e-4}, "run.duration is 0.0005: it must be at least run.step, which is 0.001"),
    ({"run.step": 5e-324}, "run.duration is 80.0: it must be at most 1000000000 steps of 5e-324"),
    ({"run.duration": 1.001e6}, "run.duration is 1001000.0: it must be at most 1000000000 steps of 0.001"),
    ({"run.record_every": 0}, "run.record_every is 0: it must lie between 1 and 1000000000"),
    ({"run.record_every": 2**63 - 1}, "run.record_every is 9223372036854775807: it must lie between 1 and 1000000000"),
    ({"run.record_every": 1e34}, "run.record_every is 1e+34: it must be an integer"),
    ({"run.record_every": 10**34}, "it must lie between 1 and 1000000000"),
    ({"disturbance.hold": 1e34}, "disturbance.hold is 1e+34: it must be at most 1000000000 steps of 0.001"),
    ({"disturbance.hold": 1e308}, "disturbance.hold is 1e+308: it must be at most 1000000000 steps of 0.001"),
    (
        {"rate.kind": "staircase", "rate.amplitude": 1.0, "rate.hold": 1e300},
        "rate.hold is 1e+300: it must be at most 1000000000 steps of 1e-06",
    ),
    (
        {"rate.kind": "step", "rate.amplitude": 1.0, "rate.start": 1e16},
        "rate.start is 1e+16: it must be at most 1000000000 steps of 1e-06",
    ),
    ({"rate.levels": 2**63}, "rate.levels is 9223372036854775808: it must lie between 1 and 1000000000"),
    (
        {"reference.frequency": (1.0, 1e300)},
        "reference.frequency[1] is 1e+300: it must be at most 1e+06",
    ),
    ({"disturbance.frequency": (-2e6, 0.0)}, "disturbance.frequency[0] is -2000000.0: it must be at least -1e+06"),
    ({"run.duration": 10**400}, "run.duration is an integer of 1329 bits: it must be a number"),
    ({"run.record_every": 1.5}, "run.record_every is 1.5: it must be an integer"),
    ({"run.kernel_tolerance": 0.2}, "run.kernel_tolerance is 0.2: it must lie between 1e-09 and 0.1"),
    ({"run.units": "si"}, 'run.units is "si": it must be nondimensional or SI'),
    ({"run.duration": "eighty\nunits"}, 'run.duration is "eighty\\nunits": it must be a number'),
    (
        {"run.step": -1.0, "controller.order": 2, "plant.mass": 0},
        "plant.mass is 0: it must be greater than 0 (and 2 more)",
    ),
]


@pytest.mark.parametrize(("changes", "sentence"), BAD, ids=[str(changes)[:60] for changes, _ in BAD])
def test_bad_input_is_answered_with_one_sentence(changes: dict[str, Any], sentence: str) -> None:
    assert sentence in refusal(changes)


def test_what_is_not_used_is_not_converted() -> None:
    """A constant rate has no start; the device is not ideal, so that the core receives the rate at all."""
    late = PAPER.replace({"rate.start": 1e300, "device.delay": 1, "run.duration": 0.01})
    assert len(simulate(late)["time"]) == 11


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[controller]\noder = 0.9", "controller.oder is not a known field; did you mean controller.order?"),
        ("[contoller]\norder = 0.9", "contoller is not a known field; did you mean controller?"),
        ("order = 0.9", "order is not a known field; did you mean controller.order?"),
        ("run = 3", "run is 3: it must be a table"),
        (
            "plant.damping = {xx = 1, xy = 0, yy = 1, zz = 2}",
            "plant.damping.zz is not a known field; known are plant.damping.xx, ",
        ),
        ('"a\\nb" = 1', "'a\\nb' is not a known field"),
        ("[run]\nduration = 1979-05-27", "run.duration is 1979-05-27: it must be a number"),
        ("[run]\nduration = nan", "run.duration is nan: it must be a finite number"),
        ("[controller]\nforce_limit = -inf", "controller.force_limit is -inf: it must be greater than 0"),
        ('[disturbance]\nkind = "noise"', "noise must have exactly one of the two"),
        ("[disturbance]\nstandard_deviation = 1\ndensity = 1", "noise must have exactly one of the two"),
        ("[controller]\norder = ", "the text is not valid TOML: Invalid value (at end of document)"),
        (
            "[controller]\norder 0.9",
            "the text is not valid TOML: Expected '=' after a key in a key/value pair",
        ),
        ("[run]\nstep = 1\nstep = 2", "the text is not valid TOML: Cannot overwrite a value"),
        ("x = " + "[" * 5000, "the text is not valid TOML: it is nested too deeply"),
        ("x = " + "1" * 5000, "the text is not valid TOML: "),
        (f'[run]\nunits = "{"x" * 500}"', "...: it must be nondimensional or SI"),
    ],
)
def test_bad_toml_is_answered_with_one_sentence(text: str, sentence: str) -> None:
    assert sentence in toml_refusal(text)


@pytest.mark.parametrize("path", sorted(paths(Scenario)))
def test_no_field_takes_a_string_a_date_or_nan(path: str) -> None:
    for value in ("1.0", math.nan, tomllib.loads("x = 1979-05-27")["x"]):
        assert refusal({path: value}).startswith(path.removesuffix(".each"))


def test_a_scenario_built_in_python_is_refused_with_the_same_sentence() -> None:
    with pytest.raises(ScenarioError, match=re.escape("controller.order is 1.2: it must lie between 0 and 1")):
        Scenario(controller={"order": 1.2})


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ('{"run": {"step": "x"}}', 'run.step is "x": it must be a number, or a time such as "2 us" or "20 ms"'),
        ('{"runn": {}}', "runn is not a known field; did you mean run?"),
        ("3", "scenario is 3: it must be a table"),
    ],
)
def test_the_functions_of_pydantic_refuse_in_the_same_words(given: str, sentence: str) -> None:
    for read in (lambda: Scenario.model_validate(json.loads(given)), lambda: Scenario.model_validate_json(given)):
        with pytest.raises(ScenarioError) as refused:
            read()
        assert str(refused.value) == sentence
    with pytest.raises(ScenarioError, match=r'^scenario is "{": it must be JSON, but EOF'):
        Scenario.model_validate_json("{")
    same = Scenario.paper()
    assert Scenario.model_validate(same) is same
    assert Scenario.model_validate({"run": {"step": "2 us"}}).run.step == 2e-3


def test_an_uncaught_error_prints_one_traceback_only() -> None:
    code = "from fracgyro.scenario import Scenario; Scenario.from_toml('[run]\\nstep = -1')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1
    assert done.stderr.endswith("ScenarioError: run.step is -1: it must be greater than 0\n")


def test_a_scenario_cannot_be_changed_in_place() -> None:
    with pytest.raises(AttributeError, match="frozen"):
        PAPER.run.step = 1.0
    with pytest.raises(AttributeError, match="frozen"):
        PAPER.run = Scenario().run


def test_replace_leaves_the_original_alone_and_takes_whole_tables() -> None:
    changed = PAPER.replace(
        {"plant.stiffness.xx": 70.0, "run": {"duration": 5.0}, "plant.damping": PAPER.plant.damping}
    )
    assert changed.plant.stiffness.xx == 70.0
    assert changed.run.duration == 5.0
    assert PAPER.plant.stiffness.xx == 63.955
    assert Scenario.paper() == PAPER


def test_replacing_nothing_changes_nothing() -> None:
    assert PAPER.replace({}) == PAPER


# Text and files


@pytest.mark.parametrize("variant", ["corrected", "printed"])
def test_the_paper_survives_toml(variant: Any) -> None:
    scenario = Scenario.paper(variant)
    assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_the_text_is_complete_commented_and_fits_the_line() -> None:
    lines = PAPER.to_toml().splitlines()
    tables = tomllib.loads(PAPER.to_toml())
    assert [*tables, "electrodes"] == sorted(
        Scenario.model_fields, key=lambda name: name == "electrodes"
    )  # the empty list
    assert max(map(len, lines)) <= 110
    for name, info in Scenario.model_fields.items():
        table = info.annotation
        assert table is not None
        for field, field_info in table.model_fields.items():
            assert field_info.description, f"{name}.{field} has no description"
            if PAPER.controller.kind not in (kinds_with(f"{name}.{field}") or KINDS):
                assert field not in tables[name], "of other controllers"
                continue
            own = set(getattr(PAPER, name).kinds) if name in OWN_KINDS else set()
            if own and not own & set(having(name, field) or own):
                assert field not in tables[name], "of other kinds"
                continue
            if (name, field) not in {("disturbance", "added"), ("electrodes", "each")}:  # tables of their own
                assert field in tables[name] or f"# {field} is not set" in lines
    for previous, line in pairwise(lines):
        if "=" in line and not line.startswith("#"):
            assert previous.startswith("# "), f"{line} has no comment"


def test_numbers_are_written_in_the_fewest_digits_that_read_back() -> None:
    text = PAPER.to_toml()
    assert "\nmass = 1.8e-07\n" in text
    assert "\norder = 0.9\n" in text
    assert "\nhold = 0.001\n" in text
    assert "\nstiffness = {xx = 63.955, xy = 12.779, yy = 95.92}\n" in text


def test_equal_scenarios_hash_equally_and_different_ones_differently() -> None:
    assert re.fullmatch("[0-9a-f]{64}", PAPER.content_hash())
    assert PAPER.content_hash() == Scenario.from_toml(PAPER.to_toml()).content_hash()
    hashes = {PAPER.content_hash(), Scenario.paper("printed").content_hash()}
    hashes |= {PAPER.replace({"disturbance.seed": seed}).content_hash() for seed in range(1, 9)}
    assert len(hashes) == 10


def test_save_then_load_is_the_same_scenario_and_leaves_no_other_file(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    for scenario in (PAPER, Scenario.paper("printed")):
        scenario.save(path)
        assert Scenario.load(str(path)) == scenario
        assert path.read_text(encoding="utf-8") == scenario.to_toml()
    assert list(tmp_path.iterdir()) == [path]


def test_a_reader_of_the_old_file_never_sees_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    PAPER.save(path)
    with open(path, encoding="utf-8") as reader:
        Scenario.paper("printed").save(path)
        assert reader.read() == PAPER.to_toml()


def test_save_writes_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "link.toml").symlink_to(tmp_path / "real.toml")
    PAPER.save(tmp_path / "link.toml")
    assert (tmp_path / "link.toml").is_symlink()
    assert Scenario.load(tmp_path / "real.toml") == PAPER


def test_a_save_that_fails_keeps_the_old_file_and_leaves_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "my.toml"
    PAPER.save(path)

    def full(source: object, target: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(ScenarioError, match=r"my\.toml cannot be written: No space left on device$"):
        Scenario.paper("printed").save(path)
    assert Scenario.load(path) == PAPER
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["missing/my.toml", "."])
def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(ScenarioError, match=r"cannot be written: (No such file|it is not a regular file)") as caught:
        PAPER.save(tmp_path / name)
    only_sentence(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "my.toml cannot be read: No such file or directory"),
        (b"[plant]\nmass = 1e-", "my.toml is not valid TOML: "),
        (
            b"[plant]\nmass 1",
            "my.toml is not valid TOML: Expected '=' after a key in a key/value pair (at line 2, column 6)",
        ),
        (b"\xff\xfe[run]", "my.toml is not valid TOML: byte 0 is not UTF-8"),
        (b"[run]\nstep = 0", "run.step is 0: it must be greater than 0"),
    ],
)
def test_a_file_that_is_missing_half_written_or_not_text_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes | None, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path("my.toml").write_bytes(content)
    with pytest.raises(ScenarioError) as caught:
        Scenario.load("my.toml")
    assert only_sentence(caught.value).startswith(sentence)


def test_every_half_written_file_is_either_refused_or_still_valid(tmp_path: Path) -> None:
    path, text = tmp_path / "my.toml", PAPER.to_toml()
    refused = 0
    for end in range(0, len(text), 97):
        path.write_text(text[:end], encoding="utf-8")
        try:
            Scenario.load(path)
        except ScenarioError as error:
            refused += 1
            only_sentence(error)
    assert refused > 5


def test_an_unreadable_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"cannot be read: Is a directory$"):
        Scenario.load(tmp_path)
    with pytest.raises(ScenarioError, match=r"cannot be read: .*null"):
        Scenario.load("my\0.toml")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission_is_named(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    PAPER.save(path)
    path.chmod(0)
    with pytest.raises(ScenarioError, match=r"cannot be read: Permission denied$"):
        Scenario.load(path)


def test_the_byte_order_mark_of_some_editors_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text(PAPER.to_toml(), encoding="utf-8-sig")
    assert Scenario.load(tmp_path / "my.toml") == PAPER


# Any valid scenario

number = st.floats(-1e6, 1e6)
positive = st.floats(1e-9, 1e6)
not_negative = st.just(0.0) | positive


def pairs(entry: st.SearchStrategy[float]) -> st.SearchStrategy[list[float]]:
    return st.lists(entry, min_size=2, max_size=2)


def triples(entry: st.SearchStrategy[float]) -> st.SearchStrategy[list[float]]:
    return st.lists(entry, min_size=3, max_size=3)


@st.composite
def definite(draw: st.DrawFn) -> dict[str, float]:
    xx, yy = draw(st.floats(1e-6, 1e6)), draw(st.floats(1e-6, 1e6))
    smallest = min(xx, yy)
    return matrix(xx, draw(st.floats(-0.9, 0.9)) * smallest, yy)


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    step, steps = draw(st.floats(1e-6, 1.0)), draw(st.integers(1, 10**6))
    strength = draw(st.sampled_from(["standard_deviation", "density"]))
    hold = draw(st.none() | st.integers(1, 1000).map(lambda count: count * step))
    layer_thickness = draw(not_negative)
    tables: dict[str, dict[str, Any]] = {
        "plant": {
            "mass": draw(positive),
            "damping": draw(definite()),
            "stiffness": draw(definite()),
            "damping_deviation": draw(definite()),
            "stiffness_deviation": draw(definite()),
            "angular_rate": draw(number),
            "transverse_rate": draw(pairs(number)),
            "reference_length": draw(positive),
            "reference_frequency": draw(positive),
        },
        "reference": {name: draw(pairs(number)) for name in ("amplitude", "frequency", "phase")},
        "controller": {
            "kind": draw(st.sampled_from(["fractional_fast_terminal", "fractional", "fast_terminal", "linear"])),
            "order": draw(st.floats(0, 1)),
            "fractional_gain": draw(pairs(positive) | positive),
            "terminal_gain": draw(pairs(positive) | positive),
            "terminal_exponent": draw(st.floats(0, 1, exclude_min=True, exclude_max=True)),
            "layer_thickness": layer_thickness,
            "layer": draw(st.sampled_from(["quadratic", "linear"])),
            "derivative": draw(st.sampled_from(["caputo", "riemann_liouville"])),
            "rate_law": draw(st.sampled_from(["skew", "printed"])),
            "singularity_floor": draw(positive),
            "adaptive": draw(st.booleans()),
            "force_limit": draw(positive | st.just(math.inf)),
            "switching_limit": draw(positive | st.just(math.inf)) if layer_thickness > 0 else math.inf,
        },
        "adaptation": {
            **{name: draw(positive) for name in ("damping_gain", "stiffness_gain", "rate_gain", "initial_ratio")},
            **{name: draw(not_negative) for name in ("leakage", "dead_zone", "projection")},
            "bound_gain": draw(triples(positive)),
            "initial_bound": draw(triples(not_negative)),
        },
        "disturbance": {
            "kind": draw(st.sampled_from(["none", "noise", "sine"])),
            strength: draw(not_negative),
            "hold": hold,
            "seed": draw(st.integers(0, 2**63 - 1)),
            **{name: draw(pairs(number)) for name in ("amplitude", "frequency", "phase")},
        },
        "run": {
            "duration": steps * step,
            "step": step,
            "initial_position": draw(pairs(number)),
            "initial_velocity": draw(pairs(number)),
            "record_every": draw(st.integers(1, 10**6)),
            "kernel_tolerance": draw(st.floats(1e-9, 1e-1)),
            "units": draw(st.sampled_from(["nondimensional", "SI"])),
        },
    }
    for name in draw(st.sets(st.sampled_from(["reference", "controller", "adaptation"]))):
        del tables[name]
    return Scenario(**tables)


@settings(max_examples=60)
@given(scenarios())
def test_any_valid_scenario_survives_toml_unchanged(scenario: Scenario) -> None:
    text = scenario.to_toml()
    again = Scenario.from_toml(text)
    assert again == scenario
    assert again.to_toml() == text
    assert again.replace({}) == scenario
    assert again.content_hash() == scenario.content_hash()
    tomllib.loads(text)


@settings(max_examples=60)
@given(scenarios())
def test_the_scales_take_any_nondimensional_plant_back_to_si(scenario: Scenario) -> None:
    plant, scales = scenario.plant, scenario.plant.scales
    damping, stiffness, rate, *_ = plant.nondimensional()
    np.testing.assert_allclose(damping * scales.damping, plant.damping.entries(), rtol=1e-14, atol=1e-290)
    np.testing.assert_allclose(stiffness * scales.stiffness, plant.stiffness.entries(), rtol=1e-14, atol=1e-290)
    assert rate * scales.rate == pytest.approx(plant.angular_rate, rel=1e-14, abs=1e-290)
    assert scales.time * scales.rate == pytest.approx(1.0)
    assert scales.velocity * scales.time == pytest.approx(scales.length)


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_the_smallest_eigenvalue_is_numpys(xx: float, xy: float, yy: float) -> None:
    expected = np.linalg.eigvalsh([[xx, xy], [xy, yy]])[0]
    assert Symmetric(xx=xx, xy=xy, yy=yy).smallest_eigenvalue() == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(st.text(max_size=20) | st.text(alphabet="\x00\x1f\x7f\x80\\\"'\n\u2028", max_size=6))
def test_any_text_is_written_so_that_it_reads_back(text: str) -> None:
    assert tomllib.loads(f"value = {toml_value(text)}") == {"value": text}


@given(st.text(max_size=60) | st.text(alphabet='[]{}="\n.#01ab_- run step', max_size=60))
def test_any_text_is_a_scenario_or_one_sentence(text: str) -> None:
    try:
        Scenario.from_toml(text)
    except ScenarioError as error:
        only_sentence(error)
