"""The command line as a user meets it: a process, its output and its exit code."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import click
import fracgyro as fg
import numpy as np
import pytest
import xarray as xr
from children import PATIENCE
from click.testing import CliRunner
from command_server import fracgyro as run
from fracgyro.cli import cli
from fracgyro.cli.commands import entry_points
from fracgyro.cli.main import COMMANDS
from fracgyro.scenario.table import toml_value

SHORT = ("--set", "run.duration=2.0")
BOUNDED = fg.Scenario.paper().replace({"controller.switching_limit": 0.5})


def sentence(result: subprocess.CompletedProcess[str]) -> str:
    """The one line that bad input ends with."""
    assert result.returncode == 2, result
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    (line,) = result.stderr.splitlines()
    assert line.startswith("fracgyro: ")
    return line.removeprefix("fracgyro: ")


def test_the_scenario_it_prints_is_the_papers_and_simulates(tmp_path: Path) -> None:
    printed = run("scenario", "paper")
    assert printed.returncode == 0
    assert printed.stdout == fg.Scenario.paper().to_toml()
    (tmp_path / "my.toml").write_text(printed.stdout, encoding="utf-8")
    simulated = run("simulate", tmp_path / "my.toml", *SHORT, "--json")
    assert simulated.returncode == 0
    expected = fg.metrics.rmse(fg.simulate(fg.Scenario.paper().replace({"run.duration": 2.0})))
    assert json.loads(simulated.stdout)["rmse"]["whole"]["x"] == pytest.approx(float(expected[0]), rel=1e-12)


def test_the_printed_variant_can_be_had() -> None:
    assert run("scenario", "paper-printed").stdout == fg.Scenario.paper("printed").to_toml()


def test_a_run_is_saved_and_drawn(tmp_path: Path) -> None:
    result = run(
        "simulate",
        *SHORT,
        "--set",
        "run.units=SI",
        "--out",
        tmp_path / "run.nc",
        "--plot",
        tmp_path / "run.svg",
    )
    assert result.returncode == 0
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as saved:
        assert saved.attrs["units"] == "SI"
        assert fg.Scenario.from_toml(saved.attrs["scenario"]).run.duration == 2.0
        assert saved["position"].attrs["units"] == "m"
        assert float(saved["time"][-1]) == pytest.approx(2e-3)
    assert "<svg" in (tmp_path / "run.svg").read_text(encoding="utf-8")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.nc", "run.svg"]


def test_a_table_of_metrics_is_printed_for_people() -> None:
    result = run("simulate", *SHORT)
    assert result.returncode == 0
    assert "never" in result.stdout
    in_si = run("simulate", *SHORT, "--set", "run.units=SI")
    for printed, unit, length, of_bounds in (
        (result, "1/ω0", "q0", "m ω0² q0, m ω0², m ω0"),
        (in_si, "s", "m", "N, N/m, N s/m"),
    ):
        lines = [line.rstrip() for line in printed.stdout.splitlines()]
        assert lines[0].split() == ["metric", "value", "unit"]
        ends = {line.split()[0]: line for line in lines[1:] if line and line[0] != " "}
        assert re.search(rf"\d  +{re.escape(unit)}$", ends["error_settling_time"])
        assert re.search(rf"  {length}$", ends["rmse"])
        assert re.search(rf"\d  +{re.escape(of_bounds)}$", ends["bound_final"])
        assert re.search(r"\d$", ends["stiffness_error"])
    assert "q0 is 1e-06 m, ω0 1000 rad/s, m 1.8e-07 kg." in result.stdout
    assert "q0 is" not in in_si.stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            ["simulate", "--set", "controller.order=1.2"],
            "controller.order is 1.2: it must lie between 0 and 1",
        ),
        (["simulate", "--set", "controller.oder=0.5"], "did you mean controller.order?"),
        (["simulate", "--set", "controller.order"], "has no '='"),
        (["simulate", "--set", "controller.order=high"], 'controller.order is "high": it must be a number'),
        (["simulate", "--set", "plant.mass=nan"], "plant.mass is nan"),
        (["simulate", "--set", f"run.duration={'[' * 20000}"], "--set run.duration: its value is nested too deeply"),
        (["simulate", "--set", f"run.duration={'[' * 90}{']' * 90}"], "run.duration is [[[[[[[[[[[[[[[[[...]]]]]"),
        (["simulate", "--set", f"run.duration={'9' * 5000}"], 'run.duration is "99999'),
        (
            ["simulate", "--set", "controller.order=0.8\nx = 1"],
            'controller.order is "0.8\\nx = 1": it must be a number',
        ),
        (["simulate", "my\nfile.toml"], "my\\nfile.toml cannot be read: No such file or directory"),
        (["simulate", "half.toml\n"], "half.toml\\n cannot be read"),
        (
            ["export", "web", "whole.toml", "--out", "whole.toml"],
            "whole.toml cannot be written: it already exists",
        ),
        (["simulate", "whole.toml", *SHORT, "--out", "whole.toml"], "whole.toml cannot be written: its suffix must be"),
        (["simulate", "nowhere.toml"], "nowhere.toml cannot be read: No such file or directory"),
        (["simulate", "half.toml"], "half.toml is not valid TOML"),
        (["simulate", *SHORT, "--out", "nowhere/run.nc"], "nowhere/run.nc cannot be written: No such file"),
        (["simulate", *SHORT, "--plot", "run.mp3"], "run.mp3 cannot be drawn"),
        (["simulate", *SHORT, "--out", "run.h5"], "run.h5 cannot be written: its suffix must be one of .nc, .csv, "),
        (["reproduce", "--seeds", "1"], "seeds is 1: it must be at least 2"),
        (["reproduce", "--seeds", "some"], "'some' is not a valid integer"),
        (["reproduce", "--out", "half.toml"], "half.toml cannot be created: File exists"),
        (["reprodce"], "reprodce is not a command; did you mean reproduce?"),
        (["export", "firmwar"], "firmwar is not a command; did you mean firmware?"),
        (["export", "rocket"], "rocket is not a command; known are firmware, fmu, "),
        (["scenario", "dual_mas"], "nor a file; did you mean dual_mass?"),
        (["simulate", "--set", "controller.kind=pdi"], "or mode_reversal; did you mean pid?"),
        (["simulate", "--set", "adaptation.kind=compsite"], "or joint; did you mean composite?"),
        (
            ["simulate", "--set", "controller.ordr=.8"],
            "controller.ordr is not a known field; did you mean controller.o",
        ),
        (["scenario", "rocket"], '"rocket" is neither a shipped scenario nor a file'),
    ],
)
def test_bad_input_ends_with_one_sentence(tmp_path: Path, words: list[str], expected: str) -> None:
    (tmp_path / "half.toml").write_text("[controller]\norder = ", encoding="utf-8")
    BOUNDED.save(tmp_path / "whole.toml")
    assert expected in sentence(run(*words, cwd=tmp_path))
    assert {p.name for p in tmp_path.iterdir()} == {"half.toml", "whole.toml"}, "nothing may be left behind"
    assert fg.Scenario.load(tmp_path / "whole.toml") == BOUNDED


def test_a_diverging_run_says_when_and_what_to_change_and_keeps_what_was_computed(tmp_path: Path) -> None:
    said = sentence(
        run(
            "simulate",
            "--set",
            "run.step=0.01",
            "--set",
            "disturbance.hold=",
            "--out",
            "run.nc",
            cwd=tmp_path,
        )
    )
    assert "diverged at t = " in said
    assert "try run.step = 0.005 or less" in said
    assert "run.nc" in said
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as saved:
        assert 10 < saved.sizes["time"] < 8000
        assert bool(np.isfinite(saved["position"]).all())


def test_an_empty_value_unsets_a_field() -> None:
    result = run("simulate", *SHORT, "--set", "run.step=2e-3", "--set", "disturbance.hold=", "--json")
    assert result.returncode == 0, result.stderr


def test_help_lists_the_commands() -> None:
    result = run("--help")
    assert result.returncode == 0
    for command in ("reproduce", "simulate", "scenario"):
        assert command in result.stdout


def test_a_package_adds_a_command_by_an_entry_point(tmp_path: Path) -> None:
    """It is imported when it is run or listed, and its own ValueError is a sentence."""
    (tmp_path / "fracgyro_more.py").write_text(
        "import click\nprint('imported')\n@click.command()\n@click.option('--fail', is_flag=True)\n"
        "def greet(fail):\n    'Greet the user.'\n    if fail:\n        raise ValueError('nobody is here')\n"
        "    click.echo('hello')\n",
        encoding="utf-8",
    )
    about = tmp_path / "fracgyro_more-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: fracgyro_more\nVersion: 1.0\n", encoding="utf-8")
    (about / "entry_points.txt").write_text("[fracgyro.commands]\ngreet = fracgyro_more:greet\n", encoding="utf-8")
    path = {"PYTHONPATH": str(tmp_path)}
    assert through_shell("greet", tmp_path, **path).stdout == "imported\nhello\n"
    assert through_shell("greet --fail", tmp_path, **path).stderr == "fracgyro: nobody is here\n"
    assert "; did you mean greet?" in through_shell("geet", tmp_path, **path).stderr
    assert "imported" not in through_shell("scenario --list", tmp_path, **path).stdout
    listed = through_shell("--help", tmp_path, **path).stdout.splitlines()
    assert [line.split()[0] for line in listed[listed.index("Commands:") + 1 :]] == sorted([*NAMES, "greet"])
    assert "  greet      Greet the user." in listed


NAMES = [
    "allan",
    "check",
    "compare",
    "datasheet",
    "device",
    "diff",
    "enter",
    "explain",
    "export",
    "identify",
    "live",
    "rate",
    "replay",
    "reproduce",
    "scenario",
    "schema",
    "selfcheck",
    "simulate",
]
NAMES += ["sweep", "tune", "zoo"]


def loaded_by(*words: str) -> list[str]:
    """Names of modules that a command has imported when it ends."""
    code = """
import sys, fracgyro.cli
try: fracgyro.cli.main()
finally: print("\\n", *sys.modules)
"""
    ran = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=PATIENCE)
    return ran.stdout.splitlines()[-1].split()


def test_help_loads_nothing_that_takes_long() -> None:
    loaded = loaded_by("--help")
    rooms = {"fracgyro_lab", "fracgyro_lab.commands", "fracgyro_lab.zoo", "fracgyro_lab.zoo.commands"}
    assert {name for name in loaded if name.startswith("fracgyro_lab")} == rooms
    assert not {"matplotlib", "numpy", "optuna", "pydantic", "scipy", "xarray"} & set(loaded)


def test_a_run_loads_no_library_of_other_arrays() -> None:
    loaded = loaded_by("simulate", "paper", "--set", "run.duration=0.1")
    assert "xarray" in loaded
    assert not {"dask.array", "pint", "sparse"} & set(loaded)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_is_where_the_list_says(name: str) -> None:
    context = click.Context(cli, info_name="fracgyro")
    command = cli.get_command(context, name)
    assert command is not None
    assert command.name == name


def test_output_that_cannot_be_written_is_said_in_one_sentence() -> None:
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "fracgyro", "scenario", "paper"]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=PATIENCE)
    assert result.returncode == 2
    assert result.stderr == "fracgyro: the output cannot be written: No space left on device\n"


def through_shell(words: str, cwd: Path, **changes: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", f'"{sys.executable}" -m fracgyro {words}'],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, **changes},
        timeout=PATIENCE,
    )


def test_closed_streams_cost_nothing_but_what_they_would_have_said(tmp_path: Path) -> None:
    silent = through_shell("simulate --set run.duration=2.0 --out run.nc >&-", tmp_path)
    assert (silent.returncode, silent.stdout, silent.stderr) == (0, "", "")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as saved:
        assert saved.sizes["time"] > 100
    assert through_shell("simulate nowhere.toml 2>&-", tmp_path).returncode == 2
    assert through_shell("simulate nowhere.toml 2>/dev/full", tmp_path).returncode == 2
    assert through_shell("simulate nowhere.toml >&- 2>&- <&-", tmp_path).returncode == 2


@pytest.mark.nightly
def test_a_picture_is_the_same_whatever_matplotlib_has_been_told(tmp_path: Path) -> None:
    draw = "simulate --set run.duration=2.0 --plot"
    assert through_shell(f"{draw} plain.png", tmp_path).returncode == 0
    settings = "text.usetex: True\nfont.size: 30\nlines.linewidth: 9\nnonsense: 1\nsavefig.bbox: tight\n"
    for place in ("matplotlibrc", "other"):  # the first one is found where the command runs
        (tmp_path / place).write_text(settings, encoding="utf-8")
        drawn = through_shell(f"{draw} told.png", tmp_path, MPLBACKEND="nonsense", MATPLOTLIBRC=str(tmp_path / "other"))
        assert (drawn.returncode, drawn.stderr) == (0, "")
        assert (tmp_path / "told.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


@pytest.mark.parametrize("columns", ["1", "20"])
def test_a_narrow_terminal_cuts_nothing_off(tmp_path: Path, columns: str) -> None:
    wide, narrow = (through_shell("simulate --set run.duration=2.0", tmp_path, COLUMNS=c) for c in ("200", columns))
    assert narrow.stdout == wide.stdout
    assert "surface_settling_time" in narrow.stdout


def test_a_terminal_without_greek_letters_shows_the_table(tmp_path: Path) -> None:
    shown = through_shell("simulate --set run.duration=2.0", tmp_path, PYTHONIOENCODING="ascii")
    assert (shown.returncode, shown.stderr) == (0, "")
    assert "1/\\u03c90" in shown.stdout


def test_a_file_whose_name_is_not_text_is_read_and_named_by_its_bytes(tmp_path: Path) -> None:
    name = os.fsencode(tmp_path) + b"/my\xff.toml"
    with open(name, "wb") as file:
        file.write(BOUNDED.to_toml().encode())
    command = [sys.executable.encode(), b"-m", b"fracgyro", b"export", b"web", name, b"--out", name + b".json"]
    done = subprocess.run(command, capture_output=True, timeout=PATIENCE, env={**os.environ, "LC_ALL": "C.UTF-8"})
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(name + b".json: ")


def test_a_device_is_not_replaced_by_a_file() -> None:
    assert "/dev/null cannot be written: it is not a regular file" in sentence(
        run("export", "web", "hardware", "--out", "/dev/null")
    )
    assert Path("/dev/null").is_char_device()


def test_metrics_do_not_depend_on_how_often_samples_are_kept() -> None:
    thin = ("--set", "run.record_every=50")
    kept, all_kept = (json.loads(run("simulate", *SHORT, *more, "--json").stdout) for more in (thin, ()))
    assert kept == all_kept


def test_a_scenario_cut_off_between_two_lines_is_noticed(tmp_path: Path) -> None:
    text = fg.Scenario.paper().to_toml()
    (tmp_path / "half.toml").write_text("\n".join(text.splitlines()[:20]) + "\n", encoding="utf-8")
    assert "half.toml is cut off" in sentence(run("simulate", "half.toml", cwd=tmp_path))


def test_a_run_too_long_to_record_is_refused_before_it_begins(tmp_path: Path) -> None:
    long = ("--set", "controller.kind=linear", "--set", "run.duration=1e5")
    reported = sentence(run("simulate", *long, "--out", tmp_path / "run.nc"))
    assert reported.startswith("run.record_every is 1: 1 runs of 100000001 samples of 29 numbers are 23.2 GB")
    assert list(tmp_path.iterdir()) == []


def test_too_little_memory_is_said_in_one_sentence(tmp_path: Path) -> None:
    """1.2 GB of memory in all, and a record of 1.9 GB."""
    import resource

    words = ["simulate", "--set", "controller.kind=linear", "--set", "run.step=1e-5", "--set", "run.duration=77.0"]
    result = subprocess.run(
        [sys.executable, "-m", "fracgyro", *words, "--out", tmp_path / "run.nc"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (1_200_000_000, 1_200_000_000)),
    )
    assert sentence(result) == "there is not enough memory: make run.record_every larger, or record fewer runs"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        ("numpy.zeros(2) + numpy.zeros(3)", "ValueError: operands could not be broadcast"),
        ("int('x')", "ValueError: invalid literal for int()"),
        ("numpy.linalg.norm([1], axis=2)", "AxisError"),
        ("{}['omega0']", "KeyError"),
        ("numpy.load_it", "AttributeError"),
    ],
)
def test_an_error_that_nobody_foresaw_is_a_bug_to_report_and_no_sentence(fault: str, kind: str) -> None:
    code = (
        "import numpy, fracgyro.cli, fracgyro.simulation.simulate as there\n"
        f"there.simulate = lambda *_: {fault}\n"
        "fracgyro.cli.main()"
    )
    command = [sys.executable, "-c", code, "simulate"]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 1
    assert ran.stdout == ""
    lines = ran.stderr.splitlines()
    assert lines[-1].startswith("fracgyro: this is a bug. Please report it with the lines above")
    assert lines[0] == "Traceback (most recent call last):"
    assert kind in lines[-2]


@pytest.mark.parametrize("words", [[], ["export"]])
def test_a_group_without_a_command_prints_its_help(words: list[str]) -> None:
    bare, asked = CliRunner().invoke(cli, words), CliRunner().invoke(cli, [*words, "--help"])
    assert (bare.exit_code, bare.output) == (0, asked.output)
    assert "\nCommands:\n" in bare.output


def test_metrics_of_a_time_after_the_end_are_left_out_with_the_reason() -> None:
    short = CliRunner().invoke(cli, ["simulate", "--set", "run.duration=5"]).output
    assert "steady: x" not in short
    assert "chattering  " not in short
    assert "run.duration is 5: rmse steady, chattering and rate_error_rms need samples from" in short
    long = CliRunner().invoke(cli, ["simulate", "--set", "run.duration=12"]).output
    assert "steady: x" in long
    assert "run.duration is" not in long


def simulated(*changes: str, scenario: str = "paper") -> tuple[dict[str, str], dict[str, Any], str]:
    """Rows of the table by metric, the JSON, and the whole output of `fracgyro simulate` with these changes."""
    words = ["simulate", scenario, *(word for change in changes for word in ("--set", change))]
    table, found = (CliRunner().invoke(cli, [*words, *more]) for more in ((), ("--json",)))
    assert (table.exit_code, found.exit_code) == (0, 0), table.output + found.output
    lines = [line for line in table.output.splitlines() if line[:1].strip()]
    return {line.split()[0]: line for line in lines}, json.loads(found.stdout), table.output


def test_a_step_is_reported_with_its_overshoot_and_times() -> None:
    changes = {"reference.kind": ["step", "rest"], "reference.smoothing": 0.2, "run.initial_position": (0.0, 0.0)}
    scenario = fg.Scenario.paper().replace({**changes, "run.duration": 4.0})
    expected = fg.metrics.step_response(fg.simulate(scenario)).sel(axis="x")
    rows, found, _ = simulated(
        'reference.kind=["step","rest"]',
        "reference.smoothing=0.2",
        "run.initial_position=[0,0]",
        "run.duration=4.0",
    )
    assert list(rows)[1:5] == list(expected) == list(found)[:4]
    for name in expected:
        assert found[name] == {"x": pytest.approx(float(expected[name]), rel=1e-12)}
    assert re.search(rf"rise_time +x {expected.rise_time:g} +1/ω0", rows["rise_time"])


def test_a_chirp_is_reported_with_its_frequency_response() -> None:
    soft = {
        "controller.kind": "disturbance_rejection",
        "controller.nominal_model": False,
        "controller.natural_frequency": 5.0,
        "controller.extended_observer_bandwidth": 30.0,
        "reference.kind": "chirp",
        "reference.end": 40.0,
        "reference.final_frequency": (80.0, 80.0),
        "run.duration": 40.0,
    }
    rows, found, _ = simulated(*(f"{field}={toml_value(value)}" for field, value in soft.items()))
    response = fg.metrics.frequency_response(fg.simulate(fg.Scenario.paper().replace(soft)))
    cutoff = next(float(each.frequency) for each in response.gain.sel(axis="x") if each < 0.5**0.5)
    assert found["cutoff_frequency"]["x"] == pytest.approx(cutoff)
    assert found["gain_deviation"]["x"] == pytest.approx(float(abs(response.gain.sel(axis="x") - 1).max()))
    assert found["phase_deviation"]["y"] == pytest.approx(float(abs(response.phase.sel(axis="y")).max()))
    assert re.search("phase_deviation.* rad", rows["phase_deviation"])
    *_, output = simulated("reference.kind=chirp", "reference.start=3", "reference.end=9", "run.duration=1.0")
    assert "figures of the reference are left out: reference.start is 3.0: the run must contain some of" in output


def test_a_conventional_gyroscope_is_reported_by_its_drive_and_not_by_an_error_against_the_sine() -> None:
    driven = ("controller.kind=force_rebalance", 'reference.kind=["sine","rest"]', "run.initial_position=[0,0]")
    rows, found, _ = simulated(*driven, "run.duration=3000.0", scenario="dual_mass")
    assert abs(found["amplitude_error"]) < 1e-3
    assert found["frequency"] == pytest.approx(1.0, abs=1e-6)
    assert set(found["rmse"]["whole"]) == {"y"}
    assert "error_settling_time" not in found
    assert "error_settling_time" not in rows
    assert re.search(r"rmse +whole: y", rows["rmse"])


@pytest.mark.parametrize(
    ("step", "hold"), [("0.01", None), (".01", None), ("3e-4", None), ("5e-4", 1e-3), ("1e-3", 1e-3)]
)
def test_the_noise_of_the_paper_follows_a_step_that_is_set(
    monkeypatch: pytest.MonkeyPatch, step: str, hold: float | None
) -> None:
    ran: list[fg.Scenario] = []
    monkeypatch.setattr("fracgyro.simulation.simulate.simulate", lambda scenario, *_: ran.append(scenario))
    CliRunner().invoke(cli, ["simulate", "--set", f"run.step={step}", "--set", "run.duration=12"])
    assert [(scenario.run.step, scenario.disturbance.hold) for scenario in ran] == [(float(step), hold)]


OWN = """
def of(result):
    return lambda *of: result

none, number, three, text = of(None), of(1.0), of((1.0, 2.0, 3.0)), of("ab")
nan = of((float("nan"), 0.0))
spring = lambda sample: (-1e4 * (sample.position[0] - sample.reference[0]) - 200.0 * sample.velocity[0], 0.0)
"""


@pytest.mark.parametrize("name", ["none", "number", "three", "text", "nan"])
def test_results_of_own_code_that_are_not_forces_or_derivatives_are_one_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    said = sentence(run("simulate", *SHORT, "--controller", f"own.py:{name}", cwd=tmp_path))
    assert said.startswith("the controller returned ")
    assert said.endswith(" at t = 0: it must return two finite numbers")
    if name in ("three", "nan", "none"):
        said = sentence(run("simulate", *SHORT, "--plant", f"own.py:{name}", cwd=tmp_path))
        assert said.startswith("the plant returned ")
        assert said.endswith(" at t = 0: it must return 4 finite numbers")


def test_metrics_of_what_a_controller_does_not_report_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    missing = {"rate_error", "rate_settling_time", "damping_error", "stiffness_error", "bound_final", "bound_0_halfway"}
    missing |= {"surface_settling_time", "rate_error_rms", "rate_error_peak"}
    own = ["simulate", "--set", "run.duration=2", "--controller", "own.py:spring"]
    table = run(*own, cwd=tmp_path).stdout
    names = {line.split(" ")[0] for line in table.splitlines()}
    assert {"rmse", "error_settling_time", "effort"} <= names
    assert not missing & names
    assert "rmse steady and chattering need samples" in table
    for words in ([], ["--seeds", "2"]):
        found = set(json.loads(run(*own, *words, "--json", cwd=tmp_path).stdout))
        assert {"rmse", "error_settling_time", "effort"} <= found
        assert not missing & found
    of_paper = json.loads(run("simulate", "--set", "run.duration=2", "--json", cwd=tmp_path).stdout)
    assert missing <= set(of_paper)


def test_an_own_controller_that_diverges_in_si_learns_its_units(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    said = sentence(run("simulate", "--set", "run.units=SI", "--controller", "own.py:spring", cwd=tmp_path))
    assert re.search(r"diverged at t = \S+ s: .* run\.step, which is 1e-06 s,", said)
    assert said.endswith("as run.units is SI, its samples are in m and m/s, and its force is in N")


def test_entry_points_are_those_that_the_standard_library_finds() -> None:
    for group in ("console_scripts", "fracgyro.commands"):
        expected = {(each.name, each.module, each.attr) for each in metadata.entry_points(group=group)}
        assert set(entry_points(group)) == expected != set()
