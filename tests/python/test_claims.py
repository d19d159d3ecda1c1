"""Every verdict on the paper's claims, on made-up metrics of a known answer: on both sides of each threshold."""

from __future__ import annotations

import itertools
import json
import math
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from fracgyro import metrics
from fracgyro.scenario.to_core import core_setup
from fracgyro_lab.paper import claims, runs
from fracgyro_lab.paper.claims import CLAIMS, Material
from fracgyro_lab.paper.step_cost import StepCost, time_steps
from fracgyro_lab.verdicts import write_claims

SEEDS = 20  # 19 of them are the 95 % in which something must hold
AXES = {"window": ["whole", "transient", "steady"], "axis": ["x", "y"]}


def by_seed(most: float, *others: float) -> np.ndarray:
    """A value for every seed: the last ones as reported, the rest `most`."""
    return np.array([most] * (SEEDS - len(others)) + list(others))


def rmse(size: float = 1.0, **cells: np.ndarray) -> xr.DataArray:
    """An RMSE that is the same everywhere but in the cells reported, as steady_x."""
    values = xr.DataArray(np.full((SEEDS, 3, 2), size), dims=["run", "window", "axis"], coords=AXES)
    for name, value in cells.items():
        window, axis = name.split("_")
        values.loc[{"window": window, "axis": axis}] = value
    return values


def material(variant: str = "corrected", **controllers: dict[str, Any]) -> Material:
    """Metrics by controller and name, over the seeds; a recorded run where a claim reads one."""
    study = {}
    for name, values in controllers.items():
        arrays = {k: v if isinstance(v, xr.DataArray) else xr.DataArray(v, dims="run") for k, v in values.items()}
        study[variant, name, runs.PAPER_ORDER] = xr.Dataset(arrays)
    return Material(variant, {(variant, "proposed"): RECORDED}, study)


def recorded() -> xr.Dataset:
    """Fifteen units of time: ‖e‖ is 0.1 e^-t, s is (0.3, 0.4)."""
    t = np.arange(0, 15, 0.01)
    error = np.stack([0.06 * np.exp(-t), 0.08 * np.exp(-t)], axis=1)
    surface = np.tile([0.3, 0.4], (len(t), 1))
    both = {name: (["time", "axis"], values) for name, values in (("error", error), ("surface", surface))}
    return xr.Dataset(both, coords={"time": t, "axis": ["x", "y"]}, attrs={"units": "nondimensional"})


RECORDED = recorded()


def verdict(identifier: str, found: Material) -> bool:
    held, evidence = CLAIMS[identifier][2](found)
    assert "nan" not in evidence
    return held


# -- a: the error settles before t = 5 -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("times", "held"),
    [
        (by_seed(4.99), True),
        (by_seed(4.99, 5.0), True),
        (by_seed(4.99, math.nan), True),
        (by_seed(4.99, 5.0, 5.0), False),
        (by_seed(4.99, math.nan, math.nan), False),
        (by_seed(40.0), False),
    ],
)
def test_a_holds_where_the_error_settles_before_5_in_19_of_20_seeds(times: np.ndarray, held: bool) -> None:
    found = material(proposed={"error_settling_time": times, "rmse": rmse(0.25)})
    assert verdict("a", found) is held


def test_the_evidence_of_a_is_the_median_the_range_and_what_never_settled() -> None:
    found = material(proposed={"error_settling_time": by_seed(4.0, 3.0, 7.5, math.nan), "rmse": rmse(0.25)})
    # 0.1 e^-t is 0.05 at ln 2, 0.02 at ln 5, 0.005 at ln 20 and 0.001 at ln 100: the next sample of 0.01.
    assert claims.error_settles(found)[1] == (
        "‖e‖ stays below 0.01 from t = 4.00 (range 3.00 to 7.50) over 19 seeds, never in 1; before t = 5 in 90% of "
        "them. For other bounds (seed 0) 0.05: 0.70, 0.02: 1.61, 0.005: 3.00, 0.001: 4.61. In the run's 80 time units "
        "the error never becomes zero: noise keeps its steady RMS at 0.25 [0.25, 0.25] on x."
    )
    never = material(proposed={"error_settling_time": np.full(SEEDS, math.nan), "rmse": rmse()})
    assert "never in any of 20 seeds" in claims.error_settles(never)[1]


# -- b: fractional sliding mode control takes about 10 ------------------------------------------------------


@pytest.mark.parametrize(
    ("theirs", "mine", "held"),
    [
        (by_seed(10.0), by_seed(2.0), True),
        (by_seed(7.5), by_seed(2.0), True),
        (by_seed(7.49), by_seed(2.0), False),
        (by_seed(12.5), by_seed(2.0), True),
        (by_seed(12.51), by_seed(2.0), False),
        (by_seed(10.0), by_seed(2.0, 11.0), True),
        (by_seed(10.0), by_seed(2.0, 11.0, 11.0), False),
        (by_seed(10.0), by_seed(10.0), False),
        (by_seed(10.0), by_seed(11.0), False),
    ],
)
def test_b_holds_where_the_fractional_one_settles_at_about_10_and_last(
    theirs: np.ndarray, mine: np.ndarray, held: bool
) -> None:
    found = material(proposed={"error_settling_time": mine}, fractional={"error_settling_time": theirs})
    assert verdict("b", found) is held


def test_the_evidence_of_b_is_which_is_slower() -> None:
    mine, theirs = by_seed(2.0, 11.0, 11.0), by_seed(10.0, 9.0)
    found = material(proposed={"error_settling_time": mine}, fractional={"error_settling_time": theirs})
    assert claims.fractional_is_slower(found)[1] == (
        "fractional SMC settles at 10.00 (range 9.00 to 10.00) over 20 seeds, the proposed controller at 2.00 (range "
        "2.00 to 11.00) over 20 seeds; fractional SMC is the slower of the two in 90% of seeds."
    )


# -- c: more accurate than conventional control --------------------------------------------------------------

SPREAD = np.linspace(-1.0, 1.0, SEEDS)  # standard deviation 0.6228: of the mean 0.1393, times t(19) 0.2915
ELSEWHERE = ["transient_x", "transient_y", "steady_x", "steady_y"]


@pytest.mark.parametrize("cell", ELSEWHERE)
@pytest.mark.parametrize(("gain", "held"), [(0.30, True), (0.28, False), (-0.30, False), (0.0, False)])
def test_c_holds_where_the_interval_of_the_saving_excludes_zero_everywhere(cell: str, gain: float, held: bool) -> None:
    found = material(
        proposed={"rmse": rmse(2.0)}, conventional={"rmse": rmse(4.0, **{cell: 2.0 + gain + SPREAD, "whole_x": -9.0})}
    )
    assert verdict("c", found) is held


def test_the_evidence_of_c_is_the_share_saved() -> None:
    found = material(proposed={"rmse": rmse(2.0)}, conventional={"rmse": rmse(4.0, steady_y=2.5 + SPREAD)})
    assert claims.more_accurate_than_conventional(found)[1] == (
        "RMSE saved against conventional fast terminal SMC (negative: lost), paired by seed, with 95 % confidence "
        "interval: transient x +50.0% [+50.0%, +50.0%]; transient y +50.0% [+50.0%, +50.0%]; steady x +50.0% "
        "[+50.0%, +50.0%]; steady y +20.0% [+8.3%, +31.7%]."
    )


# -- d: the surface converges and V falls --------------------------------------------------------------------


@pytest.fixture
def rises(monkeypatch: pytest.MonkeyPatch) -> dict[float, float]:
    """The largest rise of V by step."""
    found = {1e-3: 0.4, 5e-4: 0.2, 2.5e-4: 0.1}
    monkeypatch.setattr(claims, "_lyapunov_rise", lambda _, step: found[step])
    return found


def surfaces(times: np.ndarray) -> Material:
    return material(proposed={"surface_settling_time": times}, conventional={"surface_settling_time": by_seed(8.0)})


@pytest.mark.parametrize(
    ("times", "finest", "held"),
    [
        (by_seed(9.99), 0.1, True),
        (by_seed(9.99, 10.0), 0.1, True),
        (by_seed(9.99, 10.0, 10.0), 0.1, False),
        (by_seed(9.99), 0.101, False),
        (by_seed(40.0), 0.101, False),
    ],
)
def test_d_holds_where_the_surface_is_reached_before_10_and_the_rise_of_v_halves_with_the_step(
    rises: dict[float, float], times: np.ndarray, finest: float, held: bool
) -> None:
    rises[2.5e-4] = finest
    assert verdict("d", surfaces(times)) is held


def test_d_does_not_hold_where_the_first_halving_leaves_more_than_half_the_rise(rises: dict[float, float]) -> None:
    rises.update({1e-3: 0.39, 5e-4: 0.2, 2.5e-4: 0.1})
    assert not verdict("d", surfaces(by_seed(5.0)))


def test_the_evidence_of_d_is_the_rms_on_the_surface_and_the_rises(rises: dict[float, float]) -> None:
    reported = claims.surface_converges(surfaces(by_seed(5.0, math.nan)))[1]
    assert reported == (
        "‖s‖ stays within the layer δ = 0.06 from t = 5.00 (range 5.00 to 5.00) over 19 seeds, never in 1; "
        "conventional: 8.00 (range 8.00 to 8.00) over 20 seeds. After t = 10 the RMS of s is 0.3, 0.4 (seed 0): an "
        "ultimate bound set by the noise, not zero in finite time. Without noise and layer V rises above its lowest "
        "value so far by up to 0.4, 0.2, 0.1 of V(0) at h = 1e-3 and its half and quarter: V never rises in the limit "
        "h -> 0 only."
    )
    rises[2.5e-4] = 0.2
    assert "(45) does not hold for these equations." in claims.surface_converges(surfaces(by_seed(5.0)))[1]


def test_the_largest_rise_is_above_the_least_value_so_far_and_over_the_first() -> None:
    assert claims._largest_rise(np.array([4.0, 1.0, 3.0, 2.0, 2.5])) == 0.5
    assert claims._largest_rise(np.array([4.0, 5.0, 1.0, 1.5])) == 0.25
    assert claims._largest_rise(np.array([4.0, 3.0, 1.0])) == 0.0


@pytest.mark.parametrize(("variant", "falls"), [("corrected", True), ("printed", False)])
def test_v_falls_under_the_corrected_equations_alone(variant: str, falls: bool) -> None:
    coarse, fine = (claims._lyapunov_rise(variant, step) for step in (1e-3, 5e-4))
    assert (fine <= 0.5 * coarse) is falls
    assert (coarse < 0.5) is falls  # relative to V(0)


# -- e: no chattering ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("worst", "held"), [(0.0099, True), (0.01, False), (0.02, False)])
def test_e_holds_where_no_seed_chatters(worst: float, held: bool) -> None:
    chattering = xr.DataArray(np.full((SEEDS, 2), 0.002), dims=["run", "axis"])
    chattering[7, 1] = worst
    force, effort = by_seed(600.0, 700.0), xr.DataArray(np.full((SEEDS, 2), 300.0), dims=["run", "axis"])
    found = material(proposed={"chattering": chattering, "largest_force": force, "effort": effort})
    judged, evidence = claims.no_chattering(found)
    assert judged is held
    assert evidence.startswith(f"largest chattering index over seeds and axes {worst:.2g}; the same controller without")
    assert evidence.endswith("would have 4, the smooth force only 1e-05. The largest |u| is 700, against 300 RMS.")
    without = float(evidence.split("(δ = 0): ")[1].split(";")[0])
    assert 0.1 < without < 1.0  # far more than with the layer


# -- f: the estimates converge -------------------------------------------------------------------------------


def estimates(**changed: np.ndarray) -> dict[str, np.ndarray]:
    base = {"rate_error": by_seed(-0.0049), "damping_error": by_seed(0.05), "stiffness_error": by_seed(0.05)}
    quality = {"rate_error_peak": by_seed(0.03), "rate_settling_time": by_seed(78.9)}
    return {**base, **quality, **changed}


OTHERS = {
    "fractional": {"rate_error_peak": by_seed(0.2), "rate_settling_time": by_seed(79.0)},
    "conventional": {"rate_error_peak": by_seed(0.5), "rate_settling_time": by_seed(3.0, math.nan)},
}


@pytest.mark.parametrize(
    ("changed", "held"),
    [
        ({}, True),
        ({"rate_error": by_seed(-0.0049, 0.2)}, True),
        ({"rate_error": by_seed(-0.0049, 0.0051, -0.0051)}, False),
        ({"rate_error": by_seed(-0.2)}, False),
        ({"damping_error": by_seed(0.05, 0.051)}, True),
        ({"damping_error": by_seed(0.05, 0.051, 0.051)}, False),
        ({"stiffness_error": by_seed(0.05, 0.051, 0.051)}, False),
    ],
)
def test_f_holds_where_each_estimate_is_within_5_percent_in_19_of_20_seeds(
    changed: dict[str, np.ndarray], held: bool
) -> None:
    assert verdict("f", material(proposed=estimates(**changed), **OTHERS)) is held


def test_the_evidence_of_f_is_how_far_off_each_estimate_is_and_under_which_controller() -> None:
    proposed = estimates(damping_error=by_seed(0.04, 2.0, 2.0))
    reported = claims.estimates_converge(material(proposed=proposed, **OTHERS))[1]
    # K h/2 is 355.3, 70.99 and 532.9 times 0.0005.
    assert reported == (
        "at t = 80: Ω̂z off by 0.049 of the true value (median; 100% of seeds within 5 %); D̂ off by 0.04 of the true "
        "value (median; 90% of seeds within 5 %); K̂ off by 0.05 of the true value (median; 100% of seeds within 5 %). "
        "Holding the force for a step h makes the plant look as if damped by K h/2 = 0.18, 0.04, 0.27 (xx, xy, yy) "
        "more, many times the true damping. Peak error of Ω̂z, and share of seeds in which Ω̂z has settled within 10 % "
        "of the true value before the last unit of time: proposed 0.3 × Ωz, 100%; fractional 2 × Ωz, 0%; conventional "
        "5 × Ωz, 95%."
    )
    printed = claims.estimates_converge(material("printed", proposed=estimates(), **OTHERS))[1]
    assert printed.endswith("The skew part of Ω̂ never moves from 0.95 Ωz, under any of the three controllers.")


# -- g: the bounds settle ------------------------------------------------------------------------------------


def bounds(half: np.ndarray, end: np.ndarray) -> Material:
    final = xr.DataArray(np.stack([end, 9 * end, 9 * end], axis=1), dims=["run", "bound"], coords={"bound": [0, 1, 2]})
    return material(proposed={"bound_final": final, "bound_0_halfway": half})


@pytest.mark.parametrize(
    ("half", "end", "held"),
    [(2.0, 2.0198, True), (2.0, 2.02, False), (1.0, 1.01005, False), (2.0, 2.5, False), (2.0, 2.0, True)],
)
def test_g_holds_where_the_bound_grows_by_less_than_1_percent_in_every_seed(
    half: float, end: float, held: bool
) -> None:
    assert verdict("g", bounds(by_seed(2.0, half), by_seed(2.0, end))) is held


def test_the_evidence_of_g_is_the_growth() -> None:
    reported = claims.bounds_settle(bounds(by_seed(2.0), by_seed(2.2)))[1]
    assert reported == (
        "b̂0 grows from 2.000 at t = 40 to 2.200 at t = 80, by 10 [10, 10] %, 5.0e-03 per unit of time. ‖s‖ ≥ 0 under "
        "(44), so under noise b̂ can only grow."
    )


# -- h: the order of least RMSE, in test_reproduce.py --------------------------------------------------------
# -- i: the fractional order costs more ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ratios", "held"), [((1.01,), True), ((1.0,), False), ((0.9, 0.99, 1.5), False), ((0.9, 1.01, 1.02), True)]
)
def test_i_holds_where_the_median_of_paired_timings_is_above_1(ratios: tuple[float, ...], held: bool) -> None:
    cost = StepCost(ratios, tuple(70e-9 for _ in ratios), 19)
    assert claims.costs_more(Material("corrected", {}, {}, cost))[0] is held


def test_the_evidence_of_i_is_the_time_of_a_step_of_each() -> None:
    cost = StepCost((1.2, 1.25, 1.6), (50e-9, 75e-9, 200e-9), 19)
    assert claims.costs_more(Material("corrected", {}, {}, cost))[1] == (
        "a step of the proposed controller takes 1.25 times one of the conventional (range 1.20 to 1.60 over 3 paired "
        "timings), 75 ns against 60 ns, with its 19 exponentials for 20 units of time. With the whole history "
        "summed at every step, as usual, the cost would grow with the run."
    )


def test_a_step_costs_what_the_clock_says_of_the_proposed_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    # In turn 3 seconds for the proposed controller and 2 for the conventional one.
    clock = itertools.accumulate(itertools.cycle([10.0, 3.0, 10.0, 2.0]))
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    cost = time_steps("corrected")
    assert cost.ratios == pytest.approx([1.5] * 7)
    assert cost.seconds == pytest.approx([3.0 / 20_001] * 7)
    assert (
        cost.exponentials
        == core_setup(runs.scenario("corrected", "proposed").replace({"run.duration": 20.0})).kernel.count
    )


# -- All of them ---------------------------------------------------------------------------------------------


def test_a_verdict_is_what_the_criterion_says_of_each_variant(monkeypatch: pytest.MonkeyPatch) -> None:
    judged = {
        "x": ("claim x", "criterion x", lambda m: (m.variant == "printed" and m.cost.exponentials == 3, m.variant))
    }
    monkeypatch.setattr(claims, "CLAIMS", judged)
    found = claims.judge({}, {}, {"printed": StepCost(exponentials=3), "corrected": StepCost(exponentials=4)})
    assert found == [
        claims.Claim("x", "claim x", "printed", "reproduced", "criterion x", "printed"),
        claims.Claim("x", "claim x", "corrected", "not reproduced", "criterion x", "corrected"),
    ]


def test_claims_are_written_as_they_are_worded(tmp_path: Path) -> None:
    claim = claims.Claim("a", "‖e‖ → 0", "printed", "reproduced", "‖e‖ < 1", "Ω̂z")
    write_claims([claim], tmp_path / "claims.json")
    text = (tmp_path / "claims.json").read_text(encoding="utf-8")
    assert json.loads(text) == [asdict(claim)]
    assert '  "claim": "‖e‖ → 0",\n' in text


def test_the_criteria_state_the_thresholds_that_are_judged_by() -> None:
    assert claims.MIN_SHARE == 0.95
    assert claims.ERROR_BOUND == metrics.ERROR_BOUND == 0.01
    for identifier, words in {
        "a": "‖e‖ stays below 0.01 from before t = 5 on, in 95% of seeds",
        "b": "stays below 0.01 between 7.5 and 12.5, and later than the proposed controller's in 95% of seeds",
        "d": "within the boundary layer, 0.06, from before t = 10 on, in 95% of seeds",
        "e": "below 1 % of the RMS of u after t = 10",
        "f": "within 5 % of its true value in 95% of seeds",
        "g": "grows by less than 1 % from t = 40 to t = 80",
    }.items():
        assert words in CLAIMS[identifier][1]
