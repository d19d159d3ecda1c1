"""Runs side by side in lanes equal single runs, whatever lies beside them, with any number of lanes and threads."""

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.setup import core_setup

PAPER = fg.Scenario.paper().replace({"run.duration": 3.0})
LANES = _core.lane_counts()


def measure(scenarios: list[fg.Scenario], lanes: int, threads: int = 1, single: bool = False) -> np.ndarray:
    params = _core.MetricsParams()
    params.transient = 1.0
    return _core.measure_runs([core_setup(s) for s in scenarios], params, threads, lanes, single)


def varied(count: int) -> list[fg.Scenario]:
    """Runs that differ in every way that the lanes of one block can, and in some that they cannot."""
    random = np.random.default_rng(7)
    scenarios = []
    for i in range(count):
        step = float(random.choice([1e-3, 5e-4]))
        scenarios.append(
            PAPER.replace(
                {
                    "controller.kind": str(random.choice(["fractional_fast_terminal", "fast_terminal", "fractional"])),
                    "controller.order": float(random.choice([0.0, 1.0, *random.uniform(0.05, 0.95, 6)])),
                    "controller.terminal_exponent": float(random.choice([0.5, random.uniform(0.3, 0.9)])),
                    "controller.fractional_gain": tuple(random.uniform(5, 15, 2).tolist()),
                    "controller.layer": str(random.choice(["linear", "quadratic"])),
                    "controller.rate_law": str(random.choice(["skew", "printed"])),
                    "controller.derivative": str(random.choice(["caputo", "riemann_liouville"])),
                    "controller.force_limit": float(random.choice([1e3, np.inf])),
                    "adaptation.leakage": float(random.choice([0.0, 0.1])),
                    "adaptation.dead_zone": float(random.choice([0.0, 0.02])),
                    "reference.frequency": tuple(random.uniform(1, 3, 2).tolist()),
                    "plant.angular_rate": float(random.uniform(50, 150)),
                    "disturbance.kind": str(random.choice(["noise", "none"])),
                    "disturbance.hold": float(random.choice([1, 2, 5])) * step,
                    "disturbance.seed": i,
                    "run.step": step,
                    "run.duration": float(random.choice([1.5, 3.0])),
                }
            )
        )
    return scenarios


@pytest.mark.parametrize("lanes", LANES)
def test_runs_in_lanes_equal_single_runs_to_rounding(lanes: int) -> None:
    scenarios = varied(24)
    found = measure(scenarios, lanes)
    names = list(_core.metric_names)
    for scenario, row in zip(scenarios, found, strict=True):
        full = fg.metrics.summary(fg.simulate(scenario), transient=1.0)
        for i, axis in enumerate("xy"):
            for window in ("whole", "transient", "steady"):
                single = full["rmse"].sel(window=window).values[i]
                np.testing.assert_allclose(row[names.index(f"rmse_{window}_{axis}")], single, rtol=1e-9)
            np.testing.assert_allclose(row[names.index(f"effort_{axis}")], full["effort"].values[i], rtol=1e-9)
        for name in ("rate_error", "rate_error_peak", "damping_error", "stiffness_error", "bound_0_halfway"):
            np.testing.assert_allclose(row[names.index(name)], full[name].values, rtol=1e-8, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("lanes", LANES)
def test_the_number_of_threads_changes_no_bit(lanes: int) -> None:
    scenarios = varied(17)
    np.testing.assert_array_equal(measure(scenarios, lanes, threads=1), measure(scenarios, lanes, threads=3))


@pytest.mark.parametrize("lanes", LANES)
def test_a_run_is_not_disturbed_by_those_beside_it(lanes: int) -> None:
    calm = [PAPER.replace({"disturbance.seed": seed}) for seed in range(lanes - 1)]
    wild = PAPER.replace({"controller.fractional_gain": 3000.0})
    alone = measure(calm, lanes)
    beside = measure([wild, *calm], lanes)
    assert np.isfinite(beside[0, -1])  # diverged
    assert 0 < beside[0, -1] < 3.0
    np.testing.assert_array_equal(beside[1:], alone)


@pytest.mark.parametrize("lanes", LANES)
def test_noise_drawn_once_for_many_runs_changes_no_bit(lanes: int) -> None:
    scenarios = [
        PAPER.replace({"controller.order": order, "disturbance.seed": seed})
        for order in np.linspace(0.1, 1.0, 11).tolist()
        for seed in range(3)
    ]
    alone = [measure([scenario], lanes)[0] for scenario in scenarios]
    np.testing.assert_array_equal(measure(scenarios, lanes, threads=2), alone)


def test_all_widths_agree() -> None:
    results = [measure(varied(9), lanes) for lanes in LANES]
    for other in results[1:]:
        np.testing.assert_allclose(other, results[0], rtol=1e-7, atol=1e-12)


def test_runs_that_all_diverge_end_early() -> None:
    wild = [PAPER.replace({"controller.fractional_gain": 3000.0, "disturbance.seed": seed}) for seed in range(5)]
    metrics = fg.simulate_many(wild, metrics_only=True)
    for i, scenario in enumerate(wild):
        with pytest.raises(fg.DivergedError) as caught:
            fg.simulate(scenario)
        np.testing.assert_allclose(metrics["diverged_at"].values[i], len(caught.value.run["time"]) * 1e-3)


def test_a_width_that_the_processor_lacks_is_refused() -> None:
    with pytest.raises(ValueError, match="lanes"):
        measure([PAPER], 3)


@pytest.mark.parametrize("lanes", LANES)
def test_single_precision_has_the_metrics_of_double_precision_to_its_rounding(lanes: int) -> None:
    scenarios = [
        PAPER.replace({"controller.order": order, "controller.terminal_exponent": exponent, "disturbance.seed": seed})
        for order, exponent in ((0.9, 0.5), (0.5, 0.6), (1.0, 0.5))
        for seed in range(6)
    ]
    double, single = (measure(scenarios, lanes, single=s) for s in (False, True))
    names = list(_core.metric_names)
    for name, rtol in (("rmse_whole_x", 0.01), ("rmse_transient_y", 0.01), ("effort_x", 1e-3), ("largest_force", 0.01)):
        np.testing.assert_allclose(single[:, names.index(name)], double[:, names.index(name)], rtol=rtol, err_msg=name)
    steady = [names.index(name) for name in ("rmse_steady_x", "rmse_steady_y", "rate_error_rms")]
    np.testing.assert_allclose(single[:, steady], double[:, steady], rtol=0.1)
    assert np.any(single != double)
    np.testing.assert_array_equal(measure(scenarios, lanes, threads=3, single=True), single)


def test_recorded_runs_are_in_double_precision() -> None:
    with pytest.raises(ValueError, match="single_precision is True without metrics_only"):
        fg.simulate_many([PAPER], single_precision=True)
