"""References of every kind: against an independent reference, in every loop, and in one sentence if they are wrong."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from embedded import need
from fracgyro import _core
from fracgyro.export.replay import first_difference
from fracgyro.export.targets import answer_columns, answers
from fracgyro.scenario.to_core import core_setup, equivalent_sine, reference_reach
from fracgyro.simulation.dataset import write_run
from nightly import nightly_unless
from reference_oracle import motion
from test_parity import load

pytestmark = pytest.mark.usefixtures("lanes")
TERMS = [
    {"amplitude": (1.0, 0.5), "frequency": (1.0, 2.0), "phase": (0.0, 0.3)},
    {"amplitude": (0.2, 0.1), "frequency": (7.0, 9.0)},
]
POINTS = [[0.0, 0.0, 0.1], [0.7, 0.4, 0.1], [1.5, 1.0, -0.2], [2.0, 0.8, 0.3], [4.5, -0.3, 0.0]]
KINDS: dict[str, dict[str, Any]] = {
    "sine about an offset": {"reference.offset": (0.3, -0.1)},
    "sines": {"reference.kind": "sines", "reference.terms": TERMS},
    "step": {"reference.kind": "step", "reference.amplitude": (0.5, -0.2), "reference.smoothing": 0.1},
    "pulse": {"reference.kind": "step", "reference.start": 0.5, "reference.end": 2.0, "reference.smoothing": 0.05},
    "jump": {"reference.kind": "step", "reference.start": 1.0},
    "order 1": {"reference.kind": "step", "reference.smoothing": 0.1, "reference.smoothing_order": 1},
    "ramp": {
        "reference.kind": "ramp",
        "reference.slope": (0.5, -0.2),
        "reference.start": 0.25,
        "reference.end": 3.0,
        "reference.smoothing": 0.1,
        "reference.smoothing_order": 4,
    },
    "bare ramp": {"reference.kind": "ramp", "reference.slope": (0.5, -0.2)},
    "chirp": {
        "reference.kind": "chirp",
        "reference.frequency": (1.0, 3.0),
        "reference.final_frequency": (6.0, 0.5),
        "reference.start": 0.5,
        "reference.end": 3.5,
        "reference.phase": (0.2, 1.0),
    },
    "staircase": {
        "reference.kind": "staircase",
        "reference.amplitude": (0.2, -0.1),
        "reference.hold": 0.4,
        "reference.levels": 5,
        "reference.smoothing": 0.1,
        "reference.start": 0.3,
    },
    "table": {"reference.kind": "table", "reference.points": POINTS},
    "table of two rows": {"reference.kind": "table", "reference.points": POINTS[:2]},
    "table of one row": {"reference.kind": "table", "reference.points": POINTS[2:3]},
    "rest": {"reference.kind": "rest", "reference.offset": (0.1, 0.2)},
    "one kind per axis": {"reference.kind": ["chirp", "rest"], "reference.end": 2.0},
}
BASE = fg.Scenario.paper().replace({"run.duration": 5.0})
SCENARIOS = {name: BASE.replace(changes) for name, changes in KINDS.items()}
each = pytest.mark.parametrize("name", SCENARIOS)


@each
def test_it_is_the_motion_of_an_independent_reference(name: str) -> None:
    scenario = SCENARIOS[name]
    steps = scenario.run.steps
    rows = np.array(_core.reference(core_setup(scenario), steps + 1, 1)).reshape(-1, 3, 2).transpose(1, 0, 2)
    expected = motion(scenario, scenario.run.step * np.arange(steps + 1))
    scale = np.maximum(np.abs(expected).max(axis=(1, 2), keepdims=True), 1.0)
    np.testing.assert_allclose(rows / scale, expected / scale, rtol=0, atol=2e-13)


@each
def test_a_run_records_it_and_is_judged_by_it(name: str) -> None:
    run = fg.simulate(SCENARIOS[name])
    expected = motion(SCENARIOS[name], run.time.values)
    np.testing.assert_allclose(run.reference, expected[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.error, run.position - expected[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.error_rate, run.velocity - expected[1], rtol=0, atol=1e-10)


@each
def test_many_runs_have_the_bits_of_single_ones(name: str) -> None:
    runs = [SCENARIOS[name].replace({"controller.order": order}) for order in np.linspace(0.6, 0.95, 9).tolist()]
    setups, params = [core_setup(run) for run in runs], _core.MetricsParams()
    by_itself = _core.measure_runs(setups, params, 1, 1, False)
    for lanes in _core.lane_counts():
        np.testing.assert_array_equal(_core.measure_runs(setups, params, 2, lanes, False), by_itself)


def test_runs_of_several_references_measured_together_keep_their_own() -> None:
    runs = [scenario for scenario in SCENARIOS.values() for _ in range(3)]
    found = fg.measure_many(runs)
    for at in range(0, len(runs), 5):
        alone = fg.measure_many([runs[at]])
        for name in found.data_vars:
            np.testing.assert_array_equal(found[name].values[at], alone[name].values[0])


@each
def test_it_survives_its_toml(name: str, tmp_path: Path) -> None:
    scenario = SCENARIOS[name]
    scenario.save(tmp_path / "mine.toml")
    assert fg.Scenario.load(tmp_path / "mine.toml") == scenario


@pytest.mark.parametrize(
    ("names", "target"),
    nightly_unless(
        lambda names, target: names == ("table", "table") or target in {"host", "lanes"},
        product(
            [("sines", "ramp"), ("chirp", "staircase"), ("table", "table")],
            ["host", "lanes", "m4f", "m7", "fmu", "wasm"],
        ),
    ),
)
def test_every_target_has_its_bits(names: tuple[str, ...], target: str, tmp_path: Path) -> None:
    """One kind per axis, so that three programs of a target show five kinds."""
    need({"m4f": "Cortex-M", "m7": "Cortex-M", "wasm": "WebAssembly"}.get(target, ""))
    changes = {field: value for name in names for field, value in KINDS[name].items()}
    scenario = BASE.replace({**changes, "reference.kind": names, "run.duration": 2.0, "controller.kind": "pid"})
    write_run(fg.simulate(scenario), tmp_path / "run.nc")
    trace = load(tmp_path / "run.nc")
    number = "float" if target == "m4f" else "double"
    expected = answers("host", scenario, "float", trace.motion) if number == "float" else trace.answers
    difference = first_difference(answers(target, scenario, number, trace.motion), expected, answer_columns(scenario))
    assert difference is None, difference


def test_a_device_loop_follows_it() -> None:
    chirp = SCENARIOS["chirp"]
    real = chirp.replace({"device.delay": 1, "device.position_noise": 1e-12})
    np.testing.assert_array_equal(fg.simulate(real).reference, fg.simulate(chirp).reference)


def test_a_table_of_a_sine_is_the_sine() -> None:
    times = np.linspace(0, 5, 1001)
    frequency, phase = np.array(BASE.reference.frequency), np.array(BASE.reference.phase)
    values = np.sin(np.outer(times, frequency) + phase)
    table = BASE.replace({"reference.kind": "table", "reference.points": np.column_stack([times, values])})
    np.testing.assert_allclose(fg.simulate(table).reference, fg.simulate(BASE).reference, atol=2e-8)
    amplitude, found = equivalent_sine(table)
    np.testing.assert_allclose(amplitude, 1.0, rtol=0.02)
    np.testing.assert_allclose(found, frequency, rtol=0.02)


def test_a_smoothed_step_arrives_and_moves_no_faster_than_its_filter() -> None:
    step = SCENARIOS["step"]
    position, velocity = reference_reach(step)
    assert position == pytest.approx((0.5, 0.2), rel=1e-6)
    fastest = 2**2 * np.exp(-2) / 2  # maximum of x^(n-1) e^-x/(n-1)! with n = 3, at x = 2
    assert velocity == pytest.approx((0.5 * fastest / 0.1, 0.2 * fastest / 0.1), rel=1e-4)


def test_a_file_is_read_once_and_kept(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("time,x,y\n" + "\n".join(f"{t},{x},{y}" for t, x, y in POINTS) + "\n")
    (tmp_path / "mine.toml").write_text('[reference]\nkind = "table"\nfile = "path.csv"\n')
    scenario = fg.Scenario.load(tmp_path / "mine.toml")
    (tmp_path / "path.csv").unlink()
    assert scenario.reference.points == tuple(map(tuple, POINTS))
    assert fg.Scenario.from_toml(scenario.to_toml()) == scenario


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "stp"}, "reference.kind is \"stp\": it must be sine, sines, step, ramp, chirp, staircase, table or "
         "rest, or a list of two of these for x and y; did you mean step?"),
        ({"kind": "sine", "slope": (1.0, 1.0)}, "reference.slope is [1.0, 1.0]: it needs "
         "reference.kind = \"ramp\", but reference.kind is \"sine\""),
        ({"kind": "ramp"}, "reference.slope is missing: a ramp must have one, [x, y]; zeros are allowed"),
        ({"file": "a.csv"}, "reference.file is \"a.csv\": it needs reference.kind = \"table\", but reference.kind is "
         "\"sine\""),
        ({"kind": "table"}, "reference.points is missing: a table must have points, or a file of them"),
        ({"kind": "sines"}, "reference.terms is missing: sines must have a list of {amplitude, frequency, phase}"),
        ({"kind": "chirp"}, "reference.end is inf: a chirp must reach its final frequency at a finite time"),
        ({"kind": "step", "start": 2.0, "end": 1.0}, "reference.end is 1.0: it must be greater than reference.start, "
         "which is 2.0"),
        ({"kind": "staircase", "smoothing": 2.0}, "reference.smoothing is 2.0: it must be at most reference.hold, "
         "which is 1.0"),
        ({"kind": "table", "points": [[0.0, 1.0]]}, "reference.points is [[0.0, 1.0]]: it must be a list of 1 to "
         "100000 triples [time, x, y] of finite numbers whose times rise"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_in_one_sentence(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(fg.ScenarioError) as caught:
        fg.Scenario(reference=changes)
    assert str(caught.value) == message


def test_a_conventional_gyroscope_drives_a_sine() -> None:
    with pytest.raises(fg.ScenarioError, match=r"reference.kind is \"chirp\": for controller.kind open_loop"):
        SCENARIOS["chirp"].replace({"controller.kind": "open_loop"})
    held = BASE.replace({"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"]})
    assert not fg.simulate(held).reference.sel(axis="y").any()


def test_a_law_with_a_resonator_takes_its_frequency_from_any_kind() -> None:
    law = BASE.replace({"controller.kind": "park_horowitz", "disturbance.kind": "none", "run.duration": 20.0})
    frequency = (2.0, 1.0)
    sine = law.replace({"reference.frequency": frequency, "reference.phase": (0.0, 0.3)})
    term = {"amplitude": (1.0, 1.0), "frequency": frequency, "phase": (0.0, 0.3)}
    sines = law.replace({"reference.kind": "sines", "reference.terms": [term]})
    np.testing.assert_allclose(fg.simulate(sines).position, fg.simulate(sine).position, rtol=0, atol=1e-9)
