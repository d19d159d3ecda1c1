"""The command line, in this process: any words and any files end with results, or with one sentence and exit code 2.

An input is JSON: the words, and files in the current folder in addition to those of `_furnish`.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import random
import re
import sys
import warnings
from pathlib import Path
from typing import Any

import fracgyro as fg
import fuzz_scenarios
import harness
import mutate
from fracgyro.cli import main
from fracgyro.scenario.messages import paths

FMU = importlib.import_module("fracgyro.export.fmu")
REPRODUCE = importlib.import_module("fracgyro_lab.paper.reproduce")

STUDY = '[fixed]\nrun.duration = 0.02\n[vary]\ncontroller.kind = ["linear", "fractional"]\n'
SCENARIOS = ["good.toml", "any.toml", "link.toml", "line\nbreak.toml", "\udcff.toml", "empty", "any.nc"]  # may be valid
FILES = [*SCENARIOS, "any.csv", "study.toml", "pipe", "loop", "folder", "full", "new"]
FILES += ["/dev/zero", "/dev/null", "/", "", ".", "nowhere/x", "x" * 300]
OUTS = [*FILES, "new.nc", "new.png", "new.svg", "new.json", "new.fmu", "good.toml/x", "new.mp3", "new.", "\udcff.nc"]
FIELDS = [path for path in paths(fg.Scenario) if path not in ("run.duration", "run.step", "run")]
LENGTHS = ["0.02", "0", "-1", "nan", "x", "1e400", "[1]", "", "0.001", "1e-400", "true", "{}"]
TARGETS = ["host", "m4f", "m7", "wasm", "fmu", "lanes", "toaster"]


def make(rng: random.Random) -> bytes:
    files = {"any.toml": fuzz_scenarios.make(rng).decode("latin-1"), "any.csv": _table(rng), "any.nc": _bytes(rng)}
    files["study.toml"] = mutate.damage(rng, STUDY.encode()).decode("latin-1") if rng.random() < 0.7 else STUDY
    (command,) = rng.choices(list(COMMANDS), [WEIGHTS[name] for name in COMMANDS])
    words = COMMANDS[command](rng)
    for _ in range(rng.choice([0, 0, 0, 0, 1, 2])):
        place = rng.randrange(len(words) + 1)
        word = rng.choice(
            ["--json", "--out", "--set", "--help", "-h", "--", "-", "", "--version", "--no", "x", "é", "\n"]
        )
        words[place:place] = [word]
    if rng.random() < 0.05:
        del words[rng.randrange(len(words))]
    return json.dumps({"words": words, "files": files}).encode()


def _bytes(rng: random.Random) -> str:
    return rng.choice([b"", b"\x89HDF\r\n\x1a\n", b"CDF\x01", rng.randbytes(rng.randrange(400))]).decode("latin-1")


def _table(rng: random.Random) -> str:
    rows = b"time,rate\n0,1\n0.001,2.5\n0.002,-1\n"
    return (mutate.damage(rng, rows) if rng.random() < 0.7 else rows).decode("latin-1")


def _setting(rng: random.Random) -> list[str]:
    if rng.random() < 0.1:
        words = rng.choice(["run.duration", "=", "", "x=1", "run.duration=" + "[" * 5000, "run=1", "==", "a.b.c=1"])
        return ["--set", words]
    if rng.random() < 0.15:
        return ["--set", f"{rng.choice(['run.duration', 'run.step'])}={rng.choice(LENGTHS)}"]
    field, value = rng.choice(FIELDS), mutate._value(mutate.extreme(rng))
    if field.endswith("file"):
        value = rng.choice(FILES)
    if "points" in field and rng.random() < 0.5:
        value = "[[0.0, 1.0], [1e-3, 2.0]]"
    return ["--set", f"{field}={value}"]


def _simulate(rng: random.Random) -> list[str]:
    words = ["simulate", *([rng.choice(FILES)] if rng.random() < 0.5 else []), "--set", "run.duration=0.02"]
    for _ in range(rng.choice([0, 1, 1, 2, 3])):
        words += _setting(rng)
    words += ["--out", rng.choice(OUTS)] if rng.random() < 0.25 else []
    words += ["--plot", rng.choice(OUTS)] if rng.random() < 0.08 else []
    return words + (["--json"] if rng.random() < 0.5 else [])


def _export(what: str) -> Any:
    def words(rng: random.Random) -> list[str]:
        more = rng.choice([[], [], ["--number", rng.choice(["float", "double", "half"])]]) if what != "web" else []
        if what == "fmu":
            more += ["--fmi", rng.choice(["2.0", "3.0", "9"])]
            more += rng.choice([[], ["--controller"], ["--controller", "--units", rng.choice(["V", "N"])]])
        return ["export", what, rng.choice(FILES), "--out", rng.choice(OUTS), *more]

    return words


COMMANDS: dict[str, Any] = {
    "simulate": _simulate,
    "scenario": lambda rng: ["scenario", rng.choice(["paper", "disc", "rocket", "--list", "", "paper-printed"])],
    "web": _export("web"),
    "firmware": _export("firmware"),
    "fmu": _export("fmu"),
    "replay": lambda rng: ["replay", rng.choice(FILES), "--target", rng.choice(TARGETS)],
    "sweep": lambda rng: ["sweep", rng.choice(FILES), "--out", rng.choice(OUTS), *rng.choice([[], ["--resume"]])],
    "tune": lambda rng: ["tune", rng.choice(FILES), "--out", rng.choice(OUTS), *rng.choice([[], ["--resume"]])],
    "rate": lambda rng: [
        "rate",
        rng.choice([name for name in FILES if name not in SCENARIOS]),
        "--out",
        rng.choice(OUTS),
    ],
    "zoo": lambda rng: ["zoo", rng.choice(["show", "check", "run"]), rng.choice(FILES)],
    "reproduce": lambda rng: ["reproduce", "--seeds", rng.choice(["0", "1", "-1", "x", "", "1e9"])],
}
# How often each is drawn, out of 100; a command without a weight is an error.
WEIGHTS = {"simulate": 50, "scenario": 5, "web": 9, "firmware": 6, "fmu": 5, "replay": 8, "sweep": 8, "tune": 4}
WEIGHTS |= {"rate": 3, "zoo": 1, "reproduce": 1}


def _furnish(folder: Path) -> None:
    scenario = fg.Scenario.paper().replace({"run.duration": 0.02, "controller.switching_limit": 0.5})
    scenario.save(folder / "good.toml")
    for name in ("line\nbreak.toml", "\udcff.toml"):
        (folder / name).write_bytes((folder / "good.toml").read_bytes())
    os.mkfifo(folder / "pipe")
    (folder / "loop").symlink_to("loop")
    (folder / "link.toml").symlink_to("good.toml")
    (folder / "folder").mkdir()
    (folder / "full").mkdir()
    (folder / "full" / "precious").write_bytes(b"precious")
    (folder / "empty").write_bytes(b"")


def _left_out(_: object) -> None:
    """Replacement for the work after the arguments have been accepted: a whole reproduction takes minutes."""
    sys.exit(0)


def check(case: bytes, folder: Path) -> str:
    given = json.loads(case)
    _furnish(folder)
    for name, text in given["files"].items():
        (folder / name).write_bytes(text.encode("latin-1"))
    precious = {p: p.read_bytes() for p in [folder / "good.toml", folder / "full" / "precious"]}
    FMU._binaries = lambda *_: {}  # compilers take seconds, and are not run here
    REPRODUCE.time_steps = _left_out
    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["fracgyro", *given["words"]]
    with warnings.catch_warnings(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        warnings.simplefilter("error")
        try:
            main()
            raise AssertionError("it returned")
        except SystemExit as stop:
            code = stop.code or 0
    said = err.getvalue()
    assert "Traceback" not in said, said
    assert code in (0, 2), (code, said)
    if code == 2:
        *before, line = said.split("\n")[:-1]
        if given["words"][0] == "check":  # every error
            assert all(each.startswith("fracgyro: ") and harness.is_sentence(each) for each in before), said
        else:  # a bar, if something was run
            assert not before or given["words"][0] in ("sweep", "tune"), said
        assert line.startswith("fracgyro: "), said
        assert harness.is_sentence(line), said
        assert out.getvalue() == "", out.getvalue()
    for path, data in precious.items():
        assert path.read_bytes() == data, path
    left = [path.name for path in folder.rglob(".*") if re.fullmatch(r"\.[0-9a-f]{32}(\.\w+)?", path.name)]
    assert not left, left
    return "worked" if code == 0 else "refused"


if __name__ == "__main__":
    harness.main(harness.Face(make, check))
