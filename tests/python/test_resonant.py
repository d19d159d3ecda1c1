"""Resonant control: an independent transcription, and the closed loop on devices that are not as it believes."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup
from law_oracles import Resonant

STEPS = 4000
SHORT = fg.Scenario.paper().replace({"controller.kind": "resonant", "run.duration": STEPS * 1e-3})
QUIET = {"disturbance.kind": "none", "disturbance.hold": None, "disturbance.standard_deviation": None}
NO_INTEGRAL = {"controller.integral_frequency": 0.0, "controller.resonator_gain": 5.0}
TERMS = [
    {"amplitude": (0.5, 0.2), "frequency": (2.0, 3.0), "phase": (0.3, 1.0)},
    {"amplitude": (0.2, 0.3), "frequency": (5.0, 2.0)},
]
FREQUENCIES = {"sine": [np.pi, np.pi / 2], "sines": [2.0, 5.0, 3.0], "step": []}
REFERENCES: dict[str, dict[str, Any]] = {
    "sine": {},
    "sines": {"reference.kind": "sines", "reference.terms": TERMS},
    "step": {"reference.kind": "step", "reference.start": 0.5, "reference.smoothing": 0.1},
}


@pytest.mark.parametrize("integral", [0.0, 3.0])
@pytest.mark.parametrize("limit", [np.inf, 700.0])
@pytest.mark.parametrize("reference", REFERENCES)
def test_it_is_its_transcription_in_a_fixed_frame(reference: str, limit: float, integral: float) -> None:
    changes = {**REFERENCES[reference], "controller.force_limit": limit, "controller.integral_frequency": integral}
    scenario, law = SHORT.replace(changes), Resonant(FREQUENCIES[reference])
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(found["position"], expected["position"], rtol=0, atol=1e-10)


def late(changes: dict[str, Any], after: float = 16.0) -> float:
    run = fg.simulate(SHORT.replace({**QUIET, **NO_INTEGRAL, "run.duration": 20.0, **changes}))
    return float(fg.metrics.rmse(run, (after, None)).max())


@pytest.mark.parametrize("reference", ["sine", "sines"])
def test_with_stiffness_and_damping_off_by_ten_percent_no_error_is_left(reference: str) -> None:
    off = {**REFERENCES[reference], "adaptation.initial_ratio": 0.9}
    assert late({**off, "controller.resonator_gain": 0.0}) > 2e-4
    assert late(off) < 1e-11


@pytest.mark.parametrize("changes", [REFERENCES["step"], {"controller.resonator_gain": 0.0}], ids=["step", "no gain"])
def test_without_resonators_it_has_the_run_of_the_pid(changes: dict[str, Any]) -> None:
    resonant = SHORT.replace(changes)
    pid = fg.simulate(resonant.replace({"controller.kind": "pid"}))
    np.testing.assert_array_equal(fg.simulate(resonant)["control"], pid["control"])


# Gains tuned for noise of 1e-13 m/sqrt(Hz) and chattering of 0.0035 (docs/decisions/0046).
TUNED = {
    "full": {"natural_frequency": 65.0, "integral_frequency": 0.0, "damping_ratio": 1.1, "resonator_gain": 1.2},
    "position": {
        "natural_frequency": 58.0,
        "integral_frequency": 0.0,
        "damping_ratio": 0.6,
        "resonator_gain": 1.2,
        "observer_bandwidth": 113.0,
    },
}


def tuned(sensing: str) -> fg.Scenario:
    noise = {"device.position_noise_density": 1e-13, "device.sensing": sensing}
    noise |= {"device.velocity_noise_density": 1e-10} if sensing == "full" else {}
    gains = {f"controller.{name}": value for name, value in TUNED[sensing].items()}
    return SHORT.replace({**noise, **gains, "controller.force_limit": 1000.0, "run.duration": 20.0})


@pytest.mark.parametrize("sensing", ["full", "position"])
def test_it_bears_what_nobody_stated(sensing: str) -> None:
    def error(changes: dict[str, Any]) -> float:
        runs = fg.simulate_many([tuned(sensing).replace(changes)], seeds=range(3))
        return float(np.sqrt((runs["error"].values[:, 10_000:] ** 2).mean()))

    known = error({})
    assert known < (4e-5 if sensing == "full" else 9e-5)
    assert error({"device.delay": 1}) < 1.1 * known
    stiffer = {"plant.stiffness_deviation": {"xx": 3.2, "xy": 0.64, "yy": 4.8}}
    assert error(stiffer) < 1.05 * known


def test_lanes_with_other_frequencies_keep_their_own() -> None:
    pairs = [(1.0, 2.0), (2.0, 2.0), (3.0, 0.0), (0.5, 2000.0), (2.0, 2.001)]
    setups = [
        core_setup(SHORT.replace({**changes, "reference.frequency": pair, "run.duration": 1.0}))
        for changes in ({}, {"device.sensing": "full"})
        for pair in pairs
    ]
    params = _core.MetricsParams()
    separate = _core.measure_runs(setups, params, 1, 1, False)
    for lanes in _core.lane_counts():
        np.testing.assert_array_equal(_core.measure_runs(setups, params, 1, lanes, False), separate)


def test_after_a_long_time_at_the_limit_it_tracks_within_a_few_time_constants() -> None:
    # The plant is pushed with more force than the actuator has for 5 units of time.
    pushed = {"disturbance.kind": "step", "disturbance.amplitude": (900.0, 900.0), "disturbance.end": 5.0}
    pushed |= {"disturbance.hold": None, "disturbance.standard_deviation": None, "controller.force_limit": 600.0}
    run = fg.simulate(SHORT.replace({**pushed, **NO_INTEGRAL, "run.duration": 12.0}))
    at_limit = np.abs(run["control"].values).max(axis=1) == 600.0
    assert at_limit[:5000].mean() > 0.5
    assert np.abs(run["error"].values[9000:]).max() < 1e-5


def test_single_precision_tracks_as_double_does() -> None:
    setups = [core_setup(SHORT.replace({**QUIET, "run.duration": 20.0}))]
    params = _core.MetricsParams()
    single = _core.measure_runs(setups, params, 1, max(_core.lane_counts()), True)
    names = list(fg.analysis.metric_names.COLUMNS)
    assert single[0, names.index("rmse_steady_x")] < 1e-6
