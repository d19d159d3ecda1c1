"""The task `rate` of `fracgyro compare`: its measurements against closed forms, and a user's controller."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.rate.units import DEG_PER_S
from fracgyro.scenario.kinds import kinds_with
from fracgyro.scenario.schema import Datasheet
from fracgyro.study.tune.criteria import Measured
from fracgyro_lab.comparison import rate_runs
from fracgyro_lab.comparison.contender import Contender
from fracgyro_lab.comparison.own import own_contender
from fracgyro_lab.comparison.plan import planned
from fracgyro_lab.comparison.rate import Rate
from fracgyro_lab.comparison.run import compare
from fracgyro_lab.comparison.task import sensed

RATE = Rate()
DUAL_MASS = RATE.scenarios()["dual_mass"]
HZ = 2 * math.pi / DUAL_MASS.plant.reference_frequency
CONTENDERS = {contender.name: contender for contender in RATE.contenders}
REBALANCE = {
    "controller.pll_bandwidth": 100 * HZ,
    "controller.amplitude_bandwidth": 100 * HZ,
    "controller.amplitude_integral": 20 * HZ,
    "controller.demodulation_bandwidth": 2000 * HZ,
    "controller.rebalance_bandwidth": 200 * HZ,
}


def scenario(name: str, values: dict[str, Any], noise: float = 1e-13, information: str = "P") -> fg.Scenario:
    return CONTENDERS[name].scenario(sensed(DUAL_MASS, information, noise), values)


@pytest.mark.parametrize(
    ("contender", "information"),
    [pytest.param(c, of, id=f"{c.name}-{of}") for c in RATE.contenders for of in c.classes],
)
def test_every_contender_is_a_scenario_at_both_ends_of_every_range(contender: Contender, information: str) -> None:
    base = sensed(DUAL_MASS, information, 1e-13)
    assert len(contender.tuned(information)) <= 8
    assert contender.bandwidth is not None
    for end in ("low", "high"):
        gains = (*contender.tuned(information), contender.bandwidth)
        mine = contender.scenario(base, {gain.field: getattr(gain, end) for gain in gains})
        for table in ("plant", "disturbance", "rate", "device"):
            assert getattr(mine, table) == getattr(base, table), table
        has_datasheet = mine.controller.kind in kinds_with("datasheet.force_noise")
        assert mine.datasheet == (base.datasheet if has_datasheet else Datasheet())
        assert mine.controller.force_limit == base.controller.force_limit
        assert mine.adaptation.initial_rate == 0.0, "none knows the rate"


# -- Measurements --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "noise", "expected"),
    [
        ("lqg", 0.0, 0.00789),
        ("lqg", 1e-13, 0.0180),
        ("force_rebalance", 0.0, 0.0112),
        ("force_rebalance", 1e-13, 0.0257),
    ],
)
def test_the_bound_is_that_of_the_axes_that_move(name: str, noise: float, expected: float) -> None:
    assert rate_runs.bound(scenario(name, {}, noise)) == pytest.approx(expected, rel=0.005)


def test_the_angle_random_walk_of_white_noise_is_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise of known density on a slope of the output, which a standard deviation would include."""
    unit, density = DUAL_MASS.plant.scales, 1e-6  # rad/s/sqrt(Hz)
    rng = np.random.default_rng(5)

    def white(run: fg.Scenario, seeds: Any, *, every: int, block: int, controller: Any) -> Any:
        interval = every * block * run.run.step * unit.time
        count = math.ceil(run.run.steps / block)
        return rng.normal(size=(len(seeds), count)) * density / math.sqrt(interval) / unit.rate + 1e-9

    monkeypatch.setattr(rate_runs, "rate_means", white)
    walk, spread, mean = rate_runs.noise_at_rest(scenario("lqg", {}), range(2000), None)
    together = RATE.interval("angle_random_walk", walk)
    assert together[0] == pytest.approx(math.degrees(density) * 60, rel=0.03)
    assert together[1] < math.degrees(density) * 60 < together[2]
    assert RATE.interval("output_noise", spread)[0] == pytest.approx(
        1e3 * math.degrees(density) / math.sqrt(5e-4), rel=0.01
    )
    assert mean.mean() == pytest.approx(math.degrees(1e-9 * unit.rate) * 3600, rel=0.3)
    measured = Measured({"angle_random_walk": walk}, np.isnan(walk))
    assert np.exp(RATE.error(measured)) == pytest.approx(walk)


def test_a_constant_output_has_an_error_and_has_not_diverged() -> None:
    """Output like that of converters too coarse for an axis held at rest."""
    found = RATE.error(Measured({"angle_random_walk": np.array([0.0, 0.02, np.nan])}, np.array([False, False, True])))
    assert np.isfinite(found[:2]).all()
    assert found[2] == math.inf


def test_the_bandwidth_that_is_found_is_100_hz_and_where_there_is_none_it_is_none() -> None:
    contender, base = CONTENDERS["force_rebalance"], sensed(DUAL_MASS, "P", 0.0)
    found = RATE.completed(contender, base, REBALANCE)
    assert found is not None
    below, above = (abs(g) for g in rate_runs.response(contender.scenario(base, found), None, (95.0, 105.0)))
    assert above < math.sqrt(0.5) < below
    slow = {**REBALANCE, "controller.rebalance_bandwidth": 40 * HZ}
    assert RATE.completed(contender, base, slow) is None, "no filter of the output makes the loop faster"
    assert RATE.completed(CONTENDERS["open_loop"], base, dict(list(REBALANCE.items())[:-1])) is None


def test_force_rebalance_has_the_errors_of_its_closed_forms() -> None:
    """EQUATIONS, "The conventional gyroscope": dxy/2, the cosine of a hidden delay, and quadrature times its sine."""
    mine = scenario("force_rebalance", {**REBALANCE, "controller.output_bandwidth": 150 * HZ}, noise=0.0)
    found = RATE.figures(mine, [10_000], None)
    plant, step = mine.plant, mine.run.step
    cross = 0.1 * math.sqrt(plant.damping.xx * plant.damping.yy) / (2 * plant.mass)
    assert found["bias_damping"] == pytest.approx(math.degrees(cross) * 3600, rel=0.01)
    assert found["bias_quadrature_hidden"] == pytest.approx(300 * math.sin(step) * 3600, rel=0.01)
    assert abs(found["bias_quadrature"]) < 20.0
    held = 1e6 * step**2 / 24
    assert found["scale_factor_error"] == pytest.approx(held, rel=0.05)
    assert found["scale_factor_hidden"] == pytest.approx(held + 1e6 * (math.cos(step) - 1), rel=0.01)
    assert found["lag_10"] < found["lag_100"] < 120
    assert abs(found["bias_drift"]) < 100
    assert found["rms_drift"] > abs(found["bias_drift"])
    assert found["full_scale"] in [300.0 * 2**n for n in range(6)]
    assert 5 < found["start_up"] < 100


def test_two_axes_tell_the_rate_from_what_one_axis_cannot() -> None:
    mine = scenario("lqg", {"adaptation.rate_forgetting": 0.0265})
    (both,) = RATE.measure([mine], range(10_000, 10_008), mine, None)
    assert 0.7 < RATE.interval("over_bound", both.metrics["over_bound"])[0] < 1.6
    found = RATE.figures(mine, [10_000], None)
    assert abs(found["bias_damping"]) < 20
    assert abs(found["scale_factor_error"]) < 20


def test_a_trial_that_is_far_off_is_not_measured_further() -> None:
    wild = scenario("adrc_nominal", {"controller.rate_bandwidth": 0.03})
    (found,) = RATE.train([wild], range(2), wild, None)
    assert np.isnan(found.metrics["output_noise"]).all()
    assert found.metrics["scale_factor_error"] > 5e4
    fair = scenario("lqg", {"adaptation.rate_forgetting": 0.0265})
    (found,) = RATE.train([fair], range(2), fair, None)
    assert np.isfinite(found.metrics["output_noise"]).all()


# -- A controller of one's own -------------------------------------------------------------------------------

# PD with feedforward of the nominal plant. The force on y holds for a step, whose middle counts; without that which y's
# own damping needs, what follows x's velocity is the rate's.
NATIVE = """
import math

import numba
import fracgyro as fg

pointer = numba.types.CPointer(numba.types.double)
STEP, DAMPING, STIFFNESS = 0.05, (2.14e-4, 2.257e-3), (1.0, 1.027188637)


@numba.cfunc(numba.types.void(pointer, pointer, pointer, pointer))
def compiled(given, state, gains, out):
    for i in range(2):
        e, v = given[1 + i] - given[5 + i], given[3 + i] - given[7 + i]
        out[i] = given[9 + i] + DAMPING[i] * given[7 + i] + STIFFNESS[i] * given[5 + i] - gains[0] * e - gains[1] * v
    part = 1.0 - math.exp(-gains[2] * STEP)
    missing = out[1] - DAMPING[1] * (given[8] + 0.5 * STEP * given[10])
    state[0] += part * (missing * given[7] - state[0])
    state[1] += part * (given[7] * given[7] - state[1])
    out[2] = 0.5 * state[0] / max(state[1], 1e-12)


def law(kp, kd, bandwidth):
    return fg.native.Law(
        compiled, 2, parameters={"kp": kp, "kd": kd, "bandwidth": bandwidth}, reports=["rate_estimate"]
    )


law.ranges = {"kp": (0.03, 0.1), "kd": (2.5, 5.0), "bandwidth": (1e-3, 1.0)}
"""


def test_a_controller_of_ones_own_gives_a_rate_at_the_bandwidth_of_all(tmp_path: Path) -> None:
    pytest.importorskip("numba", reason="this Python has no Numba, which the test extra asks for up to 3.14")
    (tmp_path / "mine.py").write_text(NATIVE, encoding="utf-8")
    given = f"{tmp_path / 'mine.py'}:law"
    device = tmp_path / "device.toml"
    DUAL_MASS.replace({"adaptation.initial_ratio": 1.0}).save(device)
    mine = {"only": ["law"], "classes": ["F"], "noise": [0.0], "controller": given, "trials": 1, "quick": True}
    result = compare("rate", tmp_path / "out", scenarios=[device], **mine)
    (row,) = json.loads(result.data.read_text(encoding="utf-8"))["contenders"]
    assert row["trials"] == 1
    walk, error = (row["metrics"][name]["value"] for name in ("angle_random_walk", "error"))
    assert walk == pytest.approx(error, rel=1e-14)  # which is a geometric mean: of this one
    assert walk > 0
    assert row["metrics"]["scale_factor_error"]["value"] < 5000
    assert row["ratio"] is None, "the reference takes no part"
    exact = sensed(DUAL_MASS, "F", 0.0)
    assert set(row["others"]) == {*RATE.plants(exact), *RATE.conditions(exact)}
    assert set(row["gains"]) == {"law.kp", "law.kd", "law.bandwidth"}


def test_a_quick_look_is_at_positions_with_noise() -> None:
    def cells(**options: Any) -> list[tuple[str, float]]:
        given: dict[str, Any] = {"scenarios": (), "only": (), "controller": None, "trials": None, "storage": None}
        found = planned("rate", **{**given, "classes": (), "noise": (), "quick": True, **options})
        return list(dict.fromkeys((row.cell.information, row.cell.noise) for row in found.rows))

    assert cells() == [("P", 1e-13)]
    assert cells(noise=(0.0,)) == [("F", 0.0), ("P", 0.0)]
    assert cells(quick=False) == [("F", 0.0), ("F", 1e-13), ("P", 1e-13)]


def test_what_has_nothing_to_tune_has_its_bandwidth_found() -> None:
    plan = planned(
        "rate",
        scenarios=(),
        only=("lqg", "force_rebalance"),
        classes=("P",),
        noise=(1e-13,),
        controller=None,
        trials=None,
        quick=False,
        storage=None,
    )
    tuned, joint = plan.rows
    assert plan.waves() == [[tuned]]
    tuning = plan.tuning(tuned, {})
    assert (tuning.trials, tuning.few, tuning.samplers) == (200, 8, 2)
    values = plan.untuned(joint)
    assert values is not None
    assert set(values) == {"adaptation.rate_forgetting"}
    (gain,) = rate_runs.response(plan.judging(joint, values).scenario(), None, (100.0,))
    assert abs(gain) == pytest.approx(math.sqrt(0.5), rel=0.011)


def test_the_bandwidth_of_ones_own_is_found_and_not_tuned(tmp_path: Path) -> None:
    pytest.importorskip("numba", reason="this Python has no Numba, which the test extra asks for up to 3.14")
    (tmp_path / "mine.py").write_text(NATIVE, encoding="utf-8")
    mine = own_contender(f"{tmp_path / 'mine.py'}:law", RATE)
    assert [gain.field for gain in mine.gains] == ["law.kp", "law.kd"]
    assert mine.bandwidth is not None
    assert mine.bandwidth.field == "law.bandwidth"


def test_a_controller_without_a_bandwidth_is_refused(tmp_path: Path) -> None:
    text = "def law(kp):\n    return lambda sample: (0.0, 0.0)\n\n\nlaw.ranges = {'kp': (1.0, 2.0)}\n"
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match=r"law\.ranges has no bandwidth: it must have one"):
        own_contender(f"{tmp_path / 'mine.py'}:law", RATE)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"reference.amplitude": (1.0, 0.0)}, "both axes must be driven"),
        ({"reference.frequency": (0.5, 1.0)}, "both must begin with 1.0"),
        ({"disturbance.kind": "none"}, "it must be noise"),
    ],
)
def test_a_scenario_that_is_no_driven_gyroscope_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(fg.ScenarioError, match=said):
        RATE.scenario(DUAL_MASS.replace(changes))


def test_300_deg_per_s_is_the_range() -> None:
    assert DEG_PER_S.of(rate_runs.RANGE) == pytest.approx(300.0)
