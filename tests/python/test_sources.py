"""Logs and the sources they were made from: the dependencies of a log, and outdated logs."""

from __future__ import annotations

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
    for function in (sources._tree, sources.tokens, sources.digest):
        function.cache_clear()


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A repository with one benchmark, one module and the core in two headers, of which one is an alternative."""
    files = {
        "benchmarks/speed.py": 'import fracgyro as fg\n\nDEPENDS_ON = ["pid"]\nprint(fg.simulate(2.0), "two words")\n',
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
    found = of("benchmarks/rate_sensor.py")
    assert {
        "benchmarks/rate_sensor.py",
        "python/fracgyro/rate/allan.py",
        "python/fracgyro/scenario/shipped/dual_mass.toml",
        "bindings/bind_loop.cpp",
        "include/fracgyro/estimation/joint.hpp",
        "include/fracgyro/core/covariance.hpp",  # included by joint.hpp
    } <= found
    joint = of("benchmarks/soak.py", "soak_joint")
    assert "include/fracgyro/estimation/joint.hpp" in joint - of("benchmarks/soak.py", "soak")
    assert "benchmarks/soak.cpp" in joint
    assert {
        "fpga/benchmarks/fpga.py",  # that fpga_fixed.py imports
        "fpga/fracgyro_fpga/schedule.py",
        "fpga/fracgyro_fpga/cpp/trace.hpp",
        "fpga/fracgyro_fpga/verilog/controller.v.jinja",
        "fpga/tests/units.cpp",
        "python/fracgyro/export/compilers.py",
    } <= of("fpga/benchmarks/fpga_fixed.py")


def test_a_log_does_not_depend_on_controllers_it_does_not_use_nor_on_what_writes_logs() -> None:
    park, joint = (f"include/fracgyro/{name}.hpp" for name in ("controllers/park_horowitz", "estimation/joint"))
    assert not of("benchmarks/rate_sensor.py") & {park, "python/fracgyro/study/sweep/run.py", "benchmarks/machine.py"}
    assert {park, joint} <= of("lab/compare.py")
    assert joint not in of("benchmarks/rate_estimation.py") | of("benchmarks/kernel_design.py")


def test_every_log_has_a_script_and_every_script_a_log() -> None:
    committed = {f"benchmarks/results/{path.name}" for path in (ROOT / "benchmarks/results").glob("*.md")}
    assert committed | set(sources.ELSEWHERE.values()) == set(sources.scripts())
    for log, script in sources.scripts().items():
        of_revisions = script.stem == "size"  # which no file of this one changes
        assert of_revisions or len(sources.sources(script, log)) > 1, f"{log} states nothing that it depends on"


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
        ("benchmarks/speed.py", '"pid"', '"pid", "lqg"', True),
    ],
)
def test_a_log_is_behind_only_after_a_change_that_its_numbers_may_depend_on(
    tree: Path, name: str, before: str, after: str, behind: bool
) -> None:
    log, script = tree / "benchmarks/results/speed.md", tree / "benchmarks/speed.py"
    found = sources.behind()
    assert found.pop("benchmarks/results/speed.md") == "is missing"
    log.write_text("# Speed\n", encoding="utf-8")
    assert sources.behind()["benchmarks/results/speed.md"] == "does not state its sources"
    log.write_text(f"# Speed\n\n{sources.stamp(script)}\n", encoding="utf-8")
    assert "benchmarks/results/speed.md" not in sources.behind()
    text = (tree / name).read_text(encoding="utf-8")
    assert before in text
    (tree / name).write_text(text.replace(before, after), encoding="utf-8")
    forget()
    assert ("benchmarks/results/speed.md" in sources.behind()) == behind


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


def test_the_list_needs_no_library_and_fails_only_when_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = subprocess.run(
        [sys.executable, "-I", "-S", "benchmarks/sources.py"], cwd=ROOT, capture_output=True, text=True
    )
    assert listed.returncode == 0, listed.stderr
    late = sources.behind()
    assert [line.split()[0] for line in listed.stdout.splitlines()[:-1]] == list(late)
    monkeypatch.setattr(sys, "argv", ["sources.py"])
    assert sources.main() == 0
    monkeypatch.setattr(sys, "argv", ["sources.py", "--check"])
    assert sources.main() == bool(late)


def test_a_log_that_does_not_exist_is_refused_by_its_name() -> None:
    ran = subprocess.run([sys.executable, "benchmarks/bench.py", "rates"], cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 2
    assert "no log is called rates: names are batch, " in ran.stderr
