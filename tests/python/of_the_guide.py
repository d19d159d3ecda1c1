"""The controller of CONTRIBUTING.md in every integration: run by test_one_place.py, with a package built with it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import fmpy
import fracgyro as fg
import numpy as np
import pyarrow.parquet as pq
import pytest
from children import PATIENCE
from click.testing import CliRunner, Result
from embedded import need
from fracgyro import _core
from fracgyro.cli import cli
from fracgyro.export.web import settings_types
from fracgyro.scenario import reference
from fracgyro.scenario.to_core import core_setup
from reference_oracle import motion

PD = fg.Scenario.paper().replace({"controller.kind": "pd", "run.duration": 1.0})
SAID_OF_KP = "Unit omega0^2, > 0: spring on the error."
SAID_OF_PEAK = "largest |e| so far, of both axes"


def command(*words: str | Path) -> Result:
    return CliRunner().invoke(cli, [*map(str, words)])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pd") / "pd.toml"
    path.write_text(PD.to_toml(), encoding="utf-8")
    return path


def test_a_scenario_states_its_fields_with_their_meaning_and_defaults() -> None:
    text = PD.replace({"controller.kp": 4e4}).to_toml()
    assert f"# {SAID_OF_KP}\nkp = 40000.0\n# Unit omega0, > 0: damper on the error.\nkd = 200.0\n" in text
    assert fg.Scenario.from_toml(text) == PD.replace({"controller.kp": 4e4})
    schema = fg.Scenario.model_json_schema()["$defs"]["Controller"]["properties"]["kp"]
    said = {"default": 1e4, "exclusiveMinimum": 0.0, "unit": "omega0^2", "description": SAID_OF_KP}
    assert schema.items() >= said.items()


def test_what_is_out_of_range_is_refused_in_one_sentence() -> None:
    words = ["-S", "-m", "fracgyro", "simulate", "--set", "controller.kind=pd", "--set", "controller.kp=0"]
    ran = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=PATIENCE)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == "fracgyro: controller.kp is 0: it must be greater than 0\n"


def test_a_run_is_that_of_the_same_law_in_python_and_records_what_it_reports() -> None:
    scenario = PD.replace({"controller.kp": 4e4, "controller.kd": 250.0})
    damping, stiffness, rate, _, _ = scenario.plant.nondimensional()
    d, k = (scenario.adaptation.initial_ratio * np.array([[m[0], m[1]], [m[1], m[2]]]) for m in (damping, stiffness))
    coriolis = scenario.adaptation.initial_ratio * np.array([[0.0, -2.0 * rate], [2.0 * rate, 0.0]])

    def law(s: fg.Sample) -> Iterable[float]:
        r, v = np.array(s.reference), np.array(s.reference_velocity)
        position, velocity, acceleration = motion(scenario, np.array([s.time]), scenario.run.step)[:, 0]
        forward = (d + coriolis) @ velocity + k @ position + acceleration
        return forward - 4e4 * (np.array(s.position) - r) - 250.0 * (np.array(s.velocity) - v)

    run, same = fg.simulate(scenario), fg.simulate(scenario, controller=law)
    np.testing.assert_allclose(run["position"], same["position"], rtol=0, atol=1e-12)
    peak = np.maximum.accumulate(np.abs(run["error"].values).max(axis=1))
    np.testing.assert_array_equal(run["peak_error"].values, [0.0, *peak[:-1]])
    assert run["peak_error"].attrs == {"units": "1", "long_name": SAID_OF_PEAK}
    si = fg.simulate(scenario.replace({"run.units": "SI"}))["peak_error"]
    assert si.attrs["units"] == "m"
    np.testing.assert_allclose(si, run["peak_error"] * 1e-6, rtol=1e-15)


def test_runs_in_lanes_have_the_bits_of_single_ones(file: Path) -> None:
    setups = [core_setup(PD.replace({"controller.kp": 1e4 * (1 + i), "disturbance.seed": i})) for i in range(9)]
    params, lanes = _core.MetricsParams(), _core.lane_counts()[-1]
    together = _core.measure_runs(setups, params, 1, lanes)
    alone = np.vstack([_core.measure_runs([setup], params, 1, lanes) for setup in setups])
    np.testing.assert_array_equal(together, alone)
    effort = [
        float(fg.metrics.summary(fg.simulate(PD.replace({"controller.kp": kp})))["effort"][0]) for kp in (1e4, 2e4)
    ]
    found = fg.measure_many([PD, PD.replace({"controller.kp": 2e4})])["effort"][:, 0]
    np.testing.assert_allclose(found, effort, rtol=1e-9)
    assert effort[0] != effort[1]


def test_a_study_sweeps_a_field(tmp_path: Path) -> None:
    study = '[fixed]\ncontroller.kind = "pd"\nrun.duration = 12.0\n[vary]\ncontroller.kp = [1e4, 4e4]\n'
    (tmp_path / "study.toml").write_text(study, encoding="utf-8")
    swept = command("sweep", tmp_path / "study.toml", "--out", tmp_path / "out")
    assert swept.exit_code == 0, swept.output
    rows = pq.read_table(tmp_path / "out" / "runs").to_pydict()
    assert rows["controller.kp"] == [1e4, 4e4]
    soft, stiff = rows["rmse_steady_x"]
    assert stiff < soft / 1.5


def test_a_controller_is_stepped_tuned_and_saved() -> None:
    controller = fg.Controller(PD)
    controller.step(0.0, (0.5, 0.5), (0.0, 0.0))
    assert controller.report == {"peak_error": 0.5}
    other = fg.Controller(PD)
    other.state = controller.state
    assert other.report == {"peak_error": 0.5}
    loop = fg.Loop(PD)
    loop.run(500)
    loop.set({"controller.kp": 4e4})
    changed = loop.run(500)["error"]
    assert not np.array_equal(changed, fg.simulate(PD)["error"][500:])


def test_an_fmu_has_its_fields_to_tune_and_what_it_reports(file: Path, tmp_path: Path) -> None:
    assert command("export", "fmu", file, "--out", tmp_path / "pd.fmu").exit_code == 0
    variables = {v.name: v for v in fmpy.read_model_description(str(tmp_path / "pd.fmu")).modelVariables}
    kp, peak = variables["controller.kp"], variables["peak_error"]
    assert (kp.causality, kp.variability, kp.start, kp.min) == ("parameter", "tunable", "10000.0", "0.0")
    assert kp.description == SAID_OF_KP
    assert (peak.causality, peak.description) == ("output", SAID_OF_PEAK)
    tuned = fmpy.simulate_fmu(str(tmp_path / "pd.fmu"), start_values={"controller.kp": 4e4}, output=["error.x"])
    expected = fg.simulate(PD.replace({"controller.kp": 4e4}))["error"].values[:, 0]
    np.testing.assert_array_equal(tuned["error.x"], expected)


def test_firmware_reports_it_by_name(file: Path, tmp_path: Path) -> None:
    assert command("export", "firmware", file, "--out", tmp_path / "firmware").exit_code == 0
    header = (tmp_path / "firmware" / "fracgyro_coefficients.h").read_text(encoding="utf-8")
    assert f"typedef struct {{\n    fracgyro_number peak_error; /* {SAID_OF_PEAK} */\n}} fracgyro_report;" in header


def test_javascript_has_its_types(file: Path, tmp_path: Path) -> None:
    (settings,) = (part for part in settings_types().split("export ") if '"controller.kind": "pd"' in part)
    assert settings.startswith("interface PdSettings extends CommonSettings {")
    assert '  "controller.kp": number;\n  "controller.kd": number;\n' in settings
    assert command("export", "web", file, "--out", tmp_path / "pd.json").exit_code == 0


def test_the_reference_lists_them() -> None:
    lines = reference.page().splitlines()
    assert f"| `controller.kp` | omega0^2 | > 0 | `10000.0` | {SAID_OF_KP} |" in lines
    assert f"| `peak_error` | q0 | – | {SAID_OF_PEAK.replace('|', chr(92) + '|')} |" in lines


def test_the_documentation_site_has_its_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[2] / "docs/site")
    from controllers import overview, page

    text, pictures = page("pd")
    assert text.startswith(
        "# PD with feedforward\n\nA spring and a damper hold each axis on the reference. Use it when"
    )
    assert r"- k_{p} e - k_{d} \dot{e}" in text
    kp = "| `controller.kp` | > 0, in {math}`ω_{0}^{2}` | `10000.0` | spring on the error. |"
    assert kp in text
    assert len(pictures) == 2
    assert "| [`pd`](../controllers/pd.md) | spring and damper | no |" in overview()


TARGETS = {"host": "", "m7": "Cortex-M", "wasm": "WebAssembly", "fmu": "", "lanes": ""}


@pytest.fixture(scope="module")
def recorded(file: Path) -> Path:
    simulated = command("simulate", file, "--out", file.with_name("run.nc"))
    assert simulated.exit_code == 0, simulated.output
    return file.with_name("run.nc")


@pytest.mark.parametrize("target", TARGETS)
def test_a_recorded_run_has_the_same_bits_on_every_target(recorded: Path, target: str) -> None:
    need(TARGETS[target])
    replayed = command("replay", recorded, "--target", target)
    assert replayed.exit_code == 0, replayed.output
