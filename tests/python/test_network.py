"""Network sliding mode: an independent transcription, and what its weights do."""

from __future__ import annotations

from itertools import product
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from in_lanes import assert_lanes_agree
from law_oracles import Network
from nightly import nightly_unless

PAPER = fg.Scenario.paper().replace({"controller.kind": "network", "controller.force_limit": 1000.0})
SHORT = PAPER.replace({"run.duration": 4.0})
NOISE = {"device.position_noise_density": 1e-13, "device.velocity_noise_density": 1e-10}
VARIANTS: dict[str, dict[str, Any]] = {
    "gaussian": {},
    "reference": {"network_inputs": "reference", "nodes": 7, "node_width": 0.4},
    "diagonal": {"layout": "diagonal", "nodes": 9},
    "constant": {"basis": "constant", "learning_frequency": 500.0},
    "linear": {"basis": "linear", "weight_leak": 0.5, "error_leak": 3.0},
    "chebyshev": {"basis": "chebyshev", "polynomial_degree": 4, "switching_force": 5.0},
    "minimal": {"minimal": True, "weight_leak": 0.1, "learning_frequency": 100.0},
    "no model": {"model": False},
    "prediction": {"prediction_weight": 2.0},
    "prediction, fast": {"basis": "linear", "prediction_weight": 50.0, "prediction_rate": 40.0},
    "fuzzy": {"normalized": True, "nodes": 9, "node_width": 0.6},
    "memberships": {"basis": "membership", "nodes": 12, "normalized": True, "node_width": 0.7},
    "inner loop": {"inner_loop": 0.7, "nodes": 8},
    "outer loop": {"outer_loop": 0.9, "basis": "linear"},
    "gate": {"gate": 0.6, "basis": "chebyshev"},
    "moving": {"center_rate": 30.0, "width_rate": 20.0, "nodes": 10},
    "all": {
        **{"basis": "membership", "normalized": True, "inner_loop": 0.4, "outer_loop": 0.3, "gate": 0.5},
        **{"center_rate": 2.0, "width_rate": 0.5, "prediction_weight": 1.0},
    },
}


def variant(scenario: fg.Scenario, name: str) -> fg.Scenario:
    return scenario.replace({f"controller.{field}": value for field, value in VARIANTS[name].items()})


@pytest.mark.parametrize(
    ("name", "limit"),
    nightly_unless(
        lambda name, limit: limit == np.inf or name == next(iter(VARIANTS)), product(VARIANTS, [np.inf, 700.0])
    ),
)
def test_it_is_its_transcription(limit: float, name: str) -> None:
    scenario, law = variant(SHORT.replace({**NOISE, "controller.force_limit": limit}), name), Network()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-8 * scale)


def test_the_constant_basis_is_the_integral_of_integral_sliding_mode() -> None:
    gains = {"controller.surface_gain": 36.0, "controller.reaching_rate": 80.0, **NOISE}
    ours = SHORT.replace({**gains, "controller.basis": "constant", "controller.learning_frequency": 40.0})
    integral = {"controller.integral_rate": 20.0, "controller.disturbance_observer": 0.0}
    theirs = SHORT.replace({"controller.kind": "integral_sliding", **gains, **integral})
    found, expected = (fg.simulate(scenario)["control"].values for scenario in (ours, theirs))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_lanes_and_single_precision() -> None:
    assert_lanes_agree([variant(SHORT, name) for name in VARIANTS])
