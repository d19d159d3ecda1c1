"""Logs and the sources they were made from: the dependencies of a log, and outdated logs."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "benchmarks"))

import sources  # noqa: E402


def of(script: str, log: str = "") -> set[str]:
    return {str(path.relative_to(ROOT)) for path in sources.sources(ROOT / script, log)}


def forget() -> None:
    for function in vars(sources).values():
        if hasattr(function, "cache_clear"):
            function.cache_clear()


def edit(path: Path, before: str, after: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after), encoding="utf-8")
    forget()


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A repository with one benchmark, one module and the core in two headers, of which one is an alternative."""
    files = {
        "benchmarks/speed.py": "import fracgyro as fg\n\nMEASURES_CODE = True\nDEPENDS_ON = ['pid']\n"
        'print(fg.simulate(2.0), "two words")\n',
        "benchmarks/error.py": 'import fracgyro as fg\n\nDEPENDS_ON = ["pid"]\nprint(fg.simulate(2.0), fg.draw())\n',
        "benchmarks/golden.py": "import fracgyro as fg\n\nprint(fg.simulate(1.0))\n",
        "benchmarks/golden.json": '{"core: kernel": "1", "pid: exact": "2", "lqg: exact": "3", "pid: late": "refused"}',
        "python/fracgyro/__init__.py": "",
        "python/fracgyro/__init__.pyi": "from .run import simulate as simulate\nfrom .page import draw as draw\n",
        "python/fracgyro/run.py": 'from . import _core\n\ndef simulate(x):\n    """Once."""\n    return 3 * x\n',
        "python/fracgyro/page.py": "def draw(): ...\n",
        "bindings/module.cpp": '#include "fracgyro/controllers/registry.hpp"\n',
        "include/fracgyro/controllers/registry.hpp": '#include "fracgyro/controllers/pid.hpp"\n#include "lqg.hpp"\n',
        "include/fracgyro/controllers/pid.hpp": 'double pid = 2.0;  // its gain\nauto words = "Gain of it.";\n',
        "include/fracgyro/controllers/lqg.hpp": "double lqg = 3.0;\n",
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    (tmp_path / "benchmarks/results").mkdir()
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    forget()
    yield tmp_path
    forget()


def test_a_log_depends_on_what_its_script_imports_and_on_the_headers_below_it() -> None:
    assert {
        "benchmarks/firmware.py",
        "python/fracgyro/scenario/shipped/dual_mass.toml",
        "bindings/bind_loop.cpp",
        "include/fracgyro/estimation/joint.hpp",
        "include/fracgyro/core/covariance.hpp",  # included by joint.hpp
    } <= of("benchmarks/firmware.py")
    found = of("lab/compare.py")
    assert {"lab/compare.py", "lab/fracgyro_lab/comparison/plan.py"} <= found
    covered = (".hpp", "dual_mass.toml", "to_core.py", "allan.py")  # by golden runs
    assert not [name for name in found if name.endswith(covered)]
    soak = ROOT / "benchmarks/soak.py"
    assert "benchmarks/soak.cpp" in of("benchmarks/soak.py", "soak_joint")
    joint = sources.golden(soak, "soak_joint").keys() - sources.golden(soak, "soak").keys()
    assert joint
    assert all(name.startswith("sliding_mode, joint: ") for name in joint)
    assert {
        "fpga/benchmarks/fpga.py",  # that fpga_fixed.py imports
        "fpga/fracgyro_fpga/schedule.py",
        "fpga/fracgyro_fpga/cpp/trace.hpp",
        "fpga/fracgyro_fpga/verilog/controller.v.jinja",
        "fpga/tests/units.cpp",
        "python/fracgyro/export/compilers.py",
    } <= of("fpga/benchmarks/fpga_fixed.py")


def test_a_log_does_not_depend_on_controllers_it_does_not_use_nor_on_what_writes_logs() -> None:
    assert not of("benchmarks/rate_sensor.py") & {"python/fracgyro/study/sweep/run.py", "benchmarks/machine.py"}
    park, joint = (f"include/fracgyro/{name}.hpp" for name in ("controllers/park_horowitz", "estimation/joint"))
    assert park not in of("benchmarks/firmware.py")
    assert not {park, joint} & of("benchmarks/batch.py")
    names = {script: sources.golden(ROOT / script) for script in ("lab/compare.py", "benchmarks/rate_estimation.py")}
    assert {"park_horowitz: park_horowitz, exact", "sliding_mode, joint: linear, exact"} <= names[
        "lab/compare.py"
    ].keys()
    assert not [name for name in names["benchmarks/rate_estimation.py"] if "joint" in name or "park" in name]


def test_every_log_has_a_script_and_every_script_a_log() -> None:
    committed = {f"benchmarks/results/{path.name}" for path in (ROOT / "benchmarks/results").glob("*.md")}
    assert committed | set(sources.ELSEWHERE.values()) == set(sources.scripts())
    for log, script in sources.scripts().items():
        of_revisions = script.stem == "size"  # which no file of this one changes
        several = len(sources.sources(script, log)) > 1 or sources.golden(script, log)
        assert of_revisions or several, f"{log} states nothing that it depends on"


@pytest.mark.parametrize(
    ("name", "before", "after", "behind"),
    [
        ("include/fracgyro/controllers/pid.hpp", "// its gain", "/* another */", False),
        ("include/fracgyro/controllers/pid.hpp", "double pid = ", "double  pid\n=", False),
        ("include/fracgyro/controllers/pid.hpp", "Gain of it.", "Gain of the PID.", False),
        ("include/fracgyro/controllers/pid.hpp", "2.0", "2.5", True),
        ("include/fracgyro/controllers/lqg.hpp", "3.0", "3.5", False),
        ("bindings/module.cpp", "registry", "pid", True),
        ("python/fracgyro/run.py", "Once.", "Once, exactly.", False),
        ("python/fracgyro/run.py", "    return", "    # one run\n    return", False),
        ("python/fracgyro/run.py", "3 * x", "4 * x", True),
        ("python/fracgyro/page.py", "...", "pass", False),
        ("benchmarks/speed.py", "two words", "three words", True),
        ("benchmarks/speed.py", "'pid'", "'pid', 'lqg'", True),
        ("benchmarks/golden.json", '"2"', '"4"', False),
    ],
)
def test_a_log_is_behind_only_after_a_change_that_its_numbers_may_depend_on(
    tree: Path, name: str, before: str, after: str, behind: bool
) -> None:
    log, script = tree / "benchmarks/results/speed.md", tree / "benchmarks/speed.py"
    assert sources.behind()["benchmarks/results/speed.md"] == "is missing"
    log.write_text("# Speed\n", encoding="utf-8")
    assert sources.behind()["benchmarks/results/speed.md"] == "does not state its sources"
    log.write_text(f"# Speed\n\n{sources.stamp(script)}\n", encoding="utf-8")
    assert "benchmarks/results/speed.md" not in sources.behind()
    edit(tree / name, before, after)
    assert ("benchmarks/results/speed.md" in sources.behind()) == behind


@pytest.mark.parametrize(
    ("name", "before", "after", "behind"),
    [
        ("include/fracgyro/controllers/pid.hpp", "2.0", "2.5", False),
        ("bindings/module.cpp", "registry", "pid", False),
        ("python/fracgyro/run.py", "3 * x", "x * 3", False),
        ("python/fracgyro/page.py", "...", "pass", True),
        ("benchmarks/error.py", "2.0", "3.0", True),
        ("benchmarks/golden.json", '"1"', '"4"', True),
        ("benchmarks/golden.json", '"2"', '"4"', True),
        ("benchmarks/golden.json", '"3"', '"4"', False),
        ("benchmarks/golden.json", '"refused"}', '"refused", "pid: faster": "5"}', False),
        ("benchmarks/golden.json", '"refused"}', '"5"}', True),
        ("benchmarks/golden.json", '"core: kernel": "1", ', "", True),
    ],
)
def test_a_log_of_simulated_numbers_is_behind_if_a_golden_run_has_changed_but_not_if_one_is_new(
    tree: Path, name: str, before: str, after: str, behind: bool
) -> None:
    log, script = tree / "benchmarks/results/error.md", tree / "benchmarks/error.py"
    log.write_text(f"# Error\n\n{sources.stamp(script)}\n", encoding="utf-8")
    assert "with the first 4 golden runs" in log.read_text(encoding="utf-8")
    assert "benchmarks/results/error.md" not in sources.behind()
    edit(tree / name, before, after)
    assert ("benchmarks/results/error.md" in sources.behind()) == behind


@pytest.mark.parametrize("entry", ["pidd", "pyproject.toml"])
def test_a_dependency_that_is_neither_a_controller_nor_a_pattern_is_reported(tree: Path, entry: str) -> None:
    script = tree / "benchmarks/speed.py"
    script.write_text(f'DEPENDS_ON = ["{entry}"]\n', encoding="utf-8")
    with pytest.raises(SystemExit, match=re.escape(f"speed.py: DEPENDS_ON has {entry}, which no header is called")):
        sources.sources(script)


def test_dependencies_are_assigned_once(tree: Path) -> None:
    script = tree / "benchmarks/speed.py"
    script.write_text('DEPENDS_ON = ["pid"]\nDEPENDS_ON += ["lqg"]\n', encoding="utf-8")
    with pytest.raises(SystemExit, match=re.escape("speed.py: DEPENDS_ON must be assigned once")):
        sources.sources(script)


def test_a_log_made_with_arguments_is_not_the_log(tree: Path) -> None:
    stamp = sources.stamp(tree / "benchmarks/speed.py", ["--seeds", "2"])
    (tree / "benchmarks/results/speed.md").write_text(f"# Speed\n\n{stamp}\n", encoding="utf-8")
    assert sources.behind()["benchmarks/results/speed.md"] == "was made with --seeds 2"


def test_messages_of_exceptions_do_not_count(tmp_path: Path) -> None:
    texts = []
    for message in ("mass is negative", "mass must be positive"):
        path = tmp_path / f"{len(message)}.py"
        path.write_text(f"if mass < 0:\n    raise ValueError('{message}')\n", encoding="utf-8")
        texts.append(sources.tokens(path))
    assert texts[0] == texts[1]


def test_a_pattern_that_matches_no_file_is_reported(tree: Path) -> None:
    script = tree / "benchmarks/speed.py"
    script.write_text('DEPENDS_ON = ["bindings/*.hpp"]\n', encoding="utf-8")
    with pytest.raises(SystemExit, match=re.escape("benchmarks/speed.py: DEPENDS_ON has bindings/*.hpp")):
        sources.sources(script)


def test_the_golden_runs_have_the_committed_hashes() -> None:
    """If a hash must change, python benchmarks/golden.py writes the new ones, and the logs that need it are behind."""
    import golden

    committed = json.loads((ROOT / sources.GOLDEN).read_text(encoding="utf-8"))
    found = golden.golden()
    assert [name for name in found if not golden.same(committed.get(name), found[name])] == []
    assert committed.keys() == found.keys()


@pytest.mark.nightly
@pytest.mark.parametrize("program", sorted(path.name for path in (ROOT / "benchmarks").glob("*.cpp")))
def test_the_programs_of_the_benchmarks_fit_the_core(program: str) -> None:
    """Their flags do not matter: they need no more than to be valid."""
    numbers = ["-DNUMBER=double"] if program == "soak.cpp" else []
    words = ["-std=c++20", "-fsyntax-only", "-w", f"-I{ROOT / 'include'}", *numbers, str(ROOT / "benchmarks" / program)]
    ran = subprocess.run(["c++", *words], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr[:2000]


def test_the_list_needs_no_library_and_fails_only_when_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = subprocess.run(
        [sys.executable, "-I", "-S", "benchmarks/sources.py"], cwd=ROOT, capture_output=True, text=True
    )
    assert listed.returncode == 0, listed.stderr
    late = sources.behind()
    assert [line.split()[0] for line in listed.stdout.splitlines()[:-1]] == list(late)
    monkeypatch.setattr(sources, "behind", lambda: late)
    monkeypatch.setattr(sys, "argv", ["sources.py"])
    assert sources.main() == 0
    monkeypatch.setattr(sys, "argv", ["sources.py", "--check"])
    assert sources.main() == bool(late)


def test_a_log_that_does_not_exist_is_refused_by_its_name() -> None:
    ran = subprocess.run([sys.executable, "benchmarks/bench.py", "rates"], cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 2
    assert "no log is called rates: names are accelerations, " in ran.stderr
