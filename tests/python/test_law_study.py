"""Studies with a user's controller: its parameters vary, study.json identifies it, and no other resumes."""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pyarrow.parquet as pq
import pytest
from children import PATIENCE
from command_server import fracgyro
from fracgyro.export.compilers import system_compiler
from fracgyro.scenario import ScenarioError
from fracgyro.study.controller import recorded
from fracgyro.study.sweep.design import read_plan
from fracgyro.study.tune.plan import read_tuning
from laws import by_numba

IN_C = """
void pd(const double* in, double* state, const double* p, double* out) {
    for (int i = 0; i < 2; ++i)
        out[i] = in[9 + i] - p[0] * (in[1 + i] - in[5 + i]) - p[1] * (in[3 + i] - in[7 + i]);
}
void softer(const double* in, double* state, const double* p, double* out) {
    pd(in, state, p, out);
    out[0] *= 0.5;
}
"""
FIXED = "seeds = 2\n[fixed]\nrun.duration = 2.0\n[metrics]\ntransient = 1.0\n"
GRID = f"""{FIXED}
[vary]
"law.kp" = {{ low = 1e4, high = 4e4, steps = 3, scale = "log" }}
plant.angular_rate = [0.0, 100.0]
"""
GAINS = {"kp": 2e4, "kd": 250.0}
BASE = fg.Scenario.paper().replace({"run.duration": 2.0})


def built(folder: Path, text: str = IN_C) -> ctypes.CDLL:
    (folder / "law.c").write_text(text, encoding="utf-8")
    options = ["-x", "c", "-O1", "-ffp-contract=off", "-shared", "-fPIC"]
    system_compiler(*options, folder / "law.c", "-o", folder / "law.so")
    return ctypes.CDLL(str(folder / "law.so"))


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return built(tmp_path_factory.mktemp("law"))


@pytest.fixture(scope="module")
def law(compiled: ctypes.CDLL) -> fg.native.Law:
    return fg.native.Law(compiled.pd, parameters=GAINS)


def study(folder: Path, text: str) -> Path:
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


# -- Sweep ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory, law: fg.native.Law) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    result = fg.study.sweep(study(folder, GRID), folder / "out", controller=law)
    assert (result.runs, result.diverged) == (12, 0)
    return folder


def test_a_row_is_what_its_law_measures(swept: Path, law: fg.native.Law) -> None:
    rows = pq.read_table(swept / "out" / "runs").to_pydict()
    assert rows["law.kp"] == [1e4] * 4 + [2e4] * 4 + [4e4] * 4
    assert rows["plant.angular_rate"] == [0.0, 0.0, 100.0, 100.0] * 3
    alone = fg.measure_many(
        [BASE.replace({"plant.angular_rate": 100.0})], seeds=[1], transient=1.0, controller=law.replace({"kp": 4e4})
    )
    assert rows["rmse_steady_y"][11] == float(alone["rmse"].sel(window="steady", axis="y").item())
    assert len(set(rows["rmse_steady_y"])) == 12
    assert set(rows["rate_error"]) == {None}, "the law reports no rate"


def test_measure_many_takes_a_law_for_each_scenario(law: fg.native.Law) -> None:
    laws = [law.replace({"kp": kp}) for kp in (1e4, 3e4)]
    together = fg.measure_many([BASE, BASE], seeds=range(3), controller=laws)["rmse"].values
    for i, each in enumerate(laws):
        alone = fg.measure_many([BASE], seeds=range(3), controller=each)["rmse"].values
        np.testing.assert_array_equal(together[3 * i : 3 * i + 3], alone)
    for wrong in (laws[:1], [laws[0], print], []):
        with pytest.raises(ValueError, match=r"a list must have one native\.Law for each of the 2 scenarios"):
            fg.measure_many([BASE, BASE], controller=wrong)


def test_the_summary_says_what_ran(swept: Path) -> None:
    page = (swept / "out" / "summary.html").read_text(encoding="utf-8")
    assert "controller is pd with kp = 20000, kd = 250, which replaces [controller]" in page
    assert "law.kp" in page
    assert "have none, as the controller does not report this quantity" in page


def test_study_json_says_which_controller_it_was(swept: Path) -> None:
    said = json.loads((swept / "out" / "study.json").read_text(encoding="utf-8"))["parts"]["controller"]
    assert len(said.pop("code")) == 64
    assert said == {"name": "pd", "parameters": GAINS, "state_size": 0, "reports": []}


def resumed(folder: Path, controller: Any) -> int:
    return fg.study.sweep(folder / "study.toml", folder / "out", controller=controller, resume=True).resumed


def test_a_study_resumes_with_its_controller_from_wherever_it_is_loaded(
    swept: Path, law: fg.native.Law, compiled: ctypes.CDLL, tmp_path: Path
) -> None:
    assert resumed(swept, law) == 12
    last = sorted((swept / "out" / "runs").iterdir())[-1]
    rows = last.read_bytes()
    last.unlink()
    copy = tmp_path / "copy.so"
    copy.write_bytes(Path(compiled._name).read_bytes())
    assert resumed(swept, fg.native.Law(ctypes.CDLL(str(copy)).pd, parameters=GAINS)) < 12
    assert last.read_bytes() == rows


def test_another_controller_is_refused(swept: Path, law: fg.native.Law, compiled: ctypes.CDLL, tmp_path: Path) -> None:
    changed = built(tmp_path, IN_C.replace("in[9 + i]", "0.9 * in[9 + i]")).pd
    others = [
        law.replace({"kd": 251.0}),
        fg.native.Law(compiled.softer, parameters=GAINS),
        fg.native.Law(compiled.pd, 1, GAINS),
        fg.native.Law(changed, parameters=GAINS),
    ]
    for other in others:
        with pytest.raises(ScenarioError, match="has another study, which differs in controller: "):
            resumed(swept, other)


def test_a_study_of_the_scenarios_own_controller_is_another(tmp_path: Path, law: fg.native.Law) -> None:
    text = FIXED + "[vary]\nplant.angular_rate = [0.0, 100.0]\n"
    fg.study.sweep(study(tmp_path, text), tmp_path / "out", controller=law)
    with pytest.raises(ScenarioError, match="which differs in controller: "):
        resumed(tmp_path, None)
    fg.study.sweep(tmp_path / "study.toml", tmp_path / "own")
    with pytest.raises(ScenarioError, match="which differs in controller: "):
        fg.study.sweep(tmp_path / "study.toml", tmp_path / "own", controller=law, resume=True)


def pd_with(kp: float) -> Callable[[fg.Sample], tuple[float, float]]:
    def force(s: fg.Sample) -> tuple[float, float]:
        x, y = (
            s.reference_acceleration[i]
            - kp * (s.position[i] - s.reference[i])
            - GAINS["kd"] * (s.velocity[i] - s.reference_velocity[i])
            for i in range(2)
        )
        return x, y

    return force


def test_a_callable_sweeps_and_is_known_by_its_code(tmp_path: Path, law: fg.native.Law) -> None:
    text = FIXED + "[vary]\nplant.angular_rate = [0.0, 100.0]\n"
    fg.study.sweep(study(tmp_path, text), tmp_path / "out", controller=pd_with(2e4))
    rows = pq.read_table(tmp_path / "out" / "runs").to_pydict()
    rates = [BASE.replace({"plant.angular_rate": rate}) for rate in (0.0, 100.0)]
    expected = fg.measure_many(rates, seeds=range(2), controller=law)["effort"].sel(axis="x").values
    np.testing.assert_allclose(rows["effort_x"], expected, rtol=1e-9)
    assert resumed(tmp_path, pd_with(2e4)) == 4
    with pytest.raises(ScenarioError, match="which differs in controller: "):
        resumed(tmp_path, pd_with(2.1e4))


def test_a_controller_whose_code_cannot_be_read_is_not_resumed(tmp_path: Path) -> None:
    class Locked:
        def __init__(self) -> None:
            self.lock = threading.Lock()

        def reset(self, scenario: fg.Scenario) -> None:  # without which it would be copied
            self.lock = threading.Lock()

        def __call__(self, s: fg.Sample) -> tuple[float, float]:
            return 0.0, 0.0

    text = FIXED + "[vary]\nplant.angular_rate = [0.0]\n"
    fg.study.sweep(study(tmp_path, text), tmp_path / "out", controller=Locked())
    assert json.loads((tmp_path / "out" / "study.json").read_text())["parts"]["controller"]["code"] is None
    with pytest.raises(ScenarioError, match=r"^controller is .*Locked, whose code cannot be read and compared"):
        resumed(tmp_path, Locked())


def test_no_cluster_runs_a_controller_from_outside(tmp_path: Path, law: fg.native.Law) -> None:
    with pytest.raises(ValueError, match=r'scheduler is "tcp://a:1": it must be left out, as a user.s controller'):
        fg.study.sweep(study(tmp_path, GRID), tmp_path / "out", controller=law, scheduler="tcp://a:1")
    assert not (tmp_path / "out").exists()


# -- Identity of a controller --------------------------------------------------------------------------------

MODULE = """
import math
import fracgyro as fg
GAIN = {gain}
WORDS = {{"one", "two", "three", "four"}}
def helper(x):
    return {helper} * x if "one" in {{"one", "two", "three"}} else x
class Integral:
    def __init__(self, ki):
        self.ki, self.sum = ki, 5.0
    def reset(self, scenario):
        self.sum = 0.0
    def __call__(self, s):
        self.sum += self.ki * s.position[0]
        return -GAIN * math.tanh(helper(s.position[0])) - self.sum, 0.0
controller = Integral({ki})
"""


def code_of(text: str) -> str:
    names: dict[str, Any] = {"__name__": "mine"}
    exec(text, names)
    return str(recorded(names["controller"], BASE)["controller"]["code"])


def test_a_callable_is_known_by_what_it_does_and_has() -> None:
    same = {"gain": 1.5, "helper": 2.0, "ki": 3.0}
    code = code_of(MODULE.format(**same))
    assert code == code_of("# a comment\n" + MODULE.format(**same))
    for name in same:
        assert code_of(MODULE.format(**{**same, name: 7.0})) != code, name


def test_a_callable_is_the_same_in_another_process(tmp_path: Path) -> None:
    text = MODULE.format(gain=1.5, helper=2.0, ki=3.0)
    script = (
        "from fracgyro.study.controller import recorded\n"
        'print(recorded(controller, fg.Scenario())["controller"]["code"])\n'
    )
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    for seed in "12":
        ran = subprocess.run(
            [sys.executable, "-c", "from mine import *; import fracgyro as fg\n" + script],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": str(tmp_path)},
            capture_output=True, text=True, timeout=PATIENCE,
        )  # fmt: skip
        assert ran.stdout.strip() == code_of(text), ran.stderr


def test_after_its_runs_a_controller_is_still_the_same() -> None:
    names: dict[str, Any] = {"__name__": "mine"}
    exec(MODULE.format(gain=1.5, helper=2.0, ki=3.0), names)
    before = recorded(names["controller"], BASE)
    assert before["controller"]["parameters"] == {"ki": 3.0, "sum": 0.0}
    fg.simulate(BASE.replace({"run.duration": 0.1}), names["controller"])
    assert names["controller"].sum != 0.0
    assert recorded(names["controller"], BASE) == before


def test_a_function_of_numba_is_known_by_its_python() -> None:
    def made(sign: float) -> fg.native.Law:
        def push(given: Any, state: Any, p: Any, out: Any) -> None:
            out[0] = out[1] = sign * p[0]

        return fg.native.Law(by_numba(push), parameters={"force": 1.0})

    found = [recorded(made(sign), BASE)["controller"]["code"] for sign in (1.0, 1.0, -1.0)]
    assert found[0] is not None
    assert found[0] == found[1] != found[2]


# -- Refused input -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[vary]\n"law.kpp" = [1.0]', "law.kpp is not a parameter of the law; did you mean law.kp?"),
        ("[vary]\nlaw.gain = [1.0]", "law.gain is not a parameter of the law; it has law.kp, law.kd"),
        ('[vary]\nlaw.kp = ["big"]', 'law.kp is "big": it must be a finite number'),
        ("[vary]\nlaw.kp = [1.0, nan]", "law.kp is nan: it must be a finite number"),
        ("[vary]\nlaw.kp = [true]", "law.kp is true: it must be a finite number"),
        ("[vary]\nlaw.kp = [[1.0, 2.0]]", "law.kp is [1.0, 2.0]: it must be a finite number"),
        (
            "[vary]\nlaw.kp = 3.0",
            "it must be a list of values or { low, high } or { relative }; a single value belongs to the law",
        ),
        ("[vary]\nlaw.kp = []", "law.kp is []: it must have at least one value"),
        ("[vary]\nlaw.kp = { low = 2.0, high = 1.0 }", "law.kp: low is 2.0: it must be less than high, which is 1.0"),
        ("[vary]\nlaw.kp = { low = 1.0, high = inf }", "law.kp: high is inf: it must be a finite number"),
        ("[vary]\nlaw = 3", "law is 3: it must be a table"),
        ('[vary]\nlaw.kp = [1.0]\n"law.kp" = [1.0]', "law.kp is given twice: it must be given once"),
        (
            "[vary]\ncontroller.order = [0.5, 0.9]",
            "controller.order is in [vary]: it has no effect, as a native.Law replaces the scenario's controller; only "
            "controller.force_limit, controller.filter, controller.observer_bandwidth, controller.event_threshold, "
            "controller.event_share and controller.compensation_bandwidth remain",
        ),
        ("[vary]\nrun.kernel_tolerance = [1e-6, 1e-5]", "run.kernel_tolerance is in [vary]: it has no effect"),
        ("[fixed]\nlaw.kp = 1.0", "law.kp is in [fixed]: it must be set in the controller that is passed to the study"),
    ],
)
def test_a_bad_parameter_is_refused_in_one_sentence(
    tmp_path: Path, law: fg.native.Law, text: str, expected: str
) -> None:
    objective = '\n[[objective]]\nmetric = "effort_x"\n'
    for read, tail in ((read_plan, ""), (read_tuning, objective)):
        with pytest.raises(ScenarioError) as refusal:
            read(study(tmp_path, f"{text}{tail}"), law)
        assert expected in str(refusal.value)


def test_what_is_no_law_has_no_parameters(tmp_path: Path) -> None:
    path = study(tmp_path, GRID)
    with pytest.raises(ScenarioError, match=r"^law\.kp is in \[vary\]: it is only allowed with a native\.Law"):
        fg.study.sweep(path, tmp_path / "out", controller=pd_with(1.0))
    with pytest.raises(ScenarioError, match=r"^law\.kp is in \[vary\]: it is only allowed in fracgyro.study.sweep"):
        fg.study.sweep(path, tmp_path / "out")
    plain = study(tmp_path, FIXED)
    for wrong in (3, int):
        with pytest.raises(TypeError, match=r"it must be a native\.Law, or a callable"):
            fg.study.sweep(plain, tmp_path / "out", controller=wrong)
    assert not (tmp_path / "out").exists()


def test_what_any_law_reads_may_vary(tmp_path: Path, law: fg.native.Law) -> None:
    text = f"{FIXED}[vary]\ncontroller.force_limit = [10.0, inf]\n"
    fg.study.sweep(study(tmp_path, text), tmp_path / "out", controller=law)
    largest = pq.read_table(tmp_path / "out" / "runs").to_pydict()["largest_force"]
    assert max(largest[:2]) == 10.0 < min(largest[2:])


@pytest.mark.parametrize("start", [fg.study.sweep, fg.study.tune])
def test_a_controller_that_raises_at_once_leaves_the_folder_free(tmp_path: Path, start: Callable[..., object]) -> None:
    broken = [True]

    def force(s: fg.Sample) -> tuple[float, float]:
        if broken[0]:
            raise RuntimeError("a slip")
        return pd_with(2e4)(s)

    text = FIXED + "[vary]\nplant.angular_rate = { low = 0.0, high = 100.0 }\n"
    text += '[design]\nkind = "random"\npoints = 2\n'
    if start is fg.study.tune:
        text = text.replace('[design]\nkind = "random"\npoints', "[tune]\ntrials")
        text += '[[objective]]\nmetric = "effort_x"\n'
    path = study(tmp_path, text)
    with pytest.raises(ValueError, match="a slip"):
        start(path, tmp_path / "out", controller=force)
    assert not list(tmp_path.glob("out/*"))
    broken[0] = False
    start(path, tmp_path / "out", controller=force)


@pytest.mark.parametrize("command", ["sweep", "tune"])
def test_the_command_line_says_that_a_law_needs_python(tmp_path: Path, command: str) -> None:
    text = FIXED + "[vary]\nlaw.kp = { low = 1.0, high = 2.0 }\n"
    text += '[[objective]]\nmetric = "effort_x"\n' if command == "tune" else ""
    ran = fracgyro(command, study(tmp_path, text), "--out", tmp_path / "out")
    assert ran.returncode == 2
    assert ran.stderr.startswith("fracgyro: law.kp is in [vary]: it is only allowed in fracgyro.study.sweep and")
    assert ran.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


# -- Tune ----------------------------------------------------------------------------------------------------

TUNE = (
    FIXED
    + """
[vary]
law.kp = { low = 1e3, high = 4e4, scale = "log" }
controller.force_limit = [1000.0, 2000.0]
[tune]
trials = 8
held_out_seeds = 3
[[objective]]
metric = "rmse_steady_x"
"""
)


def test_a_law_is_tuned(tmp_path: Path, law: fg.native.Law) -> None:
    base = law.replace({"kp": 2e3})
    path = study(tmp_path, TUNE)
    tuned = fg.study.tune(path, tmp_path / "out", controller=base)
    assert isinstance(tuned.controller, fg.native.Law)
    found = tuned.controller.parameters
    assert found["kp"] > 4e3
    assert found["kd"] == GAINS["kd"]
    assert base.parameters["kp"] == 2e3
    trials = (tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()
    assert trials[0].startswith("trial,law.kp,controller.force_limit,mean of rmse_steady_x,")
    scenario = fg.Scenario.load(tuned.scenario)
    rows = fg.measure_many([scenario], seeds=range(2), transient=1.0, controller=tuned.controller)
    mean = float(rows["rmse"].sel(window="steady", axis="x").mean())
    (chosen,) = (line.split(",") for line in trials[1:] if line.startswith(f"{tuned.trial},"))
    assert float(chosen[1]) == found["kp"]
    assert float(chosen[3]) == mean
    assert tuned.held_out.objectives[0].tuned < tuned.held_out.objectives[0].base
    text = tuned.scenario.read_text(encoding="utf-8")
    assert f"#   law.kp = {found['kp']}, was 2000.0" in text
    assert "# The controller before tuning was pd with kp = 2000, kd = 250, which replaces [controller]." in text
    page = tuned.report.read_text(encoding="utf-8")
    assert "fracgyro simulate tuned.toml" not in page
    assert "pd with kp = 2000, kd = 250" in page

    more = path.read_text(encoding="utf-8").replace("trials = 8", "trials = 10")
    again = fg.study.tune(study(tmp_path, more), tmp_path / "out", controller=base, resume=True)
    assert again.trials == 10
    with pytest.raises(ScenarioError, match="which differs in controller: "):
        fg.study.tune(path, tmp_path / "out", controller=law, resume=True)


# -- Location ------------------------------------------------------------------------------------------------


def test_importing_fracgyro_is_light_and_studies_and_rate_are_at_hand() -> None:
    script = (
        "import sys, fracgyro as fg; print(sorted({name.partition('.')[0] for name in sys.modules}));"
        "fg.study.sweep; fg.rate.allan; import fracgyro.study.sweep.blocks, fracgyro.study.tune.plan;"
        "import fracgyro.rate.allan, fracgyro.rate.characterise;"
        "assert all(map(callable, (fg.study.sweep, fg.study.tune, fg.rate.characterise, fg.rate.allan)))"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr
    imported = set(eval(ran.stdout))
    assert "fracgyro" in imported
    assert not imported & {"numpy", "optuna", "dask", "distributed", "matplotlib", "allantools", "sqlalchemy", "jinja2"}
