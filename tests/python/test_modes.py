"""Whole angle, virtual rotation, mode reversal: independent transcriptions, and the shipped example."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from law_oracles import Line, Reversal

ROOT = Path(__file__).resolve().parents[2]
DISC = fg.Scenario.load(ROOT / "examples/scenarios/disc_whole_angle.toml")
# Exact positions and velocities for both, as a law of one's own would get.
KNOWN = {"device.sensing": "full", "run.duration": 600.0, "run.record_every": 1}
DEG_S = np.pi / 180 / DISC.plant.reference_frequency
LAWS: dict[str, tuple[type[Line | Reversal], dict[str, Any]]] = {
    "whole angle": (Line, {"controller.virtual_rate": 1e-3, "controller.start_angle": 0.2}),
    "compensated": (Line, {"controller.damping_compensation": 2e-4, "controller.damping_axis": 1.1}),
    "at the force limit": (Line, {"controller.force_limit": 1e-3, "run.initial_velocity": (0.3, 0.4)}),
    "virtual rotation": (
        Line,
        {"controller.kind": "virtual_rotation", "controller.virtual_rate": 5e-3, "controller.reversal_turns": 0.05}
        | {"controller.angle_bandwidth": 0.2},
    ),
    "reversal by jumps": (
        Reversal,
        {"controller.kind": "mode_reversal", "controller.reversal_interval": 140.0, "controller.settling_time": 60.0},
    ),
    "reversal by swings": (
        Reversal,
        {"controller.kind": "mode_reversal", "controller.reversal_interval": 140.0, "controller.settling_time": 60.0}
        | {"controller.swing_rate": 0.01, "controller.start_angle": 0.3},
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_mode_is_its_transcription_in_complex_numbers(name: str) -> None:
    kind, changes = LAWS[name]
    scenario, law = DISC.replace({**KNOWN, **changes}), kind()
    expected, found = fg.simulate(scenario, law), fg.simulate(scenario)
    scale = np.abs(expected["control"].values).max()
    np.testing.assert_allclose(found["control"], expected["control"], rtol=0, atol=1e-8 * scale)
    np.testing.assert_allclose(found["position"], expected["position"], rtol=0, atol=1e-8)
    for channel in law.reports[0]:
        reported = np.array([report[channel] for report in law.reports])
        near = 1e-8 * max(np.abs(reported).max(), 1e-3)
        np.testing.assert_allclose(found[channel].values[: len(reported)], reported, rtol=0, atol=near, err_msg=channel)
    if "virtual" in name:
        assert len(np.unique(found["virtual_rate_error"])) > 2
    if "reversal" in name:
        assert len(np.unique(found["reversed_bias"])) > 1


def test_the_example_turns_with_the_case_and_reports_rate_and_decay() -> None:
    run = fg.simulate(DISC)
    late = run.isel(time=run["time"].values > 10000.0)
    turned = np.unwrap(late["pattern_angle"].values)
    rate = -(turned[-1] - turned[0]) / float(late["time"][-1] - late["time"][0])
    assert rate / DEG_S == pytest.approx(200.0, abs=0.1)
    assert float(late["rate_estimate"].mean()) / DEG_S == pytest.approx(200.0, abs=0.1)
    assert float(late["decay_rate"].mean()) == pytest.approx(2.5e-7, rel=0.2)  # 1/tau
    figures = fg.metrics.drive(run)
    assert abs(float(figures["amplitude_error"])) < 1e-4
    assert abs(float(figures["phase_error"])) < 1.2
