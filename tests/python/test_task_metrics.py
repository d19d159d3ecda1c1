"""Metrics of a task, on motions whose figures are known in closed form."""

from __future__ import annotations

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from scipy import signal

STEP = fg.Scenario.paper().replace({"reference.kind": ["step", "rest"], "reference.start": 1.0, "run.duration": 30.0})
CHIRP = fg.Scenario.paper().replace(
    {
        "reference.kind": ["chirp", "rest"],
        "reference.frequency": (0.5, 0.0),
        "reference.final_frequency": (6.0, 0.0),
        "reference.end": 60.0,
    }
)


def moved(scenario: fg.Scenario, position: np.ndarray) -> xr.Dataset:
    """A run whose motion on x is this one, nondimensional."""
    run = fg.simulate(scenario)
    unit = scenario.plant.reference_length if scenario.run.units == "SI" else 1.0
    run["position"].loc[{"axis": "x"}] = unit * position
    return run


@pytest.mark.parametrize("height", [0.5, -2.0])
@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_a_second_order_step_has_the_overshoot_and_times_of_the_textbook(height: float, units: str) -> None:
    damping, natural = 0.5, 2.0
    scenario = STEP.replace({"reference.amplitude": (height, 0.0), "reference.offset": (0.3, 0.0), "run.units": units})
    t = np.maximum(scenario.run.step * np.arange(scenario.run.steps + 1) - 1.0, 0.0)
    ringing = natural * np.sqrt(1 - damping**2)
    share = 1 - np.exp(-damping * natural * t) * (
        np.cos(ringing * t) + damping * natural / ringing * np.sin(ringing * t)
    )
    found = fg.metrics.step_response(moved(scenario, 0.3 + height * share)).sel(axis="x")
    unit = scenario.plant.scales.time if units == "SI" else 1.0
    assert found.overshoot == pytest.approx(np.exp(-np.pi * damping / np.sqrt(1 - damping**2)), rel=1e-5)
    rise = np.interp(0.9, share[t < np.pi / ringing], t[t < np.pi / ringing])
    rise -= np.interp(0.1, share[t < np.pi / ringing], t[t < np.pi / ringing])
    assert found.rise_time == pytest.approx(unit * rise, abs=2e-3 * unit)
    assert found.settling_time == pytest.approx(unit * t[np.flatnonzero(np.abs(share - 1) > 0.02)[-1] + 1])
    assert found.final_error == pytest.approx(0.0, abs=1e-9)
    assert found.rise_time.attrs["units"] == ("s" if units == "SI" else "1/omega0")


def test_a_motion_that_never_arrives_has_no_settling_time_and_an_axis_without_a_step_no_figures() -> None:
    t = STEP.run.step * np.arange(STEP.run.steps + 1)
    found = fg.metrics.step_response(moved(STEP, 0.5 * (t > 1)))
    assert np.isnan(found.settling_time).all()
    assert np.isnan(found.rise_time.sel(axis="x"))
    assert found.final_error.sel(axis="x") == pytest.approx(-0.5)
    assert np.isnan(found.overshoot.sel(axis="y"))


def test_the_frequency_response_of_a_filter_is_that_of_the_filter() -> None:
    t = CHIRP.run.step * np.arange(CHIRP.run.steps + 1)
    run = fg.simulate(CHIRP)
    plant = signal.lti([9.0], [1.0, 1.8, 9.0])
    _, answer, _ = signal.lsim(plant, run.reference.sel(axis="x").values, t)
    found = fg.metrics.frequency_response(moved(CHIRP, answer), bands=60).sel(axis="x")
    inside = found.sel(frequency=slice(0.8, 5.5))
    _, expected = signal.freqresp(plant, inside.frequency.values)
    ratio = inside.gain * np.exp(1j * inside.phase)
    assert (abs(ratio - expected) < 0.05 * abs(expected).max()).all()
    assert (inside.coherence > 0.98).all()


def test_an_axis_has_a_response_only_at_the_frequencies_of_its_own_chirp() -> None:
    chirp = {"reference.kind": "chirp", "reference.frequency": (0.5, 2.0), "reference.final_frequency": (2.0, 6.0)}
    found = fg.metrics.frequency_response(fg.simulate(CHIRP.replace(chirp)), bands=40)
    measured = found.gain.notnull()
    assert (found.frequency[measured.sel(axis="x")] <= 2.0).all()
    assert (found.frequency[measured.sel(axis="y")] >= 2.0).all()
    assert (measured.sum("frequency") > 5).all()


def test_the_phase_of_a_drive_does_not_depend_on_the_distance_of_recorded_samples() -> None:
    driven = {"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"], "run.duration": 2000.0}
    scenario = fg.Scenario.shipped("dual_mass").replace(driven)
    every, tenth = (
        float(fg.metrics.drive(fg.simulate(scenario.replace({"run.record_every": n}))).phase_error) for n in (1, 10)
    )
    assert tenth == pytest.approx(every, abs=1e-3)


def test_the_coherence_falls_where_something_else_moves_the_axis() -> None:
    t = CHIRP.run.step * np.arange(CHIRP.run.steps + 1)
    reference = fg.simulate(CHIRP).reference.sel(axis="x").values
    noise = np.random.default_rng(1).standard_normal(len(t))
    found = fg.metrics.frequency_response(moved(CHIRP, reference + 20 * noise), bands=10).sel(axis="x")
    assert (found.coherence < 0.9).all()


@pytest.mark.parametrize("phase", [0.0, 0.1, -0.3])
def test_the_phase_of_a_drive_is_that_of_the_held_force(phase: float) -> None:
    scenario = fg.Scenario.shipped("paper_resonance")
    driven = {"controller.kind": "force_rebalance", "reference.kind": ["sine", "rest"], "run.duration": 200.0}
    run = fg.simulate(scenario.replace(driven))
    angle = run.time.values
    run["drive_frequency"][:] = 1.0
    run["drive_amplitude"][:] = 1.02 * scenario.reference.amplitude[0]
    run["position"].loc[{"axis": "x"}] = np.sin(angle)
    run["control"].loc[{"axis": "x"}] = np.cos(angle + 0.5 * scenario.run.step + phase)
    found = fg.metrics.drive(run)
    assert float(found.phase_error) == pytest.approx(phase, abs=1e-9)
    assert float(found.amplitude_error) == pytest.approx(0.02)
    assert np.isnan(found.amplitude_settling_time)


def test_a_task_that_a_run_has_not_is_named() -> None:
    run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 1.0}))
    with pytest.raises(ValueError, match=r"reference.kind is 'sine': an axis must have a step"):
        fg.metrics.step_response(run)
    with pytest.raises(ValueError, match=r"reference.kind is 'sine': an axis must have a chirp"):
        fg.metrics.frequency_response(run)
    with pytest.raises(ValueError, match=r"controller.kind is fractional_fast_terminal: it must be open_loop or"):
        fg.metrics.drive(run)
    with pytest.raises(ValueError, match=r"the Dataset has 2 runs: select one"):
        fg.metrics.step_response(fg.simulate_many([STEP], seeds=range(2)))
