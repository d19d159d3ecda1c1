"""Terms that published laws add to the linear surface: an independent transcription, and what each changes."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup
from law_oracles import Backstepping

KNOWN = {"controller.kind": "linear", "controller.adaptive": False}
PAPER = fg.Scenario.paper().replace(KNOWN | {"run.duration": 3.0})
TUNED = {
    "controller.fractional_gain": 30.0,
    "controller.layer_thickness": 2.0,
    "adaptation.initial_bound": [200.0, 0.0, 0.0],
}
OPTIONS: dict[str, dict[str, Any]] = {
    "none": {},
    "coupling": {"controller.coupling": 400.0},
    "integral": {"controller.error_integral": 500.0},
    "global": {"controller.start_rate": 3.0},
    "dynamic": {"controller.surface_filter": 5e-3},
}
OPTIONS["all"] = {name: value for each in OPTIONS.values() for name, value in each.items()}


@pytest.mark.parametrize("limit", [np.inf, 400.0])
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_it_is_its_transcription(options: dict[str, Any], limit: float) -> None:
    scenario, law = PAPER.replace(TUNED | options | {"controller.force_limit": limit}), Backstepping()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    assert (law.reached > 0) == (limit < np.inf)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-9 * scale)


def test_backstepping_is_the_linear_surface_within_a_percent() -> None:
    """With the laws (44), at the gains that tuning chooses: c1 c2 = 3000 against the term of 1."""
    learns = PAPER.replace(TUNED | {"controller.adaptive": True, "run.duration": 10.0})

    def error(coupling: float) -> float:
        run = fg.simulate(learns.replace({"controller.coupling": coupling}))
        return float(np.sqrt((run["error"].values[5000:] ** 2).mean()))

    assert error(1.0) == pytest.approx(error(0.0), rel=0.01)
    assert error(1.0) != error(0.0)


def test_lanes_and_single_precision() -> None:
    setups = [core_setup(PAPER.replace(TUNED | options)) for options in OPTIONS.values()]
    params = _core.MetricsParams()
    separate = _core.measure_runs(setups, params, 1, 1, False)
    for lanes in _core.lane_counts():
        np.testing.assert_array_equal(_core.measure_runs(setups, params, 1, lanes, False), separate)
    single = _core.measure_runs(setups, params, 1, max(_core.lane_counts()), True)
    np.testing.assert_allclose(single[:, :4], separate[:, :4], rtol=0.01)
