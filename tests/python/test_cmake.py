"""fracgyro in a CMake project: the example built with the installed package, and from source."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from children import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "cpp"


def cmake(*words: str | Path) -> str:
    program = shutil.which("cmake", path=str(Path(sys.executable).parent)) or "cmake"
    ran = subprocess.run([program, *words], capture_output=True, text=True, timeout=PATIENCE)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def built(source: Path, build: Path, *options: str) -> Path:
    cmake("-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=Release", *options)
    cmake("--build", build)
    return build / "closed_loop"


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The prefix that fracgyro was installed to."""
    folder = tmp_path_factory.mktemp("package")
    cmake("-S", ROOT, "-B", folder / "build")
    cmake("--install", folder / "build", "--prefix", folder / "prefix")
    return folder / "prefix"


@pytest.fixture(scope="module")
def from_source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(EXAMPLE, tmp_path_factory.mktemp("source"), "-DCMAKE_DISABLE_FIND_PACKAGE_fracgyro=ON")


@pytest.fixture(scope="module")
def simulated() -> str:
    """Expected output of the example, from `fracgyro simulate`."""
    command = [sys.executable, "-m", "fracgyro", "simulate", "--json"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE)
    rmse = json.loads(ran.stdout)["rmse"]["whole"]
    return f"RMSE: x {rmse['x']:.9g}, y {rmse['y']:.9g}\n"


def output(program: Path) -> str:
    return subprocess.run([program], capture_output=True, text=True, check=True, timeout=PATIENCE).stdout


def test_the_example_finds_the_installed_package(package: Path, simulated: str, tmp_path: Path) -> None:
    program = built(EXAMPLE, tmp_path, f"-DCMAKE_PREFIX_PATH={package}")
    assert not (tmp_path / "_deps").exists(), "it was built from source"
    assert output(program) == simulated


def test_the_project_of_the_readme_finds_the_installed_package(package: Path, simulated: str, tmp_path: Path) -> None:
    (block,) = re.findall(r"^```cmake\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL | re.M)
    head = "cmake_minimum_required(VERSION 3.20)\nproject(readme LANGUAGES CXX)\n"
    (tmp_path / "CMakeLists.txt").write_text(head + block, encoding="utf-8")
    shutil.copy(EXAMPLE / "main.cpp", tmp_path)
    assert output(built(tmp_path, tmp_path / "build", f"-DCMAKE_PREFIX_PATH={package}")) == simulated


def test_the_example_builds_from_source(from_source: Path, simulated: str) -> None:
    assert output(from_source) == simulated


def test_a_project_that_includes_fracgyro_does_not_install_it(from_source: Path, tmp_path: Path) -> None:
    cmake("--install", from_source.parent, "--prefix", tmp_path / "prefix")
    assert not (tmp_path / "prefix").exists()


def test_the_package_has_every_header_once_and_the_version_of_the_project(package: Path) -> None:
    folders = ROOT / "include", package / "include"
    kept, installed = (sorted(path.relative_to(of) for path in of.rglob("*.hpp")) for of in folders)
    assert installed == kept
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    (file,) = package.rglob("fracgyro-config-version.cmake")
    assert f'set(PACKAGE_VERSION "{version}")' in file.read_text(encoding="utf-8")
