"""The board: laws that enter, laws that are refused, entries that are checked, and the page of all of them."""

from __future__ import annotations

import json
import math
import re
import socket
import struct
import sys
from pathlib import Path
from typing import Any, Literal

import fracgyro as fg
import numpy as np
import pytest
from browser import served, violations, watched
from click.testing import CliRunner
from command_server import fracgyro
from fracgyro.cli import cli
from fracgyro_lab.board.check import check, differences
from fracgyro_lab.board.enter import enter, write
from fracgyro_lab.board.entrant import Entrant, entrant
from fracgyro_lab.board.entry import Entry, read, schema
from fracgyro_lab.board.page import write_page
from fracgyro_lab.board.room import Limits
from fracgyro_lab.board.trial import knows_seeds
from fracgyro_lab.comparison.track_contenders import CONTENDERS
from jsonschema import Draft202012Validator
from shared import shared

ROOT = Path(__file__).resolve().parents[2]
BOARD = ROOT / "lab/board"
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has the limit, or the call of C")
PD = (BOARD / "pid_in_python.py").read_text(encoding="utf-8")
# A law without gains to tune, with a line to be replaced.
PLAIN = """
class Law:
    def __init__(self):
        pass  # begin

    def reset(self, scenario):
        pass  # reset

    def __call__(self, s):
        force = [a - 4e4 * e - 280 * d for a, e, d in zip(s.reference_acceleration, s.error, s.error_rate)]
        return force  # end
"""


def refusal(text: str, folder: Path, **limits: Any) -> str:
    """The sentence with which a law is refused."""
    path = folder / "bad.py"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(fg.ScenarioError) as error:
        enter(f"{path}:Law", limits=Limits(**limits))
    said = str(error.value)
    assert "\n" not in said
    assert str(folder) not in said
    start, _, reason = said.partition(" is refused: ")
    assert start == "bad.py:Law"
    return reason


def changed(place: str, *lines: str) -> str:
    """The plain law with lines instead of `pass  # place`, or before the `return`."""
    marks = {"begin": ("pass  # begin", 8), "reset": ("pass  # reset", 8), "end": ("return force  # end", 8)}
    mark, indent = marks[place]
    after = [mark] if place == "end" else []
    assert mark in PLAIN
    return PLAIN.replace(mark, f"\n{' ' * indent}".join([*lines, *after]))


# -- Laws that are refused -------------------------------------------------------------------------------------------


def test_a_law_that_raises_is_refused(tmp_path: Path) -> None:
    found = refusal(changed("end", "if s.time > 1: 1 / 0"), tmp_path)
    assert found == "the controller raised ZeroDivisionError: division by zero at t = 1.001"
    assert refusal(f"1 / 0\n{PLAIN}", tmp_path) == "bad.py cannot be run: ZeroDivisionError: division by zero"
    assert refusal(changed("end", "raise SystemExit"), tmp_path).startswith("it raised SystemExit")
    assert refusal(changed("end", "return 'left', 0.0"), tmp_path).endswith("it must return two finite numbers")


def test_a_law_that_loops_for_ever_is_refused(tmp_path: Path) -> None:
    found = refusal(changed("end", "while True: pass"), tmp_path, seconds=6.0)
    assert found == "it did not end within 6 s"
    assert refusal(f"while True: pass\n{PLAIN}", tmp_path, seconds=2.0) == "it did not end within 2 s"


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        (["open('x', 'w')"], "it opened x for writing; a law must not write files"),
        pytest.param(
            ["import os", "os.open('x', os.O_CREAT)"],
            "it opened x for writing; a law must not write files",
            marks=pytest.mark.nightly,
        ),
        pytest.param(
            ["import os", "os.mkdir('x')"],
            "it changed files (os.mkdir); a law must not write files",
            marks=pytest.mark.nightly,
        ),
        (["try: open('x', 'a')", "except Exception: pass"], "it opened x for writing; a law must not write files"),
        (
            ["import ctypes", "ctypes.CDLL(None).creat(b'x', 0o600)"],
            "it left x in its folder; a law must not write files",
        ),
        (["import socket", "socket.socket()"], "it opened a socket; a law must not use the network"),
        (["import subprocess", "subprocess.run(['true'])"], "it started a process; a law must not"),
        (["import os", "os.kill(os.getppid(), 0)"], "it sent a signal; a law must not"),
        (
            ["import gc", "gc.get_objects()"],
            "it searched the memory of its process; a law must not look for seeds",
        ),
        (["import os", "os._exit(3)"], "it ended its process, with code 3"),
    ],
    ids=["open", "os.open", "mkdir", "caught", "by C", "socket", "process", "signal", "memory", "exit"],
)
def test_a_law_that_leaves_its_room_is_refused(lines: list[str], found: str, tmp_path: Path) -> None:
    assert refusal(changed("begin", *lines), tmp_path) == found


@LINUX
def test_a_law_that_takes_much_memory_is_refused(tmp_path: Path) -> None:
    found = refusal(changed("begin", "self.held = bytearray(3 << 30)"), tmp_path, memory=2 << 30)
    assert found == "it needed more than 2048 MiB of memory"


@LINUX
def test_no_byte_can_be_written_even_by_c(tmp_path: Path) -> None:
    lines = ["import ctypes", "c = ctypes.CDLL(None)", f"f = c.open(b'{tmp_path}/out', 0o1101, 0o600)"]
    lines += ["assert f > 0 and c.write(f, b'abc', 3) == -1", "raise ValueError('it could not')"]
    assert refusal(changed("begin", *lines), tmp_path).endswith("raised ValueError: it could not")
    assert (tmp_path / "out").read_bytes() == b""


@LINUX
def test_a_server_of_this_machine_cannot_be_reached_even_by_c(entered: Path, tmp_path: Path) -> None:
    if not read(entered).own_network:
        pytest.skip("the system refuses network namespaces")
    with socket.create_server(("127.0.0.1", 0)) as server:
        place = struct.pack("=H", socket.AF_INET) + struct.pack("!H4B8x", server.getsockname()[1], 127, 0, 0, 1)
        lines = ["import ctypes", "c = ctypes.CDLL(None)", "s = c.socket(2, 1, 0)", f"place = {place!r}"]
        lines += ["raise ValueError(f'{s >= 0}, {c.connect(s, place, 16)}')"]
        found = changed("begin", *lines)
        scope: dict[str, Any] = {}
        exec(found, scope)
        with pytest.raises(ValueError, match=r"^True, 0$"):
            scope["Law"]()
        assert refusal(found, tmp_path).endswith("raised ValueError: True, -1")


def test_a_law_that_reads_a_seed_is_refused(tmp_path: Path) -> None:
    text = changed("reset", "self.seed = scenario.disturbance.seed").replace("a - 4e4 * e", "a - self.seed - 4e4 * e")
    found = refusal(text, tmp_path)
    assert found == "its force depends on disturbance.seed of the scenario; a law must not read seeds"


GUESSES = """
from fracgyro_lab.board.entrant import entrant
from fracgyro_lab.board.trial import base

import fracgyro as fg


def first(seed):
    found = []
    short = base("F").replace({"run.duration": 0.002, "disturbance.seed": seed})
    fg.simulate(short, controller=lambda s: found.append(s.position) or (0.0, 0.0))
    return found[0]


KNOWN = {first(seed) for seed in entrant(f"{__file__}:Law", "F").seeds("judging", 8)}
"""


def test_a_law_that_guesses_its_seeds_is_refused(tmp_path: Path) -> None:
    """It knows the noise of each of its seeds, and does well in those runs only."""
    text = changed("end", "if s.time == 0: self.known = s.position in KNOWN")
    text += "\n    known = False\n"
    text = text.replace("return force", "return force if self.known else [0.5 * each for each in force]")
    found = refusal(GUESSES + text, tmp_path)
    assert found == (
        "its error is smaller with the seeds of the entry than with secret ones; a law must not know its seeds"
    )


def test_a_law_that_is_not_deterministic_or_remembers_is_refused(tmp_path: Path) -> None:
    found = "two equal runs of it differ; a law must be deterministic and forget its earlier runs"
    text = changed("end", "import random", "force[0] += random.random()")
    assert refusal(text, tmp_path) == found
    text = changed("end", "self.times.append(0)", "force[0] += len(self.times)") + "    times = []\n"
    assert refusal(text, tmp_path) == found


def test_a_smaller_error_counts_as_knowledge_only_beyond_chance() -> None:
    random = np.random.default_rng(0)
    mine, secret = random.normal(0.0, 0.05, (2, 8))
    assert not knows_seeds(mine, secret)
    assert not knows_seeds(mine + 0.5, secret), "more error than with other seeds"
    assert knows_seeds(mine, secret + math.log(1.5))
    wide = random.normal(0.0, 2.0, 8)
    assert not knows_seeds(wide, wide[::-1] + math.log(1.5)), "a law near instability"
    assert knows_seeds(mine, np.full(8, math.inf))
    assert not knows_seeds(np.full(8, math.inf), secret)


def test_what_is_not_a_law_is_refused_before_anything_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("two.py")
    path.write_text("class A: pass\nclass B: pass\nclass _C: pass\n", encoding="utf-8")
    for given, said in {
        "pidd": 'the law is "pidd": it must be FILE.py or a compiled law; did you mean pid',
        "adrc": "--class is F: adrc takes part only in P",
        "no.py": "no.py cannot be read: No such file or directory",
        str(path): f"{path} has A, B: name one, as in two.py:NAME",
        f"{path}:C": f'the law is "{path}:C": it must be a class, a function or a variable of {path}',
    }.items():
        with pytest.raises(fg.ScenarioError) as error:
            enter(given)
        assert str(error.value).startswith(said)
    path.write_text("class A:\n", encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match=r"two\.py cannot be read: expected an indented block"):
        enter(str(path))


# -- Seeds -----------------------------------------------------------------------------------------------------------


def test_seeds_follow_from_hash_name_class_and_purpose(tmp_path: Path) -> None:
    path = tmp_path / "pd.py"
    path.write_text(PD, encoding="utf-8")
    mine = entrant(str(path), "F")
    assert mine.law == "pd.py:Pid"
    assert mine.seeds("judging", 8) == entrant(f"{path}:Pid", "F").seeds("judging", 8)
    other = entrant(str(path), "P").seeds("judging", 8)
    path.write_text(f"{PD}\n", encoding="utf-8")
    lists = [
        mine.seeds("judging", 8),
        mine.seeds("training", 8),
        other,
        entrant(str(path), "F").seeds("judging", 8),
    ]
    every = [seed for seeds in lists for seed in seeds]
    assert len(set(every)) == 32
    assert all(0 <= seed < 2**63 for seed in every)


def test_a_compiled_law_is_found_by_its_name_and_by_its_kind() -> None:
    assert entrant("fractional_fast_terminal", "F") == entrant("paper", "F")
    hashes = {entrant(each.name, each.classes[0]).sha256 for each in CONTENDERS}
    assert len(hashes) == len(CONTENDERS)


# -- Entries ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def entered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The entry of a law in Python that prints, next to it."""

    def fill(folder: Path) -> None:
        folder.mkdir()
        (folder / "pd.py").write_text(PD.replace("self.kp, self.kd = kp, kd", "self.kp, self.kd = kp, kd; print(kp)"))
        write(enter(str(folder / "pd.py"), author="A. Person"), folder / "pd.json")

    return shared(tmp_path_factory, "entered", fill) / "pd.json"


def test_an_entry_has_both_rows_their_distance_to_the_limit_and_every_change(entered: Path) -> None:
    entry = read(entered)
    assert (entry.law, entry.author, entry.setting.trials) == ("pd.py:Pid", "A. Person", 80)
    given, tuned = entry.rows.as_given, entry.rows.tuned
    assert given is not None
    assert tuned is not None
    assert given.gains == {}
    assert set(tuned.gains) == {"kp", "kd", "ki"}
    assert tuned.kept
    assert 0 < tuned.error.value < given.error.value
    assert tuned.over_limit is not None
    assert tuned.over_limit.steady > 1
    assert set(entry.robustness) > {"K +5 %", "noise x 3", "one step of hidden delay", "12 bit", "push"}
    assert entry.robustness["noise x 3"].value > 1
    assert len(entry.trace.error) == 60
    assert entered.stat().st_size < 5000


def test_an_entry_is_reproduced_by_its_law_and_no_other_numbers_are(entered: Path) -> None:
    again = check(entered)
    stated = read(entered)
    assert not list(differences(stated, again, {}))
    assert again.rows.tuned is not None
    for place, factor, said in (
        (("rows", "tuned", "error", "value"), 0.95, "rows.tuned.error.value is "),
        (("rows", "as_given", "chattering"), 1.1, "rows.as_given.chattering is "),
        (("robustness", "push", "value"), 0.8, "robustness.push is "),
    ):
        found = json.loads(entered.read_text())
        table = found
        for name in place[:-1]:
            table = table[name]
        table[place[-1]] *= factor
        (clause,) = differences(Entry.model_validate(found), again, {})
        assert clause.startswith(said)
    (clause,) = differences(stated, again, {"stated": math.log(1.0), "found": math.log(1.25)})
    assert clause.startswith("the tuned gains are better than those of the search by a factor of 1.25: ")
    moved = json.loads(entered.read_text())
    moved["seeds"]["judging"][0] += 1
    assert list(differences(Entry.model_validate(moved), again, {})) == ["the seeds are not those of its hash"]


def test_an_entry_of_another_file_is_refused(entered: Path, tmp_path: Path) -> None:
    (tmp_path / "pd.json").write_bytes(entered.read_bytes())
    (tmp_path / "pd.py").write_text(PD + "\n", encoding="utf-8")
    with pytest.raises(fg.ScenarioError, match=r"pd\.json: sha256 is [0-9a-f]{12}\.\.\., but pd\.py has "):
        check(tmp_path / "pd.json")


def test_the_command_writes_an_entry_and_checks_it(tmp_path: Path) -> None:
    ran = fracgyro("enter", "linear", "--out", "linear.json", cwd=tmp_path)
    assert (ran.returncode, ran.stdout.splitlines()[-1]) == (0, "Entry: linear.json")
    assert read(tmp_path / "linear.json").law == "linear"
    ran = fracgyro("enter", "--check", "linear.json", cwd=tmp_path)
    assert (ran.returncode, ran.stdout.splitlines()[-1]) == (0, "linear.json: reproduced")
    ran = fracgyro("enter", "linear", cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (2, "fracgyro: --out is missing: name the JSON file of the entry\n")


ENTRIES = sorted(BOARD.glob("*.json"))


def complaints(found: Any) -> list[str]:
    return [error.message for error in Draft202012Validator(schema()).iter_errors(found)]


def test_the_command_prints_the_schema() -> None:
    ran = CliRunner().invoke(cli, ["schema", "entry"])
    assert json.loads(ran.stdout) == schema()
    Draft202012Validator.check_schema(schema())


@pytest.mark.parametrize("path", ENTRIES, ids=lambda path: path.stem)
def test_an_entry_of_the_board_is_valid_and_its_seeds_are_its_own(path: Path) -> None:
    entry = read(path)
    assert complaints(json.loads(path.read_text(encoding="utf-8"))) == []
    assert entry.to_json() == path.read_text(encoding="utf-8")
    information = entry.setting.information
    who = Entrant(entry.law, "", information, None, entry.sha256)
    assert entry.seeds.training == who.seeds("training", 4)
    assert entry.seeds.judging == who.seeds("judging", 8)
    file, colon, _ = entry.law.partition(":")
    if colon:
        assert entrant(f"{BOARD / file}", information).sha256 == entry.sha256


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"format": 1', '"format": 2'),
        ('"information": "F"', '"information": "X"'),
        ('"lost": 0', '"lost": -1'),
        ('"own_network"', '"network"'),
        ('"kept": true', '"kept": "yes"'),
    ],
)
def test_what_is_not_an_entry_is_refused_by_reader_and_schema(old: str, new: str, tmp_path: Path) -> None:
    text = (BOARD / "pid.json").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "bad.json"
    path.write_text(text.replace(old, new), encoding="utf-8")
    assert complaints(json.loads(path.read_text()))
    with pytest.raises(fg.ScenarioError, match=r"bad\.json is not an entry of the board: "):
        read(path)


# -- The page --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("board")
    assert write_page(BOARD, folder, ROOT / "benchmarks/results/flops.md") == len(ENTRIES)
    return folder


def test_the_page_has_every_entry_in_order_and_the_operations_that_are_counted(page: Path) -> None:
    text = (page / "index.html").read_text(encoding="utf-8")
    rows = re.findall(r'<tr id="(\w+)".*?</tr>', text, re.DOTALL)
    assert sorted(rows) == [path.stem for path in ENTRIES]
    errors = [read(BOARD / f"{name}.json").best.error.value for name in rows]
    finite = [error for error in errors if error is not None]
    assert finite == sorted(finite)
    (pid,) = re.findall(r'<tr id="pid".*?</tr>', text, re.DOTALL)
    log = (ROOT / "benchmarks" / "results" / "flops.md").read_text(encoding="utf-8")
    (flops,) = re.findall(r"^\| `pid` \| – \| positions and velocities \|.* \*\*(\d+)\*\* \|", log, re.MULTILINE)
    assert f'<td data-value="{flops}">{flops}</td>' in pid
    assert text.count('class="limit"') == len({read(path).setting.information for path in ENTRIES})


def test_a_text_of_an_entry_cannot_become_markup(tmp_path: Path) -> None:
    found = json.loads((BOARD / "pid.json").read_text(encoding="utf-8"))
    found["words"], found["author"] = "<b onclick=1>&", "</td><script>alert(1)</script>"
    (tmp_path / "pid.json").write_text(json.dumps(found), encoding="utf-8")
    write_page(tmp_path, tmp_path / "out")
    text = (tmp_path / "out/index.html").read_text(encoding="utf-8")
    assert text.count("<script>") == 1
    assert "<b onclick" not in text


def test_an_entry_of_a_law_that_has_changed_is_marked(tmp_path: Path) -> None:
    text = (BOARD / "pid.json").read_text(encoding="utf-8")
    remarks = []
    for sha in (entrant("pid", "F").sha256, "0" * 64):
        (tmp_path / "pid.json").write_text(text.replace(read(BOARD / "pid.json").sha256, sha), encoding="utf-8")
        write_page(tmp_path, tmp_path / "out")
        remarks.append("the law has changed since" in (tmp_path / "out/index.html").read_text(encoding="utf-8"))
    assert remarks == [False, True]


def test_a_folder_without_entries_is_refused(tmp_path: Path) -> None:
    with pytest.raises(fg.ScenarioError, match="has no entries: they are JSON files of `fracgyro enter`"):
        write_page(tmp_path, tmp_path / "out")


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 400)])
def test_the_page_can_be_sorted_filtered_and_read(
    browser: Any, page: Path, scheme: Literal["light", "dark"], width: int
) -> None:
    with served(page) as address:
        tab = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        faults = watched(tab, address)
        tab.goto(f"{address}index.html")
        assert violations(tab) == []
        assert tab.evaluate("document.documentElement.scrollWidth") <= width

        def names() -> list[str]:
            shown: list[str] = tab.evaluate("[...document.querySelectorAll('tbody tr:not([hidden])')].map(r => r.id)")
            return shown

        entries = {path.stem: read(path) for path in ENTRIES}
        tab.click("th button:text('Error, q0')")
        shown = set()
        for information in ("P", "F"):
            tab.check(f"input[value={information}]")
            assert {entries[name].setting.information for name in names()} == {information}
            shown |= set(names())
        assert shown == entries.keys()
        known = [name for name in names() if entries[name].best.error.value is not None]
        errors = [entries[name].best.error.value for name in known]
        assert errors == sorted(errors, reverse=True)
        tab.click("th button:text('Law')")
        assert [entries[name].law for name in names()] == sorted(entries[name].law for name in names())
        tab.uncheck("input[value=compiled]")
        assert names() == ["pid_in_python"]
        assert tab.inner_text("#count") == "1"
        assert faults == []
