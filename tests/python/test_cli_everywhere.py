"""Names of shipped scenarios, and a user's controller, wherever a command or a function takes one."""

from __future__ import annotations

import json
from pathlib import Path

import fracgyro as fg
import pandas
import pytest
import xarray as xr
from click.testing import CliRunner
from fracgyro.analysis.confidence import mean_interval
from fracgyro.cli import cli
from fracgyro.export.web import document
from fracgyro.scenario.named import named
from fracgyro.scenario.shipped import NAMES
from fracgyro.simulation.many import threads_available
from fracgyro.simulation.own_file import ControllerFile, PlantFile
from fracgyro.study.file import base_scenario
from fracgyro_lab.comparison.plan import planned
from pyarrow import parquet
from scipy.io import loadmat


def ran(*words: str | Path) -> str:
    """The output of a command, which must succeed."""
    found = CliRunner().invoke(cli, list(map(str, words)))
    assert found.exit_code == 0, found.output + str(found.exception)
    return found.stdout


def refused(*words: str | Path) -> str:
    """The sentence of a command that fails before it does anything."""
    found = CliRunner().invoke(cli, list(map(str, words)), standalone_mode=False)
    assert isinstance(found.exception, Exception)
    return str(found.exception)


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_scenario_has_a_name_in_python_and_on_the_command_line(name: str) -> None:
    printed = fg.Scenario.from_toml(ran("scenario", name))
    assert fg.Scenario.shipped(name) == named(name) == printed
    assert f"\n{name} " in "\n" + ran("scenario", "--list")


def test_a_name_wins_over_a_file_and_a_path_is_always_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mine = fg.Scenario.paper().replace({"run.duration": 2.0})
    mine.save("dual_mass")
    mine.save("mine")
    assert named("dual_mass") == fg.Scenario.shipped("dual_mass")
    assert named("./dual_mass") == named(Path("dual_mass")) == named("mine") == mine
    assert base_scenario("dual_mass", tmp_path, {}) == fg.Scenario.shipped("dual_mass")
    assert base_scenario("./dual_mass", tmp_path, {}) == mine


@pytest.mark.parametrize(
    "words",
    [
        ["simulate"],
        ["rate", "--out", "out"],
        ["export", "firmware", "--out", "out"],
        ["export", "fmu", "--out", "out.fmu"],
        ["export", "web", "--out", "out.json"],
        ["export", "matlab", "--out", "out"],
        ["export", "fpga", "--out", "out"],
        ["compare", "track", "--quick", "--out", "out"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_every_command_suggests_the_name_that_was_meant(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refused(*words, "dual_mas")
    assert said == '"dual_mas" is neither a shipped scenario nor a file; did you mean dual_mass?'
    assert not list(tmp_path.iterdir())


def test_the_names_reach_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ran("export", "web", "dual_mass", "--out", "out.json")
    found = json.loads(Path("out.json").read_text())
    assert found == found | document(fg.Scenario.shipped("dual_mass"))
    found = ran("simulate", "paper-printed", "--set", "run.duration=2.0", "--json")
    printed = fg.simulate(fg.Scenario.paper("printed").replace({"run.duration": 2.0}))
    assert json.loads(found)["rmse"]["whole"]["x"] == pytest.approx(float(fg.metrics.rmse(printed)[0]), rel=1e-12)
    everything = {"classes": (), "noise": (), "only": (), "controller": None, "trials": 1, "quick": True}
    plan = planned("rate", scenarios=["disc"], storage=None, **everything)
    assert list(plan.scenarios) == ["disc"]


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(fg.ScenarioError, match='scenario is "rocket": it must be one of paper, paper-printed, '):
        fg.Scenario.shipped("rocket")
    with pytest.raises(fg.ScenarioError, match="; did you mean dual_mass"):
        fg.Scenario.shipped("dual_mas")


# -- A controller of one's own -------------------------------------------------------------------------------

OWN = """
from __future__ import annotations

import dataclasses

import fracgyro as fg


def pd(sample):
    pairs = zip(sample.position, sample.velocity, sample.reference, sample.reference_velocity)
    return tuple(-1600.0 * (q - r) - 56.0 * (v - w) for q, v, r, w in pairs)


@dataclasses.dataclass
class Pd:
    kp: float = 1600.0
    kd: float = 56.0

    def __call__(self, sample):
        pairs = zip(sample.position, sample.velocity, sample.reference, sample.reference_velocity)
        return tuple(-self.kp * (q - r) - self.kd * (v - w) for q, v, r, w in pairs)

    def report(self):
        return {"rate_estimate": 0.5 * self.kd}


class Needs:
    def __init__(self, kp, kd=1.0):
        pass


class Fails:
    def __init__(self):
        raise KeyError("gains")


class Empty:
    pass


law = fg.native.Law(0x1000, parameters={"kp": 1.0})
native_plant = fg.native.Plant(0x1000)
three = 3


def spring(time, state, force):
    x, y, vx, vy = state
    return vx, vy, force[0] - 300.0 * x, force[1] - 500.0 * y


@dataclasses.dataclass
class Spring:
    kx: float = 300.0
    ky: float = 500.0

    def __call__(self, time, state, force):
        x, y, vx, vy = state
        return vx, vy, force[0] - self.kx * x, force[1] - self.ky * y
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    (tmp_path / "study.toml").write_text("fixed.run.duration = 2.0\nvary.run.step = [1e-3, 5e-4]\n", encoding="utf-8")
    (tmp_path / "gains.toml").write_text(
        "seeds = 2\nfixed.run.duration = 2.0\nvary.controller.force_limit = { low = 1e5, high = 1e6 }\n"
        "tune = { trials = 2, held_out_seeds = 2 }\nobjective = [{ metric = 'rmse_whole_x' }]\n",
        encoding="utf-8",
    )
    return tmp_path


@pytest.mark.parametrize("name", ["pd", "Pd"])
def test_a_controller_of_ones_own_is_simulated_and_names_the_result(own: Path, name: str) -> None:
    short = ["--set", "run.duration=2.0", "--controller", f"own.py:{name}"]
    found = json.loads(ran("simulate", *short, "--json"))
    pd = ControllerFile.read("own.py:pd").object
    run = fg.simulate(fg.Scenario.paper().replace({"run.duration": 2.0}), pd)
    assert found["controller"] == name
    assert found["rmse"]["whole"]["x"] == pytest.approx(float(fg.metrics.rmse(run)[0]), rel=1e-9)
    assert f"controller: {name}, of own.py:{name}" in ran("simulate", *short)
    ran("simulate", *short, "--set", "run.record_every=7", "--out", "run.nc")
    with xr.open_dataset("run.nc", engine="h5netcdf") as saved:
        assert saved.attrs["controller"] == name
        assert ("rate_estimate" in saved) == (name == "Pd")


def test_every_command_takes_it(own: Path) -> None:
    of = ["--controller", "own.py:Pd"]
    ran("sweep", "study.toml", *of, "--out", "swept")
    assert json.loads((own / "swept/study.json").read_text())["parts"]["controller"]["name"] == "Pd"
    assert "already finished" in ran("sweep", "study.toml", *of, "--out", "swept", "--resume")
    assert "controller: Pd" in ran("tune", "gains.toml", *of, "--out", "tuned")
    said = refused("sweep", "study.toml", "--out", "swept", "--resume")
    assert "controller" in said, "a study with a controller is not resumed without it"
    assert "rate" in refused("rate", "dual_mass", "--controller", "own.py:pd", "--out", "sensor")


@pytest.mark.parametrize(
    "command", ["simulate", "sweep study.toml --out o", "tune gains.toml --out o", "rate disc --out o"]
)
@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("own.py", '--controller is "own.py": it must be FILE.py:NAME'),
        ("other.py:pd", "other.py cannot be read: No such file or directory"),
        (
            "own.py:pdd",
            "--controller names pdd: it must be a class, a function or a fracgyro.native.Law of own.py; did",
        ),
        ("own.py:three", "--controller names three: it must be a class, a function"),
        ("own.py:Needs", "Needs of own.py has no default for kp: every argument must have one"),
        ("own.py:Fails", "Fails() of own.py raised KeyError: 'gains'"),
        ("own.py:Empty", "Empty() of own.py is "),
        ("study.toml:pd", "study.toml cannot be run: NameError"),
    ],
)
def test_what_is_not_a_controller_is_refused_in_one_sentence(
    own: Path, command: str, given: str, sentence: str
) -> None:
    assert refused(*command.split(), "--controller", given).startswith(sentence)
    assert not (own / "o").exists()


def test_a_law_is_taken_as_it_is(own: Path) -> None:
    assert ControllerFile.read("own.py:law").controller().parameters == {"kp": 1.0}


@pytest.mark.parametrize("name", ["spring", "Spring"])
def test_a_plant_of_ones_own_is_simulated_and_names_the_result(own: Path, name: str) -> None:
    short = ["--set", "run.duration=2.0", "--plant", f"own.py:{name}"]
    scenario = fg.Scenario.paper().replace({"run.duration": 2.0})
    spring = PlantFile.read("own.py:spring").plant()
    found = json.loads(ran("simulate", *short, "--json"))
    assert found["plant"] == name
    rmse = float(fg.metrics.rmse(fg.simulate(scenario, plant=spring))[0])
    assert found["rmse"]["whole"]["x"] == pytest.approx(rmse, rel=1e-9)
    both = json.loads(ran("simulate", *short, "--controller", "own.py:pd", "--json"))
    pd = ControllerFile.read("own.py:pd").controller()
    assert both["rmse"]["whole"]["x"] == pytest.approx(
        float(fg.metrics.rmse(fg.simulate(scenario, pd, spring))[0]), rel=1e-9
    )
    assert (both["controller"], both["plant"]) == ("pd", name)
    assert f"plant: {name}, of own.py:{name}" in ran("simulate", *short)
    ran("simulate", *short, "--set", "run.record_every=7", "--out", "run.nc")
    with xr.open_dataset("run.nc", engine="h5netcdf") as saved:
        assert saved.attrs["plant"] == name
    seeds = json.loads(ran("simulate", *short, "--seeds", "3", "--json"))
    rows = fg.measure_many([scenario], seeds=range(3), plant=spring)
    assert seeds["rmse"]["whole"]["x"]["mean"] == pytest.approx(
        float(rows["rmse"].sel(window="whole", axis="x").mean()), rel=1e-9
    )


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("own.py", '--plant is "own.py": it must be FILE.py:NAME'),
        ("other.py:spring", "other.py cannot be read: No such file or directory"),
        (
            "own.py:sprung",
            "--plant names sprung: it must be a class, a function or a fracgyro.native.Plant of own.py; did",
        ),
        ("own.py:law", "--plant names law: it must be a class, a function"),
        ("own.py:Needs", "Needs of own.py has no default for kp: every argument must have one"),
        ("own.py:Empty", "Empty() of own.py is "),
    ],
)
def test_what_is_not_a_plant_is_refused_in_one_sentence(own: Path, given: str, sentence: str) -> None:
    assert refused("simulate", "--out", "o.nc", "--plant", given).startswith(sentence)
    assert refused("simulate", "--controller", "own.py:native_plant").startswith("--controller names native_plant: ")
    assert not (own / "o.nc").exists()


# -- Files and seeds -----------------------------------------------------------------------------------------


def test_a_run_is_written_in_the_format_of_the_suffix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for suffix in ("csv", "parquet", "mat", "nc"):
        ran("simulate", "dual_mass", "--set", "run.duration=30", "--set", "run.units=SI", "--out", f"run.{suffix}")
    run = fg.simulate(fg.Scenario.shipped("dual_mass").replace({"run.duration": 30.0, "run.units": "SI"}))
    lines = (tmp_path / "run.csv").read_text().splitlines()
    assert lines[0].startswith("# fracgyro ")
    assert lines[1].startswith("# units: time s, position_x m, position_y m, velocity_x m/s, ")
    assert ", bound_estimate_0 N, bound_estimate_1 N/m, bound_estimate_2 N s/m" in lines[1]
    tables = pandas.read_csv("run.csv", comment="#", float_precision="round_trip"), pandas.read_parquet("run.parquet")
    for table in tables:
        assert list(table)[:3] == ["time", "position_x", "position_y"]
        assert (table["position_y"].to_numpy() == run["position"].values[:, 1]).all()
        assert (table["stiffness_estimate_xy"].to_numpy() == run["stiffness_estimate"].values[:, 1]).all()
        assert (table["time"].to_numpy() == run["time"].values).all()
    assert (loadmat("run.mat")["position"] == run["position"].values).all()
    schema = parquet.read_schema("run.parquet")
    assert fg.Scenario.from_toml(schema.metadata[b"scenario"].decode()) == run.fracgyro.scenario
    assert schema.field("bound_estimate_1").metadata == {b"units": b"N/m"}
    run.fracgyro.to_csv("again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "run.csv").read_bytes()


def test_a_file_of_another_kind_is_not_replaced_and_nothing_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fracgyro.simulation.simulate.simulate", lambda *_: pytest.fail("it ran"))
    for name in ("run.csv", "run.mat", "run.parquet", "run.nc", "run.png"):
        (tmp_path / name).write_text("my results", encoding="utf-8")
        option = "--plot" if name == "run.png" else "--out"
        assert "is a file of another kind" in refused("simulate", option, name)
        assert (tmp_path / name).read_text() == "my results"
    assert "its suffix must be one of .nc, .csv, .parquet, .mat" in refused("simulate", "--out", "run.hdf5")
    with pytest.raises(ValueError, match="the Dataset has 2 runs: select one"):
        fg.simulate_many([fg.Scenario.paper().replace({"run.duration": 1.0})], seeds=range(2)).fracgyro.to_csv("a.csv")


def test_seeds_give_means_with_intervals(tmp_path: Path) -> None:
    short = ("--set", "run.duration=12", "--set", "disturbance.seed=5", "--set", "run.units=SI")
    found = json.loads(ran("simulate", *short, "--seeds", "6", "--json"))
    scenario = fg.Scenario.paper().replace({"run.duration": 12.0})
    rows = fg.measure_many([scenario], seeds=range(5, 11))
    wanted = mean_interval(rows["rmse"].sel(window="steady", axis="y").values * scenario.plant.reference_length)
    assert found["seeds"] == 6
    assert list(found["rmse"]["steady"]["y"].values()) == pytest.approx(list(wanted), rel=1e-9)
    assert found["rate_settling_time"] == {"mean": None, "low": None, "high": None, "never": 6}
    table = ran("simulate", *short, "--seeds", "6")
    assert f"{wanted.mean:.6g} [{wanted.low:.6g}, {wanted.high:.6g}]" in table
    assert "--seeds is given with --out" in refused("simulate", "--seeds", "6", "--out", "run.nc")
    assert refused("simulate", "--seeds", "1") == "--seeds is 1: it must lie between 2 and 1000000"
    assert "3 of 3 runs diverged, the first with disturbance.seed 0 at" in refused(
        "simulate", "--seeds", "3", "--set", "run.step=0.02"
    )


# -- Studies before they run, and on some processors -----------------------------------------------------------


def test_a_dry_run_tells_the_size_and_runs_nothing(own: Path) -> None:
    Path("grid.toml").write_text(
        "seeds = 3\nfixed.run.duration = 2.0\n[vary]\ncontroller.order = [0.5, 0.9]\n"
        "controller.layer_thickness = [0.01, 0.02]\n",
        encoding="utf-8",
    )
    before = sorted(own.iterdir())
    found = json.loads(ran("sweep", "grid.toml", "--dry-run", "--json"))
    assert [found[name] for name in ("runs", "points", "seeds", "steps")] == [12, 4, 3, 12 * 2000]
    assert found["rows"][1] == {"controller.order": 0.5, "controller.layer_thickness": 0.02}
    assert 0.0 < found["seconds"] < 60.0
    shown = ran("sweep", "grid.toml", "--dry-run").splitlines()
    assert shown[0] == "12 runs: 4 points, 3 seeds, 2.4e+04 steps in all"
    assert shown[1].startswith("estimated time on this machine: ")
    assert shown[2].split() == ["controller.order", "controller.layer_thickness"]
    assert "10 runs: 2 trials, 2 seeds" in ran("tune", "gains.toml", "--dry-run", "--controller", "own.py:Pd")
    assert sorted(own.iterdir()) == before
    assert refused("sweep", "grid.toml") == "--out is missing: it must name a folder, unless --dry-run is given"


def test_jobs_limit_the_processors_and_not_the_result(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[int] = []

    def counted() -> int:
        used.append(threads_available())
        return used[-1]

    monkeypatch.setattr("fracgyro.simulation.measure.threads_available", counted)
    ran("sweep", "study.toml", "--out", "one", "--jobs", "1")
    assert set(used) == {1}
    ran("sweep", "study.toml", "--out", "all")
    assert threads_available() in used
    one, every = (pandas.read_parquet(own / name / "runs") for name in ("one", "all"))
    pandas.testing.assert_frame_equal(one, every, check_exact=True)
    assert refused("sweep", "study.toml", "--out", "none", "--jobs", "0") == (
        "jobs is 0: it must be a number of processors, at least 1"
    )
    assert refused("tune", "gains.toml", "--out", "none", "--jobs", "-1").startswith("jobs is -1: it must be")
    assert not (own / "none").exists()


@pytest.mark.parametrize("command", ["simulate", "rate", "sweep", "tune"])
def test_every_command_that_runs_many_takes_jobs_and_frees_the_processors_again(command: str, own: Path) -> None:
    arguments = {"simulate": [], "rate": ["paper"], "sweep": ["study.toml"], "tune": ["gains.toml"]}[command]
    out = [] if command == "simulate" else ["--out", "none"]
    assert refused(command, *arguments, *out, "--jobs", "0").startswith("jobs is 0: it must be")
    assert not (own / "none").exists()


def test_jobs_limit_the_seeds_of_a_simulation(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[int] = []

    def counted() -> int:
        used.append(threads_available())
        return used[-1]

    monkeypatch.setattr("fracgyro.simulation.measure.threads_available", counted)
    ran("simulate", "--set", "run.duration=2", "--seeds", "3", "--jobs", "1")
    assert used == [1]
