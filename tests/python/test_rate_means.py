"""Rate estimates averaged during a run, against the averages of its record."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.scenario.to_core import core_setup
from fracgyro.simulation.rate_means import rate_means

PAPER = fg.Scenario.paper().replace({"run.duration": 1.0, "adaptation.kind": "composite"})
DEVICE = PAPER.replace({"device.position_noise": 1e-10, "device.rate_random_walk": 50.0, "device.delay": 1})
SEEDS = [3, 5]


class Reporting:
    """No force, and a speed reported as a rate."""

    def __init__(self) -> None:
        self.reports = 0

    def reset(self, scenario: fg.Scenario) -> None:
        """Nothing is learned, and reports of all runs are counted."""

    def __call__(self, sample: Any) -> tuple[float, float]:
        self.velocity = sample.velocity
        return 0.0, 0.0

    def report(self) -> dict[str, float]:
        self.reports += 1
        return {"other": 1.0, "rate_estimate": self.velocity[0]}


def recorded(scenario: fg.Scenario, every: int, block: int, controller: Any = None) -> np.ndarray:
    """The same from a record, nondimensional."""
    run = fg.simulate_many([scenario.replace({"run.record_every": every})], seeds=SEEDS, controller=controller)
    values = run["rate_estimate"].values[:, :-1]
    count = values.shape[1] // block
    return np.asarray(values[:, : count * block].reshape(len(SEEDS), count, block).mean(axis=2))


@pytest.mark.parametrize("scenario", [PAPER, DEVICE, PAPER.replace({"device.sensing": "position"})])
@pytest.mark.parametrize(("every", "block"), [(1, 100), (4, 25), (7, 9)])
def test_means_of_the_rate_are_those_of_the_record(scenario: fg.Scenario, every: int, block: int) -> None:
    found = rate_means(scenario, SEEDS, every=every, block=block)
    wanted = recorded(scenario, every, block)
    assert found.shape == (2, 1000 // every // block)
    np.testing.assert_allclose(found, wanted, rtol=1e-13)
    assert (found[0] != found[1]).any()


@pytest.mark.parametrize("scenario", [PAPER, DEVICE])
def test_a_controller_from_outside_is_asked_for_its_rate_where_it_counts(scenario: fg.Scenario) -> None:
    controller = Reporting()
    found = rate_means(scenario, SEEDS, every=4, block=25, controller=controller)
    assert controller.reports == 2 * 250
    np.testing.assert_allclose(found, recorded(scenario, 4, 25, Reporting()), rtol=1e-13)


def test_of_an_outside_controller_in_si_units_the_means_are_nondimensional() -> None:
    found = rate_means(PAPER.replace({"run.units": "SI"}), SEEDS, every=4, block=25, controller=Reporting())
    assert np.isfinite(found).all()
    run = fg.simulate(PAPER.replace({"run.units": "SI", "disturbance.seed": 3}), controller=Reporting())
    assert found[0, 0] == pytest.approx(float(run["rate_estimate"][:100:4].mean()) / 1000.0, rel=1e-9)


def test_a_run_that_diverges_has_no_means() -> None:
    wild = PAPER.replace({"adaptation.initial_bound": (1e6, 1e6, 1e6)})
    assert np.isnan(rate_means(wild, SEEDS, every=1, block=10)).all()


def test_a_controller_that_estimates_no_rate_has_none() -> None:
    for device in (False, True):
        with pytest.raises(ValueError, match="the controller estimates no rate"):
            _core.rate_means([core_setup(PAPER.replace({"controller.kind": "pid"}))], 1, 10, 1, device)
