"""Short ways to scenarios and their set-ups, against the long ways: equal for every field, bit for bit."""

from __future__ import annotations

import tomllib
from itertools import product
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.scenario import checks, patched
from fracgyro.scenario.kinds import KINDS, numbers
from fracgyro.scenario.messages import leaves
from fracgyro.scenario.patched import AT_ONCE, Patch, are_valid, patched_fields
from fracgyro.scenario.scenario import Scenario
from fracgyro.scenario.schema import Adaptation, Controller
from fracgyro.scenario.shipped import NAMES
from fracgyro.scenario.to_core import core_setup, parts
from fracgyro.scenario.toml import _plain_tables
from fracgyro.study.space import Dimension
from fracgyro.study.sweep.point_columns import Points
from fracgyro.study.sweep.setups import Setups, fields_to_patch, scenario_of
from hypothesis import given
from hypothesis import strategies as st
from test_lanes import DERIVED, DIFFERENCES, SHORT, SILENT, WITHOUT_EFFECT, derived, first_of

EVERY = {
    **DIFFERENCES,
    **{path: (SILENT if path.startswith("electronics.") else {}, value) for path, value in WITHOUT_EFFECT.items()},
    **{path: derived(path) for path in DERIVED},
}
RATE_AND_DEVICE = {
    "rate.amplitude": ({"rate.kind": "step", "rate.amplitude": 2.0}, 3.0),
    "rate.points": ({"rate.kind": "table", "rate.points": [[0.0, 1.0]]}, [[0.0, 2.0], [1e-4, 3.0]]),
    "device.sensing": ({}, "position"),
    "device.delay": ({}, 1),
    "device.position_noise": ({}, 1e-9),
}
EVERY |= RATE_AND_DEVICE  # the rule for the others is tested below


@pytest.mark.parametrize("field", EVERY)
def test_a_patched_set_up_is_the_long_way_s_for_every_field(field: str) -> None:
    first, value = EVERY[field]
    base = first_of(first)
    changed = base.replace({field: value})
    own = patched_fields(base, [field])
    given = changed if not own else base
    patch, point = Patch(given, own), tuple(value for _ in own)
    expected = core_setup(changed)
    for made in (patch.setup(point), *patch.setups([point, point])):
        assert _core.setup_settings(made) == _core.setup_settings(expected)
        assert _core.setup_kernel(made) == _core.setup_kernel(expected)
        assert (made.sensing, made.seed, made.kind) == (expected.sensing, expected.seed, expected.kind)
    if own:  # all else that a set-up is made of
        rest = {"numbers": {}, "memory": (0.0,) * 4}
        assert parts(base)._replace(**rest) == parts(changed)._replace(**rest)


def test_fields_that_are_patched_are_all_but_those_that_are_listed() -> None:
    """Every field outside the two tables, and every one that is read elsewhere, takes the long way by rule."""
    for kind in KINDS:
        base = Scenario().replace({"controller.kind": kind})
        own = patched_fields(base, list(leaves(Scenario)))
        assert own == []  # together with the kind
        varied = [path for path in leaves(Scenario) if path not in patched.KINDS_OF_FIELDS]
        of_core = {number.path for number in numbers(kind)}
        expected = {path for path in varied if path.split(".")[0] in ("controller", "adaptation") and path in of_core}
        assert set(patched_fields(base, varied)) == expected - patched.READ_ELSEWHERE


BRANCHES: list[dict[str, Any]] = [
    {},
    {"controller.layer_thickness": 0.0},
    {"controller.filter": "kalman"},
    {"controller.adaptive": False},
    {"device.sensing": "position"},
    {"reference.kind": "rest"},
    {"disturbance.kind": "none"},
    {"rate.kind": "step", "rate.amplitude": 1.0},
]


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_but_the_numbers_reads_a_field_that_is_patched(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a check of the whole scenario nor another part of the set-up: else it would have to follow."""
    base = Scenario().replace({"controller.kind": kind, "guard.checked": True})
    varied = [path for path in leaves(Scenario) if path not in patched.KINDS_OF_FIELDS]
    own = set(patched_fields(base, varied))
    assert own
    seen: set[str] = set()
    for table, model in (("controller", Controller), ("adaptation", Adaptation)):

        def read(self: Any, name: str, table: str = table) -> Any:
            seen.add(f"{table}.{name}")
            return object.__getattribute__(self, name)

        monkeypatch.setattr(model, "__getattribute__", read, raising=False)
    monkeypatch.setattr(checks, "_check_fields_of_its_kind", lambda scenario: None)  # for each field by itself
    for changes in BRANCHES:
        try:
            other = base.replace(changes)
        except fg.ScenarioError:  # not of this kind
            continue
        seen.clear()
        checks.check(other)
        other.controller._check()
        parts(other)
        assert "controller.kind" in seen
        assert seen & own <= {"controller.order"}  # the order, for the exponentials


def test_texts_with_units_that_follow_from_an_exponent_take_the_long_way() -> None:
    base = fg.Scenario.paper()
    assert patched_fields(base, ["controller.order"]) == ["controller.order"]
    assert patched_fields(base.in_si(), ["controller.order"]) == []
    assert patched_fields(base.in_si(), ["adaptation.rate_gain"]) == ["adaptation.rate_gain"]


def test_a_column_is_valid_as_its_ends_are() -> None:
    base = fg.Scenario.paper()
    assert are_valid(base, {"controller.order": (0.0, 1.0), "adaptation.rate_gain": (1.0, 1e3)})
    assert not are_valid(base, {"controller.order": (0.0, 1.01)})
    assert not are_valid(base, {"adaptation.rate_gain": (-1.0, 1.0)})


def test_negative_zero_is_zero_in_a_patched_set_up() -> None:
    base = fg.Scenario.paper()
    patch = Patch(base, ["controller.fractional_gain"])
    place = [number.path for number in numbers(base.controller.kind)].index("controller.fractional_gain")
    for made in (patch.setup(((-0.0, 5.0),)), *patch.setups([((-0.0, 5.0),)])):
        assert np.copysign(1.0, _core.setup_settings(made)[place]) == 1.0


def test_many_patched_set_ups_are_those_of_each_point() -> None:
    """In any order of the fields, also those of which only the places in the core ascend."""
    base = fg.Scenario.paper()
    fields = ["adaptation.rate_gain", "controller.order", "controller.fractional_gain", "adaptation.stiffness_gain"]
    assert patched_fields(base, fields) == fields
    rng = np.random.default_rng(0)
    points = [(r, o, (x, y), s) for r, o, x, y, s in rng.uniform(0.1, 0.9, (AT_ONCE + 3, 5)).tolist()]
    patch = Patch(base, fields)
    made = list(patch.setups(points))
    assert len(made) == len(points)
    for place in (0, 1, AT_ONCE - 1, AT_ONCE, AT_ONCE + 2):
        expected = patch.setup(points[place])
        assert _core.setup_settings(made[place]) == _core.setup_settings(expected)
        assert _core.setup_kernel(made[place]) == _core.setup_kernel(expected)


def test_the_core_refuses_places_that_do_not_ascend() -> None:
    setup = core_setup(SHORT)
    for places, width in (([1, 0], 2), ([3, 3], 2), ([3], 2)):
        with pytest.raises(ValueError, match="one column for each place"):
            _core.with_settings(setup, places, np.zeros((1, width)))


# -- The points of a study


def test_the_set_ups_of_a_study_are_those_of_its_scenarios() -> None:
    base = SHORT
    fields = ["adaptation.rate_gain", "plant.angular_rate", "controller.order", "run.duration", "law.gain"]
    choices = ((50.0, 70.0), (90.0, 110.0), (0.0, 0.4, 1.0), (0.1, 0.2), (1.0,))
    dimensions = [Dimension(field, 0.0, 0.0, choices=each) for field, each in zip(fields, choices, strict=True)]
    own = fields_to_patch(base, dimensions)
    assert own == ("adaptation.rate_gain", "controller.order")
    setups = Setups(base, fields, own)
    for number, point in enumerate(product(*choices)):
        expected = core_setup(scenario_of(base, number, fields, point))
        (of_each,) = setups.each(number, Points.grid(choices)[number : number + 1])
        for made in (setups.setup(number, point), of_each):
            assert _core.setup_settings(made) == _core.setup_settings(expected)
            assert _core.setup_kernel(made) == _core.setup_kernel(expected)


def test_a_column_with_an_invalid_value_and_a_kind_that_varies_take_the_long_way() -> None:
    wrong = Dimension("adaptation.rate_gain", 0.0, 0.0, choices=(1.0, -1.0))
    kinds = Dimension("controller.kind", 0.0, 0.0, choices=("linear", "fractional"))
    right = Dimension("controller.order", 0.1, 0.9)
    assert fields_to_patch(SHORT, [right]) == ("controller.order",)
    assert fields_to_patch(SHORT, [right, wrong]) == fields_to_patch(SHORT, [right, kinds]) == ()


def test_a_point_that_cannot_run_is_named_with_all_its_values() -> None:
    setups = Setups(SHORT, ["controller.order", "run.step"], ["controller.order"])
    with pytest.raises(fg.ScenarioError, match=r"point 7 \(controller\.order = 0\.5, run\.step = 0\.0007\) cannot run"):
        setups.alike(7, (0.5, 0.7e-3))


# -- Scenario.replace keeps the tables that it does not change


@pytest.mark.parametrize("field", sorted(EVERY))
def test_a_replaced_field_makes_the_scenario_that_its_own_text_makes(field: str) -> None:
    first, value = EVERY[field]
    base = first_of(first)
    found = base.replace({field: value})
    again = Scenario.from_toml(found.to_toml())  # validates every field
    assert found == again
    assert hash(found) == hash(again)
    if field not in WITHOUT_EFFECT:
        assert found != base


def test_texts_with_units_follow_a_plant_that_changes() -> None:
    base = fg.Scenario(run={"duration": "20 ms"})
    assert base.run.duration == 20.0
    assert base.replace({"plant.reference_frequency": 2000.0}).run.duration == 40.0
    assert base.replace({"controller.order": 0.5}).run.duration == 20.0


def test_the_first_error_of_a_replacement_is_worded_as_that_of_a_file() -> None:
    base = fg.Scenario.paper()
    for changes, part in (
        ({"run.step": -1.0}, "run.step is -1.0: it must be greater than 0"),
        ({"plant.mass": "1 V"}, "plant.mass"),
        ({"run.step": 0.7e-3}, "disturbance.hold"),
        ({"plant": 3}, "plant is 3: it must be a table"),
        ({"controller.order": 2.0, "adaptation.rate_gain": -1.0}, "controller.order is 2.0"),
    ):
        with pytest.raises(fg.ScenarioError, match=part):
            base.replace(changes)


# -- TOML, a line at a time


@pytest.mark.parametrize("name", NAMES)
def test_a_saved_scenario_is_read_a_line_at_a_time_as_tomllib_reads_it(name: str) -> None:
    text = fg.Scenario.shipped(name).to_toml()
    found = _plain_tables(text)
    if "\n[[" in text:  # a list of tables is left to tomllib
        assert found is None
        assert fg.Scenario.from_toml(text) == fg.Scenario.shipped(name)
    else:
        assert repr(found) == repr(tomllib.loads(text))


MARKS = ["a", "b", "xx", " = ", "=", "[", "]", "{", "}", '"', "\\", "#", "\n", "inf", "-", "+", "_", "1", "0", ".", "e"]
MARKS += [",", " ", "nan", "true", "false", "9223372036854775808", "\t", "\r", "é", "\x7f", "\x00", "1e999", "00"]
LINES = ["a = 1\n", "b = inf\n", "c = [1.0, -inf]\n", '"text"', "[a]\n", "[b]\n", "# a\n"]
LINES += ["{xx = 1, xy = 0.5, yy = -2e3}"]
WORDS = st.sampled_from(MARKS + LINES)


@given(st.lists(WORDS, max_size=12).map("".join))
def test_lines_are_read_as_tomllib_reads_them_or_left_to_it(text: str) -> None:
    found = _plain_tables(text)
    if found is not None:
        assert repr(found) == repr(tomllib.loads(text))


def test_what_is_not_for_a_scenario_is_left_to_tomllib() -> None:
    for text in (
        "a = 9223372036854775808",
        "a = [[[1]]]",
        "a = 1\na = 2",
        "[a]\n[a]",
        "a = 1\n[a]",
        "a = 01",
        "a = [1,]",
        'a = "\\u0041"',
        "a = 1\r\n",
        "# \x01",
    ):
        assert _plain_tables(text) is None
