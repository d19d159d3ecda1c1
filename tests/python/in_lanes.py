"""A law in lanes and in single precision."""

from __future__ import annotations

import fracgyro as fg
import numpy as np
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup


def assert_lanes_agree(scenarios: list[fg.Scenario]) -> None:
    """Metrics of runs in lanes have the bits of single runs; in single precision those of the first are within 1 %."""
    setups, params = [core_setup(scenario) for scenario in scenarios], _core.MetricsParams()
    separate = _core.measure_runs(setups, params, 1, 1, False)
    for lanes in _core.lane_counts():
        np.testing.assert_array_equal(_core.measure_runs(setups, params, 1, lanes, False), separate)
    single = _core.measure_runs(setups[:1], params, 1, max(_core.lane_counts()), True)
    np.testing.assert_allclose(single[0, :4], separate[0, :4], rtol=0.01)
