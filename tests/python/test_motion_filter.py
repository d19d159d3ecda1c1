"""The Kalman filter between sensors and any controller: its equations, what it is worth, where it runs, refusals."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from filter_oracle import MotionFilter
from fracgyro import ScenarioError
from fracgyro.analysis.metrics import chattering
from fracgyro.export.targets import answers
from laws import by_numba

FULL = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
POSITIONS = {"device.sensing": "position", "device.position_noise_density": 1e-13}
KALMAN = {"controller.filter": "kalman"}
PID = fg.Scenario.paper().replace(
    {"controller.kind": "pid", "controller.natural_frequency": 300.0, "controller.force_limit": 1000.0, **KALMAN}
)
CASES: dict[str, dict[str, Any]] = {
    "both": FULL,
    "positions": POSITIONS,
    "good sensors": {"datasheet.position_noise": 1e-6, "datasheet.velocity_noise": 1e-4},
    "exact positions": {"device.sensing": "position"},
    "delay": FULL | {"device.delay": 2, "controller.natural_frequency": 100.0},
    "the controller believes another delay": POSITIONS | {"device.delay": 1, "datasheet.delay": 0},
    "other numbers": FULL | {"datasheet.force_noise": 30.0, "controller.observer_bandwidth": 20.0},
}


def spring(sample: Any) -> tuple[float, float]:
    (x, y), (rx, ry), (vx, vy) = sample.position, sample.reference, sample.velocity
    return -4e4 * (x - rx) - 300 * vx, -4e4 * (y - ry) - 300 * vy


@pytest.mark.parametrize("name", CASES)
def test_a_controller_receives_the_motion_of_its_equations(name: str) -> None:
    scenario = PID.replace({**CASES[name], "run.duration": 2.0})
    oracle, seen = MotionFilter(scenario), []

    def keeping(sample: Any) -> tuple[float, float]:
        seen.append((*sample.position, *sample.velocity))
        return spring(sample)

    run = fg.simulate(scenario, keeping)
    measured = zip(run["measured_position"].values, run["measured_velocity"].values, strict=True)
    expected = []
    for (q, v), force in zip(measured, run["control"].values, strict=True):
        expected.append(np.hstack(oracle.estimate(q, v)))
        oracle.sent(force)
    found = np.array(seen)
    assert np.abs(run["control"].values).max() == 1000.0  # which the filter takes into account
    positions, velocities = np.hsplit(found - np.array(expected), 2)
    assert np.abs(positions).max() < 1e-9
    assert np.abs(velocities).max() < 1e-7
    assert np.abs(found[100:, 2:] - run["velocity"].values[100:]).max() > 1e-9  # it is an estimate


@pytest.mark.parametrize("sensing", [FULL, POSITIONS], ids=["both", "positions"])
@pytest.mark.parametrize("kind", ["fractional_fast_terminal", "pid", "super_twisting", "least_squares_pid"])
def test_every_kind_of_controller_acts_on_that_motion(kind: str, sensing: dict[str, Any]) -> None:
    filtered = PID.replace({"controller.kind": kind, "run.duration": 0.3, **sensing})
    # Exact positions: a fractional surface would smooth noisy ones itself.
    exact = {"datasheet.position_noise": 0.0} if kind.startswith("fractional") else {}
    plain = filtered.replace({"controller.filter": "none", "device.sensing": "full", **exact})
    ours, inner, oracle = fg.Controller(filtered), fg.Controller(plain), MotionFilter(filtered)
    run = fg.simulate(filtered)
    for n in range(300):
        q, v = run["measured_position"].values[n], run["measured_velocity"].values[n]
        force = ours.step(n * 1e-3, q, v)
        np.testing.assert_array_equal(force, run["control"].values[n])
        expected = inner.step(n * 1e-3, *oracle.estimate(q, v))
        oracle.sent(force)
        np.testing.assert_allclose(force, expected, rtol=1e-6, atol=1e-3)


def measured(changes: dict[str, Any]) -> tuple[float, float]:
    """RMS error of x and y together, and the larger chattering, after the transient."""
    run = fg.simulate_many([PID.replace({"run.duration": 20.0, **changes})], seeds=range(2))
    steady = run.sel(time=slice(10.0, None))
    return float(np.sqrt((steady["error"] ** 2).mean())), float(max(chattering(run).mean("run").values))


@pytest.mark.parametrize("sensing", [FULL, POSITIONS], ids=["both", "positions"])
def test_it_lowers_the_chattering_of_the_same_gains_several_times(sensing: dict[str, Any]) -> None:
    filtered, raw = measured(sensing), measured(sensing | {"controller.filter": "none"})
    assert filtered[1] < raw[1] / 4
    assert filtered[0] < 1.15 * raw[0]


@pytest.mark.parametrize("sensing", [FULL, POSITIONS, {}], ids=["both", "positions", "exact"])
def test_a_hidden_step_of_delay_costs_little(sensing: dict[str, Any]) -> None:
    known, _ = measured(sensing)
    hidden, _ = measured(sensing | {"device.delay": 1, "datasheet.delay": 0})
    assert hidden < 1.4 * known


def test_with_the_nominal_plant_and_without_noise_it_changes_nothing() -> None:
    exact = {"adaptation.initial_ratio": 1.0, "disturbance.kind": "none", "run.duration": 5.0}
    filtered, raw = (fg.simulate(PID.replace({**exact, "controller.filter": name})) for name in ("kalman", "none"))
    np.testing.assert_allclose(filtered["position"], raw["position"], rtol=0, atol=1e-11)


@pytest.mark.parametrize("device", ["dual_mass", "disc", "paper_resonance", "tuned_in_air"])
def test_on_the_shipped_devices_it_is_better_than_the_observer(device: str) -> None:
    shipped = fg.Scenario.shipped(device)
    duration = 30_000 * shipped.run.step
    base = shipped.replace(
        {
            "controller.kind": "pid",
            "controller.natural_frequency": 0.3 / shipped.run.step,
            "controller.observer_bandwidth": 0.1 / shipped.run.step,
            "run.duration": duration,
        }
    )
    assert base.device.sensing == "position"
    both = [base, base.replace(KALMAN)]
    errors = fg.measure_many(both, transient=0.75 * duration)["rmse"].sel(window="steady").prod("axis").values
    assert 0.0 < errors[1] < 0.6 * errors[0]


# -- Every way to run it -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["both", "positions", "delay"])
def test_runs_in_parts_alone_and_measured_are_the_same(name: str) -> None:
    scenario = PID.replace({**CASES[name], "run.duration": 1.0})
    run = fg.simulate(scenario)
    loop = fg.Loop(scenario)
    first = loop.run(400)
    saved, other = loop.state, fg.Loop(scenario)
    other.state = saved
    np.testing.assert_array_equal(first["control"], run["control"][:400])
    np.testing.assert_array_equal(other.run(601)["control"], run["control"][400:])
    controller = fg.Controller(scenario)
    for n, (q, v) in enumerate(zip(run["measured_position"].values, run["measured_velocity"].values, strict=True)):
        np.testing.assert_array_equal(controller.step(n * 1e-3, q, v), run["control"].values[n])
        if n == 300:
            controller = copy.copy(controller)
    many = fg.measure_many([scenario, scenario.replace({"controller.filter": "none"})])
    whole = many["rmse"].sel(window="whole").values
    np.testing.assert_allclose(whole[0], np.sqrt((run["error"].values ** 2).mean(axis=0)), rtol=1e-12)
    assert (whole[0] != whole[1]).all()


def test_a_users_controller_behind_it_runs_in_parts_and_resumes() -> None:
    scenario = PID.replace({**FULL, "run.duration": 0.4})

    def compiled(given: Any, state: Any, p: Any, out: Any) -> None:
        for i in range(2):
            out[i] = -4e4 * (given[1 + i] - given[5 + i]) - 300 * given[3 + i]

    law = fg.native.Law(by_numba(compiled))
    run = fg.simulate(scenario, law)
    np.testing.assert_array_equal(run["control"], fg.simulate(scenario, spring)["control"])
    loop, other = fg.Loop(scenario, law), fg.Loop(scenario, law)
    np.testing.assert_array_equal(loop.run(200)["control"], run["control"][:200])
    other.state = loop.state
    np.testing.assert_array_equal(other.run(201)["control"], run["control"][200:])
    without = fg.simulate(scenario.replace({"controller.filter": "none"}), law)
    assert not np.array_equal(run["control"], without["control"])


def test_what_the_filter_is_cannot_change_while_the_loop_runs() -> None:
    loop = fg.Loop(PID.replace(FULL))
    loop.set({"controller.damping_ratio": 1.0})
    with pytest.raises(ScenarioError, match=r"^controller\.filter cannot be set while the loop runs: it acts only at"):
        loop.set({"controller.filter": "none"})


@pytest.mark.parametrize("sensing", [FULL, POSITIONS], ids=["both", "positions"])
def test_its_guard_holds_the_force_through_bad_samples_and_goes_on(sensing: dict[str, Any]) -> None:
    scenario = PID.replace({**sensing, "guard.checked": True, "run.duration": 3.0})
    controller, plant = fg.Controller(scenario), fg.Plant(scenario.replace({"disturbance.seed": 3}))
    statuses = set()
    for n in range(3000):
        motion = plant.motion
        bad = n in (1000, 1003) or 1500 <= n < 1540
        q = (np.nan, 0.0) if bad else motion.position
        v = None if "device.sensing" in sensing else motion.velocity
        plant.step(controller.step(n * 1e-3, q, v))
        statuses.add(controller.status)
    reference = np.array([np.sin(np.pi * 3.0), np.cos(np.pi * 1.5)])
    assert statuses >= {"ok", "not_finite"}
    np.testing.assert_allclose(plant.motion.position, reference, atol=2e-3)


# -- Fields and refusals -------------------------------------------------------------------------------------


def test_fields_of_the_datasheet_come_with_the_filter() -> None:
    plain = fg.Scenario.paper().replace({"controller.kind": "pid"})
    assert "noise is not set" not in plain.to_toml()  # only the pick-offs are there
    text = PID.to_toml()
    for name in ("force_noise", "position_noise", "velocity_noise", "delay"):
        assert f"# {name} is not set" in text
    table = text[text.index("[datasheet]") : text.index("[disturbance]")]
    assert "stiffness_drift" not in table
    stated = PID.replace({"datasheet.delay": 1})
    assert fg.Scenario.from_toml(stated.to_toml()) == stated
    assert stated.replace({"controller.filter": "none"}).datasheet.delay is None
    with pytest.raises(ScenarioError) as error:
        plain.replace({"datasheet.delay": 1})
    assert str(error.value).startswith("datasheet.delay is 1: it needs controller.kind = ")
    assert str(error.value).endswith('but controller.kind is "pid"; or controller.filter = "kalman"')


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"controller.kind": "lqg"}, "controller.kind lqg"),
        ({"controller.kind": "internal_model"}, "controller.kind internal_model"),
        ({"controller.kind": "disturbance_rejection"}, "controller.kind disturbance_rejection"),
        ({"controller.kind": "force_rebalance"}, "controller.kind force_rebalance"),
        ({"controller.kind": "linear", "adaptation.kind": "joint"}, "adaptation.kind joint"),
    ],
)
def test_a_controller_that_filters_by_itself_refuses_it(changes: dict[str, Any], named: str) -> None:
    said = f'controller.filter is "kalman": for {named}, which filters the measurements itself, it must be none'
    with pytest.raises(ScenarioError) as error:
        fg.Scenario.paper().replace(changes | KALMAN)
    assert str(error.value) == said
    not_in_use = {"controller.kind": "linear", "adaptation.kind": "joint", "controller.adaptive": False}
    assert fg.Scenario.paper().replace(not_in_use | KALMAN).controller.filter == "kalman"


def test_targets_without_it_say_so(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'^controller\.filter is "kalman": it must be none for this target'):
        answers("lanes", PID, "double", np.zeros((3, 4)))
