"""The documents match the package: defaults and units are its own, examples and commands run."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import click
import fracgyro as fg
import matplotlib
import pytest
from fracgyro.cli import cli
from fracgyro.export.compilers import system_compiler
from fracgyro.scenario import reference
from fracgyro.scenario.schema import ERRATA_SWITCHES
from fracgyro.scenario.table import toml_value
from fracgyro.study import reference as study_reference
from nightly import nightly_unless
from test_text import DOCUMENTS, ROOT, relative


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(text: str, language: str) -> list[str]:
    """The contents of every block fenced as ```language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


# -- EQUATIONS.md --------------------------------------------------------------------------------------------


def rows() -> Iterator[list[str]]:
    """The cells of every row of the tables of parameters."""
    for row in re.findall(r"^\|(.*)\|$", read("EQUATIONS.md"), re.MULTILINE):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)]
        if len(cells) == 6 and re.fullmatch(r"`[a-z]+\.[a-z_]+`", cells[3]):
            yield cells


def parameters() -> Iterator[tuple[str, str]]:
    """(field, default) of each."""
    for _, _, _, field, default, _ in rows():
        yield field.strip("`"), default.strip("`")


def units() -> Iterator[tuple[str, str]]:
    for _, unit, _, field, _, _ in rows():
        yield field.strip("`"), unit


@pytest.mark.parametrize(("field", "default"), list(parameters()))
def test_every_default_of_the_equations_is_that_of_the_scenario(field: str, default: str) -> None:
    table, name = field.split(".")
    value = getattr(getattr(fg.Scenario(), table), name)
    assert default == ("–" if value is None else toml_value(value))


def test_the_equations_list_every_physical_parameter_and_every_switch() -> None:
    fields = {
        f"{table}.{name}"
        for table, model in fg.Scenario()
        for name in type(model).model_fields
        if f"{table}.{name}" not in {"run.record_every", "run.units"}  # bookkeeping
    }
    assert {field for field, _ in parameters()} == fields
    errata = read("EQUATIONS.md").split("## Printed and corrected")[1]
    for switch in ERRATA_SWITCHES:
        assert f"| `{switch}` |" in errata


def test_every_unit_of_the_equations_is_that_of_the_scenario() -> None:
    signs = {
        "unit ": "",
        "ω": "omega",
        "α": "alpha",
        "γ": "gamma",
        "μ": "mu",
        "ν": "nu",
        "ρ": "rho",
        "−": "-",
        "²": "^2",
        "³": "^3",
        "√Hz": "sqrt(Hz)",
        "√s": "sqrt(s)",
        " ": "*",
    }
    schema = fg.Scenario.model_json_schema()["$defs"]
    for field, listed in units():
        table, name = field.split(".")
        unit = schema[table.capitalize()]["properties"][name].get("unit", "–").replace(" ", "*")
        for sign, word in signs.items():
            listed = listed.replace(sign, word)
        assert listed == unit, field


def test_the_reference_is_what_the_core_and_the_tables_say() -> None:
    assert read("docs/reference.md") == reference.page(), "make it again, as its first lines say"


def test_the_reference_of_study_files_is_what_their_models_say() -> None:
    assert read("docs/study_files.md") == study_reference.page(), "make it again, as its first lines say"


# -- Examples ------------------------------------------------------------------------------------------------


# test_experiments.py runs the examples of docs/experiments.md, one by one.
GUIDES = [ROOT / "README.md", *sorted(set((ROOT / "docs").glob("*.md")) - {ROOT / "docs/experiments.md"})]


# Identification takes twelve seconds, and has tests of its own.
RUN = [path for path in GUIDES if "```python" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", nightly_unless(lambda path: path.name != "identify.md", RUN), ids=relative)
def test_the_python_of_a_guide_runs(path: Path, tmp_path: Path) -> None:
    if library := {"control.md": "control", "gymnasium.md": "gymnasium"}.get(path.name):
        pytest.importorskip(library, reason=f"{library}, which the extra interop brings, is not installed")
    code = "\n".join(blocks(path.read_text(encoding="utf-8"), "python"))
    for law in blocks(path.read_text(encoding="utf-8"), "c"):  # in C that is C++, too
        (tmp_path / "law.cpp").write_text(f'extern "C" {{\n{law}}}\n', encoding="utf-8")
        headers = f"-I{fg.native.INCLUDE}"
        system_compiler("-O2", "-shared", "-fPIC", headers, tmp_path / "law.cpp", "-o", tmp_path / "law.so")
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-W", "default::DeprecationWarning", "-c", code],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr


def commands() -> list[str]:
    """Every line of a shell block that starts with `fracgyro`."""
    texts = (path.read_text(encoding="utf-8") for path in DOCUMENTS)
    lines = (line for text in texts for block in blocks(text, "sh") for line in block.splitlines())
    return sorted({line for line in lines if line.startswith("fracgyro ")})


@pytest.mark.parametrize("line", commands())
def test_every_command_of_the_documents_is_one(line: str) -> None:
    words = shlex.split(line, comments=True)[1:]
    words = list(takewhile(lambda word: word not in (">", "|"), words))
    group: click.Command = cli
    while isinstance(group, click.Group) and (words or not group.invoke_without_command):
        name, command, words = group.resolve_command(click.Context(group), words)
        assert command is not None, name
        group = command
    group.make_context(line, words)


def test_the_readme_is_short_and_shows_python() -> None:
    assert len(read("README.md").split()) < 900
    assert blocks(read("README.md"), "python")


@pytest.mark.parametrize(("script", "picture"), [("readme_picture", "run"), ("front_picture", "compare")])
def test_a_picture_is_what_its_script_draws(script: str, picture: str, tmp_path: Path) -> None:
    """The same elements with the same numbers, rounded to 0.1 pt; another Matplotlib may draw it otherwise."""
    committed = read(f"docs/{picture}.svg")
    if f"Matplotlib v{matplotlib.__version__} " not in committed:
        pytest.skip(f"docs/{picture}.svg was drawn by another Matplotlib than {matplotlib.__version__}")
    line = f"import sys; from pathlib import Path; import {script}; {script}.draw(Path(sys.argv[1]))"
    again = tmp_path / "again.svg"
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "benchmarks")}
    subprocess.run([sys.executable, "-c", line, again], env=environment, check=True)
    number = r"(?<![\w#.])-?\d+(?:\.\d+)?"
    drawn, committed = (
        re.sub(r"[mp][0-9a-f]{10}", "", text) for text in (again.read_text(encoding="utf-8"), committed)
    )
    assert re.sub(number, "0", drawn) == re.sub(number, "0", committed)
    of_committed = [float(each) for each in re.findall(number, committed)]
    assert [float(each) for each in re.findall(number, drawn)] == pytest.approx(
        of_committed, abs=0.11
    )  # rounded to 0.1 pt
