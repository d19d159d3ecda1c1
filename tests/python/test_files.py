"""Files named by a user: pipes, devices, links, huge files, others' files; and written files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import fracgyro as fg
import pytest
from children import PATIENCE
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.files import MAX_INPUT, one_line, reason, whole_file
from nightly import nightly_unless

PAPER = fg.Scenario.paper()
BOUNDED = PAPER.replace({"controller.switching_limit": 0.5})

# Every reader of a file that a user names, in a process that may hang or fill its memory.
READ_ALL = """
import json, os, resource, sys
from pathlib import Path
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of many cores it would reserve the room for each
resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30,) * 2)
import fracgyro as fg
from fracgyro.export.replay import load
from fracgyro.study.sweep.design import read_plan
from fracgyro.study.tune.plan import read_tuning

named = sys.argv[1]
for read in (read_plan, read_tuning):
    Path(f"{read.__name__}.toml").write_text(f"scenario = {json.dumps(named)}\\n[[objective]]\\nmetric = 'effort_x'\\n"
        if read is read_tuning else f"scenario = {json.dumps(named)}\\n")
rate = {"rate.kind": "table", "rate.file": named}
readers = {
    "scenario": lambda: fg.Scenario.load(named),
    "rate.file": lambda: fg.Scenario().replace(rate),
    "temperature_file": lambda: fg.Scenario().replace({"device.temperature_file": named}),
    "study": lambda: read_plan(named),
    "tuning": lambda: read_tuning(named),
    "scenario of a study": lambda: read_plan("read_plan.toml"),
    "scenario of a tuning": lambda: read_tuning("read_tuning.toml"),
    "trace": lambda: load(named),
}
for name, read in readers.items():
    try:
        read()
        print(json.dumps([name, "read"]))
    except ValueError as error:
        print(json.dumps([name, str(error)]))
"""


def sentences(named: str, folder: Path) -> dict[str, str]:
    """Message of every reader for the file."""
    command = [sys.executable, "-c", READ_ALL, named]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr[-2000:]
    said = dict(json.loads(line) for line in ran.stdout.splitlines())
    assert len(said) == 8
    assert all(len(sentence.splitlines()) == 1 for sentence in said.values())
    return said


@pytest.mark.parametrize("kind", ["pipe", "device", "loop", "folder"])
def test_what_is_no_regular_file_is_refused_at_once_by_every_reader(tmp_path: Path, kind: str) -> None:
    named = {"pipe": "pipe", "device": "/dev/zero", "loop": "loop", "folder": "folder"}[kind]
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "folder").mkdir()
    why = {"loop": "Too many levels of symbolic links", "folder": "Is a directory"}.get(
        kind, "it is not a regular file"
    )
    for name, said in sentences(named, tmp_path).items():
        assert f"cannot be read: {why}" in said, name


def test_a_huge_file_is_refused_by_its_size(tmp_path: Path) -> None:
    with open(tmp_path / "huge", "wb") as file:
        file.truncate(MAX_INPUT + 1)
    for name, said in sentences("huge", tmp_path).items():
        assert ("it is not NetCDF" if name == "trace" else "it is larger than 16 MiB") in said, name


def test_no_sentence_shows_what_is_in_a_file_that_a_scenario_names(tmp_path: Path) -> None:
    (tmp_path / "shadow").write_text("root:hunter2:19000\nhunter2\n", encoding="utf-8")
    (tmp_path / "rows").write_text("time,rate\n0,hunter2\n", encoding="utf-8")
    (tmp_path / "oven").write_text("time,temperature\n0,1\n0,hunter2\n", encoding="utf-8")
    for name in ("shadow", "rows", "oven"):
        said = sentences(name, tmp_path)
        assert "read" not in said.values()
        assert "hunter2" not in "".join(said.values())


# -- Written -------------------------------------------------------------------------------------------------


def test_a_file_of_another_kind_is_not_replaced_where_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    PAPER.save(path)
    with (
        pytest.raises(ValueError, match=r"mine\.toml cannot be written: it is a file of another kind"),
        whole_file(path, replaces="its kind") as scratch,
    ):
        scratch.write_bytes(b"\x89HDF...")
    assert fg.Scenario.load(path) == PAPER
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine.toml"]


@pytest.mark.parametrize("before", [b"", b"\x89HDF of an older run"])
def test_an_empty_file_and_one_of_the_same_kind_are_replaced(tmp_path: Path, before: bytes) -> None:
    (tmp_path / "run.nc").write_bytes(before)
    with whole_file(tmp_path / "run.nc", replaces="its kind") as scratch:
        scratch.write_bytes(b"\x89HDF...")
    assert (tmp_path / "run.nc").read_bytes() == b"\x89HDF..."


@pytest.mark.parametrize("export", [fg.export.fmu, fg.export.web, fg.export.firmware])
@pytest.mark.parametrize("mine", [b"PK\x03\x04", b'{"version"', b"any"])
def test_no_export_replaces_what_is_there(export: Callable[..., None], mine: bytes, tmp_path: Path) -> None:
    path = tmp_path / "mine"
    path.write_bytes(mine)
    with pytest.raises(ValueError, match="mine cannot be written: it already exists; name an empty or a new f"):
        export(PAPER, path, unbounded=True)
    assert path.read_bytes() == mine
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine"]


def test_an_empty_file_is_as_good_as_a_new_one(tmp_path: Path) -> None:
    (tmp_path / "own.json").touch()
    fg.export.web(PAPER, tmp_path / "own.json", unbounded=True)
    assert json.loads((tmp_path / "own.json").read_text(encoding="utf-8"))["version"] == fg.__version__


@pytest.mark.parametrize("name", ["loop", "loop/run.nc", "file/run.nc", "/", ".", "x" * 300])
def test_a_place_where_nothing_can_be_written_is_one_sentence_and_kept(tmp_path: Path, name: str) -> None:
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "file").write_bytes(b"precious")
    with pytest.raises(ValueError, match=r"cannot be written: ") as caught, whole_file(tmp_path / name) as scratch:
        scratch.write_bytes(b"new")
    assert len(str(caught.value).splitlines()) == 1
    assert (tmp_path / "loop").is_symlink()
    assert (tmp_path / "file").read_bytes() == b"precious"
    assert {entry.name for entry in tmp_path.iterdir()} == {"loop", "file"}


def test_a_full_disk_while_firmware_is_written_is_the_systems_few_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(source: object, target: object, *more: object, **others: object) -> None:
        raise OSError(28, "No space left on device", str(target))

    monkeypatch.setattr("shutil.copyfile", full)
    with pytest.raises(ValueError, match=r"firmware cannot be written: No space left on device$"):
        fg.export.firmware(BOUNDED, tmp_path / "firmware")
    assert not list(tmp_path.iterdir())


def test_an_error_is_worded_by_its_number_wherever_that_stands() -> None:
    assert reason(OSError(28, "a whole paragraph")) == "No space left on device"
    assert reason(OSError([("a", "b", "[Errno 13] Permission denied: 'b'")])) == "Permission denied"
    assert reason(OSError("it is not a regular file")) == "it is not a regular file"


def test_a_sentence_is_one_line_whatever_names_are_in_it() -> None:
    assert one_line("α ≤ 1") == "α ≤ 1"
    assert one_line("x" * 5000 + ": it must be 1").endswith("xxx: it must be 1")
    assert len(one_line("x" * 5000)) < 900
    assert one_line("a\nb\r\u2028\x1b[0m\udcff") == r"a\nb\r\u2028\x1b[0m\udcff"
    with pytest.raises(fg.ScenarioError, match=r"^my\\nfile\.toml cannot be read: No such file or directory$"):
        fg.Scenario.load("my\nfile.toml")


# Every writer, in a process whose files may not grow beyond a limit: as on a full disk. Started with -B, because Python
# keeps a truncated bytecode file if the disk is full.
WRITE_ALL = """
import json, resource, sys
from pathlib import Path

import fracgyro as fg
import numpy as np
from fracgyro.analysis.plots import write_plot
from fracgyro.simulation.dataset import write_run

scenario = fg.Scenario.paper().replace({"run.duration": 12.0, "controller.switching_limit": 0.5})
run = fg.simulate(scenario.replace({"run.record_every": 10}))
integral = fg.fractional.pid(0.0, 1.0, 0.5, 0.0, 1.0, step=1e-3, longest=10.0)
scenario.save("scenario.toml")
np.savetxt("record.csv", np.random.default_rng(0).normal(size=200), header="x")
study = "scenario = 'scenario.toml'\\nvary.controller.order = {}\\n"
Path("sweep.toml").write_text(study.format([0.8, 0.9]))
goal = "[[objective]]\\nmetric = 'effort_x'\\n"
Path("tune.toml").write_text(study.format("{ low = 0.8, high = 0.9 }") + goal)

writers = {
    "run.nc": lambda path: write_run(run, path),
    "run.mat": run.fracgyro.to_mat,
    "run.png": lambda path: write_plot(run, path),
    "run.svg": lambda path: write_plot(run, path),
    "run.pdf": lambda path: write_plot(run, path),
    "saved.toml": scenario.save,
    "web.json": lambda path: fg.export.web(scenario, path),
    "gyro.fmu": lambda path: fg.export.fmu(scenario, path),
    "firmware": lambda path: fg.export.firmware(scenario, path),
    "matlab": lambda path: fg.export.matlab(scenario, path),
    "operator": lambda path: fg.export.operator(integral, path),
    "allan": lambda path: fg.rate.analyze_record("record.csv", path, rate=100.0),
    "sweep": lambda path: fg.study.sweep("sweep.toml", path),
    "tune": lambda path: fg.study.tune("tune.toml", path),
}
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
for name, write in writers.items():
    try:
        write(Path(name))
        print(json.dumps([name, "written"]))
    except ValueError as error:
        print(json.dumps([name, str(error)]))
"""


@pytest.mark.parametrize("limit", nightly_unless(lambda limit: limit == 2000, [300, 2000]))
def test_on_a_full_disk_every_writer_ends_in_one_sentence_and_leaves_no_file(tmp_path: Path, limit: int) -> None:
    command = [sys.executable, "-B", "-c", WRITE_ALL, str(limit)]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stderr[-2000:]
    said = dict(json.loads(line) for line in ran.stdout.splitlines())
    assert len(said) == 14
    for name, sentence in said.items():
        assert len(sentence.splitlines()) == 1
        assert ("File too large" in sentence) != (name == "gyro.fmu" and "c++ failed" in sentence), name
    files = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert files == {"scenario.toml", "record.csv", "sweep.toml", "tune.toml"}


# The command line, whose files may not grow beyond a limit.
FULL = "import resource, fracgyro.cli; resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0})); fracgyro.cli.main()"


@pytest.mark.parametrize("words", ["--out run.nc", "--plot run.pdf"])
def test_a_run_that_finds_no_room_on_the_disk_ends_with_exit_code_2(tmp_path: Path, words: str) -> None:
    command = [sys.executable, "-B", "-c", FULL.format(8192), "simulate", "--set", "run.duration=5.0", *words.split()]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=PATIENCE)
    assert (ran.returncode, ran.stderr) == (2, f"fracgyro: {words.split()[1]} cannot be written: File too large\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_finds_no_room_on_the_disk_is_no_success(tmp_path: Path, unbuffered: str) -> None:
    with open(tmp_path / "paper.toml", "w", encoding="utf-8") as out:
        ran = subprocess.run(
            [sys.executable, "-B", "-c", FULL.format(1000), "scenario", "paper"],
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
            timeout=PATIENCE,
        )
    assert (ran.returncode, ran.stderr) == (2, "fracgyro: the output cannot be written: File too large\n")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--plot", "run.xyz"], "run.xyz cannot be drawn: its suffix must be one of .svg, .png, .pdf"),
        (["--plot", "nowhere/run.svg"], "nowhere/run.svg cannot be written: No such file or directory"),
        (["--out", "nowhere/run.nc"], "nowhere/run.nc cannot be written: No such file or directory"),
        (["--out", "mine.toml"], "mine.toml cannot be written: its suffix must be one of .nc, .csv, .parquet, .mat"),
    ],
)
def test_a_run_does_not_begin_when_its_files_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], expected: str
) -> None:
    monkeypatch.chdir(tmp_path)
    PAPER.save("mine.toml")
    monkeypatch.setattr("fracgyro.simulation.simulate.simulate", lambda *_: pytest.fail("it ran"))
    ran = CliRunner().invoke(cli, ["simulate", *words])
    assert isinstance(ran.exception, ValueError)
    assert str(ran.exception) == expected
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
