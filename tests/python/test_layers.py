"""Allowed includes and imports: dependencies point down, and the core needs nothing that firmware lacks."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "include"
PACKAGES = {
    "fracgyro": ROOT / "python/fracgyro",
    "fracgyro_fpga": ROOT / "fpga/fracgyro_fpga",
    "fracgyro_lab": ROOT / "lab/fracgyro_lab",
}
# The folders of include/fracgyro, each with the other folders that it may include.
CONTROL = {"core", "control"}
LAYERS = {
    "core": set(),
    "plant": {"core"},
    "control": {"core"},
    "estimation": CONTROL,
    "hardware": CONTROL,
    "controllers": CONTROL | {"estimation", "hardware"},
}
LAYERS["sim"] = set(LAYERS)
FIRMWARE = {"core", "control", "estimation", "hardware", "controllers"}

# No heap, no exceptions, no I/O, no libm except in scalar.hpp.
FIRMWARE_STANDARD = {"array", "bit", "concepts", "cstddef", "cstdint", "limits", "type_traits", "utility"}
# For lists of fields and controllers, which firmware never asks for.
LISTS_STANDARD = {"span", "string_view", "tuple", "variant"}
EXACT_LIBM = {"sqrt", "fabs", "copysign"}  # by IEEE 754
FORBIDDEN_WORDS = {"new", "delete", "malloc", "free", "throw", "try", "catch", "virtual", "typeid"}


def sources(folder: str) -> list[Path]:
    found = sorted(path for path in (ROOT / folder).rglob("*") if path.suffix in (".hpp", ".cpp"))
    assert found, f"{folder} has no sources"
    return found


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def code(path: Path) -> str:
    """Without comments and the contents of strings."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r'(?<!include )"(\\.|[^"\\\n])*"', '""', text)


def includes(path: Path) -> list[tuple[str, str]]:
    """(`<` or `\"`, name) of each."""
    return re.findall(r'#\s*include\s*([<"])([^>"]+)[>"]', path.read_text(encoding="utf-8"))


def is_standard(header: str) -> bool:
    return re.fullmatch(r"[a-z_]+", header) is not None


def is_ours(header: str) -> bool:
    return (INCLUDE / header).is_file()


HEADERS = [path for layer in LAYERS for path in sources(f"include/fracgyro/{layer}")]
in_firmware = pytest.mark.parametrize("path", [p for p in HEADERS if p.parent.name in FIRMWARE], ids=name)


def test_every_header_belongs_to_a_layer_and_no_two_share_a_name() -> None:
    assert sorted(HEADERS) == sources("include")
    assert len({path.name for path in HEADERS}) == len(HEADERS), "EQUATIONS.md and comments name headers by file name"


@pytest.mark.parametrize("path", HEADERS, ids=name)
def test_a_header_includes_its_layer_and_those_below(path: Path) -> None:
    below = LAYERS[path.parent.name] | {path.parent.name}
    for bracket, header in includes(path):
        if bracket == '"':
            assert is_ours(header), header
            assert header.split("/")[1] in below, header
        else:
            instructions = path.name in ("lanes.hpp", "random.hpp") and header in ("immintrin.h", "emmintrin.h")
            assert is_standard(header) or instructions


def test_the_headers_include_one_another_without_a_cycle() -> None:
    left = {name(path): {f"include/{h}" for bracket, h in includes(path) if bracket == '"'} for path in HEADERS}
    while free := [header for header, needed in left.items() if not needed & left.keys()]:
        for header in free:
            del left[header]
    assert not left


@in_firmware
def test_what_firmware_compiles_includes_a_few_headers_without_code(path: Path) -> None:
    for bracket, header in includes(path):
        if bracket == "<":
            allowed = FIRMWARE_STANDARD | LISTS_STANDARD | ({"cmath"} if path.name == "scalar.hpp" else set())
            assert header in allowed


@in_firmware
def test_what_firmware_compiles_neither_allocates_nor_throws(path: Path) -> None:
    words = set(re.findall(r"\w+", code(path)))
    assert not words & FORBIDDEN_WORDS


@in_firmware
def test_what_firmware_compiles_calls_no_libm_that_may_round_differently_elsewhere(path: Path) -> None:
    text = code(path)
    called = set(re.findall(r"std::(\w+)\s*\(", text))
    casts = {"size_t", "int32_t", "int64_t", "uint64_t", "string_view"}
    assert called - casts <= (EXACT_LIBM if path.name == "scalar.hpp" else set())
    # Without std:: as well: only the core's own functions have these meanings.
    assert not re.search(r"(?<![\w.:])(pow|sin|cos|tan|exp2?|log2?|sqrt|tgamma|floor|round)f?\s*\(", text)


@in_firmware
def test_what_firmware_compiles_keeps_no_mutable_globals(path: Path) -> None:
    for line in code(path).splitlines():
        if re.match(r"\s*(inline|static|thread_local|extern)\s", line) and "(" not in line:
            assert "constexpr" in line, line


@pytest.mark.parametrize("path", sources("bindings"), ids=name)
def test_the_bindings_include_the_headers_and_nanobind(path: Path) -> None:
    for bracket, header in includes(path):
        if bracket == "<":
            allowed = header.startswith("nanobind/") or (path.name, header) == ("memory.hpp", "sys/mman.h")
            assert is_standard(header) or allowed
        else:
            assert is_ours(header) or (path.parent / header).is_file(), header


OTHERS = [path for of in ("fmu", "lanes", "web") for path in sources(f"integrations/{of}")]


@pytest.mark.parametrize("path", OTHERS, ids=name)
def test_an_integration_includes_the_headers_itself_and_the_standard_it_speaks(path: Path) -> None:
    for bracket, header in includes(path):
        if bracket == "<":
            assert is_standard(header)
        else:
            made_or_fmi = {"exported.hpp", "fmi2Functions.h", "fmi3Functions.h"}
            assert header in made_or_fmi or is_ours(header) or (path.parent / header).is_file(), header


@pytest.mark.parametrize("path", sources("fpga"), ids=name)
def test_the_room_of_hardware_includes_the_headers_itself_and_what_simulates_it(path: Path) -> None:
    for bracket, header in includes(path):
        if bracket == "<":
            assert is_standard(header)
        else:
            simulated = re.fullmatch(r"V\w+\.h|verilated\.h|controller\.h", header)
            own = (ROOT / "fpga/fracgyro_fpga/cpp" / header).is_file()
            assert simulated or own or is_ours(header), header


def test_firmware_needs_the_core_alone() -> None:
    (path,) = sources("integrations/firmware")
    for bracket, header in includes(path):
        assert header == "fracgyro.h" if bracket == '"' else is_standard(header)


def test_matlab_needs_the_interface_of_the_firmware_alone() -> None:
    (path,) = sources("integrations/matlab")
    for bracket, header in includes(path):
        assert header in {"fracgyro.h", "mex.h"} if bracket == '"' else is_standard(header)


@pytest.mark.parametrize("path", sources("tests/cpp"), ids=name)
def test_the_core_tests_need_neither_the_bindings_nor_python(path: Path) -> None:
    for bracket, header in includes(path):
        if bracket == "<":
            assert is_standard(header) or header == "gtest/gtest.h"
        else:
            assert "bindings" not in header
            assert ".." not in header


def imported(path: Path) -> set[str]:
    """First parts of absolute imports, anywhere in the file."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").partition(".")[0])
    return found


@pytest.mark.parametrize("path", sorted(p for at in PACKAGES.values() for p in at.rglob("*.py")), ids=name)
def test_a_package_imports_nothing_that_is_not_installed_with_it(path: Path) -> None:
    assert not imported(path) & {"tests", "benchmarks", "pytest", "hypothesis", "mpmath", "numba", "conftest"}


@pytest.mark.parametrize("of", PACKAGES)
def test_of_our_packages_only_the_library_is_imported_by_another(of: str) -> None:
    paths = [path for ending in ("py", "pyi") for path in PACKAGES[of].rglob(f"*.{ending}")]
    ours = {each for path in paths for each in imported(path) if each.partition("_")[0] == "fracgyro"}
    assert ours <= {"fracgyro", of}


@pytest.mark.parametrize("room", sorted(set(PACKAGES) - {"fracgyro"}))
def test_a_room_of_its_own_imports_the_library_and_no_other_room(room: str) -> None:
    found = set().union(*(imported(path) for path in PACKAGES[room].rglob("*.py")))
    assert "fracgyro" in found
    assert not found & set(PACKAGES) - {room, "fracgyro"}


# The rooms of each package from the ground up, and of a room that has rooms within it. A room imports itself and rooms
# of the lines before its own; "" is the package or the room itself: its __init__ and its stub.
LIBRARY = [
    ["_core", "files", "arguments", "extras"],
    ["fractional"],
    ["scenario"],
    ["simulation"],
    ["analysis", "export", "interop"],
    ["rate", "study"],
    ["devices"],
    ["identification"],
    ["", "cli"],
    ["__main__"],
]
STUDY = [
    ["cluster", "controller", "folder", "preview", "sums"],
    ["space"],
    ["file"],
    ["sweep", "tune"],
    ["", "json_schema", "reference"],
]
LAB = [["verdicts"], ["comparison", "paper"], ["board"], ["zoo"], ["", "commands"]]
ROOMS = {"fracgyro": LIBRARY, "fracgyro.study": STUDY, "fracgyro_lab": LAB}


def package(name: str) -> dict[str, set[str]]:
    """The modules that each module of a package imports from it; an __init__ has the name of its package."""
    paths = {}
    for path in sorted(PACKAGES[name].rglob("*.py")):
        parts = path.relative_to(PACKAGES[name]).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    found: dict[str, set[str]] = {"_core": set()}
    for module, path in paths.items():
        is_package = path.stem == "__init__"
        texts = [each.read_text(encoding="utf-8") for each in (path, path.with_suffix(".pyi")) if each.exists()]
        known = {"_core", *paths} if name == "fracgyro" else set(paths)
        found[module] = set().union(*(imported_of(text, module, is_package, known, name) for text in texts))
    return found


def imported_of(text: str, module: str, is_package: bool, known: set[str], package: str = "fracgyro") -> set[str]:
    """Wherever an import stands: in a function and under TYPE_CHECKING, too."""
    found = set()
    here = module.split(".") if module else []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = [alias.name.partition(f"{package}.") for alias in node.names]
            found |= {rest for before, own, rest in names if own and not before}
            continue
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level:
            base = here[: len(here) - node.level + is_package]
        elif str(node.module).partition(".")[0] == package:
            base = []
        else:
            continue
        inner = str(node.module or "").removeprefix(package).removeprefix(".") if not node.level else node.module
        target = ".".join([*base, *([inner] if inner else [])])
        for alias in node.names:
            deeper = f"{target}.{alias.name}" if target else alias.name
            found.add(deeper if deeper in known else target)
    return found


def arrows(place: str) -> set[tuple[str, str]]:
    """(room, room that it imports) for each import within a package or within a room."""
    name, _, room = place.partition(".")
    inside = f"{room}." if room else ""
    found = set()
    for module, targets in package(name).items():
        for target in targets:
            if all(f"{each}.".startswith(inside) for each in (module, target)):
                mine, theirs = (f"{each}.".removeprefix(inside).partition(".")[0] for each in (module, target))
                found.add((mine, theirs))
    return found


def circle(modules: Mapping[str, set[str]]) -> list[str]:
    """Modules of which each imports the one before it; none if there are no such."""
    try:
        TopologicalSorter(modules).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_imports_are_seen_wherever_they_stand() -> None:
    text = """
from __future__ import annotations
import numpy
import fracgyro.files
from fracgyro import arguments
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from . import charts
def late():
    from ..scenario.table import Table
    from .. import metrics
"""
    known = {"files", "arguments", "rate", "rate.charts", "scenario.table"}
    found = imported_of(text, "rate.report", False, known)
    assert found == {"files", "arguments", "rate.charts", "scenario.table", ""}  # metrics is a name of the package
    assert imported_of("from .run import sweep", "study.sweep", True, {"study.sweep.run"}) == {"study.sweep.run"}
    assert imported_of("from .allan import a", "rate.bound", False, {"rate.allan"}) == {"rate.allan"}


def test_no_modules_of_a_package_import_one_another_in_a_circle() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    modules = package("fracgyro")
    assert "analysis.metrics" in modules["cli.simulate"], "the imports are not read"
    assert "study.sweep.run" in modules["study"], "the stubs are not read"
    assert "comparison.run" in package("fracgyro_lab")["comparison"]
    assert [circle(package(name)) for name in PACKAGES] == [[] for _ in PACKAGES]


@pytest.mark.parametrize("place", ROOMS)
def test_rooms_import_only_rooms_below(place: str) -> None:
    floor = {room: level for level, line in enumerate(ROOMS[place]) for room in line}
    found = sorted(arrows(place))
    assert {room for arrow in found for room in arrow} == floor.keys()
    assert [(mine, theirs) for mine, theirs in found if mine != theirs and floor[theirs] >= floor[mine]] == []


SCRIPTS = [
    path
    for folder in ("benchmarks", "fpga/benchmarks", "lab", "lab/article")
    for path in sorted((ROOT / folder).glob("*.py"))
]


@pytest.mark.parametrize("path", SCRIPTS, ids=name)
def test_a_script_imports_what_the_packages_have(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] in PACKAGES:
            module = importlib.import_module(str(node.module))
            for alias in node.names:
                there = hasattr(module, alias.name) or find_spec(f"{node.module}.{alias.name}")
                assert there, f"{node.module} has no {alias.name}"


def test_the_version_is_typed_once() -> None:
    version = re.search(r'^version = "([^"]+)"', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert version
    code_files = [
        ROOT / "CMakeLists.txt",
        ROOT / "Makefile",
        *(p for at in PACKAGES.values() for p in sorted(at.rglob("*.py"))),
    ]
    code_files += [path for folder in ("include", "bindings") for path in sources(folder)]
    for path in code_files:
        assert version[1] not in path.read_text(encoding="utf-8"), name(path)
    assert not re.search(r"project\([^)]*\bVERSION\b", (ROOT / "CMakeLists.txt").read_text())
