"""Boundedness: divergence of a sampled loop whose bounds grow in noise, limits of the bounds, and conditions for
exports.

The runs here have the paper's noise. Bounds that grow FAST, ten times as fast as the paper's, come in some 300 units of
time to where the paper's come in some 4000.
"""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.export.firmware import coefficients_header
from fracgyro.scenario.bounded import check_bounded, gain, is_bounded
from fracgyro.scenario.shipped import COMMON, SHIPPED, shipped_text
from fracgyro.scenario.table import toml_value

ROOT = Path(__file__).resolve().parents[2]
PAPER = fg.Scenario.paper()
LIMITED = PAPER.replace({"controller.switching_limit": 0.5})
FAST = {"adaptation.bound_gain": (10.0, 16.0, 16.0), "run.duration": 420.0}
KINDS = ["fractional_fast_terminal", "fractional", "fast_terminal", "linear"]
ADAPTATIONS = ["gradient", "composite"]
INF = math.inf


def gains(scenario: fg.Scenario, run: xr.Dataset) -> np.ndarray:
    """rho h/delta at every sample, from the record."""
    sizes = [np.hypot(*run[name].values.T) for name in ("position", "velocity")]
    samples = zip(run["bound_estimate"].values, *sizes, strict=True)
    return np.array([gain(scenario, b, q, v) for b, q, v in samples])


# -- The loop ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("single", [False, True])
def test_bounds_that_grow_in_noise_end_every_loop_and_limited_ones_none(single: bool) -> None:
    cases = [
        PAPER.replace(
            {**FAST, "controller.kind": kind, "adaptation.kind": adaptation, "controller.switching_limit": limit}
        )
        for kind, adaptation, limit in itertools.product(KINDS, ADAPTATIONS, [INF, 0.5])
    ]
    runs = fg.measure_many(cases, single_precision=single)
    free, limited = runs.isel(run=slice(0, None, 2)), runs.isel(run=slice(1, None, 2))
    assert free["diverged_at"].notnull().all()
    assert limited["diverged_at"].isnull().all()
    assert (limited["rmse"].sel(window="steady") < 1e-3).all()
    assert (limited["bound_final"] <= 30 * (1 + 1e-6)).all()  # 0.5 delta/h


@pytest.mark.parametrize("kind", ["fast_terminal", "linear"])
def test_the_papers_own_bounds_end_the_loop_after_seconds_of_its_device(kind: str) -> None:
    long = PAPER.replace({"controller.kind": kind, "run.duration": 6000.0, "run.record_every": 1000})
    with pytest.raises(fg.DivergedError, match=r"at t = [345]\d{3}.*so that rho h/delta was") as caught:
        fg.simulate(long)
    # Long before, while the loop is still stable, it approaches 2, or in the terminal surface's steep middle somewhat
    # below.
    before = caught.value.run.isel(time=slice(None, -900))
    assert abs(before["error"].values[-1000:]).max() < 1e-3
    assert 1.2 < gains(long, before)[-1] < 2.1
    limited = long.replace({"controller.switching_limit": 0.5})
    run = fg.simulate(limited)
    assert abs(run["error"].values[-1000:]).max() < 1e-3
    found = gains(limited, run)
    assert found.max() == 0.5
    assert (found[3000:] == 0.5).all(), "at rest at the limit"


@pytest.mark.parametrize(
    ("changes", "threshold"),
    [
        ({}, 2 - 10 * 1e-3),
        ({"controller.fractional_gain": 100.0}, 2 - 100 * 1e-3),
        ({"run.step": 5e-4, "controller.layer_thickness": 0.02}, 2 - 10 * 5e-4),
        ({"controller.kind": "fractional", "controller.fractional_gain": 200.0}, None),
    ],
)
def test_the_threshold_is_that_of_the_equations(changes: dict[str, object], threshold: float | None) -> None:
    """Known parameters, frozen bounds, no noise: below it s decays, above it rings out of the layer for ever."""
    still = PAPER.replace(
        {
            "controller.kind": "linear",
            "controller.adaptive": False,
            "disturbance.kind": "none",
            "run.initial_position": (1e-6, 1.0),
            "run.initial_velocity": (math.pi, 0.0),
            "run.duration": 20.0,
            **changes,
        }
    )
    c, h = still.controller, still.run.step
    if threshold is None:  # h^(2-alpha) lambda1 times the fractional derivative's gain at the sampling's limit
        harmonics = np.arange(1, 20001, 2.0)
        alpha = c.order
        at = (h / math.pi) ** (1 - alpha) * 8 / math.pi**2
        derivative = at * math.sin(0.5 * math.pi * alpha) * np.sum(harmonics ** (alpha - 3))
        integral = -at * h / math.pi * math.cos(0.5 * math.pi * alpha) * np.sum(harmonics ** (alpha - 4))
        threshold = (2 - c.fractional_gain[0] * h * derivative) / (1 + c.fractional_gain[0] * integral)
        assert 1.92 < threshold < 1.94

    def rings(slope: float) -> bool:
        b0 = slope * c.layer_thickness / h
        run = fg.simulate(still.replace({"adaptation.initial_bound": (b0, 0.0, 0.0)}))
        return bool(np.hypot(*run["surface"].values[-100:].T).max() > c.layer_thickness)

    assert not rings(threshold - 2e-3)
    assert rings(threshold + 2e-3)


def test_a_limit_that_is_not_reached_changes_no_bit() -> None:
    changes = {"run.duration": 20.0, "adaptation.kind": "composite"}
    free, limited = (fg.simulate(s.replace(changes)) for s in (PAPER, LIMITED))
    assert gains(PAPER.replace(changes), free).max() < 0.5
    for name in ("control", "position", "bound_estimate"):
        assert free[name].values.tobytes() == limited[name].values.tobytes(), name


def test_runs_with_and_without_the_limit_share_no_block() -> None:
    pair = [PAPER.replace({**FAST, "run.duration": 20.0, "controller.switching_limit": x}) for x in (INF, 0.01)] * 4
    runs = fg.measure_many(pair)
    for i, scenario in enumerate(pair[:2]):
        single = fg.metrics.summary(fg.simulate(scenario))["bound_final"].values
        np.testing.assert_allclose(runs["bound_final"].values[i::2], np.tile(single, (4, 1)), rtol=1e-6)
    assert runs["bound_final"].values[1].max() == pytest.approx(0.6)


# -- Cause of a divergence -----------------------------------------------------------------------------------


@pytest.mark.parametrize("units", ["nondimensional", "SI"])
def test_a_run_that_its_bounds_ended_says_so(units: str) -> None:
    with pytest.raises(fg.DivergedError) as caught:
        fg.simulate(PAPER.replace({**FAST, "controller.kind": "linear", "run.units": units}))
    said = str(caught.value)
    assert "the bound estimates had grown to [" in said
    assert "controller.switching_limit = 0.5 bounds them" in said
    assert float(said.partition("rho h/delta was ")[2].partition(",")[0]) > 1.9
    assert "run.step" not in said


def test_a_run_that_its_step_ended_says_so() -> None:
    with pytest.raises(fg.DivergedError, match=r"run\.step is 0\.01/ω0, which is too long for these gains"):
        fg.simulate(PAPER.replace({"run.step": 1e-2, "disturbance.hold": 1e-2}))


# -- Conditions for exports ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "bounded"),
    [
        ({}, False),
        ({"controller.switching_limit": 1.0}, True),
        ({"controller.switching_limit": 1.01}, False),
        ({"controller.adaptive": False}, True),
        ({"controller.adaptive": False, "controller.layer_thickness": 0.0}, True),
        ({"controller.layer_thickness": 0.0}, False),
        ({"controller.force_limit": 6000.0}, False),  # rings within it
        ({"adaptation.leakage": 0.1}, False),  # the noise decides
        ({"adaptation.dead_zone": 0.1}, False),  # likewise
        ({"adaptation.bound_gain": (1e-9, 1e-9, 1e-9)}, False),  # later
        ({"disturbance.kind": "none"}, False),  # not of the hardware
        # At p = 19, b = 5.8, 5.9, 6.0 and on the reference rho = 5.8 + 5.9 sqrt(2) + 6.0 pi sqrt(5)/2 = 35.2, of 60.
        ({"adaptation.projection": 19.0}, True),
        ({"adaptation.projection": 40.0}, False),
        ({"adaptation.projection": 19.0, "run.step": 2e-3, "disturbance.hold": 2e-3}, False),
    ],
)
def test_bounded_is_what_cannot_grow_to_where_the_loop_diverges(changes: dict[str, object], bounded: bool) -> None:
    assert is_bounded(PAPER.replace(changes)) is bounded


def test_an_unbounded_controller_is_exported_only_if_asked_for(tmp_path: Path) -> None:
    said = "controller.switching_limit is inf: it must be at most 1 for a controller that runs indefinitely"
    for export in (fg.export.firmware, fg.export.fmu, fg.export.web):
        with pytest.raises(fg.ScenarioError, match=said):
            export(PAPER, tmp_path / "out")
    assert not list(tmp_path.iterdir())
    fg.export.firmware(PAPER, tmp_path / "firmware", unbounded=True)
    fg.export.web(PAPER, tmp_path / "paper.json", unbounded=True)
    fg.export.web(LIMITED, tmp_path / "limited.json")
    assert json.loads((tmp_path / "paper.json").read_text())["settings"]["controller.switching_limit"] is None
    assert json.loads((tmp_path / "limited.json").read_text())["settings"]["controller.switching_limit"] == 0.5
    with pytest.raises(fg.ScenarioError, match=r"controller\.layer_thickness is 0\.0: it must be greater than 0"):
        check_bounded(PAPER.replace({"controller.layer_thickness": 0.0}), unbounded=False)


@pytest.mark.parametrize("target", ["firmware", "fmu", "web"])
def test_the_command_line_says_it_in_one_sentence(
    target: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    PAPER.save(tmp_path / "paper.toml")
    arguments = ["export", target, str(tmp_path / "paper.toml"), "--out", str(tmp_path / "out")]
    refused = CliRunner().invoke(cli, arguments)
    assert isinstance(refused.exception, fg.ScenarioError)  # which `main` turns into one sentence and code 2
    assert "--unbounded" in str(refused.exception)
    assert not (tmp_path / "out").exists()
    if target != "fmu":  # which takes a compiler
        assert CliRunner().invoke(cli, [*arguments, "--unbounded"]).exit_code == 0


def test_a_limit_without_a_layer_is_refused() -> None:
    with pytest.raises(fg.ScenarioError, match=r"controller\.switching_limit is 0\.5: it must be inf when"):
        LIMITED.replace({"controller.layer_thickness": 0.0})


# -- Shipped scenarios for hardware --------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_scenario_has_what_hardware_needs(name: str) -> None:
    common = fg.Scenario.from_toml(
        (ROOT / f"python/fracgyro/scenario/shipped/{COMMON}.toml").read_text(encoding="utf-8")
    )
    scenario = fg.Scenario.shipped(name)
    assert is_bounded(scenario)
    text = shipped_text(name)
    for table, fields in common.model_dump(exclude_unset=True).items():
        assert text.count(f"[{table}]") == 1
        for field, value in fields.items():
            assert getattr(getattr(scenario, table), field) == value
            assert f"\n{field} = {toml_value(value)}\n" in text
    assert "switching_limit" in common.controller.model_fields_set


def test_the_preset_for_hardware_is_the_papers_with_limits() -> None:
    limits = {"controller.force_limit": 6000.0, "controller.switching_limit": 0.5}
    assert fg.Scenario.shipped("hardware") == PAPER.replace(
        {**limits, "guard.checked": True, "run.kernel_tolerance": 3e-5}
    )
    for variant in ("printed", "corrected"):
        assert fg.Scenario.paper(variant).controller.switching_limit == INF


def test_the_tuned_scenario_is_bounded_and_over_the_papers_time_runs_as_it_was_tuned() -> None:
    tuned = fg.Scenario.load(ROOT / "examples/scenarios/tuned.toml")
    assert is_bounded(tuned)
    assert coefficients_header(tuned, "float")
    free = tuned.replace({"controller.switching_limit": INF, "controller.force_limit": INF})
    assert fg.simulate(tuned)["control"].values.tobytes() == fg.simulate(free)["control"].values.tobytes()
