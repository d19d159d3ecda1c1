"""The same bits on every processor that NumPy, OpenBLAS and glibc emulate here, and in lanes of any width."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from fracgyro import _core
from fracgyro.analysis.metric_names import COLUMNS
from fracgyro.cli import cli
from fracgyro.export import parity
from fracgyro.scenario.to_core import core_setup
from nightly import nightly_unless
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

# Prints a hash of everything that has promised bits, by name.
EVERYTHING = Path(__file__).with_name("everything_promised.py")
KERNELS = ["Haswell", "SkylakeX", "Nehalem", "Sandybridge", "Zen", "Prescott"]  # OpenBLAS kernels
DISPATCHED = [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]  # NumPy's, above its baseline
SETTINGS = {
    **{f"OpenBLAS for {name}": {"OPENBLAS_CORETYPE": name} for name in KERNELS},
    "NumPy without vectors": {"NPY_DISABLE_CPU_FEATURES": " ".join(DISPATCHED)},
    "glibc without vectors": {
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX2_Usable,-FMA,-FMA_Usable,-FMA4,-AVX512F,-AVX512VL,-AVX512DQ"
    },
}


def in_python(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    mine = {name: value for name, value in os.environ.items() if name not in {k for s in SETTINGS.values() for k in s}}
    return subprocess.run(
        [sys.executable, *words], env={**mine, **environment}, capture_output=True, text=True, timeout=300
    )


def hashes(environment: dict[str, str]) -> dict[str, str]:
    ran = in_python(environment, str(EVERYTHING))
    assert ran.returncode == 0, ran.stderr
    found: dict[str, str] = json.loads(ran.stdout)
    return found


@pytest.fixture(scope="session")
def as_found() -> dict[str, str]:
    return hashes({})


# Haswell fuses products and sums.
ALWAYS = ("OpenBLAS for Haswell", "NumPy without vectors")


@pytest.mark.parametrize("name", nightly_unless(lambda name: name in ALWAYS, SETTINGS))
def test_no_promised_bit_depends_on_the_processor_that_libraries_see(name: str, as_found: dict[str, str]) -> None:
    # NumPy tries a product when it is imported.
    if in_python(SETTINGS[name], "-c", "import numpy").returncode in (-signal.SIGILL, -signal.SIGSEGV):
        pytest.skip(f"{SETTINGS[name]}: this processor lacks the instructions")
    found = hashes(SETTINGS[name])
    assert len(found) > 30
    assert [what for what in as_found if found[what] != as_found[what]] == []


def test_the_settings_do_change_what_numpy_computes() -> None:
    """NumPy's own exp differs between its widest vectors and none; otherwise the test above proves nothing."""
    if not DISPATCHED:
        pytest.skip("NumPy has one code path for this processor")
    code = "from numpy._core._multiarray_umath import __cpu_features__ as f; print(sorted(n for n in f if f[n]))"
    all_on, off = (in_python(environment, "-c", code).stdout for environment in ({}, SETTINGS["NumPy without vectors"]))
    assert all_on
    assert all_on != off


# -- Lanes ---------------------------------------------------------------------------------------------------


CHAOTIC = fg.Scenario.paper().replace({"run.duration": 3.0})
RUNS = [
    CHAOTIC.replace({**changes, "disturbance.seed": seed})
    for changes in (
        {},
        {"controller.order": 0.3, "controller.terminal_exponent": 0.1},
        {"controller.kind": "fast_terminal", "controller.terminal_exponent": 0.2},
        {"controller.kind": "linear", "controller.force_limit": 900.0},
        {"adaptation.kind": "composite", "adaptation.forgetting": 0.1},
        {"adaptation.kind": "joint", "adaptation.forgetting": 0.1, "controller.kind": "linear"},
        {"controller.kind": "super_twisting", "run.duration": 2.5},
        {"controller.kind": "nonsingular_terminal", "run.duration": 2.0},
        {"controller.kind": "force_rebalance", "controller.force_limit": 900.0},
        {"controller.fractional_gain": 3000.0},  # diverges
    )
    for seed in range(9)
]


def measured(lanes: int, single: bool) -> np.ndarray:
    params = _core.MetricsParams()
    params.transient = 1.0
    rows: np.ndarray = _core.measure_runs([core_setup(s) for s in RUNS], params, 1, lanes, single)
    return rows


# One lane: every run by itself.
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("lanes", [1, *_core.lane_counts()])
def test_lanes_of_every_width_have_the_same_bits(lanes: int, single: bool) -> None:
    assert measured(lanes, single).tobytes() == measured(2, single).tobytes()


@pytest.mark.parametrize("lanes", [1, *_core.lane_counts()])
def test_a_run_in_a_lane_has_the_bits_of_a_single_run(lanes: int) -> None:
    """Compares the metrics that do not depend on an order of additions."""
    names, rows = COLUMNS, measured(lanes, False)
    for scenario, row in zip(RUNS, rows, strict=True):
        if not np.isnan(row[names.index("diverged_at")]):
            continue
        run = fg.simulate(scenario)
        rate = run["rate_estimate"].values - scenario.plant.nondimensional()[2]
        assert row[names.index("rate_error")] == rate[-1]
        assert row[names.index("rate_error_peak")] == np.abs(rate).max()
        if "bound_estimate" in run:
            assert row[names.index("bound_0_halfway")] == run["bound_estimate"].values[len(rate) // 2, 0]
        assert row[names.index("largest_force")] == np.abs(run["control"].values).max()
        limit = scenario.controller.force_limit
        assert row[names.index("saturated_share")] == (np.abs(run["control"].values) >= limit).any(axis=-1).mean()


# -- The published hashes -----------------------------------------------------------------------------------


def test_this_installation_has_the_published_bits() -> None:
    said = CliRunner().invoke(cli, ["selfcheck", "--json"])
    found = json.loads(said.output)
    assert found["hashes"] == parity.PUBLISHED
    assert found["sound"] is True
    assert said.exit_code == 0


def test_the_published_hashes_are_those_of_the_committed_log() -> None:
    log = (Path(__file__).resolve().parents[2] / "benchmarks/results/parity.md").read_text(encoding="utf-8")
    for number, published in parity.PUBLISHED.items():
        assert f"## {number}: `{published}`" in log


def test_the_command_names_what_it_checked_and_fails_where_a_bit_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parity, "SCENARIO", fg.Scenario.paper().replace({"run.duration": 0.2}))
    said = CliRunner().invoke(cli, ["selfcheck"])
    assert said.exit_code == 1
    first, second, *hashes = said.output.splitlines()
    assert first.startswith("fracgyro ")
    assert _core.compiler in first
    assert second == f"processor: {parity.processor()}; lanes of " + ", ".join(
        f"{8 * count} bytes" for count in _core.lane_counts()
    )
    for line, (number, published) in zip(hashes, parity.PUBLISHED.items(), strict=True):
        assert line.startswith(f"parity hash, {number}: ")
        assert line.endswith(f", NOT the published {published}")
